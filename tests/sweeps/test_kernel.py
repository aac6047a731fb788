import itertools

import numpy as np
import pinocchio as pin
import pytest
from chains import floating_leg, in_units, random_leg, slides
from extremes.extreme_impacts import chain
from hypothesis import given, settings
from hypothesis import strategies as st

import kickdyn as kd
from kickdyn.sweeps import kernel
from kickdyn.sweeps.dataset import VARIABLES
from kickdyn.sweeps.grid import Grid
from kickdyn.sweeps.kernel import (
    ACROSS,
    DOUBT,
    LOST,
    MOBILITY,
    MOMENTUM,
    NORMAL,
    RESTITUTION,
    ROWS,
    TANGENT,
    USE,
    WORST,
    Kernel,
    KernelModel,
    fill_variables,
)
from kickdyn.sweeps.sweep_kick import Kick, kick_from

LEG = kd.Leg.human()


def answers(leg, kick, axes, first=0, count=None):
    model, grid = KernelModel.of(leg, kick), Grid(axes)
    return model, Kernel(model, leg, grid)(first, grid.size if count is None else count)


def agree(leg, kick, axes, speeds=1e-12):
    """Hold every posture against `kick_from`; return how many stick, slip and are in doubt.

    Joint speeds are compared to `speeds`.
    """
    model, found = answers(leg, kick, axes)
    seen = {"sticks": 0, "slips": 0, "doubt": 0}
    for number, answer in enumerate(found.T):
        if answer[DOUBT]:
            seen["doubt"] += 1
            continue
        outcome = kick_from(leg.posture(Grid(axes).configuration(leg, number)), kick)
        impact = outcome.impact
        size = np.linalg.norm(impact.impulse)
        assert np.linalg.norm(model.axes @ answer[: NORMAL + 1] - impact.impulse) < 1e-12 * size
        assert 1 / answer[MOBILITY] == pytest.approx(impact.effective_mass, rel=1e-12)
        assert answer[LOST] == pytest.approx(impact.energy_lost, rel=1e-12, abs=1e-13 * size)
        assert answer[USE] == pytest.approx(outcome.speed_use, rel=speeds)
        assert answer[WORST] == pytest.approx(impact.worst_joint[1], rel=1e-12)
        assert answer[RESTITUTION] < 1e-12
        assert answer[MOMENTUM] < 1e-12
        seen["sticks" if impact.sticking else "slips"] += 1
    return model.planar, seen


@pytest.mark.parametrize("friction", [0.0, 0.05, 0.4])
def test_planar_motion_is_kick_from(friction):
    axes = {name: np.radians([3.0, 20.0, 47.0, 61.0]) for name in LEG.joint_names}
    planar, seen = agree(LEG, Kick(speed=2.0, restitution=0.7, friction=friction), axes)
    assert planar
    assert seen["doubt"] == 0
    assert seen["slips"] > 0 if friction < 0.1 else seen["sticks"] > 0


@pytest.mark.parametrize("seed", range(8))
def test_motion_in_space_is_kick_from(seed):
    rng = np.random.default_rng(seed)
    leg = random_leg(rng, joints=3 + seed % 5)
    model = leg.model
    model.armature = np.linspace(0.01, 0.05, leg.nv)
    model.velocityLimit = np.linspace(4.0, 9.0, leg.nv) if seed else np.array([5.0, np.inf, 9.0])
    leg = kd.Leg.from_model(model, "toe")
    axes = {name: rng.uniform(-2, 2, 2) for name in leg.joint_names[:4]}
    kick = Kick(speed=rng.uniform(0.5, 9), restitution=rng.uniform(0, 1), friction=0.15)
    planar, seen = agree(leg, kick, axes)
    assert not planar
    assert seen["doubt"] <= 1


@pytest.mark.parametrize("friction", [1e-6, 1e-10, 1e-14, 1e-18, 1e-300])
def test_the_slightest_friction_is_a_slip_against_the_sliding(friction):
    leg = random_leg(np.random.default_rng(3), joints=4)
    axes = {name: np.array([-1.3, 0.4]) for name in leg.joint_names}
    _, seen = agree(leg, Kick(speed=2.0, friction=friction), axes)
    assert seen == {"sticks": 0, "slips": 16, "doubt": 0}


@pytest.mark.parametrize("friction", [0.15, 1.0])
@pytest.mark.parametrize(("last", "doubt"), [(1e-2, 0.0), (1e-4, 0.5), (1e-6, 1.0), (1e-8, 1.0)])
def test_short_light_feet_keep_their_digits_or_are_marked(last, doubt, friction):
    kick = Kick(speed=3.0, attack=0.5, restitution=0.6, friction=friction)
    rods = chain((0.4, 0.4, 0.3 * last), (2.0, 2.0, last))
    for leg, each in ((rods, 4), (random_leg(np.random.default_rng(0), 5, last=last), 2)):
        axes = {name: np.linspace(-1.5, 1.4, each) for name in leg.joint_names}
        planar, seen = agree(leg, kick, axes, speeds=1e-11)
        assert planar is (leg is rods)
        assert seen["doubt"] <= doubt * sum(seen.values())
        assert last > 1e-7 or seen["doubt"] > 0.8 * sum(seen.values())


@pytest.mark.parametrize("size", [(0.1, 1.0, 1.0), (1.0, 0.1, 1.0), (0.01, 1.0, 0.01)])
def test_short_links_before_long_ones_keep_their_digits_or_are_marked(size):
    leg, kick = chain(size, size), Kick(speed=3.0, attack=0.5, restitution=0.6, friction=0.15)
    axes = {name: np.linspace(-1.2, 1.3, 6) for name in leg.joint_names}
    _, seen = agree(leg, kick, axes, speeds=1e-11)
    assert seen["slips"] + seen["sticks"] > 0
    assert seen["doubt"] > 20 if min(size) < 0.1 else seen["doubt"] < 20


def test_branches_slides_and_rotors_count():
    model, here = pin.Model(), pin.SE3.Identity()
    body = pin.Inertia(2.0, np.array([0.1, 0.0, -0.2]), 0.05 * np.eye(3))
    turn, slide = pin.JointModelRY(), pin.JointModelPX()
    for name, parent, kind, x in (
        ("hip", 0, turn, 3.0), ("side", 1, slide, 0.1), ("arm", 2, turn, 0.2),
        ("knee", 1, turn, 0.1), ("stretch", 4, slide, 0.2),
    ):  # fmt: skip
        place = pin.SE3(here.rotation, np.array([x, 0.1, -0.4]))
        joint = model.addJoint(parent, kind, place, name)
        model.appendBodyToJoint(joint, body, here)
    tip = pin.SE3(here.rotation, np.array([0.1, 0.0, -0.3]))
    model.addFrame(pin.Frame("toe", 5, 0, tip, pin.FrameType.OP_FRAME))
    model.armature = np.linspace(0.01, 0.05, 5)
    model.velocityLimit = np.linspace(3.0, 9.0, 5)
    leg = kd.Leg.from_model(model, "toe")
    axes = {name: np.array([0.1, 0.35, 0.6]) for name in leg.joint_names}
    kick = Kick(attack=0.2, friction=0.1)
    planar, seen = agree(leg, kick, axes)
    assert planar
    assert seen["doubt"] == 0
    assert agree(kd.Leg.from_robot("g1", legs_only=True), kick, {
        "right_hip_pitch_joint": np.array([-0.7, 0.2]), "right_knee_joint": np.array([0.3, 0.9]),
        "left_hip_roll_joint": np.array([0.1, 0.2])})[0] is False  # fmt: skip


@pytest.mark.parametrize("most", [1e4, 1e9, 1e16, 1e20, np.inf])
def test_a_limit_beyond_all_others(most):
    for leg, planar in ((kd.Leg.human(), True), (random_leg(np.random.default_rng(1), 5), False)):
        model = leg.model
        model.velocityLimit = np.linspace(4.0, 9.0, leg.nv)
        model.velocityLimit[1] = most
        fast = kd.Leg.from_model(model, leg.frame)
        axes = {name: np.array([0.3, 0.6, 1.1]) for name in leg.joint_names[:4]}
        assert agree(fast, Kick(speed=5.0), axes, speeds=1e-10)[0] is planar


def test_a_single_joint_is_swept_one_by_one():
    model = pin.Model()
    hip = model.addJoint(0, pin.JointModelRY(), pin.SE3.Identity(), "hip")
    body = pin.Inertia(2.0, np.array([0.0, 0.0, -0.3]), 0.05 * np.eye(3))
    model.appendBodyToJoint(hip, body, pin.SE3.Identity())
    tip = pin.SE3(np.eye(3), np.array([0.0, 0.0, -0.8]))
    model.addFrame(pin.Frame("toe", hip, 0, tip, pin.FrameType.OP_FRAME))
    leg = kd.Leg.from_model(model, "toe")
    found = answers(leg, Kick(attack=0.0), {"hip": np.array([0.0, 0.3])})[1]
    assert found[DOUBT].all()
    assert kick_from(leg.posture([0.0]), Kick(attack=0.0)).status == "ok"


def test_what_cannot_be_vouched_for_is_marked():
    axes = {"hip": np.radians([90.0]), "knee": np.zeros(1), "ankle": np.radians([40.0, 90.0])}
    assert answers(LEG, Kick(attack=0.0), axes)[1][DOUBT].tolist() == [0, 1]


powers = st.integers(-8, 8)


@pytest.mark.parametrize("planar", [True, False])
@given(seed=st.integers(0, 10**6), metre=powers, half=powers, second=powers)
@settings(max_examples=15, derandomize=True, deadline=None)
def test_powers_of_two_of_the_units_change_no_bit(planar, seed, metre, half, second):
    """Of the kilogram powers of four, for roots of masses are taken.

    The residual of momentum of hinges and slides together is relative to a norm of both.
    """
    rng = np.random.default_rng(seed)
    leg = LEG if planar else random_leg(rng, joints=int(rng.integers(3, 7)))
    axes = {name: rng.uniform(-1.5, 1.5, 2) for name in leg.joint_names[:4]}
    limits, speed = rng.uniform(2.0, 20.0, leg.nv), rng.uniform(0.5, 9.0)
    contact = {"attack": 0.4, "restitution": 0.6, "friction": rng.choice([0.0, 0.1, 0.5])}
    m, kg, s, sliding = 2.0**metre, 4.0**half, 2.0**second, slides(leg)

    def found(metre, kilogram, second):
        model = in_units(leg, metre, kilogram).model
        model.velocityLimit = limits * metre**sliding / second
        ball = kd.Ball(0.43 * kilogram, 0.11 * metre)
        kick = Kick(speed=speed * metre / second, ball=ball, **contact)
        joints = dict(zip(leg.joint_names, metre**sliding, strict=True))
        values = {name: joints[name] * each for name, each in axes.items()}
        return answers(kd.Leg.from_model(model, leg.frame), kick, values)

    model, one = found(1.0, 1.0, 1.0)
    assert model.planar is planar
    assert np.isfinite(one).all()
    units = np.ones(ROWS)
    units[[TANGENT, ACROSS, NORMAL, WORST]] = kg * m / s
    units[MOBILITY], units[LOST] = 1 / kg, kg * m**2 / s**2
    same = slice(MOMENTUM) if sliding.any() else slice(ROWS)
    assert found(m, kg, s)[1][same].tolist() == (one * units[:, None])[same].tolist()


def test_a_range_of_postures_is_a_part_of_the_whole():
    axes = {name: np.linspace(0.1, 0.9, k) for name, k in (("hip", 7), ("knee", 5), ("ankle", 3))}
    whole = answers(LEG, Kick(), axes)[1]
    assert (answers(LEG, Kick(), axes, first=37, count=50)[1] == whole[:, 37:87]).all()


def test_only_fixed_trees_of_hinges_and_slides_have_a_kernel():
    assert KernelModel.of(floating_leg(np.random.default_rng(1)), Kick()) is None
    assert KernelModel.of(kd.Leg.from_robot("bolt", base="floating"), Kick()) is None


def test_what_is_not_finite_is_doubtful():
    model = KernelModel.of(LEG, Kick(restitution=0.5))
    found = np.ones((10, 12))
    found[DOUBT] = 0.0
    for row in range(10):
        found[row, row] = np.inf if row % 2 else np.nan
    found[USE, 11] = 2.0
    rows, status = np.zeros((13, 12)), np.zeros(12, np.int8)
    doubtful = fill_variables(found, model, rows, status)
    assert doubtful.tolist() == [True] * 10 + [False] * 2
    assert status[10:].tolist() == [0, 1]
    values = dict(zip(VARIABLES, rows[:, 10], strict=True))
    ball = Kick().ball
    assert values["effective_mass"] == values["energy_lost"] == values["speed_use"] == 1.0
    assert values["impulse"] == pytest.approx(3**0.5)
    assert values["immovable_impulse"] == pytest.approx(1.5)
    assert values["ball_speed"] == values["speed_ratio"] == pytest.approx(3**0.5 / ball.mass)
    assert values["worst_joint_impulse"] == values["momentum_residual"] == 1.0


def test_a_variable_that_the_kernel_does_not_fill_in_ends_the_sweep(monkeypatch):
    monkeypatch.setattr(kernel, "VARIABLES", {**VARIABLES, "added": ("1", "added later")})
    model, answer, rows = (
        KernelModel.of(LEG, Kick()),
        np.ones((ROWS, 2)),
        np.full((len(VARIABLES) + 1, 2), np.nan),
    )
    with pytest.raises(KeyError, match="added"):
        fill_variables(answer, model, rows, np.zeros(2, np.int8))


@pytest.mark.parametrize("shape", [(3, 7, 13), (2, 2, 40), (5, 41, 1), (4, 1, 33), (1, 1, 80)])
def test_postures_are_those_of_the_grid_wherever_a_range_begins(shape):
    rng = np.random.default_rng(0)
    axes = {n: rng.uniform(-0.5, 0.7, k) for n, k in zip(LEG.joint_names, shape, strict=True)}
    model, kick = KernelModel.of(LEG, Kick()), Kick()
    alone = [
        answers(LEG, kick, {n: np.array([q]) for n, q in zip(axes, values, strict=True)})[1][:, 0]
        for values in itertools.product(*axes.values())
    ]
    swept, size = Kernel(model, LEG, Grid(axes)), len(alone)
    for first, count in ((0, size), (1, 32), (size // 2 + 3, 33), (size - 1, 1), (17, 50)):
        assert np.array_equal(swept(first, count), np.transpose(alone[first : first + count]))


def test_a_base_that_moves():
    swept = {"hip": [-0.4, 0.3, 0.9], "knee": [0.2, 0.9], "ankle": [-0.2, 0.4]}
    axes = {name: np.array(values) for name, values in swept.items()}
    kick = Kick(speed=9.0)
    assert agree(LEG.with_base_velocity((3, 0, 0.5), (0, -1, 0)), kick, axes)[0]
    g1 = kd.Leg.from_robot("g1", base="fixed", legs_only=True)
    moving = g1.with_base_velocity((1.0, 0.2, -0.1), (0.3, -1.0, 0.5))
    axes = {name: np.array([0.02, 0.2]) for name in g1.joint_names[-6:-1]}
    planar, seen = agree(moving, kick, axes, speeds=1e-11)
    assert not planar
    assert seen["doubt"] == 0
    # a foot that moves in a plane cannot make up for a base that leaves it
    assert KernelModel.of(LEG.with_base_velocity((3, 0.1, 0)), kick) is None
    assert KernelModel.of(LEG.with_base_velocity((3, 0, 0), (0.1, 0, 0)), kick) is None
