"""What the manual takes from the program and the package: tables of keys and columns, the help of commands, lists of modules, figures.

Each function makes Markdown. No Sphinx here, so that tests can ask without it.
"""
import ast
import json
import os
import re
import subprocess
import sys
from functools import lru_cache
from pathlib import Path

root = Path(__file__).resolve().parents[3]
if str(root / "python") not in sys.path:
    sys.path.insert(0, str(root / "python"))


def program():
    """The program that says what its keys are: MORAINE_PROGRAM, or the one in build/."""
    path = Path(os.environ.get("MORAINE_PROGRAM") or root / "build/moraine")
    if not path.exists():
        raise RuntimeError(f"{path} is not there, and the manual takes its tables from it; ./moraine docs builds it first, "
                             "or set MORAINE_PROGRAM")
    return str(path)


@lru_cache
def output_of(*command):
    done = subprocess.run(command, capture_output=True, text=True, cwd=root,
                          env={**os.environ, "COLUMNS": "100", "PYTHONPATH": str(root / "python")})
    if done.returncode:
        raise RuntimeError(f"{' '.join(command)} failed: {done.stderr.strip()}")
    return done.stdout


def tables():
    return json.loads(output_of(program(), "keys", "--format", "json"))


def code(text):
    """As code, also within a table."""
    return f"`{text}`".replace("|", r"\|") if text else ""


about_tables = {  # what a table of case.toml is about
    "": "At the top of the file, before the first table.",
    "box": "The space of the bed, its sides and its floor.",
    "grains": "How many grains, how large, of what, and where they begin.",
    "contact": "What acts between two grains that touch.",
    "wall": "What acts between a grain and a wall, and the top wall itself.",
    "model": "Gravity, time step and what makes a run faster or more exact.",
    "fluid": "Pore water.",
    "material": "A kind of grains. A case may have four; each begins with `[[material]]`.",
    "pair": "What acts between grains of two materials. Each begins with `[[pair]]`.",
    "stage": "One stage of the experiment. They run in the order in which they stand; each begins with `[[stage]]`. "
             "Where kinds of stages are named, the key belongs to these alone.",
    "output": "How often what is written.",
    "guards": "When a run stops because it has gone wrong.",
}


def keys():
    lines, table = [], None
    for key in tables()["keys"]:
        name = key["name"]
        head, _, leaf = name.rpartition(".")
        if head != table:
            table = head
            title = "At the top" if not head else f"`[[{head}]]`" if head in ("stage", "material", "pair") else f"`[{head}]`"
            lines += ["", f"(keys-{head or 'top'})=", f"## {title}", "", about_tables[head], ""]
        unit = "" if key["unit"] in ("", "1") else " " + key["unit"]
        default = key["default"]
        facts = ["must be given" if default == "(required)"
                 else f"default {reference_to(default)}" if re.fullmatch(r"[a-z]+\.[\w.]+", default)
                 else f"default `{default}`{unit}" if default else ""]
        if key["accepts"]:
            facts.append("one of " + ", ".join(f"`{word}`" for word in key["accepts"].split(" | "))
                         if key["type"] == "choice" else f"accepts `{key['accepts']}`{unit if '`' not in unit else ''}")
        if key["kinds"]:
            facts.append("stages of kind " + ", ".join(f"`{kind}`" for kind in key["kinds"].split(", ")))
        kind = {"number": "a number" + (f" in{unit}" if unit else ""), "integer": "a whole number", "boolean": "true or false",
                "text": "a text", "choice": "a word", "path": "a path", "list": "a list",
                "load": f"a number in{unit} or [a history](#a-load-that-changes)"}[key["type"]]
        meaning = linked(escaped(key["meaning"].replace("; or a history, see below", "").replace("; see below", "; see [presets](#presets)")), name)
        lines += [f"```{{key}} {name}", f"{meaning[:1].upper() + meaning[1:]}.", "",
                  "; ".join([kind[:1].upper() + kind[1:], *filter(None, facts)]) + ".", "```", ""]
    return "\n".join(lines)


def reference_to(name):
    return f"that of {{key}}`{name}`"


def escaped(text):
    """Plain words of the program, as Markdown shows them unchanged."""
    return re.sub(r"([\\*_$<>\[\]{}^|#])", r"\\\1", text)


def linked(text, own):
    """Other keys that a meaning names by their full names become links."""
    names = {key["name"] for key in tables()["keys"]}
    return re.sub(r"\b[a-z]+\.[a-z_\\]+\b", lambda m: f"{{key}}`{plain}`" if (plain := m[0].replace("\\", "")) in names and plain != own else m[0], text)


def series():
    lines = ["| column | unit | what | only with |", "|---|---|---|---|"]
    for c in tables()["series"]:
        lines.append(f"| {code(c['name'])} | {c['unit']} | {escaped(c['meaning'])} | {c['needs']} |")
    return "\n".join(lines)


def below_the_list(begin, end):
    """A paragraph of `moraine keys`, word for word."""
    text = output_of(program(), "keys")
    start = text.index(begin)
    return "```text\n" + text[start:text.index(end, start) if end in text[start:] else len(text)].strip() + "\n```"


def help_of(command):
    from moraine.__main__ import commands
    if command in commands:
        text = output_of(sys.executable, "-m", "moraine", command, "--help")
    else:
        text = output_of(program(), command, "--help")
    return "```{code-block} text\n:class: help\n" + text.strip().replace(str(root) + "/", "") + "\n```"


# Commands, in the order of the page: what each is for, and an example. One that a version does not have is left out.
about_commands = {
    "check": (
        'Says what would run, without running it: grains, memory, and for each stage time step, regime and run time. Begin with it.',
        'moraine check cases/quick-shear\nmoraine check cases/quick-shear --set normal_stress=80kPa'),
    "run": (
        'Runs a case. Results go to `CASE/output`; those that are there already are not touched without `--resume` or `--force`. How: [Run a case](../how-to/runs.md), [Go on after an interruption](../how-to/restart.md).',
        'moraine run cases/quick-shear\nmoraine run cases/quick-shear --resume'),
    "sweep": (
        'Runs a case with each value of a list, several at once. Results go to `CASE/sweep`. How: [Run several cases at once](../how-to/sweeps.md).',
        'moraine sweep cases/quick-shear --set normal_stress=10,20,40kPa'),
    "replay": (
        'Computes a case anew with the loads that were changed from outside, in `CASE/replay`, and says whether all bits are the same. It takes no `--set`. How: [Steer a run](../how-to/notebooks.md).',
        'moraine replay my-bed'),
    "keys": (
        'Lists all keys of `case.toml`, or those with all of some words in name or meaning. `--format json` prints this list and the columns of `series.h5` for programs.',
        'moraine keys\nmoraine keys wall\nmoraine keys --format json'),
    "bench": (
        'Times some steps of a case without output, and prints one line of JSON.',
        'moraine bench cases/quick-shear --steps 10000 --stage settle'),
    "export": (
        'Writes the grains of a case as others read them. How: [Write grains](../how-to/own-grains.md#write-grains).',
        'moraine export cases/quick-shear --output grains.csv\nmoraine export cases/quick-shear --format vtk --output grains.vtk'),
    "import-sphere": (
        'Makes a case from a binary file of the program `sphere`, box and parameters included.',
        'moraine import-sphere bed.bin my-bed'),
    "watch": (
        'Follows a case while it runs, in the terminal and in a picture. How: [Watch a run](../how-to/watch.md).',
        'moraine watch cases/quick-shear'),
    "figures": (
        "Draws the paper's figures of a case, or of several beside each other, as PDF and PNG into `CASE/figures`. The [gallery](../gallery.md) shows them.",
        'moraine figures cases/quick-shear\nmoraine figures cases/quick-shear/sweep --only fig14-mohr-coulomb'),
    "movie": (
        "Makes the paper's two animations from the snapshots of a case. How: [Make movies and pages](../how-to/movies.md).",
        'moraine movie cases/quick-shear'),
    "view": (
        'Writes one page that shows the bed of a case in 3D, with curves beside it. How: [Make movies and pages](../how-to/movies.md).',
        'moraine view cases/quick-shear'),
    "report": (
        'Measures the runs of a study again, and writes its report anew.',
        './moraine report cases/paper-2013/runs/fast'),
    "reproduce": (
        'Runs a study, what is missing of it, and ends with figures and a report. Needs Snakemake. How: [Reproduce a study](../how-to/studies.md).',
        './moraine reproduce paper-2013 --quick'),
    "cases": (
        'Copies the cases that come with the package into a folder, to run and to change them. In the sources they are in `cases/`.',
        'moraine cases --help'),
}


def known_commands():
    """Those of the program and of the package; the launcher's own are on the page itself."""
    from moraine.__main__ import commands as in_python
    return {*re.findall(r'add_subcommand\(\s*"([\w-]+)"', (root / "src/main.cpp").read_text()), *in_python}


def commands():
    known = known_commands()
    return "\n\n".join(f"(command-{name})=\n## {name}\n\n{what}\n\n```\n{example}\n```\n\n{help_of(name)}"
                       for name, (what, example) in about_commands.items() if name in known)


# Modules that serve commands and reports; so do those of commands, and all *_report.
inside = {"__main__", "cluster", "core", "example_cases", "frames", "measure", "page", "paper", "places", "progress", "sealed", "spheres", "study",
          "study_runs", "style", "tables", "textplot"}
for_users = ["case", "sweep", "run", "results", "strength", "dilatancy", "shearing", "profile", "forces", "section", "rotation",
             "compaction", "intervals", "bed_figures", "force_figures", "water_figures"]


def modules():
    """Names of the modules: for users, in the order of the page, and inside."""
    from moraine.__main__ import commands
    names = sorted(path.stem for path in (root / "python/moraine").glob("*.py") if path.stem != "__init__")
    internal = [name for name in names if name in inside or name.endswith("_report") or name in (module for module, _ in commands.values())]
    public = [name for name in names if name not in internal]
    return sorted(public, key=lambda name: (for_users.index(name) if name in for_users else len(for_users), name)), internal


def api():
    def page(name):
        more = "   :inherited-members: str, Mapping, object\n   :exclude-members: Text\n" if name == "case" else ""  # calls for stages are made from the table of keys
        return f"(module-{name})=\n## moraine.{name}\n\n```{{eval-rst}}\n.. automodule:: moraine.{name}\n{more}```"
    return "\n\n".join(page(name) for name in modules()[0])


def internal():
    def about(name):
        text = ast.get_docstring(ast.parse((root / f"python/moraine/{name}.py").read_text())) or ""
        return escaped(text.split("\n\n")[0].split("\n")[0].strip())
    return "\n".join(["| module | what |", "|---|---|", *(f"| `{name}` | {about(name)} |" for name in modules()[1])])


def gallery():
    """The figures of the reports in cases/*/results, with their captions."""
    parts = []
    for report in sorted(root.glob("cases/*/results/report.md"), key=lambda path: (path.parts[-3] != "paper-2013", path)):
        study = report.parts[-3]
        title = re.search(r"^# (.*)$", (report.parents[1] / "README.md").read_text(), re.M)[1]
        parts += ["", f"## {title}", "", f"From the [report](../../cases/{study}/results/report.md) of [cases/{study}](../../cases/{study}/README.md):", "",
                  "```", f"./moraine reproduce {study}" + (" --preset fast --seeds 3" if study == "paper-2013" else ""), "```", ""]
        for name, file, caption in re.findall(r"^!\[(.*?)\]\((figures/[\w.-]+\.png)\)\n\n(\*.*\*)$", report.read_text(), re.M):
            parts += [f"![{name}](../../cases/{study}/results/{file})", "", caption, ""]
    return "\n".join(parts)


def notebooks():
    """Those in docs/manual/notebooks, with their results as they are kept in them."""
    def fenced(language, text):
        return f"````{language}\n{text.rstrip()}\n````"

    def shown(output):
        data = output.get("data", {})
        if output["output_type"] == "stream":
            return fenced("text", "".join(output["text"]))
        if "image/png" in data:
            return f"![What the lines above draw](data:image/png;base64,{''.join(data['image/png']).replace(chr(10), '')})"
        if "text/html" in data:
            return fenced("{raw} html", "".join(data["text/html"]))
        return fenced("text", "".join(data["text/plain"]))

    parts = []
    for file in sorted((root / "docs/manual/notebooks").glob("*.ipynb"), key=lambda path: path.name, reverse=True):  # shear first
        for cell in json.loads(file.read_text())["cells"]:
            text = "".join(cell["source"])
            if cell["cell_type"] == "markdown":
                text = re.sub(r"^#", "##", text, flags=re.M)
                parts.append(re.sub(r"\]\(([\w-]+\.ipynb)\)", r"](../notebooks/\1)", text))
            else:
                parts += [fenced("python", text), *map(shown, cell["outputs"])]
    return "\n\n".join(parts)


def case_row():
    return ("| {py:class}`moraine.Case <moraine.case.Case>` | builds, edits, checks, runs and sweeps a case |\n"
            if "case" in modules()[0] else "")


makers = {
    "api": api,
    "internal": internal,
    "case-row": case_row,
    "gallery": gallery,
    "notebooks": notebooks,
    "keys": keys,
    "series": series,
    "commands": commands,
    "loads": lambda: below_the_list("A load may change", "\nWhat model.preset"),
    "presets": lambda: below_the_list("What model.preset sets", "\0"),
}


def made(what):
    """What stands in place of <!-- generated: WHAT -->."""
    if what not in makers:
        raise RuntimeError(f"<!-- generated: {what} -->: expected one of {', '.join(makers)}")
    return makers[what]()


def missing(text):
    """What is wrong with `file: name(), name`; empty where file and names are there."""
    name, _, names = text.partition(": ")
    if not (root / name).exists():
        return f"{name} is not there"
    body = (root / name).read_text(errors="replace") if (root / name).is_file() else ""
    lost = [word for word in re.findall(r"\w+", names) if not re.search(rf"\b{word}\b", body)]
    return f"{name} has no {', '.join(lost)}" if lost else ""
