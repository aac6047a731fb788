"""Every number of a plan's report, against strikes, flights and Pinocchio."""

import json
import math
import re
from types import SimpleNamespace

import numpy as np
import pinocchio as pin
import pytest
from tolerances import agrees, optimized

import kickdyn as kd
from kickdyn.planning import plan_report as module
from kickdyn.planning.plan_report import PlanReport, describe_passage, score, verdict
from kickdyn.scene.scene import Wall

LEG, BALL, AIR = kd.Leg.human(), kd.Ball(), kd.Air()


@pytest.fixture(scope="module")
def weak():
    return kd.plan_kick(LEG, kd.Goal(50, time=2), BALL, AIR)


@pytest.fixture(scope="module", params=[1.0, -1.0], ids=["left", "right"])
def plan(request):
    """A kick with the contact point on either side of the ball's centre, and of the launch."""
    g1, side = kd.Leg.from_robot("g1", legs_only=True), request.param
    spin = (0.0, -25.0 * side, 12.0 * side)
    return kd.plan_kick(g1, kd.Goal((6, side, 0), time=0.9, spin=spin), BALL, AIR)


def contact_point(plan):
    """Return the contact point above the ball's centre and to the left, along the launch [m]."""
    arm = plan.impact.posture.contact_point - plan.impact.ball_before.position
    along = plan.impact.ball_after.velocity * [1.0, 1.0, 0.0]
    return arm[2], np.cross([0.0, 0.0, 1.0], along / np.linalg.norm(along)) @ arm


def numbers(text):
    """Return the numbers of a line."""
    return [float(x) for x in re.findall(r"(?<![\w.])-?\d+\.?\d*(?:e-?\d+)?", text)]


def test_every_number_of_the_json_is_that_of_the_plan(plan):
    report = json.loads(json.dumps(PlanReport(plan, Wall(3.0, 0.2), True).to_json()))
    impact, leg, (up, left) = plan.impact, plan.leg, contact_point(plan)
    after, velocity = impact.ball_after, impact.ball_after.velocity
    speed, ahead = np.linalg.norm(velocity), plan.goal.target / plan.goal.distance
    there = kd.fly(after, BALL, AIR, plane=kd.Plane(after.position + 3.0 * ahead, -ahead, "centre"))
    passes = there.landing.position - after.position
    torque = pin.nonLinearEffects(leg.model, leg.model.createData(), plan.q, plan.v)
    uses = plan.v / leg.velocity_limit, torque / leg.effort_limit
    speed_use, torque_use = (np.abs(use)[plan.v != 0.0].max() for use in uses)
    angles = leg.joint_values(plan.q)
    expected = {
        "status": plan.status, "share": 1.0, "time": 0.9, "warnings": list(plan.warnings),
        "landing_error": plan.landing_error, "time_error": plan.path.duration - 0.9,
        "goal.target_m": plan.goal.target, "goal.time": 0.9,
        "launch.speed": speed, "launch.velocity": velocity, "launch.spin": after.spin,
        "launch.time": 0.9, "launch.angle_deg": math.degrees(math.asin(velocity[2] / speed)),
        "launch.azimuth_deg": math.degrees(math.atan2(velocity[1], velocity[0])),
        "impact.impulse": BALL.mass * velocity,
        "impact.foot_velocity": impact.posture.jacobian @ plan.v,
        "impact.restitution": 0.8, "impact.restitution_given": 0.8,
        "impact.normal": (impact.ball_before.position - impact.posture.contact_point) / BALL.radius,
        "impact.up_m": up, "impact.left_m": left, "leg.name": "g1", "leg.heading_deg": 0.0,
        "leg.v": plan.v, "leg.objective": "joint-speed",
        "leg.value": np.mean((plan.v / leg.velocity_limit)[plan.v != 0.0] ** 2),
        "leg.binding": list(plan.binding), "leg.speed_use": speed_use,
        "leg.torque_use": torque_use, "leg.worst_joint": impact.worst_joint[0],
        "leg.worst_joint_impulse": impact.worst_joint[1], "wall.above": passes[2] - 0.2,
        "wall.beside": abs(np.cross(ahead, passes)[2]) - 1.25 - BALL.radius,
        "goal_mouth.end": score(plan).end,
        "leg.q_deg": {name: math.degrees(angle) for name, angle in angles.items()},
    }  # fmt: skip
    for key, value in expected.items():
        shown = report
        for name in key.split("."):
            shown = shown[name]
        if isinstance(value, str | list):
            assert shown == value, key
        else:
            assert shown == pytest.approx(value, abs=2e-6), key


def test_the_table_has_the_contact_on_its_side_of_the_centre(plan):
    (line,) = (line for line in PlanReport(plan).table() if line.startswith("impact"))
    (up, left), impact = contact_point(plan), plan.impact
    sizes = np.linalg.norm(impact.impulse), np.linalg.norm(impact.posture.jacobian @ plan.v)
    assert numbers(line)[:4] == pytest.approx([1e3 * abs(up), 1e3 * abs(left), *sizes], abs=0.06)
    assert f"{'above' if up > 0 else 'below'} the ball's centre" in line
    assert f"mm to the {'left' if left > 0 else 'right'}" in line


def test_beyond_limits_names_them_and_where_the_ball_comes_down(weak):
    said = verdict(weak)
    assert "speed of knee" in said
    path = kd.fly(weak.impact.ball_after, BALL, AIR)
    for value in (path.range, path.duration):
        assert f"{value:.4g}" in said
    assert f"{50 - path.range:.3g} m from the target" in said
    assert f"{weak.share:.0%}" in said
    reached, wished = PlanReport(weak).table()[:2]
    assert numbers(reached)[0] == pytest.approx(weak.impact.ball_after.speed, abs=1e-4)  # digits
    assert numbers(wished)[0] == pytest.approx(weak.launch.speed, abs=1e-4)  # digits
    rows = {name: value for name, value, _ in weak._rows()}
    agrees(rows["launch"], weak.share * weak.launch.velocity, optimized(1e-7))


def test_a_wall_is_cleared_by_what_the_goal_asked_for():
    corner = kd.plan_kick(LEG, kd.Goal((20, 3.4, 2.1), over=(9.15, 2.0)), BALL, AIR)
    (base,) = (line for line in PlanReport(corner).table() if line.startswith("base"))
    turn = math.degrees(math.atan2(*corner.launch.velocity[1::-1]))
    assert (numbers(base), base[-4:]) == ([pytest.approx(turn, abs=6e-3)], "left")
    assert numbers(describe_passage(Wall(9.15, 1.9), corner)) == [pytest.approx(0.1, abs=1e-3)]
    with pytest.raises(kd.InvalidInput, match=r"hits the wall.* 1\.\d+ m from its edge"):
        describe_passage(Wall(9.15, 2.5), corner)
    with pytest.raises(kd.InvalidInput, match="between the ball and the target"):
        describe_passage(Wall(30.0, 1.9), corner)


@pytest.mark.parametrize(("state", "force", "friction"), [
    ("stands", (3, -4, 10), 0.5), ("turns", (3, -4, 10), 0.5), ("lifts-off", (3, -4, -10), None),
])  # fmt: skip
def test_the_friction_that_a_foot_needs_is_that_of_its_impulse(state, force, friction):
    impulses = {"sole": np.array([*force, 0.0, 0.0, 0.0])}
    hit = SimpleNamespace(support_impulses=impulses, footing={"sole": state})
    stands = SimpleNamespace(impact=hit, balance=0.0123)
    assert module._least_friction("sole", stands) == friction
    said = module._describe_stance("sole", stands)
    assert "12.3 mm inside" in said
    assert state.replace("-", " ") in said
    assert ("friction of 0.5" in said, "the moment" in said) == (
        state == "stands",
        state == "turns",
    )
