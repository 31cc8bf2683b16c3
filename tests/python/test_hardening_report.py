"""The report of hardening-2015, on made-up runs: what is read off a run, and what is said of many."""
import csv

import numpy as np
import pytest

import fake_wet_case
from fake_wet_case import height
from moraine import hardening_report as report
from moraine.__main__ import main
from moraine.results import Results
from moraine.hardening_report import Kind

rate_1 = {"viscosity": 1.797e-6, "k_c": 3.5e-15}


def fake(directory, **what):
    fake_wet_case.write(directory, **what)
    return Results(directory)


def test_a_run_is_measured(tmp_path):
    run = report.Run(fake(tmp_path / "wet", peak=1.2, closure="full", **rate_1))
    found, rows = run.measured(), run.rows
    assert run.kind == Kind("full", 1.0)
    assert found["peak_raw"] == pytest.approx(1.2 * rows["shear_friction"].max())
    assert 0.98 * found["peak_raw"] < found["peak"] < found["peak_raw"]
    assert found["strain_at_peak"] == pytest.approx(0.05, abs=0.01)
    assert found["lowest_pressure_kPa"] == pytest.approx(-2, rel=0.01)
    k = 3.5e-15 * 0.42**3 / 0.58**2
    assert found["group"] == pytest.approx(1.797e-6 * 0.05 * height**2 / k / 20e3)
    late = rows["shear_strain"] >= 0.75 * 0.3
    assert found["effective_friction_late"] == pytest.approx(rows["shear_stress"][late].mean() / (20e3 - rows["water_pressure_mean"][late].mean()))
    assert found["friction_late"] == pytest.approx(1.2 * rows["shear_friction"][late].mean())


def test_friction_is_smoothed_as_the_original_s(tmp_path):
    """A Hann window over a strain of 0.01: rows lie 0.001 apart here, so over ten of them."""
    run = report.Run(fake(tmp_path / "wet", **rate_1))
    strain, friction = run.smooth
    window = np.hanning(10)
    k = 40
    assert friction[k] == pytest.approx((run.friction[k:k + 10] * window).sum() / window.sum())
    assert strain[k] == run.rows["shear_strain"][k + 5]


def test_the_rate_is_relative(tmp_path):
    for name, what, relative in (("k_c", {"k_c": 3.5e-13, "viscosity": 1.797e-6}, 0.01), ("mu", {"k_c": 3.5e-15, "viscosity": 1.797e-7}, 0.1),
                                 ("rate", {"k_c": 3.5e-15, "viscosity": 1.797e-6, "rate": 0.1}, 2)):
        assert report.Run(fake(tmp_path / name, **what)).kind.relative_rate == pytest.approx(relative)
    assert report.Run(fake(tmp_path / "dry", wet=False)).kind == Kind("", 0.0)


@pytest.fixture
def study(tmp_path):
    """Two packings, two rates with drag, one without, dry twins, and one run that has not come to its end."""
    for seed in (1, 2):
        here, more = tmp_path / f"runs/fast/seed-{seed}", 0.01 * seed
        fake(here / "dry", wet=False, seed=seed)
        fake(here / "wet/sweep/a", peak=1.2 + more, seed=seed, closure="full", **rate_1)
        fake(here / "wet/sweep/b", peak=1.1 + more, seed=seed, closure="full", viscosity=1.797e-6, k_c=3.5e-13)
        fake(here / "wet/sweep/c", peak=1.3 + more, seed=seed, closure="pressure_gradient", rows=None if seed == 1 else 150, **rate_1)
        fake(tmp_path / f"runs/fast+compressibility-2/seed-{seed}/wet/sweep/a", peak=1.05, seed=seed, closure="full", **rate_1)
    (tmp_path / "study.toml").write_text('title = "t"\nreport = "hardening"\n[[case]]\nname = "dry"\n')
    (tmp_path / "dry").mkdir()
    (tmp_path / "dry/case.toml").touch()
    return tmp_path / "runs/fast"


def test_report(study, capsys):
    assert main(["report", str(study)]) == 0
    said = capsys.readouterr().out
    assert "seed-2/wet/sweep/c: has come to 50 % of its shear" in said
    with (study / "results/measurements.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 7 and {r["closure"] for r in rows} == {"dry", "full", "pressure_gradient"}
    text = (study / "results/report.md").read_text()
    assert "| 1 | 0.71 | 0.61 ± " in text and "too few runs to tell" in text and "| 0.1 | 0.65 | - | - |" in text
    assert "fast+compressibility-2:" in text and "from that of the dry bed of the same packing" in text
    assert {p.name for p in (study / "results/figures").glob("*.png")} == {"curves.png", "peaks.png", "pressure.png"}


def test_agreement_is_that_of_one_more_run():
    def verdict(peaks):
        kinds = {Kind("full", 1.0): [{"peak": p} for p in peaks]}
        return next(line for line in report.peak_table(kinds) if line[0] == "1")[2]
    assert verdict([0.70, 0.71, 0.73]).endswith(": agrees")
    assert verdict([0.90, 0.91, 0.93]).endswith(": higher")
    assert verdict([0.50, 0.51, 0.53]).endswith(": lower")
    assert verdict([0.70, 0.71]).endswith(": too few runs to tell")


def test_the_critical_state_is_compared_packing_by_packing():
    def said(faster):
        rows = lambda values: [{"seed": s, "effective_friction_late": v, "strain": 0.4} for s, v in values.items()]
        return report.critical_state({Kind("", 0.0): rows({1: 0.35, 2: 0.37, 3: 0.36}), Kind("full", 1.0): rows(faster)})
    assert "no dependence on the rate is seen" in said({1: 0.351, 2: 0.368, 3: 0.361})
    assert "+0.050" in said({1: 0.400, 2: 0.421, 3: 0.409}) and "still depends" in said({1: 0.400, 2: 0.421, 3: 0.409})
    assert "cannot be told" in said({1: 0.4})


def test_a_study_without_runs(tmp_path, capsys):
    (tmp_path / "runs/fast").mkdir(parents=True)
    assert main(["report", str(tmp_path / "runs/fast")]) == 1
    assert "there is no run" in capsys.readouterr().err
