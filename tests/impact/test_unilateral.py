"""Feet that may leave the ground: the laws themselves, and the held foot where it would stand."""

import dataclasses

import numpy as np
import pytest
from chains import constraint_speed, in_units, slides

import kickdyn as kd

FOOT, OTHER = "left_ankle_roll_link", "right_ankle_roll_link"
SOLE = [(x, y, -0.035) for x in (-0.05, 0.12) for y in (-0.03, 0.03)]
ROBOT = kd.Leg.from_robot("g1", OTHER, base="floating", drives=False)
Q = {"right_hip_pitch_joint": -0.4, "right_knee_joint": 0.6, "left_knee_joint": 0.3}
Q["left_ankle_pitch_joint"] = -0.3  # the sole is level


def stance(friction=0.6, scale=1.0, **options):
    options = {"sole": scale * np.array(SOLE), **options}
    return ROBOT.with_supports(kd.Support(FOOT, friction=friction, **options))


def kick(leg, wish=(4.0, 0.5, 1.0), normal=None, friction=0.3, e=0.7, offset=None):
    posture = leg.posture(leg.configuration(Q))
    v = posture.joint_velocity(wish)
    return (
        posture,
        v,
        kd.Ball(),
        kd.Contact(wish if normal is None else normal, e, friction, offset),
    )


KICKS = {
    "forward": kick(stance()),
    "down": kick(stance(), (1, 0, -4)),
    "up": kick(stance(), (1, 0, 4)),
    "sideways": kick(stance(), (1, 4, 0), (1, 3, 0.5)),
    "slippery": kick(stance(0.05), (4, 0, 0.3)),
    "frictionless": kick(stance(0.0), (4, 0, -1), friction=0.0),
    "down, large foot": kick(stance(0.6, 3), (1, 0, -4)),
    "point foot": kick(stance(sole=None, point=True), (3, 0, 2)),
    "instep": kick(stance(), offset=(0.05, 0.01, 0.02)),
    "askew": kick(stance(0.3), (3, -1, 2)),
}
OPTIONS = {"ball_velocity": (-1.0, 0.2, 0.0), "ball_spin": (3.0, -20.0, 1.0)}


@pytest.mark.parametrize("name", KICKS)
def test_contact_laws_hold_in_the_outcome(name):
    """Read from v_after and the impulses alone: Signorini and Coulomb at the ground and ball."""
    _, _, ball, contact = KICKS[name]
    hit = kd.unilateral_strike(*KICKS[name], **OPTIONS)
    posture, mu = hit.posture, hit.posture.leg.constraints.supports[0].friction
    scale, speed = np.linalg.norm(hit.impulse), hit.approach_speed
    rows = posture.constraint_projector.rows @ hit.v_after
    assert hit.cone_residual <= 1e-11
    for lever, p, u in zip(
        levers(hit), hit.solution.impulses[1:], hit.point_velocities[FOOT], strict=True
    ):
        moves = rows[:3] + (np.cross(rows[3:], lever) if len(rows) == 6 else 0)
        assert moves == pytest.approx(u, abs=1e-11 * speed)
        assert u[2] >= -1e-10 * speed
        assert p[2] >= -1e-10 * scale
        assert abs(u[2] * p[2]) <= 1e-9 * speed * scale
        assert np.hypot(*p[:2]) <= mu * p[2] + 1e-9 * scale
        if np.hypot(*u[:2]) > 1e-6 * speed:  # slides: friction is full, and against it
            assert p[:2] * np.hypot(*u[:2]) == pytest.approx(-mu * p[2] * u[:2], abs=1e-8 * scale)
    n = contact.normal
    slip = (
        hit.ball_after.velocity
        - ball.radius * np.cross(hit.ball_after.spin, n)
        - posture.jacobian @ hit.v_after
    )
    slip -= (slip @ n) * n
    across = hit.impulse - (hit.impulse @ n) * n
    assert np.linalg.norm(across) <= contact.friction * (hit.impulse @ n) + 1e-9 * scale
    if np.linalg.norm(slip) > 1e-6 * speed:
        assert across @ slip == pytest.approx(
            -contact.friction * (hit.impulse @ n) * np.linalg.norm(slip), abs=1e-8 * scale * speed
        )
    assert hit.restitution_residual <= 1e-10
    assert hit.momentum_residual <= 1e-12
    assert np.abs(hit.joint_impulses[0]).max() <= 1e-12 * scale  # nothing carries the base


def levers(hit):
    (support,) = hit.posture.leg.constraints.supports
    (block,) = hit.posture.constraint_projector.blocks
    return np.zeros((1, 3)) if support.sole is None else support.sole @ block.rotation_world_frame.T


@pytest.mark.parametrize("name", KICKS)
def test_energy_adds_up(name):
    _, v, ball, _ = KICKS[name]
    hit = kd.unilateral_strike(*KICKS[name], **OPTIONS)

    def energy(joints, state):
        return 0.5 * (
            joints @ hit.posture.inertia @ joints
            + ball.mass * state.velocity @ state.velocity
            + ball.inertia * state.spin @ state.spin
        )

    lost = energy(v, hit.ball_before) - energy(hit.v_after, hit.ball_after)
    assert hit.energy_lost == pytest.approx(lost, abs=1e-11 * energy(v, hit.ball_before))
    assert hit.energy_lost > 0


def test_where_the_ground_would_hold_it_nothing_changes():
    held, loose = both("down, large foot")
    assert held.footing == loose.footing == {FOOT: "stands"}
    assert np.abs(held.v_after - loose.v_after).max() <= 1e-9 * np.abs(held.v_after).max()
    assert loose.impulse == pytest.approx(held.impulse, rel=1e-9)
    assert loose.support_impulses[FOOT] == pytest.approx(held.support_impulses[FOOT], abs=1e-9)


def test_the_effective_mass_is_that_of_the_leg_without_supports():
    held, loose = both("instep")
    contact = KICKS["instep"][3]
    free = ROBOT.posture(held.posture.q).with_contact_offset(contact.offset)
    assert loose.effective_mass == free.effective_mass(contact.normal)
    assert loose.effective_mass < 0.9999 * held.effective_mass


@pytest.mark.parametrize("name", ["forward", "sideways", "slippery", "down, large foot"])
def test_an_obstacle_is_the_limit_of_heavy_balls(name):
    posture, v, _, contact = KICKS[name]
    heavy, hit = (
        kd.unilateral_strike(posture, v, kd.Ball(mass), contact) for mass in (1e12, np.inf)
    )
    size = np.linalg.norm(hit.impulse)
    assert hit.impulse == pytest.approx(heavy.impulse, abs=1e-8 * size)
    assert hit.joint_impulses == pytest.approx(heavy.joint_impulses, abs=1e-8 * size)
    assert not hit.ball_after.velocity.any()


def test_digits_are_no_more_than_the_solver_leaves():
    _, loose = both("forward")
    rough = dataclasses.replace(loose, solution=loose.solution._replace(residual=1e-6))
    assert loose.digits > 10
    assert rough.digits == pytest.approx(6.0, abs=1e-3)
    assert rough.joint_digits.max() < 6.0 + 1e-9


def test_a_foot_that_only_turns_on_the_spot_slips():
    """Its friction could supply the force alone, but not the moment about the vertical with it."""
    held, loose = both("down")
    x, y, z = held.support_impulses[FOOT][:3]
    assert np.hypot(x, y) < 0.6 * z
    assert (held.footing, loose.footing) == ({FOOT: "turns"}, {FOOT: "slips"})


def test_a_foot_that_slips_on_the_ground_cannot_be_held_by_it():
    """Near the limit the corners may share their impulses so that it stands or so that it slips."""
    rng, verdicts = np.random.default_rng(2), []
    for _ in range(24):
        leg = stance(rng.uniform(0.3, 0.7), rng.uniform(1.0, 2.0))
        case = kick(leg, np.array([1.0, 0.0, -4.0]) + 0.4 * rng.normal(size=3))
        held, loose = kd.strike(*case), kd.unilateral_strike(*case)
        verdicts.append((held.footing[FOOT], loose.footing[FOOT]))
    assert verdicts.count(("turns", "stands")) == 0
    assert verdicts.count(("stands", "stands")) >= 4
    assert verdicts.count(("turns", "slips")) >= 6
    assert verdicts.count(("stands", "slips")) <= 2


def both(name):
    return kd.strike(*KICKS[name], **OPTIONS), kd.unilateral_strike(*KICKS[name], **OPTIONS)


@pytest.mark.parametrize("name", [name for name in KICKS if "down" not in name])
def test_where_it_would_not_the_foot_moves(name):
    held, loose = both(name)
    assert held.footing[FOOT] != "stands"
    assert loose.footing[FOOT] != "stands"
    assert constraint_speed(loose) > 1e-4
    assert constraint_speed(held) < 1e-12


def test_two_feet():
    hands = kd.Leg.from_robot("g1", "right_rubber_hand", base="floating")
    supports = [kd.Support(foot, friction=0.6, sole=SOLE) for foot in (FOOT, OTHER)]
    leg = hands.with_supports(*supports)
    q = leg.configuration({**Q, "right_ankle_pitch_joint": -0.2})  # that sole is level too
    v = leg.posture(q).joint_velocity((3, 0, 1))
    hit = kd.unilateral_strike(leg.posture(q), v, kd.Ball(), kd.Contact((3, 0, 1), 0.7, 0.3))
    assert set(hit.footing) == {FOOT, OTHER}
    without = hands.with_supports(supports[0], OTHER).posture(q)
    with pytest.raises(kd.InvalidInput, match=f"support {OTHER} has no friction"):
        kd.unilateral_strike(without, v, kd.Ball(), kd.Contact((3, 0, 1), 0.7, 0.3))
    assert hit.cone_residual <= 1e-10
    assert hit.momentum_residual <= 1e-12
    assert hit.restitution_residual <= 1e-10


def test_each_foot_has_its_own_friction():
    """Named in either order; the impulses at every corner are inside the cone of that foot."""
    hands = kd.Leg.from_robot("g1", "right_rubber_hand", base="floating")
    q = hands.configuration({**Q, "right_ankle_pitch_joint": -0.2})
    frictions, answers = {FOOT: 0.9, OTHER: 0.05}, []
    for names in ((FOOT, OTHER), (OTHER, FOOT)):
        feet = [kd.Support(name, friction=frictions[name], sole=SOLE) for name in names]
        leg = hands.with_supports(*feet)
        v = leg.posture(q).joint_velocity((3, 1, 1))
        hit = kd.unilateral_strike(leg.posture(q), v, kd.Ball(), kd.Contact((3, 1, 1), 0.7, 0.3))
        corners = hit.solution.impulses[1:].reshape(2, 4, 3)
        for name, impulses in zip(names, corners, strict=True):
            ratio = np.hypot(impulses[:, 0], impulses[:, 1]) - frictions[name] * impulses[:, 2]
            assert ratio.max() < 1e-9
            total = hit.support_impulses[name][:3]
            assert total == pytest.approx(impulses.sum(axis=0), abs=1e-12)
        slippery = hit.support_impulses[OTHER]
        assert np.hypot(*slippery[:2]) == pytest.approx(0.05 * slippery[2], rel=0.5)
        answers.append((hit.impulse, hit.support_impulses[FOOT]))
    assert answers[0][0] == pytest.approx(answers[1][0], rel=1e-6)
    firm = answers[0][1]
    assert np.hypot(*firm[:2]) > 0.06 * firm[2]


@pytest.mark.parametrize(
    ("leg", "said"),
    [
        (ROBOT, "g1 has no supports: Leg.with_supports adds them"),
        (ROBOT.with_supports(FOOT), f"support {FOOT} has no friction"),
        (ROBOT.with_supports(kd.Support(FOOT, friction=0.5)), f"support {FOOT} has no sole"),
    ],
)
def test_what_cannot_be_solved_is_refused(leg, said):
    with pytest.raises(kd.InvalidInput, match=said):
        kd.unilateral_strike(*kick(leg))


def test_an_answer_that_misses_the_laws_is_refused(monkeypatch):
    monkeypatch.setattr("kickdyn.impact.newton_law.MAX_RESIDUAL", 0.0)
    with pytest.raises(kd.KickdynError, match=r"no impulses found at 5 contacts: the best have"):
        kd.unilateral_strike(*KICKS["forward"])


@pytest.mark.parametrize(
    ("law", "said"),
    [
        ("paper", "impact law is 'paper', which is defined for one contact: 5 .* need 'newton'"),
        ("stronge", "impact law is 'stronge', which is defined for one contact"),
        ("poisson", "impact law is 'poisson': it must be one of newton"),
        (3, "impact law is 3: it must be one of newton"),
    ],
)
def test_other_laws_are_refused(law, said):
    with pytest.raises(kd.InvalidInput, match=said):
        kd.unilateral_strike(*KICKS["forward"], law)


@pytest.mark.parametrize("friction", [10.0, 1e3, 1e6])
@pytest.mark.parametrize("name", ["forward", "down", "sideways", "point foot"])
def test_friction_as_strong_as_you_like(name, friction):
    """Above about 10 nothing slides any more that is pressed, and the answer hardly changes."""
    posture, v, ball, contact = KICKS[name]
    (support,) = posture.leg.constraints.supports
    for at_ball in (0.3, friction):
        rough = kd.Contact(contact.normal, contact.restitution, at_ball)
        hits = []
        for mu in (friction, 2 * friction):
            foot = kd.Support(FOOT, friction=mu, sole=support.sole, point=support.point)
            leg = ROBOT.with_supports(foot)
            hits.append(kd.unilateral_strike(leg.posture(posture.q), v, ball, rough, **OPTIONS))
        assert hits[0].cone_residual <= 1e-10
        assert hits[0].restitution_residual <= 1e-9
        apart = np.abs(hits[1].v_after - hits[0].v_after).max()
        assert apart <= 2.0 / friction * np.abs(hits[0].v_after).max()


def test_a_tilted_sole_is_refused():
    posture, _, ball, contact = KICKS["forward"]
    leg = posture.leg
    q = leg.configuration(Q | {"left_ankle_pitch_joint": 0.2})
    v = leg.posture(q).joint_velocity((4.0, 0.5, 1.0))
    leg = leg.with_supports(kd.Support(FOOT, friction=0.6, sole=[(1, 0, 0), (0, 1, 1), (0, 0, 0)]))
    with pytest.raises(kd.InvalidInput, match=f"sole of {FOOT} is tilted .* differ by"):
        kd.unilateral_strike(leg.posture(q), v, ball, contact)


@pytest.mark.parametrize("name", ["forward", "down, large foot", "slippery"])
def test_slow_kicks_do_what_fast_ones_do(name):
    """All is in proportion to the speed, and so is what counts as at rest."""
    posture, v, ball, contact = KICKS[name]
    hit = kd.unilateral_strike(posture, v, ball, contact)
    slow = kd.unilateral_strike(posture, 1e-6 * v, ball, contact)
    assert (slow.footing, slow.sticking) == (hit.footing, hit.sticking)
    assert slow.v_after == pytest.approx(1e-6 * hit.v_after, abs=1e-15)


def test_a_fast_spin_costs_the_normal_no_digits():
    posture, v, ball, contact = KICKS["forward"]
    normals = [
        kd.unilateral_strike(posture, v, ball, kd.Contact(contact.normal, 0.7), ball_spin=spin)
        for spin in ((0, 0, 0), (1e10, 1e10, -1e10))
    ]
    still, fast = (hit.impulse for hit in normals)
    assert fast == pytest.approx(still, rel=1e-12)


@pytest.mark.parametrize("corners", [3, 4])
def test_a_sole_that_slips_has_one_solution_on_three_corners_and_many_on_four(corners):
    """The ball has no friction, so that its spin changes only where the solver starts."""
    robot = kd.Leg.from_robot("g1", OTHER, base="floating")
    support = kd.Support(FOOT, friction=0.6, sole=SOLE[:corners])
    posture, v, ball, contact = kick(robot.with_supports(support), friction=0.0)
    hits = [
        kd.unilateral_strike(posture, v, ball, contact, ball_spin=spin)
        for spin in ((0, 0, 0), (1e3, 1e3, -1e3), (1e10, 1e10, -1e10))
    ]
    assert {str(hit.footing[FOOT]) for hit in hits} == {"slips"}
    assert max(hit.cone_residual for hit in hits) < 1e-12
    for hit in hits[1:]:
        rounding = 1e-12 if corners == 3 else 1e-5
        assert hit.impulse == pytest.approx(hits[0].impulse, rel=rounding)


@pytest.mark.parametrize("name", ["forward", "down", "slippery", "point foot"])
@pytest.mark.parametrize("units", [(2.0**-8, 2.0**12, 2.0**-3), (2.0**6, 2.0**-10, 2.0**5)])
def test_powers_of_two_of_the_units_change_no_bit(name, units):
    posture, v, ball, contact = KICKS[name]
    hit, (m, kg, s), (support,) = (
        kd.unilateral_strike(*KICKS[name], **OPTIONS), units, posture.leg.constraints.supports
    )  # fmt: skip
    sole = None if support.sole is None else support.sole * m
    again = in_units(posture.leg, m, kg).with_supports(
        kd.Support(FOOT, point=support.point, friction=support.friction, sole=sole)
    )
    q = posture.q.copy()
    q[:3] *= m
    hit_again = kd.unilateral_strike(
        again.posture(q), v * m ** slides(again) / s, kd.Ball(ball.mass * kg, ball.radius * m),
        contact, ball_velocity=np.array(OPTIONS["ball_velocity"]) * m / s,
        ball_spin=np.array(OPTIONS["ball_spin"]) / s,
    )  # fmt: skip
    assert hit_again.impulse.tolist() == (hit.impulse * kg * m / s).tolist()
    assert hit_again.footing == hit.footing
    of_ground = hit.support_impulses[FOOT][:3] * kg * m / s
    assert hit_again.support_impulses[FOOT][:3].tolist() == of_ground.tolist()
    assert hit_again.v_after.tolist() == (hit.v_after * m ** slides(again) / s).tolist()
