"""moraine.Case: built, edited, written, checked. Running is in test_run_case.py."""
import inspect
import runpy
import shutil
import tomllib

import pytest

from conftest import root

pytest.importorskip("moraine._core", reason="moraine._core is not built here (pip install .)")
pytest.importorskip("tomlkit")

import moraine
from moraine import _core, tables


@pytest.fixture
def case(tmp_path):
    case = moraine.Case(tmp_path / "bed", title="A bed")
    case.box(x="22 cm", y=0.22).grains(count=60, columns_x=5, columns_y=4)
    return case.settle("1 s").consolidate("80 kPa", duration="0.5 s").shear(rate="0.05 1/s", strain=1)


def words(action):
    """Of the one error that it raises."""
    with pytest.raises(moraine.Error) as caught:
        action()
    return str(caught.value)


def test_it_writes_what_a_person_would(case):
    case.output.series_interval = "10 ms"
    case.contact.k_n = "1.16e7 N/m"
    case.write()
    assert case.file.read_text() == """\
title = "A bed"

[box]
x = "22 cm"
y = 0.22

[grains]
count = 60
columns_x = 5
columns_y = 4

[contact]
k_n = "1.16e7 N/m"

[output]
series_interval = "10 ms"

[[stage]]
name = "settle"
kind = "settle"
duration = "1 s"

[[stage]]
name = "consolidate"
kind = "consolidate"
duration = "0.5 s"
normal_stress = "80 kPa"

[[stage]]
name = "shear"
kind = "shear"
strain = 1
normal_stress = "80 kPa"
strain_rate = "0.05 1/s"
"""
    resolved = tomllib.loads(_core.resolve(str(case.directory)))
    assert resolved["box"]["x"] == 0.22 and resolved["stage"][2]["normal_stress"] == 80e3


def test_every_key_of_the_table_has_a_place_with_its_meaning_and_unit(case):
    seen = 0
    for row in _core.keys():
        table, _, leaf = row["name"].rpartition(".")
        if row["name"] == "stages":
            continue
        owners = [tables.CaseKeys] if not table else [tables.classes[table]] if table != "stage" else \
            [tables.stage_classes[kind] for kind in tables.kinds if not row["kinds"] or kind in row["kinds"].split(", ")]
        for owner in owners:
            doc = inspect.getattr_static(owner, leaf).__doc__
            assert doc.startswith(row["meaning"]) and (row["unit"] in ("", "1") or row["unit"] in doc), row["name"]
            seen += 1
    assert seen > len(_core.keys())
    assert "k_n" in dir(case.contact) and "velocity" in dir(case.stages["shear"]) and "velocity" not in dir(case.stages["settle"])
    for kind in tables.kinds:
        assert "duration" in inspect.signature(getattr(case, kind)).parameters


@pytest.mark.parametrize("name, value, right", [
    ("contact.k_n", -1, "expected > 0 N/m"),
    ("contact.k_n", "3 Pa", "expected a unit convertible to N/m"),
    ("contact.k_n", "3", "expected"),
    ("contact.law", "herz", "did you mean hertz?"),
    ("grains.count", 2.5, "expected an integer"),
    ("box.floor", "yes", "expected true or false"),
    ("contact.kn", 3, "did you mean contact.k_n?"),
    ("contact.density", 3, "did you mean grains.density?"),
    ("title", 3, "expected a text in quotes"),
    ("stage.shear.normal_stress", {"ramp": ["20 kPa"], "over": "1 s"}, "ramp: expected two values, [from, to]"),
    ("stage.shear.strian", 1, "did you mean stage.shear.strain?"),
])
def test_what_is_wrong_is_said_at_once_in_the_words_of_the_file_reader(case, name, value, right):
    before = case.text
    said = words(lambda: case.__setitem__(name, value))
    assert said.startswith(name) and right in said
    assert case.text == before
    # The same value in a file.
    table, _, leaf = name.rpartition(".")
    line = f"{leaf} = {case.toml(name, value)}\n"
    text = line if not table else f"[{table}]\n{line}" if not table.startswith("stage") else f'[[stage]]\nname = "shear"\nkind = "shear"\n{line}'
    of_file = words(lambda: _core.fill("there", text))
    assert " ".join(of_file.split()).endswith(" ".join(said.split())) and of_file.startswith("there/case.toml:")


def test_a_key_that_there_is_not_is_also_an_attribute_error(case):
    with pytest.raises(AttributeError, match="did you mean contact.k_n"):
        case.contact.kn
    with pytest.raises(AttributeError, match="did you mean contact.k_n"):
        case.contact.kn = 3
    with pytest.raises(AttributeError, match="did you mean shear"):
        case.shaer()
    with pytest.raises(moraine.Error, match="did you mean title"):
        case.titel = "x"
    with pytest.raises(moraine.Error, match="did you mean title"):
        moraine.Case("nowhere", titel="x")
    with pytest.raises(AttributeError, match="no stage 'sheer'; stages: settle, consolidate, shear"):
        case.stages.sheer
    assert not hasattr(case.contact, "_ipython_display_") and not hasattr(case.stages, "_ipython_display_")


@pytest.mark.parametrize("value", [None, object(), {1: None}, [None]])
def test_what_toml_does_not_have_is_refused(case, value):
    assert "contact.mu_s" in words(lambda: setattr(case.contact, "mu_s", value))


def test_a_key_of_another_kind_of_stage_is_refused(case):
    expected = "belongs to kind shear, and this stage is settle"
    assert expected in words(lambda: setattr(case.stages["settle"], "velocity", "1 m/s"))
    assert expected in words(lambda: case.stages["settle"].velocity)
    assert expected in words(lambda: case.settle("1 s", velocity=1))


def test_reading_gives_what_was_set_or_the_default(case):
    assert case.box.x == "22 cm" and case.box.y == 0.22 and case.title == "A bed"
    assert case.contact.mu_s == 0.3 and case.contact.mu_d == 0.3
    case.contact.mu_s = "50 %"
    assert case.contact.mu_s == "50 %" and case.contact.mu_d == 0.5  # by another key
    assert case.stages["settle"].wall_gamma_n == 1e4 and case.stages["shear"].wall_gamma_n == 0  # by kind
    case.model.preset = "fast"
    assert case.model.f == 0.3 and case.stages["shear"].f == 0.3
    case.model.f = 0.1
    assert case.stages["shear"].f == 0.1
    del case.model.f, case.model.preset, case.contact.mu_s
    assert case.model.f == 0.075 and case.contact.mu_s == 0.3
    del case.contact.mu_s  # is not there: it stays the default
    assert "[model]" not in case.text and "[contact]" not in case.text
    assert "mu_s = 0.3" in repr(case.contact) and "by default" in repr(case.contact)


@pytest.mark.parametrize("name, value", [("box.floor", False), ("model.ledger", True), ("grains.seed", 7), ("model.dt", "auto"), ("model.dt", 1e-5),
                                         ("grains.material", ""), ("stage.shear.fluid", True), ("stages", ["settle"]), ("contact.k_n", 1.16e7),
                                         ("material.sand.sizes", ["1 mm", "1 cm"])])
def test_what_was_set_is_read_again(case, name, value):
    case.material("sand")
    case[name] = value
    assert case[name] == value and type(case[name]) is type(value)
    case.write()
    again = moraine.Case(case.directory)
    assert again[name] == value and type(again[name]) is type(value) and again.text == case.text
    del again[name]
    assert not again.has(name)


def test_numpy_numbers_are_numbers(case):
    numpy = pytest.importorskip("numpy")
    case.grains.seed, case.contact.k_n, case.box.floor = numpy.int64(3), numpy.float64(1e7), numpy.bool_(True)
    assert (case.grains.seed, case.contact.k_n, case.box.floor) == (3, 1e7, True)
    assert "seed = 3\n" in case.text and "k_n = 10000000.0\n" in case.text and "floor = true\n" in case.text


def test_what_a_case_extends_is_read_too(case, tmp_path):
    case.contact.mu_s = 0.4
    case.write()
    longer = moraine.Case(tmp_path / "longer", extends="../bed")
    assert longer.contact.mu_s == 0.4 and list(longer.stages) == ["settle", "consolidate", "shear"]
    longer.stages["shear"].strain = 2
    assert longer.text == 'extends = "../bed"\n\n[[stage]]\nname = "shear"\nstrain = 2\n'
    assert longer.stages["shear"].strain == 2 and longer.stages["shear"].strain_rate == 0.05
    assert "expected a directory that holds a case.toml" in words(lambda: setattr(longer, "extends", "../nowhere"))
    assert longer.extends == "../bed"


def test_a_case_may_start_from_another(case, tmp_path):
    case.write()
    assert moraine.Case(tmp_path / "deep/er", start=case).start == "../../bed"


def test_stages_are_calls(tmp_path):
    case = moraine.Case(tmp_path / "x")
    assert case.settle(duration="1 s") is case
    case.consolidate("20 kPa", duration="1 s").shear(rate="0.1 1/s", strain=0.1).shear(rate="-0.1 1/s", strain=0.1)
    case.shear_stress("8 kPa", duration="1 s", name="creep").uniaxial(rate=0.1, strain=0.1).press("20 kPa", rate=0.1, duration=1)
    assert list(case.stages) == ["settle", "consolidate", "shear", "shear-2", "creep", "uniaxial", "press"]
    assert case.stages["shear-2"].strain_rate == "-0.1 1/s" and case.stages["press"].strain_rate == 0.1
    # Shear keeps the stress of the stage before.
    assert [case.stages[name].normal_stress for name in ("shear", "shear-2", "creep")] == ["20 kPa"] * 3
    assert case.stages["uniaxial"].normal_stress == 0
    assert case.stages.shear.strain == 0.1 and "shear" in dir(case.stages) and "shear-2" not in dir(case.stages)
    case.stages["shear"].normal_stress = {"ramp": ["20 kPa", "80 kPa"], "over": "0.5 s"}
    assert 'normal_stress = {ramp = ["20 kPa", "80 kPa"], over = "0.5 s"}' in case.text
    assert case.stages["shear"].normal_stress == {"ramp": ["20 kPa", "80 kPa"], "over": "0.5 s"}
    del case.stages["uniaxial"], case.stages["press"]
    assert list(case.stages) == ["settle", "consolidate", "shear", "shear-2", "creep"]


def test_wrong_calls_of_stages_change_nothing(case):
    before = case.text
    assert "duration is given twice" in words(lambda: case.settle("1 s", duration="2 s"))
    assert "rate and strain_rate are the same key" in words(lambda: case.shear(rate=1, strain_rate=1))
    assert "there is another stage of this name" in words(lambda: case.settle("1 s", name="settle"))
    assert "expected letters, digits" in words(lambda: case.settle("1 s", name="a b"))
    assert "unknown key" in words(lambda: case.shear(rate=1, strian=1))
    assert "no stage 'sheer'; stages: settle, consolidate, shear" in words(lambda: case.stages["sheer"])
    with pytest.raises(TypeError, match="one value without a name, duration"):
        case.settle(1, 2)
    assert case.text == before and list(case.stages) == ["settle", "consolidate", "shear"]


def test_a_stage_that_needs_a_key_says_so(case):
    del case.stages["shear"].strain
    assert "stage.shear.duration = 0.0 (by default): expected either duration or strain" in words(case.check)


def test_materials_and_pairs(case):
    case.grains.material = "sand"
    case.material("sand", mu_s=0.5).material("clay", mu_s=0.1, sizes=["1 mm", "1 cm"]).pair("sand", "clay", mu_s=0.2)
    assert list(case.materials) == ["sand", "clay"] and list(case.pairs) == ["sand-clay"]
    case.materials["clay"].density = "2.7 g/cm3"
    assert case.materials["clay"].density == "2.7 g/cm3" and case.materials["sand"].density is None  # as grains.density
    assert case.pairs["sand-clay"].mu_s == 0.2
    assert '[[pair]]\nof = ["sand", "clay"]\nmu_s = 0.2\n' in case.text
    assert "did you mean" in words(lambda: case.material("silt", mu_z=1)) and list(case.materials) == ["sand", "clay"]
    case.write()
    _core.resolve(str(case.directory))


def test_a_file_keeps_its_comments(tmp_path):
    shutil.copytree(root / "cases/quick-shear", tmp_path / "q", ignore=shutil.ignore_patterns("output", "sweep"))
    case = moraine.Case(tmp_path / "q")
    before = case.file.read_text()
    assert case.text == before
    case.contact.k_n = "2e7 N/m"
    case.stages["shear"].strain = 0.1
    case.guards.interval = 1000
    case.uniaxial("0.01 1/s", strain=0.1)
    case.write()
    changed = set(case.file.read_text().splitlines()) - set(before.splitlines())
    assert changed == {'k_n = "2e7 N/m"   # a hundredth of Table 1', "strain = 0.1", "[guards]", "interval = 1000", 'name = "uniaxial"',
                       'kind = "uniaxial"', 'strain_rate = "0.01 1/s"'}
    again = moraine.Case(tmp_path / "q")
    assert list(again.stages) == ["settle", "consolidate", "shear", "uniaxial"] and again.guards.interval == 1000
    _core.resolve(str(tmp_path / "q"))


def test_a_file_with_an_error_is_not_read(tmp_path):
    (tmp_path / "case.toml").write_text("[contact]\nkn = 3\n")
    assert words(lambda: moraine.Case(tmp_path)) == f"{tmp_path}/case.toml:2: contact.kn = 3: unknown key; did you mean contact.k_n?"


def script(directory, strain=1, **how):
    case = moraine.Case(directory, title="t", **how)
    case.settle("1 s").consolidate("80 kPa", duration="0.5 s").shear(rate="0.05 1/s", strain=strain)
    return case.write()


def test_a_script_may_run_again(tmp_path):
    first = script(tmp_path).text
    assert script(tmp_path).text == first == script(tmp_path, new=True).text
    case = script(tmp_path, strain=2)  # what is changed is changed in its place
    assert list(case.stages) == ["settle", "consolidate", "shear"] and case.stages["shear"].strain == 2
    assert script(tmp_path, strain=3, new=True).stages["shear"].strain == 3  # what this session wrote may be written over


def test_what_someone_else_wrote_is_not_overwritten(case):
    case.write()
    case.file.write_text(case.text.replace("A bed", "Mine"))
    case.grains.seed = 3
    assert "has changed since" in words(case.write) and "overwrite=True" in words(case.write) and "Mine" in case.file.read_text()
    anew = moraine.Case(case.directory, new=True, title="Other")
    assert "says something else than this case" in words(anew.write) and "Mine" in case.file.read_text()
    edited = moraine.Case(case.directory)
    assert edited.title == "Mine"
    case.write(overwrite=True)
    assert 'title = "A bed"' in case.file.read_text()
    case.file.unlink()  # nothing is lost by writing it again
    case.write()


def test_check_says_what_would_run(case):
    case.wall.mass = "10 kg"
    case.shear(rate="0.05 1/s", strain=0.01, name="more").model.preset = "fast"
    text = case.check(threads=1)
    assert text.startswith("A bed\n") and "stage 3: shear" in text and "inertia" in text
    assert repr(text) == str(text)  # as a notebook shows it
    case.grains.cell = 3
    assert case.check(threads=1) != text
    assert "expected cpu | cuda | auto" in words(lambda: case.check(backend="gpu"))


def test_stubs_are_those_of_the_table():
    stubs = runpy.run_path(str(root / "python/stubs.py"))
    assert stubs["target"].read_text() == stubs["text"](), "run python/stubs.py"


def test_where_nothing_can_be_written(tmp_path):
    (tmp_path / "file").write_text("")
    assert "Not a directory" in words(lambda: moraine.Case(tmp_path / "file/bed"))
    assert "/proc/bed/case.toml: cannot be written" in words(lambda: moraine.Case("/proc/bed").settle("1 s").write())
