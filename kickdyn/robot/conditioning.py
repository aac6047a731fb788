"""The Cholesky factor of a joint-space inertia, and how many digits it can lose."""

from __future__ import annotations

import math

import numpy as np
from scipy.linalg import blas, lapack

from kickdyn.core.validation import Array


def cholesky_with_condition(inertia: Array) -> tuple[Array, float]:
    """Return the Cholesky factor of M, its upper triangle unused, and a bound on the condition.

    Where M is not positive definite, the factor is 0 and the bound inf. Scaled to unit diagonal, M
    has eigenvalues that add up to n, so the smallest is above det / e (the others' product is
    largest where they are equal), and the condition below n^1.5 e / det. Where many joints make
    that too large: below n^2 tr M |M^-1| (van der Sluis 1969: no other scaling is n times better).
    """
    factor, info = lapack.dpotrf(inertia.T, lower=1, clean=0)
    if info:
        return np.zeros_like(factor), math.inf
    diagonal = inertia.diagonal().tolist()
    roots = factor.diagonal().tolist()
    determinant = math.prod([a * a / b for a, b in zip(roots, diagonal, strict=True)])
    n = len(inertia)
    if determinant > 1e-9:  # far below 1 it is rounding
        return factor, n**1.5 * math.e / determinant
    reciprocal, _ = lapack.dpocon(factor, sum(diagonal), uplo="L")
    return factor, n * n / float(reciprocal) if reciprocal else math.inf


def condition(inertia: Array, factor: Array) -> float:
    """Return the condition of M scaled to unit diagonal; inf where it is not positive definite.

    Scaled, so that a light toe on a heavy leg, or metres beside radians, do not count as
    ill-conditioned; they cost the Cholesky factor no digits.
    """
    if not all(root > 0.0 for root in factor.diagonal().tolist()):
        return math.inf
    scale = 1.0 / np.sqrt(inertia.diagonal())
    scaled, root = inertia * scale * scale[:, None], factor * scale[:, None]
    reciprocal, _ = lapack.dpocon(root, lapack.dlange("1", scaled), uplo="L")
    return 1.0 / float(reciprocal) if reciprocal else math.inf


def rounding(inertia: Array, factor: Array, rows: Array) -> float:
    """Return by how many times M's rounding is seen in a foot's inverse mass, at most.

    An error of M by e of its diagonal, E, changes the inverse mass J M^-1 J^T along an axis by
    x^T E x with x = M^-1 J^T: at most e (sum_i sqrt(M_ii) |x_i|)^2.

    Args:
        inertia: M = L L^T, shape `(nv, nv)`.
        factor: L.
        rows: L^-1 J^T, shape `(nv, n)`.
    """
    x = blas.dtrsm(1.0, factor, rows, lower=1, trans_a=1)
    sums = np.sqrt(inertia.diagonal()).dot(abs(x)).tolist()
    squares = (rows * rows).sum(axis=0).tolist()
    shares = [a * a / b for a, b in zip(sums, squares, strict=True) if b]
    return max(shares, default=1.0)
