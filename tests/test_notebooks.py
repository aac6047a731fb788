"""Every notebook runs from top to bottom and is stored without outputs."""

import re
from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient
from nbclient.exceptions import CellExecutionError

ROOT = Path(__file__).resolve().parent.parent
NOTEBOOKS = sorted((ROOT / "notebooks").glob("*.ipynb"))
by_name = pytest.mark.parametrize("file", NOTEBOOKS, ids=lambda file: file.stem)


def test_there_are_notebooks():
    assert NOTEBOOKS


def client_of(notebook, folder):
    return NotebookClient(notebook, timeout=60, resources={"metadata": {"path": folder}})


@by_name
def test_runs(file, tmp_path):
    """As in the folder of the notebooks, beside which is the folder of the data."""
    (tmp_path / "data").symlink_to(ROOT / "data")
    folder = tmp_path / "notebooks"
    folder.mkdir()
    notebook = nbformat.read(file, as_version=4)
    client_of(notebook, folder).execute()
    errors = [
        output
        for cell in notebook.cells
        for output in cell.get("outputs", [])
        if output.output_type == "error" or output.get("name") == "stderr"
    ]
    assert errors == []
    assert list(folder.iterdir()) == []


@by_name
def test_is_clean(file):
    """Outputs, execution counts and metadata of a run are not stored."""
    notebook = nbformat.read(file, as_version=4)
    nbformat.validate(notebook)
    assert [cell.id for cell in notebook.cells] == [
        f"cell-{number:02d}" for number in range(len(notebook.cells))
    ]
    for cell in notebook.cells:
        assert not cell.metadata
        assert cell.get("outputs", []) == []
        assert cell.get("execution_count") is None
    assert set(notebook.metadata) == {"kernelspec", "language_info"}
    assert re.match(r"# \S.*\n\n\S", notebook.cells[0].source), "a title and an introduction"


@by_name
def test_a_page_names_it(file):
    assert f"notebooks/{file.name}" in (ROOT / "docs" / "examples.md").read_text("utf-8")


NO_ROBOTS = """
from importlib import metadata

def files(name):
    raise metadata.PackageNotFoundError(name)

metadata.files = files
"""


def test_missing_robots_are_reported_in_one_line(tmp_path):
    notebook = nbformat.read(ROOT / "notebooks" / "humanoid_kick.ipynb", as_version=4)
    notebook.cells.insert(0, nbformat.v4.new_code_cell(NO_ROBOTS))
    with pytest.raises(CellExecutionError):
        client_of(notebook, tmp_path).execute()
    (output,) = (each for cell in notebook.cells for each in cell.get("outputs", []))
    (line,) = output.traceback
    assert "\n" not in line
    assert 'install it with pip install "kickdyn[robots]"' in line
