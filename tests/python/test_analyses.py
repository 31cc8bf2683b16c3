"""Strength, profiles, rotation and consolidation against answers that are known."""
from types import SimpleNamespace

import numpy as np
import pytest

from moraine import compaction, profile, rotation, strength
from moraine.results import MissingData, Table

rng = np.random.default_rng(1)


def stage(strain, friction, dilation, rate=0.05, sigma_0=80e3):
    strain = np.asarray(strain, float)
    columns = {"shear_strain": strain, "stage_time": strain / rate, "shear_friction": np.asarray(friction, float),
               "dilation_diameters": np.asarray(dilation, float), "dilation": np.asarray(dilation, float),
               "height": 1 + np.asarray(dilation, float),  # m: H_0 and mean diameter are 1 m
               "shear_stress": sigma_0 * np.asarray(friction, float)}
    return SimpleNamespace(series=Table("series.h5", columns, {}))


def bed(z, radius, role=None, displacement=None, box=(1.0, 2.0, 1.0), top=1.0, rotation=None):
    n = len(z)
    position = np.zeros((n, 3))
    position[:, 2] = z
    moved = np.zeros((n, 3))
    if displacement is not None:
        moved[:, 0] = displacement
    grains = {"position": position, "radius": np.full(n, float(radius)), "displacement": moved,
              "role": np.zeros(n, int) if role is None else np.asarray(role),
              "rotation": np.zeros((n, 3)) if rotation is None else rotation}
    return SimpleNamespace(grains=Table("bed.h5:/grains", grains, {}), top_wall=top, box=np.array(box), area=box[0] * box[1], file="bed.h5")


def test_smoothed_is_the_mean_over_the_window():
    x = np.linspace(0, 1, 1001)
    mean = strength.smoothed(x, x**2, 0.02)
    inner = slice(10, -10)
    sums = np.array([(x[k - 10:k + 11]**2).mean() for k in range(10, 991)])
    assert np.allclose(mean[inner], sums)
    assert np.isnan(mean[:10]).all() and np.isnan(mean[-10:]).all()


def test_raw_and_smoothed_peaks_of_a_known_curve():
    x = np.linspace(0, 1, 2001)                    # every 0.01 s
    friction = 0.4 + 0.1 * np.exp(-((x - 0.1) / 0.05)**2) - 0.4 * np.exp(-x / 0.005)
    spike = friction.copy()
    spike[1000] = 2.0                              # a row that a series of 0.05 s has
    spike[1001] = 3.0                              # one that it has not
    s = strength.strength(stage(x, spike, 0.7 * (1 - np.exp(-x / 0.05))))
    assert s.peak_raw == 2.0 and s.peak_raw_strain == pytest.approx(0.5)
    s = strength.strength(stage(x, friction, 0.7 * (1 - np.exp(-x / 0.05))))
    assert s.peak == pytest.approx(0.5, abs=2e-3) and s.peak_strain == pytest.approx(0.1, abs=2e-3)
    assert s.ultimate == pytest.approx(0.4, abs=1e-6)
    assert s.dilation == pytest.approx(0.7, abs=1e-6)
    assert s.dilation_end == pytest.approx(-0.05 * np.log(0.05), abs=5e-3)
    assert s.tau_peak_raw == pytest.approx(80e3 * friction.max(), rel=1e-3)


def test_rows_half_a_step_off_their_time_are_still_the_nearest():
    times = 0.01 * np.arange(1001) + np.where(np.arange(1001) % 2, 2e-6, -2e-6)
    times[0] = 0
    assert np.array_equal(strength.every(times, 0.05), np.arange(0, 1001, 5))
    assert np.array_equal(strength.every(times[::5], 0.05), np.arange(201))


def test_a_shear_that_has_only_begun_has_no_peak():
    with pytest.raises(MissingData, match="series.h5: no row 0.05 s after the shear began"):
        strength.strength(stage([0, 0.0005], [0, 0.1], [0, 0]))


def test_reading_up_to_a_strain():
    x = np.linspace(0, 1, 2001)
    s = strength.strength(stage(x, x, x), until=0.5)
    assert s.strain == pytest.approx(0.5) and s.peak_raw == pytest.approx(0.5)


def test_slope_is_that_of_the_line_through_a_window():
    x = np.linspace(0, 1, 401)
    got = strength.slope(x, 3 * x + 2, 0.02)
    inside = np.isfinite(got)
    assert np.allclose(got[inside], 3) and inside.sum() > 380 and not inside[0]
    assert np.allclose(strength.slope(x, np.sin(5 * x), 0.02)[inside], 5 * np.cos(5 * x)[inside], atol=2e-3)
    assert np.isnan(strength.slope(np.zeros(50), np.arange(50), 0.02)).all()  # at one place


def test_taylor_s_relation_of_curves_that_keep_it_or_not():
    x, mu_cs = np.linspace(0, 1, 2001), 0.35
    friction = mu_cs + 0.2 * (x / 0.05) * np.exp(1 - x / 0.05)  # a peak of 0.55 at a strain of 0.05
    lifted = 0.2 * 0.05 * np.e * (1 - (1 + x / 0.05) * np.exp(-x / 0.05))  # the integral of what is above mu_cs
    kept = strength.taylor(stage(x, friction, lifted))
    assert kept.mu_cs == pytest.approx(mu_cs, abs=1e-4)
    assert np.nanmax(np.abs(kept.residual)) < 3e-3  # a line through a bent window is not quite its mean slope
    assert kept.strain[kept.at_peak] == pytest.approx(0.05, abs=0.003)
    assert kept.area == pytest.approx(lifted[-1], rel=0.002)
    half = strength.taylor(stage(x, friction, lifted / 2))
    assert half.residual[half.at_peak] == pytest.approx(0.1, abs=0.005) and half.mu_cs == pytest.approx(mu_cs, abs=1e-4)


def test_mohr_coulomb_recovers_a_line_and_its_standard_errors():
    sigma = np.repeat([10e3, 20e3, 40e3, 60e3, 80e3, 120e3], 3)
    exact = strength.mohr_coulomb(sigma, 1200 + sigma * np.tan(np.radians(32)))
    assert exact.phi == pytest.approx(32) and exact.C == pytest.approx(1200) and exact.phi_se < 1e-6
    tau = 1200 + sigma * np.tan(np.radians(32)) + rng.normal(0, 500, len(sigma))
    fit = strength.mohr_coulomb(sigma, tau)
    slope, intercept = np.polyfit(sigma, tau, 1)   # ordinary least squares has the same answer
    variance = ((tau - intercept - slope * sigma)**2).sum() / (len(sigma) - 2)
    slope_se = np.sqrt(variance / ((sigma - sigma.mean())**2).sum())
    C_se = np.sqrt(variance * (1 / len(sigma) + sigma.mean()**2 / ((sigma - sigma.mean())**2).sum()))
    assert np.tan(np.radians(fit.phi)) == pytest.approx(slope, rel=1e-6)
    assert fit.C == pytest.approx(intercept, rel=1e-5)
    assert fit.C_se == pytest.approx(C_se, rel=1e-4)
    assert np.radians(fit.phi_se) == pytest.approx(slope_se / (1 + slope**2), rel=1e-4)
    assert fit.interval()[0] == pytest.approx(2.1199 * fit.phi_se, rel=1e-4)  # t of 16 degrees of freedom


def test_mohr_coulomb_needs_two_stresses():
    with pytest.raises(ValueError, match="at least 3 points at 2 normal stresses, not 3 at 1"):
        strength.mohr_coulomb([1, 1, 1], [1, 2, 3])


def test_porosity_cuts_spheres_exactly():
    r = 0.1
    edges, phi = profile.porosity(bed([0.5], r, box=(0.5, 0.4, 1), top=1.0), thickness=0.5)
    half = 2 / 3 * np.pi * r**3
    assert np.allclose(edges, [0, 0.5, 1.0])
    assert np.allclose(phi, 1 - half / (0.2 * 0.5))
    edges, phi = profile.porosity(bed([0.25], r, box=(0.5, 0.4, 1), top=1.0), thickness=0.2)
    cap = np.pi * 0.05**2 * (3 * r - 0.05) / 3     # above 0.2 lies all but a cap of height 0.05
    assert phi[0] == pytest.approx(1 - cap / (0.2 * 0.2))
    assert phi[1] == pytest.approx(1 - (4 / 3 * np.pi * r**3 - cap) / (0.2 * 0.2))
    assert np.allclose(phi[2:], 1)


def test_depth_of_the_porosity_gained():
    r = 0.05
    z = np.arange(0.05, 1, 0.1)                     # one grain in the middle of each of ten slabs
    before = bed(z, r, box=(0.2, 0.2, 1))
    after = bed(np.delete(z, [2, 6]), r, box=(0.2, 0.2, 1))
    assert profile.loosened_depth(before, after) == pytest.approx((0.75 + 0.35) / 2 / 0.1)
    assert np.isnan(profile.loosened_depth(before, before))


def test_shear_zone_of_a_linear_profile():
    z = np.linspace(0.005, 0.995, 400)
    u = np.clip((z - 0.5) / 0.5, 0, None)          # the upper half shears
    role = np.where(z > 0.98, 2, 0)
    depth, integral = profile.shear_zone(bed(z, 0.01, role, u), share=0.05)
    top = z[role == 2].mean()
    layer = u[role == 2].mean()
    assert depth * 0.02 == pytest.approx(top - (0.5 + 0.5 * 0.05 * layer), abs=2e-3)
    assert integral * 0.02 == pytest.approx(0.25 / layer, rel=2e-2)


def test_shear_zone_says_what_is_missing():
    with pytest.raises(MissingData, match="no grain has role 2"):
        profile.shear_zone(bed([0.1, 0.2], 0.02))


def test_rotation_of_free_grains():
    omega = rng.normal([0, 0.5, 0], [1, 2, 3], (500, 3))
    found = rotation.statistics(bed(np.zeros(502), 0.02, [0] * 500 + [1, 2], rotation=np.vstack([omega, [[9, 9, 9]] * 2])))
    assert found.grains == 500
    assert np.allclose(found.mean, omega.mean(axis=0))
    assert np.allclose(found.variance, ((omega - omega.mean(axis=0))**2).sum(axis=0) / 499)


def test_exponential_is_recovered():
    t = np.linspace(0, 1.5, 151)
    fit = compaction.exponential(t, 0.04 - 0.03 * np.exp(-t / 0.2))
    assert fit.time == pytest.approx(0.2) and fit.final == pytest.approx(0.04) and fit.amplitude == pytest.approx(0.03)
    late = compaction.exponential(t, 0.04 - 0.03 * np.exp(-t / 0.2), begin=0.5)
    assert late.time == pytest.approx(0.2) and late.amplitude == pytest.approx(0.03 * np.exp(-2.5))
    with pytest.raises(ValueError, match="at least 5 rows"):
        compaction.exponential(t[:3], t[:3])


def test_inertia_number_of_table_1():
    assert compaction.inertia_number(0.05, 0.02, 2600, 10e3) == pytest.approx(5.1e-4, rel=1e-2)
    assert compaction.inertia_number(0.05, 0.02, 2600, 120e3) == pytest.approx(1.5e-4, rel=2e-2)
