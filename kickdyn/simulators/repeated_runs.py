"""Plans carried out repeatedly, by robots that differ from the model, or to be corrected."""

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import cached_property
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from kickdyn.ball import BallState
from kickdyn.core import validation
from kickdyn.core.files import plain
from kickdyn.core.representation import ReprMixin, Row
from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput, KickdynError
from kickdyn.impact.collide import collide
from kickdyn.planning.kick import replan_motion, turn_plan
from kickdyn.planning.kick_library import KickLibrary
from kickdyn.planning.kick_plan import KickPlan
from kickdyn.planning.kick_reader import launch_axes
from kickdyn.planning.launch import Launch, plan_launch
from kickdyn.robot.collisions import FootKind
from kickdyn.robot.standing import is_floating
from kickdyn.simulators.mujoco_field import KickNoise
from kickdyn.simulators.run_in_mujoco import MujocoRun, run_in_mujoco
from kickdyn.simulators.tune_mujoco import MujocoTuning

MOST_RUNS = 10_000
"""Largest number of runs."""


@dataclass(frozen=True, eq=False, repr=False)
class NoisyRuns(ReprMixin):
    """Runs of one plan by robots that differ from it.

    Means and standard deviations are of the runs in which the foot hits the ball; they are NaN
    where no run does, standard deviations also where one does.

    Attributes:
        runs: one for each seed.
        noise: how much the robots differ.
    """

    runs: tuple[MujocoRun, ...]
    noise: KickNoise

    @property
    def upright(self) -> int:
        """Number of runs in which the robot stands 1 s after the ball has left."""
        return sum(run.upright for run in self.runs)

    @property
    def hits(self) -> tuple[MujocoRun, ...]:
        """The runs in which the foot hits the ball."""
        return tuple(run for run in self.runs if run.path is not None)

    @cached_property
    def launch_errors(self) -> Array:
        """Errors of relative speed, azimuth and elevation [rad] of the hits, shape `(k, 3)`.

        They are relative to the launch that meets the goal.
        """
        launches = [self.runs[0].plan.launch.velocity, *(r.ball_after.velocity for r in self.hits)]
        x, y, z = np.array(launches).T
        speeds, azimuths = np.sqrt(x * x + y * y + z * z), np.arctan2(y, x)
        elevations = np.arctan2(z, np.hypot(x, y))
        turns = np.remainder(azimuths - azimuths[0] + np.pi, 2.0 * np.pi) - np.pi
        errors = np.stack([speeds / speeds[0] - 1.0, turns, elevations - elevations[0]], axis=1)
        return validation.read_only(errors[1:])

    @property
    def means(self) -> Array:
        """Mean errors of relative speed, azimuth and elevation [rad], shape `(3,)`."""
        return self.launch_errors.mean(axis=0) if self.hits else np.full(3, math.nan)

    @property
    def deviations(self) -> Array:
        """Their standard deviations, shape `(3,)`."""
        few = len(self.hits) < 2
        return np.full(3, math.nan) if few else self.launch_errors.std(axis=0, ddof=1)

    @property
    def misses(self) -> Array:
        """Distances of the balls from the target by seed, infinite for missed balls, `(n,)` [m]."""
        return np.array([run.miss for run in self.runs])

    def to_json(self) -> dict[str, object]:
        """Return the numbers, for JSON: errors of speed, azimuth and elevation [rad]."""
        return {
            "runs": len(self.runs),
            "upright": self.upright,
            "hits": len(self.hits),
            "means": self.means.tolist() if self.hits else None,
            "deviations": self.deviations.tolist() if len(self.hits) > 1 else None,
            "misses": plain(self.misses),
        }

    def _rows(self) -> Iterable[Row]:
        yield "upright", f"{self.upright} of {len(self.runs)}", ""
        yield "hit the ball", f"{len(self.hits)} of {len(self.runs)}", ""
        for name, mean, spread, unit in zip(
            ("speed error", "azimuth error", "elevation error"), self.means, self.deviations,
            ("%", "deg", "deg"), strict=True,
        ):  # fmt: skip
            scale = 100.0 if unit == "%" else math.degrees(1.0)
            yield name, f"{scale * mean:+.1f} +- {scale * spread:.1f}", unit
        for share in (0.5, 0.9):
            miss = float(np.quantile(self.misses, share, method="inverted_cdf"))
            yield f"miss, {share:.0%} of the runs", f"up to {miss:.3g}", "m"


@validation.check_arguments
def run_with_noise(
    plan: KickPlan,
    runs: int = 50,
    *,
    noise: KickNoise | None = None,
    tuning: MujocoTuning | None = None,
    progress: Callable[[str], None] | None = None,
    foot: str = FootKind.SHAPES,
) -> NoisyRuns:
    """Carry out the motion of a plan with robots that differ from it, by the seeds from 0 on.

    Args:
        plan: with a `motion`.
        runs: their number, 1 to 10,000.
        noise: how much the robots differ; None is `KickNoise()`.
        tuning: contact of foot and ball of an earlier run, such as `run.tuning`; None is the one of
            `run_in_mujoco`.
        progress: called with a line of text before each run.
        foot: what strikes the ball, `shapes` or `plate`, as for `run_in_mujoco`.

    Raises:
        InvalidInput: as for `run_in_mujoco`.

    Example:
        >>> import kickdyn as kd
        >>> goal, ball, air = kd.Goal(20, time=1.2), kd.Ball(), kd.Air()
        >>> plan = kd.plan_kick(kd.Leg.human(), goal, ball, air, motion=True)
        >>> noisy = kd.run_with_noise(plan, 3)
        >>> noisy.upright, bool(noisy.deviations[0] < 0.05)
        (3, True)
    """
    validation.check_type(int, runs=runs)
    validation.number("runs", runs, at_least=1, at_most=MOST_RUNS)
    amount, done = noise or KickNoise(), list[MujocoRun]()
    for seed in range(runs):
        if progress is not None:
            progress(f"run {seed + 1} of {runs}")
        done.append(run_in_mujoco(plan, tuning=tuning, seed=seed, noise=amount, foot=foot))
        tuning = done[0].tuning
    return NoisyRuns(tuple(done), amount)


LARGEST_STEP = 1.5
"""Largest correction of a launch over its error."""


class Observer(StrEnum):
    """What gives the ball of a planned kick: `collide`, or the motion in MuJoCo."""

    COLLIDE = "collide"
    MUJOCO = "mujoco"


@validation.check_arguments
def refine_kick(
    plan: KickPlan,
    rounds: int = 2,
    by: str = Observer.COLLIDE,
    foot: str = FootKind.SHAPES,
    library: KickLibrary | None = None,
) -> KickPlan:
    r"""Correct the commanded launch of a plan by the ball that a contact of 10 ms gives.

    `strike`, by which kicks are planned, has no duration. In a real contact the foot turns under
    the ball, and the robot does not follow its motion exactly. In each round the motion is planned
    again, from the one before, for the launch

    .. math:: v = v_b + B^{-1} (v^* - \hat v_b)

    from the best plan so far, with its ball :math:`\hat v_b` as observed, and the launch
    :math:`v^*` that meets the goal from the place where this ball leaves the foot, with its spin.
    The slope B of observed by commanded launches is 1 at first and learns from each round
    (Broyden's method); a step is at most 1.5 times as large as the error. The motion of a robot
    that stands keeps its azimuth; in the end the robot is turned about the ball by the error of the
    azimuth (the plan's `heading`), which changes nothing else.

    Args:
        plan: with a `motion`.
        rounds: number of corrections, 1 to 10.
        by: `collide`, or `mujoco` for `run_in_mujoco` with its default contact.
        foot: what strikes the ball by `mujoco`, `shapes` or `plate`, as for `run_in_mujoco`.
        library: of `kick_library`, whose kicks take the place of motions that are planned again.

    Returns:
        The plan, of all rounds and the first one, whose ball is nearest to :math:`v^*`.
        Its `impact`, `path` and `landing_error` belong to the commanded launch by `strike`,
        which misses the target by what the contact is expected to add; `run_in_mujoco(...).miss`
        is the distance of the simulated ball from the target.

    Raises:
        InvalidInput: a plan without a motion, or a launch that is not in the library.
        KickdynError: a foot that misses the ball.
    """
    chosen, kind = validation.choice("by", by, Observer), validation.choice("foot", foot, FootKind)
    validation.check_type(int, rounds=rounds)
    validation.number("rounds", rounds, at_least=1, at_most=10)
    if plan.motion is None:
        raise InvalidInput("the plan has no motion: plan it with plan_kick(..., motion=True)")
    best, slope = _try(plan, chosen, kind), np.eye(3)
    for _ in range(rounds):
        step = np.linalg.lstsq(slope, best.error)[0]
        size = float(np.linalg.norm(step))
        if size == 0.0:  # the ball is as wished
            break
        step *= min(1.0, LARGEST_STEP * best.size / size)
        command = best.plan.impact.ball_after.velocity + step
        again = replan_motion if library is None else library.replan
        tried = _try(again(best.plan, command), chosen, kind)
        slope += np.outer(best.error - tried.error - slope @ step, step) / (step @ step)
        best = min(best, tried, key=lambda one: one.size)
    corrected = replace(best.plan, corrected_by=chosen.value)
    return turn_plan(corrected, best.turn) if is_floating(plan.leg) else corrected


class _Tried(NamedTuple):
    """A plan, the error of its ball's velocity, `(3,)` [m/s], and the angle of its turn [rad].

    The plan's robot is to be turned by `turn` [rad] about the ball; `error` has no such part.
    """

    plan: KickPlan
    error: Array
    turn: float

    @property
    def size(self) -> float:
        """Size of the error [m/s]."""
        return float(np.linalg.norm(self.error))


def _try(plan: KickPlan, by: Observer, foot: FootKind) -> _Tried:
    """Return the plan with the error of its ball's velocity."""
    ball = _observe(plan, by, foot)
    wished = _wished_velocity(plan, ball)
    if not is_floating(plan.leg):
        return _Tried(plan, wished - ball.velocity, 0.0)
    turn = launch_axes(wished)[2] - launch_axes(ball.velocity)[2]
    # a turned robot kicks the ball from another place, if only by a millimetre
    wished = _wished_velocity(plan, _turned(ball, turn, plan.impact.ball_before.position))
    turn = math.remainder(launch_axes(wished)[2] - launch_axes(ball.velocity)[2], math.tau)
    azimuth = launch_axes(plan.impact.ball_after.velocity)[2] - launch_axes(wished)[2]
    error = _about_vertical(azimuth) @ (wished - _about_vertical(turn) @ ball.velocity)
    return _Tried(plan, error, turn)


def _wished_velocity(plan: KickPlan, ball: BallState) -> Array:
    """Return the velocity with which a ball meets the goal from where it leaves, `(3,)` [m/s].

    The flight begins half of the contact's duration after the kick, which is `ball.time` [s].
    """
    launch = plan.launch
    if not isinstance(launch, Launch):
        return launch.velocity
    goal = plan.aim.seen_from(ball.position - plan.impact.ball_before.position, 0.0)
    if goal.time is not None:
        goal = replace(goal, time=goal.time - float(ball.time))
    if goal.beside is None:
        goal = replace(goal, spin=ball.spin)
    met = plan_launch(goal, plan.impact.ball, launch.air)
    return launch.velocity if met.limit is not None else met.velocity


def _observe(plan: KickPlan, by: Observer, foot: FootKind) -> BallState:
    """Return the ball that a plan gives; its time is half of the contact's duration."""
    impact = plan.impact
    if by is Observer.COLLIDE:
        hit = collide(impact.posture, impact.v_before, impact.ball, impact.contact)
        return replace(hit.ball_after, time=0.5 * hit.contact_time)
    run = run_in_mujoco(plan, foot=foot)
    if run.path is None:
        raise KickdynError("the foot does not reach the ball in MuJoCo: nothing can be corrected")
    return replace(run.ball_after, time=0.5 * run.contact_time)


def _about_vertical(angle: float) -> Array:
    return np.asarray(pin.rpy.rpyToMatrix(0.0, 0.0, angle))


def _turned(ball: BallState, angle: float, centre: Array) -> BallState:
    """Return a ball turned to the left about the vertical through a point."""
    rotation = _about_vertical(angle)
    place = centre + rotation @ (ball.position - centre)
    return BallState(place, rotation @ ball.velocity, rotation @ ball.spin, ball.time)
