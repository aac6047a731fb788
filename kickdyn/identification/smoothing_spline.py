r"""`SmoothingSpline`: a smooth curve of configurations through measured ones, with its covariance.

The curve is a B-spline of degree 5, :math:`x(t)`, in the tangent space at one configuration, that
minimises

.. math:: \sum_k |x(t_k) - x_k|^2_{W_k} + \sum_j \frac{1}{S_j} \int \left( e^{-g(t)} \ddddot x_j^2
    + e^{-g(t)/2} \dddot x_j^2 / \tau^2 \right) dt

with the information matrices :math:`W_k` of the configurations :math:`x_k`. Read as a Gaussian
prior, with g = 0, the jerk :math:`\dddot x_j` is a stationary process with the variance
:math:`S_j \tau / 2` and the correlation time :math:`\tau` (Ornstein-Uhlenbeck process), which
gives the covariance (Wahba 1983, J. R. Stat. Soc. B 45:133). Quadratics cost nothing. Each
:math:`S_j` has the largest restricted likelihood, times a log-normal prior: the few frames of a
swing alone would often determine it wrongly by decades.

The prior may grow towards the end (Pintore, Speckman & Holmes 2006, Biometrika 93:113), with
:math:`g(t) = \gamma (t - t_{end})`, at least :math:`-\gamma T`: a swing accelerates most just
before the impact. A prior that is the same at all times takes the end for as smooth as the
beginning, and then both the velocity at the end and its deviation are too small.
"""

import math
from typing import Any

import numpy as np
import pinocchio as pin
from scipy.interpolate import BSpline
from scipy.linalg import eigh
from scipy.optimize import minimize_scalar

from kickdyn.core.validation import Array
from kickdyn.errors import KickdynError
from kickdyn.robot.surgery import has_floating_base

DEGREE, FREE = 5, 3
"""Degree of the spline, and number of its polynomials that cost nothing, up to quadratics."""

KNOT_SPACING, MOST_KNOTS = 0.01, 60
"""Least time between knots [s], and most intervals between them."""

JERK_TIME = 0.05
r"""Time :math:`\tau` within which a jerk changes [s]: a knee turns by 1 rad in it before a kick."""

GROWTH, GROWTH_TIME = 50.0, 0.15
r"""Rate :math:`\gamma` at which the prior grows towards an impact [1/s], and the time T before it,
in which it grows [s]. The rate is chosen with `benchmarks/motion_coverage.py`, so that deviations
of synthetic kicks cover the truth; the likelihood does not determine it."""

ANGLE_DENSITY, TRANSLATION_DENSITY, DENSITY_DEVIATION = 6.0, 5.0, 1.5
r"""Medians of the prior of :math:`\log_{10} S`, with S in rad2/s7 or m2/s7, of an angle and of a
translation of a floating base, and its standard deviation. What changes by :math:`\Delta` within
:math:`\tau` has about :math:`\Delta^2 / \tau^7`: 0.03 rad or 0.01 m within 0.05 s are the medians,
a knee that turns by 1 rad in that time has :math:`10^{9.1}`, two deviations more."""

LARGEST_DEVIATION = 10.0
"""Deviation of a coordinate that is not determined in a frame [rad, m], for the likelihood."""


class SmoothingSpline:
    """A spline through q, `(n, nq)`, with information matrices; its prior has a growth [1/s]."""

    def __init__(
        self, model: Any, times: Array, q: Array, information: Array, growth: float = 0.0
    ) -> None:
        self.model, self.begin, self.end = model, float(times[0]), float(times[-1])
        self.reference = q[-1]
        x = np.array([pin.difference(model, self.reference, sample) for sample in q])
        # information by x, whose tangent space is the reference's
        jacobians = np.array([pin.dIntegrate(model, self.reference, row, pin.ARG1) for row in x])
        weights = jacobians.transpose(0, 2, 1) @ information @ jacobians
        least = np.eye(x.shape[1]) / LARGEST_DEVIATION**2
        variances = np.linalg.inv(weights + least).diagonal(axis1=1, axis2=2)
        penalty = self._set_basis(times, growth)
        b = self.basis(times) @ self._turned
        nv, size = x.shape[1], b.shape[1]
        medians = np.full(nv, ANGLE_DENSITY)
        if has_floating_base(model):
            medians[:3] = TRANSLATION_DENSITY
        normal = np.einsum("kjl,ka,kb->jalb", weights, b, b, optimize=True)
        for j, median in enumerate(medians.tolist()):
            density = _likely_density(b, penalty, x[:, j], variances[:, j], median)
            normal[j, :, j, :] += np.diag(penalty) / density
        right = np.einsum("kjl,kl,ka->ja", weights, x, b, optimize=True).ravel()
        normal = normal.reshape(nv * size, nv * size)
        scale = 1.0 / np.sqrt(normal.diagonal())  # entries differ by many decades
        inverse = np.linalg.inv(normal * scale * scale[:, None]) * scale * scale[:, None]
        self._covariance = inverse.reshape(nv, size, nv, size)
        self._coefficients = (inverse @ right).reshape(nv, size)

    def _set_basis(self, times: Array, growth: float) -> Array:
        """Set a basis of splines with a diagonal penalty, 0 for quadratics, and return the penalty.

        Strong smoothing then loses no digits (Demmler & Reinsch 1975, Numer Math 24:375).
        """
        duration = self.end - self.begin
        count = int(np.clip(duration / KNOT_SPACING, 4, min(MOST_KNOTS, len(times))))
        inner = np.linspace(self.begin, self.end + 2.0 * duration / len(times), count + 1)
        knots = np.concatenate([[inner[0]] * DEGREE, inner, [inner[-1]] * DEGREE])
        self.basis = BSpline(knots, np.eye(len(knots) - DEGREE - 1), DEGREE)
        nodes, gauss = np.polynomial.legendre.leggauss(3)
        width = inner[1] - inner[0]
        nodes = (inner[:-1, None] + 0.5 * width * (1.0 + nodes)).ravel()
        grown = growth * np.maximum(nodes - self.end, -GROWTH_TIME)
        amount = 0.5 * width * np.tile(gauss, count) * np.exp(-grown)
        jerk, rate = (self.basis.derivative(order)(nodes) for order in (3, 4))
        penalty = rate.T @ (rate * amount[:, None])
        penalty += jerk.T @ (jerk * (amount * np.exp(0.5 * grown))[:, None]) / JERK_TIME**2
        b = self.basis(times)
        size, gram = float(np.trace(penalty)), b.T @ b
        shares, self._turned = eigh(penalty / size, gram / np.trace(gram) + penalty / size)
        shares[:FREE] = 0.0
        return np.asarray(size * shares)

    def state(self, t: float) -> tuple[Array, Array, Array]:
        """Return q, v and the covariance of both, `(2 nv, 2 nv)`, at a time [s]."""
        rows = np.array([self.basis(t), self.basis.derivative()(t)]) @ self._turned
        x, rate = rows @ self._coefficients.T
        jacobian = pin.dIntegrate(self.model, self.reference, x, pin.ARG1)
        covariance = np.einsum("sa,jalb,tb->sjtl", rows, self._covariance, rows, optimize=True)
        transformed = np.einsum("ij,sjtl,kl->sitk", jacobian, covariance, jacobian, optimize=True)
        size = 2 * len(x)
        q = pin.integrate(self.model, self.reference, x)
        return q, jacobian @ rate, transformed.reshape(size, size)

    def rate(self, t: float) -> Array:
        """Return the derivatives of q, in its tangent space, and of v by time, `(2 nv,)`."""
        rows = np.array([self.basis.derivative(i)(t) for i in (0, 1, 2)]) @ self._turned
        x, *rates = rows @ self._coefficients.T
        jacobian = pin.dIntegrate(self.model, self.reference, x, pin.ARG1)
        return np.concatenate([jacobian @ rate for rate in rates])


def _likely_density(b: Array, penalty: Array, y: Array, variances: Array, median: float) -> float:
    gram, right = b.T @ (b / variances[:, None]), b.T @ (y / variances)

    def cost(exponent: float) -> float:
        system = gram + np.diag(10.0**-exponent * penalty)
        scale = 1.0 / np.sqrt(system.diagonal())
        scaled = system * scale * scale[:, None]
        solved = np.linalg.solve(scaled, scale * right)
        size = np.linalg.slogdet(scaled)[1] - 2.0 * np.log(scale).sum()
        rank = len(penalty) - FREE
        prior = ((exponent - median) / DENSITY_DEVIATION) ** 2
        fit = size + rank * math.log(10.0) * exponent - (scale * right) @ solved
        return float(fit + prior)

    grid = median + np.arange(-6.0, 7.0)
    best = grid[int(np.argmin([cost(exponent) for exponent in grid]))]
    minimum = minimize_scalar(cost, bounds=(best - 1.0, best + 1.0), method="bounded")
    if not minimum.success:
        raise KickdynError("no smoothing was found for this motion")
    return float(10.0 ** float(minimum.x))
