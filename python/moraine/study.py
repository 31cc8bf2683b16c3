"""A study: the runs that ./moraine reproduce makes of a directory in cases/ that holds a study.toml, and where they lie.

study.toml names the cases of the study, directories beside it, each once for each seed:

    title = "..."                 of its report
    report = "paper"              which report (moraine.report)
    seeds = 3                     how many packings, where --seeds does not say

    [[case]]
    name = "settle"               the directory; what stands in its case.toml is taken over

    [[case]]
    name = "shear"
    start = "settle"              the case it starts from; what another case starts from is called a bed
    lists = { normal_stress = "10,20 kPa" }   one run for each value, or combination, by `moraine sweep`
    quick = { "grains.count" = "500" }        what --quick changes in this case; or false, which leaves it out

    [quick]                       what --quick changes
    seeds = 2
    set = { "grains.count" = "1000" }
    lists = { normal_stress = "20 kPa," }

They lie in

    runs/NAME/seed-S/settle
    runs/NAME/seed-S/shear/sweep/normal_stress-20kPa

NAME is the preset or quick, with what was set besides: fast+mass-64_kg. Such a variant starts from the beds of the study without, unless
what is set concerns those: grains, box, or one of their stages.
"""
from dataclasses import dataclass, field
from pathlib import Path
import functools
import json
import os
import re
import sys
import tomllib

from .results import MissingData

of_beds = ("grains.", "box.")   # keys that concern a bed wherever they are set


@dataclass(frozen=True)
class Part:
    """One of the cases of a study."""
    name: str
    start: str = ""                             # name of another one
    lists: dict = field(default_factory=dict)   # KEY: "VALUE,VALUE unit"
    stages: tuple = ()                          # names of the stages it runs
    quick: dict = field(default_factory=dict)   # KEY: VALUE with --quick

    @property
    def count(self):
        """Of runs for one seed."""
        product = 1
        for values in self.lists.values():
            product *= len([v for v in values.split(",") if v.strip()])
        return product


@functools.cache
def stages_of(directory):
    """Names of the stages that the case in this directory runs, with what it takes over from others."""
    file = directory / "case.toml"
    try:
        case = tomllib.loads(file.read_text())
    except (OSError, tomllib.TOMLDecodeError) as why:
        raise MissingData(f"{file}: {why}") from None
    if case.get("stages"):
        return tuple(case["stages"])
    before = stages_of((directory / case["extends"]).resolve()) if case.get("extends") else ()
    own = [s["name"] for s in case.get("stage", []) if "name" in s]
    return before + tuple(name for name in own if name not in before)


def read(home):
    """study.toml of a directory; errors name the file and what would be right."""
    file = Path(home) / "study.toml"
    try:
        what = tomllib.loads(file.read_text())
    except FileNotFoundError:
        raise MissingData(f"there is no {file}") from None
    except tomllib.TOMLDecodeError as why:
        raise MissingData(f"{file}: {why}") from None

    def expect(fulfilled, key, wanted):
        if not fulfilled:
            raise MissingData(f"{file}: {key}: expected {wanted}")

    known = {"title": (str, "a text"), "report": (str, "a text"), "seeds": (int, "a number"), "case": (list, "tables [[case]]"), "quick": (dict, "a table")}
    for key, value in what.items():
        expect(key in known, key, f"one of {', '.join(known)}")
        expect(isinstance(value, known[key][0]), key, known[key][1])
    expect(what.get("title"), "title", "a text")
    expect(what.get("case"), "case", "at least one [[case]]")
    for case in what["case"]:
        expect(isinstance(case.get("quick", {}), dict) or case["quick"] is False, "case.quick", "a table of keys and values, or false")
    for table in (what.get("quick", {}), *what["case"]):
        for key, value in {**table.get("lists", {}), **table.get("set", {}), **(table.get("quick") or {})}.items():
            expect(isinstance(value, str), key, "a text, as --set takes it")
    names = []
    for case in what["case"]:
        expect(not case.keys() - {"name", "start", "lists", "quick"}, "case", "name, start, lists and quick")
        expect(case.get("name") and (Path(home) / case["name"] / "case.toml").exists(), f"case.name = {case.get('name')}",
               "a directory beside it, with a case.toml")
        expect(case["name"] not in names, f"case.name = {case['name']}", "each case once")
        expect(case.get("start", "") in ("", *names), f"case.start = {case.get('start')}", "a case above it")
        if case.get("start"):
            left_out = next(c for c in what["case"] if c.get("name") == case["start"]).get("quick") is False
            expect(not left_out or case.get("quick") is False, f"case.quick = false: {case['start']}", f"false in {case['name']}, which starts from it, too")
        names.append(case["name"])
    return what


@dataclass
class Study:
    home: str = "."                                 # directory of study.toml
    preset: str = "fast"
    seeds: list = field(default_factory=list)       # empty: as study.toml has it
    quick: bool = False
    settings: dict = field(default_factory=dict)    # KEY: VALUE besides what study.toml has
    lists: dict = field(default_factory=dict)       # KEY: VALUES in place of what study.toml has
    settled: str = ""                               # name of the study whose beds are used; empty: see above
    results: str = ""
    moraine: str = "../../moraine"
    python: str = sys.executable    # one that has what `moraine report` imports; Snakemake's own may not
    gpu: bool = False
    step: str = ""                  # program that runs a command as a step of a job; set where jobs go to a cluster

    def __post_init__(self):
        what = read(self.home)
        quick = what.get("quick", {}) if self.quick else {}
        self.title, self.report = what["title"], what.get("report", "paper")
        self.quick_settings = quick.get("set", {})
        if not self.seeds:
            self.seeds = list(range(1, quick.get("seeds", what.get("seeds", 1)) + 1))
        what["case"] = [case for case in what["case"] if not (self.quick and case.get("quick") is False)]
        other = quick.get("lists", {}) | self.lists  # instead of those of each case
        self.parts = {case["name"]: Part(case["name"], case.get("start", ""), {k: other.get(k, v) for k, v in case.get("lists", {}).items()},
                                         stages_of((Path(self.home) / case["name"]).resolve()),
                                         (case.get("quick") or {}) if self.quick else {}) for case in what["case"]}
        for key in self.lists:
            if not any(key in part.lists for part in self.parts.values()):
                raise MissingData(f"{key} is not a list of {Path(self.home) / 'study.toml'}")

    @property
    def beds(self):
        """The cases that others start from."""
        return {part.start for part in self.parts.values()} - {""}

    def concerns_bed(self, key):
        return key.startswith(of_beds) or any(self.concerns(key, self.parts[bed]) for bed in self.beds if key.startswith("stage."))

    @staticmethod
    def concerns(key, part):
        """All but keys of stages that are not its own."""
        return not key.startswith("stage.") or key.split(".")[1] in part.stages

    @property
    def base(self):
        return ("quick" if self.preset == "fast" else f"quick-{self.preset}") if self.quick else self.preset

    @property
    def name(self):
        return "+".join([self.base] + variant_names(self.settings))

    @property
    def bed(self):
        """Name of the study whose beds are used."""
        return self.settled or (self.name if any(map(self.concerns_bed, self.settings)) else self.base)

    def of_case(self, name):
        """Name of the study that the case belongs to."""
        return self.bed if name in self.beds else self.name

    def directory(self, name, seed):
        return Path("runs") / self.of_case(name) / f"seed-{seed}" / name

    def done(self, name, seed):
        """The file that says that all runs of a case have finished, for these values of its lists."""
        values = "+".join([name, *(f"{key.rpartition('.')[2]}-{safe(text)}" for key, text in self.parts[name].lists.items())])
        return f"{self.directory(name, seed).parent}/{values}.done"

    def log(self, name, seed):
        """Where a job on a cluster writes, beside the file that says it has finished. For Snakemake a parameter, not a log, which the
        job would begin by removing."""
        return self.done(name, seed).removesuffix(".done") + ".log"

    def report_log(self):
        return f"runs/{self.name}/report.log"

    def start(self, name, seed):
        """Of these files a case needs the first, if any."""
        start = self.parts[name].start
        return [self.done(start, seed)] if start and not (self.settled and start in self.beds) else []

    def wanted(self, seed):
        """The cases to be run."""
        return [name for name in self.parts if not (self.settled and name in self.beds)]

    def all_done(self):
        return [self.done(name, seed) for seed in self.seeds for name in self.wanted(seed)]

    def threads(self, name):
        return 1 if self.gpu else self.parts[name].count

    def command(self, name, seed, threads):
        """Words of the command that computes what is missing of a case."""
        lists = self.parts[name].lists
        sets = [word for key, text in lists.items() for word in ("--set", f"{key}={text}")]
        return [*filter(None, [self.step]), self.moraine, "sweep" if lists else "run", str(self.directory(name, seed)), *sets, "--resume", "--threads", str(threads),
                "--backend", "cuda" if self.gpu else "cpu"]

    def report_command(self):
        # What people have to say about the study of this name stands beside study.toml.
        notes = f"notes-{self.name}.md"
        return [self.python, "-m", "moraine", "report", f"runs/{self.name}", "--output", self.results,
                *(["--notes", notes] if (Path(self.home) / notes).exists() else [])]

    @classmethod
    def from_config(cls, config):
        """From Snakemake's configuration: any of the fields above, by their names."""
        study = cls(**{k: v for k, v in config.items() if k in cls.__annotations__})
        study.results = study.results or f"runs/{study.name}/results"
        return study

    def write_config(self):
        """runs/NAME/study.json, for snakemake --configfile; relative to `home`, where Snakemake runs."""
        file = Path("runs") / self.name / "study.json"
        (self.home / file).parent.mkdir(parents=True, exist_ok=True)
        fields = {k: v for k, v in self.__dict__.items() if k in self.__annotations__} | {"home": "."}
        (self.home / file).write_text(json.dumps(fields, indent=1) + "\n")
        return file

    def write_cases(self):
        """The case.toml of each case, before anything runs. Those that are there stay; another one in its place is an error."""
        for directory, text in self.case_files():
            file = Path(self.home) / directory / "case.toml"
            if not file.exists():
                file.parent.mkdir(parents=True, exist_ok=True)
                file.write_text(text)
            elif file.read_text() != text:
                raise SystemExit(f"moraine: {file} is not that of this study; move the folder away, or remove it, and try again")

    def case_files(self):
        """(directory, text of case.toml) of each case."""
        for seed in self.seeds:
            for name in self.wanted(seed):
                yield self.directory(name, seed), self._text(self.parts[name], seed)

    def _text(self, part, seed):
        own = self.settings.items()
        if part.name in self.beds and self.bed != self.name:
            own = []  # the beds of the study without
        elif part.name in self.beds:
            own = [(k, v) for k, v in own if self.concerns_bed(k)]
        tables = {"model.preset": json.dumps(self.preset), "grains.seed": str(seed)}
        tables |= {k: toml(v) for k, v in (*self.quick_settings.items(), *part.quick.items(), *own) if self.concerns(k, part)}
        text = f'extends = "../../../../{part.name}"\n'
        if part.start:
            start = os.path.relpath(self.directory(part.start, seed), self.directory(part.name, seed))
            text += f'start = "{start}"\n'
        by_table = {}
        for key, value in tables.items():
            table, _, leaf = key.rpartition(".")
            by_table.setdefault(table, []).append(f"{leaf} = {value}\n")
        for table, lines in by_table.items():
            stage = table.startswith("stage.")
            text += f"\n[[stage]]\nname = \"{table[6:]}\"\n" if stage else f"\n[{table}]\n" if table else "\n"
            text += "".join(lines)
        return text


def safe(text):
    """For names of files."""
    return re.sub(r"[^A-Za-z0-9.-]+", "_", text.rstrip(", "))


def variant_names(settings):
    """mass-64_kg, shear.duration-2_s: the last word of the key, with its stage, or its table where two keys have the same last word."""
    last = [key.rpartition(".")[2] for key in settings]

    def name(key, word):
        return key.removeprefix("stage.") if key.startswith("stage.") or last.count(word) > 1 else word
    return [f"{name(key, word)}-{safe(value)}" for word, (key, value) in zip(last, settings.items())]


def toml(value):
    """A number or a truth value as it is, all else as a text."""
    try:
        number = repr(float(value))
    except ValueError:
        return value if value in ("true", "false") else json.dumps(value)
    return value if re.fullmatch(r"[-+]?(0|[1-9]\d*)(\.\d+)?([eE][-+]?\d+)?", value) else number  # TOML knows no .5 and no 1.
