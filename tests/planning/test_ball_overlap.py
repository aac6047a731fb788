"""How deep bodies are inside a ball, against shapes whose distances are known."""

import math

import pytest

import kickdyn as kd
from kickdyn.planning.ball_overlap import find_overlaps

BALL = kd.Ball()
LEG = """<mujoco><worldbody><body name="shank" pos="0 0 1">
  <joint name="knee" type="hinge" axis="0 -1 0" range="-90 90"/>
  <geom type="capsule" fromto="0 0 0 0 0 -0.8" size="0.04"/>
  <body name="foot" pos="0 0 -0.9"><geom type="sphere" size="{}" pos="{} 0 0"/></body>
</body></worldbody></mujoco>"""


def kick(tmp_path, size, ahead, offset):
    """An impact at an offset from the foot, which is a sphere ahead of the origin."""
    (tmp_path / "leg.xml").write_text(LEG.format(size, ahead))
    leg = kd.Leg.from_mjcf(tmp_path / "leg.xml", "foot")
    contact = kd.Contact((1, 0, 0), 0.8, offset=offset)
    return kd.strike(leg.posture([0.0]), [1.0], BALL, contact)


def test_a_foot_counts_as_far_as_its_contact_point_does_not_explain_it(tmp_path):
    """The contact point at the front touches; behind the front, the ball is in the foot anyway."""
    assert find_overlaps(kick(tmp_path, 0.05, 0.1, (0.15, 0, 0))) == {}
    assert find_overlaps(kick(tmp_path, 0.05, 0.1, (0.12, 0, 0))) == {}
    top = find_overlaps(kick(tmp_path, 0.05, 0.1, (0.1, 0, 0.05)))
    radius = BALL.radius
    assert top == pytest.approx({"foot": radius + 0.05 - math.hypot(radius, 0.05)})


def test_another_body_counts_where_it_is_inside_the_ball(tmp_path):
    (tmp_path / "leg.xml").write_text(LEG.format(0.05, 0.0))
    leg = kd.Leg.from_mjcf(tmp_path / "leg.xml", "foot")
    contact = kd.Contact((1, 0, 0), 0.8, offset=(-0.02, 0, 0.2))
    hit = kd.strike(leg.posture([0.0]), [1.0], BALL, contact)
    distance = BALL.radius - 0.02  # of the ball's centre from the axis of the shank
    found = find_overlaps(hit)
    assert found.keys() == {"shank"}
    assert found["shank"] == pytest.approx(BALL.radius + 0.04 - distance, abs=1e-9)


def test_a_leg_without_shapes_has_nothing_to_compare():
    leg = kd.Leg.from_model(kd.Leg.human().model, "toe")
    hit = kd.strike(leg.posture([0.0, 0.0, 0.0]), [1, 0, 0], BALL, kd.Contact((1, 0, 0), 0.8))
    assert find_overlaps(hit) == {}
