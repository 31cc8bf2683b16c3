"""Wet beds: their figures, and the command that runs and reports the experiments on till."""
import csv
from pathlib import Path
import sys
import tomllib

import numpy as np
import pytest

import fake_wet_case
from fake_wet_case import height
from moraine import figures, till, till_report, water_figures
from moraine.__main__ import main
from moraine.case import Case, MissingData


def fake(directory, **what):
    """See fake_wet_case.py."""
    fake_wet_case.write(directory, **what)
    return Case(directory)


@pytest.fixture
def home(tmp_path, monkeypatch):
    """An empty cases/till."""
    monkeypatch.setattr(till, "root", tmp_path)
    (tmp_path / "cases/till").mkdir(parents=True)
    return tmp_path / "cases/till"


def test_pressure_by_level_and_time(tmp_path):
    times, heights, levels = water_figures.pressure_field(fake(tmp_path / "case").stage("shear"))
    assert times == pytest.approx([0, 1, 2, 3]) and heights == pytest.approx([0.8, 0.81, 0.82, 0.83])
    assert levels == pytest.approx(-1000 * np.outer([0, 1, 2, 3], [1, 2, 3, 4]))


def test_a_snapshot_without_water_says_so(tmp_path):
    shear = fake(tmp_path / "case", wet=False).stage("shear")
    with pytest.raises(MissingData, match="there is no water in it"):
        shear.snapshots[0].water_grid
    with pytest.raises(MissingData, match="fewer than two snapshots of stage shear hold water"):
        water_figures.pressure(shear)


def test_a_wet_case_has_two_more_figures_and_a_dry_one_none(tmp_path, capsys):
    wet, dry = (fake(tmp_path / name, wet=name == "wet") for name in ("wet", "dry"))
    names = {f.name for f in figures.Selection([wet]).figures} - {f.name for f in figures.Selection([dry]).figures}
    assert names == {"water-shear", "water-pressure"}
    assert main(["figures", str(wet.directory), "--format", "png", "--only", ",".join(names)]) == 0
    assert {p.stem for p in (wet.directory / "figures").glob("*.png")} == names
    capsys.readouterr()
    main(["figures", str(dry.directory), "--format", "png", "--output", str(tmp_path / "figures")])
    said = capsys.readouterr()
    assert "water" not in said.out + said.err
    assert main(["figures", str(dry.directory), "--only", "water-shear"]) == 1
    assert "no case has a shear stage with pore water" in capsys.readouterr().out


def test_a_run_is_measured(tmp_path):
    run = till_report.Run("wet", fake(tmp_path / "wet", peak=1.2))
    found = run.measured()
    rows = run.rows
    assert found["peak_raw"] == 1.2 * rows["shear_friction"].max()
    assert 0.99 * found["peak_raw"] < found["peak"] < found["peak_raw"]
    assert found["strain_at_peak"] == pytest.approx(0.05, abs=0.01)
    assert found["lowest_pressure_kPa"] == pytest.approx(-2, rel=0.01)
    assert found["mu_rate_over_k_c_Pa_m2"] == pytest.approx(1.8e-3 * 0.05 / 3.5e-9)
    k = 3.5e-9 * 0.42**3 / 0.58**2
    assert found["group"] == pytest.approx(1.8e-3 * 0.05 * height**2 / k / 20e3)
    assert found["friction_end"] == pytest.approx(rows["total_friction"][rows["shear_strain"] > 0.2699].mean())


def test_a_dry_run_needs_no_columns_of_water(tmp_path):
    run = till_report.Run("dry", fake(tmp_path / "dry", wet=False))
    assert "total_friction" not in run.rows and run.measured()["peak_raw"] == run.rows["shear_friction"].max()


def test_report(home, capsys):
    directories = till.hardening_directories()
    fake(directories["dry+rate-0.05"], wet=False)
    fake(directories["k_c-3.5e-9+rate-0.05"], peak=1.2)
    fake(directories["k_c-3.5e-10+rate-0.05"], k_c=3.5e-10, peak=1.5, snapshots=0)
    fake(directories["k_c-3.5e-10+rate-0.1"], k_c=3.5e-10, rate=0.1, rows=150)
    assert main(["till", "report"]) == 0
    said = capsys.readouterr().out
    assert "k_c-3.5e-8+rate-0.1: left out: it has not been run" in said
    assert "k_c-3.5e-10+rate-0.1: has come to 50 % of its shear" in said
    assert "pressure-k_c-3.5e-10+rate-0.05: not drawn" in said
    results = home / "results"
    with (results / "hardening.csv").open() as file:
        rows = {r["run"]: r for r in csv.DictReader(file)}
    assert set(rows) == {"dry+rate-0.05", "k_c-3.5e-9+rate-0.05", "k_c-3.5e-10+rate-0.05"}
    assert float(rows["k_c-3.5e-10+rate-0.05"]["peak_over_dry"]) == pytest.approx(1.5, rel=1e-5)
    text = (results / "hardening.md").read_text()
    assert "| 3.5e-09 | 0.05 | 25.7 |" in text and "| dry | 0.05 |" in text and "0.71" in text and "1.20" in text
    assert {p.stem for p in (results / "figures").glob("*.png")} == {
        "hardening", "peaks", "dilation", "pressure-k_c-3.5e-9+rate-0.05", "pressure-k_c-3.5e-10+rate-0.1"}
    for name in ("hardening", "peaks", "dilation"):
        assert f"figures/{name}.png" in text


def test_report_without_dry_twins(home):
    directories = till.hardening_directories()
    fake(directories["k_c-3.5e-9+rate-0.05"])
    notes = till_report.build(directories, home / "results", lambda _: None)
    assert len(notes) == 11 and (home / "results/figures/peaks.png").exists()


def test_report_with_nothing_to_report(home, capsys):
    assert main(["till", "report"]) == 1
    assert "./moraine till hardening runs them" in capsys.readouterr().err


def test_cases_set_only_what_differs(home):
    cases = {name: tomllib.loads(text) for name, text in till.hardening_cases().items()}
    assert len(cases) == 12 and set(cases) == set(till.hardening_directories())
    wet, dry = cases["k_c-3.5e-10+rate-0.1"], cases["dry+rate-0.1"]
    assert wet["extends"] == dry["extends"] == "../../" and "start" not in wet
    assert wet["fluid"] == {"permeability_factor": "3.5e-10 m2"} and dry["fluid"] == {"enabled": False}
    assert wet["stage"] == dry["stage"] == [{"name": "shear", "strain_rate": "0.1 1/s"}]
    assert wet["output"] == {"series_interval": "0.01 s", "snapshot_interval": "0.25 s"}
    assert list(cases)[0].endswith("0.025")  # what takes longest comes first


program = """#!{python}
import sys
sys.path.insert(0, {tests!r})
from pathlib import Path
import shutil
import fake_wet_case
words, directory = sys.argv[1:], Path(sys.argv[2])
with Path({calls!r}).open("a") as calls:
    print(*words, file=calls)
if "3.5e-8+rate-0.1" in directory.name and {fails}:
    sys.exit("moraine: it went wrong")
shutil.rmtree(directory / "output", ignore_errors=True)
fake_wet_case.write(directory, wet="dry" not in directory.name, snapshots=2)
"""


@pytest.fixture
def calls(tmp_path, monkeypatch):
    """Of a program that leaves a made-up case behind: calls(fails) sets it up, calls() has the lines of its arguments so far."""
    file, script = tmp_path / "calls", tmp_path / "program"
    monkeypatch.setenv("MORAINE_PROGRAM", str(script))

    def use(fails=None):
        if fails is None:
            return file.read_text().splitlines() if file.exists() else []
        script.write_text(program.format(python=sys.executable, tests=str(Path(__file__).resolve().parent), calls=str(file), fails=fails))
        script.chmod(0o755)
    use(False)
    return use


def case_in(directory):
    directory.mkdir(parents=True)
    (directory / "case.toml").write_text('title = "a case"\n')


def test_hardening_runs_what_is_missing(home, calls, capsys):
    case_in(home / "bed")
    directories = till.hardening_directories()
    fake(directories["dry+rate-0.05"], wet=False)
    (directories["dry+rate-0.05"] / "case.toml").write_text(till.hardening_cases()["dry+rate-0.05"])
    calls(True)
    assert main(["till", "hardening", "--at-once", "3"]) == 1
    said = capsys.readouterr()
    assert calls()[0] == "run cases/till/bed --resume --quiet --threads 3 --backend cpu"
    assert len(calls()) == 12 and not any("dry+rate-0.05" in c for c in calls())
    assert "run cases/till/hardening/runs/dry+rate-0.1 --resume --quiet --threads 1 --backend cpu" in calls()
    assert "1 of 12 runs have finished; 3 at once" in said.out and said.out.count(": finished (") == 10 + 1
    assert "k_c-3.5e-8+rate-0.1: moraine: it went wrong" in said.err


def test_a_case_that_was_changed_stays(home, calls, capsys):
    directory = till.hardening_directories()["dry+rate-0.1"]
    case_in(directory)
    assert main(["till", "hardening"]) == 1
    assert "is not that of this study" in capsys.readouterr().err and calls() == []
    assert (directory / "case.toml").read_text() == 'title = "a case"\n'


def test_two_at_once_are_refused(home, capsys):
    with till.hold(home / "hardening/runs"):
        assert main(["till", "hardening"]) == 1
    assert "in use by another ./moraine till" in capsys.readouterr().err


def test_quick(home, calls):
    case_in(home / "quick-undrained")
    case_in(home / "quick-undrained/dry")
    assert main(["till", "quick"]) == 0
    assert sorted(c.split()[1] for c in calls()) == ["cases/till/quick-undrained", "cases/till/quick-undrained/dry"]
    assert {p.name for p in (home / "results/figures").iterdir()} == {"quick-undrained.png", "pressure-quick-undrained.png"}
    assert main(["till", "quick"]) == 0 and len(calls()) == 2


@pytest.mark.parametrize("wrong", ["0", "-1", "many", "1.5"])
def test_at_once_is_a_count(wrong, capsys):
    assert main(["till", "quick", f"--at-once={wrong}"]) == 1
    assert "--at-once" in capsys.readouterr().err
