"""Reads, measures and draws the results of Moraine. `moraine.open(CASE)` is where to begin; see `moraine.case`."""
__all__ = ["Case", "MissingData", "Snapshot", "Stage", "Table", "open"]
__version__ = "0.1.0"


def __getattr__(name):  # on demand: the workflow's own Python may lack numpy and h5py
    if name not in __all__:
        raise AttributeError(f"module {__name__} has no {name}")
    from . import case
    return getattr(case, name)
