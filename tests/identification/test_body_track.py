"""Tracks of markers and angles; markers on a leg, and the smoothing spline of configurations."""

import numpy as np
import pinocchio as pin
import pytest
from chains import free_body
from kick_motion import LEG, PLACES, state
from tolerances import agrees, closed_form, differenced, optimized, sampled

import kickdyn as kd
from kickdyn.errors import FaultyFile
from kickdyn.identification import smoothing_spline
from kickdyn.identification.marker_kinematics import (
    MARKER_NOISE,
    SCALE_DEVIATION,
    FittedLeg,
    Marker,
    MarkerKinematics,
    place_deviation,
    scaled_leg,
)
from kickdyn.identification.smoothing_spline import GROWTH, SmoothingSpline

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


LEG_MODEL = kd.Leg.human().model
TIMES = np.linspace(-0.15, 0.0, 76)
DEVIATION = 3e-3


def measured(curve, seed):
    noise = DEVIATION * np.random.default_rng(seed).normal(size=(len(TIMES), 3))
    return np.array([curve(TIMES)] * 3).T + noise


def spline(q, growth=0.0):
    information = np.tile(np.eye(3) / DEVIATION**2, (len(TIMES), 1, 1))
    return SmoothingSpline(LEG_MODEL, TIMES, q, information, growth)


def on_a_grid(y, density, growth, step=2e-3):
    """Return v and its deviation at 0 on a grid, which ends with the knots after the last time."""
    count = round((TIMES[-1] - TIMES[0] + 2 * 0.15 / 76) / step) + 1
    grid = TIMES[0] + step * np.arange(count)
    nearest = np.eye(count)[np.rint((TIMES - TIMES[0]) / step).astype(int)]
    hessian = nearest.T @ nearest / DEVIATION**2
    for order, share, size in ((3, 0.5, 1 / smoothing_spline.JERK_TIME**2), (4, 1.0, 1.0)):
        rows = np.diff(np.eye(count), order, axis=0) / step**order
        middles = grid[: len(rows)] + 0.5 * order * step
        grown = growth * np.maximum(middles, -smoothing_spline.GROWTH_TIME)
        hessian += rows.T @ (rows * (np.exp(-share * grown) * size * step / density)[:, None])
    covariance = np.linalg.inv(hessian)
    curve, k = covariance @ nearest.T @ y / DEVIATION**2, round(0.15 / step)
    slope = np.zeros(count)
    slope[[k - 1, k + 1]] = -0.5 / step, 0.5 / step
    return slope @ curve, np.sqrt(slope @ covariance @ slope)


@pytest.mark.parametrize("growth", [0.0, GROWTH])
@pytest.mark.parametrize("exponent", [7.0, 9.0])
def test_the_curve_minimises_its_functional(monkeypatch, growth, exponent):
    """Against a curve on a grid; the spline's knots are 10 ms apart."""
    monkeypatch.setattr(smoothing_spline, "_likely_density", lambda *_: 10.0**exponent)
    size = 10.0 ** ((exponent - 9.0) / 2.0)  # a density grows as the square of the curve
    q = measured(lambda t: size * np.tanh(t / 0.06), 4)
    _, v, covariance = spline(q, growth).state(0.0)
    for j in range(3):
        velocity, deviation = on_a_grid(q[:, j], 10.0**exponent, growth)
        assert np.sqrt(covariance[3 + j, 3 + j]) == pytest.approx(deviation, rel=0.03)
        assert v[j] == pytest.approx(velocity, abs=0.1 * deviation)


def test_a_density_of_which_the_measurement_says_nothing_is_the_median():
    rows, penalty = np.random.default_rng(1).normal(size=(20, 8)), np.linspace(1.0, 2.0, 8)
    penalty[: smoothing_spline.FREE] = 0.0
    found = smoothing_spline._likely_density(rows, penalty, rows[:, 0], np.full(20, 1e40), 7.3)
    assert np.log10(found) == pytest.approx(7.3, abs=1e-3)


def test_deviations_cover_curves_of_the_prior():
    """Curves whose jerk is an Ornstein-Uhlenbeck process, with densities of the prior."""
    rng, scores, fine = np.random.default_rng(7), [], 5e-4
    steps = round(0.15 / fine)
    decay = np.exp(-fine / smoothing_spline.JERK_TIME)
    for _ in range(15):
        prior = smoothing_spline.ANGLE_DENSITY, smoothing_spline.DENSITY_DEVIATION
        density = 10.0 ** rng.normal(*prior, 3)
        size = np.sqrt(density * smoothing_spline.JERK_TIME / 2)
        jerk = [size * rng.normal(size=3)]
        for _ in range(steps):
            jerk.append(decay * jerk[-1] + size * np.sqrt(1 - decay**2) * rng.normal(size=3))
        rates = [np.array(jerk)]  # then acceleration, velocity, position, by trapezoids
        for start in ((5.0, 3.0, 20.0), (3.0, -4.0, 2.0), (0.3, 0.5, -0.2)):
            steps_of_x = fine * (rates[-1][1:] + rates[-1][:-1]) / 2
            rates.append(start + np.vstack([np.zeros(3), np.cumsum(steps_of_x, axis=0)]))
        positions, velocity = rates[3][:: steps // 75], rates[2][-1]
        q = positions + DEVIATION * rng.normal(size=positions.shape)
        _, v, covariance = spline(q).state(0.0)
        scores.append((v - velocity) / np.sqrt(covariance.diagonal()[3:]))
    assert np.mean(np.square(scores)) == pytest.approx(1.0, abs=np.sqrt(2) * sampled(45, 4.0))


def test_a_free_body_by_differences(monkeypatch):
    """Without jerk, the covariance is that of a quadratic by weighted least squares.

    Where the body is at rest, errors of its angles turn no velocity. The acceleration is exact at
    the end, the reference. Medians of the prior are 0.01 m or 0.03 rad within 0.05 s.
    """
    model, priors, rng = free_body().leg.model, [], np.random.default_rng(2)
    monkeypatch.setattr(smoothing_spline, "_likely_density", lambda *x: priors.append(x) or 1e-20)
    times, factors = np.linspace(-1.0, 0.0, 12), rng.normal(size=(12, 6, 6))
    information = factors @ factors.transpose(0, 2, 1) + np.eye(6)
    information[-1] = 0.0
    square, line = 0.5 * rng.normal(size=(2, 6))

    def spline_of(line, number=0, change=0.0 * line):
        moved = np.outer(4 * times * (times + 1), square) + np.outer(times, line)
        q = np.array([pin.integrate(model, pin.neutral(model), x) for x in moved])
        q[number] = pin.integrate(model, q[number], change)
        return SmoothingSpline(model, times, q, information)

    def slopes(first, last):
        change = pin.difference(model, first[0], last[0])
        return np.concatenate([change, last[1] - first[1]]) / 2e-5

    still, rest, expected = spline_of(0.0 * line), -0.5, np.zeros((12, 12))
    _, _, _, variances, medians = zip(*priors, strict=True)
    assert medians == pytest.approx(np.log10(np.repeat([0.01, 0.03], 3) ** 2 / 0.05**7), abs=0.2)
    assert [x[-1] for x in variances] == pytest.approx([100.0] * 6)  # 10 m or rad
    for k in range(11):
        by_frame = np.transpose([slopes(*(spline_of(0.0 * line, k, x).state(rest) for x in (-e, e)))
                                 for e in 1e-5 * np.eye(6)])  # fmt: skip
        expected += by_frame @ np.linalg.inv(information[k]) @ by_frame.T
    agrees(still.state(rest)[2], expected, differenced())
    moving = spline_of(line).state
    for t, count in ((0.0, 12), (rest, 6)):
        right = slopes(moving(t - 1e-5), moving(t + 1e-5))
        agrees(spline_of(line).rate(t)[:count], right[:count], differenced())
