"""The pictures of docs/how-to/pages.md, by the commands and snippets that stand there.

    python benchmarks/gallery.py               # all
    python benchmarks/gallery.py goal motion   # those

Needs Chromium, and the extras `robots` and `motion`.
"""

import re
import shlex
import subprocess
import sys
import tempfile
from pathlib import Path

from matplotlib.image import imread
from PIL import Image

ROOT = Path(__file__).resolve().parent.parent
PAGE = ROOT / "docs" / "how-to" / "pages.md"
IMAGES = ROOT / "docs" / "images"
MOST = 190_000
SCRIPT = "from kickdyn.cli.commands import main; main()"
PICTURE = re.compile(
    r"!\[[^]]*\]\(../images/(gallery-([a-z-]+)\.png)\)\s+```(bash|python)\n(.*?)```", re.S
)


def main(wanted: list[str]) -> None:
    """Make the pictures, each in an empty folder, where its snippet writes `picture.png`."""
    for file, name, kind, text in PICTURE.findall(PAGE.read_text(encoding="utf-8")):
        if wanted and name not in wanted:
            continue
        with tempfile.TemporaryDirectory() as folder:
            for command in _commands(kind, text):
                subprocess.run(command, cwd=folder, check=True, stdout=subprocess.DEVNULL)
            _save(Path(folder) / "picture.png", IMAGES / file)
        print(
            f"{file}: {(IMAGES / file).stat().st_size / 1e3:.0f} kB, {imread(IMAGES / file).shape}"
        )


def _commands(kind: str, text: str) -> list[list[str]]:
    """Return the command lines of a snippet of Python, or of a shell's lines."""
    if kind == "python":
        return [[sys.executable, "-c", text]]
    lines = [shlex.split(line) for line in text.replace("\\\n", " ").splitlines()]
    return [[sys.executable, "-c", SCRIPT, *line[1:]] for line in lines if line]


def _save(picture: Path, file: Path) -> None:
    """Keep a picture at most 1280 wide, and in 256 colours if it takes more than `MOST` bytes."""
    image = Image.open(picture).convert("RGB")
    image.thumbnail((1280, 1280))
    image.save(file, optimize=True)
    if file.stat().st_size > MOST:
        image.quantize(256, Image.Quantize.MAXCOVERAGE).save(file, optimize=True)


if __name__ == "__main__":
    main(sys.argv[1:])
