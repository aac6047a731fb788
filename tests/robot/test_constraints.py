import pickle

import numpy as np
import pytest

import kickdyn as kd

G1 = kd.Leg.from_robot("g1", base="floating")
FOOT, OTHER = "left_ankle_roll_link", "right_ankle_roll_link"


def test_supports_are_kept_and_let_go():
    sole = [(0.1, 0.03, -0.03), (0.1, -0.03, -0.03), (-0.05, 0, -0.03)]
    support = kd.Support(FOOT, friction=0.7, sole=sole)
    leg = G1.with_supports(support)
    assert leg.constraints.supports == (support,)
    assert leg.constraints.size == support.size == 6
    copy = pickle.loads(pickle.dumps(leg))
    kept = copy.constraints.supports[0]
    assert (kept.frame, kept.point, kept.friction) == (FOOT, False, 0.7)
    assert kept.sole.tolist() == [list(corner) for corner in sole]
    assert leg.locked({"waist_yaw_joint": 0.1}).constraints.supports == (support,)
    assert leg.with_armature({"waist_yaw_joint": 0.1}).constraints.supports == (support,)
    assert leg.with_supports().constraints is None
    other = leg.with_supports("left_ankle_pitch_link")  # in place of, not as well
    assert other.constraints.names == ["left_ankle_pitch_link"]
    loops = ("left_wrist_yaw_link", "right_wrist_yaw_link"), ("left_wrist_yaw_link", "torso_link")
    assert leg.with_loops(loops[0]).with_loops(loops[1]).constraints.loops == loops[1:]
    assert G1.constraints is None
    with pytest.raises(ValueError, match="read-only"):
        support.sole[0, 0] = 1


@pytest.mark.parametrize(
    ("supports", "said"),
    [
        (("left_toe",), "frame 'left_toe' is unknown: g1 has "),
        ((OTHER,), f"support {OTHER} is on the kicking limb, .* right_ankle_roll_joint"),
        ((FOOT, "right_knee_link"), "support right_knee_link is on the kicking limb"),
        ((7,), "support is 7: it must be a frame's name or Support"),
        ((None,), "support is None"),
    ],
)
def test_what_cannot_stand_is_refused(supports, said):
    with pytest.raises(kd.InvalidInput, match=said):
        G1.with_supports(*supports)


def test_beyond_the_kicking_foot_is_the_kicking_limb_too():
    leg = kd.Leg.from_robot("g1", frame="left_knee_link", base="floating")
    with pytest.raises(kd.InvalidInput, match=f"{FOOT} is on the kicking limb"):
        leg.with_supports(FOOT)


def test_the_fixed_base_stands_already():
    leg = kd.Leg.from_robot("g1")
    with pytest.raises(kd.InvalidInput, match="pelvis is fixed to the base: it stands already"):
        leg.with_supports("pelvis")


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"friction": -0.1}, f"friction under {FOOT} is -0.1"),
        ({"friction": np.nan}, f"friction under {FOOT} is nan"),
        ({"sole": [(0, 0, 0), (1, 0, 0)]}, r"has shape \(2, 3\): it must be \(k, 3\)"),
        ({"sole": [0, 0, 0]}, r"has shape \(3,\)"),
        ({"sole": np.zeros((4, 2))}, r"has shape \(4, 2\)"),
        ({"sole": [(0, 0, np.inf)] * 3}, "sole .*finite"),
        ({"sole": np.eye(3), "point": True}, "corners of a flat foot"),
    ],
)
def test_bad_soles_are_refused(options, said):
    with pytest.raises(kd.InvalidInput, match=said):
        kd.Support(FOOT, **options)


@pytest.mark.parametrize(
    ("loops", "said"),
    [
        ((("pelvis", "tip"),), "frame 'tip' is unknown"),
        ((("torso_link", "torso_link"),), "loop torso_link - torso_link joins a body to itself"),
        (("pelvis",), "loop is 'pelvis': it must be a pair"),
        ((("pelvis",),), "it must be a pair"),
    ],
)
def test_bad_loops_are_refused(loops, said):
    with pytest.raises(kd.InvalidInput, match=said):
        G1.with_loops(*loops)


def test_an_open_loop_is_refused_with_its_gap():
    leg = G1.with_loops(("left_wrist_yaw_link", "right_wrist_yaw_link"))
    q = leg.configuration()
    hands = [
        kd.Leg.from_robot("g1", f"{side}_wrist_yaw_link", base="floating").posture(q)
        for side in ("left", "right")
    ]
    gap = np.linalg.norm(hands[0].contact_point - hands[1].contact_point)
    with pytest.raises(kd.InvalidInput, match=rf"is open by {gap:.6g} m in Posture\(g1.*closed"):
        leg.posture(q)


def test_rows_are_the_frames_velocities():
    """Against the frame's own motion, by finite differences."""
    import pinocchio as pin

    rng = np.random.default_rng(2)
    leg = G1.with_supports(FOOT, kd.Support("right_wrist_yaw_link", point=True))
    model = leg.model
    q = pin.integrate(model, pin.neutral(model), rng.uniform(-0.6, 0.6, size=leg.nv))
    v, h = rng.normal(size=leg.nv), 1e-6
    places = []
    for step in (-h, h):
        data = model.createData()
        pin.framesForwardKinematics(model, data, pin.integrate(model, q, step * v))
        places.append([data.oMf[model.getFrameId(s.frame)] for s in leg.constraints.supports])
    (foot_0, hand_0), (foot_1, hand_1) = places
    rows = leg.posture(q).constraint_projector.rows @ v
    linear = (foot_1.translation - foot_0.translation) / (2 * h)
    angular = pin.log3(foot_1.rotation @ foot_0.rotation.T) / (2 * h)
    hand = (hand_1.translation - hand_0.translation) / (2 * h)
    assert rows == pytest.approx(np.concatenate([linear, angular, hand]), abs=1e-8)


def test_nothing_is_held_twice():
    for again in (FOOT, kd.Support(FOOT, point=True)):
        with pytest.raises(kd.InvalidInput, match=f"{FOOT} is held twice"):
            G1.with_supports(FOOT, again)
    hands = ("left_rubber_hand", "right_rubber_hand")
    with pytest.raises(kd.InvalidInput, match="hand is held twice"):
        G1.with_loops(hands, hands[::-1])


def test_a_support_is_a_name_and_a_sole_has_an_area():
    for wrong, said in (
        ({"frame": 5}, "frame is 5"),
        ({"frame": FOOT, "point": "no"}, "point of .* is 'no'"),
        ({"frame": FOOT, "sole": [(0, 0, 0), (1, 1, 0), (2, 2, 0)]}, "must span an area"),
    ):
        with pytest.raises(kd.InvalidInput, match=said):
            kd.Support(**wrong)
