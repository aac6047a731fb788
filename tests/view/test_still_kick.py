"""A kick at its instant, and the moves that make another kick of it."""

import math

import numpy as np
import pinocchio as pin
import pytest
from drawn_scene import SINGLE, DrawnScene, check_joints, in_the_picture
from tolerances import agrees, closed_form

import kickdyn as kd
from kickdyn.robot.ground_clearance import find_depths
from kickdyn.view.still_kick import StillKick, impulse_ellipsoid

LEG = kd.Leg.human()


def kick(knee=20.0, speed=10.0, normal=(2, 0, 1)):
    posture = LEG.posture(np.radians([10, knee, -5]))
    v = posture.joint_velocity(speed * np.array([math.cos(0.4), 0, math.sin(0.4)]))
    return kd.strike(posture, v, kd.Ball(), kd.Contact(normal, 0.8, 0.4))


def test_the_moves_place_all_that_another_kick_moves():
    other = kick(knee=50.0, speed=6.0, normal=(1, 0, 2))  # the ball is above the sole
    moves = StillKick(kick()).moves(other, caption="slower")
    scene = DrawnScene(moves.commands)
    check_joints(scene, "leg", LEG, other.posture.q)
    agrees(scene.point("ball"), other.ball_before.position, SINGLE)
    floor, bottom = scene.point("ground")[2], other.ball_before.position[2] - other.ball.radius
    assert floor < bottom - 1e-3
    assert not find_depths(LEG, other.posture.q, floor - 1e-6)
    assert find_depths(LEG, other.posture.q, floor + 5e-3)
    path = kd.fly(other.ball_after, other.ball, kd.Air())
    agrees(scene.point("end"), path.landing.position, SINGLE)
    agrees(scene.curve("curve")[-1], path.landing.position, 10 * SINGLE)
    assert f">{path.range:.3g} m<" in moves.labels
    assert f">{np.linalg.norm(other.impulse):.3g} N s<" in moves.labels
    assert "slower" in moves.panel


def test_the_camera_sees_flights_of_half_as_much_again():
    first, other = kick(), kick(speed=11.5)
    ranges = [kd.fly(hit.ball_after, hit.ball, kd.Air()).range for hit in (first, other)]
    assert 1.4 < ranges[1] / ranges[0] < 1.55
    still = StillKick(first)
    shown, moved = DrawnScene(still.page), DrawnScene(still.moves(other).commands)
    in_the_picture(shown.slopes(moved.curve("curve")))


def test_arrows_and_ellipsoid_keep_their_scale():
    """The ellipsoid is as long in a direction as the root of the effective mass."""
    impact, other, scales = kick(), kick(knee=60.0, speed=5.0), []
    still = StillKick(impact)
    for hit, source in ((impact, still.page), (other, still.moves(other).commands)):
        scene = DrawnScene(source)
        start, vector = scene.arrow("arrow")
        agrees(start, hit.posture.contact_point, SINGLE)
        scale = np.linalg.norm(vector) / np.linalg.norm(hit.impulse)
        agrees(vector, scale * hit.impulse, SINGLE)
        ellipsoid, direction = scene.pose("ellipsoid"), np.array([0.6, 0.0, 0.8])
        agrees(ellipsoid[:3, 3], hit.posture.contact_point, SINGLE)
        radius = 1.0 / np.linalg.norm(np.linalg.solve(ellipsoid[:3, :3], direction))
        scales.append((scale, radius / np.sqrt(hit.posture.effective_mass(direction))))
    assert scales[0] == pytest.approx(scales[1], rel=SINGLE)


def test_impulses_on_the_ellipsoid_take_the_same_energy():
    """A planar leg has a flat one."""
    leg = kd.Leg.human(height=1.8, mass=75, model="3d")
    posture = leg.posture(np.linspace(0.1, 0.6, leg.model.nq))
    radii, axes = impulse_ellipsoid(posture)
    mass = pin.crba(leg.model, leg.model.createData(), posture.q)
    mass = np.triu(mass) + np.triu(mass, 1).T
    for direction in np.random.default_rng(3).normal(size=(20, 3)):
        impulse = axes @ (radii * direction / np.linalg.norm(direction))
        jump = np.linalg.solve(mass, posture.jacobian.T @ impulse)
        assert 0.5 * jump @ mass @ jump == pytest.approx(0.5, rel=closed_form(1e3))
    radii, axes = impulse_ellipsoid(kick().posture)
    (flat,) = np.flatnonzero(radii == 0)
    np.testing.assert_allclose(np.abs(axes[:, flat]), (0, 1, 0), atol=closed_form(1e4))
