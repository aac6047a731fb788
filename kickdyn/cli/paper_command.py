"""The command `kickdyn paper`: the paper's tables and figures, item by item."""

import re
from itertools import chain
from pathlib import Path

import click
from matplotlib.figure import Figure

from kickdyn.cli.command import Command, busy, offers
from kickdyn.cli.option_groups import JsonOptions, takes
from kickdyn.core.files import check_outputs
from kickdyn.core.plot_style import save_figure, styled
from kickdyn.errors import InvalidInput
from kickdyn.paper.item import Item
from kickdyn.paper.reproduce import chosen, item_names, show


@click.command("paper", Command)
@click.option("--only", metavar="ITEM", shell_complete=offers(lambda _: item_names()),
              help="Show one table or figure only, such as table2 or fig10.")  # fmt: skip
@takes(output=JsonOptions)
@click.option("--figures", metavar="DIR", type=click.Path(),
              help="Write the figures to a folder, which is created.")  # fmt: skip
@click.option("--sensitivity/--no-sensitivity", default=True, show_default=True,
              help="Repeat the items with other drag and lift coefficients.")  # fmt: skip
def paper(only: str | None, output: JsonOptions, figures: str | None, sensitivity: bool) -> None:
    """Reproduce the ICRA 2005 paper's tables and figures, item by item.

    Example: kickdyn paper --only fig8 --figures build/paper
    """
    sections = chosen(only)
    drawings = {}
    if figures is not None:
        for section in sections:
            name = re.sub(r"\W+", "_", section.name.lower())
            if section.draw:
                drawings[Path(figures) / f"{name}.png"] = section.draw
        if not drawings:
            raise InvalidInput(f"--figures is {figures!r}: {only} has no figure")
        check_outputs(json_file=output.json_file)
        try:
            Path(figures).mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InvalidInput(f"{figures} cannot be created ({error.strerror})") from None
    output.check(*map(str, drawings))
    items: dict[str, list[Item]] = {}
    varied: dict[str, list[Item]] = {}  # with other coefficients
    with busy("reproducing") as report:
        for section in sections:
            report(f"reproducing {section.name}")
            items[section.name], varying = section.compare()
            if sensitivity and varying:
                varied[section.name] = varying
        for file, draw in drawings.items():
            report(f"drawing {file.name}")
            with styled():
                figure = Figure(figsize=(9, 5))
                draw(figure)
            save_figure(figure, file)
    output.write_json([item.as_json() for item in chain(*items.values(), *varied.values())])
    if output.prints:
        show(items, varied)
    output.name_written(*drawings)
