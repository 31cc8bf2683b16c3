"""The page of a bed in 3D: what is in it, and what a browser makes of it."""
import html as html_text
import json
import re
import shutil
import subprocess

import numpy as np
import pytest

import fake_sheared_case as sheared
import fake_wet_case
from moraine import MissingData, open as open_case, view
from moraine.__main__ import main

browser = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)


def has_library():
    try:
        return bool(view.library())
    except MissingData:
        return False


with_library = pytest.mark.skipif(not has_library(), reason="there is no three.js here (apt-get install libjs-three)")


@pytest.fixture(scope="module")
def case(tmp_path_factory):
    """With a title and a water grid that a page must get through."""
    made = sheared.write(tmp_path_factory.mktemp("view") / "case", [sheared.shear(0.13)])
    for file in (made.output / "case.toml", made.directory / "case.toml"):
        file.write_text(file.read_text().replace("A case that was made up", "A </script><b>case</b> {{data}} & more"))
    for k, file in enumerate(sorted((made.output / "snapshots").glob("03-*.h5"))):
        with view.results.h5py.File(file, "r+") as h5:
            group = h5.create_group("water")
            group.attrs.update({"cells_x": 3, "cells_y": 2, "cells_z": 4, "size": [5.0, 5.0, 6.0]})
            group["pressure"] = -1000.0 * k * np.arange(24)
    return made


def parts(page):
    """What the page says of the case, and the numbers of each snapshot."""
    text = page.read_text()
    head = json.loads(re.search(r'<script type="application/json" id="data">(.*?)</script>', text, re.S)[1])
    packed = re.findall(r'<script type="text/plain" class="snapshot">(.*?)</script>', text)
    return head, [view.unpacked(about["columns"], p) for about, p in zip(head["snapshots"], packed)]


@with_library
def test_the_page_has_the_numbers_of_the_snapshots(case, tmp_path):
    page = tmp_path / "new/view.html"
    assert main(["view", str(case.directory), "--output", str(page)]) == 0
    head, snapshots = parts(page)
    assert [p.name for p in page.parent.iterdir()] == ["view.html"] and len(snapshots) == 3
    for about, found, snapshot in zip(head["snapshots"], snapshots, open_case(case.directory).stage("shear").snapshots):
        g, c = snapshot.grains, snapshot.contacts
        assert about["time"] == snapshot.stage_time
        assert about["top"] == (g["position"][:, 2] + g["radius"]).max()  # which is above the wall here
        assert about["strain"] == pytest.approx(0.13 * snapshot.stage_time, rel=1e-3)

        def same(name, values):
            values = np.asarray(values, float)
            assert np.abs(found[name] - values).max() <= 0.51 * np.ptp(values) / 65535 + 1e-12

        for axis in range(3):
            same("xyz"[axis], g["position"][:, axis])
        same("pressure", g["pressure"])
        same("radius", g["radius"])
        same("speed", np.linalg.norm(g["velocity"], axis=1))
        same("displacement", g["displacement"][:, 0])
        same("spin", g["spin"][:, 1])
        same("rotation", g["rotation"][:, 1])
        same("water", snapshot.water["pressure"])
        assert np.array_equal(found["role"], g["role"])
        assert np.array_equal(found["coordination"], [np.sum(c["i"] == k) + np.sum(c["j"] == k) for k in range(150)])
        force = snapshot.normal_forces()
        kept = force >= 0.2 * force.mean()
        assert 0 < kept.sum() < len(force) == about["contacts"]
        assert np.array_equal(found["i"], c["i"][kept]) and np.array_equal(found["j"], c["j"][kept])
        same("force", force[kept])
    assert head["water"]["range"] == [-50, 50] and head["fields"]["spin"]["range"][0] == -head["fields"]["spin"]["range"][1]
    rows = open_case(case.directory).stage("shear").series
    assert head["series"]["curves"]["shear friction"] == pytest.approx(rows["shear_friction"], rel=1e-6, abs=1e-9)


@with_library
def test_the_page_needs_no_network(case, tmp_path):
    main(["view", str(case.directory), "--output", str(tmp_path / "view.html")])
    text = (tmp_path / "view.html").read_text()
    assert not re.search(r"<(script|img|iframe)[^>]*\ssrc=|<link|@import", text) and "{{style}}" not in text
    assert "<title>A &lt;/script>&lt;b>case&lt;/b> {{data}} &amp; more</title>" in text
    assert text.count("</script>") == 3 + 3  # library, data, program, and the snapshots: none was ended early


@with_library
def test_snapshots_are_left_out_and_it_is_said(case, tmp_path, capsys):
    page = tmp_path / "view.html"
    assert main(["view", str(case.directory), "--output", str(page), "--every", "2"]) == 0
    assert "1 of 3 snapshots" in capsys.readouterr().out
    head, _ = parts(page)
    times = [s.stage_time for s in open_case(case.directory).stage("shear").snapshots]
    assert [s["time"] for s in head["snapshots"]] == [times[0], times[2]] and head["left_out"].startswith("1 of 3 snapshots")
    assert main(["view", str(case.directory), "--output", str(page), "--most", "0.01"]) == 0
    assert "1 of 3 snapshots" in capsys.readouterr().out  # the first and the last stay


@pytest.mark.parametrize("values, step", [
    (np.array([]), None), (np.full(5, 3.25), None), (np.linspace(-2, 7, 1000), None), (np.arange(70000) % 66000, 1)])
def test_packing(values, step):
    packed = view.Packed()
    packed.add("a", values, step)
    packed.add("b", [1, 2, 3], 1)
    found = view.unpacked(packed.columns, packed.text())
    assert np.array_equal(found["b"], [1, 2, 3]) and len(found["a"]) == len(values)
    if len(values):
        assert np.abs(found["a"] - values).max() <= (0 if step else 0.501 * np.ptp(values) / 65535)


def test_what_is_missing_is_said(case, tmp_path, capsys, monkeypatch):
    assert main(["view", str(tmp_path)]) == 1 and "is no case directory" in capsys.readouterr().err
    fake_wet_case.write(tmp_path / "thin")
    without = tmp_path / "thin"  # snapshots that have radii only
    assert main(["view", str(without)]) == 1 and "there is no " in capsys.readouterr().err
    assert not (without / "figures/view.html").exists()
    with pytest.raises(MissingData, match="not finite"):
        view.Packed().add("pressure", [1.0, np.nan])
    for place, why in ((case.directory / "case.toml", "is no page that moraine view has written"), (tmp_path, "is a directory")):
        assert main(["view", str(case.directory), "--output", str(place)]) == 1
        assert why in capsys.readouterr().err
    assert (case.directory / "case.toml").read_text().startswith("title")
    monkeypatch.setattr(view.Path, "is_file", lambda self: False)
    monkeypatch.setattr(view.importlib.util, "find_spec", lambda name: None)
    assert main(["view", str(case.directory)]) == 1
    assert "apt-get install libjs-three; with pip: pip install jupyter-threejs-sage" in capsys.readouterr().err


@pytest.mark.parametrize("words, why", [(("--every", "0"), "expected 1 or more"), (("--most", "0"), "expected 0.01 to 2000 MB"),
                                        (("--most", "9", "--every", "2"), "not allowed with")])
def test_bad_options(case, words, why, capsys):
    with pytest.raises(SystemExit):
        main(["view", str(case.directory), *words])
    assert why in capsys.readouterr().err


@with_library
@pytest.mark.skipif(not browser, reason="there is no chromium here (apt-get install chromium)")
def test_a_browser_shows_it(case, tmp_path):
    """It unpacks the numbers that are in it, shows what the address asks for, and has nothing to complain of."""
    page = tmp_path / "view.html"
    main(["view", str(case.directory), "--output", str(page)])
    done = subprocess.run([browser, "--headless", "--no-sandbox", f"--user-data-dir={tmp_path / 'profile'}", "--use-gl=angle", "--use-angle=swiftshader",
                           "--enable-unsafe-swiftshader", "--enable-logging=stderr", "--virtual-time-budget=10000", "--dump-dom",
                           f"{page.as_uri()}#t=1&colour=speed&chains=1&force=1&water=1&cut=2"], capture_output=True, text=True, timeout=120)
    assert "CONSOLE" not in done.stderr  # neither errors of JavaScript nor of the shaders
    found = json.loads(html_text.unescape(re.search(r'<body[^>]* data-state="([^"]*)"', done.stdout)[1]))
    snapshot = open_case(case.directory).stage("shear").snapshots[1]
    force = snapshot.normal_forces()
    assert (found["shown"], found["grains"], found["colour"]) == (1, 150, "speed")
    assert abs(found["contacts"] - np.sum(force >= force.mean())) <= 1  # of one that is rounded to the other side
    assert found["first"] == pytest.approx(snapshot.grains["position"][0], abs=1e-4)
    assert re.search(r'<div id="label">speed \(mm/s\)</div>', done.stdout) and '<div id="problem"></div>' in done.stdout
