"""The joint-space inertia and the Jacobian of a contact point: the response to an impulse there."""

import math
from functools import cached_property

import numpy as np
from scipy.linalg import blas, lapack

from kickdyn.core import validation
from kickdyn.core.validation import Array, ArrayLike, protect
from kickdyn.errors import InvalidInput
from kickdyn.robot.constraints import ConstraintProjector


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
    _whitened: Array | None

    @cached_property
    def condition(self) -> float:
        """Condition number of M in the 1-norm, scaled to unit diagonal (LAPACK's estimate).

        Neither a light toe on a heavy leg nor metres beside radians cost the factor digits. It is
        inf if M is not positive definite.
        """
        factor = self._cholesky
        if not (factor.diagonal() > 0.0).all():
            return math.inf
        scale = 1.0 / np.sqrt(self.inertia.diagonal())
        scaled, root = self.inertia * scale * scale[:, None], factor * scale[:, None]
        reciprocal, _ = lapack.dpocon(root, lapack.dlange("1", scaled), uplo="L")
        return 1.0 / float(reciprocal) if reciprocal else math.inf

    @property
    def jacobian_norm(self) -> float:
        """Frobenius norm of the Jacobian J, in its own units."""
        entries = self.jacobian.ravel()
        return math.sqrt(entries.dot(entries))

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

    def delassus(self) -> Array:
        r"""Return :math:`J M^{-1} J^T` at the contact point, shape `(3, 3)` [1/kg, world frame]."""
        factor = self.whitened_jacobian
        return np.asarray(factor.dot(factor.T))

    @cached_property
    def rounding_gain(self) -> float:
        r"""Factor by which the relative rounding of M can grow in `delassus`; about 1 as a rule.

        An error of M by e of its diagonal, E, changes the inverse mass along an axis by
        :math:`x^T E x` with :math:`x = M^{-1} J^T`: at most
        :math:`e\,(\sum_i \sqrt{M_{ii}}\,|x_i|)^2`.
        """
        whitened = self.whitened_jacobian.T
        x = blas.dtrsm(1.0, self._cholesky, whitened, lower=1, trans_a=1)
        sums = np.sqrt(self.inertia.diagonal()).dot(abs(x)).tolist()
        squares = (whitened * whitened).sum(axis=0).tolist()
        shares = [a * a / b for a, b in zip(sums, squares, strict=True) if b]
        return max(shares, default=1.0)

    def effective_mass(self, normal: ArrayLike) -> float:
        r"""Return :math:`1 / (n^T J M^{-1} J^T n)` [kg]; inf if the leg cannot move along n.

        Stiff joints hold; `without_stiff_joints` has the effective mass with these joints free.

        Args:
            normal: direction n, shape `(3,)` of any length but zero [world frame].
        """
        row = validation.direction("normal", normal).dot(self.whitened_jacobian)
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
        # not dtrtrs: OpenBLAS runs it in threads however small, milliseconds on a busy machine;
        # of side=0 and lower=1, the names would take a fifth of the time
        whitened: Array = blas.dtrsm(1.0, self._cholesky, rows.T, 0, 1)
        return whitened
