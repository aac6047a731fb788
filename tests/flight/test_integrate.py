"""The integrator: closed forms, order, energy, and the events within its steps."""

import itertools
import math

import numpy as np
import pytest
from mpmath import mp, mpf
from references.vector_flight import rates
from tolerances import agrees, integrated

import kickdyn as kd
from kickdyn.aerodynamics.drag import constant
from kickdyn.flight import integrate as integrate_module
from kickdyn.flight.equations import FINEST, FlightEquations
from kickdyn.flight.events import CREST
from kickdyn.flight.forces import downward
from kickdyn.flight.integrate import Tolerance, integrate, trajectory

BALL = kd.Ball()


def launch(velocity, height=0.0, spin=(0, 0, 0)):
    return kd.BallState((0, 0, height), velocity, spin)


# --- closed forms -------------------------------------------------------------------------------


@pytest.mark.parametrize("velocity", [(0.3, 0.1, 0.5), (0.2, 0.0, -0.1)])
def test_creeping_flow_has_a_closed_form(velocity):
    bead = kd.Ball(mass=1e-3, radius=1e-3)
    syrup = kd.Air(density=1.2, viscosity=0.5, drag="stokes", lift=None, buoyancy=False)
    path = kd.fly(launch(velocity, 0.051), bead, syrup, kd.Ground(), tol=1e-12)
    with mp.workdps(30):
        tau = mpf(1e-3) / (6 * mp.pi * mpf(0.5) * mpf(1e-3))
        v, g, drop = [mpf(x) for x in velocity], mpf(9.81), mpf(0.051) - mpf(1e-3)

        def fade(t):
            return tau * (1 - mp.exp(-t / tau))

        t = mp.findroot(lambda t: drop + (v[2] + g * tau) * fade(t) - g * tau * t, 0.1)
        where = [float(v[0] * fade(t)), float(v[1] * fade(t)), 1e-3]
    assert path.duration == pytest.approx(float(t), rel=integrated(1e-12))
    agrees(path.landing.position, where, integrated(1e-12))


@pytest.mark.parametrize("reynolds", [1e-6, 1e-3, 0.9])
@pytest.mark.parametrize("drag", ["stokes", "sphere", "brazuca"])
def test_all_drag_is_stokes_below_reynolds_number_1(reynolds, drag):
    """v decays by exp(-t/tau), tau of a second here."""
    viscosity = 1.2 * 2 * BALL.radius * 12 / reynolds
    ball = kd.Ball(6 * math.pi * viscosity * BALL.radius, BALL.radius)
    air = kd.Air(density=1.2, viscosity=viscosity, drag=drag, lift=None, buoyancy=False)
    path = kd.fly(launch((3, 2, 11)), ball, air, tol=1e-12)
    with mp.workdps(30):
        t = mp.findroot(lambda t: (11 + mpf(9.81)) * (1 - mp.exp(-t)) - mpf(9.81) * t, 1.5)
        gone = float(1 - mp.exp(-t))
    apex = math.log1p(11 / 9.81)
    assert path.duration == pytest.approx(float(t), rel=integrated(1e-12))
    agrees(path.landing.position, [3 * gone, 2 * gone, 0], integrated(1e-12))
    assert path.apex.time == pytest.approx(apex, rel=integrated(1e-12))
    assert path.height == pytest.approx(11 - 9.81 * apex, rel=integrated(1e-12))


def test_a_ball_that_falls_far_has_its_terminal_velocity():
    air = kd.Air(drag=constant(0.4), lift=None)
    path = kd.fly(launch((0, 0, 0), 3000.0), BALL, air, kd.Ground(), tol=1e-12)
    weight = (BALL.mass - air.density * BALL.volume) * 9.81
    limit = math.sqrt(2 * weight / (air.density * BALL.cross_section * 0.4))
    agrees(path.landing.velocity, [0, 0, -limit], 1e-8)


def test_lift_alone_turns_a_ball_in_circles():
    """Neutrally buoyant and without drag: ten circles with the radius 2 m / (rho A C_L)."""
    air = kd.Air(drag=None, lift=constant(0.5), torque=None)
    ball = kd.Ball(air.density * BALL.volume, BALL.radius)
    radius = 2 * ball.mass / (air.density * ball.cross_section * 0.5)
    path = kd.fly(kd.BallState(velocity=(3, 0, 0), spin=(0, 0, 20)), ball, air,
                  kd.Ground(-0.2), 1e-8, time_limit=12.0)  # fmt: skip
    angle = 3.0 / radius * 12.0
    right = radius * np.array([math.sin(angle), 1 - math.cos(angle), 0])
    assert path.landing.position == pytest.approx(right, abs=integrated(1e-8) * 3.0 * 12.0)
    true = np.linalg.norm(path.landing.position - right)
    assert true < path.error < 10 * true


FLIGHTS = {
    "kick": (launch((25, 0, 12), spin=(0, -25.0, 10)), kd.Air()),
    "lift alone": (launch((20, 5, 10), spin=(10, -80, 30)), kd.Air(drag=None, lift=0.3)),
    "fast": (launch((300, 0, 120), spin=(0, -25, 10)), kd.Air()),
    "crisis": (launch((9, 2, 24), spin=(5, -30, 10)), kd.Air(drag="tango12")),
    "wind": (launch((20, 3, 12), spin=(5, -30, 10)), kd.Air(wind=(-30, 12, 2))),
}


@pytest.mark.parametrize("name", FLIGHTS)
def test_the_forces_do_the_work_that_the_ball_loses(name):
    """Weight and buoyancy do none from launch height to launch height."""
    state, air = FLIGHTS[name]
    path = kd.fly(state, BALL, air, tol=1e-12)
    nodes, weights = np.polynomial.legendre.leggauss(20)
    work = 0.0
    for began, ended in itertools.pairwise(path.duration * np.linspace(0, 1, 31) ** 3):
        states = path.sample((ended - began) / 2 * nodes + (began + ended) / 2)
        power = []
        for v, spin in zip(states.velocity, states.spin, strict=True):
            rate = rates(np.concatenate([np.zeros(3), v, spin]), BALL, air)[3:6]
            power.append(BALL.mass * (rate @ v + downward(BALL, air) * v[2]))
        work += (ended - began) / 2 * float(weights @ power)
    kinetic = [BALL.mass / 2 * node.speed**2 for node in (path.launch, path.landing)]
    assert kinetic[1] - kinetic[0] == pytest.approx(work, abs=1e-8 * kinetic[0])


def test_a_flight_with_lift_alone_can_be_reversed():
    """Backwards in time omega x v keeps its sense if the spin is reversed as well."""
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
        ((2, 0.3, 6), 1.2, 6.0),  # through Re 2e4 to 7e4, where formulas join
        ((50, 2, 22), 3.0, 7.0),  # through 35 m/s, where the data end
    ],
)
def test_the_error_falls_with_about_the_eighth_power_of_the_evaluations(velocity, end, least):
    motion = FlightEquations(launch(velocity, spin=(5, -30, 15)), BALL, kd.Air())

    def arc(tol):
        tolerance = Tolerance(max(tol, FINEST), np.full(7, tol))
        return integrate(motion.rates, (0.0, motion.begin), [CREST], end, tolerance)

    exact = arc(1e-14).state
    arcs = [arc(10.0**-k) for k in np.arange(3, 10.6, 0.25)]
    errors = [np.abs(each.state - exact).max() for each in arcs]
    slope, _ = np.polyfit(np.log([each.evaluations for each in arcs]), np.log(errors), 1)
    assert -slope > least


# --- events of a parabola -------------------------------------------------------------------------


def fall(_, y):
    return [*y[3:], 0.0, 0.0, -10.0]


TOLERANCE = Tolerance(1e-10, np.full(6, 1e-10))
START = np.array([0, 0, 0, 1.0, 0, 10.0])


def event(function, name="there"):
    return kd.Event(name, lambda state, numbers: function(state))


def test_an_arc_ends_at_the_event():
    level = event(lambda y: y[5])
    arc = integrate(fall, (2.0, START), [level], 100.0, TOLERANCE)
    assert arc.reached is level
    assert arc.end == pytest.approx(3.0, rel=1e-14)
    assert arc.state == pytest.approx([1, 0, 5, 1, 0, 0], abs=1e-12)
    samples = trajectory(arc, START)(np.array([2.0, 2.5, 3.0]))
    assert samples[2] == pytest.approx([0, 3.75, 5], abs=1e-12)


def test_an_arc_without_an_event_ends_at_the_time_limit():
    deep = event(lambda y: y[2] + 1e6)
    arc = integrate(fall, (0.0, START), [deep, CREST], 3.0, TOLERANCE)
    ((passed, locate),) = arc.passed
    assert (arc.reached, arc.end, passed) == (None, 3.0, CREST)
    assert arc.state == pytest.approx([3, 0, -15, 1, 0, -20])
    assert locate()[0] == pytest.approx(1.0)


def test_the_first_of_several_events_ends_an_arc():
    ends = [event(lambda y, x=x: x - y[0]) for x in (1.9, 1.5, 1.7)]
    assert integrate(fall, (0.0, START), ends, 3.0, TOLERANCE).reached is ends[1]


@pytest.mark.parametrize("brake", [2.0, 2e5])
def test_an_event_that_is_zero_at_the_start_must_rise_first(brake):
    """It starts level, rises, and comes down: in the second case within a step."""

    def hop(t, y):
        return [*y[3:], 0.0, 0.0, 1.0 - brake * t]

    loose = Tolerance(1e-6, np.full(6, 1e-2))
    arc = integrate(hop, (0.0, np.zeros(6)), [event(lambda y: y[5])], 10.0, loose)
    assert arc.end == pytest.approx(2 / brake, rel=1e-6)


def test_an_event_that_comes_and_goes_within_a_step_is_found():
    """The speed -(t - 1) (t - 2) leads down to -1/30 at 1 s, then up."""

    def sway(t, y):
        return [0.0, 0.0, y[5], 0.0, 0.0, 3.0 - 2.0 * t]

    low = event(lambda y: y[2])
    start = (0.0, np.array([0.0, 0.0, 0.8, 0.0, 0.0, -2.0]))
    arc = integrate(sway, start, [low], 2.05, Tolerance(1e-2, np.full(6, 1e3)))
    assert arc.reached is low
    assert 0.7 < arc.end < 1.0


@pytest.mark.parametrize("bad", [math.nan, math.inf])
@pytest.mark.parametrize("when", [0.0, 0.5])
def test_an_acceleration_that_is_no_number_ends_in_an_error(bad, when):
    def broken(t, y):
        return [*y[3:], 0.0, 0.0, bad if t >= when else -10.0]

    with pytest.raises(kd.KickdynError, match=r"not finite|could not be integrated beyond"):
        integrate(broken, (0.0, np.zeros(6)), [event(lambda y: y[2] + 100)], 10.0, TOLERANCE)


def test_an_endless_integration_ends_in_an_error(monkeypatch):
    """In syrup a ball comes to rest in 1e-7 s, then creeps for seconds."""
    monkeypatch.setattr(integrate_module, "MAX_EVALUATIONS", 2000)
    with pytest.raises(kd.KickdynError, match="more than 2000 evaluations"):
        kd.fly(launch((10, 0, 10)), BALL, kd.Air(viscosity=1e6))
