"""Motions from markers: against the motion that made them, with noise, gaps and faults."""

import numpy as np
import pinocchio as pin
import pytest
from kick_motion import ANKLE, HIP, KNEE, LEG, PLACES, clean, state, track, velocity

import kickdyn as kd


def changed(change, rate=240):
    whole = track(rate)
    positions = whole.positions.copy()
    change(positions)
    return kd.BodyTrack(whole.times, whole.markers, positions)


def test_without_noise_the_configurations_are_those_of_the_motion():
    motion = kd.fit_motion(track(240), LEG, PLACES)
    for t, q in zip(motion.times, motion.configurations, strict=True):
        assert np.abs(pin.difference(LEG.model, state(t), q)).max() < 1e-9
    assert list(motion.scales.values()) == pytest.approx([1.0] * 7, abs=1e-9)
    assert motion.v(-0.1) == pytest.approx(velocity(-0.1), abs=1e-3)
    at = motion.at_contact(0.0)
    assert np.abs(at.v - velocity(0.0)).max() < 0.03  # of 17 rad/s
    assert at.foot_velocity == pytest.approx(
        LEG.posture(state(0)).point_velocity(velocity(0)), abs=0.02
    )


@pytest.mark.parametrize(("rate", "degrees", "joint_share"), [(500, 0.5, 0.03), (240, 0.9, 0.05)])
def test_a_millimetre_of_noise(rate, degrees, joint_share):
    missed, foot, sigmas, angles = [], [], [], []
    truth = LEG.posture(state(0)).point_velocity(velocity(0))
    for seed in range(2):
        motion = kd.fit_motion(track(rate, 1e-3, seed), LEG, PLACES)
        assert motion.noise == pytest.approx(1e-3, rel=0.1)
        assert motion.warnings == ()
        at = motion.at_contact(0.0)
        angle = pin.difference(LEG.model, state(0), at.posture.q)
        angles.append(np.degrees(angle[6:]))
        error = at.v - velocity(0)
        missed.append(error[[HIP, KNEE]] / abs(velocity(0)[KNEE]))
        foot.append(np.linalg.norm(at.foot_velocity - truth) / np.linalg.norm(truth))
        sigmas += [angle / at.q_deviations, error / at.v_deviations]
    assert (np.sqrt(np.mean(np.square(angles), axis=0)) < degrees).all()
    assert np.sqrt(np.mean(np.square(missed))) < joint_share
    assert np.sqrt(np.mean(np.square(foot))) < 0.02
    assert 0.6 < np.sqrt(np.mean(np.square(sigmas))) < 1.6


def test_segments_take_the_lengths_of_the_person():
    other = kd.Leg.human(height=1.8, mass=58, sex="female", model="3d", base="floating")
    motion = kd.fit_motion(track(240), other, {
        name: (link, np.array(p) * 1.8 / 1.65) for name, (link, p) in PLACES.items()
    })  # fmt: skip
    assert motion.scales["hip_rotation"] == pytest.approx(1.65 / 1.8, rel=1e-3)
    assert motion.scales["knee"] == pytest.approx(1.65 / 1.8, rel=1e-3)
    shank = other.joint_names.index("knee") + 1
    ours, given = (leg.model.inertias[shank].inertia.diagonal() for leg in (motion.leg, other))
    assert ours / given == pytest.approx([motion.scales["knee"] ** 2] * 3)
    assert motion.leg.model.inertias[shank].mass == other.model.inertias[shank].mass


def test_places_that_are_wrong_by_a_centimetre_are_estimated():
    """Velocities stay right; without it, those of the knee and the foot are wrong by 3 to 8 %."""
    rng, whole = np.random.default_rng(5), track(240, 1e-3)
    rough = {n: (link, p + 0.01 * rng.uniform(-1, 1, 3)) for n, (link, p) in PLACES.items()}
    motion = kd.fit_motion(whole, LEG, rough)
    (line,) = motion.warnings
    assert line.startswith("the places of the markers, or the height of the leg, do not fit: ")
    assert motion.noise == pytest.approx(1e-3, rel=0.1)
    at = motion.at_contact(0.0)
    errors = (at.v - velocity(0))[[HIP, KNEE]] / velocity(0)[KNEE]
    assert np.abs(errors).max() < 0.05
    assert motion.scales["knee"] == pytest.approx(1.0, abs=0.03)
    assert at.v_deviations[[HIP, KNEE]].max() < 0.05 * abs(velocity(0)[KNEE])


def test_nothing_is_smoothed_across_the_impact():
    """What happens after the contact does not change what was before it."""

    def after(positions):
        positions[len(clean(240, 0.0)[0]) :] += (0.03, 0.0, 0.0)

    whole = track(240, until=0.1)
    positions = whole.positions.copy()
    after(positions)
    other = kd.BodyTrack(whole.times, whole.markers, positions)
    plain, jump = (
        kd.fit_motion(one, LEG, PLACES, contact=0.0, scale=False) for one in (whole, other)
    )
    assert (jump.q(-0.01) == plain.q(-0.01)).all()
    assert (jump.at_contact().v == plain.at_contact().v).all()
    assert jump.q(0.05)[0] - plain.q(0.05)[0] == pytest.approx(0.03, abs=1e-6)


def test_gaps_are_named_and_what_is_seen_counts():
    def hide(positions):
        positions[5, 0] = np.nan
        positions[7:9, 3:] = np.nan

    motion = kd.fit_motion(changed(hide), LEG, PLACES)
    assert motion.gaps["base0"] == (5,)
    assert motion.gaps["thigh1"] == (7, 8)
    assert motion.undetermined == (7, 8)
    for k, seen, error in ((5, 12, 1e-9), (7, 6, 1e-5), (9, 12, 1e-9)):  # the pelvis in frame 7
        q = pin.difference(LEG.model, state(motion.times[k]), motion.configurations[k])
        assert np.abs(q[:seen]).max() < error
    assert motion.frames == tuple(range(48))


def test_a_foot_that_is_hidden_just_before_the_contact():
    """The other joints are as well known as before, the ankle less."""

    def hide(positions):
        positions[-3:, 9:] = np.nan  # 13 ms

    whole = track(240, 1e-3)
    positions = whole.positions.copy()
    hide(positions)
    other = kd.BodyTrack(whole.times, whole.markers, positions)
    seen, hidden = (kd.fit_motion(one, LEG, PLACES, contact=0.0) for one in (whole, other))
    assert hidden.undetermined == (45, 46, 47)
    (line,) = hidden.warnings
    assert line.startswith("markers 'foot0' (3 frames), 'foot1' (3 frames), 'foot2' (3 frames) are")
    a, b = (motion.at_contact() for motion in (seen, hidden))
    assert b.v_deviations[HIP] < 1.2 * a.v_deviations[HIP]
    assert b.v_deviations[ANKLE] > 1.2 * a.v_deviations[ANKLE]
    assert (np.abs(b.v - velocity(0)) < 4 * b.v_deviations).all()


def test_markers_that_are_not_seen_at_the_contact_have_a_warning():
    def hide(positions):
        positions[30:33, 6] = np.nan  # away from the contact
        positions[40:, 9:11] = np.nan

    motion = kd.fit_motion(changed(hide), LEG, PLACES, contact=0.0, scale=False)
    (line,) = motion.warnings
    assert line.startswith(
        "markers 'foot0' (8 frames), 'foot1' (8 frames) are not seen in frame 47, the last one "
        "before the contact"
    )
    seen = kd.fit_motion(track(240), LEG, PLACES, contact=0.0, scale=False)
    assert seen.warnings == ()
    ankle = slice(-2, None)
    assert (motion.at_contact().v_deviations[ankle] > seen.at_contact().v_deviations[ankle]).all()


def hide_contact(positions):
    positions[-12:, 4:] = np.nan


@pytest.mark.parametrize(
    ("change", "markers", "message"),
    [
        (lambda p: p.__imul__(1000), PLACES,
         "markers are up to .* m apart, as in millimetres or centimetres: positions"),
        (lambda p: p.__setitem__((slice(None), [3, 6]), p[:, [6, 3]]), PLACES,
         "marker '.*' is .* m from its place on the leg in frame .*: markers are swapped"),
        (lambda p: p.__setitem__((5, [0, 1]), p[5, [1, 0]]), PLACES,  # pelvis left and right
         "marker 'base[01]' is .* m from its place on the leg in frame 5: .*NaN leaves it out"),
        (lambda p: p.__setitem__((..., 1), -p[..., 1]), PLACES,  # the other leg
         "markers 'base0', 'base1' are swapped"),
        (lambda p: p.__setitem__((slice(None), slice(3, 12), 1), 0.2 - p[:, 3:, 1]), PLACES,
         "marker '.*' is .* m from its place on the leg in frame .*: .* on the other leg"),
        (lambda p: p.__setitem__((slice(None), slice(9, None)), np.nan), PLACES,
         "marker 'foot0' is not seen in any frame"),
        (lambda _: None, {k: v for k, v in PLACES.items() if "foot" not in k},
         "too few markers: .* (ankle|subtalar) in any frame; they are 3 on base, .*, 3 on shank, "
         "0 on foot:"),
        (lambda _: None, {k: v for k, v in PLACES.items() if "base" not in k},
         "too few markers: .* joint .* in any frame; they are 0 on base, 3 on thigh, 3 on shank, "
         "3 on foot"),
        (lambda p: p.__setitem__((slice(None), [0, 1]), p[:, [1, 0]]), PLACES,
         "markers 'base0', 'base1' are swapped in frame .: they are .* m if exchanged"),
        (lambda _: None, {k: (link, (x, -y, z)) for k, (link, (x, y, z)) in PLACES.items()},
         "markers base0, base1, base2 are 0.117 m to the right of the hip, but the pelvis of a "
         "right leg is on its left"),
        (lambda _: None, {"x": "foot"}, "marker 'x' is unknown: "),
        (lambda _: None, {"foot0": "hand"}, "hand"),
        (lambda _: None, {"foot0": ("foot", 1, 2)}, "place of marker 'foot0' is"),
        (lambda _: None, PLACES | {"foot0": ("foot", (100, 30, 20))},
         r"point of marker 'foot0' is \[100.0, 30.0, 20.0\], up to 100 m from the origin of foot: "
         "it must be in metres"),
        (lambda p: p.__setitem__((slice(None), 9, 2), p[:, 9, 2] + 0.12), PLACES,  # one of 12
         "marker '.*' is 0.0.* m from its place on the leg in frame [0-9]+: .* another segment$"),
        (lambda _: None, {}, "markers is empty"),
    ],
)  # fmt: skip
def test_refused(change, markers, message):
    with pytest.raises(kd.InvalidInput, match=message):
        kd.fit_motion(changed(change, rate=50), LEG, markers)


def test_a_doubtful_order_has_a_warning_that_names_the_markers():
    """A foot of three markers can turn over so that it nearly fits its exchanged markers."""
    heel, toe, side = (-0.05, 0.0, 0.0), (0.10, 0.01, 0.03), (0.08, -0.05, 0.0)
    foot = {"foot0": heel, "foot1": toe, "foot2": side}
    whole = track(50)
    positions = whole.positions.copy()
    data = LEG.model.createData()
    for k, t in enumerate(whole.times):
        pin.framesForwardKinematics(LEG.model, data, state(t))
        pose = data.oMf[LEG.model.getFrameId("foot")]
        positions[k, 9:] = [pose.act(np.array(place)) for place in (heel, side, toe)]
    exchanged = kd.BodyTrack(whole.times, whole.markers, positions)
    places = PLACES | {name: ("foot", place) for name, place in foot.items()}
    line, *_ = kd.fit_motion(exchanged, LEG, places, scale=False).warnings
    assert line.startswith("markers 'foot1', 'foot2' may be swapped in frame ")
    assert line.endswith("if exchanged")


def test_times_without_frames_are_refused():
    motion = kd.fit_motion(changed(hide_contact), LEG, PLACES)
    with pytest.raises(kd.InvalidInput, match=r"contact at 0 s: 24 frames .* 'thigh1' in frame 47"):
        motion.at_contact(0.0)
    with pytest.raises(kd.InvalidInput, match="time is None"):
        motion.at_contact()
    with pytest.raises(kd.InvalidInput, match="the motion is known from"):
        motion.q(1.0)
    with pytest.raises(kd.InvalidInput, match="contact is 5 s: the track is from"):
        kd.fit_motion(track(240), LEG, PLACES, contact=5.0)
    last = track(240).times[-1]
    with pytest.raises(kd.InvalidInput, match=f"the track is from .* to {last:g} s"):
        kd.fit_motion(track(240), LEG, PLACES, contact=last + 0.03)


def test_another_vertical_axis_has_a_warning():
    """A floating base can take any direction, so that the residuals do not show it."""
    whole = track(50)
    lying = kd.BodyTrack(whole.times, whole.markers, whole.positions[..., [0, 2, 1]] * (1, 1, -1))
    (line,) = kd.fit_motion(lying, LEG, PLACES, scale=False).warnings
    assert "if the file has y up, read it with up='y'" in line
    assert "\n" not in line
    assert kd.fit_motion(whole, LEG, PLACES, scale=False).warnings == ()
    straight = np.tile([[0, -0.4, 0], [0, -0.8, 0], [0.1, -0.8, 0]], (10, 1, 1))
    fixed = kd.BodyTrack(np.arange(10) / 100, ["knee", "ankle", "toe"], straight)
    with pytest.raises(kd.InvalidInput, match=r"y seems to point up"):
        kd.fit_motion(fixed, kd.Leg.human(), {"knee": "shank", "ankle": "foot", "toe": "toe"})


def test_plot():
    motion = kd.fit_motion(track(120, until=0.1), LEG, PLACES, contact=0.0, scale=False)
    figure = motion.plot(["knee", "ankle"])
    assert figure.get_size_inches()[0] == 3.5
    angles, speeds = figure.axes
    before, *_ = angles.lines
    first, last = 1e-3 * before.get_xdata()[[0, -1]]
    assert first == -0.15
    assert last == pytest.approx(motion.times[motion.times < 0][-1])
    knee = np.degrees(motion.q(last)[KNEE + 1])  # behind a quaternion
    assert before.get_ydata()[-1] == pytest.approx(knee)
    assert speeds.get_ylim()[0] < -16
    with pytest.raises(kd.InvalidInput, match=r"joints is .*'hand'.*: it must name some of hip"):
        motion.plot(["hand"])


def test_joint_angles_of_a_file():
    leg, times = kd.Leg.human(), np.arange(0, 0.2, 1 / 240)
    angles = {"hip_r": 0.3 + times, "knee_r": -1.0 + 4 * times**2, "ankle_r": 0.0 * times}
    whole = kd.BodyTrack(times, angles=angles)
    names = {"hip": "hip_r", "knee": "-knee_r", "ankle": "ankle_r"}
    at = kd.fit_motion(whole, leg, angles=names, contact=0.2).at_contact()
    assert at.posture.q == pytest.approx([0.5, 0.84, 0.0], abs=1e-6)
    assert at.v == pytest.approx([1.0, -1.6, 0.0], abs=1e-4)
    with pytest.raises(kd.InvalidInput, match="it must name one coordinate for each of hip, knee"):
        kd.fit_motion(whole, leg, angles={"hip": "hip_r"})
    with pytest.raises(kd.InvalidInput, match="angles need a leg on a fixed base"):
        kd.fit_motion(whole, LEG, angles=names)
    moving = kd.fit_motion(whole, leg.with_base_velocity((4, 0, 0)), angles=names, contact=0.2)
    assert moving.at_contact().foot_velocity == pytest.approx(
        at.foot_velocity + np.array([4, 0, 0])
    )
    (line,) = kd.fit_motion(whole, leg, angles=names | {"knee": "knee_r"}).warnings
    assert line.startswith("joint knee is outside its range of 0 to 140 deg in 48 frames of 48")
    degrees = kd.BodyTrack(times, angles={name: np.degrees(x) for name, x in angles.items()})
    with pytest.raises(kd.InvalidInput, match=r"angle 'hip_r' is up to .*, as in degrees"):
        kd.fit_motion(degrees, leg, angles=names)
    with pytest.raises(kd.InvalidInput, match="angle 'x' is not in the track"):
        kd.fit_motion(whole, leg, angles=names | {"hip": "x"})


def test_an_impact_from_the_motion_and_the_ball():
    motion = kd.fit_motion(track(500, 5e-4), LEG, PLACES, contact=0.0)
    ball, truth = kd.Ball(), LEG.posture(state(0))
    normal = truth.point_velocity(velocity(0))
    hit = kd.strike(truth, velocity(0), ball, kd.Contact(normal, 0.7))
    times = np.arange(-0.1, 0.12, 1 / 500)
    start = truth.contact_point + ball.radius * hit.contact.normal
    path = start + np.outer(np.maximum(times, 0.0), hit.ball_after.velocity)
    path += 5e-4 * np.random.default_rng(2).normal(size=path.shape)
    found = kd.infer_impact(motion, kd.Track(times, path))
    assert found.impulse == pytest.approx(hit.impulse, rel=0.02, abs=0.05)
    assert abs(found.restitution - 0.7) < 3 * found.deviations["restitution"] + 0.01
    missed = abs(found.effective_mass - hit.effective_mass)
    assert missed < 2 * found.deviations["effective_mass"]
    sizes = np.linalg.norm(found.joint_impulses[:, :3], axis=1)
    expected = np.linalg.norm(hit.joint_impulses[:, :3], axis=1)
    for name, a, b in zip(LEG.joint_names, sizes, expected, strict=True):
        deviation = found.joint_deviations.get(name, 0.0)  # none in a floating base
        assert abs(a - b) < 4 * deviation + 1e-3 * expected.max()
    assert any("does not show the spin" in line for line in found.warnings)
    pressed = path.copy()
    pressed[(times > 1e-9) & (times < 0.0149)] -= 0.02 * hit.contact.normal  # during the contact
    again = kd.infer_impact(motion, kd.Track(times, pressed), contact=0.0)
    unpressed = kd.infer_impact(motion, kd.Track(times, path), contact=0.0)
    assert again.impulse == pytest.approx(unpressed.impulse, rel=1e-12)
    with pytest.raises(kd.InvalidInput, match=r"track of the ball has 0 samples after the contact"):
        kd.infer_impact(motion, kd.Track(times[:50], path[:50]))
    with pytest.raises(kd.InvalidInput, match="ball, ball_before and ball_after are needed"):
        kd.infer_impact(truth, velocity(0))
