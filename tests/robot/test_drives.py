"""Drives: rotors behind gears, the files that list them, and those of the catalogue."""

import pickle

import numpy as np
import pinocchio as pin
import pytest
from scipy.integrate import solve_ivp

import kickdyn as kd
from kickdyn.robot.catalog import ROBOTS
from kickdyn.robot.drives import catalogued_drives, read_drives
from kickdyn.robot.leg import NO_DRIVES
from kickdyn.scene.launch_and_end import contact_time_error

DRIVEN = ("g1", "talos", "icub", "icub_reduced", "bolt")


def write(folder, text):
    path = folder / "drives.toml"
    path.write_text(text)
    return path


def test_the_robots_page_has_g1_with_its_drives():
    """Effective mass and speed ratio of the toe as measured in the posture of the page."""
    g1 = kd.Leg.from_robot("g1")
    bend = {"right_hip_pitch_joint": -5, "right_knee_joint": 10, "right_ankle_pitch_joint": -5}
    posture = g1.posture(g1.configuration({j: np.radians(x) for j, x in bend.items()}))
    along = np.array([np.cos(np.pi / 6), 0.0, 0.5])
    impact = kd.strike(posture, posture.joint_velocity(along), kd.Ball(), kd.Contact(along, 0.8))
    assert impact.effective_mass == pytest.approx(0.62, abs=0.01)
    assert impact.ball_after.speed == pytest.approx(1.064, abs=0.005)
    bare = kd.Leg.from_robot("g1", drives=False).posture(posture.q)
    assert bare.effective_mass(along) == pytest.approx(0.2547, abs=1e-4)


def test_a_rotor_behind_a_gear_has_the_energy_of_its_lagrangian():
    """The kinetic energy is the links' own and, of each rotor, J (n v)^2 / 2."""
    drives = {"hip": kd.Drive(2e-5, 60), "knee": kd.Drive(1e-5, -120), "ankle": kd.Drive(3e-3)}
    leg, q = kd.Leg.human(), np.array([0.3, 0.8, -0.2])
    geared, model = leg.with_drives(drives).posture(q).inertia, leg.model
    for v in np.random.default_rng(1).normal(size=(5, 3)):
        links = pin.computeKineticEnergy(model, model.createData(), q, v)
        speeds = v * [drive.gear for drive in drives.values()]
        rotors = 0.5 * speeds**2 @ [drive.rotor_inertia for drive in drives.values()]
        assert 0.5 * v @ geared @ v == pytest.approx(links + rotors, rel=1e-12)


@pytest.mark.parametrize("name", DRIVEN)
@pytest.mark.parametrize("base", ["fixed", "floating"])
def test_robots_of_the_catalogue_have_drives(name, base):
    robot = kd.Leg.from_robot(name, base=base, legs_only=True)
    bare = kd.Leg.from_robot(name, base=base, legs_only=True, drives=False)
    driven = [robot.velocity_index(joint) for joint in robot.single_joints]
    assert (robot.model.armature[driven] > 0).all()
    assert not bare.model.armature.any()
    assert robot.velocity_limit.tolist() == bare.velocity_limit.tolist()
    assert robot.locked({robot.single_joints[0]: 0}).model.armature.any()


def test_drives_have_sources_and_bolt_has_the_torque_of_its_motors():
    for name in DRIVEN:
        assert 'source = "' in catalogued_drives(name).read_text()
    assert {name for name in ROBOTS if catalogued_drives(name)} == {*DRIVEN, "human"}
    assert kd.Leg.from_robot("bolt").effort_limit == pytest.approx(2.7)
    assert read_drives(catalogued_drives("talos"))["leg_*_joint"].reflected_inertia == 0.1


def test_a_file_gives_drives_before_joints_are_locked(tmp_path):
    file = write(
        tmp_path,
        '[joints]\n"*" = { rotor_inertia_kg_m2 = 1e-5, gear = 50 }\n'
        "knee = { rotor_inertia_kg_m2 = 0.02, torque_limit_n_m = 80, speed_limit_rad_s = 9 }\n",
    )
    leg = kd.Leg.from_urdf("urdf/leg_human.urdf", drives=file, locked={"ankle": 0.1})
    assert leg.model.armature == pytest.approx([0.025, 0.02])
    assert (leg.effort_limit[1], leg.velocity_limit[1]) == (80, 9)
    assert leg.effort_limit[0] == kd.Leg.human().effort_limit[0]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "has no .joints.: it needs lines such as"),
        ("a = 1 2", "is not TOML"),
        ("a." * 40_000 + "a = 1", "has more than 1000 dots in a line"),
        ("rotors = 1\n[joints.knee]\nrotor_inertia_kg_m2 = 1", "rotors is unknown: .* has source"),
        ("[joints.knee]\ngear = 3", "knee has no rotor_inertia_kg_m2: 0 is valid"),
        ("[joints.knee]\ninertia = 3", "knee has inertia: choose rotor_inertia_kg_m2, gear"),
        ("[joints]\nknee = 0.1", "knee has 0.1: choose rotor_inertia_kg_m2, gear"),
        ("[joints.knee]\nrotor_inertia_kg_m2 = -1", "knee: rotor inertia is -1.0.*at least 0"),
        ("[joints.knee]\nrotor_inertia_kg_m2 = 11", "knee: rotor inertia times .* 11 kg m2: it"),
        ("[joints.knee]\nrotor_inertia_kg_m2 = 1\ngear = 0", "knee: gear is 0: it must be the"),
        ("[joints.knee]\nrotor_inertia_kg_m2 = 1\ngear = nan", "knee: gear is nan"),
        ("[joints.knee]\nrotor_inertia_kg_m2 = 1\ngear = 1e300", "knee: rotor .* is inf kg m2"),
        (
            "[joints.knee]\nrotor_inertia_kg_m2 = 1\ntorque_limit_n_m = -1",
            "knee: torque limit is -1.0: .* at least 0",
        ),
        (
            "[joints.knee]\nrotor_inertia_kg_m2 = 1\nstiffness_n_m_rad = -1",
            "knee: stiffness is -1.0.* at least 0",
        ),
        (
            "[joints.knee]\nrotor_inertia_kg_m2 = 1\nfriction_n_m = -1",
            "knee: friction is -1.0.* at least 0",
        ),
        ("[joints.nee]\nrotor_inertia_kg_m2 = 0", "joint 'nee' is unknown: did you mean 'knee'"),
    ],
)
def test_bad_files_are_refused_in_one_line(tmp_path, text, said):
    with pytest.raises(kd.InvalidInput, match=said) as refused:
        kd.Leg.human().with_drives(write(tmp_path, text))
    assert "\n" not in str(refused.value)


def test_the_limits_of_the_effective_mass():
    """Stiff is the limit of heavy rotors, on a floating base the whole body as one."""
    robot = kd.Leg.from_robot("bolt", base="floating")
    posture = robot.posture(robot.configuration({"FR_KFE": 0.4}))
    masses = posture.effective_mass_limits((1, 0, 0.5))
    heavy = robot.with_armature(dict.fromkeys(robot.single_joints, 1e7)).posture(posture.q)
    assert masses["with rotors"] == posture.effective_mass((1, 0, 0.5))
    bare = kd.Leg.from_robot("bolt", base="floating", drives=False).posture(posture.q)
    assert masses["without rotors"] == pytest.approx(bare.effective_mass((1, 0, 0.5)), rel=1e-12)
    assert masses["with stiff joints"] == pytest.approx(heavy.effective_mass((1, 0, 0.5)), rel=1e-5)
    fixed = kd.Leg.from_robot("bolt").posture(np.zeros(6))
    assert fixed.effective_mass_limits((1, 0, 0))["with stiff joints"] == np.inf
    contact = kd.Contact((1, 0, 0.5), 0.8)
    struck = kd.strike(posture, posture.joint_velocity((1, 0, 0.5)), kd.Ball(), contact)
    assert "limit without rotors" in str(struck)


CONTACT = kd.Contact((0, 0, 1), restitution=1.0)


def hinge(**drive):
    """A bar of 0.5 m about y with a drive, in a posture 0.4 rad below level; without gravity."""
    model = pin.Model()
    model.addJoint(0, pin.JointModelRY(), pin.SE3.Identity(), "hip")
    inertia = pin.Inertia(1.5, np.array([0.2, 0.0, 0.0]), np.diag([1e-3, 0.04, 0.04]))
    model.appendBodyToJoint(1, inertia, pin.SE3.Identity())
    tip = pin.SE3(np.eye(3), np.array([0.5, 0.0, 0.0]))
    model.addFrame(pin.Frame("toe", 1, 0, tip, pin.FrameType.OP_FRAME))
    model.gravity = pin.Motion.Zero()
    leg = kd.Leg.from_model(model, "toe").with_drives({"hip": kd.Drive(2e-5, 40, **drive)})
    return leg.posture([0.4]), 1.5 * 0.2**2 + 0.04 + 2e-5 * 40**2


def integrated(contact_stiffness, inertia, v, drive, creep):
    """The impulse on the ball, by own equations of motion of hinge, spring and ball."""
    ball, axis = kd.Ball(), np.array([0.0, 1.0, 0.0])

    def turned(q):
        return np.array([[np.cos(q), 0, np.sin(q)], [0, 1, 0], [-np.sin(q), 0, np.cos(q)]])

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

    def apart(t, y):
        return ball.radius - height(y)[1] if t > 1e-4 else 1.0

    apart.terminal = True
    y = solve_ivp(
        rates, (0, 1), [0.4, v, *np.zeros(6)], "DOP853", events=apart, rtol=1e-10, atol=1e-12
    ).y
    return ball.mass * y[5:8, -1]


@pytest.mark.parametrize("limits", [(300.0, 0.0), (0.0, 250.0), (4e4, 20.0)])
def test_a_drive_between_free_and_stiff_is_a_spring_and_a_rotor(limits):
    drive = kd.Drive(2e-5, 40, stiffness=limits[0], friction=limits[1])
    (posture, inertia), v = hinge(stiffness=limits[0], friction=limits[1]), -12.0
    hit = kd.collide(posture, [v], kd.Ball(), CONTACT, contact_time=0.012, tol=1e-10)
    creep = 1e-3 * np.sqrt(2 * hit.approach.energy() / inertia)
    own = integrated(hit.force_model.stiffness, inertia, v, drive, creep)
    assert hit.impulse == pytest.approx(own, rel=1e-7, abs=1e-7)
    assert hit.energy_residual < 1e-7
    number = hit.contact_time * np.sqrt(limits[0] / inertia)
    assert posture.drive_number(hit.contact_time) == pytest.approx({"hip": number}, rel=1e-12)
    assert "drive number, hip" in str(hit)


def test_a_hinge_has_the_effective_mass_of_its_lagrangian():
    r"""T = I v^2 / 2 + J (n v)^2 / 2, of a tip that moves by L cos q along z."""
    posture, inertia = hinge()
    expected = inertia / (0.5 * np.cos(0.4)) ** 2
    assert posture.effective_mass((0, 0, 1)) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("kind", ["stiffness", "friction"])
def test_free_and_stiff_are_the_limits_of_a_drive(kind):
    """In the impulse of a contact of 1 ms, of a leg whose ankle is at rest before it."""
    model = kd.Leg.human().model
    model.gravity = pin.Motion.Zero()
    leg = kd.Leg.from_model(model, "toe").with_armature({"ankle": 0.02})
    q, v, contact = [0.3, 0.6, -0.2], [-2.0, -9.0, 0.0], kd.Contact((1, 0, 0.3), 0.8)

    def impulse(leg):
        hit = kd.collide(leg.posture(q), v, kd.Ball(), contact, contact_time=1e-3, tol=1e-6)
        return np.linalg.norm(hit.impulse)

    def driven(size):
        return impulse(leg.with_drives({"ankle": kd.Drive(0.02, **{kind: size})}))

    free, stiff = impulse(leg), impulse(leg.with_stiff_joints("ankle"))
    assert stiff > 1.03 * free
    assert driven(1e-3) == pytest.approx(free, rel=1e-5)
    assert driven(3e7 if kind == "stiffness" else 800.0) == pytest.approx(stiff, rel=2e-3)
    between = driven(2e5 if kind == "stiffness" else 100.0)
    assert free + 0.05 * (stiff - free) < between < free + 0.95 * (stiff - free)


def test_a_short_contact_is_free_and_a_long_one_is_stiff():
    """At one stiffness; `strike` names the limit that it has."""
    model = kd.Leg.human().model
    model.gravity = pin.Motion.Zero()
    drives = {joint: kd.Drive(0.02, stiffness=3e5) for joint in ("hip", "knee", "ankle")}
    leg = kd.Leg.from_model(model, "toe").with_drives(drives)
    posture, contact = leg.posture([0.3, 0.6, -0.2]), kd.Contact((1, 0, 0.3), 1.0)
    v = 1e-3 * np.array([-2.0, -9.0, 1.0])  # so slow that the posture stays
    free = kd.strike(posture, v, kd.Ball(), contact)
    assert free.drive_limit == "with rotors"
    assert kd.strike(kd.Leg.human().posture(posture.q), v, kd.Ball(), contact).drive_limit == (
        "without rotors"
    )
    speeds, numbers = [], []
    for time in (1e-6, 0.1):
        hit = kd.collide(posture, v, kd.Ball(), contact, contact_time=time)
        speeds.append(hit.ball_after.velocity @ contact.normal)
        numbers.append(posture.drive_number(time).values())
    assert max(numbers[0]) < 0.02 < 30 < min(numbers[1])
    assert speeds[0] == pytest.approx(free.ball_after.velocity @ contact.normal, rel=1e-3)
    assert speeds[1] == pytest.approx(2.0 * free.foot_velocity @ contact.normal, rel=1e-2)  # a wall


def test_the_limit_names_stiff_joints():
    leg = kd.Leg.human().with_armature({"knee": 0.1}).with_stiff_joints("hip", "ankle")
    hit = kd.strike(
        leg.posture([0.3, 0.6, -0.2]), [-2.0, -9.0, 0.0], kd.Ball(), kd.Contact((1, 0, 0.3), 0.8)
    )
    assert hit.drive_limit == "with rotors, stiff hip, ankle"
    assert "with rotors, stiff hip, ankle" in str(hit)


def test_drives_go_with_their_joints():
    leg = kd.Leg.human().with_drives({"*": kd.Drive(1e-5, 30, friction=1.0)})
    assert [*leg.drives] == ["hip", "knee", "ankle"]
    again = (
        pickle.loads(pickle.dumps(leg)).locked({"knee": 0.3}).with_drives({"hip": kd.Drive(0.1)})
    )
    assert {joint: drive.friction for joint, drive in again.drives.items()} == {
        "hip": 0,
        "ankle": 1,
    }
    assert [*again.compliant_drives] == ["ankle"]


def test_a_scene_with_compliant_drives_integrates_the_contact(tmp_path):
    drives = write(tmp_path, "[joints.knee]\nrotor_inertia_kg_m2 = 0.1\nstiffness_n_m_rad = 5e3")
    leg = kd.Leg.human().with_drives(drives)
    assert leg.drives["knee"].stiffness == 5e3
    posture, law = leg.posture([0.3, 0.6, -0.2]), kd.Compliance(contact_time=1e-3)
    scene = kd.Scene(
        posture, np.array([-2.0, -9.0, 0.0]), kd.Ball(), kd.Contact((1, 0, 0.3), 0.8), law=law
    )
    assert (
        contact_time_error(scene, kd.strike(posture, scene.v, scene.ball, scene.contact)).velocity
        == np.inf
    )


def test_a_file_without_drives_is_warned_of(tmp_path):
    file = tmp_path / "leg.urdf"
    file.write_text(kd.Leg.human().file.text)
    leg = kd.Leg.from_urdf(file)
    assert leg.warnings == (NO_DRIVES,)
    assert leg.locked({"ankle": 0}).warnings == (NO_DRIVES,)
    assert leg.with_armature({"knee": 0.02}).warnings == ()
    assert kd.Leg.from_urdf(file, drives=False).warnings == ()
    assert kd.Leg.human().warnings == kd.Leg.testbed().warnings == ()
    assert NO_DRIVES in kd.Leg.from_robot("romeo", legs_only=True).warnings
    assert NO_DRIVES not in kd.Leg.from_robot("human", legs_only=True).warnings


def test_bad_drives_are_refused():
    leg = kd.Leg.human()
    with pytest.raises(kd.InvalidInput, match="there is no such file"):
        leg.with_drives("no.toml")
    with pytest.raises(kd.InvalidInput, match=r"drive of knee is 0[.]1"):
        leg.with_drives({"knee": 0.1})
    with pytest.raises(kd.InvalidInput, match="drives is 3: it must map names to values"):
        leg.with_drives(3)
