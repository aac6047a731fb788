"""Tracks of markers and joint angles: files in metres with z up, gaps, the centre of a ball."""

import numpy as np
import pytest
from tolerances import agrees, closed_form, optimized

import kickdyn as kd
from kickdyn.errors import FaultyFile

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


@pytest.mark.parametrize(("unit", "size", "between", "gap"), [
    ("mm", 1000.0, "\t", ""), ("cm", 100.0, "\t\t", "0"), ("m", 1.0, " \t ", "-9999"),
    ("inch", 1 / 0.0254, " ", "nan"), ("Meters", 1.0, "\t", ""), ("in", 1 / 0.0254, "\t", ""),
    ("centimeters", 100.0, "\t", ""), ("millimeters", 1000.0, "\t", "")])  # fmt: skip
def test_a_trc_file_in_metres_with_z_up(tmp_path, unit, size, between, gap):
    """Its values stand between any blanks; missing markers are empty, nan or one number thrice."""
    points, file = POINTS + 0.1, tmp_path / "kick.trc"
    points[2, 1] = np.nan
    lines = trc(points, unit, size).split("\n")
    lines[2] = lines[2].replace("\t", between)
    lines[8] = lines[8].removesuffix("\t\t\t") + 3 * f"\t{gap}"
    file.write_text("\n".join(lines))
    track = kd.BodyTrack.from_trc(file)
    assert (track.markers, track.gaps) == (("a", "b"), {"b": (2,)})
    assert track.times == pytest.approx([0, 0.01, 0.02, 0.03])
    assert track.positions == pytest.approx(points, nan_ok=True)


TRC = trc(POINTS)


@pytest.mark.parametrize(("text", "markers"), [
    (TRC.replace("\n", "\r\n"), "ab"), ("\ufeff" + TRC.replace(".", ","), "ab"),
    (TRC.replace("\t", "  "), "ab"), (TRC.replace("PathFileType", "pathfiletype"), "ab"),
    (TRC.replace("\n\n", "\n"), "ab"), (TRC.replace("\n\t\tX1\tY1\tZ1\tX2\tY2\tZ2\n", ""), "ab"),
    (TRC.replace("100\t100", "100\t"), "ab"), (TRC.replace("a\t\t\tb\t\t", "a\tb"), "ab"),
    (TRC.replace("a\t\t\tb", "a\t\t\t"), "a"), (TRC.replace("a\t\t\tb", "\t\t\tb"), "b"),
    (TRC.replace("\na", "a") + "\t", "ab"), (TRC.rpartition("\n")[0], "ab"),
    (TRC.rsplit("\n", 3)[0], "ab")], ids=range(13))  # fmt: skip
def test_a_trc_file_of_any_writer_has_its_markers_in_place(tmp_path, text, markers):
    """A marker without a name takes no other's place; decimals may have commas."""
    (tmp_path / "kick.trc").write_bytes(text.encode())
    track = kd.BodyTrack.from_trc(tmp_path / "kick.trc")
    assert "".join(track.markers) == markers
    right = POINTS[: len(track), ["ab".index(name) for name in markers]]
    agrees(track.positions, right, closed_form(1e3))


@pytest.mark.parametrize(("header", "unit"), [
    ("inDegrees=yes", 180 / np.pi), ("inDegrees = yes\t\t", 180 / np.pi), ("inDegrees=no", 1.0),
    ("# SIMM Motion File Header:\nname kick", 180 / np.pi), ("version=1", 1.0),
    ("Angles are in degrees.", 180 / np.pi),
    ("Units are S.I. (angles in degrees with inDegrees=yes)\ninDegrees=no", 1.0),
    ("inDegrees: no", 1.0), ("INDEGREES=YES\r", 180 / np.pi)])  # fmt: skip
def test_a_mot_file_in_radians(tmp_path, header, unit):
    """Columns that share a name are left out, translations keep their unit."""
    file = tmp_path / "kick.mot"
    file.write_text(
        f"Coordinates\nnRows=2\nnColumns=5\n{header}\nEndHeader\t\n\n"
        "Time\tknee_angle_r\tpelvis_tx\t/base/Pelvis_TY/value\ta\ta\t\n"
        "0.0\t90\t0,5\t0.7\t1\t2\n0.01\t-45\t\t0.8\t1\t2\t\n0.02   0 0.6 0.9 1 2\n"
    )
    track = kd.BodyTrack.from_mot(file)
    assert track.times.tolist() == [0, 0.01, 0.02]
    assert set(track.angles) == {"knee_angle_r", "pelvis_tx", "/base/Pelvis_TY/value"}
    assert track.warnings == ("2 columns are named a: left out",)
    assert track.angles["knee_angle_r"] * unit == pytest.approx([90, -45, 0])
    assert track.angles["pelvis_tx"] == pytest.approx([0.5, np.nan, 0.6], nan_ok=True)
    assert track.angles["/base/Pelvis_TY/value"] == pytest.approx([0.7, 0.8, 0.9])


@pytest.mark.parametrize(("key", "number", "warned"), [
    ("NumMarkers", 2, False), ("NumMarkers", 3, True), ("NumFrames", len(POINTS), False),
    ("NumFrames", 99, True)])  # fmt: skip
def test_other_numbers_in_the_header_of_a_trc_file_are_warned_of(tmp_path, key, number, warned):
    lines = TRC.splitlines()
    lines[1:3] = [f"Units\t{key}", f"cm\t{number}"]
    (tmp_path / "kick.trc").write_text("\n".join(lines))
    line = f"line 3 says {number} {key[3:].lower()}, and {2 if warned else number} are read"
    if key == "NumFrames" and warned:
        line = f"line 3 says 99 frames, and {len(POINTS)} are read"
    assert kd.BodyTrack.from_trc(tmp_path / "kick.trc").warnings == ((line,) if warned else ())


MOT = "inDegrees=no\nendheader\ntime\ta\n0\t1\n1\t2\n"


@pytest.mark.parametrize(("ending", "text", "message", "remedy"), [
    ("trc", TRC[4:], "not a TRC file.*PathFileType", ("FileType", "PathFileType")),
    ("trc", trc(POINTS, "ell"), r"'ell'.*mm, cm, m", ("ell", "cm")),
    ("trc", TRC.split("Frame#")[0], "ends after 3 lines", (TRC.split("Frame#")[0], TRC)),
    ("trc", TRC.replace("a\t\t\tb", "\t\t\t"), "line 4 must name", ("Time", "Time\ta")),
    ("trc", TRC.replace("a\t\t\tb", "a\tb\tc"), "line 7 has 8 cells.* 11", ("a\tb\tc", "a\tb")),
    ("trc", TRC.replace("\t", " ").replace(" 200.0", ""), "line 7 has 7.* 8", ("1 0", "1 0 0")),
    ("trc", TRC.replace("0.01", "0.00"), "line 8 .* 0 after 0.*increase", ("0.00\t", "0.01\t")),
    ("trc", TRC.replace("100.0", "x"), "line 7 is .*'-?x'.* must be numbers", ("x", "100.0")),
    ("mot", MOT.replace("endheader", ""), "must have a line endheader", ("=no", "=no\nendheader")),
    ("mot", MOT.replace("time\ta", "a\ttime"), "line 3 .*time first", ("a\ttime", "time\ta")),
    ("mot", MOT.replace("=no", "=maybe"), "'maybe'.* yes or no", ("maybe", "yes")),
    ("mot", MOT.replace("\ta\n", "\ta\tb\n"), "line 4 has 2 cells.* 3", ("\ta\tb", "\ta")),
    ("mot", MOT.replace("1\t2", "0\t2"), "line 5 .* 0 after 0.*increase", ("0\t2", "1\t2")),
    ("mot", "endheader\ntime a\n", "no row", ("a\n", "a\n0 1\n"))], ids=range(14))  # fmt: skip
def test_a_file_is_refused_with_advice_that_helps(tmp_path, ending, text, message, remedy):
    file, read = tmp_path / f"kick.{ending}", getattr(kd.BodyTrack, f"from_{ending}")
    file.write_text(text)
    with pytest.raises(FaultyFile, match=message) as refused:
        read(file)
    assert str(refused.value).isprintable()
    file.write_text(text.replace(*remedy))
    assert len(read(file))


def test_markers_are_found_by_name_without_the_prefix_of_a_subject_and_gaps_are_left_out():
    points = np.concatenate([POINTS, POINTS[:, :1]], axis=1)
    points[2, 1, 0] = np.nan
    track = kd.BodyTrack([0, 0.1, 0.2, 0.3], ["Ann:a", "b", "Bob:b"], points)
    assert track.find_marker("a") == track.find_marker("Ann:a") == 0
    twice = kd.BodyTrack([0, 0.1, 0.2, 0.3], ["Ann:a", "b", "b"], points)
    assert twice.find_marker("a") == 0
    with pytest.raises(kd.InvalidInput, match="'b' is named 2 times"):
        twice.find_marker("b")
    assert track.marker_track("b") == kd.Track([0, 0.1, 0.3], POINTS[[0, 1, 3], 1])
    with pytest.raises(kd.InvalidInput, match=r"'c'.*Bob:b"):
        track.marker_track("c")
    points[:, 1] = np.nan
    with pytest.raises(kd.InvalidInput, match="'b' is not seen"):
        kd.BodyTrack([0, 1, 2, 3], ["a", "b", "c"], points).marker_track("b")


RADIUS = 0.05
SPOTS = RADIUS * np.array(
    [(0, 0, 1), (0.6, 0, 0.8), (0, -0.8, 0.6), (-0.48, 0.6, 0.64), (0, 0.6, 0.8)]
)


def ball_with_markers(spots=SPOTS, noise=0.0):
    """Return the track of markers of a ball that turns as it moves, and its centre."""
    times = np.linspace(0, 0.1, 11)
    centre = np.stack([20 * times, 3 * times, 0.11 + 4 * times], axis=1)
    cos, sin, zero = np.cos(30 * times), np.sin(30 * times), 0 * times
    turn = np.array([[cos, zero, sin], [zero, zero + 1, zero], [-sin, zero, cos]])
    points = centre[:, None] + np.einsum("ijt,kj->tki", turn, np.asarray(spots))
    points += np.random.default_rng(3).normal(0, noise, points.shape)
    return kd.BodyTrack(times, list("abcde"[: len(spots)]), points), centre


def test_the_centre_of_a_ball_is_as_far_from_all_markers_as_its_radius():
    track, centre = ball_with_markers()
    points = track.positions.copy()
    points[3, :2] = np.nan  # three of five remain
    points[5, 0] = np.nan
    ball = kd.BodyTrack(track.times, track.markers, points).marker_track(*"abcde", radius=RADIUS)
    assert ball.times == pytest.approx(np.delete(track.times, 3))
    agrees(ball.positions, np.delete(centre, 3, axis=0), optimized())
    # with noise, no other centre has a smaller sum of squares: its derivatives are 0
    track, _ = ball_with_markers(noise=5e-4)
    fitted = track.marker_track(*"abcde", radius=RADIUS)
    arms = fitted.positions[:, None] - track.positions
    distances = np.linalg.norm(arms, axis=2)
    slopes = ((distances - RADIUS)[..., None] * arms / distances[..., None]).sum(axis=1)
    assert np.abs(slopes).max() < optimized() * np.abs(distances - RADIUS).max()
    # the corners of a tetrahedron have its centre as theirs; they may be 5 % off the ball
    corners = RADIUS * np.array([(1, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1)]) / np.sqrt(3.0)
    for share in (0.951, 1.049):
        track, centre = ball_with_markers(share * corners)
        agrees(track.marker_track(*"abcd", radius=RADIUS).positions, centre, optimized())
    with pytest.raises(kd.InvalidInput, match=r"2\.55 mm from a sphere"):
        ball_with_markers(1.051 * corners)[0].marker_track(*"abcd", radius=RADIUS)
