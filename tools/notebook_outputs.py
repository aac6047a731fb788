"""Run the notebooks and store their outputs, small enough for a code host to show.

    python tools/notebook_outputs.py [NOTEBOOK...]

The outputs are for readers: tests run the notebooks, and do not compare what is stored.
"""

import base64
import html
import io
import re
import sys
import tempfile
from pathlib import Path

import nbformat
from nbclient import NotebookClient
from nbclient.output_widget import OutputWidget
from PIL import Image

from kickdyn.view.document import save_picture

ROOT = Path(__file__).resolve().parent.parent
NOTEBOOKS = sorted((ROOT / "notebooks").glob("*.ipynb"))

WIDGET = "application/vnd.jupyter.widget-view+json"
LIVE_VIEW = '<iframe src="http://127.0.0.1:'
PICTURES = ("image/png", "image/jpeg")


class _Output(OutputWidget):
    """An output of `interact` that keeps what it gets, without sending it back to the kernel.

    A message sent while the client waits for the reply of a cell can hide that reply until the
    client's time limit has passed.
    """

    def sync_state(self):
        """Send nothing: no notebook reads its outputs."""


def run(notebook, folder):
    """Run a notebook in a folder."""
    client = NotebookClient(
        notebook,
        timeout=3600,
        resources={"metadata": {"path": folder}},
    )
    client.widget_registry["@jupyter-widgets/output"]["OutputModel"] = _Output
    client.execute()


def outputs(cell):
    """Return the outputs of a cell, those of one stream together, without sliders and live views.

    They need a running kernel: a code host shows nothing of them.
    """
    kept = []
    for output in cell.get("outputs", []):
        data = output.get("data", {})
        if WIDGET in data or data.get("text/html", "").startswith(LIVE_VIEW):
            continue
        if output.output_type == "stream" and kept and kept[-1].get("name") == output.name:
            kept[-1].text += output.text
        else:
            kept.append(output.copy())
    return kept


def is_page(data):
    """Return whether the data of an output are those of a 3-D page."""
    return data.get("text/html", "").startswith("<iframe srcdoc=")


def _small_png(picture):
    """Return a PNG of 256 colours at most."""
    file = io.BytesIO()
    Image.open(io.BytesIO(picture)).convert("RGB").quantize(256).save(file, "png", optimize=True)
    return file.getvalue()


def _picture_of_page(page):
    """Return the picture of a page, which a code host shows in its place."""
    source = html.unescape(re.match(r'<iframe srcdoc="(.*?)" sandbox', page, re.DOTALL)[1])
    with tempfile.TemporaryDirectory() as folder:
        png = Path(folder) / "page.png"
        save_picture(source, png)
        file = io.BytesIO()
        Image.open(png).convert("RGB").resize((960, 540)).save(file, "jpeg", quality=85)
    return file.getvalue()


def _as_text(picture):
    """Return a picture as a notebook stores it."""
    return base64.b64encode(picture).decode() + "\n"


def store(file):
    """Run a notebook and write it with its outputs."""
    notebook = nbformat.read(file, as_version=4)
    run(notebook, file.parent)
    for cell in notebook.cells:
        cell.metadata.clear()
        if cell.cell_type != "code":
            continue
        cell.outputs = outputs(cell)
        for output in cell.outputs:
            data = output.get("data", {})
            if is_page(data):
                data["image/jpeg"] = _as_text(_picture_of_page(data.pop("text/html")))
            if "image/png" in data:
                data["image/png"] = _as_text(_small_png(base64.b64decode(data["image/png"])))
    notebook.metadata = {
        "kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"},
        "language_info": {"name": "python"},
    }
    nbformat.write(notebook, file)


if __name__ == "__main__":
    for each in [Path(name).resolve() for name in sys.argv[1:]] or NOTEBOOKS:
        store(each)
        print(f"{each.name}: {each.stat().st_size / 1000:.0f} kB")
