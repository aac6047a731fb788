"""Swings of three legs: what the torques do, integrated by others, is what the swing says."""

from dataclasses import replace
from functools import cache
from itertools import pairwise

import numpy as np
import pinocchio as pin
import pytest
from scipy.integrate import simpson, solve_ivp

import kickdyn as kd

BALL, AIR = kd.Ball(), kd.Air(drag="brazuca")
HUMAN = kd.Leg.human()
LEGS = {
    "human": (HUMAN, kd.Goal(20, time=1.2)),
    "testbed": (kd.Leg.testbed(), kd.Goal(1.5, time=0.6)),
    "g1": (
        kd.Leg.from_robot("g1").locked(
            {f"right_{name}_joint": 0.0 for name in ("hip_yaw", "ankle_pitch", "ankle_roll")}
        ),
        kd.Goal((3, 0.5, 0), time=0.7),
    ),
}


@cache
def planned(name):
    leg, goal = LEGS[name]
    return kd.plan_kick(leg, goal, BALL, AIR, swing=True)


@cache
def swung(name):
    return kd.plan_swing(LEGS[name][0], planned(name))


@pytest.mark.parametrize("name", LEGS)
def test_a_swing_is_what_it_says(name):
    assert planned(name).status == "met"
    assert planned(name).landing_error < 1e-6
    swing = swung(name)
    check_rest_impact_rest(swing)
    check_limits_between_the_nodes(swing)
    check_forward_dynamics(swing)
    check_energy(swing)


def parts(swing):
    return swing.backswing, swing.follow_through


def check_rest_impact_rest(swing):
    assert swing.status == "met"
    assert (swing.share, swing.limit) == (1.0, "")
    at, hit = swing.chain, swing.plan.impact
    before, after = swing.backswing.fine, swing.follow_through.fine
    for here, v in ((before.q[-1], hit.v_before), (after.q[0], hit.v_after)):
        assert here == pytest.approx(swing.plan.q[at.qs], abs=1e-9)
        moving = before.v[-1] if v is hit.v_before else after.v[0]
        assert moving == pytest.approx(v[at.vs], abs=1e-9)
    assert swing.impact_error < 1e-9
    assert np.abs(before.v[0]).max() < 1e-9
    assert np.abs(after.v[-1]).max() < 1e-9
    assert before.time[-1] == after.time[0] == 0


def check_limits_between_the_nodes(swing):
    chain = swing.chain
    for part in parts(swing):
        for t in np.split(np.linspace(part.nodes[0], part.nodes[-1], 600), 3):
            way = part.sample(t)
            assert (way.q >= chain.lower).all()
            assert (way.q <= chain.upper).all()
            assert (np.abs(way.v) <= chain.velocity_limit).all()
            assert (np.abs(way.torque) <= chain.effort_limit * (1 + 1e-6)).all()
    fine = [part.fine for part in parts(swing)]
    torques, speeds = (np.vstack([getattr(m, name) for m in fine]) for name in ("torque", "v"))
    assert swing.torque_use == np.abs(torques / chain.effort_limit).max() <= 1
    assert swing.speed_use == np.abs(speeds / chain.velocity_limit).max() <= 1
    gaps = [np.minimum(m.q - chain.lower, chain.upper - m.q).min() for m in fine]
    assert swing.range_left == min(gaps) >= 0
    assert swing.defect < 1e-12


def check_forward_dynamics(swing):
    """Forward dynamics under the torques, by an integrator that knows nothing of the swing."""
    for part in parts(swing):
        model, data = part.chain.model, part.chain.model.createData()
        n, nodes = model.nv, part.nodes
        state = np.concatenate([part.sample(nodes[0]).q[0], part.sample(nodes[0]).v[0]])

        def slope(t, x, part=part, model=model, data=data, n=n, nodes=nodes):
            torque = part.sample(np.clip(t, nodes[0], nodes[-1])).torque[0]
            return np.concatenate([x[n:], pin.aba(model, data, x[:n], x[n:], torque)])

        for first, last in pairwise(nodes):  # smooth in between
            state = solve_ivp(slope, (first, last), state, rtol=1e-9, atol=1e-10).y[:, -1]
        end = part.sample(nodes[-1])
        assert state[:n] == pytest.approx(end.q[0], abs=1e-5)
        assert state[n:] == pytest.approx(end.v[0], abs=1e-4)


def check_energy(swing):
    for part in parts(swing):
        model, data = part.chain.model, part.chain.model.createData()
        way = part.fine
        work = float(simpson(way.power.sum(axis=1), x=way.time))
        ends = [
            pin.computeKineticEnergy(model, data, way.q[i], way.v[i])
            + pin.computePotentialEnergy(model, data, way.q[i])
            for i in (0, -1)
        ]
        size = max(1.0, *map(abs, ends))
        assert work == pytest.approx(ends[1] - ends[0], abs=1e-5 * size)


def test_the_whole_leg_moves_with_it_and_rests_outside():
    swing = swung("human")
    assert swing.configuration(0.0) == pytest.approx(swing.plan.q, abs=1e-12)
    first = -swing.backswing.duration
    assert swing.configuration(first - 1).tolist() == swing.configuration(first).tolist()
    way = swing.sample([first, 0.0, swing.follow_through.duration])
    assert way.v[1] == pytest.approx(swing.plan.v, abs=1e-9)
    with pytest.raises(kd.InvalidInput, match="times that rise"):
        swing.sample([0.0, -0.01])
    with pytest.raises(kd.InvalidInput, match="this phase lasts from 0 to"):
        swing.sample([9.0])
    again = kd.plan_swing(HUMAN, swing.plan)
    assert again.sample(way.time).torque.tolist() == way.torque.tolist()


@pytest.fixture(scope="module")
def plan():
    return planned("human")


def test_the_quickest_is_quicker_and_the_least_torque_is_less(plan):
    quick, easy = kd.plan_swing(HUMAN, plan, objective="time"), swung("human")
    assert quick.backswing.duration < easy.backswing.duration
    assert quick.follow_through.duration < easy.follow_through.duration
    assert quick.value == pytest.approx(quick.backswing.duration + quick.follow_through.duration)
    effort = []
    for one in (quick, easy):
        used = [(part.fine.torque / HUMAN.effort_limit) ** 2 for part in parts(one)]
        times = [part.fine.time for part in parts(one)]
        effort.append(sum(simpson(u.mean(axis=1), x=t) for u, t in zip(used, times, strict=True)))
    assert effort[1] < effort[0]
    assert easy.value == pytest.approx(effort[1], rel=1e-2)


def test_start_and_end_are_as_asked(plan):
    start, end = HUMAN.configuration({"knee": 0.6}), HUMAN.configuration({"hip": 0.7, "knee": 0.5})
    swing = kd.plan_swing(HUMAN, plan, start=start, end=end, nodes=12)
    assert swing.backswing.fine.q[0] == pytest.approx(start, abs=1e-9)
    assert swing.follow_through.fine.q[-1] == pytest.approx(end, abs=1e-9)


def weaker(hip, knee=210.0):
    model = HUMAN.model
    model.effortLimit = np.array([hip, knee, 122.0])
    model.upperPositionLimit = np.full(3, 3.0)
    return kd.Leg.from_model(model, "toe")


def test_too_weak_a_leg_gets_the_most_of_it_and_the_joint_at_fault(plan):
    swing = kd.plan_swing(weaker(60.0), plan, longest=0.2, nodes=12)
    assert swing.status == "beyond-limits"
    assert 0.3 < swing.share < 0.6
    assert swing.limit.startswith("backswing: the torque limit of hip leaves 0.")
    assert swing.torque_use <= 1
    assert swing.backswing.sample(0.0).v[0] == pytest.approx(swing.share * plan.v, abs=1e-9)
    after = swing.follow_through.sample(0.0).v[0]
    assert after == pytest.approx(swing.share * plan.impact.v_after, abs=1e-9)
    hit = kd.strike(HUMAN.posture(plan.q), swing.share * plan.v, BALL, plan.impact_target.contact)
    assert hit.v_after == pytest.approx(after, abs=1e-9)  # a strike scales
    assert swing.impact_error < 1e-9
    most = np.abs([plan.v, plan.impact.v_after]).max()
    assert replace(swing, share=swing.share - 0.1).impact_error == pytest.approx(0.1 * most)
    for stronger in (weaker(66.0), weaker(60.0, knee=231.0)):
        other = kd.plan_swing(stronger, plan, longest=0.2, nodes=12)
        assert (other.share > 1.02 * swing.share) == (stronger.effort_limit[0] == 66.0)


def test_a_share_of_a_kick_is_refused_where_the_restitution_would_be_another(plan):
    e = plan.impact.restitution  # as planned, and less at a lower speed
    contact = kd.Contact(plan.impact.contact.normal, [[5, 0.5 * e], [10, e]], 0.4)
    impact = kd.strike(plan.impact.posture, plan.v, BALL, contact)
    assert impact.restitution == e
    with pytest.raises(kd.InvalidInput, match=r"planned speed, at which the restitution is 0\."):
        kd.plan_swing(weaker(60.0), replace(plan, impact=impact), longest=0.2, nodes=12)


def test_a_kick_at_a_joints_stop_has_no_swing_and_the_way_out_costs_little():
    goal = kd.Goal(15, time=1)
    stuck = kd.plan_kick(HUMAN, goal, BALL, AIR)
    with pytest.raises(
        kd.InvalidInput, match=r"knee is at the end of its range .* moves on at 4.7"
    ):
        kd.plan_swing(HUMAN, stuck)
    free = kd.plan_kick(HUMAN, goal, BALL, AIR, swing=True)
    assert "swing" not in free.binding
    assert stuck.value < free.value < 1.01 * stuck.value
    assert kd.plan_swing(HUMAN, free, nodes=12).status == "met"


def test_what_cannot_be_swung_is_kicked_as_hard_as_can_be():
    goal = kd.Goal(30, time=1.5)
    assert kd.plan_kick(HUMAN, goal, BALL, AIR).status == "met"
    plan = kd.plan_kick(HUMAN, goal, BALL, AIR, swing=True)
    assert plan.status == "beyond-limits"
    assert plan.share == pytest.approx(0.9548, abs=2e-3)
    assert plan.binding[0] == "swing"
    assert kd.plan_swing(HUMAN, plan).status == "met"


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"objective": "beauty"}, "'beauty': it must be one of torque-squared, time"),
        ({"longest": 0}, "longest is 0"),
        ({"longest": float("nan")}, "longest is nan"),
        ({"nodes": 3}, "nodes is 3: it must be a whole number from 4 to 200"),
        ({"nodes": 12.0}, "nodes is 12.0"),
        ({"start": [0, 0]}, r"start: q has shape \(2,\)"),
        ({"start": [0, -1, 0]}, "start has knee at -1: it must be in 0 to 2.44"),
        ({"end": [0, float("nan"), 0]}, "every entry must be finite"),
        ({"leg": kd.Leg.from_robot("bolt")}, "the plan is for Leg"),
        ({"plan": None}, "plan is None: it must be a kickdyn.KickPlan"),
    ],
)
def test_bad_input(plan, options, words):
    given = {"leg": HUMAN, "plan": plan, **options}
    with pytest.raises(kd.InvalidInput, match=words):
        kd.plan_swing(given.pop("leg"), given.pop("plan"), **given)


def test_a_joint_that_the_impact_moves_but_that_does_not_swing_must_be_locked(plan):
    thigh = kd.Leg.from_model(HUMAN.model, "shank")
    hit = kd.strike(thigh.posture(plan.q), plan.v, BALL, plan.impact_target.contact)
    with pytest.raises(kd.InvalidInput, match="the impact moves ankle"):
        kd.plan_swing(thigh, replace(plan, impact=hit))


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"objective": "joint-impulse"}, r"with swing=True \(--swing\) it must be joint-speed or"),
        ({"limits": False}, "a swing is planned within limits"),
    ],
)
def test_kicks_with_a_swing_refuse(options, words):
    with pytest.raises(kd.InvalidInput, match=words):
        kd.plan_kick(HUMAN, kd.Goal(15, time=1), BALL, AIR, swing=True, **options)


@pytest.mark.parametrize(
    ("leg", "goal"),
    [
        (HUMAN, kd.Goal(15, time=1)),
        (HUMAN, kd.Goal(25.125, time=2.208)),
        (kd.Leg.testbed(), kd.Goal(1.2, time=0.5)),
        (kd.Leg.testbed(), kd.Goal(1.58, time=0.56)),
    ],
)
def test_the_way_that_a_plan_promises_keeps_its_limits_and_is_found(leg, goal):
    plan = kd.plan_kick(leg, goal, BALL, AIR, swing=True, objective="kinetic-energy")
    assert plan.status == "met"
    for part, v in zip(plan.phases, (plan.v, plan.impact.v_after), strict=True):
        way, chain = part.sample(part.sign * np.linspace(0, part.duration, 1500)), part.chain
        assert (np.abs(way.torque) <= chain.effort_limit).all()
        assert (np.abs(way.v) <= chain.velocity_limit).all()
        assert (way.q >= chain.lower).all()
        assert (way.q <= chain.upper).all()
        assert way.q[0] == pytest.approx(plan.q[chain.qs], abs=1e-9)
        assert way.v[0] == pytest.approx(v[chain.vs], abs=1e-9)
        assert np.abs(way.v[-1]).max() < 1e-9
    assert kd.plan_swing(leg, plan).status == "met"
    other = kd.plan_swing(leg, plan, nodes=36)
    assert other.status == "met"
    assert other.torque_use <= 1


def test_a_plan_without_a_swing_promises_none():
    assert kd.plan_kick(HUMAN, kd.Goal(15, time=1), BALL, AIR).phases is None


def test_the_way_a_plan_carries_is_the_answer_where_the_solver_finds_none():
    leg = kd.Leg.testbed()
    goal = kd.Goal(1.7027424644632017, time=0.3004798734347314)
    plan = kd.plan_kick(
        leg, goal, kd.Ball(), kd.Air(drag="brazuca"), swing=True, objective="kinetic-energy"
    )
    swing = kd.plan_swing(leg, plan)
    assert swing.status == "met"
    assert swing.torque_use <= 1.0
