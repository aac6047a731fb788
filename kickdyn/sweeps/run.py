"""Running a sweep: one kick from every posture of a grid, into a labelled dataset."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.impact.laws import normal_impulse
from kickdyn.robot.leg import Leg
from kickdyn.sweeps.grid import DIGITS, Grid
from kickdyn.sweeps.kick import STATUSES, Kick, Outcome, kick_from
from kickdyn.sweeps.provenance import provenance

VARIABLES = {
    "effective_mass": ("kg", "effective mass of the leg along the normal"),
    "impulse": ("N s", "impulse on the ball"),
    "immovable_impulse": ("N s", "impulse on an obstacle that cannot move, the paper's Table 2"),
    "ball_speed": ("m/s", "speed of the ball after the impact"),
    "speed_ratio": ("1", "ball speed over foot speed"),
    "launch_angle": ("rad", "launch above the horizontal"),
    "back_spin": ("rad/s", "spin of the ball after the impact about -y; negative is top spin"),
    "worst_joint_impulse": ("N s", "largest linear impulse inside a joint"),
    "energy_lost": ("J", "kinetic energy lost in the impact"),
    "speed_use": ("1", "least largest joint speed over its limit that moves the foot so"),
    "carry": ("m", "horizontal distance to where the ball is back at its launch height"),
    "restitution_residual": ("1", "relative error of Newton's restitution"),
    "momentum_residual": ("1", "relative momentum that Newton-Euler cannot account for"),
}
"""Name of every number a sweep gives for a posture, with unit and meaning."""

_SPEED, _OK = list(VARIABLES).index("ball_speed"), STATUSES.index("ok")

KERNEL_FROM = 2000
"""Postures of a grid from which a kernel is used: it saves seconds every time but the first, when
compiling takes 16 s."""


def sweep(
    leg: Leg,
    grid: Grid,
    kick: Kick,
    progress: Callable[[int, tuple[float, int] | None], None] | None = None,
) -> xr.Dataset:
    """Kick from every posture of a grid.

    Args:
        leg: the leg.
        grid: the postures.
        kick: what they share.
        progress: told how many postures more, and of those that are possible the highest ball speed
            [m/s] and its number.

    Returns:
        A dataset with one dimension per joint of the grid [rad or m], the variables of
        `VARIABLES`, and `status`; units and provenance are in the attributes. Where the status is
        `out of reach`, there is no impact and the numbers are nan.
    """
    check_names(grid)
    rows = np.full((len(VARIABLES), grid.size), np.nan)
    status = np.empty(grid.size, dtype=np.int8)

    def see(first: int, found: Array, how: NDArray[np.int8]) -> None:
        part = slice(first, first + len(how))
        rows[:, part], status[part] = found, how
        if progress is not None:
            speed = np.where(how == _OK, found[_SPEED], -np.inf)
            i = int(speed.argmax())
            progress(len(how), (float(speed[i]), first + i) if how[i] == _OK else None)

    if grid.size < KERNEL_FROM:
        for i, q in enumerate(grid.configurations(leg)):
            outcome = kick_from(leg.posture(q), kick)
            see(i, _row(outcome, kick)[:, None], np.array([STATUSES.index(outcome.status)], "i1"))
    else:
        from kickdyn.sweeps.stream import stream  # which stands on this file

        stream(None, leg, grid, kick, carry_error=0.0, see=see)
    return _dataset(leg, grid, kick, rows, status)


def check_names(grid: Grid) -> None:
    """Raise `InvalidInput` where a joint's name would hide a result in the dataset."""
    for name in grid.axes:
        taken = name in VARIABLES or name == "status"
        shadowed = name.endswith("_deg") and name.removesuffix("_deg") in grid.axes
        if taken or shadowed or "/" in name or name.strip(".") == "":
            raise InvalidInput(
                f"joint {name!r} cannot be swept: in the dataset its name is that of a result, "
                "or not a name at all; rename it"
            )


def numbers(outcome: Outcome, kick: Kick) -> dict[str, float]:
    """Return the numbers of `VARIABLES` for one posture."""
    return dict(zip(VARIABLES, _row(outcome, kick).tolist(), strict=True))


def _row(outcome: Outcome, kick: Kick) -> Array:
    hit = outcome.hit
    if hit is None:
        return np.full(len(VARIABLES), np.nan)
    immovable = normal_impulse(hit.approach_speed, kick.restitution, hit.effective_mass)
    return np.array(
        [
            hit.effective_mass,
            math.hypot(*hit.impulse),
            immovable,
            hit.ball_after.speed,
            hit.speed_ratio,
            hit.ball_after.elevation,
            0.0 - hit.ball_after.spin[1],
            hit.worst_joint[1],
            hit.energy_lost,
            outcome.speed_use,
            outcome.carry,
            hit.restitution_residual,
            hit.momentum_residual,
        ]
    )


def _dataset(leg: Leg, grid: Grid, kick: Kick, rows: Array, status: NDArray[np.int8]) -> xr.Dataset:
    dims = tuple(grid.axes)
    data = xr.Dataset(attrs=provenance(leg, kick))
    for name, values in grid.axes.items():
        unit = leg.joint_unit(name)
        data.coords[name] = (name, values, {"units": unit, "long_name": f"{name} joint"})
        if unit == "rad" and " " not in name:  # netCDF takes no coordinate with a space
            angles = np.round(np.degrees(values), DIGITS) + 0.0  # no -0
            data.coords[f"{name}_deg"] = (name, angles, {"units": "deg"})
    for column, (name, (unit, meaning)) in enumerate(VARIABLES.items()):
        attributes = {"units": unit, "long_name": meaning}
        data[name] = (dims, rows[column].reshape(grid.shape), attributes)
    data["status"] = (
        dims,
        status.reshape(grid.shape),
        {
            "long_name": "whether the leg can kick so",
            "flag_values": np.arange(len(STATUSES), dtype=np.int8),
            "flag_meanings": " ".join(name.replace(" ", "_") for name in STATUSES),
        },
    )
    return data
