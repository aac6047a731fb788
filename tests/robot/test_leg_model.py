"""Drives: rotors behind gears, springs and friction, and the files that list them."""

import numpy as np
import pinocchio as pin
import pytest
from chains import at, serial
from scipy.integrate import solve_ivp
from tolerances import closed_form, integrated

import kickdyn as kd
from kickdyn.robot.leg_model import catalogued_drives, read_drives
from kickdyn.robot.urdf_file import shipped_urdf

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
