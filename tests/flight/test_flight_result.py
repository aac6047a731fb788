"""What a flight answers once flown: arrival at x, orientation."""

import math
import pickle

import numpy as np
import pytest
from flight_methods import LANDINGS, kicks

import kickdyn as kd
from kickdyn.aerodynamics import drag as drag_models
from kickdyn.aerodynamics.drag import constant
from kickdyn.flight import integrate

BALL = kd.Ball()


def launch(velocity, spin=(0, 0, 0), at=(0, 0, 0)):
    return kd.BallState(at, velocity, spin)


# --- arrival ------------------------------------------------------------------------------------


def test_arrival_is_on_the_path():
    path = kd.fly(launch((25, 3, 10), (0, -20, 10)), BALL, kd.Air(), tol=1e-12)
    there = path.arrival(20.0)
    assert there.position[0] == pytest.approx(20.0, abs=1e-12)
    assert there.position == pytest.approx(path.sample(there.time).position, abs=1e-7)
    assert path.arrival(path.landing.position[0] + 1) is None
    by_a_hair = path.landing.position[0] * (1 + 1e-11)  # the ground comes first
    assert path.arrival(by_a_hair).position == pytest.approx(path.landing.position, abs=1e-8)
    assert path.arrival(-1.0) is None
    assert path.arrival(0.0).time == 0.0


def test_arrival_in_a_vacuum_is_the_formula():
    vacuum = kd.fly(launch((10, 0, 10)), BALL)
    assert vacuum.arrival(5.0).position[2] == pytest.approx(5 - 9.81 / 8, rel=1e-14)


@pytest.mark.parametrize("tol", [1e-4, 1e-6, 1e-9])
def test_arrival_is_as_exact_as_a_landing(tol):
    state = launch((25, 3, 10), (5, -20, 10))
    path = kd.fly(state, BALL, kd.Air(), tol=tol)
    exact = kd.fly(state, BALL, kd.Air(), tol=1e-13)
    for x in (10.0, 20.0, 30.0):
        apart = np.linalg.norm(path.arrival(x).position - exact.arrival(x).position)
        assert apart <= 30 * tol * x


def test_a_ball_blown_back_arrives_from_either_side():
    gale = kd.Air(wind=(-40, 0, 0))
    path = kd.fly(launch((8, 0, 20)), BALL, gale, tol=1e-10)
    x = path.sample(np.linspace(0, path.duration, 4001)).position[:, 0]
    assert path.landing.position[0] < -5
    assert path.arrival(x.max() - 1e-3).velocity[0] > 0
    assert path.arrival(x.max() + 1e-3) is None
    assert path.arrival(-3.0).velocity[0] < 0


def test_no_arrival_after_the_end():
    path = kd.fly(launch((25, 0, 10)), BALL, kd.Air(), plane=kd.Plane((10, 0, 0), (-1, 0, 0)))
    assert path.arrival(9.5) is not None
    assert path.arrival(10.5) is None
    cut = kd.fly(launch((25, 0, 10)), BALL, kd.Air(), time_limit=0.2)
    assert cut.arrival(4.0) is not None
    assert cut.arrival(6.0) is None


# --- orientation --------------------------------------------------------------------------------

AIRS = {"vacuum": None, "no torque": kd.Air(torque=None), "air": kd.Air()}


@pytest.mark.parametrize("name", ["vacuum", "no torque"])
@pytest.mark.parametrize("spin", [(0, 0, 0), (0, -40, 0), (10, -40, 25)])
def test_constant_spin_turns_at_a_constant_rate(name, spin):
    path = kd.fly(launch((25, 0, 10), spin), BALL, AIRS[name])
    rate = float(np.linalg.norm(spin))
    for t in (0.0, 0.1, path.duration):
        axis = np.array(spin) / rate if rate else np.array([1.0, 0, 0])
        x, y, z = axis
        cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        expected = np.eye(3) + math.sin(rate * t) * cross + (1 - math.cos(rate * t)) * cross @ cross
        assert path.orientation(t).as_matrix() == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("spin", [(0, -60, 0), (10, -40, 25)], ids=["planar", "spatial"])
def test_decaying_spin_turns_by_its_integral(spin):
    path = kd.fly(launch((25, 0, 12), spin), BALL, kd.Air(), tol=1e-12)
    nodes, weights = np.polynomial.legendre.leggauss(40)
    end = path.duration
    rates = np.linalg.norm(path.sample(end / 2 * (nodes + 1)).spin, axis=1)
    angle = float(end / 2 * weights @ rates)
    assert angle < 0.99 * end * np.linalg.norm(spin)
    turned = path.orientation(end).as_rotvec()
    axis = np.array(spin) / np.linalg.norm(spin)
    assert abs(turned - (turned @ axis) * axis).max() < 1e-9  # about the axis of the spin
    assert math.remainder(float(turned @ axis) - angle, 2 * math.pi) == pytest.approx(0, abs=1e-7)


def test_decay_at_constant_speed_has_a_closed_form():
    """The angle is omega tau (1 - exp(-t/tau)); a ball that neither drags nor falls."""
    still = kd.Air(drag=None, lift=None, torque=lambda re, sp: 0.5, wind=(-1e3, 0, 0))
    path = kd.fly(launch((0, 0, 10), (0, 0, 30)), BALL, still, tol=1e-12)
    t = path.duration
    speed = 1e3  # the ball's own 10 m/s add 5e-5 of it
    brake = 0.5 * still.density * BALL.cross_section * speed * BALL.radius**2 / BALL.inertia
    tau = 1 / (brake + 8 * math.pi * still.viscosity * BALL.radius**3 / BALL.inertia)
    angle = 30 * tau * -math.expm1(-t / tau)
    assert t > 5 * tau
    assert path.orientation(t).magnitude() == pytest.approx(angle, rel=1e-4)


def test_quaternions_are_those_of_pinocchio():
    import pinocchio as pin

    path = kd.fly(launch((25, 0, 10), (3, -40, 9)), BALL, kd.Air())
    turn = path.orientation(0.3)
    assert pin.Quaternion(turn.as_quat()).toRotationMatrix() == pytest.approx(turn.as_matrix())
    many = path.orientation([0.0, 0.3])
    assert many.as_quat().shape == (2, 4)
    assert many.as_matrix()[1] == pytest.approx(turn.as_matrix(), abs=1e-14)


@pytest.mark.parametrize("name", AIRS)
def test_orientation_at_times_outside_is_refused(name):
    path = kd.fly(launch((25, 0, 10), (0, 30, 0)), BALL, AIRS[name])
    with pytest.raises(kd.InvalidInput, match="the flight lasts from 0"):
        path.orientation(99.0)


def test_lift_only_air_turns_too():
    air = kd.Air(drag=None, lift=constant(0.2))
    path = kd.fly(launch((25, 0, 10), (0, -30, 0)), BALL, air)
    assert 0 < path.orientation(0.05).magnitude() < 1.5


@pytest.mark.parametrize("tol", [1e-4, 1e-8])
def test_the_error_of_many_circles_is_at_or_above_the_truth(tol):
    """Neutrally buoyant and without drag, lift alone turns a ball: ten times, at 3 m/s."""
    air = kd.Air(drag=None, lift=constant(0.5), torque=None)
    ball = kd.Ball(air.density * BALL.volume, BALL.radius)
    radius = 2 * ball.mass / (air.density * ball.cross_section * 0.5)  # 0.6 m
    launch, ground = kd.BallState(velocity=(3, 0, 0), spin=(0, 0, 20)), kd.Ground(-0.2)
    path = kd.fly(launch, ball, air, ground, tol=tol, time_limit=12.0)
    angle = 3.0 / radius * 12.0
    exact = radius * np.array([math.sin(angle), 1 - math.cos(angle), 0])
    true = np.linalg.norm(path.landing.position - exact)
    assert true < path.error < 10 * true


@pytest.mark.parametrize("tol", [1e-10, 1e-12, 1e-13])
def test_the_error_of_a_shot_straight_up_is_at_or_above_that_of_its_duration(tol):
    """Drag against the square of the speed has a jump in its second derivative at the apex.

    What the step that crosses it misses does not fall evenly with the tolerance. The duration is
    v_t / g (atan(v / v_t) + atanh(v' / v_t)) with the terminal speed v_t and the landing speed v'.
    """
    air = kd.Air(drag=constant(0.5), lift=None, torque=None, buoyancy=False)
    limit = math.sqrt(2 * BALL.mass * 9.81 / (air.density * BALL.cross_section * 0.5))
    speeds = np.geomspace(2.0, 200.0, 20)
    launches = kd.BallState(np.zeros((20, 3)), speeds[:, None] * [0, 0, 1], np.zeros((20, 3)))
    paths = [kd.fly(launch((0, 0, up)), BALL, air, tol=tol) for up in speeds]
    many = kd.fly_many(launches, BALL, air, tol=tol, error=True)
    down = speeds / np.sqrt(1 + (speeds / limit) ** 2)
    exact = limit / 9.81 * (np.arctan(speeds / limit) + np.arctanh(down / limit))
    for duration, error in (
        (np.array([path.duration for path in paths]), [path.error for path in paths]),
        (many.duration.values, many.error.values),
    ):
        assert (np.abs(duration - exact) * down <= error).all()
        assert duration == pytest.approx(exact, rel=4 * tol)


@pytest.mark.parametrize("tol", [1e-6, 1e-10, 1e-12])
def test_the_error_is_within_ten_times_the_truth_in_the_median(tol):
    """Against landings computed with 20 digits."""
    paths, true = [], []
    for scene, torque in (("drag only", None), ("full", "smits-smith")):
        air = kd.Air(drag="brazuca", torque=torque)
        for state, landing in zip(kicks(), LANDINGS[scene], strict=True):
            spin = (0, 0, 0) if torque is None else state.spin
            paths.append(
                kd.fly(kd.BallState(velocity=state.velocity, spin=spin), BALL, air, tol=tol)
            )
            true.append(math.dist(paths[-1].landing.position[:2], landing))
    position, velocity, spin = (
        [getattr(path.launch, name) for path in paths[6:]]
        for name in ("position", "velocity", "spin")
    )
    states = kd.BallState(position, velocity, spin)
    many = kd.fly_many(states, BALL, kd.Air(drag="brazuca"), tol=tol, error=True)
    off = np.linalg.norm(many.landing_position.values[:, :2] - LANDINGS["full"], axis=1)
    for error, truth in (
        (np.array([path.error for path in paths]), true),
        (many.error.values, off),
    ):
        assert 1.0 < np.median(error / np.array(truth)) < 10.0


def test_the_error_counts_the_rounding_of_a_far_position():
    near, far = (
        kd.fly(kd.BallState((x, 0, 0.0), (20, 0, 8)), BALL, kd.Air()) for x in (0.0, 2.0**30)
    )
    moved = (far.landing.position - far.launch.position) - near.landing.position
    assert 1e-8 < np.linalg.norm(moved) <= far.error < 1e-5
    assert near.error < 0.9 * far.error


def peak(reynolds, spin_parameter):
    """500 wide in Re, 0.03 m/s: no step of a flight that is 1.5 s long sees it."""
    return 0.2 + 0.5 * math.exp(-(((reynolds - 2.5e5) / 250) ** 2))


def dip(reynolds, spin_parameter):
    return 0.2 - 0.19 * math.exp(-(((reynolds - 2.5e5) / 440) ** 2))


def jump(reynolds, spin_parameter):
    return 0.2 if reynolds < 2.5e5 else 0.3


@pytest.mark.parametrize("drag", [peak, dip, jump, drag_models.MODELS["brazuca"].function])
def test_the_error_counts_narrow_features_of_a_coefficient_of_ones_own(drag):
    air, worst = kd.Air(drag=drag), 0.0
    for start in (launch((18, 0, 6)), launch((20, 0, 6))):
        path = kd.fly(start, BALL, air, tol=1e-6)
        exact = kd.fly(start, BALL, air, tol=1e-10, max_step=path.duration / 1000)
        true = np.linalg.norm(path.landing.position - exact.landing.position)
        assert true <= path.error < 10 * true + 1e-5
        worst = max(true, worst)
    assert worst > 1e-3 or drag is not peak


def test_the_error_counts_narrow_features_of_a_torque_of_ones_own():
    """The spin falls within 0.03 m/s, and lift with it: no step of an ordinary flight sees it."""

    def braking(reynolds, spin_parameter):
        return 1e-3 + 10.0 * math.exp(-(((reynolds - 2.5e5) / 250) ** 2))

    air, start = kd.Air(drag=0.2, lift="wang", torque=braking), launch((20, 0, 6), (0, -30, 10))
    path, finer = (kd.fly(start, BALL, air, tol=tol) for tol in (1e-6, 1e-10))
    exact = kd.fly(start, BALL, air, tol=1e-10, max_step=path.duration / 1000)
    moved = (exact.landing.position - each.landing.position for each in (path, finer))
    true, of_finer = map(np.linalg.norm, moved)
    assert of_finer > 0.1
    assert true <= path.error < 10 * true


def test_the_error_is_infinite_where_no_finer_flight_can_be_computed(monkeypatch):
    """A ball that falls at the very speed where its drag jumps above its weight."""
    air = kd.Air(drag=lambda reynolds, spin_parameter: 0.2 if reynolds < 1.5e5 else 5.0)
    path = kd.fly(launch((1, 0, 0)), BALL, air, kd.Ground(-15), tol=1e-2)
    assert path.status == "landed"
    monkeypatch.setattr(integrate, "MAX_EVALUATIONS", 10_000)
    assert path.error == math.inf


def test_max_step_limits_the_steps_and_is_checked():
    start = launch((20, 0, 6))
    path = kd.fly(start, BALL, kd.Air(), max_step=0.01)
    assert path.evaluations > 12 * path.duration / 0.01
    assert pickle.loads(pickle.dumps(path)).evaluations == path.evaluations
    for bad in (0, -1, math.nan, "1"):
        with pytest.raises(kd.InvalidInput, match=r"max_step is .*above 0"):
            kd.fly(start, BALL, kd.Air(), max_step=bad)
