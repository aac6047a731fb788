"""The command `kickdyn paper`: the paper's tables and figures, item by item."""

from itertools import chain

import click

from kickdyn.cli.command import Command, busy
from kickdyn.cli.option_groups import JsonOptions, takes
from kickdyn.paper.item import Item
from kickdyn.paper.reproduce import chosen, show


@click.command("paper", Command)
@click.option("--only", metavar="ITEM",
              help="Show one table or figure only, such as table2 or fig10.")  # fmt: skip
@takes(output=JsonOptions)
@click.option("--sensitivity/--no-sensitivity", default=True, show_default=True,
              help="Repeat the items with other drag and lift coefficients.")  # fmt: skip
def paper(only: str | None, output: JsonOptions, sensitivity: bool) -> None:
    """Reproduce the ICRA 2005 paper's tables and figures, item by item.

    Example: kickdyn paper --only fig8 --json fig8.json
    """
    sections = chosen(only)
    output.check()
    items: dict[str, list[Item]] = {}
    varied: dict[str, list[Item]] = {}  # with other coefficients
    with busy("reproducing") as report:
        for section in sections:
            report(f"reproducing {section.name}")
            items[section.name], varying = section.compare()
            if sensitivity and varying:
                varied[section.name] = varying
    output.write_json([item.as_json() for item in chain(*items.values(), *varied.values())])
    if output.prints:
        show(items, varied)
    output.name_written()
