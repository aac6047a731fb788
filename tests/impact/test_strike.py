"""The strike as a user calls it: the paper's numbers, energy, and bad input."""

import gc
import math
import weakref

import mpmath
import numpy as np
import pinocchio as pin
import pytest
from chains import floating_leg, in_units, random_kick, random_leg, slides
from hypothesis import given, settings
from hypothesis import strategies as st

import kickdyn as kd
from kickdyn.impact.laws import LAWS

LEG = kd.Leg.human()
ATTACK = np.array([math.cos(math.radians(30)), 0.0, math.sin(math.radians(30))])
seeds = st.integers(0, 2**32 - 1)


def paper_posture(ankle_deg):
    return LEG.posture(np.radians([5, 10, ankle_deg]))


@pytest.mark.parametrize(("ankle", "total"), [(-5, 1.554), (15, 0.944), (40, 0.646)])
def test_table_2(ankle, total):
    """The ball's term left out, e = 0.8, foot at 1 m/s."""
    ours = kd.normal_impulse(1.0, 0.8, paper_posture(ankle).effective_mass(ATTACK))
    assert ours == pytest.approx(total, rel=0.003)


def test_an_impact_and_its_posture_are_freed_at_once():
    """Neither refers to itself, so that no garbage collector is needed."""
    posture = paper_posture(-5)
    impact = kd.strike(posture, [0.1, -2, 1], kd.Ball(), kd.Contact(ATTACK, 0.8, 0.4))
    assert len(impact.joint_impulses) == 3
    seen = weakref.ref(posture)
    gc.disable()
    try:
        del posture, impact
        assert seen() is None
    finally:
        gc.enable()


@given(q=st.tuples(*(st.floats(low, high) for low, high in zip(LEG.lower, LEG.upper, strict=True))))
@settings(max_examples=300, derandomize=True, deadline=None)
def test_with_the_balls_term_no_posture_reaches_table_2(q):
    posture, ball = LEG.posture(q), kd.Ball.paper()
    v = posture.try_joint_velocity(ATTACK)
    if v is not None:
        hit = kd.strike(posture, v, ball, kd.Contact(ATTACK, restitution=0.8))
        assert np.linalg.norm(hit.impulse) <= 1.8 * ball.mass * 1.0 * (1 + 1e-9)


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("friction", [0.0, 0.1, 1.0])
@given(seed=seeds)
@settings(max_examples=100, derandomize=True, deadline=None)
def test_momentum_and_energy_balance(law, friction, seed):
    rng = np.random.default_rng(seed)
    kick, options = random_kick(rng, random_leg(rng), friction=friction)
    hit = kd.strike(*kick, law, **options)
    _, v, ball, contact = kick

    def energy(joint_velocity, state):
        leg = joint_velocity @ hit.posture.inertia @ joint_velocity
        return 0.5 * float(
            leg
            + ball.mass * state.velocity @ state.velocity
            + ball.inertia * state.spin @ state.spin
        )

    before = kd.BallState(hit.ball_after.position, options["ball_velocity"], options["ball_spin"])
    lost = energy(v, before) - energy(hit.v_after, hit.ball_after)
    assert hit.energy_lost == pytest.approx(lost, abs=1e-12 * energy(v, before))
    assert hit.momentum_residual <= 1e-12
    jump = ball.mass * (hit.ball_after.velocity - options["ball_velocity"])
    assert jump == pytest.approx(hit.impulse, rel=1e-12, abs=1e-13)
    lever = -ball.radius * contact.normal
    turn = ball.inertia * (hit.ball_after.spin - options["ball_spin"])
    assert turn == pytest.approx(np.cross(lever, hit.impulse), rel=1e-10, abs=1e-12)
    assert hit.ball_after.position == pytest.approx(hit.posture.contact_point - lever)
    if law == "newton":
        assert hit.restitution_residual <= 1e-12
    if law == "stronge" or (friction == 0.0 and law == "newton"):
        assert hit.energy_lost >= 0.0
        assert not hit.creates_energy


@pytest.mark.parametrize("law", ["newton", "stronge"])
def test_an_offset_turns_with_the_foot(law):
    """The contact point 3 cm above the sole, as the foot's axes say, whatever its angle."""
    contact = kd.Contact((1, 0, 0.3), 0.7, 0.4, offset=(0, 0, 0.03))
    hit = kd.strike(LEG.posture(np.radians([0, 0, 90])), [0, -2, -1], kd.Ball(), contact, law)
    there = LEG.posture(np.radians([0, 0, 90])).contact_point + np.array([0.03, 0, 0])
    assert hit.posture.contact_point == pytest.approx(there)
    assert hit.ball_after.position == pytest.approx(there + kd.Ball().radius * contact.normal)
    assert hit.foot_velocity == pytest.approx(hit.posture.jacobian @ [0, -2, -1])
    assert hit.momentum_residual <= 1e-14


def test_a_particle_does_not_turn_and_grips_harder():
    """Its tangential inertia is all of m, a shell's 2/5 of it: friction has more to do."""
    contact = kd.Contact((1, 0, 0.2), 0.7, friction=5.0)
    wall = np.radians([0, 0, 90])
    options = {"ball_velocity": (-3, 0, 1), "law": "newton"}
    shell, particle = (
        kd.strike(LEG.posture(wall), np.zeros(3), ball, contact, **options)
        for ball in (kd.Ball(), kd.Ball(inertia_factor=math.inf))
    )
    assert particle.ball_after.spin.tolist() == [0, 0, 0]
    assert abs(shell.ball_after.spin[1]) > 1
    gripped = np.array([0.2, 0, -1]) / math.hypot(1, 0.2)  # across the normal
    assert abs(particle.impulse @ gripped) > 1.5 * abs(shell.impulse @ gripped)


def test_a_rolling_ball_and_a_volley():
    """What counts at the contact is the velocity of the ball's surface, spin included."""
    q, v, ball = np.radians([5, 10, -5]), np.array(V), kd.Ball()
    contact = kd.Contact((1, 0, 0.1), 0.7, 0.3)
    speed = 2.0
    rolling = {"ball_velocity": (-speed, 0, 0), "ball_spin": (0, -speed / ball.radius, 0)}
    sliding = {"ball_velocity": (-speed, 0, 0)}
    volley = {"ball_velocity": (-8, 1, -6), "ball_spin": (3, 40, -10)}
    rolled, slid, volleyed = (
        kd.strike(LEG.posture(q), v, ball, contact, "stronge", **motion)
        for motion in (rolling, sliding, volley)
    )
    assert rolled.approach_speed == slid.approach_speed < volleyed.approach_speed
    assert np.abs(rolled.impulse - slid.impulse).max() > 0.1
    for hit in (rolled, slid, volleyed):
        surface = [
            state.velocity - ball.radius * np.cross(state.spin, contact.normal) - foot
            for state, foot in (
                (hit.ball_before, hit.foot_velocity),
                (hit.ball_after, hit.posture.jacobian @ hit.v_after),
            )
        ]
        work = -0.5 * hit.impulse @ (surface[0] + surface[1])
        assert hit.energy_lost == pytest.approx(work, rel=1e-11)


def test_restitution_residual_tells_where_the_papers_law_does_not_restitute():
    v = paper_posture(-5).joint_velocity(ATTACK)
    contact = kd.Contact((1, 0, 0.2), restitution=0.8, friction=0.4)
    hit = kd.strike(paper_posture(-5), v, kd.Ball(), contact, "paper")
    assert hit.restitution_residual > 0.01


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("friction", [0.0, 0.1, 0.4, 3.0])
@pytest.mark.parametrize("seed", [None, 0, 1, 2])
def test_an_obstacle_is_the_limit_of_heavy_balls(law, friction, seed):
    """Of a planar leg, which cannot move across its plane, and of chains about any axes."""
    if seed is None:
        posture, normal = paper_posture(15), (1, 0, 0.6)
        v = posture.joint_velocity((3, 0, 1))
    else:
        leg = random_leg(np.random.default_rng(seed), joints=6)
        (posture, v, _, contact), _ = random_kick(np.random.default_rng(seed), leg)
        normal = np.sign(contact.normal @ posture.point_velocity(v)) * contact.normal
    contact = kd.Contact(normal, 0.8, friction)
    heavy, hit = (kd.strike(posture, v, kd.Ball(m), contact, law) for m in (1e12, math.inf))
    size = np.linalg.norm(hit.impulse)
    assert hit.impulse == pytest.approx(heavy.impulse, abs=1e-8 * size)
    assert hit.joint_impulses == pytest.approx(heavy.joint_impulses, abs=1e-8 * size)
    assert hit.v_after == pytest.approx(heavy.v_after, rel=1e-7, abs=1e-8)
    assert hit.energy_lost == pytest.approx(heavy.energy_lost, rel=1e-7, abs=1e-9)
    assert hit.sticking == heavy.sticking
    assert not hit.ball_after.velocity.any()
    assert not hit.ball_after.spin.any()
    if law == "newton":
        assert hit.digits > 10
        slopes = hit.sensitivity().impulse["v"] @ v
        assert slopes == pytest.approx(hit.impulse, abs=1e-8 * size)  # linear in v


@pytest.mark.parametrize(("ankle", "total"), [(-5, 1.554), (15, 0.944), (40, 0.646)])
def test_table_2_is_a_strike_at_an_obstacle(ankle, total):
    """What `test_table_2` computes without a strike, now with an impulse in every joint."""
    posture = paper_posture(ankle)
    v = posture.joint_velocity(ATTACK)
    hit = kd.strike(posture, v, kd.Ball(math.inf), kd.Contact(ATTACK, 0.8))
    expected = kd.normal_impulse(1.0, 0.8, posture.effective_mass(ATTACK))
    assert np.linalg.norm(hit.impulse) == pytest.approx(expected, rel=1e-12)
    assert expected == pytest.approx(total, abs=5e-3)
    assert hit.momentum_residual < 1e-12
    assert hit.joint_impulses[:, :3].any(axis=1).all()


def test_an_obstacle_that_the_leg_cannot_move_towards_is_refused():
    coming = {"ball_velocity": (0.0, -3.0, 0.0)}
    for law in LAWS:
        with pytest.raises(kd.InvalidInput, match="ball mass is inf and the leg cannot move"):
            kd.strike(
                paper_posture(15), np.zeros(3), kd.Ball(math.inf), kd.Contact((0, 1, 0), 0.8), law,
                **coming,
            )  # fmt: skip


def test_an_immovable_leg_returns_the_ball():
    """A stretched leg cannot give along itself: the ball bounces off as off a wall."""
    stretched, down = np.radians([0, 0, 90]), (0, 0, -1)
    hit = kd.strike(
        LEG.posture(stretched),
        np.zeros(3),
        kd.Ball(),
        kd.Contact(down, 0.5),
        ball_velocity=(0, 0, 2),
    )
    assert hit.effective_mass > 1e15
    assert hit.ball_after.velocity == pytest.approx([0, 0, -1], rel=1e-14)
    assert hit.speed_ratio == math.inf


def test_effective_mass_and_ratio_are_those_of_eq_10():
    posture, ball = paper_posture(-5), kd.Ball()
    hit = kd.strike(posture, posture.joint_velocity(3 * ATTACK), ball, kd.Contact(ATTACK, 0.8))
    m = hit.effective_mass
    assert m == pytest.approx(posture.effective_mass(ATTACK), rel=1e-15)
    assert hit.approach_speed == pytest.approx(3, rel=1e-14)
    assert hit.speed_ratio == pytest.approx(1.8 * m / (m + ball.mass), rel=1e-13)
    assert hit.posture.condition == posture.condition


ECCENTRIC = {
    "posture": LEG.posture(np.radians([85, 105, 45])),
    "v": [5, -2, 3],
    "ball": kd.Ball(mass=3.0),
    "contact": kd.Contact(
        (math.cos(math.radians(20)), 0, -math.sin(math.radians(20))), restitution=0.9, friction=0.6
    ),
}


def test_newtons_law_says_where_it_creates_energy():
    """A medicine ball and a bent leg: friction feeds the speed that restitution returns."""
    hit = kd.strike(**ECCENTRIC)
    assert hit.creates_energy
    assert hit.energy_lost == pytest.approx(-0.648, abs=1e-3)


def test_stronges_law_creates_none_there():
    hit = kd.strike(**ECCENTRIC, law="stronge")
    assert hit.energy_lost > 0
    assert hit.restitution_residual > 0.01


V = [0.1, -2.0, -1.0]


@pytest.mark.parametrize(
    ("change", "error", "words"),
    [
        ({"v": [-x for x in V]}, kd.NoImpact, r"moves .* 1\.\d+ m/s away from the ball"),
        ({"v": [0, 0, 0]}, kd.NoImpact, "do not approach"),
        ({"ball_velocity": (99, 0, 0)}, kd.NoImpact, "away from the ball"),
        ({"q": [0, math.nan, 0]}, kd.InvalidInput, r"q is \[0\.0, nan, 0\.0\]: .*finite"),
        ({"q": [0, 0]}, kd.InvalidInput, r"q has shape \(2,\): it must be \(3,\)"),
        ({"v": [0, math.inf, 0]}, kd.InvalidInput, r"v is .*finite"),
        ({"v": [1.7e308, -1.7e308, -1.7e308]}, kd.InvalidInput, "double precision"),
        ({"v": [0, -1e160, -1e160]}, kd.InvalidInput, "double precision"),
        ({"v": "fast"}, kd.InvalidInput, "v is 'fast'"),
        (
            {"law": "hertz"},
            kd.InvalidInput,
            "impact law is 'hertz': it must be one of newton, stronge, paper",
        ),
        ({"ball_spin": (0, math.nan, 0)}, kd.InvalidInput, "spin is .*finite"),
        ({"ball_velocity": (1, 2)}, kd.InvalidInput, r"velocity has shape \(2,\)"),
    ],
)
def test_bad_input(change, error, words):
    good = {"q": np.radians([5, 10, -5]), "v": V, "law": "newton"}
    options = {**good, **change}
    q, v, law = (options.pop(key) for key in ("q", "v", "law"))
    contact = kd.Contact(ATTACK, restitution=0.8)
    with pytest.raises(error, match=words) as caught:
        kd.strike(LEG.posture(q), v, kd.Ball(), contact, law, **options)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("friction", [0.0, 0.4])
@pytest.mark.parametrize("scale", [1e-250, 1e-170, 1e-30, 1e30, 1e120])
def test_impact_is_linear_in_the_velocities(law, friction, scale):
    contact = kd.Contact((2, 0.3, 1), 0.7, friction)
    q, v = np.radians([5, 10, -5]), np.array(V)
    hit = kd.strike(LEG.posture(q), v, kd.Ball(), contact, law)
    scaled = kd.strike(LEG.posture(q), scale * v, kd.Ball(), contact, law)
    assert scaled.impulse / scale == pytest.approx(hit.impulse, rel=1e-9)
    assert scaled.speed_ratio == pytest.approx(hit.speed_ratio, rel=1e-9)


powers = st.integers(-12, 12)


@given(law=st.sampled_from(list(LAWS)), seed=seeds, metre=powers, half=powers, second=powers)
@settings(max_examples=200, derandomize=True, deadline=None)
def test_powers_of_two_of_the_units_change_no_bit(law, seed, metre, half, second):
    """Of the kilogram powers of four, for roots of masses are taken."""
    rng = np.random.default_rng(seed)
    leg = random_leg(rng, last=rng.choice([1.0, 1e-2]))
    friction = rng.choice([0.0, 0.3, 2.0])
    (posture, v, ball, contact), motion = random_kick(rng, leg, friction=friction)
    hit = kd.strike(posture, v, ball, contact, law, **motion)
    m, kg, s, sliding = 2.0**metre, 4.0**half, 2.0**second, slides(leg)
    again = kd.strike(
        in_units(leg, m, kg).posture(posture.q * m**sliding),
        v * m**sliding / s,
        kd.Ball(ball.mass * kg, ball.radius * m),
        contact,
        law,
        ball_velocity=motion["ball_velocity"] * m / s,
        ball_spin=motion["ball_spin"] / s,
    )
    assert again.impulse.tolist() == (hit.impulse * kg * m / s).tolist()
    assert again.energy_lost == hit.energy_lost * kg * m**2 / s**2
    assert again.v_after.tolist() == (hit.v_after * m**sliding / s).tolist()
    assert again.ball_after.spin.tolist() == (hit.ball_after.spin / s).tolist()
    units = np.repeat([kg * m / s, kg * m**2 / s], 3)
    assert again.joint_impulses.tolist() == (hit.joint_impulses * units).tolist()


@pytest.mark.parametrize("metre", [2.0**-20, 2.0**20])
def test_hinges_about_a_skew_axis_are_as_heavy_in_every_unit(metre):
    model, parent, place = pin.Model(), 0, pin.SE3.Identity()
    for k in range(4):
        hinge = pin.JointModelRevoluteUnaligned(np.array([0.48, 0.6, 0.64]))
        parent = model.addJoint(parent, hinge, place, f"hinge{k + 1}")
        size = 0.02 if k == 1 else 1.0
        moments = size**3 * np.diag([0.02, 0.03, 0.04])
        body = pin.Inertia(size, size * np.array([0.1, 0.05, 0.2]), moments)
        model.appendBodyToJoint(parent, body, pin.SE3.Identity())
        place = pin.SE3(np.eye(3), size * np.array([0.3, -0.1, 0.4]))
    model.addFrame(pin.Frame("toe", parent, 0, place, pin.FrameType.OP_FRAME))
    leg, q = kd.Leg.from_model(model, "toe"), [0.3, 0.5, -0.4, 0.2]
    assert leg.posture(q).is_ill_conditioned
    mass = leg.posture(q).effective_mass((1.0, 0.3, 0.2))
    assert in_units(leg, metre, 1.0).posture(q).effective_mass((1.0, 0.3, 0.2)) == mass


@pytest.mark.parametrize("far", [1e3, 1e9, 1e15])
def test_a_leg_far_from_the_origin_strikes_alike(far):
    model = LEG.model
    model.jointPlacements[1] = pin.SE3(np.eye(3), np.array([far, -far, far]))
    away = kd.Leg.from_model(model, "toe")
    contact = kd.Contact((2, 0.3, 1), 0.7, 0.4)
    here, there = (
        kd.strike(leg.posture(np.zeros(3)), V, kd.Ball(), contact) for leg in (LEG, away)
    )
    assert there.impulse == pytest.approx(here.impulse, rel=1e-13)
    assert there.joint_impulses == pytest.approx(here.joint_impulses, rel=1e-12, abs=1e-14)


@pytest.mark.parametrize("length", [1e-6, 1e6, 1e20])
def test_links_of_absurd_length_keep_their_digits(length):
    """Against M, J and Eq. (10) in 60 digits."""
    model = LEG.model
    model.jointPlacements[2] = pin.SE3(np.eye(3), np.array([0.0, 0.0, -length]))
    posture = kd.Leg.from_model(model, "toe").posture(np.radians([5, 10, -5]))
    with mpmath.workdps(60):
        links = ((7, 0.08, 0.371 / 2), (3, 0.049, 0.443 / 2), (1, 0.0018, 0.145 / 2))
        lengths = [mpmath.mpf(length), mpmath.mpf("0.443"), mpmath.mpf("0.145")]
        q = [mpmath.mpf(float(angle)) for angle in posture.q]
        turn = [-q[0], -q[0] + q[1], -q[0] + q[1] + q[2]]  # of each link about y
        rates = [[-1, 0, 0], [-1, 1, 0], [-1, 1, 1]]
        down = [(-mpmath.sin(t), -mpmath.cos(t)) for t in turn[:2]]
        down.append((mpmath.cos(turn[2]), -mpmath.sin(turn[2])))  # the foot points forward

        def column(link, lever):
            """KIC of a point on a link: rotation about y turns (x, z) to (z, -x)."""
            result = mpmath.zeros(2, 3)
            for k in range(link + 1):
                reach = lever if k == link else lengths[k]
                for j in range(3):
                    result[0, j] += rates[k][j] * reach * down[k][1]
                    result[1, j] -= rates[k][j] * reach * down[k][0]
            return result

        inertia = mpmath.zeros(3, 3)
        for k, (mass, moment, lever) in enumerate(links):
            kic, spin = column(k, mpmath.mpf(lever)), mpmath.matrix([rates[k]])
            inertia += mass * (kic.T * kic) + mpmath.mpf(moment) * (spin.T * spin)
        n = mpmath.matrix([[mpmath.cos(0.5), mpmath.sin(0.5)]])
        row = n * column(2, lengths[2])
        exact = 1 / (row * mpmath.lu_solve(inertia, row.T))[0]
    ours = posture.effective_mass([math.cos(0.5), 0, math.sin(0.5)])
    assert ours == pytest.approx(float(exact), rel=1e-12)


@pytest.mark.parametrize("wrong", range(4))
def test_things_of_the_wrong_kind_are_named(wrong):
    posture = paper_posture(15)
    arguments = [posture, posture.joint_velocity(ATTACK), kd.Ball(), kd.Contact(ATTACK, 0.8)]
    if wrong in (0, 2, 3):
        arguments[wrong] = None
        with pytest.raises(kd.InvalidInput, match=r"(posture|ball|contact) is None"):
            kd.strike(*arguments)
    else:
        arguments[3] = kd.Contact(ATTACK, 0.8, wrong, offset=(1e100, 0, 0))
        with pytest.raises(kd.InvalidInput, match="contact offset is"):
            kd.strike(*arguments)


@pytest.mark.parametrize("law", LAWS)
@given(seed=seeds)
@settings(max_examples=20, derandomize=True, deadline=None)
def test_a_base_that_moves_is_another_frame_of_reference(law, seed):
    """Seen from the point of the base over the contact, the ball is slower by its velocity."""
    rng = np.random.default_rng(seed)
    leg = random_leg(rng)
    linear, angular = rng.normal(size=3) * 3, rng.normal(size=3)
    (posture, v, ball, contact), options = random_kick(rng, leg, friction=0.3)
    carried = linear + np.cross(angular, posture.contact_point)
    moving = leg.with_base_velocity(linear, angular).posture(posture.q)
    seen = kd.strike(posture, v, ball, contact, law, **options)
    options["ball_velocity"] = options["ball_velocity"] + carried
    hit = kd.strike(moving, v, ball, contact, law, **options)
    size = np.abs([*hit.ball_after.velocity, *hit.ball_before.velocity]).max()
    rounding = 1e-13 * max(size, 10 ** (3 - hit.digits + 13))
    assert hit.ball_after.velocity == pytest.approx(
        seen.ball_after.velocity + carried, abs=rounding
    )
    assert hit.impulse == pytest.approx(seen.impulse, abs=ball.mass * rounding)
    assert hit.foot_velocity == pytest.approx(posture.point_velocity(v) + carried, abs=1e-12)
    assert hit.restitution_residual == pytest.approx(seen.restitution_residual, abs=1e-10)


def test_the_velocity_of_the_base_is_that_of_the_contact_point_as_it_moves():
    linear, angular, t = np.array([3.0, 0.5, -0.2]), np.array([0.3, -2.0, 1.0]), 1e-6
    posture = LEG.with_base_velocity(linear, angular).posture([0.7, 0.5, -0.3])
    ends = [pin.exp3(h * angular) @ posture.contact_point + h * linear for h in (-0.5 * t, 0.5 * t)]
    assert posture.point_velocity(np.zeros(3)) == pytest.approx((ends[1] - ends[0]) / t, abs=1e-9)
    wish = np.array([9.0, *posture.transport_velocity[1:2], 2.0])
    assert posture.point_velocity(posture.joint_velocity(wish)) == pytest.approx(wish, abs=1e-12)


def test_pinocchio_strikes_with_a_base_that_moves_too():
    posture = LEG.with_base_velocity((4, 0.3, -0.2), (0.3, -2, 1)).posture([0.7, 0.5, -0.3])
    kick = posture, [6.6, -14.5, 6.6], kd.Ball(), kd.Contact((2, 0.3, 1), 0.8)
    ours, other = (
        kd.strike(*kick, engine=engine, ball_velocity=(1, 2, 0.5), ball_spin=(3, 4, 5))
        for engine in ("closed-form", "pinocchio")
    )
    assert ours.ball_after.velocity == pytest.approx(other.ball_after.velocity, abs=1e-12)
    assert ours.joint_impulses == pytest.approx(other.joint_impulses, abs=1e-12)


def test_only_a_fixed_base_is_given_a_velocity():
    floating = floating_leg(np.random.default_rng(0))
    with pytest.raises(kd.InvalidInput, match="must have a fixed base and no supports"):
        floating.with_base_velocity((1, 0, 0))
    with pytest.raises(kd.InvalidInput, match=r"linear .*nan.* finite"):
        LEG.with_base_velocity((1, math.nan, 0))
    with pytest.raises(kd.InvalidInput, match=r"^speed of the base is 101.0: .* 100 \[m/s\]$"):
        LEG.with_base_velocity((101, 0, 0))
    with pytest.raises(kd.InvalidInput, match=r"^angular speed of the base is 200.0: .* \[rad"):
        LEG.with_base_velocity((1, 0, 0), (0, -200, 0))
    assert LEG.with_base_velocity((1, 0, 0)).with_base_velocity((0, 0, 0)).base_velocity is None
