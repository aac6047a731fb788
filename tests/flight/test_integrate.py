"""The integrator, against closed forms and against an integrator of our own."""

import math

import numpy as np
import pytest
from mpmath import mp, mpf

import kickdyn as kd
from kickdyn.aerodynamics.drag import constant
from kickdyn.flight import integrate
from kickdyn.flight.integrate import Event, fly_until

BALL = kd.Ball()
PLAIN = {"lift": None, "buoyancy": False}


def launch(velocity, height=0.0, spin=(0, 0, 0)):
    return kd.BallState((0, 0, height), velocity, spin)


# --- closed forms -------------------------------------------------------------------------------


@pytest.mark.parametrize("cd", [0.2, 0.47])
@pytest.mark.parametrize("rise", [0.5, 10, 60])
def test_quadratic_drag_straight_up_and_down(cd, rise):
    air = kd.Air(drag=constant(cd), **PLAIN)
    path = kd.fly(launch((0, 0, rise)), BALL, air, tol=1e-12)
    k = 0.5 * air.density * BALL.cross_section * cd / BALL.mass
    climb = math.atan(rise * math.sqrt(k / 9.81)) / math.sqrt(9.81 * k)
    height = math.log1p(k * rise**2 / 9.81) / (2 * k)
    fall = math.acosh(math.exp(k * height)) / math.sqrt(9.81 * k)
    assert path.apex.time == pytest.approx(climb, rel=1e-10)
    assert path.height == pytest.approx(height, rel=1e-10)
    assert path.duration == pytest.approx(climb + fall, rel=1e-10)
    speed = rise / math.sqrt(1 + k * rise**2 / 9.81)
    assert path.landing.velocity == pytest.approx([0, 0, -speed], rel=1e-10)


@pytest.mark.parametrize("velocity", [(0.3, 0.1, 0.5), (0.2, 0.0, -0.1)])
def test_creeping_flow_has_a_closed_form(velocity):
    bead = kd.Ball(mass=1e-3, radius=1e-3)
    syrup = kd.Air(density=1.2, viscosity=0.5, drag="stokes", **PLAIN)
    path = kd.fly(launch(velocity, 0.051), bead, syrup, kd.Ground(), tol=1e-12)
    with mp.workdps(30):
        tau = mpf(1e-3) / (6 * mp.pi * mpf(0.5) * mpf(1e-3))
        v, g, drop = [mpf(x) for x in velocity], mpf(9.81), mpf(0.051) - mpf(1e-3)

        def fade(t):
            return tau * (1 - mp.exp(-t / tau))

        t = mp.findroot(lambda t: drop + (v[2] + g * tau) * fade(t) - g * tau * t, 0.1)
        where = [float(v[0] * fade(t)), float(v[1] * fade(t)), 1e-3]
    assert path.duration == pytest.approx(float(t), rel=1e-10)
    assert path.landing.position == pytest.approx(where, rel=1e-10, abs=1e-13)


def test_terminal_velocity():
    air = kd.Air(drag=constant(0.4), lift=None)
    path = kd.fly(launch((0, 0, 0), 3000.0), BALL, air, kd.Ground(), tol=1e-12)
    carried = BALL.mass - air.density * BALL.volume
    limit = math.sqrt(2 * carried * 9.81 / (air.density * BALL.cross_section * 0.4))
    assert path.landing.velocity == pytest.approx([0, 0, -limit], rel=1e-8)


def test_lift_alone_does_no_work():
    air = kd.Air(drag=None, lift=constant(0.3), buoyancy=False)
    path = kd.fly(launch((20, 5, 10), spin=(10, -80, 30)), BALL, air, tol=1e-12)
    states = path.sample(np.linspace(0, path.duration, 100))
    energy = states.speed**2 / 2 + 9.81 * states.position[:, 2]
    assert energy == pytest.approx(np.full(100, energy[0]), rel=1e-10)


def test_drag_takes_what_the_ball_loses():
    air = kd.Air(torque=None)
    spin = np.array([0, -25.0, 10])  # Sp stays below 0.4, where drag would have a kink
    path = kd.fly(launch((25, 0, 12), spin=spin), BALL, air, tol=1e-11)
    nodes, weights = np.polynomial.legendre.leggauss(100)
    t = path.duration / 2 * (nodes + 1)
    states = path.sample(t)
    power = []
    for u, speed in zip(states.velocity, states.speed, strict=True):
        spin_parameter = BALL.radius * np.linalg.norm(np.cross(spin, u)) / speed**2
        cd = air.drag(air.density * speed * 2 * BALL.radius / air.viscosity, spin_parameter)
        power.append(0.5 * air.density * BALL.cross_section * cd * speed**3)
    lost = BALL.mass / 2 * (path.launch.speed**2 - path.landing.speed**2)
    assert path.duration / 2 * weights @ power == pytest.approx(lost, rel=1e-10)


# --- an integrator of our own -------------------------------------------------------------------


def classical(state, ball, air, steps_per_second):
    """Landing time and state by the classical Runge-Kutta method, at a fixed step."""
    g = 9.81 * (1 - air.density * ball.volume / ball.mass * air.buoyancy)

    def rate(y):
        u, spin = y[3:6] - air.wind, y[6:]
        speed = math.sqrt(u @ u)
        magnus = np.cross(spin, u / speed)
        across = math.sqrt(magnus @ magnus)
        reynolds = air.density * speed * 2 * ball.radius / air.viscosity
        spin_parameter = ball.radius * across / speed
        force = -air.drag(reynolds, spin_parameter) * u / speed
        if across:
            force = force + air.lift(reynolds, spin_parameter) * magnus / across
        pressure = 0.5 * air.density * ball.cross_section * speed**2
        brake = air.torque(reynolds, spin_parameter) * air.density * ball.cross_section * speed
        brake = brake * ball.radius**2 + 8 * math.pi * air.viscosity * ball.radius**3
        acceleration = pressure / ball.mass * force - [0, 0, g]
        return np.concatenate([y[3:6], acceleration, -brake / ball.inertia * spin])

    def step(y, h):
        a = rate(y)
        b = rate(y + h / 2 * a)
        c = rate(y + h / 2 * b)
        return y + h / 6 * (a + 2 * b + 2 * c + rate(y + h * c))

    y, t, h = np.concatenate([np.zeros(3), state.velocity, state.spin]), 0.0, 1 / steps_per_second
    while True:
        ahead = step(y, h)
        if ahead[2] < 0:
            break
        y, t = ahead, t + h
    rest = h * y[2] / (y[2] - ahead[2])
    for _ in range(8):
        ahead = step(y, rest)
        rest -= ahead[2] / ahead[5]
    return np.array([t + rest, *step(y, rest)])


def extrapolated(*flight, steps=150):
    coarse, fine = (classical(*flight, n) for n in (steps, 2 * steps))
    return fine + (fine - coarse) / 15


SHOTS = {  # none meets a kink of the coefficients, at Sp 0.4 or 35 m/s
    "drag": (launch((25, 0, 12)), kd.Air()),
    "free kick": (launch((25, 2, 12), spin=(5, -30, 15)), kd.Air()),
    "windy": (launch((22, 3, 15), spin=(10, 20, -30)), kd.Air(wind=(-3, 2, 1))),
    "smooth sphere": (launch((15, 0, 15), spin=(0, 0, 20)), kd.Air(drag="sphere", lift="wang")),
}


@pytest.fixture(scope="module", params=SHOTS)
def shot(request):
    state, air = SHOTS[request.param]
    return state, air, extrapolated(state, BALL, air)


def miss(path, exact):
    """Worst error of landing position and time, relative to the flight's own."""
    apart = np.abs(path.landing.position - exact[1:4]).max() / path.range
    return max(apart, abs(path.duration / exact[0] - 1))


def test_landing_is_right_to_a_few_tolerances(shot):
    state, air, exact = shot
    path = kd.fly(state, BALL, air, tol=1e-10)
    assert miss(path, exact) < 20e-10
    assert path.landing.velocity == pytest.approx(exact[4:7], abs=20e-10 * path.launch.speed)
    assert path.landing.spin == pytest.approx(exact[7:], abs=1e-7)


def test_default_tolerance_is_what_the_readme_says(shot):
    state, air, exact = shot
    assert miss(kd.fly(state, BALL, air), exact) < 1e-8


def test_error_falls_with_the_tolerance(shot):
    state, air, exact = shot
    errors = [miss(kd.fly(state, BALL, air, tol=tol), exact) for tol in (1e-4, 1e-7, 1e-10)]
    assert errors[0] < 20e-4
    assert errors[1] < 20e-7
    assert errors[2] < 20e-10
    assert errors[2] < errors[0]


def test_finest_tolerance_is_near_rounding():
    state, air = SHOTS["drag"]
    path = kd.fly(state, BALL, air, tol=1e-13)
    assert miss(path, extrapolated(state, BALL, air, steps=600)) < 1e-12


@pytest.mark.parametrize("rise", [1e-30, 1e-12, 1e-6, 1e-3])
def test_smallest_hop_is_as_right_as_any(rise):
    g = 9.81 * (1 - kd.Air().density * BALL.volume / BALL.mass)
    for height in (0.0, 100.0):
        path = kd.fly(launch((rise, 0, rise), height), BALL, kd.Air(lift=None))
        assert path.duration == pytest.approx(2 * rise / g, rel=2e-5)  # the rest is drag
        digits = 1e-16 * height  # that a position there can hold
        assert path.height == pytest.approx(rise**2 / (2 * g), rel=2e-5, abs=100 * digits)


# --- the pieces ---------------------------------------------------------------------------------


def fall(_, y):
    return [*y[3:], 0.0, 0.0, -10.0]


ATOL = np.full(6, 1e-10)


def test_until_the_event():
    start = np.array([0, 0, 0, 1.0, 0, 10.0])
    arc = fly_until([Event(lambda y: y[5])], 5, fall, (2.0, start), 100.0, 1e-10, ATOL)
    assert arc.reached is not None
    assert arc.end == pytest.approx(3.0, rel=1e-14)
    assert arc.state == pytest.approx([1, 0, 5, 1, 0, 0], abs=1e-12)
    t = np.array([2.0, 2.5, 3.0])
    assert arc.trajectory(t)[2] == pytest.approx([0, 3.75, 5], abs=1e-12)


def test_until_the_time_limit():
    start = np.array([0, 0, 0, 1.0, 0, 10.0])
    arc = fly_until([Event(lambda y: y[2] + 1e6)], 5, fall, (0.0, start), 3.0, 1e-10, ATOL)
    assert (arc.reached, arc.end) == (None, 3.0)
    assert arc.state == pytest.approx([3, 0, -15, 1, 0, -20])
    assert [t for t, _ in arc.crests] == [pytest.approx(1.0)]  # highest on the way


@pytest.mark.parametrize("brake", [2.0, 2e5])
def test_event_that_is_zero_at_the_start_must_rise_first(brake):
    def hop(t, y):  # starts level, rises, and comes down: in the second case within a step
        return [*y[3:], 0.0, 0.0, 1.0 - brake * t]

    arc = fly_until(
        [Event(lambda y: y[5])], 5, hop, (0.0, np.zeros(6)), 10.0, 1e-6, np.full(6, 1e-2)
    )
    assert arc.end == pytest.approx(2 / brake, rel=1e-6)


@pytest.mark.parametrize("bad", [math.nan, math.inf])
@pytest.mark.parametrize("when", [0.0, 0.5])
def test_acceleration_that_is_no_number_ends_in_an_error(bad, when):
    def broken(t, y):
        return [*y[3:], 0.0, 0.0, bad if t >= when else -10.0]

    with pytest.raises(kd.KickdynError, match=r"not finite|could not be integrated beyond"):
        fly_until([Event(lambda y: y[2] + 100)], 5, broken, (0.0, np.zeros(6)), 10.0, 1e-9, ATOL)


def test_endless_integration_ends_in_an_error(monkeypatch):
    monkeypatch.setattr(integrate, "MAX_EVALUATIONS", 2000)
    syrup = kd.Air(viscosity=1e6)  # comes to rest in 1e-7 s, then creeps for seconds
    with pytest.raises(kd.KickdynError, match="takes more than 2000 evaluations"):
        kd.fly(launch((10, 0, 10)), BALL, syrup)


@pytest.mark.parametrize("speed", [1e100, 1e300])
def test_speed_beyond_double_precision_ends_in_an_error(speed):
    with pytest.raises(kd.KickdynError):
        kd.fly(launch((speed, 0, speed)), BALL, kd.Air())
