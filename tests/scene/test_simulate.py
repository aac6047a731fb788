"""Simulations stay within their tolerance and their error, and name what they neglect."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from random_scenes import random_scene, wide_scene
from tolerances import agrees, closed_form, integrated

import kickdyn as kd
from kickdyn.core.files import shipped
from kickdyn.scene.launch_and_end import collision_error, end_error, path_error
from kickdyn.scene.simulate import CONTACT_SHARE, simulate_as_instant

SCENES = sorted(Path(shipped("scenes")).glob("*.toml"))
LEG = kd.Leg.human()
POSTURE = LEG.posture(np.radians([5, 10, -5]))
TURF = kd.Ground(-0.9, "turf")


def kick(speed=10.0, **parts):
    v = POSTURE.joint_velocity([0.9 * speed, 0, 0.4 * speed])
    contact = parts.pop("contact", kd.Contact((2, 0, 1), 0.8, 0.4))
    parts = {"air": kd.Air(drag="brazuca"), "ground": kd.Ground(-0.9), **parts}
    return kd.Scene(POSTURE, v, parts.pop("ball", kd.Ball()), contact, **parts)


def gap(one, other):
    return float(np.linalg.norm(one.end.position - other.end.position))


@pytest.mark.parametrize(("make", "seed", "count"), [
    (random_scene, 4, 6), (wide_scene, 21, 4),
    pytest.param(random_scene, 14, 40, marks=pytest.mark.slow),
    pytest.param(wide_scene, 22, 40, marks=pytest.mark.slow)])  # fmt: skip
def test_random_scenes_stay_within_their_tolerance(make, seed, count):
    rng, done = np.random.default_rng(seed), 0
    while done < count:
        scene = make(rng)
        try:
            reference = kd.simulate(scene, None)
        except kd.KickdynError:  # no impact, or pressed into the ground
            with pytest.raises(kd.KickdynError):
                kd.simulate(scene, 0.1)
            continue
        done += 1
        for tolerance in (0.05, 1.0):
            answer = kd.simulate(scene, tolerance)
            assert answer.status == reference.status
            assert answer.within_tolerance == (answer.error <= tolerance)
            if answer.error < math.inf:
                assert answer.error <= tolerance
                error = answer.error + reference.numerical_error
                assert gap(answer, reference) <= error + closed_form(1e4)


WALL = kd.Plane((1.5, 0, 0), (-1, 0, 0))


@pytest.mark.parametrize(("parts", "status", "word"), [
    ({}, "landed", "landed at"), ({"plane": WALL}, "at-plane", "reached the plane at"),
    ({"ground": TURF}, "at-rest", "came to rest at"),
    ({"ground": TURF, "plane": WALL}, "at-plane", "reached the plane at"),
    ({"ground": TURF, "plane": kd.Plane((9, 0, 0), (-1, 0, 0)),
      "law": kd.Compliance(contact_time=0.01)}, "at-rest", "came to rest at"),
    ({"air": None, "ground": kd.Ground(-1e7)}, "aloft", "NO END"),
    ({"air": kd.Air(wind=(20, 0, 0)), "ground": replace(TURF, surface="hard-floor")}, "blown",
     "NO END"),
], ids=["ground", "plane", "rest", "plane later", "contact time", "aloft", "blown"])  # fmt: skip
@pytest.mark.parametrize("tolerance", [0.1, None])
def test_a_path_ends_as_its_scene_says_or_has_no_error(parts, status, word, tolerance):
    answer = kd.simulate(kick(4, **parts), tolerance)
    assert answer.status == status
    assert answer.end_text.startswith(word)
    assert answer.within_tolerance is (word != "NO END")
    if word == "NO END":
        assert answer.error == math.inf
        assert all(math.isnan(size) for size in answer.effect_sizes.values())
    else:
        assert gap(answer, kd.simulate(kick(4, **parts), None)) <= answer.error <= 0.1


@pytest.mark.parametrize("law", ["newton", "stronge"])
def test_an_instantaneous_kick_is_strike_and_fly_at_every_tolerance(law):
    scene = kick(law=law)
    hit = kd.strike(scene.posture, scene.v, scene.ball, scene.contact, law)
    path = kd.fly(hit.ball_after, scene.ball, scene.air, scene.ground)
    for tolerance in (None, 1e-6, 1.0):
        answer = kd.simulate(scene, tolerance)
        assert answer.within_tolerance
        assert answer.end.position.tolist() == path.landing.position.tolist()
        assert answer.numerical_error == answer.error == path.error
        assert (answer.neglected, answer.model_error) == ((), 0.0)
    below = kd.simulate(scene, 1e-12)
    assert not below.within_tolerance
    bounced = kd.simulate(kick(4, ground=TURF), None)
    assert isinstance(bounced.path, kd.Course)
    assert not bounced.end.velocity.any()


@pytest.mark.parametrize("tolerance", [0.1, None])
def test_scenes_that_cannot_be_simulated_are_refused_at_every_tolerance(tolerance):
    down, ball = kd.Contact((0.94, 0, -0.34), 0.8, 0.4), kd.Ball()
    level = float((POSTURE.contact_point + ball.radius * down.normal)[2]) - ball.radius
    pressed = kd.Scene(POSTURE, POSTURE.joint_velocity([5, 0, -2]), ball, down,
                       law=kd.Compliance(contact_time=0.01), ground=kd.Ground(level))  # fmt: skip
    for scene in (pressed, kick(ground=kd.Ground(0.0))):
        with pytest.raises(kd.InvalidInput, match="inside"):
            kd.simulate(scene, tolerance)
    with pytest.raises(kd.NoImpact):
        kd.simulate(kick(contact=kd.Contact((-1, 0, 0), 0.8)), tolerance)
    with pytest.raises(kd.InvalidInput, match=r"kickdyn\.Scene"):
        kd.simulate("scene.toml", tolerance)


def test_the_contact_time_is_neglected_up_to_its_share_of_the_tolerance():
    contact = kd.Contact((1, 0, 0.1), 0.8)
    scene = kick(2, contact=contact, law=kd.Compliance(contact_time=1e-4), ground=None)
    coarse = kd.simulate(scene, 5.0)
    assert coarse.neglected == ("contact time",)
    assert "contact time" not in coarse.modelled
    for factor, size in ((1.01, coarse.model_error), (0.2, 0.0)):
        answer = kd.simulate(scene, coarse.model_error / CONTACT_SHARE * factor)
        assert answer.model_error == size
        assert answer.neglected == (("contact time",) if size else ())
    assert coarse.effect_sizes["contact time"] == coarse.model_error


@pytest.mark.parametrize("tolerance", [0.01, 0.1])
def test_errors_of_contact_and_path_add_up(tolerance):
    scene = kick(law=kd.Compliance(contact_time=0.01))
    answer = kd.simulate(scene, tolerance)
    assert "contact time" in answer.modelled
    launch_error = collision_error(scene.ball, answer.launch, answer.impact.tol)
    right = path_error(scene, answer.path) + end_error(scene, answer.path, launch_error)
    assert answer.numerical_error == pytest.approx(right, rel=closed_form())
    assert answer.error == answer.model_error + answer.numerical_error <= tolerance
    exact = kd.simulate(scene, None)
    assert gap(answer, exact) <= answer.error + exact.numerical_error


def test_an_instantaneous_view_has_the_measured_error_of_the_contact_time():
    scene = kd.load_scene("volley")
    instant, whole = simulate_as_instant(scene), kd.simulate(scene, None)
    apart = gap(instant, whole)
    assert apart > 0.1
    right = apart + whole.numerical_error
    assert instant.model_error == pytest.approx(right, rel=closed_form())
    assert instant.error == instant.model_error + instant.numerical_error > instant.model_error
    assert instant.neglected == ("contact time",)
    assert whole.end_text in instant.note
    assert gap(instant, kd.simulate(scene.as_instant(), None)) == 0.0
    assert simulate_as_instant(kd.load_scene("paper_kick")).neglected == ()


@pytest.mark.parametrize("ball", [kd.Ball(), kd.Ball(0.1, 0.2)], ids=["football", "beach ball"])
@pytest.mark.parametrize("name", ["restitution", "friction"])
def test_the_deviation_of_the_end_is_that_of_a_changed_contact(ball, name):
    """Without lift the spin has no effect: else its part is added, whatever its direction."""
    parts = {"air": kd.Air(drag="sphere", lift=None), "ball": ball, "ground": kd.Ground(-2)}
    contact = kd.Contact((2, 0, 1), 0.8, 0.05)
    answer = kd.simulate(kick(contact=contact, uncertainty={name: 0.02}, **parts), None)
    ends = [
        kd.simulate(kick(contact=replace(contact, **{name: getattr(contact, name) + d}), **parts))
        for d in (-1e-3, 1e-3)
    ]
    assert answer.end_deviation == pytest.approx(0.02 / 2e-3 * gap(*ends), rel=1e-3)
    assert math.isnan(kd.simulate(kick(), None).end_deviation)


def test_the_smallest_effects_are_negligible_up_to_half_the_tolerance():
    sizes = kd.simulate(kick(1.5), None).effect_sizes
    ordered = sorted(sizes, key=lambda name: sizes[name])
    for number in range(1, len(ordered) + 1):
        total = math.fsum(sizes[name] for name in ordered[:number])
        answer = kd.simulate(kick(1.5), 2.0 * total * (1.0 + 1e-6))
        assert answer.negligible == tuple(ordered[:number])
    assert kd.simulate(kick(1.5), None).negligible == ()


@pytest.mark.parametrize(("name", "part", "changes"), [
    ("drag", "air", {"drag": None}), ("lift", "air", {"lift": None}),
    ("wind", "air", {"wind": (0, 0, 0)}), ("friction", "contact", {"friction": 0.0})])  # fmt: skip
def test_the_size_of_an_effect_is_what_changes_without_it(name, part, changes):
    scene = kd.load_scene("free_kick")
    full = kd.simulate(scene, None)
    less = scene.replace(**{part: replace(getattr(scene, part), **changes)})
    hit = kd.strike(scene.posture, scene.v, scene.ball, less.contact)
    end = kd.fly(hit.ball_after, scene.ball, less.air, scene.ground, plane=scene.plane).landing
    size = next(row for row in full.effects if row.effect == name)
    right = math.dist(end.position, full.end.position)
    assert size.end == pytest.approx(right, rel=integrated(1e-8))
    assert size.impulse == pytest.approx(math.dist(hit.impulse, full.impact.impulse))
    assert set(full.modelled) >= {"ball rotation", "drag crisis", name}


def test_warnings_of_leg_impact_and_flight_are_passed_on_once():
    posture = LEG.posture(np.radians([5, 150, -5]))
    parts = posture, posture.joint_velocity([3, 0, 1]), kd.Ball(), kd.Contact((1, 0, 0.2), 0.8, 0.4)
    answer = kd.simulate(kd.Scene(*parts, air=kd.Air()))
    assert sorted(answer.warnings) == sorted({*answer.impact.warnings, *answer.path.warnings})
    assert any("knee at 150 deg" in line for line in answer.warnings)
    assert all(repr(answer).count(line) == 1 for line in answer.warnings[:3])


@pytest.mark.parametrize("below", [0.0, 0.4])
def test_heights_are_from_the_ground_to_the_edges_of_the_ball(below):
    scene, wall = kick(8, air=None), kd.Wall(0.6, 0.3)
    level = float(scene.ball_position[2]) - scene.ball.radius - below
    normal = np.array([-0.8, -0.6, 0.0])
    goal = kd.Plane((1.5, 0.3, 0), normal, "centre")
    answer = kd.simulate(scene.replace(ground=kd.Ground(level), plane=goal, wall=wall), None)
    assert answer.start_height == pytest.approx(below, abs=closed_form(100))
    t = wall.distance / (answer.launch.velocity @ answer.scene.ahead)
    rise = float(answer.launch.velocity[2]) * t - 9.81 / 2 * t**2
    assert answer.passage.above == pytest.approx(below + rise - wall.height, abs=closed_form(100))
    assert ("The flight goes on" in answer.pitch_text) is not answer.passage.is_clear
    aside, z = np.cross(normal, answer.end.position - goal.point)[2], answer.end.position[2]
    right = np.array([2.44 - (z - level), 3.66 - abs(aside)]) - scene.ball.radius
    agrees([answer.score.bar, answer.score.post], right, closed_form(1e3))
    assert kd.simulate(scene.replace(ground=None), None).start_height == 0.0


@pytest.mark.parametrize("path", SCENES, ids=lambda path: path.stem)
def test_shipped_scenes_are_within_the_limits_of_their_legs(path):
    assert kd.simulate(kd.load_scene(path)).impact.warnings == ()
