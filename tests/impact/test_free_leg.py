"""A leg that something else holds is noticed, whatever holds it."""

import numpy as np
import pytest
from chains import random_leg

import kickdyn as kd
from kickdyn.impact.free_leg import check_free

Q, V = np.radians([5, 10, -5]), [0.1, -2.0, -1.0]
TOUCH = kd.Contact((2, 0.3, 1), 0.7)


@pytest.fixture
def held(monkeypatch):
    """A hip that stays where it is: the other joints answer alone."""

    def solve(self, push):
        answer = np.zeros_like(push)
        answer[1:] = np.linalg.solve(self.inertia[1:, 1:], push[1:])
        return answer

    monkeypatch.setattr(kd.Posture, "solve", solve)


@pytest.mark.usefixtures("held")
def test_a_held_leg_is_refused():
    hit = kd.strike(kd.Leg.human(), Q, V, kd.Ball(), TOUCH)
    with pytest.raises(kd.InvalidInput, match="held by more than its joints: sensitivities are"):
        hit.sensitivity()
    with pytest.raises(kd.InvalidInput, match=r"held by more .*: a contact that takes time is for"):
        kd.collide(kd.Leg.human(), Q, V, kd.Ball(), TOUCH)


@pytest.mark.parametrize("seed", range(30))
def test_a_free_leg_passes(seed):
    rng = np.random.default_rng(seed)
    leg = random_leg(rng)
    check_free(leg.posture(rng.uniform(-2, 2, size=leg.nq)), "this is")
