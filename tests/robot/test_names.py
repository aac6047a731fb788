import numpy as np
import pinocchio as pin
import pytest

import kickdyn as kd
from kickdyn.robot.names import expand_patterns, lock_remedy, unknown
from kickdyn.robot.urdf_file import shipped_urdf

JOINTS = ("hip", "knee", "finger1", "finger2", "finger[1]", "thumb")


def hand(lower=(-1.0, -1.0, -1.0, -1.0, -1.0), names=("hip", "finger1", "finger2", "palm", "rail")):
    """Return a chain of joints about x, the last one along x."""
    model, parent = pin.Model(), 0
    for name, low in zip(names, lower, strict=True):
        kind = pin.JointModelPX() if name == "rail" else pin.JointModelRX()
        limits = (np.array([9.0]), np.array([9.0]), np.array([low]), np.array([2.0]))
        parent = model.addJoint(parent, kind, pin.SE3.Identity(), name, *limits)
        model.appendBodyToJoint(parent, pin.Inertia.Random(), pin.SE3.Identity())
        model.addJointFrame(parent)
    return model


@pytest.mark.parametrize(
    ("values", "found"),
    [
        ({"hip": 1.0}, {"hip": 1.0}),
        ({"finger?": 1.0}, {"finger1": 1.0, "finger2": 1.0}),
        ({"finger[1]": 1.0}, {"finger[1]": 1.0}),  # a name, so no pattern
        ({"[ht]*": 0.5}, {"hip": 0.5, "thumb": 0.5}),
        ({"*": 0.0, "knee": 2.0}, dict.fromkeys(JOINTS, 0.0) | {"knee": 2.0}),
        ({"finger*": 1.0, "*1": 1.0}, {"finger1": 1.0, "finger2": 1.0, "finger[1]": 1.0}),
        ({"KNEE": 1.0, "toe*": 1.0, 3: 1.0}, {}),
    ],
)
def test_patterns_stand_for_names(values, found):
    assert expand_patterns(values, JOINTS) == found


def test_a_name_that_matches_two_values_is_refused():
    with pytest.raises(
        kd.InvalidInput, match=r"'finger1' matches 'f\*' and '\*1', which have diff"
    ):
        expand_patterns({"f*": 0.0, "*1": 1.0}, JOINTS)
    with pytest.raises(kd.InvalidInput, match=r"joint f\* is nan"):
        expand_patterns({"f*": float("nan")}, JOINTS)


def test_the_remedy_can_be_copied():
    model = hand(names=("hip", "finger 1", "finger2", "palm", "rail"))
    text = lock_remedy(model, ["finger 1", "palm"])
    assert text == (
        "lock them by locked={'finger 1': 0, 'palm': 0} in Python, "
        "by --lock 'finger 1=0' --lock palm=0 in commands"
    )
    model = hand()
    one = lock_remedy(model, ["finger1"])
    assert one == "lock it by locked={'finger1': 0} in Python, by --lock finger1=0 in commands"


def test_the_remedy_is_inside_the_range():
    text = lock_remedy(hand(lower=(-1.0, 1.0, -1.0, -1.0, 1.0)), ["finger1", "finger2", "rail"])
    assert text == (
        "lock them by locked={'finger1': 1.5, 'finger2': 0, 'rail': 1.5} in Python, "
        "by --lock finger1=85.94 --lock finger2=0 --lock rail=1.5 in commands"
    )


def test_without_another_joint_there_is_no_remedy():
    assert lock_remedy(hand(), ["hip", "finger1", "finger2", "palm", "rail"]) == ""
    many = [f"x{k}" for k in range(31)]
    model = hand((-1.0,) * 32, (*many, "hip"))
    assert lock_remedy(model, many).startswith("lock them by locked={joint: value} in Python")


def test_of_many_frames_the_nearest_and_those_of_feet_come_first():
    names = [*(f"link{k}" for k in range(60)), "l_ankle", "l_sole", "r_toe"]
    line = unknown("frame", "link_9", "robot", names, ["l_sole", "r_toe", "hand"])
    assert line.startswith("frame 'link_9' is unknown: did you mean 'link9'? robot has link9, ")
    assert ", l_sole, r_toe, link0, " in line
    assert line.endswith(" and 43 more")
    assert unknown("joint", "x", "robot", names).startswith("joint 'x' is unknown: robot has link0")
    assert unknown("frame", "x", "leg", ["hip", "toe"]) == "frame 'x' is unknown: leg has hip, toe"


@pytest.mark.parametrize(
    ("frame", "nearest"),
    [
        ("right_foot", "right_ankle_roll_link"),
        ("left_sole", "left_ankle_roll_link"),
        ("toee", "toe"),
        ("pelvs", "pelvis"),
    ],
)
def test_a_foot_that_no_frame_has_is_sought_at_the_ends_of_limbs(frame, nearest):
    with pytest.raises(kd.InvalidInput, match=f"^frame '{frame}' is unknown: did you mean") as said:
        kd.Leg.from_robot("g1", frame)
    assert f"did you mean '{nearest}'?" in str(said.value)
    assert "right_ankle_roll_link" in str(said.value)
    assert len(str(said.value)) < 700


def test_a_small_leg_says_where_it_ends():
    with pytest.raises(kd.InvalidInput, match=r"did you mean 'toe'\? leg_human has base, hip"):
        kd.Leg.from_urdf(shipped_urdf("leg_human.urdf"), "sole")
