"""The picture of a measured motion: joint angles and speeds around the contact."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from kickdyn.core.plot_style import COLUMN_WIDTH, styled

DRAWN_TIMES = 200
"""Number of times that are drawn in each part of the motion."""


@styled()
def leg_motion_figure(
    motion: Any, joints: Sequence[str], spans: Sequence[tuple[float, float]]
) -> Figure:
    """Draw angles and speeds of joints of a `LegMotion` in spans of time, with 1.96 deviations."""
    figure = Figure(figsize=(COLUMN_WIDTH, 4.2))
    angles, speeds = figure.subplots(2, 1, sharex=True)
    zero, model = motion.contact.time if motion.contact else 0.0, motion.leg.workspace.model
    numbers = [model.getJointId(name) for name in joints]
    places, columns = ([of[i] for i in numbers] for of in (model.idx_qs, model.idx_vs))
    for begin, end in spans:
        t = np.linspace(begin, end, DRAWN_TIMES)
        q, v = (np.array([of(x) for x in t]) for of in (motion.q, motion.v))
        spread = np.array([motion.deviations(x) for x in t])[:, :, columns]
        for axes, values, sigma in (
            (angles, np.degrees(q[:, places]), np.degrees(spread[:, 0])),
            (speeds, v[:, columns], spread[:, 1]),
        ):
            axes.set_prop_cycle(None)
            for k, name in enumerate(joints):
                labelled = axes is angles and (begin, end) == spans[0]
                label = name.replace("$", r"\$") if labelled else None  # "$" begins a formula
                (line,) = axes.plot(1e3 * (t - zero), values[:, k], label=label, linewidth=1.2)
                low, high = values[:, k] - 1.96 * sigma[:, k], values[:, k] + 1.96 * sigma[:, k]
                axes.fill_between(1e3 * (t - zero), low, high, color=line.get_color(), alpha=0.25)
    angles.set_ylabel("angle [deg]")
    speeds.set(ylabel="speed [rad/s]", xlabel="time [ms]")
    if motion.contact is not None:
        speeds.set_xlabel("time from the contact [ms]")
        for axes in (angles, speeds):
            axes.axvline(0.0, color="0.6", linewidth=1, linestyle=":")
    figure.legend(loc="outside upper center", ncols=3)
    return figure
