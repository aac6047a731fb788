import math

import numpy as np
import pytest

import kickdyn as kd
from kickdyn.robot.urdf_file import shipped_urdf

TREE = kd.Leg.from_urdf(shipped_urdf("leg_fourbar.urdf"))
LOOP = ("shank_pin", "rocker_b_tip")
LEG = TREE.with_loops(LOOP)


def flexed(drive):
    return LEG.close_loops(
        LEG.configuration({"rocker_b": drive}), keep=("hip", "rocker_b", "ankle")
    )


def test_straight_it_is_closed_and_hinged_at_the_knee():
    """The rockers cross at the knee's centre; they are light, so little else differs."""
    ours, hinge = LEG.posture(np.zeros(5)), kd.Leg.human().posture(np.zeros(3))
    assert ours.contact_point == pytest.approx(hinge.contact_point, abs=1e-15)
    assert ours.delassus() == pytest.approx(hinge.delassus(), rel=1e-3, abs=1e-12)
    assert ours.constraint_projector.rank == 2  # of 3 rows: nothing moves along y
    cut = TREE.posture(np.zeros(5))
    assert cut.effective_mass([1, 0, 0]) < 0.99 * ours.effective_mass([1, 0, 0])


@pytest.mark.parametrize("drive", [0.1, 0.4, 0.8, 1.3])
def test_closed_is_the_circles_intersection(drive):
    """Two pins on the thigh, two rods, one bar between: by the law of cosines."""
    q = dict(zip(LEG.joint_names, flexed(drive), strict=True))
    assert (q["hip"], q["ankle"], q["rocker_b"]) == (0, 0, drive)
    rod, bar = math.hypot(0.035, 0.035), 0.03

    def turned(x, z, angle):  # about y
        return np.array(
            [math.cos(angle) * x + math.sin(angle) * z, math.cos(angle) * z - math.sin(angle) * x]
        )

    front, back = np.array([0.02, 0.02]), np.array([-0.02, 0.02])
    tip = back + turned(0.035, -0.035, drive)
    pin_a = front + turned(-0.035, -0.035, q["rocker_a"])
    assert np.linalg.norm(tip - pin_a) == pytest.approx(bar, abs=1e-14)
    assert np.linalg.norm(pin_a - front) == pytest.approx(rod, abs=1e-15)
    flexion = q["rocker_a"] + q["shank_pin_a"]
    assert pin_a + turned(bar, 0, flexion) == pytest.approx(tip, abs=1e-14)
    assert LEG.lower[1] <= q["rocker_a"] <= LEG.upper[1]
    assert LEG.lower[2] <= q["shank_pin_a"] <= LEG.upper[2]


def test_closing_what_is_closed_changes_nothing():
    q = flexed(0.7)
    assert LEG.close_loops(q) == pytest.approx(q, abs=1e-13)
    assert TREE.close_loops([0.1, 0.2, 0.3, 0.4, 0.5]).tolist() == [0.1, 0.2, 0.3, 0.4, 0.5]


def test_foot_velocity_keeps_the_loop_closed():
    posture = LEG.posture(flexed(0.7))
    v = posture.joint_velocity([2, 0, 1])
    h = 1e-5
    ahead = LEG.posture(LEG.close_loops(posture.q + h * v))
    moved = (ahead.contact_point - posture.contact_point) / h
    assert moved == pytest.approx([2, 0, 1], abs=2e-3)


@pytest.mark.parametrize(
    ("drive", "keep"), [(2.5, ("rocker_b",)), (0.8, ("rocker_a", "rocker_b", "shank_pin_a"))]
)
def test_what_cannot_be_closed_is_refused_with_its_gap(drive, keep):
    with pytest.raises(
        kd.InvalidInput, match=r"loop shank_pin - rocker_b_tip stays open by .* m: .*rank \d of 3"
    ):
        LEG.close_loops(LEG.configuration({"rocker_b": drive}), keep=keep)


def test_loops_that_contradict_each_other_are_refused():
    both = TREE.with_loops(LOOP, ("shank_pin", "base"))  # the hip is farther away
    with pytest.raises(kd.InvalidInput, match=r"base stays open by .*rank \d of 6"):
        both.close_loops(np.zeros(5))


def test_bad_input():
    with pytest.raises(kd.InvalidInput, match="joint 'knee' is unknown"):
        LEG.close_loops(np.zeros(5), keep=("knee",))
    with pytest.raises(kd.InvalidInput, match=r"q has shape \(3,\)"):
        LEG.close_loops(np.zeros(3))


def test_two_hands_together():
    """A loop across a whole robot, its base afloat and a foot on the ground."""
    robot = kd.Leg.from_robot("g1", base="floating").with_supports("left_ankle_roll_link")
    hands = ("left_rubber_hand", "right_rubber_hand")
    leg = robot.with_loops(hands)
    q = leg.close_loops(leg.configuration({"left_elbow_joint": 0.4, "right_elbow_joint": 0.3}))
    posture = leg.posture(q)
    assert posture.constraint_projector.rank == 9
    assert q[:7] == pytest.approx([0, 0, 0, 0, 0, 0, 1], abs=1e-15)  # the base has no part in it
    v = posture.joint_velocity((3, 0, 0))
    hit = kd.strike(posture, v, kd.Ball(), kd.Contact((1, 0, 0.2), 0.8, friction=0.4))
    assert hit.momentum_residual <= 1e-12
    assert hit.support_residual <= 1e-10
    assert hit.loop_residual <= 1e-10
    assert list(hit.support_impulses) == ["left_ankle_roll_link"]
    assert list(hit.loop_impulses) == [hands]


def test_only_the_loops_own_joints_move():
    """From far off, too, where closing starts anew."""
    q = {"hip": 0.5, "ankle": 0.2, "rocker_b": 0.05, "rocker_a": -1.5, "shank_pin_a": 2}
    closed = dict(
        zip(LEG.joint_names, LEG.close_loops(LEG.configuration(q), ["rocker_b"]), strict=True)
    )
    assert {name: closed[name] for name in ("hip", "ankle", "rocker_b")} == {
        name: q[name] for name in ("hip", "ankle", "rocker_b")
    }
    LEG.posture(list(closed.values()))


def test_what_is_no_configuration_is_refused():
    with pytest.raises(kd.InvalidInput, match="keep is 'rocker_b'"):
        LEG.close_loops(np.zeros(5), keep="rocker_b")
    with pytest.raises(kd.InvalidInput, match="must have length 1"):
        kd.Leg.from_robot("g1", base="floating").close_loops(np.zeros(36))


def test_joints_to_keep_are_a_list():
    leg = kd.Leg.human()
    for keep in (None, 3, "hip"):
        with pytest.raises(kd.InvalidInput, match=r"keep is .*must be a list of joints' names"):
            leg.close_loops(leg.configuration(), keep=keep)
