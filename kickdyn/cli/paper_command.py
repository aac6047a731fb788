"""The command `kickdyn paper`: the paper's tables and figures, item by item."""

import re
from collections.abc import Callable
from itertools import chain
from pathlib import Path

import click
from matplotlib.figure import Figure

from kickdyn.cli.command import Command, busy, check_files, offers
from kickdyn.core.files import check_outputs, write_json
from kickdyn.core.plot_style import save_figure, styled
from kickdyn.errors import InvalidInput
from kickdyn.paper.item import Item
from kickdyn.paper.paper_report import show
from kickdyn.paper.reproduce import Section, chosen, item_names


@click.command("paper", Command)
@click.option("--only", metavar="ITEM", shell_complete=offers(lambda _: item_names()),
              help="Show one table or figure only, such as table2 or fig10.")  # fmt: skip
@click.option("--json", "json_file", metavar="FILE", help="Write all items as JSON; - is stdout.")
@click.option("--figures", metavar="DIR", help="Write the figures to a folder, which is created.")
@click.option("--sensitivity/--no-sensitivity", default=True, show_default=True,
              help="Repeat the items with other drag and lift coefficients.")  # fmt: skip
def paper(
    only: str | None,
    json_file: str | None,
    figures: str | None,
    sensitivity: bool,
) -> None:
    """Reproduce the ICRA 2005 paper's tables and figures, item by item.

    Example: kickdyn paper --only fig8 --figures build/paper
    """
    sections = chosen(only)
    drawings = {}
    if figures is not None:
        drawings = {_file(section, figures): section.draw for section in sections if section.draw}
        if not drawings:
            raise InvalidInput(f"--figures is {figures!r}: {only} has no figure")
        check_outputs(json_file=json_file)
        try:
            Path(figures).mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InvalidInput(f"{figures} cannot be created ({error.strerror})") from None
    check_files(*drawings, json_file=json_file)
    items: dict[str, list[Item]] = {}
    others: dict[str, list[Item]] = {}
    with busy("reproducing") as report:
        for section in sections:
            report(f"reproducing {section.name}")
            items[section.name], varying = section.compare()
            if sensitivity and varying:
                others[section.name] = varying
        for file, draw in drawings.items():
            report(f"drawing {file.name}")
            save_figure(_figure(draw), file)
    if json_file is not None:
        every = chain(*items.values(), *others.values())
        write_json(json_file, [item.as_json() for item in every])
    if json_file != "-":
        show(items, others)
        for written in drawings:
            click.echo(f"wrote {written}")


def _file(section: Section, folder: str) -> Path:
    """Return the file that a figure is drawn into."""
    name = re.sub(r"\W+", "_", (section.also or section.name).lower())
    return Path(folder) / f"{name}.png"


@styled()
def _figure(draw: Callable[[Figure], None]) -> Figure:
    """Return a figure, drawn."""
    figure = Figure(figsize=(9, 5))
    draw(figure)
    return figure
