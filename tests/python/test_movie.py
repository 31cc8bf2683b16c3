"""Movies of made-up cases, looked at with ffprobe and frame by frame."""
import json
import shutil
import subprocess

import numpy as np
import pytest

import fake_sheared_case as sheared
from fake_case import FakeCase
from moraine import MissingData, Snapshot, frames, movie, open as open_case, spheres
from moraine.__main__ import main

with_ffmpeg = pytest.mark.skipif(not shutil.which("ffmpeg"), reason="there is no ffmpeg here (apt-get install ffmpeg)")


@pytest.fixture(scope="module")
def case(tmp_path_factory):
    return sheared.write(tmp_path_factory.mktemp("movie") / "case", [sheared.shear(0.13)])


def probed(path):
    asked = ["ffprobe", "-v", "error", "-count_frames", "-show_streams", "-show_format", "-of", "json", str(path)]
    found = json.loads(subprocess.run(asked, capture_output=True, check=True).stdout)
    return found["streams"][0], found["format"]


def images(path, size):
    raw = subprocess.run(["ffmpeg", "-v", "error", "-i", str(path), "-f", "rawvideo", "-pix_fmt", "rgb24", "-"], capture_output=True, check=True).stdout
    return np.frombuffer(raw, np.uint8).reshape(-1, size[1], size[0], 3).astype(int)


@with_ffmpeg
def test_both_movies_have_a_frame_for_each_snapshot(case, tmp_path, capsys):
    assert main(["movie", str(case.directory), "--size", "480x360", "--fps", "4", "--output", str(tmp_path)]) == 0
    said = capsys.readouterr().out
    for kind in ("grains", "section"):
        stream, file = probed(tmp_path / f"{kind}.mp4")
        assert (stream["codec_name"], stream["pix_fmt"], stream["width"], stream["height"]) == ("h264", "yuv420p", 480, 360)
        assert int(stream["nb_read_frames"]) == 3 and stream["r_frame_rate"] == "4/1"
        assert file["tags"]["title"] == "A case that was made up"
        assert f"{kind}.mp4: 3 frames" in said
        seen = images(tmp_path / f"{kind}.mp4", (480, 360))
        assert all(np.abs(a - b).max() > 60 for a, b in zip(seen, seen[1:]))  # pressures and velocities grow, the caption changes
    assert sorted(p.name for p in tmp_path.iterdir()) == ["grains.mp4", "section.mp4"]  # nothing else is left


@with_ffmpeg
def test_one_movie_of_a_stage_by_name(case, tmp_path):
    assert main(["movie", str(case.directory), "--only", "grains", "--stage", "settle", "--size", "320x240", "--output", str(tmp_path)]) == 0
    assert [p.name for p in tmp_path.iterdir()] == ["grains.mp4"]


@with_ffmpeg
def test_colours_are_those_of_the_pressures(case):
    """The colour bar reaches as far as few grains of all snapshots go, and a grain of the upper end has its last colour."""
    _, files = frames.snapshots(open_case(case.directory), None, 2)
    last = Snapshot(files[-1]).grains
    upper = movie.pressure_scale([last["pressure"][last["role"] == 0]])
    assert np.mean(last["pressure"][last["role"] == 0] / 1e3 > upper) <= 0.03 and upper in (100, 150)
    for picture in movie.grains(files, (640, 480), "title", open_case(case.directory).stage("shear")):
        assert picture.bar.vmax == upper
        pixels = picture.pixels("t")
        assert pixels.shape == (480, 640, 4)


def test_a_failure_of_ffmpeg_leaves_the_movie_of_before(case, tmp_path, monkeypatch):
    (tmp_path / "bin").mkdir()
    fake = tmp_path / "bin/ffmpeg"
    fake.write_text("#!/bin/sh\nfor last; do :; done\necho half >\"$last\"\necho 'No space left on device' >&2\nexit 1\n")
    fake.chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path / 'bin'}:/usr/bin:/bin")
    (tmp_path / "grains.mp4").write_text("    ftyp of before")
    with pytest.raises(MissingData, match="grains.mp4: ffmpeg failed: No space left on device"):
        movie.make(open_case(case.directory), "grains", tmp_path / "grains.mp4", size=(320, 240))
    assert (tmp_path / "grains.mp4").read_text() == "    ftyp of before"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["bin", "grains.mp4"]


def test_other_files_are_not_overwritten(case, tmp_path):
    (tmp_path / "grains.mp4").write_text("notes")
    with pytest.raises(MissingData, match="grains.mp4: is there already, and is no MP4; move it, or give another --output"):
        movie.make(open_case(case.directory), "grains", tmp_path / "grains.mp4")
    assert (tmp_path / "grains.mp4").read_text() == "notes"


def test_what_is_missing_is_said(case, tmp_path, capsys, monkeypatch):
    def said(*words):
        assert main(["movie", *map(str, words)]) == 1
        return capsys.readouterr().err

    monkeypatch.setattr(shutil, "which", lambda name: "/usr/bin/ffmpeg")
    assert "is no case directory" in said(tmp_path)
    assert "there is no stage sheer; it has settle, consolidate, shear" in said(case.directory, "--stage", "sheer", "--output", tmp_path)
    without = FakeCase(tmp_path / "without")
    without.write(without.history())
    assert "there is no snapshot; the key output.snapshot_interval" in said(without.directory)
    (without.output / "snapshots").mkdir()
    shutil.copy(case.output / "snapshots/03-shear-000000.h5", without.output / "snapshots")
    assert "is the only snapshot of stage shear; a movie takes 2 at least" in said(without.directory)
    monkeypatch.setattr(shutil, "which", lambda name: None)
    assert "there is no ffmpeg on the PATH" in said(case.directory)


@pytest.mark.parametrize("words, why", [
    (("--fps", "0"), "expected 0.1 to 120 frames a second"), (("--size", "641x480"), "expected even numbers"),
    (("--size", "wide"), "invalid size, WIDTHxHEIGHT, value: 'wide'"), (("--only", "water"), "invalid choice"),
])
def test_bad_options(case, words, why, capsys):
    with pytest.raises(SystemExit):
        main(["movie", str(case.directory), *words])
    assert why in capsys.readouterr().err


def test_nearer_spheres_hide_those_behind():
    view = spheres.View(np.array([[0, 0, 0.0]]), np.array([1.0]), 0, 0, at_most=(100, 60))
    assert view.height // 2 <= 60 and view.width // 2 <= 100
    red, blue = np.array([1, 0, 0]), np.array([0, 0, 1])
    image = spheres.draw(np.array([[0, 0.5, 0], [0, -0.5, 0.0]]), np.array([1.0, 0.5]), np.array([red, blue]), view)  # seen from -y
    middle = image[image.shape[0] // 2, image.shape[1] // 2]
    assert middle[2] > 0.5 > middle[0] and image[image.shape[0] // 2, 5, 0] > 0.3


def test_round_up():
    assert [frames.round_up(v) for v in (0, 0.011, 99, 100, 101, 7)] == pytest.approx([1, 0.015, 100, 100, 150, 8])
