import numpy as np
import pinocchio as pin
import pytest
import umsgpack

import kickdyn as kd
from kickdyn.view.camera import Camera
from kickdyn.view.impulses import (
    arrow_tips,
    draw_impulse,
    impulse_arrows,
    joint_pushes,
    largest,
)
from kickdyn.view.label_places import LabelPlaces
from kickdyn.view.recorder import recorder

ASIDE = Camera(np.array([0.0, -5.0, -0.5]), np.array([0.0, 0.0, -0.5]))


def test_the_foot_loses_what_the_ball_gets(kick):
    """Momentum of the foot alone: what the ankle gives, less what the ball gets."""
    hit = kick[0]
    pushes = {name: (start, push) for name, start, push in joint_pushes(hit)}
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
    assert largest(hit) == pytest.approx(np.linalg.norm(hit.impulse))


def test_arrows_are_to_one_scale_and_say_their_impulse(kick):
    hit = kick[0]
    viewer = recorder()
    arrows = impulse_arrows(hit, 0.2, 0.0, LabelPlaces(ASIDE))
    assert [arrow.node for arrow in arrows] == [
        "arrow",
        *(f"joint_arrows/{1 + joint}" for joint in
          np.argsort([-np.linalg.norm(push) for _, _, push in joint_pushes(hit)])),
    ]  # fmt: skip
    for arrow in arrows:
        draw_impulse(viewer[arrow.node], arrow, 0.2)
    said = [umsgpack.unpackb(packed) for packed in viewer.window.commands()]
    for arrow in arrows:
        size = np.linalg.norm(arrow.impulse)
        path = f"/meshcat/{arrow.node}/"
        parts = [c["object"]["geometries"][0]["height"] for c in said if c["type"] == "set_object"
                 and c["path"] in (path + "shaft", path + "head")]  # fmt: skip
        assert sum(parts) == pytest.approx(0.2 * size)
        assert arrow.label.text == f"{size:.3g} N s"
        (tip,) = (c["matrix"][12:15] for c in said
                  if c["type"] == "set_transform" and c["path"] == path + "label")  # fmt: skip
        np.testing.assert_allclose(tip, 0.2 * arrow.impulse)


@pytest.mark.parametrize("away", [1, 100])
def test_every_arrow_is_labelled_the_largest_joint_nearest(kick, away):
    """From far away all tips are one point: the ball's label is there, the others beside it."""
    camera = Camera(away * ASIDE.position, ASIDE.target)
    labels = [arrow.label for arrow in impulse_arrows(kick[0], 0.2, 0.0, LabelPlaces(camera))]
    assert all(labels)
    rows = [abs(label.row) for label in labels]
    assert rows[0] == 0.0
    if away == 100:
        assert rows == sorted(rows)
        assert len({(label.row, label.left) for label in labels}) == 4


def test_tips_are_where_arrows_end(kick):
    arrows = impulse_arrows(kick[0], 0.2, 0.0, LabelPlaces(ASIDE))
    np.testing.assert_allclose(
        arrow_tips(kick[0], 0.2, 0.0), [arrow.start + 0.2 * arrow.impulse for arrow in arrows]
    )


def test_small_ones_get_no_arrow(kick):
    pushes = sorted(np.linalg.norm(push) for _, _, push in joint_pushes(kick[0]))
    drawn = impulse_arrows(kick[0], 0.2, (pushes[0] + pushes[1]) / 2, LabelPlaces(ASIDE))
    assert len(drawn) == 3


def test_no_impulse_no_arrow():
    hit = kd.strike(
        kd.Leg.human().posture(np.zeros(3)), [1, 0, 0], kd.Ball(), kd.Contact((1, 0, 0), 0.0)
    )
    idle = kd.Impact.known(**{**vars(hit), "impulse": np.zeros(3),
                              "joint_impulses": np.zeros((3, 6))})  # fmt: skip
    assert impulse_arrows(idle, 1.0, 0.0, LabelPlaces(ASIDE)) == []
    assert largest(idle) == 0.0
