"""Held legs: derivatives against differences, q and v brought back to what holds the leg."""

import numpy as np
import pinocchio as pin
import pytest
from chains import any_kick
from nudges import RESULTS, by_differences, margin

import kickdyn as kd
from kickdyn.impact.sensitivity import UNITS
from kickdyn.robot.urdf_file import shipped_urdf

LEFT, HANDS = "left_ankle_roll_link", ("left_wrist_yaw_link", "right_wrist_yaw_link")
G1 = kd.Leg.from_robot("g1", base="floating")
BOLT = kd.Leg.from_robot("bolt", base="floating")
FOURBAR = kd.Leg.from_urdf(shipped_urdf("leg_fourbar.urdf"))
LEGS = {
    "flat foot": G1.with_supports(LEFT),
    "point foot": BOLT.with_supports(kd.Support("FL_FOOT", point=True)),
    "foot, and hands joined": G1.with_loops(HANDS).with_supports(LEFT),
    "redundant supports": G1.with_supports(LEFT, kd.Support("left_ankle_pitch_link", point=True)),
    "loop in a plane": FOURBAR.with_loops(("shank_pin", "rocker_b_tip")),
}


def some_kick(name, friction, seed=3):
    leg, rng = LEGS[name], np.random.default_rng(seed)
    (posture, v, ball, contact), options = any_kick(rng, leg, friction=friction)
    if name == "loop in a plane":  # across the plane, nothing moves
        q = leg.close_loops(leg.configuration({"hip": 0.2, "rocker_b": 0.4}), keep=("rocker_b",))
        posture = leg.posture(q)
        v = posture.admissible(np.array([3.0, 2.0, 1.0, -2.0, 4.0]))
        way = posture.point_velocity(v)
        contact = kd.Contact(way + 0.3 * way[[2, 1, 0]], 0.6, friction)
        options["ball_velocity"] = np.zeros(3)
    return (posture, v, ball, contact), options, rng


@pytest.mark.parametrize("name", LEGS)
@pytest.mark.parametrize(
    ("friction", "branch"), [(0.0, "frictionless"), (0.05, "slip"), (9.0, "stick")]
)
def test_against_differences(name, friction, branch):
    kick, options, rng = some_kick(name, friction)
    hit = kd.strike(*kick, **options)
    slopes = hit.sensitivity()
    assert slopes.branch == branch
    assert margin(hit) > 0.01 or not friction
    masses = np.array([link.mass for link in list(kick[0].leg.model.inertias)[1:]])
    for source in UNITS:
        size = slopes.impulse[source].shape[1]
        way = rng.normal(size=size) / np.sqrt(size)
        if source == "link_mass":  # each in proportion, for some are tiny
            way = rng.uniform(-1, 1, size=size) * masses
        if source == "friction" and not friction:
            continue
        expected, hits = by_differences(kick, options, source, way)
        assert {near.sticking for near in hits} == {hit.sticking}
        for result, slope in expected.items():
            ours = getattr(slopes, result)[source] @ way
            scale = max(np.abs(slope).max(), np.abs(RESULTS[result](hit)).max())
            assert np.abs(ours - slope).max() <= 1e-6 * scale, (source, result)


def test_what_holds_the_leg_matters():
    """The same kick afloat has other derivatives, by much more than differences can err."""
    kick, options, _ = some_kick("flat foot", 0.0)
    afloat = kd.strike(G1.posture(kick[0].q), *kick[1:], **options).sensitivity().impulse["q"]
    held = kd.strike(*kick, **options).sensitivity().impulse["q"]
    assert np.abs(afloat - held).max() > 1e-2 * np.abs(held).max()


def test_what_a_support_or_loop_takes_up_does_not_count():
    """v across what holds, and q that would open a loop."""
    kick, options, _ = some_kick("foot, and hands joined", 0.05)
    hit = kd.strike(*kick, **options)
    slopes, hold = hit.sensitivity(), hit.posture.constraint_projector
    rows = hold.rows
    across = np.linalg.solve(hit.posture.inertia, rows.T)
    loop = rows[6:]
    for result in RESULTS:
        by_v, by_q = (getattr(slopes, result)[source] for source in ("v", "q"))
        assert np.abs(by_v @ across).max() <= 1e-10 * np.abs(by_v).max() * np.abs(across).max()
        assert np.abs(by_q @ loop.T).max() <= 1e-10 * np.abs(by_q).max()
    kept = rows @ slopes.v_after["v"]
    assert np.abs(kept).max() <= 1e-11


def test_the_budget_of_a_standing_robot():
    """One source is its Jacobian, as for a leg that nothing holds."""
    kick, options, _ = some_kick("flat foot", 0.05)
    hit = kd.strike(*kick, **options)
    slopes, ours = hit.sensitivity(), hit.uncertainty(q=0.01, link_mass=0.1)
    for result in ("impulse", "velocity", "spin"):
        by_q, by_mass = (getattr(slopes, result)[source] for source in ("q", "link_mass"))
        expected = 1e-4 * by_q @ by_q.T + 1e-2 * by_mass @ by_mass.T
        assert getattr(ours, result) == pytest.approx(expected, rel=1e-12)
    assert ours.branch == "slip"


def composite():
    joint = pin.JointModelComposite()
    for part in (pin.JointModelRX(), pin.JointModelRY()):
        joint.addJoint(part)
    return joint


TURNING = {
    "universal": pin.JointModelUniversal(np.array([1.0, 0, 0]), np.array([0, 1.0, 0])),
    "euler": pin.JointModelSphericalZYX(),
    "composite": composite(),
}


def jointed(hip):
    """A thigh on some joint, and a shank on a hinge."""
    model, down = pin.Model(), pin.SE3(np.eye(3), np.array([0, 0, -0.4]))
    model.name = "rig"
    body = pin.Inertia(1.0, np.array([0, 0, -0.2]), np.diag([0.02, 0.02, 0.01]))
    first = model.addJoint(0, hip, pin.SE3.Identity(), "hip")
    knee = model.addJoint(first, pin.JointModelRY(), down, "knee")
    for joint in (first, knee):
        model.appendBodyToJoint(joint, body, pin.SE3.Identity())
    model.addFrame(pin.Frame("toe", knee, 0, down, pin.FrameType.OP_FRAME))
    return kd.Leg.from_model(model, "toe")


def jointed_hit(hip):
    leg = jointed(hip)
    posture = leg.posture(leg.configuration({"knee": 0.4}))
    v = np.arange(1.0, 1.0 + leg.nv)
    return kd.strike(posture, v, kd.Ball(), kd.Contact(posture.point_velocity(v), 0.7))


@pytest.mark.parametrize("hip", TURNING.values(), ids=TURNING)
def test_joints_whose_axes_turn_are_refused(hip):
    hit = jointed_hit(hip)
    for ask in (hit.sensitivity, lambda: hit.uncertainty(q=0.1)):
        with pytest.raises(kd.InvalidInput, match=r"^axes of hip depend on the joint's own angles"):
            ask()


STEADY = (pin.JointModelSpherical(), pin.JointModelRUBY(), pin.JointModelHX(0.1))


@pytest.mark.parametrize("hip", STEADY, ids=lambda joint: joint.shortname())
def test_joints_whose_axes_stay_are_not(hip):
    assert np.isfinite(jointed_hit(hip).sensitivity().impulse["q"]).all()
