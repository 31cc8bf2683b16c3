"""Taylor's relation as reports show it, and the porosity of columns, on curves and grains whose answers are known."""
from types import SimpleNamespace

import numpy as np
import pytest

from moraine import dilatancy, profile, strength
from moraine.results import MissingData, Table


def stage(excess=0.0, end=0.5):
    """A bed 2 m high whose friction is that of the critical state, its dilation rate, and an excess where it is largest."""
    x = np.linspace(0, end, 501)
    rate = 0.2 * np.exp(-((x - 0.1) / 0.05) ** 2)
    lifted = 2 * np.concatenate([[0], np.cumsum((rate[1:] + rate[:-1]) / 2 * np.diff(x))])
    columns = {"shear_strain": x, "shear_friction": 0.4 + rate * (1 + excess), "dilation": lifted, "height": 2 + lifted}
    return SimpleNamespace(series=Table("series.h5", columns, {}))


def test_taylor_s_relation_in_a_table():
    (name, count, peak, rate, critical, left, rms), = dilatancy.table({"bed": [stage(), stage(0.1), stage(end=0.01)]})
    assert (name, count) == ("bed", 2)                  # the third is too short for a window
    mean = [float(text.split()[0]) for text in (peak, rate, critical, left)]
    assert mean == pytest.approx([0.61, 0.2, 0.4, 0.01], abs=0.005) and float(rms) < 0.01


def test_mean_curves_keep_to_what_all_have():
    own = [strength.taylor(stage()), strength.taylor(stage(end=0.4))]
    strain, left = dilatancy.mean_curve(own, lambda t: t.friction - t.rate)
    assert strain[0] >= 0.01 and strain[-1] <= 0.39 and np.allclose(left, 0.4, atol=0.003)
    with pytest.raises(MissingData, match="no run is sheared by 0.02"):
        dilatancy.figure({"bed": [stage(end=0.01)]})


def test_points_in_a_ball_stand_for_its_volume():
    ball = profile.inside(3000)
    assert (np.linalg.norm(ball, axis=1) < 1).all() and np.allclose(ball.mean(axis=0), 0, atol=0.01)
    assert np.allclose((ball**2).mean(axis=0), 1 / 5, atol=0.005) and np.mean(ball[:, 2] > 0.5) == pytest.approx(5 / 32, abs=0.005)


def test_porosity_of_columns():
    rng = np.random.default_rng(3)
    place = rng.uniform(0.5, 3.5, (40, 3)) * [1, 1, 1]
    grains = {"position": place, "radius": rng.uniform(0.1, 0.4, 40)}
    bed = SimpleNamespace(grains=grains, box=(4.0, 4.0, 0.0), top_wall=4.0, area=16.0)
    found = profile.section_porosity(bed, 4, 4)
    edges, slabs = profile.porosity(bed, 0.999)
    assert len(slabs) == 4 and np.allclose(found.mean(axis=0), slabs, atol=0.002)  # over the width as cut exactly
    grains["position"] = place + [0, 1, 0]              # over the periodic side, a column further on
    assert np.allclose(profile.section_porosity(bed, 4, 4), np.roll(found, 1, axis=0), atol=1e-9)
