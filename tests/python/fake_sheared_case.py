"""Whole cases that were sheared, along +x or mirrored along -x, or to and fro; beside fake_case.py and fake_snapshot.py."""
import shutil

import h5py
import numpy as np

from fake_case import FakeCase, stage, three_stages
from fake_snapshot import write as write_snapshot
from moraine import open as open_case

box = 5.0
rng = np.random.default_rng(7)
place = np.array([[k % 5, k // 5 % 5, k // 25] for k in range(150)]) + 0.5 + rng.integers(-4, 5, (150, 3)) / 128  # exact in a mirror, too
role = np.select([np.arange(150) < 25, np.arange(150) >= 125], [1, 2], 0)
spin, velocity, pressure = rng.normal(0.2, 1, (150, 3)), rng.normal(0.1, 1, (150, 3)), rng.uniform(0, 1e5, 150)


def _pairs():
    d = place[:, None] - place
    d[:, :, :2] -= box * np.round(d[:, :, :2] / box)
    return np.argwhere(np.triu(np.linalg.norm(d, axis=2) < 1.02, 1))


pairs = _pairs()
normal, tangential = rng.exponential(100, len(pairs)), rng.normal(0, 10, (len(pairs), 3))


def shear(rate, strain=0.3, name="shear"):
    return stage(name, "shear", strain=strain, strain_rate=rate, normal_stress=20e3, mu_s=0.3)


def write(directory, stages):
    """Settled, consolidated, and sheared in these stages; three snapshots of each, in which the grains have moved with the top layer in
    proportion to the cube of their height. Gives the FakeCase."""
    case = FakeCase(directory, [*three_stages[:2], *stages], model={"preset": "none", "softening": 1.0, "gravity": 9.8, "dt": 0.0, "ledger": True})
    history = case.history()
    case.write(history)
    case.finish()
    (case.output / "snapshots").mkdir()
    for index, s in enumerate(case.stages):
        rows = history[history["stage"] == index]
        for k, at in enumerate(np.linspace(0, len(rows) - 1, 3).astype(int)):
            turned = rows["shear_strain"][at]
            moved = np.column_stack([2 * turned * (place[:, 2] / 6)**3, 0.01 * turned * spin[:, :2]])
            looser = 1.03125 if s["kind"] == "shear" else 1  # in height
            write_snapshot(case.output / "snapshots", place * [1, 1, looser], 0.5, pairs, normal, tangential, box=(box, box, 0), top_wall=6 * looser,
                           stem=f"{index + 1:02d}-{s['name']}-{k:06d}", time=float(rows["stage_time"][at]), role=role, displacement=moved,
                           velocity=velocity * (1 + k), spin=spin, rotation=turned * spin, pressure=pressure * (1 + 0.1 * k))
    return case


def mirror(source, directory, stages):
    """The same bed in a mirror across x, sheared the other way: `stages` are as for write()."""
    case = FakeCase(directory, [*three_stages[:2], *stages], model={"preset": "none", "softening": 1.0, "gravity": 9.8, "dt": 0.0, "ledger": True})
    case.write(case.history())
    case.finish()
    shutil.copytree(source.output / "snapshots", case.output / "snapshots")
    for file in (case.output / "snapshots").glob("*.h5"):
        with h5py.File(file, "r+") as h5:
            for name in ("grains/displacement", "grains/velocity", "contacts/force_normal", "contacts/force_tangential", "contacts/force"):
                h5[name][:, 0] *= -1
            for name in ("grains/position", "contacts/point"):
                h5[name][:, 0] = box - h5[name][:, 0]
            for name in ("grains/spin", "grains/rotation"):  # axial vectors
                h5[name][:, 1:] *= -1
    return case


def twins(directory):
    """The same case sheared along +x, and its mirror image along -x, opened."""
    plus = write(directory / "plus" / "case", [shear(0.13)])
    minus = mirror(plus, directory / "minus" / "case", [shear(-0.13)])
    return open_case(plus.directory), open_case(minus.directory)


def to_and_fro(directory):
    """Forth, and back to where it began."""
    return open_case(write(directory / "case", [shear(0.13, name="forth"), shear(-0.13, name="back")]).directory)
