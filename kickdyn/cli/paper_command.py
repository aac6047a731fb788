"""The command `kickdyn paper`: the paper's tables and figures, item by item."""

from itertools import chain

import click

from kickdyn.cli.commands import busy
from kickdyn.cli.option_groups import JsonOptions, command
from kickdyn.paper.item import Item
from kickdyn.paper.reproduce import chosen, show


@command("paper")
@click.option("--only", metavar="ITEM",
              help="Show one table or figure only, such as table2 or fig10.")  # fmt: skip
def paper(only: str | None, output: JsonOptions) -> None:
    """Reproduce the ICRA 2005 paper's tables and figures, item by item.

    The file of --json also has the items with other drag and lift coefficients.

    Example: kickdyn paper --only fig8 --json fig8.json
    """
    sections = chosen(only)
    output.check()
    items: dict[str, list[Item]] = {}
    varied: list[Item] = []  # with other coefficients
    with busy("reproducing") as report:
        for section in sections:
            report(f"reproducing {section.name}")
            items[section.name], varying = section.compare()
            varied += varying
    output.write_json([item.as_json() for item in chain(*items.values(), varied)])
    if output.prints:
        show(items)
    output.name_written()
