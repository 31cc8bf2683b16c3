#!/usr/bin/env python3
"""Writes python/moraine/tables.pyi, what editors and type checkers know of the keys, from the program's table of keys.

Needs moraine._core. A test fails where the file is not what this writes.
"""
from pathlib import Path
import sys

here = Path(__file__).resolve().parent
target = here / "moraine/tables.pyi"


def text():
    sys.path.insert(0, str(here))
    from moraine import tables

    def documented(doc, indent):
        return f'{indent}"""{doc.replace(chr(10) * 2, chr(10) * 2 + indent)}"""'

    def members(keys):
        return [line for key in keys for line in (f"    {key.leaf}: {key.hint}", documented(key.doc, "    "))]

    def arguments(keys):
        return ", ".join(f"{key.leaf}: {key.hint} = ..." for key in keys)

    def table(name, base, keys, doc):
        return [f"class {name}({base}):", documented(doc, "    "), *members(keys), f"    def __call__(self, *, {arguments(keys)}) -> Case: ...", ""]

    lines = ["# Written by python/stubs.py from the table of keys.", "from dataclasses import dataclass", "from typing import Any", "",
             "from .case import Case", "from .run import Error", "", "class UnknownKey(Error, AttributeError): ...", "",
             "@dataclass(frozen=True)", "class Key:", *(f"    {name}: str" for name in tables.Key.__annotations__),
             *("    @property", "    def table(self) -> str: ...", "    @property", "    def leaf(self) -> str: ...",
               "    @property", "    def hint(self) -> str: ...", "    @property", "    def doc(self) -> str: ...",
               "    def belongs_to(self, kind: str) -> bool: ..."), "",
             "keys: list[Key]", "by_name: dict[str, Key]", "tables: list[str]", "kinds: list[str]", "listed: tuple[str, ...]",
             "carries_on: tuple[str, ...]", "classes: dict[str, type[Any]]", "stage_classes: dict[str, type[Any]]",
             "def keys_of(table: str, kind: str | None = None) -> list[Key]: ...", "",
             "class KeyTable:", "    def __init__(self, case: Case, at: str) -> None: ...", ""]
    for name in tables.classes:
        lines += table(tables.class_name(name), "KeyTable", tables.keys_of(name), tables.titles.get(name, name))
    lines += table("Stage", "KeyTable", tables.keys_of("stage"), "a stage")
    lines += ["class CaseKeys:", *members([key for key in tables.keys_of("") if key.leaf != "stages"])]
    for name in tables.classes:
        if name not in tables.listed:
            lines += [f"    {name}: {tables.class_name(name)}", documented(tables.titles.get(name, name), "    ")]
    for kind in tables.kinds:
        keys = [key for key in tables.keys_of("stage", kind) if key.leaf != "kind"]
        first = next(key for key in keys if key.leaf == tables.driver.get(kind, "duration"))
        rest = [key for key in keys if key is not first]
        shorts = "".join(f", {short}: {tables.by_name['stage.' + long].hint} = ..." for short, long in tables.short_names_of(kind).items())
        lines += [f"    def {kind}(self, {arguments([first])}, *, {arguments(rest)}{shorts}) -> Case:",
                  documented(getattr(tables.CaseKeys, kind).__doc__.split("\n\n")[0], "        "), "        ..."]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    target.write_text(text())
