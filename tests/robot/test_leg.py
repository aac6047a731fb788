import json
import math
import pickle
import re
import threading

import numpy as np
import pinocchio as pin
import pytest
import yourdfpy
from chains import random_leg
from mpmath import mp, mpf

import kickdyn as kd
from kickdyn.robot.leg import NO_DRIVES, read_leg
from kickdyn.robot.urdf_file import shipped_urdf

BODY = pin.Inertia(1.0, np.array([0.0, 0.0, -0.25]), np.diag([0.1, 0.1, 0.05]))


def arm(joint=None, body=BODY, armature=0.0, placement=None, joints=2, tip=(0, 0, -0.5)):
    """A pin.Model: a hanging chain of like joints, with a frame `toe` at its tip."""
    model = pin.Model()
    model.name = "arm"
    parent = 0
    for k in range(joints):
        hang = placement or pin.SE3(np.eye(3), np.array([0, 0, -0.5 * (k > 0)]))
        parent = model.addJoint(parent, joint or pin.JointModelRY(), hang, f"j{k}")
        model.addJointFrame(parent)
        model.appendBodyToJoint(parent, body, pin.SE3.Identity())
    reach = pin.SE3(np.eye(3), np.array(tip, float))
    model.addFrame(pin.Frame("toe", parent, 0, reach, pin.FrameType.OP_FRAME))
    model.armature = np.full(model.nv, armature)
    return model


def body(mass=1.0, moments=(0.1, 0.1, 0.05), at=(0.1, 0.2, 0.3)):
    turn = pin.rpy.rpyToMatrix(0.3, 0.4, 0.5)
    return pin.Inertia(mass, np.array(at), turn @ np.diag(moments) @ turn.T)


@pytest.mark.parametrize(
    ("frame", "said"),
    [
        ("tow", "'tow' is unknown: did you mean 'toe'. leg_human has base, hip, .*toe"),
        ("SHANK", "'SHANK' is unknown: did you mean 'shank'"),
        ("xyzzy", "'xyzzy' is unknown: leg_human has base"),
        ("", "'' is unknown"),
        (None, "frame is None: it must be a str"),
        ("universe", "'universe' is unknown"),  # id 0, which is no part of the leg
        ("base", "'base' is fixed to the base: a kick must move it"),
    ],
)
def test_frame_must_exist_and_move(frame, said):
    with pytest.raises(kd.InvalidInput, match=said):
        kd.Leg.from_model(kd.Leg.human().model, frame)


def test_long_lists_of_names_are_cut():
    with pytest.raises(kd.InvalidInput, match=r"arm has toe, j0, .*j18 and 41 more$"):
        kd.Leg.from_model(arm(joints=60), "tow")


def test_frame_can_be_a_joint_and_a_body_goes_before_it(spoil, load):
    assert kd.Leg.from_model(kd.Leg.human().model, "ankle").posture(np.zeros(3)).contact_point[
        2
    ] == pytest.approx(-0.814)
    both = load(spoil(('name="hip"', 'name="toe"')))  # a joint named like the link at the tip
    assert both.posture([0, 0]).contact_point == pytest.approx([0, 0, 0.2])


UNSOUND = {
    "negative mass": body(mass=-1.0),
    "no mass": body(mass=0.0),
    "mass nan": body(mass=math.nan),
    "mass inf": body(mass=math.inf),
    "lever nan": body(at=(0, math.nan, 0)),
    "nothing": pin.Inertia.Zero(),
    "triangle": body(moments=(0.1, 0.1, 0.21)),
}


@pytest.mark.parametrize("unsound", UNSOUND.values(), ids=UNSOUND)
def test_unsound_inertia_is_refused(unsound):
    with pytest.raises(kd.InvalidInput, match="joint 'j0' moves an unsound inertia"):
        kd.Leg.from_model(arm(body=unsound), "toe")


def test_moments_beyond_float64_are_refused():
    far = pin.SE3(np.eye(3), np.array([0, 0, -1e98]))
    with pytest.raises(kd.InvalidInput, match="an unsound inertia: its moments exceed the range"):
        kd.Leg.from_model(arm(body=body(mass=1e10), placement=far), "toe")


@pytest.mark.parametrize(
    "moments", [(0.1, 0.2, 0.3), (0, 0.1, 0.1), (0, 0, 0)], ids=["disc", "rod", "point"]
)
def test_flat_thin_and_point_bodies_are_sound(moments):
    leg = kd.Leg.from_model(arm(body=body(moments=moments)), "toe")
    assert leg.posture([0.1, 0.2]).effective_mass([1, 0, 0]) > 0


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"armature": -1e-9}, "armature is .*0 or more"),
        ({"armature": math.nan}, "armature is .*finite"),
        ({"placement": pin.SE3(np.eye(3), np.array([math.nan, 0, 0]))}, "is not a rigid motion"),
        ({"placement": pin.SE3(2 * np.eye(3), np.zeros(3))}, "is not a rigid motion"),
        ({"tip": (math.nan, 0, 0)}, "unsound"),
        ({"joints": 0}, "no moving joint"),
    ],
)
def test_unsound_model_is_refused(change, said):
    with pytest.raises(kd.InvalidInput, match=said):
        kd.Leg.from_model(arm(**change), "toe")


def test_mimic_joints_are_refused(spoil):
    text = spoil(('<axis xyz="0 1 0"/>', '<axis xyz="0 1 0"/><mimic joint="hip"/>'))
    model = pin.buildModelFromXML(text, mimic=True)
    with pytest.raises(kd.InvalidInput, match=r"^joint 'knee' mimics another"):
        kd.Leg.from_model(model, "toe")


@pytest.mark.parametrize("other", [-1.62, 9.81, math.nan, math.inf])
def test_another_gravity_is_refused(other):
    """The ball would fly with 9.81 m/s2, whatever the model says."""
    model = arm()
    model.gravity = pin.Motion(np.array([0, 0, other]), np.zeros(3))
    with pytest.raises(kd.InvalidInput, match=r"^gravity of .* must be \(0, 0, -9.81\)"):
        kd.Leg.from_model(model, "toe")


@pytest.mark.parametrize("model", [None, "leg.urdf", pin.GeometryModel(), pin.Data()])
def test_what_is_no_model_is_refused(model):
    with pytest.raises(kd.InvalidInput, match=r"it must be a pinocchio\.Model"):
        kd.Leg.from_model(model, "toe")


def test_urdf_without_moving_joint_is_refused(load):
    with pytest.raises(kd.UrdfError, match="has no moving joint"):
        load('<robot name="stone"><link name="toe"/></robot>')


def test_armature_is_honoured():
    plain, geared = (kd.Leg.from_model(arm(armature=a), "toe").posture([1, 2]) for a in (0, 0.25))
    assert geared.inertia - plain.inertia == pytest.approx(0.25 * np.eye(2), abs=1e-15)
    assert geared.effective_mass([1, 0, 0]) > plain.effective_mass([1, 0, 0])


def test_leg_is_its_own():
    model = arm()
    leg = kd.Leg.from_model(model, "toe")
    before = leg.posture([0.3, 0.4]).inertia.copy()
    for other in (model, leg.model):
        other.inertias[1].mass = 50.0
        other.armature = np.ones(2)
        other.lowerPositionLimit = np.ones(2)
        other.addFrame(pin.Frame("late", 1, 0, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
    assert (leg.posture([0.3, 0.4]).inertia == before).all()
    assert leg.joint_range("j0")[0] < 0
    for array in (
        leg.contact_lever,
        leg.posture([0, 0]).contact_lever,
        leg.lower,
        leg.upper,
        leg.velocity_limit,
        leg.effort_limit,
    ):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0


@pytest.mark.parametrize("gravity", [-9.81, 0.0])
def test_model_comes_back_with_its_gravity(gravity):
    model = arm()
    model.gravity = pin.Motion(np.array([0, 0, gravity]), np.zeros(3))
    leg = kd.Leg.from_model(model, "toe")
    assert leg.model.gravity == model.gravity
    assert leg.workspace.model.gravity == pin.Motion.Zero()  # an impact knows none


@pytest.mark.parametrize(
    "leg", [kd.Leg.human(), kd.Leg.from_model(arm(armature=0.1), "toe")], ids=["urdf", "model"]
)
def test_pickle(leg):
    copy = pickle.loads(pickle.dumps(leg))
    q = np.full(leg.nq, 0.3)
    assert repr(copy) == repr(leg)
    assert copy.file == leg.file
    assert (copy.model.gravity, copy.frame) == (leg.model.gravity, leg.frame)
    assert (copy.posture(q).inertia == leg.posture(q).inertia).all()
    assert (copy.posture(q).jacobian == leg.posture(q).jacobian).all()


def test_threads_do_not_mix():
    leg = random_leg(np.random.default_rng(3), joints=6)
    qs = np.random.default_rng(4).uniform(-2, 2, size=(2, 300, leg.nq))

    def summary(q):
        posture = leg.posture(q)
        return posture.contact_point.tolist() + posture.delassus().ravel().tolist()

    serial = [[summary(q) for q in half] for half in qs]
    together = [[], []]
    barrier = threading.Barrier(2)

    def work(k):
        barrier.wait()
        together[k] += [summary(q) for q in qs[k]]

    workers = [threading.Thread(target=work, args=(k,)) for k in (0, 1)]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join()
    assert together == serial


def test_each_thread_has_its_own_workspace():
    leg = kd.Leg.human()
    spaces = [leg.workspace.data]
    worker = threading.Thread(target=lambda: spaces.append(leg.workspace.data))
    worker.start()
    worker.join()
    assert spaces[0] is not spaces[1]
    assert leg.workspace.data is spaces[0]


def test_locked_joints_move_as_one_body():
    leg, q = kd.Leg.human(), [0.3, 0.8, -0.2]
    locked = leg.locked({"ankle": -0.2})
    assert locked.joint_names == ("hip", "knee")
    assert locked.frame == "toe"
    full, less = leg.posture(q), locked.posture(q[:2])
    assert less.contact_point == pytest.approx(full.contact_point, abs=1e-15)
    assert less.inertia == pytest.approx(full.inertia[:2, :2], abs=1e-14)
    assert less.effective_mass([1, 0, 0]) > full.effective_mass([1, 0, 0])
    assert locked.upper.tolist() == leg.upper[:2].tolist()
    assert leg.joint_names == ("hip", "knee", "ankle")


def test_a_rotor_as_heavy_as_the_world_locks_its_joint():
    """The limit of armature is the locked joint: their difference shrinks with the rotor."""
    leg, q = kd.Leg.human(), [0.3, 0.8, -0.2]
    locked = leg.locked({"ankle": -0.2}).posture(q[:2]).delassus()
    gaps = [
        np.abs(leg.with_armature({"ankle": rotor}).posture(q).delassus() - locked).max()
        for rotor in (1e2, 1e4, 1e6)
    ]
    assert gaps[0] > 90 * gaps[1] > 8000 * gaps[2]
    geared = leg.with_armature({"knee": 0.5, "hip": 0.2}).posture(q).inertia
    assert geared - leg.posture(q).inertia == pytest.approx(np.diag([0.2, 0.5, 0]), abs=1e-15)
    again = leg.with_armature({"knee": 0.5}).with_armature({"knee": 0.1, "hip": 0.2})
    assert again.model.armature == pytest.approx([0.2, 0.1, 0])


def test_links_may_have_the_names_of_joints():
    """As in the four-bar leg, where rocker_a and rocker_b are both."""
    leg = kd.Leg.from_urdf(shipped_urdf("leg_fourbar.urdf"))
    q = leg.configuration({"hip": 0.2, "rocker_b": 0.4, "rocker_a": 0.3, "ankle": 0.1})
    for name in ("ankle", "rocker_a"):
        locked = leg.locked({name: {"ankle": 0.1, "rocker_a": 0.3}[name]})
        keep = [k for k, joint in enumerate(leg.joint_names) if joint != name]
        full, less = leg.posture(q), locked.posture(q[keep])
        assert less.contact_point == pytest.approx(full.contact_point, abs=1e-15)
        assert less.inertia == pytest.approx(full.inertia[np.ix_(keep, keep)], abs=1e-14)
        names = [frame.name for frame in locked.model.frames]
        assert names.count("rocker_b") == 2  # as in the file
    loop = ("shank_pin", "rocker_b_tip")
    assert leg.with_loops(loop).locked({"ankle": 0.1}).constraints.loops == (loop,)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda leg: leg.locked({"toe": 0}), "joint 'toe' is unknown: leg_human has hip"),
        (lambda leg: leg.locked({"hip": math.nan}), "joint hip is nan"),
        (lambda leg: leg.locked({"ankle": 30}), "ankle at 1718.9 deg is outside .* be locked"),
        (lambda leg: leg.locked({"hip": 0, "knee": 0, "ankle": 0}), "all joints .* are locked"),
        (lambda leg: leg.with_armature({"toe": 1}), "joint 'toe' is unknown"),
        (lambda leg: leg.with_armature({"hip": -1}), "armature of hip is -1.0: .*at least 0"),
    ],
)
def test_bad_locks_and_rotors_are_refused(change, said):
    with pytest.raises(kd.InvalidInput, match=said):
        change(kd.Leg.human())


def test_repr_names_joints_and_frame():
    assert repr(kd.Leg.human()) == (
        "Leg('leg_human', joints=['hip', 'knee', 'ankle'], frame='toe')"
    )


def test_wrong_kinds_are_named():
    leg = kd.Leg.human()
    calls = {"joints": leg.locked, "rotors": leg.with_armature}
    for name, call in calls.items():
        with pytest.raises(kd.InvalidInput, match=rf"^{name} is .*must map names to values"):
            call(["hip"])
    assert leg.locked(None).joint_names == leg.joint_names
    for loop in (5, None, "hip"):
        with pytest.raises(kd.InvalidInput, match="must be a pair"):
            leg.with_loops(loop)


def test_a_frame_whose_placement_is_not_finite_is_refused():
    model = arm()
    frame = model.frames[model.getFrameId("toe")]
    frame.placement = pin.SE3(np.eye(3), np.array([math.nan, 0, 0]))
    with pytest.raises(kd.InvalidInput, match="placement of frame 'toe' is not finite"):
        kd.Leg.from_model(model, "toe")


def test_a_negative_speed_limit_is_refused():
    model = arm()
    model.velocityLimit = np.array([1.0, -1.0])
    with pytest.raises(kd.InvalidInput, match=r"velocity limit is \[1.0, -1.0\]: every entry must"):
        kd.Leg.from_model(model, "toe")


def test_a_limit_that_is_no_number_is_said_to_be_none():
    model = arm()
    model.upperPositionLimit = np.array([math.nan, 1.0])
    with pytest.raises(kd.InvalidInput, match=r"joint range is .*every limit must be a number"):
        kd.Leg.from_model(model, "toe")


def test_a_joint_without_a_frame_can_be_locked():
    """Pinocchio's buildReducedModel crashes where a joint has no frame of its name."""
    model = kd.Leg.human().model
    number = model.addJoint(0, pin.JointModelRY(), pin.SE3.Identity(), "arm")
    model.appendBodyToJoint(number, BODY, pin.SE3.Identity())
    leg = kd.Leg.from_model(model, "toe").locked({"arm": 0.3})
    assert leg.joint_names == ("hip", "knee", "ankle")


HUMAN = (("0.371", "7", "0.08", "0.1855"), ("0.443", "3", "0.049", "0.2215"))
HUMAN = (*HUMAN, ("0.145", "1", "0.0018", "0.0725"))
TESTBED = (("0.4", "1.712", "0.02305", "0.2"), ("0.396", "1.074", "0.01413", "0.198"))
TESTBED = (*TESTBED, ("0.22", "0.57", "0.00055", "0.073"))
LEGS = {"human": (kd.Leg.human(), HUMAN), "testbed": (kd.Leg.testbed(), TESTBED)}
STRETCHED = [0.0, 0.0, math.pi / 2]  # thigh, shank and foot in one line, straight down


def textbook(limbs, q):
    """Toe, its Jacobian (x and z), and M of a planar leg, by summing the bodies' kinetic energy.

    Thigh and shank hang along -z at absolute angle 0, the foot along +x; hip flexion turns
    forward, knee flexion and plantar flexion turn back.
    """
    turns = ((1, 0, 0), (1, -1, 0), (1, -1, -1))
    inertia = mp.zeros(3, 3)
    joint, jacobian = mp.zeros(2, 1), mp.zeros(2, 3)
    for k, limb in enumerate(limbs):
        length, mass, moment, centre = (mpf(number) for number in limb)
        turn = mp.matrix([turns[k]])
        angle = sum(mpf(float(a)) * t for a, t in zip(q, turns[k], strict=True))
        cos, sin = mp.cos(angle), mp.sin(angle)
        along = mp.matrix([cos, sin]) if k == 2 else mp.matrix([sin, -cos])
        across = mp.matrix([-along[1], along[0]])  # d along / d angle
        at_centre = jacobian + centre * across * turn
        inertia += mass * at_centre.T * at_centre + moment * turn.T * turn
        joint, jacobian = joint + length * along, jacobian + length * across * turn
    return joint, jacobian, inertia


def as_floats(matrix):
    return np.array(matrix.tolist(), dtype=float)


@pytest.mark.parametrize("name", LEGS)
@pytest.mark.parametrize("seed", range(5))
def test_planar_leg_is_the_textbooks(name, seed):
    leg, limbs = LEGS[name]
    q = np.random.default_rng(seed).uniform(-3, 3, size=3)
    posture = leg.posture(q)
    with mp.workdps(50):
        toe, jacobian, inertia = textbook(limbs, q)
        assert posture.contact_point[[0, 2]] == pytest.approx(as_floats(toe)[:, 0], abs=2e-15)
        assert np.abs(posture.jacobian[[0, 2]] - as_floats(jacobian)).max() < 2e-15
        assert np.abs(posture.inertia - as_floats(inertia)).max() < 5e-15
        for degrees in (0, 30, 90, 200):
            n = mp.matrix([mp.cos(mp.radians(degrees)), mp.sin(mp.radians(degrees))])
            give = (n.T * jacobian * mp.inverse(inertia) * jacobian.T * n)[0]
            exact = float(1 / give)
            normal = [float(n[0]), 0.0, float(n[1])]
            assert posture.effective_mass(normal) == pytest.approx(exact, rel=1e-12)
    assert (posture.jacobian[1] == 0).all()
    assert posture.contact_point[1] == 0


@pytest.mark.parametrize("seed", range(10))
def test_jacobian_is_the_derivative_of_the_contact_point(seed):
    rng = np.random.default_rng(seed)
    leg = random_leg(rng)
    q, h = rng.uniform(-2, 2, size=leg.nq), 1e-5
    numeric = np.column_stack(
        [
            (leg.posture(q + step).contact_point - leg.posture(q - step).contact_point) / (2 * h)
            for step in h * np.eye(leg.nv)
        ]
    )
    assert np.abs(leg.posture(q).jacobian - numeric).max() < 1e-9


SPATIAL = """<robot name="spatial"><link name="l0"/>{}</robot>"""
LIMB = """
<joint name="j{k}" type="{kind}"><parent link="l{before}"/><child link="l{k}"/>
  <origin xyz="{at}" rpy="{rpy}"/><axis xyz="{axis}"/>
  <limit lower="-3" upper="3" effort="1" velocity="1"/></joint>
<link name="l{k}"><inertial><origin xyz="{centre}" rpy="{tilt}"/><mass value="{mass}"/>
  <inertia ixx="0.03" ixy="0.002" ixz="0.001" iyy="0.02" iyz="-0.003" izz="0.04"/>
</inertial></link>"""


def test_spatial_inertia_is_the_bodies_kinetic_energy(tmp_path):
    rng = np.random.default_rng(8)

    def triple(length=None):
        numbers = rng.uniform(-0.5, 0.5, size=3)
        numbers *= length / np.linalg.norm(numbers) if length else 1.0
        return " ".join(repr(float(x)) for x in numbers)

    limbs = "".join(
        LIMB.format(
            **{"k": k, "before": k - 1, "kind": kind, "at": triple(), "rpy": triple()},
            **{"axis": triple(1.0), "centre": triple(), "tilt": triple(), "mass": 1 + k},
        )
        for k, kind in enumerate(("revolute", "prismatic", "revolute", "revolute"), start=1)
    )
    path = tmp_path / "spatial.urdf"
    path.write_text(SPATIAL.format(limbs))
    leg = kd.Leg.from_urdf(path, "l4")
    robot = yourdfpy.URDF.load(str(path))  # its kinematics is independent of Pinocchio's

    def poses(q):
        robot.update_cfg(q)
        return [
            robot.get_transform(name) @ robot.link_map[name].inertial.origin
            for name in ("l1", "l2", "l3", "l4")
        ]

    q, h = rng.uniform(-1, 1, size=4), 1e-5
    now = poses(q)
    inertia = np.zeros((4, 4))
    steps = [(poses(q + step), poses(q - step)) for step in h * np.eye(4)]
    for body, pose in enumerate(now):
        rates = [(up[body] - down[body]) / (2 * h) for up, down in steps]
        linear = np.column_stack([rate[:3, 3] for rate in rates])
        spins = [rate[:3, :3] @ pose[:3, :3].T for rate in rates]  # skew: omega x
        turning = np.column_stack([(s[2, 1], s[0, 2], s[1, 0]) for s in spins])
        inertial = robot.link_map[f"l{body + 1}"].inertial
        world = pose[:3, :3] @ inertial.inertia @ pose[:3, :3].T
        inertia += inertial.mass * linear.T @ linear + turning.T @ world @ turning
    robot.update_cfg(q)
    tip = robot.get_transform("l4")[:3, 3]
    assert leg.posture(q).contact_point == pytest.approx(tip, abs=1e-14)
    assert np.abs(leg.posture(q).inertia - inertia).max() < 1e-9


@pytest.mark.parametrize("seed", range(10))
def test_delassus_matrix(seed):
    rng = np.random.default_rng(seed)
    leg = random_leg(rng)
    posture = leg.posture(rng.uniform(-2, 2, size=leg.nq))
    delassus = posture.delassus()
    direct = posture.jacobian @ np.linalg.solve(posture.inertia, posture.jacobian.T)
    assert delassus == pytest.approx(direct, rel=1e-9, abs=1e-11 * np.abs(direct).max())
    assert (delassus == delassus.T).all()
    assert np.linalg.eigvalsh(delassus).min() > -1e-13 * np.abs(delassus).max()
    for normal in rng.normal(size=(5, 3)):
        n = normal / np.linalg.norm(normal)
        exact = 1 / (n @ delassus @ n)
        assert posture.effective_mass(n) == pytest.approx(exact, rel=1e-9)
        assert posture.effective_mass(-1e-200 * normal) == pytest.approx(exact, rel=1e-9)


def test_immovable_direction_has_infinite_mass():
    posture = LEGS["human"][0].posture([0.4, 0.5, 0.1])
    assert posture.effective_mass([0, 1, 0]) == math.inf  # sideways, in a planar leg
    assert LEGS["human"][0].posture(STRETCHED).effective_mass([0, 0, 1]) > 1e25
    with pytest.raises(kd.InvalidInput, match="length 0"):
        posture.effective_mass([0, 0, 0])


def test_leg_of_one_joint():
    # Pinocchio hands out one-dimensional Jacobians here
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelRY(), pin.SE3.Identity(), "hinge")
    rod = pin.Inertia(3.0, np.array([0, 0, -0.5]), np.diag([0.25, 0.25, 0.01]))
    model.appendBodyToJoint(joint, rod, pin.SE3.Identity())
    tip = pin.SE3(np.eye(3), np.array([0.0, 0.0, -1.0]))
    model.addFrame(pin.Frame("toe", joint, 0, tip, pin.FrameType.OP_FRAME))
    posture = kd.Leg.from_model(model, "toe").posture([0.0])
    assert posture.jacobian.tolist() == [[-1], [0], [0]]
    assert posture.effective_mass([1, 0, 0]) == pytest.approx(0.25 + 3 * 0.25)  # I / r^2
    assert posture.effective_mass([0, 0, 1]) == math.inf
    assert posture.joint_velocity([2, 0, 0]) == pytest.approx([-2])
    with pytest.raises(kd.InvalidInput, match="out of reach"):
        posture.joint_velocity([0, 0, 1])


@pytest.mark.parametrize("seed", range(10))
def test_joint_velocity_is_the_one_of_least_kinetic_energy(seed):
    rng = np.random.default_rng(seed)
    leg = random_leg(rng, joints=int(rng.integers(4, 8)))
    posture = leg.posture(rng.uniform(-2, 2, size=leg.nq))
    wish = rng.normal(size=3)
    v = posture.joint_velocity(wish)
    assert posture.point_velocity(v) == pytest.approx(wish, abs=1e-10 * np.abs(wish).max())
    least = v @ posture.inertia @ v
    *_, rows = np.linalg.svd(posture.jacobian)
    null = rows[3:]  # moves the leg, not the contact point
    for other in v + rng.normal(size=(20, len(null))) @ null:
        assert posture.jacobian @ other == pytest.approx(wish, abs=1e-9)
        assert other @ posture.inertia @ other > least
    # an impulse at the contact point would give the same: it does no work on the null space
    assert np.abs(null @ posture.inertia @ v).max() < 1e-10 * np.abs(posture.inertia @ v).max()


@pytest.mark.parametrize(
    "wish", [(0, 0, 1), (0, 0, -1e-9), (1, 0, 1), (0, 1, 0), (1e300, 1, 1e300)]
)
def test_stretched_leg_cannot_move_along_itself(wish):
    posture = LEGS["human"][0].posture(STRETCHED)
    with pytest.raises(
        kd.InvalidInput, match=r"out of reach of Posture\(leg_human, q=\[0, 0, 1.5"
    ) as raised:
        posture.joint_velocity(wish)
    near = json.loads(re.search(r"nearest velocity is (.*) m/s", str(raised.value))[1])
    assert near == [wish[0], 0, 0]
    posture.joint_velocity(near)


@pytest.mark.parametrize("aside", [1e-2, 1e-6, 1.2e-8])
def test_a_velocity_that_is_missed_by_little_is_refused(aside):
    """A planar leg cannot move its toe aside."""
    posture = LEGS["human"][0].posture(Q)
    assert posture.point_velocity(posture.joint_velocity([10, 0, 1])) == pytest.approx([10, 0, 1])
    with pytest.raises(kd.InvalidInput, match=r"the nearest velocity is \[10.0, 0.0, 1.0\] m/s"):
        posture.joint_velocity([10, aside, 1])
    assert posture.try_joint_velocity([10, aside, 1]) is None
    assert posture.try_joint_velocity([10, 0.8e-8, 1]) is not None  # a billionth is rounding


@pytest.mark.filterwarnings("error")
def test_a_velocity_beyond_float64_is_refused_without_a_warning():
    posture = LEGS["human"][0].posture([0.3, 0.4, 0.1])
    for wish in ([1e308, 0, 0], [1e308, 0, 1e308]):
        assert posture.try_joint_velocity(wish) is None
        with pytest.raises(kd.InvalidInput, match="exceed the range of float64"):
            posture.joint_velocity(wish)


def test_a_nearly_stretched_leg_reaches_its_velocity():
    """Its two directions of motion have gains of unlike size."""
    posture = LEGS["human"][0].posture([0.3, 1e-5, math.pi / 2])
    v = posture.joint_velocity([1.0, 0.0, 0.3])
    rounding = np.finfo(float).eps * np.abs(v).max()
    assert posture.point_velocity(v) == pytest.approx([1.0, 0.0, 0.3], abs=rounding)


@pytest.mark.parametrize("scale", [1e-200, 1e-9, 1, 1e9, 1e200])
def test_reach_does_not_depend_on_speed(scale):
    posture = LEGS["human"][0].posture(STRETCHED)
    slow = posture.joint_velocity([1, 0, 0])
    assert posture.joint_velocity([scale, 0, 0]) == pytest.approx(scale * slow, rel=1e-12)


def test_standing_still_is_always_in_reach():
    assert LEGS["human"][0].posture(STRETCHED).joint_velocity([0, 0, 0]).tolist() == [0, 0, 0]


Q = [0.5, 1.0, -0.25]  # exact in every format below


@pytest.mark.parametrize(
    "q",
    [
        tuple(Q),
        np.array(Q, ">f8"),
        np.array(Q, ">f4"),
        np.array(Q, np.float16),
        np.array(Q, np.longdouble),
        np.array([Q, Q]).T[:, 0],
        np.array(Q[::-1])[::-1],
        np.ma.array(Q),
    ],
    ids=lambda q: getattr(q, "dtype", type(q)),
)
def test_any_array_of_the_same_numbers_is_the_same_posture(q):
    leg = LEGS["human"][0]
    assert (leg.posture(q).inertia == leg.posture(Q).inertia).all()
    assert (leg.posture(q).jacobian == leg.posture(Q).jacobian).all()


def test_q_is_copied_and_nothing_can_be_written():
    q = np.array(Q)
    posture = LEGS["human"][0].posture(q)
    q[:] = 9
    assert posture.q.tolist() == Q
    arrays = (
        "q",
        "contact_point",
        "jacobian",
        "inertia",
        "rotation_world_joint",
        "whitened_jacobian",
    )
    for name in arrays:
        with pytest.raises(ValueError, match="read-only"):
            getattr(posture, name)[0] = 1


def test_postures_outlive_each_other():
    leg = LEGS["human"][0]
    first = leg.posture(Q)
    kept = [array.copy() for array in (first.contact_point, first.jacobian, first.inertia)]
    leg.posture([1, 2, 3])
    now = (first.contact_point, first.jacobian, first.inertia)
    assert all((a == b).all() for a, b in zip(kept, now, strict=True))


def wheel(lever=0.5):
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelRUBY(), pin.SE3.Identity(), "wheel")
    point = pin.Inertia(1.0, np.array([lever, 0, 0]), np.zeros((3, 3)))
    model.appendBodyToJoint(joint, point, pin.SE3.Identity())
    model.addFrame(
        pin.Frame("toe", joint, 0, pin.SE3(np.eye(3), np.ones(3)), pin.FrameType.OP_FRAME)
    )
    return kd.Leg.from_model(model, "toe")


def test_joint_that_moves_no_inertia_is_refused():
    with pytest.raises(kd.InvalidInput, match=r"not positive definite: a joint moves no inertia"):
        wheel(lever=0.0).posture([1, 0])


@pytest.mark.parametrize("seed", range(5))
def test_condition_and_solve(seed):
    rng = np.random.default_rng(seed)
    leg = random_leg(rng)
    posture = leg.posture(rng.uniform(-2, 2, size=leg.nq))
    scale = 1 / np.sqrt(posture.inertia.diagonal())
    exact = np.linalg.cond(posture.inertia * scale * scale[:, None], 1)
    assert exact / 3 <= posture.condition <= exact * (1 + 1e-9)  # LAPACK's is a lower estimate
    impulse = rng.normal(size=leg.nv)
    assert posture.inertia @ posture.solve(impulse) == pytest.approx(impulse, abs=1e-9)


def test_repr_names_leg_and_angles():
    assert repr(LEGS["human"][0].posture(Q)) == "Posture(leg_human, q=[0.5, 1, -0.25])"


@pytest.mark.parametrize("seed", range(20))
def test_a_point_elsewhere_on_the_foot_is_a_frame_there(seed):
    rng = np.random.default_rng(seed)
    leg, offset = random_leg(rng), rng.uniform(-0.2, 0.2, size=3)
    model = leg.model
    frame = model.frames[leg.frame_id]
    there = frame.placement * pin.SE3(np.eye(3), offset)
    model.addFrame(pin.Frame("patch", frame.parentJoint, 0, there, pin.FrameType.OP_FRAME))
    q = rng.uniform(-2, 2, size=leg.nq)
    asked = kd.Leg.from_model(model, "patch").posture(q)
    origin = leg.posture(q)
    _ = origin.delassus(), origin.rounding_gain  # kept of the old point, they must not stay
    moved = origin.with_contact_offset([1, 1, 1]).with_contact_offset(offset)
    assert moved.contact_point == pytest.approx(asked.contact_point, abs=1e-14)
    assert moved.jacobian == pytest.approx(asked.jacobian, abs=1e-14)
    assert moved.contact_lever == pytest.approx(asked.contact_lever, abs=1e-14)
    assert moved.delassus() == pytest.approx(asked.delassus(), rel=1e-11, abs=1e-13)
    assert moved.rounding_gain == pytest.approx(asked.rounding_gain)
    assert not np.allclose(origin.contact_point, moved.contact_point)
    assert moved.with_contact_offset(None) is moved


@pytest.mark.parametrize("offset", [(0, 0, 1001), (0, -1001, 0)])
def test_a_contact_point_far_away_is_refused(offset):
    posture = kd.Leg.human().posture([0.1, 0.2, -0.1])
    with pytest.raises(kd.InvalidInput, match=r"contact offset is 1001\.0: .* at most 1000 .m."):
        posture.with_contact_offset(offset)


def test_a_foot_faster_than_floats_is_refused():
    posture = kd.Leg.human().posture([0.1, 0.2, -0.1])
    with pytest.raises(kd.InvalidInput, match="is too fast"):
        posture.joint_velocity([1e308, 0, 1e308])


def test_a_speed_limit_of_0_is_named(spoil, load):
    leg = load(spoil(('velocity="20"', 'velocity="0"')))
    assert leg.warnings == (
        NO_DRIVES,
        "speed limit of knee is 0: a kick that moves it is too fast",
    )
    assert kd.Leg.human().warnings == ()


MJCF = """<mujoco><worldbody><body><joint name="hip" type="hinge" axis="0 1 0"/>
<geom type="capsule" fromto="0 0 0 0 0 -0.8" size="0.05"/><site name="toe" pos="0 0 -0.8"/>
</body></worldbody></mujoco>"""


def test_the_root_element_tells_the_formats_apart(tmp_path):
    """The files' names do not: both are XML."""
    urdf, mjcf = tmp_path / "a.xml", tmp_path / "b.xml"
    urdf.write_text(kd.Leg.human().file.text)
    mjcf.write_text(MJCF)
    assert read_leg(urdf, "toe", "fixed").joint_names == ("hip", "knee", "ankle")
    assert read_leg(mjcf, "toe", "fixed").joint_names == ("hip",)


def test_folders_of_packages_are_for_a_urdf(tmp_path):
    mjcf = tmp_path / "b.xml"
    mjcf.write_text(MJCF)
    with pytest.raises(kd.InvalidInput, match="package-dir is 'meshes': it is for URDF files"):
        read_leg(mjcf, "toe", "fixed", ["meshes"])
