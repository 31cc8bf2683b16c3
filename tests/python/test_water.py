"""Figures of wet beds."""
import numpy as np
import pytest

import fake_wet_case
from moraine import figures, water_figures
from moraine.__main__ import main
from moraine.results import Results, MissingData


def fake(directory, **what):
    """See fake_wet_case.py."""
    fake_wet_case.write(directory, **what)
    return Results(directory)


def test_pressure_by_level_and_time(tmp_path):
    times, heights, levels = water_figures.pressure_field(fake(tmp_path / "case").stage("shear"))
    assert times == pytest.approx([0, 1, 2, 3]) and heights == pytest.approx([0.8, 0.81, 0.82, 0.83])
    assert levels == pytest.approx(-1000 * np.outer([0, 1, 2, 3], [1, 2, 3, 4]))


def test_a_snapshot_without_water_says_so(tmp_path):
    shear = fake(tmp_path / "case", wet=False).stage("shear")
    with pytest.raises(MissingData, match="there is no water in it"):
        shear.snapshots[0].water_grid
    with pytest.raises(MissingData, match="fewer than two snapshots of stage shear hold water"):
        water_figures.pressure(shear)


def test_a_wet_case_has_two_more_figures_and_a_dry_one_none(tmp_path, capsys):
    wet, dry = (fake(tmp_path / name, wet=name == "wet") for name in ("wet", "dry"))
    names = {f.name for f in figures.Selection([wet]).figures} - {f.name for f in figures.Selection([dry]).figures}
    assert names == {"water-shear", "water-pressure"}
    assert main(["figures", str(wet.directory), "--format", "png", "--only", ",".join(names)]) == 0
    assert {p.stem for p in (wet.directory / "figures").glob("*.png")} == names
    capsys.readouterr()
    main(["figures", str(dry.directory), "--format", "png", "--output", str(tmp_path / "figures")])
    said = capsys.readouterr()
    assert "water" not in said.out + said.err
    assert main(["figures", str(dry.directory), "--only", "water-shear"]) == 1
    assert "no case has a shear stage with pore water" in capsys.readouterr().out
