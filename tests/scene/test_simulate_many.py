"""Draws of a scene are simulations of the drawn scenes."""

import numpy as np
import pytest
from tolerances import agrees, closed_form, sampled

import kickdyn as kd
from kickdyn.scene.launch_and_end import collide_scene, end_of, fly_scene, strike_scene
from kickdyn.scene.scene import Compliance
from kickdyn.scene.simulate_many import _Draws, _with_contact_time

SPREAD = {
    "q": 0.01, "v": 0.1, "restitution": 0.02, "friction": 0.03, "normal": 0.02,
    "ball_velocity": 0.1, "ball_spin": 2.0}  # fmt: skip


def drawn_scenes(scene, n, seed):
    """Return the scenes that the random numbers of a seed stand for."""
    draws = _Draws(scene)
    numbers = np.random.default_rng(seed).normal(size=(n, draws.size))
    q, v, contact, velocity, spin = draws.arguments(numbers)
    return [
        scene.replace(
            posture=scene.leg.posture(q[i]), v=v[i], uncertainty=None,
            contact=contact[i % len(contact)],
            incoming=kd.BallState(velocity=velocity[i], spin=spin[i]),
        )
        for i in range(n)
    ]  # fmt: skip


@pytest.mark.parametrize(("name", "law"), [
    ("free_kick", "newton"), ("free_kick", "stronge"), ("wet_grass_pass", "newton"),
    pytest.param("robocup_carpet", "newton", marks=pytest.mark.slow)])  # fmt: skip
def test_each_draw_is_a_simulation(name, law):
    scene = kd.load_scene(name).replace(law=law, uncertainty=SPREAD)
    many = kd.simulate_many(scene, 3, tolerance=None, seed=3)
    near = {"rel": closed_form(1e4), "abs": closed_form(1e4)}
    for i, drawn in enumerate(drawn_scenes(scene, 3, 3)):
        struck = strike_scene(drawn).ball_after
        assert many.launch.velocity[i] == pytest.approx(struck.velocity, **near)
        assert many.launch.spin[i] == pytest.approx(struck.spin, **near)
        place = many.nominal.launch.position  # where the ball lies, whatever the foot does
        path = fly_scene(scene, kd.BallState(place, struck.velocity, struck.spin))
        assert many.status[i] == path.status
        assert many.end[i] == pytest.approx(end_of(path).position, abs=1e-3)
        assert many.duration[i] == pytest.approx(path.duration, abs=1e-3)


def test_draws_without_an_impact_and_paths_without_an_end_have_no_end():
    """A foot that moves away from the ball, and a wind that carries higher balls away."""

    def rising(z):
        return 0.0, 0.0, 80.0 if z > -0.6 else 0.0

    scene = kd.load_scene("paper_kick").replace(uncertainty={"v": 4.0}, air=kd.Air(wind=rising))
    many, statuses = kd.simulate_many(scene, 12), []
    for drawn in drawn_scenes(scene, 12, 0):
        try:
            statuses.append(fly_scene(drawn, strike_scene(drawn).ball_after).status)
        except kd.NoImpact:
            statuses.append("no-impact")
    assert set(statuses) == {"landed", "aloft", "no-impact"}
    assert many.status.tolist() == statuses
    ends = np.isfinite(many.end).all(axis=1)
    assert ends.tolist() == [status == "landed" for status in statuses]
    agrees(many.mean, many.end[ends].mean(axis=0), closed_form())
    assert many.deviation**2 == pytest.approx(many.end[ends].var(axis=0, ddof=1).sum())


def test_the_change_by_the_contact_time_is_quadratic_through_the_nodes():
    """A quadratic function without mixed terms is exact at 0 and at both nodes of each axis."""
    law = Compliance(contact_time=0.008)
    scene = kd.load_scene("free_kick").replace(law=law, uncertainty={"v": 0.2})
    draws, node, tol = _Draws(scene), np.sqrt(3), 1e-5
    values = np.array([[0, 0, 0], [node, 0, 0], [0, node, 0], [0, 0, -node], [0.4, -0.9, 0.7]])
    instant = draws.launches(values)[0][:, 3:]
    launch, error = _with_contact_time(draws, values, draws.launches(values)[0], tol)
    v = draws.arguments(values)[1]
    hits = [collide_scene(scene.replace(v=row), tol).ball_after for row in v]
    right = np.array([[*hit.velocity, *hit.spin] for hit in hits])
    agrees(launch[:4, 3:], right[:4], closed_form(10))
    agrees(launch[4, 3:] - instant[4], right[4] - instant[4], 0.01)
    assert 0.0 < error < 0.01 * np.linalg.norm(right[4, :3] - instant[4, :3])
    many = kd.simulate_many(scene, 3, 0.05, seed=3)
    values, tol = np.random.default_rng(3).normal(size=(3, draws.size)), many.nominal.impact.tol
    launch, error = _with_contact_time(draws, values, draws.launches(values)[0], tol)
    agrees(many.launch.velocity, launch[:, 3:6], closed_form(1e3))
    assert many.model_error == pytest.approx(error * many.nominal.path.duration)


def test_sources_are_drawn_independently_with_their_deviations():
    spread = SPREAD | {"restitution": 0.5, "friction": 0.5}
    scene = kd.load_scene("free_kick").replace(uncertainty=spread)
    draws, nv = _Draws(scene), scene.leg.nv
    values = np.random.default_rng(1).normal(size=(2000, draws.size))
    changes, (q, v, contact, velocity, spin) = draws.changes(values), draws.arguments(values)
    for name, change in changes.items():
        count = {"q": nv, "v": nv, "restitution": 1, "friction": 1}.get(name, 3)
        assert change.shape == (2000, count)
        assert change.std(axis=0) == pytest.approx(spread[name], rel=sampled(2 * 2000))
        assert change.mean(axis=0) == pytest.approx(0.0, abs=spread[name] * sampled(2000))
    correlation = np.corrcoef(np.hstack([*changes.values()]), rowvar=False)
    assert np.abs(correlation - np.eye(draws.size)).max() < sampled(2000)
    plain = scene.contact
    for name, most in (("restitution", 1.0), ("friction", np.inf)):
        right = np.clip(getattr(plain, name) + changes[name][:, 0], 0.0, most)
        agrees(getattr(contact, name), right, closed_form())
    normal = plain.normal + changes["normal"]
    agrees(contact.normal, normal / np.linalg.norm(normal, axis=1)[:, None], closed_form())
    incoming = scene.incoming
    before = {"q": (q, scene.q), "v": (v, scene.v)}
    before |= {"ball_velocity": (velocity, incoming.velocity), "ball_spin": (spin, incoming.spin)}
    for name, (drawn, value) in before.items():
        agrees(drawn, value + changes[name], closed_form())
