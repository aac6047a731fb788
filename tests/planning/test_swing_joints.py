import numpy as np
import pinocchio as pin
import pytest

import kickdyn as kd
from kickdyn.planning import swing_joints as room


def test_only_the_foots_joints_are_left_with_their_limits():
    leg = kd.Leg.from_robot("g1")
    joints = room.joints_of(leg)
    assert joints.names[0] == "right_hip_pitch_joint"
    assert joints.names[-1] == "right_ankle_roll_joint"
    assert joints.effort.tolist() == leg.effort_limit[joints.vs].tolist()
    assert joints.low.tolist() == leg.lower[joints.qs].tolist()
    assert joints.model.gravity.linear[2] == pytest.approx(-9.81)


def test_what_hangs_on_them_comes_with_them():
    """Its torques are those of the whole robot, all else at rest."""
    leg = kd.Leg.from_robot("talos")
    joints, model = room.joints_of(leg), leg.model
    q, v = leg.configuration(), np.zeros(leg.nv)
    draw = np.random.default_rng(0)
    q[joints.qs], v[joints.vs] = draw.normal(size=(2, len(joints.names)))
    every = pin.rnea(model, model.createData(), q, v, 0 * v)[joints.vs]
    data = joints.model.createData()
    alone = pin.rnea(joints.model, data, q[joints.qs], v[joints.vs], 0 * v[joints.vs])
    assert alone == pytest.approx(every, abs=1e-10)


@pytest.mark.parametrize(("what", "named"), [("velocityLimit", "speed"), ("effortLimit", "torque")])
def test_a_joint_without_limits_is_refused(what, named):
    model = kd.Leg.human().model
    limits = getattr(model, what)
    limits[1] = np.inf
    setattr(model, what, limits)
    with pytest.raises(kd.InvalidInput, match=f"^{named} limit of knee is inf: a swing needs one"):
        room.joints_of(kd.Leg.from_model(model, "toe"))


def test_a_floating_base_is_refused():
    with pytest.raises(kd.InvalidInput, match="joints without one angle"):
        room.joints_of(kd.Leg.from_robot("g1", base="floating"))


def test_without_casadi_it_says_how_to_install_it(monkeypatch):
    monkeypatch.setattr(room, "find_spec", lambda name: None)
    with pytest.raises(kd.InvalidInput, match=r'pip install "kickdyn\[swing\]"'):
        kd.plan_kick(kd.Leg.human(), kd.Goal(15, time=1), kd.Ball(), swing=True)
