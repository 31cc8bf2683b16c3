"""Case directories such as a run leaves them, with made-up numbers: output/case.toml and output/series.h5.

    case = FakeCase(tmp_path / "case")            # three stages, as cases/quick-shear
    case.write(case.history()[:100])              # the first 100 rows, as of a run that has ended or been killed
    with case.open_series(rows) as series:        # as of a run that goes on: SWMR
        series.append(row)

Rows are a structured array with the columns of src/output/series.cpp, which is read for their names, units and meanings.
"""
import contextlib
from pathlib import Path
import re
import sys
import time

import h5py
import numpy as np

source = Path(__file__).resolve().parents[2] / "src/output/series.cpp"
columns = re.findall(r'\{"(\w+)", "([^"]+)",\s*"([^"]+)"\}', source.read_text())  # (name, units, meaning)
dry_columns = [name for name, _, _ in columns].index("wall_water_pressure")  # the rest is there where a stage has water
row_type = np.dtype([(name, float) for name, _, _ in columns])


def stage(name, kind, **settings):
    zero = dict.fromkeys(("duration", "strain", "normal_stress", "velocity", "strain_rate", "shear_stress"), 0.0)
    return {"name": name, "kind": kind} | zero | {"f": 0.075} | settings


three_stages = [
    stage("settle", "settle", duration=0.4),
    stage("consolidate", "consolidate", duration=0.15, normal_stress=20e3),
    stage("shear", "shear", strain=0.3, strain_rate=0.13, normal_stress=20e3),
]


def toml(tables):
    def value(v):
        return {True: "true", False: "false"}[v] if isinstance(v, bool) else f'"{v}"' if isinstance(v, str) else repr(v)

    lines = [f"{k} = {value(v)}" for k, v in tables.items() if not isinstance(v, (dict, list))]
    for name, table in tables.items():
        for one in table if isinstance(table, list) else [table] if isinstance(table, dict) else []:
            lines += [f"\n[[{name}]]" if isinstance(table, list) else f"\n[{name}]"]
            lines += [f"{k} = {value(v)}" for k, v in one.items()]
    return "\n".join(lines) + "\n"


class FakeCase:
    def __init__(self, directory, stages=None, **tables):
        self.directory, self.output = Path(directory), Path(directory) / "output"
        self.stages = three_stages if stages is None else stages
        self.settings = {
            "title": "A case that was made up", "start": "",
            "box": {"x": 0.43, "y": 0.43, "z": 0.0, "periodic": "xy", "floor": True},
            "grains": {"count": 1000, "radius_mean": 0.02, "radius_std": 9.38e-05, "density": 2600.0, "seed": 1},
            "contact": {"k_n": 1.16e7, "k_t": 1.16e7, "mu_s": 0.3, "mu_d": 0.3},
            "model": {"gravity": 9.80665, "f": 0.075, "dt": 0.0, "ledger": True},
            "output": {"series_interval": 0.01, "snapshot_interval": 0.1, "checkpoint_interval": 60.0},
        } | tables | {"stage": self.stages}
        self.output.mkdir(parents=True)
        (self.directory / "case.toml").write_text(toml(self.settings))
        (self.output / "case.toml").write_text("# moraine 0.1.0, cpu, 1 thread, AVX2, seed 1\n" + toml(self.settings))

    @property
    def file(self):
        return self.output / "series.h5"

    def history(self, interval=0.01, dt=1e-4, height=0.32):
        """All rows of all stages: friction with a peak of about 0.5 at a strain of 0.05, dilation, energies that decay. Stages of shear
        that follow each other go on from each other's strain, friction and dilation."""
        parts, began = [], 0.0
        for index, s in enumerate(self.stages):
            rate = s["strain_rate"] or s["velocity"] / height
            end = s["duration"] or s["strain"] / abs(rate)
            t = np.append(np.arange(0, end - 1e-9, interval), end)
            rows = np.zeros(len(t), row_type)
            rows["stage"], rows["step"], rows["stage_time"], rows["time"] = index, np.round(t / dt), t, began + t
            rows["porosity"], rows["coordination"], rows["unbalanced_force"] = 0.42, 4.0, 0.05 + np.exp(-t / 0.05)
            rows["kinetic"], rows["potential"] = 0.02 + 10 * np.exp(-t / 0.05), 100 - np.minimum(t, 1)
            if s["kind"] in ("shear", "shear_stress"):
                strain, d = abs(rate) * t, np.sign(rate)
                goes_on = index > 0 and self.stages[index - 1]["kind"] in ("shear", "shear_stress")
                before = parts[-1][-1] if goes_on else np.zeros((), row_type)
                friction = 0.4 * (1 - np.exp(-strain / 0.005)) + 0.1 * strain / 0.05 * np.exp(1 - strain / 0.05)
                rows["shear_strain"] = before["shear_strain"] + d * strain
                rows["shear_friction"] = before["shear_friction"] * np.exp(-strain / 0.005) + d * friction
                rows["dilation_diameters"] = before["dilation_diameters"] + (-0.1 if goes_on else 0.4) * (1 - np.exp(-strain / 0.2))
                rows["layers_work"] = 100 * strain
            if s["kind"] == "uniaxial":
                rows["dilation_diameters"] = -rate * t * height / 0.04
            rows["dilation"] = 0.04 * rows["dilation_diameters"]
            rows["height"] = height + rows["dilation"]
            rows["normal_stress"] = s["normal_stress"]
            rows["shear_stress"] = rows["shear_friction"] * rows["normal_stress"]
            rows["residue"] = 1e-5 * t if self.settings["model"]["ledger"] else np.nan
            parts.append(rows)
            began += end
        return np.concatenate(parts)

    def write(self, rows):
        """Replaces series.h5 as a run does that begins or resumes: made aside, then renamed."""
        aside = self.file.with_name("series.h5.tmp")
        with h5py.File(aside, "w", libver="latest") as h5:
            h5.attrs["program"] = "moraine"
            wet = any(s.get("fluid") for s in self.stages)
            for name, units, meaning in columns if wet else columns[:dry_columns]:
                dataset = h5.create_dataset(name, data=rows[name], maxshape=(None,), chunks=(256,))
                dataset.attrs["units"], dataset.attrs["meaning"] = np.bytes_(units), np.bytes_(meaning)
        aside.replace(self.file)

    @contextlib.contextmanager
    def open_series(self, rows):
        """Writes these rows and goes on in single-writer multiple-reader mode."""
        self.write(rows)
        with h5py.File(self.file, "r+", libver="latest", locking=False) as h5:  # as readers in the same process must, too
            h5.swmr_mode = True
            yield Writer(h5)

    def finish(self):
        """The part of a checkpoint that says so."""
        with h5py.File(self.output / "checkpoint.h5", "w") as h5:
            h5.attrs["finished"] = np.uint8(1)


class Writer:
    def __init__(self, h5):
        self.h5 = h5

    def append(self, rows):
        rows = np.atleast_1d(rows)
        for name in self.h5:
            dataset = self.h5[name]
            dataset.resize(len(dataset) + len(rows), 0)
            dataset[-len(rows):] = rows[name]
        self.h5.flush()


def run(directory, pause):
    """A run of the whole case, so many seconds between rows."""
    case = FakeCase(directory)
    history = case.history()
    with case.open_series(history[:1]) as series:
        for row in history[1:]:
            series.append(row)
            time.sleep(pause)
    case.finish()


if __name__ == "__main__":
    run(sys.argv[1], float(sys.argv[2]))
