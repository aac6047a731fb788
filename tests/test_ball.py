import dataclasses
import math

import numpy as np
import pytest
from scipy.integrate import quad

import kickdyn as kd

BAD = [math.nan, -1.0, 0.0, "0.4", None, True, 1j]


@pytest.mark.parametrize("name", ["mass", "radius"])
@pytest.mark.parametrize("value", [*BAD, math.inf, -math.inf], ids=repr)
def test_ball_refuses(name, value):
    if (name, value) == ("mass", math.inf):
        return  # an obstacle
    with pytest.raises(kd.InvalidInput, match=f"ball {name} is .*above 0"):
        kd.Ball(**{name: value})


@pytest.mark.parametrize(("mass", "radius"), [(1e-300, 1e-100), (1e300, 1e100), (1e-320, 0.1)])
def test_ball_refuses_an_inertia_beyond_double_precision(mass, radius):
    with pytest.raises(kd.InvalidInput, match="inertia"):
        kd.Ball(mass, radius)


@pytest.mark.parametrize(
    "value", [math.nan, math.inf, -80e3, 0.0, 0.8, 12.0, 1100.0, 2e6, "1 bar", True]
)
def test_ball_refuses_a_pressure_that_is_none_of_an_inflated_ball(value):
    """0.8 is in bar, 12 in psi and 1100 in g/cm2, not in Pa."""
    with pytest.raises(
        kd.InvalidInput, match=r"ball pressure is .* 0\.8 bar, or 80 kPa, is 80e3 Pa"
    ):
        kd.Ball(pressure=value)


def test_the_stiffness_of_an_inflated_ball():
    """The slope of p pi a^2 at d = 0, with a^2 = 2 R d - d^2, by differences."""
    ball, d = kd.Ball(pressure=80e3), 1e-6
    force = 80e3 * math.pi * (2 * ball.radius * d - d * d)
    assert ball.stiffness == pytest.approx(force / d, rel=1e-5)
    assert "pressure" in repr(ball)
    # a dropped ball: 2.80 mm for each m/s, Dowell & Krebs 1991, at a pressure that is not known
    assert 1e3 * math.sqrt(ball.mass / ball.stiffness) == pytest.approx(2.80, rel=0.01)
    ends = [1e3 * math.sqrt(ball.mass / kd.Ball(pressure=p).stiffness) for p in (60e3, 110e3)]
    assert [round(d, 1) for d in ends] == [3.2, 2.4]  # as the page has it
    with pytest.raises(kd.InvalidInput, match=r"ball pressure is None: .*pressure=80e3"):
        kd.Ball().stiffness  # noqa: B018


LAUNCH = kd.BallState(velocity=(5.0, 0.0, 5.0))
MANY = kd.BallState(velocity=[(5.0, 0.0, 5.0)] * 2)
LEG, CONTACT = kd.Leg.human(), kd.Contact((1, 0, 0.3), 0.8)
KICK = LEG.posture((0.1, 0.2, 0.3)), LEG.posture((0.1, 0.2, 0.3)).joint_velocity((3, 0, 1))
NOT_FOR_OBSTACLES = {
    "a flight": [
        lambda ball: kd.fly(LAUNCH, ball),
        lambda ball: kd.fly(LAUNCH, ball, air=None),
        lambda ball: kd.follow(LAUNCH, ball),
        lambda ball: kd.fly_many(MANY, ball),
        lambda ball: kd.plan_launch(kd.Goal(20.0, time=1.5), ball),
        lambda ball: kd.plan_pass(kd.Goal(5.0, time=1.5), ball),
        lambda ball: kd.plan_kick(LEG, kd.Goal(20.0, time=1.5), ball),
    ],
    "a sweep": [lambda ball: kd.Kick(speed=3.0, ball=ball)],
    "a scene": [lambda ball: kd.Scene(*KICK, ball, CONTACT)],
    "a contact that takes time": [lambda ball: kd.collide(*KICK, ball, CONTACT)],
}


@pytest.mark.parametrize(
    ("what", "call"),
    [(what, call) for what, calls in NOT_FOR_OBSTACLES.items() for call in calls],
)
def test_an_obstacle_is_for_impacts_only(what, call):
    with pytest.raises(kd.InvalidInput) as caught:
        call(kd.Ball(math.inf))
    assert str(caught.value) == (
        f"ball mass is inf, an obstacle that cannot move: {what} needs a finite mass"
    )


@pytest.mark.parametrize("factor", [2 / 3, math.inf])
def test_an_obstacle_does_not_turn(factor):
    ball = kd.Ball(math.inf, inertia_factor=factor)
    assert (ball.inertia, ball.turning) == (math.inf, 0.0)


def test_default_ball_is_within_law_2():
    ball = kd.Ball()
    assert 0.410 <= ball.mass <= 0.450
    assert 0.68 <= 2 * math.pi * ball.radius <= 0.70


def test_paper_ball_is_table_3():
    assert kd.Ball.paper() == kd.Ball(mass=0.45, radius=0.1)


def test_inertia_is_that_of_a_shell():
    # rings of a sphere's surface: dm = m/2 sin(a) da at distance r sin(a) from the axis
    ball = kd.Ball(mass=0.3, radius=0.2)
    rings, _ = quad(lambda a: 0.15 * math.sin(a) * (0.2 * math.sin(a)) ** 2, 0, math.pi)
    assert ball.inertia == pytest.approx(rings, rel=1e-12)
    assert ball.cross_section == pytest.approx(math.pi * 0.04, rel=1e-15)
    assert ball.volume == pytest.approx(4 / 3 * math.pi * 0.008, rel=1e-15)


def test_ball_is_frozen_and_holds_floats():
    ball = kd.Ball(mass=np.float32(0.5), radius=1)
    assert type(ball.mass) is type(ball.radius) is float
    with pytest.raises(dataclasses.FrozenInstanceError):
        ball.mass = 1.0


@pytest.mark.parametrize("name", ["position", "velocity", "spin"])
@pytest.mark.parametrize(
    ("value", "said"),
    [
        ((1, 2), r"shape \(2,\): it must be \(3,\) or \(n, 3\)"),
        ([[1, 2]], r"shape \(1, 2\)"),
        ([[[1, 2, 3]]], r"shape \(1, 1, 3\)"),
        ((1, 2, math.nan), "finite"),
        ("abc", "real numbers"),
    ],
)
def test_state_refuses(name, value, said):
    with pytest.raises(kd.InvalidInput, match=f"^{name} .*{said}"):
        kd.BallState(**{name: value})


@pytest.mark.parametrize(
    ("time", "said"), [(math.nan, "finite"), ([[0]], r"time has .*a number or \(n,\)")]
)
def test_state_refuses_time(time, said):
    with pytest.raises(kd.InvalidInput, match=said):
        kd.BallState(time=time)


def test_many_states_share_what_has_no_rows():
    velocity = np.arange(6.0).reshape(2, 3)
    states = kd.BallState(velocity=velocity, spin=(0, -30, 0), position=(0, 0, 0.11))
    assert states.position.tolist() == [[0, 0, 0.11]] * 2
    assert states.velocity.tolist() == velocity.tolist()
    assert states.spin.tolist() == [[0, -30, 0]] * 2
    assert states.time.tolist() == [0, 0]
    assert kd.BallState(velocity=velocity, time=3).time.tolist() == [3, 3]
    assert kd.BallState(time=[1, 2]).position.shape == (2, 3)
    assert kd.BallState(np.empty((0, 3))).velocity.shape == (0, 3)
    with pytest.raises(ValueError, match="read-only"):
        states.spin[0, 0] = 1.0


def test_many_states_have_the_same_number():
    with pytest.raises(kd.InvalidInput, match=r"spin has shape \(3, 3\): .* \(3,\) or \(2, 3\)"):
        kd.BallState(velocity=np.ones((2, 3)), spin=np.ones((3, 3)))
    with pytest.raises(kd.InvalidInput, match=r"time has shape \(3,\): .*number or \(2,\)"):
        kd.BallState(velocity=np.ones((2, 3)), time=[0, 1, 2])


@pytest.mark.parametrize("shape", [(3,), (5, 3)])
def test_state_is_a_copy_that_cannot_be_changed(shape):
    given = np.ones(shape)
    state = kd.BallState(given, given, given, np.zeros(shape[:-1]))
    given[:] = 7
    for array in (state.position, state.velocity, state.spin, state.time):
        assert np.all(np.asarray(array) != 7)
        if isinstance(array, np.ndarray):
            with pytest.raises(ValueError, match="read-only"):
                array[0] = 7
    with pytest.raises(dataclasses.FrozenInstanceError):
        state.time = 1.0


@pytest.mark.parametrize(
    ("velocity", "speed", "elevation_deg"),
    [
        ((0, 0, 0), 0, 0),
        ((3, 0, 4), 5, math.degrees(math.atan2(4, 3))),
        ((-3, 0, 4), 5, math.degrees(math.atan2(4, 3))),  # above the horizontal, flying back
        ((0, 2, -2), math.sqrt(8), -45),
        ((0, 0, 1), 1, 90),
    ],
)
def test_speed_and_elevation(velocity, speed, elevation_deg):
    one = kd.BallState(velocity=velocity)
    assert type(one.speed) is type(one.elevation) is float
    assert one.speed == pytest.approx(speed, rel=1e-15)
    assert math.degrees(one.elevation) == pytest.approx(elevation_deg, rel=1e-15)
    many = kd.BallState(np.zeros((2, 3)), [velocity, (1, 0, 0)], np.zeros((2, 3)), [0, 1])
    assert many.speed.tolist() == [one.speed, 1.0]
    assert many.elevation.tolist() == [one.elevation, 0.0]


@pytest.mark.parametrize("value", [math.nan, -math.inf, 0, -0.4, 0.67, "0.4", None, True], ids=repr)
def test_ball_refuses_an_inertia_no_ball_has(value):
    with pytest.raises(kd.InvalidInput, match=r"inertia factor is .*above 0 and at most 0\.66"):
        kd.Ball(inertia_factor=value)


def test_a_solid_ball_and_a_particle():
    assert kd.Ball(1.0, 0.5, 2 / 5).inertia == pytest.approx(0.1)
    assert kd.Ball(inertia_factor=math.inf).inertia == math.inf


def test_turning_is_what_resists_a_push_across_the_normal():
    assert kd.Ball(1.0, 0.5, 2 / 5).turning == pytest.approx(0.5**2 / 0.1)
    assert kd.Ball(inertia_factor=math.inf).turning == 0.0
    assert kd.Ball(0.5, 1e3, 1e-300).turning == pytest.approx(2e300)


@pytest.mark.parametrize("ball", [(1e-320, 0.1), (0.43, 0.11, 1e-308), (1e-200, 1e5, 1e-120)])
def test_ball_refuses_an_inertia_without_digits(ball):
    with pytest.raises(kd.InvalidInput, match="mass, inertia and their inverses must be finite"):
        kd.Ball(*ball)


@pytest.mark.parametrize("values", [(430, 0.11), (0.43, 11), (0.43, 110), (430, 22)])
def test_grams_and_centimetres_are_warned_of(values):
    ball = kd.Ball(*values)
    (said,) = ball.warnings
    assert said.startswith(f"the ball has {values[0]:g} kg and a radius of {values[1]:g} m:")
    assert said in ball._repr_html_()
    assert said in kd.fly(kd.BallState(velocity=(5, 0, 5)), ball).warnings
    posture = kd.Leg.human().posture([0.5, 0.3, -0.2])
    assert said in kd.strike(posture, [5, 2, 1], ball, kd.Contact((1, 0, 0.3), 0.8)).warnings


def test_soccer_balls_and_obstacles_are_not_warned_of():
    assert [kd.Ball(*ball).warnings for ball in ((), (99.0, 1.0), (math.inf, 0.1))] == [()] * 3
