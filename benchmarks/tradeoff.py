"""Print the error and the computing time of methods for impact and flight, and plot them.

    python benchmarks/tradeoff.py [PLOT.png]

It takes about a minute. MuJoCo is measured where it is installed.
"""

import sys
from collections.abc import Sequence

from flight_methods import measure_flights
from impact_methods import measure_impacts
from measurement import Measurement, front_figure
from rich.console import Console

from kickdyn.core.representation import empty_table, screen_width

TITLES = {
    "impact": "Impulse in posture a of Table 2 at 10 m/s; reference of 50 digits; *: Pareto front",
    "flight": "Landing points of 6 kicks, error in m; reference of 20 digits; *: Pareto front",
}


def print_table(title: str, rows: Sequence[Measurement]) -> None:
    """Print measurements, by scene."""
    table = empty_table(title)
    for head in ("method", "setting", "error", "calls", "time\n\\[us]", "times the\nfastest", ""):
        table.add_column(head, justify="left" if head in ("method", "setting") else "right")
    for row in rows:
        same = [other for other in rows if other.scene == row.scene]
        if row is same[0]:
            table.add_row(f"[bold]{row.scene}[/]")
        table.add_row(
            row.method,
            row.setting,
            f"{row.error:.1e}",
            "" if row.calls is None else f"{row.calls:.0f}",
            f"{1e6 * row.seconds:.4g}",
            f"{row.seconds / min(other.seconds for other in same):.3g}",
            "*" if row.pareto else "",
            end_section=row is same[-1],
        )
    Console(highlight=False, width=screen_width()).print(table)


def main() -> None:
    """Measure, print and plot."""
    rows = {"impact": measure_impacts(), "flight": measure_flights()}
    for kind, title in TITLES.items():
        print_table(title, rows[kind])
    for plot in sys.argv[1:]:
        front_figure(rows["impact"], rows["flight"]).savefig(plot)


if __name__ == "__main__":
    main()
