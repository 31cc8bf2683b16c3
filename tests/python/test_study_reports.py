"""What the reports of angular, lateral and hysteresis read off runs, on curves whose answers are known."""
import numpy as np
import pytest

from moraine import angular_report, hysteresis_report, lateral_report
from moraine.results import Table


def slipping_run(velocity, pressure, interval=0.01):
    """A run of hysteresis without its files."""
    run = object.__new__(hysteresis_report.Run)
    t = interval * np.arange(len(pressure))
    run.t, run.pressure, run.tau, run.sigma_0 = t, np.asarray(pressure, float), 4e3, 20e3
    run.rows = {"shear_strain": np.concatenate([[0], np.cumsum(velocity[:-1] * interval)]), "stage_time": t}
    return run


def test_where_slip_starts_and_stops():
    t = np.arange(0, 8.005, 0.01)
    pressure = 12e3 * (1 - np.abs(t % 4 - 2) / 2)
    velocity = np.where((t > 1.5) & (t < 3), 1.0, 0.0) + np.where((t > 0.5) & (t < 0.7), 0.2, 0.0)  # a small slip before, none in the second cycle
    run = slipping_run(velocity, pressure)
    assert run.cycles == [(0, 400), (400, 800)] and run.rise == pytest.approx(6e3)
    slip, = run.slips()
    assert (slip.cycle, slip.fastest) == (1, pytest.approx(1)) and slip.slip == pytest.approx(1.5, abs=0.1)
    assert slip.pressure_start == pytest.approx(9e3, abs=500) and slip.pressure_stop == pytest.approx(6e3, abs=500)
    assert slip.friction_start == pytest.approx(4 / 11, abs=0.02) and slip.friction_stop == pytest.approx(4 / 14, abs=0.02)


def lateral_run(shape, side=3.0, count=30):
    run = object.__new__(lateral_report.Run)
    run.shape, run.side, run.diameter = shape, side, 0.1
    run.__dict__["before"] = ((np.arange(count) + 0.5) * side / count, np.zeros(count))
    return run


def test_positions_across_are_counted_from_the_slowest_line(monkeypatch):
    monkeypatch.setattr(lateral_report.Run, "cells", (30, 10))
    cosine, half = lateral_run("cosine"), lateral_run("half")
    assert np.allclose(cosine.across([0.0, 0.5, 1.5, 2.75, 3.0]), [0, 0.5, 1.5, 0.25, 0])
    assert np.allclose(half.across([2.25, 0.75, 0.0, 1.5]), [0, 1.5, 0.75, 0.75])   # both margins half way
    assert list(half.strip(np.array([2.2, 1.6, 0.7]))) == [0, 1, 2]
    y = cosine.before[0]
    for run, values in ((cosine, cosine.across(y)), (half, half.across(y))):
        away, folded = run.folded(values)
        assert np.allclose(folded, away, atol=0.051) and len(away) == 15


def test_lines_of_mohr_and_coulomb_for_each_kind():
    kinds = [angular_report.Kind(False, 0.3, r) for r in (0.0, 0.5)]
    rows = [{"packing": "dense", "mu_s": 0.3, "mu_roll": k.mu_roll, "seed": s, "sigma_0_kPa": sigma, "friction_peak": np.tan(np.radians(phi)) + 1 / sigma + 1e-4 * (-1) ** s,
             "friction_peak_raw": 0.7, "friction_ultimate": 0.3 + 1e-4 * (-1) ** s} for k, phi in zip(kinds, (25, 35)) for s in (1, 2) for sigma in (20.0, 80.0)]
    head, table = angular_report.strength_table(rows, kinds)
    assert [line[1].split()[0] for line in table[:2]] == ["25.0", "35.0"] and table[0][2].startswith("1.00 ") and len(head) == len(table[0])
    assert table[2][0] == "quartz sand (Table 2)" and table[2][5] == f"{3.7 / 80 + 1:.3f}"
    assert angular_report.Kind(True, 0.5, 0.25).label == "μ_r = 0.25, μ = 0.5, loose"


def test_stage_1_contracts_or_not():
    run = object.__new__(angular_report.Run)
    strain = np.linspace(0, 0.3, 301)
    run.rows = {"shear_strain": strain, "dilation": np.where(strain < 0.02, -strain, 5 * strain - 0.12)}
    run.__dict__["diameter"] = 2.0
    assert run.contraction() == pytest.approx((0.01, 0.02), abs=1e-3)
    run.rows["dilation"] = strain
    assert run.contraction() == (0.0, 0.0)


def test_rows_up_to_the_onset_of_slip():
    rows = Table("series.h5", {"shear_strain": np.linspace(0, 2, 201)}, {})
    assert hysteresis_report.first_rows(rows)["shear_strain"][-1] == pytest.approx(hysteresis_report.onset)
    assert len(hysteresis_report.first_rows(rows.rows(slice(5)))) == 5
