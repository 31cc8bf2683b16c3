"""The bed that packs down, in LAMMPS: all grains free, under gravity between a floor and a wall that comes down.

Contacts between grains: springs, normal damping, friction, with memory. Floor and wall: a normal spring, and dampers whose
tangential force friction bounds, as Moraine has them. Two things differ. LAMMPS has no wall that a stress moves: its wall goes
the way that Moraine's wall went (a polynomial within some 0.04 mm of it), so that LAMMPS is spared the wall's equation of
motion. And LAMMPS measures damping by the reduced mass, Moraine by the pair: gamma_n / m is taken at the mean grain.
"""
import json
import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

import h5py
import numpy as np

warm_up = 100  # steps, as `moraine bench` does before it looks at the clock


def motion_formula(time, place, variable):
    """place(t) - place(0) as a LAMMPS formula of the named variable, which must run over the times' range from 0 to 1."""
    p = np.polynomial.Polynomial.fit(time / time[-1], place, 9).convert().coef
    formula = "0.0"
    for c in reversed(p[1:]):
        formula = f"({formula}+({float(c)!r}))*v_{variable}"
    return formula


def pack(start, settings, gamma_n, dt, wall, steps, ranks, skin, style="gran/hooke/history", program="lmp"):
    """Time the steps after the warm-up; `wall` is the wall's times, s, and heights, m. Returns what LAMMPS says of it."""
    contact, stage = settings["contact"], settings["stage"][0]
    density, box = settings["grains"]["density"], settings["box"]
    with h5py.File(start) as file:
        x, r = file["state/x"][:], file["state/r"][:]
    mass = density * 4 / 3 * np.pi * r.mean() ** 3  # kg
    k_n, k_t, mu = contact["k_n"], contact["k_t"], contact["mu_d"]
    damping = gamma_n / (mass / 2)
    if style == "granular":
        pair = f"pair_style granular\npair_coeff * * hooke {k_n} {damping!r} tangential linear_history {k_t} 0.0 {mu}"
    else:
        pair = f"pair_style {style} {k_n} {k_t} {damping!r} 0.0 {mu} 0\npair_coeff * *"
    plane = f"hooke {k_n} NULL {stage['wall_gamma_n'] / mass!r} {stage['wall_gamma_t'] / mass!r} {stage['wall_mu']} 1"
    time, height = wall
    script = f"""\
units si
atom_style sphere
boundary p p f
processors {ranks} 1 1
newton off
comm_modify vel yes
read_data bed.data
neighbor {skin} bin
neigh_modify delay 0 every 1 check yes
{pair}
timestep {dt!r}
fix weight all gravity {settings['model']['gravity']} vector 0 0 -1
fix move all nve/sphere
fix floor all wall/gran {plane} zplane 0.0 NULL
variable s equal step*dt/{float(time[-1])!r}
variable down equal {motion_formula(time, height, 's')}
region wall plane 0 0 {float(height[0])!r} 0 0 -1 move NULL NULL v_down
fix wall all wall/gran/region {plane} region wall
thermo_style custom step ke
thermo 1000000
run {warm_up}
run {steps}
"""
    with tempfile.TemporaryDirectory() as tmp:
        with open(Path(tmp) / "bed.data", "w") as file:
            file.write(f"bed\n\n{len(r)} atoms\n1 atom types\n\n0 {box['x']!r} xlo xhi\n0 {box['y']!r} ylo yhi\n"
                       f"{-r.max()!r} {height[0] + 4 * r.max()!r} zlo zhi\n\nAtoms\n\n")
            file.writelines(f"{i + 1} 1 {2 * q!r} {density!r} {a % box['x']!r} {b % box['y']!r} {c!r}\n"
                            for i, ((a, b, c), q) in enumerate(zip(x.tolist(), r.tolist())))
        (Path(tmp) / "in.lmp").write_text(script)
        command = [program, "-in", "in.lmp", "-log", "log.lammps"]
        if ranks > 1:
            command = ["mpirun", "--oversubscribe", "--allow-run-as-root", "-np", str(ranks)] + command
        run = subprocess.run(command, cwd=tmp, capture_output=True, text=True, env=dict(os.environ, OMP_NUM_THREADS="1"))
    if run.returncode:
        sys.exit(f"LAMMPS failed:\n{run.stdout[-2000:]}{run.stderr[-2000:]}")
    def last(pattern):
        return float(re.findall(pattern, run.stdout)[-1])
    return dict(ms_per_step=1e3 * last(r"Loop time of ([\d.e+-]+)") / steps, neighbours_per_grain=last(r"Ave neighs/atom = ([\d.]+)"),
                list_builds=int(last(r"Neighbor list builds = (\d+)")), kinetic_J=last(rf"\n +{warm_up + steps} +([\d.e+-]+)"))
