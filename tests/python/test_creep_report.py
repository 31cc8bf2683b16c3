"""The report of creep-2016, on a made-up run: levels by phase, bursts, and what the original recorded, where that is there."""
import numpy as np
import pytest

from fake_case import FakeCase, stage
from moraine import creep_report as report
from moraine.__main__ import main
from moraine.results import Results, MissingData
from moraine.creep_report import Record

period = 5.0


def coordination(t, calm=3.5, creep=2.5, burst=0.2):
    """Calm, but creeping between phases of 3.495 and 4.795 s and loose from there to 0.195 s of the next period."""
    phase = t % period
    z = np.where((phase > 3.495) & (phase < 4.795), creep, calm)
    return np.where((phase >= 4.795) | ((phase < 0.195) & (t > period / 2)), burst, z)


def fake(directory, seconds=15.0, **what):
    case = FakeCase(directory, [stage("swing", "shear_stress", duration=15.0, normal_stress=80e3, shear_stress=10e3, fluid=True, top_pressure=0.0,
                                      top_pressure_amplitude=70e3, top_pressure_frequency=0.2, top_pressure_phase=np.pi)])
    rows = case.history()
    rows["coordination"] = coordination(rows["stage_time"], **what)
    rows["shear_strain"] = 0.1 * rows["stage_time"]
    case.write(rows[rows["stage_time"] <= seconds + 1e-9])
    return Results(directory)


def record(seconds=15.0, **what):
    t = np.arange(0.01, seconds + 1e-9, 0.01)
    return Record("made up", t, coordination(t, **what), period)


def test_levels_are_medians_over_the_periods_after_the_first():
    r = record()
    r.coordination[(r.t > 6.9) & (r.t < 7.1)] = 1.0  # in one of two periods
    assert r.level(1.0) == 3.5 and r.level(4.0) == 2.5 and len(r.at(4.0)) == 2
    assert r.level(2.0) == (3.5 + 1.0) / 2


def test_bursts_are_found_in_the_period_in_which_they_begin():
    bursts = record().bursts()
    assert [b[0] for b in bursts] == [1, 2]  # that of the third is not over
    for _, begin, end, lowest, span in bursts:
        assert begin == pytest.approx(4.8, abs=0.011) and end == pytest.approx(5.19, abs=0.011)
        assert lowest == 0.2 and span == pytest.approx(0.4, abs=0.02)
    assert all(np.isnan(b[1]) for b in record(burst=1.5).bursts())


def test_the_stress_that_the_grains_bear(tmp_path):
    run = report.Run(fake(tmp_path / "case"))
    assert run.effective(1.25) == pytest.approx(150e3) and run.effective(3.75) == pytest.approx(10e3)
    assert [round(x[1], 3) for x in run.by_period()] == [0.5, 0.5, 0.5]


@pytest.fixture
def study(tmp_path):
    fake(tmp_path / "runs/fast/seed-1/swing")
    (tmp_path / "study.toml").write_text('title = "t"\nreport = "creep"\n[[case]]\nname = "swing"\n')
    (tmp_path / "swing").mkdir()
    (tmp_path / "swing/case.toml").touch()
    return tmp_path / "runs/fast"


def test_report_beside_the_original(study, tmp_path, monkeypatch):
    t = record(30.0, calm=3.6, creep=2.0, burst=0.05)
    np.savetxt(tmp_path / "original.txt", [np.zeros(len(t.t)), np.zeros(len(t.t)), t.coordination])
    monkeypatch.setattr(report, "original_file", tmp_path / "original.txt")
    assert main(["report", str(study)]) == 0
    text = (study / "results/report.md").read_text()
    assert "| 1 | 147 | 3.50 | 3.60 | -0.10 | within 0.15 |" in text and "| 4 | 13 | 2.50 | 2.00 | +0.50 | outside 0.3 |" in text
    assert "| 2 | 4.80 to 5.19 s | 0.40 s | 0.20 | 4.80 to 5.19 s | 0.40 s | 0.05 |" in text
    assert {p.name for p in (study / "results/figures").glob("*.png")} == {"overlay.png", "phase.png"}


def test_report_without_the_original(study, monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(report, "original_file", tmp_path / "nowhere.txt")
    assert main(["report", str(study)]) == 0
    assert "the original's record is not here (nowhere.txt)" in capsys.readouterr().out
    text = (study / "results/report.md").read_text()
    assert "| 1 | 147 | 3.50 | - | - | - |" in text


def test_a_run_under_way_is_shown(tmp_path, capsys):
    fake(tmp_path / "runs/fast/seed-1/swing", seconds=11.0)
    report.build(tmp_path / "runs/fast", tmp_path / "results")
    assert "has come to 73 % of its time" in capsys.readouterr().out


def test_a_run_without_a_whole_period_is_left_out(tmp_path):
    fake(tmp_path / "runs/fast/seed-1/swing", seconds=3.0)
    with pytest.raises(MissingData, match="has not come to the end of its first period"):
        report.build(tmp_path / "runs/fast", tmp_path / "results")
