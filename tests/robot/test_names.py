"""Names of joints and frames: patterns, remedies that can be copied, and suggestions."""

import numpy as np
import pinocchio as pin
import pytest

from kickdyn.robot.names import expand_patterns, lock_remedy

JOINTS = ("hip", "knee", "finger1", "finger2", "finger[1]", "thumb")


def hand(names, **lower):
    """A chain of joints about x with the range -1 to 2, or from `lower`; a rail is along x."""
    model, parent = pin.Model(), 0
    for name in names:
        kind = pin.JointModelPX() if name == "rail" else pin.JointModelRX()
        limits = [np.array([limit]) for limit in (9.0, 9.0, lower.get(name, -1.0), 2.0)]
        parent = model.addJoint(parent, kind, pin.SE3.Identity(), name, *limits)
        model.appendBodyToJoint(parent, pin.Inertia.FromSphere(1.0, 0.1), pin.SE3.Identity())
    return model


@pytest.mark.parametrize(("values", "expanded"), [
    ({"hip": 1.0}, {"hip": 1.0}), ({"finger?": 1.0}, {"finger1": 1.0, "finger2": 1.0}),
    ({"finger[1]": 1.0}, {"finger[1]": 1.0}),  # a name, so no pattern
    ({"*": 0.0, "knee": 2.0}, dict.fromkeys(JOINTS, 0.0) | {"knee": 2.0}),
    ({"finger*": 1.0, "*1": 1.0}, {"finger1": 1.0, "finger2": 1.0, "finger[1]": 1.0})])  # fmt: skip
def test_patterns_stand_for_names(values, expanded):
    assert expand_patterns(values, JOINTS) == expanded


@pytest.mark.parametrize(("lower", "joints", "values", "options"), [
    ({}, ("finger 1", "palm"), "{'finger 1': 0, 'palm': 0}", "'finger 1=0' --lock palm=0"),
    ({}, ("palm",), "{'palm': 0}", "palm=0"),
    # in the middle of a range without 0; 1.5 rad are 85.94 degrees
    ({"palm": 1.0, "rail": 1.0}, ("palm", "rail"), "{'palm': 1.5, 'rail': 1.5}",
     "palm=85.94 --lock rail=1.5")])  # fmt: skip
def test_a_remedy_can_be_copied(lower, joints, values, options):
    text = lock_remedy(hand(("hip", "finger 1", "palm", "rail"), **lower), joints)
    assert f"locked={values} " in text
    assert f"--lock {options} " in text
