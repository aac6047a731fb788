import numpy as np
import pytest

import kickdyn as kd

LEG, GOAL = kd.Leg.human(), kd.Goal(15, time=1)


def changed(**limits):
    model = LEG.model
    for name, values in limits.items():
        setattr(model, name, np.array(values))
    return kd.Leg.from_model(model, "toe")


def refusal(leg=LEG, **how):
    with pytest.raises(kd.InvalidInput, match="has no posture") as error:
        kd.plan_kick(leg, GOAL, kd.Ball(), kd.Air(), **how)
    return str(error.value)


@pytest.mark.parametrize("how", [{"ball_height": -2.0}, {"ball_at": (3.0, 0.0, -0.6)}])
def test_a_ball_out_of_reach_is_told_of_one_within(how):
    said = refusal(**how)
    assert "the nearest ball found that it can kick so has its centre at (" in said
    near = [float(part) for part in said.rpartition("(")[2].partition(")")[0].split(",")]
    plan = kd.plan_kick(LEG, GOAL, kd.Ball(), kd.Air(), ball_height=near[2])
    assert plan.hit.ball_after.position[2] == pytest.approx(near[2], abs=1e-3)
    wished = next(iter(how.values()))
    far = near[2] - wished if "ball_height" in how else np.linalg.norm(np.subtract(near, wished))
    assert abs(far) < (1.3 if "ball_height" in how else 2.3)  # what the leg's length leaves


def test_joints_too_weak_to_hold_the_leg_are_named():
    said = refusal(changed(effortLimit=[1.0, 1.0, 1.0]), ball_height=-0.7)
    assert "without its speed and torque limits it has one: held still, hip takes" in said
    assert "and has 1" in said
    assert "knee takes" in said
