"""From a wished-for flight back to the kick (`python -m kickdyn.plan`)."""

from __future__ import annotations

import json
import math
import sys
from dataclasses import replace
from typing import Any

import click
import numpy as np

from kickdyn import checks
from kickdyn.air import Air
from kickdyn.ball import Ball
from kickdyn.door import run
from kickdyn.errors import InvalidInput
from kickdyn.files import check_distinct, check_writable, replacing
from kickdyn.leg import Leg
from kickdyn.planning.goal import Goal
from kickdyn.planning.kick import OBJECTIVES, KickPlan, plan_kick
from kickdyn.posture_sweep import AIRS, load_leg


@click.command("plan", context_settings={"help_option_names": ["-h", "--help"]})
@click.option("--distance", required=True, type=float, help="To the target, along x [m].")
@click.option("--height", default=0.0, show_default=True,
              help="Of the target above where the ball lies, centre to centre [m].")  # fmt: skip
@click.option("--left", default=0.0, show_default=True, help="Of the target, sideways [m].")
@click.option("--time", type=float, help="Of the flight to the target [s].")
@click.option("--apex", type=float, help="Greatest height of the flight above its start [m].")
@click.option("--launch-speed", type=float, help="Of the ball [m/s].")
@click.option("--over", metavar="DISTANCE:HEIGHT",
              help="A point on the way for the ball's centre, as over a wall [m].")  # fmt: skip
@click.option("--arc", default="low", show_default=True, type=click.Choice(["low", "high"]),
              help="Which, where two launches meet the goal.")  # fmt: skip
@click.option("--leg", "leg_name", default="human", metavar="human|testbed|FILE|ROBOT",
              show_default=True, help="One of ours, a URDF file, or a robot by name, such as g1: "
              "its right leg, on a fixed base.")  # fmt: skip
@click.option("--frame", metavar="NAME", help="Link or joint whose origin strikes the ball.")
@click.option("--offset", metavar="X,Y,Z", help="Of the contact from there, in its axes [m].")
@click.option("--ball-height", type=float,
              help="Of the ball's centre [m, world frame]. Default: as if it lay at the height "
              "of the foot of the straight leg.")  # fmt: skip
@click.option("--objective", default="joint speed", show_default=True,
              type=click.Choice(list(OBJECTIVES)), help="What is made least.")  # fmt: skip
@click.option("--no-limits", is_flag=True, help="Lift the joints' speed and effort limits.")
@click.option("--restitution", default=0.8, show_default=True, help="Coefficient e, 0 to 1.")
@click.option("--friction", default=0.4, show_default=True, help="Coulomb's coefficient.")
@click.option("--spin", metavar="X,Y,Z", help="Of the ball [rad/s]; back spin has Y below 0.")
@click.option("--wind", metavar="X,Y,Z", help="Of the air [m/s].")
@click.option("--air", default="standard", show_default=True, type=click.Choice(list(AIRS)),
              help="20 degC at sea level, the paper's, or none.")  # fmt: skip
@click.option("--robust", metavar="ERRORS",
              help="Make the scatter of the landing least, for standard deviations such as "
              "speed=0.02,angle=0.01,contact=0.002,drag=0.05 (rad, m).")  # fmt: skip
@click.option("--json", "json_file", metavar="FILE", help="Write the plan; - is stdout.")
@click.option("--view", metavar="FILE.html", help="Write a 3-D page of the kick.")
def plan(
    distance: float,
    height: float,
    left: float,
    time: float | None,
    apex: float | None,
    launch_speed: float | None,
    over: str | None,
    arc: str,
    leg_name: str,
    frame: str | None,
    offset: str | None,
    ball_height: float | None,
    objective: str,
    no_limits: bool,
    restitution: float,
    friction: float,
    spin: str | None,
    wind: str | None,
    air: str,
    robust: str | None,
    json_file: str | None,
    view: str | None,
) -> None:
    """Find the posture and the joint velocity that send the ball where it shall go.

    Example: python -m kickdyn.plan --distance 30 --time 1.5 --leg human --view kick.html --json -
    """
    checks.number("distance", distance, above=0, unit="m")
    way = None if over is None else _numbers("over", over, ":", 2)
    goal = Goal(
        (distance, left, height),
        time=time,
        apex=apex,
        speed=launch_speed,
        over=None if way is None else (way[0], way[1]),
    )
    leg = load_leg(leg_name, frame)
    ball = Ball()
    check_distinct(json_file, view)
    for file in (None if json_file == "-" else json_file, view):
        if file is not None:
            check_writable(file)
    place = None if offset is None else _numbers("offset", offset, ",", 3)
    if ball_height is None:
        standing = leg.posture(leg.configuration())
        standing = standing if place is None else standing.touched_at(place)
        ball_height = float(standing.contact_point[2]) + ball.radius
    around = _blown(AIRS[air](), wind)
    spread = None if robust is None else _spread(robust)
    planned = plan_kick(
        leg,
        goal,
        ball,
        around,
        objective=objective if spread is None else "scatter",
        spread=spread,
        restitution=restitution,
        friction=friction,
        spin=(0.0, 0.0, 0.0) if spin is None else _numbers("spin", spin, ",", 3),
        offset=place,
        ball_height=ball_height,
        limits=not no_limits,
        arc="high" if arc == "high" else "low",
    )
    _write(planned, leg, ball, json_file, view)


def _blown(air: Air | None, wind: str | None) -> Air | None:
    if wind is None:
        return air
    if air is None:
        raise InvalidInput(f"wind is {wind!r}: without air there is none")
    blowing = np.array(_numbers("wind", wind, ",", 3))
    return replace(air, wind=blowing)


def _numbers(name: str, text: str, between: str, count: int) -> list[float]:
    try:
        values = [float(part) for part in text.split(between)]
    except ValueError:
        values = []
    if len(values) != count or not all(math.isfinite(value) for value in values):
        raise InvalidInput(f"{name} is {text!r}: it must be {count} numbers, as {_shape(name)}")
    return values


def _spread(text: str) -> dict[str, float]:
    found = {}
    for part in text.split(","):
        name, _, value = part.partition("=")
        try:
            found[name.strip()] = float(value)
        except ValueError:
            raise InvalidInput(
                f"robust is {text!r}: it must be like speed=0.02,angle=0.01"
            ) from None
    return found


def _shape(name: str) -> str:
    return "DISTANCE:HEIGHT" if name == "over" else "X,Y,Z"


def _write(
    planned: KickPlan, leg: Leg, ball: Ball, json_file: str | None, view: str | None
) -> None:
    html = None
    if view is not None:
        from kickdyn.view.page import kick_page, write_page

        html = kick_page(planned.hit, ball, planned.path, caption=_verdict(planned))
        write_page(view, html)
    if json_file is not None:
        written = json.dumps(as_json(planned, leg), indent=2, allow_nan=False) + "\n"
        if json_file == "-":
            sys.stdout.write(written)
            return
        with replacing(json_file) as draft:
            draft.write_text(written, encoding="utf-8")
    click.echo(text(planned, leg))
    for file in (json_file, view):
        if file is not None:
            click.echo(f"wrote {file}")


def _verdict(planned: KickPlan) -> str:
    """Return the answer in a line."""
    where = ", ".join(f"{part:.4g}" for part in planned.goal.target)
    if planned.status == "met":
        return (
            f"The ball comes to ({where}) m after {planned.path.duration:.4g} s; strike and flight "
            f"miss it by {planned.landing_error:.1e} m."
        )
    return (
        f"Beyond the leg's limits: it gives the ball {planned.share:.0%} of the speed that "
        f"({where}) m takes, and misses by {planned.landing_error:.3g} m."
    )


def text(planned: KickPlan, leg: Leg) -> str:
    """Return a plan as lines of text."""
    launch, hit = planned.launch, planned.hit
    up, left = planned.touch.place
    angles = leg.angles_deg(planned.q)
    joints = [
        f"  {name:24} {angles[name]:9.2f} {leg.joint_unit(name).replace('rad', 'deg')}  "
        f"{planned.v[leg.velocity_index(name)]:9.3f} {leg.joint_unit(name)}/s"
        for name in angles
        if planned.v[leg.velocity_index(name)] != 0.0 or angles[name] != 0.0
    ]
    turned = math.degrees(planned.heading)
    aside = [f"base    turned {turned:.2f} deg to the left"] if turned else []
    return "\n".join(
        [
            _verdict(planned),
            f"launch  {launch.speed:.4f} m/s, {math.degrees(launch.elevation):.3f} deg up, "
            f"{math.degrees(launch.azimuth):.3f} deg left; {launch.steps} Newton steps",
            f"touch   {1e3 * up:.1f} mm up and {1e3 * left:.1f} mm left of the ball's centre, "
            f"impulse {math.hypot(*hit.impulse):.4f} N s, "
            f"foot {math.hypot(*hit.foot_velocity):.4f} m/s",
            f"leg     {planned.objective} {planned.value:.4g}; speed {planned.speed_use:.0%} and "
            f"effort {planned.effort_use:.0%} of their limits; worst joint impulse "
            f"{hit.worst_joint[1]:.3g} N s at {hit.worst_joint[0]}",
            *aside,
            *joints,
        ]
    )


def as_json(planned: KickPlan, leg: Leg) -> dict[str, Any]:
    """Return a plan as what JSON can hold: SI units, degrees where a name says so."""
    launch, hit, goal = planned.launch, planned.hit, planned.goal
    return {
        "status": planned.status,
        "goal": {"target_m": goal.target.tolist(), goal.kind: getattr(goal, goal.kind)},
        "launch": {
            "speed": launch.speed,
            "elevation_deg": math.degrees(launch.elevation),
            "azimuth_deg": math.degrees(launch.azimuth),
            "velocity": launch.velocity.tolist(),
            "spin": launch.spin.tolist(),
            "time": launch.time,
            "newton_steps": launch.steps,
        },
        "touch": {
            "impulse": hit.impulse.tolist(),
            "normal": hit.touch.normal.tolist(),
            "up_m": planned.touch.place[0],
            "left_m": planned.touch.place[1],
            "foot_velocity": hit.foot_velocity.tolist(),
        },
        "leg": {
            "name": leg.name,
            "heading_deg": math.degrees(planned.heading),
            "q_deg": leg.angles_deg(planned.q),
            "v": planned.v.tolist(),
            "objective": planned.objective,
            "value": planned.value,
            "speed_use": planned.speed_use,
            "effort_use": planned.effort_use,
            "worst_joint": hit.worst_joint[0],
            "worst_joint_impulse": hit.worst_joint[1],
        },
        "share": planned.share,
        "time": planned.path.duration,
        "landing_error": planned.landing_error,
    }


if __name__ == "__main__":
    run(plan)
