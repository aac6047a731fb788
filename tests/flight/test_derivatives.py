"""Derivatives of a flight are those of flights by `fly` from changed launches."""

import numpy as np
import pytest
from tolerances import agrees, differenced, integrated

import kickdyn as kd
from kickdyn.aerodynamics.coefficient_model import ScaledCoefficient
from kickdyn.flight.derivatives import INCREMENT, fly_with_launch_slopes, fly_with_slopes

BALL = kd.Ball()
AIR = kd.Air(drag="brazuca", wind=(1.0, -2.0, 0.0))
PROFILE = kd.Air(drag="brazuca", wind=lambda height: (1.0 + 0.5 * height, -2.0, 0.0))
LAUNCH = kd.BallState((0.5, -1.0, 0.3), (18.0, 2.0, 9.0), (5.0, -30.0, 20.0))
GROUND = kd.Plane((0, 0, 0), (0, 0, 1))
WALL = kd.Plane((15, 0, 0), (-1, 0.2, 0), "centre")
SIZES = np.array([20.0, 20.0, 20.0, 40.0, 40.0, 40.0, 1.0])
NEAR = {"rel": differenced(1), "abs": differenced(1)}


def by_central_differences(function, sizes, step=1e-4):
    """Return the derivatives of a function of p changes, shape `(m, p)`."""
    steps = step * np.diag(sizes)
    return np.array([(function(s) - function(-s)) / (2 * s.sum()) for s in steps]).T


def landing(air, change, **end):
    """Fly with changed velocity, spin and factor of the drag."""
    if air is not None:
        air = kd.Air(drag=ScaledCoefficient(air.drag, 1 + change[6]), wind=air.wind)
    velocity, spin = LAUNCH.velocity + change[:3], LAUNCH.spin + change[3:6]
    return kd.fly(kd.BallState(LAUNCH.position, velocity, spin), BALL, air, tol=1e-12, **end)


@pytest.mark.parametrize("air", [None, AIR, PROFILE], ids=["vacuum", "wind", "profile"])
def test_the_flight_is_that_of_fly(air):
    flight = fly_with_launch_slopes(LAUNCH, BALL, air, 1.1)
    times = np.linspace(0.0, 1.1, 7)
    sample, states = kd.fly(LAUNCH, BALL, air, tol=1e-12).sample(times), flight.states(times)
    agrees(states[:, :3] + LAUNCH.position, sample.position, integrated(1e-12))
    agrees(states[:, 3:6], sample.velocity, integrated(1e-12))
    agrees(states[:, 6:] * LAUNCH.spin, sample.spin, integrated(1e-12))
    assert flight.position(1.1) == pytest.approx(states[-1, :3])
    assert flight.velocity(1.1) == pytest.approx(states[-1, 3:6])


@pytest.mark.parametrize("air", [None, AIR, PROFILE], ids=["vacuum", "wind", "profile"])
def test_slopes_at_a_time_are_those_of_differences(air):
    right = by_central_differences(lambda change: landing(air, change).sample(0.9).position, SIZES)
    flight = fly_with_launch_slopes(LAUNCH, BALL, air, 1.1)
    assert flight.slopes(0.9) == pytest.approx(right, **NEAR)
    assert flight.slopes(np.array([0.3, 0.9]))[1] == pytest.approx(flight.slopes(0.9))


@pytest.mark.parametrize("air", [None, AIR], ids=["vacuum", "wind"])
@pytest.mark.parametrize("plane", [GROUND, WALL], ids=["ground", "wall"])
def test_slopes_at_a_plane_are_those_of_differences(air, plane):
    def end(change):
        ground = {"ground": kd.Ground(-100.0), "plane": WALL} if plane is WALL else {}
        path = landing(air, change, **({"ground": kd.Ground()} | ground))
        return np.array([*path.landing.position, path.duration])

    flight = fly_with_launch_slopes(LAUNCH, BALL, air, plane)
    result = [*flight.position(flight.end) + LAUNCH.position, flight.end]
    assert result == pytest.approx(end(np.zeros(7)), rel=integrated(1e-9))
    position, time = flight.slopes_at_plane(plane.normal, flight.end)
    right = by_central_differences(end, SIZES)
    assert np.vstack([position, time]) == pytest.approx(right, **NEAR)


@pytest.mark.parametrize("vacuum", [True, False])
@pytest.mark.parametrize("central", [True, False])
def test_a_launch_is_any_function_of_parameters(vacuum, central):
    """Size of the spin, height of the launch, factor of the lift, and wind."""

    def launch(values):
        size, height, lift, wind = values
        air = kd.Air(drag="brazuca", lift=ScaledCoefficient(kd.Air().lift, lift), wind=(wind, 0, 0))
        state = kd.BallState((0, 0, height), (18, 2, 9), size * np.array([0.0, -0.6, 0.8]))
        return state, None if vacuum else air

    def end(change):
        state, air = launch(values + change)
        return kd.fly(state, BALL, air, kd.Ground(-100), tol=1e-12).sample(1.0).position

    values, sizes = np.array([30.0, 2.0, 0.8, 1.5]), np.array([30.0, 2.0, 1.0, 1.5])
    flight = fly_with_slopes(launch, values, INCREMENT * sizes, BALL, 1.0, central=central)
    right = by_central_differences(end, sizes)
    assert flight.slopes(1.0) == pytest.approx(right, **NEAR)


@pytest.mark.parametrize("air", [kd.Air(drag=None, lift=0.2), kd.Air(drag="brazuca")], ids=str)
def test_slopes_by_the_spin_of_a_ball_that_does_not_spin(air):
    """Lift appears with the spin; drag that grows with its size has a kink there."""
    launch = kd.BallState((0, 0, 1), (25.0, 0.0, 12.0))
    slopes = fly_with_launch_slopes(launch, BALL, air, 1.5).slopes(1.5)[:, 3:6]
    step = INCREMENT * 0.1 * np.linalg.norm(launch.velocity) / BALL.radius

    def position(change):
        state = kd.BallState(launch.position, launch.velocity, change)
        return kd.fly(state, BALL, air, kd.Ground(-9), 1e-13).sample(1.5).position

    right = by_central_differences(position, 3 * [1e-4], step / 1e-4)
    assert slopes[2, 1] < 0  # back spin, which is negative, lifts the ball
    agrees(slopes, right, differenced(1))


def broken(reynolds, spin_parameter):
    raise ArithmeticError("no coefficient")


SYRUP = kd.Air(density=1400.0, viscosity=1e4, drag="sphere", buoyancy=False)
AWAY = kd.Plane((-1, 0, 0), (1, 0, 0))


@pytest.mark.parametrize(("air", "end", "words"), [(None, AWAY, "does not reach the plane"),
    (AIR, AWAY, "does not reach the plane"),
    (AIR, kd.Plane((1, 0, 0), (1, 0, 0)), "beyond the plane"),
    (kd.Air(drag=broken), 1.0, "cannot be integrated.*no coefficient"),
    (SYRUP, 100.0, "more than 10000 evaluations")],
    ids=["vacuum", "air", "beyond", "broken", "syrup"])  # fmt: skip
def test_errors(air, end, words):
    with pytest.raises(kd.KickdynError, match=words):
        fly_with_launch_slopes(kd.BallState(velocity=(9, 0, 3)), kd.Ball(0.02), air, end, 1e-4)
