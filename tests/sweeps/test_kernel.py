"""Kernels of a sweep have the answers of `kick_from`, or mark a posture as doubtful."""

import itertools

import numpy as np
import pinocchio as pin
import pytest
from chains import floating_leg, random_leg
from extremes.extreme_impacts import chain
from tolerances import closed_form

import kickdyn as kd
from kickdyn.flight.batch import fly_many
from kickdyn.sweeps import chunk_solver, kernel
from kickdyn.sweeps.chunk_solver import CarryTable, ChunkSolver, launches
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
    axes = {name: np.array([0.1, 0.6]) for name in leg.joint_names}
    planar, counts = agree(leg, Kick(attack=0.2, friction=0.1), axes)
    assert (planar, counts["doubt"]) == (True, 0)


def test_a_joint_whose_axis_passes_through_the_contact_point_does_not_move_it():
    leg = kd.Leg.human(height=1.8, mass=75.0, model="3d")  # its subtalar joint, without a limit
    axes = dict.fromkeys(("hip", "hip_adduction", "hip_rotation"), np.array([-0.3, 0.2]))
    assert agree(leg, Kick(speed=9.0), axes, 1e4) == (False, {"sticks": 8, "slips": 0, "doubt": 0})


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


CARRY = list(VARIABLES).index("carry")
SLOW = Kick(speed=3.0, attack=0.5, restitution=0.6, friction=0.15, air=None)


def solved(leg, grid, kick=SLOW, tolerance=0.0):
    solver = ChunkSolver(leg, grid, kick, tolerance)
    solver.prepare()
    return solver(0, grid.size)


@pytest.mark.parametrize("planar", [True, False])
def test_doubtful_postures_of_short_light_feet_are_kick_from(planar):
    rods = chain((0.4, 0.4, 3e-6), (2.0, 2.0, 1e-5))
    leg = rods if planar else random_leg(np.random.default_rng(3), 5, last=1e-5)
    grid = Grid({name: np.array([-1.5, 0.3]) for name in leg.joint_names})
    rows, status = solved(leg, grid)
    for i in range(0, grid.size, 3):
        outcome = kick_from(leg.posture(grid.configuration(leg, i)), SLOW)
        assert status[i] == outcome.status.flag
        right = np.array(list(variables_of(outcome, SLOW).values()))
        close = {"rel": closed_form(1e3), "abs": closed_form(10), "nan_ok": True}
        assert rows[:, i] == pytest.approx(right, **close), i


def test_blocks_of_a_grid_are_parts_of_the_whole(monkeypatch):
    names = ("hip", "knee", "ankle")
    grid = Grid({name: np.linspace(-0.4, 0.9, n) for name, n in zip(names, (5, 3, 3), strict=True)})
    rows, status = solved(LEG, grid)
    monkeypatch.setattr(chunk_solver, "BLOCK", 16)
    solver = ChunkSolver(LEG, grid, SLOW)
    solver.prepare()
    for first, count in ((0, 45), (7, 33)):
        part, flags = solver(first, count)
        right = rows[:, first : first + count]
        assert part == pytest.approx(right, rel=closed_form(1e4), abs=closed_form(10), nan_ok=True)
        assert flags.tolist() == status[first : first + count].tolist()


def test_interpolation_changes_carries_only_and_within_the_tolerance():
    kick = Kick(speed=14.0)
    axes = {"hip": np.linspace(-0.2, 1.4, 15), "knee": np.linspace(0, 2.2, 25), "ankle": [0, 0.5]}
    grid = Grid({name: np.asarray(values) for name, values in axes.items()})
    difference = np.abs(solved(LEG, grid, kick)[0] - solved(LEG, grid, kick, 1e-5)[0]).max(axis=1)
    assert 0 < difference[CARRY] <= 1e-5
    assert not np.delete(difference, CARRY).any()


@pytest.mark.parametrize(("speed", "attack", "friction", "tolerance"), [
    (1.0, 30.0, 0.4, 1e-8), (12.0, 30.0, 0.4, 1e-6), (18.0, 10.0, 0.4, 1e-4),
    (9.0, 0.0, 0.2, 1e-6)])  # fmt: skip
def test_carries_are_within_their_tolerance(speed, attack, friction, tolerance):
    kick = Kick(speed=speed, attack=np.radians(attack), friction=friction)
    model, draw, n = KernelModel.of(LEG, kick), np.random.default_rng(3), 2000
    normal = 1.8 * speed * kick.ball.mass * draw.uniform(0, 1, n)  # (1 + e) m v
    tangent = friction * normal * draw.uniform(-1, 1, n)
    carry = np.full(n, np.nan)
    to_fly = CarryTable(model, tolerance)(normal, tangent, carry)
    balls = launches(model, np.column_stack([tangent, np.zeros(n), normal]))
    flown = fly_many(balls, kick.ball, kick.air, tol=1e-11).range.values
    assert to_fly.mean() < 0.01
    assert np.abs(carry - flown)[~to_fly].max() <= tolerance
    assert np.isnan(carry[to_fly]).all()


def test_impulses_outside_the_table_are_to_be_flown():
    """Above (1 + e) m v, beyond the friction, 0, or not finite."""
    kick = Kick(speed=3.0)
    most = 1.8 * 3.0 * kick.ball.mass
    normal = np.array([0.99 * most, 1.01 * most, 0.5 * most, 0.5 * most, 0.0, np.nan])
    tangent = np.array([0.0, 0.0, 0.39, 0.41, 0.0, 0.0]) * 0.5 * most
    to_fly = CarryTable(KernelModel.of(LEG, kick), 1e-3)(normal, tangent, np.full(6, np.nan))
    assert to_fly.tolist() == [False, True, False, True, True, True]
