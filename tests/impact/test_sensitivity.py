"""Analytic derivatives against central differences of fourth order, branch by branch."""

import math

import numpy as np
import pytest
from chains import floating_kick, random_kick, random_leg
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from nudges import RESULTS, by_differences, margin
from tolerances import agrees, closed_form, differenced

import kickdyn as kd
from kickdyn.impact.sensitivity import UNITS

seeds = st.integers(0, 2**32 - 1)
CASES = {f"{name}, no friction": (0.0, {"frictionless"}) for name in ("chain", "floating", "table")}
CASES |= dict.fromkeys(("chain", "floating"), (0.15, {"stick", "slip"}))
CASES |= dict.fromkeys(("table", "moving base"), (0.15, {"slip"}))


def kick_of(case, rng):
    friction = CASES[case][0]
    if case.startswith("floating"):
        (posture, *others), options = floating_kick(rng, friction=friction)
        model = posture.leg.model
        model.armature = np.concatenate([np.zeros(6), rng.uniform(0, 0.1, size=2)])
        return (kd.Leg.from_model(model, "toe").posture(posture.q), *others), options
    leg = random_leg(rng, 4 if case == "moving base" else None)
    if case == "moving base":
        leg = leg.with_base_velocity((2.0, -1.0, 0.5), (1.0, -3.0, 2.0))
    e = rng.uniform(0.1, 0.9)
    (posture, v, ball, contact), options = random_kick(rng, leg, friction=friction, restitution=e)
    if case.startswith("table"):  # e changes with all that changes the speed of approach
        speed = kd.strike(posture, v, ball, contact, **options).approach_speed
        rows = [[0.5 * speed, rng.uniform(0.5, 0.9)], [2 * speed, rng.uniform(0.1, 0.9)]]
        contact = kd.Contact(contact.normal, rows, friction)
    return (posture, v, ball, contact), options


@pytest.mark.parametrize("case", CASES)
def test_against_differences(case):
    """Along one random direction of each source, where no difference meets the other branch."""
    branches = set()

    @given(seed=seeds)
    @settings(max_examples=15)
    def check(seed):
        rng = np.random.default_rng(seed)
        kick, options = kick_of(case, rng)
        impact = kd.strike(*kick, **options)
        slopes, friction = impact.sensitivity(), impact.contact.friction
        assume(margin(impact) >= 0.02 * friction)
        branches.add(str(slopes.branch))
        if friction:
            assert slopes.margin == pytest.approx(margin(impact), rel=closed_form(1e4))
        for name in ("q", "v", "normal") if case == "moving base" else UNITS:
            if name == "friction" and friction == 0:
                continue
            direction = rng.normal(size=slopes.impulse[name].shape[1])
            direction /= np.linalg.norm(direction)
            differences, impacts = by_differences(kick, options, name, direction)
            assume(all(one.sticking == impact.sticking for one in impacts))
            for result, right in differences.items():
                slope = getattr(slopes, result)[name] @ direction
                size = max(np.abs(right).max(), np.abs(RESULTS[result](impact)).max())
                assert slope == pytest.approx(right, abs=10 * differenced() * size), (result, name)

    check()
    assert branches >= CASES[case][1]


def human(friction, normal=(2, 0.3, 1), e=0.7):
    posture = kd.Leg.human().posture(np.radians([5, 10, -5]))
    return posture, np.array([0.1, -2.0, -1.0]), kd.Ball(), kd.Contact(normal, e, friction)


def test_friction_that_sets_in():
    """Without friction, its derivative is that of the first friction there is."""
    slopes, h = kd.strike(*human(0.0)).sensitivity(), 1e-6
    hits = [kd.strike(*human(k * h)) for k in range(3)]
    for result in ("impulse", "velocity", "spin", "v_after", "joint_impulses"):
        none, little, more = map(RESULTS[result], hits)
        right = (4 * little - 3 * none - more) / (2 * h)
        agrees(getattr(slopes, result)["friction"][..., 0], right, differenced(1))


@pytest.mark.parametrize("pace", [1.0, 1e-8])  # the boundary is relative to the impulse
@pytest.mark.parametrize(("factor", "at_boundary"), [(1.0, True), (1.001, False), (0.999, False)])
def test_the_boundary_is_announced(pace, factor, at_boundary):
    impact = kd.strike(*human(5.0))
    pressing = float(impact.contact.normal @ impact.impulse)
    edge = np.linalg.norm(impact.impulse - pressing * impact.contact.normal) / pressing
    posture, v, *others = human(edge * factor)
    assert kd.strike(posture, pace * v, *others).sensitivity().at_boundary is at_boundary


def test_the_textbook_case():
    """Eq. (10) differentiated by hand: p = (1 + e) u / (1/M + 1/m)."""
    impact = kd.strike(*human(0.0))
    m, big, p = impact.ball.mass, impact.effective_mass, impact.impulse
    slopes = impact.sensitivity()
    agrees(slopes.impulse["restitution"][:, 0], p / 1.7, closed_form())
    agrees(slopes.impulse["ball_mass"][:, 0], p / m * big / (big + m), closed_form(10))
    heavier = slopes.impulse["link_mass"] @ np.array([7.0, 3.0, 1.0])  # all of them in proportion
    agrees(heavier, p * m / (big + m), closed_form(10))
    assert math.isinf(slopes.margin)
    assert np.abs(slopes.impulse["normal"] @ impact.contact.normal).max() < closed_form()
    of_ball = impact.sensitivity(of_leg=False)
    assert sorted(set(UNITS) - set(of_ball.impulse)) == ["link_mass", "q", "v"]
    agrees(of_ball.velocity["ball_mass"], slopes.velocity["ball_mass"], closed_form())


def test_a_law_without_derivatives_and_a_foot_that_lets_go_are_refused():
    impact = kd.strike(*human(0.2), "paper")
    for call in (impact.sensitivity, lambda: impact.uncertainty(v=0.1)):
        with pytest.raises(kd.InvalidInput, match="'paper'"):
            call()
    sole = [(x, y, -0.035) for x in (-0.05, 0.12) for y in (-0.03, 0.03)]
    foot = kd.Support("left_ankle_roll_link", friction=0.6, sole=sole)
    leg = kd.Leg.from_robot("g1", "right_ankle_roll_link", base="floating").with_supports(foot)
    posture = leg.posture(leg.configuration())
    v = posture.joint_velocity((3, 0, 2))
    loose = kd.unilateral_strike(posture, v, kd.Ball(), kd.Contact((3, 0, 2), 0.7, 0.3))
    with pytest.raises(kd.InvalidInput, match="a support moves"):
        loose.sensitivity()
