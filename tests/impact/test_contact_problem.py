"""The contact problem of a strike, and the axes of a contact."""

import numpy as np
import pytest
from chains import random_kick, random_leg
from tolerances import agrees, closed_form

import kickdyn as kd
from kickdyn.impact.contact_problem import tangents
from kickdyn.impact.laws import LAWS


@pytest.mark.parametrize("decade", range(14))
def test_tangents_and_normal_are_a_rotation_however_little_slides(decade):
    rng = np.random.default_rng(decade)
    for _ in range(10):
        normal, sliding = rng.normal(size=(2, 3))
        normal /= np.linalg.norm(normal)
        sliding -= normal * (sliding @ normal)
        velocity = normal + 10.0**-decade * sliding / np.linalg.norm(sliding)
        axes = np.column_stack([*tangents(normal, rng.uniform(1e-3, 1e3) * velocity), normal])
        agrees(axes.T @ axes, np.eye(3), closed_form())
        assert np.linalg.det(axes) == pytest.approx(1.0)
        if decade < 12:  # less sliding counts as rounding
            assert axes[:, 0] @ velocity > 0.9 * 10.0**-decade


@pytest.mark.parametrize("law", LAWS)
def test_a_strike_solves_the_contact_problem_of_its_approach(law):
    """G = J M^-1 J^T + I / m + r^2 / I_b (I - n n^T), and the velocity of the surfaces."""
    rng = np.random.default_rng(5)
    (posture, v, ball, contact), options = random_kick(rng, random_leg(rng), friction=0.3)
    impact = kd.strike(posture, v, ball, contact, law, **options)
    problem, n = impact.approach.contact_problem(), contact.normal
    axes, velocity = problem.in_contact_axes()
    matrix = posture.jacobian @ np.linalg.solve(posture.inertia, posture.jacobian.T)
    across = np.eye(3) - np.outer(n, n)
    matrix += np.eye(3) / ball.mass + ball.radius**2 / ball.inertia * across
    near = closed_form(posture.condition)
    agrees(axes[0] @ problem.delassus(axes) @ axes[0].T, matrix, near)
    assert problem.inverse_mass(n) == pytest.approx(n @ matrix @ n, rel=near)
    surface = options["ball_velocity"] - ball.radius * np.cross(options["ball_spin"], n)
    agrees(axes[0] @ velocity, surface - posture.jacobian @ v, closed_form(10))
    solution = LAWS[law].solve(problem)
    assert solution.impulses[0].tolist() == impact.impulse.tolist()
