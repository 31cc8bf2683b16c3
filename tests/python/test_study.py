"""The study of the paper: where its runs lie, what they are, and the words of its report."""
import contextlib
import shutil
import tomllib

import numpy as np
import pytest

from conftest import root
from fake_case import FakeCase
from moraine import measure, paper_report as report, reproduce
from moraine.__main__ import main
from moraine.results import Results, MissingData
from moraine.study import Study as AnyStudy, toml
from moraine.reproduce import last_value, seeds

paper = root / "cases/paper-2013"


def Study(home=paper, **what):
    return AnyStudy(home=home, **what)


def cases_of(study):
    return {str(d): tomllib.loads(text) for d, text in study.case_files()}


def test_every_study_can_be_read():
    assert reproduce.studies() == ["angular", "creep-2016", "grading", "hardening-2015", "hysteresis", "lateral", "paper-2013"]
    for name in reproduce.studies():
        for quick in False, True:
            assert cases_of(AnyStudy(root / "cases" / name, quick=quick))


def test_a_study_and_its_cases():
    assert cases_of(Study(seeds=[4])) == {
        "runs/fast/seed-4/settle": {"extends": "../../../../settle", "model": {"preset": "fast"}, "grains": {"seed": 4}},
        "runs/fast/seed-4/shear": {"extends": "../../../../shear", "start": "../settle", "model": {"preset": "fast"},
                                   "grains": {"seed": 4}}}


def test_a_variant_shares_the_settled_bed():
    study = Study(seeds=[1], settings={"wall.mass": "64 kg", "stage.shear.clear_history": "true"})
    assert study.name == "fast+mass-64_kg+shear.clear_history-true"
    cases = cases_of(study)
    assert set(cases) == {"runs/fast/seed-1/settle", f"runs/{study.name}/seed-1/shear"}
    assert cases["runs/fast/seed-1/settle"].keys() == {"extends", "model", "grains"}
    shear = cases[f"runs/{study.name}/seed-1/shear"]
    assert shear["start"] == "../../../fast/seed-1/settle"
    assert shear["wall"] == {"mass": "64 kg"} and shear["stage"] == [{"name": "shear", "clear_history": True}]


def test_a_variant_of_the_bed_settles_its_own():
    study = Study(seeds=[1], settings={"stage.settle.mu_s": "0.1"})
    cases = cases_of(study)
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
    assert [last_value(v) for v in ("10,20 kPa", "80 kPa,", "full, pressure_gradient")] == ["20 kPa", "80 kPa", "pressure_gradient"]


def test_normal_stresses_are_those_of_the_sweep(capsys):
    assert main(["reproduce", "paper-2013", "--set", "stage.shear.normal_stress=40kPa", "--dry-run"]) == 1
    assert "give --set normal_stress=40kPa" in capsys.readouterr().err


def test_beds_of_another_study():
    study = Study(preset="paper", seeds=[1], settled="fast")
    (directory, text), = study.case_files()
    assert str(directory) == "runs/paper/seed-1/shear" and 'start = "../../../fast/seed-1/settle"' in text
    assert study.start("shear", 1) == []  # nothing is to be settled first


@pytest.fixture
def home(tmp_path):
    """A study of three cases, two of which start from the first."""
    for name, text in {"bed": '[[stage]]\nname = "fall"\n[[stage]]\nname = "press"\n', "dry": 'extends = "../bed"\nstages = ["shear"]\n[[stage]]\nname = "shear"\n',
                       "wet": 'extends = "../dry"\n'}.items():
        (tmp_path / name).mkdir()
        (tmp_path / name / "case.toml").write_text(text)
    (tmp_path / "study.toml").write_text("""
title = "three"
seeds = 2
[[case]]
name = "bed"
[[case]]
name = "dry"
start = "bed"
[[case]]
name = "wet"
start = "bed"
lists = { "fluid.permeability_factor" = "1e-13,1e-15 m2", "fluid.closure" = "full,pressure_gradient" }
[quick]
seeds = 1
set = { "grains.count" = "1000", "stage.press.duration" = "0.1 s", "stage.shear.strain" = "0.1" }
lists = { "fluid.closure" = "full," }
""")
    return tmp_path


def test_runs_of_a_study_with_lists(home):
    study = Study(home)
    assert study.seeds == [1, 2] and study.beds == {"bed"}
    assert study.parts["wet"].stages == ("shear",) and study.parts["bed"].stages == ("fall", "press")
    assert study.command("wet", 2, 4) == [
        "../../moraine", "sweep", "runs/fast/seed-2/wet", "--set", "fluid.permeability_factor=1e-13,1e-15 m2", "--set",
        "fluid.closure=full,pressure_gradient", "--resume", "--threads", "4", "--backend", "cpu"]
    assert study.command("dry", 1, 1)[1] == "run" and study.threads("wet") == 4 and study.threads("dry") == 1
    assert study.start("wet", 1) == ["runs/fast/seed-1/bed.done"] and study.start("bed", 1) == []
    assert study.done("wet", 1) == "runs/fast/seed-1/wet+permeability_factor-1e-13_1e-15_m2+closure-full_pressure_gradient.done"
    other = Study(home, lists={"fluid.closure": "full,"})  # other values: other runs of the same study
    assert other.name == study.name and other.done("wet", 1) != study.done("wet", 1) and other.threads("wet") == 2


def test_a_quick_study_sets_what_concerns_each_case(home):
    study = Study(home, quick=True)
    cases = cases_of(study)
    assert set(cases) == {f"runs/quick/seed-1/{name}" for name in ("bed", "dry", "wet")}
    assert cases["runs/quick/seed-1/bed"]["stage"] == [{"name": "press", "duration": "0.1 s"}]
    assert cases["runs/quick/seed-1/wet"]["stage"] == [{"name": "shear", "strain": 0.1}]
    assert study.parts["wet"].lists["fluid.closure"] == "full,"


def test_a_case_says_what_a_quick_study_makes_of_it(home):
    file = home / "study.toml"
    text = file.read_text().replace('name = "dry"\n', 'name = "dry"\nquick = { "stage.shear.strain" = "0.2" }\n').replace(
        'name = "wet"\n', 'name = "wet"\nquick = false\n')
    file.write_text(text)
    cases = cases_of(Study(home, quick=True))
    assert set(cases) == {f"runs/quick/seed-1/{name}" for name in ("bed", "dry")}
    assert cases["runs/quick/seed-1/dry"]["stage"] == [{"name": "shear", "strain": 0.2}]  # before what [quick] says for all
    assert "wet" in Study(home).parts and "stage" not in cases_of(Study(home))["runs/fast/seed-1/dry"]
    file.write_text(text.replace('name = "bed"\n', 'name = "bed"\nquick = false\n'))
    with pytest.raises(MissingData, match="case.quick = false: bed: expected false in dry, which starts from it, too"):
        Study(home, quick=True)


def test_a_setting_of_a_bed_s_stage_makes_a_bed(home):
    assert Study(home, settings={"stage.press.duration": "1 s"}).bed == "fast+press.duration-1_s"
    assert Study(home, settings={"stage.shear.strain": "1", "fluid.compressibility": "1e-9 1/Pa"}).bed == "fast"


@pytest.mark.parametrize("before, after, said", [
    ('name = "dry"\nstart = "bed"', 'name = "dry"\nstart = "wet"', "case.start = wet: expected a case above it"),
    ('name = "dry"', 'name = "moist"', "case.name = moist: expected a directory beside it, with a case.toml"),
    ('name = "dry"', 'name = "bed"', "case.name = bed: expected each case once"),
    ("seeds = 2", "seed = 2", "seed: expected one of title, report, seeds, case, quick"),
    ("seeds = 2", 'seeds = "2"', "seeds: expected a number"),
    ('"full,pressure_gradient"', "2", "fluid.closure: expected a text, as --set takes it"),
    ("[quick]", "[quick", "study.toml"),
])
def test_what_is_wrong_with_a_study_is_said(home, before, after, said):
    file = home / "study.toml"
    file.write_text(file.read_text().replace(before, after, 1))
    with pytest.raises(MissingData) as why:
        Study(home)
    assert said in str(why.value) and "study.toml" in str(why.value)


def test_only_lists_of_a_study_have_other_values(home):
    with pytest.raises(MissingData, match="wall.mass is not a list of"):
        Study(home, lists={"wall.mass": "1,2"})


def test_a_case_of_another_study_is_not_overwritten(home):
    study = Study(home, seeds=[1])
    study.write_cases()
    study.write_cases()
    file = home / "runs/fast/seed-1/bed/case.toml"
    file.write_text("title = 'mine'\n")
    with pytest.raises(SystemExit, match="is not that of this study"):
        study.write_cases()
    assert file.read_text() == "title = 'mine'\n"


def test_the_configuration_survives_being_written(home, monkeypatch):
    import json
    study = Study(home, seeds=[1, 2], quick=True, settings={"wall.mass": "64 kg"}, lists={"fluid.closure": "full,"})
    file = study.write_config()
    monkeypatch.chdir(home)  # where Snakemake runs
    again = AnyStudy.from_config(json.loads(file.read_text()))
    assert again.name == study.name == "quick+mass-64_kg" and again.all_done() == study.all_done()
    assert again.results == "runs/quick+mass-64_kg/results"


@pytest.mark.skipif(not shutil.which("snakemake"), reason="snakemake is not installed")
def test_what_the_workflow_runs(tmp_path, monkeypatch):
    """With a launcher that only notes its arguments, in a directory whose name has a space."""
    here = tmp_path / "a copy"
    shutil.copytree(root / "cases/paper-2013", here / "cases/paper-2013", ignore=shutil.ignore_patterns("runs", ".snakemake", "results"))
    shutil.copy(root / "cases/Snakefile", here / "cases")
    launcher, calls = here / "moraine", here / "calls"
    launcher.write_text(f"""#!/bin/sh\nprintf '%s|' "$@" >>'{calls}'\necho >>'{calls}'\n""")
    launcher.chmod(0o755)
    (here / "python").symlink_to(root / "python")
    monkeypatch.setattr(reproduce, "root", here)
    monkeypatch.delenv("MORAINE_LAUNCHER", raising=False)
    assert main(["reproduce", "paper-2013", "--seeds", "1", "--cores", "1"]) != 0  # the report finds no run
    assert calls.read_text().splitlines() == [
        'check|runs/fast/seed-1/settle|--set|start=""|',
        'check|runs/fast/seed-1/shear|--set|start=""|--set|normal_stress=120 kPa|',
        "run|runs/fast/seed-1/settle|--resume|--threads|1|--backend|cpu|",
        "sweep|runs/fast/seed-1/shear|--set|normal_stress=10,20,40,60,80,120 kPa|--resume|--threads|1|--backend|cpu|"]
    calls.unlink()
    written = here / "cases/paper-2013/runs/fast/results/report.html"  # of before: no reason to leave out what is wanted besides
    written.parent.mkdir(exist_ok=True)
    written.touch()
    main(["reproduce", "paper-2013", "--seeds", "1", "--cores", "1", "--set", "normal_stress=30kPa"])
    assert calls.read_text().splitlines()[2:] == ["sweep|runs/fast/seed-1/shear|--set|normal_stress=30kPa,|--resume|--threads|1|--backend|cpu|"]


def test_two_at_once_do_not_share_a_bed(home):
    with contextlib.ExitStack() as stack:
        for file in reproduce.hold(Study(home)):
            stack.enter_context(file)
        with pytest.raises(MissingData, match="runs/fast is in use by another reproduce"):
            reproduce.hold(Study(home, settings={"wall.mass": "64 kg"}))
        reproduce.hold(Study(home, preset="paper"))
    reproduce.hold(Study(home, settings={"wall.mass": "64 kg"}))


def test_variants_share_a_bed_that_has_settled(home):
    heavy, slow = (Study(home, seeds=[1], settings={key: value}) for key, value in (("wall.mass", "64 kg"), ("model.f", "0.1")))
    (home / "runs/fast/seed-1").mkdir(parents=True)
    with contextlib.ExitStack() as stack:
        for file in reproduce.hold(heavy):  # it will settle the bed
            stack.enter_context(file)
        with pytest.raises(MissingData, match="runs/fast is in use"):
            reproduce.hold(slow)
    (home / "runs/fast/seed-1/bed.done").touch()
    with contextlib.ExitStack() as stack:
        for study in heavy, slow:
            for file in reproduce.hold(study):
                stack.enter_context(file)
        for study in heavy, Study(home, seeds=[1]):
            with pytest.raises(MissingData, match="is in use by another reproduce"):
                reproduce.hold(study)


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
    measure.require_end(Results(case.directory))
    case.write(history[:-30])
    with pytest.raises(MissingData, match="the shear has come to 8. % of its time"):
        measure.require_end(Results(case.directory))


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
