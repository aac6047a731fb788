"""A scene whose uncertainties are drawn many times: where the ball ends, and the scatter."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from kickdyn.ball import BallState
from kickdyn.core import validation
from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput, KickdynError
from kickdyn.impact.collide import Collision
from kickdyn.impact.laws import LAWS
from kickdyn.impact.strike_many import ContactRows, Strikes, StrikeStatus
from kickdyn.impact.uncertainty import source_covariance
from kickdyn.scene.launch_and_end import STATUSES_WITH_END, collide_scene, strike_scene
from kickdyn.scene.scene import Scene
from kickdyn.scene.simulate import Simulation, simulate

SOURCES = ("q", "v", "restitution", "friction", "normal", "ball_velocity", "ball_spin")
"""Sources of uncertainty that are drawn; masses and the size of the ball change the flight, too."""


@dataclass(frozen=True, eq=False)
class Simulations:
    """Where the ball of a scene ends for n draws of the scene's uncertainties.

    Attributes:
        nominal: the simulation of the scene itself, whose model all draws have.
        launch: the balls after the impacts, n states; nan where there is no impact.
        end: position of the ends, shape `(n, 3)` [m, world frame]; nan where there is none.
        duration: times from launch to end, shape `(n,)` [s].
        status: how each path ends, or `no-impact` or `failed`, shape `(n,)`.
        model_error: error of the ends by the model beside `nominal.error`, the largest of those
            that were measured [m]; 0 for an instantaneous contact.
    """

    nominal: Simulation
    launch: BallState
    end: Array
    duration: Array
    status: NDArray[Any]
    model_error: float = 0.0

    @property
    def mean(self) -> Array:
        """Mean of the ends, shape `(3,)` [m, world frame]."""
        ends = self.end[np.isfinite(self.end).all(axis=1)]
        return np.asarray(ends.mean(axis=0)) if len(ends) else np.full(3, np.nan)

    @property
    def covariance(self) -> Array:
        """Covariance of the ends, shape `(3, 3)` [m2]."""
        ends = self.end[np.isfinite(self.end).all(axis=1)]
        return np.cov(ends.T) if len(ends) > 1 else np.full((3, 3), np.nan)

    @property
    def deviation(self) -> float:
        """Standard deviation of the end, the root of the trace of the covariance [m]."""
        return math.sqrt(float(np.trace(self.covariance)))


@validation.check_arguments
def simulate_many(
    scene: Scene, draws: int, tolerance: float | None = 0.05, *, seed: int = 0
) -> Simulations:
    r"""Draw the uncertainties of a scene many times and simulate each draw.

    The model is chosen once, by `simulate` and the tolerance, and then computed for all draws in
    machine code by `strike_many` and `fly_many` or `follow_many`. The sources are normally
    distributed and independent; restitution stays between 0 and 1, friction at 0 or above. The ball
    leaves from where it does in the scene itself, whatever the posture.

    Where the contact takes time, what it changes at the launch, :math:`\delta(x)`, is a quadratic
    function of the drawn values x without mixed terms in the directions of the sources. It is
    fitted to collisions at 2 d + 1 points for d drawn numbers, and its error measured at further
    ones (`model_error`).

    Args:
        scene: the scene, with an `uncertainty` of q, v, restitution, friction, normal,
            ball_velocity or ball_spin.
        draws: number n of draws, 1 to 1e7.
        tolerance: tolerance of `simulate`, which chooses the model [m]; None models everything.
        seed: seed of the random numbers.

    Raises:
        InvalidInput: a scene without uncertainty, or with one that is not drawn; or as `simulate`.
        NoImpact: foot and ball of the scene itself do not approach each other.

    Example:
        >>> import kickdyn as kd
        >>> scene = kd.load_scene("free_kick").replace(uncertainty={"v": 0.05})
        >>> many = kd.simulate_many(scene, 2000)
        >>> many.end.shape, bool(0.5 < many.deviation / many.nominal.end_deviation < 2)
        ((2000, 3), True)
    """
    n = validation.whole("draws", draws, at_least=1, at_most=10_000_000)
    seed = validation.whole("seed", seed, at_least=0)
    if not scene.uncertainty:
        raise InvalidInput("the scene has no uncertainty: draws need one, Scene(uncertainty=...)")
    for name in scene.uncertainty:
        if name not in SOURCES:
            drawn = ", ".join(SOURCES)
            raise InvalidInput(f"uncertainty of {name} is not drawn: simulate_many draws {drawn}")
    # the draws need no sensitivities, which `simulate` takes for its uncertainty
    linear = not isinstance(scene.law, str) or LAWS[scene.law].differentiate is not None
    nominal = simulate(scene if linear else scene.replace(uncertainty=None), tolerance)
    source = _Draws(scene)
    values = np.random.default_rng(seed).normal(size=(n, source.size))
    launch, status = source.launches(values)
    model_error = 0.0
    if isinstance(nominal.impact, Collision):
        launch, error = _with_contact_time(source, values, launch, nominal.impact.tol)
        model_error = error * float(nominal.path.duration)
    launch[:, :3] = np.where(np.isfinite(launch[:, :1]), nominal.launch.position, np.nan)
    return _flown(nominal, launch, status, model_error)


class _Draws:
    """A scene and the sources that are drawn from standard normal numbers, `size` for a draw."""

    def __init__(self, scene: Scene) -> None:
        self.scene, self.factors, nv = scene, dict[str, Array](), scene.leg.nv
        for name, value in scene.uncertainty.items():
            size = {"q": nv, "v": nv, "restitution": 1, "friction": 1}.get(name, 3)
            eigenvalues, axes = np.linalg.eigh(source_covariance(name, value, size))
            self.factors[name] = axes * np.sqrt(np.maximum(eigenvalues, 0.0))  # L of L L^T
        self.size = sum(factor.shape[1] for factor in self.factors.values())

    def changes(self, values: Array) -> dict[str, Array]:
        """Return the changes of the sources, each of shape `(n, size)`, for normal numbers."""
        ends = np.cumsum([factor.shape[1] for factor in self.factors.values()])
        blocks = zip(np.split(values, ends[:-1], axis=1), self.factors.items(), strict=True)
        return {name: block @ factor.T for block, (name, factor) in blocks}

    def arguments(self, values: Array) -> tuple[Array, Array, ContactRows, Array, Array]:
        """Return q, v, contacts (n or one), velocity and spin of the ball for n strikes."""
        scene, changes, n = self.scene, self.changes(values), len(values)
        leg, q = scene.leg, np.tile(scene.q, (n, 1))
        if "q" in changes and leg.nq == leg.nv:
            q = q + changes["q"]
        elif "q" in changes:
            model = leg.workspace.model
            q = np.array([pin.integrate(model, scene.q, change) for change in changes["q"]])
        v = scene.v + changes.get("v", np.zeros((n, leg.nv)))
        if leg.constraints is not None:  # as far as supports and loops allow
            q = np.array([leg.close_loops(row) for row in q])
            v = np.array([leg.posture(row).admissible(v[i]) for i, row in enumerate(q)])
        contact = ContactRows.of([scene.contact])
        if {"restitution", "friction", "normal"} & set(changes):
            contact = _changed(contact, changes)
        still, incoming = np.zeros((n, 3)), scene.incoming
        velocity = incoming.velocity + changes.get("ball_velocity", still)
        return q, v, contact, velocity, incoming.spin + changes.get("ball_spin", still)

    def launches(self, values: Array, tol: float | None = None) -> tuple[Array, NDArray[np.int8]]:
        """Return `(n, 9)`, balls after strikes, or after collisions to a tolerance, and status."""
        scene, (q, v, contact, velocity, spin) = self.scene, self.arguments(values)
        if tol is None and (scene.is_compliant or scene.law == "newton"):
            impacts = Strikes(scene.leg, [scene.ball], contact, velocity, spin).compute(q, v)
            columns = impacts.ball_position, impacts.ball_velocity, impacts.ball_spin
            return np.hstack(columns), impacts.status
        launches, status = np.full((len(values), 9), np.nan), np.zeros(len(values), np.int8)
        for i in range(len(values)):
            try:
                drawn = scene.replace(
                    posture=scene.leg.posture(q[i]), v=v[i], contact=contact[i % len(contact)],
                    incoming=BallState(velocity=velocity[i], spin=spin[i]),
                )  # fmt: skip
                impact = strike_scene(drawn) if tol is None else collide_scene(drawn, tol)
            except KickdynError:
                status[i] = StrikeStatus.FAILED.flag
                continue
            ball = impact.ball_after
            launches[i] = np.concatenate([ball.position, ball.velocity, ball.spin])
        return launches, status


def _changed(contact: ContactRows, changes: dict[str, Array]) -> ContactRows:
    n = len(next(iter(changes.values())))
    restitution, friction = contact.restitution * np.ones(n), contact.friction * np.ones(n)
    if "restitution" in changes:
        if np.isnan(restitution).any():
            raise InvalidInput(
                "uncertainty of restitution is not drawn where it depends on the speed: "
                "simulate_many needs a number"
            )
        restitution = np.clip(restitution + changes["restitution"][:, 0], 0.0, 1.0)
    if "friction" in changes:
        friction = np.maximum(friction + changes["friction"][:, 0], 0.0)
    normal = contact.normal + changes.get("normal", np.zeros((n, 3)))
    normal = normal / validation.length(normal)[:, None]
    return ContactRows(contact.given, normal, restitution, friction, changed=True)


def _with_contact_time(
    source: _Draws, values: Array, launch: Array, tol: float
) -> tuple[Array, float]:
    """Return launches after contacts that take time, and the largest error of a velocity [m/s]."""
    d = source.size
    points = np.vstack([np.zeros(d), math.sqrt(3.0) * np.eye(d), -math.sqrt(3.0) * np.eye(d)])
    checks = np.random.default_rng(1).normal(size=(8, d))
    points = np.vstack([points, checks])
    change = source.launches(points, tol)[0] - source.launches(points)[0]
    if not np.isfinite(change).all():
        raise KickdynError(
            "a collision of draws within two standard deviations has no result: the uncertainty is "
            "too large for a contact that takes time"
        )
    here, up, down = change[0], change[1 : d + 1], change[d + 1 : 2 * d + 1]
    slope, curve = (up - down) / (2.0 * math.sqrt(3.0)), (up + down - 2.0 * here) / 6.0

    def fitted(x: Array) -> Array:
        return np.asarray(here + x @ slope + (x * x) @ curve)

    missed = (fitted(checks) - change[2 * d + 1 :])[:, 3:6]
    return launch + fitted(values), float(validation.length(missed).max())


def _flown(
    nominal: Simulation, launch: Array, status: NDArray[np.int8], model_error: float
) -> Simulations:
    from kickdyn.flight.batch import fly_many
    from kickdyn.flight.follow_many import follow_many

    scene, n = nominal.scene, len(launch)
    flies = np.isfinite(launch).all(axis=1)
    end, duration = np.full((n, 3), np.nan), np.full(n, np.nan)
    names = np.array([str(status) for status in StrikeStatus], dtype=object)[status]
    states = BallState(launch[flies, :3], launch[flies, 3:6], launch[flies, 6:])
    options: Any = {"ball": scene.ball, "air": scene.air, "ground": scene.ground,
                    "plane": scene.plane}  # fmt: skip
    paths = (follow_many if scene.is_followed else fly_many)(states, **options)
    end[flies] = (paths.position if scene.is_followed else paths.landing_position).values
    duration[flies] = paths.duration.values
    flags = np.array(paths.status.attrs["flag_meanings"].split(), dtype=object)
    names[flies] = flags[paths.status.values]
    end[~np.isin(names, [str(status) for status in STATUSES_WITH_END])] = np.nan
    balls = BallState.computed(launch[:, :3].copy(), launch[:, 3:6].copy(), launch[:, 6:].copy())
    return Simulations(nominal, balls, end, duration, names, model_error)
