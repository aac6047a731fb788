import math

import numba
import numpy as np
import pytest

from kickdyn.core.simd import (
    BATCH,
    LARGEST_ANGLE,
    aligned_zeros,
    batches,
    choose,
    sine_and_cosine,
    spread,
)

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


@pytest.mark.parametrize("limit", [1.0, 5.0, -5.0])
def test_each_number_of_a_batch_is_computed_as_by_numpy(limit):
    floats = np.zeros((8, 2, BATCH))
    floats[0] = A, B
    compute(floats, limit)
    expected = [
        (A, B), (A + B, A - B), (A * B, A / B), (1 / A, 2 - A),
        (np.minimum(A, B), np.maximum(A, -B)), (np.sqrt(A * A), np.abs(A)),
        (np.where((A > 0) & (B <= 1) | (A == B), A, 0.5),
         np.where((limit <= A) | (limit < 0), 1.0, B)),
        (np.full(BATCH, 3.0), A * B / A),
    ]  # fmt: skip
    assert np.array_equal(floats, np.array(expected))  # to the last bit


def test_products_and_sums_are_rounded_separately():
    @numba.njit
    def compute(floats):
        rows = batches(floats)
        rows[2] = rows[0] * rows[0] + rows[1]

    floats = np.zeros((3, BATCH))
    floats[0], floats[1] = 1.0 + 2.0**-30, -1.0
    compute(floats)
    assert np.all(floats[2] == 2.0**-29)  # a fused multiply-add would keep 2**-60


def test_without_a_number_and_infinite_numbers():
    floats = np.zeros((8, 2, BATCH))
    floats[0, 0, :3], floats[0, 1, :3] = (np.nan, np.inf, 0.0), (1.0, np.nan, 0.0)
    with np.errstate(all="ignore"):
        compute(floats, np.inf)
    assert np.isnan(floats[1:4, 0, 0]).all()
    assert np.isnan(floats[2, 1, 2])
    assert floats[6, 0, 0] == 0.5  # no comparison with nan is true


RECORD = np.dtype([("matrix", float, (2, 2, BATCH)), ("number", float, BATCH)])


@numba.njit(error_model="numpy", _nrt=False)
def fill_records(floats):
    records = batches(floats)
    for k in range(1, len(records)):
        record, before = records[k], records[k - 1]
        record.number = before.number * before.matrix[0, 1]
        record.matrix[1, 0] = before.matrix[0, 1] - record.number
        record.matrix[1, 1] = 2.0


@pytest.mark.parametrize("offset", [0, 8])
def test_fields_of_records_are_batches(offset):
    memory = aligned_zeros((3 * RECORD.itemsize // 8 + BATCH,)).view(np.uint8)
    assert memory.ctypes.data % (8 * BATCH) == 0
    records = memory[offset : offset + 3 * RECORD.itemsize].view(RECORD)
    records["matrix"][:, 0, 1], records["number"][0] = A, B
    fill_records(records)
    numbers = np.array([B, B * A, B * A * A])
    assert np.array_equal(records["number"], numbers)
    assert np.array_equal(records["matrix"][1:, 1, 0], A - numbers[1:])
    assert (records["matrix"][1:, 1, 1] == 2.0).all()
    assert not records["matrix"][:, 0, 0].any()


def test_sine_and_cosine_of_a_batch():
    @numba.njit(error_model="numpy", _nrt=False)
    def compute(floats):
        rows = batches(floats)
        for k in range(rows.shape[1]):
            rows[1, k], rows[2, k] = sine_and_cosine(rows[0, k])

    rng, floats = np.random.default_rng(2), np.zeros((3, 60, BATCH))
    floats[0, :20] = rng.uniform(-4, 4, (20, BATCH))
    floats[0, 20:40] = rng.integers(-9, 10, (20, BATCH)) * (np.pi / 4)  # borders of the quadrants
    floats[0, 40:] = rng.uniform(-LARGEST_ANGLE, LARGEST_ANGLE, (20, BATCH))
    compute(floats)
    assert np.abs(floats[1] - np.sin(floats[0])).max() < 3e-16
    assert np.abs(floats[2] - np.cos(floats[0])).max() < 3e-16
