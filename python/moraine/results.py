"""A case directory as arrays.

    case = moraine.open("cases/quick-shear")
    shear = case.stage("shear")
    shear.series["shear_friction"]            # one number for each row of the stage
    shear.series.units["shear_stress"]        # "Pa"
    shear.snapshots[-1].grains["position"]    # n x 3, m

Everything is in SI units, x along the shear direction, z up, stresses positive in compression. Data is read when it is first
asked for. A case that is still running can be opened, too: series.h5 is read in HDF5's single-writer multiple-reader mode.
"""
from functools import cached_property
from pathlib import Path
import tomllib

import h5py
import numpy as np

from .sealed import MissingData, is_sealed, read


class Table:
    """Columns of a group of an HDF5 file, by name; `units` by the same names."""

    def __init__(self, file, columns, units):
        self.file, self.columns, self.units = Path(file), columns, units

    def __getitem__(self, name):
        try:
            return self.columns[name]
        except KeyError:
            raise MissingData(f"{self.file}: there is no dataset {name}; it has {', '.join(self.columns) or 'none'}") from None

    def __contains__(self, name):
        return name in self.columns

    def __iter__(self):
        return iter(self.columns)

    def __len__(self):
        """Rows."""
        return len(next(iter(self.columns.values()), ()))

    def rows(self, which):
        """The table with these rows only (a mask, a slice, or indices)."""
        return Table(self.file, {name: column[which] for name, column in self.columns.items()}, self.units)


def _table(file, h5, name="/"):
    """Of the group `name` of an open file."""
    group = h5.get(name)
    if not isinstance(group, h5py.Group):
        raise MissingData(f"{file}: there is no group {name}")
    datasets = {name: d for name, d in group.items() if isinstance(d, h5py.Dataset)}
    units = {name: d.attrs.get("units", b"") for name, d in datasets.items()}
    units = {name: u.decode() if isinstance(u, bytes) else str(u) for name, u in units.items()}
    return Table(file, {name: d[()] for name, d in datasets.items()}, units)


def _numbers(values):
    return np.array(values, float)


class Snapshot:
    """All grains and contacts at one time.

    grains: id, role (0 free, 1 lower layer, 2 driven layer), radius m, position m, displacement m, velocity m/s, spin rad/s,
    rotation rad, force N, pressure Pa. contacts, forces on grain i: i, j, point m, force_normal N, force_tangential N, overlap m.
    water, by cell, x fastest: pressure Pa (over hydrostatic), porosity, permeability m2, flux m/s.
    """

    def __init__(self, file):
        self.file = Path(file)

    @cached_property
    def _sealed(self):
        return is_sealed(self.file)

    def _attributes(self, group, problem, **types):
        def take(h5):
            try:
                return {name: kind(h5[group].attrs[name]) for name, kind in types.items()}
            except KeyError as why:
                raise MissingData(f"{self.file}: {problem}: {why}") from None
        return read(self.file, take, self._sealed)

    @cached_property
    def _about(self):
        return self._attributes("/", "not a snapshot of Moraine", time=float, stage_time=float, box=_numbers, top_wall=float)

    @property
    def time(self):
        """s, since the case began"""
        return self._about["time"]

    @property
    def stage_time(self):
        """s"""
        return self._about["stage_time"]

    @property
    def box(self):
        """m; x and y are the periodic sides"""
        return self._about["box"]

    @property
    def top_wall(self):
        """m; its height"""
        return self._about["top_wall"]

    def _group(self, name):
        table = read(self.file, lambda h5: _table(f"{self.file}:/{name}", h5, name), self._sealed)
        if len({len(column) for column in table.columns.values()}) > 1:
            raise MissingData(f"{table.file}: the datasets differ in length")
        return table

    @cached_property
    def grains(self):
        return self._group("grains")

    @cached_property
    def contacts(self):
        table = self._group("contacts")
        if any(len(table) and not 0 <= table[k].min() <= table[k].max() < len(self.grains) for k in "ij"):
            raise MissingData(f"{table.file}: has contacts of grains that are not in the snapshot")
        return table

    @cached_property
    def water(self):
        return self._group("water")

    @cached_property
    def water_grid(self):
        """Cells along x, y, z, and the sides of the grid, m; its top is that of the bed, and it follows that."""
        found = self._attributes("water", "there is no water in it", cells_x=int, cells_y=int, cells_z=int, size=_numbers)
        return (found["cells_x"], found["cells_y"], found["cells_z"]), found["size"]

    @property
    def area(self):
        """Of the horizontal cross-section, m^2."""
        return self.box[0] * self.box[1]

    def branches(self):
        """From the centre of j to that of i of each contact, across periodic sides; n x 3, m (x_ij of eq. 5)."""
        x = self.grains["position"]
        d = x[self.contacts["i"]] - x[self.contacts["j"]]
        for axis in (0, 1):
            d[:, axis] -= self.box[axis] * np.round(d[:, axis] / self.box[axis])
        return d

    def normal_forces(self):
        """Magnitude of f_n of each contact, N."""
        return np.linalg.norm(self.contacts["force_normal"], axis=1)


class Stage:
    """One stage of a case: its settings (SI), its rows of the series, its snapshots in order of time."""

    def __init__(self, case, index, settings):
        self.case, self.index, self.settings = case, index, settings
        self.name, self.kind = settings["name"], settings["kind"]

    @property
    def series(self):
        table = self.case.series
        own = table.rows(table["stage"] == self.index)
        if not len(own):
            raise MissingData(f"{table.file}: no rows of stage {self.name} (stage = {self.index}) yet")
        return own

    @cached_property
    def snapshots(self):
        pattern = f"{self.index + 1:02d}-{self.name}-*.h5"  # files count stages from 1, the series from 0
        found = sorted((self.case.output / "snapshots").glob(pattern))
        if not found:
            raise MissingData(f"{self.case.output}/snapshots: there is no snapshot {pattern}")
        return [Snapshot(f) for f in found]

    @property
    def sheared(self):
        return self.kind in ("shear", "shear_stress")

    @property
    def wet(self):
        """Whether there is pore water."""
        return self.settings.get("fluid", False)


class Results:
    def __init__(self, directory):
        self.directory = Path(directory)
        self.output = self.directory / "output"
        try:
            self.text = (self.output / "case.toml").read_text(errors="replace")
        except (FileNotFoundError, NotADirectoryError):
            what = "has no results yet; run it first: ./moraine run" if (self.directory / "case.toml").exists() else \
                "is no case directory, which would hold a case.toml:"
            raise MissingData(f"{self.directory} {what} {self.directory}") from None
        except OSError as why:
            raise MissingData(f"{self.output}/case.toml: cannot be read: {why.strerror or why}") from None
        try:
            self.settings = tomllib.loads(self.text)
            self.stages = [Stage(self, k, s) for k, s in enumerate(self.settings["stage"])]
            self.seed = self.settings["grains"]["seed"]
        except (ValueError, KeyError, TypeError) as why:  # of tomllib, too
            raise MissingData(f"{self.output}/case.toml: not what a run of Moraine writes: {why}") from None

    def __repr__(self):
        return f"Results({str(self.directory)!r}: {', '.join(s.name for s in self.stages)})"

    @cached_property
    def series(self):
        return self.read_series()

    def read_series(self):
        """The whole series as it is now; `series` keeps what it has once read."""
        file = self.output / "series.h5"
        # A lock, however short, could make a run that resumes fail.
        table = read(file, lambda h5: _table(file, h5), swmr=True, locking=False)
        length = min((len(c) for c in table.columns.values()), default=0)  # a row may be on its way
        return table.rows(slice(length))

    def refresh(self):
        """Forgets what has been read, of a case that goes on: the next look at series and snapshots has what there is then. Returns self."""
        for one in (self, *self.stages):
            for read_once in ("series", "snapshots"):
                vars(one).pop(read_once, None)
        return self

    def stage(self, which):
        """By name, or the last of a kind: stage("shear")."""
        for fits in (lambda s: s.name == which, lambda s: s.kind == which):
            if found := [s for s in self.stages if fits(s)]:
                return found[-1]
        raise MissingData(f"{self.output}/case.toml: there is no stage {which}; it has {', '.join(s.name for s in self.stages)}")

    @property
    def normal_stress(self):
        """sigma_0 of the last stage that has one, Pa; of one that changes the largest in the series."""
        for stage in reversed(self.stages):
            sigma_0 = stage.settings.get("normal_stress", 0)
            if isinstance(sigma_0, dict):  # a history
                sigma_0 = float(stage.series["asked_normal_stress"].max())
            if sigma_0 > 0:
                return sigma_0
        raise MissingData(f"{self.output}/case.toml: no stage has a normal_stress")

    @property
    def diameter(self):
        """Mean grain diameter 2 r, m; of the grains themselves where there is a snapshot, else as asked for."""
        for stage in self.stages:
            try:
                return 2 * float(stage.snapshots[0].grains["radius"].mean())
            except MissingData:
                continue
        return 2 * self.settings["grains"]["radius_mean"]


def open(directory):  # noqa: A001 - as in h5py, numpy and PIL
    """The results in a case directory. Raises MissingData where there are none."""
    return Results(directory)
