"""Both programs' contact laws in numpy, with a switch for each thing in which they differ: slow, short, independent of both.

LAMMPS, gran/hooke/history:  levers r in contact velocity and torque; normal of the step's end; the spring keeps its part in
                             the new tangent plane.
Moraine, contact.hpp:        levers r + delta_n/2 (eqs. 4 and 7); normal and levers of the middle of the step; the spring
                             turns with the pair.
The scene is that of lammps-bed: gravity, floor, a layer at rest, a layer driven at constant height, no damping.
"""
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Law:
    lever_in_torque: bool = False    # r + delta_n/2 in the torque
    lever_in_velocity: bool = False  # the same in the contact velocity
    mid_step: bool = False           # normal and levers of the middle of the step
    turned_spring: bool = False      # the spring turns with the pair, about the normal too


LAMMPS = Law()
MORAINE = Law(True, True, True, True)


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


class Bed:
    """grains: x (m), r (m), role (0 free, 1 at rest, 2 driven); law parameters SI."""

    reach = 2e-4  # m, of the list of pairs; good while no grain moves further than half of it

    def __init__(self, x, r, role, pairs, sides, k_n, k_t, mu, density, gravity, speed, dt, law):
        self.x, self.r, self.start = x.copy(), r[:, None], x.copy()
        self.sides, self.k_n, self.k_t, self.mu, self.dt, self.law = sides, k_n, k_t, mu, dt, law
        mass = density * 4 / 3 * np.pi * self.r ** 3
        free = (role == 0)[:, None]
        self.inverse_mass = free / mass
        self.inverse_inertia = free / (0.4 * mass * self.r ** 2)
        self.gravity = np.where(free, [[0.0, 0.0, -gravity]], 0.0)
        self.v = np.where((role == 2)[:, None], [[speed, 0.0, 0.0]], 0.0)
        self.omega = np.zeros_like(x)
        self.i, self.j = pairs
        self.spring = np.zeros((len(self.i), 3))
        self.wall_spring = np.zeros_like(x)
        self.evaluate(0.0)
        self.v += 0.5 * dt * self.acceleration()
        self.omega += 0.5 * dt * self.inverse_inertia * self.torque
        self.begun = False

    def acceleration(self):
        return self.force * self.inverse_mass + self.gravity

    def contact(self, n, delta, r_i, r_j, curvature, v, w_i, w_j, spring, dt):
        """Force on i, n x f_t, both levers of the torque, new spring."""
        law = self.law
        lever_v = 0.5 * delta if law.lever_in_velocity else 0.0
        lever_t = 0.5 * delta if law.lever_in_torque else 0.0
        v_n = dot(v, n)
        n_step, shortening = n, 0.0
        if law.mid_step:
            n_step = n - 0.5 * dt * curvature * (v - v_n * n)
            shortening = 0.25 * dt * v_n
        v_c = v + np.cross(n_step, (r_i + lever_v - shortening) * w_i + (r_j + lever_v - shortening) * w_j)
        step = dt * (v_c - dot(v_c, n_step) * n_step)
        if law.turned_spring:
            twist = 0.5 * dt * dot(n, w_i + w_j)
            turned = spring + twist * np.cross(n, spring + 0.5 * step) - 0.5 * twist ** 2 * spring
            trial = turned + step
            trial = trial - dot(n, trial) * n_step
        else:
            trial = spring + step
            trial = trial - dot(n, trial) * n
        f_n = -self.k_n * np.minimum(delta, 0.0)
        f_t = -self.k_t * trial
        size = np.sqrt(dot(f_t, f_t))
        with np.errstate(invalid="ignore", divide="ignore"):
            cut = np.where(size > self.mu * f_n, self.mu * f_n / size, 1.0)
        return f_n * n + cut * f_t, np.cross(n, cut * f_t), r_i + lever_t, r_j + lever_t, cut * trial

    def evaluate(self, dt):
        i, j, n = self.i, self.j, len(self.r)
        d = self.x[i] - self.x[j]
        d[:, :2] -= self.sides * np.round(d[:, :2] / self.sides)
        distance = np.sqrt(dot(d, d))
        f, n_x_f, l_i, l_j, self.spring = self.contact(
            d / distance, distance - (self.r[i] + self.r[j]), self.r[i], self.r[j], 1 / distance, self.v[i] - self.v[j],
            self.omega[i], self.omega[j], self.spring, dt)
        up = np.broadcast_to([0.0, 0.0, 1.0], self.x.shape)
        f_w, n_x_f_w, l_w, _, self.wall_spring = self.contact(
            up, self.x[:, 2:] - self.r, self.r, 0.0, 0.0, self.v, self.omega, 0.0 * self.omega, self.wall_spring, dt)
        self.force, self.torque = f_w, -l_w * n_x_f_w
        for a in range(3):
            self.force[:, a] += np.bincount(i, f[:, a], n) - np.bincount(j, f[:, a], n)
            self.torque[:, a] -= np.bincount(i, (l_i * n_x_f)[:, a], n) + np.bincount(j, (l_j * n_x_f)[:, a], n)

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
