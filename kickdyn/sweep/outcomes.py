"""The rows of a sweep, many at once: kernels for the impact, `fly_many` for the flight."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from kickdyn.ball import BallState
from kickdyn.checks import Array
from kickdyn.errors import KickdynError
from kickdyn.leg import Leg
from kickdyn.sweep.grid import Grid
from kickdyn.sweep.kick import STATUSES, Kick, kick_from
from kickdyn.sweep.run import VARIABLES, numbers
from kickdyn.sweep.scene import scene_of

AGREEMENT = 1e-9
"""What a kernel may differ from `kick_from`, relatively, before the sweep stops."""

_CHECKED = ("effective_mass", "impulse", "ball_speed", "worst_joint_impulse", "speed_use")


class Outcomes:
    """What every posture of a grid makes of a kick, by ranges of postures; safe in threads.

    Where there is no kernel (a floating base, supports, loops, wind that changes with height) every
    posture is one `kick_from`, thousands of times slower.

    Args:
        leg: the leg.
        grid: the postures, the last axis running fastest.
        kick: what they share.
    """

    def __init__(self, leg: Leg, grid: Grid, kick: Kick) -> None:
        self._leg, self._grid, self._kick = leg, grid, kick
        windy = kick.air is not None and callable(kick.air.wind)
        scene = None if windy else scene_of(leg, kick)
        self._scene = scene
        if scene is not None:
            from kickdyn.sweep.kernels import Kernel

            joints = [1 + leg.joint_names.index(name) for name in grid.axes]
            values = list(grid.axes.values())
            self._kernel = Kernel(scene, joints, values, np.zeros(leg.nv), kick.ball.mass)

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
        from kickdyn.flight.batch import fly_many
        from kickdyn.sweep.kernels import DOUBT, GIVE, LOST, MOMENTUM, RESTITUTION, USE, WORST

        kick, ball, scene = self._kick, self._kick.ball, self._scene
        assert scene is not None
        found = self._kernel(first, len(status))
        n, p = kick.direction, np.ascontiguousarray((scene.axes @ found[:3]).T)
        velocity = p / ball.mass
        spin = np.cross(p, n) * (ball.radius / ball.inertia)
        size = np.sqrt(np.einsum("ij,ij->i", p, p))
        doubt = (found[DOUBT] != 0.0) | ~np.isfinite(found).all(axis=0)
        sure = np.flatnonzero(~doubt)
        still = np.zeros((len(sure), 3))
        flown = fly_many(BallState(still, velocity[sure], spin[sure], still[:, 0]), ball, kick.air)
        carry = np.full(len(status), np.nan)
        carry[sure] = flown.range.values
        doubt[sure[flown.status.values != 0]] = True
        mass = 1.0 / np.where(doubt, 1.0, found[GIVE])
        columns = {
            "effective_mass": mass,
            "impulse": size,
            "immovable_impulse": (1.0 + kick.restitution) * kick.speed * mass,
            "ball_speed": size / ball.mass,
            "speed_ratio": size / ball.mass / kick.speed,
            "launch_angle": np.arctan2(velocity[:, 2], np.hypot(velocity[:, 0], velocity[:, 1])),
            "back_spin": 0.0 - spin[:, 1],
            "worst_joint_impulse": found[WORST],
            "energy_lost": found[LOST],
            "speed_use": found[USE],
            "carry": carry,
            "restitution_residual": found[RESTITUTION],
            "momentum_residual": found[MOMENTUM],
        }
        for row, name in zip(rows, VARIABLES, strict=True):
            row[:] = columns[name]
        status[:] = found[USE] > 1.0
        return np.asarray(doubt)

    def _one(self, number: int) -> tuple[Array, int]:
        outcome = kick_from(
            self._leg.posture(self._grid.configuration(self._leg, number)), self._kick
        )
        row = np.array(list(numbers(outcome, self._kick).values()))
        return row, STATUSES.index(outcome.status)

    def _verify(self, first: int, i: int, rows: Array) -> None:
        row, _ = self._one(first + i)
        for k, name in enumerate(VARIABLES):
            if name in _CHECKED and not abs(rows[k, i] - row[k]) <= AGREEMENT * abs(row[k]):
                raise KickdynError(
                    f"posture {first + i}: the kernel has {name} {rows[k, i]!r}, strike {row[k]!r}"
                )
