"""Several flights in one picture: curves where the balls fly, a legend with their numbers."""

import re

import numpy as np
import pytest
from drawn_scene import SINGLE, DrawnScene
from tolerances import agrees, closed_form

import kickdyn as kd
from kickdyn.core.mechanics import GRAVITY

BALL = kd.Ball()
FELT = kd.Surface("felt", 0.5, 0.5, rolling_deceleration=1.0)
ROLLING = kd.BallState(velocity=(4, 0, 0), spin=(0, 4 / BALL.radius, 0))
PARABOLA = kd.fly(kd.BallState(velocity=(10, 0, GRAVITY)), BALL, None)
COURSE = kd.follow(ROLLING, BALL, ground=kd.Ground(-BALL.radius, FELT))


def test_every_flight_is_a_curve_along_its_path():
    """As wide all along as the camera sees it."""
    aside = kd.fly(kd.BallState(velocity=(9, 3, 9)), BALL)
    flights = {"top": PARABOLA, "<b>back</b>": aside, "roll": COURSE}
    page = kd.page(flights, caption="a & b")
    scene = DrawnScene(page)
    for k, path in enumerate(flights.values()):
        centres = scene.curve(f"curve/{k}")
        right = path.sample(np.linspace(0, path.duration, len(centres))).position
        agrees(centres, right, 10 * SINGLE)
        radii = scene.vertices(f"curve/{k}").reshape(-1, 8, 3) - centres[:, None]
        away = np.linalg.norm(centres - scene.camera()[0], axis=1)
        angles = np.linalg.norm(radii, axis=2) / away[:, None]
        np.testing.assert_allclose(angles, angles[0, 0], rtol=1e-2)
    assert scene.point("ground")[2] == pytest.approx(-BALL.radius)
    agrees(scene.point("ball"), PARABOLA.launch.position, closed_form(1e4))
    size = np.ptp(scene.vertices("ball/hexagons"), axis=0)
    assert size == pytest.approx(2 * BALL.radius, rel=1e-2)
    assert "&lt;b&gt;back&lt;/b&gt;" in page.html
    assert "<title>a &amp; b</title>" in page.html


@pytest.mark.parametrize(("path", "numbers"), [
    (PARABOLA, f"20 m, rises {GRAVITY / 2:.3g} m, 2 s"), (COURSE, "8 m along the ground, 4 s"),
    (kd.fly(kd.BallState(), BALL), "0 m")], ids=["vacuum", "course", "rest"])  # fmt: skip
def test_the_legend_has_how_far_how_high_and_how_long(path, numbers):
    assert f"<td>{numbers}" in kd.page(path).panel


def test_distances_lead_from_the_launch_to_the_farthest_end():
    """Wherever the launch is."""
    far, near = (kd.fly(kd.BallState((70, -50, 1), (v, 0, 9)), BALL) for v in (12.0, 7.0))
    labels = DrawnScene(kd.page({"near": near, "far": far})).labels
    shown = np.array(re.findall(r'distances/\d+">([\d.]+) m<', labels), dtype=float)
    assert 0.0 <= far.range - shown.max() < np.diff(np.sort(shown)).min()


def test_measured_positions_are_dots_along_the_whole_flight():
    flight = kd.fly(kd.BallState(velocity=(10, 0, 8)), BALL, kd.Air(lift=None))
    track = kd.Track(times := np.linspace(0.0, 1.5, 60), flight.sample(times).position)
    page = kd.page(kd.identify(track, BALL, kd.Air(lift=None), free=[]))
    centres = DrawnScene(page).vertices("dots/0").reshape(-1, 12, 3).mean(axis=1)
    distances = np.linalg.norm(centres[:, None] - track.positions, axis=2)
    assert distances.min(axis=1).max() < 100 * SINGLE
    assert 10 <= len(centres) <= 15
    assert np.diff(distances.argmin(axis=1)).max() < 10
