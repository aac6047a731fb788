"""Planning a swing: from rest through a planned kick's impact to rest again, within limits."""

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from kickdyn.core import validation
from kickdyn.core.representation import ReprMixin, Row
from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.planning.goal import PlanStatus
from kickdyn.planning.kick_plan import KickPlan
from kickdyn.planning.swing_phase import LONGEST, Motion, SwingPhase, check_solver, swing_chain
from kickdyn.robot.kicking_chain import (
    KickingChain,
    check_unconstrained,
    configuration_with_angles,
    with_angles,
)
from kickdyn.robot.leg import Leg


@dataclass(frozen=True, eq=False, repr=False)
class Swing(ReprMixin):
    """A joint trajectory from rest through the impact to rest, with its errors and limits.

    Attributes:
        status: `met`; or `beyond-limits`: then this is the same kick at `share` of its speed, the
            largest share to which the leg can be brought from rest, and from which it can be
            stopped.
        plan: the planned kick.
        share: share of the planned joint velocity that is reached; the launch of the ball scales
            alike.
        limit: reason why the planned kick has no swing, in a line; empty where the status is `met`.
        objective: objective that was minimized, `torque-squared` or `time`.
        value: value of the objective [s].
        backswing: the motion from rest to the impact.
        follow_through: the motion from the impact to rest. At the impact, v jumps as `strike`
            computes it.
    """

    status: PlanStatus
    plan: KickPlan
    share: float
    limit: str
    objective: str
    value: float
    backswing: SwingPhase
    follow_through: SwingPhase

    def _rows(self) -> Iterable[Row]:
        yield "status", self.status, ""
        if self.limit:
            yield "limit", self.limit, ""
        yield "share of the planned speed", self.share, ""
        yield "backswing", self.backswing.duration, "s"
        yield "follow-through", self.follow_through.duration, "s"
        yield f"objective {self.objective}", self.value, "s"
        yield "share of the torque limit", self.torque_use, ""
        yield "share of the speed limit", self.speed_use, ""
        yield "range left", self.range_left, "rad"
        yield "defect", self.defect, ""
        yield "impact error", self.impact_error, ""

    @property
    def phases(self) -> tuple[SwingPhase, SwingPhase]:
        """The backswing and the follow-through."""
        return self.backswing, self.follow_through

    @property
    def chain(self) -> KickingChain:
        """The joints that move, with their limits; all others stay where they are."""
        return self.backswing.chain

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the joints that move."""
        return self.chain.names

    def sample(self, t: ArrayLike) -> Motion:
        """Return the motion at one time or several.

        Args:
            t: times since the impact, below 0 before it, shape `(k,)`, not falling [s]. At 0 it is
                the motion just before the impact.

        Raises:
            InvalidInput: times that fall, or a time outside the swing.
        """
        time = np.atleast_1d(validation.floats("t", t, unit="s"))
        if time.ndim > 1 or (np.diff(time) < 0).any():
            raise InvalidInput(f"t is {time.tolist()}: it must be a number, or times that rise")
        before = self.backswing.sample(time[time <= 0])
        after = self.follow_through.sample(time[time > 0])
        return Motion(*(np.concatenate(pair) for pair in zip(before, after, strict=True)))

    def configuration(self, t: float) -> Array:
        """Return the configuration of the whole leg at a time, shape `(nq,)` [rad; m].

        Args:
            t: time since the impact [s]. Before and after the swing the leg is at rest.
        """
        asked = validation.number("t", t, unit="s")
        time = min(max(asked, -self.backswing.duration), self.follow_through.duration)
        q = self.plan.q.copy()
        q[self.chain.qs] = self.sample(time).q[0]
        return q

    @property
    def torque_use(self) -> float:
        """Largest torque over its limit, at 20 times per interval between nodes."""
        return max(phase.torque_use for phase in self.phases)

    @property
    def speed_use(self) -> float:
        """Largest joint speed over its limit, at 20 times per interval between nodes."""
        return max(phase.speed_use for phase in self.phases)

    @property
    def range_left(self) -> float:
        """Least distance of a joint from the ends of its range [rad]; below 0 it is outside.

        It is evaluated at 20 times per interval between nodes.
        """
        return min(phase.range_left for phase in self.phases)

    @property
    def defect(self) -> float:
        """Largest error of the acceleration that the torques give, over the largest acceleration.

        The torques are those of the recursive Newton-Euler algorithm, and the articulated-body
        algorithm computes the acceleration from them, at 20 times per interval between nodes.
        """
        model, data = self.chain.model, self.chain.model.createData()
        worst = 0.0
        for phase in self.phases:
            fine = phase.fine
            rows = zip(fine.q, fine.v, fine.torque, strict=True)
            given = np.array([pin.aba(model, data, *row) for row in rows])
            worst = max(worst, float(np.abs(given - fine.a).max() / np.abs(fine.a).max()))
        return worst

    @property
    def impact_error(self) -> float:
        """Largest difference from the planned q and v before and after the impact [rad, rad/s]."""
        chain, impact = self.chain, self.plan.impact
        worst = 0.0
        for phase, v in zip(self.phases, (impact.v_before, impact.v_after), strict=True):
            motion = phase.sample(0.0)
            off = [motion.q[0] - self.plan.q[chain.qs], motion.v[0] - self.share * v[chain.vs]]
            worst = max(worst, float(np.abs(off).max()))
        return worst


@validation.check_arguments
def plan_swing(
    leg: Leg,
    plan: KickPlan,
    *,
    objective: str = "torque-squared",
    longest: float = LONGEST,
    start: ArrayLike | None = None,
    end: ArrayLike | None = None,
    nodes: int = 24,
) -> Swing:
    r"""Find the motion from rest to a planned impact, and from there to rest again.

    The torques of the equations of motion are even in velocity, so that a backswing is a motion
    from the impact to rest, backwards in time; both phases are computed as such. Range, speed and
    torque limits of the leg hold throughout. Torques may jump at both ends and at the impact. Needs
    CasADi, `pip install "kickdyn[swing]"`.

    Args:
        leg: the leg that was planned for, or one that differs from it in its limits only.
        plan: a kick by `plan_kick`; with `swing=True` it finds one that has a swing.
        objective: `torque-squared`, :math:`\int \frac1n \sum_i (\tau_i / \tau_{max,i})^2 dt`; or
            `time`, the sum of both durations.
        longest: longest duration of either phase [s].
        start: posture at rest before the kick, shape `(nq,)` [rad; m for prismatic joints]. With
            None, it is any posture in which the torques can hold the joints.
        end: posture at rest after the kick, likewise.
        nodes: number of intervals of either phase. Where the solver does not come up to the motion
            that `plan_kick(..., swing=True)` found, that one is taken, with its own nodes.

    Raises:
        InvalidInput: CasADi is missing; a joint is at the end of its range and moves into it; no
            swing is found; a leg with supports or loops, which tie joints together that a swing
            chooses one by one, or with stiff joints; joints that move but are not between base and
            foot, or joints without limits; a value out of range; a swing that reaches only a share
            of the planned speed, where the restitution of the plan depends on the speed.
    """
    given, leg = leg, with_angles(leg)
    check_unconstrained(leg, "swings are planned")
    check_solver()
    from kickdyn.planning.stop_problem import Stop, StopSolver, SwingObjective

    objective = validation.choice("objective", objective, SwingObjective)
    longest = validation.number("longest", longest, at_least=0.01, at_most=60, unit="s")
    if not isinstance(nodes, int) or isinstance(nodes, bool) or not 4 <= nodes <= 200:
        raise InvalidInput(f"nodes is {nodes!r}: it must be a whole number from 4 to 200")
    chain = _checked_chain(leg, plan)
    rests = _checked_rest(chain, given, "start", start), _checked_rest(chain, given, "end", end)
    q, before, after = plan.q[chain.qs], plan.v[chain.vs], plan.impact.v_after[chain.vs]
    for name, v in (("backswing", -before), ("follow-through", after)):
        _check_stoppable(chain, leg, name, q, v)
    known = _known_phases(chain, plan, longest) if start is None and end is None else None
    try:
        phases, share, limit = StopSolver(chain, nodes, objective).find_both(
            Stop(-1, q, -before, rests[0], longest), Stop(1, q, after, rests[1], longest)
        )
    except InvalidInput:
        if known is None:
            raise
        share = 0.0
    if known is not None and share < 1.0:
        phases, share, limit = known, 1.0, ""
    if share < 1e-3:
        raise InvalidInput(f"there is no swing to this kick; {limit}")
    _check_restitution(plan, share)
    return Swing(
        status=PlanStatus.MET if share == 1.0 else PlanStatus.BEYOND_LIMITS,
        plan=plan,
        share=share,
        limit=limit,
        objective=objective,
        value=sum(
            phase.duration if objective == SwingObjective.TIME else phase.torque_squared
            for phase in phases
        ),
        backswing=phases[0],
        follow_through=phases[1],
    )


def _check_restitution(plan: KickPlan, share: float) -> None:
    """Raise `InvalidInput` where the restitution at a share of the speed is another."""
    impact = plan.impact
    e = impact.contact.restitution_at(share * impact.approach_speed)
    if share < 1.0 and e != impact.restitution:
        raise InvalidInput(
            f"the swing reaches {share:.0%} of the planned speed, at which the restitution is "
            f"{e:.4g}, not {impact.restitution:.4g}: the kick is another, so plan it with "
            "plan_kick(swing=True)"
        )


def _known_phases(
    chain: KickingChain, plan: KickPlan, longest: float
) -> tuple[SwingPhase, SwingPhase] | None:
    """Return the phases that a plan contains, if it has some that keep the limits of a chain."""
    if plan.phases is None:
        return None
    back, on = (replace(phase, chain=chain) for phase in plan.phases)
    for phase in (back, on):
        within = max(phase.torque_use, phase.speed_use) <= 1.0 and phase.range_left >= 0.0
        if not within or phase.duration > longest:
            return None
    return back, on


def _checked_chain(leg: Leg, plan: KickPlan) -> KickingChain:
    """Return the joints that swing, or raise `InvalidInput` where the plan is for others."""
    planned = plan.impact.posture.leg
    if planned.joint_names != leg.joint_names or planned.frame != leg.frame:
        raise InvalidInput(f"the plan is for {planned!r}: it must be for {leg!r}")
    chain, speeds = swing_chain(leg), np.abs(plan.impact.v_after)
    idle = speeds.copy()
    idle[chain.vs] = 0.0
    if idle.max() > 1e-9 * speeds.max():
        worst = int(np.argmax(idle))
        name = next(name for name in leg.joint_names if leg.velocity_index(name) == worst)
        raise InvalidInput(f"the impact moves {name}, which does not swing the foot: lock it first")
    return chain


def _checked_rest(chain: KickingChain, leg: Leg, name: str, q: ArrayLike | None) -> Array | None:
    """Return a posture at rest, or raise `InvalidInput` where it is out of range."""
    if q is None:
        return None
    try:
        rest: Array = configuration_with_angles(leg, q)[chain.qs]
    except InvalidInput as error:
        raise InvalidInput(f"{name}: {error}") from None
    outside = (rest < chain.lower) | (rest > chain.upper)
    if outside.any():
        i = int(np.argmax(outside))
        raise InvalidInput(
            f"{name} has {chain.names[i]} at {rest[i]:g}: it must be in "
            f"{chain.lower[i]:g} to {chain.upper[i]:g} rad"
        )
    return rest


def _check_stoppable(chain: KickingChain, leg: Leg, phase: str, q: Array, v: Array) -> None:
    """Refuse what no torque can stop, with the joint's name, which the solver would not give."""
    distance = np.where(v > 0, chain.upper - q, q - chain.lower)
    fast = np.where(distance <= 1e-9, np.abs(v) / chain.velocity_limit, 0.0)
    worst = int(np.argmax(fast))
    if fast[worst] <= 1e-6:
        return
    name, speed = chain.names[worst], abs(float(v[worst]))
    angle, unit = round(float(q[worst]), 9) + 0.0, leg.joint_unit(name)
    raise InvalidInput(
        f"there is no swing to this kick; {phase}: {name} is at the end of its range ({angle:.4g} "
        f"{unit}) and moves on at {speed:.4g} {unit}/s; "
        "plan_kick(..., swing=True) finds a kick that can stop"
    )
