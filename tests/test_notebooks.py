"""Every notebook runs from top to bottom, and is stored for readers: small, in order, clean."""

import base64
import re

import nbformat
import pytest
from notebook_outputs import NOTEBOOKS, PICTURES, ROOT, outputs, run

by_name = pytest.mark.parametrize("file", NOTEBOOKS, ids=lambda file: file.stem)


def faults(notebook):
    """Return the errors and warnings that cells wrote."""
    written = [output for cell in notebook.cells for output in cell.get("outputs", [])]
    return [
        output
        for output in written
        if output.output_type == "error" or output.get("name") == "stderr"
    ]


@pytest.mark.slow
@by_name
def test_a_notebook_runs_without_error_or_warning(file, tmp_path):
    """In a folder beside that of the data, as in the repository; it leaves no file behind."""
    (tmp_path / "data").symlink_to(ROOT / "data")
    folder = tmp_path / "notebooks"
    folder.mkdir()
    notebook = nbformat.read(file, as_version=4)
    run(notebook, folder)
    assert faults(notebook) == []
    assert list(folder.iterdir()) == []


@by_name
def test_a_notebook_is_stored_small_and_without_traces(file):
    """Cells were run in their order, pictures are small, and nothing tells of a machine."""
    text = file.read_text("utf-8")
    notebook = nbformat.reads(text, as_version=4)
    nbformat.validate(notebook)
    assert faults(notebook) == []
    code = [cell for cell in notebook.cells if cell.cell_type == "code"]
    assert [cell.execution_count for cell in code] == list(range(1, len(code) + 1))
    assert all(not cell.metadata for cell in notebook.cells)
    assert set(notebook.metadata) == {"kernelspec", "language_info"}
    assert re.match(r"# \S.*\n\n\S", notebook.cells[0].source), "a title and an introduction"
    data = [output.get("data", {}) for cell in code for output in outputs(cell)]
    sizes = [len(base64.b64decode(one[kind])) for one in data for kind in PICTURES if kind in one]
    assert 0 < max(sizes) < 100_000
    assert len(text) < 400_000
    assert str(ROOT) not in text
    assert "/tmp/" not in text
    assert f"notebooks/{file.name}" in (ROOT / "docs" / "examples.md").read_text("utf-8")
