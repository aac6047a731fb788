"""The picture of a motion: torques and speeds against their limits, and margins."""

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from kickdyn.core.plot_style import styled

TIMES = 400
"""Number of times before the impact, and as many after it, that are drawn."""

LINES = 5
"""Number of broken limits that are drawn."""


@styled()
def motion_figure(motion: Any) -> Figure:
    """Draw torques and speeds of a `Motion` over their limits, and margins that are lengths.

    The impact is at 0, where speeds and torques jump.
    """
    robot = motion.robot
    columns = [robot.velocity_index(name) for name in motion.joints]
    torque_limit, speed_limit = robot.effort_limit[columns], robot.velocity_limit[columns]
    before = np.linspace(motion.begin, 0.0, TIMES)
    after = np.linspace(1e-9, motion.end, TIMES)
    times = np.concatenate([before, after])
    torque = np.array([motion.torque(t)[columns] for t in times]) / torque_limit
    speed = np.array([motion.v(t)[columns] for t in times]) / speed_limit
    every = [motion.margins(t) for t in times]
    lengths = [name for name in every[0] if name.endswith(" [m]")]
    figure = Figure(figsize=(9.0, 8.0))
    rows = figure.subplots(3 if lengths else 2, 1, sharex=True)
    for axes, label, values in (
        (rows[0], "torque, % of its limit", torque),
        (rows[1], "speed, % of its limit", speed),
    ):
        axes.plot(before, 100 * values[:TIMES])
        axes.set_prop_cycle(None)
        axes.plot(after, 100 * values[TIMES:])
        axes.set_ylabel(label)
        axes.set_ylim(-105, 105)
    for line, name in zip(rows[0].lines, motion.joints, strict=False):
        line.set_label(name.replace("$", r"\$"))  # matplotlib reads formulas between dollars
    figure.legend(handles=rows[0].lines[: len(columns)], loc="outside lower center", ncols=4)
    if lengths:
        for name in lengths:
            margin = [1e3 * margins[name] for margins in every]
            rows[2].plot(times, margin, label=name.removesuffix(" [m]"))
        rows[2].set_ylabel("margin [mm]")
        rows[2].set_ylim(0, 200)
        rows[2].legend()
    for axes in rows:
        axes.axvline(0.0, color="0.6", linewidth=1, linestyle=":")
    rows[-1].set_xlabel("time from the impact [s]")
    figure.suptitle((robot.name or "leg").replace("$", r"\$"))
    return figure


@styled()
def check_figure(check: Any) -> Figure:
    """Draw launches of a `MotionCheck` over time, the place of the ball, and broken limits."""
    table = check.launches
    time, centre = table.time.values, table.ball_position.values
    figure = Figure(figsize=(9.0, 9.0))
    rows = figure.subplots(4, 1, sharex=True)
    for axes, label, values in (
        (rows[0], "ball speed [m/s]", table.ball_speed.values[:, None]),
        (rows[1], "elevation [deg]", np.degrees(table.elevation.values)[:, None]),
        (rows[2], "centre of the ball [m]", centre[:, :2]),
    ):
        axes.plot(time, values)
        axes.set_ylabel(label)
    rows[2].legend(rows[2].lines, ["x", "y"])
    worst = sorted(check.broken, key=lambda limit: -limit.frames)[:LINES]
    for limit in worst:
        name = limit.name if limit.unit == "1" else f"{limit.name} [{limit.unit}]"
        rows[3].plot(time, check.margins[name], label=name.replace("$", r"\$"))
    rows[3].set_ylabel("margin")
    if worst:
        rows[3].legend()
    for axes in rows:
        if check.best is not None:
            axes.axvline(time[check.best], color="0.6", linewidth=1, linestyle=":")
    rows[3].set_xlabel("time [s]")
    figure.suptitle((check.motion.leg.name or "leg").replace("$", r"\$"))
    return figure
