"""A leg at one configuration: what kinematics and inertia say there."""

from __future__ import annotations

import math
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike
from scipy.linalg import blas, lapack

from kickdyn import checks
from kickdyn.checks import Array
from kickdyn.errors import InvalidInput

if TYPE_CHECKING:
    from kickdyn.leg import Leg

MAX_CONDITION = 1e15

REACH_TOLERANCE = 1e-9
"""Share of a wished-for velocity that may be missed before it counts as out of reach."""


class Posture:
    """A leg at a configuration `q`; made by `Leg.posture`, so kinematics has always been run.

    Attributes:
        leg: the leg.
        q: configuration, shape `(nq,)` [rad; m for prismatic joints].
        contact_point: origin of the leg's contact frame, shape `(3,)` [m, world frame].
        condition: condition number of the joint-space inertia, 1-norm (LAPACK's estimate), joints
            scaled to unit diagonal; about log10 of it digits can be lost.
        jacobian: KIC of that point, `velocity = jacobian @ v`, shape `(3, nv)` [world frame].
        inertia: joint-space inertia M, armature included, shape `(nv, nv)` [kg m2].
    """

    def __init__(self, leg: Leg, q: ArrayLike) -> None:
        model, data = leg.workspace.model, leg.workspace.data
        self.leg = leg
        self.q = checks.vector("q", q, model.nq)
        if model.nq != model.nv and not pin.isNormalized(model, self.q, 1e-9):
            raise InvalidInput(
                f"q is {self.q.tolist()}: the (cos, sin) pair of a continuous joint must have "
                "length 1 (Leg.configuration makes one from angles)"
            )
        pin.forwardKinematics(model, data, self.q)
        placement = pin.updateFramePlacement(model, data, leg.frame_id)
        self.contact_point: Array = placement.translation.copy()
        self.joint_rotation: Array = data.oMi[leg.contact_joint].rotation.copy()
        # In local axes: about the world's origin, a leg far from it would lose its digits.
        self.inertia: Array = pin.crba(model, data, self.q, pin.Convention.LOCAL)
        local = pin.computeFrameJacobian(model, data, self.q, leg.frame_id, pin.LOCAL)
        self.jacobian: Array = placement.rotation @ local.reshape(6, model.nv)[:3]
        self._factor, self._scale, self.condition = _factored(self.inertia)
        if not self.condition < MAX_CONDITION:
            fault = (
                "is not positive definite: a joint moves no inertia"
                if self.condition == math.inf
                else f"has condition {self.condition:.1g}: above {MAX_CONDITION:g} no digit is left"
            )
            raise InvalidInput(
                f"the joint-space inertia of {leg.name} at q = {self.q.tolist()} {fault}"
            )
        for array in (
            *(self.q, self.inertia, self.contact_point),
            *(self.jacobian, self.joint_rotation, self._factor),
        ):
            array.setflags(write=False)

    def __repr__(self) -> str:
        """Name the leg and its angles."""
        angles = ", ".join(f"{angle:.4g}" for angle in self.q)
        return f"Posture({self.leg.name}, q=[{angles}])"

    @cached_property
    def mobility(self) -> Array:
        """`J L^-T` with M = L L^T, shape `(3, nv)`: its rows span the Delassus matrix."""
        # not dtrtrs: OpenBLAS runs it in threads however small, milliseconds on a busy machine
        rows = blas.dtrsm(1.0, self._factor, (self.jacobian * self._scale).T, lower=1)
        rows.setflags(write=False)
        return np.asarray(rows.T)

    def delassus(self) -> Array:
        """Return J M^-1 J^T at the contact point, shape `(3, 3)` [1/kg, world frame]."""
        return np.asarray(self.mobility @ self.mobility.T)

    def effective_mass(self, normal: ArrayLike) -> float:
        """Return 1 / (n^T J M^-1 J^T n) [kg]; inf where the leg is immovable along the normal.

        Args:
            normal: direction, any length but zero, shape `(3,)` [world frame].

        Raises:
            InvalidInput: the normal has length 0.
        """
        row = checks.direction("normal", normal) @ self.mobility
        give = float(row @ row)
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
        """Return M^-1 times a joint-space impulse, or many as columns, `(nv,)` or `(nv, n)`."""
        v, _ = lapack.dpotrs(self._factor, (self._scale * joint_impulse.T).T, lower=1)
        return np.asarray((self._scale * v.T).T)


def _factored(inertia: Array) -> tuple[Array, Array, float]:
    """Return the Cholesky factor of M scaled to unit diagonal, the scale, and the condition.

    Scaled, so that a light toe on a heavy leg, or metres beside radians, cost no digits and do not
    count as ill-conditioned.
    """
    diagonal = inertia.diagonal()
    if not (diagonal > 0.0).all():
        return inertia, diagonal, math.inf
    scale = 1.0 / np.sqrt(diagonal)
    scaled = inertia * scale * scale[:, None]
    factor, info = lapack.dpotrf(scaled, lower=1)
    if info:
        return factor, scale, math.inf
    norm = float(np.abs(scaled).sum(axis=0).max())
    reciprocal, _ = lapack.dpocon(factor, norm, uplo="L")
    return factor, scale, 1.0 / float(reciprocal) if reciprocal else math.inf
