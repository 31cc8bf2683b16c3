"""Rotation gathered by each grain since the stage began, about each axis (par. 45, Fig. 11)."""
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Rotation:
    mean: np.ndarray        # about x, y, z; rad
    variance: np.ndarray    # empirical, rad^2
    grains: int


def rotations(snapshot):
    """About x, y, z, rad, n x 3: grains of the driven and the resting layer are left out, since they have no spin."""
    return snapshot.grains["rotation"][snapshot.grains["role"] == 0]


def statistics(snapshot, all_grains=False):
    """all_grains: with those of the two layers, which do not rotate."""
    omega = snapshot.grains["rotation"] if all_grains else rotations(snapshot)
    return Rotation(omega.mean(axis=0), omega.var(axis=0, ddof=1), len(omega))
