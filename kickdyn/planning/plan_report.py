"""A planned kick in words and in JSON, with the wall and the goal that it meets on a pitch."""

import math
from dataclasses import dataclass
from typing import Any

from kickdyn.ball import BallState
from kickdyn.core.files import attributes, plain
from kickdyn.core.representation import distance_in_words
from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.flight.follow import Course
from kickdyn.planning.goal import Goal, PlanStatus
from kickdyn.planning.kick_plan import KickPlan
from kickdyn.planning.launch import Launch, OutOfReach
from kickdyn.planning.meeting import LandingSlopes, Meeting
from kickdyn.planning.passes import Pass
from kickdyn.scene.scene import Passage, Score, Wall, check_before, passage_on, score_at

SAMPLE_RATE = 100.0
"""Rate of a motion's samples [Hz]."""

WALL_CLEARANCE = 0.1
"""Clearance of the ball's lower edge over a wall where nothing else is asked for [m]."""


OBSERVERS = {"collide": "a contact that takes time", "mujoco": "its motion in MuJoCo"}
"""What a launch is corrected by, in words."""

FAULTS = {
    PlanStatus.MET: "",
    PlanStatus.COLLIDES: " But a body is inside the ball or another body, or under the ground.",
    PlanStatus.SUPPORT_MOVES: " But the ground cannot keep the supporting foot at rest.",
    PlanStatus.BEYOND_LIMITS: " But the motion does not keep all limits.",
}
"""What a kick that meets its goal is worth, by the status of its plan."""


def passage_of(wall: Wall, plan: KickPlan) -> Passage | None:
    """Return the passage of a plan's ball by a wall; None if it comes down before."""
    return passage_on(plan.path, wall, plan.aim.ahead, plan.impact.ball.radius)


def describe_passage(wall: Wall, plan: KickPlan) -> str:
    """Return by how much the ball clears the wall, as a sentence; `InvalidInput` if it does not."""
    check_before(wall, plan.aim.distance)
    passage = passage_of(wall, plan)
    if passage is None:
        return "The ball lands before it reaches the wall."
    if passage.is_clear:
        return str(passage)
    weak = "" if plan.share == 1.0 else "the goal is beyond the limits of the leg, and "
    raise InvalidInput(f"{weak}the ball {passage.hit}")


def score(plan: KickPlan) -> Score:
    """Return the score of a kick at the goal."""
    radius, path = plan.impact.ball.radius, plan.path
    displacement = path.sample(path.duration).position - path.launch.position
    ahead, left, up = displacement.tolist()
    arrives = plan.aim.target[0] - ahead <= 1e-3 and up > -radius
    return score_at(left, up, radius, arrives=arrives)


@dataclass(frozen=True)
class PlanReport:
    """A planned kick with the wall and the goal that were asked about."""

    plan: KickPlan
    wall: Wall | None = None
    goal_mouth: bool = False

    def sentences(self) -> list[str]:
        """Return the answer in sentences; raise `InvalidInput` where the ball hits the wall."""
        plan = self.plan
        sentences = [
            verdict(plan),
            self.wall and describe_passage(self.wall, plan),
            self.goal_mouth and str(score(plan)),
            _describe_place(plan),
            plan.motion
            and f"The motion takes {-plan.motion.begin:.3g} s from rest to the impact and "
            f"{plan.motion.end:.3g} s from there to rest, with "
            f"{_limit_use(plan.speed_use, plan.torque_use)}.",
            *_describe_meeting(plan),
            *(_describe_stance(name, plan) for name in plan.impact.footing),
        ]
        return [sentence for sentence in sentences if sentence]

    def to_json(self) -> dict[str, Any]:
        """Return the report as what JSON can hold: SI units, degrees where a name says so."""
        plan, impact, leg = self.plan, self.plan.impact, self.plan.leg
        up, left = plan.impact_target.contact_offset
        masses = impact.posture.effective_mass_limits(impact.contact.normal)
        joint, joint_impulse = impact.worst_joint
        errors = "landing_error time_error" if isinstance(plan.goal, Goal) else "velocity_error"
        report = {
            "status": plan.status,
            "goal": _goal_json(plan.goal),
            "launch": _launch_json(plan.launch),
            "impact": {
                **attributes(impact, "impulse foot_velocity restitution"),
                "restitution_given": impact.contact.restitution,
                "normal": impact.contact.normal.tolist(),
                "effective_mass": plain(masses),
                "up_m": up,
                "left_m": left,
            },
            "leg": {
                "name": leg.name,
                "heading_deg": math.degrees(plan.heading),
                "moved_m": plan.moved.tolist(),
                "q_deg": leg.angles_deg(plan.q),
                "q_m": leg.positions_m(plan.q),
                **attributes(plan, "v objective value binding speed_use torque_use"),
                "worst_joint": joint,
                "worst_joint_impulse": joint_impulse,
            },
            "time": plan.path.duration,
            **attributes(plan, f"share sensitivity_to_ball warnings {errors}"),
        }
        if plan.corrected_by:
            report["corrected_by"] = plan.corrected_by
        if plan.meeting is not None:
            slopes, meeting = _landing_slopes(plan), _meeting_json(plan.meeting)
            if isinstance(plan.goal, Goal):
                meeting["target_position"] = plan.target_position.tolist()
            meeting["landing_slopes"] = slopes and attributes(slopes, "time velocity place")
            report |= {"meeting": meeting, "meetings": [_meeting_json(x) for x in plan.meetings]}
        if self.wall is not None:
            above, beside, _ = passage_of(self.wall, plan) or (None, None, None)
            report["wall"] = {"above": above, "beside": beside}
        if self.goal_mouth:
            report["goal_mouth"] = score(plan)._asdict()
        if plan.balance is not None:
            report["stance"] = {
                "footing": {name: str(state) for name, state in impact.footing.items()},
                "balance": plan.balance,
                "impulse": plain(impact.support_impulses),
                "friction": {name: _least_friction(name, plan) for name in impact.footing},
            }
        if plan.motion is not None:
            samples = plan.motion.samples(SAMPLE_RATE)
            numbers = attributes(samples, "q v torque ground_wrench")
            report["motion"] = {"joints": samples.joints, "time": samples.t.tolist(), **numbers}
        return report


def _describe_place(plan: KickPlan) -> str:
    """Return where a leg is placed that kicks a ball beside its plane, as a sentence."""
    if not plan.moved.any():
        return ""
    turn = math.degrees(plan.heading)
    turned = f"turned by {abs(turn):.3g} deg to the {'left' if turn > 0.0 else 'right'} and "
    return (
        f"The leg has to be {turned if abs(turn) >= 0.005 else ''}moved by {_point(plan.moved)} "
        "from where it was given: the ball is beside the plane in which its foot moves."
    )


def _describe_meeting(plan: KickPlan) -> list[str]:
    """Return the place of the meeting with a moving ball, and its tolerances, as sentences."""
    meeting = plan.meeting
    if meeting is None:
        return []
    line = f"The ball is met {meeting.wait:.3g} s after it was seen, at "
    line += f"{_point(meeting.ball.position)} in the world frame"
    if isinstance(plan.goal, Goal):
        seen = math.dist(plan.target_position, meeting.incoming.state.position)
        distance = math.hypot(*plan.goal.target)
        line += f", {distance:.4g} m from the target ({seen:.4g} m from where it was seen)"
    possible, sought = sum(x.impact is not None for x in plan.meetings), len(plan.meetings)
    if sought > 1:
        others = {sought: "all of them", 1: "this one only"}.get(possible, f"{possible} of them")
        line += f"; kicks were sought for {sought} times and found for {others}"
    lines, slopes = [line + "."], _landing_slopes(plan)
    if slopes is not None:
        texts = (
            "the foot {:.2g} ms early or late",
            "the ball's velocity {:.3g} mm/s off",
            "the ball's place {:.2g} mm off",
        )
        pairs = zip(texts, slopes.tolerances, strict=True)
        errors = [text.format(1e3 * error) for text, error in pairs if math.isfinite(error)]
        lines.append(
            "Each of these errors alone moves the ball by up to 10 cm at the target: "
            f"{', or '.join(errors)}."
        )
    return lines


def _point(place: Array) -> str:
    """Return a place in words, its rounding as 0."""
    return f"({', '.join(f'{round(x, 9) + 0.0:.4g}' for x in place.tolist())}) m"


def _landing_slopes(plan: KickPlan) -> LandingSlopes | None:
    """Return the derivatives of the landing of a flight to a target."""
    if plan.meeting is None or isinstance(plan.path, Course):
        return None
    return plan.meeting.landing_slopes


def _verdict_of_trap(plan: KickPlan) -> str:
    after, path, wished = plan.impact.ball_after, plan.path, plan.launch.velocity
    spin, speed = math.hypot(*after.spin), math.hypot(*wished)
    release = "The foot leaves the ball "
    release += f"with {after.speed:.3g} m/s" if plan.share < 1.0 or speed else "at rest"
    release += f", with a spin of {spin:.3g} rad/s" if spin > 1e-9 else ""
    if plan.share < 1.0:
        wish = f"velocity of {speed:.3g} m/s" if speed else "rest"
        line = (
            f"The wished {wish} is beyond the limits of the leg{_limits(plan)}: it can give the "
            f"ball {plan.share:.0%} of the change of velocity. {release}, "
            f"{plan.velocity_error:.3g} m/s off the wish."
        )
    else:
        line = f"{release}; the computed velocity is {plan.velocity_error:.2g} m/s off."
        line += FAULTS[plan.status]
    assert isinstance(path, Course)
    rests = "rests" if path.status == "at-rest" else "is"
    return f"{line} It {rests} {path.distance:.3g} m away {path.duration:.3g} s later."


def verdict(plan: KickPlan) -> str:
    """Return in a line whether the goal is met, and else where the kick ends."""
    if not isinstance(plan.goal, Goal):
        return _verdict_of_trap(plan)
    path, after = plan.path, f"after {plan.path.duration:.4g} s"
    target = f"the target {_point(plan.goal.target)}"
    if plan.meeting is not None:
        after = f"{plan.path.duration:.4g} s after the kick"
        target = f"the target {_point(plan.target_position)} in the world frame"
    error = distance_in_words(plan.landing_error)
    if plan.corrected_by:
        line = (
            f"The launch is corrected by {OBSERVERS[plan.corrected_by]}, for {target}; by an "
            f"impact without duration, the ball would miss it by {error}."
        )
        return line + FAULTS[plan.status]
    if plan.share == 1.0:
        line = f"The ball reaches {target} {after}; the computed impact and flight miss it by "
        return f"{line}{error}.{FAULTS[plan.status]}"
    if path.status == "at-plane":
        end = f"passes the target {after}, {plan.time_error:.3g} s too late"
    elif isinstance(path, Course):
        end = f"stops {path.distance:.4g} m away {after}"
    else:
        does = "lands" if path.status == "landed" else "is still aloft"
        end = f"{does} {path.range:.4g} m away {after}"
    missed = "" if plan.landing_error < 5e-4 else f", {plan.landing_error:.3g} m from the target"
    gives = f"{plan.share:.0%} of the speed that {target} requires"
    if plan.meeting is not None:
        gives = (
            f"{plan.share:.0%} of the change of velocity that {target} requires, so that it leaves "
            f"with {plan.impact.ball_after.speed:.3g} m/s in place of {plan.launch.speed:.3g} m/s"
        )
    return (
        f"The goal is beyond the limits of the leg{_limits(plan)}. Its hardest kick in this "
        f"direction gives the ball {gives}. The ball {end}{missed}."
    )


def _limits(plan: KickPlan) -> str:
    """Return the limits that a plan reaches, in brackets."""
    return f" ({', '.join(plan.binding)})" if plan.binding else ""


def unreachable_json(goal: Goal, error: OutOfReach) -> dict[str, Any]:
    """Return the output of `--json` for a goal that nothing meets."""
    nearest, launch = None, error.nearest
    if isinstance(launch, Launch):
        nearest = {**_goal_json(launch.reached), "launch_speed": launch.speed}
    elif isinstance(launch, Pass):
        nearest = {"distance": launch.course.distance, "time": launch.time}
    status = PlanStatus.UNREACHABLE
    return {"status": status, "goal": _goal_json(goal), "limit": error.limit, "nearest": nearest}


def _least_friction(frame: str, plan: KickPlan) -> float | None:
    """Return the least coefficient of friction under a support; None if it is not pressed."""
    x, y, z = plan.impact.support_impulses[frame][:3].tolist()
    return math.hypot(x, y) / z if z > 0.0 else None


def _describe_stance(frame: str, plan: KickPlan) -> str:
    friction, state, needs = _least_friction(frame, plan), plan.impact.footing[frame], ""
    if state == "stands" and friction:
        needs = f", which needs a coefficient of friction of {friction:.2g} or more"
    elif state == "turns":
        needs = " about the vertical: friction cannot supply the moment that keeps it at rest"
    return (
        f"The robot stands on {frame}, with its centre of mass {1e3 * (plan.balance or 0.0):.1f} "
        f"mm inside the edge of the sole, seen from above. In the impact this foot "
        f"{state.replace('-', ' ')}{needs}."
    )


def _limit_use(speed: float, torque: float) -> str:
    """Return the largest use of limits in words; 0 is of joints without a limit."""
    uses = {"speed": speed, "torque": torque}
    named = [f"{use:.0%} of the {name} limits" for name, use in uses.items() if use > 0.0]
    return f"up to {' and '.join(named)}" if named else "no use of the limits"


def _launch_json(launch: Launch | Pass | BallState) -> dict[str, Any]:
    if isinstance(launch, BallState):
        return attributes(launch, "speed velocity spin")
    angles = {"angle_deg": math.degrees(launch.angle), "azimuth_deg": math.degrees(launch.azimuth)}
    return attributes(launch, "speed velocity spin time iterations") | angles


def _goal_json(goal: Goal | BallState) -> dict[str, Any]:
    if isinstance(goal, BallState):
        return attributes(goal, "velocity")
    beside = {} if goal.beside is None else {"beside": goal.beside}
    return {"target_m": goal.target.tolist(), goal.kind: getattr(goal, goal.kind), **beside}


def _meeting_json(meeting: Meeting) -> dict[str, Any]:
    use = meeting.speed_use if meeting.impact is not None else None
    numbers = attributes(meeting.ball, "time position velocity spin")
    return numbers | {"share": meeting.share, "speed_use": use, "reason": meeting.reason}
