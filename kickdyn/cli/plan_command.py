"""From a wished-for flight back to the kick (`kickdyn plan`)."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial
from typing import Any

import click
import numpy as np
from click.core import ParameterSource

from kickdyn.air import AIRS, Air
from kickdyn.ball import Ball
from kickdyn.cli.command import busy
from kickdyn.cli.named_legs import load_leg
from kickdyn.core import validation
from kickdyn.core.files import check_outputs, write_json
from kickdyn.errors import InvalidInput
from kickdyn.ground import SURFACES
from kickdyn.planning.free_kick import OVER, Wall, scored
from kickdyn.planning.goal import Arc, Goal
from kickdyn.planning.kick import plan_kick
from kickdyn.planning.kick_plan import KickPlan
from kickdyn.planning.launch import OutOfReach
from kickdyn.planning.objectives import OBJECTIVES
from kickdyn.planning.plan_report import (
    aftermath,
    as_json,
    cautions,
    scattered,
    swing_said,
    text,
    unreachable_json,
    verdict,
)
from kickdyn.planning.swing import plan_swing
from kickdyn.planning.swing_result import Swing

CROUCH = 0.1
"""By how much lower a robot's hips are when it kicks, over the height of its straight leg: its
knees are bent, by 52 degrees if it stood on that foot."""


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
@click.option("--beside", metavar="DISTANCE:LEFT",
              help="Where a curved way passes, left of the line to the target [m]: the ball gets "
              "the spin for it.")  # fmt: skip
@click.option("--wall", metavar="DISTANCE:HEIGHT[:WIDTH]",
              help="A wall across the line to the target, 2.5 m wide if not named [m]. The ball "
              "goes over it, or beside it; with nothing else named, 0.1 m over it.")  # fmt: skip
@click.option("--goal", "mouth", is_flag=True,
              help="Draw a goal 7.32 m wide and 2.44 m high, straight ahead at the target's "
              "distance, and say whether the ball goes in.")  # fmt: skip
@click.option("--pass", "surface", metavar="SURFACE", type=click.Choice(list(SURFACES)),
              help="Play the ball along the ground in --time, on turf, carpet...")  # fmt: skip
@click.option("--arc", default="low", show_default=True, type=click.Choice([*map(str, Arc)]),
              help="Which, where two launches meet the goal.")  # fmt: skip
@click.option("--leg", "leg_name", default="human", metavar="human|testbed|FILE|ROBOT",
              show_default=True, help="One of ours, a URDF file, or a robot by name, such as g1: "
              "its right leg, on a fixed base.")  # fmt: skip
@click.option("--frame", metavar="NAME", help="Link or joint whose origin strikes the ball.")
@click.option("--offset", metavar="X,Y,Z", help="Of the contact from there, in its axes [m].")
@click.option("--ball-height", type=float,
              help="Of the ball's centre [m, world frame]. Default: as if it lay at the height "
              "of the foot of the straight leg; of a robot's, with its knees bent. "
              "(Free in Python, where -0.7042 is human's default here.)")  # fmt: skip
@click.option("--ball-at", metavar="X,Y,Z",
              help="Where its centre lies, instead [m]: what is left is the leg's "
              "self-motion.")  # fmt: skip
@click.option("--objective", default="joint speed", show_default=True,
              type=click.Choice(list(OBJECTIVES)),
              help="What is made least, or most where it says so; effort is the leg's kinetic "
              "energy.")  # fmt: skip
@click.option("--no-limits", is_flag=True, help="Lift the joints' limits of speed and torque.")
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
@click.option("--swing", is_flag=True, help="Plan the way from rest to the impact and to rest "
              "again, within all limits, and show it in the page.")  # fmt: skip
@click.option("--plot", metavar="FILE", help="Draw torques and powers of the swing: png, svg, pdf.")
def plan(
    distance: float,
    height: float,
    left: float,
    time: float | None,
    apex: float | None,
    launch_speed: float | None,
    over: str | None,
    beside: str | None,
    wall: str | None,
    mouth: bool,
    surface: str | None,
    arc: str,
    leg_name: str,
    frame: str | None,
    offset: str | None,
    ball_height: float | None,
    ball_at: str | None,
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
    swing: bool,
    plot: str | None,
) -> None:
    """Find the posture and the joint velocity that send the ball where it shall go.

    Example: kickdyn plan --distance 30 --time 1.5 --leg human --view kick.html --json -
    """
    validation.number("distance", distance, above=0, unit="m")
    players = None if wall is None else Wall.read(wall)
    way = None if over is None else _pair("over", over)
    if players is not None:
        players.check_before(math.hypot(distance, left))
        if all(named is None for named in (time, apex, launch_speed, way, surface)):
            way = (players.distance, players.height + OVER)
    goal = Goal(
        (distance, left, height),
        time=time,
        apex=apex,
        speed=launch_speed,
        over=way,
        beside=None if beside is None else _pair("beside", beside),
    )
    leg = load_leg(leg_name, frame)
    ball = Ball()
    if plot is not None and not swing:
        raise InvalidInput(f"plot is {plot!r}: what is drawn is the swing, so add --swing")
    if plot is not None:
        from kickdyn.sweeps.sweep_plot import check_name

        check_name(plot)
    check_outputs(view, plot, json_file=json_file)
    place = None if offset is None else _numbers("offset", offset, ",", 3)
    ball_position = None if ball_at is None else _numbers("ball-at", ball_at, ",", 3)
    if ball_height is None and ball_position is None:
        standing = leg.posture(leg.configuration()).with_contact_offset(place)
        ball_height = float(standing.contact_point[2]) + ball.radius
        if leg.contact_normal_cone is not None:  # a robot, whose toe must point ahead
            ball_height -= CROUCH * float(standing.contact_point[2])
    around = _blown(AIRS[air], wind)
    spread = None if robust is None else _spread(robust)
    if spread is not None:
        _check_robust(swing)
    kick = partial(
        plan_kick,
        leg,
        ball=ball,
        air=around,
        objective=objective if spread is None else "scatter",
        spread=spread,
        restitution=restitution,
        friction=friction,
        spin=(0.0, 0.0, 0.0) if spin is None else _numbers("spin", spin, ",", 3),
        offset=place,
        ball_height=ball_height,
        ball_at=ball_position,
        limits=not no_limits,
        arc=arc,
        surface=surface,
        swing=swing,
    )
    try:
        with busy("planning the kick") as say:
            planned = kick(goal)
            if swing:
                say("planning the swing")
            swung = plan_swing(leg, planned) if swing else None
    except OutOfReach as error:
        if json_file is not None:
            write_json(json_file, unreachable_json(goal, error))
        raise
    said = [verdict(planned)]
    if spread is not None:
        said.append(scattered(planned, spread))
    if players is not None:
        said.append(players.passed(planned, kick))
    if mouth:
        said.append(scored(planned))
    if swung is not None:
        said.append(swing_said(swung))
    said += aftermath(planned, not no_limits) + cautions(planned)
    if swung is not None and plot is not None:
        from kickdyn.sweeps.sweep_plot import save_figure
        from kickdyn.view.swing_plot import swing_figure

        save_figure(swing_figure(swung), plot)
    report = as_json(planned, swung, players, mouth, spread)
    _write(planned, swung, said, players, mouth, report, json_file, view, plot)


def _blown(air: Air | None, wind: str | None) -> Air | None:
    if wind is None:
        return air
    if air is None:
        raise InvalidInput(f"wind is {wind!r}: without air there is none")
    blowing = np.array(_numbers("wind", wind, ",", 3))
    return replace(air, wind=blowing)


def _pair(name: str, text: str) -> tuple[float, float]:
    first, second = _numbers(name, text, ":", 2)
    return first, second


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


def _check_robust(swing: bool) -> None:
    given = click.get_current_context().get_parameter_source("objective")
    if given == ParameterSource.COMMANDLINE:
        raise InvalidInput("robust and objective are named: the scatter is what is made least")
    if swing:
        raise InvalidInput(
            "robust and swing are named: a swing goes with objective joint speed or effort"
        )


def _shape(name: str) -> str:
    return {"over": "DISTANCE:HEIGHT", "beside": "DISTANCE:LEFT"}.get(name, "X,Y,Z")


def _write(
    planned: KickPlan,
    swung: Swing | None,
    said: list[str],
    wall: Wall | None,
    mouth: bool,
    report: dict[str, Any],
    json_file: str | None,
    view: str | None,
    plot: str | None,
) -> None:
    if view is not None:
        from kickdyn.view.page import page
        from kickdyn.view.wall_and_goal import goal_boxes, wall_boxes

        ball, goal = planned.hit.ball, planned.goal
        foot = planned.path.launch.position - np.array([0.0, 0.0, ball.radius])
        boxes = [] if wall is None else wall_boxes(foot, goal.ahead, *wall)
        boxes += goal_boxes(foot, float(goal.target[0])) if mouth else []
        shown = swung if swung is not None and swung.status == "met" else planned
        page(shown, caption=" ".join(said), scenery=boxes).save(view)
    if json_file is not None:
        write_json(json_file, report)
        if json_file == "-":
            return
    from kickdyn.core.console import screen_width, wrapped  # a tenth of a second

    width = screen_width()
    click.echo("\n".join(wrapped(line, width) for line in said))
    click.echo("\n".join(wrapped(line, width, indent=8) for line in text(planned)))
    for file in (json_file, view, plot):
        if file is not None:
            click.echo(f"wrote {file}")
