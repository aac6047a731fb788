"""Answers stay within their tolerance and their own error, and say what they neglect."""

import math
import pickle
import re
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from random_scenes import random_scene, wide_scene

import kickdyn as kd
from kickdyn.core.representation import distance_in_words
from kickdyn.scene.launch_and_end import (
    collide_scene,
    collision_error,
    end_error,
    path_error,
)
from kickdyn.scene.simulate import (
    CONTACT_SHARE,
    _length_text,
    measure_effects,
    simulate_as_instant,
)

SCENES = Path(__file__).resolve().parents[2] / "scenes"
LEG = kd.Leg.human()
POSTURE = LEG.posture(np.radians([5, 10, -5]))


def kick(speed=10.0, **parts):
    v = POSTURE.joint_velocity([0.9 * speed, 0, 0.4 * speed])
    contact = parts.pop("contact", kd.Contact((2, 0, 1), 0.8, 0.4))
    parts = {"air": kd.Air(drag="brazuca"), "ground": kd.Ground(-0.9), **parts}
    return kd.Scene(POSTURE, v, kd.Ball(), contact, **parts)


def gap(one, other):
    return float(np.linalg.norm(one.end.position - other.end.position))


def test_a_path_that_bounces_is_not_followed_in_vain(monkeypatch):
    """It takes longer than a contact: an answer follows it once, whichever impact it takes."""
    module, followed, seen = sys.modules["kickdyn.scene.simulate"], [], set()
    fly_scene = module.fly_scene

    def counted(*arguments):
        followed.append(arguments)
        return fly_scene(*arguments)

    monkeypatch.setattr(module, "fly_scene", counted)
    rng = np.random.default_rng(8)
    for tolerance in (0.01, 1.0, 10.0, 30.0, 100.0):
        scene = random_scene(rng, ground=kd.Ground(-1.5, "turf"), plane=None, contact_time=0.01)
        followed.clear()
        seen.add(type(kd.simulate(scene, tolerance).impact).__name__)
        assert len(followed) == 1
    assert seen == {"Impact", "Collision"}


def test_random_scenes_stay_within_their_tolerance():
    rng, done, neglected = np.random.default_rng(4), 0, 0
    while done < 8:
        scene = random_scene(rng)
        try:
            reference = kd.simulate(scene, None)
        except (kd.NoImpact, kd.InvalidInput):  # pressed into the ground
            continue
        done += 1
        for tolerance in (0.05, 1.0):
            answer = kd.simulate(scene, tolerance)
            assert answer.error <= tolerance
            assert gap(answer, reference) <= answer.error + 1e-7
            neglected += len(answer.neglected)
    assert neglected


def test_wide_scenes_stay_within_their_tolerance():
    rng, done = np.random.default_rng(21), 0
    while done < 5:
        scene = wide_scene(rng)
        try:
            reference = kd.simulate(scene, None)
        except kd.KickdynError:
            with pytest.raises(kd.KickdynError):
                kd.simulate(scene, 0.1)
            continue
        done += 1
        for tolerance in (0.01, 1.0):
            answer = kd.simulate(scene, tolerance)
            assert answer.status == reference.status
            if answer.error < math.inf:
                assert answer.within_tolerance
                assert gap(answer, reference) <= answer.error + reference.numerical_error + 1e-12


LIGHT = {
    "beach ball": kd.Ball(0.1, 0.2),
    "balloon": kd.Ball(0.02, 0.11),
    "50 g": kd.Ball(0.05, 0.1),
}


@pytest.mark.parametrize("drag", ["sphere", "brazuca"])
@pytest.mark.parametrize("name", LIGHT)
def test_light_balls(name, drag):
    ball, air = LIGHT[name], kd.Air(drag=drag, lift=None, torque=None)
    for up in (0.1, 0.7, 1.2):
        for speed in (5, 10, 20):
            v = POSTURE.joint_velocity([speed * math.cos(up), 0, speed * math.sin(up)])
            contact = kd.Contact((math.cos(up), 0, math.sin(up)), 0.8, 0.4)
            below = float(POSTURE.contact_point[2] + ball.radius * (contact.normal[2] - 1))
            scene = kd.Scene(POSTURE, v, ball, contact, air=air, ground=kd.Ground(below))
            answer, reference = kd.simulate(scene, 0.2), kd.simulate(scene, None)
            assert gap(answer, reference) <= answer.error <= 0.2


WORDS = {
    "landed": "landed at (",
    "at-plane": "reached the plane at (",
    "at-rest": "came to rest at (",
}


def test_what_ended_it_is_said():
    wall = kd.Plane((1.5, 0, 0), (-1, 0, 0))
    for parts, status in (
        ({}, "landed"),
        ({"plane": wall}, "at-plane"),
        ({"ground": kd.Ground(-0.9, "turf")}, "at-rest"),
        ({"ground": kd.Ground(-0.9, "turf"), "plane": wall}, "at-plane"),
    ):
        for tolerance in (0.1, None):
            answer = kd.simulate(kick(4, **parts), tolerance)
            assert answer.status == status
            assert answer.within_tolerance
            assert str(answer).startswith(WORDS[status])


@pytest.mark.parametrize(
    ("parts", "status"),
    [
        ({"air": None, "ground": kd.Ground(-1e7)}, "aloft"),
        ({"air": kd.Air(wind=(20, 0, 0)), "ground": kd.Ground(-0.9, "hard-floor")}, "blown"),
    ],
)
@pytest.mark.parametrize("tolerance", [0.1, None])
def test_a_way_without_an_end_has_no_error(parts, status, tolerance):
    answer = kd.simulate(kick(4, **parts), tolerance)
    assert (answer.status, answer.error, answer.within_tolerance) == (status, math.inf, False)
    assert str(answer).startswith(f"NO END ({status}), computed as far as (")
    assert all(math.isnan(size) for size in answer.effect_sizes.values())


def test_a_tolerance_that_numerics_cannot_meet_is_said():
    answer = kd.simulate(kick(), 1e-12)
    assert not answer.within_tolerance
    assert "NOT WITHIN the tolerance of 1e-12 m" in str(answer)
    with pytest.raises(kd.InvalidInput, match=r"^tolerance is 1e-15 m: that is below rounding; .*"):
        kd.simulate(kick(), 1e-15)
    assert "NOT WITHIN" not in str(kd.simulate(kick(), 1e-6))


@pytest.mark.parametrize(("attack", "time"), [(70, 1e-4), (70, 1e-5), (60, 1e-5)])
def test_a_brief_contact_that_sticks_is_not_the_instant_by_newton(attack, time):
    up = math.radians(attack)
    contact = kd.Contact((math.cos(up), 0, math.sin(up)), 0.8, 1.0)
    v = POSTURE.joint_velocity([10, 0, 5])
    scene = kd.Scene(POSTURE, v, kd.Ball(), contact, law=kd.Compliance(contact_time=time))
    reference = kd.simulate(scene, None)
    instant = kd.simulate(kd.Scene(POSTURE, v, kd.Ball(), contact), None)
    assert gap(instant, reference) > 0.2
    for tolerance in (0.05, 0.5, 5.0):
        answer = kd.simulate(scene, tolerance)
        assert gap(answer, reference) <= answer.error <= tolerance
    if attack == 70:  # at 5 m; the estimate is no empty word
        assert "contact time" in answer.neglected


def test_a_contact_that_takes_time_before_bounces_and_a_plane_has_an_error():
    wall = kd.Plane((9, 0, 0), (-1, 0, 0))
    scene = kick(
        5, ground=kd.Ground(-0.9, "turf"), plane=wall, law=kd.Compliance(contact_time=0.01)
    )
    reference = kd.simulate(scene, None)
    assert reference.error < 1e-3
    answer = kd.simulate(scene, 0.1)
    assert gap(answer, reference) <= answer.error <= 0.1


@pytest.mark.parametrize("tolerance", [0.1, 1.0, None])
def test_a_tolerance_refuses_what_everything_refuses(tolerance):
    down = kd.Contact((0.94, 0, -0.34), 0.8, 0.4)
    v = POSTURE.joint_velocity([5, 0, -2])
    level = float((POSTURE.contact_point + kd.Ball().radius * down.normal)[2]) - kd.Ball().radius
    parts = (POSTURE, v, kd.Ball(), down)
    pressed = kd.Scene(*parts, law=kd.Compliance(contact_time=0.01), ground=kd.Ground(level))
    inside = kick(ground=kd.Ground(0.0))
    for scene, why in ((pressed, "inside"), (inside, "inside")):
        with pytest.raises(kd.InvalidInput, match=why):
            kd.simulate(scene, tolerance)


def test_spread_of_a_light_ball():
    parts = {"air": kd.Air(drag="sphere", lift=None, torque=None)}

    def light(restitution, **more):
        contact = kd.Contact((0.34, 0, 0.94), restitution, 0.4)
        v = POSTURE.joint_velocity([5, 0, 14])
        return kd.Scene(POSTURE, v, LIGHT["beach ball"], contact, **parts, **more)

    answer = kd.simulate(light(0.8, uncertainty={"restitution": 0.03}), 1e-3)
    ends = [kd.simulate(light(e), None) for e in (0.795, 0.805)]
    assert answer.end_deviation == pytest.approx(3 * gap(*ends), rel=0.1)


def test_coefficients_beyond_their_data_are_warned_of():
    slow = kd.simulate(kick(5.0, ground=None), None)
    assert slow.warnings == slow.path.warnings
    assert [line.split(":")[0] for line in slow.warnings] == ["lift saturating"]
    assert f"\nwarning: {slow.warnings[0]}" in str(slow)
    still = kd.simulate(kick(5.0, ground=None, contact=kd.Contact((2, 0, 1), 0.8)), None)
    assert still.warnings == ()
    assert "warning" not in str(still)


def test_a_joint_outside_its_range_is_warned_of():
    posture = LEG.posture(np.radians([5, 150, -5]))
    v = posture.joint_velocity([3, 0, 1])
    scene = kd.Scene(posture, v, kd.Ball(), kd.Contact((1, 0, 0.2), 0.8))
    answer = kd.simulate(scene, 0.1)
    assert "knee at 150 deg is outside its range 0 to 140 deg" in answer.warnings
    assert str(answer).count("\nwarning: knee at 150 deg is outside its range") == 1


@pytest.mark.parametrize(
    ("seed", "number", "why"),
    [
        (101, 43, "a contact that takes time throws the ball much higher than the instant's"),
        (6, 274, "the ball rolls in the wind"),
        (101, 300, "many bounces"),
        (6, 45, "the ball flies only because its contact takes time"),
    ],
)
def test_random_scenes_that_once_claimed_too_little(seed, number, why):
    rng = np.random.default_rng(seed)
    scene = [random_scene(rng) for _ in range(number)][-1]
    reference = kd.simulate(scene, None)
    for tolerance in (0.01, 0.05, 1.0):
        answer = kd.simulate(scene, tolerance)
        assert answer.error <= tolerance
        assert gap(answer, reference) <= answer.error + reference.numerical_error, why


def test_everything_is_strike_and_flight():
    scene = kick()
    answer = kd.simulate(scene, None)
    hit = kd.strike(scene.posture, scene.v, scene.ball, scene.contact)
    path = kd.fly(hit.ball_after, scene.ball, scene.air, scene.ground)
    np.testing.assert_array_equal(answer.end.position, path.landing.position)
    assert answer.neglected == ()
    assert set(answer.modelled) == {
        "friction", "ball rotation", "drag", "drag crisis", "lift", "spin decay", "buoyancy"
    }  # fmt: skip
    assert answer.numerical_error == path.error


def test_everything_is_followed_to_rest():
    scene = kick(4, ground=kd.Ground(-0.9, "turf"))
    answer = kd.simulate(scene, None)
    assert isinstance(answer.path, kd.Course)
    assert not answer.end.velocity.any()
    rough = kd.simulate(scene, 0.05)
    assert gap(answer, rough) <= rough.error < 0.05
    assert isinstance(rough.path, kd.Course)


def test_the_smallest_effects_are_negligible_as_far_as_the_tolerance_allows():
    sizes = kd.simulate(kick(1.5), None).effect_sizes
    ordered = sorted(sizes, key=lambda name: sizes[name])
    for number in range(1, len(ordered) + 1):
        total = math.fsum(sizes[name] for name in ordered[:number])
        answer = kd.simulate(kick(1.5), 2.0 * total * (1.0 + 1e-9))
        assert answer.negligible == tuple(ordered[:number])
        assert answer.neglected == ()
    assert kd.simulate(kick(1.5), None).negligible == ()


def test_a_tolerance_does_not_change_an_instantaneous_kick():
    exact = kd.simulate(kick(), None)
    for tolerance in (1e-6, 1.0):
        answer = kd.simulate(kick(), tolerance)
        assert answer.end.position.tolist() == exact.end.position.tolist()
        assert answer.warnings == exact.warnings
        assert answer.error == answer.numerical_error == exact.error <= 1e-6


def test_without_air_nothing_is_flown():
    answer = kd.simulate(kick(air=None), 0.01)
    assert answer.method == "impact: kd.strike; path: closed form"
    assert answer.modelled == ("friction", "ball rotation")


def test_it_goes_to_the_plane():
    scene = kick(plane=kd.Plane((3, 0, 0), (-1, 0, 0), "centre"))
    answer = kd.simulate(scene, 0.05)
    assert answer.end.position[0] == pytest.approx(3, abs=answer.error)
    assert gap(answer, kd.simulate(scene, None)) <= answer.error


def test_spread_bounds_what_a_change_does():
    scene = kick(uncertainty={"restitution": 0.02})
    answer = kd.simulate(scene, 1e-3)
    other = kick(contact=kd.Contact((2, 0, 1), 0.82, 0.4))
    moved = gap(kd.simulate(other, 1e-3), answer)
    assert 0.9 * moved < answer.end_deviation < 2 * moved
    assert math.isnan(kd.simulate(kick(), 1.0).end_deviation)


def test_it_prints_its_budget():
    answer = kd.simulate(kick(1.5, uncertainty={"v": 0.1}), 0.02)
    lines = str(answer).splitlines()
    assert lines[2].startswith("The uncertainties of the scene give the end a standard deviation")
    table = lines[lines.index(f"{'effect':20}{'size [m]':>9}") :]
    assert [line.split("  ")[0] for line in table[:8]] == [
        "effect", "friction", "ball rotation", "drag", "drag crisis", "lift", "spin decay",
        "buoyancy",
    ]  # fmt: skip
    rows = {line[:20].strip(): line[20:].split() for line in table[1:8]}
    assert rows == {
        name: [f"{size:.2g}", *["negligible"] * (name in answer.negligible)]
        for name, size in answer.effect_sizes.items()
    }
    assert "lift" in answer.negligible
    assert "friction" not in answer.negligible
    timed = kd.simulate(kick(1.5, law=kd.Compliance(contact_time=1e-4)), 1.0)
    assert timed.neglected == ("contact time",)
    (row,) = [line for line in str(timed).splitlines() if line.startswith("contact time  ")]
    assert row.split()[2:] == [f"{timed.effect_sizes['contact time']:.2g}", "neglected"]
    assert "m by the neglected contact time and" in str(timed)


def test_the_drag_of_a_ball_that_bounces_has_a_size():
    answer = kd.simulate(kick(4, ground=kd.Ground(-0.9, "turf")), 0.1)
    less = kd.simulate(kick(4, ground=kd.Ground(-0.9, "turf"), air=None), None)
    assert answer.effect_sizes["drag"] == pytest.approx(gap(less, answer), rel=0.5)


@pytest.mark.parametrize(("metres", "text"), [
    (198.4, "198"), (9.81, "9.8"), (0.0047, "0.0047"), (math.inf, "unknown"),
])  # fmt: skip
def test_lengths_are_readable(metres, text):
    assert _length_text(metres) == text


@pytest.mark.parametrize("tolerance", [0, -1, math.nan, "1"])
def test_bad_tolerances_are_refused(tolerance):
    with pytest.raises(kd.InvalidInput, match="tolerance"):
        kd.simulate(kick(), tolerance)


def test_what_cannot_be_simulated_is_refused():
    with pytest.raises(kd.InvalidInput, match=r"kickdyn\.Scene"):
        kd.simulate("scene.toml")
    away = kick(contact=kd.Contact((-1, 0, 0), 0.8))
    with pytest.raises(kd.NoImpact):
        kd.simulate(away, 1.0)


def test_an_answer_can_be_pickled():
    answer = kd.simulate(kd.load_scene("free_kick"))
    again = pickle.loads(pickle.dumps(answer))
    assert again.numerical_error == answer.numerical_error > 0.0
    assert (again.status, again.error) == (answer.status, answer.error)
    np.testing.assert_array_equal(again.end.position, answer.end.position)


def test_the_error_covers_what_the_instant_neglects():
    scene = kd.load_scene("volley")
    answer, whole = simulate_as_instant(scene), kd.simulate(scene, None)
    apart = math.dist(answer.end.position, whole.end.position)
    assert apart > 0.1
    assert answer.model_error == apart + whole.numerical_error > apart
    assert answer.error == answer.model_error + answer.numerical_error
    assert answer.neglected == ("contact time",)
    said = str(answer)
    assert (
        f"error {distance_in_words(answer.error)}; all effects are modelled except contact time ("
        in said
    )
    assert answer.modelled == ("friction", "ball rotation", "drag", "drag crisis", "lift")
    x, y, z = whole.end.position.round(3) + 0.0
    assert f"with it: landed at ({x:.3f}, {y:.3f}, {z:.3f}) m" in said


def test_a_contact_of_an_instant_neglects_nothing():
    scene = kd.load_scene("paper_kick")
    answer = simulate_as_instant(scene)
    assert answer.neglected == ()
    assert "; all effects are modelled\n" in str(answer)
    assert simulate_as_instant(scene.replace(law="stronge")).impact.law == "stronge"
    assert answer.end.position.tolist() == kd.simulate(scene, None).end.position.tolist()


def test_where_the_contact_cannot_be_computed_the_error_is_not_known():
    posture = kd.Leg.human().posture(np.radians([5, 10, -5]))
    v, contact = posture.joint_velocity([10, 0, 5]), kd.Contact((2, 0, 1), restitution=0.8)
    ball, ground = kd.Ball(), kd.Ground(-2)
    scene = kd.Scene(posture, v, ball, contact, ground=ground, law=kd.Compliance(contact_time=0.1))
    with pytest.raises(kd.InvalidInput, match="beyond its radius"):
        kd.simulate(scene, None)
    answer = simulate_as_instant(scene)
    assert answer.error == math.inf
    assert not answer.within_tolerance
    assert "error unknown; all effects are modelled except contact time" in str(answer)
    assert "which cannot be computed: stiffness is" in str(answer)
    assert (
        "contact shown as instantaneous; this moves the end of the path by an unknown distance"
        in kd.page(answer).html
    )
    assert (answer.neglected, answer.model_error) == (("contact time",), math.inf)


def test_the_contact_time_is_neglected_where_its_size_is_within_its_share_of_the_tolerance():
    contact = kd.Contact((1, 0, 0.1), 0.8)
    scene = kick(2, contact=contact, law=kd.Compliance(contact_time=1e-4), ground=None)
    size = kd.simulate(scene, 5.0).model_error
    for factor in (1.0 + 1e-6, 0.2):  # a little below, a flight shows that it matters less
        answer = kd.simulate(scene, size / CONTACT_SHARE * factor)
        assert answer.neglected == (("contact time",) if factor > 1.0 else ())
        assert answer.model_error == (size if factor > 1.0 else 0.0)


@pytest.mark.parametrize("tolerance", [0.01, 0.1])
def test_errors_add_up(tolerance):
    scene = kick(law=kd.Compliance(contact_time=0.01))
    answer = kd.simulate(scene, tolerance)
    assert "contact time" in answer.modelled
    assert 0.0 < answer.numerical_error <= tolerance
    assert answer.error == answer.model_error + answer.numerical_error <= tolerance
    launch_error = collision_error(scene, answer.launch, answer.impact.tol)
    by_contact = end_error(scene, answer.path, launch_error)
    assert answer.numerical_error == path_error(scene, answer.path) + by_contact > by_contact
    exact = kd.simulate(scene, None)
    assert gap(answer, exact) <= answer.error + exact.numerical_error


def test_evaluations_are_counted():
    instant = kd.simulate(kick(1.5), None)
    assert instant.evaluations == instant.path.evaluations > 0
    timed = kd.simulate(kick(1.5, law=kd.Compliance(contact_time=0.01)), 0.1)
    assert timed.evaluations == timed.impact.evaluations + timed.path.evaluations
    bounced = kd.simulate(kick(4, ground=kd.Ground(-0.9, "turf")), None)
    assert bounced.evaluations > sum(flight.evaluations for flight in bounced.path.flights)


def test_heights_over_a_wall_are_from_the_ground_to_the_lower_edge_of_the_ball():
    wall = kd.Wall(0.4, 0.3)
    scene = kick(4, air=None, plane=kd.Plane((9, 0, 0), (-1, 0, 0)), wall=wall)
    answer = kd.simulate(scene, None)
    start = scene.ball_position
    lower_edge = float(start[2]) - scene.ball.radius + 0.9
    assert answer.start_height == pytest.approx(lower_edge, abs=1e-12)
    time = 0.4 / math.hypot(*answer.launch.velocity[:2])
    rise = float(answer.launch.velocity[2]) * time - 0.5 * 9.81 * time**2
    assert answer.passage.above == pytest.approx(lower_edge + rise - 0.3, abs=1e-3)
    on_tee = kd.simulate(scene.replace(ground=None), None)
    assert on_tee.start_height == 0.0


@pytest.mark.parametrize("below", [0.0, 0.4])
def test_heights_at_a_goal_are_from_the_ground_to_the_edges_of_the_ball(below):
    scene = kick(8, air=None)
    level = float(scene.ball_position[2]) - scene.ball.radius - below
    goal = kd.Plane((1.5, 0.3, 0), (-1, 0, 0), "centre")
    answer = kd.simulate(scene.replace(ground=kd.Ground(level), plane=goal), None)
    assert (answer.status, answer.start_height) == ("at-plane", pytest.approx(below, abs=1e-12))
    _, y, z = answer.end.position
    assert answer.score.bar == pytest.approx(2.44 - (z - level) - scene.ball.radius, abs=1e-9)
    assert answer.score.post == pytest.approx(3.66 - abs(y - 0.3) - scene.ball.radius, abs=1e-9)


@pytest.mark.parametrize("law", ["newton", kd.Compliance(contact_time=1e-3)])
@pytest.mark.parametrize("tolerance", [1e-6, 0.05, 5.0])
def test_a_tolerance_loses_no_warning(law, tolerance):
    scene = kick(law=law, contact=kd.Contact((2, 0, 1), ((1.0, 0.8), (3.0, 0.6)), 0.4))
    exact, answer = kd.simulate(scene, None), kd.simulate(scene, tolerance)
    assert answer.neglected == (("contact time",) if tolerance == 5.0 and law != "newton" else ())
    kinds = ["knee at ", "restitution", "lift saturating"]
    for simulation in (exact, answer):
        assert [
            line[: len(kind)] for line, kind in zip(simulation.warnings, kinds, strict=True)
        ] == kinds
        assert set(simulation.warnings) == {*simulation.impact.warnings, *simulation.path.warnings}
    if not answer.neglected:
        assert set(answer.warnings) >= set(exact.impact.warnings)


@pytest.mark.parametrize("path", sorted(SCENES.glob("*.toml")), ids=lambda path: path.stem)
def test_the_scenes_of_kickdyn_are_within_the_limits_of_their_legs(path):
    assert kd.simulate(kd.load_scene(path)).impact.warnings == ()


@pytest.mark.parametrize(
    ("name", "frame"),
    [("paper_kick", "from the base of the leg"), ("robocup_carpet", "in the world frame")],
)
def test_the_frame_of_the_positions_is_named(name, frame):
    line = f"Positions are of the ball's centre, {frame}: x forward"
    assert line in kd.simulate(kd.load_scene(name)).summary


def test_the_scene_of_the_paper_is_the_kick_that_it_prints():
    scene = kd.load_scene("paper_kick")
    attack = np.array([math.cos(math.radians(30)), 0, math.sin(math.radians(30))])
    np.testing.assert_allclose(scene.posture.point_velocity(scene.v), 1.2 * attack, atol=1e-4)
    np.testing.assert_allclose(scene.contact.normal, attack, atol=1e-12)
    assert (scene.contact.friction, scene.ball, scene.air.density) == (0.4, kd.Ball.paper(), 1.22)


def numbers_in(text):
    """Return the numbers of a text, without those in units such as m/s2."""
    return [float(number) for number in re.findall(r"(?<![\w^.])-?\d+\.?\d*(?:e-?\d+)?", text)]


def test_every_printed_number_is_that_of_the_simulation():
    answer = kd.simulate(kd.load_scene("free_kick"), 0.05)
    expected = {
        "reached the plane at": [*answer.end.position, answer.end.time, 0.05],
        "The ball passes": [answer.passage.beside, answer.score.post, answer.score.bar],
        "Positions are of": [answer.scene.ground.height],
        "The uncertainties": [answer.end_deviation],
        "The error is": [answer.numerical_error, 1e-9],
        **{f"{name:20}": [size] for name, size in answer.effect_sizes.items()},
    }
    lines = [line for line in str(answer).splitlines() if numbers_in(line.replace("half", ""))]
    printed = {}
    for line in lines:
        if not line.startswith("warning: "):
            (start,) = [start for start in expected if line.startswith(start)]
            printed[start] = numbers_in(line.replace("DOP853", ""))
    assert printed.keys() == expected.keys()
    for start, numbers in expected.items():
        assert printed[start] == pytest.approx(numbers, rel=0.051, abs=5e-10), start


def sizes(scene):
    return measure_effects(kd.simulate(scene, None))


@pytest.fixture(scope="module")
def paper_kick():
    return kd.load_scene(SCENES / "paper_kick.toml")


def test_drag_and_friction(paper_kick):
    rows = {row.effect: row for row in sizes(paper_kick)}
    assert set(rows) == {"friction", "ball rotation", "drag", "drag crisis", "lift"}
    hit = kd.strike(paper_kick.posture, paper_kick.v, paper_kick.ball, paper_kick.contact)
    full = kd.fly(
        hit.ball_after, paper_kick.ball, paper_kick.air, paper_kick.ground
    ).landing.position
    light = kd.Air(
        paper_kick.air.density, paper_kick.air.viscosity, drag=None, torque=None, buoyancy=False
    )
    bare = kd.fly(hit.ball_after, paper_kick.ball, light, paper_kick.ground).landing.position
    assert rows["drag"].end == pytest.approx(np.linalg.norm(bare - full), rel=1e-9)
    assert rows["drag"].impulse == 0
    smooth = kd.strike(
        paper_kick.posture,
        paper_kick.v,
        paper_kick.ball,
        kd.Contact(paper_kick.contact.normal, 0.8),
    )
    difference = float(np.linalg.norm(smooth.impulse - hit.impulse))
    assert rows["friction"].impulse == pytest.approx(difference, rel=1e-12)


def test_sizes_are_distances_in_space():
    scene = kd.load_scene("free_kick")
    full = kd.simulate(scene, None)
    still = replace(scene.air, wind=(0, 0, 0))
    end = kd.fly(full.launch, scene.ball, still, scene.ground, plane=scene.plane).landing.position
    size = next(row.end for row in measure_effects(full) if row.effect == "wind")
    assert size == pytest.approx(math.dist(end, full.end.position), rel=1e-9)
    assert size > 1.001 * math.dist(end[:2], full.end.position[:2])


def test_a_contact_that_takes_time_and_a_stance():
    rows = {row.effect: row for row in sizes(kd.load_scene(SCENES / "volley.toml"))}
    assert rows["contact time"].impulse > 0.1
    robot = {row.effect: row for row in sizes(kd.load_scene(SCENES / "robocup_carpet.toml"))}
    assert {"supports", "armature"} <= set(robot)
    assert robot["armature"].end > robot["supports"].end > 0


def test_what_has_no_answer_says_so(paper_kick):
    air = kd.Air(lift=None, torque=None, drag="brazuca")
    floats = kd.Ball(0.003, 0.1)  # lighter than air: drag is all that ends its flight
    plane = kd.Plane((30, 0, 0), (-1, 0, 0))
    parts = (paper_kick.posture, paper_kick.v, floats, kd.Contact((1, 0, 0), 0.8))
    rows = sizes(kd.Scene(*parts, air=air, plane=plane))
    assert {row.effect for row in rows} >= {"drag", "buoyancy"}
    for row in rows:
        assert np.isnan(row.end) == bool(row.why_not)


def test_an_effect_has_no_size_where_the_ball_does_not_end(paper_kick):
    parts = (paper_kick.posture, paper_kick.v, paper_kick.ball, paper_kick.contact)
    rows = sizes(kd.Scene(*parts, ground=kd.Ground(-1e7)))
    assert {row.effect for row in rows} == {"friction", "ball rotation"}
    assert all(np.isnan(row.end) and row.why_not == "no end: aloft" for row in rows)
    assert all(row.impulse > 0 for row in rows)


def test_attempts_at_a_tolerance_take_no_longer_than_the_exact_answer(monkeypatch):
    """The first attempt knows how the error of the end falls, also where lift grows with a root."""
    evaluations = []

    def collide(scene, tol):
        hit = collide_scene(scene, tol)
        evaluations.append(hit.evaluations)
        return hit

    monkeypatch.setattr("kickdyn.scene.simulate.collide_scene", collide)
    rng = np.random.default_rng(6)
    scenes = [wide_scene(rng) for _ in range(322)]
    for number in (126, 166, 322):
        exact = kd.simulate(scenes[number - 1], None)
        (most,) = evaluations
        evaluations.clear()
        for tolerance in (0.01, 0.1):
            answer = kd.simulate(scenes[number - 1], tolerance)
            assert 0 < sum(evaluations) <= 1.2 * most
            evaluations.clear()
            assert math.dist(answer.end.position, exact.end.position) <= answer.error < tolerance
