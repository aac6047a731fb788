"""Tracks: checks, slices, files."""

import csv
import sys

import numpy as np
import pytest

import kickdyn as kd
from kickdyn.identification.track import _send_c3d


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
        ([0, 1e20], np.zeros((2, 3)), r"times\[1\] is 1e\+20: every entry must be finite, up to"),
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
    file.write_text("frame, time ,X,Y,Z\n1,0.0,1,2,3\n2,0.1,,,\n3,0.2,4,5,6\n4,0.3,NaN,5,6\n")
    track = kd.Track.from_csv(file, columns=("time", "X", "Y", "Z"))
    assert track == kd.Track([0.0, 0.2], [[1, 2, 3], [4, 5, 6]])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "t,x,y\n0,1,2\n",
            r"its first row is \['t', 'x', 'y'\]: .* must name 't', 'x', 'y', 'z' once each",
        ),
        ("t,x,y,z\n", "no row of numbers"),
        ("t,x,y,z\n0,1,2,three\n", "row 2 has"),
        ("t,x,y,z\n0,1,2,inf\n", "row 2 .* finite"),
        ("t,x,y,z\n0,1,2,nan\n", "no row of numbers"),
        ("", r"its first row is \[\]"),
        ("t;x;y;z\n0;1;2;3\n", "'t;x;y;z'.*: separated by commas"),
        ("t,x,y,x,z\n0,1,2,1,3\n", "once each"),
        ("t,x,y,z\n0,02,1,0,2,0,3,0\n", "row 2 has 8 cells and the first row 4"),
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


@pytest.fixture
def c3d(tmp_path):
    """Return a function that writes a C3D file of two markers in a unit."""
    ezc3d = pytest.importorskip("ezc3d")

    def written(unit="mm", labels=("ball", "foot"), size=1000.0, first=0):
        content, points = ezc3d.c3d(), np.ones((4, len(labels), 6))
        points[:3, 0] = size * np.arange(18).reshape(6, 3).T
        points[:3, 0, 2] = np.nan  # not seen
        parameters = content["parameters"]["POINT"]
        parameters["UNITS"]["value"], parameters["RATE"]["value"] = [unit], [100.0]
        parameters["LABELS"]["value"] = labels
        content["data"]["points"] = points
        content["header"]["points"]["first_frame"] = first
        content["header"]["points"]["last_frame"] = first + 5
        content.write(str(tmp_path / "track.c3d"))
        return tmp_path / "track.c3d"

    return written


def test_a_c3d_file_is_read_without_modules_of_the_working_directory(c3d, tmp_path, monkeypatch):
    (tmp_path / "numpy.py").write_text('raise SystemExit("planted")')
    monkeypatch.chdir(tmp_path)
    assert len(kd.Track.from_c3d(c3d("m", ("ball",)))) == 5


@pytest.mark.parametrize(("unit", "size"), [("mm", 1000.0), ("cm", 100.0), ("m", 1.0)])
def test_a_marker_of_a_c3d_file_in_metres(c3d, unit, size):
    track = kd.Track.from_c3d(c3d(unit, size=size), marker="ball")
    assert track.times == pytest.approx([0, 0.01, 0.03, 0.04, 0.05])
    assert track.positions[:2] == pytest.approx(np.array([[0, 1, 2], [3, 4, 5]]), rel=1e-6)
    assert len(kd.Track.from_c3d(c3d(unit, ("ball",)))) == 5


def test_times_of_a_c3d_file_count_from_its_first_frame(c3d):
    """Files of two cameras that began at different frames have one clock."""
    track = kd.Track.from_c3d(c3d(first=40), marker="ball")
    assert track.times == pytest.approx([0.4, 0.41, 0.43, 0.44, 0.45])


@pytest.mark.parametrize(
    ("options", "marker", "message"),
    [
        ({}, "head", r"no marker 'head': its markers are \['ball', 'foot'\]"),
        ({}, None, "several markers, name one"),
        ({"unit": "furlong"}, "ball", "its unit is 'furlong'"),
    ],
)
def test_a_faulty_c3d_file_is_refused(c3d, options, marker, message):
    with pytest.raises(kd.InvalidInput, match=message):
        kd.Track.from_c3d(c3d(**options), marker)


@pytest.mark.parametrize(
    "changes", [{970: 236}, {273: 106, 1089: 135}, {1056: 255}, {550: 127}], ids=str
)
def test_a_damaged_c3d_file_is_refused(c3d, changes, monkeypatch):
    """Read in this process, two would end it, the third would take all memory, the last no end."""
    monkeypatch.setattr("kickdyn.identification.track.C3D_MEMORY", 800_000_000)
    monkeypatch.setattr("kickdyn.identification.track.C3D_TIME", 5.0 if 1056 in changes else 2.0)
    file = c3d()
    content = bytearray(file.read_bytes())
    for place, byte in changes.items():
        content[place] = byte
    file.write_bytes(content)
    with pytest.raises(kd.InvalidInput, match="not a C3D file that ezc3d can read"):
        kd.Track.from_c3d(file, "ball")


def test_what_is_no_c3d_file_is_refused(tmp_path):
    pytest.importorskip("ezc3d")
    (tmp_path / "text.c3d").write_text("t,x,y,z\n")
    for name, message in (("text.c3d", "is not a C3D file"), ("none.c3d", "no such file")):
        with pytest.raises(kd.InvalidInput, match=message):
            kd.Track.from_c3d(tmp_path / name)


def test_a_cell_may_be_long_and_other_readers_keep_their_limit(tmp_path):
    limit, file = csv.field_size_limit(), tmp_path / "track.csv"
    file.write_text(f"t,x,y,z\n0,1,2,{3.5:.200000f}\n")
    assert kd.Track.from_csv(file).positions.tolist() == [[1, 2, 3.5]]
    assert csv.field_size_limit() == limit
    file.write_text("t,x\n")
    with pytest.raises(kd.InvalidInput, match="its first row"):
        kd.Track.from_csv(file)
    assert csv.field_size_limit() == limit


def test_the_process_that_reads_a_c3d_file_is_limited(monkeypatch):
    resource, limits = pytest.importorskip("resource"), {}
    monkeypatch.setattr(resource, "setrlimit", limits.__setitem__)
    monkeypatch.setattr("sys.argv", ["", "none.c3d", "2000", "7"])
    monkeypatch.setitem(sys.modules, "ezc3d", None)  # what it may cost is limited before
    with pytest.raises(ImportError):
        _send_c3d()
    assert limits == {resource.RLIMIT_AS: (2000, 2000), resource.RLIMIT_CPU: (7, 7)}
