"""Moraine as a program: a case written, run on one thread, and what it left read back."""
import os
from pathlib import Path
import resource
import subprocess
import sys

import h5py
import numpy as np

sys.path.append(str(Path(__file__).resolve().parents[2] / "python"))
from moraine.sealed import seal  # noqa: E402


class Failed(Exception):
    """The program stopped; the message is its own."""


def write_case(directory, text):
    directory.mkdir(parents=True, exist_ok=True)
    (directory / "case.toml").write_text(text)
    return directory


def run(program, case, cpu_limit=None):
    """Seconds of processor time. That, not the wall clock, is what a busy machine distorts least."""
    limit = None if cpu_limit is None else lambda: resource.setrlimit(resource.RLIMIT_CPU, (int(cpu_limit), int(cpu_limit) + 5))
    with open(case / "stdout.txt", "w+") as out:
        process = subprocess.Popen([str(program), "run", str(case), "--force", "--quiet", "--threads", "1", "--backend", "cpu"],
                                   stdout=out, stderr=subprocess.STDOUT, preexec_fn=limit)
        _, status, used = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
        out.seek(0)
        text = out.read().strip()
    if process.returncode:
        said = text.split("\n")[-1].partition("; the last good checkpoint")[0]  # what follows is a path
        raise Failed(said or f"stopped by signal {-process.returncode} (limit {cpu_limit:.0f} s of processor time)")
    return used.ru_utime + used.ru_stime


def series(case, stage=-1):
    with h5py.File(case / "output/series.h5") as file:
        of = file["stage"][:]
        chosen = of == (of[-1] if stage < 0 else stage)
        return {name: data[:][chosen] for name, data in file.items()}


def last_snapshot(case):
    """Grains, and the height of the top wall."""
    path = sorted((case / "output/snapshots").glob("*.h5"))[-1]
    with h5py.File(path) as file:
        return {name: data[:] for name, data in file["grains"].items()}, float(file.attrs["top_wall"])


def write_start(program, directory, positions, radius, velocity=None, spin=None, wall=0.0):
    """A checkpoint with these grains in it: equal radii, at rest unless said otherwise, no contact yet."""
    n = len(positions)
    write_case(directory, f"""\
[box]
x = 1
y = 1
floor = false
[grains]
count = {n}
radius_mean = {radius!r}
radius_std = 0
columns_x = 3
columns_y = 3
[model]
gravity = 0
dt = 1e-9
[[stage]]
name = "lattice"
kind = "settle"
duration = 1e-9
""")
    run(program, directory)
    path = directory / "output/checkpoint.h5"
    with h5py.File(path, "r+") as file:
        state = file["state"]
        order = state["id"][:]
        for name, values in (("x", positions), ("x_start", positions), ("v", velocity), ("omega", spin)):
            state[name][:] = 0 if values is None else np.asarray(values, float)[order]
        state.attrs["staggered"] = np.array(0, state.attrs["staggered"].dtype)
        state.attrs["wall_z"] = wall
    seal(path)
    return path
