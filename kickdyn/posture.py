"""A leg at one configuration: what kinematics and inertia say there."""

from __future__ import annotations

import copy
import math
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike
from scipy.linalg import blas, lapack

from kickdyn import checks
from kickdyn.checks import Array
from kickdyn.errors import InvalidInput
from kickdyn.hold import Hold
from kickdyn.sound_model import culprits, listed

if TYPE_CHECKING:
    from kickdyn.constraints import Constraints
    from kickdyn.leg import Leg

MAX_CONDITION = 1e13

MAX_OFFSET = 1e3
"""Largest distance of a contact point along an axis of its frame [m]."""

REACH_TOLERANCE = 1e-9
"""Share of a wished-for velocity that may be missed before it counts as out of reach."""

HELD_TOLERANCE = 1e-9
"""Share of what the joints contribute that a held frame may move at, for rounding."""


class Posture:
    """A leg at a configuration `q`; made by `Leg.posture`, so kinematics has always been run.

    Attributes:
        leg: the leg.
        q: configuration, shape `(nq,)` [rad; m for prismatic joints].
        contact_point: origin of the leg's contact frame, or what `touched_at` made of it, shape
            `(3,)` [m, world frame].
        contact_lever: of that point from the contact joint's origin, in the joint's axes, shape
            `(3,)` [m].
        condition: condition number of the joint-space inertia, 1-norm (LAPACK's estimate), joints
            scaled to unit diagonal; about log10 of it digits can be lost.
        hold: its supports and loops there; None without any.
        jacobian: KIC of that point, `velocity = jacobian @ v`, shape `(3, nv)` [world frame].
        inertia: joint-space inertia M, armature included, shape `(nv, nv)` [kg m2].
    """

    def __init__(self, leg: Leg, q: ArrayLike) -> None:
        space = leg.workspace
        model, data = space.model, space.data
        self.leg = leg
        self.q = configuration(model, q)
        pin.forwardKinematics(model, data, self.q)
        placement = pin.updateFramePlacement(model, data, leg.frame_id)
        self.contact_point: Array = placement.translation.copy()
        self.contact_lever: Array = leg.contact_lever
        self.joint_rotation: Array = space.placements[leg.contact_joint].rotation.copy()
        # In local axes: about the world's origin, a leg far from it would lose its digits.
        self.inertia: Array = pin.crba(model, data, self.q, pin.Convention.LOCAL)
        local = pin.computeFrameJacobian(model, data, self.q, leg.frame_id, pin.LOCAL)
        self._frame = placement.copy()
        self._frame_jacobian: Array = local.reshape(6, model.nv)
        self.jacobian: Array = placement.rotation.dot(self._frame_jacobian[:3])
        self._factor, self._scale, self.condition = _factored(self.inertia)
        if not self.condition < MAX_CONDITION:
            fault = (
                "is not positive definite: a joint moves no inertia"
                if self.condition == math.inf
                else f"has condition {self.condition:.1g}, above {MAX_CONDITION:g}: no digits"
            )
            raise InvalidInput(
                f"the joint-space inertia of {leg.name} at q = {self.q.tolist()} {fault} (at "
                f"fault: {listed(culprits(model, self.inertia))}; Leg.locked locks joints)"
            )
        self.hold = None if leg.constraints is None else self._held(leg.constraints, model, data)
        for array in (
            *(self.q, self.inertia, self.contact_point),
            *(self.jacobian, self.joint_rotation, self._factor),
        ):
            array.setflags(write=False)

    def __repr__(self) -> str:
        """Name the leg and its angles."""
        angles = ", ".join(f"{angle:.4g}" for angle in self.q)
        return f"Posture({self.leg.name}, q=[{angles}])"

    def _held(self, constraints: Constraints, model: Any, data: Any) -> Hold:
        constraints.check_closed(model, data, self)
        rows, blocks = constraints.rows(model, data, self.q)
        return Hold(constraints, rows, blocks, self._weighed(rows), self)

    def _weighed(self, rows: Array) -> Array:
        """Return L^-1 times the rows' transpose, with M = L L^T, shape `(nv, rows)`."""
        # not dtrtrs: OpenBLAS runs it in threads however small, milliseconds on a busy machine
        return np.asarray(blas.dtrsm(1.0, self._factor, (rows * self._scale).T, lower=1))

    def touched_at(self, offset: ArrayLike) -> Posture:
        """Return this posture with its contact point elsewhere on the foot.

        Args:
            offset: from the contact frame's origin, in that frame's axes, shape `(3,)` [m].
        """
        arm = checks.vector("contact offset", offset, 3, unit="m")
        if np.abs(arm).max() > MAX_OFFSET:
            raise InvalidInput(
                f"contact offset is {arm.tolist()} m: it must be on the foot, {MAX_OFFSET:g} m at "
                "most"
            )
        turn, frame = self._frame.rotation, self._frame_jacobian
        moved = copy.copy(self)
        moved.__dict__.pop("mobility", None)
        moved.contact_point = self._frame.act(arm)
        moved.contact_lever = self.leg.contact_lever + self.joint_rotation.T @ (turn @ arm)
        moved.jacobian = turn @ (frame[:3] - pin.skew(arm) @ frame[3:])
        for array in (moved.contact_point, moved.contact_lever, moved.jacobian):
            array.setflags(write=False)
        return moved

    @cached_property
    def mobility(self) -> Array:
        """`J L^-T` with M = L L^T, shape `(3, nv)`: its rows span the Delassus matrix.

        Without the part that supports and loops block, if there are any.
        """
        rows = self._weighed(self.jacobian)
        if self.hold:
            rows = self.hold.freed(rows)
        rows.setflags(write=False)
        return np.asarray(rows.T)

    def delassus(self) -> Array:
        """Return J M^-1 J^T at the contact point, shape `(3, 3)` [1/kg, world frame]."""
        return np.asarray(self.mobility.dot(self.mobility.T))

    def effective_mass(self, normal: ArrayLike) -> float:
        """Return 1 / (n^T J M^-1 J^T n) [kg]; inf where the leg is immovable along the normal.

        Args:
            normal: direction, any length but zero, shape `(3,)` [world frame].

        Raises:
            InvalidInput: the normal has length 0.
        """
        return self.mass_along(checks.direction("normal", normal))

    def mass_along(self, unit: Array) -> float:
        """Return what `effective_mass` does, along a vector known to have length 1."""
        row = unit.dot(self.mobility)
        give = float(row.dot(row))
        return 1.0 / give if give else math.inf

    def point_velocity(self, v: ArrayLike) -> Array:
        """Return the contact point's velocity, shape `(3,)` [m/s, world frame]."""
        return np.asarray(self.jacobian @ checks.vector("v", v, self.leg.nv))

    def joint_velocity(self, point_velocity: ArrayLike) -> Array:
        """Return the joint velocity of least kinetic energy that moves the contact point so.

        Args:
            point_velocity: wished for, shape `(3,)` [m/s, world frame].

        Returns:
            v, shape `(nv,)` [rad/s].

        Raises:
            InvalidInput: the leg cannot move its contact point in that direction here.
        """
        wish = checks.vector("point velocity", point_velocity, 3, unit="m/s")
        v = self.try_joint_velocity(wish)
        if v is None:
            raise InvalidInput(
                f"point velocity {wish.tolist()} m/s is out of reach of {self!r}: "
                "its contact point cannot move in that direction there"
            )
        return v

    def try_joint_velocity(self, wish: Array) -> Array | None:
        """Return what `joint_velocity` returns, or None where that is out of reach."""
        left, gains, right = np.linalg.svd(self.mobility, full_matrices=False)
        usable = gains > 1e-12 * gains[0] if gains[0] > 0 else gains > 0
        part = np.divide(left.T @ wish, gains, out=np.zeros_like(gains), where=usable)
        v = self._scale * blas.dtrsv(self._factor, right.T @ part, lower=1, trans=1)
        missed = np.abs(self.jacobian @ v - wish).max()
        return None if missed > REACH_TOLERANCE * np.abs(wish).max() else np.asarray(v)

    def solve(self, joint_impulse: Array) -> Array:
        """Return the velocity jump after a joint-space impulse, shape `(nv,)` [rad/s].

        It is M^-1 times the impulse, and that of supports and loops, where there are any. Without
        them, many may come as columns, `(nv, n)`.
        """
        return self.respond(joint_impulse)[0]

    def respond(self, joint_impulse: Array) -> tuple[Array, Array]:
        """Return what `solve` does, and the impulses of supports and loops.

        Those are stacked as in `Constraints.rows`, shape `(rows,)` [N s, N m s, world axes]; where
        they are redundant, of all splits the smallest.
        """
        if self.hold is None:
            v, _ = lapack.dpotrs(self._factor, (self._scale * joint_impulse.T).T, lower=1)
            return np.asarray((self._scale * v.T).T), np.zeros(0)
        weighed = blas.dtrsv(self._factor, self._scale * joint_impulse, lower=1)
        jump = blas.dtrsv(self._factor, self.hold.freed(weighed), lower=1, trans=1)
        return np.asarray(self._scale * jump), self.hold.impulses(weighed)

    def admissible(self, v: ArrayLike) -> Array:
        """Return the joint velocity nearest to `v`, by kinetic energy, that supports and loops let.

        Args:
            v: shape `(nv,)` [rad/s].
        """
        v = checks.vector("v", v, self.leg.nv)
        if self.hold is None:
            return v
        # M v = L L^T v: what L^T v loses is the constraints' share
        weighed = blas.dtrmv(self._factor, v / self._scale, lower=1, trans=1)
        part = blas.dtrsv(self._factor, self.hold.freed(weighed), lower=1, trans=1)
        return np.asarray(self._scale * part)

    def check_velocity(self, v: Array) -> None:
        """Raise `InvalidInput` if a joint velocity moves what a support or loop holds."""
        if self.hold is None:
            return
        speeds = np.abs(self.hold.rows @ v)
        if not (speeds <= HELD_TOLERANCE * (np.abs(self.hold.rows) @ np.abs(v))).all():
            worst = int(np.argmax(speeds))
            raise InvalidInput(
                f"v moves {self.hold.name_of(worst)}, which is held, at {speeds[worst]:.3g} "
                f"{self.hold.unit_of(worst)} in {self!r}: Posture.admissible(v) gives the nearest "
                "velocity that does not"
            )


def configuration(model: Any, q: ArrayLike) -> Array:
    """Return q checked, shape `(nq,)`; raise `InvalidInput` if it is no configuration."""
    checked = checks.vector("q", q, model.nq)
    if model.nq != model.nv and not pin.isNormalized(model, checked, 1e-9):
        raise InvalidInput(
            f"q is {checked.tolist()}: the (cos, sin) pair of a continuous joint must have "
            "length 1 (Leg.configuration makes one from angles)"
        )
    return checked


def _factored(inertia: Array) -> tuple[Array, Array, float]:
    """Return the Cholesky factor of M scaled to unit diagonal, the scale, and the condition.

    Scaled, so that a light toe on a heavy leg, or metres beside radians, cost no digits and do not
    count as ill-conditioned.
    """
    diagonal = inertia.diagonal()
    if not all(entry > 0.0 for entry in diagonal.tolist()):
        return inertia, diagonal, math.inf
    scale = 1.0 / np.sqrt(diagonal)
    scaled = inertia * scale * scale[:, None]
    factor, info = lapack.dpotrf(scaled, lower=1)
    if info:
        return factor, scale, math.inf
    norm = lapack.dlange("1", scaled)
    reciprocal, _ = lapack.dpocon(factor, norm, uplo="L")
    return factor, scale, 1.0 / float(reciprocal) if reciprocal else math.inf
