"""The paper's law against its own equations."""

import dataclasses
import math

import numpy as np
import pytest
from contacts import by_paper, planar_attack, split

from kickdyn.impact.laws import limit_friction


def test_the_papers_stick_transmits_all_and_spins_by_its_offset():
    problem = planar_attack(friction=0.4, offset=0.2)  # tan(0.2) < 0.4
    impulse, sticking, _, _ = by_paper(problem)
    ball = problem.ball
    assert sticking
    expected = 1.8 * 14 / (1 / 5 + 1 / ball.mass)  # Eq. (10) along the attack
    assert impulse == pytest.approx([expected, 0, 0], rel=1e-14, abs=1e-14)
    spin = np.cross(-ball.radius * problem.normal, impulse) / ball.inertia
    launch = expected / ball.mass
    assert spin[1] == pytest.approx(-1.5 * launch / ball.radius * math.sin(0.2), rel=1e-14)


@pytest.mark.parametrize("friction", [0.0, 0.5])
def test_a_force_on_the_edge_of_the_friction_cone_sticks(friction):
    force = np.array([2.0 * friction, 0.0, 2.0])
    impulse, tangential, sticking = limit_friction(force, np.array([0.0, 0.0, 1.0]), friction)
    assert sticking
    assert impulse.tolist() == force.tolist()
    assert tangential.tolist() == [2.0 * friction, 0.0, 0.0]


def test_the_papers_slip_transmits_mu_times_the_normal_part():
    problem = planar_attack(friction=0.1, offset=0.2)
    impulse, sticking, _, _ = by_paper(problem)
    normal, friction = split(problem, impulse)
    full = 1.8 * 14 / (1 / 5 + 1 / problem.ball.mass)
    assert not sticking
    assert normal == pytest.approx(full * math.cos(0.2), rel=1e-14)
    assert np.linalg.norm(friction) == pytest.approx(0.1 * normal, rel=1e-14)
    # Eqs. (15)-(17): in the plane of F and N, towards F
    assert friction / np.linalg.norm(friction) == pytest.approx(
        [math.sin(0.2), 0, -math.cos(0.2)], abs=1e-14
    )


def test_the_mass_is_that_along_the_attack():
    problem = planar_attack(friction=0.4, offset=0.2)
    problem = dataclasses.replace(problem, delassus_factor=np.diag([1 / np.sqrt(5), 0.0, 3.0]))
    expected = 1.8 * 14 / (1 / 5 + 1 / problem.ball.mass)
    assert by_paper(problem).impulse == pytest.approx([expected, 0, 0], rel=1e-14, abs=1e-13)
