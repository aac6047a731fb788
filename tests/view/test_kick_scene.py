import dataclasses
import math
import re
from types import SimpleNamespace

import numpy as np
import pinocchio as pin
import pytest
import umsgpack

import kickdyn as kd
from kickdyn.planning.backswing import Backswing
from kickdyn.robot.ground_clearance import find_depths
from kickdyn.view import kick_scene
from kickdyn.view.camera import BOTTOM, LEFT, RIGHT, TOP
from kickdyn.view.document import recording_viewer
from kickdyn.view.kick_scene import (
    describe_buried,
    draw_impulse,
    draw_kick,
    impulse_arrows,
    joint_impulses_in_world,
    largest_impulse,
    stripe_width,
)
from kickdyn.view.leg_figure import joint_poses
from kickdyn.view.playback import kick_pace, leg_configuration


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
    return viewer, draw_kick(viewer, kick[0], kick[2]).pace


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


def test_a_whole_swing_is_beside_the_caption():
    leg, ball = kd.Leg.human(), kd.Ball()
    plan = kd.plan_kick(leg, kd.Goal(15, time=1), ball, kd.Air(), swing=True)
    swing, viewer = kd.plan_swing(leg, plan), recording_viewer()
    draw_kick(viewer, plan.impact, plan.path, swing=swing)
    said = [umsgpack.unpackb(packed) for packed in viewer.window.commands]
    (shift,) = (c["matrix"] for c in said if c.get("path") == "/meshcat" and "matrix" in c)
    target = -np.reshape(shift, (4, 4)).T[:3, 3]
    (x, y, z) = next(c["value"] for c in said if c.get("property") == "position"
                     and "Cameras" in c["path"])  # fmt: skip
    eye = np.add(target, (x, -z, y))
    into = (target - eye) / np.linalg.norm(target - eye)
    right = np.cross(into, (0, 0, 1)) / np.linalg.norm(np.cross(into, (0, 0, 1)))
    for time in np.linspace(-swing.backswing.duration, swing.follow_through.duration, 30):
        away = leg.posture(swing.configuration(time)).contact_point - eye
        across, up = (away @ axis / (away @ into) for axis in (right, np.cross(right, into)))
        assert -LEFT < across < RIGHT
        assert -BOTTOM < up < TOP


def test_a_backswing_is_followed_by_joints_that_come_to_rest(kick, monkeypatch):
    hit, moved = kick[0], np.array([0.1, 0.2, 0.3])
    monkeypatch.setattr(Backswing, "configuration", lambda _, time: moved * time)
    backswing = Backswing(None, None)
    for time in (-0.4, -0.1, 0.0):
        assert np.array_equal(kick_scene._configuration(hit, backswing, time), moved * time)
    after = leg_configuration(hit, 0.1)
    assert np.array_equal(kick_scene._configuration(hit, backswing, 0.1), after)


def test_the_ball_rests_on_the_ground(scene, kick):
    said = [umsgpack.unpackb(packed) for packed in scene[0].window.commands]
    (ground,) = (c["matrix"] for c in said
                 if c["path"] == "/meshcat/ground" and c["type"] == "set_transform")  # fmt: skip
    assert ground[14] == pytest.approx(kick[0].ball_after.position[2] - kick[1].radius)


def test_the_lawn_ends_beyond_the_landing(kick, monkeypatch):
    lawns = []
    monkeypatch.setattr(kick_scene, "draw_ground", lambda *drawn: lawns.append(drawn))
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


def test_the_axes_stand_beside_leg_ball_and_flight(kick, monkeypatch):
    """In the picture, no point of leg, ball, flight or line is in the box around their arrows."""
    impact, _, path = kick
    found = {}
    place = kick_scene._free_place

    def spy(camera, figure, lines, foot, size):
        found.update(camera=camera, points=np.vstack([figure, lines]), size=size, foot=foot)
        found["place"] = place(camera, figure, lines, foot, size)
        return found["place"]

    monkeypatch.setattr(kick_scene, "_free_place", spy)
    draw_kick(recording_viewer(), impact, path)
    camera, origin = found["camera"], found["place"]
    assert origin[2] == found["foot"][2]
    ends = camera.slopes(origin + found["size"] * np.vstack([np.zeros(3), np.eye(3)]))
    low, high = ends.min(axis=0), ends.max(axis=0)
    points = camera.slopes(found["points"])
    assert not ((low < points) & (points < high)).all(axis=1).any()
    assert (low > (-LEFT, -BOTTOM)).all()
    assert (high < (RIGHT, TOP)).all()
    behind = np.vstack([origin, camera.target + 10 * (camera.target - camera.position)])
    np.testing.assert_allclose(camera.slopes(behind)[1], 0.0, atol=1e-12)  # straight ahead


@pytest.mark.parametrize(
    ("extent", "width"), [(6, 1), (11.9, 1), (12, 2), (30, 5), (59, 5), (0.6, 0.1)]
)
def test_stripes_are_round_numbers(extent, width):
    assert stripe_width(extent) == pytest.approx(width)


def test_bodies_under_the_lawn_are_announced(make_kick):
    hit, ball, path = make_kick(kd.Leg.human(), 5.0, degrees=(20, 40, 0))
    pace = kick_pace(hit, path.duration)
    moved = [leg_configuration(hit, time) for time in pace.times]
    floor = hit.ball_before.position[2] - ball.radius
    assert describe_buried(hit.posture.leg, moved, pace, floor - 5.0) == ""
    said = describe_buried(hit.posture.leg, moved, pace, floor)
    assert said == draw_kick(recording_viewer(), hit, path).text
    assert re.fullmatch(r"Under the ground in this picture: .* m, \d+ ms (before|after) .*\.", said)


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
    drawn = draw_kick(viewer, hit, path, lies=False)
    floor, bottom = height_of_the_ground(viewer), hit.ball_before.position[2] - ball.radius
    moved = [leg_configuration(hit, time) for time in drawn.pace.times]
    assert find_depths(hit.posture.leg, moved, floor) == []
    assert find_depths(hit.posture.leg, moved, floor + 5e-3) != []
    assert drawn.text == f"The ball is on a tee, {bottom - floor:.2g} m above the ground."
    said = [umsgpack.unpackb(packed) for packed in viewer.window.commands]
    (stand,) = (c["object"]["geometries"][0] for c in said
                if c["path"] == "/meshcat/tee" and c["type"] == "set_object")  # fmt: skip
    assert stand["height"] == pytest.approx(bottom - floor)


def test_a_robot_stands_on_the_ground_also_where_the_ball_is_lower():
    leg = kd.Leg.from_model(
        pin.buildModelFromXML(kd.Leg.human().file.text, pin.JointModelFreeFlyer()), "toe"
    )
    leg = leg.with_model(_with_a_trunk(leg.model)).with_supports("base")
    posture = leg.posture(leg.configuration({"knee": 0.3}))
    hit = kd.strike(posture, posture.joint_velocity([4, 0, 3]), kd.Ball(),
                    kd.Contact([4, 0, 3], 0.8))  # fmt: skip
    viewer = recording_viewer()
    drawn = draw_kick(viewer, hit, kd.fly(hit.ball_after, kd.Ball()), lies=False)
    assert height_of_the_ground(viewer) == pytest.approx(0.0)  # of the frame that is held
    depth = kd.Ball().radius - hit.ball_before.position[2]
    assert drawn.text.endswith(
        f" The ball is {depth:.2g} m in the ground on which the robot stands."
    )


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


@pytest.mark.parametrize(("joint", "largest"), [(0.5, 1.0), (3.0, 3.0)])
def test_the_largest_impulse_is_the_ball_s_or_a_joint_s(joint, largest):
    impulses = np.zeros((3, 6))
    impulses[1] = (0, 0, -joint, 9, 9, 9)
    impact = SimpleNamespace(
        posture=kd.Leg.human().posture(np.zeros(3)),
        impulse=np.array([0.6, 0.0, 0.8]),
        joint_impulses=impulses,
    )
    assert largest_impulse(impact) == pytest.approx(largest)


def test_arrows_are_to_one_scale_with_a_label_at_their_tip(kick):
    hit, viewer = kick[0], recording_viewer()
    arrows = impulse_arrows(hit, 0.0)
    sizes = np.linalg.norm(hit.joint_impulses[:, :3], axis=1)
    order = np.argsort(-sizes)
    assert [arrow.node for arrow in arrows] == [
        "arrow",
        *(f"joint_arrows/{1 + joint}" for joint in order),
    ]
    for arrow in arrows:
        draw_impulse(viewer[arrow.node], arrow, 0.2)
    commands = [umsgpack.unpackb(packed) for packed in viewer.window.commands]
    for arrow in arrows:
        path = f"/meshcat/{arrow.node}/"
        objects = {c["path"]: c["object"] for c in commands if c["type"] == "set_object"}
        parts = [objects[path + name]["geometries"][0]["height"] for name in ("shaft", "head")]
        assert sum(parts) == pytest.approx(0.2 * np.linalg.norm(arrow.impulse))
        (tip,) = (c["matrix"][12:15] for c in commands
                  if c["type"] == "set_transform" and c["path"] == path + "label")  # fmt: skip
        np.testing.assert_allclose(tip, 0.2 * arrow.impulse)
    assert len(viewer.window.labels) == len(arrows)
    for arrow, label in zip(arrows, viewer.window.labels, strict=True):
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
    assert largest_impulse(idle) == 0.0
