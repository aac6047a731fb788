"""The joint-space inertia and the Jacobian of a contact point: the response to an impulse there."""

import math
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
from scipy.linalg import blas, lapack

from kickdyn.core import validation
from kickdyn.core.validation import Array, ArrayLike, protect
from kickdyn.errors import InvalidInput
from kickdyn.robot.constraints import ConstraintProjector
from kickdyn.robot.model_validation import condition, rounding_gain


class JointSpace:
    r"""Algebra of the inertia M and the Jacobian J of a `Posture`, with its constraints.

    With the Cholesky factor of :math:`M = L L^T`, the columns of :math:`L^{-1} J^T` are
    whitened: their inner products are the entries of :math:`J M^{-1} J^T`, and constraints are
    orthogonal projections of them.
    """

    jacobian: Array
    inertia: Array
    constraint_projector: ConstraintProjector | None
    _cholesky: Array
    _condition_bound: float
    _whitened: Array | None

    @cached_property
    def condition(self) -> float:
        """Condition number of M in the 1-norm, scaled to unit diagonal (LAPACK's estimate)."""
        return condition(self.inertia, self._cholesky)

    @property
    def jacobian_norm(self) -> float:
        """Frobenius norm of the Jacobian J, in its own units."""
        return math.sqrt(np.vdot(self.jacobian, self.jacobian))

    @property
    def whitened_jacobian(self) -> Array:
        r"""Return :math:`J L^{-T}` with :math:`M = L L^T`, shape `(3, nv)` [world frame].

        With constraints, it is projected on the velocity jumps that they allow in an impact.
        """
        if self._whitened is None:  # not a cached_property: its lock would take 2 us
            columns = self._whiten(self.jacobian)
            if self.constraint_projector is not None:
                columns = self.constraint_projector.project(columns)
            protect(columns)
            self._whitened = columns.T
        return self._whitened

    def whiten(self, jacobian: ArrayLike) -> Array:
        r"""Return :math:`L^{-1} J^T` of any Jacobian, `(rows, nv)`, as for `whitened_jacobian`."""
        rows = validation.floats("jacobian", jacobian)
        if rows.ndim != 2 or rows.shape[1] != len(self.inertia):
            raise InvalidInput(
                f"jacobian has shape {rows.shape}: it must have rows of length {len(self.inertia)}"
            )
        columns, projector = self._whiten(rows), self.constraint_projector
        return columns if projector is None else projector.project(columns)

    def delassus_factor(self) -> Array:
        r"""Return F with :math:`F F^T = J M^{-1} J^T`, the whitened Jacobian, shape `(3, n)`."""
        return self.whitened_jacobian

    def delassus(self) -> Array:
        r"""Return :math:`J M^{-1} J^T` at the contact point, shape `(3, 3)` [1/kg, world frame]."""
        factor = self.delassus_factor()
        return np.asarray(factor.dot(factor.T))

    @cached_property
    def rounding_gain(self) -> float:
        """Factor by which the relative rounding of M can grow in `delassus`; about 1 as a rule."""
        return rounding_gain(self.inertia, self._cholesky, self.whitened_jacobian.T)

    @property
    def is_ill_conditioned(self) -> bool:
        """Whether the rounding of M can grow by a factor of more than 100 in `delassus`."""
        return self._condition_bound > 1e3 and self.rounding_gain > 100.0  # the bound costs less

    def effective_mass(self, normal: ArrayLike) -> float:
        r"""Return :math:`1 / (n^T J M^{-1} J^T n)` [kg]; inf if the leg cannot move along n.

        Stiff joints hold; `without_stiff_joints` has the effective mass with these joints free.

        Args:
            normal: direction n, shape `(3,)` of any length but zero [world frame].
        """
        row = validation.direction("normal", normal).dot(self.delassus_factor())
        inverse = float(row.dot(row))
        return 1.0 / inverse if inverse else math.inf

    def solve(self, joint_impulse: ArrayLike) -> Array:
        r"""Return the velocity jump :math:`M^{-1} f` after a joint-space impulse f, shape `(nv,)`.

        Supports and loops take part. Without them, f may have n columns, and so has the result.
        """
        return self.respond(joint_impulse)[0]

    def respond(self, joint_impulse: ArrayLike) -> tuple[Array, Array]:
        """Return the velocity jump that `solve` returns, and the impulses of supports and loops.

        The impulses are stacked as in `constraint_projector.rows`, shape `(rows,)` [N s, N m s,
        world axes]. Where several sets of them have the same effect, they are the smallest ones.
        """
        free, nv = self.constraint_projector is None, len(self.inertia)
        if free and isinstance(joint_impulse, np.ndarray) and joint_impulse.shape[:-1] == (nv,):
            joint_impulse = validation.floats("joint impulse", joint_impulse)  # one per column
        else:
            joint_impulse = validation.vector("joint impulse", joint_impulse, nv)
        if self.constraint_projector is None:
            v, _ = lapack.dpotrs(self._cholesky, joint_impulse, lower=1)
            return np.asarray(v), np.zeros(0)
        whitened = blas.dtrsv(self._cholesky, joint_impulse, lower=1)
        allowed = self.constraint_projector.project(whitened)
        jump = blas.dtrsv(self._cholesky, allowed, lower=1, trans=1)
        return np.asarray(jump), self.constraint_projector.impulses(whitened)

    def _whiten(self, rows: Array) -> Array:
        # not dtrtrs: OpenBLAS runs it in threads however small, milliseconds on a busy machine
        whitened: Array = blas.dtrsm(1.0, self._cholesky, rows.T, lower=1)
        return whitened


class _Body(NamedTuple):
    """One body and its joint, in the joint's axes; motions and forces linear, then angular.

    With the joint's motions :math:`S = Q R`, its velocity counts in the orthonormal motions Q:
    there a joint near a singularity, where columns of S are nearly parallel, loses no digits.

    Attributes:
        parent: its number.
        columns: the joint's places in v.
        lift: force transform to the parent's axes, shape `(6, 6)`; its transpose takes motions
            from there.
        inertia: of this body alone, shape `(6, 6)`.
        joint, normal: Q, and an orthonormal basis N across it, shapes `(6, k)`, `(6, 6 - k)`.
        root: R, shape `(k, k)`.
        rotor: armature as an inertia of motions along Q, :math:`R^{-T} D_r R^{-1}`, `(k, k)`.
        factor: lower Cholesky factor of D = Q^T A Q + rotor, A the inertia of all from here on.
        coupling: N^T A Q, shape `(6 - k, k)`.
    """

    parent: int
    columns: slice
    lift: Array
    inertia: Array
    joint: Array
    normal: Array
    root: Array
    rotor: Array
    factor: Array
    coupling: Array

    def solve(self, right: Array) -> Array:
        """Return D^-1 times a matrix or vector."""
        return np.asarray(lapack.dpotrs(self.factor, right, lower=1)[0])

    def pass_on(self, force: Array) -> tuple[Array, Array]:
        """Return the velocity D^-1 Q^T f along Q after a force f, and the force on the parent."""
        speed = self.solve(self.joint.T @ force)
        transmitted = self.normal @ (self.normal.T @ force - self.coupling @ speed)
        return speed, self.lift @ (transmitted + self.joint @ (self.rotor @ speed))


class ArticulatedBodies:
    r"""The bodies of a leg at one configuration; for legs without supports and loops.

    The joint-space inertia M of a short link before a long one is nearly singular, though its foot
    has an inverse mass as of any leg: a small difference of what the rounding of M has lost. Here
    bodies are joined from the foot to the base (Featherstone, Rigid Body Dynamics Algorithms, 2008,
    chapter 7). The inertia that a body adds to its parent's is

    .. math:: A - A S\,(S^T A S + D_r)^{-1} S^T A

    without rotors, :math:`D_r = 0`, where S are the joint's motions. It is exactly 0 along S: each
    inertia is split into S and an orthonormal basis N across it, and only the part across is passed
    to the parent, so that a free joint leaves 0 there and not the rounding of a difference. The
    recursion thus loses digits where bodies do, not where joint coordinates do; and because no
    basis mixes metres with radians, results do not depend on the units.
    """

    def __init__(self, model: Any, data: Any, q: Array) -> None:
        pin.forwardKinematics(model, data, q)
        self.nv = model.nv
        joined: list[Array] = [inertia.matrix() for inertia in model.inertias]
        bodies = []
        for number in range(model.njoints - 1, 0, -1):
            bodies.append(body := _joined(model, data, number, joined[number]))
            if body.parent:
                joined[body.parent] += body.lift @ _resisting(body, joined[number]) @ body.lift.T
        self.bodies: list[_Body] = bodies[::-1]

    def delassus_factor(self, number: int, forces: Array) -> Array:
        """Return F with :math:`F F^T = K M^{-1} K^T`, shape `(n, nv)`, K the forces' Jacobian.

        The forces, `(n, 6)`, act on the body of the joint with this number, in its axes.
        """
        rows, force = np.zeros((len(forces), self.nv)), forces.T
        while number:
            body = self.bodies[number - 1]
            work = body.joint.T @ force
            rows[:, body.columns] = blas.dtrsm(1.0, body.factor, work, lower=1).T
            _, force = body.pass_on(force)
            number = body.parent
        return rows

    def respond(self, number: int, push: Array) -> tuple[Array, Array, Array]:
        """Return the velocity jump, the impulses of joints, and the residual momentum.

        Shapes are `(nv,)`, `(njoints, 6)` in the joints' axes, and `(nv,)`. The push is an impulse
        on the body of the joint with this number, in its axes, `(6,)` [N s, N m s].
        """
        speeds: dict[int, Array] = {}
        number_above, force = number, push
        while number_above:
            speeds[number_above], force = self.bodies[number_above - 1].pass_on(force)
            number_above = self.bodies[number_above - 1].parent
        jump, left_over = np.zeros(self.nv), np.zeros(self.nv)
        motions = np.zeros((len(self.bodies) + 1, 6))
        for i, body in enumerate(self.bodies, start=1):
            parent_motion = body.lift.T @ motions[body.parent]
            sideways, parent_rate = body.normal.T @ parent_motion, body.joint.T @ parent_motion
            rate = speeds.get(i, 0.0) + body.solve(
                body.rotor @ parent_rate - body.coupling.T @ sideways
            )
            motions[i] = body.joint @ rate + body.normal @ sideways
            jump[body.columns] = np.linalg.solve(body.root, rate - parent_rate)
        transmitted = np.zeros((len(self.bodies) + 1, 6))
        transmitted[number] -= push
        for i in range(len(self.bodies), 0, -1):
            body = self.bodies[i - 1]
            transmitted[i] += body.inertia @ motions[i]
            transmitted[body.parent] += body.lift @ transmitted[i]
            along = body.joint.T @ transmitted[i] + body.rotor @ (body.root @ jump[body.columns])
            left_over[body.columns] = body.root.T @ along
        return jump, transmitted[1:], left_over


def _joined(model: Any, data: Any, number: int, inertia: Array) -> _Body:
    """Return a body, from its inertia with all that hangs from it."""
    index, size = model.idx_vs[number], model.nvs[number]
    columns = slice(index, index + size)
    joint, root, normal = _orthonormal(
        np.asarray(data.joints[number].S, dtype=float).reshape(6, size)
    )
    inverse = np.linalg.inv(root)
    rotor = inverse.T @ (model.armature[columns, None] * inverse)
    drive = inertia @ joint
    factor, _ = lapack.dpotrf(joint.T @ drive + rotor, lower=1)
    return _Body(
        parent=model.parents[number],
        columns=columns,
        lift=data.liMi[number].toDualActionMatrix(),
        inertia=model.inertias[number].matrix(),
        joint=joint,
        normal=normal,
        root=root,
        rotor=rotor,
        factor=factor,
        coupling=normal.T @ drive,
    )


def _orthonormal(joint: Array) -> tuple[Array, Array, Array]:
    """Return Q and R with S = Q R, and an orthonormal basis N across S.

    Translations and rotations have bases of their own, unless a joint couples the two, as a screw.
    """
    moves = np.array([joint[:3].any(axis=0), joint[3:].any(axis=0)])
    size = joint.shape[1]
    if moves.all(axis=0).any():
        basis, root = np.linalg.qr(joint, mode="complete")
        return basis[:, :size], root[:size], basis[:, size:]
    along, root, normal, free = np.zeros((6, size)), np.zeros((size, size)), np.zeros((6, 6)), 0
    for rows, columns in zip((slice(0, 3), slice(3, 6)), moves, strict=True):
        basis, upper = np.linalg.qr(joint[rows, columns], mode="complete")
        count = upper.shape[1]
        along[rows, columns] = basis[:, :count]
        root[np.ix_(columns, columns)] = upper[:count]
        normal[rows, free : free + 3 - count] = basis[:, count:]
        free += 3 - count
    return along, root, normal[:, :free]


def _resisting(body: _Body, inertia: Array) -> Array:
    """Return the inertia that a body adds to its parent's: without the motion of its joint."""
    joint, normal, coupling = body.joint, body.normal, body.coupling
    projected = normal.T @ inertia @ normal - coupling @ body.solve(coupling.T.copy())
    added = normal @ projected @ normal.T
    if body.rotor.any():  # a rotor resists along the joint too
        reflected = joint @ body.solve(body.rotor).T  # rotor D^-1
        cross_term = reflected @ coupling.T @ normal.T
        added += cross_term + cross_term.T + reflected @ (joint.T @ inertia @ joint) @ joint.T
    return np.asarray(added)
