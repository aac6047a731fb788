"""Tracks: checks, slices, files."""

import numpy as np
import pytest

import kickdyn as kd


@pytest.fixture
def track():
    times = np.arange(10) / 50
    return kd.Track(times, np.column_stack([times, 2 * times, 1 + times]))


def test_a_slice_is_a_track(track):
    part = track[2:5]
    assert len(part) == 3
    assert part == kd.Track(track.times[2:5], track.positions[2:5])
    assert part.duration == pytest.approx(0.04)
    with pytest.raises(ValueError, match="read-only"):
        part.times[0] = 1.0


@pytest.mark.parametrize(
    ("times", "positions", "message"),
    [
        ([0, 1], [[0, 0, 0]], r"shape \(2,\) and positions \(1, 3\)"),
        ([], np.zeros((0, 3)), "at least one sample"),
        ([0, 1, 1], np.zeros((3, 3)), r"times\[2\] is 1 s after times\[1\] of 1 s"),
        ([0, 1], [[0, 0, 0], [0, np.nan, 0]], r"positions\[1\] is \[0.0, nan, 0.0\]"),
        ([0, np.inf], np.zeros((2, 3)), r"times\[1\] is inf"),
        ("a", np.zeros((2, 3)), "real numbers"),
        (None, None, "times"),
    ],
)
def test_what_is_no_track_is_refused(times, positions, message):
    with pytest.raises(kd.InvalidInput, match=message):
        kd.Track(times, positions)


def test_an_index_is_refused(track):
    with pytest.raises(kd.InvalidInput, match=r"track\[3\]: a part of a track is a slice"):
        track[3]
    with pytest.raises(kd.InvalidInput, match="at least one sample"):
        track[3:3]


def test_a_file_with_gaps_and_other_names(tmp_path):
    file = tmp_path / "track.csv"
    file.write_text("frame, time ,X,Y,Z\n1,0.0,1,2,3\n2,0.1,,,\n3,0.2,4,5,6\n")
    track = kd.Track.from_csv(file, columns=("time", "X", "Y", "Z"))
    assert track == kd.Track([0.0, 0.2], [[1, 2, 3], [4, 5, 6]])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "no column 't', 'x', 'y', 'z'"),
        ("t,x,y\n0,1,2\n", "no column 'z': the first row has"),
        ("t,x,y,z\n", "no row of numbers"),
        ("t,x,y,z\n0,1,2,three\n", "row 2 has"),
        ("t,x,y,z\n0,1,2,nan\n", "row 2 .* finite"),
        ("t,x,y,z\n0,1,2,3\n0,1,2,3\n", "row 3 has the time 0 s after 0 s"),
    ],
)
def test_a_faulty_file_is_refused(tmp_path, text, message):
    file = tmp_path / "track.csv"
    file.write_text(text)
    with pytest.raises(kd.InvalidInput, match=message):
        kd.Track.from_csv(file)


def test_columns_are_four_names(tmp_path):
    with pytest.raises(kd.InvalidInput, match="four columns"):
        kd.Track.from_csv(tmp_path / "track.csv", columns=("t", "x"))
