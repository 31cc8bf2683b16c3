import os
from pathlib import Path
import pty
import select
import signal
import subprocess
import sys
import time
from types import SimpleNamespace

import numpy as np
import pytest

import fake_case
from fake_case import FakeCase, stage
from moraine import MissingData, progress, textplot
from moraine.__main__ import main
from moraine.progress import Progress

here = Path(__file__).resolve().parent
environment = os.environ | {"PYTHONPATH": str(here.parents[1] / "python"), "COLUMNS": "80", "LINES": "24", "LC_ALL": "C.UTF-8"}
command = [sys.executable, "-m", "moraine", "watch"]


def lived(case, seconds_ago):
    """Makes the results look as old as that."""
    then = time.time() - seconds_ago
    for file in case.output.rglob("*.h5"):
        os.utime(file, (then, then))


def watch(capsys, *words):
    """(exit status, standard output, standard error)"""
    return main(["watch", *map(str, words)]), *capsys.readouterr()


@pytest.fixture
def case(tmp_path):
    return FakeCase(tmp_path / "case")


def test_a_finished_case_is_drawn_once(case, capsys):
    case.write(case.history())
    status, out, _ = watch(capsys, case.directory)
    assert status == 0
    assert out.count("A case that was made up") == 1
    assert "stage shear (3 of 3)   100.0 %   strain 0.3 of 0.3" in out and "finished" in out
    assert (case.output / "watch.png").read_bytes().startswith(b"\x89PNG")
    assert sorted(p.name for p in case.output.iterdir()) == ["case.toml", "series.h5", "watch.png"]


def test_a_checkpoint_that_says_finished_is_believed(case):
    case.write(case.history()[:-1])
    case.finish()
    p = Progress(case.directory)
    p.look()
    assert p.state == "finished"


@pytest.mark.parametrize("last, expected", [
    (stage("s", "shear", strain=0.1, velocity=0.04), 2.5 * 0.32),
    (stage("s", "shear", strain=0.1, strain_rate=-0.2), 0.5),
    (stage("s", "shear", duration=0.7, strain_rate=0.2), 0.7),
    (stage("s", "uniaxial", strain=0.1, strain_rate=0.5), 0.2),
])
def test_ends_where_the_stage_ends(tmp_path, last, expected):
    case = FakeCase(tmp_path / "case", [last])
    history = case.history()
    case.write(history[:-1])
    p = Progress(case.directory)
    p.look()
    assert p.duration == pytest.approx(expected) and p.state == "running" and p.fraction < 1
    case.write(history)
    p.look()
    assert p.state == "finished" and p.fraction == pytest.approx(1)
    assert p.strain == pytest.approx(last["strain"] or 0.14)


@pytest.fixture
def still(monkeypatch):
    """Time stands still, however busy the machine is."""
    now = time.time()
    monkeypatch.setattr(time, "time", lambda: now)


def test_estimates_the_time_left_from_rows_that_come(case, still):
    history, p = case.history(), Progress(case.directory)
    for seconds_ago, rows in ((20, 60), (10, 70)):  # 0.01 s of model time each second
        case.write(history[:rows])
        lived(case, seconds_ago)
        assert p.look() and not p.look()
    left = (0.3 / 0.13 - history["stage_time"][69]) / 0.01 - 10
    assert p.left() == (pytest.approx(left, rel=0.02), pytest.approx(left, rel=0.02))


def test_later_stages_count_with_their_time_step(tmp_path, still):
    case = FakeCase(tmp_path / "case", [stage("a", "settle", duration=1.0, f=0.01), stage("b", "settle", duration=3.0, f=0.03)])
    history, p = case.history(), Progress(case.directory)
    for seconds_ago, rows in ((10, 1), (0, 51)):
        case.write(history[:rows])
        lived(case, seconds_ago)
        p.look()
    assert p.left() == (pytest.approx(10, rel=0.1), pytest.approx(30, rel=0.1))


def test_a_resumed_run_replaces_the_file_and_takes_rows_back(case):
    history, p = case.history(), Progress(case.directory)
    with case.open_series(history[:100]):
        p.look()
        assert len(p.series) == 100
    with case.open_series(history[:80]) as series:
        assert p.look() and len(p.series) == 80 and p.left() is None
        series.append(history[80])
        assert p.look() and len(p.series) == 81
        assert p.series["time"][-1] == history["time"][80]


def test_results_that_are_deleted_are_waited_for_again(case):
    case.write(case.history()[:100])
    p = Progress(case.directory)
    assert p.look() and p.state == "running"
    case.file.unlink()
    assert p.look() and p.state == "waiting"


def test_a_run_that_is_silent_for_long_is_noticed(case, capsys):
    case.write(case.history()[:100])
    lived(case, 301)
    status, out, _ = watch(capsys, case.directory, "--once", "--no-png")
    assert status == 0
    assert "no new row for 5 min 1 s: has the run been stopped?" in out
    assert f"./moraine run {case.directory} --resume".replace(" ", "") in "".join(out.split())


def test_rows_that_come_slowly_are_no_silence(tmp_path, still, monkeypatch):
    case = FakeCase(tmp_path / "case", output={"series_interval": 0.01, "checkpoint_interval": 1e9})
    history, p = case.history(), Progress(case.directory)
    for seconds_ago, rows in ((160, 59), (130, 60), (100, 61)):  # a row each 30 s
        case.write(history[:rows])
        lived(case, seconds_ago)
        p.look()
    assert p.state == "running"
    later = time.time() + 201
    monkeypatch.setattr(progress.time, "time", lambda: later)
    assert not p.look() and p.state == "silent"


def test_why_a_run_stopped_is_told(case, capsys):
    case.write(case.history()[:100])
    (case.output / "log.txt").write_text("A case\nstopped: interrupted at step 3 of stage shear; --resume goes on from here\n")
    _, out, _ = watch(capsys, case.directory, "--once", "--no-png")
    assert "stopped: interrupted at step 3 of stage shear" in out and "To go on: ./moraine run" in out


def test_follows_a_run_from_before_its_start_to_its_end(tmp_path):
    directory = tmp_path / "case"
    directory.mkdir()
    (directory / "case.toml").touch()
    watching = subprocess.Popen([*command, directory, "--interval", "0.05"], env=environment, stdout=subprocess.PIPE,
                                stderr=subprocess.PIPE, text=True)
    assert "waiting for" in watching.stdout.readline()
    (directory / "case.toml").unlink()
    subprocess.run([sys.executable, fake_case.__file__, directory, "0.02"], check=True, env=environment)
    out, err = watching.communicate(timeout=60)
    assert (watching.returncode, err) == (0, "")
    assert "stage settle (1 of 3)" in out and "ETA" in out
    blocks = out.split("A case that was made up")
    assert len(blocks) > 4 and "finished" in blocks[-1] and "289 rows" in blocks[-1]
    assert (directory / "output/watch.png").exists()


def test_ctrl_c_gives_the_terminal_back(case):
    case.write(case.history()[:100])
    child, terminal = pty.fork()
    if child == 0:
        os.execve(sys.executable, [*command, case.directory, "--interval", "0.1", "--no-png"], environment)
    out, sent, until = b"", False, time.time() + 30
    while time.time() < until and select.select([terminal], [], [], 30)[0]:
        try:
            out += os.read(terminal, 65536)
        except OSError:  # the other side has closed
            break
        if not sent and out.count(b"\033[H") >= 3:
            os.kill(child, signal.SIGINT)
            sent = True
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 130
    assert out.startswith(b"\033[?25l") and out.rstrip().endswith(b"\033[?25h")
    assert b"Traceback" not in out


def test_a_pipe_that_closes_ends_it(case):
    case.write(case.history())
    done = subprocess.run(f"{' '.join(command)} {case.directory} --no-png | head -n 1", shell=True, env=environment, text=True,
                          capture_output=True, timeout=60)
    assert done.stdout == "A case that was made up\n" and done.stderr == ""


def test_bad_input_is_one_line_and_status_1(case, tmp_path, capsys):
    def fails(directory, *expected):
        status, out, err = watch(capsys, directory, "--once", "--no-png")
        assert (status, out, err.count("\n")) == (1, "", 1), err
        for text in expected:
            assert text in err

    fails(tmp_path / "nowhere", "nowhere is no case directory: there is no", "nowhere/case.toml")
    fails(case.directory / "case.toml", "is no case directory")
    fails(case.directory, "there are no rows in", "series.h5 yet; run the case first: ./moraine run")
    case.file.write_bytes(b"no HDF5")
    fails(case.directory, "series.h5: cannot be read as HDF5")
    case.write(case.history())
    case.file.write_bytes(case.file.read_bytes()[:20000])
    fails(case.directory, "series.h5: cannot be read as HDF5")
    case.write(case.history())
    (case.output / "case.toml").write_text("stage = 3 4")
    fails(case.directory, "case.toml: not what a run of Moraine writes")


def test_rows_of_a_stage_that_the_case_lacks(case):
    rows = case.history()
    rows["stage"] = 7
    case.write(rows)
    with pytest.raises(MissingData, match="has rows of stage 7, but .* has 3 stages"):
        Progress(case.directory).look()


def test_without_a_ledger(tmp_path, capsys):
    case = FakeCase(tmp_path / "case", model={"dt": 0.0, "ledger": False})
    case.write(case.history())
    status, out, _ = watch(capsys, case.directory)
    assert status == 0 and "no energy ledger" in out and "nan" not in out


def test_goes_on_without_a_picture_where_none_can_be_written(case, capsys):
    case.write(case.history())
    status, out, err = watch(capsys, case.directory, "--png", case.directory / "nowhere/a.png")
    assert status == 0 and "nowhere/a.png: cannot be written: No such file or directory; going on without a picture" in \
        " ".join(out.split())


@pytest.mark.parametrize("kind", ["settle", "consolidate", "shear_stress", "uniaxial"])
@pytest.mark.parametrize("words", [["--no-png"], ["--time"]])
def test_draws_every_kind_of_stage_from_its_first_row_on(tmp_path, capsys, kind, words):
    case = FakeCase(tmp_path / "case", [stage("one", kind, duration=0.2, strain_rate=0.1)])
    for rows in (1, 2, None):
        case.write(case.history()[:rows])
        status, out, err = watch(capsys, case.directory, "--once", *words)
        assert (status, err) == (0, "") and "kinetic energy, J" in out


@pytest.mark.parametrize("width, height", [(20, 10), (40, 24), (60, 24), (80, 24), (160, 50), (300, 12)])
@pytest.mark.parametrize("braille", [True, False])
def test_fits_into_the_terminal(case, capsys, monkeypatch, width, height, braille):
    monkeypatch.setenv("COLUMNS", str(width))
    monkeypatch.setenv("LINES", str(height))
    monkeypatch.setenv("LC_ALL", "C.UTF-8" if braille else "C")
    case.write(case.history()[:100])
    _, out, _ = watch(capsys, case.directory, "--once", "--no-png")
    lines = out.removesuffix("\n\n").split("\n")
    assert len(lines) < height and max(map(len, lines)) <= width
    assert braille or out.isascii()


def test_a_plot_shows_what_it_is_given():
    x = np.linspace(0, 1, 50)
    lines = textplot.plot("line", x, x, 30, 7, x_label="x", braille=False)
    assert lines[0].startswith("line  1") and all(len(line) == 30 for line in lines)
    assert [lines[1].split("|")[0].strip(), lines[5].split("|")[0].strip()] == ["1", "0"]
    first = [line.split("|")[1].rstrip() for line in lines[1:6]]
    assert [len(f) for f in first] == sorted((len(f) for f in first), reverse=True)  # it rises from left to right
    assert textplot.plot("log", x, np.full(50, -1.0), 30, 7, log=True)[1:] == [" " * 30] * 6  # nothing to show
    assert "-" in textplot.plot("gap", x, np.full(50, np.nan), 30, 7)[0]
    flat = textplot.plot("flat", x, np.ones(50), 30, 7)
    assert sum(any(c > "\u2800" for c in line) for line in flat) == 1


def test_times_are_told_as_people_do():
    told = {3: "3 s", 61: "1 min 1 s", 7260: "2 h 1 min", 90000: "1 d 1 h"}
    assert {s: progress.readable(s) for s in told} == told


def test_misspelt_options_name_the_nearest(capsys):
    for words, said in [(["watch", "CASE", "--onec"], "--onec: unknown option of watch; did you mean --once?"),
                        (["figures", "CASE", "--formt", "pdf"], "--formt: unknown option of figures; did you mean --format?"),
                        (["watch", "CASE", "--qqq"], "--qqq: unknown option of watch; see moraine watch --help"),
                        (["watch", "CASE", "more"], "more: one word too many for watch; see moraine watch --help")]:
        assert main(words) == 1
        assert capsys.readouterr().err == f"moraine: {said}\n"


@pytest.mark.parametrize("kind, expected", [("press", np.log(0.6 / 0.25) / 3 / 0.5), ("uniaxial", (1 - 0.25 / 0.6) / 0.5)])
def test_porosity_ends_a_stage(kind, expected):
    pressed = SimpleNamespace(kind=kind, settings=stage("s", kind, porosity=0.4, strain_rate=0.5))
    assert progress.duration(pressed, 0.3, 0.75) == pytest.approx(expected)
