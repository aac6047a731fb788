"""Scatter to first order: against drawn strikes and flights, differences, and the parabola."""

import math
from dataclasses import replace

import numpy as np
import pytest
from tolerances import agrees, closed_form, differenced, integrated

import kickdyn as kd
from kickdyn.planning.scatter import scatter

LEG, BALL, AIR = kd.Leg.from_robot("g1", legs_only=True), kd.Ball(), kd.Air(drag="brazuca")
SMALL = {"speed": 2e-3, "angle": 1e-3, "contact": 1e-4, "restitution": 2e-3}
BENT = LEG.configuration({"right_hip_pitch_joint": -0.3, "right_knee_joint": 0.6})


def struck(friction):
    """Return a strike whose foot sticks or slips, and whose ball flies up with spin."""
    posture = LEG.posture(BENT)
    v = posture.joint_velocity((7.0, 1.0, 3.0))
    return kd.strike(posture, v, BALL, kd.Contact((0.92, 0.1, 0.25), 0.7, friction))


def across(direction):
    """Return the directions upwards and to the left, across one."""
    along = direction / np.linalg.norm(direction)
    left = np.cross((0, 0, 1.0), along) / np.linalg.norm(along[:2])
    return np.array([np.cross(along, left), left])


def ball_of(hit, speed=0.0, angle=(0, 0), contact=(0, 0), restitution=0.0):
    """Return the ball of a strike with errors of its sources."""
    foot, normal = hit.foot_velocity, hit.contact.normal
    change = foot * speed + np.linalg.norm(foot) * np.asarray(angle) @ across(foot)
    turned = normal - np.asarray(contact) @ across(normal) / BALL.radius
    law = kd.Contact(turned, hit.contact.restitution + restitution, hit.contact.friction)
    v = hit.v_before + hit.posture.joint_velocity(change)
    return kd.strike(hit.posture, v, BALL, law).ball_after


@pytest.mark.parametrize("friction", [0.4, 0.02], ids=["sticks", "slips"])
@pytest.mark.parametrize("source", SMALL)
def test_the_covariance_of_a_source_is_that_of_differences_of_landings(source, friction):
    hit, h = struck(friction), 1e-4 * BALL.radius
    assert hit.sticking == (friction == 0.4)
    result, slopes = scatter(hit, AIR, **{source: SMALL[source]}), []
    for step in [[h]] if source in ("speed", "restitution") else [[h, 0], [0, h]]:
        both = [sign * np.array(step) for sign in (1, -1)]
        balls = [ball_of(hit, **{source: e if e.size == 2 else float(e[0])}) for e in both]
        ends = [
            kd.fly(ball, BALL, AIR, tol=1e-12).landing.position - ball.position for ball in balls
        ]
        slopes.append((ends[0] - ends[1])[:2] / (2 * h))
    expected = SMALL[source] ** 2 * sum(np.outer(slope, slope) for slope in slopes)
    agrees(result.covariance, expected, 100 * differenced())
    agrees(result.by_source[source], result.covariance, closed_form())


def test_the_covariance_of_drag_is_that_of_differences_of_landings():
    hit, h, ends = struck(0.4), 1e-4, []
    for share in (1 + h, 1 - h):
        air = replace(AIR, drag=lambda re, spin, share=share: share * AIR.drag(re, spin))
        landing = kd.fly(hit.ball_after, BALL, air, tol=1e-12).landing
        ends.append(landing.position[:2])
    slope = (ends[0] - ends[1]) / (2 * h)
    covariance = scatter(hit, AIR, drag=0.02).covariance
    agrees(covariance, 0.02**2 * np.outer(slope, slope), 100 * differenced())


def test_the_covariances_of_independent_sources_add_up():
    hit = struck(0.4)
    result = scatter(hit, AIR, **SMALL, drag=0.02)
    alone = [scatter(hit, AIR, **{name: size}) for name, size in {**SMALL, "drag": 0.02}.items()]
    agrees(result.covariance, sum(one.covariance for one in alone), closed_form(10))
    assert result.radius == pytest.approx(math.sqrt(sum(one.radius**2 for one in alone)))
    landing = kd.fly(hit.ball_after, BALL, AIR, tol=1e-12).landing.position
    agrees(result.mean, landing[:2] - hit.ball_after.position[:2], integrated(1e-10))
