"""moraine.Run: a run in this process. Needs the compiled part of the package."""
import os
import signal
import shutil
import threading
import time
from pathlib import Path

import numpy as np
import pytest

import moraine

pytest.importorskip("moraine._core", reason="moraine._core is not built here: pip install . in a virtual environment")

small = (Path(__file__).parents[1] / "run/small-bed/case.toml").read_text().replace("strain = 0.2", "duration = 0.8").replace("0.02 s", "1000 s")


@pytest.fixture
def bed(tmp_path):
    def make(name, text=small):
        (tmp_path / name).mkdir()
        (tmp_path / name / "case.toml").write_text(text)
        return tmp_path / name
    return make


def to_shear(run):
    while run.stage != "shear":
        run.step(10000)


def checkpoint(directory):
    return (directory / "output/checkpoint.h5").read_bytes()


def test_bits_with_a_callback_are_those_without(bed):
    plain, watched = bed("plain"), bed("watched")
    with moraine.Run(plain) as run:
        run.finish(progress=False)
    seen = []

    def look(run):
        seen.append((run.stage, run.step_number, float(np.abs(run.velocities).max()), len(run.bed.contact_i), float(run.pressures.sum())))

    with moraine.Run(watched) as run:
        run.every(500, look)
        run.finish(progress=False)
        assert run.finished and run.step(5) == 0
    assert checkpoint(plain) == checkpoint(watched)
    assert [step for stage, step, *_ in seen if stage == "shear"][:3] == [500, 1000, 1500]
    assert all(np.isfinite(speed) and speed > 0 for _, _, speed, *_ in seen)


def test_arrays_are_views_that_stay(bed):
    with moraine.Run(bed("bed")) as run:
        to_shear(run)
        before = run.bed
        x = before.positions
        kept = x.copy()
        assert x.shape == (300, 3) and x.dtype == float and not x.flags.owndata and not x.flags.writeable
        assert np.shares_memory(x, before.positions)
        step = run.step_number
        run.step(200)
        assert run.step_number == step + 200
        after = run.positions
        assert np.array_equal(x, kept) and not np.array_equal(after, kept)
    del run, before
    assert np.array_equal(x, kept)


def test_numbers_are_those_of_the_snapshot(bed):
    directory = bed("bed")
    with moraine.Run(directory) as run:
        run.finish(progress=False)
        b = run.bed
        snapshot = moraine.open(directory).stage("shear").snapshots[-1]
        grains, order = snapshot.grains, np.argsort(b.ids)
        assert np.array_equal(grains["radius"], b.radii[order])
        assert np.array_equal(grains["pressure"], b.pressures[order])
        assert np.array_equal(grains["spin"], b.spins[order])
        assert np.array_equal(grains["role"], b.roles[order])
        wrapped = b.positions[order].copy()
        wrapped[:, :2] -= b.box[:2] * np.floor(wrapped[:, :2] / b.box[:2])
        assert np.allclose(grains["position"], wrapped, rtol=0, atol=1e-15)
        pairs = {tuple(sorted((b.ids[i], b.ids[j]))): f for i, j, f in zip(b.contact_i, b.contact_j, b.contact_overlaps)}
        assert pairs == {(i, j): f for i, j, f in zip(snapshot.contacts["i"], snapshot.contacts["j"], snapshot.contacts["overlap"])}
        force = np.linalg.norm(b.contact_normal_forces, axis=1).sum()
        assert force == pytest.approx(snapshot.normal_forces().sum(), rel=1e-12)
        assert run.latest["shear_strain"] == moraine.open(directory).series["shear_strain"][-1]
        assert b.water_pressures is None


def test_a_stress_that_a_callback_changes_is_kept_resumed_and_replayed(bed):
    def soften(run):
        if run.stage == "shear":
            run.set("normal_stress", 2000 + run.step_number)

    whole, cut = bed("whole"), bed("cut")
    with moraine.Run(whole) as run:
        run.every(1000, soften)
        run.finish(progress=False)
        assert run.events[0] == ("shear", 1000, "normal_stress", 3000.0) and len(run.events) == run.steps // 1000
    run = moraine.Run(cut)
    run.every(1000, soften)
    to_shear(run)
    run.checkpoint()
    run.step(2500)
    run.close()  # all since the checkpoint is lost, but for the events
    with moraine.Run(cut, resume=True) as run:
        run.step(2500)
        assert len(run.events) == 2, "made again from events.csv, without the callback"
        run.every(1000, soften)
        run.finish(progress=False)
    assert checkpoint(whole) == checkpoint(cut)


def test_control_c_leaves_a_checkpoint_and_the_run_goes_on(bed):
    whole, cut = bed("whole"), bed("cut")
    with moraine.Run(whole) as run:
        run.finish(progress=False)
    run = moraine.Run(cut)
    signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's job in the background ignores it
    timer = threading.Timer(0.05, lambda: os.kill(os.getpid(), signal.SIGINT))
    timer.start()
    with pytest.raises(KeyboardInterrupt):
        while not run.finished:
            run.step(100000)
        time.sleep(10)
    where = (run.stage, run.step_number)
    run.close()
    with moraine.Run(cut, resume=True) as run:
        if where[1] > 0:
            assert (run.stage, run.step_number) == where
        run.finish(progress=False)
    assert checkpoint(whole) == checkpoint(cut)


def test_what_a_callback_raises_comes_through(bed):
    with moraine.Run(bed("bed")) as run:
        run.every(100, lambda run: 1 / 0)
        with pytest.raises(ZeroDivisionError):
            run.step(1000)
        assert run.step_number == 100
        assert (run.directory / "output/series.h5").exists()


def test_a_run_that_is_resumed_where_a_stage_ended_begins_the_next(bed):
    directory, seen = bed("bed"), []
    with moraine.Run(directory) as run:
        while run.stage == "settle":
            run.step(10000)
    with moraine.Run(directory, resume=True) as run:  # there is no checkpoint but that of the stage's end
        assert (run.stage, run.step_number) == ("consolidate", 0)
        run.set("normal_stress", "3 kPa")
        run.every(100, lambda run: seen.append(run.step_number))
        assert run.step(250) == 250
    assert seen == [100, 200]


def test_a_finished_case_can_be_read(bed):
    directory = bed("bed")
    with moraine.Run(directory) as run:
        run.finish(progress=False)
        known = run.stage, run.kind, run.steps, run.step_number, run.time, run.latest, run.pressures.sum(), repr(run)
    with moraine.Run(directory, resume=True) as run:
        assert run.finished and run.step(5) == 0
        run.finish()
        assert known == (run.stage, run.kind, run.steps, run.step_number, run.time, run.latest, run.pressures.sum(), repr(run))


def test_one_call_at_a_time(bed):
    run, failures = moraine.Run(bed("bed"), threads=1), []
    thread = threading.Thread(target=run.finish, kwargs={"progress": False})
    thread.start()
    calls = [run.close, run.checkpoint, lambda: run.latest, lambda: run.positions, lambda: run._run.step(1)]
    while thread.is_alive() and len(failures) < len(calls):
        try:
            calls[len(failures)]()
        except moraine.Error as error:
            failures.append(str(error))
    thread.join()
    assert len(failures) == len(calls) and all("one call at a time" in words for words in failures)
    assert run.finished
    run.close()


def test_a_run_stays_where_it_is_when_the_directory_changes(bed, tmp_path, monkeypatch):
    bed("bed")
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path)
    with moraine.Run("bed") as run:
        monkeypatch.chdir(tmp_path / "elsewhere")
        run.step(100)
        run.checkpoint()
    monkeypatch.chdir(tmp_path)
    with moraine.Run("bed", resume=True) as run:
        assert run.step_number == 100


def test_control_c_in_a_callback_leaves_a_checkpoint(bed):
    directory = bed("bed")

    def interrupt(run):
        raise KeyboardInterrupt

    with moraine.Run(directory) as run:
        run.every(100, interrupt)
        with pytest.raises(KeyboardInterrupt):
            run.step(1000)
    with moraine.Run(directory, resume=True) as run:
        assert run.step_number == 100


def test_numbers_of_numpy(bed):
    with moraine.Run(bed("bed")) as run:
        seen = []
        run.every(np.int64(50), lambda run: seen.append(run.step_number))
        assert run.step(np.int32(100)) == 100 and seen == [50, 100]
        to_shear(run)
        run.set("normal_stress", np.array(2500.5))
        run.set("velocity", np.float32(0.25))
        assert [value for *_, value in run.events] == [2500.5, 0.25]


def test_results_that_are_there_are_not_replaced_unasked(bed):
    directory = bed("bed")
    moraine.Run(directory).close()
    with pytest.raises(moraine.Error, match="holds the results.*resume=True.*force=True"):
        moraine.Run(directory)
    with moraine.Run(directory, force=True) as run:
        assert run.step_number == 0


@pytest.mark.parametrize("what, words", [
    (lambda run: run.set("velocity", "1 cm/s"), ["velocity", "stage settle", 'kind = "shear"']),
    (lambda run: run.set("normal_stres", 1), ["did you mean normal_stress?"]),
    (lambda run: run.set("normal_stress", "1 m"), ["normal_stress = 1 m", "Pa"]),
    (lambda run: run.set("gamma_n", 1), ["stays as it is", "normal_stress, velocity"]),
    (lambda run: run.step(-1), ["0 steps or more"]),
    (lambda run: run.every(0, print), ["1 step or more"]),
    (lambda run: run.every(1.5, print), ["every(1.5)", "a whole number"]),
    (lambda run: run.every(10, None), ["every(10, None)", "a function"]),
    (lambda run: run.step(1e3), ["step(1000.0)", "a whole number"]),
    (lambda run: run.step("many"), ["step('many')", "a whole number"]),
    (lambda run: (run.every(10, lambda run: run.step(1)), run.step(20)), ["called from a callback"]),
    (lambda run: moraine.Run(run.directory), ["another run is writing here"]),
    (lambda run: moraine.Run(run.directory, resume=True), ["another run is writing here"]),
    (lambda run: moraine.Run(run.directory / "nothing"), ["nothing", "case.toml"]),
    (lambda run: moraine.Run(run.directory, set={"contact.mu": 1}), ["set contact.mu=1", "known here: law, k_n"]),
    (lambda run: moraine.Run(run.directory, backend="gpu"), ["auto, cpu or cuda"]),
    (lambda run: (run.close(), run.step(1)), ["closed", "resume"]),
])
def test_errors(bed, what, words):
    run = moraine.Run(bed("bed"))
    with pytest.raises(moraine.Error) as error:
        what(run)
    for word in words:
        assert word in str(error.value)
    assert "--" not in str(error.value)


def test_a_full_bar(bed, capsys):
    with moraine.Run(bed("bed")) as run:
        run.finish()
    shown = capsys.readouterr().err
    for stage in ("settle", "consolidate", "shear"):
        assert stage in shown
    assert "100%" in shown
    shutil.rmtree(run.directory)
