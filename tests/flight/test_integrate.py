"""The integrator, against closed forms and against an integrator of our own."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mpmath import mp, mpf
from scipy.integrate import solve_ivp

import kickdyn as kd
from kickdyn.aerodynamics.drag import constant
from kickdyn.flight import integrate as integrate_module
from kickdyn.flight.equations import FINEST, FlightEquations
from kickdyn.flight.events import CREST
from kickdyn.flight.forces import downward
from kickdyn.flight.integrate import Tolerance, integrate, trajectory

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


# --- an integrator of our own -------------------------------------------------------------------


def rate_of(y, ball, air):
    """Rate of displacement, velocity and spin, by the vector formulas."""
    g = 9.81 * (1 - air.density * ball.volume / ball.mass * air.buoyancy)
    u, spin = y[3:6] - air.wind, y[6:]
    speed = math.sqrt(u @ u) or 1e-300
    magnus = np.cross(spin, u / speed)
    across = math.sqrt(magnus @ magnus)
    reynolds = max(air.density * speed * 2 * ball.radius / air.viscosity, 1e-290)
    spin_parameter = ball.radius * across / speed
    force = -air.drag(reynolds, spin_parameter) * u / speed
    if across:
        force = force + air.lift(reynolds, spin_parameter) * magnus / across
    pressure = 0.5 * air.density * ball.cross_section * speed**2
    brake = air.torque(reynolds, spin_parameter) * air.density * ball.cross_section * speed
    brake = brake * ball.radius**2 + 8 * math.pi * air.viscosity * ball.radius**3
    acceleration = pressure / ball.mass * force - [0, 0, g]
    return np.concatenate([y[3:6], acceleration, -brake / ball.inertia * spin])


def classical(state, ball, air, steps_per_second):
    """Landing time and state by the classical Runge-Kutta method, at a fixed step."""

    def rate(y):
        return rate_of(y, ball, air)

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


FLIGHTS = {
    "kick": (launch((25, 0, 12), spin=(0, -25.0, 10)), kd.Air()),
    "slow": (launch((1, 0.2, 3)), kd.Air()),
    "fast": (launch((300, 0, 120), spin=(0, -25, 10)), kd.Air()),
    "crisis": (launch((9, 2, 24), spin=(5, -30, 10)), kd.Air(drag="tango12")),
    "wind": (launch((20, 3, 12), spin=(5, -30, 10)), kd.Air(wind=(-30, 12, 2))),
    "sphere": (launch((12, 0, 9)), kd.Air(drag="sphere", lift=None)),
}


@pytest.mark.parametrize("name", FLIGHTS)
def test_the_forces_do_the_work_that_the_ball_loses(name):
    """Drag and, in a wind, lift; buoyancy and weight do none from launch height to launch height.

    In a wind, the work on the ball is counted in the frame of the ground.
    """
    state, air = FLIGHTS[name]
    path = kd.fly(state, BALL, air, tol=1e-12)
    nodes, weights = np.polynomial.legendre.leggauss(30)
    work, pieces = 0.0, np.unique(path.duration * np.linspace(0, 1, 41) ** 3)
    for began, ended in itertools.pairwise(pieces):
        states = path.sample((ended - began) / 2 * nodes + (began + ended) / 2)
        power = []
        for v, spin in zip(states.velocity, states.spin, strict=True):
            rate = rate_of(np.concatenate([np.zeros(3), v, spin]), BALL, air)[3:6]
            power.append(BALL.mass * (rate @ v + downward(BALL, air) * v[2]))
        work += (ended - began) / 2 * float(weights @ power)
    lost = BALL.mass / 2 * (path.launch.speed**2 - path.landing.speed**2)
    assert -work == pytest.approx(lost, rel=1e-8)


# --- extremes, against scipy at 1e-13 and against closed forms -----------------------------------


def reference(state, ball, air, drop=0.0):
    """Landing time, displacement, velocity and spin by `solve_ivp`, then Newton to the ground."""

    def rate(_, y):
        return rate_of(y, ball, air)

    def down(t, y):
        return y[2] + drop if t > 0 else 1.0

    down.terminal, down.direction = True, -1
    y = np.concatenate([np.zeros(3), state.velocity, state.spin])
    pace = np.linalg.norm(state.velocity) or 1.0
    near = 1e-15 * min(pace * pace / 9.81, 300.0)
    atol = np.array([*3 * [near], *3 * [1e-15 * min(pace, 30.0)], *3 * [1e-13]])
    found = solve_ivp(rate, (0, 1e3), y, "DOP853", events=down, rtol=1e-13, atol=atol)
    t, y = found.t_events[0][0], found.y_events[0][0]
    # the event is an interpolant's: go to its time from the last step before, and on from there
    last = np.flatnonzero(found.t < t)[-1]
    y = solve_ivp(rate, (found.t[last], t), found.y[:, last], "DOP853", rtol=1e-13, atol=atol)
    y = y.y[:, -1]
    for _ in range(3):
        late = -(y[2] + drop) / y[5]
        y, t = y + late * rate(t, y + late / 2 * rate(t, y)), t + late
    return t, y


def agrees(state, ball, air, tol, ground=None, drop=0.0, within=50):
    """Assert that `fly` gives the reference's landing to some times the tolerance."""
    path = kd.fly(state, ball, air, ground, tol)
    t, y = reference(state, ball, air, drop)
    length = max(np.abs(y[:3]).max(), path.height)
    assert path.status == "landed"
    assert path.duration == pytest.approx(t, rel=within * tol)
    moved = path.landing.position - state.position
    assert np.abs(moved - y[:3]).max() <= within * tol * length
    assert path.landing.velocity == pytest.approx(y[3:6], abs=within * tol * np.abs(y[3:6]).max())
    assert path.landing.spin == pytest.approx(y[6:], rel=within * tol, abs=1e-300)
    return path


EXTREMES = {
    "1000 m/s": (launch((800, 100, 600), spin=(5, -40, 20)), kd.Air(drag="brazuca")),
    "spin of 10,000 rad/s": (launch((25, 2, 10), spin=(2e3, -9e3, 4e3)), kd.Air(drag="brazuca")),
    "straight up": (launch((0, 0, 25)), kd.Air(drag="brazuca")),
    "straight up with spin along": (launch((0, 0, 25), spin=(0, 0, 60)), kd.Air(drag="brazuca")),
    "straight up with spin across": (launch((0, 0, 25), spin=(30, -50, 0)), kd.Air(drag="brazuca")),
    "wind faster than the ball": (
        launch((5, 0, 5), spin=(0, -20, 9)),
        kd.Air(drag="brazuca", wind=(-60, 10, 0)),
    ),
    "updraft": (launch((5, 1, 8)), kd.Air(drag="brazuca", wind=(2, 0, 9))),
}


@pytest.mark.parametrize("name", EXTREMES)
@pytest.mark.parametrize("tol", [1e-8, 1e-11])
def test_extremes(name, tol):
    state, air = EXTREMES[name]
    # The steps grow with tol^(1/8). Where one crosses a join of the drag's formulas, of which the
    # fourth derivative jumps, it errs by up to h^5 times that jump and its estimate may not see it.
    agrees(state, BALL, air, tol, within=20 + 0.004 * tol ** (5 / 8 - 1))


@pytest.mark.parametrize("velocity", [(25, 0, 0), (20, 3, -15), (0, 0, -30), (0, 0, 0)])
def test_down_from_a_height(velocity):
    state = launch(velocity, 40 + BALL.radius, (4, -30, 9))
    agrees(state, BALL, kd.Air(), 1e-11, kd.Ground(), drop=40.0)


@pytest.mark.parametrize("mass", [1e-6, 1e3])
def test_extreme_masses(mass):
    ball = kd.Ball(mass, 1e-3)
    agrees(launch((3, 0.5, 4), spin=(5, -40, 20)), ball, kd.Air(), 1e-10)


@pytest.mark.parametrize("reynolds", [10.0, 1e2, 1e4, 3e4, 1e5, 1e6, 1e7])
@pytest.mark.parametrize("drag", ["brazuca", "sphere", "supercritical"])
def test_high_reynolds_numbers(reynolds, drag):
    viscosity = 1.2 * 2 * BALL.radius * 12 / reynolds
    air = kd.Air(density=1.2, viscosity=viscosity, drag=drag)
    agrees(launch((8, 1, 9), spin=(5, -20, 10)), BALL, air, 1e-10, within=200)  # through joins


@pytest.mark.parametrize("reynolds", [1e-6, 1e-3, 0.9])
@pytest.mark.parametrize("drag", ["stokes", "sphere", "brazuca"])
def test_low_reynolds_numbers_have_a_closed_form(reynolds, drag):
    """Below Re 1 all models are Stokes': v decays by exp(-t/tau), tau of a second here."""
    viscosity = 1.2 * 2 * BALL.radius * 12 / reynolds
    ball = kd.Ball(6 * math.pi * viscosity * BALL.radius, BALL.radius)
    air = kd.Air(density=1.2, viscosity=viscosity, drag=drag, lift=None, buoyancy=False)
    path = kd.fly(launch((3, 2, 11)), ball, air, tol=1e-12)
    with mp.workdps(30):
        t = mp.findroot(lambda t: (11 + mpf(9.81)) * (1 - mp.exp(-t)) - mpf(9.81) * t, 1.5)
        gone = 1 - mp.exp(-t)
    assert path.duration == pytest.approx(float(t), rel=1e-11)
    where = [3 * float(gone), 2 * float(gone), 0]
    assert path.landing.position == pytest.approx(where, rel=1e-11, abs=1e-12)
    apex = math.log1p(11 / 9.81)
    assert path.apex.time == pytest.approx(apex, rel=1e-11)
    assert path.height == pytest.approx(11 - 9.81 * apex, rel=1e-11)


@pytest.mark.parametrize("speed", [1e-6, 1e-5])
def test_a_micrometre_a_second(speed):
    """Re 0.01 to 0.1: a hop of 1e-13 m, of which drag takes a billionth."""
    air = kd.Air(lift=None)
    path = kd.fly(launch((speed, 0, speed)), BALL, air, tol=1e-12)
    with mp.workdps(50):
        tau = mpf(BALL.mass) / (6 * mp.pi * mpf(air.viscosity) * mpf(BALL.radius))
        g = mpf(9.81) * (1 - mpf(air.density) * mpf(BALL.volume) / mpf(BALL.mass))
        v = mpf(speed)
        t = mp.findroot(
            lambda t: (v + g * tau) * tau * -mp.expm1(-t / tau) - g * tau * t, 2 * v / g
        )
        far = v * tau * -mp.expm1(-t / tau)
    assert path.duration == pytest.approx(float(t), rel=1e-12)
    assert path.range == pytest.approx(float(far), rel=1e-12)


@pytest.mark.parametrize("ball", ["brazuca", "tango12", "teamgeist", "jabulani"])
def test_the_drag_crisis_is_crossed_without_stalling(ball):
    """Twice: slower than 12 m/s at the top, faster before and after."""
    state = launch((9, 0, 24), spin=(0, -25, 0))
    path = agrees(state, BALL, kd.Air(drag=ball), 1e-12)
    assert path.apex.speed < 11 < 14 < path.launch.speed
    assert path.evaluations < 2500


# --- symmetries, order --------------------------------------------------------------------------


@given(st.tuples(*[st.floats(-60, 60)] * 3), st.floats(0, 50))
def test_time_reversal_without_drag(velocity, height):
    start = launch(velocity, height + BALL.radius)
    there = kd.fly(start, BALL, None, kd.Ground())
    back = kd.BallState(there.landing.position, -there.landing.velocity)
    home = kd.fly(back, BALL, None, kd.Ground(-1.0)).sample(there.duration)
    scale = 1 + float(np.abs(there.sample([0.0, there.apex.time]).position).max()) + there.range
    assert home.position == pytest.approx(start.position, abs=1e-13 * scale)
    assert home.velocity == pytest.approx(-start.velocity, abs=1e-12 * scale)


def test_lift_alone_can_be_reversed_too():
    """Backwards in time omega x v keeps its sense only if the spin is turned round as well."""
    air = kd.Air(drag=None, lift=constant(0.3), torque=None)
    start = launch((20, 5, 10), 1.0, (10, -80, 30))
    there = kd.fly(start, BALL, air, kd.Ground(), 1e-12)
    back = kd.BallState(there.landing.position, -there.landing.velocity, -there.landing.spin)
    home = kd.fly(back, BALL, air, kd.Ground(-50.0), 1e-12).sample(there.duration)
    assert home.position == pytest.approx(start.position, abs=1e-8)
    assert home.velocity == pytest.approx(-start.velocity, abs=1e-8)


@pytest.mark.parametrize(
    ("velocity", "end", "least"),
    [
        ((25, 2, 12), 2.5, 7.5),
        ((2, 0.3, 6), 1.2, 6.0),  # through Re 2e4 to 7e4, joined there
        ((50, 2, 22), 3.0, 7.0),  # through 35 m/s, where the data end
    ],
)
def test_order_of_convergence(velocity, end, least):
    """The error falls with about the 8th power of the number of evaluations."""
    motion = FlightEquations(launch(velocity, spin=(5, -30, 15)), BALL, kd.Air())
    start = (0.0, motion.begin)

    def arc(tol):
        tolerance = Tolerance(max(tol, FINEST), np.full(7, tol))
        return integrate(motion.rates, start, [CREST], end, tolerance)

    exact = arc(1e-14).state
    arcs = [arc(10.0**-k) for k in np.arange(3, 10.6, 0.25)]
    errors = [np.abs(each.state - exact).max() for each in arcs]
    slope, _ = np.polyfit(np.log([each.evaluations for each in arcs]), np.log(errors), 1)
    assert -slope > least


# --- the pieces ---------------------------------------------------------------------------------


def fall(_, y):
    return [*y[3:], 0.0, 0.0, -10.0]


TOLERANCE = Tolerance(1e-10, np.full(6, 1e-10))


def event(function, name="there"):
    return kd.Event(name, lambda state, numbers: function(state))


def test_until_the_event():
    start = np.array([0, 0, 0, 1.0, 0, 10.0])
    level = event(lambda y: y[5])
    arc = integrate(fall, (2.0, start), [level], 100.0, TOLERANCE)
    assert arc.reached is level
    assert arc.end == pytest.approx(3.0, rel=1e-14)
    assert arc.state == pytest.approx([1, 0, 5, 1, 0, 0], abs=1e-12)
    t = np.array([2.0, 2.5, 3.0])
    assert trajectory(arc, start)(t)[2] == pytest.approx([0, 3.75, 5], abs=1e-12)


def test_until_the_time_limit():
    start = np.array([0, 0, 0, 1.0, 0, 10.0])
    deep = event(lambda y: y[2] + 1e6)
    arc = integrate(fall, (0.0, start), [deep, CREST], 3.0, TOLERANCE)
    assert (arc.reached, arc.end) == (None, 3.0)
    assert arc.state == pytest.approx([3, 0, -15, 1, 0, -20])
    ((passed, locate),) = arc.passed
    assert passed is CREST
    assert locate()[0] == pytest.approx(1.0)


def test_the_first_of_several_events_ends_it():
    start = np.array([0, 0, 0, 1.0, 0, 10.0])
    ends = [event(lambda y, x=x: x - y[0]) for x in (1.9, 1.5, 1.7)]
    assert integrate(fall, (0.0, start), ends, 3.0, TOLERANCE).reached is ends[1]


@pytest.mark.parametrize("brake", [2.0, 2e5])
def test_event_that_is_zero_at_the_start_must_rise_first(brake):
    def hop(t, y):  # starts level, rises, and comes down: in the second case within a step
        return [*y[3:], 0.0, 0.0, 1.0 - brake * t]

    loose = Tolerance(1e-6, np.full(6, 1e-2))
    arc = integrate(hop, (0.0, np.zeros(6)), [event(lambda y: y[5])], 10.0, loose)
    assert arc.end == pytest.approx(2 / brake, rel=1e-6)


def test_event_within_a_step_at_both_ends_of_which_its_rate_has_one_sign():
    def sway(t, y):  # at the speed -(t - 1) (t - 2): down to -1/30 at 1 s, then up
        return [0.0, 0.0, y[5], 0.0, 0.0, 3.0 - 2.0 * t]

    low = event(lambda y: y[2])
    start = (0.0, np.array([0.0, 0.0, 0.8, 0.0, 0.0, -2.0]))
    arc = integrate(sway, start, [low], 2.05, Tolerance(1e-2, np.full(6, 1e3)))
    assert arc.reached is low
    assert 0.7 < arc.end < 1.0


@pytest.mark.parametrize("bad", [math.nan, math.inf])
@pytest.mark.parametrize("when", [0.0, 0.5])
def test_acceleration_that_is_no_number_ends_in_an_error(bad, when):
    def broken(t, y):
        return [*y[3:], 0.0, 0.0, bad if t >= when else -10.0]

    with pytest.raises(kd.KickdynError, match=r"not finite|could not be integrated beyond"):
        integrate(broken, (0.0, np.zeros(6)), [event(lambda y: y[2] + 100)], 10.0, TOLERANCE)


def test_endless_integration_ends_in_an_error(monkeypatch):
    monkeypatch.setattr(integrate_module, "MAX_EVALUATIONS", 2000)
    syrup = kd.Air(viscosity=1e6)  # comes to rest in 1e-7 s, then creeps for seconds
    with pytest.raises(kd.KickdynError, match="takes more than 2000 evaluations"):
        kd.fly(launch((10, 0, 10)), BALL, syrup)


@pytest.mark.parametrize("speed", [1e100, 1e300])
def test_speed_beyond_double_precision_ends_in_an_error(speed):
    with pytest.raises(kd.KickdynError):
        kd.fly(launch((speed, 0, speed)), BALL, kd.Air())
