"""The picture of a swing: what every joint does, from rest through the impact to rest."""

import numpy as np
from matplotlib.figure import Figure

from kickdyn.core.plot_style import styled
from kickdyn.planning.swing import Swing


@styled()
def swing_figure(swing: Swing) -> Figure:
    """Draw speeds and torques over their limits, and powers [W], against time [s].

    The impact is at 0, where speeds jump and torques may.
    """
    chain = swing.chain
    phases, torque = [phase.fine for phase in swing.phases], chain.effort_limit
    figure = Figure(figsize=(9.0, 8.0))
    rows = figure.subplots(3, 1, sharex=True)
    gap = np.full((1, len(swing.joints)), np.nan)  # no line across the impact
    time = np.concatenate([phases[0].time, [0.0], phases[1].time])
    for axes, label, values in (
        (
            rows[0],
            "speed, % of its limit",
            [100 * phase.v / chain.velocity_limit for phase in phases],
        ),
        (rows[1], "torque, % of its limit", [100 * phase.torque / torque for phase in phases]),
        (rows[2], "power [W]", [phase.power for phase in phases]),
    ):
        lines = axes.plot(time, np.vstack([values[0], gap, values[1]]))
        for line, name in zip(lines, swing.joints, strict=True):
            line.set_label(name.replace("$", r"\$"))  # matplotlib reads formulas between dollars
        axes.axvline(0.0, color="0.6", linewidth=1, linestyle=":")
        axes.set_ylabel(label)
        if axes is not rows[2]:
            axes.set_ylim(-105, 105)
    figure.legend(handles=rows[0].lines[: len(swing.joints)], loc="outside lower center", ncols=3)
    rows[2].set_xlabel("time from the impact [s]")
    name = (swing.plan.leg.name or "leg").replace("$", r"\$")
    least = {"torque-squared": "squared torque"}.get(swing.objective, swing.objective)
    figure.suptitle(f"{name}: least {least}, {swing.share:.0%} of the planned speed")
    return figure
