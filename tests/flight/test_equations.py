"""The equations of motion, and the tolerances they are integrated to."""

import math

import numpy as np
import pytest
from mpmath import mp, mpf

import kickdyn as kd
from kickdyn.aerodynamics.drag import constant
from kickdyn.flight.equations import MAX_SPEED, FlightEquations, drag_length, tolerances

BALL = kd.Ball()


def test_a_flight_does_not_depend_on_its_plane():
    flat = kd.fly(kd.BallState(velocity=(20, 0, 9), spin=(0, -40, 0)), BALL, kd.Air(), tol=1e-13)
    c, s = math.cos(0.7), math.sin(0.7)
    turned = kd.BallState(velocity=(20 * c, 20 * s, 9), spin=(40 * s, -40 * c, 0))
    path = kd.fly(turned, BALL, kd.Air(), tol=1e-13)
    assert path.range == pytest.approx(flat.range, abs=1e-8)
    assert path.duration == pytest.approx(flat.duration, abs=1e-10)
    assert np.linalg.norm(path.landing.spin) == pytest.approx(abs(flat.landing.spin[1]), rel=1e-10)


def test_spin_decays_as_the_law_says():
    """At constant speed, exponentially: I omega' = -(rho A R^2 beta v + 8 pi mu R^3) omega."""
    air = kd.Air(drag=None, lift=None, buoyancy=False)
    path = kd.fly(kd.BallState(velocity=(25, 0, 1e-3), spin=(0, 60, 20)), BALL, air)
    t = path.duration
    tau = 2 * BALL.mass / (3 * air.density * BALL.cross_section * 0.010 * 25)
    assert tau == pytest.approx(25.1, abs=0.1)  # for m 0.43, C 0.69
    creep = 8 * math.pi * air.viscosity * BALL.radius**3 / BALL.inertia
    left = math.exp(-t * (1 / tau + creep))
    assert path.landing.spin == pytest.approx(left * np.array([0, 60, 20]), rel=1e-9)


def test_no_torque_no_decay():
    path = kd.fly(kd.BallState(velocity=(25, 0, 9), spin=(0, 60, 0)), BALL, kd.Air(torque=None))
    assert path.landing.spin.tolist() == [0, 60, 0]


def test_wind_may_depend_on_height():
    shear = kd.Air(wind=lambda z: (-2.0 * z, 0.0, 0.0))
    still, steady = kd.Air(), kd.Air(wind=(-2.0, 0.0, 0.0))
    launch = kd.BallState(velocity=(20, 0, 9))
    ranges = [kd.fly(launch, BALL, air).range for air in (still, steady, shear)]
    assert ranges == sorted(ranges, reverse=True)
    constant = kd.Air(wind=lambda z: (-2.0, 0.0, 0.0))
    assert kd.fly(launch, BALL, constant).range == pytest.approx(ranges[1], rel=1e-8)


# --- what tolerances are relative to --------------------------------------------------------------

VACUUM = kd.Air(density=0.0)
G = 9.81


@pytest.mark.parametrize(
    ("speed", "drop", "wind", "length", "pace"),
    [
        (20.0, 0.0, 0.0, 400 / G, 20.0),
        (0.0, 5.0, 0.0, 10.0, math.sqrt(10 * G)),
        (1.0, 0.0, 10.0, 100 / G, 10.0),
        (1e-3, 7.0, 0.0, 14.0, math.sqrt(14 * G)),
        (1e3, 0.0, 0.0, 1e6 / G, 1e3),
    ],
)
def test_in_a_vacuum_tolerances_are_relative_to_the_parabola(speed, drop, wind, length, pace):
    found = tolerances(speed, drop, wind, BALL, VACUUM, 1e-6)
    assert found == pytest.approx((1e-6, 1e-6 * length, 1e-6 * pace))


@pytest.mark.parametrize("speed", [1e-3, 30.0, 1e3, 1e8])
def test_with_drag_they_are_relative_to_the_closed_form_straight_up(speed):
    air = kd.Air(drag=constant(0.2), lift=None, buoyancy=False)
    k = 0.5 * air.density * BALL.cross_section * 0.2 / BALL.mass
    height = math.log1p(k * speed**2 / G) / (2 * k)
    back = speed / math.sqrt(1 + k * speed**2 / G)
    found = tolerances(speed, 0.0, 0.0, BALL, air, 1e-6)
    assert found == pytest.approx((1e-6, 2e-6 * height, 1e-6 * back), rel=1e-9)


def test_creeping_flow_has_stokes_length():
    bead = kd.Ball(1e-3, 1e-3)
    syrup = kd.Air(density=1.2, viscosity=0.5)
    for speed in (1e-6, 1e-3, 0.1):  # Re up to 5e-4
        stokes = speed * bead.mass / (6 * math.pi * 0.5 * bead.radius)
        found = float(drag_length(bead, syrup)(np.array(speed)))
        assert stokes * 0.99 < found < stokes * 1.34  # steps of 8 a decade


@pytest.mark.parametrize("speed", [15.0, 60.0, 1e3])
def test_the_drag_length_is_of_the_least_drag_on_the_way(speed):
    air = kd.Air()
    least = min(air.drag(14_500 * v) for v in np.geomspace(speed / 1e3, speed, 4000))
    bound = 2 * BALL.mass / (air.density * BALL.cross_section * least)
    assert float(drag_length(BALL, air)(np.array(speed))) == pytest.approx(bound, rel=0.3)


def test_many_are_the_same_as_each():
    draw = np.random.default_rng(1)
    speed = 10.0 ** draw.uniform(-6, 6, 50)
    drop, wind = draw.uniform(0, 100, 50), draw.uniform(0, 9, 50)
    rtol, near, slow = tolerances(speed, drop, wind, BALL, kd.Air(), 1e-9)
    for i in range(50):
        one = tolerances(speed[i], drop[i], wind[i], BALL, kd.Air(), 1e-9)
        assert one == pytest.approx((rtol, near[i], slow[i]), rel=1e-14, abs=0)
    none = tolerances(np.empty(0), np.empty(0), 0.0, BALL, kd.Air(), 1e-9)
    assert none[1].shape == none[2].shape == (0,)


def silent(reynolds, spin_parameter):
    raise ValueError("no data")


@pytest.mark.parametrize(
    "drag", [None, silent, constant(0.0), constant(math.nan), constant(math.inf), constant(-1.0)]
)
def test_a_drag_that_says_nothing_bounds_nothing(drag):
    found = tolerances(5.0, 0.0, 0.0, BALL, kd.Air(drag=drag, buoyancy=False), 1)
    assert found[1:] == pytest.approx((25 / G, 5))


@pytest.mark.parametrize("mass", [1e-300, 0.005, 1.204 * BALL.volume])
def test_they_stay_within_double_precision(mass):
    """A balloon at rest, one that neither sinks nor rises; a launch at any speed."""
    for speed in (0.0, 1e-300, 1e8, 1e100):
        rtol, near, slow = tolerances(speed, 0.0, 0.0, kd.Ball(mass, BALL.radius), kd.Air(), 1e-13)
        assert rtol >= 10 * np.finfo(float).eps  # else a step's estimated error is rounding
        assert min(near, slow) > 0


# --- what they are for --------------------------------------------------------------------------


@pytest.mark.parametrize("tol", [1e-6, 1e-9, 1e-12])
@pytest.mark.parametrize("speed", [1e-6, 1.0, 1e3, 1e5, MAX_SPEED])
def test_a_flight_is_right_relative_to_its_own_length(speed, tol):
    """Straight up and down against the closed form, from a micrometre a second to light."""
    air = kd.Air(drag=constant(0.2), lift=None, buoyancy=False)
    path = kd.fly(kd.BallState(velocity=(0, 0, speed)), BALL, air, tol=tol)
    with mp.workdps(40):
        k = mpf(air.density) * BALL.cross_section * mpf(0.2) / (2 * mpf(BALL.mass))
        g, v = mpf(G), mpf(speed)
        height = mp.log1p(k * v**2 / g) / (2 * k)
        climb = mp.atan(v * mp.sqrt(k / g)) / mp.sqrt(g * k)
        fall = mp.asinh(mp.sqrt(mp.expm1(2 * k * height))) / mp.sqrt(g * k)
        back = v / mp.sqrt(1 + k * v**2 / g)
    assert path.height == pytest.approx(float(height), rel=20 * tol)
    assert path.duration == pytest.approx(float(climb + fall), rel=20 * tol)
    assert path.landing.velocity[2] == pytest.approx(-float(back), rel=20 * tol)


@pytest.mark.parametrize("speed", [300.0, 1e3, 1e4])
def test_error_estimates_hold_for_fast_launches(speed):
    launch = kd.BallState(velocity=(0.8 * speed, 0.1 * speed, 0.6 * speed), spin=(5, -40, 20))
    exact = kd.fly(launch, BALL, kd.Air(), tol=1e-13)
    for tol in (1e-5, 1e-8):
        path = kd.fly(launch, BALL, kd.Air(), tol=tol)
        true = float(np.linalg.norm(path.landing.position - exact.landing.position))
        assert true <= path.error
        assert true < 100 * tol * np.linalg.norm(exact.landing.position)


def test_error_estimates_hold_over_eight_decades_of_speed():
    rng = np.random.default_rng(11)
    ratios = []
    for _ in range(80):
        ahead = rng.normal(size=3) * [1, 1, 0] + [0, 0, rng.uniform(0.2, 2)]
        velocity = 10 ** rng.uniform(-4, 4) * ahead / np.linalg.norm(ahead)
        spin = rng.normal(size=3) * rng.choice([0, 30, 3000])
        state = kd.BallState((0, 0, BALL.radius + rng.uniform(0, 30)), velocity, spin)
        air, tol = kd.Air(wind=rng.normal(size=3) * rng.choice([0, 10])), 10 ** rng.uniform(-10, -4)
        path, exact = (kd.fly(state, BALL, air, kd.Ground(), t) for t in (tol, 1e-13))
        moved = exact.landing.position - state.position
        true = float(np.linalg.norm(path.landing.position - exact.landing.position))
        assert true <= path.error
        assert true <= 300 * tol * max(np.abs(moved).max(), exact.height)
        ratios.append(path.error / max(true, 1e-300))
    assert np.median(ratios) < 100


@pytest.mark.parametrize(
    ("velocity", "spin", "air", "count"),
    [
        ((10, 3, 5), (0, 0, 0), kd.Air(drag=None, lift=None), 6),  # x and y at constant speed
        ((0, 0, 5), (0, 0, 0), kd.Air(drag=None, lift=None), 2),
        ((10, 0, 5), (0, 9, 0), kd.Air(), 5),
        ((10, 0, 5), (9, 0, 0), kd.Air(torque=None), 6),
    ],
)
def test_states_that_change_are_counted(velocity, spin, air, count):
    launch = kd.BallState(velocity=velocity, spin=spin)
    assert FlightEquations(launch, BALL, air).count_changing() == count
