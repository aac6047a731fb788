"""What the pages have from the code, from references.bib and from validation.csv.

    python docs/reference_tables.py reference/scene-file

prints a page with its tables. `make docs` inserts them in the site. A mark such as `<!-- keys -->`
is the place of a table in a page, and a block `{api}` lists names whose docstrings are shown.
"""

import csv
import inspect
import pkgutil
import re
import sys
import tomllib
from collections.abc import Iterable
from itertools import takewhile
from pathlib import Path

from kickdyn.aerodynamics import drag, lift, spin_decay
from kickdyn.cli.commands import COMMANDS
from kickdyn.core.files import shipped
from kickdyn.ground import SURFACES
from kickdyn.paper.item import MEANINGS
from kickdyn.restitution import format_restitution
from kickdyn.scene.scene_tables import TABLES, Table, quoted
from kickdyn.sweeps.dataset import VARIABLES

DOCS = Path(__file__).resolve().parent


def table(heads: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    """Return a table in Markdown."""
    heads = list(heads)
    lines = [heads, ["---"] * len(heads), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def listed(keys: Iterable[str], last: str) -> str:
    """Return keys as code, with a word before the last one."""
    *first, end = (f"`{key}`" for key in keys)
    return f"{', '.join(first)} {last} {end}" if first else end


def conditions(table_of_file: Table) -> str:
    """Return the sentences on the keys that a table must have."""
    alternatives = [group for group in table_of_file.required if len(group) > 1]
    needed = [name for group in table_of_file.required if len(group) == 1 for name in group]
    lines = [f"Exactly one of {listed(group, 'and')} is required." for group in alternatives]
    if needed:
        lines.append(f"{listed(needed, 'and')} {'are' if len(needed) > 1 else 'is'} required.")
    lines += [
        f"`{key.name}` goes with {listed(key.needs, 'or')} only."
        for key in table_of_file.keys
        if key.needs
    ]
    return " ".join(lines)


def scene_keys() -> str:
    """Return the tables of a scene file with their keys."""
    blocks = []
    for part in TABLES:
        rows = [
            [
                f"`{key.name}`",
                key.takes if isinstance(key.takes, str) else quoted(key.takes),
                key.meaning,
            ]
            for key in part.keys
        ]
        needed = "required" if part.is_required else "optional"
        title = (
            f"## [{part.name}]\n\nThis section is {needed}." if part.name else "## Top of the file"
        )
        blocks.append(f"{title} {conditions(part)}".rstrip())
        blocks.append(table(("key", "value", "meaning"), rows))
    return "\n\n".join(blocks)


GUIDES = {
    "check": "[your own robot](../how-to/own-robot.md)",
    "check-motion": "[recorded motions](../how-to/recorded-motions.md)",
    "posture-sweep": "[sweeps](../how-to/sweeps.md)",
    "plan": "[planning](../explanation/planning.md)",
    "reach": "[standing](../explanation/standing.md#reach)",
    "kick-library": "[a kick in milliseconds](../how-to/kick-library.md)",
    "paper": "[the paper](../explanation/paper.md)",
    "tradeoff": "[which function](../how-to/which-function.md)",
    "simulate": "[tolerance](../how-to/tolerance.md)",
    "tune-mujoco": "[MuJoCo](../how-to/mujoco.md)",
    "identify": "[ball tracks](../how-to/identification.md)",
    "view": "[pages](../how-to/pages.md)",
}
"""The page that explains each command."""


def commands() -> str:
    """Return the commands with their summaries and guides."""
    rows = ([f"`kickdyn {name}`", text, GUIDES[name]] for name, (_, text) in COMMANDS.items())
    return table(("command", "purpose", "guide"), rows)


def options() -> str:
    """Return the directives of sphinx-click for all commands."""
    blocks = (
        f".. click:: kickdyn.cli.{file}:{name.replace('-', '_')}\n   :prog: kickdyn {name}"
        for name, (file, _) in COMMANDS.items()
    )
    return "```{eval-rst}\n" + "\n\n".join(blocks) + "\n```"


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
            format_restitution(surface.restitution),
            f"{surface.friction:g}",
            f"{surface.rolling_deceleration:g}",
            surface.source,
        ]
        for name, surface in SURFACES.items()
    )
    return table(heads, rows)


def scenes() -> str:
    """Return the installed scenes with the first sentences of their files."""
    rows = []
    for file in sorted(shipped("scenes").glob("*.toml")):
        comment = takewhile(lambda line: line.startswith("#"), file.read_text("utf-8").splitlines())
        sentence = " ".join(line.strip("# ") for line in comment).split(". ")[0].split(": `")[0]
        rows.append([f"`{file.stem}`", sentence.removesuffix(".")])
    return table(("scene", "content"), rows)


def references() -> str:
    """Return the references of `docs/references.bib`, by author."""
    text = (DOCS / "references.bib").read_text(encoding="utf-8")
    lines = []
    for entry in re.findall(r"^@\w+\{\w+,\n(.*?)\n\}", text, re.DOTALL | re.MULTILINE):
        has = dict(re.findall(r"^  (\w+) = \{(.*)\},$", entry, re.MULTILINE))
        names = ", ".join(name.split(",")[0] for name in has["author"].split(" and "))
        kinds = ("journal", "booktitle", "publisher", "howpublished", "volume")
        place = " ".join(has[kind] for kind in kinds if kind in has)
        pages = has.get("pages", "").replace("-", "\N{EN DASH}")
        link = f"https://doi.org/{has['doi']}" if "doi" in has else has.get("url")
        lines.append(
            f"- {names} ({has['year']}): *{has['title']}*."
            + (f" {', '.join(filter(None, [place, pages]))}." if place else "")
            + (f" <{link}>" if link else "")
        )
    return "\n".join(sorted(lines))


def drives() -> str:
    """Return the drives of robots by name, with the comments and sources of their files."""
    rows = []
    for file in sorted(shipped("drives").glob("*.toml")):
        text = file.read_text("utf-8")
        content = tomllib.loads(text)
        joints = {}
        for joint, drive in content["joints"].items():
            rotor, gear = drive["rotor_inertia_kg_m2"], drive.get("gear", 1)
            size = f"{rotor * gear**2:.4g}" + (
                f" ({rotor:g} behind {gear:g}:1)" if gear > 1 else ""
            )
            if "torque_limit_n_m" in drive:
                size += f", torque limit {drive['torque_limit_n_m']:g} N m"
            joints.setdefault(size, []).append(f"`{joint}`")
        inertias = "; ".join(f"{', '.join(names)} {size}" for size, names in joints.items())
        comment = " ".join(
            line.strip("# ") for line in takewhile(lambda line: line[:1] == "#", text.splitlines())
        )
        rows.append([file.stem, inertias or "none", comment, content["source"]])
    return table(("robot", "reflected inertia J n² [kg m²]", "notes", "source"), rows)


def coefficients() -> str:
    """Return the models of drag, lift and spin decay with their ranges and sources."""
    models = [*drag.MODELS.values(), *lift.MODELS.values(), *spin_decay.MODELS.values()]
    rows = (
        [
            f"{model.kind} `{model.name}`",
            *(f"{low:.3g} to {high:.3g}" for low, high in (model.reynolds, model.spin)),
            model.source,
        ]
        for model in models
    )
    return table(("model", "Re", "spin parameter", "source"), rows)


def verdicts() -> str:
    """Return the verdicts of `kickdyn paper` with their meanings."""
    return table(("verdict", "meaning"), ([f"`{name}`", text] for name, text in MEANINGS.items()))


def measurements() -> str:
    """Return the comparisons of `docs/explanation/validation.csv`, without their assumptions."""
    text = (DOCS / "explanation" / "validation.csv").read_text(encoding="utf-8")
    _, *rows = csv.reader(text.splitlines())
    cells = ([*row[:4], re.sub("partly|disagrees", r"**\g<0>**", row[4])] for row in rows)
    return table(("", "quantity", "measured", "kickdyn", "verdict"), cells)


PAGES = {
    "reference/commands": {"commands": commands, "options": options},
    "reference/bibliography": {"references": references},
    "reference/scene-file": {"scenes": scenes, "keys": scene_keys, "surfaces": surfaces},
    "reference/dataset": {"variables": variables},
    "explanation/paper": {"verdicts": verdicts},
    "explanation/robots": {"drives": drives},
    "explanation/theory": {"coefficients": coefficients},
    "explanation/validation": {"measurements": measurements},
}
"""By page, the marks and the functions that return their tables."""


OPTIONS = {
    "Leg": ("inherited-members:",),
    "Posture": ("inherited-members: ReprMixin",),
    "Impact": ("inherited-members: ReprMixin",),
    "Collision": ("inherited-members: ReprMixin",),
    "Launch": ("show-inheritance:",),
    "Pass": ("show-inheritance:",),
    "impact.laws.LAWS": ("no-value:",),
    "paper.assumptions.DEFAULT": ("no-value:",),
    "paper.assumptions.LIFT_WITHOUT_CRISIS": ("no-value:",),
}
"""Options of autodoc for names of the API; classes and modules also have `members`."""


def docstring_of(name: str) -> str:
    """Return the directive of autodoc for a name below `kickdyn`."""
    value = pkgutil.resolve_name(f"kickdyn:{name}" if "." not in name else f"kickdyn.{name}")
    options = [*OPTIONS.get(name, ())]
    if inspect.ismodule(value):
        kind = "module"
    elif inspect.isclass(value):
        kind = "exception" if issubclass(value, Exception) else "class"
    else:
        kind = "function" if inspect.isfunction(value) else "data"
    named_tuple = kind == "class" and issubclass(value, tuple)  # its docstring has its members
    if kind in ("module", "class") and not named_tuple:
        options.insert(0, "members:")
    return "\n".join([f".. auto{kind}:: kickdyn.{name}", *(f"   :{line}" for line in options)])


def docstrings(names: str) -> str:
    """Return the directives of autodoc for names, one a line."""
    blocks = "\n\n".join(map(docstring_of, names.split()))
    return f"```{{eval-rst}}\n{blocks}\n```"


def with_tables(page: str, text: str) -> str:
    """Return the text of a page with its tables in place of the marks, and with docstrings."""
    for name, block in PAGES.get(page, {}).items():
        mark = f"<!-- {name} -->"
        if text.count(mark) != 1:
            raise RuntimeError(f"{page}.md must have {mark} once")
        text = text.replace(mark, block())
    return re.sub(r"```\{api\}\n(.*?)```", lambda block: docstrings(block[1]), text, flags=re.S)


def read(page: str) -> str:
    """Return a page with its tables."""
    return with_tables(page, (DOCS / f"{page}.md").read_text(encoding="utf-8"))


if __name__ == "__main__":
    print("\n".join(map(read, sys.argv[1:])))
