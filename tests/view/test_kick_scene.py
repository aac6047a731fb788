"""A kick, drawn and moving: everything is where Pinocchio and the flight have it at the time."""

import dataclasses
import math
import re
from types import SimpleNamespace

import numpy as np
import pinocchio as pin
import planned_motions
import pytest
import trimesh
from drawn_scene import SINGLE, DrawnScene, check_joints, in_the_picture
from scipy.spatial.transform import Rotation
from tolerances import agrees, closed_form

import kickdyn as kd
from kickdyn.planning.meeting import arrival_of
from kickdyn.robot.ground_clearance import find_depths
from kickdyn.view import kick_scene
from kickdyn.view.document import recording_viewer
from kickdyn.view.kick_scene import ball_poses
from kickdyn.view.wall_and_goal import wall_boxes


def drawn_kick(impact, path, **options):
    """Return the scene of a kick, its pace, and the sentence about the ground."""
    viewer = recording_viewer()
    pace, text = kick_scene.draw_kick(viewer, impact, path, **options)
    return DrawnScene(viewer), pace, text


@pytest.fixture(scope="module")
def drawn(kick):
    return drawn_kick(kick[0], kick[2])


def test_leg_and_ball_are_where_they_are_at_each_time(kick, drawn):
    """The joints move with v before the impact, and come to rest exponentially after it."""
    (impact, _, path), (scene, pace, _) = kick, drawn
    leg, last = impact.posture.leg, len(pace.times) - 1
    stop = kick_scene.SWING_LENGTH / np.abs(impact.v_after).max()
    for frame in (0, pace.impact // 2, pace.impact, pace.impact + 5, last // 2, last, pace.end):
        time = pace.times[min(frame, last)]
        change = time * impact.v_before
        if time > 0:
            change = stop * (1 - math.exp(-time / stop)) * impact.v_after
        q = np.clip(impact.posture.q + change, leg.lower, leg.upper)
        check_joints(scene, "leg", leg, q, frame)
        right, flown = np.eye(4), min(max(time, 0.0), path.duration)
        right[:3, :3] = path.orientation(flown).as_matrix()
        right[:3, 3] = path.sample(flown).position if time > 0 else impact.ball_before.position
        agrees(scene.pose("ball", frame), right, SINGLE)
    assert scene.options == {"play": True, "repetitions": math.inf}
    ends = {max(keys) for tracks in scene.tracks.values() for keys in tracks.values()}
    assert ends == {pace.end}  # so that they repeat together


@pytest.mark.parametrize(("speed", "attack", "drop", "box"), [
    (6.0, 20.0, 2.0, ""), (6.0, 160.0, 2.0, ""), (6.0, 20.0, 2.0, "wall"), (0.5, 85.0, 0.0, ""),
    (3.0, 20.0, 0.0, "leg")])  # fmt: skip
def test_all_that_is_drawn_is_in_the_picture(make_kick, leg_looking_like, speed, attack, drop, box):
    """Axes stand at the right of the flight, behind the ball; distances lead to its end."""
    large = "<visual><geometry><box size='3 1 1'/></geometry></visual>"
    leg = leg_looking_like(large) if box == "leg" else kd.Leg.human()
    hit, ball, _ = make_kick(leg, speed, (-30, 100, 0)[: leg.nq], attack)
    start, ahead = hit.ball_before.position, np.sign(90 - attack) * np.array([1.0, 0.0, 0.0])
    foot = start - (0.0, 0.0, ball.radius + drop)
    path = kd.fly(hit.ball_after, ball, ground=kd.Ground(foot[2]))
    boxes = wall_boxes(foot, ahead, 2.0, 4.0, 6.0) if box == "wall" else []
    scene, *_ = drawn_kick(hit, path, scenery=boxes)
    points = [foot]
    for node in scene.objects:
        shape = scene.shape(node)
        if shape["type"] == "BoxGeometry":
            size = [shape[name] for name in ("width", "height", "depth")]
            points += list(trimesh.creation.box(size, scene.pose(node)).vertices)
        elif "data" in shape and not node.startswith("ground"):
            points += list(scene.vertices(node))
        elif node.endswith("shaft"):
            begin, vector = scene.arrow(node.removesuffix("/shaft"))
            points += [begin, begin + vector]
    in_the_picture(scene.slopes(points))
    origin = scene.point("axes") - foot
    assert (origin @ ahead < 0, origin @ np.cross(ahead, (0, 0, 1)) > 0) == (True, True)
    assert origin[2] == pytest.approx(0.0, abs=closed_form(10))
    agrees(scene.point("ground"), foot, closed_form(10))
    shown = re.findall(r'data-node="/meshcat/(distances/\d+)">([\d.]+) m<', scene.labels)
    distances = np.array([float(text) for _, text in shown])
    for (node, _), distance in zip(shown, distances, strict=True):
        agrees(scene.point(node), foot + distance * ahead, closed_form(10))
    step = np.diff(np.unique(distances)).min()
    assert abs(distances.max() - np.hypot(*(path.landing.position - foot)[:2])) < step
    edges = np.unique(((scene.vertices("ground") - foot) @ ahead).round(4))
    assert np.diff(edges).min() == pytest.approx(step)


def test_a_planned_motion_is_shown_with_its_configurations():
    plan = planned_motions.swinging()
    scene, pace, _ = drawn_kick(plan.impact, plan.path, motion=plan.motion)
    leg, passed = plan.impact.posture.leg, []
    assert pace.times[0] == pytest.approx(plan.motion.begin)
    for frame in (0, pace.impact // 3, pace.impact, pace.impact + 20, len(pace.times) - 1):
        q = plan.motion.q(pace.times[frame])
        check_joints(scene, "leg", leg, q, frame)
        passed.append(leg.posture(q).contact_point)
    in_the_picture(scene.slopes(passed))


def test_a_slow_kick_has_the_arrows_of_a_fast_one(make_kick):
    """A joint has one if its impulse is a twentieth of the largest."""
    slow, fast = (make_kick(kd.Leg.human(), speed, friction=0.0) for speed in (1e-2, 10.0))
    nodes = [set(drawn_kick(hit, path)[0].tracks) for hit, _, path in (slow, fast)]
    sizes = np.linalg.norm(fast[0].joint_impulses[:, :3], axis=1)
    most = max(sizes.max(), np.linalg.norm(fast[0].impulse))
    right = {f"joint_arrows/{k + 1}" for k in range(3) if sizes[k] > 0.05 * most}
    for drawn_nodes in nodes:
        assert {node for node in drawn_nodes if node.startswith("joint_arrows")} == right


def test_arrows_have_the_direction_and_length_of_their_impulses(kick, drawn):
    """To one scale, with the size at the tip; they appear at the impact, and move with joints."""
    impact, (scene, pace, _) = kick[0], drawn
    data = impact.posture.leg.model.createData()
    pin.forwardKinematics(impact.posture.leg.model, data, impact.posture.q)
    scale = np.linalg.norm(scene.arrow("arrow")[1]) / np.linalg.norm(impact.impulse)
    arrows = {"arrow": (impact.posture.contact_point, impact.impulse)}
    for joint in (1, 2, 3):
        push = data.oMi[joint].rotation @ impact.joint_impulses[joint - 1, :3]
        arrows[f"joint_arrows/{joint}"] = data.oMi[joint].translation, push
    for node, (origin, impulse) in arrows.items():
        start, vector = scene.arrow(node)
        agrees(start, origin, SINGLE)
        agrees(vector, scale * impulse, SINGLE)
        agrees(scene.point(f"{node}/label"), origin + scale * impulse, SINGLE)
        size = f"{np.linalg.norm(impulse):.3g} N s<"
        assert re.search(rf'data-node="/meshcat/{node}/label"[^\n]*>{size}', scene.labels)
        sizes = {frame: size[0] for frame, size in scene.tracks[node][".scale"].items()}
        assert sizes[0] == sizes[pace.impact - 1] < 0.01
        assert sizes[pace.impact] == sizes[pace.end] == 1.0
    for frame in (0, pace.impact, pace.end):
        agrees(scene.point("joint_arrows/3", frame), scene.point("leg/3", frame), SINGLE)
    sizes = np.sort(np.linalg.norm(impact.joint_impulses[:, :3], axis=1))
    arrows = kick_scene.impulse_arrows(impact, (sizes[0] + sizes[1]) / 2)
    assert [arrow.size for arrow in arrows[1:]] == pytest.approx(sizes[:0:-1])
    for share, names in ((0.0, []), (1e-6, ["ball"])):  # of an impulse, however small
        scaled = impact.solution._replace(impulses=share * impact.solution.impulses)
        arrows = kick_scene.impulse_arrows(dataclasses.replace(impact, solution=scaled), 1.0)
        assert [arrow.name for arrow in arrows] == names


@pytest.mark.parametrize("duration", [0.0, 0.1, 2.5, 1000.0])
@pytest.mark.parametrize("speed", [0.0, 1.0, 40.0])
@pytest.mark.parametrize("backswing", [None, 0.3])
def test_the_whole_kick_is_shown_in_some_seconds(duration, speed, backswing):
    """With the impact at time 0; the clock of the page is linear between its knots."""
    impact = SimpleNamespace(v_before=np.array([speed, -speed / 2]), v_after=np.full(2, speed / 3))
    pace = kick_scene.kick_pace(impact, duration, backswing)
    assert 3.9 < len(pace.times) / kick_scene.RATE < pace.end / kick_scene.RATE < 7.0
    assert (np.diff(pace.times) > 0).all()
    assert pace.times[pace.impact] == pytest.approx(0, abs=closed_form(10))
    if backswing is not None:
        assert pace.times[0] == pytest.approx(-backswing)
        assert pace.times[-1] >= duration * (1 - closed_form())
    elif duration or speed:
        swing = kick_scene.SWING_LENGTH / speed if speed else math.inf
        assert pace.times[-1] == pytest.approx(duration or 2.8 / 1.2 * swing)
        # a hard strike is shown slower than its flight, a slow one in one pace
        assert -pace.times[0] == pytest.approx(min(swing, 1.2 / 2.8 * (duration or math.inf)))
    shown = np.interp(np.arange(len(pace.times)) / kick_scene.RATE, *pace.knots.T)
    assert shown == pytest.approx(pace.times, abs=closed_form(100) * pace.times[-1])


def test_a_support_stays_where_it_is():
    robot, foot = kd.Leg.from_robot("g1", base="floating", legs_only=True), "left_ankle_roll_link"
    leg = robot.with_supports(foot)
    posture = leg.posture(leg.configuration({"right_hip_pitch_joint": -0.6}))
    v = posture.joint_velocity([4, 0, 1])
    hit = kd.strike(posture, v, kd.Ball(), kd.Contact((4, 0, 1), 0.8))
    data, places = leg.model.createData(), []
    for time in (0.0, -0.1, 0.05, 3.0):
        q = kick_scene.leg_configuration(hit, time)
        assert pin.isNormalized(leg.model, q, closed_form(1e4))
        pin.framesForwardKinematics(leg.model, data, q)
        places.append(data.oMf[leg.model.getFrameId(foot)].homogeneous)
    np.testing.assert_allclose(places, [places[0]] * 4, atol=closed_form(1e3))
    scene, _, text = drawn_kick(hit, kd.fly(hit.ball_after, kd.Ball()), lies=False)
    start = f"leg/{leg.model.frames[leg.model.getFrameId(foot)].parentJoint}/"
    soles = [scene.vertices(node) for node in scene.objects
             if node.startswith(start) and "data" in scene.shape(node)]  # fmt: skip
    floor, bottom = np.vstack(soles)[:, 2].min(), hit.ball_before.position[2] - hit.ball.radius
    assert scene.point("ground")[2] == pytest.approx(floor, abs=5e-3)  # drawn meshes are finer
    assert f"{bottom - scene.point('ground')[2]:.2g} m above" in text


def test_a_ball_that_comes_or_rolls_is_shown_doing_so():
    """Straight on without a path, and turning by its spin; on the ground as it rolls."""
    ball, posture = kd.Ball(), kd.Leg.human().posture(np.radians([5, 10, -5]))
    velocity, spin = np.array([-5.0, 1.0, 0.0]), np.array([0.0, 30.0, 4.0])
    hit = kd.strike(posture, np.zeros(3), ball, kd.Contact([1, 0, 0.3], 0.8, 0.4),
                    ball_velocity=velocity, ball_spin=spin)  # fmt: skip
    (pose,) = ball_poses(hit.ball_before, kd.fly(hit.ball_after, ball), np.array([-0.1]))
    agrees(pose[:3, 3], hit.ball_before.position - 0.1 * velocity, closed_form(100))
    agrees(pose[:3, :3], Rotation.from_rotvec(-0.1 * spin).as_matrix(), closed_form(100))
    start = kd.BallState((0, 0, ball.radius), (2.0, 0, 0), (0, 2.0 / ball.radius, 0))
    course = kd.follow(start, ball, None, kd.Ground(surface="turf"))
    x, (pose,) = course.sample(0.5).position[0], ball_poses(start, course, np.array([0.5]))
    agrees(pose[:3, :3], Rotation.from_rotvec((0, x / ball.radius, 0)).as_matrix(), 1e-3)
    assert pose[0, 3] == pytest.approx(x)


def test_a_ball_that_is_trapped_is_on_its_path_to_the_foot():
    ball, air, ground = kd.Ball(), kd.Air(), kd.Ground(-0.82, "turf")
    comes = kd.BallState((2.0, 0.0, -0.5), (-3.0, 0.0, 0.5), (0.0, 4.0, 0.0))
    plan = kd.plan_trap(kd.Leg.human(), kd.IncomingBall(comes, ground), ball, air)
    arrival, course = arrival_of(plan.meeting, ball), kd.follow(comes, ball, air, ground)
    for before in (0.05, 0.3):
        (pose,) = ball_poses(plan.impact.ball_before, plan.path, np.array([-before]), arrival)
        agrees(pose[:3, 3], course.sample(plan.meeting.time - before).position, SINGLE)
    scene, *_ = drawn_kick(plan.impact, plan.path, arrival=arrival)
    assert f"met after {plan.meeting.time:.3g} s" in scene.labels
    agrees(scene.curve("arrival")[0], comes.position, 10 * SINGLE)


def test_a_ball_that_need_not_lie_on_the_ground_is_on_a_tee_above_the_lowest_point(make_kick):
    hit, ball, path = make_kick(kd.Leg.human(), 5.0, degrees=(40, 30, -20))
    scene, pace, text = drawn_kick(hit, path, lies=False)
    floor, bottom = scene.point("ground")[2], hit.ball_before.position[2] - ball.radius
    moved = [kick_scene.leg_configuration(hit, time) for time in pace.times[::4]]
    assert not any(find_depths(hit.posture.leg, q, floor - 1e-6) for q in moved)
    assert any(find_depths(hit.posture.leg, q, floor + 5e-3) for q in moved)
    assert f"tee, {bottom - floor:.2g} m above" in text
    assert scene.shape("tee")["height"] == pytest.approx(bottom - floor)
    right = *hit.ball_before.position[:2], (bottom + floor) / 2
    assert scene.point("tee") == pytest.approx(right)
    hit, ball, path = make_kick(kd.Leg.human(), 0.1, degrees=(0, 90, 0))  # the ball is lowest
    scene, _, text = drawn_kick(hit, path, lies=False)
    assert scene.point("ground")[2] == pytest.approx(hit.ball_before.position[2] - ball.radius)
    assert text == ""
