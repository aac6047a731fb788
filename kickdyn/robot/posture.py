"""A leg at one configuration: what kinematics and inertia say there."""

from __future__ import annotations

import copy
import math
from collections.abc import Iterable
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike
from scipy.linalg import blas, lapack

from kickdyn.core import validation
from kickdyn.core.read_only import ReadOnly
from kickdyn.core.representation import ReprMixin, Row, warned
from kickdyn.core.validation import Array
from kickdyn.core.vectors import cross3
from kickdyn.errors import InvalidInput
from kickdyn.robot.articulated_body import Articulated
from kickdyn.robot.conditioning import cholesky_with_condition, condition, rounding
from kickdyn.robot.constraint_projector import ConstraintProjector
from kickdyn.robot.model_validation import find_singular_joints, listed

if TYPE_CHECKING:
    from kickdyn.robot.constraints import Constraints
    from kickdyn.robot.leg import Leg

MAX_CONDITION = 1e13

DOUBTFUL_CONDITION = 1e3
"""Bound on M's condition from which it is looked up what that costs the foot's inverse mass."""

MAX_LOSS = 100.0
"""`Posture.rounding` from which articulated bodies replace M."""

MAX_OFFSET = 1e3
"""Largest distance of a contact point along an axis of its frame [m]."""

REACH_TOLERANCE = 1e-9
"""Share of a wished-for velocity that may be missed before it counts as out of reach."""

SHOWN = 8
"""Joints of a posture that are shown; of a robot with more, those that are not at 0."""


class Posture(ReprMixin, ReadOnly):
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
        constraint_projector: its supports and loops there; None without any.
        jacobian: KIC of that point, `velocity = jacobian @ v`, shape `(3, nv)` [world frame].
        inertia: joint-space inertia M, armature included, shape `(nv, nv)` [kg m2].
    """

    def __init__(self, leg: Leg, q: ArrayLike) -> None:
        space = leg.workspace
        model, data = space.model, space.data
        self.leg = leg
        self.q = leg.checked_configuration(q)
        pin.forwardKinematics(model, data, self.q)
        placement = pin.updateFramePlacement(model, data, leg.frame_id)
        self.contact_point: Array = placement.translation.copy()
        self._origin, self._turn = self.contact_point, placement.rotation.copy()
        self.contact_lever: Array = leg.contact_lever
        self.joint_rotation: Array = space.placements[leg.contact_joint].rotation.copy()
        # In local axes: about the world's origin, a leg far from it would lose its digits.
        self.inertia: Array = pin.crba(model, data, self.q, pin.Convention.LOCAL)
        local = pin.computeFrameJacobian(model, data, self.q, leg.frame_id, pin.LOCAL)
        self._frame_jacobian: Array = local.reshape(6, model.nv)
        self.jacobian: Array = self._turn.dot(self._frame_jacobian[:3])
        self._mobility: Array | None = None
        self._give: Array | None = None
        self._factor, self._bound = cholesky_with_condition(self.inertia)
        if not self._bound < MAX_CONDITION and not self.condition < MAX_CONDITION:
            fault = (
                "is not positive definite: a joint moves no inertia"
                if self.condition == math.inf
                else f"has condition {self.condition:.1g}, above {MAX_CONDITION:g}: no digits"
            )
            raise InvalidInput(
                f"the joint-space inertia of {leg.name} at q = {self.q.tolist()} {fault} (at "
                f"fault: {listed(find_singular_joints(model, self.inertia))}; "
                "Leg.locked locks joints)"
            )
        self.constraint_projector = (
            None if leg.constraints is None else self._held(leg.constraints, model, data)
        )
        for array in (self.q, self.inertia, self.contact_point, self.jacobian, self.joint_rotation):
            array.setflags(write=False)

    def __repr__(self) -> str:
        """Name the leg and its angles."""
        angles = ", ".join(f"{angle:.4g}" for angle in self.q)
        return f"Posture({self.leg.name}, q=[{angles}])"

    def _rows(self) -> Iterable[Row]:
        yield "leg", self.leg.name, ""
        joints = self.leg.angles_deg(self.q)
        moved = {name: value for name, value in joints.items() if value or len(joints) <= SHOWN}
        for name in list(moved)[:SHOWN]:
            yield name, moved[name], self.leg.joint_unit(name).replace("rad", "deg")
        if len(moved) > SHOWN:
            yield "and", f"{len(moved) - SHOWN} joints more", ""
        yield "contact point", self.contact_point, "m"
        yield "condition", self.condition, ""
        yield from warned(self.warnings)

    @property
    def warnings(self) -> tuple[str, ...]:
        """A line for each joint outside its range (allowed; or are these degrees?)."""
        return tuple(self.leg.outside_range(self.q))

    def _held(self, constraints: Constraints, model: Any, data: Any) -> ConstraintProjector:
        constraints.check_closed(model, data, self)
        rows, blocks = constraints.rows(model, data, self.q)
        return ConstraintProjector(constraints, rows, blocks, self._whitened(rows), self)

    def _whitened(self, rows: Array) -> Array:
        """Return L^-1 times the rows' transpose, with M = L L^T, shape `(nv, rows)`."""
        # not dtrtrs: OpenBLAS runs it in threads however small, milliseconds on a busy machine
        whitened: Array = blas.dtrsm(1.0, self._factor, rows.T, lower=1)
        return whitened

    def touched_at(self, offset: ArrayLike | None) -> Posture:
        """Return this posture with its contact point elsewhere on the foot.

        Args:
            offset: from the contact frame's origin, in that frame's axes, shape `(3,)` [m]; None
                leaves the point where it is.
        """
        if offset is None:
            return self
        arm = validation.vector("contact offset", offset, 3, unit="m")
        if np.abs(arm).max() > MAX_OFFSET:
            raise InvalidInput(
                f"contact offset is {arm.tolist()} m: it must be on the foot, {MAX_OFFSET:g} m at "
                "most"
            )
        turn, frame = self._turn, self._frame_jacobian
        moved = copy.copy(self)
        moved._mobility = moved._give = None
        moved.__dict__.pop("rounding", None)
        moved.contact_point = self._origin + turn @ arm
        moved.contact_lever = self.leg.contact_lever + self.joint_rotation.T @ (turn @ arm)
        moved.jacobian = turn @ (frame[:3] - pin.skew(arm) @ frame[3:])
        for array in (moved.contact_point, moved.contact_lever, moved.jacobian):
            array.setflags(write=False)
        return moved

    @cached_property
    def condition(self) -> float:
        """Condition number of the joint-space inertia; see the class."""
        return condition(self.inertia, self._factor)

    @property
    def whitened_jacobian(self) -> Array:
        """`J L^-T` with M = L L^T, shape `(3, nv)`: its rows span the Delassus matrix.

        Without the part that supports and loops block, if there are any.
        """
        if self._mobility is None:
            rows = self._whitened(self.jacobian)
            if self.constraint_projector is not None:
                rows = self.constraint_projector.project(rows)
            rows.setflags(write=False)
            self._mobility = rows.T
        return self._mobility

    def delassus(self) -> Array:
        """Return J M^-1 J^T at the contact point, shape `(3, 3)` [1/kg, world frame]."""
        rows = self.delassus_factor()
        give: Array = rows.dot(rows.T)
        return give

    @cached_property
    def rounding(self) -> float:
        """By how many times M's rounding is seen in `delassus`, at most; 1 of a sound leg."""
        return rounding(self.inertia, self._factor, self.whitened_jacobian.T)

    @property
    def is_ill_conditioned(self) -> bool:
        """Whether M's rounding would be seen in what the foot gives way by."""
        return self._bound > DOUBTFUL_CONDITION and self.rounding > MAX_LOSS

    @cached_property
    def articulated(self) -> Articulated:
        """The leg's bodies, which keep the digits that M loses; without supports and loops."""
        space = self.leg.workspace
        return Articulated(space.model, space.data, self.q)

    def delassus_factor(self) -> Array:
        """Return `(3, n)` rows whose products are the entries of the Delassus matrix."""
        if self._give is None:
            self._give = self.whitened_jacobian
            if self.constraint_projector is None and self.is_ill_conditioned:
                axes, lever = self.joint_rotation.tolist(), self.contact_lever.tolist()
                pushes = np.array([(*axis, *cross3(lever, axis)) for axis in axes])
                self._give = self.articulated.give(self.leg.contact_joint, pushes)
        return self._give

    def effective_mass(self, normal: ArrayLike) -> float:
        """Return 1 / (n^T J M^-1 J^T n) [kg]; inf where the leg is immovable along the normal.

        Args:
            normal: direction, any length but zero, shape `(3,)` [world frame].

        Raises:
            InvalidInput: the normal has length 0.
        """
        return self.mass_along(validation.direction("normal", normal))

    def mass_along(self, unit: Array) -> float:
        """Return what `effective_mass` does, along a vector known to have length 1."""
        row = unit.dot(self.delassus_factor())
        give = float(row.dot(row))
        return 1.0 / give if give else math.inf

    def point_velocity(self, v: ArrayLike) -> Array:
        """Return the contact point's velocity, shape `(3,)` [m/s, world frame]."""
        return np.asarray(self.jacobian @ validation.vector("v", v, self.leg.nv))

    def joint_velocity(self, point_velocity: ArrayLike) -> Array:
        """Return the joint velocity of least kinetic energy that moves the contact point so.

        Args:
            point_velocity: wished for, shape `(3,)` [m/s, world frame].

        Returns:
            v, shape `(nv,)` [rad/s].

        Raises:
            InvalidInput: the leg cannot move its contact point in that direction here, or so fast.
        """
        wish = validation.vector("point velocity", point_velocity, 3, unit="m/s")
        with np.errstate(over="ignore", invalid="ignore"):  # said below
            v = self.try_joint_velocity(wish)
        if v is not None and not np.isfinite(v).all():
            raise InvalidInput(
                f"point velocity {wish.tolist()} m/s takes joints of {self!r} beyond what a "
                "float64 holds: it must be slower"
            )
        if v is None:
            raise InvalidInput(
                f"point velocity {wish.tolist()} m/s is out of reach of {self!r}: "
                "its contact point cannot move in that direction there"
            )
        return v

    def try_joint_velocity(self, wish: Array) -> Array | None:
        """Return what `joint_velocity` returns, or None where that is out of reach."""
        left, gains, right = np.linalg.svd(self.whitened_jacobian, full_matrices=False)
        usable = gains > 1e-12 * gains[0] if gains[0] > 0 else gains > 0
        v, miss = np.zeros_like(self._factor[0]), wish
        for _ in range(2):  # what is missed, by gains of unlike size, is asked for once more
            part = np.divide(left.T @ miss, gains, out=np.zeros_like(gains), where=usable)
            v = v + blas.dtrsv(self._factor, right.T @ part, lower=1, trans=1)
            miss = wish - self.jacobian @ v
        # nan, where it is too fast for float64, is not missed
        return None if np.abs(miss).max() > REACH_TOLERANCE * np.abs(wish).max() else v

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
        if self.constraint_projector is None:
            v, _ = lapack.dpotrs(self._factor, joint_impulse, lower=1)
            return np.asarray(v), np.zeros(0)
        whitened = blas.dtrsv(self._factor, joint_impulse, lower=1)
        jump = blas.dtrsv(
            self._factor, self.constraint_projector.project(whitened), lower=1, trans=1
        )
        return np.asarray(jump), self.constraint_projector.impulses(whitened)

    def admissible(self, v: ArrayLike) -> Array:
        """Return the joint velocity nearest to `v`, by kinetic energy, that supports and loops let.

        Args:
            v: shape `(nv,)` [rad/s].
        """
        v = validation.vector("v", v, self.leg.nv)
        if self.constraint_projector is None:
            return v
        # M v = L L^T v: what L^T v loses is the constraints' share
        whitened = blas.dtrmv(self._factor, v, lower=1, trans=1)
        return np.asarray(
            blas.dtrsv(self._factor, self.constraint_projector.project(whitened), lower=1, trans=1)
        )

    def check_velocity(self, v: Array) -> None:
        """Raise `InvalidInput` if a joint velocity moves what a support or loop holds."""
        if self.constraint_projector is None:
            return
        moved = self.constraint_projector.moved(v)
        if moved is not None:
            name, speed, unit = moved
            raise InvalidInput(
                f"v moves {name}, which is held, at {speed:.3g} {unit} in {self!r}: "
                "Posture.admissible(v) gives the nearest velocity that does not"
            )
