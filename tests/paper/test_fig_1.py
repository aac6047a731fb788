"""Self-motion: postures with one contact point, and the impulses that they give."""

import math

import numpy as np
import pytest
from tolerances import closed_form

import kickdyn as kd
from kickdyn.paper import fig_1
from kickdyn.paper.fig_1 import self_motion

LEG, START = kd.Leg.human(), np.radians([25, 40, 10])


@pytest.fixture(scope="module")
def postures():
    return self_motion(LEG, START)


def test_the_contact_point_stays_and_the_joints_go_from_limit_to_limit(postures):
    points = np.array([posture.contact_point for posture in postures])
    assert np.ptp(points, axis=0).max() < closed_form(100)
    q = np.array([posture.q for posture in postures])
    steps = np.linalg.norm(np.diff(q, axis=0), axis=1)
    assert steps == pytest.approx(np.full(len(steps), fig_1.STEP), rel=0.1)
    for end in (q[0], q[-1]):
        room = np.minimum(end - LEG.lower, LEG.upper - end).min()
        assert 0 <= room < 3 * fig_1.STEP


def test_items_are_the_extremes_of_impulses_by_eq_10(postures):
    """p = (1 + e) v / (1/m + 1/M) along the attack; on an obstacle, 1/M is 0."""
    items = {item.item: item for item in fig_1.items()}
    attack, start = np.array([math.cos(math.pi / 6), 0, 0.5]), postures
    for struck, mobility in (("a ball", 1 / 0.45), ("an obstacle", 0.0)):
        right = [1.8 * 1.0 / (1 / posture.effective_mass(attack) + mobility) for posture in start]
        for label, value in (("most", max(right)), ("least", min(right))):
            item = items[f"Fig. 1 {label} impulse on {struck}"]
            assert item.ours == pytest.approx(value, rel=closed_form(1e3)), item.item
            assert f"{max(right) / min(right):.2f}" in item.why
            assert item.verdict == "shape-reproduced"
            posture = start[right.index(value)]
            ball = kd.Ball(mass=1 / mobility if mobility else math.inf, radius=0.1)
            hit = kd.strike(posture, posture.joint_velocity(attack), ball, kd.Contact(attack, 0.8))
            joint, inside = hit.worst_joint
            name = f"Fig. 1 {label} impulse on {struck}, in the {joint}"
            assert items[name].ours == pytest.approx(inside, rel=closed_form(1e3)), name


@pytest.mark.parametrize(("leg", "q", "words"), [
    (LEG, [0.0, -1.0, 0], "range"), (LEG, [0.0, 0.0], r"shape \(2,\)"),
    (LEG.locked({"ankle": 0.0}), [0.1, 0.2], "0 degrees of self-motion")])  # fmt: skip
def test_a_leg_without_self_motion_and_other_bad_input_is_refused(leg, q, words):
    with pytest.raises(kd.InvalidInput, match=words):
        self_motion(leg, q)
