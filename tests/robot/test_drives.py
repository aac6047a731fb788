"""Drives: rotors behind gears, the files that list them, and those of the catalogue."""

import numpy as np
import pinocchio as pin
import pytest

import kickdyn as kd
from kickdyn.robot.catalog import ROBOTS
from kickdyn.robot.drives import catalogued_drives, read_drives
from kickdyn.robot.leg import NO_DRIVES

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
        ("rotors = 1\n[joints.knee]\nrotor_inertia_kg_m2 = 1", "rotors is unknown: .* has source"),
        ("[joints.knee]\ngear = 3", "knee has no rotor_inertia_kg_m2: 0 is valid"),
        ("[joints.knee]\ninertia = 3", "knee has inertia: choose rotor_inertia_kg_m2, gear"),
        ("[joints]\nknee = 0.1", "knee has 0.1: choose rotor_inertia_kg_m2, gear"),
        ("[joints.knee]\nrotor_inertia_kg_m2 = -1", "knee: rotor inertia is -1.0.*at least 0"),
        ("[joints.knee]\nrotor_inertia_kg_m2 = 11", "knee: rotor inertia times .* 11 kg m2: it"),
        ("[joints.knee]\nrotor_inertia_kg_m2 = 1\ngear = 0", "knee: gear is 0: it must be the"),
        ("[joints.knee]\nrotor_inertia_kg_m2 = 1\ngear = nan", "knee: gear is nan"),
        (
            "[joints.knee]\nrotor_inertia_kg_m2 = 1\ntorque_limit_n_m = -1",
            "knee: torque limit is -1.0: .* at least 0",
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
    assert masses["stiff"] == pytest.approx(heavy.effective_mass((1, 0, 0.5)), rel=1e-5)
    fixed = kd.Leg.from_robot("bolt").posture(np.zeros(6))
    assert fixed.effective_mass_limits((1, 0, 0))["stiff"] == np.inf
    contact = kd.Contact((1, 0, 0.5), 0.8)
    struck = kd.strike(posture, posture.joint_velocity((1, 0, 0.5)), kd.Ball(), contact)
    assert "limit without rotors" in str(struck)


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
