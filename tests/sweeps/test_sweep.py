"""Every posture of a sweep is a strike and a flight, by kernel or one by one."""

import math
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from chains import constraint_speed, fourbar
from tolerances import closed_form, integrated

import kickdyn as kd
from kickdyn.sweeps.dataset import VARIABLES
from kickdyn.sweeps.kernel import KernelModel
from kickdyn.sweeps.queries import outcome_at
from kickdyn.sweeps.sweep_kick import PostureStatus, kick_from

LEG = kd.Leg.human()
KICK = kd.Kick(attack=0.0)
POSTURES = {"hip": [0.0, 0.7, 1.4], "knee": [0.0, 0.3], "ankle": [0.0, 0.8]}


def test_variables_are_those_of_strike_and_fly():
    cell = kd.sweep(LEG, POSTURES, KICK).isel(hip=1, knee=1, ankle=0)
    posture, n = LEG.posture([0.7, 0.3, 0.0]), np.array([1.0, 0.0, 0.0])
    hit = kd.strike(posture, posture.joint_velocity(n), kd.Ball(), kd.Contact(n, 0.8, 0.4))
    v = hit.ball_after.velocity
    mass, speed = posture.effective_mass(n), np.linalg.norm(v)
    right = {  # (1 + e) m v, and the ratio to a foot at 1 m/s
        "effective_mass": mass, "impulse": np.linalg.norm(hit.impulse),
        "immovable_impulse": 1.8 * mass, "ball_speed": speed, "speed_ratio": speed,
        "launch_angle": math.asin(v[2] / speed), "back_spin": -hit.ball_after.spin[1],
        "worst_joint_impulse": np.linalg.norm(hit.joint_impulses[:, :3], axis=1).max(),
        "energy_lost": hit.energy_lost,
    }  # fmt: skip
    row = {name: float(cell[name]) for name in right}
    assert row == pytest.approx(right, rel=closed_form(100), abs=closed_form())
    carry = kd.fly(hit.ball_after, kd.Ball(), kd.Air(), tol=1e-12).range
    assert float(cell.carry) == pytest.approx(carry, rel=integrated(1e-11, 1000))
    down = kd.sweep(LEG, {"knee": 0.2}, kd.Kick(attack=math.radians(-40)))
    assert float(down.carry[0]) == 0.0


@pytest.mark.parametrize("samples", [None, "list"])
def test_the_kernel_agrees_with_single_kicks(samples, monkeypatch):
    kick = kd.Kick(attack=0.0, speed=9.0)
    postures = {"hip": np.linspace(-0.3, 1.7, 5), "knee": np.linspace(0, 2.2, 5),
                "ankle": np.linspace(-0.3, 0.8, 5)}  # fmt: skip
    with monkeypatch.context() as patch:
        patch.setattr(KernelModel, "of", lambda *_: None)
        single = kd.sweep(LEG, postures, kick, samples=samples)
    compiled = kd.sweep(LEG, postures, kick, samples=samples, tolerance=0, threads=2)
    assert samples or set(np.unique(single.status)) == {0, 1}
    for name in {*VARIABLES, "status"} - {"restitution_residual", "momentum_residual"}:
        rough = integrated(1e-11, 1000) if name == "carry" else closed_form(100)
        close = {"rel": rough, "abs": closed_form(10)}
        assert compiled[name].values == pytest.approx(single[name].values, **close), name


def test_variables_are_nan_only_out_of_reach():
    model = LEG.model
    model.upperPositionLimit = np.array([2.0, 2.0, 2.0])
    leg = kd.Leg.from_model(model, "toe")
    postures = {"hip": math.pi / 2, "knee": 0.0, "ankle": [1.4, math.pi / 2]}
    data = kd.sweep(leg, postures, kd.Kick(attack=0, speed=0.1))
    assert data.status.values.ravel().tolist() == [0, 2]
    for name in VARIABLES:
        assert np.isnan(data[name].values.ravel()).tolist() == [False, True], name


@pytest.mark.parametrize(("change", "word"), [
    ({"leg": "human"}, r"leg is 'human'.*kickdyn\.Leg"), ({"tolerance": -1.0}, "tolerance is -1"),
    ({"threads": 2, "executor": ThreadPoolExecutor(1)}, "threads and executor"),
    ({"resume": True}, "store"), ({"executor": ThreadPoolExecutor(1)}, "store"),
    ({"postures": dict.fromkeys(("hip", "knee"), np.linspace(0, 1, 1001))}, "1,002,001.*store"),
    ({"variables": ["ball_sped"]}, "'ball_sped'.*'ball_speed'"),
    ({"variables": []}, r"variables is \[\]"),
], ids=lambda value: ", ".join(value) if isinstance(value, dict) else value)  # fmt: skip
def test_bad_arguments_are_refused_in_one_line(change, word):
    arguments = {"leg": LEG, "postures": {"hip": 0.1}, "kick": KICK, **change}
    with pytest.raises(kd.InvalidInput, match=word):
        kd.sweep(**arguments)


def test_loops_and_supports_hold_in_every_posture():
    robot = kd.Leg.from_robot("bolt", base="floating").with_supports("FL_FOOT")
    kick, closed = kd.Kick(air=None), 0
    for model, joints in ((fourbar(), {"rocker_a": [0.2, 0.41], "hip": [0.0, 0.5]}),
                          (robot, {"FR_KFE": [0.0, 0.6], "FR_HFE": [0.3]})):  # fmt: skip
        data = kd.sweep(model, joints, kick)
        for index in np.ndindex(*data.status.shape):
            cell = data.isel(dict(zip(joints, index, strict=True)))
            if cell.status == PostureStatus.NOT_CLOSED.flag:
                assert float(cell.rocker_a) == 0.41
                assert np.isnan([float(cell[name]) for name in VARIABLES]).all()
                continue
            closed += 1
            named = {name: float(cell[name]) for name in joints}
            posture = model.posture(model.close_loops(model.configuration(named), keep=named))
            impact = kick_from(posture, kick).impact
            assert float(cell.ball_speed) == pytest.approx(impact.ball_after.speed)
            assert constraint_speed(impact) <= closed_form(1e3)
            again = outcome_at(model, kick, cell).impact
            assert again.ball_after.speed == pytest.approx(impact.ball_after.speed)
    assert closed == 4
