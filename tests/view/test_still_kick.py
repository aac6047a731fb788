"""A kick at its instant, and the moves that make another kick of it."""

import math

import numpy as np
import pinocchio as pin
import pytest
import umsgpack

import kickdyn as kd
from kickdyn.view import still_kick
from kickdyn.view.leg_figure import joint_poses
from kickdyn.view.still_kick import StillKick, impulse_ellipsoid

LEG = kd.Leg.human()


def kick(knee=20.0, friction=0.4, speed=10.0, leg=LEG):
    posture = leg.posture(np.radians([10, knee, -5]))
    v = posture.joint_velocity(speed * np.array([math.cos(0.4), 0, math.sin(0.4)]))
    return kd.strike(posture, v, kd.Ball(), kd.Contact((2, 0, 1), 0.8, friction))


def unpacked(commands):
    return [umsgpack.unpackb(packed) for packed in commands]


def transforms(commands):
    return {
        c["path"]: np.reshape(c["matrix"], (4, 4)).T
        for c in unpacked(commands)
        if c["type"] == "set_transform"
    }


def test_the_moves_place_all_that_another_kick_moves():
    still, other = StillKick(kick()), kick(knee=50.0, speed=6.0)
    moves = still.moves(other, caption="slower")
    places = transforms(moves.commands)
    for joint, pose in enumerate(joint_poses(LEG, other.posture.q)):
        np.testing.assert_allclose(places[f"/meshcat/leg/{joint}"], pose, atol=1e-6)
    ball = places["/meshcat/ball"][:3, 3]
    np.testing.assert_allclose(ball, other.ball_before.position, atol=1e-6)
    assert places["/meshcat/ground"][2, 3] <= ball[2] - other.ball.radius + 1e-6
    arrow = places["/meshcat/arrow"][:3, 3]
    np.testing.assert_allclose(arrow, other.posture.contact_point, atol=1e-6)
    path = kd.fly(other.ball_after, other.ball, kd.Air())
    end = places["/meshcat/end"][:3, 3]
    np.testing.assert_allclose(end, path.landing.position, atol=1e-5)
    assert f">{path.range:.3g} m<" in moves.labels
    assert f">{np.linalg.norm(other.impulse):.3g} N s<" in moves.labels
    assert "slower" in moves.panel


def test_lengths_of_arrows_keep_their_scale():
    first = kick()
    still = StillKick(first)
    tips = [
        transforms(commands)["/meshcat/arrow/label"][:3, 3]
        for commands in (still.page.viewer.window.commands, still.moves(kick(speed=5.0)).commands)
    ]
    np.testing.assert_allclose(tips[1], 0.5 * tips[0], rtol=1e-6)


def test_an_arrow_that_is_too_small_is_taken_away(monkeypatch):
    still = StillKick(kick())
    monkeypatch.setattr(still_kick, "LEAST_JOINT_IMPULSE", 0.3)  # of the largest impulse
    moves = still.moves(kick())
    gone = {c["path"] for c in unpacked(moves.commands) if c["type"] == "delete"}
    assert gone == {"/meshcat/joint_arrows/1", "/meshcat/joint_arrows/2"}
    assert "joint_arrows/3/label" in moves.labels
    assert "joint_arrows/1/label" not in moves.labels
    again = [c["type"] for c in unpacked(still.moves(kick()).commands)]
    assert "delete" not in again


def test_impulses_on_the_ellipsoid_take_the_same_energy():
    leg = kd.Leg.human(height=1.8, mass=75, model="3d")
    posture = leg.posture(np.linspace(0.1, 0.6, leg.model.nq))
    radii, axes = impulse_ellipsoid(posture)
    rng = np.random.default_rng(3)
    for direction in rng.normal(size=(20, 3)):
        p = axes @ (radii * direction / np.linalg.norm(direction))
        jump = np.linalg.solve(mass_matrix(posture), posture.jacobian.T @ p)
        assert 0.5 * jump @ mass_matrix(posture) @ jump == pytest.approx(0.5, rel=1e-9)


def mass_matrix(posture):
    model = posture.leg.workspace.model
    data = model.createData()
    m = pin.crba(model, data, posture.q)
    return np.triu(m) + np.triu(m, 1).T


def test_a_planar_leg_has_a_flat_ellipsoid():
    radii, axes = impulse_ellipsoid(kick().posture)
    (flat,) = np.flatnonzero(radii == 0)
    np.testing.assert_allclose(np.abs(axes[:, flat]), (0, 1, 0), atol=1e-9)
