"""The rows of a sweep, many at once: kernels for the impact; carries are read off, or flown."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from kickdyn.core.validation import Array
from kickdyn.errors import KickdynError
from kickdyn.flight.batch import fly_many
from kickdyn.robot.leg import Leg
from kickdyn.sweeps.carry import Carries, launches
from kickdyn.sweeps.columns import CARRY, fill
from kickdyn.sweeps.grid import Grid
from kickdyn.sweeps.kernel_scene import Scene, scene_of
from kickdyn.sweeps.kernels import NORMAL, TANGENT, Kernel
from kickdyn.sweeps.kick import STATUSES, Kick, kick_from
from kickdyn.sweeps.run import VARIABLES, numbers

AGREEMENT = 1e-9
"""What a kernel may differ from `kick_from`, relatively, before the sweep stops."""

FLOWN = 1e-7
"""What a carry may, beside the error it may have: both are flown to 1e-9."""

_CHECKED = ("effective_mass", "impulse", "ball_speed", "worst_joint_impulse", "speed_use", "carry")


def kernel_scene(leg: Leg, kick: Kick) -> Scene | None:
    """Return what a kernel strikes with; None where there is none."""
    windy = kick.air is not None and callable(kick.air.wind)
    return None if windy else scene_of(leg, kick)


def interpolated(scene: Scene | None, kick: Kick, carry_error: float) -> float:
    """Return the error that carries read off polynomials will have [m]; 0 where balls are flown."""
    readable = scene is not None and scene.planar and kick.air is not None
    return carry_error if readable else 0.0


class Outcomes:
    """What every posture of a grid makes of a kick, by ranges of postures; safe in threads.

    Where there is no kernel (a floating base, supports, loops, wind that changes with height) every
    posture is one `kick_from`, thousands of times slower.

    Args:
        leg: the leg.
        grid: the postures, the last axis running fastest.
        kick: what they share.
        carry_error: how far off a carry may be where it can be read off polynomials, see `Carries`
            [m]; 0 flies every ball, to 1e-9 of the carry.
    """

    def __init__(self, leg: Leg, grid: Grid, kick: Kick, carry_error: float = 0.0) -> None:
        self._leg, self._grid, self._kick = leg, grid, kick
        scene = kernel_scene(leg, kick)
        self._scene, self._carries = scene, None
        if scene is None:
            return
        joints = [1 + leg.joint_names.index(name) for name in grid.axes]
        values = list(grid.axes.values())
        self._kernel = Kernel(scene, joints, values, np.zeros(leg.nv), kick.ball.mass)
        error = interpolated(scene, kick, carry_error)
        if error > 0.0:
            self._carries = Carries(scene, kick, error)

    def __call__(self, first: int, count: int) -> tuple[Array, NDArray[np.int8]]:
        """Return rows, shape `(len(VARIABLES), count)`, and status, of postures from `first` on.

        Raises:
            InvalidInput: what `kick_from` refuses.
            KickdynError: the kernel and `kick_from` disagree.
        """
        rows = np.full((len(VARIABLES), count), np.nan)
        status = np.zeros(count, np.int8)
        if self._scene is None:
            doubt = np.ones(count, bool)
        else:
            doubt = self._kicked(first, rows, status)
            sure = np.flatnonzero(~doubt)
            if sure.size:
                self._verify(first, int(sure[0]), rows)
        for i in np.flatnonzero(doubt).tolist():
            rows[:, i], status[i] = self._one(first + i)
        return rows, status

    def _kicked(self, first: int, rows: Array, status: NDArray[np.int8]) -> NDArray[np.bool_]:
        """Fill in what the kernel knows; return where `kick_from` must."""
        kick, ball, scene = self._kick, self._kick.ball, self._scene
        assert scene is not None
        found = self._kernel(first, len(status))
        doubt, unknown = np.empty(len(status), bool), np.ones(len(status), bool)
        scalars = kick.speed, kick.restitution, ball.mass, ball.radius / ball.inertia
        fill(found, scene.axes, scalars, rows, status, doubt)
        if self._carries is not None:
            self._carries(found[NORMAL], found[TANGENT], rows[CARRY], unknown)
        fly = np.flatnonzero(unknown & ~doubt)
        if fly.size:
            flown = fly_many(launches(scene, kick, found[:3, fly].T), ball, kick.air)
            rows[CARRY, fly] = flown.range.values
            doubt[fly[flown.status.values != 0]] = True
        return doubt

    def _one(self, number: int) -> tuple[Array, int]:
        outcome = kick_from(
            self._leg.posture(self._grid.configuration(self._leg, number)), self._kick
        )
        row = np.array(list(numbers(outcome, self._kick).values()))
        return row, STATUSES.index(outcome.status)

    def _verify(self, first: int, i: int, rows: Array) -> None:
        row, _ = self._one(first + i)
        for k, name in enumerate(VARIABLES):
            slack = (FLOWN if k == CARRY else AGREEMENT) * abs(row[k])
            if k == CARRY:  # a launch that is level but for rounding comes down at once
                slack += self._carries.error if self._carries else 1e-9
            if name in _CHECKED and not abs(rows[k, i] - row[k]) <= slack:
                raise KickdynError(
                    f"posture {first + i}: the sweep has {name} {float(rows[k, i])!r}, a single "
                    f"kick {float(row[k])!r}"
                )
