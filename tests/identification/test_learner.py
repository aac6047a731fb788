"""Kick, observe, correct: simulated worlds with unknown drag, wind and launch speed."""

import numpy as np
import pytest

import kickdyn as kd
from kickdyn.aerodynamics.drag import constant
from kickdyn.identification.learner import PRIOR, Learner

BALL, MODEL = kd.Ball(), kd.Air(drag=constant(0.2), lift=None)


class World:
    """A world whose drag, wind and launch speed differ from the model, and whose kicks scatter."""

    def __init__(self, seed, scatter=0.03):
        rng = self.rng = np.random.default_rng(seed)
        wind = (*rng.normal(0, 2, 2), 0)
        self.air = kd.Air(drag=constant(0.2 * rng.uniform(0.7, 1.4)), lift=None, wind=wind)
        self.gain, self.scatter = rng.uniform(0.85, 1.15), scatter

    def landing(self, command, scatters=True):
        rotation = self.rng.normal(0.0, self.scatter, 3) if scatters else np.zeros(3)
        velocity = self.gain * command
        velocity = velocity * (1 + rotation[0]) + np.cross([0, *rotation[1:]], velocity)
        return kd.fly(kd.BallState(velocity=velocity), BALL, self.air)


@pytest.mark.parametrize(("distance", "time"), [(30.0, 1.5), (50.0, 2.0), (100.0, 3.0)])
def test_a_goal_is_met_to_the_scatter_in_few_kicks(distance, time):
    rounds = []
    for seed in range(6):
        world, learner = World(seed), Learner(kd.Goal(distance, time=time), BALL, MODEL)
        for count in range(10):  # noqa: B007 read after the loop
            expected = world.landing(learner.command, scatters=False).landing.position
            if np.hypot(expected[0] - distance, expected[1]) < 2 * 0.03 * 2**0.5 * distance:
                break
            path = world.landing(learner.command)
            learner.observe(path.landing.position, path.duration)
        rounds.append(count)
    assert np.median(rounds) <= 2
    assert max(rounds) <= 4


def test_without_scatter_the_model_becomes_the_world():
    world = World(3, scatter=0.0)
    learner = Learner(
        kd.Goal(40.0, time=1.8), BALL, MODEL, scatter=0.001, deviation=0.001, time_deviation=1e-4
    )
    assert not learner.is_done
    for _ in range(6):
        path = world.landing(learner.command)
        learner.observe(path.landing.position, path.duration)
    miss = world.landing(learner.command).landing.position[:2] - [40, 0]
    assert np.hypot(*miss) < 0.02
    assert learner.is_done
    assert all(learner.deviations[name] < PRIOR[name] for name in PRIOR)
    assert "done" in str(learner)


def test_a_landing_alone_is_enough():
    world, learner = World(4), Learner(kd.Goal(30.0, time=1.5), BALL, MODEL)
    learner.observe(world.landing(learner.command).landing.position[:2])
    assert learner.shots[0].time is None
    assert learner.deviations["speed"] < PRIOR["speed"]


@pytest.mark.parametrize(
    ("arguments", "options", "message"),
    [
        ((None, BALL), {}, "kickdyn.Goal"),
        ((kd.Goal(30, time=1.5), None), {}, "kickdyn.Ball"),
        ((kd.Goal(30, time=1.5), BALL, kd.Air(drag=None)), {}, "no drag"),
        ((kd.Goal((30, 0, 1), time=1.5), BALL), {}, "1 m above the launch"),
        ((kd.Goal(30, time=1.5), BALL), {"prior": {"rain": 1}}, "rain"),
        ((kd.Goal(30, time=1.5), BALL), {"scatter": -1}, "scatter is -1"),
    ],
)
def test_wrong_arguments_are_refused(arguments, options, message):
    with pytest.raises(kd.InvalidInput, match=message):
        Learner(*arguments, **options)


def test_wrong_observations_are_refused():
    learner = Learner(kd.Goal(30, time=1.5), BALL, MODEL)
    with pytest.raises(kd.InvalidInput, match="landing has shape"):
        learner.observe([1.0])
    with pytest.raises(kd.InvalidInput, match="time is 0"):
        learner.observe([1.0, 2.0], 0.0)
    assert learner.shots == ()
