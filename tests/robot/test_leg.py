import math
import pickle
import threading

import numpy as np
import pinocchio as pin
import pytest
from chains import random_leg

import kickdyn as kd
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
        ("tow", "'tow' is unknown: leg_human has base, hip, .*toe"),
        ("", "'' is unknown"),
        (None, "None is unknown"),
        ("universe", "'universe' is unknown"),  # id 0, which is no part of the leg
        ("base", "'base' is fixed to the base: a kick must move it"),
    ],
)
def test_frame_must_exist_and_move(frame, said):
    with pytest.raises(kd.InvalidInput, match=said):
        kd.Leg.from_model(kd.Leg.human().model, frame)


def test_long_lists_of_names_are_cut():
    with pytest.raises(kd.InvalidInput, match=r"j38, j39 and 21 more$"):
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
    assert copy.urdf == leg.urdf
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
