r"""`SmoothingSpline`: a smooth curve of configurations through measured ones, with its covariance.

The curve is a B-spline of degree 5, :math:`x(t)`, in the tangent space at one configuration, that
minimises

.. math:: \sum_k |x(t_k) - x_k|^2_{W_k} + \sum_j \lambda_j \int e^{-g(t)} \dddot x_j^2 \, dt

with the information matrices :math:`W_k` of the configurations :math:`x_k`. Read as a Gaussian
prior of the third derivative, the penalty gives the covariance (Wahba 1983, J. R. Stat. Soc. B
45:133), and each :math:`\lambda_j` is the one of largest restricted likelihood.

The variance of this prior may grow towards the end (Pintore, Speckman & Holmes 2006, Biometrika
93:113), with :math:`g(t) = \gamma (t - t_{end})`, at least :math:`-\gamma T`: a swing accelerates
most just before the impact. A prior that is the same at all times takes the end for as smooth as
the beginning, and then both the velocity at the end and its deviation are too small.
"""

import math
from typing import Any

import numpy as np
import pinocchio as pin
from scipy.interpolate import BSpline
from scipy.optimize import minimize_scalar

from kickdyn.core.validation import Array, ArrayLike
from kickdyn.errors import KickdynError

ROUGHNESS, DEGREE = 3, 5
"""Order of the derivative that the penalty of smoothing is on, and degree of the spline."""

KNOT_SPACING, MOST_KNOTS = 0.01, 60
"""Least time between knots [s], and most intervals between them."""

GROWTH, BASE_GROWTH, GROWTH_TIME = 30.0, 10.0, 0.15
r"""Rates :math:`\gamma` at which the variance of the prior grows towards an impact [1/s], of joints
and of a floating base, which is heavier, and the time T before it in which it grows [s]. They are
chosen with `benchmarks/motion_coverage.py`, so that the deviations of synthetic kicks cover the
truth; the likelihood does not determine them."""


class SmoothingSpline:
    """A smoothing spline through configurations with information matrices.

    Args:
        model: model of the leg.
        times: times of the configurations, shape `(n,)` [s].
        q: configurations, shape `(n, nq)`.
        information: information matrix of each, in the tangent space, shape `(n, nv, nv)`.
        growth: rate at which the variance of the prior grows towards the last time, a number or
            shape `(nv,)` [1/s].
    """

    def __init__(
        self, model: Any, times: Array, q: Array, information: Array, growth: ArrayLike = 0.0
    ) -> None:
        self.model, self.begin, self.end = model, float(times[0]), float(times[-1])
        self.reference = q[-1]
        x = np.array([pin.difference(model, self.reference, one) for one in q])
        # information by x, whose tangent space is the reference's
        moved = np.array([pin.dIntegrate(model, self.reference, one, pin.ARG1) for one in x])
        weights = moved.transpose(0, 2, 1) @ information @ moved
        rates = np.broadcast_to(growth, model.nv).tolist()
        penalties = {rate: self._penalty(len(times), rate) for rate in set(rates)}
        b = self.basis(times)
        variances = np.linalg.inv(weights).diagonal(axis1=1, axis2=2)
        nv, size = x.shape[1], b.shape[1]
        normal = np.einsum("kjl,ka,kb->jalb", weights, b, b, optimize=True)
        for j, rate in enumerate(rates):
            penalty = penalties[rate]
            strength = _restricted_likelihood(b, penalty, x[:, j], variances[:, j])
            normal[j, :, j, :] += strength * penalty
        right = np.einsum("kjl,kl,ka->ja", weights, x, b, optimize=True).ravel()
        normal = normal.reshape(nv * size, nv * size)
        self._covariance = np.linalg.inv(normal).reshape(nv, size, nv, size)
        self._coefficients = np.linalg.solve(normal, right).reshape(nv, size)

    def _penalty(self, frames: int, growth: float) -> Array:
        """Set the basis of splines and return the penalty of their roughness."""
        duration = self.end - self.begin
        count = int(np.clip(duration / KNOT_SPACING, 4, min(MOST_KNOTS, frames)))
        inner = np.linspace(self.begin, self.end + 2.0 * duration / frames, count + 1)
        knots = np.concatenate([[inner[0]] * DEGREE, inner, [inner[-1]] * DEGREE])
        self.basis = BSpline(knots, np.eye(len(knots) - DEGREE - 1), DEGREE)
        nodes, gauss = np.polynomial.legendre.leggauss(3)
        width = inner[1] - inner[0]
        at = (inner[:-1, None] + 0.5 * width * (1.0 + nodes)).ravel()
        grown = growth * np.maximum(at - self.end, -GROWTH_TIME)
        amount = np.sqrt(0.5 * width * np.tile(gauss, count) * np.exp(-grown))
        rough = self.basis.derivative(ROUGHNESS)(at) * amount[:, None]
        return np.asarray(rough.T @ rough)

    def state(self, t: float) -> tuple[Array, Array, Array]:
        """Return q, v and the covariance of both, `(2 nv, 2 nv)`, at a time [s]."""
        rows = np.array([self.basis(t), self.basis.derivative()(t)])
        x, rate = rows @ self._coefficients.T
        moved = pin.dIntegrate(self.model, self.reference, x, pin.ARG1)
        covariance = np.einsum("sa,jalb,tb->sjtl", rows, self._covariance, rows, optimize=True)
        turned = np.einsum("ij,sjtl,kl->sitk", moved, covariance, moved, optimize=True)
        size = 2 * len(x)
        q = pin.integrate(self.model, self.reference, x)
        return q, moved @ rate, turned.reshape(size, size)


def _restricted_likelihood(b: Array, penalty: Array, y: Array, variances: Array) -> float:
    """Return the strength of the penalty of largest restricted likelihood for one coordinate."""
    gram, right = b.T @ (b / variances[:, None]), b.T @ (y / variances)
    rank = len(penalty) - ROUGHNESS
    scale = float(np.trace(gram) / np.trace(penalty))

    def cost(exponent: float) -> float:
        strength = scale * 10.0**exponent
        system = gram + strength * penalty
        sign, size = np.linalg.slogdet(system)
        if sign <= 0.0:
            return math.inf
        return float(size - rank * math.log(strength) - right @ np.linalg.solve(system, right))

    # stronger smoothing makes a parabola of what may be one, with deviations that are too small
    grid = np.arange(-14.0, 6.0)
    best = grid[int(np.argmin([cost(exponent) for exponent in grid]))]
    found = minimize_scalar(cost, bounds=(best - 1.0, best + 1.0), method="bounded")
    if not found.success:
        raise KickdynError("the smoothing of this motion was not found")
    return float(scale * 10.0 ** float(found.x))
