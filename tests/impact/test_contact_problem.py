"""The axes of a contact."""

import numpy as np
import pytest
from tolerances import agrees, closed_form

from kickdyn.impact.contact_problem import tangents


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
