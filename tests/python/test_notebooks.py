"""The notebooks of the manual run from top to bottom, in an empty folder. A minute or two each."""
from pathlib import Path

import pytest

import moraine
from conftest import root

pytest.importorskip("moraine._core", reason="moraine._core is not built here (pip install .)")
nbformat = pytest.importorskip("nbformat")
nbclient = pytest.importorskip("nbclient")
for module in ("ipykernel", "pandas", "tomlkit", "matplotlib_inline"):
    pytest.importorskip(module)

notebooks = sorted((root / "docs/manual/notebooks").glob("*.ipynb"))


@pytest.mark.parametrize("file", notebooks, ids=lambda file: file.stem)
def test_it_runs_and_says_nothing_unasked(file, tmp_path, monkeypatch):
    monkeypatch.setenv("PYTHONPATH", str(Path(moraine.__file__).parents[1]))
    notebook = nbformat.read(file, as_version=4)
    nbformat.validate(notebook)
    kept = {k: sorted(o.output_type for o in cell.outputs) for k, cell in enumerate(notebook.cells) if cell.cell_type == "code"}
    nbclient.NotebookClient(notebook, timeout=600, kernel_name="python3", resources={"metadata": {"path": str(tmp_path)}}).execute()
    for k, cell in enumerate(notebook.cells):
        if cell.cell_type == "code":
            said = [o.text for o in cell.outputs if o.output_type == "stream" and o.name == "stderr"]
            assert not said, f"cell {k}: {said}"
            assert sorted(o.output_type for o in cell.outputs) == kept[k], f"cell {k}: shows something else than the file"
    assert list(tmp_path.iterdir()), "it writes its cases where it runs"


def test_there_are_notebooks():
    assert len(notebooks) == 2
