"""What the report of gradings reads off a bed, on beds whose answers are known."""
from types import SimpleNamespace

import numpy as np
import pytest

from moraine import grading_report as report


def test_sizes_by_mass():
    radius = np.array([1.0, 2.0, 1.0, 2.0, 1.0])         # masses 1, 8, 1, 8, 1
    assert report.size_at(radius, 3 / 19) == 2.0 and report.size_at(radius, 3.01 / 19) == 4.0
    order, finer = report.by_mass(radius)
    assert list(order) == [0, 2, 4, 1, 3] and np.allclose(finer, np.array([1, 2, 3, 11, 19]) / 19)


def test_thirds_of_the_mass():
    radius = np.cbrt(np.arange(1.0, 31.0))               # masses 1 to 30, 465 in all
    which = report.third_of_mass(radius)
    mass = [radius[which == k] ** 3 for k in range(3)]
    assert [len(m) for m in mass] == [17, 7, 6] and max(mass[0]) < min(mass[1]) < max(mass[1]) < min(mass[2])
    assert np.allclose([m.sum() for m in mass], 465 / 3, atol=16)
    assert (report.third_of_mass(np.ones(9)) == np.repeat([0, 1, 2], 3)).all()


def bed(x, contacts, top=10.0):
    x = np.array(x, float)
    grains = {"position": x, "radius": np.full(len(x), 0.5)}
    i, j = np.array(contacts, int).reshape(-1, 2).T
    return SimpleNamespace(grains=grains, contacts={"i": i, "j": j}, top_wall=top)


def test_grains_that_bear_load():
    square = [[0, 0, 5], [1, 0, 5], [1, 1, 5], [0, 1, 5]]
    ring = [[0, 1], [1, 2], [2, 3], [3, 0]]
    left, count = report.load_bearing(bed(square, ring))
    assert left.all() and count == 4
    chain = square + [[2, 0, 5], [3, 0, 5]]               # hangs on the ring by one end: falls off, grain by grain
    left, count = report.load_bearing(bed(chain, ring + [[1, 4], [4, 5]]))
    assert list(left) == [True] * 4 + [False] * 2 and count == 4
    left, count = report.load_bearing(bed([[0, 0, 0.49], [0, 0, 1.4]], [[0, 1]]))  # on the floor, which is no contact of a snapshot
    assert list(left) == [True, False] and count == 0


def test_differences_between_gradings():
    rows = [{"grading": g, "sigma_0_kPa": s, "q": v + o} for g, v in (("1", 1.0), ("5", 1.5)) for s in (20.0, 80.0) for o in (-0.01, 0.0, 0.01)]
    mean, half = report.difference(rows, "q", "5")
    # Each stress: standard error 0.01 sqrt(2/3), four degrees of freedom; the mean over two has it over sqrt(2), and eight.
    assert mean == pytest.approx(0.5) and half == pytest.approx(2.306 * 0.01 * np.sqrt(2 / 3 / 2), rel=1e-3)
    assert np.isnan(report.difference(rows[:1] + rows[6:], "q", "5")[0])
    assert report.verdict(0.5, 0.1, 1, "lower", "higher") == "0.5 ± 0.1: higher"
    assert report.verdict(-0.05, 0.1, 2, "lower", "higher") == "-0.05 ± 0.10: no difference seen"
    assert report.verdict(0.5, np.nan, 1, "lower", "higher") == "too few runs to tell"
