r"""`identify`: launch, spin, drag, lift and wind from measured positions of a ball in flight.

The unknowns :math:`p` minimise the squared distance between the measured positions :math:`y_k` and
the positions of the flight that starts with them,

.. math:: \min_p \; \sum_k \frac{|x(t_k; p) - y_k|^2}{\sigma^2} + \frac{|\omega|^2}{\omega_0^2}

with :math:`x` the solution of the equations of `kickdyn.flight.forces` and :math:`\sigma` the noise
of a coordinate, estimated from the residuals. The last term says that a spin is of the order of
:math:`\omega_0` = 100 rad/s; it decides only what the measurement leaves open. The covariance of
the estimate is :math:`\sigma^2 (J^T J)^{-1}` with the derivatives :math:`J` of the residuals,
increased where neighbouring residuals are correlated.
"""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from enum import StrEnum
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import least_squares

from kickdyn.aerodynamics.coefficient_model import Coefficient, find_model, scaled
from kickdyn.aerodynamics.drag import MODELS, constant
from kickdyn.air import Air
from kickdyn.ball import Ball, BallState
from kickdyn.core import validation
from kickdyn.core.mechanics import GRAVITY
from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput, KickdynError
from kickdyn.flight.derivatives import INCREMENT, DifferentiableFlight, fly_with_slopes
from kickdyn.ground import Ground
from kickdyn.identification.identification_result import Identification, ModelScore
from kickdyn.identification.track import Track, refuse_intervals, refuse_units
from kickdyn.planning.problem import keep_last

LEAST_SAMPLES = 5
"""Fewer positions do not determine a launch together with its standard deviations."""

SPIN_SPREAD = 100.0
"""Order of magnitude of a spin [rad/s]: five professionals' curling free kicks have 106 rad/s on
average (Passmore et al. 2012)."""

FIRST_SPINS = (20.0, 80.0)
"""Spins from which a fit starts [rad/s]."""

OUTLIER = 4.5
"""Residuals of more than this many standard deviations are left out: in normally distributed noise
seven of a million are."""

LEAST_USED_FRACTION = 0.9
"""Fraction of the samples that are used at least."""

FINEST_TOL, COARSEST_TOL = 1e-10, 1e-7
"""Relative tolerances of the integration: the least, and the first one."""

COST_TOL, ROBUST_COST_TOL = 1e-8, 1e-4
"""Relative change of the sum of squares at which a fit ends, less than 0.001 of a deviation; and at
which the robust one ends, which only chooses the outliers and the start of the other."""

FAILED_RESIDUAL = 1e6
"""Residual where no flight can be integrated [m]: no step of a solver ends there."""

FIRST_DRAG = 0.2
"""First guess of a constant C_D: its value above the drag crisis (Goff & Carre 2009)."""

LARGEST_COEFFICIENT, LARGEST_SPEED = 10.0, 10.0
"""Largest size of a coefficient or factor, and of a speed over the mean speed of the measurement
plus 10 m/s, in a fit: what is no flight would lead there."""


class Free(StrEnum):
    """What can be sought beside the launch."""

    SPIN = "spin"
    DRAG = "drag"
    DRAG_SCALE = "drag-scale"
    LIFT_SCALE = "lift-scale"
    WIND = "wind"


NAMES = {
    Free.SPIN: ("back_spin", "side_spin", "gyro_spin"),
    Free.DRAG: ("drag",),
    Free.DRAG_SCALE: ("drag_scale",),
    Free.LIFT_SCALE: ("lift_scale",),
    Free.WIND: ("wind_x", "wind_y"),
}
"""Names of the unknowns that each brings."""

COEFFICIENTS = ("drag", "drag_scale", "lift_scale")
"""Unknowns without a unit."""

LAUNCH = ("x", "y", "z", "vx", "vy", "vz")
"""Names of the first six unknowns of each flight."""

Evaluation = tuple[Array, Array]
"""Residuals, shape `(3 n,)` [m], and their derivatives by the unknowns, shape `(3 n, p)`."""


@validation.check_arguments
def identify(
    track: Track | Sequence[Track],
    ball: Ball,
    air: Air | None = None,
    *,
    free: Iterable[str] = ("spin", "drag"),
    spin: ArrayLike = (0.0, 0.0, 0.0),
    ground: Ground | None = None,
    compare: Sequence[str | Air] = (),
) -> Identification:
    r"""Return the flight that best fits measured positions, with standard deviations.

    `scipy.optimize.least_squares` fits the equations of motion to the positions, first with a loss
    that outliers hardly move (soft L1), then, without the outliers, in the sense of least squares.
    The derivatives come from `fly_with_slopes`.

    Args:
        track: positions in one flight, from after its start to before its end, without a bounce; or
            several such tracks, whose flights then share drag, lift and wind.
        ball: the ball; its mass and radius count.
        air: the air of the fit: density, coefficients and wind; None is `Air()`.
        free: unknowns besides the position and velocity at the first sample: `spin`; `drag`,
            one drag coefficient for the whole flight instead of the air's model; `drag-scale` and
            `lift-scale`, factors of the air's models; `wind`, its horizontal components.
        spin: known spin, shape `(3,)` [rad/s, world frame]; it is used unless `free` contains
            `spin`.
        ground: the ground; a ball that is under it is refused. None means that its height is
            unknown.
        compare: drag models by name, or airs, which are ranked: each is fitted to the first half of
            each flight and predicts the second one. The fit itself uses `air`.

    Raises:
        InvalidInput: fewer than 5 positions, samples a second or more apart, positions that are no
            flight in metres, or a wrong argument.
        KickdynError: no flight could be fitted.
    """
    tracks = _tracks(track)
    air = Air() if air is None else air
    sought = _sought(free, air)
    known = validation.vector("spin", spin, 3, unit="rad/s")
    for flight in tracks:
        _check_flight(flight, ball, ground)
    rivals = [_rival(model, air, tracks) for model in compare]
    problem = _Problem(tracks, ball, air, sought, known)
    result = _result(problem, _fit(problem))
    scores = [_score(*rival, problem) for rival in rivals]
    return replace(result, comparison=tuple(sorted(scores, key=lambda s: s.prediction_rms)))


class _Problem(NamedTuple):
    """Measured tracks and what is sought of them."""

    tracks: tuple[Track, ...]
    ball: Ball
    air: Air
    sought: tuple[Free, ...]
    known_spin: Array

    @property
    def seeks_spin(self) -> bool:
        """Whether the spins are sought."""
        return Free.SPIN in self.sought

    @property
    def per_flight(self) -> int:
        """Number of unknowns of each flight alone."""
        return 9 if self.seeks_spin else 6

    @property
    def shared(self) -> list[str]:
        """Names of the unknowns that all flights share."""
        return [name for free in self.sought if free != Free.SPIN for name in NAMES[free]]

    @property
    def names(self) -> list[str]:
        """Names of all unknowns; with several flights they end in the number of the flight."""
        names = [*LAUNCH, *(NAMES[Free.SPIN] if self.seeks_spin else ())]
        count = len(self.tracks)
        if count > 1:
            names = [f"{name}_{i}" for i in range(count) for name in names]
        return [*names, *self.shared]

    def flight_columns(self, i: int) -> slice:
        """Return the places of the unknowns of flight i alone among all unknowns."""
        return slice(i * self.per_flight, (i + 1) * self.per_flight)

    def shared_values(self, unknowns: Array) -> dict[str, float]:
        """Return the unknowns that all flights share, by name."""
        first = len(self.tracks) * self.per_flight
        return dict(zip(self.shared, unknowns[first:].tolist(), strict=True))

    def air_of(self, shared: Mapping[str, float]) -> Air:
        """Return the air with the given coefficients and wind."""
        changes: dict[str, Any] = {}
        if "drag" in shared:
            changes["drag"] = constant(shared["drag"])
        for kind in ("drag", "lift"):
            model = getattr(self.air, kind)
            if f"{kind}_scale" in shared and model is not None:
                changes[kind] = scaled(model, shared[f"{kind}_scale"])
        if "wind_x" in shared:
            changes["wind"] = (shared["wind_x"], shared["wind_y"], 0.0)
        return replace(self.air, **changes)


class _Estimate(NamedTuple):
    """An estimate: the unknowns, the axes of each spin, residuals [m], and which are used."""

    unknowns: Array
    axes: list[Array]
    residuals: Array
    jacobian: Array
    used: NDArray[np.bool_]


def flight_axes(velocity: Array) -> Array:
    r"""Return the axes of back spin, side spin and gyro spin as columns, shape `(3, 3)`.

    With the unit vector :math:`t` along the velocity and :math:`l` horizontal, to its left: back
    spin turns about :math:`-l` and lifts the ball, side spin about :math:`t \times l` and bends the
    flight to the left, gyro spin about :math:`t`.
    """
    speed = float(np.linalg.norm(velocity))
    along = velocity / speed if speed > 0.0 else np.array([1.0, 0.0, 0.0])
    left = np.array([-along[1], along[0], 0.0])
    size = float(np.linalg.norm(left))
    left = left / size if size > 1e-9 else np.array([0.0, 1.0, 0.0])
    return np.column_stack([-left, np.cross(along, left), along])


def _tracks(track: Track | Sequence[Track]) -> tuple[Track, ...]:
    """Return one track or several as a tuple."""
    tracks = (track,) if isinstance(track, Track) else track
    if not isinstance(tracks, Sequence) or not tracks:
        raise InvalidInput(
            f"track is {validation.brief(track)}: it must be a kickdyn.Track or a list of them"
        )
    for i, entry in enumerate(tracks):
        if not isinstance(entry, Track):
            raise InvalidInput(
                f"track {i} is {validation.brief(entry)}: it must be a kickdyn.Track"
            )
    return tuple(tracks)


def _sought(free: Iterable[str], air: Air) -> tuple[Free, ...]:
    """Return what is sought, without repetitions, in the order of `Free`."""
    names = [free] if isinstance(free, str) else free
    chosen = {validation.choice("free", name, Free) for name in names}
    if {Free.DRAG, Free.DRAG_SCALE} <= chosen:
        raise InvalidInput(
            "free has drag and drag-scale: take one, because the first replaces the model that the "
            "second scales"
        )
    for name, kind in ((Free.DRAG_SCALE, "drag"), (Free.LIFT_SCALE, "lift")):
        if name in chosen and getattr(air, kind) is None:
            raise InvalidInput(f"free has {name}, but the air has no {kind} model to scale")
    if Free.WIND in chosen and callable(air.wind):
        raise InvalidInput("free has wind, but the air's wind is a function of height")
    return tuple(name for name in Free if name in chosen)


def _check_flight(track: Track, ball: Ball, ground: Ground | None) -> None:
    """Raise `InvalidInput` unless a track may be a flight, in metres."""
    if len(track) < LEAST_SAMPLES:
        raise InvalidInput(
            f"a flight has {len(track)} positions: at least {LEAST_SAMPLES} are needed"
        )
    if ground is not None:
        lowest = int(np.argmin(track.positions[:, 2]))
        height = float(track.positions[lowest, 2])
        if height < ground.height:
            raise InvalidInput(
                f"the ball is at {height:.4g} m at {track.times[lowest]:.10g} s, below the "
                f"ground at {ground.height:g} m: give the ground's height in the track's "
                "coordinates"
            )
    refuse_intervals(track)
    if not np.ptp(track.positions, axis=0).any():
        raise InvalidInput(
            f"the ball stays at {track.positions[0].tolist()} m: it does not move, so this is not "
            "a flight"
        )
    falling = -2.0 * np.polyfit(track.times - track.times[0], track.positions[:, 2], 2)[0]
    refuse_units(track, float(falling))


def _fit(problem: _Problem) -> _Estimate:
    """Return the best estimate of several starts."""
    polynomials = [_polynomial(track) for track in problem.tracks]
    noise = float(np.median([noise for _, noise in polynomials]))
    launches = [launch for launch, _ in polynomials]
    axes = [flight_axes(launch[3:6]) for launch in launches]
    sizes = FIRST_SPINS if problem.seeks_spin else (0.0,)
    starts = [_start(problem, launches, axes, size) for size in sizes]
    tol = COARSEST_TOL
    evaluate = partial(_evaluate, problem, axes, tol)
    if evaluate(starts[0]) is None:
        raise KickdynError(
            "no flight could be integrated from the first guess of the launch: check the units and "
            "that the samples are one flight"
        )
    prior = _spin_rows(problem, 0.0)
    robust = [_minimise(evaluate, start, prior, robust_scale=3.0 * noise) for start in starts]
    _, unknowns = min(robust, key=lambda fit: fit[0])
    residuals, jacobian = evaluate(unknowns) or _impossible()
    used = np.zeros(residuals.size, dtype=bool)
    longest = max(float(np.ptp(track.positions, axis=0).max()) for track in problem.tracks)
    for _ in range(4):  # the spread of the residuals and the outliers depend on each other
        spread = _spread(residuals, longest)
        used_before, used = used, np.repeat(~_outliers(residuals, spread), 3)
        tol_before, tol = tol, min(max(1e-3 * spread / longest, FINEST_TOL), COARSEST_TOL)
        if np.array_equal(used_before, used) and tol == tol_before:
            break
        evaluate = partial(_evaluate, problem, axes, tol)
        _, unknowns = _minimise(evaluate, unknowns, _spin_rows(problem, spread), used)
        residuals, jacobian = evaluate(unknowns) or _impossible()
    return _Estimate(unknowns, axes, residuals, jacobian, used)


def _outliers(residuals: Array, spread: float) -> NDArray[np.bool_]:
    """Return which samples are too far off, shape `(n,)`: a tenth of them at most.

    Where more samples are far off, they are no outliers: the model does not describe the flight.
    """
    farthest = np.abs(residuals).reshape(-1, 3).max(axis=1)
    limit = max(OUTLIER * spread, float(np.quantile(farthest, LEAST_USED_FRACTION)))
    return np.asarray(farthest > limit)


def _impossible() -> Evaluation:
    raise KickdynError(
        "the fitted flight could not be integrated: check the units, and that the samples are one "
        "flight"
    )


def _polynomial(track: Track) -> tuple[Array, float]:
    """Return a first guess of position and velocity, shape `(6,)`, and of the noise [m].

    They come from polynomials in time, fitted without the samples that are far from them.
    """
    times = track.times - track.times[0]
    degree = 2 if len(track) < 9 else 3 if len(track) < 30 else 5
    span = max(track.duration, 1e-300)
    kept = np.ones(len(track), dtype=bool)
    for _ in range(4):
        fit = np.polynomial.polynomial.polyfit(times[kept] / span, track.positions[kept], degree)
        residuals = track.positions - np.polynomial.polynomial.polyval(times / span, fit).T
        noise = max(1.4826 * float(np.median(np.abs(residuals[kept]))), 1e-12)
        kept = np.abs(residuals).max(axis=1) < 6.0 * noise
        if kept.sum() <= degree + 1:
            break
    return np.concatenate([fit[0], fit[1] / span]), noise


def _start(problem: _Problem, launches: list[Array], axes: list[Array], size: float) -> Array:
    """Return a first guess of all unknowns; spins have a size, and the axis that bends the path."""
    guesses: list[Array] = []
    for track, launch, columns in zip(problem.tracks, launches, axes, strict=True):
        guesses.append(launch)
        if problem.seeks_spin:
            times = track.times - track.times[0]
            bend = 2.0 * np.polyfit(times, track.positions, 2)[0] + [0.0, 0.0, GRAVITY]
            axis = np.cross(launch[3:6], bend)
            guesses.append(size * columns.T @ axis / max(float(np.linalg.norm(axis)), 1e-300))
    first = {"drag": FIRST_DRAG, "drag_scale": 1.0, "lift_scale": 1.0}
    if "wind_x" in problem.shared:
        wind = np.asarray(problem.air.wind)
        first |= {"wind_x": float(wind[0]), "wind_y": float(wind[1])}
    return np.concatenate([*guesses, [first[name] for name in problem.shared]])


def _evaluate(
    problem: _Problem, axes: list[Array], tol: float, unknowns: Array
) -> Evaluation | None:
    """Return residuals and their derivatives; None where a flight fails."""
    shared = problem.shared_values(unknowns)
    if any(abs(shared.get(name, 0.0)) > LARGEST_COEFFICIENT for name in COEFFICIENTS):
        return None
    residuals: list[Array] = []
    blocks: list[Array] = []
    first_shared = unknowns.size - len(shared)
    for i, track in enumerate(problem.tracks):
        columns = problem.flight_columns(i)
        values = unknowns[columns]
        flight = _fly(problem, track, axes[i], np.concatenate([values, [*shared.values()]]), tol)
        if flight is None:
            return None
        times = track.times - track.times[0]
        moved = flight.states(times)[:, :3]
        residuals.append((values[:3] + moved - track.positions).ravel())
        slopes = flight.slopes(times).reshape(residuals[-1].size, -1)
        block = np.zeros((len(slopes), unknowns.size))
        block[:, columns] = np.hstack(
            [np.tile(np.eye(3), (len(track), 1)), slopes[:, : values.size - 3]]
        )
        block[:, first_shared:] = slopes[:, values.size - 3 :]
        blocks.append(block)
    return np.concatenate(residuals), np.vstack(blocks)


def _fly(
    problem: _Problem, track: Track, axes: Array, values: Array, tol: float
) -> DifferentiableFlight | None:
    """Return the flight over the times of a track; None where it fails or is far too fast.

    The values are position, velocity and, where it is sought, spin in the given axes, then the
    unknowns that all flights share. The derivatives are by all but the position, which moves the
    flight without a change.
    """
    position, parameters = values[:3], values[3:]
    duration = float(track.times[-1] - track.times[0])
    usual = float(np.linalg.norm(np.ptp(track.positions, axis=0))) / duration + 10.0
    if np.abs(parameters[:3]).max() > LARGEST_SPEED * usual:
        return None
    spins = 3 if problem.seeks_spin else 0

    def launch(changed: Array) -> tuple[BallState, Air]:
        spin = axes @ changed[3:6] if problem.seeks_spin else problem.known_spin
        shared = dict(zip(problem.shared, changed[3 + spins :].tolist(), strict=True))
        state = BallState.computed(np.array(position), np.array(changed[:3]), np.array(spin))
        return state, problem.air_of(shared)

    speed = max(float(np.linalg.norm(parameters[:3])), 1e-3)
    sizes = [
        *3 * [speed],
        *spins * [SPIN_SPREAD],
        *np.maximum(np.abs(parameters[3 + spins :]), 0.1),
    ]
    increments = INCREMENT * np.array(sizes)
    try:
        return fly_with_slopes(launch, parameters, increments, problem.ball, duration, tol)
    except KickdynError:
        return None


def _minimise(
    evaluate: Callable[[Array], Evaluation | None],
    start: Array,
    prior: Array,
    used: NDArray[np.bool_] | None = None,
    robust_scale: float | None = None,
) -> tuple[float, Array]:
    """Return the least cost and the unknowns.

    Args:
        evaluate: returns residuals and derivatives, or None where there is no flight.
        start: the first guess of the unknowns.
        prior: rows whose products with the unknowns are residuals, too.
        used: which residuals count; None for all.
        robust_scale: scale of the robust loss soft L1 [m]; None for least squares.
    """
    rows = slice(None) if used is None else used
    first = evaluate(start) or _impossible()
    failed = np.full(first[0].size, FAILED_RESIDUAL), first[1]

    @keep_last
    def residuals_and_slopes(unknowns: Array) -> Evaluation:
        residuals, slopes = evaluate(unknowns) or failed
        return (
            np.concatenate([residuals[rows], prior @ unknowns]),
            np.vstack([slopes[rows], prior]),
        )

    result = least_squares(
        lambda unknowns: residuals_and_slopes(unknowns)[0],
        start,
        jac=lambda unknowns: residuals_and_slopes(unknowns)[1],
        method="trf",
        x_scale="jac",
        loss="linear" if robust_scale is None else "soft_l1",
        f_scale=1.0 if robust_scale is None else robust_scale,
        xtol=1e-12,
        ftol=COST_TOL if robust_scale is None else ROBUST_COST_TOL,
        gtol=1e-15,
        max_nfev=60,
    )
    return float(result.cost), result.x


def _spin_rows(problem: _Problem, spread: float) -> Array:
    """Return the rows that weigh the spins against their usual size, none without spins.

    The spread is the standard deviation of a residual [m].
    """
    columns = [
        problem.flight_columns(i).start + 6 + k
        for i in range(len(problem.tracks) if problem.seeks_spin else 0)
        for k in range(3)
    ]
    return np.eye(len(problem.names))[columns] * spread / SPIN_SPREAD


def _spread(residuals: Array, length: float) -> float:
    """Return the standard deviation of a normal distribution with this median size [m].

    It is not below the error of integration over a path of a length [m].
    """
    return max(1.4826 * float(np.median(np.abs(residuals))), 100.0 * FINEST_TOL * length)


def _result(problem: _Problem, estimate: _Estimate) -> Identification:
    """Return the result: estimates, their covariance and the residuals."""
    kept = estimate.residuals[estimate.used]
    freedom = max(kept.size - estimate.unknowns.size, 1)
    noise = math.sqrt(float(kept @ kept) / freedom)
    widening = _widening(problem, estimate)
    spread = noise * widening
    jacobian = np.vstack([estimate.jacobian[estimate.used], _spin_rows(problem, spread)])
    size = np.maximum(np.linalg.norm(jacobian, axis=0), 1e-300)
    _, singular, right = np.linalg.svd(jacobian / size, full_matrices=False)
    inverse = np.where(singular > 1e-14 * singular[0], 1.0 / singular, 1e14 / singular[0])
    root = (right.T * inverse) / size[:, None] * spread  # its product with itself is the covariance
    unknowns = estimate.unknowns.copy()
    launches: list[BallState] = []
    for i, (track, axes) in enumerate(zip(problem.tracks, estimate.axes, strict=True)):
        columns = problem.flight_columns(i)
        position, velocity, spin = unknowns[columns][:3], unknowns[columns][3:6], problem.known_spin
        if problem.seeks_spin:  # to the axes of the fitted velocity
            rows = slice(columns.start + 6, columns.stop)
            spin = axes @ unknowns[rows]
            turned = flight_axes(velocity).T @ axes
            unknowns[rows], root[rows] = turned @ unknowns[rows], turned @ root[rows]
        launches.append(BallState(position, velocity, spin, float(track.times[0])))
    return Identification(
        tracks=problem.tracks,
        ball=problem.ball,
        air=problem.air_of(problem.shared_values(unknowns)),
        launches=tuple(launches),
        names=tuple(problem.names),
        estimates=unknowns,
        covariance=root @ root.T,
        residuals=estimate.residuals.reshape(-1, 3),
        used=estimate.used.reshape(-1, 3)[:, 0],
        noise=noise,
        widening=widening,
    )


def _widening(problem: _Problem, estimate: _Estimate) -> float:
    r"""Return the factor by which correlated residuals widen the deviations, 1 without correlation.

    With a correlation :math:`\rho` of neighbouring residuals, n samples say as much as
    :math:`n (1 - \rho) / (1 + \rho)` independent ones (Bayley & Hammersley 1946).
    """
    products, squares, first = 0.0, 0.0, 0
    rows = np.where(estimate.used, estimate.residuals, 0.0).reshape(-1, 3)
    for track in problem.tracks:
        flight = rows[first : first + len(track)]
        products += float((flight[1:] * flight[:-1]).sum())
        squares += float((flight * flight).sum())
        first += len(track)
    correlation = min(products / squares, 0.98) if squares > 0.0 else 0.0
    if correlation < 2.0 / math.sqrt(estimate.used.sum()):  # which chance explains
        return 1.0
    return math.sqrt((1.0 + correlation) / (1.0 - correlation))


def _rival(model: str | Air, air: Air, tracks: tuple[Track, ...]) -> tuple[str, Air]:
    """Return the name of a model and its air; raise `InvalidInput` if it cannot be compared."""
    fewest = min(map(len, tracks))
    if (fewest + 1) // 2 < LEAST_SAMPLES:
        raise InvalidInput(
            f"a flight of {fewest} positions has too few to fit a half: compare needs "
            f"{2 * LEAST_SAMPLES - 1}"
        )
    if isinstance(model, Air):
        return f"drag {_named(model.drag)}, lift {_named(model.lift)}", model
    return model, replace(air, drag=find_model("drag", MODELS, model))


def _score(name: str, air: Air, problem: _Problem) -> ModelScore:
    """Return how well a model, fitted to the first halves, predicts the second ones."""
    sought = tuple(free for free in problem.sought if free != Free.DRAG)
    misses, fits = [], []
    for track in problem.tracks:
        middle = (len(track) + 1) // 2
        half = problem._replace(air=air, sought=sought, tracks=(track[:middle],))
        estimate = _fit(half)
        fits.append(_result(half, estimate).rms)
        flight = _fly(half, track, estimate.axes[0], estimate.unknowns, FINEST_TOL)
        if flight is None:
            misses.append(math.inf)
            continue
        moved = flight.states(track.times - track.times[0])[:, :3]
        misses.append(_rms((estimate.unknowns[:3] + moved - track.positions)[middle:]))
    return ModelScore(name, _rms(np.array(misses)), _rms(np.array(fits)), tuple(misses))


def _named(model: Coefficient | None) -> str:
    """Return the name of a model, or the value of a constant."""
    value = getattr(model, "value", None)
    return f"{value:g}" if value is not None else str(getattr(model, "name", model))


def _rms(errors: Array) -> float:
    """Return the root of the mean square length of vectors, or of numbers."""
    return math.sqrt(float((errors * errors).sum()) / len(errors))
