"""Analytic derivatives against central differences of fourth order, branch by branch."""

import math

import numpy as np
import pytest
from chains import floating_kick, random_kick, random_leg
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from nudges import RESULTS, by_differences, margin

import kickdyn as kd
from kickdyn.impact.sensitivity import UNITS

seeds = st.integers(0, 2**32 - 1)


def check(kick, options, rng, names=UNITS):
    """Along one random direction of each source."""
    hit = kd.strike(*kick, **options)
    slopes = hit.sensitivity()
    assume(margin(hit) >= 0.02 * hit.contact.friction)  # differences must not meet the other branch
    for name in names:
        if name == "friction" and hit.contact.friction == 0:
            continue
        way = rng.normal(size=slopes.impulse[name].shape[1])
        way /= np.linalg.norm(way)
        differences, hits = by_differences(kick, options, name, way)
        assume(all(near.sticking == hit.sticking for near in hits))
        for result, expected in differences.items():
            ours = getattr(slopes, result)[name] @ way
            size = max(np.abs(expected).max(), np.abs(RESULTS[result](hit)).max())
            assert np.abs(ours - expected).max() <= 1e-7 * size, (name, result)
    return slopes.branch


@pytest.mark.parametrize(
    ("friction", "branches"),
    [(0.0, {"frictionless"}), (0.15, {"stick", "slip"}), (0.4, {"stick", "slip"})],
)
@pytest.mark.parametrize("floating", [False, True])
def test_against_differences(friction, branches, floating):
    seen = set()

    @given(seed=seeds)
    @settings(max_examples=30 if floating else 60, derandomize=True, deadline=None)
    def run(seed):
        rng = np.random.default_rng(seed)
        if floating:
            (posture, *rest), options = floating_kick(rng, friction=friction)
            model = posture.leg.model
            model.armature = np.concatenate([np.zeros(6), rng.uniform(0, 0.1, size=2)])
            kick = kd.Leg.from_model(model, "toe").posture(posture.q), *rest
        else:
            kick, options = random_kick(
                rng, random_leg(rng), friction=friction, restitution=rng.uniform(0.1, 0.9)
            )
        seen.add(check(kick, options, rng))

    run()
    assert seen == branches


def human(friction, normal=(2, 0.3, 1), e=0.7):
    posture = kd.Leg.human().posture(np.radians([5, 10, -5]))
    contact = kd.Contact(normal, e, friction)
    return (posture, np.array([0.1, -2.0, -1.0]), kd.Ball(), contact), {}


def test_friction_that_sets_in():
    """Without friction, its derivative is that of the first friction there is."""
    kick, options = human(0.0)
    slopes = kd.strike(*kick, **options).sensitivity()
    h = 1e-6
    little = [kd.strike(*human(k * h)[0]).impulse for k in range(3)]
    assert slopes.impulse["friction"][:, 0] == pytest.approx(
        (4 * little[1] - 3 * little[0] - little[2]) / (2 * h), rel=1e-6, abs=1e-9
    )


def test_without_sliding_there_is_no_friction_to_set_in():
    """A foot that the impact itself brings to move along the normal only."""
    posture, *_ = human(0.0)[0]
    ball, n = kd.Ball(), np.array([1.0, 0.0, 0.0])
    aside = posture.delassus() @ n
    impulse = 1.5 / (aside[0] + 1 / ball.mass)
    v = posture.joint_velocity((1.0, 0.0, aside[2] * impulse))
    hit = kd.strike(posture, v, ball, kd.Contact(n, 0.5))
    foot_after = posture.jacobian @ hit.v_after
    assert np.abs(foot_after[1:]).max() < 1e-15
    slopes = hit.sensitivity()
    assert np.abs(slopes.impulse["friction"]).max() == 0.0
    h = 1e-6
    slower = [kd.strike(posture, v, ball, kd.Contact(n, 0.5 + k * h)) for k in (-1, 1)]
    by_e = (slower[1].impulse - slower[0].impulse) / (2 * h)
    assert slopes.impulse["restitution"][:, 0] == pytest.approx(by_e, rel=1e-8)


@pytest.mark.parametrize("pace", [1.0, 1e-8])  # the boundary is relative to the impulse
def test_the_boundary_is_announced(pace):
    kick, options = human(5.0)
    hit = kd.strike(*kick, **options)
    assert hit.sticking
    pressing = float(hit.contact.normal @ hit.impulse)
    edge = np.linalg.norm(hit.impulse - pressing * hit.contact.normal) / pressing
    for friction, at_boundary in ((edge, True), (edge * 1.001, False), (edge * 0.999, False)):
        posture, v, *others = human(friction)[0]
        slopes = kd.strike(posture, pace * np.array(v), *others).sensitivity()
        assert slopes.at_boundary is at_boundary
    assert slopes.branch == "slip"


def test_what_cannot_matter_does_not():
    kick, options = human(0.2)
    hit = kd.strike(*kick, **options)
    slopes = hit.sensitivity()
    assert np.abs(slopes.impulse["normal"] @ hit.contact.normal).max() < 1e-14
    assert slopes.impulse["ball_radius"] == pytest.approx(np.zeros((3, 1)), abs=1e-15)
    assert math.isinf(kd.strike(*human(0.0)[0]).sensitivity().margin)


def test_the_textbook_case():
    """Eq. (10) differentiated by hand: p = (1 + e) u / (1/M + 1/m)."""
    kick, _ = human(0.0)
    hit = kd.strike(*kick)
    m, big, p = hit.ball.mass, hit.effective_mass, hit.impulse
    slopes = hit.sensitivity()
    assert slopes.impulse["restitution"][:, 0] == pytest.approx(p / 1.7, rel=1e-13)
    assert slopes.impulse["ball_mass"][:, 0] == pytest.approx(p / m * big / (big + m), rel=1e-13)
    heavier = slopes.impulse["link_mass"] @ np.array([7.0, 3.0, 1.0])  # all of them in proportion
    assert heavier == pytest.approx(p * m / (big + m), rel=1e-12)


def test_the_card_says_per_what():
    slopes = kd.strike(*human(0.4)[0]).sensitivity()
    rows = {name: (value, unit) for name, value, unit in slopes._rows()}
    assert rows["margin"][1] == ("N s" if slopes.branch == "stick" else "m/s")
    assert rows["impulse by restitution, at most"][1] == "N s per 1"
    assert rows["impulse by v, at most"][1] == "N s per (rad/s)"
    assert rows["impulse by link_mass, at most"][1] == "N s per kg"
    assert not [unit for _, unit in rows.values() if unit.endswith("per ")]


def test_other_laws_are_refused():
    kick, options = human(0.2)
    hit = kd.strike(*kick, "paper", **options)
    with pytest.raises(kd.InvalidInput, match="impact law 'paper' has no sensitivities"):
        hit.sensitivity()


def test_a_foot_that_let_go_is_refused():
    sole = [(x, y, -0.035) for x in (-0.05, 0.12) for y in (-0.03, 0.03)]
    foot = kd.Support("left_ankle_roll_link", friction=0.6, sole=sole)
    leg = kd.Leg.from_robot("g1", "right_ankle_roll_link", base="floating").with_supports(foot)
    posture = leg.posture(leg.configuration())
    v = posture.joint_velocity((3, 0, 2))
    kick = posture, v, kd.Ball(), kd.Contact((3, 0, 2), 0.7, 0.3)
    assert np.isfinite(kd.strike(*kick).sensitivity().margin)
    loose = kd.unilateral_strike(*kick)
    assert loose.footing != {"left_ankle_roll_link": "stands"}
    with pytest.raises(kd.InvalidInput, match=r"a support moves at .* for supports that stay"):
        loose.sensitivity()


def test_links_without_mass_have_no_mass_to_scale():
    leg = kd.Leg.from_robot("human")
    masses = [inertia.mass for inertia in leg.model.inertias][1:]
    assert 0.0 in masses
    posture = leg.posture(np.full(leg.nq, 0.2))
    v = posture.joint_velocity((10, 0, 3))
    hit = kd.strike(posture, v, kd.Ball(), kd.Contact((1, 0, 0.2), 0.7, 0.4))
    slopes = hit.sensitivity().impulse["link_mass"]
    assert np.isfinite(slopes).all()
    assert not slopes[:, np.equal(masses, 0.0)].any()
    assert np.isfinite(hit.uncertainty(link_mass=0.1).branch_sigmas)


def test_derivatives_beyond_double_precision_are_refused():
    posture = kd.Leg.human().posture([0.1, 0.2, 0.3])
    v = 1e138 * posture.joint_velocity((3, 0, 1))
    hit = kd.strike(posture, v, kd.Ball(1e-170), kd.Contact((1, 0, 0.3), 0.8, 0.4))
    with pytest.raises(kd.KickdynError, match="exceed double precision"):
        hit.sensitivity()
    for friction in (0.0, 0.4):  # without friction, some derivatives are finite
        contact = kd.Contact((1, 0, 0.3), 0.8, friction)
        light = kd.strike(posture, v / 1e130, kd.Ball(1e-300), contact)
        with pytest.raises(kd.KickdynError, match="exceed double precision"):
            light.sensitivity()


@pytest.mark.parametrize("friction", [0.0, 0.15, 0.4])
def test_restitution_over_speed_against_differences(friction):
    """The speed of approach changes with foot and ball velocity, posture and normal."""
    seen = set()

    @given(seed=seeds)
    @settings(max_examples=15, derandomize=True, deadline=None)
    def run(seed):
        rng = np.random.default_rng(seed)
        kick, options = random_kick(rng, random_leg(rng), friction=friction)
        speed = kd.strike(*kick, **options).approach_speed
        table = [[0.5 * speed, rng.uniform(0.5, 0.9)], [2 * speed, rng.uniform(0.1, 0.9)]]
        (posture, v, ball, contact) = kick
        steep = posture, v, ball, kd.Contact(contact.normal, table, friction)
        seen.add(check(steep, options, rng))
        with_table = kd.strike(*steep, **options)
        number = kd.Contact(contact.normal, with_table.restitution, friction)
        constant = kd.strike(posture, v, ball, number, **options).sensitivity()
        change = with_table.sensitivity().impulse["v"] - constant.impulse["v"]
        assert np.abs(change).max() > 1e-6  # what the table adds is seen

    run()
    assert seen >= {"frictionless" if friction == 0.0 else "slip"}


@pytest.mark.parametrize("friction", [0.0, 0.15, 1.0])
@given(seed=seeds)
@settings(max_examples=5, derandomize=True, deadline=None)
def test_derivatives_with_a_base_that_turns(friction, seed):
    rng = np.random.default_rng(seed)
    leg = random_leg(rng, 4).with_base_velocity((2.0, -1.0, 0.5), (1.0, -3.0, 2.0))
    check(*random_kick(rng, leg, friction=friction), rng, ("q", "v", "normal"))
