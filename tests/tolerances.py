"""How closely a result agrees with what is right: one relative tolerance for each kind of method.

Use them as `rel` of `pytest.approx` or `rtol` of `assert_allclose`.
Vectors and matrices are compared on the scale of their largest entry with `agrees`.
"""

import numpy as np

EPSILON = float(np.finfo(float).eps)


def closed_form(condition=1.0):
    """A formula in floats: rounding of some hundred operations, times the condition number."""
    return 500 * EPSILON * max(condition, 1.0)


def integrated(tol, gain=100.0):
    """An integrator with relative tolerance `tol` per step, whose errors grow by `gain`."""
    return gain * tol


def optimized(tol=1e-6):
    """A nonlinear program or a root that ends at the relative tolerance `tol`."""
    return 10 * tol


def differenced(order=2):
    """Finite differences with the best step: central ones have order 2, one-sided ones 1."""
    return 100 * EPSILON ** (order / (order + 1))


def sampled(count, deviations=5.0):
    """A mean of `count` draws, in standard deviations of one draw."""
    return deviations / np.sqrt(count)


def agrees(result, right, tolerance):
    """Raise unless arrays differ by `tolerance` times the largest entry of `right` at most."""
    right = np.asarray(right, dtype=float)
    scale = np.abs(right).max(initial=0.0) or 1.0
    np.testing.assert_allclose(result, right, rtol=0, atol=tolerance * scale)
