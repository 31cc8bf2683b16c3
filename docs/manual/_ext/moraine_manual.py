"""What the manual takes from the program: tables of keys and columns, and the help of commands.

A page has a line <!-- generated: WHAT --> where one of these goes:
    keys             all keys of case.toml, each with an anchor; the role {key}`contact.k_n` links to it
    presets, loads   what stands below the list of `moraine keys`
    series           the columns of series.h5
    help COMMAND     what `moraine COMMAND --help` prints
    gallery          the figures of the studies, as their reports have them
    api, internal    the modules of python/moraine: those for users with their docstrings, the others as a list
The role {src}`src/dem/law/contact.hpp: grip()` names a file of the sources, and functions or types in it. A file or name that is
not there is a warning, so that the manual follows the code.
"""
import ast
import json
import os
import re
import subprocess
import sys
from functools import lru_cache
from pathlib import Path

from docutils import nodes
from sphinx.errors import ExtensionError
from sphinx.util import logging

root = Path(__file__).resolve().parents[3]
log = logging.getLogger(__name__)


def program():
    """The program that says what its keys are: MORAINE_PROGRAM, or the one in build/."""
    path = Path(os.environ.get("MORAINE_PROGRAM") or root / "build/moraine")
    if not path.exists():
        raise ExtensionError(f"{path} is not there, and the manual takes its tables from it; ./moraine docs builds it first, "
                             "or set MORAINE_PROGRAM")
    return str(path)


@lru_cache
def output_of(*command):
    done = subprocess.run(command, capture_output=True, text=True, cwd=root,
                          env={**os.environ, "COLUMNS": "100", "PYTHONPATH": str(root / "python")})
    if done.returncode:
        raise ExtensionError(f"{' '.join(command)} failed: {done.stderr.strip()}")
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
    sys.path.insert(0, str(root / "python"))
    from moraine.__main__ import commands
    if command in commands:
        text = output_of(sys.executable, "-m", "moraine", command, "--help")
    else:
        text = output_of(program(), command, "--help")
    return "```text\n" + text.strip().replace(str(root) + "/", "") + "\n```"


# Modules that serve commands and reports; so do those of commands, and all *_report. Others are for users.
inside = {"__main__", "cluster", "core", "measure", "page", "paper", "progress", "sealed", "spheres", "study", "study_runs", "style", "tables",
          "textplot"}
first = ["case", "sweep", "run", "results", "strength", "dilatancy", "shearing", "profile", "forces", "section", "rotation", "compaction", "intervals"]


def modules():
    """Names of the modules: for users, in the order of the page, and inside."""
    sys.path.insert(0, str(root / "python"))
    from moraine.__main__ import commands
    names = sorted(path.stem for path in (root / "python/moraine").glob("*.py") if path.stem != "__init__")
    internal = [name for name in names if name in inside or name.endswith("_report") or name in (module for module, _ in commands.values())]
    public = [name for name in names if name not in internal]
    return sorted(public, key=lambda name: (first.index(name) if name in first else len(first), name)), internal


def api():
    def page(name):
        more = "   :inherited-members:\n" if name == "case" else ""  # calls for stages are made from the table of keys
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


def case_row():
    return ("| {py:class}`moraine.Case <moraine.case.Case>` | builds, edits, checks, runs and sweeps a case |\n"
            if "case" in modules()[0] else "")


makers = {
    "api": api,
    "internal": internal,
    "case-row": case_row,
    "gallery": gallery,
    "keys": keys,
    "series": series,
    "loads": lambda: below_the_list("A load may change", "\nWhat model.preset"),
    "presets": lambda: below_the_list("What model.preset sets", "\0"),
}


def fill_in(app, document, source):
    def made(match):
        what, _, rest = match[1].partition(" ")
        if what == "help":
            return help_of(rest)
        if what not in makers:
            raise ExtensionError(f"{document}: <!-- generated: {match[1]} -->: expected help COMMAND or one of {', '.join(makers)}")
        return makers[what]()
    if document.startswith("bench/results/") and not re.search(r"^# ", source[0], re.M):
        source[0] = f"# {Path(document).name}\n\n" + source[0]  # a table alone
    source[0] = re.sub(r"<!-- generated: ([\w -]+?) -->", made, source[0])


def missing(text):
    """What is wrong with `file: name(), name`; empty where file and names are there."""
    name, _, names = text.partition(": ")
    if not (root / name).exists():
        return f"{name} is not there"
    body = (root / name).read_text(errors="replace") if (root / name).is_file() else ""
    lost = [word for word in re.findall(r"\w+", names) if not re.search(rf"\b{word}\b", body)]
    return f"{name} has no {', '.join(lost)}" if lost else ""


def src(role, rawtext, text, lineno, inliner, options=None, content=()):
    wrong = missing(text)
    if wrong:
        log.warning(wrong, location=(inliner.document.settings.env.docname, lineno))
    return [nodes.literal(rawtext, text)], []


def as_rst(app, what, name, obj, options, lines):
    """Docstrings are plain text with `name` for code; what is indented stands as it is."""
    out, inside_block = [], False
    for line in lines:
        indented = line.startswith(" ")
        if indented and not inside_block:
            out += ["", "::", ""]
        if line.strip() and not indented and inside_block:
            out.append("")
        if line.strip():
            inside_block = indented
        out.append(line if indented else re.sub(r"[|*]", r"\\\g<0>", re.sub(r"(?<![`:\w])`([^`]+)`(?!`)", r"``\1``", line)))
    lines[:] = out


def setup(app):
    app.add_object_type("key", "key", objname="key of case.toml", indextemplate="single: %s (key)")
    app.add_role("src", src)
    app.connect("source-read", fill_in)
    app.connect("autodoc-process-docstring", as_rst, priority=100)
    return {"parallel_read_safe": True}
