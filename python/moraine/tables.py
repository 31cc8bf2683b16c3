"""The tables of case.toml as classes, made from the program's table of keys: a property for each key.

`CaseKeys` is what moraine.Case has of it: the keys on top of the file, a property for each table, a call for each kind of stage.
"""
from collections.abc import Mapping
from dataclasses import dataclass
import inspect

from .run import Error, _core

listed = ("material", "pair", "stage")  # tables of which a case may have many
required = "(required)"


class UnknownKey(Error, AttributeError):
    """A key that case.toml does not know, or that a kind of stage does not have."""


@dataclass(frozen=True)
class Key:
    """A row of the table of keys."""
    name: str       # "contact.k_n"
    type: str       # number, integer, boolean, text, choice, path, list, load
    unit: str       # SI; "1" or empty: none
    default: str    # as in `moraine keys`
    accepts: str
    meaning: str
    kinds: str      # of the stages that have it; empty: all

    @property
    def table(self):
        return self.name.rpartition(".")[0]

    @property
    def leaf(self):
        return self.name.rpartition(".")[2]

    @property
    def hint(self):
        """Of the values it takes."""
        return {"number": "float | str", "integer": "int | float | str", "boolean": "bool", "list": "list[str]",
                "load": "float | str | dict"}.get(self.type, "str")

    def belongs_to(self, kind):
        return not self.kinds or kind in self.kinds.split(", ")

    @property
    def doc(self):
        unit = "" if self.unit in ("", "1") else f" in {self.unit}"
        kind = {"choice": "one of " + self.accepts.replace(" | ", ", "), "load": f"number{unit}, text with a unit, or history (a dict)",
                "number": f"number{unit}" + (", or text with a unit" if self.unit else ""), "list": "list of texts"}.get(self.type, self.type)
        facts = [kind]
        if self.accepts and self.type != "choice":
            facts.append(self.accepts)
        usual, _, special = self.default.partition("; ")
        usual = "empty" if usual in ('""', "[]") else usual.strip('"')
        facts.append("has to be given" if self.default == required else f"default {usual}" + (f" ({special})" if special else ""))
        if self.kinds:
            facts.append(f"of stages {self.kinds}")
        return f"{self.meaning}\n\n{'; '.join(facts)}"


keys = [Key(**row) for row in _core.keys()]
by_name = {key.name: key for key in keys}
tables = list(dict.fromkeys(key.table for key in keys))  # in the order of the table of keys; "" is the top of the file
kinds = by_name["stage.kind"].accepts.split(" | ")
titles = {"box": "the box that holds the grains", "grains": "the grains at the start", "contact": "contacts between grains",
          "wall": "walls, and contacts with them", "model": "gravity, time step, and what the computation costs", "fluid": "pore water",
          "material": "a material of grains or walls", "pair": "two materials, one against the other", "stage": "a stage",
          "output": "how often results are written", "guards": "where a run that goes wrong is stopped"}

# What a call takes first, without its name: what drives a stage of this kind.
driver = {"settle": "duration", "consolidate": "normal_stress", "shear": "strain_rate", "shear_stress": "shear_stress",
          "uniaxial": "strain_rate", "press": "pressure"}
short_names = {"rate": "strain_rate", "stress": "normal_stress"}  # of calls; not where the short name could mean two keys


def keys_of(table, kind=None):
    return [key for key in keys if key.table == table and (kind is None or key.belongs_to(kind))]


def short_names_of(kind):
    own = {key.leaf for key in keys_of("stage", kind)}
    return {short: long for short, long in short_names.items() if long in own and not (short == "stress" and "shear_stress" in own)}


class KeyTable:
    """The keys of one table. Reading gives what was set, or the default (in SI); del goes back to that."""
    __slots__ = ("_case", "_at")

    def __init__(self, case, at):
        object.__setattr__(self, "_case", case)
        object.__setattr__(self, "_at", at)  # "contact", "stage.shear"

    def __call__(self, **values):
        """Sets several keys: case.grains(count=500, seed=2). Returns the case."""
        for leaf, value in values.items():
            setattr(self, leaf, value)
        return self._case

    def __setattr__(self, leaf, value):
        self._case[f"{self._at}.{leaf}"] = value

    def __getattr__(self, leaf):  # what is no property
        if leaf.startswith("_"):
            raise AttributeError(f"{type(self).__name__} has no {leaf}")
        self._case[f"{self._at}.{leaf}"]  # raises
        raise UnknownKey(f"{self._at}.{leaf}: not a key of this table")

    def __dir__(self):
        return [key.leaf for key in self._keys]

    def __repr__(self):
        """What is set, then the defaults, as in a case.toml."""
        lines = {True: [], False: []}
        for key in self._keys:
            name = f"{self._at}.{key.leaf}"
            value, own = self._case[name], self._case.has(name)
            unit = "" if own or key.unit in ("", "1") else f"  # {key.unit}"
            lines[own].append(f"# {key.leaf}: {key.default}" if value is None else f"{key.leaf} = {self._case.toml(name, value)}{unit}")
        by_default = ["# by default"] if lines[False] else []
        return "\n".join([f"[{self._at}]", *lines[True], *by_default, *lines[False]])


class Stage(KeyTable):
    """A [[stage]]; each kind has a class of its own."""
    __slots__ = ()


def _property(key, name_of):
    return property(lambda self: self._case[name_of(self)], lambda self, value: self._case.__setitem__(name_of(self), value),
                    lambda self: self._case.__delitem__(name_of(self)), key.doc)


def class_name(table, kind=None):
    return "".join(word.capitalize() for word in (kind or table).split("_")) + ("Stage" if kind else "")


def _table_class(table, kind=None):
    own = keys_of(table, kind)
    rows = "\n".join(f"  {key.leaf}: {key.meaning}" for key in own)
    what = f"[{table}]" if table not in listed else f"[[{table}]]"
    about = f"{what}: {titles.get(table, table)}{f' of kind {kind}' if kind else ''}."
    members = {"__slots__": (), "__doc__": f"{about} {KeyTable.__doc__}\n\n{rows}", "__module__": __name__, "_keys": own}
    for key in own:
        members[key.leaf] = _property(key, lambda self, leaf=key.leaf: f"{self._at}.{leaf}")
    return type(class_name(table, kind), (Stage if kind else KeyTable,), members)


classes = {table: _table_class(table) for table in tables if table and table != "stage"}
stage_classes = {kind: _table_class("stage", kind) for kind in kinds}
globals().update({c.__name__: c for c in [*classes.values(), *stage_classes.values()]})


def _top_property(key):
    return property(lambda self: self[key.name], lambda self, value: self.__setitem__(key.name, value),
                    lambda self: self.__delitem__(key.name), key.doc)


def _table_property(table):
    def fill(self, values):
        if not isinstance(values, Mapping):
            raise Error(f"{table} = {values!r}: expected a dict of keys, or case.{table}.KEY = ...")
        classes[table](self, table)(**values)
    return property(lambda self: classes[table](self, table), fill, None, classes[table].__doc__)


def _stage_call(kind):
    own = [key for key in keys_of("stage", kind) if key.leaf != "kind"]
    first, shorts = driver.get(kind, "duration"), short_names_of(kind)

    def call(self, *args, **values):
        if len(args) > 1:
            raise TypeError(f"{kind}() takes one value without a name, {first}; the others are given by name")
        if args:
            values = {first: args[0], **({first: values[first]} if first in values else {}), **values}
            if values[first] is not args[0]:
                raise Error(f"{kind}: {first} is given twice; expected it once")
        for short, long in shorts.items():
            if short in values:
                if long in values:
                    raise Error(f"{kind}: {short} and {long} are the same key; expected it once")
                values[long] = values.pop(short)
        return self._state_stage(kind, values)

    Parameter = inspect.Parameter
    order = sorted(own, key=lambda key: key.leaf != first)
    call.__signature__ = inspect.Signature(
        [Parameter("self", Parameter.POSITIONAL_OR_KEYWORD),
         *(Parameter(key.leaf, Parameter.POSITIONAL_OR_KEYWORD if key.leaf == first else Parameter.KEYWORD_ONLY, default=None,
                     annotation=key.hint) for key in order),
         *(Parameter(short, Parameter.KEYWORD_ONLY, default=None, annotation=by_name["stage." + long].hint)
           for short, long in shorts.items())])
    short = "".join(f" {s} is short for {long}." for s, long in shorts.items())
    carried = " Without normal_stress it keeps that of the stage before." if kind in carries_on else ""
    call.__name__, call.__qualname__, call.__module__ = kind, f"Case.{kind}", __name__
    call.__doc__ = (f"Adds a stage of kind {kind} (name: of the stage, by default {kind}), or states one of that name anew that was read "
                    f"from the file. Returns the case. A number is in SI, a text has a unit.{short}{carried}\n\n"
                    + "\n".join(f"  {key.leaf}: {key.doc.replace(chr(10) * 2, ' (')})" for key in order))
    return call


carries_on = ("shear", "shear_stress")  # kinds that keep the normal stress of the stage before, where the call says none


class CaseKeys:
    """What moraine.Case has from the table of keys."""


for _key in keys_of(""):
    if _key.leaf != "stages":  # case.stages has the stages themselves; case["stages"] is the key
        setattr(CaseKeys, _key.leaf, _top_property(_key))
for _table in classes:
    if _table not in listed:
        setattr(CaseKeys, _table, _table_property(_table))
for _kind in kinds:
    setattr(CaseKeys, _kind, _stage_call(_kind))
