"""moraine.Case that runs: alone, and as a sweep."""
import os
from pathlib import Path
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest

from conftest import root

pytest.importorskip("moraine._core", reason="moraine._core is not built here (pip install .)")
for module in ("tomlkit", "tqdm", "pandas"):
    pytest.importorskip(module)

import moraine
from moraine import strength


def small(directory, strain=0.05):
    """60 grains, sheared within seconds."""
    case = moraine.Case(directory, title="Small", new=True)
    case.box(x="22 cm", y="22 cm").grains(count=60, columns_x=5, columns_y=5, cell=1.06)
    case.model(preset="fast").wall(mass="2 kg").output(series_interval="10 ms", snapshot_interval="0.1 s")
    return case.settle("0.1 s").consolidate("20 kPa", duration="0.05 s").shear(rate="0.5 1/s", strain=strain)


def series(results):
    rows = results.read_series()
    return {name: rows[name] for name in rows}


def same_bits(a, b):
    return a.keys() == b.keys() and all(np.array_equal(a[name], b[name]) for name in a)


def test_a_case_runs_and_its_results_open(tmp_path):
    case = small(tmp_path / "c")
    results = case.run(threads=1, progress=False)
    assert [stage.name for stage in results.stages] == ["settle", "consolidate", "shear"]
    assert results.stage("shear").series["shear_strain"][-1] == pytest.approx(0.05, rel=1e-3)
    assert results.settings["title"] == "Small"
    with pytest.raises(moraine.Error, match="resume=True to go on.*force=True"):
        case.run(progress=False)
    before = series(results)
    assert same_bits(before, series(case.run(resume=True, progress=False)))  # has finished
    assert same_bits(before, series(case.run(force=True, threads=2, progress=False)))


def test_results_grow_while_it_runs(tmp_path):
    case = small(tmp_path / "c")
    with case.begin(threads=1) as run:
        while run.stage != "shear":
            run.step(1000)
        results = case.results()
        before = len(results.series)
        with pytest.raises(moraine.Error, match="another run|is running|under way|in use"):
            case.run(force=True, progress=False)
        run.finish(progress=False)
        assert len(results.series) == before  # as it was read
        assert len(results.refresh().series) > before
        assert len(results.stage("shear").series) > 3


def test_a_sweep_gives_one_table(tmp_path):
    case = small(tmp_path / "c")
    sweep = case.sweep({"grains.seed": [1, 2]}, normal_stress=["10 kPa", 20e3], progress=False)
    table = sweep.table
    assert list(table.index) == ["normal_stress-10kPa+seed-1", "normal_stress-20000.0Pa+seed-1", "normal_stress-10kPa+seed-2",
                                 "normal_stress-20000.0Pa+seed-2"]
    assert list(table["grains.seed"]) == [1, 1, 2, 2] and list(table["normal_stress"]) == [10e3, 20e3] * 2
    assert table.attrs["units"]["normal_stress"] == "Pa" and table.attrs["units"]["peak"] == "1"
    for results, (_, row) in zip(sweep.results, table.iterrows()):
        shear = results.stage("shear")
        assert shear.settings["normal_stress"] == results.stage("consolidate").settings["normal_stress"] == row["normal_stress"]
        assert results.seed == row["grains.seed"]
        s = strength.strength(shear)
        assert (row["peak"], row["ultimate"], row["porosity"]) == (s.peak, s.ultimate, shear.series["porosity"][-1])
    alone = small(tmp_path / "alone")
    alone.grains.seed = 2
    for stage in ("consolidate", "shear"):
        alone.stages[stage].normal_stress = "10 kPa"
    assert same_bits(series(alone.run(progress=False)), series(sweep.results[2]))


def test_a_sweep_without_shear_has_a_table_too(tmp_path):
    case = small(tmp_path / "c")
    del case.stages["shear"], case.stages["consolidate"]
    table = case.sweep(seed=[1, 2], progress=False).table
    assert table["peak"].isna().all() and table["porosity"].between(0.2, 0.9).all()


@pytest.mark.parametrize("values, right", [
    ({"normal_stres": ["1 kPa", "2 kPa"]}, "did you mean stage.normal_stress"),
    ({"normal_stress": ["1 kPa", "2 m"]}, "expected a unit convertible to Pa"),
    ({"normal_stress": ["1 kPa", -2]}, "expected >= 0 Pa"),
    ({"normal_stress": []}, "expected a value at least"),
    ({"normal_stress": "1 kPa"}, "nothing to sweep"),
    ({"seed": [1, 1]}, "expected every value once"),
    ({"stage.sheer.strain": [0.1, 0.2]}, "no stage \"sheer\""),
])
def test_a_wrong_sweep_leaves_nothing_behind(tmp_path, values, right):
    case = small(tmp_path / "c")
    with pytest.raises(moraine.Error, match=right) as caught:
        case.sweep(values, progress=False)
    assert "--" not in str(caught.value)
    assert not (case.directory / "sweep").exists()


def test_a_case_that_fails_is_named(tmp_path):
    case = small(tmp_path / "c")
    with pytest.raises(moraine.Error, match=r"1 of 2 cases did not finish \(resume=True goes on with them\):\n  max_overlap-1e-12: ") as caught:
        case.sweep(max_overlap=[0.2, 1e-12], progress=False)
    assert "max_overlap-0.2:" not in str(caught.value)


def interrupt_once(present):
    """Ctrl-C as soon as this file is there."""
    def wait():
        while not present.exists():
            time.sleep(0.02)
        os.kill(os.getpid(), signal.SIGINT)
    threading.Thread(target=wait, daemon=True).start()


def test_ctrl_c_leaves_checkpoints_and_resume_goes_on(tmp_path):
    whole = small(tmp_path / "whole", strain=1).sweep(seed=[1, 2, 3], at_once=2, progress=False)
    case = small(tmp_path / "cut", strain=1)
    interrupt_once(case.directory / "sweep/seed-1/output/snapshots/03-shear-000001.h5")
    with pytest.raises(KeyboardInterrupt):
        case.sweep(seed=[1, 2, 3], at_once=2, progress=False)
    assert (case.directory / "sweep/seed-1/output/checkpoint.h5").exists()
    assert not (case.directory / "sweep/seed-3/output/checkpoint.h5").exists()
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    with pytest.raises(moraine.Error, match="resume=True"):
        case.sweep(seed=[1, 2, 3], at_once=2, progress=False)
    sweep = case.sweep(seed=[1, 2, 3], at_once=2, resume=True, progress=False)
    assert all(same_bits(series(a), series(b)) for a, b in zip(sweep.results, whole.results))


def test_progress_is_a_bar(tmp_path, capfd):
    small(tmp_path / "c").sweep(seed=[1, 2], progress=True)
    out, err = capfd.readouterr()
    assert "100%" in err and "2 of 2 finished" in err and "finished: seed-1" in out + err


@pytest.mark.skipif(not (root / "build/moraine").exists(), reason="build/moraine is not built")
def test_folders_and_bits_are_those_of_the_command_line(tmp_path):
    from_python = small(tmp_path / "python").sweep(normal_stress=["10 kPa", "20 kPa"], progress=False)
    small(tmp_path / "shell").write()
    subprocess.run([root / "build/moraine", "sweep", tmp_path / "shell", "--set", "normal_stress=10,20kPa", "--quiet"], check=True)
    for directory, results in zip(from_python.directories, from_python.results):
        assert same_bits(series(results), series(moraine.open(tmp_path / "shell/sweep" / directory.name)))
    checked = subprocess.run([root / "build/moraine", "check", tmp_path / "shell", "--threads", "1"], check=True, capture_output=True, text=True)
    same = [line for line in checked.stdout.splitlines() if "time" not in line and "about" not in line]
    assert same == [line for line in moraine.Case(tmp_path / "shell").check(threads=1).splitlines() if "time" not in line and "about" not in line]


def test_the_example_draws_its_figure(tmp_path):
    """python/examples/three-stresses.py, shortened."""
    pytest.importorskip("matplotlib")
    text = (root / "python/examples/three-stresses.py").read_text()
    assert len(text.splitlines()) <= 25
    short = text.replace("strain=0.4", "strain=0.05")
    assert short != text
    (tmp_path / "script.py").write_text(short)
    environment = {**os.environ, "PYTHONPATH": str(Path(moraine.__file__).parents[1]), "MPLBACKEND": "agg"}
    for _ in range(2):  # again, it goes on from the end
        ran = subprocess.run([sys.executable, "script.py"], cwd=tmp_path, env=environment, capture_output=True, text=True)
        assert ran.returncode == 0, ran.stderr
    assert (tmp_path / "three-stresses.png").stat().st_size > 10000 and "normal_stress-80kPa" in ran.stdout
