"""Every posture of a sweep is a strike and a flight by the slowest joints that kick as asked."""

import itertools
import math
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from chains import constraint_speed, fourbar, random_leg
from tolerances import EPSILON, agrees, closed_form, integrated, optimized

import kickdyn as kd
from kickdyn.sweeps.dataset import VARIABLES
from kickdyn.sweeps.kernel import KernelModel
from kickdyn.sweeps.queries import outcome_at
from kickdyn.sweeps.sweep_kick import Kick, PostureStatus, kick_from, speed_use
from kickdyn.sweeps.sweep_kick import slowest_joint_velocity as slowest

LEG = kd.Leg.human()
KICK = kd.Kick(attack=0.0)
POSTURES = {"hip": [0.0, 0.7, 1.4], "knee": [0.0, 0.3], "ankle": [0.0, 0.8]}


def test_variables_are_those_of_strike_and_fly():
    cell = kd.sweep(LEG, POSTURES, KICK).isel(hip=1, knee=1, ankle=0)
    posture, n = LEG.posture([0.7, 0.3, 0.0]), np.array([1.0, 0.0, 0.0])
    hit = kd.strike(posture, posture.joint_velocity(n), kd.Ball(), kd.Contact(n, 0.8, 0.4))
    v = hit.ball_after.velocity
    mass, speed = posture.effective_mass(n), np.linalg.norm(v)
    right = {  # (1 + e) m v, and the ratio to a foot at 1 m/s
        "effective_mass": mass, "impulse": np.linalg.norm(hit.impulse),
        "immovable_impulse": 1.8 * mass, "ball_speed": speed, "speed_ratio": speed,
        "launch_angle": math.asin(v[2] / speed), "back_spin": -hit.ball_after.spin[1],
        "worst_joint_impulse": np.linalg.norm(hit.joint_impulses[:, :3], axis=1).max(),
        "energy_lost": hit.energy_lost,
    }  # fmt: skip
    row = {name: float(cell[name]) for name in right}
    assert row == pytest.approx(right, rel=closed_form(100), abs=closed_form())
    carry = kd.fly(hit.ball_after, kd.Ball(), kd.Air(), tol=1e-12).range
    assert float(cell.carry) == pytest.approx(carry, rel=integrated(1e-11, 1000))
    down = kd.sweep(LEG, {"knee": 0.2}, kd.Kick(attack=math.radians(-40)))
    assert float(down.carry[0]) == 0.0


@pytest.mark.parametrize("samples", [None, "list"])
def test_the_kernel_agrees_with_single_kicks(samples, monkeypatch):
    kick = kd.Kick(attack=0.0, speed=9.0)
    postures = {"hip": np.linspace(-0.3, 1.7, 5), "knee": np.linspace(0, 2.2, 5),
                "ankle": np.linspace(-0.3, 0.8, 5)}  # fmt: skip
    with monkeypatch.context() as patch:
        patch.setattr(KernelModel, "of", lambda *_: None)
        single = kd.sweep(LEG, postures, kick, samples=samples)
    compiled = kd.sweep(LEG, postures, kick, samples=samples, tolerance=0, threads=2)
    assert samples or set(np.unique(single.status)) == {0, 1}
    for name in {*VARIABLES, "status"} - {"restitution_residual", "momentum_residual"}:
        rough = integrated(1e-11, 1000) if name == "carry" else closed_form(100)
        close = {"rel": rough, "abs": closed_form(10)}
        assert compiled[name].values == pytest.approx(single[name].values, **close), name


def test_variables_are_nan_only_out_of_reach():
    model = LEG.model
    model.upperPositionLimit = np.array([2.0, 2.0, 2.0])
    leg = kd.Leg.from_model(model, "toe")
    postures = {"hip": math.pi / 2, "knee": 0.0, "ankle": [1.4, math.pi / 2]}
    data = kd.sweep(leg, postures, kd.Kick(attack=0, speed=0.1))
    assert data.status.values.ravel().tolist() == [0, 2]
    for name in VARIABLES:
        assert np.isnan(data[name].values.ravel()).tolist() == [False, True], name


@pytest.mark.parametrize(("change", "word"), [
    ({"leg": "human"}, r"leg is 'human'.*kickdyn\.Leg"), ({"tolerance": -1.0}, "tolerance is -1"),
    ({"threads": 2, "executor": ThreadPoolExecutor(1)}, "threads and executor"),
    ({"resume": True}, "store"), ({"executor": ThreadPoolExecutor(1)}, "store"),
    ({"postures": dict.fromkeys(("hip", "knee"), np.linspace(0, 1, 1001))}, "1,002,001.*store"),
    ({"variables": ["ball_sped"]}, "'ball_sped'.*'ball_speed'"),
    ({"variables": []}, r"variables is \[\]"),
], ids=lambda value: ", ".join(value) if isinstance(value, dict) else value)  # fmt: skip
def test_bad_arguments_are_refused_in_one_line(change, word):
    arguments = {"leg": LEG, "postures": {"hip": 0.1}, "kick": KICK, **change}
    with pytest.raises(kd.InvalidInput, match=word):
        kd.sweep(**arguments)


def test_loops_and_supports_hold_in_every_posture():
    robot = kd.Leg.from_robot("bolt", base="floating").with_supports("FL_FOOT")
    kick, closed = kd.Kick(air=None), 0
    for model, joints in ((fourbar(), {"rocker_a": [0.2, 0.41], "hip": [0.0, 0.5]}),
                          (robot, {"FR_KFE": [0.0, 0.6], "FR_HFE": [0.3]})):  # fmt: skip
        data = kd.sweep(model, joints, kick)
        for index in np.ndindex(*data.status.shape):
            cell = data.isel(dict(zip(joints, index, strict=True)))
            if cell.status == PostureStatus.NOT_CLOSED.flag:
                assert float(cell.rocker_a) == 0.41
                assert np.isnan([float(cell[name]) for name in VARIABLES]).all()
                continue
            closed += 1
            named = {name: float(cell[name]) for name in joints}
            posture = model.posture(model.close_loops(model.configuration(named), keep=named))
            impact = kick_from(posture, kick).impact
            assert float(cell.ball_speed) == pytest.approx(impact.ball_after.speed)
            assert constraint_speed(impact) <= closed_form(1e3)
            again = outcome_at(model, kick, cell).impact
            assert again.ball_after.speed == pytest.approx(impact.ball_after.speed)
    assert closed == 4


G1 = kd.Leg.from_robot("g1", base="fixed", legs_only=True)
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
