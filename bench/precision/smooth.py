"""Short smooth scenes, each against itself at a much smaller step.

The error is |q - q_ref|/|q_ref - q_0| over all grains: for the collision q is velocity and r times spin after the grains have parted,
else displacement and r times rotation. q_0 is its value at the start.
"""
import math

import numpy as np

from beds import Beds, Setting, k_paper, mass, radius, stress
from program import Failed, last_snapshot, run, write_case, write_start

f_reference = 0.075 / 64


class Scene:
    def __init__(self, program, directory, soft=1):
        self.program, self.directory, self.k = program, directory, k_paper / soft
        directory.mkdir(parents=True, exist_ok=True)

    def state(self, f):
        """q at the end, and the number of steps."""
        steps = max(1, round(self.duration / (f * math.sqrt(mass / self.k))))
        case = write_case(self.directory / "run", f"""\
start = "{self.start.resolve()}"
[box]
{self.box}
[contact]
k_n = {self.k!r}
k_t = {self.k!r}
[wall]
mass = 0.1
[model]
gravity = 0
dt = {self.duration / steps!r}
[[stage]]
name = "scene"
{self.stage}
duration = {self.duration!r}
zero_kinematics = false
wall_gamma_n = 0
wall_gamma_t = 0
[output]
series_interval = 1
snapshot_interval = 1
""")
        run(self.program, case, 60)
        return self.quantity(last_snapshot(case)[0]), steps

    def quantity(self, grains):
        return np.hstack([grains["displacement"], radius * grains["rotation"]])

    origin = 0.0


class Collision(Scene):
    """Two grains, oblique and spinning: 0.5 m/s along the normal, slip at first, then grip."""
    title = "two grains collide"

    def __init__(self, program, directory, soft=1):
        super().__init__(program, directory, soft)
        contact = math.pi * math.sqrt(mass / 2 / self.k)
        normal = np.array([0.8, 0, 0.6])
        gap = 0.1 * contact * 0.5
        self.duration = 1.3 * contact
        v = 0.5 * 0.5 * normal + 0.5 * 0.3 * np.array([-0.6, 0, 0.8])
        centre = np.array([0.5, 0.5, 0.5])
        x = np.array([centre, centre + (2 * radius + gap) * normal])
        spin = np.array([[0, 3.0, 1.0], [0, 1.0, -2.0]])
        self.start = write_start(program, directory / "start", x, radius, [v, -v], spin)
        self.origin = np.hstack([[v, -v], radius * spin])
        self.box = 'floor = false\nperiodic = "none"'
        self.stage = 'kind = "settle"\nmu_s = 0.3'

    def quantity(self, grains):
        return np.hstack([grains["velocity"], radius * grains["spin"]])


class Column(Scene):
    """Three grains under load: the lowest stands still, the highest moves, that between them rolls."""
    title = "loaded grain rolls between two"

    def __init__(self, program, directory):
        super().__init__(program, directory)
        side = 0.1
        overlap = stress * side**2 / self.k
        z = radius - overlap + (2 * radius - overlap) * np.arange(3)
        x = np.array([[side / 2, side / 2, h] for h in z])
        self.start = write_start(program, directory / "start", x, radius, wall=z[-1] + radius - overlap)
        self.duration = 1e-4
        self.box = f"x = {side}\ny = {side}"
        self.stage = f'kind = "shear"\nnormal_stress = {stress}\nvelocity = 0.003\nbottom_layer = 0.03\ntop_layer = 0.03'


class Lattice(Scene):
    """Four staggered layers of sixteen grains, just touching, are pressed: oblique contacts grip and slip."""
    title = "lattice is pressed"

    def __init__(self, program, directory):
        super().__init__(program, directory)
        step, shift = 2.1 * radius, 0.5 * radius
        side = 4 * step
        height = math.sqrt(4 * radius**2 - shift**2)
        x = np.array([[step * (i + 0.3) + shift * (k % 2), step * (j + 0.3), radius + height * k]
                      for k in range(4) for j in range(4) for i in range(4)])
        self.start = write_start(program, directory / "start", x, radius, wall=2 * radius + 3 * height)
        self.duration = 2e-4
        self.box = f"x = {side!r}\ny = {side!r}"
        self.stage = f'kind = "consolidate"\nnormal_stress = {stress}'


class Stretch:
    """The first 0.1 ms of shear of a bed at rest, too short for neighbouring courses to part."""
    title = "bed begins to shear"
    duration = 1e-4
    origin = 0.0

    def __init__(self, program, directory, size):
        self.beds = Beds(program, directory, size)
        directory.mkdir(parents=True, exist_ok=True)
        self.directory = directory
        self.relaxed = self.beds.relax(directory / "relax", self.beds.prepare(1), 1, 1)

    def state(self, f):
        case = self.directory / "run"
        steps = round(self.duration / (f * math.sqrt(mass / k_paper)))  # whole steps: all end at the same time
        self.beds.shear(case, self.relaxed, 1, Setting(f=f), f"duration = {self.duration!r}", 1.0, 120, self.duration / steps)
        grains, _ = last_snapshot(case)
        free = grains["role"] == 0
        q = np.hstack([grains["displacement"], radius * grains["rotation"]])[free]
        return q, steps


def errors(program, directory, size, factors, softenings, f_soft=0.075):
    """Rows of the table, scene by scene."""
    rows = []

    def compare(scene, reference, f, soft):
        row = dict(scene=scene.title, f=f, softening=soft, stiffness_number=Setting(soft=soft).stiffness)
        try:
            q, row["steps"] = scene.state(f)
            row["error"] = float(np.linalg.norm(q - reference) / np.linalg.norm(reference - scene.origin))
        except Failed as why:
            row["failed"] = str(why)
        rows.append(row)

    collision = Collision(program, directory / "collision")
    for scene in (collision, Column(program, directory / "column"), Lattice(program, directory / "lattice"),
                  Stretch(program, directory / "stretch", size)):
        reference, _ = scene.state(f_reference)
        for f in factors:
            compare(scene, reference, f, 1)
        if scene is collision:
            for soft in softenings:
                compare(Collision(program, directory / f"collision-k{soft}", soft), reference, f_soft, soft)
                # The model's part of it: the soft collision with the step of the reference.
                compare(Collision(program, directory / f"collision-k{soft}", soft), reference, f_reference, soft)
    return rows
