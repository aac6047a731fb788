"""Every number of the table of a result is that of its object, and has its unit."""

import html
import math
import re

import numpy as np
import pytest

import kickdyn as kd

BALL = kd.Ball(0.41, 0.105, pressure=80e3)
GROUND = kd.Ground(-0.95, surface="turf")
LEG = kd.Leg.human()
POSTURE = LEG.posture([0.7, 0.5, -0.3])
V = (6.6, -14.5, 6.6)
INCOMING = {"ball_velocity": (-3, 1, 0.5), "ball_spin": (5, -8, 3)}
CONTACT = kd.Contact((2, 0.3, 1), "peacock-ball", 0.1)
AIR = kd.Air(density=1.1, wind=(1, 2, 0.5))


def table(shown):
    """Return name, value and unit of each row of a notebook's table, as text."""
    cell = r"<t[hd][^>]*>(.*?)</t[hd]>"
    rows = re.findall(rf"<tr>{cell}{cell}{cell}</tr>", shown._repr_html_())
    return [tuple(map(html.unescape, row)) for row in rows]


def text(value):
    """Return a number or a vector with four digits."""
    if np.ndim(value):
        value = np.where(np.abs(value) < 1e-12 * np.abs(value).max(), 0.0, value)  # rounding
        return f"({', '.join(map(text, value.tolist()))})"
    return f"{value + 0.0:.4g}"


def of_ball(ball):
    return {
        "mass": (ball.mass, "kg"),
        "radius": (ball.radius, "m"),
        "inertia": (2 / 3 * ball.mass * ball.radius**2, "kg m2"),
        "pressure": (ball.pressure, "Pa"),
    }


def of_ground(ground):
    surface = ground.surface
    return {
        "height": (ground.height, "m"),
        "restitution": (surface.restitution, ""),
        "friction": (surface.friction, ""),
        "rolling deceleration": (surface.rolling_deceleration, "m/s2"),
    }


def of_air(air):
    return {
        "density": (air.density, "kg/m3"),
        "viscosity": (air.viscosity, "Pa s"),
        "wind": (air.wind, "m/s"),
    }


def of_contact(contact):
    return {"normal": (contact.normal, ""), "friction": (contact.friction, "")}


def of_ball_after(hit):
    """What a strike and a contact that takes time have in common."""
    before, after = hit.ball_before, hit.ball_after
    return {
        "impulse on the ball": (BALL.mass * (after.velocity - before.velocity), "N s"),
        "ball after": (after.velocity, "m/s"),
        "spin after": (after.spin, "rad/s"),
        "energy lost": (hit.energy_lost, "J"),
    }


def of_impact(impact):
    foot = impact.posture.jacobian @ impact.v_before
    largest = max(np.linalg.norm(impact.joint_impulses[:, :3], axis=1))
    slope = (0.696 - 0.729) / (21.2 - 9.1)  # of the table "peacock-ball"
    return of_ball_after(impact) | {
        "restitution": (0.729 + slope * (impact.approach.speed - 9.1), ""),
        "effective mass": (impact.posture.effective_mass(impact.contact.normal), "kg"),
        "foot before": (foot, "m/s"),
        "ball over foot speed": (impact.ball_after.speed / np.linalg.norm(foot), ""),
        f"worst joint, {impact.worst_joint[0]}": (largest, "N s"),
        "condition": (impact.posture.condition, ""),
    }


def of_collision(hit):
    return of_ball_after(hit) | {
        "contact time": (1e3 * hit.contact_time, "ms"),
        "peak force": (hit.peak_force, "N"),
        "deflection": (1e3 * hit.deflection, "mm"),
    }


def of_flight(flight):
    moved = flight.landing.position - flight.launch.position
    return {
        "launch": (flight.launch.velocity, "m/s"),
        "spin": (flight.launch.spin, "rad/s"),
        "range": (math.hypot(*moved[:2]), "m"),
        "height": (flight.apex.position[2] - flight.launch.position[2], "m"),
        "duration": (flight.landing.time, "s"),
        "landing": (flight.landing.position, "m"),
        "landing speed": (math.hypot(*flight.landing.velocity), "m/s"),
    }


def of_course(course):
    moved = course.rest.position - course.launch.position
    return {
        "launch": (course.launch.velocity, "m/s"),
        "bounces": (len(course.bounces), ""),
        "distance": (math.hypot(*moved[:2]), "m"),
        "duration": (course.rest.time, "s"),
        "end": (course.rest.position, "m"),
    }


def of_plan(plan):
    impact = plan.impact
    return {
        "posture": (impact.posture.q, "rad"),
        "joint velocity": (impact.v_before, "rad/s"),
        "impulse on the ball": (impact.impulse, "N s"),
        "launch": (impact.ball_after.velocity, "m/s"),
    }


IMPACT = kd.strike(POSTURE, V, BALL, CONTACT, **INCOMING)
WALL = kd.Plane((30, 0, 0), (-1, 0, 0))
"""It is reached in the air, so that the course has a flight more than bounces."""
SHOWN = [
    (BALL, of_ball),
    (kd.Ground(0.2, surface=kd.Surface("mud", 0.3, 0.9, 4.0)), of_ground),
    (AIR, of_air),
    (kd.Contact((2, 0.3, 1), 0.7, 0.1), of_contact),
    (IMPACT, of_impact),
    (kd.fly(IMPACT.ball_after, BALL, AIR, kd.Ground(-2.0)), of_flight),
    (kd.follow(IMPACT.ball_after, BALL, AIR, GROUND), of_course),
    (kd.follow(IMPACT.ball_after, BALL, AIR, GROUND, plane=WALL), of_course),
    (kd.plan_kick(LEG, kd.Goal((11, 1, 0), time=0.7), BALL, AIR), of_plan),
]


@pytest.mark.parametrize(("shown", "expected"), SHOWN, ids=lambda value: type(value).__name__)
def test_a_table_has_the_numbers_of_its_object(shown, expected):
    rows = {name: (value, unit) for name, value, unit in table(shown)}
    wanted = {name: (text(value), unit) for name, (value, unit) in expected(shown).items()}
    assert wanted.items() <= rows.items()


def test_the_table_of_a_contact_that_takes_time():
    hit = kd.collide(POSTURE, V, BALL, kd.Contact((2, 0.3, 1), 0.7, 0.1), **INCOMING)
    rows = {name: (value, unit) for name, value, unit in table(hit)}
    for name, (value, unit) in of_collision(hit).items():
        assert rows[name][1] == unit
        numbers = [float(number) for number in re.findall(r"[-+.\de]+", rows[name][0])]
        least = 5e-3 * np.abs(value).max()  # gravity acts in the contact time, too
        assert numbers == pytest.approx(np.ravel(value).tolist(), rel=5e-3, abs=4 * least)
