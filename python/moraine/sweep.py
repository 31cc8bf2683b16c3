"""Sweeps from Python: many cases, and one table of what came out."""
from functools import cached_property
from itertools import product
from pathlib import Path
import tomllib

from . import strength
from .case import toml_item as _item
from .results import MissingData, Results
from .run import Error, _core
from .tables import by_name, keys, listed

# What the table has of each case, from its last shear stage or else its last stage, and the units.
measured = {"peak": "1", "peak_strain": "1", "ultimate": "1", "dilation_diameters": "1", "porosity": "1", "height": "m", "strain": "1"}


class Sweep:
    """Cases that differ in a few keys.

    names, directories: of the cases, in the order of the values, the last list changing fastest.
    results: a moraine.Results for each.
    table: a pandas.DataFrame with a row for each; first the values in SI, then
        peak, peak_strain  largest shear friction, as a mean over a strain of 0.02, and the strain at which it is reached
        ultimate           mean shear friction over the last third of the strain
        dilation_diameters how much the bed has risen since shear began, in mean grain diameters, mean over the last tenth of the strain
        porosity, height   at the end; height in m
        strain             shear strain at the end
    nan where a case is not sheared. table.attrs["units"] has the unit of each column.
    """

    def __init__(self, units: dict[str, str], rows: list[dict], values: list[dict]):
        self._units, self._values = units, values  # of the keys that are swept; in SI, for each case
        self.names = [row["name"] for row in rows]
        self.directories = [Path(row["directory"]) for row in rows]

    @cached_property
    def results(self) -> list[Results]:
        return [Results(directory) for directory in self.directories]

    @cached_property
    def table(self):
        import pandas
        rows = [{**values, **_measure(one)} for values, one in zip(self._values, self.results)]
        table = pandas.DataFrame(rows, columns=[*self._units, *measured], index=pandas.Index(self.names, name="case"))
        table.attrs["units"] = {**self._units, **measured}
        return table

    def __len__(self):
        return len(self.names)

    def __repr__(self):
        return repr(self.table)

    def _repr_html_(self):
        return self.table._repr_html_()


def _measure(results):
    last = results.stages[-1]
    sheared = [stage for stage in results.stages if stage.kind == "shear"]
    row = {name: float("nan") for name in measured}
    try:
        row["porosity"], row["height"] = (float(last.series[name][-1]) for name in ("porosity", "height"))
        if sheared:
            s = strength.strength(sheared[-1])
            row |= {"peak": s.peak, "peak_strain": s.peak_strain, "ultimate": s.ultimate, "dilation_diameters": s.dilation, "strain": s.strain}
            rows = sheared[-1].series
            row["porosity"], row["height"] = float(rows["porosity"][-1]), float(rows["height"][-1])
    except MissingData:  # too short for any of it
        pass
    return row


def _spelled(name, value):
    """A value as one types it behind --set, so that folders get the names that `moraine sweep` gives them."""
    text = _item(name, value).as_string()
    plain = isinstance(value, str) and value.strip() and not set(value) & set("\"'[]{},#\\")
    return str(value) if plain else text


def _key(name):
    """The row of the table of keys for a name that may lack its table; None: the program will say what is wrong with it."""
    table, _, rest = name.partition(".")
    if table in listed and rest:
        return by_name.get(f"{table}.{rest.rpartition('.')[2]}")
    return by_name.get(name) or next((key for key in keys if key.leaf == name and key.table not in ("material", "pair")), None)


def _in_si(name, value):
    key = _key(name)
    if key is None:
        return value
    return tomllib.loads("v = " + _core.check_value(key.name, _item(name, value).as_string()))["v"]


def sweep(case, values, *, progress, **options):
    """See moraine.Case.sweep."""
    sets, units, in_si = [], {}, []
    for name, given in values.items():
        given = given.tolist() if hasattr(given, "tolist") else given  # of NumPy
        is_list = isinstance(given, (list, tuple, range))
        many = list(given) if is_list else [given]
        if not many:
            raise Error(f"sweep: {name} = []: expected a value at least")
        key = _key(name)
        in_si_here = [_in_si(name, one) for one in many]  # raises where one is wrong
        if key and key.unit not in ("", "1") and any(isinstance(one, str) for one in many):  # or another's unit would be theirs
            many = [one if isinstance(one, str) else f"{one!r} {key.unit}" for one in many]
        text = ",".join(_spelled(name, one) for one in many)
        sets.append((name, text + "," if is_list and len(many) == 1 else text))
        if is_list:
            units[name] = key.unit or "1" if key else "1"
            in_si.append(in_si_here)
    rows = _run(case, sets, progress, **options)
    stopped = [f"\n  {row['name']}: {row['message'] or row['state']}" for row in rows if row["state"] != "finished"]
    if stopped:
        raise Error(f"{len(stopped)} of {len(rows)} cases did not finish (resume=True goes on with them):{''.join(stopped)}")
    values = [dict(zip(units, one)) for one in product(*in_si)]  # in the order of the cases
    return Sweep(units, rows, values)


def _run(case, sets, progress, *, threads, at_once, resume, force, backend):
    def begin(say, show):
        return _core.sweep(str(case.directory), sets, threads, backend, resume, force, at_once, say, show)
    if not progress:
        return begin(lambda line: None, lambda done, line: None)

    from tqdm.auto import tqdm
    with tqdm(total=100, bar_format="{l_bar}{bar}| {elapsed} {postfix}") as bar:
        def say(line):
            tqdm.write(": ".join(line.split(": ")[:2]) if line.startswith("stopped") else line)  # the error at the end says why

        def show(done, line):
            bar.n = 100 * done
            cases, _, left = line.partition("%")
            bar.set_postfix_str(cases[:-7].strip() + left.replace("  ETA unknown", ""))  # the bar has the share
        return begin(say, show)
