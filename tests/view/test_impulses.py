import dataclasses
from types import SimpleNamespace

import numpy as np
import pinocchio as pin
import pytest
import umsgpack

import kickdyn as kd
from kickdyn.view.document import recording_viewer
from kickdyn.view.impulses import (
    draw_impulse,
    impulse_arrows,
    joint_impulses_in_world,
    largest_impulse,
)


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
