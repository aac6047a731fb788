"""Legs, postures and drives: kinematics, inertia and rotors by hand, copies, refusals."""

import math
import threading

import numpy as np
import pinocchio as pin
import pytest
from chains import at, random_leg, serial
from hypothesis import given, settings
from hypothesis import strategies as st
from mpmath import mp, mpf
from scipy.integrate import solve_ivp
from tolerances import agrees, closed_form, differenced, integrated

import kickdyn as kd
from kickdyn.robot.leg_model import catalogued_drives, read_drives
from kickdyn.robot.model_validation import frames_by_name
from kickdyn.robot.urdf_file import shipped_urdf

SEEDS = st.integers(0, 10**6)


# lengths [m], masses [kg], moments of inertia about the centre [kg m2], centres [m] of the paper
HUMAN = (("0.371", "7", "0.08", "0.1855"), ("0.443", "3", "0.049", "0.2215"))
HUMAN = (*HUMAN, ("0.145", "1", "0.0018", "0.0725"))
TESTBED = (("0.4", "1.712", "0.02305", "0.2"), ("0.396", "1.074", "0.01413", "0.198"))
TESTBED = (*TESTBED, ("0.22", "0.57", "0.00055", "0.073"))
LEGS = {"human": (kd.Leg.human(), HUMAN), "testbed": (kd.Leg.testbed(), TESTBED)}
STRETCHED = [0.0, 0.0, math.pi / 2]  # thigh, shank and foot in one line, straight down
Q = [0.5, 1.0, -0.25]  # exact in every format below


def textbook(limbs, q):
    """Toe, its Jacobian (x and z), and M of a planar leg, by summing the bodies' kinetic energy.

    Thigh and shank hang along -z at absolute angle 0, the foot along +x; hip flexion turns
    forward, knee flexion and plantar flexion turn back.
    """
    turns = ((1, 0, 0), (1, -1, 0), (1, -1, -1))
    inertia, joint, jacobian = mp.zeros(3, 3), mp.zeros(2, 1), mp.zeros(2, 3)
    for k, limb in enumerate(limbs):
        length, mass, moment, centre = (mpf(number) for number in limb)
        turn = mp.matrix([turns[k]])
        angle = sum(mpf(float(a)) * t for a, t in zip(q, turns[k], strict=True))
        cos, sin = mp.cos(angle), mp.sin(angle)
        along = mp.matrix([cos, sin]) if k == 2 else mp.matrix([sin, -cos])
        perpendicular = mp.matrix([-along[1], along[0]])  # d along / d angle
        at_centre = jacobian + centre * perpendicular * turn
        inertia += mass * at_centre.T * at_centre + moment * turn.T * turn
        joint, jacobian = joint + length * along, jacobian + length * perpendicular * turn
    return joint, jacobian, inertia


def as_floats(matrix):
    return np.array(matrix.tolist(), dtype=float)


@pytest.mark.parametrize("name", LEGS)
@pytest.mark.parametrize("seed", range(4))
def test_a_planar_leg_is_the_textbooks(name, seed):
    leg, limbs = LEGS[name]
    q = np.random.default_rng(seed).uniform(-3, 3, size=3)
    posture = leg.posture(q)
    with mp.workdps(50):
        toe, jacobian, inertia = textbook(limbs, q)
        agrees(posture.contact_point[[0, 2]], as_floats(toe)[:, 0], closed_form())
        agrees(posture.jacobian[[0, 2]], as_floats(jacobian), closed_form())
        agrees(posture.inertia, as_floats(inertia), closed_form())
        for degrees in (0, 30, 90, 200):
            n = mp.matrix([mp.cos(mp.radians(degrees)), mp.sin(mp.radians(degrees))])
            exact = 1 / (n.T * jacobian * mp.inverse(inertia) * jacobian.T * n)[0]
            normal = [float(n[0]), 0.0, float(n[1])]
            right = pytest.approx(float(exact), rel=closed_form(posture.condition))
            assert posture.effective_mass(normal) == right
    assert not posture.jacobian[1].any()


@settings(max_examples=25)
@given(SEEDS)
def test_laws_of_a_posture(seed):
    """Of Jacobian, Delassus matrix, effective mass, condition, and velocities of least energy."""
    rng = np.random.default_rng(seed)
    leg, h = random_leg(rng), 1e-5
    q = rng.uniform(-2, 2, size=leg.nq)
    posture = leg.posture(q)
    steps = h * np.eye(leg.nv)
    moves = [leg.posture(q + e).contact_point - leg.posture(q - e).contact_point for e in steps]
    agrees(posture.jacobian, np.column_stack(moves) / (2 * h), differenced())
    assert posture.jacobian_norm == pytest.approx(np.linalg.norm(posture.jacobian))
    rounding = closed_form(np.linalg.cond(posture.inertia))
    inverse = np.linalg.inv(posture.inertia)
    direct = posture.jacobian @ inverse @ posture.jacobian.T
    agrees(posture.delassus(), direct, rounding)
    agrees(posture.whiten(posture.jacobian), posture.whitened_jacobian.T, rounding)
    unit = 1 / np.sqrt(posture.inertia.diagonal())
    condition = np.linalg.cond(posture.inertia * unit * unit[:, None], 1)
    assert condition / 10 <= posture.condition <= condition * (1 + rounding)  # estimated from below
    impulses = rng.normal(size=(leg.nv, 2))
    agrees(posture.solve(impulses), inverse @ impulses, rounding)
    direction = posture.point_velocity(rng.normal(size=leg.nv))  # one that it can have
    n = direction / np.linalg.norm(direction)
    for normal in (direction, -1e-200 * direction):
        inverse_mass = 1.0 / posture.effective_mass(normal)
        assert inverse_mass == pytest.approx(n @ direct @ n, abs=rounding * direct.max())
    v = posture.joint_velocity(direction)
    size = np.abs(posture.inertia @ v).max()
    agrees(posture.point_velocity(v), direction, closed_form(1e4))
    null = np.linalg.svd(posture.jacobian)[2][np.linalg.matrix_rank(posture.jacobian) :]
    np.testing.assert_allclose(null @ posture.inertia @ v, 0.0, atol=closed_form(1e5) * size)


def test_an_immovable_direction_has_infinite_mass():
    posture = LEGS["human"][0].posture([0.4, 0.5, 0.1])
    assert posture.effective_mass([0, 1, 0]) == math.inf  # sideways, in a planar leg
    assert LEGS["human"][0].posture(STRETCHED).effective_mass([0, 0, 1]) > 1e20
    with pytest.raises(kd.InvalidInput, match="length 0"):
        posture.effective_mass([0, 0, 0])
    with pytest.raises(kd.InvalidInput, match=r"\(3, 2\): .*length 3"):
        posture.whiten(np.ones((3, 2)))


@pytest.mark.parametrize(("q", "wish", "nearest"), [
    (STRETCHED, (0, 0, 1), (0.0, 0.0, 0.0)), (STRETCHED, (1, 0, 1), (1.0, 0.0, 0.0)),
    (STRETCHED, (1e300, 1, 1e300), (1e300, 0.0, 0.0)), (Q, (10, 0.01, 1), (10.0, 0.0, 1.0)),
    (Q, (10, 2e-8, 1), (10.0, 0.0, 1.0))])  # fmt: skip
def test_a_velocity_out_of_reach_is_refused_with_the_nearest(q, wish, nearest):
    """A planar leg cannot move aside, a stretched one along itself."""
    posture = LEGS["human"][0].posture(q)
    with pytest.raises(kd.InvalidInput, match="out of reach") as refusal:
        posture.joint_velocity(wish)
    assert f"nearest velocity is {list(nearest)} m/s" in str(refusal.value)
    assert posture.try_joint_velocity(wish) is None
    assert posture.try_joint_velocity(nearest) is not None


def test_a_base_that_moves_carries_the_contact_point():
    """Its velocity is J v + v_0 + omega x; joints need the rest of a wished one."""
    rng = np.random.default_rng(1)
    leg = random_leg(rng, joints=6)
    linear, angular, v = rng.normal(size=(2, 3))[0], rng.normal(size=3), rng.normal(size=6)
    posture = leg.with_base_velocity(linear, angular).posture(rng.uniform(-1, 1, 6))
    carried = linear + np.cross(angular, posture.contact_point)
    agrees(posture.point_velocity(v), posture.jacobian @ v + carried, closed_form())
    wish = rng.normal(size=3)
    still = leg.posture(posture.q)
    agrees(posture.joint_velocity(wish), still.joint_velocity(wish - carried), closed_form(1e3))
    assert leg.with_base_velocity((0, 0, 0)).base_velocity is None


@pytest.mark.parametrize("seed", range(5))
def test_a_point_elsewhere_on_the_foot_is_a_frame_there(seed):
    rng = np.random.default_rng(seed)
    leg, offset = random_leg(rng), rng.uniform(-0.2, 0.2, size=3)
    model = leg.model
    frame = model.frames[leg.frame_id]
    there = frame.placement * pin.SE3(np.eye(3), offset)
    model.addFrame(pin.Frame("patch", frame.parentJoint, 0, there, pin.FrameType.OP_FRAME))
    q = rng.uniform(-2, 2, size=leg.nq)
    patch, origin = kd.Leg.from_model(model, "patch").posture(q), leg.posture(q)
    _ = origin.delassus(), origin.rounding_gain  # caches of the origin, which must not stay
    offset_posture = origin.with_contact_offset([1, 1, 1]).with_contact_offset(offset)
    for name in ("contact_point", "contact_lever", "jacobian"):
        agrees(getattr(offset_posture, name), getattr(patch, name), closed_form())
    rounding = closed_form(np.linalg.cond(offset_posture.inertia))
    agrees(offset_posture.delassus(), patch.delassus(), rounding)
    assert offset_posture.rounding_gain == pytest.approx(patch.rounding_gain, rel=closed_form(1e4))
    assert offset_posture.with_contact_offset(None) is offset_posture
    with pytest.raises(kd.InvalidInput, match=r"1001\.0: .* 1000 .m."):
        origin.with_contact_offset((0, -1001, 0))


HUMAN_MODEL = kd.Leg.human().model


@pytest.mark.parametrize(("change", "said"), [
    (lambda leg: leg.locked({"toe": 0}), "'toe' is unknown"),
    (lambda leg: leg.locked({"ankle": 30}), "ankle at 1718.9 deg"),
    (lambda leg: leg.locked({"hip": 0, "knee": 0, "ankle": 0}), "all joints"),
    (lambda leg: leg.with_base_velocity((0, 0, 101)), "speed of the base is 101.* 100"),
    (lambda leg: leg.with_base_velocity((0, 0, 0), (80, 0, 80)), "angular speed .* 100"),
    (lambda leg: kd.Leg.from_robot("bolt", base="floating").with_base_velocity((1, 0, 0)),
     "fixed base"),
    (lambda leg: leg.with_armature({"hip": -1}), "armature of hip is -1.0"),
    (lambda leg: kd.Leg.from_model(HUMAN_MODEL, "tow"), "'tow' is unknown: .*'toe'"),
    (lambda leg: kd.Leg.from_model(HUMAN_MODEL, None), "frame is None"),
    (lambda leg: kd.Leg.from_model(HUMAN_MODEL, "base"), "'base' is fixed to the base"),
    (lambda leg: kd.Leg.from_model(None, "toe"), r"pinocchio\.Model"),
    (lambda leg: kd.Leg.from_model(HUMAN_MODEL), r"from_model\(model, frame\).* knee.* toe"),
    (lambda leg: kd.Leg("leg.urdf"), r"pinocchio\.Model.*from_urdf"),
    (lambda leg: kd.Leg.from_urdf(leg.file.text), "the text of a file: save it"),
    (lambda leg: kd.Track.from_csv("t,x,y,z\n0,1,2,3"), "the text of a file: save it"),
])  # fmt: skip
def test_bad_arguments_are_refused(change, said):
    with pytest.raises(kd.InvalidInput, match=said):
        change(kd.Leg.human())


def test_a_frame_can_be_a_joint_and_a_body_goes_before_it(spoil, load):
    ankle = kd.Leg.from_model(HUMAN_MODEL, "ankle").posture(np.zeros(3))
    assert ankle.contact_point[2] == pytest.approx(-0.814)  # 0.371 + 0.443
    both = load(spoil(('name="hip"', 'name="toe"')))  # a joint named like the link at the tip
    assert both.posture([0, 0]).contact_point == pytest.approx([0, 0, 0.2])
    model, kinds = both.model, (pin.FrameType.FIXED_JOINT, pin.FrameType.BODY)
    fixed, body = [model.addFrame(pin.Frame("x", 1, pin.SE3.Identity(), kind)) for kind in kinds]
    assert frames_by_name(model)["x"] == body > fixed


def test_a_speed_limit_of_0_is_a_warning_where_the_joint_moves_the_foot():
    model = (leg := kd.Leg.from_robot("g1", base="fixed", legs_only=True)).model
    model.velocityLimit *= 0.0
    lines = [line for line in kd.Leg.from_model(model, leg.frame).warnings if "is 0" in line]
    assert [line.split()[3] for line in lines] == [n for n in leg.joint_names if "right" in n]


@pytest.mark.parametrize("gravity", [-9.81, 0.0])
def test_a_leg_has_a_model_of_its_own(gravity):
    model = random_leg(np.random.default_rng(0), joints=2).model
    model.gravity = pin.Motion(np.array([0, 0, gravity]), np.zeros(3))
    leg = kd.Leg.from_model(model, "toe")
    assert leg.model.gravity == model.gravity
    assert leg.workspace.model.gravity == pin.Motion.Zero()  # an impact is too short for it
    before = leg.posture([0.3, 0.4]).inertia.copy()
    for other in (model, leg.model):
        other.inertias[1].mass = 50.0
        other.armature = np.ones(2)
    assert (leg.posture([0.3, 0.4]).inertia == before).all()


def test_arrays_are_copies_and_read_only():
    q = np.array(Q)
    leg = kd.Leg.human()
    posture = leg.posture(q)
    before = posture.inertia.copy()
    q[:] = 9
    leg.posture([1, 2, 3])
    assert posture.q.tolist() == Q
    assert (posture.inertia == before).all()
    limits = leg.lower, leg.upper, leg.velocity_limit, leg.effort_limit
    for array in (*limits, posture.whitened_jacobian):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1


def test_threads_do_not_mix():
    leg = random_leg(np.random.default_rng(3), joints=6)
    qs = np.random.default_rng(4).uniform(-2, 2, size=(2, 100, leg.nq))
    barrier, together, spaces = threading.Barrier(2), [[], []], []

    def work(k):
        barrier.wait()
        spaces.append(leg.workspace.data)
        together[k] += [leg.posture(q).delassus().tolist() for q in qs[k]]

    workers = [threading.Thread(target=work, args=(k,)) for k in (0, 1)]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join()
    assert together == [[leg.posture(q).delassus().tolist() for q in half] for half in qs]
    assert spaces[0] is not spaces[1]


DRIVEN = ("g1", "talos", "icub", "icub_reduced", "bolt")


def write(folder, text):
    path = folder / "drives.toml"
    path.write_text(text)
    return path


def test_a_rotor_behind_a_gear_has_the_energy_of_its_lagrangian():
    """The kinetic energy is the links' own and, of each rotor, J (n v)^2 / 2."""
    drives = {"hip": kd.Drive(2e-5, 60), "knee": kd.Drive(1e-5, -120), "ankle": kd.Drive(3e-3)}
    leg, q = kd.Leg.human(), np.array([0.3, 0.8, -0.2])
    geared, model = leg.with_drives(drives).posture(q).inertia, leg.model
    for v in np.random.default_rng(1).normal(size=(5, 3)):
        links = pin.computeKineticEnergy(model, model.createData(), q, v)
        speeds = v * [drive.gear for drive in drives.values()]
        rotors = 0.5 * speeds**2 @ [drive.rotor_inertia for drive in drives.values()]
        assert 0.5 * v @ geared @ v == pytest.approx(links + rotors, rel=closed_form(10))


@pytest.mark.parametrize("name", DRIVEN)
def test_robots_of_the_catalogue_have_drives_with_a_source(name):
    robot = kd.Leg.from_robot(name, base="floating", legs_only=True)
    bare = kd.Leg.from_robot(name, base="floating", legs_only=True, drives=False)
    driven = [robot.velocity_index(joint) for joint in robot.single_joints]
    assert (robot.model.armature[driven] > 0).all()
    assert not robot.model.armature[:6].any()
    assert not bare.model.armature.any()
    assert robot.locked({robot.single_joints[0]: 0}).model.armature.any()
    assert 'source = "' in catalogued_drives(name).read_text()


def test_a_file_gives_drives_before_joints_are_locked(tmp_path):
    file = write(
        tmp_path,
        '[joints]\n"*" = { rotor_inertia_kg_m2 = 1e-5, gear = 50 }\n'
        "knee = { rotor_inertia_kg_m2 = 0.02, torque_limit_n_m = 80, speed_limit_rad_s = 9, "
        "friction_n_m = 3, stiffness_n_m_rad = 4 }\n",
    )
    leg = kd.Leg.from_urdf(shipped_urdf("leg_human.urdf"), drives=file, locked={"ankle": 0.1})
    assert leg.model.armature == pytest.approx([0.025, 0.02])
    assert (leg.effort_limit[1], leg.velocity_limit[1]) == (80, 9)
    assert leg.effort_limit[0] == kd.Leg.human().effort_limit[0]
    assert leg.compliant_drives == {"knee": read_drives(file)["knee"]}
    assert (leg.drives["knee"].friction, leg.drives["knee"].stiffness) == (3, 4)


@pytest.mark.parametrize(("text", "said"), [
    ("", r"no \[joints\]"),
    ("[joints.knee]\nrotor_inertia_kg_m2 = -1", "knee: rotor inertia is -1.0"),
    ("[joints.knee]\nrotor_inertia_kg_m2 = 1e-3\ngear = 101", "knee: .* 10.201 kg m2"),
    ("[joints.knee]\nrotor_inertia_kg_m2 = 1\ngear = 0", "knee: gear is 0"),
    *((f"[joints.knee]\nrotor_inertia_kg_m2 = 1\n{key} = -1", f"knee: {word} is -1.0")
      for key, word in (("torque_limit_n_m", "torque limit"), ("speed_limit_rad_s", "speed limit"),
                        ("stiffness_n_m_rad", "stiffness"), ("friction_n_m", "friction"))),
    ("[joints.knee]\ngear = 2", "knee has no rotor_inertia_kg_m2"),
    ("[joints.knee]\nrotor_inertia_kg_m2 = 0\nratio = 2", "knee has ratio: choose .*gear"),
    ("[joints.nee]\nrotor_inertia_kg_m2 = 0", "'nee' .*'knee'"),
], ids=lambda text: text[:60])  # fmt: skip
def test_bad_files_are_refused_in_one_line(tmp_path, text, said):
    with pytest.raises(kd.InvalidInput, match=f"^[^\n]*{said}[^\n]*$"):
        kd.Leg.human().with_drives(write(tmp_path, text))


def test_the_limits_of_the_effective_mass():
    """Stiff is the limit of heavy rotors, on a floating base the whole body as one."""
    normal = (1, 0, 0.5)
    robot = kd.Leg.from_robot("bolt", base="floating")
    posture = robot.posture(robot.configuration({"FR_KFE": 0.4})).with_contact_offset((0, 0, 0.1))
    masses = posture.effective_mass_limits(normal)

    def effective_mass(leg):
        return leg.posture(posture.q).with_contact_offset((0, 0, 0.1)).effective_mass(normal)

    heavy = robot.with_armature(dict.fromkeys(robot.single_joints, 1e7))
    assert masses["with rotors"] == pytest.approx(posture.effective_mass(normal), rel=closed_form())
    right = effective_mass(kd.Leg.from_robot("bolt", base="floating", drives=False))
    assert masses["without rotors"] == pytest.approx(right, rel=closed_form(10))
    assert masses["with stiff joints"] == pytest.approx(effective_mass(heavy), rel=1e-5)
    fixed = kd.Leg.from_robot("bolt").posture(np.zeros(6))
    assert fixed.effective_mass_limits((1, 0, 0))["with stiff joints"] == np.inf


CONTACT = kd.Contact((0, 0, 1), restitution=1.0)


def hinge(**drive):
    """A bar of 0.5 m about y with a drive, in a posture 0.4 rad below level; without gravity."""
    inertia = pin.Inertia(1.5, np.array([0.2, 0.0, 0.0]), np.diag([1e-3, 0.04, 0.04]))
    model = serial([("hip", pin.JointModelRY(), at(0, 0, 0), inertia)], at(0.5, 0, 0))
    model.gravity = pin.Motion.Zero()
    leg = kd.Leg.from_model(model, "toe").with_drives({"hip": kd.Drive(2e-5, 40, **drive)})
    return leg.posture([0.4]), 1.5 * 0.2**2 + 0.04 + 2e-5 * 40**2


def hinge_impulse(contact_stiffness, inertia, v, drive, creep):
    """The impulse on the ball, by equations of motion of hinge, Hertz's spring and ball."""
    ball, axis = kd.Ball(), np.array([0.0, 1.0, 0.0])

    def turned(q):
        return pin.utils.rotate("y", q)

    normal, tip = turned(-0.4) @ [0, 0, 1], np.array([0.5, 0.0, 0.0])
    start = turned(0.4) @ tip + [0, 0, ball.radius]

    def height(y):
        n = turned(y[0]) @ normal
        return n, n @ (start + y[2:5] - turned(y[0]) @ tip)

    def rates(t, y):
        n, above = height(y)
        force = contact_stiffness * max(ball.radius - above, 0.0) ** 1.5
        lever = np.cross(start + y[2:5] - above * n, n) @ axis
        torque = drive.stiffness * (0.4 + v * t - y[0])
        torque -= drive.friction * y[1] / np.hypot(y[1], creep)
        return [y[1], (torque - force * lever) / inertia, *y[5:8], *(force * n / ball.mass)]

    def separation(t, y):
        return ball.radius - height(y)[1] if t > 1e-4 else 1.0

    separation.terminal = True
    y = solve_ivp(
        rates, (0, 1), [0.4, v, *np.zeros(6)], "DOP853", events=separation, rtol=1e-10, atol=1e-12
    ).y
    return ball.mass * y[5:8, -1]


@pytest.mark.parametrize(("stiffness", "friction"), [(300.0, 0.0), (0.0, 250.0), (4e4, 20.0)])
def test_a_drive_is_a_rotor_a_spring_and_friction(stiffness, friction):
    drive = kd.Drive(2e-5, 40, stiffness=stiffness, friction=friction)
    (posture, inertia), v = hinge(stiffness=stiffness, friction=friction), -12.0
    hit = kd.collide(posture, [v], kd.Ball(), CONTACT, contact_time=0.012, tol=1e-9)
    creep = 1e-3 * np.sqrt(2 * hit.approach.energy() / inertia)
    impulse = hinge_impulse(hit.force_model.stiffness, inertia, v, drive, creep)
    assert hit.impulse == pytest.approx(impulse, rel=integrated(1e-9), abs=integrated(1e-9))
    assert hit.energy_residual < integrated(1e-9)
    number = {"hip": hit.contact_time * np.sqrt(stiffness / inertia)}
    assert posture.drive_number(hit.contact_time) == pytest.approx(number, rel=closed_form(10))
    shown = [line.split()[-1] for line in repr(hit).splitlines() if "drive number, hip" in line]
    assert shown == [f"{number['hip']:.4g}"]
