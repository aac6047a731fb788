r"""`Learner`: kick, observe where the ball came down, correct the model, kick again.

The unknown differences between model and reality are

.. math:: \theta = (\ln c_D, w_x, w_y, \ln g, \alpha, \beta):

a factor of the drag, the wind, a factor of the launch speed (as from a wrong restitution), and
errors of aim up and to the left. Before any kick they are zero with the standard deviations
`PRIOR`. After each kick the estimate is the most probable one given all landings so far, each with
the scatter that the execution of a kick has,

.. math:: \min_\theta \; \theta^T P_0^{-1} \theta
    + \sum_k (x_k(\theta) - y_k)^T R_k^{-1} (x_k(\theta) - y_k)

with the landing :math:`y_k` that was observed and :math:`x_k(\theta)` that of the model.
"""

import math
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import least_squares

from kickdyn.air import Air
from kickdyn.ball import Ball, BallState
from kickdyn.core import validation
from kickdyn.core.representation import ReprMixin, Row
from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.flight.fly import fly
from kickdyn.identification.identify import replaced, scaled
from kickdyn.planning.goal import Goal
from kickdyn.planning.launch import Launch, plan_launch

PRIOR = {
    "drag": 0.3,
    "wind_x": 2.0,
    "wind_y": 2.0,
    "speed": 0.15,
    "elevation": 0.05,
    "azimuth": 0.05,
}
"""Standard deviations of what is unknown before the first kick: relative, m/s, relative, rad."""

SCATTER = 0.03
"""Relative scatter of launch speed, and scatter of direction [rad], from kick to kick."""


class Shot(NamedTuple):
    """A kick and what was seen of it.

    Attributes:
        velocity: commanded launch velocity, shape `(3,)` [m/s].
        landing: observed, shape `(2,)` [m, from the launch].
        time: observed, of the flight [s]; None if it was not.
    """

    velocity: Array
    landing: Array
    time: float | None


class Learner(ReprMixin):
    """Finds the launch that meets a goal in a world that the model knows only roughly.

    `learner.command` is the next launch; kick it, and pass the landing to `learner.observe`.

    Args:
        goal: on level ground: a distance with a time, an apex or a speed.
        ball: mass and radius.
        air: the model to begin with; None is `Air()`.
        scatter: how far kicks of one command differ: relative in speed, and in direction [rad].
        deviation: standard deviation of an observed landing [m].
        time_deviation: of an observed time of flight [s].
        prior: standard deviations by the names of `PRIOR`; those left out keep theirs.

    Raises:
        InvalidInput: a wrong argument, or an air without drag or with a wind that is a function.
    """

    def __init__(
        self,
        goal: Goal,
        ball: Ball,
        air: Air | None = None,
        *,
        scatter: float = SCATTER,
        deviation: float = 0.05,
        time_deviation: float = 0.02,
        prior: dict[str, float] | None = None,
    ) -> None:
        validation.check_type(Goal, goal=goal)
        validation.check_type(Ball, ball=ball)
        validation.check_type(Air, type(None), air=air)
        validation.check_type(dict, type(None), prior=prior)
        self.goal, self.ball, self.model = goal, ball, Air() if air is None else air
        if self.model.drag is None or callable(self.model.wind):
            raise InvalidInput(
                "air has no drag, or a wind that is a function of height: the learner corrects "
                "a drag model and a constant wind"
            )
        if abs(float(goal.target[2])) > 0.0:
            raise InvalidInput(
                f"goal is {float(goal.target[2]):g} m above the launch: the learner observes "
                "landings at the height of the launch"
            )
        self.scatter = validation.number("scatter", scatter, at_least=0, at_most=1)
        self.deviation = validation.number("deviation", deviation, above=0, unit="m")
        self.time_deviation = validation.number("time deviation", time_deviation, above=0, unit="s")
        unknown = set(prior or {}) - set(PRIOR)
        if unknown:
            raise InvalidInput(f"prior has {sorted(unknown)}: its names are {', '.join(PRIOR)}")
        self._prior = np.array(
            [
                validation.number(f"prior {name}", value, above=0)
                for name, value in {**PRIOR, **(prior or {})}.items()
            ]
        )
        self.shots: tuple[Shot, ...] = ()
        self._theta = np.zeros(len(PRIOR))
        self._covariance = np.diag(self._prior**2)
        self._plan()

    @property
    def estimates(self) -> dict[str, float]:
        """Estimates by name: factors of drag and speed less 1, wind [m/s], errors of aim [rad]."""
        return dict(zip(PRIOR, self._theta.tolist(), strict=True))

    @property
    def deviations(self) -> dict[str, float]:
        """Standard deviations of the estimates."""
        return dict(zip(PRIOR, np.sqrt(np.diag(self._covariance)).tolist(), strict=True))

    @property
    def air(self) -> Air:
        """The air with the drag and the wind that were learned, for planning."""
        return self._air(self._theta)

    @property
    def is_done(self) -> bool:
        """Whether what is left is noise.

        The last two landings missed by less than twice their scatter, or the correction that the
        next kick would test is smaller than half the scatter.
        """
        if not self.shots:
            return False
        slope = self._slopes(self._theta, self.command)[1]
        learnt = slope[:2] @ self._covariance @ slope[:2].T
        noise = self._noise(self.command)[:2, :2]
        last = self.shots[-1].landing - self.goal.target[:2]
        within = float(last @ np.linalg.solve(noise + learnt, last)) < 4.0 * 2.0
        return within and float(np.trace(learnt)) < 0.25 * float(np.trace(noise))

    def observe(self, landing: ArrayLike, time: float | None = None) -> None:
        """Learn from where the commanded kick came down.

        Args:
            landing: at the height of the launch, shape `(2,)` or `(3,)` [m, from the launch].
            time: of the flight [s], if it was measured.

        Raises:
            InvalidInput: a wrong shape or a number that is not finite.
        """
        where = validation.floats("landing", landing, unit="m")
        if where.shape not in ((2,), (3,)):
            raise InvalidInput(f"landing has shape {where.shape}: it must be (2,) or (3,)")
        if time is not None:
            time = validation.number("time", time, above=0, unit="s")
        self.shots = (*self.shots, Shot(self.command, where[:2], time))
        self._estimate()
        self._plan()

    def _plan(self) -> None:
        """Plan the next launch with what is known, and command it with the errors taken off."""
        self.launch: Launch = plan_launch(self.goal, self.ball, self.air)
        """The flight that is wanted next."""
        self.command: Array = _aimed(self.launch.velocity, -self._theta[3:])
        """The launch velocity to ask for, shape `(3,)` [m/s]."""

    def _air(self, theta: Array) -> Air:
        """Return the air for given unknowns."""
        return replaced(
            self.model,
            drag=scaled(self.model.drag, math.exp(theta[0])),
            wind=np.asarray(self.model.wind) + np.array([theta[1], theta[2], 0.0]),
        )

    def _landing(self, theta: Array, command: Array) -> Array:
        """Return where and when a commanded launch comes down, shape `(3,)` [m, m, s]."""
        state = BallState(velocity=_aimed(command, theta[3:]), spin=self.launch_spin)
        path = fly(state, self.ball, self._air(theta), tol=1e-8)
        return np.array([*path.landing.position[:2], path.duration])

    @property
    def launch_spin(self) -> Array:
        """Spin of the planned launches, shape `(3,)` [rad/s]: none."""
        return np.zeros(3)

    def _slopes(self, theta: Array, command: Array) -> tuple[Array, Array]:
        """Return landing and time, and their derivatives by the unknowns, shape `(3, 6)`."""
        middle = self._landing(theta, command)
        steps = 1e-4 * np.eye(len(theta))
        ahead = [self._landing(theta + step, command) for step in steps]
        return middle, (np.array(ahead) - middle).T / 1e-4

    def _noise(self, command: Array) -> Array:
        """Return the covariance of landing and time of one kick, shape `(3, 3)`."""
        aim = self._slopes(self._theta, command)[1][:, 3:] * self.scatter
        measured = np.diag([self.deviation**2, self.deviation**2, self.time_deviation**2])
        return np.asarray(aim @ aim.T + measured)

    def _estimate(self) -> None:
        """Find the most probable unknowns given all shots, and their covariance."""
        roots = [np.linalg.inv(np.linalg.cholesky(self._noise(s.velocity))) for s in self.shots]

        def rows(values: Array, root: Array, shot: Shot) -> Array:
            if shot.time is None:  # the landing alone: the first two rows of a lower triangle
                return np.asarray(root[:2, :2] @ values[:2])
            return np.asarray(root @ values)

        def both(theta: Array) -> tuple[Array, Array]:
            residuals, slopes = [theta / self._prior], [np.diag(1.0 / self._prior)]
            for shot, root in zip(self.shots, roots, strict=True):
                landing, slope = self._slopes(theta, shot.velocity)
                seen = np.array([*shot.landing, 0.0 if shot.time is None else shot.time])
                residuals.append(rows(landing - seen, root, shot))
                slopes.append(rows(slope, root, shot))
            return np.concatenate(residuals), np.vstack(slopes)

        found = least_squares(
            lambda theta: both(theta)[0], self._theta, jac=lambda theta: both(theta)[1],
            xtol=1e-6, ftol=1e-6, max_nfev=20,
        )  # fmt: skip
        self._theta = found.x
        slopes = found.jac
        self._covariance = np.linalg.inv(slopes.T @ slopes)

    def _rows(self) -> Iterable[Row]:
        yield "kicks", len(self.shots), ""
        yield "next launch", self.command, "m/s"
        for name, value in self.estimates.items():
            unit = (
                "m/s"
                if name.startswith("wind")
                else "rad"
                if name in ("elevation", "azimuth")
                else ""
            )
            yield name, f"{value:.3g} +- {self.deviations[name]:.2g}", unit
        yield "done", self.is_done, ""


def _aimed(velocity: Array, errors: Array) -> Array:
    """Return a velocity with errors of log speed, elevation and azimuth [rad] added to it."""
    speed = math.hypot(*velocity) * math.exp(errors[0])
    elevation = math.atan2(velocity[2], math.hypot(velocity[0], velocity[1])) + errors[1]
    azimuth = math.atan2(velocity[1], velocity[0]) + errors[2]
    level = speed * math.cos(elevation)
    return np.array(
        [level * math.cos(azimuth), level * math.sin(azimuth), speed * math.sin(elevation)]
    )
