"""The ball's constants and states, and its contact: definitions, checks, copies."""

import dataclasses
import math

import numpy as np
import pytest
import xarray as xr
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad
from tolerances import EPSILON, closed_form

import kickdyn as kd

POSITIVE = st.floats(1e-3, 50.0)


@settings(max_examples=25)
@given(mass=POSITIVE, radius=st.floats(1e-3, 1.9), factor=st.floats(0.1, 2 / 3))
def test_constants_follow_from_mass_radius_and_inertia_factor(mass, radius, factor):
    ball = kd.Ball(mass, radius, factor)
    exact = closed_form()
    assert ball.inertia == pytest.approx(factor * mass * radius**2, rel=exact)
    assert ball.turning == pytest.approx(radius**2 / ball.inertia, rel=exact)
    assert ball.cross_section == pytest.approx(math.pi * radius**2, rel=exact)
    assert ball.volume == pytest.approx(4 / 3 * math.pi * radius**3, rel=exact)


def test_the_default_inertia_is_that_of_a_thin_shell():
    """Rings of mass m/2 sin(a) da lie at the distance r sin(a) from the axis."""
    ball = kd.Ball(mass=0.3, radius=0.2)
    rings, _ = quad(lambda a: 0.15 * math.sin(a) * (0.2 * math.sin(a)) ** 2, 0, math.pi)
    assert ball.inertia == pytest.approx(rings, rel=closed_form(10))


def test_the_default_ball_is_within_law_2_and_the_paper_s_is_of_table_3():
    """IFAB, Laws of the Game, Law 2: 410 to 450 g and a circumference of 68 to 70 cm."""
    ball = kd.Ball()
    assert 0.410 <= ball.mass <= 0.450
    assert 0.68 <= 2 * math.pi * ball.radius <= 0.70
    assert kd.Ball.paper() == kd.Ball(mass=0.45, radius=0.1)


def test_the_stiffness_is_the_slope_of_pressure_times_flattened_area():
    """The plate cuts off a circle with a^2 = 2 R d - d^2; Dowell & Krebs 1991 measured 2.80 mm."""
    ball, d = kd.Ball(pressure=80e3), 1e-6
    force = 80e3 * math.pi * (2 * ball.radius * d - d * d)
    assert ball.stiffness == pytest.approx(force / d, rel=d / ball.radius)
    assert 1e3 * math.sqrt(ball.mass / ball.stiffness) == pytest.approx(2.80, rel=0.01)


@pytest.mark.parametrize(("arguments", "words"), [
    *(({"mass": v}, "ball mass is .*above 0") for v in (math.nan, -1.0, 0, "0.4", True)),
    *(({"radius": v}, "ball radius is .*above 0") for v in (math.inf, -1.0, 0, None, 1j)),
    *(({"inertia_factor": v}, "inertia factor is .*0.66") for v in (math.nan, 0, 0.67, True)),
    *(({"pressure": v}, "pressure is .*80e3 Pa") for v in (math.nan, 0.8, 1100.0, 2e6, "1")),
    *(({"shell_share": v}, "shell share is .*at most 1") for v in (-0.1, 1.1, math.nan)),
    ({"mass": 1e-300, "radius": 1e-100}, "inertia of"),
    ({"mass": 1e300, "radius": 1e100}, "inertia of"), ({"inertia_factor": 1e-308}, "inertia of")],
    ids=str)  # fmt: skip
def test_refusals(arguments, words):
    """0.8 is a pressure in bar, 1100 in g/cm2."""
    with pytest.raises(kd.InvalidInput, match=words):
        kd.Ball(**arguments)


@pytest.mark.parametrize("values", [(430, 0.11), (5.01, 0.11), (0.43, 11), (0.43, 0.501)])
def test_a_ball_in_grams_or_centimetres_is_warned_of(values):
    (line,) = kd.Ball(*values).warnings
    assert f"{values[0]:g} kg" in line
    assert f"{values[1]:g} m" in line


@pytest.mark.parametrize("values", [(), (5.0, 0.5), (math.inf, 0.1)])
def test_soccer_balls_and_obstacles_are_not_warned_of(values):
    assert kd.Ball(*values).warnings == ()


LAUNCH = kd.BallState(velocity=(5.0, 0.0, 5.0))
LEG, CONTACT = kd.Leg.human(), kd.Contact((1, 0, 0.3), 0.8)
KICK = LEG.posture((0.1, 0.2, 0.3)), LEG.posture((0.1, 0.2, 0.3)).joint_velocity((3, 0, 1))
ROWS = [[KICK[0].q], [KICK[1]]]
LAUNCHES = kd.BallState(velocity=[(5, 0, 5)])
ALSO_FOR_OBSTACLES = {
    "strike": lambda ball: kd.strike(*KICK, ball, CONTACT),
    "strike_many": lambda ball: kd.strike_many(LEG, *ROWS, ball, CONTACT)}  # fmt: skip
NOT_FOR_OBSTACLES = {"fly": lambda ball: kd.fly(LAUNCH, ball),
    "fly_many": lambda ball: kd.fly_many(LAUNCHES, ball),
    "follow": lambda ball: kd.follow(LAUNCH, ball),
    "follow_many": lambda ball: kd.follow_many(LAUNCHES, ball),
    "plan_kick": lambda ball: kd.plan_kick(LEG, kd.Goal(3.0, time=0.7), ball),
    "sweep": lambda ball: kd.sweep(LEG, {"hip": [0.1]}, kd.Kick(speed=3.0, ball=ball)),
    "reach": lambda ball: kd.reach(LEG, ball, elevations=30.0, tolerance=0.5),
    "simulate": lambda ball: kd.simulate(kd.Scene(*KICK, ball, CONTACT)),
    "collide": lambda ball: kd.collide(*KICK, ball, CONTACT),
    "collide_many": lambda ball: kd.collide_many(LEG, *ROWS, ball, CONTACT),
    "infer_impact": lambda ball: kd.infer_impact(*KICK, ball, kd.BallState(), LAUNCH),
    "segments": lambda ball: kd.segments(kd.Track(np.arange(9) / 50, np.ones((9, 3))), ball),
}  # fmt: skip


@pytest.mark.parametrize("call", (ALSO_FOR_OBSTACLES | NOT_FOR_OBSTACLES).values(),
                         ids=ALSO_FOR_OBSTACLES | NOT_FOR_OBSTACLES)  # fmt: skip
def test_every_result_warns_of_a_ball_in_other_units(call):
    ball = kd.Ball(5.5, 0.1)
    result = call(ball)
    said = result.attrs["warnings"] if isinstance(result, xr.Dataset) else result.warnings
    assert ball.warnings[0] in said


@pytest.mark.parametrize("call", NOT_FOR_OBSTACLES.values(), ids=NOT_FOR_OBSTACLES)
def test_an_obstacle_is_for_impacts_only(call):
    with pytest.raises(kd.InvalidInput, match=r"ball mass is inf.*finite mass"):
        call(kd.Ball(math.inf))


@pytest.mark.parametrize(("velocity", "speed", "elevation_deg"), [
    ((0, 0, 0), 0, 0), ((0, 2, -2), math.sqrt(8), -45), ((0, 0, 1), 1, 90),
    ((3, 0, 4), 5, math.degrees(math.atan2(4, 3))),
    ((-3, 0, 4), 5, math.degrees(math.atan2(4, 3)))])  # it flies back  # fmt: skip
def test_speed_and_elevation(velocity, speed, elevation_deg):
    one, many = kd.BallState(velocity=velocity), kd.BallState(velocity=[velocity, (1, 0, 0)])
    assert (type(one.speed), type(one.elevation)) == (float, float)
    assert one.speed == pytest.approx(speed, rel=closed_form())
    assert math.degrees(one.elevation) == pytest.approx(elevation_deg, rel=closed_form())
    assert many.speed.tolist() == [one.speed, 1.0]
    assert many.elevation.tolist() == [one.elevation, 0.0]


def test_many_states_share_an_argument_without_rows():
    velocity = np.arange(6.0).reshape(2, 3)
    states = kd.BallState(velocity=velocity, spin=(0, -30, 0), position=(0, 0, 0.11), time=3)
    assert states.velocity.tolist() == velocity.tolist()
    assert states.position.tolist() == [[0, 0, 0.11]] * 2
    assert states.spin.tolist() == [[0, -30, 0]] * 2
    assert states.time.tolist() == [3, 3]
    assert kd.BallState(time=[1, 2]).position.shape == (2, 3)
    assert kd.BallState(np.empty((0, 3))).velocity.shape == (0, 3)


@pytest.mark.parametrize(("arguments", "words"), [*(({name: (1, 2)}, rf"{name} .*\(2,\).*\(n, 3\)")
    for name in ("position", "velocity", "spin")), ({"position": [[1, 2]]}, r"position .*\(1, 2\)"),
    ({"velocity": [[[1, 2, 3]]]}, r"velocity .*\(1, 1, 3\)"),
    ({"spin": (1, 2, math.nan)}, "spin .*finite"), ({"velocity": "abc"}, "velocity .*numbers"),
    ({"time": math.nan}, "time .*finite"), ({"time": [[0]]}, r"time .*\(1, 1\)"),
    ({"velocity": np.ones((2, 3)), "spin": np.ones((3, 3))}, r"spin .*\(3, 3\).*\(2, 3\)"),
    ({"velocity": np.ones((2, 3)), "time": [0, 1, 2]}, r"time .*\(3,\).*\(2,\)")], ids=str,
    )  # fmt: skip
def test_refusals_of_a_state(arguments, words):
    with pytest.raises(kd.InvalidInput, match=words):
        kd.BallState(**arguments)


GOOD = {"normal": (1, 0, 0), "restitution": 0.8, "friction": 0.4}


@pytest.mark.parametrize(("name", "value", "word"), [
    ("normal", (0, 0, 0), "length 0"), ("normal", (1, 0), "shape"),
    ("normal", (math.nan, 0, 1), "finite"), ("normal", "abc", "numbers"),
    *[("restitution", e, "at least 0 and at most 1") for e in (1.2, -0.1, math.nan, "0.5")],
    *[("restitution", e, "at least 0") for e in (True, None, math.inf, [0.5])],
    ("offset", (0, 0), "shape"), ("offset", (0, math.inf, 0), "finite"),
    *[("friction", mu, "at least 0") for mu in (-1e-9, math.nan, math.inf, "0.4", True)]
])  # fmt: skip
def test_bad_contacts_are_refused(name, value, word):
    with pytest.raises(kd.InvalidInput, match=f"{name} .*{word}"):
        kd.Contact(**(GOOD | {name: value}))


@pytest.mark.parametrize("scale", [5e-324, 1e-160, 1.0, 1e300])
def test_normal_of_any_length_becomes_a_unit_vector(scale):
    normal = kd.Contact((scale, 0, -scale), 0.5).normal
    assert normal == pytest.approx([math.sqrt(0.5), 0, -math.sqrt(0.5)], abs=4 * EPSILON)


def test_a_contact_keeps_copies_of_its_vectors():
    normal, offset = np.array([0.0, 0.0, 1.0]), np.array([0.1, 0.0, 0.02])
    contact = kd.Contact(normal, 0.5, offset=offset)
    normal[0] = offset[0] = 9
    assert (contact.normal.tolist(), contact.offset.tolist()) == ([0, 0, 1], [0.1, 0.0, 0.02])


def test_an_impact_needs_a_normal():
    open_contact, leg = kd.Contact(restitution=0.7, friction=0.2), kd.Leg.human()
    posture, v = leg.posture([0.1, -0.4, 0.2]), [1.0, 2.0, 0.0]
    assert open_contact == kd.Contact(None, 0.7, 0.2) != kd.Contact((1, 0, 0), 0.7, 0.2)
    assert dataclasses.replace(open_contact, normal=(2, 0, 0)).normal.tolist() == [1.0, 0.0, 0.0]
    for impact in (kd.strike, kd.collide, kd.unilateral_strike, kd.Scene):
        with pytest.raises(kd.InvalidInput, match="has no normal"):
            impact(posture, v, kd.Ball(), open_contact)
