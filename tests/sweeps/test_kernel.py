"""The kernel has the answers of `kick_from`, or marks a posture as doubtful."""

import itertools

import numpy as np
import pinocchio as pin
import pytest
from chains import floating_leg, random_leg
from tolerances import closed_form

import kickdyn as kd
from kickdyn.sweeps import kernel
from kickdyn.sweeps.dataset import VARIABLES, variables_of
from kickdyn.sweeps.grid import Grid
from kickdyn.sweeps.kernel import Kernel, KernelModel, fill_variables
from kickdyn.sweeps.sweep_kick import Kick, kick_from

LEG = kd.Leg.human()


def answers(leg, kick, axes, first=0, count=None):
    model, grid = KernelModel.of(leg, kick), Grid(axes)
    count = grid.size if count is None else count
    both = [Kernel(model, leg, grid, machine_code=x)(first, count) for x in (False, True)]
    np.testing.assert_array_equal(*both)  # to the last bit, nan included
    return model, both[0]


def agree(leg, kick, axes, condition=100.0):
    """Compare all variables but the carry with `kick_from`; return how many stick, slip, doubt."""
    model, computed = answers(leg, kick, axes)
    rows, status = np.zeros((len(VARIABLES), computed.shape[1])), np.zeros(computed.shape[1], "i1")
    doubtful = fill_variables(computed, model, rows, status)
    counts = {"sticks": 0, "slips": 0, "doubt": int(doubtful.sum())}
    for number in np.flatnonzero(~doubtful).tolist():
        outcome = kick_from(leg.posture(Grid(axes).configuration(leg, number)), kick)
        right = variables_of(outcome, kick)
        del right["carry"]
        row = {name: rows[k, number] for k, name in enumerate(VARIABLES) if name != "carry"}
        for name in ("restitution_residual", "momentum_residual"):
            assert row.pop(name) < closed_form(100), (name, right.pop(name), number)
            right.pop(name)
        close = {"rel": closed_form(condition), "abs": closed_form() * right["impulse"]}
        assert row == pytest.approx(right, **close), number
        assert status[number] == outcome.status.flag
        impulse = model.axes @ computed[: kernel.NORMAL + 1, number]
        assert impulse == pytest.approx(outcome.impact.impulse, **close), number
        counts["sticks" if outcome.impact.sticking else "slips"] += 1
    return model.planar, counts


@pytest.mark.parametrize("friction", [0.0, 0.05, 0.4])
def test_planar_motion_is_kick_from(friction):
    axes = {name: np.radians([3.0, 20.0, 47.0]) for name in LEG.joint_names}
    planar, counts = agree(LEG, Kick(speed=2.0, restitution=0.7, friction=friction), axes)
    assert (planar, counts["doubt"]) == (True, 0)
    assert counts["slips" if friction < 0.1 else "sticks"] > 0


@pytest.mark.parametrize(("seed", "friction"), [
    (0, 0.15), (1, 0.15), (3, 0.15), (4, 0.6), (6, 0.0), (8, 1e-10)])  # fmt: skip
def test_motion_in_space_is_kick_from(seed, friction):
    rng = np.random.default_rng(seed)
    leg = random_leg(rng, joints=3 + seed % 5)
    model = leg.model
    model.armature = np.linspace(0.01, 0.05, leg.nv)
    model.velocityLimit = np.linspace(4.0, 9.0, leg.nv)
    model.velocityLimit[1] = {0: np.inf, 1: 1e9, 3: 1e20}.get(seed, 5.0)
    model.velocityLimit[2] = 6.0 if seed else np.inf  # one of the three joints has a limit
    leg = kd.Leg.from_model(model, "toe")
    axes = {name: rng.uniform(-2, 2, 2) for name in leg.joint_names[:4]}
    kick = Kick(speed=rng.uniform(0.5, 9), restitution=rng.uniform(0, 1), friction=friction)
    planar, counts = agree(leg, kick, axes, condition=1e3)
    assert not planar
    assert counts["doubt"] <= 1
    assert counts["sticks"] == 0 or friction > 0.1


def test_branches_slides_and_rotors_count():
    model, here = pin.Model(), pin.SE3.Identity()
    body = pin.Inertia(2.0, np.array([0.1, 0.0, -0.2]), 0.05 * np.eye(3))
    turn, slide = pin.JointModelRY(), pin.JointModelPX()
    for name, parent, kind, x in (("hip", 0, turn, 3.0), ("side", 1, slide, 0.1),
                                  ("arm", 2, turn, 0.2), ("knee", 1, turn, 0.1),
                                  ("stretch", 4, slide, 0.2)):  # fmt: skip
        place = pin.SE3(here.rotation, np.array([x, 0.1, -0.4]))
        model.appendBodyToJoint(model.addJoint(parent, kind, place, name), body, here)
    tip = pin.SE3(here.rotation, np.array([0.1, 0.0, -0.3]))
    model.addFrame(pin.Frame("toe", 5, 0, tip, pin.FrameType.OP_FRAME))
    model.armature, model.velocityLimit = np.linspace(0.01, 0.05, 5), np.linspace(3.0, 9.0, 5)
    leg = kd.Leg.from_model(model, "toe")
    planar, counts = agree(
        leg, Kick(attack=0.2, friction=0.1), {n: np.array([0.1, 0.6]) for n in leg.joint_names}
    )
    assert (planar, counts["doubt"]) == (True, 0)


@pytest.mark.parametrize("planar", [True, False])
def test_the_base_may_move(planar):
    leg, axes = LEG, {"hip": np.array([-0.4, 0.9]), "knee": np.array([0.2, 0.9])}
    motion = ((3, 0, 0.5), (0, -1, 0)) if planar else ((1.0, 0.2, -0.1), (0.3, -1.0, 0.5))
    if not planar:
        leg = kd.Leg.from_robot("g1", base="fixed", legs_only=True)
        axes = {name: np.array([0.02, 0.2]) for name in leg.joint_names[-6:-3]}
    result, counts = agree(leg.with_base_velocity(*motion), Kick(speed=9.0), axes, condition=1e4)
    assert (result, counts["doubt"]) == (planar, 0)


@pytest.mark.parametrize("leg", [
    floating_leg(np.random.default_rng(1)),
    LEG.with_base_velocity((3, 0.1, 0)), LEG.with_base_velocity((3, 0, 0), (0.1, 0, 0)),
], ids=["floating", "base leaves the plane", "base turns out of the plane"])  # fmt: skip
def test_a_leg_that_the_kernel_does_not_serve_has_no_model(leg):
    assert KernelModel.of(leg, Kick()) is None


@pytest.mark.parametrize("shape", [(3, 7, 13), (2, 2, 40), (5, 41, 1), (1, 1, 80)])
def test_postures_are_those_of_the_grid_wherever_a_range_begins(shape):
    rng, kick = np.random.default_rng(0), Kick()
    axes = {n: rng.uniform(-0.5, 0.7, k) for n, k in zip(LEG.joint_names, shape, strict=True)}
    alone = [
        answers(LEG, kick, {n: np.array([q]) for n, q in zip(axes, values, strict=True)})[1][:, 0]
        for values in itertools.product(*axes.values())
    ]
    size = len(alone)
    for first, count in ((0, size), (1, 32), (size // 2 + 3, 33), (size - 1, 1), (17, 50)):
        swept = answers(LEG, kick, axes, first, count)[1]
        assert np.array_equal(swept, np.transpose(alone[first : first + count])), (first, count)
