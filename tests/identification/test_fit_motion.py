"""Motions from markers: against the motion that made them, with noise, gaps and faults."""

import re
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from kick_motion import HIP, KNEE, LEG, PLACES, state, track, velocity
from tolerances import agrees, closed_form, optimized, sampled

import kickdyn as kd
from kickdyn.identification.fit_motion import PELVIS, base_configurations

NOISE, FASTEST = 1e-3, abs(velocity(0)[KNEE])


def changed(change, rate=240, noise=0.0):
    """Return the track of the kick with other positions."""
    whole = track(rate, noise)
    positions = whole.positions.copy()
    change(positions)
    return kd.BodyTrack(whole.times, whole.markers, positions)


def put(*where, value=None, place=None):
    """Return a change of positions: a value, or the positions of another place."""

    def change(positions):
        positions[where] = value if place is None else positions[place].copy()

    return change


@pytest.fixture(scope="module")
def exact():
    return kd.fit_motion(track(240), LEG, PLACES, contact=0.0)


@pytest.fixture(scope="module")
def noisy():
    return [kd.fit_motion(track(240, NOISE, seed), LEG, PLACES, contact=0.0) for seed in range(3)]


def test_without_noise_the_configurations_are_those_of_the_motion(exact):
    """The last frame is 4 ms before the contact, to which the velocity is extrapolated."""
    for t, q in zip(exact.times, exact.configurations, strict=True):
        error = pin.difference(LEG.model, state(t), q)
        np.testing.assert_allclose(error, 0, atol=optimized(1e-10), err_msg=f"t = {t}")
    assert list(exact.scales.values()) == pytest.approx([1.0] * 7, abs=optimized(1e-10))
    assert (exact.warnings, exact.frames) == ((), tuple(range(48)))
    assert exact.v(-0.1) == pytest.approx(velocity(-0.1), abs=1e-3)
    at, truth = exact.at_contact(), LEG.posture(state(0)).point_velocity(velocity(0))
    assert at.v == pytest.approx(velocity(0), abs=2e-3 * FASTEST)
    assert at.foot_velocity == pytest.approx(truth, abs=2e-3 * np.linalg.norm(truth))


def test_noise_and_deviations_are_those_of_the_errors(noisy):
    """48 frames of 12 markers less 12 coordinates leave 1,152 degrees of freedom."""
    scores = []
    for motion in noisy:
        assert motion.noise == pytest.approx(NOISE, rel=sampled(2 * 1152))
        assert motion.warnings == ()
        rms = np.sqrt(np.mean(np.square(list(motion.residuals.values()))))
        assert rms == pytest.approx(NOISE * np.sqrt(3 * 1152 / 1728), rel=sampled(2 * 1152))
        shown = {name: (value, unit) for name, value, unit in motion._rows()}
        assert shown["noise of a coordinate"] == (pytest.approx(1e3 * motion.noise), "mm")
        foot = shown["residual of foot0"]
        assert foot == (pytest.approx(1e3 * motion.residuals["foot0"]), "mm")
        at = motion.at_contact()
        scores += [pin.difference(LEG.model, state(0), at.posture.q) / at.q_deviations]
        scores += [(at.v - velocity(0)) / at.v_deviations]
        assert np.degrees(at.q_deviations[6:]).max() < 1.0
        assert at.v_deviations[[HIP, KNEE]].max() < 0.05 * FASTEST
    assert np.sqrt(np.mean(np.square(scores))) == pytest.approx(1.0, rel=sampled(72))


def test_segments_take_the_lengths_of_the_person():
    other = kd.Leg.human(height=1.8, mass=58, sex="female", model="3d", base="floating")
    share = 1.65 / 1.8
    places = {name: (link, np.array(p) / share) for name, (link, p) in PLACES.items()}
    motion = kd.fit_motion(track(50), other, places)
    assert motion.scales["hip_rotation"] == pytest.approx(share, rel=1e-3)
    knee, ankle = motion.scales["knee"], other.model.getJointId("ankle")
    assert knee == pytest.approx(share, rel=1e-3)
    fitted, given = (leg.model.inertias[ankle - 1] for leg in (motion.leg, other))
    assert fitted.mass == given.mass
    assert fitted.lever == pytest.approx(knee * given.lever)
    assert fitted.inertia == pytest.approx(knee**2 * given.inertia)
    lengths = [leg.model.jointPlacements[ankle].translation for leg in (motion.leg, other)]
    assert lengths[0] == pytest.approx(knee * lengths[1])


def test_places_that_are_wrong_by_a_centimetre_are_estimated():
    """Velocities stay right; without it, those of the knee and the foot are wrong by 3 to 8 %."""
    rng = np.random.default_rng(5)
    rough = {n: (link, p + 0.01 * rng.uniform(-1, 1, 3)) for n, (link, p) in PLACES.items()}
    motion = kd.fit_motion(track(120, NOISE), LEG, rough)
    (line,) = motion.warnings
    assert "places" in line
    assert motion.noise == pytest.approx(NOISE, rel=sampled(2 * 576))
    at = motion.at_contact(0.0)
    assert at.v[[HIP, KNEE]] == pytest.approx(velocity(0)[[HIP, KNEE]], abs=0.05 * FASTEST)
    scores = (at.v - velocity(0)) / at.v_deviations
    assert np.sqrt(np.mean(scores**2)) < 1.0 + sampled(12)
    assert motion.scales["knee"] == pytest.approx(1.0, abs=0.03)


def test_nothing_is_smoothed_across_the_impact():
    """A jump by 30 mm after the contact does not change the motion before it."""
    whole = track(240, until=0.1)
    moved = whole.positions + np.where(whole.times >= 0.0, 1.0, 0.0)[:, None, None] * (0.03, 0, 0)
    plain, jump = (
        kd.fit_motion(body, LEG, PLACES, contact=0.0, scale=False)
        for body in (whole, kd.BodyTrack(whole.times, whole.markers, moved))
    )
    assert jump.q(-0.01) == pytest.approx(plain.q(-0.01), rel=closed_form(1e3))
    for contact in (None, (0.012, 0.012)):  # a contact that may have begun at 0, too
        before = plain.at_contact(contact).v
        assert jump.at_contact(contact).v == pytest.approx(before, rel=closed_form(1e6))
    assert jump.q(0.05)[0] - plain.q(0.05)[0] == pytest.approx(0.03, rel=1e-4)


def test_gaps_are_named_and_the_markers_that_are_seen_count():
    def hide(positions):
        positions[[5, 46, 47], 0] = np.nan
        positions[7:9, 3:] = np.nan
        positions[30, 11] += 0.05
        positions[20, 4] += 0.03

    motion = kd.fit_motion(changed(hide), LEG, PLACES, scale=False)
    assert motion.gaps["base0"] == (5, 46, 47)
    for contact, frames in ((-0.005, 2), (-0.01, 0)):  # after frames 46 and 45
        lines = kd.fit_motion(changed(hide), LEG, PLACES, scale=False, contact=contact).warnings
        named = [line for line in lines if "not seen in frame" in line]
        assert ["'base0' (2 frames)" in line for line in named] == [True] * (frames > 0)
    assert motion.gaps["thigh1"] == motion.undetermined == (7, 8)
    for k, coordinates in ((5, 12), (7, 6), (9, 12)):  # only the pelvis in frame 7
        error = pin.difference(LEG.model, state(motion.times[k]), motion.configurations[k])
        assert np.abs(error[:coordinates]).max() < optimized(), f"frame {k}"
    (line,) = (line for line in motion.warnings if "miss their places" in line)
    sizes = re.findall(r"'(\w+)' by (\d+) mm", line)  # from the farthest to the nearest
    assert "in frame 30, 'foot2'" in line
    assert [int(size) for _, size in sizes] == sorted((int(x) for _, x in sizes), reverse=True)
    assert len(sizes) > 1
    assert "and in 1 other frames" in line


def test_markers_of_a_foot_that_are_never_seen_together_still_count():
    def hide(positions):
        positions[::2, 9] = positions[1::2, 10] = np.nan

    motion = kd.fit_motion(changed(hide), LEG, PLACES, scale=False)
    for t, q in zip(motion.times, motion.configurations, strict=True):
        assert np.abs(pin.difference(LEG.model, state(t), q)).max() < optimized(), f"t = {t}"


def test_a_contact_needs_frames_just_before_it(exact):
    """Eight, the last one 20 ms before it at most, both without its deviation."""
    begin, end = exact.times[[0, -1]]
    h, late = 1 / 240, end + 0.024
    half = begin + h * (np.arange(9) + 0.5)
    for near, far in (
        (end + 0.0199, end + 0.0201), ((late, 0.0041), (late, 0.0039)),
        (half[7], half[6]), ((half[8], 0.9 * h), (half[8], 1.6 * h)),
    ):  # fmt: skip
        exact.at_contact(near)
        with pytest.raises(kd.InvalidInput, match=r"frames of the 0\.15 s before"):
            exact.at_contact(far)
    with pytest.raises(kd.InvalidInput, match=rf"known from {begin:g} to {end:g} s"):
        exact.v(0.001)
    for share, count in ((2.49, 0), (2.51, 1)):
        lines = replace(exact, residuals={"a": 1.0, "b": share, "c": 1.0}).warnings
        assert sum("marker 'b' is" in line for line in lines) == count


@pytest.mark.parametrize(("angle", "count"), [(50.0, 0), (70.0, 1)])
def test_a_pelvis_that_is_tilted_by_more_than_60_degrees_is_named(angle, count):
    """All markers are turned; the pelvis of the kick itself is tilted by less than 10 degrees."""
    turn = pin.rpy.rpyToMatrix(0.0, np.radians(angle), 0.0)
    turned = changed(lambda p: p.__setitem__(..., p @ turn.T), rate=50)
    lines = kd.fit_motion(turned, LEG, PLACES).warnings
    assert sum("the pelvis is tilted" in line for line in lines) == count


def standing_on_y(positions):
    """Turn y up, and exchange two markers in a frame."""
    put(5, [0, 1], place=(5, [1, 0]))(positions)
    positions[:] = positions[..., [0, 2, 1]] * (1, 1, -1)


KEEP = put(0, 0, value=np.nan)
MIRRORED = {name: (link, (x, -y, z)) for name, (link, (x, y, z)) in PLACES.items()}


@pytest.mark.parametrize(("change", "markers", "message"), [
    (lambda p: p.__imul__(1000), PLACES, "millimetres"),
    (put(5, [0, 1], place=(5, [1, 0])), PLACES, r"'base[01]' is .* frame 5.* segment; .*NaN"),
    (put(4, [0, 1], place=(4, [1, 0])), PLACES, "'base0', 'base1' may be swapped in frame 4"),
    (standing_on_y, PLACES, r"'base[01]' .* \(y seems to point up: see `up`\); in a few"),
    (lambda p: p.__setitem__((..., 1), -p[..., 1]), PLACES, "'base0', 'base1' are swapped"),
    (put(slice(None), slice(9, None), value=np.nan), PLACES, "'foot0' is not seen"),
    (KEEP, {k: v for k, v in PLACES.items() if "foot" not in k},
     "too few .*(ankle|subtalar).*3 on shank, 0 on foot"),
    (KEEP, MIRRORED, "base0, base1, base2 are 0.117 m to the right"), (KEEP, {}, "empty"),
    (KEEP, {"x": "foot"}, "'x'"), (KEEP, {"foot0": "hand"}, "hand"),
    (KEEP, {"foot0": ("foot", 1, 2)}, "'foot0'"),
    (KEEP, PLACES | {"foot0": ("foot", (100, 30, 20))}, r"\[100.0, 30.0, 20.0\].*metres"),
], ids=range(13))  # fmt: skip
def test_markers_that_do_not_fit_the_leg_are_refused(change, markers, message):
    with pytest.raises(kd.InvalidInput, match=message):
        kd.fit_motion(changed(change, rate=50), LEG, markers)


def test_joint_angles_of_a_file():
    leg, times = kd.Leg.human(), np.arange(0, 0.2, 1 / 240)
    angles = {"hip_r": 0.3 + times, "knee_r": -1.0 + 4 * times**2, "ankle_r": 0.0 * times}
    names = {"hip": "hip_r", "knee": "-knee_r", "ankle": "ankle_r"}
    whole = kd.BodyTrack(times, angles=angles)
    at = kd.fit_motion(whole, leg, angles=names, contact=0.2).at_contact()
    assert at.posture.q == pytest.approx([0.5, 0.84, 0.0], abs=optimized(1e-7))
    assert at.v == pytest.approx([1.0, -1.6, 0.0], abs=optimized(1e-5))
    assert np.degrees(at.q_deviations).max() < 0.5  # of one angle
    moving = kd.fit_motion(whole, leg.with_base_velocity((4, 0, 0)), angles=names, contact=0.2)
    assert moving.at_contact().foot_velocity - at.foot_velocity == pytest.approx([4, 0, 0])
    for beyond, count in ((9.0, 0), (11.0, 1)):  # 10 deg outside its range may be reached
        angles["knee_r"] = np.full(48, np.radians(-140.0 - beyond))
        lines = kd.fit_motion(kd.BodyTrack(times, angles=angles), leg, angles=names).warnings
        assert len(lines) == count
    assert "knee is outside its range of 0 to 140 deg in 48 frames" in lines[0]
    angles["hip_r"][[3, 7]] = np.nan
    part = kd.fit_motion(kd.BodyTrack(times, angles=angles), leg, angles=names)
    assert part.undetermined == (3, 7)
    assert part.frames == (*range(3), *range(4, 7), *range(8, 48))
    assert part.times.tolist() == np.delete(times, [3, 7]).tolist()
    variances = np.linalg.inv(part.information)
    agrees(variances, np.tile(np.radians(0.5) ** 2 * np.eye(3), (46, 1, 1)), closed_form())
    angles["ankle_r"] = np.where(np.arange(48) < 9, 0.0, np.nan)
    few = kd.BodyTrack(times, angles=angles)
    with pytest.raises(kd.InvalidInput, match="7 frames with all angles: at least 8"):
        kd.fit_motion(few, leg, angles=names)
    degrees = {name: np.full(48, 13.0) for name in angles}  # 4 pi is 12.6
    with pytest.raises(kd.InvalidInput, match="up to 13, as in degrees"):
        kd.fit_motion(kd.BodyTrack(times, angles=degrees), leg, angles=names)
    for named, message in (({"hip": "hip_r"}, "hip, knee"), (names | {"hip": "x"}, "'x' is not")):
        with pytest.raises(kd.InvalidInput, match=message):
            kd.fit_motion(whole, leg, angles=named)


PERSON = {"height": 1.7, "mass": 60, "sex": "female", "model": "3d"}
FLOATING = kd.Leg.human(**PERSON, base="floating")


def pose(leg=FLOATING, **coordinates):
    values = dict.fromkeys(PELVIS, 0.0) | coordinates
    (q,) = base_configurations(leg, {name: np.array([x]) for name, x in values.items()})
    return pin.XYZQUATToSE3(q)


@pytest.mark.parametrize(("side", "out"), [("right", -1.0), ("left", 1.0)])
def test_the_place_of_the_hip(side, out):
    """Of Delp et al. (1990), for a thigh and shank of 396 and 430 mm."""
    leg = kd.Leg.human(**PERSON, side=side, base="floating")
    knee, ankle = (leg.model.jointPlacements[leg.model.getJointId(n)] for n in ("knee", "ankle"))
    size = (np.linalg.norm(knee.translation) + np.linalg.norm(ankle.translation)) / 0.826
    hip = size * np.array([-0.0707, out * 0.0835, -0.0661])  # x forward, y left, z up
    upright = pose(leg, pelvis_tx=2.0, pelvis_ty=1.0, pelvis_tz=0.3)
    assert upright.translation == pytest.approx(np.array([2.0, -0.3, 1.0]) + hip)
    assert upright.rotation == pytest.approx(np.eye(3))
    backwards = pose(leg, pelvis_tilt=0.2)
    assert backwards.translation == pytest.approx(backwards.rotation @ hip)


def test_directions_and_order_of_the_turns():
    """The front rises, the right side goes down, the front turns to the left; about own axes."""
    turns = {"pelvis_tilt": 0.3, "pelvis_list": 0.2, "pelvis_rotation": 0.5}
    tilt, list_, rotation = (pose(**{name: angle}).rotation for name, angle in turns.items())
    assert tilt[:, 0] == pytest.approx([np.cos(0.3), 0.0, np.sin(0.3)])
    assert list_[:, 1] == pytest.approx([0.0, np.cos(0.2), np.sin(0.2)])
    assert rotation[:, 0] == pytest.approx([np.cos(0.5), np.sin(0.5), 0.0])
    assert pose(**turns).rotation == pytest.approx(tilt @ list_ @ rotation)


def test_the_velocities_at_a_contact_are_the_rates_of_the_coordinates():
    times = np.arange(0.0, 0.2, 1 / 240)
    rates = {"pelvis_tx": 3.5, "pelvis_ty": -0.1, "pelvis_tz": 0.2, "pelvis_tilt": 0.4}
    angles = {name: rates.get(name, 0.0) * times for name in PELVIS}
    speeds = dict(zip(FLOATING.single_joints, (6.0, 0.5, -1.0, -12.0, 2.0, 0.3), strict=True))
    angles |= {f"{name}_r": 0.2 + rate * (times - 0.2) for name, rate in speeds.items()}
    names = {name: f"{name}_r" for name in speeds} | {"ankle": "-ankle_r"}
    track = kd.BodyTrack(times, angles=angles)
    at = kd.fit_motion(track, FLOATING, angles=names, contact=0.2).at_contact()
    assert at.v[6:] == pytest.approx(list((speeds | {"ankle": -2.0}).values()), abs=1e-3)
    assert at.v[3:6] == pytest.approx([0.0, -0.4, 0.0], abs=1e-3)
    before, after = (pose(**{n: r * t for n, r in rates.items()}) for t in (0.199, 0.201))
    turn = pin.XYZQUATToSE3(at.posture.q[:7]).rotation
    velocity = (after.translation - before.translation) / 0.002
    assert turn @ at.v[:3] == pytest.approx(velocity, abs=1e-3)
    assert "pelvis_tx" in kd.fit_motion(track, kd.Leg.human(**PERSON), angles=names).warnings[0]
