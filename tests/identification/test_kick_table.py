"""The table of measured kicks, in CSV and LaTeX."""

import io

import numpy as np
import pytest

import kickdyn as kd

LEG = kd.Leg.human()
POSTURE, BALL = LEG.posture([0.2, 0.4, -0.1]), kd.Ball()


def inferred(speed, leg=LEG, **deviations):
    q = leg.configuration(dict(zip(LEG.joint_names, POSTURE.q.tolist(), strict=True)))
    posture = leg.posture(q)
    v = posture.joint_velocity([speed, 0.0, 1.0])
    hit = kd.strike(posture, v, BALL, kd.Contact((1, 0, 0.2), 0.7, 0.3))
    return kd.infer_impact(posture, v, BALL, hit.ball_before, hit.ball_after, **deviations)


def test_each_kick_has_values_and_deviations(tmp_path):
    slow, fast = inferred(10.0, joint_deviation=0.1), inferred(15.0)
    table = kd.kick_table({"slow": slow, "fast": fast})
    assert list(table.columns) == ["slow", "slow +-", "fast", "fast +-"]
    assert table.loc["restitution", "slow"] == pytest.approx(slow.restitution)
    assert table.loc["foot speed [m/s]", "fast"] == pytest.approx(np.hypot(15.0, 1.0))
    assert table.loc["effective mass [kg]", "slow +-"] == slow.deviations["effective_mass"]
    assert table.loc["impulse in knee [N s]", "slow +-"] == slow.joint_deviations["knee"]
    assert table["fast +-"].isna().all()
    rows = table.to_csv().splitlines()
    assert rows[0] == "quantity,slow,slow +-,fast,fast +-"
    read = np.genfromtxt(io.StringIO("\n".join(rows[1:])), delimiter=",")[:, 1:]
    assert read == pytest.approx(table.to_numpy(), nan_ok=True)


def test_a_latex_table_has_deviations_to_two_digits():
    slow, fast = inferred(10.0, velocity_deviation=(0.0, 0.03)), inferred(15.0)
    lines = kd.kick_table({"slow_1": slow, "fast": fast}, latex=True).splitlines()
    assert lines[0] == r"\begin{tabular}{lrr}"
    assert lines[2] == r" & slow\_1 & fast \\"
    (row,) = (line for line in lines if line.startswith("impulse in knee"))
    sizes = [impact.joint_sizes["knee"] for impact in (slow, fast)]
    deviation = slow.joint_deviations["knee"]
    assert f"${sizes[0]:.4f} \\pm {deviation:.4f}$ & ${sizes[1]:.4g}$ \\\\" in row
    assert 0.001 <= deviation < 0.01  # two digits are those shown
    assert lines[-1] == r"\end{tabular}"


def test_sizes_have_the_deviations_of_differences():
    """Of the foot's speed by the joint velocities, of the ball's by its own."""
    impact = inferred(10.0, velocity_deviation=(0.0, 0.2), joint_deviation=[0.1, 0.2, 0.3])
    along = impact.foot_velocity / np.linalg.norm(impact.foot_velocity)
    expected = np.linalg.norm(along @ POSTURE.jacobian * [0.1, 0.2, 0.3])
    assert impact.deviations["foot_speed"] == pytest.approx(expected, rel=1e-3)
    assert impact.deviations["ball_speed"] == pytest.approx(0.2, rel=1e-3)
    assert impact.deviations["impulse"] == pytest.approx(0.2 * BALL.mass, rel=1e-3)


def test_refused():
    with pytest.raises(kd.InvalidInput, match="kicks is empty"):
        kd.kick_table({})
    with pytest.raises(kd.InvalidInput, match="kick b"):
        kd.kick_table({"b": POSTURE})
    other = kd.Leg.human(height=1.65, mass=58, model="3d")
    with pytest.raises(kd.InvalidInput, match="kick 'b' has other joints than 'a'"):
        kd.kick_table({"a": inferred(10.0), "b": inferred(10.0, other)})
