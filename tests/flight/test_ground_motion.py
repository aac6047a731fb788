import contextlib
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

import kickdyn as kd
from kickdyn.aerodynamics import drag
from kickdyn.flight.ground_motion import bounce, roll, slide, slip
from kickdyn.ground import SURFACES, Surface

BALL = kd.Ball()
TURF = SURFACES["turf"]


def energy(state):
    """Kinetic energy [J]."""
    linear, turning = state.velocity @ state.velocity, state.spin @ state.spin
    return 0.5 * (BALL.mass * linear + BALL.inertia * turning)


def surface(e=0.6, mu=0.5, tangential=0.0):
    return Surface("test", e, mu, 0.75, tangential)


@given(
    motion=st.tuples(*[st.floats(-50, 50)] * 2, st.floats(-50, -1e-3)),
    spin=st.tuples(*[st.floats(-300, 300)] * 3),
    e=st.floats(0, 1),
    mu=st.floats(0, 3),
    tangential=st.floats(-1, 1),
)
@settings(max_examples=500, deadline=None)
def test_energy_never_rises_and_the_laws_hold(motion, spin, e, mu, tangential):
    before = kd.BallState((0, 0, 1), motion, spin)
    after = bounce(before, BALL, surface(e, mu, tangential))
    assert energy(after) <= energy(before) * (1 + 1e-12)
    assert after.velocity[2] == pytest.approx(-e * before.velocity[2], rel=1e-12)
    assert after.spin[2] == before.spin[2]
    push = BALL.mass * (after.velocity - before.velocity)
    friction, normal = math.hypot(push[0], push[1]), push[2]
    assert friction <= mu * normal * (1 + 1e-9) + 1e-12
    turn = BALL.inertia * (after.spin - before.spin)
    assert turn == pytest.approx(np.cross((0, 0, -BALL.radius), push), rel=1e-9, abs=1e-9)
    ux, uy = slip(before, BALL)
    rounding = 1e-12 * BALL.mass * math.hypot(*motion)
    if friction < mu * normal * (1 - 1e-9) - rounding and mu > 1e-6:  # it gripped
        reversed_slip = (-tangential * ux, -tangential * uy)
        assert slip(after, BALL) == pytest.approx(reversed_slip, abs=1e-9 * (1 + abs(ux) + abs(uy)))


def test_on_steel_the_speed_and_the_pressure_decide():
    """A ball that falls 2 m rebounds to 1.35 to 1.55 m (FIFA Quality Pro), and less when harder."""
    fall = math.sqrt(2 * 9.81 * 2.0)
    soft, hard = (
        [
            bounce(kd.BallState((0, 0, 1), (0, 0, -speed)), kd.Ball(pressure=p), SURFACES["steel"])
            for speed in (fall, 3 * fall)
        ]
        for p in (60e3, 110e3)
    )
    for slow, fast in (soft, hard):
        assert 1.35 < slow.velocity[2] ** 2 / (2 * 9.81) < 1.55
        assert fast.velocity[2] < 2.8 * slow.velocity[2]
    assert soft[0].velocity[2] < hard[0].velocity[2]
    given = kd.Contact((1, 0, 0), "inflated").restitution_at(fall, kd.Ball(pressure=60e3))
    assert soft[0].velocity[2] == pytest.approx(given * fall, rel=1e-14)
    table = surface([(1.0, 0.9), (5.0, 0.5)])
    assert bounce(kd.BallState((0, 0, 1), (0, 0, -4)), BALL, table).velocity[2] == pytest.approx(
        2.4
    )
    for call in (kd.follow, lambda *given: kd.follow_many(given[0], *given[1:])):
        state = kd.BallState((0, 0, 1), np.zeros((2, 3)) if call is not kd.follow else (0, 0, 0))
        with pytest.raises(kd.InvalidInput, match="ball pressure is None"):
            call(state, BALL, None, kd.Ground(surface="steel"))


def test_gripping_it_leaves_rolling():
    after = bounce(kd.BallState((0, 0, 1), (5, 0, -5)), BALL, surface(mu=2))
    assert after.velocity == pytest.approx([3, 0, 3])  # 2/5 of the slip is lost
    assert after.spin == pytest.approx([0, 3 / BALL.radius, 0])


def test_slipping_it_loses_mu_times_the_normal_impulse():
    after = bounce(kd.BallState((0, 0, 1), (20, 0, -2)), BALL, surface(e=0.5, mu=0.3))
    assert after.velocity == pytest.approx([20 - 0.3 * 1.5 * 2, 0, 1])


def test_back_spin_checks_and_side_spin_stays():
    before = kd.BallState((0, 0, 1), (5, 0, -5), (0, -200, 40))
    after = bounce(before, BALL, SURFACES["turf"])
    plain = bounce(kd.BallState((0, 0, 1), (5, 0, -5)), BALL, SURFACES["turf"])
    assert after.velocity[0] < plain.velocity[0]
    assert after.spin[2] == 40


def on_ground(velocity, spin=(0, 0, 0)):
    return kd.BallState((1, 2, BALL.radius), velocity, spin)


def test_rolling_stops_where_constant_deceleration_says():
    surface = Surface("ramp test", 0.6, 0.7, 0.735)
    path = roll(on_ground((3.43, 0, 0)), BALL, None, surface, 1e-10)
    assert path.end.position[0] - 1 == pytest.approx(8.0, abs=0.005)  # FIFA's longest roll
    assert path.end.position[0] - 1 == pytest.approx(3.43**2 / 2 / 0.735, rel=1e-9)
    assert path.duration == pytest.approx(3.43 / 0.735, rel=1e-9)
    assert path.end.velocity.tolist() == [0, 0, 0]


def test_drag_shortens_the_roll():
    far = [roll(on_ground((9, 3, 0)), BALL, air, TURF, 1e-9).end for air in (None, kd.Air())]
    way = [end.position - [1, 2, BALL.radius] for end in far]
    assert np.linalg.norm(way[1]) < 0.97 * np.linalg.norm(way[0])
    for moved in way:
        assert moved[1] / moved[0] == pytest.approx(1 / 3)


def test_while_it_rolls_its_lowest_point_rests():
    path = roll(on_ground((4, -2, 0)), BALL, kd.Air(), TURF, 1e-9)
    states = path.sample(np.linspace(0, path.duration, 50))
    for velocity, spin in zip(states.velocity, states.spin, strict=True):
        here = kd.BallState((0, 0, 0), velocity, spin)
        assert slip(here, BALL) == pytest.approx((0, 0), abs=1e-12)


def test_sliding_ends_in_rolling():
    state = on_ground((10, 0, 0))
    path = slide(state, BALL, None, TURF)
    assert slip(path.end, BALL) == pytest.approx((0, 0), abs=1e-12)
    assert path.end.velocity[0] == pytest.approx(6)  # 3/5 of it, whatever mu
    assert path.duration == pytest.approx(4 / (0.7 * 9.81))
    assert path.end.position[0] - 1 == pytest.approx((10 + 6) / 2 * path.duration)


def test_what_rolls_does_not_slide():
    rolling = on_ground((3, 0, 0), (0, 3 / BALL.radius, 0))
    assert slide(rolling, BALL, None, TURF) is None


def test_a_ball_at_rest_rests():
    path = roll(on_ground((0, 0, 0)), BALL, kd.Air(), TURF, 1e-9)
    assert path.duration == 0
    assert path.sample(np.zeros(2)).position.tolist() == [[1, 2, BALL.radius]] * 2


def test_a_strong_wind_does_not_let_it_rest_and_that_is_said():
    air = kd.Air(wind=(0, 30, 0))
    path = roll(on_ground((1, 0, 0)), BALL, air, TURF, 1e-9, time_limit=60.0)
    assert (path.blown, path.duration) == (True, 60.0)
    assert path.end.velocity[1] > 5
    assert abs(path.end.velocity[0]) < 0.1
    for velocity in ((0, 0, 0), (0, -2, 0)):  # it would turn
        path = roll(on_ground(velocity), BALL, air, TURF, 1e-9, time_limit=60.0)
        assert path.blown
        assert path.duration < 60.0
        assert path.end.velocity == pytest.approx(np.zeros(3), abs=1e-4)
    course = kd.follow(on_ground((5, 0, 0)), BALL, air, kd.Ground(surface="turf"), time_limit=30)
    assert course.status == "blown"


@pytest.mark.parametrize("tol", [1e-2, 1e-4, 1e-7])
def test_loose_tolerances_find_the_rest_in_the_wind_too(tol):
    rng = np.random.default_rng(0)
    for _ in range(8):
        air, velocity = kd.Air(wind=(*rng.normal(size=2) * 4, 0)), (*rng.normal(size=2) * 3, 0)
        found, right = (
            roll(on_ground(velocity), BALL, air, TURF, t, time_limit=50) for t in (tol, 1e-11)
        )
        assert found.blown == right.blown
        np.testing.assert_allclose(found.end.position, right.end.position, rtol=0, atol=1e-6)


def test_a_side_wind_turns_the_way_and_the_ball_rests():
    """Against scipy's LSODA on the same law, written down anew."""
    air = kd.Air(wind=(0, 2.5, 0), drag=drag.constant(0.4), lift=None, torque=None)
    path = roll(on_ground((4, 0, 0)), BALL, air, TURF, 1e-10)
    k = 0.5 * air.density * BALL.cross_section * 0.4 / (BALL.mass + BALL.inertia / BALL.radius**2)

    def rates(t, y):
        u, v = y[2], y[3]
        relative = math.hypot(u, v - 2.5)
        speed = math.hypot(u, v)
        brake = TURF.rolling_deceleration / speed
        return [u, v, -k * relative * u - brake * u, -k * relative * (v - 2.5) - brake * v]

    def slow(t, y):
        return math.hypot(y[2], y[3]) - 1e-5

    slow.terminal = True
    found = solve_ivp(rates, (0, 100), [0, 0, 4, 0], "DOP853", rtol=1e-12, atol=1e-14, events=slow)
    moved = path.end.position - path.start.position
    assert moved[:2] == pytest.approx(found.y[:2, -1], abs=1e-7)
    assert moved[1] > 0.1
    assert path.end.velocity.tolist() == [0, 0, 0]


@pytest.mark.parametrize(
    ("ball", "height", "velocity", "spin", "friction"),
    [
        (kd.Ball(1e-100, 1e-100), 0.0, (4e3, 1e-301, 0), (0, -1e3, 0), 1e300),
        (kd.Ball(1e-100, 1e-100), 1e-12, (9e-300, 7e-301, -1e-199), (0, -1e3, 0), 1e-300),
        (kd.Ball(1e3), 1e-300, (14, 14, 9e-100), (-1e-100, 1e-3, 1e-3), 1e300),
    ],
)
def test_an_absurd_ball_slides_or_is_refused_in_a_line(ball, height, velocity, spin, friction):
    ground = kd.Ground(surface=Surface("absurd", 1e-3, friction, 1e-10))
    launch = kd.BallState((0, 0, ball.radius + height), velocity, spin)
    for air in (None, kd.Air(lift=1000.0)):
        with contextlib.suppress(kd.KickdynError):
            rest = kd.follow(launch, ball, air, ground).rest
            assert np.isfinite(rest.position).all()


def test_buoyancy_takes_friction_from_a_ball_that_slides():
    """A light ball in dense air: the ground carries its weight less that of the air."""
    air, ball = kd.Air(density=20.0, drag=None, lift=None, torque=None), kd.Ball(0.41, 0.11)
    start = kd.BallState((1, 2, ball.radius), (10, 0, 0))
    lighter = 1 - 20.0 * 4 / 3 * math.pi * 0.11**3 / 0.41
    path = slide(start, ball, air, TURF)
    assert lighter < 0.8
    assert path.duration == pytest.approx(4 / (TURF.friction * 9.81 * lighter))
