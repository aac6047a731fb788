"""The picture of joint impulses: bars and error bars are those of the impact."""

import numpy as np
import pytest

import kickdyn as kd


@pytest.mark.parametrize("spread", [{}, {"v": 0.2, "restitution": 0.03}], ids=["bare", "spread"])
def test_bars_are_impulses_and_error_bars_their_deviations(spread):
    posture = kd.Leg.human().posture([0.7, 0.5, -0.3])
    hit = kd.strike(posture, [6.6, -14.5, 6.6], kd.Ball(), kd.Contact((2, 0, 1), 0.8, 0.1))
    (axes,) = hit.plot(**spread).axes
    sizes = np.linalg.norm(hit.joint_impulses[:, :3], axis=1)
    assert [bar.get_width() for bar in axes.patches] == pytest.approx(sizes)
    assert [label.get_text() for label in axes.get_yticklabels()] == ["hip", "knee", "ankle"]
    ends = [segment[:, 0] for bars in axes.collections for segment in bars.get_segments()]
    joints = hit.uncertainty(**spread).joints.values() if spread else ()
    deviations = [joint.force_deviation for joint in joints]
    assert [(end - begin) / 2 for begin, end in ends] == pytest.approx(deviations)
