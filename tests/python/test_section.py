"""moraine.section on discs and slips that are known."""
import numpy as np
import pytest

from fake_snapshot import write
from moraine import MissingData, section


def pair(directory, **motion):
    """A small grain (0) on top of a large one (1), which touch without overlap to speak of."""
    return write(directory, [[5, 5, 3.5], [5, 5, 2]], [0.5, 1.0], [(0, 1)], **motion)


def test_rolling_has_no_slip(tmp_path):
    s = pair(tmp_path, spin=[[0, -2.0, 0], [0, 1.0, 0]])  # as gears: r omega is the same, opposite in sense
    np.testing.assert_allclose(section.contact_velocity(s), 0, atol=1e-12)
    rolls_over = pair(tmp_path, velocity=[[3.0, 0, 0], [0, 0, 0]], spin=[[0, 6.0, 0], [0, 0, 0]])  # over a grain that stands
    np.testing.assert_allclose(section.contact_velocity(rolls_over), 0, atol=1e-12)


def test_sliding_is_known(tmp_path):
    s = pair(tmp_path, velocity=[[3.0, 0, -8.0], [1.0, 0, 0]])  # the approach along n is no slip
    np.testing.assert_allclose(section.contact_velocity(s), [[2, 0, 0]], atol=1e-12)
    same_sense = pair(tmp_path, spin=[[0, 2.0, 0], [0, 2.0, 0]])  # the foot of the upper goes -1, the top of the lower +2
    np.testing.assert_allclose(section.contact_velocity(same_sense), [[-3, 0, 0]], atol=1e-12)


def test_lever_arms_shrink_with_overlap(tmp_path):
    s = write(tmp_path, [[5, 5, 3], [5, 5, 2.2]], 0.5, [(0, 1)], spin=[[0, 1.0, 0], [0, 0, 0]])
    np.testing.assert_allclose(section.contact_velocity(s), [[-0.4, 0, 0]], atol=1e-12)


def test_slip_across_a_side(tmp_path):
    s = write(tmp_path, [[0.4, 5, 2], [9.4, 5, 2]], 0.5, [(0, 1)], velocity=[[0, 0, 1.0], [0, 0, 0]])
    np.testing.assert_allclose(section.contact_velocity(s), [[0, 0, 1]], atol=1e-12)


def test_discs_of_the_plane(tmp_path):
    s = write(tmp_path, [[5, 5.3, 2], [5, 9.9, 2], [0.2, 5, 3], [5, 5, 8]], 0.5, pressure=[1.0, 2, 3, 4], spin=[0, 7.0, 0])
    cut = section.section(s, y=5, z_range=(1, 4))
    assert cut.grain.tolist() == [0, 2, 2]  # one crosses the side in x, and one lies above
    np.testing.assert_allclose(cut.radius, [0.4, 0.5, 0.5])
    np.testing.assert_allclose(cut.centre, [[5, 2], [0.2, 3], [10.2, 3]])
    assert cut.pressure.tolist() == [1, 3, 3] and cut.spin.tolist() == [7, 7, 7]
    assert section.section(s, y=0).grain.tolist() == [1]  # across the side in y


def test_slip_is_that_of_the_upper_grain_over_the_lower(tmp_path):
    at = [[5, 5, 2], [5, 5, 3], [5, 5, 8], [5, 5, 7]]
    s = write(tmp_path, at, 0.5, [(0, 1), (2, 3)], velocity=[[0, 0, 0], [1.0, 0, 0], [1.0, 0, 0], [0, 0, 0]])
    cut = section.section(s, y=5)
    np.testing.assert_allclose(cut.slip, [[1, 0], [1, 0]], atol=1e-12)
    np.testing.assert_allclose(cut.point, [[5, 2.5], [5, 7.5]])
    assert len(section.section(s, y=5.3, reach=0.2).contact) == 0


def test_opposite_spins_are_counted(tmp_path):
    at = [[5, 5, 2], [5, 5, 3], [5, 5, 4]]
    s = write(tmp_path, at, 0.5, [(0, 1), (1, 2)], [1.0, 9.0], spin=[[0, 1.0, 0], [0, 1.0, 0], [0, -1.0, 0]])
    assert section.opposite_spins(s) == 0.5
    assert section.opposite_spins(s, 0.5) == 1


def test_what_is_missing_is_named(tmp_path):
    s = write(tmp_path, [[5, 5, 2]], leave_out=["grains/spin"])
    with pytest.raises(MissingData, match="spin"):
        section.section(s)
