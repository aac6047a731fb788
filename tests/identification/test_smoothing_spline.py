"""The smoothing spline of configurations: limits in closed form, its functional, its coverage."""

import numpy as np
import pinocchio as pin
import pytest
from chains import free_body
from tolerances import agrees, differenced, sampled

import kickdyn as kd
from kickdyn.identification import smoothing_spline
from kickdyn.identification.smoothing_spline import GROWTH, SmoothingSpline

MODEL = kd.Leg.human().model
TIMES = np.linspace(-0.15, 0.0, 76)
DEVIATION = 3e-3


def measured(curve, seed):
    noise = DEVIATION * np.random.default_rng(seed).normal(size=(len(TIMES), 3))
    return np.array([curve(TIMES)] * 3).T + noise


def spline(q, growth=0.0):
    information = np.tile(np.eye(3) / DEVIATION**2, (len(TIMES), 1, 1))
    return SmoothingSpline(MODEL, TIMES, q, information, growth)


def on_a_grid(y, density, growth, step=2e-3):
    """Return v and its deviation at 0 on a grid, which ends with the knots after the last time."""
    count = round((TIMES[-1] - TIMES[0] + 2 * 0.15 / 76) / step) + 1
    grid = TIMES[0] + step * np.arange(count)
    nearest = np.eye(count)[np.rint((TIMES - TIMES[0]) / step).astype(int)]
    hessian = nearest.T @ nearest / DEVIATION**2
    for order, share, size in ((3, 0.5, 1 / smoothing_spline.JERK_TIME**2), (4, 1.0, 1.0)):
        rows = np.diff(np.eye(count), order, axis=0) / step**order
        middles = grid[: len(rows)] + 0.5 * order * step
        grown = growth * np.maximum(middles, -smoothing_spline.GROWTH_TIME)
        hessian += rows.T @ (rows * (np.exp(-share * grown) * size * step / density)[:, None])
    covariance = np.linalg.inv(hessian)
    curve, k = covariance @ nearest.T @ y / DEVIATION**2, round(0.15 / step)
    slope = np.zeros(count)
    slope[[k - 1, k + 1]] = -0.5 / step, 0.5 / step
    return slope @ curve, np.sqrt(slope @ covariance @ slope)


@pytest.mark.parametrize("growth", [0.0, GROWTH])
@pytest.mark.parametrize("exponent", [7.0, 9.0])
def test_the_curve_minimises_its_functional(monkeypatch, growth, exponent):
    """Against a curve on a grid; the spline's knots are 10 ms apart."""
    monkeypatch.setattr(smoothing_spline, "_likely_density", lambda *_: 10.0**exponent)
    size = 10.0 ** ((exponent - 9.0) / 2.0)  # a density grows as the square of the curve
    q = measured(lambda t: size * np.tanh(t / 0.06), 4)
    _, v, covariance = spline(q, growth).state(0.0)
    for j in range(3):
        velocity, deviation = on_a_grid(q[:, j], 10.0**exponent, growth)
        assert np.sqrt(covariance[3 + j, 3 + j]) == pytest.approx(deviation, rel=0.03)
        assert v[j] == pytest.approx(velocity, abs=0.1 * deviation)


def test_a_density_of_which_the_measurement_says_nothing_is_the_median():
    rows, penalty = np.random.default_rng(1).normal(size=(20, 8)), np.linspace(1.0, 2.0, 8)
    penalty[: smoothing_spline.FREE] = 0.0
    found = smoothing_spline._likely_density(rows, penalty, rows[:, 0], np.full(20, 1e40), 7.3)
    assert np.log10(found) == pytest.approx(7.3, abs=1e-3)


def test_deviations_cover_curves_of_the_prior():
    """Curves whose jerk is an Ornstein-Uhlenbeck process, with densities of the prior."""
    rng, scores, fine = np.random.default_rng(7), [], 5e-4
    steps = round(0.15 / fine)
    decay = np.exp(-fine / smoothing_spline.JERK_TIME)
    for _ in range(15):
        prior = smoothing_spline.ANGLE_DENSITY, smoothing_spline.DENSITY_DEVIATION
        density = 10.0 ** rng.normal(*prior, 3)
        size = np.sqrt(density * smoothing_spline.JERK_TIME / 2)
        jerk = [size * rng.normal(size=3)]
        for _ in range(steps):
            jerk.append(decay * jerk[-1] + size * np.sqrt(1 - decay**2) * rng.normal(size=3))
        rates = [np.array(jerk)]  # then acceleration, velocity, position, by trapezoids
        for start in ((5.0, 3.0, 20.0), (3.0, -4.0, 2.0), (0.3, 0.5, -0.2)):
            steps_of_x = fine * (rates[-1][1:] + rates[-1][:-1]) / 2
            rates.append(start + np.vstack([np.zeros(3), np.cumsum(steps_of_x, axis=0)]))
        positions, velocity = rates[3][:: steps // 75], rates[2][-1]
        q = positions + DEVIATION * rng.normal(size=positions.shape)
        _, v, covariance = spline(q).state(0.0)
        scores.append((v - velocity) / np.sqrt(covariance.diagonal()[3:]))
    assert np.mean(np.square(scores)) == pytest.approx(1.0, abs=np.sqrt(2) * sampled(45, 4.0))


def test_a_free_body_by_differences(monkeypatch):
    """Without jerk, the covariance is that of a quadratic by weighted least squares.

    Where the body is at rest, errors of its angles turn no velocity. The acceleration is exact at
    the end, the reference. Medians of the prior are 0.01 m or 0.03 rad within 0.05 s.
    """
    model, priors, rng = free_body().leg.model, [], np.random.default_rng(2)
    monkeypatch.setattr(smoothing_spline, "_likely_density", lambda *x: priors.append(x) or 1e-20)
    times, factors = np.linspace(-1.0, 0.0, 12), rng.normal(size=(12, 6, 6))
    information = factors @ factors.transpose(0, 2, 1) + np.eye(6)
    information[-1] = 0.0
    square, line = 0.5 * rng.normal(size=(2, 6))

    def spline_of(line, number=0, change=0.0 * line):
        moved = np.outer(4 * times * (times + 1), square) + np.outer(times, line)
        q = np.array([pin.integrate(model, pin.neutral(model), x) for x in moved])
        q[number] = pin.integrate(model, q[number], change)
        return SmoothingSpline(model, times, q, information)

    def slopes(first, last):
        change = pin.difference(model, first[0], last[0])
        return np.concatenate([change, last[1] - first[1]]) / 2e-5

    still, rest, expected = spline_of(0.0 * line), -0.5, np.zeros((12, 12))
    _, _, _, variances, medians = zip(*priors, strict=True)
    assert medians == pytest.approx(np.log10(np.repeat([0.01, 0.03], 3) ** 2 / 0.05**7), abs=0.2)
    assert [x[-1] for x in variances] == pytest.approx([100.0] * 6)  # 10 m or rad
    for k in range(11):
        by_frame = np.transpose([slopes(*(spline_of(0.0 * line, k, x).state(rest) for x in (-e, e)))
                                 for e in 1e-5 * np.eye(6)])  # fmt: skip
        expected += by_frame @ np.linalg.inv(information[k]) @ by_frame.T
    agrees(still.state(rest)[2], expected, differenced())
    moving = spline_of(line).state
    for t, count in ((0.0, 12), (rest, 6)):
        right = slopes(moving(t - 1e-5), moving(t + 1e-5))
        agrees(spline_of(line).rate(t)[:count], right[:count], differenced())
