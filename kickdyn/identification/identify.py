r"""`identify`: launch, spin, drag, lift and wind from measured positions of a ball in flight.

The unknowns :math:`p` minimise the squared distance between the measured positions :math:`y_k` and
those of the flight that starts with them,

.. math:: \min_p \; \sum_k \frac{|x(t_k; p) - y_k|^2}{\sigma^2} + \frac{|\omega|^2}{\omega_0^2}

with :math:`x` the solution of the equations of `kickdyn.flight.forces` and :math:`\sigma` the noise
of a coordinate, estimated from the residuals. The last term says that a spin is of the order of
:math:`\omega_0` = 100 rad/s; it decides only what the measurement leaves open. The covariance of
the estimate is :math:`\sigma^2 (J^T J)^{-1}` with the derivatives :math:`J` of the residuals,
increased where neighbouring residuals are correlated.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from enum import StrEnum
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import least_squares

from kickdyn.aerodynamics.coefficient_model import Coefficient, find_model
from kickdyn.aerodynamics.drag import MODELS, constant
from kickdyn.air import Air
from kickdyn.ball import Ball, BallState
from kickdyn.core import validation
from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput, KickdynError
from kickdyn.ground import Ground
from kickdyn.identification.flight_lanes import Lane, fly_lanes
from kickdyn.identification.identification_result import Identification, ModelScore
from kickdyn.identification.track import Track, refuse_intervals, refuse_units

LEAST_SAMPLES = 5
"""Fewer positions do not determine a launch and say how well they do."""

SPIN_SPREAD = 100.0
"""Order of magnitude of a spin [rad/s]: five professionals' curling free kicks have 106 rad/s on
average (Passmore et al. 2012)."""

OUTLIER = 4.5
"""Residuals of more than this many standard deviations are left out: in normally distributed noise
seven of a million are."""

MOST_KEPT = 0.9
"""Share of the samples that count at least."""

TOL, COARSE = 1e-10, 1e-7
"""Relative tolerances of the integration: the least, and the one to begin with."""

CONVERGED, NEARLY = 1e-8, 1e-4
"""Relative change of the sum of squares at which a fit ends, less than 0.001 of a deviation; and at
which the robust one ends, which only chooses the outliers and the start of the other."""

FIRST_DRAG = 0.2
"""C_D from which a constant is sought: that of a ball above the drag crisis (Goff & Carre 2009)."""


LARGEST_COEFFICIENT, LARGEST_SPEED = 10.0, 10.0
"""No fit goes beyond this size of a coefficient or factor, nor beyond this many times the mean
speed of the measurement plus 10 m/s: what is no flight would lead there."""


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
"""The values that each brings."""

COEFFICIENTS = ("drag", "drag_scale", "lift_scale")
"""Values without a unit."""

LAUNCH = ("x", "y", "z", "vx", "vy", "vz")
"""Names of the first six unknowns of each flight."""


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
    The derivatives are integrated by `fly_lanes`.

    Args:
        track: positions in one flight, from after its start to before its end, without a bounce; or
            those of several flights, which then share drag, lift and wind.
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
    for one in tracks:
        _check_flight(one, ball, ground)
    rivals = [_rival(model, air, tracks) for model in compare]
    problem = _Problem(tracks, ball, air, sought, known)
    answer = _answer(problem, _fit(problem))
    scores = [_score(*rival, problem) for rival in rivals]
    return replace(answer, comparison=tuple(sorted(scores, key=lambda s: s.prediction_rms)))


class _Problem(NamedTuple):
    """What is measured and what is sought."""

    tracks: tuple[Track, ...]
    ball: Ball
    air: Air
    sought: tuple[Free, ...]
    known_spin: Array

    @property
    def spins(self) -> bool:
        """Whether the spins are sought."""
        return Free.SPIN in self.sought

    @property
    def per_flight(self) -> int:
        """Number of unknowns that each flight has of its own."""
        return 9 if self.spins else 6

    @property
    def shared(self) -> list[str]:
        """Names of the unknowns that all flights share."""
        return [name for free in self.sought if free != Free.SPIN for name in NAMES[free]]

    @property
    def names(self) -> list[str]:
        """Names of all unknowns; those of several flights end in the flight's number."""
        own = [*LAUNCH, *(NAMES[Free.SPIN] if self.spins else ())]
        many = len(self.tracks) > 1
        flights = [f"{name}_{i}" if many else name for i in range(len(self.tracks)) for name in own]
        return [*flights, *self.shared]

    def air_of(self, shared: Mapping[str, float]) -> Air:
        """Return the air with the given coefficients and wind."""
        changes: dict[str, Any] = {}
        if "drag" in shared:
            changes["drag"] = constant(shared["drag"])
        if "drag_scale" in shared:
            changes["drag"] = scaled(self.air.drag, shared["drag_scale"])
        if "lift_scale" in shared:
            changes["lift"] = scaled(self.air.lift, shared["lift_scale"])
        if "wind_x" in shared:
            changes["wind"] = (shared["wind_x"], shared["wind_y"], 0.0)
        return replace(self.air, **changes)


class _Estimate(NamedTuple):
    """An estimate: the unknowns, the axes of each spin, residuals [m], and which count."""

    values: Array
    axes: list[Array]
    residuals: Array
    jacobian: Array
    used: NDArray[np.bool_]


def scaled(model: Coefficient | None, factor: float) -> Coefficient:
    """Return a coefficient times a factor."""
    assert model is not None
    plain: Coefficient = getattr(model, "function", model)
    return lambda reynolds, spin_parameter: factor * plain(reynolds, spin_parameter)


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
    for i, one in enumerate(tracks):
        if not isinstance(one, Track):
            raise InvalidInput(f"track {i} is {validation.brief(one)}: it must be a kickdyn.Track")
    return tuple(tracks)


def _sought(free: Iterable[str], air: Air) -> tuple[Free, ...]:
    """Return what is sought, each once, in the order of `Free`."""
    names = [free] if isinstance(free, str) else free
    found = {validation.choice("free", name, Free) for name in names}
    if {Free.DRAG, Free.DRAG_SCALE} <= found:
        raise InvalidInput(
            "free has drag and drag-scale: take one, because the first replaces the model that the "
            "second scales"
        )
    for name, kind in ((Free.DRAG_SCALE, "drag"), (Free.LIFT_SCALE, "lift")):
        if name in found and getattr(air, kind) is None:
            raise InvalidInput(f"free has {name}, but the air has no {kind} model to scale")
    if Free.WIND in found and callable(air.wind):
        raise InvalidInput("free has wind, but the air's wind is a function of height")
    return tuple(name for name in Free if name in found)


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
        raise InvalidInput(f"the ball stays at {track.positions[0].tolist()} m: this is no flight")
    falling = -2.0 * np.polyfit(track.times - track.times[0], track.positions[:, 2], 2)[0]
    refuse_units(track, float(falling))


def _fit(problem: _Problem) -> _Estimate:
    """Return the best estimate of several starts."""
    polynomials = [_polynomial(track) for track in problem.tracks]
    noise = float(np.median([noise for _, noise in polynomials]))
    launches = [launch for launch, _ in polynomials]
    axes = [flight_axes(launch[3:6]) for launch in launches]
    starts = [
        _start(problem, launches, axes, size)
        for size in ((20.0, 80.0) if problem.spins else (0.0,))
    ]
    evaluate = partial(_evaluate, problem, axes, COARSE)
    if evaluate(starts[0]) is None:
        raise KickdynError(
            "no flight could be integrated from the first guess of the launch: check the units and "
            "that the samples are one flight"
        )
    robust = [_minimise(evaluate, start, 3.0 * noise, None, 0.0, problem) for start in starts]
    _, values = min(robust, key=lambda found: found[0])
    residuals, jacobian = evaluate(values) or _impossible()
    used = np.zeros(residuals.size, dtype=bool)
    longest = max(float(np.ptp(track.positions, axis=0).max()) for track in problem.tracks)
    for _ in range(4):  # the spread of the residuals and the outliers depend on each other
        spread = _spread(residuals, longest)
        before, used = used, np.repeat(~_outliers(residuals, spread), 3)
        tol = min(max(1e-3 * spread / longest, TOL), COARSE)
        if np.array_equal(before, used) and evaluate.args[-1] == tol:
            break
        evaluate = partial(_evaluate, problem, axes, tol)
        _, values = _minimise(evaluate, values, None, used, spread, problem)
        residuals, jacobian = evaluate(values) or _impossible()
    return _Estimate(values, axes, residuals, jacobian, used)


def _outliers(residuals: Array, spread: float) -> NDArray[np.bool_]:
    """Return which samples are too far off, shape `(n,)`: a tenth of them at most.

    Where more are, the flight is not that of the model, and its residuals are no outliers.
    """
    farthest = np.abs(residuals).reshape(-1, 3).max(axis=1)
    return np.asarray(farthest > max(OUTLIER * spread, float(np.quantile(farthest, MOST_KEPT))))


def _impossible() -> tuple[Array, Array]:
    raise KickdynError(
        "the fitted flight could not be integrated: check the units, and that the samples are one "
        "flight"
    )


def _polynomial(track: Track) -> tuple[Array, float]:
    """Return a first guess of position and velocity, shape `(6,)`, and of the noise [m].

    Both are those of polynomials in time, of which samples far away are left out.
    """
    times = track.times - track.times[0]
    degree = 2 if len(track) < 9 else 3 if len(track) < 30 else 5
    span = max(track.duration, 1e-300)
    kept = np.ones(len(track), dtype=bool)
    for _ in range(4):
        fit = np.polynomial.polynomial.polyfit(times[kept] / span, track.positions[kept], degree)
        rest = track.positions - np.polynomial.polynomial.polyval(times / span, fit).T
        noise = max(1.4826 * float(np.median(np.abs(rest[kept]))), 1e-12)
        kept = np.abs(rest).max(axis=1) < 6.0 * noise
        if kept.sum() <= degree + 1:
            break
    return np.concatenate([fit[0], fit[1] / span]), noise


def _start(problem: _Problem, launches: list[Array], axes: list[Array], size: float) -> Array:
    """Return a first guess of all unknowns; spins have a size, and the axis that bends the path."""
    parts: list[Array] = []
    for track, launch, columns in zip(problem.tracks, launches, axes, strict=True):
        parts.append(launch)
        if problem.spins:
            times = track.times - track.times[0]
            bend = 2.0 * np.polyfit(times, track.positions, 2)[0] + [0.0, 0.0, 9.81]
            about = np.cross(launch[3:6], bend)
            parts.append(size * columns.T @ about / max(float(np.linalg.norm(about)), 1e-300))
    first = {"drag": FIRST_DRAG, "drag_scale": 1.0, "lift_scale": 1.0}
    if "wind_x" in problem.shared:
        wind = np.asarray(problem.air.wind)
        first |= {"wind_x": float(wind[0]), "wind_y": float(wind[1])}
    return np.concatenate([*parts, [first[name] for name in problem.shared]])


def _evaluate(
    problem: _Problem, axes: list[Array], tol: float, values: Array
) -> tuple[Array, Array] | None:
    """Return residuals, shape `(3 n,)` [m], and their derivatives; None where a flight fails."""
    count, own = len(problem.tracks), problem.per_flight
    shared = dict(zip(problem.shared, values[count * own :].tolist(), strict=True))
    if any(abs(shared.get(name, 0.0)) > LARGEST_COEFFICIENT for name in COEFFICIENTS):
        return None
    airs = [problem.air_of(shared)]
    steps = {name: 1e-6 * max(abs(value), 0.1) for name, value in shared.items()}
    airs += [problem.air_of({**shared, name: shared[name] + step}) for name, step in steps.items()]
    residuals: list[Array] = []
    blocks: list[Array] = []
    for i, track in enumerate(problem.tracks):
        part = values[i * own : (i + 1) * own]
        velocity, times = part[3:6], track.times - track.times[0]
        usual = float(np.linalg.norm(np.ptp(track.positions, axis=0))) / times[-1] + 10.0
        if np.abs(velocity).max() > LARGEST_SPEED * usual:
            return None
        spin = axes[i] @ part[6:9] if problem.spins else problem.known_spin
        faster = 1e-6 * max(float(np.linalg.norm(velocity)), 1e-3)
        lanes = [Lane(velocity, spin, airs[0])]
        lanes += [Lane(velocity + faster * unit, spin, airs[0]) for unit in np.eye(3)]
        if problem.spins:
            lanes += [Lane(velocity, spin + 1e-5 * axis, airs[0]) for axis in axes[i].T]
        lanes += [Lane(velocity, spin, air) for air in airs[1:]]
        moved = fly_lanes(lanes, problem.ball, float(part[2]), times, tol)
        if moved is None:
            return None
        residuals.append((part[:3] + moved[0] - track.positions).ravel())
        nudges = np.array([*3 * [faster], *(own - 6) * [1e-5], *steps.values()])
        slopes = ((moved[1:] - moved[0]) / nudges[:, None, None]).reshape(len(nudges), -1).T
        block = np.zeros((3 * len(track), values.size))
        block[:, i * own : i * own + 3] = np.tile(np.eye(3), (len(track), 1))
        block[:, i * own + 3 : (i + 1) * own] = slopes[:, : own - 3]
        block[:, count * own :] = slopes[:, own - 3 :]
        blocks.append(block)
    return np.concatenate(residuals), np.vstack(blocks)


def _minimise(
    evaluate: Any,
    start: Array,
    scale: float | None,
    used: Array | None,
    spread: float,
    problem: _Problem,
) -> tuple[float, Array]:
    """Return the least cost and the unknowns, by a robust loss if it has a scale [m]."""
    weights = _spin_rows(problem, start.size, spread)
    last: dict[bytes, tuple[Array, Array]] = {}

    def both(values: Array) -> tuple[Array, Array]:
        key = values.tobytes()
        if key not in last:
            last.clear()
            found = evaluate(values)
            if found is None:  # far from any flight: no step goes there
                found = np.full(first[0].size, 1e6), first[1]
            last[key] = found
        return last[key]

    def pick(rows: Array) -> Array:
        return rows if used is None else rows[used]

    first = evaluate(start) or _impossible()
    result = least_squares(
        lambda values: np.concatenate([pick(both(values)[0]), weights @ values]),
        start,
        jac=lambda values: np.vstack([pick(both(values)[1]), weights]),
        method="trf",
        x_scale="jac",
        loss="linear" if scale is None else "soft_l1",
        f_scale=1.0 if scale is None else scale,
        xtol=1e-12, ftol=CONVERGED if scale is None else NEARLY, gtol=1e-15, max_nfev=60,
    )  # fmt: skip
    return float(result.cost), result.x


def _spin_rows(problem: _Problem, size: int, spread: float) -> Array:
    """Return the rows that weigh the spins against their usual size, none without spins."""
    if not problem.spins:
        return np.zeros((0, size))
    own = problem.per_flight
    columns = [i * own + 6 + k for i in range(len(problem.tracks)) for k in range(3)]
    rows = np.zeros((len(columns), size))
    rows[range(len(columns)), columns] = spread / SPIN_SPREAD
    return rows


def _spread(residuals: Array, length: float) -> float:
    """Return the standard deviation of a normal distribution with this median size [m].

    It is not below the error of integration over a path of a length [m].
    """
    return max(1.4826 * float(np.median(np.abs(residuals))), 100.0 * TOL * length)


def _answer(problem: _Problem, estimate: _Estimate) -> Identification:
    """Return the result: values, their covariance, undetermined parameters and warnings."""
    count, own = len(problem.tracks), problem.per_flight
    kept = estimate.residuals[estimate.used]
    freedom = max(kept.size - estimate.values.size, 1)
    noise = math.sqrt(float(kept @ kept) / freedom)
    widening = _widening(problem, estimate)
    spread = noise * widening
    jacobian = np.vstack(
        [estimate.jacobian[estimate.used], _spin_rows(problem, estimate.values.size, spread)]
    )
    size = np.maximum(np.linalg.norm(jacobian, axis=0), 1e-300)
    _, singular, right = np.linalg.svd(jacobian / size, full_matrices=False)
    inverse = np.where(singular > 1e-14 * singular[0], 1.0 / singular, 1e14 / singular[0])
    root = (right.T * inverse) / size[:, None] * spread
    values = estimate.values.copy()
    launches: list[BallState] = []
    for i, axes in enumerate(estimate.axes):
        part = values[i * own : (i + 1) * own]
        spin = problem.known_spin
        if problem.spins:  # to the axes of the fitted velocity
            turned = flight_axes(part[3:6]).T @ axes
            spin = axes @ part[6:9]
            part[6:9] = turned @ part[6:9]
            root[i * own + 6 : i * own + 9] = turned @ root[i * own + 6 : i * own + 9]
        launches.append(BallState(part[:3], part[3:6], spin, float(problem.tracks[i].times[0])))
    shared = dict(zip(problem.shared, values[count * own :].tolist(), strict=True))
    return Identification(
        problem.tracks, problem.ball, problem.air_of(shared), tuple(launches), tuple(problem.names),
        values, root @ root.T, estimate.residuals.reshape(-1, 3),
        estimate.used.reshape(-1, 3)[:, 0], noise, widening,
    )  # fmt: skip


def _widening(problem: _Problem, estimate: _Estimate) -> float:
    r"""Return by how much residuals that go together widen the deviations, 1 where they do not.

    With a correlation :math:`\rho` of neighbouring residuals, n samples say as much as
    :math:`n (1 - \rho) / (1 + \rho)` independent ones (Bayley & Hammersley 1946).
    """
    pairs, squares, first = 0.0, 0.0, 0
    rows = np.where(estimate.used, estimate.residuals, 0.0).reshape(-1, 3)
    for track in problem.tracks:
        part = rows[first : first + len(track)]
        pairs += float((part[1:] * part[:-1]).sum())
        squares += float((part * part).sum())
        first += len(track)
    correlation = min(pairs / squares, 0.98) if squares > 0.0 else 0.0
    if correlation < 2.0 / math.sqrt(estimate.used.sum()):  # as by chance
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
    fitted = problem._replace(air=air, sought=sought)
    misses, rest = [], []
    for track in problem.tracks:
        half = (len(track) + 1) // 2
        answer = _answer(part := fitted._replace(tracks=(track[:half],)), _fit(part))
        lane = Lane(answer.launch.velocity, answer.launch.spin, answer.air)
        start = answer.launch.position
        times = track.times - track.times[0]
        moved = fly_lanes([lane], problem.ball, float(start[2]), times, TOL)
        miss = math.inf if moved is None else _rms((start + moved[0] - track.positions)[half:])
        misses.append(miss)
        rest.append(answer.rms)
    return ModelScore(name, _rms(np.array(misses)), _rms(np.array(rest)), tuple(misses))


def _named(model: Coefficient | None) -> str:
    """Return the name of a model, or the value of a constant."""
    value = getattr(model, "value", None)
    return f"{value:g}" if value is not None else str(getattr(model, "name", model))


def _rms(errors: Array) -> float:
    """Return the root of the mean square length of vectors, or of numbers."""
    return math.sqrt(float((errors * errors).sum()) / len(errors))
