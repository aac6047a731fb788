import numpy as np
import pytest
from chains import random_leg

import kickdyn as kd
from kickdyn.flight.batch import fly_many
from kickdyn.sweeps import outcomes
from kickdyn.sweeps.carry import Carries, launches
from kickdyn.sweeps.grid import grid
from kickdyn.sweeps.kernel_scene import scene_of
from kickdyn.sweeps.kick import Kick
from kickdyn.sweeps.outcomes import Outcomes, interpolated

LEG = kd.Leg.human()


@pytest.mark.parametrize(
    ("speed", "attack", "friction", "error"),
    [(1.0, 30.0, 0.4, 1e-8), (12.0, 30.0, 0.4, 1e-6), (18.0, 10.0, 0.4, 1e-4),
     (9.0, 0.0, 0.2, 1e-6)],
)  # fmt: skip
def test_carries_are_within_their_error(speed, attack, friction, error):
    kick = Kick(speed=speed, attack=np.radians(attack), friction=friction)
    scene = scene_of(LEG, kick)
    carries = Carries(scene, kick, error)
    assert 0 < carries.worst <= error / 2
    draw, n = np.random.default_rng(3), 5000
    normal = 1.8 * speed * kick.ball.mass * draw.uniform(0, 1, n)
    tangent = friction * normal * draw.uniform(-1, 1, n)
    carry, unknown = np.full(n, np.nan), np.zeros(n, bool)
    carries(normal, tangent, carry, unknown)
    balls = launches(scene, kick, np.column_stack([tangent, np.zeros(n), normal]))
    flown = fly_many(balls, kick.ball, kick.air, tol=1e-11).range.values
    assert unknown.mean() < 0.01
    assert np.abs(carry - flown)[~unknown].max() <= error
    assert np.isnan(carry[unknown]).all()


def test_what_is_off_the_box_is_not_known():
    kick = Kick(speed=3.0)
    carries = Carries(scene_of(LEG, kick), kick, 1e-3)
    most = 1.8 * 3.0 * kick.ball.mass
    normal = np.array([most, 1.01 * most, 0.5 * most, 0.5 * most, 0.0, np.nan])
    tangent = np.array([0.0, 0.0, 0.39, 0.41, 0.0, 0.0]) * 0.5 * most
    carry, unknown = np.full(6, np.nan), np.zeros(6, bool)
    carries(normal, tangent, carry, unknown)
    assert unknown.tolist() == [False, True, False, True, True, True]


def test_a_sweep_reads_off_what_it_would_fly():
    kick = Kick(speed=14.0)
    postures = grid(LEG, ["hip=-10:80:10", "knee=0:130:10", "ankle=-20:50:10"])
    flown, _ = Outcomes(LEG, postures, kick)(0, postures.size)
    read, _ = Outcomes(LEG, postures, kick, 1e-5)(0, postures.size)
    off = np.abs(flown - read).max(axis=1)
    assert 0 < off[10] <= 1e-5
    assert not np.delete(off, 10).any()


def test_only_planar_flights_through_air_are_read_off():
    leg = random_leg(np.random.default_rng(0), joints=3)
    assert interpolated(scene_of(leg, Kick()), Kick(), 1e-6) == 0.0
    vacuum = Kick(air=None)
    assert interpolated(scene_of(LEG, vacuum), vacuum, 1e-6) == 0.0
    assert interpolated(scene_of(LEG, Kick()), Kick(), 1e-6) == 1e-6


def test_a_carry_that_disagrees_stops_the_sweep(monkeypatch):
    monkeypatch.setattr(outcomes.Carries, "__call__", _half)
    postures = grid(LEG, ["hip=0:10:5"])
    with pytest.raises(kd.KickdynError, match=r"posture 0: the sweep has carry .*a single kick"):
        Outcomes(LEG, postures, Kick(), 1e-6)(0, 3)


def _half(self, normal, tangent, carry, unknown):
    carry[:], unknown[:] = 0.1, False
