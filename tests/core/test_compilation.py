"""Machine code: where it is kept, batches as numpy has them; rotations, slopes and weights."""

import math
import os
import pickle
import subprocess
import sys

import numba
import numpy as np
import pytest
from scipy.integrate import DOP853
from tolerances import agrees, closed_form

from kickdyn.core.compilation import register_jitable_functions
from kickdyn.core.dop853 import COUNT, STAGES, WEIGHT, WHICH_RATE
from kickdyn.core.lanes import BATCH, LARGEST_ANGLE, batches, choose, sine_and_cosine, spread
from kickdyn.core.mechanics import difference_slopes, rotation_between

PLUS = """
import numba
from kickdyn.core.compilation import compiled, named

def plus(x):
    return x + 1.0

print(compiled(named(plus, "plus"), numba.float64(numba.float64), "a sum")(1.0))
"""


@pytest.fixture
def plus(tmp_path):
    """A process that compiles a function, and the folder in which it keeps that."""
    (tmp_path / "made.py").write_text(PLUS)
    where = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "kept")}

    def run():
        command = [sys.executable, "made.py"]
        return subprocess.run(command, cwd=tmp_path, env=where, capture_output=True, text=True)

    run()
    return run, sorted((tmp_path / "kept").rglob("*.nb?"))


@pytest.mark.parametrize("kind", ["empty", "garbage", "truncated"])
def test_damaged_machine_code_is_compiled_again(plus, kind):
    run, files = plus
    sizes = [file.stat().st_size for file in files]
    for file in files:
        content = file.read_bytes()
        half = content[: len(content) // 2]
        file.write_bytes({"empty": b"", "garbage": b"garbage", "truncated": half}[kind])
    ended = run()
    assert (ended.stdout, ended.stderr) == ("2.0\n", "")
    assert [file.stat().st_size for file in files] == sizes


@pytest.mark.processor_limit(6)
def test_machine_code_that_others_could_have_written_is_not_read(plus, tmp_path):
    run, files = plus
    code = f"open({str(tmp_path / 'planted')!r}, 'w')"
    for file in files:
        file.write_bytes(pickle.dumps(Planted(code)))
    files[0].parent.chmod(0o777)
    ended = run()
    assert ended.stdout == "2.0\n"
    assert "NUMBA_CACHE_DIR" in ended.stderr
    assert not (tmp_path / "planted").exists()
    files[0].parent.chmod(0o755)
    run()
    assert (tmp_path / "planted").exists()  # what is planted would run


class Planted:
    """What runs a program when it is unpickled."""

    def __init__(self, code):
        self.code = code

    def __reduce__(self):
        return exec, (self.code,)


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


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("apart", [0.0, 1e-16, 1e-12, 1e-9, 1e-6, 1e-3, 1.0])
def test_the_least_rotation_turns_one_direction_into_another(apart, sign):
    """Also of nearly equal and nearly opposite ones; its trace is 1 + 2 cos of the angle."""
    a, off = np.random.default_rng(0).normal(size=(2, 3))
    b = 0.3 * (sign * a + apart * off)
    turn, a, b = rotation_between(a, b), a / np.linalg.norm(a), b / np.linalg.norm(b)
    agrees(turn @ a, b, closed_form())
    agrees(turn @ turn.T, np.eye(3), closed_form())
    assert np.trace(turn) == pytest.approx(1.0 + 2.0 * a @ b, abs=closed_form())


def test_slopes_of_fourth_order_polynomials_are_exact():
    """Of rows with steps of their own, by each argument: d/dx (x^4 + x y), d/dy."""
    x, y, sizes = np.array([0.5, 2.0]), np.array([1.0, -3.0]), np.array([1e-2, 0.1])

    def values(change):
        a, b = x + change[:, 0], y + change[:, 1]
        return np.stack([a**4 + a * b, b**3, a - b], axis=1)

    slopes = difference_slopes(values, sizes, 2)
    right = np.stack([
        np.stack([4 * x**3 + y, np.zeros(2), np.ones(2)], axis=1),
        np.stack([x, 3 * y**2, -np.ones(2)], axis=1),
    ], axis=2)  # fmt: skip
    assert slopes.shape == (2, 3, 2)
    assert slopes == pytest.approx(right, rel=closed_form(100), abs=closed_form(100))


def rates(t, y):
    return np.array([y[1], -np.sin(y[0]) + 0.1 * t])


def test_a_step_by_the_table_is_scipys():
    solver = DOP853(rates, 0.0, np.array([0.3, -0.2]), 10.0, first_step=0.2, rtol=1e-6)
    y, h = solver.y.copy(), 0.2
    k = np.zeros((STAGES + 1, 2))
    k[0] = rates(0.0, y)

    def weighted(row):
        return sum(WEIGHT[row, j] * k[WHICH_RATE[row, j]] for j in range(COUNT[row]))

    for stage in range(1, STAGES):
        k[stage] = rates(DOP853.C[stage] * h, y + h * weighted(stage))
    solver.step()
    assert solver.t == pytest.approx(0.2, rel=closed_form())
    agrees(y + h * weighted(STAGES), solver.y, closed_form())
    k[STAGES] = rates(h, solver.y)
    agrees(k, solver.K, closed_form())
    # the estimates of the error are small differences of rates: they agree on the scale of these
    rounding = closed_form() * np.abs(k).max()
    np.testing.assert_allclose(weighted(STAGES + 1), k.T @ DOP853.E5, rtol=0, atol=rounding)
    np.testing.assert_allclose(weighted(STAGES + 2), k.T @ DOP853.E3, rtol=0, atol=rounding)
