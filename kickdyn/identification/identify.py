r"""`identify`: launch, spin, drag, lift and wind from measured positions of a ball in flight.

The unknowns :math:`p` minimise the squared distance between the measured positions :math:`y_k` and
the positions of the flight that starts with them,

.. math:: \min_p \; \sum_k \frac{|x(t_k; p) - y_k|^2}{\sigma^2} + \frac{|\omega|^2}{\omega_0^2}

with :math:`x` the solution of the equations of `kickdyn.flight.forces` and :math:`\sigma` the noise
of a coordinate, estimated from the residuals: one value, or one of each axis where they differ by
more than chance explains, as where a camera measures depth less accurately. The last term says that
a spin is of the order of :math:`\omega_0` = 100 rad/s; it decides only where the measurement does
not. The covariance of the estimate is :math:`\sigma^2 (J^T J)^{-1}` with the derivatives :math:`J`
of the residuals, increased where neighbouring residuals are correlated.
"""

import math
from collections.abc import Callable, Iterable
from dataclasses import replace
from enum import StrEnum
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.polynomial import polynomial
from numpy.typing import NDArray
from scipy.optimize import least_squares

from kickdyn.aerodynamics.coefficient_model import ScaledCoefficient
from kickdyn.aerodynamics.drag import constant
from kickdyn.air import Air
from kickdyn.ball import Ball, BallState
from kickdyn.core import validation
from kickdyn.core.mechanics import GRAVITY
from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput, KickdynError
from kickdyn.flight.derivatives import INCREMENT, fly_with_slopes
from kickdyn.identification.identification_result import UNITS, Identification, covariance
from kickdyn.identification.track import Track, check_samples, mean_acceleration, refuse_units
from kickdyn.planning.problem import keep_last

LONGEST_FLIGHT = 30.0
"""Duration of a track [s] that is no flight of a ball."""

SPIN_SPREAD = 100.0
"""Order of magnitude of a spin [rad/s]: five professionals' curling free kicks have 106 rad/s on
average (Passmore et al. 2012)."""

FINEST_TOL, COARSEST_TOL = 1e-10, 1e-7
"""Relative tolerances of the integration: the least, and the first one."""

COST_TOL, PROFILE_COST_TOL, ROBUST_COST_TOL = 1e-8, 1e-6, 1e-4
"""Relative changes of the sum of squares at which a fit ends, less than 0.001 of a deviation; at
which one of a profile ends; and the robust one, which only chooses the outliers and the start."""

PROFILED, LARGEST_BEND = 2.0, 2.0
"""Distance from the estimate at which a profile is taken, in standard deviations; and the factor
by which the excess of the sum of squares may differ there from a quadratic function's."""

MOST_DOUBLINGS, MOST_MINIMA = 8, 4
"""Doublings of the distance of a profile, and minima from which a fit is repeated, at most."""

LARGEST_FACTOR = 10.0
"""Largest size of a coefficient or factor in a fit, and of a speed over the mean speed of the
measurement plus 10 m/s: a track that is no flight would lead there."""

LEAST_SHARE = 0.1
"""Least noise of an axis over that of another one: a column of zeros has none."""


class Free(StrEnum):
    """What can be sought beside the launch."""

    SPIN = "spin"
    DRAG = "drag"
    DRAG_SCALE = "drag-scale"
    LIFT_SCALE = "lift-scale"
    WIND = "wind"


AIR_NAMES = {
    Free.DRAG: ("drag",),
    Free.DRAG_SCALE: ("drag_scale",),
    Free.LIFT_SCALE: ("lift_scale",),
    Free.WIND: ("wind_x", "wind_y"),
}
"""Names of the unknowns of the air."""

LAUNCH, SPIN = ("x", "y", "z", "vx", "vy", "vz"), ("back_spin", "side_spin", "gyro_spin")
"""Names of the unknowns of the launch: position and velocity, and spin."""

Evaluation = tuple[Array, Array]
"""Residuals, shape `(3 n,)` [m], and their derivatives by the unknowns, shape `(3 n, p)`."""


@validation.check_arguments
def identify(
    track: Track, ball: Ball, air: Air | None = None, *, free: Iterable[str] = ("spin", "drag")
) -> Identification:
    """Return the flight that best fits measured positions, with standard deviations.

    `scipy.optimize.least_squares` fits the equations of motion to the positions, first with a loss
    that outliers hardly move (soft L1), then without the outliers.

    Args:
        track: positions in one flight, from after its start to before its end, without a bounce.
        ball: the ball; its mass and radius count.
        air: the air of the fit: density, coefficients and wind; None is `Air()`.
        free: unknowns besides the position and velocity at the first sample: `spin`, 0 without it;
            `drag`, one drag coefficient for the whole flight instead of the air's model;
            `drag-scale` and `lift-scale`, factors of the air's models; `wind`, its horizontal
            components.

    Raises:
        InvalidInput: fewer than 5 positions, samples a second or more apart, or no flight in
            metres.
        KickdynError: no flight could be fitted.
    """
    _check_flight(track)
    air = Air() if air is None else air
    problem = _Problem(track, ball, air, _sought(free, air))
    estimate = _fit(problem, _first_guess(problem))
    by_axis = _with_noise_by_axis(problem, estimate)
    if by_axis is not problem:
        problem, estimate = by_axis, _fit(by_axis, estimate.unknowns)
    for _ in range(MOST_MINIMA):
        result = _result(problem, estimate)
        factors, lower_minimum = _profiled(problem, estimate, result)
        if lower_minimum is None:
            break
        estimate = _fit(problem, lower_minimum)
    curved = tuple(name for name, factor in zip(result.names, factors, strict=True) if factor > 1.2)
    return replace(result, covariance=result.covariance * np.outer(factors, factors), curved=curved)


class _Problem(NamedTuple):
    """A measured track and its unknowns in world axes: position, velocity, spin if sought, air."""

    track: Track
    ball: Ball
    air: Air
    sought: tuple[Free, ...]
    noise_shares: Array = np.ones(3)  # of the axes, by which residuals are divided

    @property
    def length(self) -> float:
        return float(np.ptp(self.track.positions, axis=0).max())

    @property
    def air_names(self) -> list[str]:
        return [name for free in self.sought for name in AIR_NAMES.get(free, ())]

    @property
    def names(self) -> list[str]:
        return [*LAUNCH, *(SPIN if Free.SPIN in self.sought else ()), *self.air_names]

    @property
    def spin_columns(self) -> slice:
        return slice(len(LAUNCH), len(self.names) - len(self.air_names))

    def spin_rows(self, spread: float) -> Array:
        """Return rows that weigh a spin against its usual size; residuals deviate by `spread`."""
        return np.asarray(np.eye(len(self.names))[self.spin_columns] * spread / SPIN_SPREAD)

    def turn(self, unknowns: Array) -> Array:
        """Return the rotation of the spin to back, side and gyro spin, shape `(p, p)`."""
        rotation = np.eye(unknowns.size)
        if Free.SPIN in self.sought:
            columns = self.spin_columns
            rotation[columns, columns] = flight_axes(unknowns[3:6]).T
        return rotation

    def launch(self, unknowns: Array) -> tuple[BallState, Air]:
        """Return the state of the ball at the first sample, without its time, and the air."""
        spin = unknowns[self.spin_columns] if Free.SPIN in self.sought else np.zeros(3)
        state = BallState.computed(*(np.array(row) for row in (unknowns[:3], unknowns[3:6], spin)))
        of_air = unknowns[self.spin_columns.stop :].tolist()
        values = dict(zip(self.air_names, of_air, strict=True))
        changes: dict[str, Any] = {}
        if "drag" in values:
            changes["drag"] = constant(values["drag"])
        for kind in ("drag", "lift"):
            if f"{kind}_scale" in values:
                changes[kind] = ScaledCoefficient(getattr(self.air, kind), values[f"{kind}_scale"])
        if "wind_x" in values:
            changes["wind"] = (values["wind_x"], values["wind_y"], np.asarray(self.air.wind)[2])
        return state, replace(self.air, **changes)

    def evaluate(self, tol: float, unknowns: Array) -> Evaluation:
        """Return residuals and their derivatives, or raise `KickdynError` where a flight fails."""
        track, position, parameters = self.track, unknowns[:3], unknowns[3:]
        fastest = float(np.linalg.norm(np.ptp(track.positions, axis=0))) / track.duration + 10.0
        of_air = unknowns[self.spin_columns.stop :]
        is_coefficient = [name not in UNITS for name in self.air_names]
        largest = np.abs(of_air[is_coefficient]).max(initial=0.0)
        if np.abs(parameters[:3]).max() > LARGEST_FACTOR * fastest or largest > LARGEST_FACTOR:
            raise KickdynError("the fit leads to a speed or a coefficient far beyond any ball's")
        sizes = np.full(len(parameters), SPIN_SPREAD)
        sizes[:3] = max(float(np.linalg.norm(parameters[:3])), 1e-3)
        sizes[len(parameters) - len(of_air) :] = np.maximum(np.abs(of_air), 0.1)
        flight = fly_with_slopes(
            lambda changed: self.launch(np.concatenate([position, changed])),
            parameters, INCREMENT * sizes, self.ball, track.duration, tol,
        )  # fmt: skip
        times = track.times - track.times[0]
        residuals = (position + flight.states(times)[:, :3] - track.positions).ravel()
        slopes = flight.slopes(times).reshape(residuals.size, -1)
        slopes = np.hstack([np.tile(np.eye(3), (len(track), 1)), slopes])
        shares = np.tile(self.noise_shares, len(track))
        return residuals / shares, slopes / shares[:, None]


class _Estimate(NamedTuple):
    """The unknowns, residuals [m], their derivatives, which are used, and the tolerance."""

    unknowns: Array
    residuals: Array
    jacobian: Array
    used: NDArray[np.bool_]
    tol: float


def flight_axes(velocity: Array) -> Array:
    r"""Return the axes of back spin, side spin and gyro spin as columns, shape `(3, 3)`.

    Back spin turns about the right, and lifts the ball; gyro spin about the velocity :math:`t`;
    side spin about :math:`t \times l` with :math:`l` to the left, and bends the flight to the left.
    """
    speed = float(np.linalg.norm(velocity))
    along = velocity / speed if speed > 0.0 else np.array([1.0, 0.0, 0.0])
    left = np.array([-along[1], along[0], 0.0])
    size = float(np.linalg.norm(left))
    left = left / size if size > 1e-9 else np.array([0.0, 1.0, 0.0])
    return np.column_stack([-left, np.cross(along, left), along])


def _sought(free: Iterable[str], air: Air) -> tuple[Free, ...]:
    names = [free] if isinstance(free, str) else free
    chosen = {validation.choice("free", name, Free) for name in names}
    if {Free.DRAG, Free.DRAG_SCALE} <= chosen:
        raise InvalidInput(
            "free has drag and drag-scale: choose one, because the first replaces the model that "
            "the second scales"
        )
    for name, kind in ((Free.DRAG_SCALE, "drag"), (Free.LIFT_SCALE, "lift")):
        if name in chosen and getattr(air, kind) is None:
            raise InvalidInput(f"free has {name}, but the air has no {kind} model to scale")
    if Free.WIND in chosen and callable(air.wind):
        raise InvalidInput("free has wind, but the air's wind is a function of height")
    return tuple(name for name in Free if name in chosen)


def _check_flight(track: Track) -> None:
    check_samples(track)
    if not np.ptp(track.positions, axis=0).any():
        raise InvalidInput(
            f"the ball stays at {track.positions[0].tolist()} m: it does not move, so this is not "
            "a flight"
        )
    if track.duration > LONGEST_FLIGHT:
        raise InvalidInput(
            f"the samples last {track.duration:.4g} s, but no flight takes more than "
            f"{LONGEST_FLIGHT:g} s: leave out samples with wrong times"
        )
    refuse_units(track, -float(mean_acceleration(track)[2]))


def _first_guess(problem: _Problem) -> Array:
    """Return the unknowns of the best robust fit of several starts, whose spins bend the path."""
    launch, noise = _polynomial(problem.track)
    spins = [np.zeros(0)]
    if Free.SPIN in problem.sought:
        of_air = mean_acceleration(problem.track) + np.array([0.0, 0.0, GRAVITY])
        axis = np.cross(launch[3:6], of_air)
        # spins from which a fit starts [rad/s]
        spins = [size * axis / max(float(np.linalg.norm(axis)), 1e-300) for size in (20.0, 80.0)]
    # first guess of a constant C_D: its value above the drag crisis (Goff & Carre 2009)
    guesses = {"drag": 0.2, "drag_scale": 1.0, "lift_scale": 1.0}
    if Free.WIND in problem.sought:
        guesses["wind_x"], guesses["wind_y"], _ = np.asarray(problem.air.wind).tolist()
    of_air = [guesses[name] for name in problem.air_names]
    evaluate, prior = partial(problem.evaluate, COARSEST_TOL), problem.spin_rows(0.0)
    loss: dict[str, Any] = {"loss": "soft_l1", "f_scale": 3.0 * noise, "ftol": ROBUST_COST_TOL}
    starts = [np.concatenate([launch, spin, of_air]) for spin in spins]
    robust = [_minimise(evaluate, start, prior, **loss) for start in starts]
    return min(robust, key=lambda fit: fit[0])[1]


def _with_noise_by_axis(problem: _Problem, estimate: _Estimate) -> _Problem:
    """Return the problem with the noise of each axis, over the root of the mean of its squares."""
    sizes = np.abs(estimate.residuals).reshape(-1, 3)
    noise = np.median(sizes, axis=0)
    noise = np.maximum(noise, LEAST_SHARE * noise.max())
    # the logarithm of a ratio of two medians deviates by about 1.7 over the root of the number,
    # and by 3.5 times that hardly by chance
    by_chance = math.exp(6.0 * _widening(problem, estimate) / math.sqrt(len(sizes)))
    if noise.max() <= noise.min() * by_chance:
        return problem
    return problem._replace(noise_shares=noise / math.sqrt(float(np.square(noise).mean())))


def _fit(problem: _Problem, unknowns: Array) -> _Estimate:
    residuals, jacobian = problem.evaluate(COARSEST_TOL, unknowns)
    used, tol = np.zeros(residuals.size, dtype=bool), COARSEST_TOL
    length = problem.length
    for _ in range(4):  # the spread of the residuals and the outliers depend on each other
        spread = max(1.4826 * float(np.median(np.abs(residuals))), 100.0 * FINEST_TOL * length)
        farthest = np.abs(residuals).reshape(-1, 3).max(axis=1)
        # Residuals of more than 4.5 standard deviations are left out: in normally distributed noise
        # seven of a million are. At least 90 % of the samples are used: where more are far off, the
        # model does not describe the flight.
        limit = max(4.5 * spread, float(np.quantile(farthest, 0.9)))
        used_before, used = used, np.repeat(farthest <= limit, 3)
        tol_before, tol = tol, min(max(1e-3 * spread / length, FINEST_TOL), COARSEST_TOL)
        if np.array_equal(used_before, used) and tol == tol_before:
            break
        evaluate = partial(problem.evaluate, tol)
        _, unknowns = _minimise(evaluate, unknowns, problem.spin_rows(spread), used)
        residuals, jacobian = evaluate(unknowns)
    return _Estimate(unknowns, residuals, jacobian, used, tol)


def _polynomial(track: Track) -> tuple[Array, float]:
    """Return a guess of position and velocity, `(6,)`, and of the noise [m], by polynomials."""
    times = (track.times - track.times[0]) / track.duration
    degree = 2 if len(track) < 9 else 3 if len(track) < 30 else 5
    inliers = np.ones(len(track), dtype=bool)
    for _ in range(4):
        fit = polynomial.polyfit(times[inliers], track.positions[inliers], degree)
        residuals = track.positions - polynomial.polyval(times, fit).T
        noise = max(1.4826 * float(np.median(np.abs(residuals[inliers]))), 1e-12)
        inliers = np.abs(residuals).max(axis=1) < 6.0 * noise
        if inliers.sum() <= degree + 1:
            break
    return np.concatenate([fit[0], fit[1] / track.duration]), noise


def _minimise(
    evaluate: Callable[[Array], Evaluation],
    start: Array,
    prior: Array,
    used: NDArray[np.bool_] | slice = slice(None),
    targets: Array | float = 0.0,
    ftol: float = COST_TOL,
    **options: Any,
) -> tuple[float, Array]:
    """Return the least cost and the unknowns.

    The residuals are `used` ones of `evaluate`, and prior rows times the unknowns, less `targets`.
    Where there is no flight, `evaluate` raises `KickdynError`, which ends the fit at its start
    only.
    """
    residuals, slopes = evaluate(start)
    # residuals where no flight can be integrated [m], so large that no step of a solver ends there
    failed = np.full(residuals.size, 1e6), slopes

    @keep_last
    def residuals_and_slopes(unknowns: Array) -> Evaluation:
        try:
            residuals, slopes = evaluate(unknowns)
        except KickdynError:
            residuals, slopes = failed
        residuals = np.concatenate([residuals[used], prior @ unknowns - targets])
        return residuals, np.vstack([slopes[used], prior])

    result = least_squares(
        lambda unknowns: residuals_and_slopes(unknowns)[0],
        start,
        jac=lambda unknowns: residuals_and_slopes(unknowns)[1],
        x_scale="jac", ftol=ftol, xtol=1e-12, gtol=1e-15, max_nfev=60, **options,
    )  # fmt: skip
    return float(result.cost), result.x


def _result(problem: _Problem, estimate: _Estimate) -> Identification:
    residuals = estimate.residuals[estimate.used]
    freedom = max(residuals.size - estimate.unknowns.size, 1)
    noise = math.sqrt(float(residuals @ residuals) / freedom)
    widening = _widening(problem, estimate)
    spread = noise * widening
    rows = np.vstack([estimate.jacobian[estimate.used], problem.spin_rows(spread)])
    unknowns = estimate.unknowns
    turn = problem.turn(unknowns)
    launch, air = problem.launch(unknowns)
    return Identification(
        track=problem.track,
        ball=problem.ball,
        air=air,
        launch=replace(launch, time=float(problem.track.times[0])),
        names=tuple(problem.names),
        estimates=turn @ unknowns,
        covariance=spread**2 * turn @ covariance(rows) @ turn.T,
        residuals=estimate.residuals.reshape(-1, 3) * problem.noise_shares,
        used=estimate.used.reshape(-1, 3)[:, 0],
        noise=noise,
        widening=widening,
    )


def _profiled(
    problem: _Problem, estimate: _Estimate, result: Identification
) -> tuple[Array, Array | None]:
    r"""Return the factor on the deviations, 1 or more, and a lower minimum if there is one.

    The sum of squares over :math:`\sigma^2` exceeds its minimum by :math:`k^2` at k deviations of
    an unknown, with all others at their best, if it is quadratic. If it is not, the deviation is
    half the distance at which the excess is 4 (the profile likelihood), or more.
    """
    spread = result.noise * result.widening
    deviations = np.sqrt(np.diag(result.covariance))
    if spread < 10.0 * estimate.tol * problem.length:  # the integration is less exact
        return np.ones(deviations.size), None
    turn, prior = problem.turn(estimate.unknowns), problem.spin_rows(spread)
    evaluate = partial(problem.evaluate, estimate.tol)

    def excess(unknowns: Array) -> float:
        try:
            residuals, _ = evaluate(unknowns)
        except KickdynError:
            return math.inf
        rows = np.concatenate([residuals[estimate.used], prior @ unknowns])
        return float(rows @ rows) / spread**2 - least

    least = 0.0
    least = excess(estimate.unknowns)
    widened = deviations.copy()
    for j, name in enumerate(result.names):
        if name in LAUNCH or name in result.undetermined:
            continue
        direction = turn.T @ result.covariance[:, j] / deviations[j]  # others at their best
        for sign in (-1.0, 1.0):
            distance = sign * PROFILED
            unknowns = estimate.unknowns + distance * direction
            if 1.0 / LARGEST_BEND < excess(unknowns) / PROFILED**2 < LARGEST_BEND:
                continue
            weight = 100.0 * spread / deviations[j]
            rows = np.vstack([prior, weight * turn[j]])
            for _ in range(MOST_DOUBLINGS):
                value = result.estimates[j] + distance * deviations[j]
                targets = np.append(np.zeros(len(prior)), weight * value)
                try:
                    used, ftol = estimate.used, PROFILE_COST_TOL
                    _, unknowns = _minimise(evaluate, unknowns, rows, used, targets, ftol=ftol)
                except KickdynError:
                    break
                above = excess(unknowns)
                if above < -0.1:
                    return np.ones(deviations.size), unknowns
                shift = np.abs(turn @ (unknowns - estimate.unknowns))
                widened = np.maximum(widened, shift / math.sqrt(max(above, PROFILED**2)))
                if above > PROFILED**2:
                    break
                distance *= 2.0
                unknowns = 2.0 * unknowns - estimate.unknowns
    return widened / deviations, None


def _widening(problem: _Problem, estimate: _Estimate) -> float:
    r"""Return the factor by which correlated residuals widen the deviations, 1 without correlation.

    With a correlation :math:`\rho` of neighbouring residuals, n samples say as much as
    :math:`n (1 - \rho) / (1 + \rho)` independent ones (Bayley & Hammersley 1946).
    """
    rows = np.where(estimate.used, estimate.residuals, 0.0).reshape(-1, 3)
    products = float((rows[1:] * rows[:-1]).sum())
    correlation = min(products / max(float((rows * rows).sum()), 1e-300), 0.98)
    if correlation < 2.0 / math.sqrt(estimate.used.sum()):  # which chance explains
        return 1.0
    return math.sqrt((1.0 + correlation) / (1.0 - correlation))
