"""The study of cases/paper-2013: which runs there are and where they lie. Its Snakefile and `./moraine reproduce` share this.

    runs/NAME/seed-S/settle                            grains settled at random
    runs/NAME/seed-S/shear/sweep/normal_stress-80kPa   consolidated and sheared

NAME is the preset or quick, with what was set besides: fast+mass-64_kg. Such a variant starts from the bed that fast has
settled, unless what is set concerns that bed (grains, box, the stage settle).
"""
from dataclasses import dataclass, field
from pathlib import Path
import json
import os
import re
import sys

quick_bed = {"grains.count": "1000", "grains.columns_x": "4", "grains.columns_y": "4"}
stresses = "10,20,40,60,80,120 kPa"


def stress_names(text):
    """"10,20 kPa" -> ["10kPa", "20kPa"], as `moraine sweep` names them."""
    parts = [re.sub(r"(?<=\d) (?=\d{3}\b)", "", p.strip()) for p in text.rstrip(", ").split(",")]
    unit = re.sub(r"^[-+0-9.eE]+", "", parts[-1]).strip()
    return [re.sub(r"\s+", "", p) if re.search(r"[a-zA-Z]$", p) else p + unit for p in parts]


def variant_names(settings):
    """mass-64_kg, shear.duration-2_s: the last word of the key, with its stage, or its table where two keys have the same last word."""
    last = [key.rpartition(".")[2] for key in settings]
    def name(key, word):
        return key.removeprefix("stage.") if key.startswith("stage.") or last.count(word) > 1 else word
    return [f"{name(key, word)}-{re.sub(r'[^A-Za-z0-9.-]+', '_', value)}" for word, (key, value) in zip(last, settings.items())]


def concerns_bed(key):
    return key.startswith(("grains.", "box.", "stage.settle."))


@dataclass
class Study:
    preset: str = "fast"
    seeds: list = field(default_factory=lambda: [1, 2, 3])
    stress_list: str = stresses
    quick: bool = False
    settings: dict = field(default_factory=dict)    # KEY: VALUE besides the normal stress
    settled: str = ""                               # name of the study whose settled beds are used; empty: see above
    results: str = ""
    moraine: str = "../../moraine"
    python: str = sys.executable    # one that has what `moraine report` imports; Snakemake's own may not
    gpu: bool = False

    @property
    def base(self):
        return ("quick" if self.preset == "fast" else f"quick-{self.preset}") if self.quick else self.preset

    @property
    def name(self):
        return "+".join([self.base] + variant_names(self.settings))

    @property
    def bed(self):
        """Name of the study whose settled grains are sheared."""
        return self.settled or (self.name if any(map(concerns_bed, self.settings)) else self.base)

    @property
    def stress_names(self):
        return stress_names(self.stress_list)

    @property
    def shear_threads(self):
        return 1 if self.gpu else len(self.stress_names)

    @property
    def backend(self):
        return "--backend cuda" if self.gpu else "--backend cpu"

    @property
    def notes(self):
        """What people have to say about the study of this name, for its report: notes-NAME.md beside the Snakefile."""
        return f"--notes notes-{self.name}.md" if Path(f"notes-{self.name}.md").exists() else ""

    @classmethod
    def from_config(cls, config):
        """From Snakemake's configuration: any of the fields above, by their names."""
        study = cls(**{k: v for k, v in config.items() if k in cls.__annotations__})
        study.results = study.results or f"runs/{study.name}/results"
        return study

    def write_config(self, home):
        """runs/NAME/study.json, for snakemake --configfile; relative to `home`."""
        file = Path("runs") / self.name / "study.json"
        (home / file).parent.mkdir(parents=True, exist_ok=True)
        (home / file).write_text(json.dumps(self.__dict__, indent=1) + "\n")
        return file

    def write_cases(self, home="."):
        """The case.toml of each case, before anything runs. Those that are there stay; another one in its place is an error."""
        for directory, text in self.case_files():
            file = Path(home) / directory / "case.toml"
            if not file.exists():
                file.parent.mkdir(parents=True, exist_ok=True)
                file.write_text(text)
            elif file.read_text() != text:
                raise SystemExit(f"moraine: {file} is not that of this study; move the folder away, or remove it, and try again")

    def case_files(self):
        """(directory, text of case.toml) of each case."""
        for seed in self.seeds:
            here = Path("runs") / self.name / f"seed-{seed}"
            if not self.settled:
                own = {k: v for k, v in self.settings.items() if concerns_bed(k)}
                yield Path("runs") / self.bed / f"seed-{seed}" / "settle", self._text("settle", seed, own)
            start = os.path.relpath(Path("runs") / self.bed / f"seed-{seed}" / "settle", here / "shear")
            rest = {k: v for k, v in self.settings.items() if not k.startswith("stage.settle.")}
            yield here / "shear", self._text("shear", seed, rest, f'start = "{start}"\n')

    def _text(self, what, seed, settings, more=""):
        tables = {"model.preset": json.dumps(self.preset), "grains.seed": str(seed)}
        tables |= {k: toml(v) for k, v in ((quick_bed if self.quick else {}) | settings).items()}
        text = f'extends = "../../../../{what}"\n{more}'
        by_table = {}
        for key, value in tables.items():
            table, _, leaf = key.rpartition(".")
            by_table.setdefault(table, []).append(f"{leaf} = {value}\n")
        for table, lines in by_table.items():
            stage = table.startswith("stage.")
            text += f"\n[[stage]]\nname = \"{table[6:]}\"\n" if stage else f"\n[{table}]\n" if table else "\n"
            text += "".join(lines)
        return text


def toml(value):
    """A number or a truth value as it is, all else as a text."""
    try:
        number = repr(float(value))
    except ValueError:
        return value if value in ("true", "false") else json.dumps(value)
    return value if re.fullmatch(r"[-+]?(0|[1-9]\d*)(\.\d+)?([eE][-+]?\d+)?", value) else number  # TOML knows no .5 and no 1.
