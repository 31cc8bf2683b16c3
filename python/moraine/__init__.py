"""Grain-scale till mechanics: builds, runs, measures and draws cases of Moraine.

`moraine.Case` is where to begin, `moraine.open(DIRECTORY)` opens results that are there.
"""
import importlib
from typing import TYPE_CHECKING

if TYPE_CHECKING:  # for editors; they are loaded on demand
    from .case import Case
    from .results import Results, Snapshot, Stage, Table, open
    from .run import Error, Run
    from .sealed import MissingData
    from .sweep import Sweep

__version__ = "0.1.0"

_home = {  # module of each public name; on demand, as some need no NumPy, and only some the compiled part
    "Results": "results", "MissingData": "sealed", "Snapshot": "results", "Stage": "results", "Table": "results", "open": "results",
    "Case": "case", "Sweep": "sweep", "Run": "run", "Error": "run",
}
__all__ = list(_home)


def __getattr__(name):
    if name not in _home:
        raise AttributeError(f"module {__name__} has no {name}")
    return getattr(importlib.import_module(f".{_home[name]}", __name__), name)


def __dir__():
    return sorted([*globals(), *__all__])
