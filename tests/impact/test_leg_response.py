"""Joint impulses against free bodies tied by constraints, solved as one linear system."""

import numpy as np
import pinocchio as pin
import pytest
from chains import constraint_speed, random_kick, random_leg

import kickdyn as kd
from kickdyn.impact import leg_response as leg_response_module
from kickdyn.robot.urdf_file import shipped_urdf


def skew(a):
    return np.array([[0, -a[2], a[1]], [a[2], 0, -a[0]], [-a[1], a[0], 0]])


def maximal_coordinates(hit):
    """Velocities after and joint impulses (world axes, at the joint) of free rigid bodies.

    Unknown: six velocities per body at its centre of mass, five multipliers per joint and two per
    loop.
    """
    leg, q = hit.posture.leg, hit.posture.q
    model = leg.model
    data = model.createData()
    pin.forwardKinematics(model, data, q, hit.v_before)
    pin.computeJointJacobians(model, data, q)
    n = model.njoints - 1
    columns = data.J.reshape(6, n)  # Pinocchio drops a dimension where there is one joint
    mass, momentum, rows, centres = np.zeros((6 * n, 6 * n)), np.zeros(6 * n), [], []
    for i in range(1, n + 1):
        placement, inertia = data.oMi[i], model.inertias[i]
        centre = placement.act(inertia.lever)
        turned = placement.rotation @ inertia.inertia @ placement.rotation.T
        block = slice(6 * (i - 1), 6 * i)
        mass[block, block] = np.block(
            [[inertia.mass * np.eye(3), np.zeros((3, 3))], [np.zeros((3, 3)), turned]]
        )
        twist = placement.act(data.v[i])
        velocity = twist.linear + np.cross(twist.angular, centre)
        momentum[block] = mass[block, block] @ np.concatenate([velocity, twist.angular])
        centres.append(centre)

    def motion_of(body, point):
        """Rows that give a body's velocity at a point, linear then angular; 0 is the world."""
        matrix = np.zeros((6, 6 * n))
        if body:
            at = 6 * (body - 1)
            matrix[:3, at : at + 3] = matrix[3:, at + 3 : at + 6] = np.eye(3)
            matrix[:3, at + 3 : at + 6] = -skew(point - centres[body - 1])
        return matrix

    directions = []
    for i in range(1, n + 1):
        point = data.oMi[i].translation
        column = data.oMi[i].actInv(pin.Motion(columns[:, i - 1]))
        free = np.concatenate(
            [data.oMi[i].rotation @ column.linear, data.oMi[i].rotation @ column.angular]
        )
        tied = np.linalg.svd(free.reshape(1, 6))[2][1:]  # five directions, across the free one
        relative = motion_of(i, point) - motion_of(model.parents[i], point)
        rows.append(tied @ relative)
        directions.append(tied)
    frames = {frame.name: frame for frame in model.frames}
    for names in leg.constraints.loops if leg.constraints else ():
        one, two = (frames[name] for name in names)
        point = data.oMi[one.parentJoint].act(one.placement.translation)
        relative = motion_of(two.parentJoint, point) - motion_of(one.parentJoint, point)
        rows.append(relative[[0, 2]])  # in a planar leg, y has no say
    tie = np.vstack(rows)
    foot = motion_of(leg.contact_joint, hit.posture.contact_point)[:3]
    system = np.block([[mass, -tie.T], [tie, np.zeros((len(tie), len(tie)))]])
    right = np.concatenate([momentum - foot.T @ hit.impulse, np.zeros(len(tie))])
    answer = np.linalg.solve(system, right)
    multipliers = answer[6 * n : 11 * n].reshape(n, 5)
    wrenches = [tied.T @ m for tied, m in zip(directions, multipliers, strict=True)]
    return (
        foot @ answer[: 6 * n],
        np.array(wrenches),
        [data.oMi[i].rotation for i in range(1, n + 1)],
    )


def check(kick, options):
    hit = kd.strike(*kick, **options)
    foot_after, wrenches, rotations = maximal_coordinates(hit)
    assert hit.posture.jacobian @ hit.v_after == pytest.approx(foot_after, rel=1e-10, abs=1e-10)
    ours = np.array(
        [
            np.concatenate([turn @ f[:3], turn @ f[3:]])
            for turn, f in zip(rotations, hit.joint_impulses, strict=True)
        ]
    )
    assert np.abs(ours - wrenches).max() <= 1e-10 * np.linalg.norm(hit.impulse)


@pytest.mark.parametrize("leg", [kd.Leg.human(), kd.Leg.testbed()], ids=lambda leg: leg.name)
@pytest.mark.parametrize("seed", range(20))
def test_our_legs(leg, seed):
    check(*random_kick(np.random.default_rng(seed), leg, friction=0.4))


@pytest.mark.parametrize("seed", range(60))
def test_random_chains(seed):
    rng = np.random.default_rng(seed)
    check(*random_kick(rng, random_leg(rng), friction=0.4))


@pytest.mark.parametrize("seed", range(20))
def test_closed_loop(seed):
    tree = kd.Leg.from_urdf(shipped_urdf("leg_fourbar.urdf"))
    leg = tree.with_loops(("shank_pin", "rocker_b_tip"))
    rng = np.random.default_rng(seed)
    angles = {"hip": rng.uniform(0, 2), "rocker_b": rng.uniform(0, 1.3)}
    q = leg.close_loops(leg.configuration(angles), keep=angles)
    posture = leg.posture(q)
    v = posture.admissible(rng.normal(size=leg.nv) * 5)
    normal = posture.point_velocity(v) + rng.uniform(-0.2, 0.2, size=3)
    kick = (posture, v, kd.Ball(), kd.Contact(normal, 0.8, friction=0.4))
    check(kick, {})
    hit = kd.strike(*kick)
    assert hit.momentum_residual <= 1e-12
    assert constraint_speed(hit) <= 1e-10
    ((loop, carried),) = hit.loop_impulses.items()
    assert loop == ("shank_pin", "rocker_b_tip")
    # rocker_b hangs on two pins: what comes in at its tip and at the thigh moves it
    model, joint = leg.model, leg.joint_names.index("rocker_b")
    data = model.createData()
    jump = hit.v_after - hit.v_before
    pin.centerOfMass(model, data, q, jump)
    turn = data.oMi[joint + 1].rotation
    gained = (
        model.inertias[joint + 1].mass
        * turn
        @ (
            data.v[joint + 1].linear
            + np.cross(data.v[joint + 1].angular, model.inertias[joint + 1].lever)
        )
    )
    assert carried + turn @ hit.joint_impulses[joint][:3] == pytest.approx(gained, abs=1e-12)
    assert np.linalg.norm(carried) > 1e-3


@pytest.mark.parametrize("seed", range(20))
def test_off_the_frames_origin(seed):
    rng = np.random.default_rng(seed)
    (posture, v, ball, _), options = random_kick(rng, random_leg(rng))
    offset = rng.uniform(-0.2, 0.2, size=3)
    closing = posture.with_contact_offset(offset).point_velocity(v) - options["ball_velocity"]
    tilted = closing / np.linalg.norm(closing) + rng.uniform(-0.4, 0.4, size=3)
    check((posture, v, ball, kd.Contact(tilted, 0.7, 0.4, offset)), options)


def test_the_axis_of_a_passive_joint_carries_nothing():
    kick, options = random_kick(np.random.default_rng(3), kd.Leg.human())
    hit = kd.strike(*kick, **options)
    assert np.abs(hit.joint_impulses[:, 4]).max() < 1e-14  # all axes are y


def test_worst_joint_is_named():
    kick, options = random_kick(np.random.default_rng(3), kd.Leg.human())
    hit = kd.strike(*kick, **options)
    name, size = hit.worst_joint
    sizes = np.linalg.norm(hit.joint_impulses[:, :3], axis=1)
    assert size == max(sizes)
    assert name == ("hip", "knee", "ankle")[int(np.argmax(sizes))]


@pytest.mark.parametrize("held", [False, True])
def test_an_impact_that_was_interrupted_leaves_nothing(held, monkeypatch):
    leg = kd.Leg.from_robot("bolt", base="floating")
    leg = leg.with_supports(kd.Support("FL_FOOT", point=True)) if held else leg
    posture = leg.posture(leg.configuration({"FR_HFE": 0.4, "FR_KFE": -0.8}))
    v = posture.joint_velocity([3, 0, 1])
    kick = posture, v, kd.Ball(), kd.Contact((3, 0, 1), 0.7)
    wanted = kd.strike(*kick).joint_impulses

    def interrupted(*_):
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(pin, "rnea", interrupted)
        with pytest.raises(KeyboardInterrupt):
            _ = kd.strike(*kick).joint_impulses
    leg.workspace.external_wrenches[1] += 1.0  # wherever it stopped
    assert (kd.strike(*kick).joint_impulses == wanted).all()


def test_the_momentum_residual_is_relative_to_what_the_impulse_brings_into_the_joints():
    """With a momentum left over that is not rounding: over |J| |p|, whatever the impulse."""
    posture = kd.Leg.human().posture([0.7, 0.5, -0.3])
    impulse, left = np.array([3.0, 0.0, 4.0]), np.array([0.02, -0.05, 0.01])
    for size in (1.0, 1e-6):
        response = leg_response_module._as_response(
            posture, np.zeros(3), size * impulse, np.zeros(0), np.zeros(3), np.zeros((3, 6)),
            size * left,
        )  # fmt: skip
        expected = 0.05 / (5.0 * posture.jacobian_norm)
        assert response.momentum_residual == pytest.approx(expected, rel=1e-12)
