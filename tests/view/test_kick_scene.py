import dataclasses
import math
import re
from types import SimpleNamespace

import numpy as np
import pinocchio as pin
import pytest
import umsgpack

import kickdyn as kd
from kickdyn.planning.meeting import arrival_of
from kickdyn.robot.ground_clearance import find_depths
from kickdyn.view import kick_scene, marks
from kickdyn.view.camera import BOTTOM, LEFT, RIGHT, TOP
from kickdyn.view.document import recording_viewer
from kickdyn.view.kick_scene import (
    draw_kick,
    impulse_arrows,
    joint_impulses_in_world,
    leg_configuration,
)
from kickdyn.view.leg_figure import joint_poses


def film(viewer):
    """Return animation and settings: path to track name to (frames, values)."""
    said = [umsgpack.unpackb(packed) for packed in viewer.window.commands]
    (command,) = (c for c in said if c["type"] == "set_animation")
    tracks = {}
    for animation in command["animations"]:
        for track in animation["clip"]["tracks"]:
            frames = [key["time"] for key in track["keys"]]
            values = np.array([key["value"] for key in track["keys"]])
            tracks[animation["path"], track["name"]] = frames, values
    return tracks, command["options"]


def draw(viewer, kick):
    impact, _, path = kick
    draw_kick(viewer, impact, path)


@pytest.fixture(scope="module")
def scene(kick):
    viewer = recording_viewer()
    return viewer, draw_kick(viewer, kick[0], kick[2])[0]


def test_it_plays_by_itself_for_ever_and_in_step(scene):
    tracks, options = film(scene[0])
    assert options == {"play": True, "repetitions": math.inf}
    assert {frames[0] for frames, _ in tracks.values()} == {0}
    assert {frames[-1] for frames, _ in tracks.values()} == {scene[1].end}


def test_what_moves(scene, kick):
    hit, _, path = kick
    tracks, _ = film(scene[0])
    assert {name for name, _ in tracks} == {
        *(f"/meshcat/leg/{joint}" for joint in (1, 2, 3)),
        *(f"/meshcat/joint_arrows/{joint}" for joint in (1, 2, 3)),
        *(f"/meshcat/{name}" for name in ("ball", "arrow")),
    }
    _, places = tracks["/meshcat/ball", ".position"]
    impact = scene[1].impact
    np.testing.assert_allclose(places[:impact], np.tile(hit.ball_after.position, (impact, 1)))
    np.testing.assert_allclose(places[-1], path.landing.position, atol=1e-12)


def test_the_largest_arrow_is_as_long_as_three_balls_or_half_the_leg(scene, kick):
    said = [umsgpack.unpackb(packed) for packed in scene[0].window.commands]
    drawn = {c["path"]: c["object"] for c in said if c["type"] == "set_object"}
    shaft, head = (drawn[f"/meshcat/arrow/{part}"]["geometries"][0] for part in ("shaft", "head"))
    hip, knee, ankle = (
        pose[:3, 3] for pose in joint_poses(kick[0].posture.leg, kick[0].posture.q)[1:]
    )
    extent = np.ptp([hip, knee, ankle, kick[0].ball_after.position], axis=0)
    size = np.linalg.norm(extent + 2 * kick[1].radius)
    longest = max(3.2 * kick[1].radius, 0.45 * size)
    assert shaft["height"] + head["height"] == pytest.approx(longest)


def test_arrows_appear_at_the_impact(scene):
    tracks, _ = film(scene[0])
    impact = scene[1].impact
    for node in ("arrow", "joint_arrows/1"):
        frames, sizes = tracks[f"/meshcat/{node}", ".scale"]
        assert sizes == pytest.approx([1e-3, 1e-3, 1.0, 1.0])
        assert frames[1:3] == [impact - 1, impact]


def test_arrows_of_joints_stay_at_their_joints(scene):
    tracks, _ = film(scene[0])
    impact = scene[1].impact
    for joint in (2, 3):  # the hip does not move
        frames, starts = tracks[f"/meshcat/joint_arrows/{joint}", ".position"]
        _, joints = tracks[f"/meshcat/leg/{joint}", ".position"]
        np.testing.assert_allclose(starts, joints)
        assert np.linalg.norm(np.subtract(starts[-1], starts[frames.index(impact)])) > 0.01
    assert ("/meshcat/arrow", ".position") not in tracks


def test_a_robot_is_in_the_picture_from_head_to_foot(make_kick, load):
    """The camera is as far as all that stands on the joints asks for."""
    model = kd.Leg.human().file.text
    head = '<visual><origin xyz="0 0 1.0"/><geometry><sphere radius="0.1"/></geometry></visual>'
    assert '<link name="base">' in model
    headed = load(model.replace('<link name="base">', f'<link name="base">{head}'))
    shown = []
    for leg in (kd.Leg.human(), headed):
        viewer = recording_viewer()
        draw(viewer, make_kick(leg, 3.0))
        said = [umsgpack.unpackb(packed) for packed in viewer.window.commands]
        shown.append(next(c["value"] for c in said if c.get("property") == "position"
                          and c["path"].startswith("/Cameras")))  # fmt: skip
    assert np.linalg.norm(shown[1]) > 1.2 * np.linalg.norm(shown[0])


def test_a_whole_motion_is_beside_the_caption():
    leg, ball = kd.Leg.human(), kd.Ball()
    plan = kd.plan_kick(leg, kd.Goal(15, time=1), ball, kd.Air(), motion=True)
    motion, viewer = plan.motion, recording_viewer()
    draw_kick(viewer, plan.impact, plan.path, motion=motion)
    said = [umsgpack.unpackb(packed) for packed in viewer.window.commands]
    (shift,) = (c["matrix"] for c in said if c.get("path") == "/meshcat" and "matrix" in c)
    target = -np.reshape(shift, (4, 4)).T[:3, 3]
    (x, y, z) = next(c["value"] for c in said if c.get("property") == "position"
                     and "Cameras" in c["path"])  # fmt: skip
    eye = np.add(target, (x, -z, y))
    into = (target - eye) / np.linalg.norm(target - eye)
    right = np.cross(into, (0, 0, 1)) / np.linalg.norm(np.cross(into, (0, 0, 1)))
    for time in np.linspace(motion.begin, motion.end, 30):
        away = leg.posture(motion.q(time)).contact_point - eye
        across, up = (away @ axis / (away @ into) for axis in (right, np.cross(right, into)))
        assert -LEFT < across < RIGHT
        assert -BOTTOM < up < TOP


def test_the_ball_rests_on_the_ground(scene, kick):
    said = [umsgpack.unpackb(packed) for packed in scene[0].window.commands]
    (ground,) = (c["matrix"] for c in said
                 if c["path"] == "/meshcat/ground" and c["type"] == "set_transform")  # fmt: skip
    assert ground[14] == pytest.approx(kick[0].ball_after.position[2] - kick[1].radius)


def test_the_lawn_ends_beyond_the_landing(kick, monkeypatch):
    lawns = []
    monkeypatch.setattr(marks, "draw_ground", lambda *drawn: lawns.append(drawn))
    viewer = recording_viewer()
    draw(viewer, kick)
    ((_, foot, _, _, reach),) = lawns
    away = np.linalg.norm(kick[2].landing.position - foot)
    assert reach > away + 7.0  # eight times the leg and ball, which are about 1 m tall


def test_a_flight_to_lower_ground_ends_on_it(make_kick):
    hit, ball, _ = make_kick(kd.Leg.human(), 5.0)
    viewer = recording_viewer()
    draw_kick(viewer, hit, kd.fly(hit.ball_after, ball, ground=kd.Ground(-3.0)))
    said = [umsgpack.unpackb(packed) for packed in viewer.window.commands]
    (ground,) = (c["matrix"] for c in said
                 if c["path"] == "/meshcat/ground" and c["type"] == "set_transform")  # fmt: skip
    assert ground[14] == pytest.approx(-3.0)


@pytest.mark.parametrize(
    ("speed", "degrees", "attack"),
    [(5.0, (40, 20, 0), -40), (4.0, (40, 20, 0), 90), (1e-6, (5, 10, -5), 30),
     (1e6, (5, 10, -5), 30)],
)  # fmt: skip
def test_odd_kicks_are_drawn(make_kick, speed, degrees, attack):
    viewer = recording_viewer()
    draw(viewer, make_kick(kd.Leg.human(), speed, degrees, attack, friction=0.0))
    for frames, values in film(viewer)[0].values():
        assert np.isfinite(values).all()
        assert (np.diff(frames) > 0).all()


def test_the_axes_stand_beside_leg_ball_and_flight(kick):
    """In the picture, no joint, and no point of the flight, is in the box around their arrows."""
    impact, _, path = kick
    viewer = recording_viewer()
    draw_kick(viewer, impact, path)
    (label,) = (text for text in viewer.window.labels if ">x (" in text)
    length = float(re.search(r"x \(([\d.]+) m\)", label)[1])
    said = [umsgpack.unpackb(packed) for packed in viewer.window.commands]
    moved = {c["path"]: np.array(c["matrix"][12:15]) for c in said if c["type"] == "set_transform"}
    (x, y, z) = next(c["value"] for c in said if c.get("property") == "position"
                     and "Cameras" in c["path"])  # fmt: skip
    eye = np.array([x, -z, y]) - moved["/meshcat"]
    into = -np.array([x, -z, y]) / np.linalg.norm((x, y, z))
    right = np.cross(into, (0, 0, 1)) / np.linalg.norm(np.cross(into, (0, 0, 1)))

    def slopes(points):
        away = points - eye
        return np.stack([away @ right, away @ np.cross(right, into)], 1) / (away @ into)[:, None]

    origin = moved["/meshcat/axes"]
    assert origin[2] == pytest.approx(moved["/meshcat/ground"][2])
    ends = slopes(origin + length * np.vstack([np.zeros(3), np.eye(3)]))
    low, high = ends.min(axis=0), ends.max(axis=0)
    joints = [pose[:3, 3] for pose in joint_poses(impact.posture.leg, impact.posture.q)[1:]]
    curve = path.sample(np.linspace(0, path.duration, 50)).position
    points = slopes(np.vstack([joints, impact.posture.contact_point, curve]))
    assert not ((low < points) & (points < high)).all(axis=1).any()
    assert (low > (-LEFT, -BOTTOM)).all()
    assert (high < (RIGHT, TOP)).all()


def height_of_the_ground(viewer):
    said = [umsgpack.unpackb(packed) for packed in viewer.window.commands]
    (ground,) = (c["matrix"] for c in said
                 if c["path"] == "/meshcat/ground" and c["type"] == "set_transform")  # fmt: skip
    return ground[14]


def test_a_ball_that_need_not_lie_on_the_ground_is_on_a_tee_above_the_lowest_point_of_the_leg(
    make_kick,
):
    hit, ball, path = make_kick(kd.Leg.human(), 5.0, degrees=(40, 30, -20))
    viewer = recording_viewer()
    pace, text = draw_kick(viewer, hit, path, lies=False)
    floor, bottom = height_of_the_ground(viewer), hit.ball_before.position[2] - ball.radius
    moved = [leg_configuration(hit, time) for time in pace.times]
    leg = hit.posture.leg
    assert not any(find_depths(leg, q, floor) for q in moved)
    assert any(find_depths(leg, q, floor + 5e-3) for q in moved)
    assert text == f"The ball is on a tee, {bottom - floor:.2g} m above the ground."
    said = [umsgpack.unpackb(packed) for packed in viewer.window.commands]
    (stand,) = (c["object"]["geometries"][0] for c in said
                if c["path"] == "/meshcat/tee" and c["type"] == "set_object")  # fmt: skip
    assert stand["height"] == pytest.approx(bottom - floor)
    (place,) = (c["matrix"] for c in said
                if c["path"] == "/meshcat/tee" and c["type"] == "set_transform")  # fmt: skip
    below = hit.ball_before.position[:2]
    assert place[12:15] == pytest.approx([*below, (bottom + floor) / 2])


def test_a_robot_stands_on_the_ground_also_where_the_ball_is_lower():
    leg = kd.Leg.from_model(
        pin.buildModelFromXML(kd.Leg.human().file.text, pin.JointModelFreeFlyer()), "toe"
    )
    leg = leg.with_model(_with_a_trunk(leg.model)).with_supports("base")
    posture = leg.posture(leg.configuration({"knee": 0.3}))
    hit = kd.strike(posture, posture.joint_velocity([4, 0, 3]), kd.Ball(),
                    kd.Contact([4, 0, 3], 0.8))  # fmt: skip
    viewer = recording_viewer()
    _, text = draw_kick(viewer, hit, kd.fly(hit.ball_after, kd.Ball()), lies=False)
    assert height_of_the_ground(viewer) == pytest.approx(0.0)  # of the frame that is held
    depth = kd.Ball().radius - hit.ball_before.position[2]
    assert text == f"The ball is {depth:.2g} m in the ground on which the robot stands."


def _with_a_trunk(model):
    model = model.copy()
    model.inertias[1] = pin.Inertia(10.0, np.zeros(3), 0.2 * np.eye(3))
    return model


def test_the_foot_loses_what_the_ball_gets(make_kick):
    """Momentum of the foot alone, which is turned: what the ankle gives, less the ball's."""
    hit = make_kick(kd.Leg.human(), 8.0, degrees=(20, 30, 40))[0]
    pushes = {name: (start, push) for name, start, push in joint_impulses_in_world(hit)}
    assert list(pushes) == ["hip", "knee", "ankle"]
    start, push = pushes["ankle"]
    model = hit.posture.leg.model
    data = model.createData()
    speeds = []
    for v in (hit.v_before, hit.v_after):
        pin.forwardKinematics(model, data, hit.posture.q, v)
        centre = data.oMi[3].act(model.inertias[3].lever)
        moves = pin.getVelocity(model, data, 3, pin.ReferenceFrame.WORLD)
        speeds.append(moves.linear + np.cross(moves.angular, centre))
    gained = model.inertias[3].mass * (speeds[1] - speeds[0])
    np.testing.assert_allclose(push - hit.impulse, gained, atol=1e-12)
    np.testing.assert_allclose(start, data.oMi[3].translation)


def test_arrows_are_to_one_scale_with_a_label_at_their_tip(kick):
    hit, viewer = kick[0], recording_viewer()
    draw(viewer, kick)
    arrows = impulse_arrows(hit, 0.0)
    sizes = np.linalg.norm(hit.joint_impulses[:, :3], axis=1)
    order = np.argsort(-sizes)
    assert [arrow.node for arrow in arrows] == [
        "arrow",
        *(f"joint_arrows/{1 + joint}" for joint in order),
    ]
    commands = [umsgpack.unpackb(packed) for packed in viewer.window.commands]
    objects = {c["path"]: c["object"] for c in commands if c["type"] == "set_object"}
    (tip,) = (c["matrix"][12:15] for c in commands
              if c["type"] == "set_transform" and c["path"] == "/meshcat/arrow/label")  # fmt: skip
    scale = np.linalg.norm(tip) / np.linalg.norm(hit.impulse)
    for arrow in arrows:
        path = f"/meshcat/{arrow.node}/"
        parts = [objects[path + name]["geometries"][0]["height"] for name in ("shaft", "head")]
        assert sum(parts) == pytest.approx(scale * np.linalg.norm(arrow.impulse))
        (tip,) = (c["matrix"][12:15] for c in commands
                  if c["type"] == "set_transform" and c["path"] == path + "label")  # fmt: skip
        np.testing.assert_allclose(tip, scale * arrow.impulse)
    labels = [label for label in viewer.window.labels if " N s<" in label]
    for arrow, label in zip(arrows, labels, strict=True):
        assert f'data-node="/meshcat/{arrow.node}/label"' in label
        assert label.endswith(f">{np.linalg.norm(arrow.impulse):.3g} N s</div>")


def test_small_ones_get_no_arrow(kick):
    sizes = sorted(np.linalg.norm(kick[0].joint_impulses[:, :3], axis=1))
    assert len(impulse_arrows(kick[0], (sizes[0] + sizes[1]) / 2)) == 3


def test_no_impulse_no_arrow():
    hit = kd.strike(
        kd.Leg.human().posture(np.zeros(3)), [1, 0, 0], kd.Ball(), kd.Contact((1, 0, 0), 0.0)
    )
    idle = dataclasses.replace(hit, solution=hit.solution._replace(impulses=np.zeros((1, 3))))
    assert impulse_arrows(idle, 0.0) == []


def hit_with(before, after):
    return SimpleNamespace(v_before=np.array(before), v_after=np.array(after))


@pytest.mark.parametrize("duration", [0.0, 1e-6, 0.1, 2.5, 1000.0])
@pytest.mark.parametrize("speed", [0.0, 1e-3, 1.0, 40.0])
def test_the_whole_flight_is_shown_in_about_four_seconds(duration, speed):
    pace = kick_scene.kick_pace(hit_with([speed, -speed / 2], [0.0, speed / 3]), duration)
    assert len(pace.times) / kick_scene.RATE == pytest.approx(4.0, abs=0.1)
    assert 4 < pace.end / kick_scene.RATE < 6
    assert (np.diff(pace.times) > 0).all()
    assert pace.times[pace.impact] == pytest.approx(0, abs=1e-12)
    assert pace.times[-1] >= duration * (1 - 1e-9)
    if duration:
        assert pace.times[-1] == pytest.approx(duration)


def test_a_hard_strike_is_shown_slower_than_its_flight():
    pace = kick_scene.kick_pace(hit_with([30.0], [20.0]), 2.5)
    steps = np.diff(pace.times)
    assert steps[-1] > 10 * steps[0]
    assert -pace.times[0] * 30 == pytest.approx(kick_scene.SWING_LENGTH)


def test_a_slow_kick_has_one_pace():
    pace = kick_scene.kick_pace(hit_with([1.0], [0.5]), 0.1)
    steps = np.diff(pace.times)
    np.testing.assert_allclose(steps, steps[0])


@pytest.fixture
def struck(make_kick):
    return make_kick(kd.Leg.human(), 5.0, degrees=(20, 40, 0))


def test_the_leg_passes_the_impact_with_its_velocities(struck):
    hit, step = struck[0], 1e-7
    np.testing.assert_array_equal(kick_scene.leg_configuration(hit, 0.0), hit.posture.q)
    before = (hit.posture.q - kick_scene.leg_configuration(hit, -step)) / step
    after = (kick_scene.leg_configuration(hit, step) - hit.posture.q) / step
    np.testing.assert_allclose(before, hit.v_before, rtol=1e-5, atol=1e-6)
    np.testing.assert_allclose(after, hit.v_after, rtol=1e-5, atol=1e-6)


def test_the_leg_stays_in_its_limits_and_comes_to_rest(struck):
    hit = struck[0]
    leg = hit.posture.leg
    far = [kick_scene.leg_configuration(hit, time) for time in (-10.0, 0.1, 10.0, 20.0)]
    for q in far:
        assert (leg.lower <= q).all()
        assert (q <= leg.upper).all()
    np.testing.assert_allclose(far[2], far[3])
    assert np.abs(far[3] - hit.posture.q).max() <= kick_scene.SWING_LENGTH * (1 + 1e-9)


def test_a_posture_outside_the_limits_does_not_jump(make_kick):
    hit = make_kick(kd.Leg.human(), 1.0, degrees=(-30, -20, 0))[0]
    np.testing.assert_array_equal(kick_scene.leg_configuration(hit, 0.0), hit.posture.q)


def test_joints_that_are_no_single_number_stay_on_their_manifold():
    model = pin.buildModelFromXML(kd.Leg.human().file.text, pin.JointModelFreeFlyer())
    model.inertias[1] = pin.Inertia(10.0, np.zeros(3), 0.2 * np.eye(3))
    leg = kd.Leg.from_model(model, "toe")
    posture = leg.posture(leg.configuration({"knee": 0.5}))
    v = posture.joint_velocity([4, 1, 3])
    hit = kd.strike(posture, v, kd.Ball(), kd.Contact([4, 1, 3], 0.8, 0.4))
    for time in (-0.3, 0.3):
        assert pin.isNormalized(model, kick_scene.leg_configuration(hit, time), 1e-12)


def test_the_ball_rests_then_flies_and_spins(struck):
    hit, _ball, path = struck
    before = hit.ball_before
    assert not before.velocity.any()
    assert not before.spin.any()
    early = kick_scene.ball_pose(before, path, -0.1)
    np.testing.assert_array_equal(early[:3, :3], np.eye(3))
    np.testing.assert_array_equal(early[:3, 3], hit.ball_after.position)
    late = kick_scene.ball_pose(before, path, 0.1)
    np.testing.assert_allclose(late[:3, 3], path.sample(0.1).position)
    # It turns about the spin by the right-hand rule: the axis stays, and the angle is |spin| t.
    spin = hit.ball_after.spin
    np.testing.assert_allclose(late[:3, :3] @ spin, spin)
    angle = math.acos((np.trace(late[:3, :3]) - 1) / 2)
    assert angle == pytest.approx(np.linalg.norm(spin) * 0.1)
    step = kick_scene.ball_pose(before, path, 1e-6)[:3, :3] @ (1, 0, 0) - (1, 0, 0)
    np.testing.assert_allclose(step / 1e-6, np.cross(spin, (1, 0, 0)), rtol=1e-3, atol=1e-3)


def test_the_ball_stays_where_it_landed(struck):
    hit, _ball, path = struck
    end = kick_scene.ball_pose(hit.ball_before, path, path.duration + 1)
    np.testing.assert_allclose(end[:3, 3], path.landing.position)


def test_a_ball_that_came_is_shown_coming():
    leg, ball = kd.Leg.human(), kd.Ball()
    posture = leg.posture(np.radians([5, 10, -5]))
    velocity, spin = [-5.0, 1.0, 0.0], [0.0, 30.0, 4.0]
    hit = kd.strike(posture, np.zeros(3), ball, kd.Contact([1, 0, 0.3], 0.8, 0.4),
                       ball_velocity=velocity, ball_spin=spin)  # fmt: skip
    before = hit.ball_before
    np.testing.assert_allclose(before.velocity, velocity, atol=1e-8)
    np.testing.assert_allclose(before.spin, spin, atol=1e-8)
    early = kick_scene.ball_pose(before, kd.fly(hit.ball_after, ball), -0.1)[:3, 3]
    np.testing.assert_allclose(early, hit.ball_after.position - 0.1 * np.array(velocity))
    turned = kick_scene.ball_pose(before, kd.fly(hit.ball_after, ball), -1e-6)[:3, :3]
    np.testing.assert_allclose((np.eye(3) - turned) @ (1, 0, 0) / 1e-6, np.cross(spin, (1, 0, 0)),
                               rtol=1e-3, atol=1e-3)  # fmt: skip


def test_a_ball_whose_spin_decays_is_shown_turning_less(struck):
    hit, ball, _ = struck
    thick = kd.Air(torque=lambda reynolds, spin_parameter: 1.0)  # a hundred times the default
    launch = kd.BallState(hit.ball_after.position, hit.ball_after.velocity, (0, -3, 0))
    path = kd.fly(launch, ball, thick)
    end = kick_scene.ball_pose(hit.ball_before, path, path.duration + 1)[:3, :3]
    np.testing.assert_allclose(end, path.orientation(path.duration).as_matrix())
    turned = path.orientation(path.duration).magnitude()
    assert 0 < turned < 0.9 * 3 * path.duration < math.pi


def test_a_ball_on_the_ground_turns_as_it_rolls():
    ball = kd.Ball()
    start = kd.BallState((0, 0, ball.radius), (2.0, 0, 0), (0, 2.0 / ball.radius, 0))
    course = kd.follow(start, ball, None, kd.Ground(surface="turf"))
    way = course.sample(0.5).position[0]
    place = kick_scene.ball_pose(start, course, 0.5)
    angle = math.remainder(way / ball.radius, 2 * math.pi)
    assert place[:3, :3] == pytest.approx(pin.rpy.rpyToMatrix(0, angle, 0), abs=1e-3)
    assert place[0, 3] == pytest.approx(way)


def test_a_support_stays_where_it_is():
    robot = kd.Leg.from_robot("g1", base="floating", legs_only=True)
    leg, foot = robot.with_supports("left_ankle_roll_link"), "left_ankle_roll_link"
    posture = leg.posture(leg.configuration({"right_hip_pitch_joint": -0.3}))
    v = posture.joint_velocity([4, 0, 1])
    hit = kd.strike(posture, v, kd.Ball(), kd.Contact((4, 0, 1), 0.8))
    data, places = leg.model.createData(), []
    for time in (0.0, -0.1, -0.02, 0.05, 3.0):
        pin.framesForwardKinematics(leg.model, data, kick_scene.leg_configuration(hit, time))
        places.append(data.oMf[leg.model.getFrameId(foot)].copy())
    assert all(place.isApprox(places[0], 1e-12) for place in places)


@pytest.mark.parametrize("backswing", [None, 0.3])
def test_the_clock_of_the_page_shows_the_times_of_the_pictures(backswing):
    pace = kick_scene.kick_pace(hit_with([30.0], [20.0]), 2.5, backswing)
    shown = np.interp(np.arange(len(pace.times)) / kick_scene.RATE, *pace.knots.T)
    np.testing.assert_allclose(shown, pace.times, atol=1e-12)


def test_a_ball_that_comes_is_shown_on_its_path_to_the_foot():
    ball, air = kd.Ball(), kd.Air()
    comes = kd.BallState((2.0, 0.0, -0.5), (-3.0, 0.0, 0.5), (0.0, 4.0, 0.0))
    ground = kd.Ground(-0.82, "turf")
    plan = kd.plan_trap(kd.Leg.human(), kd.IncomingBall(comes, ground), ball, air)
    arrival = arrival_of(plan.meeting, ball)
    course = kd.follow(comes, ball, air, ground)
    for before in (0.05, 0.3):
        pose = kick_scene.ball_pose(plan.impact.ball_before, plan.path, -before, arrival)
        there = course.sample(plan.meeting.time - before).position
        assert pose[:3, 3] == pytest.approx(there, abs=1e-6)
    drawn = str(kd.page(plan).html)
    assert f"met after {plan.meeting.time:.3g} s" in drawn
