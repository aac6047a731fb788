"""Tracks of markers and joint angles: files in metres with z up, gaps, and what is refused."""

import numpy as np
import pytest

import kickdyn as kd

POINTS = np.arange(24.0).reshape(4, 2, 3) / 10


def trc(points, unit="mm", size=1000.0):
    """Text of a TRC file of the markers a and b, whose y axis points up."""
    lines = [
        "PathFileType\t4\t(X/Y/Z)\tkick.trc",
        "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits",
        f"100\t100\t{len(points)}\t2\t{unit}",
        "Frame#\tTime\ta\t\t\tb\t\t",
        "\t\tX1\tY1\tZ1\tX2\tY2\tZ2",
        "",
    ]
    for k, row in enumerate(points):
        turned = row[:, [0, 2, 1]] * (1, 1, -1)  # z up to y up
        cells = ["" if np.isnan(x) else repr(float(size * x)) for x in turned.ravel()]
        lines.append("\t".join([str(k + 1), f"{k / 100}", *cells]))
    return "\n".join(lines)


@pytest.mark.parametrize(("unit", "size"), [("mm", 1000.0), ("m", 1.0)])
def test_a_trc_file_in_metres_with_z_up(tmp_path, unit, size):
    points = POINTS.copy()
    points[2, 1] = np.nan
    file = tmp_path / "kick.trc"
    file.write_text(trc(points, unit, size))
    track = kd.BodyTrack.from_trc(file)
    assert track.markers == ("a", "b")
    assert track.times == pytest.approx([0, 0.01, 0.02, 0.03])
    assert track.positions == pytest.approx(points, nan_ok=True)
    assert track.gaps == {"b": (2,)}


def test_a_c3d_file(tmp_path):
    ezc3d = pytest.importorskip("ezc3d")
    content, points = ezc3d.c3d(), np.ones((4, 2, 4))
    points[:3] = 1000 * POINTS.transpose(2, 1, 0)
    points[:3, 1, 3] = np.nan
    parameters = content["parameters"]["POINT"]
    parameters["UNITS"]["value"], parameters["RATE"]["value"] = ["mm"], [500.0]
    parameters["LABELS"]["value"] = ("a", "b")
    content["data"]["points"] = points
    content.write(str(tmp_path / "kick.c3d"))
    track = kd.BodyTrack.from_c3d(tmp_path / "kick.c3d")
    assert np.diff(track.times) == pytest.approx(0.002)
    assert track.positions[:3] == pytest.approx(POINTS[:3], rel=1e-6)
    assert track.gaps == {"b": (3,)}
    turned = kd.BodyTrack.from_c3d(tmp_path / "kick.c3d", up="y")
    assert turned.positions[0, 1] == pytest.approx([0.3, -0.5, 0.4])


def test_the_track_of_one_marker():
    points = POINTS.copy()
    points[2, 1, 0] = np.nan
    track = kd.BodyTrack([0, 0.1, 0.2, 0.3], ["a", "b"], points)
    ball = track.marker_track("b")
    assert ball.times == pytest.approx([0, 0.1, 0.3])
    assert ball.positions == pytest.approx(POINTS[[0, 1, 3], 1])
    with pytest.raises(kd.InvalidInput, match=r"marker 'c' is unknown: the track has a, b"):
        track.marker_track("c")
    points[:, 1] = np.nan
    with pytest.raises(kd.InvalidInput, match="marker 'b' is not seen in any frame"):
        kd.BodyTrack([0, 1, 2, 3], ["a", "b"], points).marker_track("b")


def test_a_mot_file_in_radians(tmp_path):
    file = tmp_path / "kick.mot"
    file.write_text(
        "Coordinates\nversion=1\nnRows=2\nnColumns=3\ninDegrees=yes\nendheader\n"
        "time\tknee_angle_r\tpelvis_tx\n0.0\t90\t0.5\n0.01\t-45\t0.6\n"
    )
    track = kd.BodyTrack.from_mot(file)
    assert track.times == pytest.approx([0, 0.01])
    assert track.angles["knee_angle_r"] == pytest.approx([np.pi / 2, -np.pi / 4])
    assert track.angles["pelvis_tx"] == pytest.approx([0.5, 0.6])
    file.write_text(file.read_text().replace("=yes", "=no"))
    assert kd.BodyTrack.from_mot(file).angles["knee_angle_r"] == pytest.approx([90, -45])


@pytest.mark.parametrize(
    ("ending", "text", "message"),
    [
        ("trc", "no", "is not a TRC file"),
        ("trc", trc(POINTS, "inch"), "its unit is 'inch': it must be mm, cm, m"),
        ("trc", trc(POINTS).replace("0.01", "0.00"), "times must increase"),
        ("trc", trc(POINTS).replace("100.0", "x"), "line 7 must be numbers"),
        ("mot", "time a\n", "is not a MOT file: it must have a line endheader"),
        ("mot", "endheader\ntime a a\n0 1 2\n", "must name different columns, time first"),
        ("mot", "endheader\ntime a\n", "no row of numbers"),
    ],
)
def test_a_faulty_file_is_refused(tmp_path, ending, text, message):
    file = tmp_path / f"kick.{ending}"
    file.write_text(text)
    with pytest.raises(kd.InvalidInput, match=message):
        getattr(kd.BodyTrack, f"from_{ending}")(file)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (([0, 0], ["a"], np.zeros((2, 1, 3))), "times must have shape"),
        (([0, 1], ["a", "a"], np.zeros((2, 2, 3))), "marker 'a' is named twice"),
        (
            ([0, 1], ["a"], np.zeros((2, 3))),
            r"positions has shape \(2, 3\): it must be \(2, 1, 3\)",
        ),
        (([0, 1], "ab"), "markers is 'ab': it must be a list of names"),
        (([0, 1], ["a"], np.full((2, 1, 3), np.inf)), "infinite entries"),
    ],
)
def test_wrong_tracks_are_refused(arguments, message):
    with pytest.raises(kd.InvalidInput, match=message):
        kd.BodyTrack(*arguments)


SPOTS = 0.11 * np.array(
    [(0, 0, 1), (0.6, 0, 0.8), (0, -0.8, 0.6), (-0.48, 0.6, 0.64), (0, 0.6, 0.8)]
)


def ball_with_markers(spots=SPOTS, names="abcde"):
    """Return the track of markers of a ball that turns as it moves, and its centre."""
    times = np.linspace(0, 0.1, 11)
    centre = np.stack([20 * times, 3 * times, 0.11 + 4 * times], axis=1)
    cos, sin, zero = np.cos(30 * times), np.sin(30 * times), 0 * times
    turn = np.array([[cos, zero, sin], [zero, zero + 1, zero], [-sin, zero, cos]])
    points = centre[:, None] + np.einsum("ijt,kj->tki", turn, np.asarray(spots))
    return kd.BodyTrack(times, list(names[: len(spots)]), points), centre


def test_the_centre_of_a_ball_follows_from_markers_on_its_surface():
    track, centre = ball_with_markers()
    np.testing.assert_allclose(
        track.marker_track(*"abcde", radius=0.11).positions, centre, atol=1e-9
    )
    points = track.positions.copy()
    points[3, :2] = np.nan  # three of five are left
    points[5, 0] = np.nan
    noise = np.random.default_rng(3).normal(0, 5e-4, points.shape)
    ball = kd.BodyTrack(track.times, track.markers, points + noise).marker_track(
        *"abcde", radius=0.11
    )
    assert ball.times == pytest.approx(np.delete(track.times, 3))
    assert np.abs(ball.positions - np.delete(centre, 3, axis=0)).max() < 3e-3


@pytest.mark.parametrize(
    ("spots", "names", "radius", "fault"),
    [
        (SPOTS, "abc", 0.11, "3 markers are named: .* at least four"),
        (SPOTS, "abcd", None, r"4 markers are named: .* \(radius=\)"),
        (SPOTS, "abcd", 0.2, "mm from a sphere of radius 0.2 m: check the radius"),
        (SPOTS[[0, 0, 0, 0]], "abcd", 0.11, "up to 110 mm from a sphere"),
        (SPOTS * np.nan, "abcd", 0.11, "no frame has four of these markers"),
        (SPOTS, "abcx", 0.11, "marker 'x' is unknown"),
    ],
)
def test_markers_that_do_not_determine_the_centre_are_refused(spots, names, radius, fault):
    track, _ = ball_with_markers(spots)
    with pytest.raises(kd.InvalidInput, match=fault):
        track.marker_track(*names, radius=radius)


def test_the_prefix_of_a_subject_may_be_left_out():
    track = kd.BodyTrack([0, 1], ["Ann:a", "Ann:b", "Bob:b"], np.zeros((2, 3, 3)))
    assert track.find_marker("a") == track.find_marker("Ann:a") == 0
    with pytest.raises(kd.InvalidInput, match=r"marker 'b' is unknown: .*Bob:b"):
        track.find_marker("b")
