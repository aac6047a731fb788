"""Torque over speed: the hyperbola of Hill."""

import numpy as np
import pytest
from tolerances import differenced

from kickdyn.robot.muscle_torque import muscle_share, muscle_share_slope

HILL = 0.25
"""a / F_0 of Hill 1938, Proc. R. Soc. Lond. B 126:136."""


def test_it_is_the_hyperbola_of_hill():
    """(F + a)(v + b) is constant, with a = k F_0 and b = k v_0."""
    u = np.linspace(0.0, 1.0, 11)
    share = muscle_share(u)
    assert (share + HILL) * (u + HILL) == pytest.approx(np.full(11, (1 + HILL) * HILL))
    assert share[[0, -1]].tolist() == [1.0, 0.0]


def test_slope():
    u, h = np.linspace(0.1, 0.9, 5), 1e-6
    slope = (muscle_share(u + h) - muscle_share(u - h)) / (2 * h)
    assert muscle_share_slope(u) == pytest.approx(slope, rel=differenced())
