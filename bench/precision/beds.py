"""Sheared beds: chaotic, so only their statistics can be compared.

Bed: 600 grains of Table 1 in a periodic box eight grains wide, under 80 kPa. Prepared once for each seed at k_n/100 with damping
and mu = 0.1 (dense); then, for each setting, stiffness set, springs cleared, damped consolidation for 0.05 s at mu = 0.1, and shear
at mu = 0.3 without damping. `paper` is f = 0.075, k_n = 1.16e9 N/m, 0.05 1/s.
"""
import hashlib
import json
import math
import shutil
from typing import NamedTuple

import numpy as np

from program import Failed, last_snapshot, run, series, write_case

k_paper, stress, rate_paper, radius, density = 1.16e9, 80e3, 0.05, 0.02, 2600.0  # N/m, Pa, 1/s, m, kg/m3
mass = density * 4 / 3 * math.pi * radius**3


class Setting(NamedTuple):
    f: float = 0.075      # dt over sqrt(min m / k)
    soft: float = 1       # k_n is k_paper over this
    faster: float = 1     # shear rate over that of the paper

    @property
    def name(self):
        return f"f{self.f:g}-k{self.soft:g}-r{self.faster:g}"

    @property
    def stiffness(self):  # k_n/(sigma_0 d)
        return k_paper / self.soft / (stress * 2 * radius)

    @property
    def inertia(self):  # eq. 1
        return rate_paper * self.faster * radius * math.sqrt(density / stress)

    @property
    def steps(self):  # for a unit of strain
        return 1 / (rate_paper * self.faster) / (self.f * math.sqrt(mass * self.soft / k_paper))


paper = Setting()
statistics = {  # unit, meaning
    "peak": ("1", "largest mean of the shear friction over a strain of 0.02"),
    "ultimate": ("1", "mean shear friction over the last third of the strain"),
    "dilation": ("d", "height gained at the end, in mean diameters"),
    "shear_zone": ("d", "displacement integrated over the height, over that of the top layer, in diameters"),
    "coordination": ("1", "contacts for each grain, mean over the last third of the strain"),
    "porosity_low": ("1", "porosity of the lower third at the end"),
    "porosity_middle": ("1", "of the middle third"),
    "porosity_top": ("1", "of the upper third"),
}


def text(size, seed, soft, stages):
    k = k_paper / soft
    return f"""\
{stages[0]}
[box]
x = {size.side!r}
y = {size.side!r}
[grains]
count = {size.grains}
columns_x = {size.columns}
columns_y = {size.columns}
cell = 1.06
seed = {seed}
[contact]
k_n = {k!r}
k_t = {k!r}
[wall]
mass = {6.4e-4 * size.grains!r}
{stages[1]}"""


def damped(soft):
    """A tenth of critical damping, for grains and walls."""
    gamma = 0.2 * math.sqrt(mass * k_paper / soft)
    viscosities = "".join(f"{key} = {gamma!r}\n" for key in ("gamma_n", "gamma_t", "wall_gamma_n", "wall_gamma_t"))
    return viscosities + "mu_s = 0.1\nmu_d = 0.1\nf = 0.075\n"


class Size(NamedTuple):
    grains: int
    side: float  # m
    columns: int
    strain: float


full, quick = Size(600, 0.32, 7, 0.25), Size(200, 0.22, 5, 0.15)


class Beds:
    def __init__(self, program, state, size):
        self.program, self.state, self.size = program, state, size
        self.version = hashlib.sha256(program.read_bytes()).hexdigest()[:12]

    def file(self, setting, seed):
        return self.state / f"bed{self.size.grains}-{setting.name}-seed{seed}.json"

    def prepare(self, seed):
        case = self.state / f"prepared{self.size.grains}-seed{seed}"
        if not (case / "done").exists():
            write_case(case, text(self.size, seed, 100, ("", f"""\
[[stage]]
name = "settle"
kind = "settle"
duration = 0.35
{damped(100)}
[[stage]]
name = "press"
kind = "consolidate"
normal_stress = {stress!r}
duration = 0.06
{damped(100)}""")))
            run(self.program, case)
            (case / "done").touch()
        return case

    def relax(self, case, prepared, seed, soft):
        """The bed at this stiffness: its springs cleared, since their stretch belongs to the old one."""
        write_case(case, text(self.size, seed, soft, (f'start = "{prepared.resolve()}"', f"""\
[[stage]]
name = "relax"
kind = "consolidate"
normal_stress = {stress!r}
duration = 0.05
clear_history = true
{damped(soft)}""")))
        run(self.program, case)
        return case

    def shear(self, case, relaxed, seed, setting, extent, interval, cpu_limit=None, dt=0.0):
        write_case(case, text(self.size, seed, setting.soft, (f'start = "{relaxed.resolve()}"', f"""\
[output]
series_interval = {interval!r}
snapshot_interval = 1000
[model]
dt = {dt!r}
[[stage]]
name = "shear"
kind = "shear"
normal_stress = {stress!r}
strain_rate = {rate_paper * setting.faster!r}
{extent}
f = {setting.f!r}""")))
        return run(self.program, case, cpu_limit)

    def measure(self, setting, seed):
        """One run, kept in a file; not run again where that is there."""
        file = self.file(setting, seed)
        if file.exists():
            return json.loads(file.read_text())
        case = self.state / f"running{self.size.grains}-{setting.name}-seed{seed}"
        result = dict(setting._asdict(), seed=seed, grains=self.size.grains, strain=self.size.strain, program=self.version)
        # A bed that flies apart would search neighbours forever.
        limit = 60 + setting.steps * self.size.strain * self.size.grains * 4e-7
        try:
            relaxed = self.relax(case / "relax", self.prepare(seed), seed, setting.soft)
            cpu = self.shear(case / "shear", relaxed, seed, setting, f"strain = {self.size.strain!r}",
                             1e-3 / (rate_paper * setting.faster), limit)
            result |= dict(cpu_s=cpu, cpu_s_per_strain=cpu / self.size.strain, **read(case / "shear", self.size))
        except Failed as why:
            result["failed"] = str(why)
        aside = file.with_suffix(".tmp")
        aside.write_text(json.dumps(result, indent=1) + "\n")
        aside.rename(file)
        shutil.rmtree(case)
        return result


def read(case, size):
    rows = series(case)
    grains, wall = last_snapshot(case)
    strain, friction = rows["shear_strain"], rows["shear_friction"]
    largest = rows["max_overlap"].max() / (2 * radius)
    # The wall thrown off the bed, or grains inside each other: not a bed any more.
    if not np.isfinite(friction).all() or largest > 0.2 or abs(rows["dilation_diameters"]).max() > 4:
        raise Failed(f"the bed flew apart: overlap up to {largest:.2g} d, dilation up to "
                     f"{abs(rows['dilation_diameters']).max():.2g} d")
    smooth = [friction[abs(strain - s) <= 0.01].mean() for s in strain if s >= 0.01]
    late = strain >= 2 / 3 * strain[-1]
    depth = porosity(grains, wall, size.side)
    return dict(steps=int(rows["step"][-1]), peak=max(smooth), peak_raw=friction[1:].max(), ultimate=friction[late].mean(),
                dilation=rows["dilation_diameters"][-1], shear_zone=shear_zone(grains), coordination=rows["coordination"][late].mean(),
                porosity_low=depth[0], porosity_middle=depth[1], porosity_top=depth[2], max_overlap_d=largest,
                residue_over_work=abs(rows["residue"][-1] / rows["layers_work"][-1]))


def shear_zone(grains):
    """Integral over z of u(z)/u_top, in diameters; u(z) is the mean over slices one diameter thick."""
    z, u, role = grains["position"][:, 2], grains["displacement"][:, 0], grains["role"]
    slices = (z / (2 * radius)).astype(int)
    return sum(u[slices == s].mean() for s in np.unique(slices)) / u[role == role.max()].mean()


def porosity(grains, wall, side, parts=3):
    """Of horizontal slices between floor and wall: each sphere is cut exactly."""
    z, r = grains["position"][:, 2], grains["radius"]
    cuts = np.linspace(0, wall, parts + 1)[:, None]
    h = np.clip(cuts - (z - r), 0, 2 * r)          # of the sphere, below the cut
    below = (np.pi * h**2 * (3 * r - h) / 3).sum(axis=1)
    return 1 - np.diff(below) / (side**2 * wall / parts)
