"""One kick is a strike and a flight by the slowest joints that move the foot as asked."""

import itertools
import math

import numpy as np
import pytest
from chains import random_leg
from tolerances import EPSILON, agrees, closed_form, integrated, optimized

import kickdyn as kd
from kickdyn.sweeps.sweep_kick import Kick, PostureStatus, kick_from, speed_use
from kickdyn.sweeps.sweep_kick import slowest_joint_velocity as slowest

LEG, G1 = kd.Leg.human(), kd.Leg.from_robot("g1", base="fixed", legs_only=True)
POSTURE = LEG.posture(np.radians([40, 30, -20]))


def limited(leg, limits):
    model = leg.model
    model.velocityLimit = np.asarray(limits, float)
    return kd.Leg.from_model(model, leg.frame)


def dual_maximum(posture, wish):
    """The least speed use by the dual of its linear programme, all vertices tried."""
    limit = posture.leg.velocity_limit
    columns = posture.jacobian[:, limit > 0]
    y = np.array([np.cross(a, b) for a, b in itertools.combinations(columns.T, 2)])
    along = np.abs(y @ columns)
    along[along < closed_form(10) * np.linalg.norm(y, axis=1)[:, None]] = 0.0
    with np.errstate(invalid="ignore"):
        capacity = np.nansum(along * limit[limit > 0], axis=1)
    return (np.abs(y @ wish) / capacity).max()


@pytest.mark.parametrize("law", ["newton", "stronge", "paper"])
def test_a_kick_is_strike_and_fly(law):
    up = math.radians(20)
    n = np.array([math.cos(up), 0, math.sin(up)])
    kick = Kick(speed=2.0, attack=up, restitution=0.7, friction=0.1, law=law)
    v, contact = POSTURE.joint_velocity(2 * n), kd.Contact(n, 0.7, 0.1)
    impact = kd.strike(POSTURE, v, kd.Ball(), contact, law)
    outcome = kick_from(POSTURE, kick)
    assert (outcome.status, outcome.impact.law) == ("ok", law)
    agrees(outcome.impact.v_before, v, closed_form(10))  # of least energy, within the limits
    assert outcome.impact.impulse == pytest.approx(impact.impulse, rel=closed_form(10), abs=EPSILON)
    path = kd.fly(impact.ball_after, kd.Ball(), kd.Air(), tol=1e-12)
    assert outcome.carry == pytest.approx(path.range, rel=integrated(1e-11, 1000))
    assert outcome.speed_use == pytest.approx(dual_planar(POSTURE, 2 * n), rel=closed_form(1e3))


def dual_planar(posture, wish):
    """The least speed use in the x-z plane by the dual of its linear programme."""
    columns = posture.jacobian[[0, 2]]
    y = np.array([[-b, a] for a, b in columns.T])
    return (np.abs(y @ wish[[0, 2]]) / (np.abs(y @ columns) @ posture.leg.velocity_limit)).max()


@pytest.mark.parametrize("special", [None, 0.0, np.inf, 1e-2, 1e9, 1e20], ids=str)
@pytest.mark.parametrize("joints", [3, 4, 6, 8])
def test_no_joint_velocity_has_less_speed_use(joints, special):
    rng = np.random.default_rng(joints)
    for _ in range(3):
        limits = rng.uniform(0.5, 20.0, joints)
        if special is not None and joints > 4:
            limits[rng.integers(joints)] = special
        leg = limited(random_leg(rng, joints), limits)
        posture, wish = leg.posture(rng.uniform(-2, 2, joints)), rng.normal(size=3)
        v = slowest(posture, wish)
        agrees(posture.point_velocity(v), wish, closed_form(10) * max(1.0, np.abs(v).max()))
        least = pytest.approx(dual_maximum(posture, wish), rel=optimized(1e-9))
        assert speed_use(posture, v) == least


@pytest.mark.parametrize("scale", [1e-200, 1e-3, 1.0, 3.0])
def test_the_slowest_joint_velocity_is_proportional_to_the_foots(scale):
    wish = np.array([8.0, 0.0, 5.0])
    v = slowest(POSTURE, wish)
    agrees(slowest(POSTURE, scale * wish) / scale, v, optimized(1e-9))


def test_the_foot_moves_exactly_where_a_linear_programme_is_not_exact():
    """HiGHS ignores levers below 1e-9, and 1e-8 of motion by a joint that may not move."""
    wish = np.array([0.8, 0.1, -0.5])
    for posture in (G1.posture(np.full(G1.nq, 1e-9)), G1.posture(np.full(G1.nq, 3e-8))):
        v = slowest(posture, wish)
        agrees(posture.point_velocity(v), wish, closed_form())
        assert speed_use(posture, v) < 0.9 * speed_use(posture, posture.joint_velocity(wish))
    posture = limited(LEG, [0, 0, 10]).posture(np.radians([40, 30, -20]))
    by_ankle = posture.jacobian[:, 2]
    wish = by_ankle + 1e-8 * np.cross(by_ankle, [0, 1, 0])
    v = slowest(posture, wish)
    agrees(posture.point_velocity(v), wish, closed_form())
    assert speed_use(posture, v) == math.inf


@pytest.mark.parametrize(("limits", "use"), [
    ([0, 10, 0], math.inf), ([0, 0, 0], math.inf), (3 * [math.inf], 0.0), ([0, 10, 10], None),
])  # fmt: skip
def test_joints_without_limit_and_joints_that_may_not_move(limits, use):
    outcome = kick_from(limited(LEG, limits).posture(np.radians([5, 10, -5])), Kick())
    assert outcome.status == ("too-fast" if use == math.inf else "ok")
    assert outcome.speed_use == use or (use is None and 0 < outcome.speed_use < 1)


def test_statuses_follow_from_reach_and_speed():
    kick = Kick(speed=10.0)  # the velocity of least energy would exceed a limit
    least_energy = POSTURE.joint_velocity(kick.speed * kick.direction)
    outcome = kick_from(POSTURE, kick)
    assert speed_use(POSTURE, outcome.impact.v_before) <= 1 < speed_use(POSTURE, least_energy)
    right = kd.strike(POSTURE, least_energy, kick.ball, kick.contact).impulse
    assert outcome.impact.impulse == pytest.approx(right, rel=closed_form(1e3))
    fast = kick_from(POSTURE, Kick(speed=50.0))
    assert (fast.status, fast.impact is None) == ("too-fast", False)
    stretched = kick_from(LEG.posture(np.radians([90, 0, 90])), Kick(attack=0.0))
    assert (stretched.status, stretched.impact) == ("out-of-reach", None)
    assert math.isnan(stretched.carry)
    assert [status.flag for status in PostureStatus] == [0, 1, 2, 3, -1]


@pytest.mark.parametrize("restitution", [[[5.0, 0.8], [15.0, 0.6]], "inflated"], ids=str)
def test_restitution_is_that_at_the_speed_of_the_foot(restitution):
    kick = Kick(speed=10.0, restitution=restitution, ball=kd.Ball(pressure=70e3))
    table = kd.sweep(LEG, {"hip": [0.1, 0.35], "knee": 0.5, "ankle": 0.17}, kick)
    if restitution != "inflated":
        assert kick.restitution_used == pytest.approx(0.7)
    for hip, impulse in zip((0.1, 0.35), table.impulse.values.ravel(), strict=True):
        posture = LEG.posture([hip, 0.5, 0.17])
        v = posture.joint_velocity(10 * kick.direction)
        right = kd.strike(posture, v, kick.ball, kick.contact).impulse
        assert impulse == pytest.approx(math.hypot(*right), rel=closed_form(1e3))
    assert isinstance(table.attrs["restitution_given"], str)  # netCDF takes no list of lists


def test_a_sweep_with_a_base_that_moves_is_one_in_another_frame():
    """Seen from the base, which is at rest there, the ball comes with the opposite velocity."""
    base, kick, ball = np.array([3.0, 0.0, 0.5]), Kick(speed=9.0, air=None), kd.Ball()
    grid = {"hip": [0.1, 0.5], "knee": [0.4, 1.1]}
    table = kd.sweep(LEG.with_base_velocity(base), grid, kick)
    for i, j in np.ndindex(2, 2):
        posture = LEG.posture([grid["hip"][i], grid["knee"][j], 0.0])
        v = slowest(posture, 9.0 * kick.direction - base)
        hit = kd.strike(posture, v, ball, kick.contact, ball_velocity=-base)
        right = {
            "ball_speed": np.linalg.norm(hit.ball_after.velocity + base),
            "impulse": np.linalg.norm(hit.impulse),
            "worst_joint_impulse": hit.worst_joint[1],
            "speed_use": speed_use(posture, v),
        }
        row = {name: float(table[name][i, j]) for name in right}
        assert row == pytest.approx(right, rel=optimized(1e-9))
