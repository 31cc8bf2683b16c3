"""Shear along -x, and to and fro: each analysis and each figure of a bed and of its mirror image, and curves that close."""
import re

import h5py
import numpy as np
import pytest

import fake_sheared_case
import fake_wet_case
from fake_sheared_case import place, shear, to_and_fro, twins, write
from moraine import bed_figures, figures, force_figures, hardening_report, measure, paper_report as report, profile, shearing, strength, style, water_figures
from moraine import open as open_case
from moraine.__main__ import main
from moraine.results import MissingData
from moraine.progress import Progress


def picture(figure):
    figure.canvas.draw()
    pixels = np.asarray(figure.canvas.buffer_rgba()).copy()
    style.plt.close(figure)
    return pixels


def lines_of(axes):
    """x and y of each curve, without the zero lines."""
    return [line.get_xydata().T for line in axes.get_lines() if len(line.get_xydata()) > 2]


def test_the_series_is_signed(tmp_path):
    plus, minus = twins(tmp_path)
    for name in ("shear_strain", "shear_stress", "shear_friction"):
        assert np.array_equal(minus.stage("shear").series[name], -plus.stage("shear").series[name])
        assert minus.stage("shear").series[name][-1] < 0
    assert np.array_equal(minus.stage("shear").series["dilation"], plus.stage("shear").series["dilation"])


def test_a_mirrored_bed_has_the_same_strength(tmp_path):
    plus, minus = (strength.strength(c.stage("shear")) for c in twins(tmp_path))
    assert plus == minus
    assert plus.peak_raw == pytest.approx(0.5, abs=5e-3) and plus.strain == pytest.approx(0.3) and plus.ultimate > 0.4


def test_a_mirrored_bed_has_the_same_measurements(tmp_path):
    said = []
    plus, minus = (measure.measure(c, said.append) for c in twins(tmp_path))
    assert not said  # nothing is left out
    assert plus.keys() == minus.keys() and len(plus) > 40
    for name in plus.keys() - {"hours"}:
        assert repr(minus[name]) == repr(plus[name]), name  # to the last digit, or nan
    assert plus["loosened_depth_d"] > 0 and plus["rotation_mean_y"] > 0 and plus["shear_zone_d"] > 1 and plus["inertia_number"] > 0


def test_a_mirrored_bed_has_the_same_figures(tmp_path):
    plus, minus = (figures.Selection([c]) for c in twins(tmp_path))
    drawn = 0
    for figure in plus.figures:
        if not figure.many:
            assert np.array_equal(picture(figure.draw(plus)), picture(figure.draw(minus))), figure.name
            drawn += 1
    assert drawn >= 12


def test_a_bed_and_its_mirror_image_have_a_mean(tmp_path):
    both = list(twins(tmp_path))
    strain, values = bed_figures.on_common_strain(both, "shear_friction")
    assert np.array_equal(values[0], values[1]) and values.min() >= 0 and strain[-1] == pytest.approx(0.3, abs=3e-3)


def test_a_variant_along_the_other_direction_does_not_differ(tmp_path):
    plus, minus = twins(tmp_path)
    found = report.variant([plus], "mirrored", [minus])
    assert found.strain == pytest.approx(0.3)
    assert all(a == b for a, b, _ in found.values.values())


def test_a_picture_is_that_of_the_raw_snapshots_unless_seen_along_the_shear(tmp_path):
    """The mirror matters: without it the comparison above would fail."""
    plus, minus = twins(tmp_path)
    raw, seen = minus.stage("shear").snapshots[-1], shearing.along(minus.stage("shear")).snapshots[-1]
    other = plus.stage("shear").snapshots[-1]
    for name in other.grains:
        assert np.array_equal(seen.grains[name], other.grains[name]), name
    for name in other.contacts:
        assert np.array_equal(seen.contacts[name], other.contacts[name]), name
    for name in ("position", "displacement", "velocity", "spin", "rotation"):
        assert not np.array_equal(raw.grains[name], other.grains[name])
    assert profile.shear_zone(raw)[0] == profile.shear_zone(other)[0]


def test_water_is_mirrored_by_cells(tmp_path):
    fake_wet_case.write(tmp_path / "case")
    file = tmp_path / "case/output/snapshots/01-shear-000001.h5"
    with h5py.File(file, "r+") as h5:
        h5["water/pressure"][:] = np.arange(36)
        h5["water/flux"][:] = np.arange(36)[:, None] * [1, 1, 1]
    seen = shearing.MirrorImage(open_case(tmp_path / "case").stage("shear").snapshots[1])
    assert list(seen.water["pressure"][:6]) == [2, 1, 0, 5, 4, 3]
    assert list(seen.water["flux"][0]) == [-2, 2, 2]


def wet_twins(directory):
    for name, rate in (("plus", 0.05), ("minus", -0.05)):
        fake_wet_case.write(directory / name, rate=rate, peak=1.2)
    return [open_case(directory / name) for name in ("plus", "minus")]


def test_mirrored_till_has_the_same_numbers_and_figures(tmp_path):
    plus, minus = wet_twins(tmp_path)
    assert minus.stage("shear").series["total_friction"].min() < -0.5
    runs = [hardening_report.Run(c) for c in (plus, minus)]
    both = [r.measured() | {"hours": 0} for r in runs]
    assert both[0] == both[1] and both[0]["peak"] > 0.5 and runs[0].rate == 0.05
    assert all(r.done == 1 for r in runs)
    for draw in (lambda c: water_figures.shear([c.stage("shear")], [""]), lambda c: water_figures.pressure(c.stage("shear")),
                 lambda c: hardening_report.curves_figure([hardening_report.Run(c)])):
        assert np.array_equal(picture(draw(plus)), picture(draw(minus)))


def test_watch_shows_a_mirrored_bed_alike(tmp_path, capsys):
    shown, pictures = [], []
    for case in twins(tmp_path):
        for more in ([], ["--time"]):
            assert main(["watch", str(case.directory), "--once", *more]) == 0
            pictures.append((case.output / "watch.png").read_bytes())
            shown.append(capsys.readouterr().out)
    assert shown[:2] == shown[2:] and pictures[:2] == pictures[2:]
    assert "peak 0.500" in shown[0] and "strain 0.3 of 0.3" in shown[0]


def test_the_way_back_is_as_strong_as_its_mirror_image(tmp_path):
    case = to_and_fro(tmp_path)
    other = open_case(write(tmp_path / "other", [shear(-0.13, name="forth"), shear(0.13, name="back")]).directory)
    for name in ("forth", "back"):
        s = strength.strength(case.stage(name))
        assert s == strength.strength(other.stage(name))
        assert s.peak > 0.45 and s.ultimate > 0.4 and s.strain == pytest.approx(0.3) and 0 < s.peak_strain < 0.1
    rows = case.stage("back").series  # by hand
    e, friction = rows["shear_strain"][0] - rows["shear_strain"], -rows["shear_friction"]
    assert s.peak_raw == friction[strength.every(rows["stage_time"], 0.05)][1:].max()
    assert s.ultimate == friction[e >= 2 / 3 * e[-1]].mean()
    assert s.dilation == rows["dilation_diameters"][e >= 0.9 * e[-1]].mean()
    assert 0.2 < s.dilation < strength.strength(case.stage("forth")).dilation  # over the height when the way forth began


def test_strain_dilation_and_height_have_one_reference(tmp_path):
    case = to_and_fro(tmp_path)
    forth, back = (case.stage(name).series for name in ("forth", "back"))
    assert back["height"][0] > forth["height"][0] + 0.01
    assert shearing.height_0(back) == pytest.approx(shearing.height_0(forth)) == forth["height"][0]
    numbers = measure.strengths(case)  # of the last stage
    assert numbers["height_0_m"] == pytest.approx(forth["height"][0])
    assert numbers["porosity_0"] == pytest.approx(1 - 0.58 * back["height"][0] / forth["height"][0])
    progress = Progress(case.directory)
    progress.look()
    assert progress.height_0 == pytest.approx(forth["height"][0]) and progress.strain == pytest.approx(0.3)


def test_the_duration_of_a_stage_by_velocity_is_over_the_height_when_shear_began(tmp_path):
    back = fake_sheared_case.stage("back", "shear", strain=0.3, velocity=-0.13 * 0.32, normal_stress=20e3)
    case = write(tmp_path / "case", [shear(0.13, name="forth"), back])
    progress = Progress(case.directory)
    progress.look()
    assert progress.duration == pytest.approx(0.3 / 0.13) and progress.state == "finished"
    measure.require_end(open_case(case.directory))


def test_shear_to_and_fro_is_drawn_as_a_loop_that_closes(tmp_path):
    case = to_and_fro(tmp_path)
    tables = shearing.drawn(case.stage("back"))
    assert tables[0]["shear_strain"][-1] == tables[1]["shear_strain"][0] == pytest.approx(0.3)
    assert tables[0]["shear_friction"][-1] == tables[1]["shear_friction"][0] > 0.4 and tables[1]["shear_friction"][-1] < -0.4
    assert tables[1]["shear_strain"][-1] == pytest.approx(0, abs=1e-12)
    for figure in (bed_figures.friction_dilation([case]), force_figures.sheared_bed(case)):
        curves = [c for axes in figure.axes for c in lines_of(axes) if axes.get_xlabel() == "shear strain $\\gamma$" or "strain" in axes.get_xlabel()
                  or "friction" in axes.get_ylabel()]
        assert len(curves) == 2
        for strain, _ in curves:
            assert strain[0] == 0 and strain.max() == pytest.approx(0.3, abs=3e-3) and strain[-1] == pytest.approx(0, abs=3e-3)
            assert np.abs(np.diff(strain)).max() < 0.01  # no jump at the seam
        assert min(c[1].min() for c in curves) < -0.4
        friction = next(axes for axes in figure.axes if "friction" in axes.get_ylabel())
        assert friction.get_ylim()[0] < -0.4
        style.plt.close(figure)


def test_watch_draws_the_loop(tmp_path):
    from moraine import watch
    progress = Progress(to_and_fro(tmp_path).directory)
    progress.look()
    rows, label, strain = watch.curves(progress, False)
    assert label == "shear strain" and strain.max() == pytest.approx(0.3) and strain[-1] == pytest.approx(0, abs=1e-12)
    assert rows["shear_friction"].min() < -0.4
    told = " ".join(p for group in watch.status(progress, progress.state) for p in group)
    friction, peak = map(float, re.search(r"friction (\S+), peak (\S+)", told).groups())
    assert 0.4 < friction <= peak  # along the way back


def test_each_stage_of_shear_has_its_own_displacement(tmp_path):
    case = to_and_fro(tmp_path)
    forth, back = (shearing.along(case.stage(name)).snapshots[-1] for name in ("forth", "back"))
    assert np.abs(case.stage("back").snapshots[-1].grains["displacement"][:, 0]).max() < 1e-12  # since shear began
    moved = 2 * 0.3 * (place[:, 2] / 6)**3
    for snapshot in (forth, back):
        assert np.allclose(snapshot.grains["displacement"][:, 0], moved)
    assert np.allclose(profile.shear_zone(back), profile.shear_zone(forth))
    with pytest.raises(MissingData, match="has not moved since shear began"):
        profile.shear_zone(case.stage("forth").snapshots[0])


def test_a_way_back_without_its_first_snapshot_says_so(tmp_path):
    case = to_and_fro(tmp_path)
    (case.output / "snapshots/04-back-000000.h5").unlink()
    with pytest.raises(MissingData, match="04-back-000001.h5: is the first snapshot of stage back.*expected one of its beginning"):
        shearing.along(case.stage("back")).snapshots


def test_another_stage_in_between_begins_anew(tmp_path):
    rest = fake_sheared_case.stage("rest", "consolidate", duration=0.1, normal_stress=20e3)
    case = open_case(write(tmp_path / "case", [shear(0.13, name="forth"), rest, shear(-0.13, name="back")]).directory)
    assert [len(c) for c in shearing.courses(case.stages)] == [1, 1]
    rows, = shearing.drawn(case.stage("back"))
    assert rows["shear_strain"][-1] == pytest.approx(0.3) and rows["shear_friction"][-1] > 0.4


def test_direction_where_the_ends_meet():
    assert shearing.direction([0, -0.1, 0.05, 0]) == -1 and shearing.direction([0, 0.1, 0]) == 1
    assert shearing.direction([0.3, 0.1]) == -1 and shearing.direction([0.3]) == 1


def test_smoothed_does_not_ask_for_an_order():
    strain, values = np.linspace(0, 1, 201), np.linspace(0, 1, 201)**2
    shuffled = np.random.default_rng(1).permutation(201)
    known = strength.smoothed(strain, values)
    assert np.array_equal(strength.smoothed(strain[shuffled], values[shuffled]), known[shuffled], equal_nan=True)
    assert np.allclose(strength.smoothed(-strain, values), known, equal_nan=True)
