"""Reads, measures and draws the results of Moraine. `moraine.open(CASE)` is where to begin; see `moraine.case`."""
from .case import Case, MissingData, Snapshot, Stage, Table, open

__all__ = ["Case", "MissingData", "Snapshot", "Stage", "Table", "open"]
__version__ = "0.1.0"
