"""Files that are damaged end with one error, and soon: HDF5 by itself would try for minutes, or die."""
import os
import random
import time

import h5py
import numpy as np
import pytest

from fake_case import FakeCase
from moraine import Results, MissingData, sealed
from moraine.__main__ import main
from moraine.results import Snapshot


def damages(data, count, seed=2013):
    """(what, bytes): changed, cut, zeroed, filled with garbage."""
    r = random.Random(seed)
    for k in range(count):
        at, length = r.randrange(len(data)), r.randrange(1, 4000)
        yield f"garbage from {at}", data[:at] + r.randbytes(len(data) - at)
        yield f"zeros at {at}", data[:at] + bytes(min(length, len(data) - at)) + data[at + length:]
        yield f"cut at {at}", data[:at]
        changed = bytearray(data)
        for _ in range(200):
            changed[r.randrange(len(data))] = r.randrange(256)
        yield f"bytes {k}", bytes(changed)


def snapshot(directory):
    """As the program writes one, seal included."""
    file = directory / "01-shear-000001.h5"
    with h5py.File(file, "w", userblock_size=sealed.size) as h5:
        h5.attrs.update({"time": 1.0, "stage_time": 0.5, "box": [1.0, 1.0, 1.0], "top_wall": 0.3})
        h5["grains/position"] = np.arange(300.0).reshape(100, 3)
        h5["contacts/i"] = np.zeros(0, np.int32)
    file.write_bytes(bytes(80) + b"snapshot 1\n" + file.read_bytes()[91:])
    sealed.seal(file)
    return file


def test_a_seal_is_that_of_sha256sum(tmp_path):
    file = snapshot(tmp_path)
    said = os.popen(f"tail -c +81 {file} | sha256sum").read().split()[0]
    assert file.read_bytes().startswith(f"moraine sha256 {said}\nsnapshot 1\nbytes {file.stat().st_size}\n".encode())
    s = Snapshot(file)
    assert (s.time, s.stage_time, s.top_wall, len(s.grains)) == (1.0, 0.5, 0.3, 100)


def test_every_damage_of_a_snapshot_is_found(tmp_path):
    file = snapshot(tmp_path)
    whole = file.read_bytes()
    for what, data in damages(whole, 50):
        if data == whole:
            continue
        file.write_bytes(data)
        for ask in (lambda s: s.time, lambda s: s.grains):
            with pytest.raises(MissingData, match=str(file)):
                pytest.fail(f"{what}: {ask(Snapshot(file))}")


def test_a_series_full_of_garbage_ends_in_seconds(tmp_path, monkeypatch):
    monkeypatch.setattr(sealed, "patience", (1, 20e6))
    case = FakeCase(tmp_path / "case")
    case.write(case.history())
    whole = case.file.read_bytes()
    for start in (20, 48, 100, 600, 5000):
        case.file.write_bytes(whole[:start] + random.Random(start).randbytes(len(whole) - start))
        began = time.monotonic()
        with pytest.raises(MissingData, match=str(case.file)):
            Results(case.directory).series
        assert time.monotonic() < began + 3


def test_watch_and_figures_say_so(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(sealed, "patience", (1, 20e6))
    case = FakeCase(tmp_path / "case")
    case.write(case.history())
    whole = case.file.read_bytes()
    case.file.write_bytes(whole[:100] + random.Random(1).randbytes(len(whole) - 100))
    for words in (["watch", str(case.directory), "--once", "--no-png"],
                  ["figures", str(case.directory), "--only", "fig04-friction-dilation"]):
        began = time.monotonic()
        assert main(words) == 1
        assert time.monotonic() < began + 8
        assert f"{case.file}: " in "".join(capsys.readouterr())


def test_a_reader_that_dies_is_told(tmp_path):
    file = tmp_path / "old.h5"
    h5py.File(file, "w").close()
    with pytest.raises(MissingData, match="old.h5: damaged: HDF5 dies of reading it"):
        sealed.read(file, lambda h5: os.kill(os.getpid(), 9))


@pytest.mark.parametrize("make", [os.mkdir, os.mkfifo, lambda f: os.symlink(f, f)])
def test_what_is_no_file_is_told(tmp_path, make):
    file = tmp_path / "a.h5"
    make(file)
    with pytest.raises(MissingData, match="a.h5: "):
        Snapshot(file).time


def test_a_damaged_checkpoint_does_not_say_that_a_case_has_finished(tmp_path, monkeypatch):
    from moraine.progress import Progress
    case = FakeCase(tmp_path / "case")
    case.write(case.history()[:-20])
    case.finish()
    progress = Progress(case.directory)
    progress.look()
    assert progress.state == "finished"
    checkpoint = case.output / "checkpoint.h5"
    checkpoint.write_bytes(bytes(100) + checkpoint.read_bytes()[100:])
    assert progress.state != "finished"
