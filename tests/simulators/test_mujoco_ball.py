"""The code of docs/how-to/mujoco.md for a ball in MuJoCo, against `fly`, `follow` and `bounce`."""

import re
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from tolerances import agrees, closed_form

import kickdyn as kd
from kickdyn.flight.follow import bounce

mujoco = pytest.importorskip("mujoco")

PAGE = Path(__file__).resolve().parents[2] / "docs" / "how-to" / "mujoco.md"
PASTED, BALL, AIR = {}, kd.Ball(), kd.Air(wind=(1.0, -2.0, 0.5))
TURN = pin.rpy.rpyToMatrix(0.5, -1.0, 2.0)
for block in re.findall(r"(?ms)^```python\n(.*?)^```", PAGE.read_text("utf-8")):
    if "def ball_forces" in block or "field = " in block:
        exec(block.partition("\nmodel = ")[0], PASTED)


@pytest.fixture
def place():
    """Place a ball whose axes are turned; return model and state, with its forces set."""

    def placed(launch, ground):
        mujoco.set_mjcb_passive(None)  # with one, nothing compiles
        model = mujoco.MjModel.from_xml_string(PASTED["field"])
        model.pair_friction[0, :2] = ground.surface.friction
        data, quaternion = mujoco.MjData(model), pin.Quaternion(TURN)
        data.qpos[:] = [*launch.position, quaternion.w, *quaternion.coeffs()[:3]]
        data.qvel[:] = [*launch.velocity, *TURN.T @ launch.spin]
        mujoco.set_mjcb_passive(PASTED["ball_forces"](model, "ball", BALL, AIR, ground))
        return model, data

    yield placed
    mujoco.set_mjcb_passive(None)


def compare(model, data, right, launch, near=None):
    """Raise unless the ball is where it should be; Euler's method is off by h/2 times a change."""
    change = np.linalg.norm(right.velocity - launch.velocity)
    near = near or min(0.01, model.opt.timestep * change)
    assert np.linalg.norm(data.qpos[:3] - right.position) < near
    mujoco.mj_forward(model, data)
    error = np.linalg.norm(data.xmat[1].reshape(3, 3) @ data.qvel[3:] - right.spin)
    assert error < near * (1 + np.linalg.norm(launch.spin))


@pytest.mark.parametrize(("velocity", "spin"), [
    ((25, 0, 6), (0, 0, 0)), ((24, 0, 7), (0, 0, 60)), ((18, 2, 12), (0, -50, 10))])  # fmt: skip
@pytest.mark.parametrize(("method", "step", "near"), [
    ("implicitfast", 0.001, None), ("RK4", 0.002, 1e-6)])  # fmt: skip
def test_it_flies_20_m_as_fly_computes(place, velocity, spin, method, step, near):
    launch, ground = kd.BallState((0, 0, 1), velocity, spin), kd.Ground(-50.0, "turf")
    (model, data), steps = place(launch, ground), round(20 / velocity[0] / step)
    model.opt.timestep, model.opt.integrator = step, {"RK4": 1, "implicitfast": 3}[method]
    mujoco.mj_step(model, data, steps)
    compare(model, data, kd.fly(launch, BALL, AIR, ground).sample(steps * step), launch, near)


@pytest.mark.parametrize("name", ["turf", "hard-floor"])
def test_it_rolls_20_m_as_follow_computes(place, name):
    """By MuJoCo's rolling friction alone 1 to 2 % farther."""
    ground, v = kd.Ground(0.0, name), np.array([4.8, 3.6, 0.0])
    launch = kd.BallState((0, 0, BALL.radius), v, np.cross([0.0, 0.0, 1.0], v) / BALL.radius)
    course, slowing = kd.follow(launch, BALL, AIR, ground), ground.surface.rolling_deceleration
    assert course.distance > 20
    model, data = place(launch, ground)
    for duration in (0.5 * course.duration, course.duration):
        mujoco.mj_step(model, data, round((duration - data.time) / 0.001))
        compare(model, data, course.sample(min(data.time, course.duration)), launch)
    model, data = place(launch, ground)
    mujoco.set_mjcb_passive(None)
    model.pair_dim[0], model.pair_friction[0, 3:] = 6, 5 / 3 * BALL.radius * slowing / 9.81
    mujoco.mj_step(model, data, round(1.1 * 6.0 / slowing / 0.001))
    assert 1.005 < np.hypot(*data.qpos[:2]) * 2 * slowing / 6.0**2 < 1.02


@pytest.mark.parametrize("fall", [5, -5])
def test_it_bounces_as_bounce_computes(place, fall):
    ground = kd.Ground(1.0, "turf")
    before = kd.BallState((0, 0, 1.0 + BALL.radius - 1e-3), (9, -2, -fall), (7, -30, 10))
    model, data = place(before, ground)
    PASTED["bounce_ball"](model, data, "ball", BALL, ground)
    after = bounce(before, BALL, ground.surface) if fall > 0 else before
    agrees(data.qvel[:3], after.velocity, closed_form())
    agrees(TURN @ data.qvel[3:], after.spin, closed_form(10))
    assert data.qpos[2] == pytest.approx(1.0 + BALL.radius, abs=2e-3)
