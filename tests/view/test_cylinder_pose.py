import numpy as np
import pytest

from kickdyn.view.cylinder_pose import UPRIGHT, along


@pytest.mark.parametrize("end", [(1, 0, 0), (0, -2, 0), (0, 0, 1e-9), (3, 4, -5)])
def test_along_lays_the_y_axis_from_start_to_end(end):
    start = np.array([1.0, 2.0, 3.0])
    place = along(start, start + end)
    turn = place[:3, :3]
    np.testing.assert_allclose(turn @ turn.T, np.eye(3), atol=1e-15)
    assert np.linalg.det(turn) == pytest.approx(1)
    np.testing.assert_allclose(turn[:, 1], np.array(end) / np.linalg.norm(end), atol=1e-6)
    np.testing.assert_allclose(place[:3, 3], start + np.array(end) / 2)


def test_upright_turns_y_to_z():
    np.testing.assert_allclose(UPRIGHT[:3, :3] @ (0, 1, 0), (0, 0, 1), atol=1e-15)
