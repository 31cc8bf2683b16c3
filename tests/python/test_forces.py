"""moraine.forces on grains whose forces are known. Tolerances are rounding, except where a comment says otherwise."""
import numpy as np
import pytest

from fake_snapshot import write
from moraine import MissingData, forces

slope = np.sqrt(0.5)
pushed = [[5 - slope / 2, 5, 2 + slope / 2], [5 + slope / 2, 5, 2 - slope / 2]]  # a grain pushes the other towards +x and down


def lattice(directory, count=4, layers=5, spacing=1.0, force=3.0, shear=0.0):
    """Simple cubic, periodic in x and y; each vertical contact carries `force`, and -shear along x on its upper grain."""
    k = np.arange(count * count * layers)
    place = np.column_stack([k % count, k // count % count, k // count**2])
    below = [(m, m - count**2) for m in k if m >= count**2]
    return write(directory, (place + 0.5) * spacing, spacing / 2, below, force, [-shear, 0, 0],
                 (count * spacing, count * spacing, 0), layers * spacing)


def directions_without_preference(count=4000):
    z = 1 - (2 * np.arange(count) + 1) / count
    turn = np.pi * (1 + 5**0.5) * np.arange(count)  # a Fibonacci spiral
    return np.column_stack([np.sqrt(1 - z**2) * np.cos(turn), np.sqrt(1 - z**2) * np.sin(turn), z])


def star(directory, directions, **more):
    """One grain in the middle, touched from these directions."""
    centre = np.array([5.0, 5.0, 5.0])
    return write(directory, [centre, *(centre + directions)], 0.5, [(0, k + 1) for k in range(len(directions))], **more)


@pytest.mark.parametrize("z_range", [None, (1.0, 4.0), (1.3, 1.4), (0.5, 2.75)])
def test_stress_of_a_lattice_is_exact(tmp_path, z_range):
    s = lattice(tmp_path, force=3.0, shear=0.6)
    expected = np.zeros((3, 3))
    expected[2, 2], expected[0, 2] = 3.0, -0.6  # a force to each 1 m^2; top along +x, hence minus
    np.testing.assert_allclose(forces.stress_tensor(s, z_range), expected, atol=1e-12)


def test_stress_of_one_tilted_contact(tmp_path):
    s = write(tmp_path, pushed, 0.5, [(0, 1)], 7.0, box=(10, 10, 0))
    z_range = 2 - slope / 2, 2  # the lower half of the branch
    n = np.array([-slope, 0, slope])
    np.testing.assert_allclose(forces.stress_tensor(s, z_range), 7.0 / 2 * np.outer(n, n) / (100 * slope / 2), atol=1e-12)


def test_horizontal_contacts_count_where_they_lie(tmp_path):
    s = write(tmp_path, [[0.4, 5, 2], [9.4, 5, 2]], 0.5, [(0, 1)], 2.0)  # across the side in x
    np.testing.assert_allclose(forces.stress_tensor(s, (1, 3)), np.diag([2.0 / 200, 0, 0]), atol=1e-15)
    np.testing.assert_allclose(forces.stress_tensor(s, (3, 4)), 0, atol=1e-15)


def test_principal_values_come_with_their_directions():
    tensor = np.diag([1.0, 3.0, 2.0])
    values, directions = forces.principal(tensor)
    np.testing.assert_allclose(values, [3, 2, 1])
    np.testing.assert_allclose(np.abs(directions), [[0, 0, 1], [1, 0, 0], [0, 1, 0]], atol=1e-12)


def test_compression_dips_towards_plus_x_under_shear_towards_plus_x(tmp_path):
    s = write(tmp_path, pushed, 0.5, [(0, 1)], 7.0)
    np.testing.assert_allclose(forces.trend_plunge(s, 1.0), [[0], [45]], atol=1e-9)
    np.testing.assert_allclose(np.cos(np.radians(forces.maximum_compressive_direction(forces.stress_tensor(s, (1, 3))))),
                               [1, slope], atol=1e-9)
    tau, sigma = 30.0, 80.0
    applied = forces.applied_compressive_direction(tau, sigma)
    np.testing.assert_allclose(applied, (0, 90 - np.degrees(np.arctan(tau / sigma))))
    balanced = np.array([[sigma, 0, -tau], [0, sigma, 0], [-tau, 0, sigma]])  # what holds a top layer dragged along +x
    trend, plunge = forces.maximum_compressive_direction(balanced)
    assert np.cos(np.radians(trend)) == pytest.approx(1) and plunge == pytest.approx(45)


def test_applied_compression_is_vertical_in_consolidation_and_turns_with_shear():
    assert forces.applied_compressive_direction(0.0, 80e3) == (0, 90)
    assert forces.applied_compressive_direction(-80e3, 80e3) == pytest.approx((180, 45))


@pytest.mark.parametrize("v, trend, plunge", [([0, 0, 1], 0, 90), ([1, 0, 0], 0, 0), ([0, 1, -1], 90, 45), ([0, 1, 1], 270, 45),
                                              ([-1, 0, -3**0.5], 180, 60)])
def test_axes_are_told_by_their_lower_end(v, trend, plunge):
    np.testing.assert_allclose(forces.axis(v), (trend, plunge), atol=1e-9)
    lower = np.array(v) / np.linalg.norm(v) * (-1 if v[2] > 0 else 1)
    np.testing.assert_allclose(forces.vector(trend, plunge), lower, atol=1e-9)


@pytest.mark.parametrize("trend, plunge, x, y", [(0, 90, 0, 0), (0, 0, 1, 0), (90, 0, 0, 1), (180, 30, -np.tan(np.pi / 6), 0),
                                                 (45, 60, np.tan(np.pi / 12) * slope, np.tan(np.pi / 12) * slope)])
def test_projection_is_equal_angle(trend, plunge, x, y):
    np.testing.assert_allclose(forces.stereographic(trend, plunge), (x, y), atol=1e-12)
    back = forces.unproject(x, y)
    np.testing.assert_allclose(forces.vector(*back), forces.vector(trend, plunge), atol=1e-12)


def test_the_strongest_contacts_are_taken(tmp_path):
    s = star(tmp_path, np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [0, slope, slope]]), normal=[1, 2, 4, 3])
    trend, plunge = forces.trend_plunge(s, 0.5)
    np.testing.assert_allclose(plunge, [90, 45], atol=1e-9)
    assert len(forces.trend_plunge(s, 1.0)[0]) == 4


def test_fabric_without_preference_is_a_third_of_unity(tmp_path):
    s = star(tmp_path, directions_without_preference())
    np.testing.assert_allclose(forces.fabric_tensor(s), np.eye(3) / 3, atol=1e-4)  # the spiral's own unevenness


def test_fabric_takes_weights(tmp_path):
    s = star(tmp_path, np.eye(3), normal=[1.0, 2.0, 5.0])
    np.testing.assert_allclose(forces.fabric_tensor(s, s.normal_forces()), np.diag([1, 2, 5]) / 8)


def test_axial_density_is_one_without_preference_and_high_on_an_axis():
    grid = np.array([0.0, 120.0, 250.0]), np.array([85.0, 10.0, 40.0])
    isotropic = forces.axial_density(*forces.axis(directions_without_preference()), grid)
    np.testing.assert_allclose(isotropic, 1, atol=0.01)  # 4,000 directions
    both_ends = forces.axial_density(np.array([0.0]), np.array([0.0]), (np.array([180.0, 90.0]), np.array([0.0, 0.0])))
    assert both_ends[0] > 50 and both_ends[1] < 1e-9


def test_segments_across_a_side_are_cut(tmp_path):
    s = write(tmp_path, [[0.25, 5, 2], [9.5, 5, 2.6], [5, 5, 3], [5.6, 5, 3]], 0.5, [(0, 1), (2, 3)], [5.0, 6.0])
    net = forces.network(s, 5, 1)
    assert net.contact.tolist() == [0, 1, 0] and net.force.tolist() == [5, 6, 5]
    np.testing.assert_allclose(net.segments[1], [[5, 3], [5.6, 3]])
    np.testing.assert_allclose(net.segments[[0, 2]], [[[0.25, 2], [0, 2.2]], [[10, 2.2], [9.5, 2.6]]], atol=1e-12)


def test_the_slice_goes_across_the_side_in_y_and_leaves_fixed_grains_out(tmp_path):
    s = write(tmp_path, [[5, 9.9, 2], [5.5, 9.9, 2], [5, 9.9, 1], [5, 5, 1], [5.5, 5, 1]], 0.5, [(0, 1), (0, 2), (3, 4)],
              role=[0, 0, 1, 0, 0])
    assert forces.network(s, 0.0, 0.4).contact.tolist() == [0]


def test_share_above_is_exact(tmp_path):
    pressure = np.array([0, 1, 4, 4.001, 5, 9, 100, 100]) * 1e3
    s = write(tmp_path, np.ones((8, 3)), pressure=pressure, role=[0, 0, 0, 0, 0, 0, 1, 2])
    assert forces.share_above(s, 1e3) == 0.5
    assert forces.share_above(s, 1e3, 8) == pytest.approx(1 / 6)


def test_distribution_is_normalised(tmp_path):
    s = star(tmp_path, np.eye(3), normal=[1.0, 2.0, 6.0], pressure=[2e3, 1e3, 0, 5e3])
    d = forces.distribution(s, 1e3)
    np.testing.assert_allclose(sorted(d.force), [1 / 3, 2 / 3, 2])
    np.testing.assert_allclose(d.pressure, [2, 1, 0, 5])
    centres, density = d.density(d.pressure, bins=10)
    assert density.sum() * (centres[1] - centres[0]) == pytest.approx(1)


def test_exponential_tail_is_found():
    quantiles = -np.log(1 - (np.arange(20000) + 0.5) / 20000) / 1.4
    beta, error = forces.exponential_tail(quantiles, 1.0)
    assert beta == pytest.approx(1.4, abs=3 * error) and error < 0.03


def test_what_is_missing_is_named(tmp_path):
    s = write(tmp_path, pushed, 0.5, [(0, 1)], leave_out=["contacts/force_normal", "grains/pressure"])
    with pytest.raises(MissingData, match="force_normal"):
        forces.trend_plunge(s)
    with pytest.raises(MissingData, match="pressure"):
        forces.share_above(s, 1.0)
    with pytest.raises(MissingData, match="no contacts between free grains"):
        forces.fabric_tensor(write(tmp_path, pushed))
