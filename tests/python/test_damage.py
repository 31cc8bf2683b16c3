"""Results that are damaged or incomplete: each is named in a MissingData, no other exception gets through."""
import h5py
import numpy as np
import pytest

from fake_case import FakeCase
from fake_snapshot import write
from moraine import Results, MissingData
from moraine.__main__ import main


def replace(file, **datasets):
    with h5py.File(file, "a") as h5:
        for name, value in datasets.items():
            name = name.replace("__", "/")
            del h5[name]
            if value is not None:
                h5[name] = value


def two_grains(directory):
    return write(directory, [[5, 5, 2], [5, 5, 3]], 0.5, [(0, 1)])


@pytest.mark.parametrize("change, message", [
    ({"contacts": None}, "there is no group contacts"),
    ({"contacts": np.zeros(3)}, "there is no group contacts"),
    ({"contacts__i": [7]}, "contacts: has contacts of grains that are not in the snapshot"),
    ({"contacts__overlap": np.zeros(3)}, "contacts: the datasets differ in length"),
    ({"grains__pressure": np.zeros(1)}, "grains: the datasets differ in length"),
])
def test_a_damaged_snapshot_is_named(tmp_path, change, message):
    s = two_grains(tmp_path)
    replace(s.file, **change)
    with pytest.raises(MissingData, match=f"{s.file}.*{message}"):
        len(s.grains), len(s.contacts)


def test_a_snapshot_with_garbage_in_it_is_named(tmp_path):
    s = two_grains(tmp_path)
    data = s.file.read_bytes()
    s.file.write_bytes(data[:600] + b"\xff" * (len(data) - 600))
    with pytest.raises(MissingData, match=str(s.file)):
        len(s.grains), len(s.contacts)


@pytest.mark.parametrize("text", [b"\xff\xfe", b"a = [", b"stage = 3", b"[[stage]]\nname = 'a'\nkind = 'shear'\n", b"stage = []\ngrains = 1"])
def test_a_damaged_case_is_named(tmp_path, text):
    case = FakeCase(tmp_path / "case")
    (case.output / "case.toml").write_bytes(text)
    with pytest.raises(MissingData, match="case.toml: not what a run of Moraine writes"):
        Results(case.directory)


def test_where_nothing_can_be_written_is_told(tmp_path, capsys):
    case = FakeCase(tmp_path / "case")
    case.write(case.history())
    (tmp_path / "file").touch()
    assert main(["figures", str(case.directory), "--only", "fig04-friction-dilation", "--output", str(tmp_path / "file/figures")]) == 1
    assert "moraine: [Errno 20] Not a directory" in capsys.readouterr().err


def test_figures_leave_out_a_case_that_is_not_sheared_yet(tmp_path, capsys):
    for name, rows in (("a", None), ("b", 20)):
        case = FakeCase(tmp_path / name)
        case.write(case.history()[:rows])
    words = ["figures", str(tmp_path), "--only", "fig04-friction-dilation", "--format", "svg"]
    assert main(words) == 0
    out = capsys.readouterr().out
    assert "left out" in out and "b/output/series.h5: no rows of stage shear" in out
    assert (tmp_path / "figures/fig04-friction-dilation.svg").exists()
    assert main([*words[:1], str(tmp_path / "b"), *words[2:]]) == 1
    assert "fig04-friction-dilation: not drawn: " in capsys.readouterr().out
