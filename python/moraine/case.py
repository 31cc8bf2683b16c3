"""A case that is built, edited, checked and run from Python.

    case = moraine.Case("my-bed", title="My own bed")
    case.grains(count=500, seed=2)                     # several keys of a table at once
    case.contact.k_n = "1.16e7 N/m"                    # or one: a number in SI, or a text with a unit
    case.settle("0.4 s").consolidate("20 kPa", duration="0.2 s").shear(rate="0.1 1/s", strain=0.3)
    case.run()

A case is a directory with a case.toml in it. Where there is one it is read and edited, and keeps its comments. Every value is judged
by the program's own table of keys when it is set; moraine.Error says what is wrong. `help(case.contact)` lists the keys of a table,
in IPython `case.contact.k_n?` tells of one.
"""
from collections.abc import Iterator, Mapping
from difflib import get_close_matches
import os
from pathlib import Path
import tomllib
from typing import TYPE_CHECKING, Any, Generic, TypeVar

import tomlkit
import tomlkit.exceptions
import tomlkit.items

from .run import Error, Run, _core
from .tables import CaseKeys, KeyTable, Material, Pair, Stage, UnknownKey, by_name, carries_on, classes, keys_of, listed, stage_classes, tables

if TYPE_CHECKING:
    from .results import Results
    from .sweep import Sweep

Table = TypeVar("Table", bound=KeyTable)

_written: dict[Path, str] = {}  # what this session has written, so that it may be replaced


class Text(str):
    """A text that a notebook shows as it is."""
    __repr__ = str.__str__


class Case(CaseKeys):
    """A case in a directory. The keys on top of case.toml may be given at once: title, start, extends.

    new: begins from nothing, whatever case.toml there is; write() then does not replace it if it says something else.
    Raises moraine.Error where case.toml cannot be read.
    """

    def __init__(self, directory: str | os.PathLike, *, new: bool = False, **keys: Any):
        self._directory = Path(directory)
        self._known = self._on_disk()  # the file as it was read or written
        self._made = new or self._known is None  # all of it here, so that it is written in the order of the table of keys
        self._document = tomlkit.document()
        self._stated: set[str] = set()  # names of stages that this object was told
        self._filled_of = None, None
        if new and self._known != _written.get(self.file):
            self._known = None
        if not self._made:
            _core.fill(str(self._directory), self._known)  # raises in the program's words
            self._document = tomlkit.parse(self._known)
        for name, value in keys.items():
            self[name] = value

    # The file.

    @property
    def directory(self) -> Path:
        """The directory of the case."""
        return self._directory

    @property
    def file(self) -> Path:
        """Its case.toml."""
        return self._directory / "case.toml"

    @property
    def text(self) -> str:
        """What case.toml would be."""
        return Text(self._ordered() if self._made else tomlkit.dumps(self._document))

    def write(self, overwrite: bool = False) -> "Case":
        """Writes case.toml, where it is not there already. Returns the case.

        Raises moraine.Error where the file is neither what was read nor what was written last; overwrite=True replaces it.
        """
        text, there = str(self.text), self._on_disk()
        if there is not None and there not in (text, self._known) and not overwrite:
            why = "says something else than this case" if self._known is None else "has changed since it was read or written"
            raise Error(f"{self.file}: {why}; moraine.Case({str(self._directory)!r}) reads it, write(overwrite=True) replaces it")
        if there != text:
            try:
                self._directory.mkdir(parents=True, exist_ok=True)
                aside = self.file.with_name("case.toml.part")
                aside.write_text(text)
                os.replace(aside, self.file)
            except OSError as why:
                raise Error(f"{self.file}: cannot be written: {why}") from None
        self._known = _written[self.file] = text
        return self

    def _on_disk(self):
        try:
            return self.file.read_text()
        except FileNotFoundError:
            return None
        except (OSError, UnicodeDecodeError) as why:
            raise Error(f"{self.file}: cannot be read: {why}") from None

    def __repr__(self):
        return f"Case({str(self._directory)!r}: {', '.join(self.stages) or 'no stages yet'})"

    def __setattr__(self, name, value):
        if name.startswith("_") or hasattr(type(self), name):
            object.__setattr__(self, name, value)
        else:
            self[name] = value  # raises

    def __getattr__(self, name):  # what is not there
        if hasattr(type(self), name):
            return object.__getattribute__(self, name)  # a property that failed: raises what it raised
        near = [] if name.startswith("_") else get_close_matches(name, [n for n in dir(self) if not n.startswith("_")], 1)
        raise AttributeError(f"a Case has no {name}" + (f"; did you mean {near[0]}?" if near else ""))

    # Keys by their full names.

    def __getitem__(self, name: str) -> Any:
        """What a key is set to, or else its value by default or preset, in SI: case["contact.k_n"], case["stage.shear.strain"]."""
        table, leaf = self._table_of(name)
        if table is not None and leaf in table:
            return _plain(table[leaf])
        at = self._at(name)
        if at not in by_name:
            raise UnknownKey(self._judged(name, 0, why=True))
        key = by_name[at]
        if at.startswith("stage.") and not key.belongs_to(self._kind_of(name)):
            raise UnknownKey(f"{name}: belongs to kind {key.kinds}, and this stage is {self._kind_of(name)}")
        for filled in self._filled_tables(name):
            if leaf in filled:
                return filled[leaf]
        return tomllib.loads(f"v = {key.default}")["v"] if key.default[:1] in ('"', "[") else None  # None: as another key, see its help

    def __setitem__(self, name: str, value: Any) -> None:
        """Sets a key: a number in SI, or a text with a unit; a load that changes is a dict, as in case.toml."""
        if hasattr(value, "directory"):  # start=bed, a Case or Results
            value = os.path.relpath(value.directory, self._directory)
        self._judged(name, value)
        before = str(self.text)
        table, leaf = self._table_of(name, create=True)
        table[leaf] = toml_item(name, value)
        self._verify(before)

    def __delitem__(self, name: str) -> None:
        """Back to the default."""
        self[name]  # raises where there is no such key
        table, leaf = self._table_of(name)
        if table is not None and leaf in table:
            before = str(self.text)
            del table[leaf]
            self._verify(before)

    def has(self, name: str) -> bool:
        """Whether case.toml says this key itself."""
        table, leaf = self._table_of(name)
        return table is not None and leaf in table

    def toml(self, name: str, value: Any) -> str:
        """A value as case.toml spells it."""
        return toml_item(name, value).as_string()

    def _judged(self, name, value, why=False, kind=None):
        """Raises Error in the program's words; or returns them, about the name alone."""
        toml = toml_item(name, value).as_string()
        if kind is None:
            kind = self._kind_of(name) if name.startswith("stage.") else ""
        try:
            return _core.check_value(name, toml, kind)
        except Error as e:
            if why:
                return str(e).replace(f"{name} = {toml}", name, 1)
            if "unknown key" in str(e):
                raise UnknownKey(str(e)) from None
            raise

    def _verify(self, before):
        """What one value may break in the rest, such as a name that is there twice; undone then."""
        try:
            self._filled()
        except Error:
            self._document = tomlkit.parse(before)
            raise

    def _filled(self):
        """All keys with their values, in SI, by tables."""
        text = str(self.text)
        if self._filled_of[0] != text:
            self._filled_of = text, tomllib.loads(_core.fill(str(self._directory), text))
        return self._filled_of[1]

    def _filled_tables(self, name):
        table, _, rest = name.partition(".")
        filled = self._filled()
        if not rest:
            return [filled]
        if table in listed:
            return [one for one in filled.get(table, []) if _name_of(table, one) == rest.rpartition(".")[0]]
        return [filled[table]] if table in filled else []

    @staticmethod
    def _at(name):
        """"stage.shear.strain" -> "stage.strain" """
        table, _, rest = name.partition(".")
        return f"{table}.{rest.rpartition('.')[2]}" if table in listed else name

    def _kind_of(self, name):
        stage = name.removeprefix("stage.").rpartition(".")[0]
        return next((one["kind"] for one in self._filled().get("stage", []) if one["name"] == stage), "")

    def _table_of(self, name, create=False):
        """The table of the document that has a key, or None, and the key's name in it."""
        table, _, rest = name.partition(".")
        if not rest:
            return self._document, name
        if table not in listed:
            if table not in self._document and create:
                self._document.add(table, tomlkit.table())
            return self._document.get(table), rest
        which, _, leaf = rest.rpartition(".")
        for one in self._document.get(table, []):
            if _name_of(table, one) == which:
                return one, leaf
        return (self._append(table, {"of": which.split("-")} if table == "pair" else {"name": which}) if create else None), leaf

    def _append(self, table, keys):
        if table not in self._document:
            self._document.add(table, tomlkit.aot())
        one = tomlkit.table()
        one.trivia.indent = "\n"
        for leaf, value in keys.items():
            one.add(leaf, toml_item(leaf, value))
        self._document[table].append(one)
        return self._document[table][-1]

    def _ordered(self):
        """As a person would write it: tables in the order of the table of keys, stages last."""
        document, blocks = self._document, []

        def lines(table, at):
            return [f"{key.leaf} = {tomlkit.item(table[key.leaf]).as_string()}" for key in keys_of(at) if key.leaf in table]
        blocks.append(lines(document, ""))
        for name in tables:
            if name and name not in listed and (own := lines(document.get(name, {}), name)):
                blocks.append([f"[{name}]", *own])
        for name in listed:
            blocks += [[f"[[{name}]]", *lines(one, name)] for one in document.get(name, [])]
        return "\n\n".join("\n".join(block) for block in blocks if block) + "\n"

    # Stages, materials, pairs of these.

    @property
    def stages(self) -> "Listed[Stage]":
        """The stages by name, in the order in which they run: case.stages["shear"].normal_stress = "40 kPa", or
        case.stages.shear.normal_stress. Printed they are as in case.toml, with defaults."""
        return Listed(self, "stage")

    @property
    def materials(self) -> "Listed[Material]":
        """The materials by name; case.material(...) adds one."""
        return Listed(self, "material")

    @property
    def pairs(self) -> "Listed[Pair]":
        """Pairs of materials, by both names: case.pairs["clay-sand"]; case.pair(...) adds one."""
        return Listed(self, "pair")

    def material(self, name: str, **keys: Any) -> "Case":
        """Adds a material of grains or walls, or states it anew. Returns the case. help(case.materials[name]) lists the keys."""
        return self._state("material", name, {"name": name}, keys)

    def pair(self, first: str, second: str, **keys: Any) -> "Case":
        """What two materials, or one and "wall", have between them. Returns the case. help(case.pairs["FIRST-SECOND"]) lists the keys."""
        return self._state("pair", f"{first}-{second}", {"of": [first, second]}, keys)

    def _state_stage(self, kind, keys):
        keys = {leaf: value for leaf, value in keys.items() if value is not None}
        name = keys.pop("name", None)
        if name is None:
            name, count = kind, 1
            while name in self._stated:
                count += 1
                name = f"{kind}-{count}"
        if name in self._stated:
            raise Error(f"stage.{name}: there is another stage of this name; expected a unique one, or case.stages[{name!r}] to change "
                        "that one")
        order = list(self.stages)
        before = order[order.index(name) - 1] if name in order[1:] else order[-1] if order and name not in order else None
        if kind in carries_on and before and "normal_stress" not in keys and "top_wall" not in keys:
            carried = self[f"stage.{before}.normal_stress"]
            if carried and not isinstance(carried, dict):
                keys["normal_stress"] = carried
        self._state("stage", name, {"name": name, "kind": kind}, keys)
        self._stated.add(name)
        return self

    def _state(self, table, name, head, keys):
        """A table of a list with these keys and no others, in the place that it has, or else last."""
        before, made = str(self.text), self._made
        try:
            one, _ = self._table_of(f"{table}.{name}.", create=True)
            for leaf in [leaf for leaf in one if leaf not in head and leaf not in keys]:
                del one[leaf]
            kind = head.get("kind", "")
            for leaf, value in head.items():
                self._judged(f"{table}.{name}.{leaf}", value, kind=kind)
                if leaf not in one or _plain(one[leaf]) != value:
                    one[leaf] = toml_item(leaf, value)
            self._filled()  # a name that is none
            for leaf, value in keys.items():
                self._judged(f"{table}.{name}.{leaf}", value, kind=kind)
                one[leaf] = toml_item(f"{table}.{name}.{leaf}", value)
            self._filled()
        except Error:
            self._document, self._made = tomlkit.parse(before), made
            raise
        return self

    # Checking and running. All write the case first.

    def check(self, threads: int = 0, backend: str = "auto") -> str:
        """What would run: time step, inertia number, memory, time; as `moraine check` prints it. Writes the case first.

        threads: 0 for all cores; backend: cpu, cuda or auto. Raises moraine.Error.
        """
        self.write()
        return Text(_core.check_case(str(self._directory), threads=threads, backend=backend).rstrip("\n"))

    def begin(self, *, threads: int = 0, resume: bool = False, force: bool = False, backend: str = "auto") -> Run:
        """Begins a run in this process, to be stepped, read and steered: a moraine.Run. Writes the case first.

        resume: go on from the last checkpoint; force: replace the results of an earlier run; threads: 0 for all cores;
        backend: cpu, cuda or auto. Raises moraine.Error.
        """
        self.write()
        return Run(str(self._directory), threads=threads, resume=resume, force=force, backend=backend)

    def run(self, *, threads: int = 0, resume: bool = False, force: bool = False, backend: str = "auto", progress: bool = True) -> "Results":
        """Runs the case to its end in this process, with a progress bar, and returns its moraine.Results. Arguments: as begin().

        Ctrl-C (in a notebook: stop) writes a checkpoint; run(resume=True) goes on from there, with the same bits.
        """
        with self.begin(threads=threads, resume=resume, force=force, backend=backend) as run:
            run.finish(progress=progress)
        return self.results()

    def results(self) -> "Results":
        """The moraine.Results of the case, also while it runs; results.refresh() reads what has come since."""
        from .results import Results
        return Results(self._directory)

    def sweep(self, values: Mapping[str, Any] | None = None, /, *, threads: int = 0, at_once: int = 0, resume: bool = False,
              force: bool = False, backend: str = "auto", progress: bool = True, **keys: Any) -> "Sweep":
        """Runs the case with each of the values, several at once: case.sweep(normal_stress=["10 kPa", "20 kPa"], seed=[1, 2]).

        A key of the stages is set in each stage that gives it; {"stage.shear.mu_s": [0.2, 0.4]} sets one in one stage. Several lists
        give their product; a value without a list is set in all. Each is a case of its own, in DIRECTORY/sweep, with the bits and
        folders of `moraine sweep`. Returns a moraine.Sweep: its `table` is a pandas.DataFrame, its `results` a list.
        at_once: cases at the same time, 0 for one to each of the threads; the other arguments: as begin(). After Ctrl-C
        sweep(..., resume=True) goes on.
        """
        from .sweep import sweep
        self.write()
        return sweep(self, {**(values or {}), **keys}, threads=threads, at_once=at_once, resume=resume, force=force, backend=backend,
                     progress=progress)


class Listed(Mapping[str, Table], Generic[Table]):
    """The stages of a case (or materials, or pairs of these) by name, in order."""

    def __init__(self, case: Case, table: str):
        self._case, self._table = case, table

    def __iter__(self) -> Iterator[str]:
        chosen = [_name_of(self._table, one) for one in self._case._filled().get(self._table, [])]
        own = [_name_of(self._table, one) for one in self._case._document.get(self._table, [])]
        return iter(chosen + [name for name in own if name not in chosen])

    def __len__(self):
        return len(list(iter(self)))

    def __getitem__(self, name: str) -> Table:
        if name not in list(self):
            raise UnknownKey(f"{self._case.directory}: no {self._table} {name!r}; {self._table}s: {', '.join(self) or 'none'}")
        at = f"{self._table}.{name}"
        if self._table != "stage":
            return classes[self._table](self._case, at)
        return stage_classes[self._case[f"{at}.kind"]](self._case, at)

    def __getattr__(self, name: str) -> Table:  # case.stages.shear, for names that are words: tab completion knows these
        if name.startswith("_"):
            raise AttributeError(name)
        return self[name]

    def __dir__(self):
        return [*super().__dir__(), *(name for name in self if name.isidentifier())]

    def __delitem__(self, name: str) -> None:
        self[name]
        tables_ = self._case._document.get(self._table, [])
        for k, one in enumerate(tables_):
            if _name_of(self._table, one) == name:
                del tables_[k]
                self._case._stated.discard(name)
                return
        raise Error(f"{self._case.directory}: {self._table} {name!r} comes from the case that this one extends; "
                    f"case[\"stages\"] = [...] names those to run")

    def __repr__(self):
        return "\n\n".join(repr(self[name]) for name in self) or f"no {self._table}s"

    def _ipython_key_completions_(self):
        return list(self)


def _name_of(table, one):
    return "-".join(one.get("of", [])) if table == "pair" else one.get("name")


def _plain(item):
    """What tomlkit has, as Python has it; booleans it gives as they are."""
    return item.unwrap() if hasattr(item, "unwrap") else item


def toml_item(name, value):
    """A value as tomlkit has it; tables within a value are in line."""
    if hasattr(value, "tolist"):  # of NumPy
        value = value.tolist()
    if isinstance(value, os.PathLike):
        value = os.fspath(value)
    if isinstance(value, Mapping):
        table = tomlkit.inline_table()
        for leaf, one in value.items():
            table.append(str(leaf), toml_item(name, one))
        return table
    if isinstance(value, (list, tuple)):
        array = tomlkit.array()
        for one in value:
            array.append(toml_item(name, one))
        return array
    if not isinstance(value, (bool, int, float, str)):
        raise Error(f"{name} = {value!r}: expected a number, a text, True or False, a list, or a dict for a load that changes"
                    + ("; del goes back to the default" if value is None else ""))
    return tomlkit.item(value)
