"""Both programs' contact laws in numpy, with a switch for each thing in which they differ: slow, short, independent of both.

LAMMPS, gran/hooke/history:  levers r in contact velocity and torque; normal of the step's end; the spring keeps its part in
                             the new tangent plane.
LAMMPS, granular:            the same, but levers r + delta_n/2 in the torque between grains, and the spring keeps its length.
Moraine, contact.hpp:        levers r + delta_n/2 (eqs. 4 and 7); normal and levers of the middle of the step; the spring
                             turns with the pair.
Hertz and Mindlin:           f_n = 4/3 E* a overlap, k_t = 8 G* a, a = sqrt(R overlap). The spring's force is kept while a grows, its
                             displacement while a shrinks (LAMMPS: mindlin_rescale/force). While a grows the force rises by k_t times
                             the step's displacement, with k_t of the step's end in LAMMPS, the mean of both ends in Moraine.
Rolling:                     theta grows by R (omega_i - omega_j) dt across the normal; couple -R k_roll theta, at most R mu_roll f_n
                             (LAMMPS: rolling sds, whose history is theta x n).
The scene is that of lammps-bed: gravity, floor, a layer at rest, a layer driven at constant height, no damping.
"""
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Law:
    lever_in_torque: bool = False    # r + delta_n/2 in the torque between grains
    lever_at_walls: bool = False     # and at the floor
    lever_in_velocity: bool = False  # the same in the contact velocity
    mid_step: bool = False           # normal and levers of the middle of the step
    turned_spring: bool = False      # the spring turns with the pair, about the normal too
    kept_length: bool = False        # the spring is brought into the new tangent plane before the step is added, at its length
    mean_stiffness: bool = False     # Mindlin: k_t of the step's middle


LAMMPS = Law()
MORAINE = Law(True, True, True, True, True, False, True)
GRANULAR = Law(lever_in_torque=True, lever_at_walls=True, kept_length=True)


@dataclass(frozen=True)
class Springs:
    """Of one kind of contact: linear (N/m), or Hertz's (Pa) where E_star > 0; rolling where mu_roll > 0."""
    k_n: float = 0.0
    k_t: float = 0.0
    E_star: float = 0.0
    G_star: float = 0.0
    mu: float = 0.0
    k_roll: float = 0.0
    mu_roll: float = 0.0


def dot(a, b):
    return np.einsum("ij,ij->i", a, b)[:, None]


def near_pairs(x, r, sides, reach):
    """Pairs i < j whose surfaces are closer than `reach`, m."""
    found = []
    for i in range(len(r)):
        d = x[i + 1:] - x[i]
        d[:, :2] -= sides * np.round(d[:, :2] / sides)
        j = np.flatnonzero(np.einsum("ij,ij->i", d, d) < (r[i + 1:] + r[i] + reach) ** 2) + i + 1
        found.append(np.stack([np.full(len(j), i), j]))
    return np.concatenate(found, axis=1)


def cut(size, limit):
    """What a limit leaves of something of that size, 1 where all."""
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(size > limit, limit / size, 1.0)


class Memory:
    """Of so many contacts: spring (m), contact radius of the step before (m), rolled (m)."""

    def __init__(self, number):
        self.spring, self.a, self.rolled = np.zeros((number, 3)), np.zeros((number, 1)), np.zeros((number, 3))


class Bed:
    """grains: x (m), r (m), role (0 free, 1 at rest, 2 driven); law parameters SI."""

    reach = 2e-4  # m, of the list of pairs; good while no grain moves further than half of it

    def __init__(self, x, r, role, pairs, sides, springs, density, gravity, speed, dt, law, at_floor=None):
        self.x, self.r, self.start = x.copy(), r[:, None], x.copy()
        self.sides, self.springs, self.at_floor, self.dt, self.law = sides, springs, at_floor or springs, dt, law
        mass = density * 4 / 3 * np.pi * self.r ** 3
        free = (role == 0)[:, None]
        self.inverse_mass = free / mass
        self.inverse_inertia = free / (0.4 * mass * self.r ** 2)
        self.gravity = np.where(free, [[0.0, 0.0, -gravity]], 0.0)
        self.v = np.where((role == 2)[:, None], [[speed, 0.0, 0.0]], 0.0)
        self.omega = np.zeros_like(x)
        self.i, self.j = pairs
        self.memory, self.wall_memory = Memory(len(self.i)), Memory(len(x))
        self.evaluate(0.0)
        self.v += 0.5 * dt * self.acceleration()
        self.omega += 0.5 * dt * self.inverse_inertia * self.torque
        self.begun = False

    def acceleration(self):
        return self.force * self.inverse_mass + self.gravity

    def contact(self, p, lever_in_torque, n, delta, r_i, r_j, curvature, v, w_i, w_j, memory, dt):
        """Force on i, n x f_t, both levers of the torque, couple on i; renews the memory. r_j = 0: a plane."""
        law = self.law
        lever_v = 0.5 * delta if law.lever_in_velocity else 0.0
        lever_t = 0.5 * delta if lever_in_torque else 0.0
        overlap = -np.minimum(delta, 0.0)
        R = r_i * r_j / (r_i + r_j) if np.any(r_j) else r_i
        f_n, k_t, held, gain = p.k_n * overlap, p.k_t, 1.0, 1.0
        if p.E_star > 0:
            a = np.sqrt(R * overlap)
            f_n, k_t = 4 / 3 * p.E_star * a * overlap, 8 * p.G_star * a
            if dt > 0:
                with np.errstate(invalid="ignore", divide="ignore"):
                    held = np.where(a > memory.a, memory.a / a, 1.0)
                gain = 0.5 * (1 + held) if law.mean_stiffness else 1.0
            memory.a = a
        v_n = dot(v, n)
        n_step, shortening = n, 0.0
        if law.mid_step:
            n_step = n - 0.5 * dt * curvature * (v - v_n * n)
            shortening = 0.25 * dt * v_n
        v_c = v + np.cross(n_step, (r_i + lever_v - shortening) * w_i + (r_j + lever_v - shortening) * w_j)
        step = dt * (v_c - dot(v_c, n_step) * n_step)
        twist = 0.5 * dt * dot(n, w_i + w_j)

        def carried(spring, step):
            if law.turned_spring:
                turned = spring + twist * np.cross(n, spring + 0.5 * step) - 0.5 * twist ** 2 * spring
                trial = turned + step
                return trial - dot(n, trial) * n_step
            if not law.kept_length:
                trial = spring + step
                return trial - dot(n, trial) * n
            size, flat = np.sqrt(dot(spring, spring)), spring - dot(n, spring) * n
            left = np.sqrt(dot(flat, flat))
            with np.errstate(invalid="ignore", divide="ignore"):
                return np.where(left > 0, size / left, 0.0) * flat + step
        trial = carried(held * memory.spring, gain * step)
        f_t = -k_t * trial
        share = cut(np.sqrt(dot(f_t, f_t)), p.mu * f_n)
        memory.spring = np.where(overlap > 0, share * trial, 0.0)
        couple = np.zeros_like(v)
        if p.mu_roll > 0:
            turn = dt * R * (w_i - w_j)
            trial = carried(memory.rolled, turn - dot(turn, n_step) * n_step)
            memory.rolled = cut(p.k_roll * np.sqrt(dot(trial, trial)), p.mu_roll * f_n) * trial
            couple = -p.k_roll * R * memory.rolled
        return f_n * n + share * f_t, np.cross(n, share * f_t), r_i + lever_t, r_j + lever_t, couple

    def evaluate(self, dt):
        i, j, n = self.i, self.j, len(self.r)
        d = self.x[i] - self.x[j]
        d[:, :2] -= self.sides * np.round(d[:, :2] / self.sides)
        distance = np.sqrt(dot(d, d))
        f, n_x_f, l_i, l_j, couple = self.contact(
            self.springs, self.law.lever_in_torque, d / distance, distance - (self.r[i] + self.r[j]), self.r[i], self.r[j],
            1 / distance, self.v[i] - self.v[j], self.omega[i], self.omega[j], self.memory, dt)
        up = np.broadcast_to([0.0, 0.0, 1.0], self.x.shape)
        f_w, n_x_f_w, l_w, _, couple_w = self.contact(
            self.at_floor, self.law.lever_at_walls, up, self.x[:, 2:] - self.r, self.r, 0.0, 0.0, self.v, self.omega,
            0.0 * self.omega, self.wall_memory, dt)
        self.force, self.torque = f_w, couple_w - l_w * n_x_f_w
        for a in range(3):
            self.force[:, a] += np.bincount(i, f[:, a], n) - np.bincount(j, f[:, a], n)
            self.torque[:, a] += np.bincount(i, (couple - l_i * n_x_f)[:, a], n) - np.bincount(j, (couple + l_j * n_x_f)[:, a], n)

    def advance(self, steps):
        for _ in range(steps):
            if self.begun:
                self.v += self.dt * self.acceleration()
                self.omega += self.dt * self.inverse_inertia * self.torque
            self.begun = True
            self.x += self.dt * self.v
            self.evaluate(self.dt)
        moved = np.sqrt(dot(self.x - self.start, self.x - self.start)).max()
        if 2 * moved > self.reach:
            raise RuntimeError(f"a grain moved {moved} m: too far for the list of pairs")
        return self.x
