import json
import math
import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pinocchio as pin
import pytest

import kickdyn as kd
from kickdyn.planning.plan_report import (
    PlanReport,
    _describe_stance,
    _limit_use,
    describe_passage,
    score,
    verdict,
)
from kickdyn.scene.pitch import Wall, read_wall

LEG, BALL, AIR = kd.Leg.human(), kd.Ball(), kd.Air()
WEAK = kd.plan_kick(LEG, kd.Goal(50, time=2), BALL, AIR)


def test_beyond_limits_names_them_and_where_the_ball_comes_down():
    said = verdict(WEAK)
    assert "speed of knee" in said
    path = kd.fly(WEAK.impact.ball_after, BALL, AIR)
    down = f"lands {path.range:.4g} m away after {path.duration:.4g} s"
    assert f"{down}, {50 - path.range:.3g} m from the target" in said


def test_late_and_beside():
    late = kd.plan_kick(LEG, kd.Goal(15, time=0.55), BALL, AIR, surface="carpet")
    passed = f"passes the target after {late.path.duration:.4g} s, {late.time_error:.3g} s"
    assert f"{passed} too late." in verdict(late)
    high = kd.plan_kick(LEG, kd.Goal((30, 0, 5), time=1.3), BALL, AIR)
    assert high.path.status == "at-plane"
    assert f"late, {high.landing_error:.3g} m from the target." in verdict(high)
    stops = kd.plan_kick(kd.Leg.testbed(), kd.Goal(40, time=9), BALL, AIR, surface="turf")
    assert f"stops {stops.path.distance:.4g} m away" in verdict(stops)


def test_lines_and_json():
    lines = PlanReport(WEAK).table()
    heads = ["reached", "wished", "impact", "leg"]
    assert [line.split()[0] for line in lines] == [*heads, *LEG.joint_names]
    assert not any("-0.0 " in line for line in lines)
    said = json.loads(json.dumps(PlanReport(WEAK).to_json(), allow_nan=False))
    assert said["status"] == "beyond-limits"
    assert said["leg"]["binding"] == list(WEAK.binding)
    assert said["landing_error"] == WEAK.landing_error
    assert said["time_error"] == said["time"] - 2
    assert said["leg"]["v"] == pytest.approx(WEAK.v.tolist())


def test_a_joint_near_0_has_no_sign():
    still = kd.strike(LEG.posture(np.full(3, -1e-6)), np.full(3, -1e-6), BALL,
                      WEAK.impact.contact, ball_velocity=[-5, 0, 0])  # fmt: skip
    lines = [line.split() for line in PlanReport(replace(WEAK, impact=still)).table()[-3:]]
    assert [line[1:] for line in lines] == 3 * [["0.00", "deg", "0.000", "rad/s"]]


def test_joints_at_rest_away_from_0_have_a_row():
    still = kd.strike(LEG.posture([0.3, 0.2, 0.0]), np.zeros(3), BALL,
                      WEAK.impact.contact, ball_velocity=[-5, 0, 0])  # fmt: skip
    lines = [line.split() for line in PlanReport(replace(WEAK, impact=still)).table()[-2:]]
    assert lines == [["hip", "17.19", "deg", "0.000", "rad/s"],
                     ["knee", "11.46", "deg", "0.000", "rad/s"]]  # fmt: skip


def test_the_restitution_is_named_where_it_depends_on_the_speed():
    goal, lines = kd.Goal(15, time=1), []
    for restitution in (0.7, "peacock-ball"):
        plan = kd.plan_kick(LEG, goal, BALL, AIR, contact=kd.Contact(None, restitution, 0.4))
        lines.append(PlanReport(plan).table()[1])
    assert "restitution" not in lines[0]
    used = f"restitution {plan.impact.restitution:.4g}, from 'peacock-ball' at "
    assert f", {used}{plan.impact.approach_speed:.4g} m/s" in lines[1]


def test_a_torque_that_binds_is_named():
    model = LEG.model
    model.effortLimit = np.array([60.0, 40.0, 20.0])
    weak = kd.Leg.from_model(model, "toe")
    plan = kd.plan_kick(weak, kd.Goal(60, time=2), BALL, AIR, objective="kinetic-energy")
    (limit,) = (limit for limit in plan.binding if limit.startswith("torque of "))
    assert limit in verdict(plan)
    line = next(line for line in PlanReport(plan).table() if line.startswith("leg"))
    assert line.endswith(f"objective kinetic-energy = {plan.value:.4g} J")
    assert f"{plan.torque_use:.0%} of the torque limits" in line
    assert re.search(r"\n  objective kinetic-energy +\d+\.?\d* J\n", repr(plan))


def test_a_motion_has_a_sentence_and_samples_in_json():
    plan = kd.plan_kick(LEG, kd.Goal(15, time=1), BALL, AIR, motion=True)
    first, line, *_ = PlanReport(plan).sentences()
    assert first == verdict(plan)
    assert line == (
        f"The motion takes {-plan.motion.begin:.3g} s from rest to the impact and "
        f"{plan.motion.end:.3g} s from there to rest, with "
        f"{_limit_use(plan.speed_use, plan.torque_use)}."
    )
    motion = json.loads(json.dumps(PlanReport(plan).to_json(), allow_nan=False))["motion"]
    assert motion["joints"] == list(LEG.joint_names)
    assert motion["time"][0] == pytest.approx(plan.motion.begin, abs=0.01)
    assert motion["time"][-1] == pytest.approx(plan.motion.end, abs=0.01)
    for time, q, torque in zip(motion["time"], motion["q"], motion["torque"], strict=True):
        assert q == plan.motion.q(time).tolist()
        assert torque == plan.motion.torque(time).tolist()


def test_what_the_flight_warns_of_is_said_of_the_plan():
    far = kd.plan_kick(LEG, kd.Goal(100, time=3), BALL, AIR, limits=False)
    lines = list(far.path.warnings)
    assert len(lines) == 1  # of drag: a spin that is rounding has no lift to warn of
    assert re.fullmatch(
        r"drag supercritical: \d+ % of the flight is outside its data \(airspeed above 26\.9 m/s\)",
        lines[0],
    )
    assert list(far.warnings) == PlanReport(far).to_json()["warnings"] == lines
    assert PlanReport(far).sentences()[-1:] == [f"Warning: {line}." for line in lines]
    for answer in (far, kd.plan_launch(kd.Goal(100, time=3), BALL, AIR)):
        assert re.findall(r"\n  warning +(.*)", repr(answer)) == lines
    near = kd.plan_kick(LEG, kd.Goal(30, time=1.5), BALL, AIR)
    assert (near.warnings, PlanReport(near).to_json()["warnings"]) == ((), [])
    assert "warning" not in repr(near)
    along = kd.plan_kick(LEG, kd.Goal(15, time=1.5), BALL, AIR, surface="carpet")
    assert along.warnings == ()


def test_a_kick_to_the_right_says_right():
    plans = [kd.plan_kick(LEG, kd.Goal((20, y, 0), time=1), BALL, AIR) for y in (3, 0, -3)]
    angle = f"{np.degrees(plans[0].heading):.2f}"
    for plan, side in zip(plans, ("left", "", "right"), strict=True):
        launch, *_, base = PlanReport(plan).table()[:4]
        azimuth = f"{abs(np.degrees(plan.launch.azimuth)):.3f} deg to the {side or 'left'}"
        assert azimuth in launch
        assert "-" not in launch + base or not side
        assert not side or base == f"base    turned by {angle} deg to the {side}"


CORNER = kd.plan_kick(LEG, kd.Goal((20, 3.4, 2.1), over=(9.15, 2.0)), BALL, AIR)
FLAT = kd.plan_kick(LEG, kd.Goal((20, 3.4, 2.1), time=0.7), BALL, AIR, limits=False)


def test_a_wall_is_cleared_by_what_the_goal_asked_for():
    said = describe_passage(Wall(9.15, 1.9), CORNER)
    assert said == "The lower edge of the ball clears the wall by 0.1 m."


def test_a_wall_that_is_hit():
    with pytest.raises(kd.InvalidInput, match=r"hits the wall, .* from its edge$"):
        describe_passage(read_wall("9.15:1.9"), FLAT)


def test_along_the_ground_no_option_clears_a_wall():
    rolled = kd.plan_kick(LEG, kd.Goal(8, time=2), BALL, AIR, surface="carpet")
    with pytest.raises(kd.InvalidInput, match=r"from its edge$"):
        describe_passage(Wall(4, 1), rolled)


def test_a_kick_too_weak_says_where_it_ends():
    weak = kd.plan_kick(LEG, kd.Goal((40, 0, 2.1), time=1.2), BALL, AIR)
    assert weak.status == "beyond-limits"
    with pytest.raises(
        kd.InvalidInput, match="beyond the limits of the leg, and the ball hits the wall"
    ):
        describe_passage(Wall(9.15, 2.5), weak)
    assert describe_passage(Wall(39.0, 1.9), weak) == "The ball lands before it reaches the wall."


def test_a_narrow_wall_off_a_curved_way_is_passed_beside():
    leg = kd.Leg.from_robot("g1", legs_only=True)
    goal = kd.Goal((20, 0, 1), time=1.0, beside=(9.15, 0.6))
    plan = kd.plan_kick(leg, goal, BALL, AIR, limits=False)
    assert plan.landing_error < 1e-3
    assert (
        describe_passage(Wall(9.15, 5.0, 0.4), plan)
        == f"The ball passes {0.4 - BALL.radius:.3g} m to the left of the wall."
    )


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("9.15", "it must be DISTANCE:HEIGHT"),
        ("a:b", "it must be DISTANCE:HEIGHT"),
        ("1:2:3:4", "it must be DISTANCE:HEIGHT"),
        ("9.15:-1", "height of the wall is -1"),
        ("nan:1", "distance of the wall is nan"),
        ("30:1.9", "between the ball and the target"),
    ],
)
def test_bad_walls(text, words):
    with pytest.raises(kd.InvalidInput, match=words):
        describe_passage(read_wall(text), CORNER)


def missing(target):
    """Return how a kick to a target beside the goal ends, and that it is said."""
    plan = kd.plan_kick(LEG, kd.Goal(target, time=1.0), BALL, AIR, limits=False)
    found = score(plan)
    assert str(found) == {
        "over": "The ball goes over the bar.",
        "beside": "The ball passes beside the post.",
        "bar": "The ball hits the bar.",
        "post": "The ball hits the post.",
    }.get(found.end)
    return found


def test_the_goal():
    post, bar = 3.66 - 3.4 - BALL.radius, 2.44 - 2.1 - 2 * BALL.radius
    assert (
        str(score(CORNER))
        == f"The ball enters the goal, {post:.3g} m from the post and {bar:.3g} m under the bar."
    )
    wide = {"post": 3.77 + BALL.radius, "beside": 3.79 + BALL.radius}  # a post is 0.12 m wide
    high = {"bar": 2.55, "over": 2.57}  # of the ball's lower edge
    for end, left in wide.items():
        assert missing((20, left, 1)).end == missing((20, -left, 1)).end == end
    for end, up in high.items():
        assert missing((20, 0, up)).end == end
    assert missing((20, 3.67 - BALL.radius, 1)).end == "post"
    assert missing((20, 0, 2.45 - 2 * BALL.radius)).end == "bar"
    assert missing((20, wide["beside"], high["bar"])).end == "beside"
    assert missing((20, wide["post"], high["over"])).end == "over"
    weak = kd.plan_kick(LEG, kd.Goal(100, time=3), BALL, AIR)
    assert str(score(weak)) == "The ball does not reach the goal."


def test_joints_without_a_limit_have_no_use_of_it():
    assert (
        _limit_use(speed=0.25, torque=0.5)
        == "up to 25% of the speed limits and 50% of the torque limits"
    )
    assert _limit_use(speed=0.0, torque=0.5) == "up to 50% of the torque limits"
    assert _limit_use(speed=0.0, torque=0.0) == "no use of the limits"


def kicks():
    """Kicks with the contact point on either side of the ball's centre, and of the launch."""
    g1 = kd.Leg.from_robot("g1", legs_only=True)
    for left, spin in ((1.0, (0.0, -25.0, 12.0)), (-1.0, (0.0, 25.0, -12.0))):
        yield kd.plan_kick(g1, kd.Goal((6, left, 0), time=0.9, spin=spin), BALL, AIR)


KICKS = list(kicks())


def contact_point(plan):
    """The contact point above the ball's centre and to the left, as seen along the launch [m]."""
    arm = plan.impact.posture.contact_point - plan.impact.ball_before.position
    along = plan.impact.ball_after.velocity * [1.0, 1.0, 0.0]
    return arm[2], np.cross([0.0, 0.0, 1.0], along / np.linalg.norm(along)) @ arm


def static_use(plan):
    """The largest speed and torque that keeps the speed, over their limits."""
    leg = plan.leg
    torque = pin.rnea(leg.model, leg.model.createData(), plan.q, plan.v, np.zeros(leg.nv))
    moving = plan.v != 0.0
    return [
        np.abs(used / limit)[moving].max()
        for used, limit in ((plan.v, leg.velocity_limit), (torque, leg.effort_limit))
    ]


@pytest.mark.parametrize("plan", KICKS)
def test_every_number_of_the_table_is_that_of_the_plan(plan):
    launch, impact, leg, drives, *rows = PlanReport(plan).table()
    after, (up, left) = plan.impact.ball_after, contact_point(plan)
    assert abs(up) > 0.005
    assert abs(left) > 0.001
    speed, angle, azimuth, side = re.fullmatch(
        r"launch  (\S+) m/s, (\S+) deg above the horizontal, (\S+) deg to the (\w+)", launch
    ).groups()
    across, level = math.atan2(after.velocity[1], after.velocity[0]), after.velocity[:2]
    assert float(speed) == pytest.approx(np.linalg.norm(after.velocity), abs=1e-4)
    rises = math.degrees(math.atan2(after.velocity[2], np.linalg.norm(level)))
    assert float(angle) == pytest.approx(rises, abs=1e-3)
    assert float(azimuth) == pytest.approx(abs(math.degrees(across)), abs=1e-3)
    assert side == ("left" if across > 0 else "right")
    height, over, aside, side, impulse, foot = re.fullmatch(
        r"impact  contact point (\S+) mm (\w+) the ball's centre and (\S+) mm to the (\w+), "
        r"impulse (\S+) N s, foot speed (\S+) m/s",
        impact,
    ).groups()
    assert (over, side) == ("above" if up > 0 else "below", "left" if left > 0 else "right")
    assert float(height) == pytest.approx(1e3 * abs(up), abs=0.06)
    assert float(aside) == pytest.approx(1e3 * abs(left), abs=0.06)
    assert float(impulse) == pytest.approx(BALL.mass * np.linalg.norm(after.velocity), abs=1e-4)
    velocity = plan.impact.posture.jacobian @ plan.v
    assert float(foot) == pytest.approx(np.linalg.norm(velocity), abs=1e-4)
    speed_use, torque_use, largest, joint, value = re.fullmatch(
        r"leg     up to (\d+)% of the speed limits and (\d+)% of the torque limits of the joints; "
        r"largest joint impulse (\S+) N s, at (\w+); objective joint-speed = (\S+) "
        r"\(mean square of the joint speeds over their limits\)",
        leg,
    ).groups()
    used = static_use(plan)
    assert [float(speed_use), float(torque_use)] == pytest.approx(np.multiply(used, 100), abs=0.51)
    assert (joint, float(largest)) == (
        plan.impact.worst_joint[0],
        pytest.approx(plan.impact.worst_joint[1], rel=5e-3),
    )
    moving = plan.v != 0.0
    ratios = plan.v[moving] / plan.leg.velocity_limit[moving]
    assert float(value) == pytest.approx(np.mean(ratios**2), rel=1e-3)
    masses = re.fullmatch(
        r"drives  effective mass (\S+) kg without rotors, (\S+) kg with rotors, infinite with "
        r"stiff joints \(base or foot fixed\); planned with rotors",
        drives,
    ).groups()
    bare = plan.leg.with_armature(dict.fromkeys(plan.leg.single_joints, 0.0)).posture(plan.q)
    normal = plan.impact.contact.normal
    expected = [bare.effective_mass(normal), plan.impact.effective_mass]
    assert [*map(float, masses)] == pytest.approx(expected, rel=5e-3)
    angles = plan.leg.joint_values(plan.q)
    shown = {name: (float(q), float(v)) for name, q, _, v, _ in map(str.split, rows)}
    assert len(shown) == np.count_nonzero(moving)
    for name, (q, v) in shown.items():
        assert q == pytest.approx(math.degrees(angles[name]), abs=0.0051)
        assert v == pytest.approx(plan.v[plan.leg.velocity_index(name)], abs=5.1e-4)


@pytest.mark.parametrize("plan", KICKS)
def test_every_number_of_the_json_is_that_of_the_plan(plan):
    report = PlanReport(plan, Wall(3.0, 0.2), True).to_json()
    impact, leg, (up, left) = plan.impact, plan.leg, contact_point(plan)
    after, velocity = impact.ball_after, impact.ball_after.velocity
    ahead = plan.goal.target / plan.goal.distance
    there = kd.fly(after, BALL, AIR, plane=kd.Plane(after.position + 3.0 * ahead, -ahead, "centre"))
    moved = there.landing.position - after.position
    speed_use, torque_use = static_use(plan)
    expected = {
        "status": plan.status,
        "share": 1.0,
        "time": 0.9,
        "landing_error": plan.landing_error,
        "time_error": plan.path.duration - 0.9,
        "warnings": list(plan.warnings),
        "goal.target_m": plan.goal.target,
        "goal.time": 0.9,
        "launch.speed": np.linalg.norm(velocity),
        "launch.velocity": velocity,
        "launch.spin": after.spin,
        "launch.time": 0.9,
        "launch.iterations": plan.launch.iterations,
        "launch.angle_deg": math.degrees(math.asin(velocity[2] / np.linalg.norm(velocity))),
        "launch.azimuth_deg": math.degrees(math.atan2(velocity[1], velocity[0])),
        "impact.impulse": BALL.mass * velocity,
        "impact.foot_velocity": impact.posture.jacobian @ plan.v,
        "impact.restitution": 0.8,
        "impact.restitution_given": 0.8,
        "impact.normal": (impact.ball_before.position - impact.posture.contact_point) / BALL.radius,
        "impact.up_m": up,
        "impact.left_m": left,
        "leg.name": "g1",
        "leg.heading_deg": 0.0,
        "leg.v": plan.v,
        "leg.objective": "joint-speed",
        "leg.value": np.mean((plan.v / leg.velocity_limit)[plan.v != 0.0] ** 2),
        "leg.binding": list(plan.binding),
        "leg.speed_use": speed_use,
        "leg.torque_use": torque_use,
        "leg.worst_joint": impact.worst_joint[0],
        "leg.worst_joint_impulse": impact.worst_joint[1],
        "wall.above": moved[2] - 0.2,
        "wall.beside": abs(np.cross(ahead, moved)[2]) - 1.25 - BALL.radius,
        "goal_mouth.end": score(plan).end,
    }
    for key, value in expected.items():
        shown = report
        for name in key.split("."):
            shown = shown[name]
        if isinstance(value, str | list):
            assert shown == value, key
        else:
            assert shown == pytest.approx(value, abs=2e-6), key
    angles = leg.joint_values(plan.q)
    assert report["leg"]["q_deg"] == pytest.approx({k: math.degrees(x) for k, x in angles.items()})


@pytest.mark.parametrize(
    ("state", "says"),
    [
        ("stands", " stands, which needs a coefficient of friction of 0.25 or more."),
        ("turns", " turns about the vertical: friction cannot supply the moment that keeps it at "
                  "rest."),
        ("slips", " slips."),
        ("lifts-off", " lifts off."),
    ],
)  # fmt: skip
def test_each_state_of_a_support_has_its_sentence(state, says):
    impulse = np.array([3.0, 4.0, 20.0, 0.0, 0.0, 0.0])
    impact = SimpleNamespace(footing={"sole": state}, support_impulses={"sole": impulse})
    line = _describe_stance("sole", SimpleNamespace(impact=impact, balance=0.0123))
    assert "its centre of mass 12.3 mm inside the edge of the sole" in line
    assert line.endswith(f"In the impact this foot{says}")
