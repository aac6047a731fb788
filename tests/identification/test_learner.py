"""Kick, observe, correct: simulated worlds with unknown drag, wind, restitution and aim."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.special import expit, logit
from scipy.stats import chi2
from tolerances import agrees, differenced, optimized, sampled

import kickdyn as kd
from kickdyn.aerodynamics.drag import constant
from kickdyn.identification.learner import LEARNT_SHARE, PRIOR

BALL, MODEL = kd.Ball(), kd.Air(drag=constant(0.2), lift=None)
GOAL = kd.Goal(30.0, time=1.5)
E0 = 0.7
PRIOR_SIZES = np.array(list(PRIOR.values())) / (1, 1, 1, E0 * (1 - E0), 1, 1)
"""Standard deviations of the unknowns as the learner has them: ln s, wind, logit e, angles."""


def path_of(command, theta, error=(0.0, 0.0, 0.0)):
    """Return the flight of a command in a world with the unknowns `theta`, shape `(6,)`."""
    air = kd.Air(drag=constant(0.2 * math.exp(theta[0])), lift=None, wind=(*theta[1:3], 0.0))
    restitution, gain = float(expit(theta[3])), 1.0
    if isinstance(command, kd.KickPlan):
        contact = replace(command.impact.contact, restitution=restitution)
        state = kd.strike(command.impact.posture, command.v, BALL, contact).ball_after
    else:
        state, gain = command, (1.0 + restitution) / (1.0 + E0)
    up = state.elevation + theta[4] + error[1]
    left = math.atan2(*state.velocity[1::-1]) + theta[5] + error[2]
    ahead = np.array([math.cos(up) * math.cos(left), math.cos(up) * math.sin(left), math.sin(up)])
    velocity = state.speed * gain * math.exp(error[0]) * ahead
    return kd.fly(kd.BallState(velocity=velocity), BALL, air, tol=1e-10)


def landing(command, theta, error=(0.0, 0.0, 0.0)):
    """Return where and when a command comes down, `(3,)` [m, m, s]."""
    path = path_of(command, theta, error)
    return np.array([*path.landing.position[:2], path.duration])


def slopes(command, theta):
    """Return derivatives of a landing by the unknowns and by the errors of a kick, `(3, 9)`."""
    values = np.concatenate([theta, np.zeros(3)])

    def at(change):
        return landing(command, (values + change)[:6], change[6:])

    return np.array([(at(step) - at(-step)) / 2e-4 for step in 1e-4 * np.eye(9)]).T


def world(seed):
    """Return unknowns that are drawn from the prior, and a generator of further numbers."""
    rng = np.random.default_rng(seed)
    return np.array([0, 0, 0, logit(E0), 0, 0]) + PRIOR_SIZES * rng.normal(size=6), rng


def learner_for(goal=GOAL, leg=None, **options):
    return kd.Learner(goal, BALL, MODEL, leg, **{"restitution": E0, **options})


def unknowns_of(learner):
    scale, wind_x, wind_y, e, *angles = learner.estimates.values()
    return np.array([math.log(scale), wind_x, wind_y, logit(e), *angles])


def sizes_of(learner):
    """Return standard deviations of the unknowns, from those of scale and restitution."""
    scale, e = learner.estimates["drag_scale"], learner.estimates["restitution"]
    return np.array(list(learner.deviations.values())) / (scale, 1, 1, e * (1 - e), 1, 1)


def test_before_the_first_kick_it_knows_the_prior():
    """The landing scatters by the errors of a kick, and is unknown by the unknowns."""
    learner = learner_for(scatter=0.02, deviation=0.5)
    theta = np.array([0, 0, 0, logit(E0), 0, 0])
    assert learner.deviations == pytest.approx(PRIOR)
    assert [*PRIOR.values()] == [0.3, 2.0, 2.0, 0.1, 0.05, 0.05]
    plain = kd.Learner(GOAL, BALL, MODEL)
    same = learner_for(restitution=0.8, scatter=0.03, deviation=0.05)
    agrees(plain.landing_scatter, same.landing_scatter, optimized(1e-7))
    assert unknowns_of(learner) == pytest.approx(theta)
    assert landing(learner.command, theta) == pytest.approx([30.0, 0.0, 1.5], abs=optimized())
    by = slopes(learner.command, theta)[:2]
    scatter = 0.02**2 * by[:, 6:] @ by[:, 6:].T + 0.5**2 * np.eye(2)
    agrees(learner.landing_scatter, scatter, 100 * differenced(1))
    uncertain = (by[:, :6] * PRIOR_SIZES**2) @ by[:, :6].T
    agrees(learner.landing_uncertainty, uncertain, 100 * differenced(1))
    assert not learner.is_done
    prior = {"wind_x": 0.5, "restitution": 0.05}
    assert learner_for(prior=prior).deviations == pytest.approx(PRIOR | prior)


@pytest.mark.parametrize("leg", [None, kd.Leg.human()], ids=["launch", "kick"])
@pytest.mark.parametrize("timed", [True, False], ids=["timed", "untimed"])
def test_after_a_kick_the_deviations_are_those_of_the_linear_estimate(leg, timed):
    """The posterior covariance with derivatives by differences, at the estimate."""
    truth, _ = world(3)
    goal = GOAL if leg is None else kd.Goal(20.0, time=1.3)
    learner = learner_for(goal, leg, scatter=1e-3, deviation=0.03, time_deviation=0.01)
    command = learner.command
    x, y, time = landing(command, truth)
    learner.observe([x, y], time if timed else None)
    rows = slice(0, 3 if timed else 2)
    by = slopes(command, unknowns_of(learner))[rows]
    noise = np.diag(np.square([0.03, 0.03, 0.01][rows])) + 1e-6 * by[:, 6:] @ by[:, 6:].T
    inverse = np.diag(PRIOR_SIZES**-2) + by[:, :6].T @ np.linalg.solve(noise, by[:, :6])
    right = np.linalg.inv(inverse)
    assert sizes_of(learner) == pytest.approx(np.sqrt(right.diagonal()), rel=0.02)
    # the most probable estimate: what is observed pulls as much as the prior
    missed = landing(command, unknowns_of(learner))[rows] - [x, y, time][rows]
    pull = by[:, :6].T @ np.linalg.solve(noise, missed)
    away = (unknowns_of(learner) - [0, 0, 0, logit(E0), 0, 0]) / PRIOR_SIZES
    assert PRIOR_SIZES * pull == pytest.approx(-away, abs=0.05 * np.abs(away).max())
    by = slopes(learner.command, unknowns_of(learner))[:2, :6]
    agrees(learner.landing_uncertainty, by @ right @ by.T, 0.05)


def test_a_track_tells_drag_and_wind():
    truth, rng = world(5)
    learner = learner_for(deviation=0.01)
    path = path_of(learner.command, truth)
    times = np.arange(0.1, path.duration - 0.1, 0.02)
    positions = path.sample(times).position
    learner.observe(kd.Track(times, positions + rng.normal(0.0, 0.01, positions.shape)))
    errors = (unknowns_of(learner) - truth) / sizes_of(learner)
    assert np.sqrt(np.mean(errors**2)) < 1.0 + sampled(12)
    assert (sizes_of(learner)[:3] < 0.3 * PRIOR_SIZES[:3]).all()
    for seen, time, words in (
        (kd.Track(times - 1.0, positions), None, r"begins at -0\.9 s"),
        (kd.Track(times, positions), 1.0, "times already"),
        ([30.0], None, r"shape \(1,\)"), ([30.0, 0.0], 0.0, "time is 0"),
    ):  # fmt: skip
        with pytest.raises(kd.InvalidInput, match=words):
            learner.observe(seen, time)
    assert len(learner.shots) == 1


def test_kicks_of_a_leg_are_learned():
    (truth, _), goal = world(2), kd.Goal(20.0, time=1.3)
    learner = learner_for(goal, kd.Leg.human(), scatter=0.003, deviation=0.005)
    misses = []
    for _ in range(3):
        seen = landing(learner.command, truth)
        misses.append(np.linalg.norm(seen[:2] - goal.target[:2]))
        assert (learner.command.status, learner.warnings) == ("met", ())
        assert learner.command.landing_error < optimized(1e-7)
        e = learner.command.impact.contact.restitution
        assert e == pytest.approx(learner.estimates["restitution"])
        # the path that is expected is the flight in the world that is known
        expected = landing(learner.command, unknowns_of(learner))
        assert expected[:2] == pytest.approx(goal.target[:2], abs=1e-3)
        learner.observe(seen[:2], seen[2])
    assert misses[-1] < 0.05 * misses[0]
    kick = learner_for(goal, kd.Leg.human(), friction=0.3, ball_height=-0.5).command.impact
    assert (kick.contact.friction, kick.ball_before.position[2]) == (0.3, pytest.approx(-0.5))


def test_learning_is_done_where_scatter_explains_the_miss():
    """To the 95 % quantile of chi-square, once the unknowns add a third of its variance at most."""
    (truth, _), learner = world(5), learner_for(scatter=0.01)
    for _ in range(4):
        seen = landing(learner.command, truth)
        learner.observe(seen[:2], seen[2])
    scatter, uncertainty = learner.landing_scatter, learner.landing_uncertainty
    assert np.trace(uncertainty) < LEARNT_SHARE * np.trace(scatter)
    ahead = np.array([0.8, 0.6])
    size = ahead @ np.linalg.solve(scatter + uncertainty, ahead)
    for share, done in ((0.99, True), (1.01, False)):
        miss = share * math.sqrt(chi2.ppf(0.95, 2) / size) * ahead
        learner._last_landing = GOAL.target[:2] + miss
        assert learner.is_done is done
    unsure = learner_for()
    unsure.observe([30.0, 0.0], 1.5)
    assert np.trace(unsure.landing_uncertainty) > LEARNT_SHARE * np.trace(unsure.landing_scatter)
    assert not unsure.is_done


def test_a_restitution_near_0_or_1_is_a_warning():
    warned = [e for e in (0.01, 0.03, 0.97, 0.99) if learner_for(restitution=e).warnings]
    assert warned == [0.01, 0.99]


@pytest.mark.parametrize(("options", "words"), [
    ({"goal": kd.Goal((30.0, 0.0, 1.0), time=1.5)}, "goal is 1 m above"),
    ({"air": kd.Air(drag=None)}, "no drag"), ({"air": kd.Air(wind=lambda z: (0, 0, 0))}, "height"),
    ({"goal": kd.Goal(30.0, time=1.5, receiver_velocity=(1, 0, 0))}, "receiver velocity is .1"),
    ({"prior": {"mass": 0.1}}, "has .'mass'"), ({"prior": {"wind_x": 0.0}}, "prior wind_x is"),
    ({"restitution": 0.0}, "restitution is 0"), ({"motion": True}, "without a leg")])  # fmt: skip
def test_what_cannot_be_learned_is_refused(options, words):
    with pytest.raises(kd.InvalidInput, match=words):
        kd.Learner(**{"goal": GOAL, "ball": BALL, "air": MODEL, **options})
