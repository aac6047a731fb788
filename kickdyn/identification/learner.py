r"""`Learner`: kick, observe the ball, correct the model, kick again.

What the model does not know is

.. math:: \theta = (\ln s, w_x, w_y, \ln \tfrac{e}{1 - e}, \alpha, \beta):

a scale s of the drag model, the wind, the restitution e of the foot's contact, and errors of aim,
upwards and to the left. Kick k has, beside, an error :math:`\epsilon_k` of its own, of the speed
and of the two angles. The most probable estimate after n kicks solves

.. math:: \min_{\theta, \epsilon} \; (\theta - \theta_0)^T P_0^{-1} (\theta - \theta_0)
    + \sum_k \frac{|\epsilon_k|^2}{\sigma^2} + \sum_k \frac{|x_k(\theta, \epsilon_k) - y_k|^2}{R}

with the observation :math:`y_k`, the prediction of the model :math:`x_k`, the scatter
:math:`\sigma` from kick to kick, and the variance R of an observation. The covariance of
:math:`\theta` is its block of the inverse of :math:`J^T J`, with the derivatives J of the residuals
whose squares are summed.
"""

import math
from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares
from scipy.special import expit, logit

from kickdyn.aerodynamics.coefficient_model import ScaledCoefficient
from kickdyn.air import Air
from kickdyn.ball import Ball, BallState
from kickdyn.contact import Contact
from kickdyn.core import validation
from kickdyn.core.mechanics import GRAVITY
from kickdyn.core.representation import ReprMixin, Row, warned
from kickdyn.core.validation import Array, ArrayLike
from kickdyn.errors import InvalidInput, KickdynError
from kickdyn.flight.derivatives import DifferentiableFlight, fly_with_slopes
from kickdyn.identification.identification_result import UNITS, covariance
from kickdyn.identification.track import Track
from kickdyn.impact.strike import strike
from kickdyn.plane import Plane
from kickdyn.planning.goal import Goal
from kickdyn.planning.kick import plan_kick, replan_turned
from kickdyn.planning.kick_library import KickLibrary
from kickdyn.planning.kick_plan import KickPlan
from kickdyn.planning.launch import Launch, fly_to_target, plan_launch
from kickdyn.planning.problem import keep_last
from kickdyn.robot.leg import Leg

PRIOR = {
    "drag_scale": 0.3,
    "wind_x": 2.0,
    "wind_y": 2.0,
    "restitution": 0.1,
    "elevation": 0.05,
    "azimuth": 0.05,
}
"""Standard deviations before the first kick: relative, m/s, m/s, 1, rad, rad."""

SCATTER = 0.03
"""Relative scatter of launch speed, and scatter of direction [rad], from kick to kick."""

LEARNT_SHARE = 1.0 / 3.0
"""Variance of the mean landing, over the variance by the scatter, at which learning ends: the
unknowns then widen the scatter by 15 %."""

SHORTEST = 1e-6
"""Duration of a flight [s] below which the ball is taken to leave into the ground."""

FLIGHT_TOL = 1e-8
"""Relative tolerance of the flights."""

INCREMENT = 1e-5
"""Increment of each of the seven values that a kick depends on, for its derivatives."""

COLUMNS = (0, 1, 2, 3, 5, 6, 4, 5, 6)
"""Of the seven values, which each of the six unknowns and the three errors of a kick changes."""

LEVEL = Plane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), "centre")
"""The plane at the height of the launch, in which landings are observed."""


Command = BallState | KickPlan
"""A launch at the origin, or a kick of a leg."""


class Shot(NamedTuple):
    """A command, and its landing `(2,)` [m], time [s] or track since the kick, or None."""

    command: Command
    landing: Array | None
    time: float | None
    track: Track | None


class Learner(ReprMixin):
    """Finds the launch, or the kick, that meets a goal although the model is only approximate.

    Carry out the `command`, and pass what the ball did to `observe`, until `is_done`. Without a
    leg, the command is a launch velocity :math:`v` for an assumed restitution :math:`e_0`, so that
    the ball leaves with the velocity :math:`v (1 + e) / (1 + e_0)`. With a leg, it is a kick that
    is planned with the estimate of the restitution.

    Args:
        goal: a target as high as the launch, with a condition such as the time.
        ball: the ball; its mass and radius count.
        air: the air to begin with, with a drag model and a constant wind.
        leg: the leg that kicks. With it, commands are kicks by `plan_kick`; with a library of its
            kicks, kicks of that library, for its own restitution; with None, launches.
        restitution: :math:`e_0`, the best guess before the first kick, 0.01 to 0.99.
        friction: friction of the contact of the leg.
        ball_height: height of the ball's centre before the kick of a leg [m, world frame]; None
            leaves it free, as in `plan_kick`.
        motion: whether commands are kicks with their motion, each planned from the one before.
        scatter: standard deviation of the launch from kick to kick of one command: relative for the
            speed, and for either angle of the direction [rad].
        deviation: standard deviation of an observed coordinate of a landing or a track [m].
        time_deviation: standard deviation of an observed time of flight [s].
        prior: standard deviations of the unknowns before the first kick; those left out are
            `drag_scale` 0.3 (relative), `wind_x` and `wind_y` 2 m/s, `restitution` 0.1, `elevation`
            and `azimuth` 0.05 rad.

    Attributes:
        command: the next launch at the origin, or with a leg the next kick. A kick is planned for
            the launch velocity that errors of aim turn into the wanted one; its `path` is the
            flight that is then expected.
        launch: the launch to the goal, in the air as it is known, that the command brings about.
        shots: the kicks so far.

    Raises:
        InvalidInput: a wrong argument, a goal above or below the launch, an air without drag or
            with a wind that is a function, or a leg that cannot kick to the goal.
    """

    command: Command
    launch: Launch
    shots: tuple[Shot, ...]

    @validation.check_arguments
    def __init__(
        self,
        goal: Goal,
        ball: Ball,
        air: Air,
        leg: Leg | KickLibrary | None = None,
        *,
        restitution: float = 0.8,
        friction: float = 0.4,
        ball_height: float | None = None,
        motion: bool = False,
        scatter: float = SCATTER,
        deviation: float = 0.05,
        time_deviation: float = 0.02,
        prior: Mapping[str, float] | None = None,
    ) -> None:
        ball.check_movable("a kick")
        if air.drag is None or callable(air.wind):
            raise InvalidInput(
                "air has no drag, or a wind that is a function of height: the learner corrects "
                "a drag model and a constant wind"
            )
        if goal.receiver_velocity.any():
            raise InvalidInput(
                f"receiver velocity is {goal.receiver_velocity.tolist()} m/s: the learner kicks "
                "again to the same target, which must be at rest"
            )
        if not goal.is_level:
            raise InvalidInput(
                f"goal is {float(goal.target[2]):g} m above the launch: the learner observes "
                "landings at the height of the launch"
            )
        if isinstance(leg, KickLibrary):
            leg.check_settings({}, ball, None, None)
        self.goal, self.ball, self.leg, self._model = goal, ball, leg, air
        restitution = validation.number("restitution", restitution, at_least=0.01, at_most=0.99)
        self._first_restitution = restitution
        self._friction = validation.number("friction", friction, at_least=0)
        self._ball_height, self._motion = ball_height, motion
        if motion and leg is None:
            raise InvalidInput("motion is True without a leg: only kicks have a motion")
        self._scatter = validation.number("scatter", scatter, above=0, at_most=1)
        self._deviation = validation.number("deviation", deviation, above=0, unit="m")
        late = validation.number("time deviation", time_deviation, above=0, unit="s")
        self._landing_deviations = np.array([self._deviation, self._deviation, late])
        self._prior = _checked_prior(prior, self._first_restitution)
        self.shots = ()
        wind_x, wind_y, _ = np.asarray(air.wind)
        self._theta0 = np.array([0.0, wind_x, wind_y, logit(self._first_restitution), 0.0, 0.0])
        self._theta: Array = self._theta0
        self._covariance = np.diag(self._prior**2)
        self._errors: Array = np.zeros((0, 3))
        self._last_landing: Array = np.zeros(2)
        self._plan()

    @property
    def estimates(self) -> dict[str, float]:
        """The estimates of the unknowns, by name.

        They are a factor of the drag model, the wind [m/s], the restitution, and how far the ball
        leaves above and to the left of what was commanded [rad].
        """
        values = self._theta.copy()
        values[0], values[3] = math.exp(values[0]), expit(values[3])
        return dict(zip(PRIOR, values.tolist(), strict=True))

    @property
    def deviations(self) -> dict[str, float]:
        """Standard deviations of the estimates, by name and in the same units."""
        sizes = np.sqrt(np.diag(self._covariance))
        scale, e = self.estimates["drag_scale"], self.estimates["restitution"]
        sizes[[0, 3]] *= scale, e * (1.0 - e)
        return dict(zip(PRIOR, sizes.tolist(), strict=True))

    @property
    def landing_scatter(self) -> Array:
        """Covariance of the landing points by scatter and observation, shape `(2, 2)` [m2]."""
        aim = self._landing_slopes[:, 6:]
        return np.asarray(self._scatter**2 * aim @ aim.T + self._deviation**2 * np.eye(2))

    @property
    def landing_uncertainty(self) -> Array:
        """Covariance of the mean landing point by the unknowns, shape `(2, 2)` [m2]."""
        slopes = self._landing_slopes[:, :6]
        return np.asarray(slopes @ self._covariance @ slopes.T)

    @property
    def is_done(self) -> bool:
        """Whether further kicks would hardly bring the ball nearer to the target.

        The last kick then missed by no more than scatter and uncertainty allow in 95 % of kicks,
        and the uncertainty has at most a third of the scatter's variance (traces of the
        covariances).
        """
        scatter, uncertainty = self.landing_scatter, self.landing_uncertainty
        missed = self._last_landing - self.goal.target[:2]
        return bool(
            self.shots
            and np.trace(uncertainty) <= LEARNT_SHARE * np.trace(scatter)
            # square of a distance, in standard deviations, that 5 % of random points in a plane
            # exceed: the 95 % quantile of the chi-square distribution with 2 degrees of freedom
            and missed @ np.linalg.solve(scatter + uncertainty, missed) <= 5.99
        )

    @property
    def warnings(self) -> tuple[str, ...]:
        """Lines about what to know before the next kick; empty if there is nothing."""
        lines = [] if self.launch.limit is None else [f"the goal is {self.launch.summary}"]
        if isinstance(self.command, KickPlan) and self.command.share < 1.0:
            lines.append(
                "the goal is beyond the limits of the leg: the kick has "
                f"{self.command.share:.0%} of the launch speed"
            )
        e = self.estimates["restitution"]
        if not 0.02 < e < 0.98:
            lines.append(
                f"restitution is {e:.3g}, near the end of its range: something else may change the "
                "launch speed"
            )
        return (*lines, *self.launch.flight.warnings)

    def observe(self, seen: ArrayLike | Track, time: float | None = None) -> None:
        """Learn from what the ball did after the command, and find the next one.

        Args:
            seen: the landing point, at the height of the launch, shape `(2,)` or `(3,)` [m, from
                the launch]; or the track of the ball in flight [m, from the launch; s, since the
                kick].
            time: time of flight, if it was measured [s]; it must be None with a track.

        Raises:
            InvalidInput: a wrong argument, a track that begins before the kick, or a time beside a
                track.
            KickdynError: no flight of the model comes near to what was observed.
        """
        if isinstance(seen, Track):
            if time is not None:
                raise InvalidInput("time is given with a track, which has times already")
            if seen.times[0] < 0.0:
                raise InvalidInput(
                    f"the track begins at {seen.times[0]:g} s: its times must be measured from the "
                    "kick"
                )
            shot = Shot(self.command, None, None, seen)
        else:
            where = validation.floats("landing", seen, unit="m")
            if where.shape not in ((2,), (3,)):
                raise InvalidInput(f"landing has shape {where.shape}: it must be (2,) or (3,)")
            if time is not None:
                time = validation.number("time", time, above=0, unit="s")
            shot = Shot(self.command, validation.read_only(where[:2]), time, None)
        before = self.__dict__.copy()
        try:
            self.shots = (*self.shots, shot)
            self._estimate()
            self._plan()
        except KickdynError:
            self.__dict__.update(before)
            raise

    def _air(self, theta: Array) -> Air:
        """Return the air for given unknowns, of which the first three count."""
        assert self._model.drag is not None
        drag = ScaledCoefficient(self._model.drag, math.exp(theta[0]))
        upwards = np.asarray(self._model.wind)[2]
        return replace(self._model, drag=drag, wind=np.array([theta[1], theta[2], upwards]))

    def _plan(self) -> None:
        air, theta = self._air(self._theta), self._theta
        self.launch = plan_launch(self.goal, self.ball, air)
        wanted, spin = self.launch.velocity, self.launch.spin
        if self.leg is None:
            velocity = _aimed(wanted, -np.array([self._gain(theta[3]), theta[4], theta[5]]))
            self.command = BallState(velocity=velocity, spin=spin)
        else:
            self.command = self._planned_kick(_aimed(wanted, [0.0, -theta[4], -theta[5]]), air)
        _, slopes = self._landing(theta, np.zeros(3), self.command)
        self._landing_slopes = slopes[:2]

    def _planned_kick(self, velocity: Array, air: Air) -> KickPlan:
        """Return the kick for a launch velocity [m/s]: the goal of that velocity in the vacuum."""
        assert self.leg is not None
        time = 2.0 * float(velocity[2]) / GRAVITY
        target = velocity[0] * time, velocity[1] * time, 0.0
        goal = Goal(target, time=time, spin=self.launch.spin)
        contact = Contact(restitution=float(expit(self._theta[3])), friction=self._friction)
        if isinstance(self.leg, KickLibrary):
            e = float(self.leg.reader.arrays["impact"][0])
            velocity = velocity * (1.0 + e) / (1.0 + float(expit(self._theta[3])))
            plan = self.leg.replan(self.leg.plan(goal), velocity)
        elif self._motion and self.shots:
            before = self.shots[-1].command
            assert isinstance(before, KickPlan)
            plan = replan_turned(before, velocity, contact)
        else:
            plan = plan_kick(
                self.leg, goal, self.ball, None, contact=contact, ball_position=self._ball_height,
                motion=self._motion,
            )  # fmt: skip
        after = self._struck(plan, self._theta[3])
        launch_velocity = _aimed(after.velocity, [0.0, self._theta[4], self._theta[5]])
        expected = BallState(after.position, launch_velocity, after.spin)
        when = self.launch.time if plan.share == 1.0 else None
        path = fly_to_target(expected, self.launch.reached, self.ball, air, when)
        return replace(plan, goal=self.goal, launch=self.launch, path=path)

    def _gain(self, logit_e: float) -> float:
        """Return the logarithm of the launch speed over the commanded speed, without a leg."""
        return math.log((1.0 + float(expit(logit_e))) / (1.0 + self._first_restitution))

    def _struck(self, plan: KickPlan, logit_e: float) -> BallState:
        """Return the ball that a kick gives with a restitution."""
        contact = replace(plan.impact.contact, restitution=float(expit(logit_e)))
        return strike(plan.impact.posture, plan.v, self.ball, contact).ball_after

    def _launched(self, values: Array, command: Command) -> BallState:
        """Return the launch that a command becomes, at the origin.

        The values, shape `(7,)`, are the first four unknowns, the error of the logarithm of the
        speed, and the sums of the errors of aim and of the kick's own angles [rad].
        """
        if isinstance(command, KickPlan):
            state, gain = self._struck(command, values[3]), 0.0
        else:
            state, gain = command, self._gain(float(values[3]))
        velocity = _aimed(state.velocity, [values[4] + gain, values[5], values[6]])
        return BallState(velocity=velocity, spin=state.spin)

    def _fly(
        self, theta: Array, error: Array, command: Command, end: float | Plane
    ) -> DifferentiableFlight:
        """Return the flight of a kick with the derivatives by the seven values of `_launched`."""
        values = np.array([*theta[:4], error[0], theta[4] + error[1], theta[5] + error[2]])
        return fly_with_slopes(
            lambda changed: (self._launched(changed, command), self._air(changed)),
            values, np.full(7, INCREMENT), self.ball, end, FLIGHT_TOL,
        )  # fmt: skip

    def _landing(self, theta: Array, error: Array, command: Command) -> tuple[Array, Array]:
        """Return landing and time of a command, `(3,)` [m, m, s], and derivatives, `(3, 9)`."""
        flight = self._fly(theta, error, command, LEVEL)
        if flight.end <= SHORTEST:
            return np.zeros(3), np.zeros((3, 9))  # no step of the solver ends there
        position, time = flight.slopes_at_plane(LEVEL.normal, flight.end)
        slopes = np.vstack([position[:2], time])[:, COLUMNS]
        return np.array([*flight.position(flight.end)[:2], flight.end]), slopes

    def _estimate(self) -> None:
        count = 3 * len(self.shots)
        spread = np.concatenate([self._prior, np.full(count, self._scatter)])
        middle = np.concatenate([self._theta0, np.zeros(count)])

        @keep_last
        def residuals_and_slopes(values: Array) -> tuple[Array, Array]:
            theta, errors = values[:6], values[6:].reshape(-1, 3)
            residuals, slopes = [(values - middle) / spread], [np.diag(1.0 / spread)]
            for k, (shot, error) in enumerate(zip(self.shots, errors, strict=True)):
                missed, slope = self._residuals(theta, error, shot)
                block = np.zeros((len(missed), len(values)))
                block[:, :6] = slope[:, :6]
                block[:, 6 + 3 * k : 9 + 3 * k] = slope[:, 6:]
                residuals.append(missed)
                slopes.append(block)
            return np.concatenate(residuals), np.vstack(slopes)

        fit = least_squares(
            lambda values: residuals_and_slopes(values)[0],
            np.concatenate([self._theta, *self._errors, np.zeros(3)]),
            jac=lambda values: residuals_and_slopes(values)[1],
            method="lm", x_scale=spread, xtol=1e-12, ftol=1e-8, max_nfev=50,
        )  # fmt: skip
        self._theta, self._errors = fit.x[:6], fit.x[6:].reshape(-1, 3)
        self._covariance = covariance(residuals_and_slopes(fit.x)[1])[:6, :6]
        shot = self.shots[-1]
        if shot.landing is not None:
            self._last_landing = shot.landing
        else:
            landing, _ = self._landing(self._theta, self._errors[-1], shot.command)
            self._last_landing = landing[:2]

    def _residuals(self, theta: Array, error: Array, shot: Shot) -> tuple[Array, Array]:
        if shot.track is not None:
            times = shot.track.times
            flight = self._fly(theta, error, shot.command, float(times[-1]))
            missed = (flight.states(times)[:, :3] - shot.track.positions).ravel()
            slopes = flight.slopes(times).reshape(missed.size, -1)[:, COLUMNS]
            return missed / self._deviation, slopes / self._deviation
        assert shot.landing is not None
        landing, slopes = self._landing(theta, error, shot.command)
        observed = np.array([*shot.landing, *([] if shot.time is None else [shot.time])])
        deviations = self._landing_deviations[: observed.size]
        missed = landing[: observed.size] - observed
        return missed / deviations, slopes[: observed.size] / deviations[:, None]

    def _rows(self) -> Iterable[Row]:
        yield "kicks", len(self.shots), ""
        if isinstance(self.command, KickPlan):
            yield "next kick, posture", self.command.q, "rad"
            yield "next kick, joint velocity", self.command.v, "rad/s"
        else:
            yield "next launch", self.command.velocity, "m/s"
        for name, value in self.estimates.items():
            yield name, f"{value:.3g} +- {self.deviations[name]:.2g}", UNITS.get(name, "")
        for name in ("scatter", "uncertainty"):
            size = math.sqrt(float(np.trace(getattr(self, f"landing_{name}"))))
            yield f"landing {name}", size, "m"
        yield "done", self.is_done, ""
        yield from warned(self.warnings)


def _checked_prior(prior: Mapping[str, float] | None, restitution: float) -> Array:
    """Return the standard deviations of the unknowns before the first kick, shape `(6,)`."""
    deviations = validation.mapping("prior", prior)
    unknown = set(deviations) - set(PRIOR)
    if unknown:
        raise InvalidInput(f"prior has {sorted(unknown)}: its names are {', '.join(PRIOR)}")
    sizes = {
        name: validation.number(f"prior {name}", value, above=0, unit=UNITS.get(name, ""))
        for name, value in {**PRIOR, **deviations}.items()
    }
    sizes["restitution"] /= restitution * (1.0 - restitution)  # of the logit
    return np.array(list(sizes.values()))


def _aimed(velocity: Array, errors: ArrayLike) -> Array:
    """Return a velocity with errors of its log speed, elevation and azimuth [rad] added to it."""
    gain, up, left = np.asarray(errors).tolist()
    speed = math.hypot(*velocity) * math.exp(gain)
    elevation = math.atan2(velocity[2], math.hypot(velocity[0], velocity[1])) + up
    azimuth = math.atan2(velocity[1], velocity[0]) + left
    level, rise = speed * math.cos(elevation), speed * math.sin(elevation)
    return np.array([level * math.cos(azimuth), level * math.sin(azimuth), rise])
