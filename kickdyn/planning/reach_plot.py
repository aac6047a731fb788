"""The figure of a robot's reach: launch speeds and distances by elevation."""

from typing import Any

from matplotlib.figure import Figure

from kickdyn.core.plot_style import styled


@styled()
def reach_figure(table: Any) -> Figure:
    """Draw the speeds of a `ReachTable`, and the distances on carpet and turf, by elevation."""
    figure = Figure(figsize=(7.5, 6.5))
    speeds, distances = figure.subplots(2, 1, sharex=True)
    for number, side in enumerate(dict.fromkeys(row.azimuth for row in table.rows)):
        rows = sorted(
            (row for row in table.rows if row.azimuth == side), key=lambda row: row.elevation
        )
        angles, colour = [row.elevation for row in rows], f"C{number}"
        speeds.plot(
            angles, [row.speed for row in rows], "o-", color=colour, label=f"azimuth {side:g} deg"
        )
        for name, line in (("carpet", "o-"), ("turf", "s--")):
            lengths = [getattr(row, name) for row in rows]
            distances.plot(angles, lengths, line, color=colour, label=name if number == 0 else None)
    speeds.set(ylabel="largest launch speed [m/s]")
    distances.set(xlabel="elevation [deg]", ylabel="distance until the ball rests [m]")
    for axes in (speeds, distances):
        axes.set_ylim(bottom=0.0)
        axes.legend()
    limits = "within the limits of the motion" if table.motion else "within those of the impact"
    figure.suptitle(f"{table.robot}: {limits}".replace("$", r"\$"))
    return figure
