"""Write the tables of docs/reference that are made from the code.

    python docs/reference_tables.py

A page keeps its own text; what stands between two marks of one name is written anew.
"""

import re
from collections.abc import Iterable
from itertools import takewhile
from pathlib import Path

from kickdyn.core.files import shipped
from kickdyn.ground import SURFACES
from kickdyn.scene.schema import GOES_WITH, NEEDED, ONE_OF, REQUIRED, SECTIONS
from kickdyn.sweeps.dataset import VARIABLES

FOLDER = Path(__file__).resolve().parent / "reference"


def table(heads: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    """Return a table in Markdown."""
    heads = list(heads)
    lines = [heads, ["---"] * len(heads), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def listed(keys: Iterable[str], last: str) -> str:
    """Return keys as code, with a word before the last one."""
    *first, end = (f"`{key}`" for key in keys)
    return f"{', '.join(first)} {last} {end}" if first else end


def conditions(section: str) -> str:
    """Return the sentences on the keys that a section must have."""
    lines = []
    if section in ONE_OF:
        lines.append(f"Exactly one of {listed(ONE_OF[section], 'and')} is required.")
    if section in NEEDED:
        verb = "are" if len(NEEDED[section]) > 1 else "is"
        lines.append(f"{listed(NEEDED[section], 'and')} {verb} required.")
    lines += [
        f"`{key}` goes with `{other}` only." for key, other in GOES_WITH.get(section, {}).items()
    ]
    return " ".join(lines)


def scene_keys() -> str:
    """Return the sections of a scene file with their keys."""
    blocks = []
    for section, keys in SECTIONS.items():
        rows = [[f"`{key}`", kind.takes, meaning] for key, (kind, meaning) in keys.items()]
        needed = "required" if section in REQUIRED else "optional"
        title = f"## [{section}]\n\nThis section is {needed}." if section else "## Top of the file"
        blocks.append(f"{title} {conditions(section)}".rstrip())
        blocks.append(table(("key", "value", "meaning"), rows))
    return "\n\n".join(blocks)


def variables() -> str:
    """Return the variables of the dataset of a sweep."""
    rows = [[f"`{name}`", unit, meaning] for name, (unit, meaning) in VARIABLES.items()]
    rows.append(["`status`", "flag", "whether the leg can perform the kick"])
    return table(("variable", "unit", "meaning"), rows)


def surfaces() -> str:
    """Return the surfaces that have a name."""
    heads = ("surface", "restitution", "friction", "rolling deceleration [m/s2]", "source")
    rows = (
        [
            f"`{name}`",
            f"{surface.restitution:g}",
            f"{surface.friction:g}",
            f"{surface.rolling_deceleration:g}",
            surface.source,
        ]
        for name, surface in SURFACES.items()
    )
    return table(heads, rows)


def scenes() -> str:
    """Return the scenes that are installed with kickdyn, and the comments with which they begin."""
    rows = []
    for file in sorted(shipped("scenes").glob("*.toml")):
        comment = takewhile(lambda line: line.startswith("#"), file.read_text("utf-8").splitlines())
        rows.append([f"`{file.stem}`", " ".join(line.strip("# ") for line in comment)])
    return table(("scene", "content"), rows)


PAGES = {
    "scene-file.md": {"scenes": scenes, "keys": scene_keys, "surfaces": surfaces},
    "dataset.md": {"variables": variables},
}
"""By page, the marks and what stands between two of them."""


def current(page: str) -> str:
    """Return the text of a page, with its tables written anew."""
    text = (FOLDER / page).read_text(encoding="utf-8")
    for name, block in PAGES[page].items():
        mark = f"<!-- {name} -->"
        text, found = re.subn(
            f"{mark}\n.*?{mark}",
            lambda _, m=mark, b=block: f"{m}\n\n{b()}\n\n{m}",
            text,
            flags=re.S,
        )
        if found != 1:
            raise RuntimeError(f"{page} has no place for {name}")
    return text


if __name__ == "__main__":
    for page in PAGES:
        (FOLDER / page).write_text(current(page), encoding="utf-8")
