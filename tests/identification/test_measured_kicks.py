"""The files in `data/`: synthetic kicks with their truth, and a measured match."""

import re
from pathlib import Path

import numpy as np
import pytest

import kickdyn as kd
from kickdyn.core.mechanics import GRAVITY

DATA = Path(__file__).resolve().parents[2] / "data"
DOCS = DATA.parent / "docs" / "how-to" / "measured-impacts.md"
measured_kicks = pytest.importorskip("measured_kicks", reason="tools come with the checkout only")
pytest.importorskip("ezc3d")


@pytest.mark.parametrize("number", [0, 1])
def test_files_are_those_of_the_script_and_the_truth_is_beside_them(number):
    surface = list(measured_kicks.KICKS)[number]
    track = kd.BodyTrack.from_c3d(DATA / f"kick_{surface}.c3d")
    assert track.markers == (*measured_kicks.MARKERS, "ball")
    made = measured_kicks.record(surface, np.random.default_rng(number))
    assert track.positions == pytest.approx(made, abs=1e-6, nan_ok=True)  # from millimetres
    assert np.diff(track.times) == pytest.approx(1 / measured_kicks.RATE)
    ball = kd.Track.from_c3d(DATA / f"kick_{surface}.c3d", "ball")
    np.testing.assert_array_equal(ball.positions, track.positions[:, -1])
    np.testing.assert_array_equal(ball.times, track.times)
    turned = kd.BodyTrack.from_c3d(DATA / f"kick_{surface}.c3d", up="y").positions[0, -1]
    assert turned.tolist() == (track.positions[0, -1, [0, 2, 1]] * (1, -1, 1)).tolist()
    with pytest.raises(kd.InvalidInput, match=r"'head'.*RASI"):
        kd.Track.from_c3d(DATA / f"kick_{surface}.c3d", "head")
    hit = measured_kicks.impact(surface)
    sizes = np.linalg.norm(hit.joint_impulses[:, :3], axis=1)
    sizes = dict(zip(hit.posture.leg.joint_names, sizes, strict=True))
    truth = [np.linalg.norm(hit.foot_velocity), hit.ball_after.speed]
    truth += [sizes[joint] for joint in ("hip", "knee", "ankle")]
    rows = re.findall(r"\| (\d+\.\d+) \| (\d+\.\d+) \|", (DATA / "README.md").read_text("utf-8"))
    assert [float(row[number]) for row in rows] == pytest.approx(truth, rel=1e-3)  # digits


def test_the_ground_of_a_measured_match_is_as_fifa_requires():
    """A rebound of 0.6 to 1.0 m from 2 m, and a roll of 4 to 10 m from a ramp 1 m high."""
    track = kd.Track.from_csv(DATA / "match_ball.csv")[:1500]
    found = kd.segments(track)
    low, high = np.sqrt([0.6 / 2.0, 1.0 / 2.0])
    spread = 2.0 * found.restitution.deviation
    assert spread < 0.15
    assert low - spread < found.restitution.median < high + spread
    rolling = found.rolling_deceleration
    longest, shortest = GRAVITY * 1.0 / (1.0 + 2.0 / 3.0) / np.array([10.0, 4.0])  # of a shell
    spread = 2.0 * rolling.deviation
    assert longest - spread < rolling.median < shortest + spread
