"""Derivatives of a flight are those of flights by `fly` from changed launches."""

import numpy as np
import pytest

import kickdyn as kd
from kickdyn.aerodynamics.coefficient_model import scaled
from kickdyn.flight.derivatives import (
    INCREMENT,
    fly_with_launch_slopes,
    fly_with_slopes,
)

BALL = kd.Ball()
AIR = kd.Air(drag="brazuca", wind=(1.0, -2.0, 0.0))
PROFILE = kd.Air(drag="brazuca", wind=lambda height: (1.0 + 0.5 * height, -2.0, 0.0))
LAUNCH = kd.BallState((0.5, -1.0, 0.3), (18.0, 2.0, 9.0), (5.0, -30.0, 20.0))
GROUND = kd.Plane((0, 0, 0), (0, 0, 1))
WALL = kd.Plane((15, 0, 0), (-1, 0.2, 0), "centre")


def by_central_differences(function, sizes, step=1e-4):
    """Return the derivatives of a function of p changes, shape `(m, p)`."""
    steps = step * np.diag(sizes)
    return np.array([(function(s) - function(-s)) / (2 * s.sum()) for s in steps]).T


def changed(change):
    """Return launch and air with changed velocity, spin and drag."""
    air = kd.Air(drag=scaled(AIR.drag, 1 + change[6]), wind=AIR.wind)
    return kd.BallState(
        LAUNCH.position, LAUNCH.velocity + change[:3], LAUNCH.spin + change[3:6]
    ), air


SIZES = np.array([20.0, 20.0, 20.0, 40.0, 40.0, 40.0, 1.0])


@pytest.mark.parametrize("air", [None, AIR, PROFILE], ids=["vacuum", "wind", "profile"])
def test_the_flight_is_that_of_fly(air):
    flight = fly_with_launch_slopes(LAUNCH, BALL, air, 1.1)
    path = kd.fly(LAUNCH, BALL, air, tol=1e-12)
    times = np.linspace(0.0, 1.1, 7)
    sample = path.sample(times)
    assert flight.states(times)[:, :3] + LAUNCH.position == pytest.approx(sample.position, abs=1e-9)
    assert np.abs(flight.states(times)[:, 3:6] - sample.velocity).max() < 1e-9
    assert flight.states(1.1)[6] == pytest.approx(sample.spin[-1, 0] / LAUNCH.spin[0], abs=1e-9)
    assert flight.velocity(1.1) == pytest.approx(sample.velocity[-1], abs=1e-9)


def test_slopes_at_a_time_are_those_of_differences():
    def end(change):
        launch, air = changed(change)
        return kd.fly(launch, BALL, air, tol=1e-12).sample(0.9).position

    expected = by_central_differences(end, SIZES)
    flight = fly_with_launch_slopes(LAUNCH, BALL, AIR, 1.1)
    assert flight.slopes(0.9) == pytest.approx(expected, rel=1e-5, abs=1e-6)
    assert flight.slopes(np.array([0.3, 0.9]))[1] == pytest.approx(flight.slopes(0.9))


@pytest.mark.parametrize("air", [None, AIR])
@pytest.mark.parametrize("plane", [GROUND, WALL])
def test_slopes_at_a_plane_are_those_of_differences(air, plane):
    def end(change):
        launch, changed_air = changed(change)
        ground = kd.Ground(-100.0 if plane is WALL else 0.0)
        far = None if plane is GROUND else plane
        medium = None if air is None else changed_air
        path = kd.fly(launch, BALL, medium, ground, tol=1e-12, plane=far)
        return np.array([*path.landing.position, path.duration])

    flight = fly_with_launch_slopes(LAUNCH, BALL, air, plane)
    assert [*flight.position(flight.end) + LAUNCH.position, flight.end] == pytest.approx(
        end(np.zeros(7)), abs=1e-7
    )
    position, time = flight.slopes_at_plane(plane.normal, flight.end)
    expected = by_central_differences(end, SIZES)
    assert np.vstack([position, time]) == pytest.approx(expected, rel=2e-5, abs=1e-6)
    assert plane.normal @ position == pytest.approx(np.zeros(7), abs=1e-9)


def test_a_launch_is_any_function_of_parameters():
    """Size of the spin, height of the launch, factor of the lift and wind."""

    def launch(values):
        size, height, lift, wind = values
        air = kd.Air(drag="brazuca", lift=scaled(kd.Air().lift, lift), wind=(wind, 0, 0))
        axis = np.array([0.0, -0.6, 0.8])
        return kd.BallState((0, 0, height), (18, 2, 9), size * axis), air

    def end(change):
        state, air = launch(values + change)
        return kd.fly(state, BALL, air, kd.Ground(-100), tol=1e-12).sample(1.0).position

    values, sizes = np.array([30.0, 2.0, 0.8, 1.5]), np.array([30.0, 2.0, 1.0, 1.5])
    flight = fly_with_slopes(launch, values, INCREMENT * sizes, BALL, 1.0)
    expected = by_central_differences(end, sizes)
    assert flight.slopes(1.0) == pytest.approx(expected, rel=1e-5, abs=1e-6)
    assert flight.slopes(1.0)[:, 1] == pytest.approx([0, 0, 1])


def test_without_air_the_derivatives_are_those_of_the_parabola():
    launch = kd.BallState(velocity=(8, 1, 5))
    flight = fly_with_launch_slopes(launch, BALL, None, kd.Plane((0, 0, 0), (0, 0, 1), "centre"))
    time = 10 / 9.81
    assert flight.end == pytest.approx(time)
    position, duration = flight.slopes_at_plane(np.array([0, 0, 1]), flight.end)
    expected = [[time, 0, 16 / 9.81], [0, time, 2 / 9.81], [0, 0, 0]]
    assert position[:, :3] == pytest.approx(np.array(expected), rel=1e-9, abs=1e-9)
    assert duration[:3] == pytest.approx([0, 0, 2 / 9.81], abs=1e-9)
    assert not position[:, 3:].any()


def test_without_air_the_place_of_a_launch_may_depend_on_parameters():
    def launch(values):
        place, speed = values
        return kd.BallState((0.5, place, 2 * place), (8, 1, speed)), None

    flight = fly_with_slopes(launch, [0.3, 5.0], [1e-6, 1e-6], BALL, 0.7)
    expected = np.array([[0, 0], [1, 0], [2, 0.7]])
    for time in (0.2, 0.7):
        expected[2, 1] = time
        assert flight.slopes(time) == pytest.approx(expected, abs=1e-8)
    assert flight.slopes(np.array([0.2, 0.7]))[1] == pytest.approx(expected, abs=1e-8)


@pytest.mark.parametrize("air", [None, AIR])
def test_a_plane_that_is_not_reached_is_an_error(air):
    away = kd.Plane((-1, 0, 0), (1, 0, 0))
    launch = kd.BallState((0, 0, 0), (9, 0, 3))
    with pytest.raises(
        kd.KickdynError, match=f"does not reach the plane{'' if air is None else ' within 1000 s'}$"
    ):
        fly_with_launch_slopes(launch, BALL, air, away, tol=1e-4)
    with pytest.raises(kd.InvalidInput, match="beyond the plane"):
        fly_with_launch_slopes(launch, BALL, air, kd.Plane((1, 0, 0), (1, 0, 0)))


def test_without_drag_a_change_of_the_spin_alone_can_bend_the_path():
    """The flight itself, without spin, and those with another velocity have a closed form."""
    air = kd.Air(drag=None, lift=0.2)
    still = kd.BallState(LAUNCH.position, LAUNCH.velocity)
    slopes = fly_with_launch_slopes(still, BALL, air, 0.9).slopes(0.9)

    def position(spin):
        state = kd.BallState(LAUNCH.position, LAUNCH.velocity, spin)
        return kd.fly(state, BALL, air, tol=1e-12).sample(0.9).position

    step = INCREMENT * 0.1 * np.linalg.norm(LAUNCH.velocity) / BALL.radius
    expected = (position((0, step, 0)) - position((0, -step, 0))) / (2 * step)
    assert np.linalg.norm(expected) > 0.0
    assert slopes[:, 4] == pytest.approx(expected, abs=1e-6 * np.linalg.norm(expected))


def test_a_flight_that_cannot_be_integrated_is_an_error():
    def broken(reynolds, spin_parameter):
        raise ArithmeticError("no coefficient")

    with pytest.raises(kd.KickdynError, match="cannot be integrated: no coefficient"):
        fly_with_launch_slopes(LAUNCH, BALL, kd.Air(drag=broken), 1.0)
    syrup = kd.Air(density=1400.0, viscosity=1e4, drag="sphere", buoyancy=False)
    with pytest.raises(kd.KickdynError, match="more than 10000 evaluations"):
        fly_with_launch_slopes(LAUNCH, kd.Ball(0.02), syrup, 100.0)


def test_slopes_by_the_spin_of_a_ball_that_does_not_spin():
    """Drag that grows with the size of the spin has a kink there; symmetry gives zeros."""
    launch = kd.BallState((0, 0, 1), (25.0, 0.0, 12.0))
    flight = fly_with_launch_slopes(launch, BALL, kd.Air(drag="brazuca"), GROUND)
    slopes, _ = flight.slopes_at_plane(GROUND.normal, flight.end)
    by_spin = slopes[:, 3:6]
    assert by_spin[0, 1] < -0.05  # back spin, which is negative, carries the ball
    assert np.abs(by_spin[0, [0, 2]]).max() < 1e-5 * abs(by_spin[0, 1])

    def landing(change):
        changed = kd.BallState(launch.position, launch.velocity, change)
        path = kd.fly(changed, BALL, kd.Air(drag="brazuca"), kd.Ground(), tol=1e-12)
        return path.landing.position

    expected = by_central_differences(landing, [30.0, 30.0, 30.0], step=1e-5)
    assert by_spin[:2] == pytest.approx(expected[:2], rel=1e-3, abs=1e-5)
