"""Shear in whichever direction: what is read along it, and how stages of shear that follow each other are drawn.

The series is signed, positive along +x. Its strain and dilation are counted from when shear began, over and from the height H_0 of
that moment; stages of shear that follow each other share that origin, so both go on through their seams, and height - dilation is H_0
in any row. A stage is read along its own direction, as its mirror image in x would be if that is -x: along() has its rows and
snapshots so, with strain and displacement from where the stage began. Hence a bed that was mirrored and sheared the other way gives
the same numbers and figures. Only drawn() keeps the signs, where a stage is one of a course of several: there the curve of shear to
and fro is to close.
"""
from functools import cached_property

import numpy as np

from .results import MissingData, Snapshot, Table

signed = ("shear_strain", "shear_stress", "shear_friction", "total_friction")  # columns of the series that change sign with x


def direction(strain):
    """1 or -1: of the way from the first strain to the last; where they are the same, of the largest way from the first."""
    way = np.asarray(strain, float) - strain[0]
    return -1 if (way[-1] or way[np.argmax(np.abs(way))]) < 0 else 1


def height_0(rows):
    """H_0, m: of the bed when shear began."""
    return float(rows["height"][0] - rows["dilation"][0])


def porosity_0(rows):
    """Of the bed when shear began: it was H_0 high, with the same grains in it."""
    height = rows["height"][0]
    return 1 - (1 - rows["porosity"][0]) * (height / (height - rows["dilation"][0]))


def turned(rows):
    """The rows of a stage, along its direction and with the strain from its first row."""
    d = direction(rows["shear_strain"])
    columns = {name: d * rows[name] if name in signed else rows[name] for name in rows}
    columns["shear_strain"] = d * (rows["shear_strain"] - rows["shear_strain"][0])
    return Table(rows.file, columns, rows.units)


def plain(snapshot):
    """What a snapshot has besides its tables."""
    return {k: v for k, v in snapshot.__dict__.items() if k not in ("grains", "contacts", "water")}


class MirrorImage(Snapshot):
    """A snapshot as seen in a mirror across x."""

    axial = ("spin", "rotation", "torque")  # components along the mirror turn round, the one across it stays

    def __init__(self, snapshot):
        self.__dict__.update(plain(snapshot))
        self.mirrored = snapshot

    def _seen(self, table, places):
        columns = {}
        for name, values in table.columns.items():
            if values.ndim == 2:
                values = values * ([1, -1, -1] if name in self.axial else [-1, 1, 1])
                if name in places:
                    values = values + [self.box[0], 0, 0]
            columns[name] = values
        return Table(table.file, columns, table.units)

    @cached_property
    def grains(self):
        return self._seen(self.mirrored.grains, ("position",))

    @cached_property
    def contacts(self):
        return self._seen(self.mirrored.contacts, ("point",))

    @cached_property
    def water(self):
        (nx, ny, nz), _ = self.water_grid
        table = self._seen(self.mirrored.water, ())
        def cells(values):
            by_place = values.reshape(nz, ny, nx, *values.shape[1:])
            return by_place[:, :, ::-1].reshape(values.shape)
        return Table(table.file, {name: cells(values) for name, values in table.columns.items()}, table.units)


class SinceStage(Snapshot):
    """A snapshot whose displacements and rotations are those since `first`, by grain."""

    def __init__(self, snapshot, first):
        self.__dict__.update(plain(snapshot))
        self.whole, self.first = snapshot, first

    @cached_property
    def grains(self):
        now, before = self.whole.grains, self.first.grains
        if not np.array_equal(now["id"], before["id"]):
            raise MissingData(f"{now.file}: its grains are not those of {before.file}, from which displacement is to be counted")
        since = {name: now[name] - before[name] for name in ("displacement", "rotation") if name in now and name in before}
        return Table(now.file, now.columns | since, now.units)

    @property
    def contacts(self):
        return self.whole.contacts

    @property
    def water(self):
        return self.whole.water


def mirrored(snapshot, d):
    """As it is for d = 1, its mirror image for d = -1."""
    return MirrorImage(snapshot) if d < 0 else snapshot


class AlongShear:
    """A stage of shear as seen along its direction: `series` and `snapshots`; all else is that of the stage."""

    def __init__(self, stage):
        self.stage = stage

    def __getattr__(self, name):
        return getattr(self.stage, name)

    @cached_property
    def _signed(self):
        return self.stage.series

    @cached_property
    def direction(self):
        return direction(self._signed["shear_strain"])

    @cached_property
    def series(self):
        return turned(self._signed)

    @cached_property
    def snapshots(self):
        found = self.stage.snapshots
        if found[0].stage_time == 0:
            found = [SinceStage(s, found[0]) for s in found]
        elif course(self.stage)[0].index != self.stage.index:  # earlier stages have moved the grains before
            raise MissingData(f"{found[0].file}: is the first snapshot of stage {self.stage.name}, which shears on after another "
                              "stage; expected one of its beginning, from which its displacement is counted")
        return [mirrored(s, self.direction) for s in found]


def along(stage):
    """A stage of shear as seen along its direction."""
    return stage if isinstance(stage, AlongShear) else AlongShear(stage)


def courses(stages):
    """[[stages of shear that follow each other]] in order."""
    groups = []
    for before, stage in zip([None, *stages], stages):
        if stage.sheared:
            if before is None or not before.sheared:
                groups.append([])
            groups[-1].append(stage)
    return groups


def course(stage):
    """The stages of shear that follow each other of which this is one."""
    return next(group for group in courses(stage.case.stages) if any(s.index == stage.index for s in group))


def drawn(stage):
    """[rows of each stage] of the course that a stage of shear belongs to, as far as there are any, as they are drawn: alone along its
    direction; of several each signed, with the strain since shear began, so that shear to and fro makes a closed curve."""
    group = course(stage)
    if len(group) == 1:
        return [along(stage).series]
    series = stage.case.series
    present = [series.rows(series["stage"] == s.index) for s in group]
    return [rows for rows in present if len(rows)]


def is_loop(stage):
    """Whether the stage is drawn with others, so that its strain and friction may have either sign."""
    return len(course(stage)) > 1


def drawn_series(series, stages):
    """The whole series with each stage as drawn() has it."""
    columns = dict(series.columns)
    for group in courses(stages):
        own = series["stage"] == group[0].index
        if len(group) == 1 and own.any():
            seen = turned(series.rows(own))
            for name in signed:
                if name in columns:
                    columns[name] = columns[name].copy()
                    columns[name][own] = seen[name]
    return Table(series.file, columns, series.units)


def joined(tables):
    """One below the other."""
    return Table(tables[0].file, {name: np.concatenate([t[name] for t in tables]) for name in tables[0]}, tables[0].units)


def of(case):
    """The stage of shear of a case, seen along its direction: the one of that name, else the last of kind shear, else of shear_stress."""
    plain_shear = any("shear" in (s.name, s.kind) for s in case.stages)
    return along(case.stage("shear" if plain_shear else "shear_stress"))
