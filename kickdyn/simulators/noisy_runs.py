"""A planned motion carried out by many robots that differ from the one of the plan."""

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from kickdyn.core import validation
from kickdyn.core.files import finite
from kickdyn.core.representation import ReprMixin, Row
from kickdyn.core.validation import Array
from kickdyn.planning.kick_plan import KickPlan
from kickdyn.simulators.mujoco_field import KickNoise
from kickdyn.simulators.run_in_mujoco import MujocoRun, run_in_mujoco
from kickdyn.simulators.striking_foot import Foot
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
        launches = [run.ball_after.velocity for run in self.hits]
        wish = _polar(np.asarray(self.runs[0].plan.launch.velocity))
        polar = np.array([_polar(launch) for launch in launches]).reshape(-1, 3)
        azimuths = np.remainder(polar[:, 1] - wish[1] + np.pi, 2.0 * np.pi) - np.pi
        errors = np.stack([polar[:, 0] / wish[0] - 1.0, azimuths, polar[:, 2] - wish[2]], axis=1)
        validation.protect(errors)
        return errors

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
            "misses": [finite(miss) for miss in self.misses.tolist()],
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
    foot: str = Foot.SHAPES,
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


def _polar(velocity: Array) -> Array:
    """Return speed, azimuth and elevation of a velocity, shape `(3,)` [m/s, rad, rad]."""
    x, y, z = velocity
    return np.array([math.hypot(x, y, z), math.atan2(y, x), math.atan2(z, math.hypot(x, y))])
