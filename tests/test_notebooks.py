"""Every notebook runs from top to bottom and is stored with the outputs that it gives."""

import base64
import re

import nbformat
import pytest
from nbclient.exceptions import CellExecutionError
from notebook_outputs import NOTEBOOKS, PICTURES, ROOT, outputs, pictures, run, same, texts

by_name = pytest.mark.parametrize("file", NOTEBOOKS, ids=lambda file: file.stem)


def test_there_are_notebooks():
    assert NOTEBOOKS


@by_name
def test_runs_and_gives_what_is_stored(file, tmp_path):
    """As in the folder of the notebooks, beside which is the folder of the data.

    Pictures are compared by presence, numbers in texts to 2 %.
    """
    (tmp_path / "data").symlink_to(ROOT / "data")
    folder = tmp_path / "notebooks"
    folder.mkdir()
    stored, notebook = (nbformat.read(file, as_version=4) for _ in range(2))
    run(notebook, folder)
    errors = [
        output
        for cell in notebook.cells
        for output in cell.get("outputs", [])
        if output.output_type == "error" or output.get("name") == "stderr"
    ]
    assert errors == []
    assert list(folder.iterdir()) == []
    for old, new in zip(stored.cells, notebook.cells, strict=True):
        assert pictures(old) == pictures(new), f"{new.id}: make notebooks stores what it gives"
        for one, other in zip(texts(old), texts(new), strict=True):
            assert same(one, other), f"{new.id}: make notebooks stores what it gives"


def test_outputs_that_differ_are_noticed():
    assert same("at 3.14 m, off by 2e-16", "at 3.15 m,  off by 1.3e-15")
    assert same("[1. 2.5 -0.3]", "[1. 2.51 -0.3]")
    assert not same("at 3.14 m", "at 3.34 m")
    assert not same("at 3.14 m", "at 3.14 km")
    assert not same("-0.5 m", "0.5 m")
    assert not same("3 of 200", "300 of 200")


@by_name
def test_is_stored_small_and_without_traces(file):
    """Cells are run in their order, pictures are small, and nothing tells of a machine."""
    notebook = nbformat.read(file, as_version=4)
    nbformat.validate(notebook)
    assert [cell.id for cell in notebook.cells] == [
        f"cell-{number:02d}" for number in range(len(notebook.cells))
    ]
    code = [cell for cell in notebook.cells if cell.cell_type == "code"]
    assert [cell.execution_count for cell in code] == list(range(1, len(code) + 1))
    assert all(not cell.metadata for cell in notebook.cells)
    assert set(notebook.metadata) == {"kernelspec", "language_info"}
    assert re.match(r"# \S.*\n\n\S", notebook.cells[0].source), "a title and an introduction"
    data = [output.get("data", {}) for cell in code for output in outputs(cell)]
    sizes = [
        len(base64.b64decode(each[kind])) for each in data for kind in PICTURES if kind in each
    ]
    assert sizes
    assert max(sizes) < 100_000
    assert str(ROOT) not in file.read_text("utf-8")
    assert "/tmp/" not in file.read_text("utf-8")


def test_the_notebooks_are_small_together():
    assert sum(file.stat().st_size for file in NOTEBOOKS) < 2_000_000


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
        run(notebook, tmp_path)
    (output,) = (
        each
        for cell in notebook.cells
        for each in cell.get("outputs", [])
        if each.output_type == "error"
    )
    (line,) = output.traceback
    assert "\n" not in line
    assert 'install it with pip install "kickdyn[robots]"' in line
