"""Every way to strike says the same of what is no kick."""

import math

import numpy as np
import pytest

import kickdyn as kd

LEG = kd.Leg.human()
Q = np.radians([5.0, 10.0, -5.0])
KICK = {
    "posture": LEG.posture(Q),
    "v": LEG.posture(Q).joint_velocity((3, 0, 1)),
    "ball": kd.Ball(),
    "contact": kd.Contact((1, 0, 0.3), 0.7),
}
DOORS = (kd.strike, kd.engine_strike, kd.collide, kd.unilateral_strike)


@pytest.mark.parametrize("door", DOORS, ids=lambda door: door.__name__)
@pytest.mark.parametrize(
    ("change", "error", "words"),
    [
        ({"posture": LEG}, kd.InvalidInput, r"^posture is Leg\(.*: it must be a kickdyn\.Posture$"),
        ({"v": [0, math.nan, 0]}, kd.InvalidInput, r"^v is .*finite"),
        (
            {"v": [0, -1e160, -1e160]},
            kd.InvalidInput,
            r"^foot and ball collide at .*double precision",
        ),
        ({"ball": None}, kd.InvalidInput, r"^ball is None"),
        ({"contact": None}, kd.InvalidInput, r"^contact is None"),
        ({"ball_velocity": (1, 2)}, kd.InvalidInput, r"^ball velocity has shape \(2,\)"),
        (
            {"ball_velocity": (-1e150, 0, 0)},
            kd.InvalidInput,
            r"^foot and ball collide at 1e\+150 m/s",
        ),
        ({"ball_spin": (0, math.inf, 0)}, kd.InvalidInput, r"^ball spin is .*finite.*rad/s"),
        ({"ball_spin": (0, 1e200, 0)}, kd.InvalidInput, r"^the ball moves at .* below 1e\+140 m/s"),
        ({"v": [0, 0, 0]}, kd.NoImpact, "^foot and ball do not approach"),
        ({"ball_velocity": (9, 0, 0)}, kd.NoImpact, "away from the ball"),
    ],
)
def test_what_is_no_kick_is_refused(door, change, error, words):
    with pytest.raises(error, match=words) as caught:
        door(**(KICK | change))
    assert "\n" not in str(caught.value)


def test_what_is_given_stays_the_callers():
    v, spin = KICK["v"].copy(), np.array([0.0, 5.0, 0.0])
    hit = kd.strike(**(KICK | {"v": v, "ball_spin": spin}))
    v[:], spin[:] = 9.0, 9.0
    assert hit.v_before.tolist() == KICK["v"].tolist()
    assert hit.ball_before.spin.tolist() == [0.0, 5.0, 0.0]
