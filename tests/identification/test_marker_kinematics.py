"""Markers on a leg: derivatives by differences, inverse kinematics, lengths of segments."""

import numpy as np
import pinocchio as pin
import pytest
from chains import free_body
from kick_motion import LEG, PLACES, state
from tolerances import agrees, differenced, optimized

from kickdyn.identification.marker_kinematics import (
    MARKER_NOISE,
    SCALE_DEVIATION,
    FittedLeg,
    Marker,
    MarkerKinematics,
    place_deviation,
    scaled_leg,
)

MODEL = LEG.model
MARKERS = [Marker(MODEL.getFrameId(link), np.array(p)) for link, p in PLACES.values()]
NAMED = dict(zip(PLACES, MARKERS, strict=True))
ALL = np.ones(len(MARKERS), dtype=bool)
JOINTS = len(LEG.joint_names)
STEP = 1e-6


def placed(q, scales=None):
    """Return positions of the markers, `(3 k,)`, with the segment behind each joint scaled."""
    model = LEG.model
    scales = np.ones(JOINTS) if scales is None else scales
    for joint in range(2, model.njoints):
        model.jointPlacements[joint].translation *= scales[model.parents[joint] - 1]
    data = model.createData()
    pin.forwardKinematics(model, data, q)
    points = []
    for number, point in MARKERS:
        frame = model.frames[number]
        local = scales[frame.parentJoint - 1] * frame.placement.act(point)
        points.append(data.oMi[frame.parentJoint].act(local))
    return np.concatenate(points)


def by_differences(function, size):
    """Return derivatives of a function of a change of this size by central differences."""
    steps = STEP * np.eye(size)
    return np.array([(function(step) - function(-step)) / (2 * STEP) for step in steps]).T


@pytest.mark.parametrize("t", [-0.15, -0.05, 0.0])
def test_markers_and_their_jacobian(t):
    q, kinematics = state(t), MarkerKinematics(MODEL, MARKERS)
    points, jacobian = kinematics.markers(q, ALL)
    agrees(points, placed(q), optimized(1e-14))
    expected = by_differences(lambda step: placed(pin.integrate(MODEL, q, step)), LEG.nv)
    agrees(jacobian, expected, differenced())


SCALES = np.ones(JOINTS)
DETERMINED = [LEG.joint_names.index(name) for name in ("hip_rotation", "knee", "subtalar")]
SCALES[[0, *DETERMINED]] = 1.03, 0.96, 1.04, 1.02


@pytest.fixture(scope="module")
def fitted():
    """The leg that is fitted to markers of another one, in four frames, and these frames."""
    times = np.linspace(-0.18, 0.0, 4)
    measured = np.array([placed(state(t), SCALES).reshape(-1, 3) for t in times])
    frames = MarkerKinematics(MODEL, MARKERS).solve_track(measured, range(4), state(times[0]))
    return scaled_leg(LEG, NAMED, measured, frames), times


def test_lengths_of_segments_are_those_of_the_markers(fitted):
    """The prior of 10 % weighs as 1 mm of noise, so that it moves them by less than 1e-4."""
    leg, _ = fitted
    scales = np.array(list(leg.scales.values()))
    assert scales[DETERMINED] == pytest.approx(SCALES[DETERMINED], abs=1e-4)
    q = state(-0.05)
    points, _ = MarkerKinematics(leg.leg.model, leg.places).markers(q, ALL)
    agrees(points, placed(q, scales), optimized(1e-14))


def test_the_covariance_of_lengths_is_that_of_the_normal_equations(fitted):
    """With all configurations as unknowns beside the lengths; derivatives by differences."""
    leg, times = fitted
    scales = np.array(list(leg.scales.values()))
    count = JOINTS + len(times) * LEG.nv
    normal = np.zeros((count, count))
    normal[:JOINTS, :JOINTS] = np.eye(JOINTS) * (MARKER_NOISE / SCALE_DEVIATION) ** 2
    for k, t in enumerate(times):
        q = state(t)
        by_q = by_differences(lambda x, q=q: placed(pin.integrate(MODEL, q, x), scales), LEG.nv)
        by_scale = by_differences(lambda x, q=q: placed(q, scales + x), JOINTS)
        rows = np.zeros((3 * len(MARKERS), count))
        rows[:, :JOINTS] = by_scale
        rows[:, JOINTS + k * LEG.nv : JOINTS + (k + 1) * LEG.nv] = by_q
        normal += rows.T @ rows
    expected = MARKER_NOISE**2 * np.linalg.inv(normal)[:JOINTS, :JOINTS]
    agrees(leg.covariance, expected, 1e-3)  # at the configurations of the fit


@pytest.mark.parametrize("c", [0.03, 0.4, 0.6])
def test_the_deviation_of_places_is_that_of_their_means_in_the_axes_of_the_segment(c):
    """A cluster that is wrong by c + d and c - d times its size, in turn, on a body that turns.

    Such residuals do not move the body, which 6 of 12 coordinates determine. The variance of a mean
    of n frames, d^2 / (n - 1), is taken off twice. It is 2 cm at most; 0.06 m is another marker.
    """
    leg, d, n = free_body().leg, 0.01, 8
    points = 0.1 * np.vstack([np.eye(3)[:2], -np.eye(3)[:2], np.zeros(3)])
    places = [Marker(leg.model.getFrameId("toe"), point) for point in points]
    q = [np.array([0, 0, 0, 0, 0, np.sin(a), np.cos(a)]) for a in np.pi / n * np.arange(n)]
    sizes = (1.0 + c + d * (-1.0) ** np.arange(n))[:, None, None]
    measured = sizes * points @ [pin.XYZQUATToSE3(x).rotation.T for x in q]
    measured[1:, 4] = np.nan  # seen once, which shows no scatter
    solve = MarkerKinematics(leg.model, places).solve
    frames = dict(enumerate(map(solve, q, measured, np.isfinite(measured[..., 0]))))
    fitted = FittedLeg(leg, {}, places, 0.0 * points, np.zeros((0, 0)))
    square = 12 / (12 - 6) * np.mean(points[:4] ** 2) * (c**2 - 2 * d**2 / (n - 1))
    right = min(np.sqrt(square), 0.02) if c < 0.5 else 0.0
    assert place_deviation(fitted, measured, frames) == pytest.approx(right, rel=optimized(1e-7))
