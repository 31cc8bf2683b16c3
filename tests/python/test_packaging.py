"""What can be said of pyproject.toml and packaging/ where neither Spack nor conda is there."""
import re
import tomllib
import types
import sys

import pytest

from conftest import root

project = tomllib.loads((root / "pyproject.toml").read_text())


def launchers(name):
    return re.search(rf"^{name}=\(([^)]*)\)", (root / "moraine").read_text(), re.M)[1].split()


def names(requirements):
    """Without versions, as PyPI has them."""
    others = {"matplotlib-base": "matplotlib", "pil": "pillow"}
    bare = (re.split(r"[ <>=@:~+]", r)[0].removeprefix("py-") for r in requirements)
    return {others.get(name, name) for name in bare}


def test_versions_agree():
    cmake = re.search(r"project\(moraine VERSION ([0-9.]+)", (root / "CMakeLists.txt").read_text())[1]
    assert f'__version__ = "{cmake}"' in (root / "python/moraine/__init__.py").read_text()
    assert f"version: {cmake}" in (root / "CITATION.cff").read_text()
    assert f'version: "{cmake}"' in (root / "packaging/conda/recipe.yaml").read_text()


def test_container_has_the_packages_of_the_launcher():
    build, run = (root / "packaging/Containerfile").read_text().split("\nFROM ")[1:]
    for package in launchers("needed"):
        assert f" {package}" in build, package
    assert "-dev" not in run


def test_conda_recipe():
    yaml = pytest.importorskip("yaml")
    recipe = yaml.safe_load((root / "packaging/conda/recipe.yaml").read_text())
    assert recipe["schema_version"] == 1
    assert set(recipe) == {"schema_version", "context", "package", "source", "build", "requirements", "tests", "about"}
    assert set(recipe["requirements"]) == {"build", "host", "run"}
    assert names(recipe["requirements"]["run"]) - {"python"} == names(project["project"]["dependencies"])
    assert names(project["build-system"]["requires"]) <= names(recipe["requirements"]["host"])


def test_spack_recipe(monkeypatch):
    """Its directives, called on a stub of spack.package."""
    depends, variants = {}, []

    def depends_on(spec, type=("build", "link"), when=""):
        depends[spec] = type
        assert not when or when.lstrip("+~") in variants

    stub = types.ModuleType("spack.package")
    stub.PythonPackage = type("PythonPackage", (), {})
    stub.depends_on, stub.variant = depends_on, lambda name, default, description: variants.append(name)
    stub.version = lambda name, branch, no_cache: None
    stub.license = lambda name: None
    stub.conflicts = lambda spec, msg: None
    stub.run_after = stub.on_package_attributes = lambda *phase, **attributes: lambda method: method
    monkeypatch.setitem(sys.modules, "spack", types.ModuleType("spack"))
    monkeypatch.setitem(sys.modules, "spack.package", stub)
    place = {}
    exec((root / "packaging/spack/package.py").read_text(), place)
    assert names(s for s, kind in depends.items() if kind == "run") == names(project["project"]["dependencies"])
    assert names(project["build-system"]["requires"]) <= names(s for s, kind in depends.items() if kind == "build")

    class Spec:
        def satisfies(self, what):
            return what == "+mpi"

    settings = place["Moraine"]().config_settings(Spec(), "/prefix")
    assert settings == {"cmake.define.MORAINE_MPI": "ON", "cmake.define.MORAINE_CUDA": "OFF"}
    options = re.findall(r"^option\((MORAINE_\w+)", (root / "CMakeLists.txt").read_text(), re.M)
    assert {key.removeprefix("cmake.define.") for key in settings} <= set(options)


def test_optional_extras_are_named_in_the_manual():
    page = (root / "docs/manual/how-to/install.md").read_text()
    for extra in project["project"]["optional-dependencies"]:
        assert f".[{extra}]" in page
