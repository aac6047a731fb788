import math

import numpy as np
import pinocchio as pin
import pytest
from chains import any_kick, random_kick
from scipy.integrate import quad

import kickdyn as kd

LEG = kd.Leg.human()


def hit(leg=LEG, seed=3, maker=random_kick):
    kick, options = maker(np.random.default_rng(seed), leg, friction=0.4)
    return kd.strike(*kick, **options)


def test_split_adds_up_and_only_rotors_act_along_the_axis():
    geared = LEG.with_armature({"knee": 0.05})
    struck = hit(geared)
    loads = kd.joint_loads(struck)
    assert list(loads) == ["hip", "knee", "ankle"]
    for load, impulse in zip(loads.values(), struck.joint_impulses, strict=True):
        assert load.structure + load.axis == pytest.approx(impulse, abs=1e-15)
        assert load.structure[4] == pytest.approx(0, abs=1e-15)  # all axes are y
        assert load.axis[[0, 1, 2, 3, 5]] == pytest.approx(np.zeros(5), abs=1e-15)
        assert load.peak_force is load.peak_moment is None
    jump = (struck.v_after - struck.v_before)[1]
    assert loads["knee"].axis[4] == pytest.approx(-0.05 * jump, rel=1e-10)
    assert abs(loads["hip"].axis[4]) < 1e-13


def test_axes_are_those_of_the_impacts_posture():
    """A universal joint's second axis turns with its first angle; the leg has moved since."""
    model, parent = pin.Model(), 0
    universal = pin.JointModelUniversal(np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0]))
    for name, kind in (("hip", universal), ("knee", pin.JointModelRY())):
        place = pin.SE3(np.eye(3), np.array([0.0, 0.0, -0.4]))
        parent = model.addJoint(parent, kind, place, name)
        body = pin.Inertia(2.0, np.array([0.0, 0.05, -0.2]), 0.02 * np.eye(3))
        model.appendBodyToJoint(parent, body, pin.SE3.Identity())
    model.addFrame(pin.Frame("toe", parent, 0, place, pin.FrameType.OP_FRAME))
    leg = kd.Leg.from_model(model, "toe")
    posture = leg.posture([0.7, -0.4, 0.5])
    v = posture.joint_velocity((3.0, 1.0, 0.5))
    struck = kd.strike(posture, v, kd.Ball(), kd.Contact((3.0, 1.0, 0.5), 0.8))
    assert struck.joint_impulses.any()  # computed, and kept
    leg.posture([-0.9, 0.8, 0.1])
    hip = kd.joint_loads(struck)["hip"]
    assert np.linalg.norm(hip.structure[3:]) > 1e-2
    assert hip.axis == pytest.approx(np.zeros(6), abs=1e-13)  # passive


def test_a_floating_base_is_all_freedom():
    leg = kd.Leg.from_robot("bolt", base="floating", drives=False).with_supports(
        kd.Support("FL_FOOT", point=True)
    )
    struck = hit(leg, maker=any_kick)
    loads = kd.joint_loads(struck)
    assert loads["root_joint"].structure == pytest.approx(np.zeros(6), abs=1e-15)
    for name in leg.joint_names[1:]:
        assert np.linalg.norm(loads[name].structure) > 1e-6
        assert np.linalg.norm(loads[name].axis) < 1e-12


def test_peak_is_that_of_half_a_sine():
    struck = hit()
    loads = kd.joint_loads(struck, 0.010)
    for load, impulse in zip(loads.values(), struck.joint_impulses, strict=True):
        pulse, _ = quad(lambda t, p=load.peak_force: p * math.sin(math.pi * t / 0.010), 0, 0.010)
        assert pulse == pytest.approx(np.linalg.norm(impulse[:3]), rel=1e-12)
        turning = load.peak_moment * 2 * 0.010 / math.pi
        assert turning == pytest.approx(np.linalg.norm(impulse[3:]), rel=1e-12)


@pytest.mark.parametrize(
    ("args", "said"),
    [
        ((0,), "contact time is 0.0: .*at least 1e-09"),
        ((math.nan,), "contact time is nan"),
        ((10,), r"contact time is 10(\.0)?: .* at most 0\.1 \[s\]"),
    ],
)
def test_bad_input_is_refused(args, said):
    with pytest.raises(kd.InvalidInput, match=said):
        kd.joint_loads(hit(), *args)


def test_wrong_kinds_are_named():
    with pytest.raises(kd.InvalidInput, match="impact is None"):
        kd.joint_loads(None)


@pytest.mark.parametrize("brief", [0.0, 1e-320, 9e-10])
def test_a_contact_has_a_least_duration(brief):
    posture = kd.Leg.human().posture([0.1, 0.4, -0.1])
    v = posture.joint_velocity((9, 0, 3))
    hit = kd.strike(posture, v, kd.Ball(), kd.Contact((3, 0, 1), 0.7))
    with pytest.raises(kd.InvalidInput, match=r"contact time is .* at least 1e-09"):
        kd.joint_loads(hit, brief)


def test_a_line_has_the_part_along_the_axis_only_where_there_is_one():
    structure, axis = np.array([3.0, 4.0, 0, 0, 0, 0]), np.array([0, 0, 2.0, 0, 0, 0])
    driven = kd.JointLoad("knee", structure, axis, 10.0, 0.0)
    assert repr(driven) == "JointLoad(knee: 5 N s, 2 N s along the axis, peak 10 N)"
    passive = kd.JointLoad("knee", structure, 0.0 * axis, None, None)
    assert repr(passive) == "JointLoad(knee: 5 N s)"
