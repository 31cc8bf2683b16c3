"""The study of the paper: where its runs lie, what they are, and the words of its report."""
import contextlib
import shutil
import tomllib

import numpy as np
import pytest

from conftest import root
from fake_case import FakeCase
from moraine import measure, report, reproduce
from moraine.__main__ import main
from moraine.case import Case, MissingData
from moraine.study import Study, stress_names, toml
from moraine.reproduce import seeds


def test_names_are_those_of_a_sweep():
    assert stress_names("10,20 kPa") == ["10kPa", "20kPa"]
    assert stress_names("80 kPa,") == ["80kPa"]
    assert stress_names("10 kPa, 1 bar") == ["10kPa", "1bar"]
    assert stress_names("12 500, 15 000 Pa") == ["12500Pa", "15000Pa"]


def test_a_study_and_its_cases():
    study = Study(seeds=[4])
    cases = {str(d): tomllib.loads(text) for d, text in study.case_files()}
    assert cases == {
        "runs/fast/seed-4/settle": {"extends": "../../../../settle", "model": {"preset": "fast"}, "grains": {"seed": 4}},
        "runs/fast/seed-4/shear": {"extends": "../../../../shear", "start": "../settle", "model": {"preset": "fast"},
                                   "grains": {"seed": 4}}}


def test_a_variant_shares_the_settled_bed():
    study = Study(seeds=[1], settings={"wall.mass": "64 kg", "stage.shear.clear_history": "true"})
    assert study.name == "fast+mass-64_kg+shear.clear_history-true"
    cases = {str(d): tomllib.loads(text) for d, text in study.case_files()}
    assert set(cases) == {"runs/fast/seed-1/settle", f"runs/{study.name}/seed-1/shear"}
    assert cases["runs/fast/seed-1/settle"].keys() == {"extends", "model", "grains"}
    shear = cases[f"runs/{study.name}/seed-1/shear"]
    assert shear["start"] == "../../../fast/seed-1/settle"
    assert shear["wall"] == {"mass": "64 kg"} and shear["stage"] == [{"name": "shear", "clear_history": True}]


def test_a_variant_of_the_bed_settles_its_own():
    study = Study(seeds=[1], settings={"stage.settle.mu_s": "0.1"})
    cases = {str(d): tomllib.loads(text) for d, text in study.case_files()}
    assert cases[f"runs/{study.name}/seed-1/settle"]["stage"] == [{"name": "settle", "mu_s": 0.1}]
    assert cases[f"runs/{study.name}/seed-1/shear"]["start"] == "../settle"
    assert "stage" not in cases[f"runs/{study.name}/seed-1/shear"]


def test_the_same_word_twice_keeps_its_table():
    study = Study(settings={"contact.gamma_n": "200 N s/m", "wall.gamma_n": "0"})
    assert study.name == "fast+contact.gamma_n-200_N_s_m+wall.gamma_n-0"


def test_values_are_toml():
    assert [toml(v) for v in ("0.5", ".5", "1.", "-3", "05", "1e-3", "64 kg", "true")] == \
        ["0.5", "0.5", "1.0", "-3", "5.0", "1e-3", '"64 kg"', "true"]
    for text in map(toml, (".5", "1.", "-0", "1e5", "+3", "inf", "64 kg", 'a "b"')):
        tomllib.loads(f"x = {text}")


def test_normal_stresses_are_those_of_the_sweep(capsys):
    assert main(["reproduce", "paper-2013", "--set", "stage.shear.normal_stress=40kPa", "--dry-run"]) == 1
    assert "give --set normal_stress=40kPa" in capsys.readouterr().err


def test_beds_of_another_study():
    study = Study(preset="paper", seeds=[1], settled="fast")
    (directory, text), = study.case_files()
    assert str(directory) == "runs/paper/seed-1/shear" and 'start = "../../../fast/seed-1/settle"' in text


def test_a_case_of_another_study_is_not_overwritten(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    study = Study(seeds=[1])
    study.write_cases()
    study.write_cases()
    file = tmp_path / "runs/fast/seed-1/settle/case.toml"
    file.write_text("title = 'mine'\n")
    with pytest.raises(SystemExit, match="is not that of this study"):
        study.write_cases()
    assert file.read_text() == "title = 'mine'\n"


def test_the_configuration_survives_being_written(tmp_path):
    import json
    study = Study(seeds=[1, 2], quick=True, settings={"wall.mass": "64 kg"})
    file = study.write_config(tmp_path)
    assert Study.from_config(json.loads((tmp_path / file).read_text())).name == study.name == "quick+mass-64_kg"


@pytest.mark.skipif(not shutil.which("snakemake"), reason="snakemake is not installed")
def test_what_the_workflow_runs(tmp_path, monkeypatch):
    """With a launcher that only notes its arguments, in a directory whose name has a space."""
    home = tmp_path / "a copy"
    shutil.copytree(root / "cases/paper-2013", home / "cases/paper-2013", ignore=shutil.ignore_patterns("runs", ".snakemake", "results"))
    launcher, calls = home / "moraine", home / "calls"
    launcher.write_text(f"""#!/bin/sh\nprintf '%s|' "$@" >>'{calls}'\necho >>'{calls}'\n""")
    launcher.chmod(0o755)
    (home / "python").symlink_to(root / "python")
    monkeypatch.setattr(reproduce, "root", home)
    monkeypatch.delenv("MORAINE_LAUNCHER", raising=False)
    assert main(["reproduce", "paper-2013", "--seeds", "1", "--cores", "1"]) != 0  # the report finds no run
    assert calls.read_text().splitlines() == [
        'check|runs/fast/seed-1/settle|--set|start=""|',
        'check|runs/fast/seed-1/shear|--set|start=""|--set|normal_stress=120 kPa|',
        "run|runs/fast/seed-1/settle|--resume|--threads|1|--backend|cpu|",
        "sweep|runs/fast/seed-1/shear|--set|normal_stress=10,20,40,60,80,120 kPa|--resume|--threads|1|--backend|cpu|"]
    calls.unlink()
    report = home / "cases/paper-2013/runs/fast/results/report.html"  # of before: no reason to leave out what is wanted besides
    report.parent.mkdir(exist_ok=True)
    report.touch()
    main(["reproduce", "paper-2013", "--seeds", "1", "--cores", "1", "--set", "normal_stress=30kPa"])
    assert calls.read_text().splitlines()[2:] == ["sweep|runs/fast/seed-1/shear|--set|normal_stress=30kPa,|--resume|--threads|1|--backend|cpu|"]


def test_two_at_once_do_not_share_a_bed(tmp_path):
    with contextlib.ExitStack() as stack:
        for file in reproduce.hold(tmp_path, Study(seeds=[1])):
            stack.enter_context(file)
        with pytest.raises(MissingData, match="runs/fast is in use by another reproduce"):
            reproduce.hold(tmp_path, Study(seeds=[1], settings={"wall.mass": "64 kg"}))
        reproduce.hold(tmp_path, Study(preset="paper"))
    reproduce.hold(tmp_path, Study(seeds=[1], settings={"wall.mass": "64 kg"}))


def test_variants_share_a_bed_that_has_settled(tmp_path):
    heavy, slow = (Study(seeds=[1], settings={key: value}) for key, value in (("wall.mass", "64 kg"), ("model.f", "0.1")))
    (tmp_path / "runs/fast/seed-1").mkdir(parents=True)
    with contextlib.ExitStack() as stack:
        for file in reproduce.hold(tmp_path, heavy):  # it will settle the bed
            stack.enter_context(file)
        with pytest.raises(MissingData, match="runs/fast is in use"):
            reproduce.hold(tmp_path, slow)
    (tmp_path / "runs/fast/seed-1/settle.done").touch()
    with contextlib.ExitStack() as stack:
        for study in heavy, slow:
            for file in reproduce.hold(tmp_path, study):
                stack.enter_context(file)
        for study in heavy, Study(seeds=[1]):
            with pytest.raises(MissingData, match="is in use by another reproduce"):
                reproduce.hold(tmp_path, study)


def test_seeds():
    assert seeds("3") == [1, 2, 3] and seeds("4,7") == [4, 7]
    for wrong in ("0", "a", "1,", "-1"):
        with pytest.raises(MissingData, match="--seeds"):
            seeds(wrong)


def rows(phi=30.0, C=1e3, noise=0.0, count=3):
    rng = np.random.default_rng(2)
    return [{"seed": s, "sigma_0_kPa": sigma, "friction_peak": (C / sigma / 1e3 + np.tan(np.radians(phi))) + noise * rng.normal(),
             "friction_peak_raw": 0.7 + 0.01 * rng.normal(), "friction_ultimate": 0.35 + 0.003 * rng.normal(), "strain_peak": 0.01 * sigma + 0.01 * rng.normal(),
             "strain_dilated": 0.3 + 0.01 * rng.normal(), "dilation_d": 0.75 + 1e-3 * s, "rotation_mean_x": (x := -0.003 + 0.01 * rng.normal()), "free_rotation_mean_x": x}
            for s in range(1, count + 1) for sigma in (10.0, 20.0, 40.0, 60.0, 80.0, 120.0)]


def find(lines, start):
    return next(x for x in lines if x.quantity.startswith(start))


def test_verdicts_follow_the_numbers():
    lines = report.quantities(rows(phi=32.1, noise=0.003))
    assert find(lines, "φ_p (smoothed)").verdict == "agrees"
    assert find(lines, "φ_u").verdict == "lower"
    lines = report.quantities(rows(phi=40.0, noise=0.003))
    assert find(lines, "φ_p (smoothed)").verdict == "higher"
    assert find(lines, "strain at the smoothed peak").verdict == "holds"
    assert find(lines, "strain until dilation").verdict == "no trend to be seen"
    assert find(lines, "dilation at 80 kPa").verdict == "agrees"
    assert find(lines, "mean of the rotation about x").verdict == "agrees"


def test_a_trend_is_no_stronger_than_its_runs():
    assert report.trend([1, 2, 3], [1, 2, 3], [1, 1, 1])[:2] == pytest.approx((1, 1 / 3), abs=0.02)  # of 6 orders, 2
    assert report.trend(range(6), range(6), [1] * 6)[:2] == pytest.approx((1, 2 / 720), abs=2e-3)
    rank, p, _ = report.trend([1, 2, 3] * 2, [1, 2, 3, 11, 12, 13], [1, 1, 1, 2, 2, 2])  # packings that differ hide no trend
    assert rank < 0.6 and p == pytest.approx(2 / 36, abs=0.01)
    three = [r for r in rows(count=1) if r["sigma_0_kPa"] in (20, 80, 120)]
    assert find(report.quantities(three), "strain at the smoothed peak").verdict == "too few runs to tell"


def test_one_run_gives_no_interval():
    lines = report.quantities(rows(count=1))
    assert find(lines, "dilation at 80 kPa").verdict == "too few runs to tell"


def test_directions_have_a_sign():
    along, against = (measure.tilt(np.outer(v, v)) for v in ([1.0, 0, -1], [-1.0, 0, -1]))
    assert along == pytest.approx(45) and against == pytest.approx(-45)
    chains = {"above_4_sheared": 0.1, "above_4_consolidated": 0.1, "strong_tilt_consolidated": 3.0, "applied_tilt": 20.0, "stress_tilt": 40.0}
    for tilt, verdict in ((40, "along the largest principal stress, not the paper's sum"), (20, "holds"), (-20, "does not hold")):
        lines = report.quantities([r | chains | {"strong_tilt_sheared": tilt} for r in rows()])
        assert find(lines, "the same in shear").verdict == verdict


def test_one_run_cannot_tell_how_grains_roll():
    lines = report.quantities([r | {"opposite_spins": 0.6} for r in rows(count=1)[:1]])
    assert find(lines, "contacts whose grains spin").verdict == "too few runs to tell"


def test_what_sets_the_runs_apart_is_said():
    def said(**what):
        return report.differs([r | {"grains": 10000, "strain": 1.0} | what for r in rows()])
    assert said() == ""
    assert "1,000 grains instead of 10,000, so" in said(grains=1000)
    assert "grains" not in said(strain=0.1) and "a shear strain of 0.10 instead of 1" in said(strain=0.1)
    assert "10,000 and a shear strain" in said(grains=1000, strain=0.1)


def test_a_run_under_way_is_left_out(tmp_path):
    case = FakeCase(tmp_path / "case")
    history = case.history()
    case.write(history)
    measure.require_end(Case(case.directory))
    case.write(history[:-30])
    with pytest.raises(MissingData, match="the shear has come to 8. % of its time"):
        measure.require_end(Case(case.directory))


def test_what_was_not_measured_is_left_out():
    lines = report.quantities(rows())
    assert not [x for x in lines if "4 σ_0" in x.quantity or "shear zone at" in x.quantity]
    assert find(lines, "shear zone (5 %").verdict == "not tested"


def test_in_short():
    lines = [report.Line(q, "", "", "", v) for q, v in (("dilation", "agrees"), ("order", "holds"), ("φ_p", "lower: not from this model (notes)"),
                                                         ("zone", "too few runs to tell"), ("I", "the paper's own Table 1 gives 5.1e-4"))]
    assert report.in_short(lines) == ("Agrees with the paper, or holds (2): dilation; order. Does not (1): φ_p. Cannot be told (1): zone.")


def test_mean_and_interval():
    mean, half = report.mean_interval([1.0, 2.0, 3.0])
    assert mean == 2.0 and half == pytest.approx(4.30265 / np.sqrt(3), rel=1e-5)
    assert np.isnan(report.mean_interval([1.0])[1])


def test_the_paper_s_one_run_may_lie_where_a_further_run_would():
    rng, inside = np.random.default_rng(3), 0
    for _ in range(2000):
        values, other = rng.normal(size=4), rng.normal()
        inside += report.compare(values.mean(), other, report.further_run(values)) == "agrees"
    assert inside / 2000 == pytest.approx(0.95, abs=0.015)


def test_table_survives_being_written(tmp_path):
    file = tmp_path / "m.csv"
    measure.table([{"program": "moraine 0.1.0, cpu, 1 thread"} | r for r in rows()], file)
    again = measure.read_table(file)
    assert again[0]["program"] == "moraine 0.1.0, cpu, 1 thread"  # with a comma in it
    assert again[0]["sigma_0_kPa"] == 10 and again[-1]["strain_peak"] == pytest.approx(rows()[-1]["strain_peak"], rel=1e-5)
