"""The reference stands on its own feet: energies, closed forms, Pinocchio to float64."""

import numpy as np
import pinocchio as pin
import pytest
from chains import random_leg

import kickdyn as kd
from references.exact_leg import (
    ExactPosture,
    leg_numbers,
    length,
    mp,
    numbers,
)


def posture_of(leg, q):
    return ExactPosture(*leg_numbers(leg), numbers(q))


@pytest.mark.parametrize("seed", range(5))
def test_it_is_pinocchios_to_float64(seed):
    rng = np.random.default_rng(seed)
    leg = random_leg(rng)
    q = rng.uniform(-2, 2, leg.nq)
    exact, ours = posture_of(leg, q), leg.posture(q)
    for mine, theirs in (
        (exact.inertia, ours.inertia),
        (exact.jacobian, ours.jacobian),
        (exact.contact_point, ours.contact_point),
    ):
        assert np.array(mine, dtype=float) == pytest.approx(theirs, abs=1e-13)


def test_armature_is_in_the_inertia():
    leg = kd.Leg.human().with_armature({"knee": 0.5})
    exact = posture_of(leg, [0.1, 0.2, 0.3])
    bare = posture_of(kd.Leg.human(), [0.1, 0.2, 0.3])
    assert exact.inertia[1][1] - bare.inertia[1][1] == 0.5
    assert (exact.inertia[0] == bare.inertia[0]).all()


def test_a_pendulum_has_its_moment_of_inertia_to_the_last_digit():
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelRY(), pin.SE3.Identity(), "hinge")
    rod = pin.Inertia(3.0, np.array([0.25, 0.0, -0.5]), np.diag([0.5, 0.75, 0.5]))
    model.appendBodyToJoint(joint, rod, pin.SE3.Identity())
    tip = pin.SE3(np.eye(3), np.array([0.0, 0.0, -2.0]))
    model.addFrame(pin.Frame("toe", joint, 0, tip, pin.FrameType.OP_FRAME))
    exact = posture_of(kd.Leg.from_model(model, "toe"), [0.7])
    about = mp.mpf("0.75") + 3 * (mp.mpf("0.0625") + mp.mpf("0.25"))
    assert abs(exact.inertia[0][0] - about) < mp.mpf(10) ** -48
    row = exact.whiten(exact.jacobian[0])
    give = (2 * mp.cos(mp.mpf(0.7))) ** 2 / about
    assert abs(row @ row - give) < mp.mpf(10) ** -48


def test_the_factor_solves_to_fifty_digits():
    rng = np.random.default_rng(3)
    leg = random_leg(rng, 6)
    exact = posture_of(leg, rng.uniform(-2, 2, 6))
    right = numbers(rng.normal(size=6))
    solved = exact.unwhiten(exact.whiten(right))
    assert length(exact.inertia @ solved - right) < mp.mpf(10) ** -44


def test_what_it_does_not_know_is_refused():
    with pytest.raises(kd.InvalidInput, match="joints of one angle"):
        leg_numbers(kd.Leg.from_robot("bolt", base="floating"))
    held = kd.Leg.from_robot("bolt", base="floating").with_supports("FL_FOOT")
    with pytest.raises(kd.InvalidInput, match="free legs only"):
        leg_numbers(held)
