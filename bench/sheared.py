"""Beds made once and kept: in the middle of a shear, and as they were before they packed; tiled for more grains.

A bed belongs to the program that made it, by a hash of its file, and lies under build/bench-beds. `Beds.case` gives a case
directory for `moraine bench`:

  undamped  shear under a wall at 10 kPa, ledger on, gamma_n = 0, from the bed that sheared to a strain of 0.02
  damped    the same with gamma_n = 100 N s/m
  packing   the first steps of `consolidate` of the imported bed, damped, from rest

The bed is ../shared/data/sphere-init-1e4.bin, imported, its suggested case run to the end. Tiles are copies of it along x and y,
whose sides are periodic. A sphere binary carries no springs: the tiled sheared bed goes on for some thousand steps before it is kept.
"""
import hashlib
import math
import shutil
import struct
import tomllib
from pathlib import Path

import h5py
import numpy as np

from bed import bed_file, call
from machine import root

grains_of_bed = 10_000
scenes = ("undamped", "damped", "packing")
normal_stress = 1e4  # Pa
gamma_n = {"undamped": 0.0, "damped": 100.0, "packing": 100.0}  # N s/m
settling = 0.01      # s, a tiled bed shears before it is kept
fast_f = 0.15        # with preset `fast`: its own f is beyond what water bears among grains as large as these


def tile(source, target, copies, grains=None):
    """Write a sphere binary of copies x copies beds side by side.

    grains: position, velocity, spin, rotation, radius to take in place of the source's own, as arrays. What lies behind the
    density in the source is left out, so that only `moraine import-sphere` and readers like it can read the target.
    """
    data = source.read_bytes()
    version, = struct.unpack_from("<d", data, 0)
    if version < 1.03:
        raise ValueError(f"{source}: version {version}, expected 1.03 or later")
    n, = struct.unpack_from("<I", data, 12)
    at = 16 + 36  # version, dimensions and number, then times and number of the file
    geometry = np.frombuffer(data, "<f8", 6, at)
    origin, box = geometry[:3], geometry[3:]
    cells = np.frombuffer(data, "<u4", 3, at + 48)
    switches = 8 if version >= 2.14 - 1e-9 else 4
    switch_bytes = data[at + 60:at + 60 + switches]
    first = at + 60 + switches
    tail = first + 28 * 8 * n
    parameters = data[tail:tail + 8 * (17 + (version >= 2.13 - 1e-9))]
    lists = np.frombuffer(data, "<f8", 28 * n, first)

    def rows(width, start):
        return lists[start * n:(start + width) * n].reshape(n, width)
    own = dict(position=rows(4, 0)[:, :3] - origin, radius=rows(4, 0)[:, 3], velocity=rows(4, 7)[:, :3], rotation=rows(3, 14),
               spin=rows(3, 17))
    g = own if grains is None else grains
    n = len(g["radius"])
    many = copies * copies
    x = np.tile(g["position"], (many, 1))
    x[:, :2] %= box[:2]
    shift = np.array([(i, j) for i in range(copies) for j in range(copies)]).repeat(n, axis=0)
    x[:, :2] += shift * box[:2]
    x += origin

    def again(values):
        return np.tile(values, (many, 1))
    nothing = np.zeros((many * n, 1))
    blocks = [np.hstack([x, again(g["radius"][:, None])]), again(np.zeros((n, 3))), np.hstack([again(g["velocity"]), nothing]),
              again(np.zeros((n, 3))), again(g["rotation"]), again(g["spin"]), again(np.zeros((n, 3))), again(np.zeros((n, 5)))]
    with open(target, "wb") as file:
        file.write(data[:12] + struct.pack("<I", many * n) + data[16:at])
        file.write(np.concatenate([origin, box * [copies, copies, 1]]).astype("<f8").tobytes())
        file.write((cells * [copies, copies, 1]).astype("<u4").tobytes() + switch_bytes)
        for block in blocks:
            file.write(np.ascontiguousarray(block, "<f8").tobytes())
        file.write(parameters)


class Beds:
    def __init__(self, program, folder=root / "build/bench-beds", backend="cpu"):
        self.program, self.backend = Path(program).resolve(), backend
        self.folder = folder / hashlib.sha256(self.program.read_bytes()).hexdigest()[:12]
        self.folder.mkdir(parents=True, exist_ok=True)

    def _once(self, name, make):
        """The directory of that name; made beside it first, so that a broken-off attempt is not taken for a bed."""
        path, part = self.folder / name, self.folder / f"{name}.part"
        if not path.exists():
            shutil.rmtree(part, ignore_errors=True)
            make(part)
            part.rename(path)
        return path

    def _import(self, name, copies, grains=None):
        def make(part):
            binary = bed_file
            if copies > 1:
                binary = self.folder / f"{name}.bin"
                tile(bed_file, binary, copies, grains)
            call(self.program, "import-sphere", binary, part)
            if copies > 1:
                binary.unlink()
        return self._once(name, make)

    def _run(self, case):
        call(self.program, "run", case, "--quiet", "--force", "--backend", self.backend)

    def _case(self, name, text, run=False):
        def make(part):
            part.mkdir()
            (part / "case.toml").write_text(text)
            if run:
                self._run(part)
        return self._once(name, make)

    def resting(self, copies=1):
        return self._import(f"resting-{copies}x{copies}", copies)

    def sheared(self, copies=1):
        """Case directory with the checkpoint and the snapshots of a bed that shears."""
        self.resting()
        if copies == 1:
            return self._case("sheared-1x1", 'extends = "../resting-1x1"\nstart = "../resting-1x1/start.h5"\n', run=True)
        if not (self.folder / f"tiled-{copies}x{copies}").exists():
            with h5py.File(last_snapshot(self.sheared())) as file:
                g = {name: data[:] for name, data in file["grains"].items()}
            self._import(f"tiled-{copies}x{copies}", copies, g)
        return self._case(f"sheared-{copies}x{copies}", f"""\
extends = "../tiled-{copies}x{copies}"
start = "../tiled-{copies}x{copies}/start.h5"
stages = ["shear"]
[output]
series_interval = {settling}
snapshot_interval = {settling}
[[stage]]
name = "shear"
strain = 0
duration = {settling}
zero_kinematics = false
""", run=True)

    def fast(self):
        """As `sheared`, but the bed has gone on with preset `fast`, dry and undamped, and lies as soft springs let it."""
        self.sheared()
        return self._case("fast-1x1", f"""\
extends = "../sheared-1x1"
start = "../sheared-1x1"
stages = ["shear"]
[contact]
gamma_n = 0
[model]
preset = "fast"
f = {fast_f}
[output]
snapshot_interval = 1
[[stage]]
name = "shear"
strain = 0
duration = 0.4
zero_kinematics = false
""", run=True)

    def under(self, name, keys):
        """As `sheared`, but the bed has gone on undamped with these lines in its [contact]."""
        self.sheared()
        return self.going_on(f"under-{name}", self.folder / "sheared-1x1", keys, run=True)

    def going_on(self, name, bed, keys, wall_keys=(), run=False):
        """A case that goes on shearing where that of `bed` ended, undamped, with these lines in [contact] and [wall].

        Walls are smooth: they touch grains of the layers only.
        """
        lines, at_walls = "\n".join(keys), "\n".join(wall_keys)
        return self._case(f"{name}-1x1", f"""\
extends = "../{bed.name}"
start = "../{bed.name}"
stages = ["shear"]
[contact]
gamma_n = 0
{lines}
[wall]
{at_walls}
[output]
series_interval = {settling}
snapshot_interval = {settling}
[[stage]]
name = "shear"
strain = 0
duration = {settling if run else 1}
zero_kinematics = false
wall_mu = 0
wall_gamma_n = 0
wall_gamma_t = 0
""", run=run)

    def case(self, scene, grains=grains_of_bed):
        copies = copies_for(grains)
        name = f"{scene}-{copies}x{copies}"
        if scene == "packing":
            bed = self.resting(copies).name
            return self._case(name, f'extends = "../{bed}"\nstart = "../{bed}/start.h5"\nstages = ["consolidate"]\n'
                              f'[contact]\ngamma_n = {gamma_n[scene]}\n')
        bed = self.sheared(copies).name
        return self._case(name, f'extends = "../{bed}"\nstart = "../{bed}"\nstages = ["shear"]\n[contact]\ngamma_n = '
                          f'{gamma_n[scene]}\n[[stage]]\nname = "shear"\nstrain = 0\nduration = 1\nzero_kinematics = false\n')

    def dt(self, copies=1):
        """s, of a step of the bed: the same in all scenes."""
        with h5py.File(last_snapshot(self.sheared(copies))) as file:
            return float(file.attrs["stage_time"] / file.attrs["step"])

    def settings(self, copies=1):
        """What the case of the imported bed says."""
        return tomllib.loads((self.resting(copies) / "case.toml").read_text())

    def wall_path(self, steps):
        """Heights of the wall that presses in `packing`, m, and their times, s, from the start to `steps` and a little beyond."""
        dt = self.dt()
        self.case("packing")
        case = self._case(f"wall-path-{steps}", f"""\
extends = "../packing-1x1"
[output]
series_interval = {20 * dt!r}
snapshot_interval = 1e3
[[stage]]
name = "consolidate"
duration = {1.02 * steps * dt!r}
""", run=True)
        with h5py.File(case / "output/series.h5") as file:
            return file["stage_time"][:], file["height"][:]


def copies_for(grains):
    copies = round(math.sqrt(grains / grains_of_bed))
    if copies * copies * grains_of_bed != grains:
        raise ValueError(f"{grains} grains: expected {grains_of_bed} times 1, 4, 9, ...")
    return copies


def last_snapshot(case):
    return max((case / "output/snapshots").glob("*-shear-*.h5"))
