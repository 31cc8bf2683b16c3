"""Case directories with a shear stage that has, or might have, pore water; beside fake_case.py."""
import h5py
import numpy as np

from fake_case import FakeCase, stage, toml

cells, height = (3, 3, 4), 0.8
water = {"viscosity": 1.8e-3, "compressibility": 4.5e-10, "permeability_factor": 3.5e-9}


def write(directory, wet=True, rate=0.05, k_c=3.5e-9, snapshots=4, rows=None, peak=1.0, seed=1, **fluid):
    """A shear stage to a strain of 0.3. Wet: water that falls by 2 kPa at the peak of friction, `peak` times as high as a dry bed's, and
    snapshots whose pressure is -1000 Pa x the number of the level x that of the snapshot."""
    case = FakeCase(directory, [stage("shear", "shear", strain=0.3, strain_rate=rate, normal_stress=20e3, mu_s=0.3, fluid=wet)],
                    fluid=water | {"enabled": wet, "permeability_factor": k_c} | fluid)
    case.settings["grains"]["seed"] = seed
    (case.output / "case.toml").write_text(toml(case.settings))
    history = case.history(interval=0.001 / abs(rate), height=height)
    strain = abs(history["shear_strain"])
    history["total_friction"] = peak * history["shear_friction"]
    history["shear_stress"] = peak * 20e3 * history["shear_friction"]
    history["water_pressure_mean"] = -2e3 * strain / 0.05 * np.exp(1 - strain / 0.05)
    case.write(history[:rows])
    if rows is None:
        case.finish()
    (case.output / "snapshots").mkdir()
    for k in range(snapshots):
        with h5py.File(case.output / f"snapshots/01-shear-{k:06d}.h5", "w") as h5:
            h5.attrs.update({"time": 1.0 * k, "stage_time": 1.0 * k, "box": [0.3, 0.3, 0.0], "top_wall": height})
            h5["grains/radius"] = np.full(5, 0.02)
            if wet:
                group = h5.create_group("water")
                group.attrs.update({f"cells_{axis}": n for axis, n in zip("xyz", cells)} | {"size": [0.3, 0.3, height + 0.01 * k]})
                group["pressure"] = -1000.0 * k * np.repeat(np.arange(1, cells[2] + 1), cells[0] * cells[1])
                group["flux"] = np.zeros((np.prod(cells), 3))
