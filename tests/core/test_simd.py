"""A batch is computed number by number as numpy computes it, to the last bit."""

import math

import numba
import numpy as np
import pytest
from tolerances import closed_form

from kickdyn.core.compilation import register_jitable_functions
from kickdyn.core.lanes import BATCH, LARGEST_ANGLE, batches, choose, sine_and_cosine, spread

register_jitable_functions()

A, B = (np.random.default_rng(seed).uniform(-2, 2, BATCH) for seed in (0, 1))


@numba.njit(error_model="numpy", _nrt=False)
def compute(floats, limit):
    rows = batches(floats)
    a, b, zero = rows[0, 0], rows[0, 1], spread(0.0)
    rows[1, 0], rows[1, 1] = a + b, a - b
    rows[2, 0], rows[2, 1] = a * b, a / b
    rows[3, 0], rows[3, 1] = 1.0 / a, 2.0 - a
    rows[4, 0], rows[4, 1] = min(a, b), max(a, -b)
    rows[5, 0], rows[5, 1] = math.sqrt(a * a), math.fabs(a)
    rows[6, 0] = choose((a > 0.0) & (b <= 1.0) | (a == b), a, 0.5)
    rows[6, 1] = choose((a >= limit) | (limit < 0.0), 1.0, b)
    rows[7, 0] = 3.0
    rows[7, 1] += a
    rows[7, 1] *= b
    rows[7, 1] -= zero
    rows[7, 1] /= a
    rows[8, 0], rows[8, 1] = sine_and_cosine(a)
    rows[9, 0] = a * a + b  # products and sums are rounded separately
    rows[9, 1] = choose(a < b, 1.0, zero)


def computed(a, b, limit):
    floats = np.zeros((10, 2, BATCH))
    floats[0] = a, b
    with np.errstate(all="ignore"):
        compute(floats, limit)
    return floats


@pytest.mark.parametrize("limit", [1.0, 5.0, -5.0])
def test_operators_functions_and_choices(limit):
    floats = computed(A, B, limit)
    right = [
        (A, B), (A + B, A - B), (A * B, A / B), (1 / A, 2 - A),
        (np.minimum(A, B), np.maximum(A, -B)), (np.sqrt(A * A), np.abs(A)),
        (np.where((A > 0) & (B <= 1) | (A == B), A, 0.5),
         np.where((limit <= A) | (limit < 0), 1.0, B)),
        (np.full(BATCH, 3.0), A * B / A),
    ]  # fmt: skip
    np.testing.assert_array_equal(floats[:8], right)
    np.testing.assert_array_equal(floats[9, 1], 1.0 * (A < B))


def test_a_product_and_a_sum_are_not_fused():
    a, b = np.full(BATCH, 1.0 + 2.0**-30), np.full(BATCH, -1.0)
    assert set(computed(a, b, 1.0)[9, 0]) == {2.0**-29}  # fused, it would keep 2**-60


@pytest.mark.parametrize("size", [1.0, 40.0, LARGEST_ANGLE])
def test_sine_and_cosine_are_those_of_the_c_library(size):
    rng = np.random.default_rng(2)
    angles = rng.uniform(-size, size, (20, BATCH))
    angles[0] = rng.integers(-9, 10, BATCH) * (np.pi / 4)  # borders of the quadrants
    for row in angles:
        sine, cosine = computed(row, B, 1.0)[8]
        np.testing.assert_allclose(sine, list(map(math.sin, row)), rtol=0, atol=closed_form())
        np.testing.assert_allclose(cosine, list(map(math.cos, row)), rtol=0, atol=closed_form())
