"""What a flight is, whatever computes it."""

import dataclasses
import math
import pickle
import re
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import kickdyn as kd
from kickdyn.aerodynamics.drag import constant
from kickdyn.flight import fly as fly_module
from kickdyn.flight import forces, integrate

BALL = kd.Ball()
KICK = (25, 3, 12)


def launch(velocity=KICK, spin=(0, 0, 0), height=0.0, at=(0, 0)):
    return kd.BallState((*at, height), velocity, spin)


def side(path):
    """How far the landing lies to the left of the launch direction [m]."""
    x, y, _ = path.launch.velocity
    dx, dy, _ = path.landing.position - path.launch.position
    return (x * dy - y * dx) / math.hypot(x, y)


# --- the paper's Fig. 8 -------------------------------------------------------------------------


def test_figure_8():
    thirty = math.radians(30)
    velocity = (30 * math.cos(thirty), 0, 30 * math.sin(thirty))
    ball, air = kd.Ball.paper(), kd.Air.paper()
    vacuum = kd.fly(launch(velocity), ball)
    drag = kd.fly(launch(velocity), ball, air)
    back, top = (kd.fly(launch(velocity, (0, w, 0)), ball, air) for w in (-180, 180))
    assert vacuum.range == pytest.approx(79.4, abs=0.1)
    assert back.height > vacuum.height > drag.height > top.height
    assert vacuum.range > drag.range > top.range
    assert back.range > top.range
    assert top.range < 0.6 * drag.range  # "much shorter"
    assert back.duration > vacuum.duration > drag.duration > top.duration
    assert all(abs(path.landing.position[1]) < 1e-9 for path in (vacuum, drag, back, top))


# --- which way it goes --------------------------------------------------------------------------


@pytest.mark.parametrize("azimuth_deg", [0, 90, 200])
def test_spin_bends_the_flight_the_right_way(azimuth_deg):
    turn = math.radians(azimuth_deg)
    ahead = np.array([math.cos(turn), math.sin(turn), 0])
    left = np.array([-math.sin(turn), math.cos(turn), 0])
    velocity = 25 * ahead + [0, 0, 10]

    def fly(spin):
        return kd.fly(launch(velocity, spin), BALL, kd.Air())

    plain = fly((0, 0, 0))
    assert fly(-60 * left).height > plain.height > fly(60 * left).height  # back spin, top spin
    assert side(fly((0, 0, 60))) > 1 > abs(side(plain))  # anticlockwise from above curves left
    assert side(fly((0, 0, -60))) < -1
    assert side(fly((0, 0, 60))) == pytest.approx(-side(fly((0, 0, -60))), rel=1e-7)


def mirrored(vector):
    return np.array(vector) * [1, -1, 1]


def test_mirror_image():
    spin, wind = np.array([20.0, -40, 30]), np.array([-3.0, 4, 1])
    path = kd.fly(launch(spin=spin), BALL, kd.Air(wind=wind))
    image = kd.fly(
        launch(mirrored(KICK), -mirrored(spin)),  # a spin turns the other way in a mirror
        *(BALL, kd.Air(wind=mirrored(wind))),
    )
    assert image.duration == pytest.approx(path.duration, rel=1e-12)
    assert image.landing.position == pytest.approx(mirrored(path.landing.position), rel=1e-12)
    assert abs(path.landing.position[1]) > 1


@pytest.mark.parametrize("spin", [(0, 0, 0), (10, -40, 20)])
def test_wind_is_a_moving_frame(spin):
    wind = np.array([4.0, -3.0, 0])
    still = kd.fly(launch(spin=spin), BALL, kd.Air(), tol=1e-12)
    windy = kd.fly(launch(KICK + wind, spin), BALL, kd.Air(wind=wind), tol=1e-12)
    assert windy.duration == pytest.approx(still.duration, rel=1e-10)
    carried = still.landing.position + wind * still.duration
    assert windy.landing.position == pytest.approx(carried, abs=1e-8)
    assert windy.landing.velocity == pytest.approx(still.landing.velocity + wind, abs=1e-8)


def test_flight_does_not_depend_on_where_it_starts():
    here, there = (
        kd.fly(launch(spin=(0, -40, 9), height=z, at=at), BALL, kd.Air(), ground)
        for z, at, ground in (
            (0.5, (0, 0), kd.Ground()),
            (500.5, (1e3, -1e3), kd.Ground(500)),
        )
    )
    moved = there.landing.position - there.launch.position
    assert moved == pytest.approx(here.landing.position - here.launch.position, abs=1e-8)
    assert there.duration == pytest.approx(here.duration, rel=1e-9)


def test_air_of_no_density_is_the_vacuum():
    spinning = launch(spin=(0, -100, 0))
    vacuum, nothing = kd.fly(spinning, BALL), kd.fly(spinning, BALL, kd.Air(density=0.0))
    thin = kd.fly(spinning, BALL, kd.Air(density=1e-9, viscosity=1e-14))
    assert nothing.landing.position.tolist() == vacuum.landing.position.tolist()
    assert thin.landing.position == pytest.approx(vacuum.landing.position, abs=1e-7)
    assert thin.evaluations > 0


def test_buoyancy_is_less_gravity():
    air = kd.Air(density=20.0, drag=None, lift=None)
    share = 1 - 20 * BALL.volume / BALL.mass
    vacuum, afloat = kd.fly(launch(), BALL), kd.fly(launch(), BALL, air)
    assert 0 < share < 1
    assert afloat.duration == pytest.approx(vacuum.duration / share, rel=1e-14)
    assert afloat.height == pytest.approx(vacuum.height / share, rel=1e-14)


# --- where it ends ------------------------------------------------------------------------------

AIRS = {"vacuum": None, "air": kd.Air(), "spin": kd.Air(wind=(2, 3, 0))}
every_air = pytest.mark.parametrize("air", AIRS.values(), ids=AIRS)


@every_air
@pytest.mark.parametrize("height", [-2.0, 0.0, 100.0])
def test_lands_on_the_ground(air, height):
    path = kd.fly(launch(spin=(0, -40, 9), height=height + 1.5), BALL, air, kd.Ground(height))
    assert path.status == "landed"
    assert path.landing.position[2] == pytest.approx(height + BALL.radius, abs=1e-9)
    assert path.landing.velocity[2] < 0
    assert float(path.sample(path.duration).position[2]) == pytest.approx(
        height + BALL.radius, abs=1e-9
    )


@every_air
def test_without_ground_it_ends_at_the_height_of_the_launch(air):
    path = kd.fly(launch(spin=(0, -40, 9), height=7.0), BALL, air)
    assert path.landing.position[2] == 7.0
    assert path.landing.velocity[2] < 0


@every_air
def test_highest_point(air):
    path = kd.fly(launch(spin=(0, -40, 9)), BALL, air)
    assert path.apex.velocity[2] == pytest.approx(0, abs=1e-9)
    heights = path.sample(np.linspace(0, path.duration, 2001)).position[:, 2]
    assert heights.max() == pytest.approx(path.height, abs=1e-4)
    assert heights.max() <= path.height + 1e-12


@every_air
@pytest.mark.parametrize("velocity", [(20, 0, 0), (20, 0, -5), (0, 0, 0), (0, 0, -1e-300)])
def test_whoever_does_not_rise_has_landed(air, velocity):
    for ground, height in ((None, 3.0), (kd.Ground(), BALL.radius)):
        path = kd.fly(launch(velocity, height=height), BALL, air, ground)
        assert (path.status, path.duration, path.range, path.height) == ("landed", 0, 0, 0)
        assert path.sample(0.0).velocity.tolist() == list(velocity)


@every_air
@pytest.mark.parametrize("velocity", [(20, 0, 0), (20, 0, -5), (0, 0, 0)])
def test_from_above_it_falls(air, velocity):
    path = kd.fly(launch(velocity, height=2 + BALL.radius), BALL, air, kd.Ground())
    assert path.duration > 0.2
    assert path.height == 0
    assert path.apex.time == 0


def test_back_spin_lifts_a_ball_kicked_level_or_downward():
    air, spin = kd.Air(), (0, -150, 0)
    level = kd.fly(launch((30, 0, 0), spin), BALL, air)
    assert level.height > 1
    down = kd.fly(launch((40, 0, -2), spin, height=2.0), BALL, air, kd.Ground())
    heights = down.sample(np.linspace(0, down.duration, 2001)).position[:, 2]
    assert heights.min() < 2 < heights.max()  # it dips first, then climbs
    assert down.height == pytest.approx(heights.max() - 2, abs=1e-4)
    assert down.apex.velocity[2] == pytest.approx(0, abs=1e-8)


def test_updraft_keeps_it_aloft():
    path = kd.fly(launch((1, 0, 5)), BALL, kd.Air(wind=(0, 0, 60)), time_limit=20.0)
    assert (path.status, path.duration) == ("aloft", 20.0)
    assert path.apex.position[2] == path.landing.position[2] > 100  # still climbing


def test_balloon_rises_from_rest():
    balloon = kd.Ball(mass=0.005, radius=0.11)
    path = kd.fly(launch((0, 0, 0)), balloon, kd.Air(drag=constant(0.4)), time_limit=5.0)
    carried = kd.Air().density * balloon.volume - balloon.mass
    speed = math.sqrt(2 * carried * 9.81 / (kd.Air().density * balloon.cross_section * 0.4))
    assert path.status == "aloft"
    assert path.landing.velocity == pytest.approx([0, 0, speed], rel=1e-6)


@pytest.mark.parametrize(
    ("gap", "velocity", "back_spin", "tol"),
    [
        (0.35548, (32.004, 0, -2.3442), 114, 1e-2),
        (0.32610, (31.652, 0, -1.9300), 129, 1e-2),
        (0.20950, (30.428, 0, -1.4211), 79.6, 1e-4),
        (0.277, (27.38, 0, -0.47), 77, 1e-6),
    ],
    ids=["lands", "rises", "lands within a tighter step", "rises within a tighter step"],
)
def test_a_ball_that_sinks_rises_and_sinks_again_within_a_step(gap, velocity, back_spin, tol):
    state = kd.BallState((0, 0, BALL.radius + gap), velocity, (0, -back_spin, 0))
    path, exact = (kd.fly(state, BALL, kd.Air(), kd.Ground(), each) for each in (tol, 1e-10))
    assert path.range == pytest.approx(exact.range, rel=tol)
    assert path.height == pytest.approx(exact.height, abs=tol * exact.range)


def test_the_apex_is_as_exact_as_the_landing():
    """Against a flight with a thousandth of the tolerance, through the joins of the drag."""
    for seed in range(12):
        draw = np.random.default_rng(seed)
        state = launch(draw.normal(size=3) * [8, 8, 2] + [0, 0, 6], draw.normal(size=3) * 20)
        path, exact = (kd.fly(state, BALL, kd.Air(), tol=tol) for tol in (1e-9, 1e-12))
        near = 1e-8 * (path.range + path.height)
        assert path.apex.position == pytest.approx(exact.apex.position, abs=near)
        assert path.apex.velocity == pytest.approx(exact.apex.velocity, abs=1e-7)
        assert path.apex.velocity[2] == pytest.approx(0, abs=1e-12)


# --- samples ------------------------------------------------------------------------------------


@every_air
def test_samples_meet_the_nodes(air):
    path = kd.fly(launch(spin=(0, -40, 9), height=2.0), BALL, air, kd.Ground())
    for node in (path.launch, path.apex, path.landing):
        near = 2e-8 if node is path.apex else 1e-9  # within a step, samples are interpolated
        here = path.sample(node.time)
        assert here.position == pytest.approx(node.position, abs=near)
        assert here.velocity == pytest.approx(node.velocity, abs=near)
        assert here.spin == pytest.approx(node.spin, abs=near)
        assert here.time == node.time


@every_air
def test_samples_are_smooth_across_the_apex(air):
    path = kd.fly(launch(spin=(0, -40, 9)), BALL, air)
    t = path.apex.time + 1e-6 * np.array([-1, 0, 1])
    states = path.sample(t)
    before, after = np.diff(states.position, axis=0)
    assert before == pytest.approx(1e-6 * states.velocity[0], abs=1e-10)
    assert after == pytest.approx(before, abs=1e-10)
    assert np.diff(states.velocity, axis=0) == pytest.approx(0, abs=1e-4)
    many = path.sample(np.linspace(0, path.duration, 500))
    steps = np.diff(many.position, axis=0) / (path.duration / 499)
    middles = (many.velocity[1:] + many.velocity[:-1]) / 2
    assert np.abs(steps - middles).max() < 1e-3  # velocity is the slope of position


@every_air
@pytest.mark.parametrize("shape", [(), (0,), (1,), (7,)])
def test_samples_have_the_shape_of_the_times(air, shape):
    path = kd.fly(launch(), BALL, air)
    states = path.sample(np.zeros(shape))
    assert states.position.shape == states.velocity.shape == states.spin.shape == (*shape, 3)
    assert np.shape(states.time) == shape


@every_air
@pytest.mark.parametrize(
    ("t", "said"),
    [
        (-1e-9, "t is -1e-09 s: the flight lasts from 0 to"),
        (99, "t is 99 s"),
        ([0, 1, 99], "t is 99 s"),
        (math.nan, "finite"),
        ("1", "real numbers"),
        ([[0.0]], "shape"),
    ],
)
def test_times_outside_the_flight_are_refused(air, t, said):
    with pytest.raises(kd.InvalidInput, match=said):
        kd.fly(launch(), BALL, air).sample(t)


# --- bad input ----------------------------------------------------------------------------------


def test_many_states_are_refused():
    many = kd.BallState(np.zeros((2, 3)), np.zeros((2, 3)), np.zeros((2, 3)), [0, 1])
    with pytest.raises(kd.InvalidInput, match=r"shape \(2, 3\): fly takes one, "):
        kd.fly(many, BALL)


@pytest.mark.parametrize("depth", [1e-6, 0.05, 10])
def test_ball_inside_the_ground_is_refused(depth):
    words = rf"starts {depth:g} m inside the ground: .* at or above {5 + BALL.radius:g} m$"
    with pytest.raises(kd.InvalidInput, match=words):
        kd.fly(launch(height=5 + BALL.radius - depth), BALL, ground=kd.Ground(5.0))


def test_ball_on_the_ground_may_be_off_by_rounding():
    path = kd.fly(launch(height=(0.1 + BALL.radius) - 2e-17), BALL, ground=kd.Ground(0.1))
    assert path.range > 10


@pytest.mark.parametrize(
    ("options", "said"),
    [
        *[({"tol": tol}, "tol is") for tol in (0, -1, 1e-14, 0.1, math.nan, "1e-9")],
        *[({"time_limit": limit}, "time limit is") for limit in (0, -1, math.inf, None)],
    ],
)
def test_bad_options_are_refused(options, said):
    with pytest.raises(kd.InvalidInput, match=said):
        kd.fly(launch(), BALL, kd.Air(), **options)


def test_flight_is_frozen_and_says_how_it_was_computed():
    path = kd.fly(launch(spin=(0, 9, 0)), BALL, kd.Air(), tol=1e-8)
    assert path.method == "DOP853, rtol 1e-08, drag, lift, spin decay"
    assert kd.fly(launch(spin=(0, 9, 0)), BALL, kd.Air(drag=None)).method.endswith(
        ", lift, spin decay"
    )
    assert path.evaluations > 0
    with pytest.raises(dataclasses.FrozenInstanceError):
        path.status = "lost"
    assert "_trajectory" not in repr(path)


# --- anything -----------------------------------------------------------------------------------


def vectors(largest):
    return st.tuples(*[st.floats(-largest, largest)] * 3)


@given(
    vectors(40),
    vectors(200),
    vectors(10),
    st.floats(0, 50),
    st.sampled_from(["brazuca", "jabulani", "sphere"]),
)
def test_any_launch_lands_where_it_should(velocity, spin, wind, height, drag):
    start = launch(velocity, spin, height + BALL.radius)
    path = kd.fly(start, BALL, kd.Air(wind=wind, drag=drag), kd.Ground(), 1e-6, time_limit=60.0)
    assert path.status == "landed"
    assert path.landing.position[2] == pytest.approx(BALL.radius, abs=1e-9)
    assert path.range >= 0
    assert path.height >= 0
    assert 0 <= path.apex.time <= path.duration
    states = path.sample(np.linspace(0, path.duration, 50))
    assert np.isfinite(states.position).all()
    heights = states.position[:, 2]
    assert heights.min() > BALL.radius - 1e-4
    assert heights.max() < start.position[2] + path.height + 1e-4


# --- error, warnings ----------------------------------------------------------------------------


def test_error_is_never_below_the_true_one():
    """60 random kicks against tol = 1e-13; in the median not above 10 times."""
    rng = np.random.default_rng(7)
    ratios = []
    for _ in range(60):
        velocity = rng.normal(size=3) * 12 + [10, 0, 10]
        spin = rng.normal(size=3) * rng.choice([0, 30, 80])
        air = kd.Air(wind=rng.normal(size=3) * rng.choice([0, 4]))
        tol = 10 ** rng.uniform(-10, -4)
        state = launch(velocity, spin, height=BALL.radius + rng.uniform(0, 3))
        path = kd.fly(state, BALL, air, kd.Ground(), tol)
        exact = kd.fly(state, BALL, air, kd.Ground(), 1e-13)
        true = np.linalg.norm(path.landing.position - exact.landing.position)
        assert path.error >= true
        ratios.append(path.error / max(true, 1e-16))
    assert np.median(ratios) < 10


def test_error_at_the_finest_tolerances():
    """Slow kicks through the joins of the drag, against the other engine at 1e-13."""
    rng = np.random.default_rng(11)
    velocity = rng.normal(size=(30, 3)) * [4, 4, 2] + [0, 0, 6]
    states = kd.BallState([(0, 0, 0.5)] * 30, velocity, rng.normal(size=(30, 3)) * 40, [0.0] * 30)
    exact = kd.fly_many(states, BALL, kd.Air(), kd.Ground(), 1e-13).landing_position.values
    for tol, rows in ((1e-11, slice(0, 10)), (1e-12, slice(10, 20)), (1e-13, slice(20, 30))):
        for position, u, spin, landing in zip(
            *(part[rows] for part in (states.position, states.velocity, states.spin, exact)),
            strict=True,
        ):
            path = kd.fly(kd.BallState(position, u, spin), BALL, kd.Air(), kd.Ground(), tol)
            assert path.error + 3e-10 >= np.linalg.norm(path.landing.position - landing)


def test_functions_that_fail_are_named():
    def broken(reynolds, spin_parameter):
        raise KeyError("no such ball")

    with pytest.raises(kd.KickdynError, match=r"not finite.*raised KeyError: 'no such ball'"):
        kd.fly(launch(), BALL, kd.Air(drag=broken))
    with pytest.raises(kd.InvalidInput, match=r"wind at the launch, 0 m high, raised ValueError"):
        kd.fly(launch(), BALL, kd.Air(wind=lambda z: (3 * math.log(z / 0.03), 0.0, 0.0)))


@pytest.mark.parametrize("value", [-0.2, math.nan, math.inf])
@pytest.mark.parametrize("kind", ["drag", "lift", "torque"])
def test_a_coefficient_that_is_not_finite_or_negative_ends_in_an_error(kind, value):
    def coefficient(reynolds, spin_parameter):
        return value

    ball = kd.BallState(velocity=(20, 0, 10), spin=(0, -50, 0))
    if kind != "drag" and value < 0:  # such a flight can be integrated
        assert kd.fly(ball, BALL, kd.Air(**{kind: coefficient})).status == "landed"
        return
    said = "not finite|could not be integrated"
    with pytest.raises(kd.KickdynError, match=said):
        kd.fly(ball, BALL, kd.Air(**{kind: coefficient}))
    with pytest.raises(kd.KickdynError, match=said):
        kd.fly(ball, BALL, kd.Air(**{kind: constant(value)}))


@pytest.mark.parametrize("speed", [1e-120, 1e-160, 1e-200, 1e-300])
def test_what_is_too_slow_for_the_air_flies_without_it(speed):
    launched = kd.BallState(velocity=(speed, 0, speed), spin=(0, 3, 0))
    path = kd.fly(launched, BALL, kd.Air(torque=None, buoyancy=False))
    assert path.duration == pytest.approx(2 * speed / 9.81, rel=1e-12)
    np.testing.assert_allclose(path.landing.velocity, (speed, 0, -speed), rtol=1e-12)


@pytest.mark.parametrize(
    "profile", [lambda z: 4 * (z / 10) ** 0.143, lambda z: 3 * math.log(z / 0.03)]
)
def test_wind_need_not_be_defined_where_no_ball_is(profile):
    air = kd.Air(wind=lambda z: (profile(z), 0.0, 0.0))
    state = launch((20, 1, 8), (0, -30, 15), height=BALL.radius)
    path = kd.fly(state, BALL, air, kd.Ground())
    many = kd.fly_many(kd.BallState([state.position], [state.velocity], [state.spin], [0]),
                       BALL, air, kd.Ground())  # fmt: skip
    assert path.landing.position == pytest.approx(many.landing_position.values[0], abs=1e-5)


def test_thin_air_that_is_too_slow_for_a_force_still_brakes_the_spin():
    r"""Creeping flow has a torque without density: :math:`\dot\omega = -8 \pi \mu r^3 \omega/I`."""
    air = kd.Air(density=1e-107, drag=None, lift=None)
    path = kd.fly(launch((10, 0, 10), (0, 30, 0)), BALL, air)
    k = 8 * math.pi * air.viscosity * BALL.radius**3 / BALL.inertia
    left = math.exp(-k * 2 * 10 / 9.81)
    assert left < 1 - 1e-4
    assert path.landing.spin[1] == pytest.approx(30 * left, rel=1e-9)


@pytest.mark.parametrize(
    "air", [None, kd.Air(drag=constant(0.0), lift=None, torque=None, buoyancy=False)]
)
def test_the_rounding_at_a_wall_that_a_ball_grazes_is_counted(air):
    """20 m/s along a wall 1 km away from the origin and 1 um/s towards it, in exact fractions."""
    plane = kd.Plane((0, 0, 0), (0.6, 0.8, 0), "centre")
    nx, ny, _ = plane.normal.tolist()
    start = kd.BallState((800.0 + 0.6e-6, -600.0 + 0.8e-6, 3), (16 - 0.6e-6, -12 - 0.8e-6, 5))
    path = kd.fly(start, BALL, air, kd.Ground(-9), plane=plane)
    (px, py, _), (vx, vy, _) = ([Fraction(part) for part in row.tolist()]
                                for row in (start.position, start.velocity))  # fmt: skip
    end = -(Fraction(nx) * px + Fraction(ny) * py) / (Fraction(nx) * vx + Fraction(ny) * vy)
    x, y, _ = path.landing.position.tolist()
    true = math.hypot(float(px + vx * end - Fraction(x)), float(py + vy * end - Fraction(y)))
    assert path.status == "at-plane"
    assert 1e-9 < true <= path.error < 1e-4


def test_a_flight_can_be_pickled():
    path = kd.fly(launch((20, 1, 8), (0, -30, 15)), BALL, kd.Air())
    again = pickle.loads(pickle.dumps(path))
    assert (again.landing.position == path.landing.position).all()
    assert (again.orientation(0.5).as_quat() == path.orientation(0.5).as_quat()).all()


def test_the_error_of_a_flight_cut_short_is_that_of_where_it_is_cut():
    """Not of the landing that a second, longer flight would come to."""
    path = kd.fly(launch(), BALL, kd.Air(), tol=1e-6, time_limit=1.0)
    exact = kd.fly(launch(), BALL, kd.Air(), tol=1e-13, time_limit=1.0)
    true = np.linalg.norm(path.landing.position - exact.landing.position)
    assert path.status == "aloft"
    assert true <= path.error < 1e-3


def test_error_of_the_closed_form_is_rounding():
    path = kd.fly(launch(), BALL)
    assert 0 < path.error < 1e-13 * path.range


def test_what_leaves_the_data_is_said():
    assert kd.fly(launch((24, 0, 10)), BALL, kd.Air()).warnings == ()
    fast = kd.fly(launch((60, 0, 10)), BALL, kd.Air())
    (said,) = fast.warnings
    assert re.match(r"drag supercritical: \d+ % of the flight is outside its data", said)
    assert said.endswith(" (airspeed above 26.9 m/s)")


def test_the_default_drag_is_meant_for_the_speeds_and_spins_of_a_match():
    for velocity, spin, limit in (
        ((29, 0, 3), 10, "airspeed above 26.9 m/s"),
        ((6, 0, 2), 5, "airspeed below 7.97 m/s"),
        ((20, 0, 3), 80, "spin parameter above 0.3"),
    ):
        said = kd.fly(launch(velocity, (0, -spin, 0)), BALL, kd.Air(lift=None)).warnings
        assert re.fullmatch(rf"drag supercritical: .* outside its data \({limit}\)", said[0])


@pytest.mark.parametrize("air", [kd.Air(drag=0.2, lift=None), kd.Air(drag=0.2, lift=0.1)])
def test_a_ball_near_the_speed_of_sound_is_warned_of(air):
    assert kd.fly(launch((99, 0, 5)), BALL, air).warnings == ()
    (said,) = kd.fly(launch((859, 0, 5)), BALL, air).warnings
    assert said.startswith("the launch speed of 859 m/s is above 100 m/s, Mach 0.3:")


@pytest.mark.parametrize(
    ("speed", "spin", "share", "limits"),
    [
        (12, 10, "100 %", "airspeed below 15.1 m/s"),
        (12, 0.5, "100 %", "airspeed below 15.1 m/s"),
        (15, 10, r"[1-9]\d %", "airspeed below 15.1 m/s"),
        (25, 120, "100 %", "spin parameter above 0.3"),
        (12, 80, "100 %", "airspeed below 15.1 m/s, spin parameter above 0.3"),
        (12, 0, None, ""),
        (29, 10, None, ""),
    ],
)
def test_lift_beyond_its_data_is_said(speed, spin, share, limits):
    start = launch((speed, 0, 3), (0, -spin, 0))
    said = kd.fly(start, BALL, kd.Air(drag=None)).warnings
    assert len(said) == (share is not None)
    if share is not None:
        words = f"lift saturating: {share} of the flight is outside its data "
        assert re.fullmatch(words + rf"\({limits}\)", said[0])


@pytest.mark.parametrize(
    ("scene", "words"),
    [
        ((None, BALL), "states? is None: it must be a kickdyn.BallState"),
        ((kd.BallState(), 0.43), r"ball is 0\.43: it must be a kickdyn.Ball"),
        ((kd.BallState(), BALL, "air"), "air is 'air': it must be a kickdyn.Air or None"),
        ((kd.BallState(), BALL, None, 0.0), r"ground is 0\.0: it must be a kickdyn.Ground or None"),
    ],
)
def test_what_is_no_scene_is_refused(scene, words):
    for flies in (kd.fly, kd.follow, kd.fly_many):
        with pytest.raises(kd.InvalidInput, match=words):
            flies(*scene)


def test_an_endless_fall_ends_at_the_time_limit_or_in_one_line(monkeypatch):
    start, ground = kd.BallState((0, 0, 1), (10, 0, 5)), kd.Ground(-1e308)
    assert kd.fly(start, BALL, kd.Air(), ground, time_limit=100.0).status == "aloft"
    monkeypatch.setattr(integrate, "MAX_EVALUATIONS", 10_000)
    with pytest.raises(kd.KickdynError, match=r"beyond .* s: it takes more than 10000 evaluations"):
        kd.fly(start, BALL, kd.Air(), ground, time_limit=1e300)


def test_a_fall_beyond_the_range_of_float64_is_refused():
    start, ground = kd.BallState((0, 0, 1), (10, 0, 5)), kd.Ground(-1e308)
    assert kd.fly(start, BALL, None, ground).duration == 1000.0
    with pytest.raises(kd.InvalidInput, match=r"flies for 1e\+300 s: .* beyond the range of float"):
        kd.fly(start, BALL, None, ground, time_limit=1e300)


# --- units ----------------------------------------------------------------------------------------


def scaled_flights(metre, kilogram, second, monkeypatch):
    """Return `fly` and `fly_many` of one kick in other units, and the results in the usual ones."""
    for module in (forces, fly_module):
        monkeypatch.setattr(module, "GRAVITY", 9.81 * metre / second**2)
    speed = metre / second
    ball = kd.Ball(BALL.mass * kilogram, BALL.radius * metre)
    usual = kd.Air()
    air = kd.Air(
        usual.density * kilogram / metre**3,
        usual.viscosity * kilogram / (metre * second),
        wind=np.array([1.0, -2.0, 0.0]) * speed,
    )
    start = kd.BallState(
        np.array([0.0, 0, 1]) * metre,
        np.array([22.0, 1, 9]) * speed,
        np.array([5, -40, 9]) / second,
    )
    ground = kd.Ground(-0.5 * metre)
    how = {"air": air, "ground": ground, "tol": 1e-8, "time_limit": 100.0 * second}

    def results(position, velocity, time, height):
        return [*(position / metre), *(velocity / speed), time / second, height / metre]

    def one():
        path = kd.fly(start, ball, **how)
        return [
            *results(path.landing.position, path.landing.velocity, path.duration, path.height),
            path.error / metre,
            path.evaluations,
        ]

    def many():
        row = kd.fly_many(kd.BallState(start.position, [start.velocity], start.spin), ball, **how)
        parts = row.landing_position, row.landing_velocity, row.duration, row.height
        return [*results(*(part.values[0] for part in parts)), int(row.evaluations[0])]

    return one, many


@settings(max_examples=12, deadline=None, derandomize=True)
@given(*(st.integers(-8, 8) for _ in range(3)))
def test_a_flight_does_not_depend_on_the_units(m, kg, s):
    """Metre, kilogram and second that are powers of two change no bit of it, gravity scaled too."""
    with pytest.MonkeyPatch.context() as patch:
        usual = scaled_flights(1.0, 1.0, 1.0, patch)[0]()
    with pytest.MonkeyPatch.context() as patch:
        assert scaled_flights(2.0**m, 2.0**kg, 2.0**s, patch)[0]() == usual


def test_many_flights_do_not_depend_on_the_units():
    with pytest.MonkeyPatch.context() as patch:
        usual = scaled_flights(1.0, 1.0, 1.0, patch)[1]()
    with pytest.MonkeyPatch.context() as patch:
        assert scaled_flights(2.0**-7, 2.0**5, 2.0**3, patch)[1]() == usual


def test_a_ball_dropped_from_rest_without_spin_is_slowed_by_drag():
    air, ground = kd.Air(buoyancy=False), kd.Ground()
    path, free = (
        kd.fly(launch((0, 0, 0), height=60.0), BALL, each, ground) for each in (air, None)
    )
    assert path.evaluations > 0
    assert path.landing.speed < 0.95 * free.landing.speed


@pytest.mark.parametrize("air", [None, kd.Air(drag=0.2)])
def test_the_apex_is_not_after_the_end(air):
    start, wall = launch((20, 0, 15), height=1.0), kd.Plane((5, 0, 0), (-1, 0, 0))
    for limits in ({"plane": wall}, {"time_limit": 0.25}):
        path = kd.fly(start, BALL, air, **limits)
        many = kd.fly_many(kd.BallState(start.position, [start.velocity]), BALL, air, **limits)
        assert path.apex.time == path.duration
        assert path.height == path.landing.position[2] - start.position[2] > 1.0
        assert many.apex_time.values[0] == many.duration.values[0]
        assert many.height.values[0] == pytest.approx(path.height, rel=1e-8)


@pytest.mark.parametrize("upward", [1e-12, 1e-17, 1e-20, 1e-40, 1e-100])
def test_a_ball_on_the_ground_that_hardly_rises_lands_at_once(upward):
    start = kd.BallState((0, 0, 0), (5, 1, upward), (0, 40, 0))
    for air in (None, kd.Air(), kd.Air(drag="brazuca", wind=(1, 2, 0))):
        flight = kd.fly(start, kd.Ball(), air)
        assert flight.status == "landed"
        assert flight.duration == pytest.approx(2.04 * upward / 10, rel=0.1)
