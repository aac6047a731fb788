"""From a goal back to the kick (`kickdyn plan`)."""

import math
from dataclasses import astuple, replace
from typing import Any

import click
import numpy as np

from kickdyn.air import AIRS, Air
from kickdyn.ball import Ball
from kickdyn.cli.air_options import air_option, drag_option, with_drag
from kickdyn.cli.ball_option import ball_option
from kickdyn.cli.command import Command, busy, check_files, check_page_name, warn
from kickdyn.cli.leg_options import LegOptions, leg_options
from kickdyn.cli.number_options import PAIR, TRIPLE, offset_option
from kickdyn.cli.plan_suggestions import (
    back_spin,
    clear_ground,
    clear_wall,
    explain_unreachable,
    within_limits,
)
from kickdyn.cli.restitution_option import restitution_option
from kickdyn.core import validation
from kickdyn.core.files import write_json
from kickdyn.errors import InvalidInput
from kickdyn.ground import SURFACES
from kickdyn.planning.goal import FARTHEST, Arc, Goal
from kickdyn.planning.kick import plan_kick
from kickdyn.planning.kick_plan import KickPlan
from kickdyn.planning.kick_program import KickObjective
from kickdyn.planning.launch import OutOfReach
from kickdyn.planning.plan_report import OVER, PlanReport, describe_passage, unreachable_json
from kickdyn.planning.scatter import checked_spread
from kickdyn.planning.swing import plan_swing
from kickdyn.restitution import Restitution
from kickdyn.robot.leg import Leg
from kickdyn.robot.standing import is_floating
from kickdyn.scene.pitch import Wall, check_before, read_wall

CROUCH = 0.1
"""Share of the height of a robot's straight leg by which its hips are lower when it kicks: its
knees are bent, by 52 degrees if it stood on that foot."""


def _uncertainty(_: click.Context, __: click.Option, text: str | None) -> dict[str, float] | None:
    """Return the standard deviations that an option names, by source."""
    if text is None:
        return None
    pairs = [part.partition("=") for part in text.split(",")]
    try:
        return checked_spread({name.strip(): float(value) for name, _, value in pairs})
    except InvalidInput as error:
        raise InvalidInput(f"--robust is {text!r}: {error}") from None
    except ValueError:
        raise InvalidInput(f"--robust is {text!r}: it must be like speed=0.02,angle=0.01") from None


@click.command("plan", Command)
@click.option("--distance", required=True, type=float, help="Distance of the target, along x [m].")
@click.option("--height", default=0.0, show_default=True,
              help="Height of the target above the initial position of the ball, centre to "
              "centre [m].")  # fmt: skip
@click.option("--left", default=0.0, show_default=True,
              help="Distance of the target to the left of the x axis [m].")  # fmt: skip
@click.option("--time", type=float, help="Time of flight to the target [s].")
@click.option("--apex", type=float, help="Greatest height of the flight above its start [m].")
@click.option("--launch-speed", type=float, help="Speed of the ball at its launch [m/s].")
@click.option("--over", callback=PAIR, metavar="DISTANCE:HEIGHT",
              help="A point that the ball's centre passes, as above a wall [m].")  # fmt: skip
@click.option("--beside", callback=PAIR, metavar="DISTANCE:LEFT",
              help="How far to the left of the line to the target the ball passes at a distance "
              "[m]; side spin curves the flight.")  # fmt: skip
@click.option("--wall", metavar="DISTANCE:HEIGHT[:WIDTH]",
              callback=lambda _, __, text: None if text is None else read_wall(text),
              help="A wall across the line to the target [m], 2.5 m wide by default. A ball that "
              "hits it is an error. Without --time, --apex, --launch-speed and --over, the ball "
              "passes 0.1 m above it.")  # fmt: skip
@click.option("--goal", "goal_mouth", is_flag=True,
              help="Draw a goal 7.32 m wide and 2.44 m high, straight ahead at the target's "
              "distance, and report whether the ball enters it.")  # fmt: skip
@click.option("--pass", "surface", metavar="SURFACE", type=click.Choice(list(SURFACES)),
              help="Play the ball along the ground in --time, on a surface such as turf or "
              "carpet.")  # fmt: skip
@click.option("--arc", default="low", show_default=True, type=click.Choice([*map(str, Arc)]),
              help="Arc of the flight, where two launches meet the goal.")  # fmt: skip
@leg_options
@offset_option
@click.option("--ball-height", type=float,
              help="Height of the ball's centre [m, world frame]. By default, the ball lies at the "
              "height of the foot of the straight leg (10 % lower hips for a robot, whose knees "
              "are bent), or on the ground of a robot on a support, z = 0. In Python, the height "
              "is free by default; -0.7042 is the default here for human.")  # fmt: skip
@click.option("--ball-at", callback=TRIPLE, metavar="X,Y,Z",
              help="Position of the ball's centre [m, world frame], in place of --ball-height. "
              "Only the self-motion of the leg remains free.")  # fmt: skip
@click.option("--objective",
              type=click.Choice([name.value for name in KickObjective if name != "scatter"]),
              help="Quantity that is minimized (maximized by most-joint-impulse).  "
              "[default: joint-speed]")  # fmt: skip
@click.option("--no-limits", is_flag=True, help="Ignore the speed and torque limits of the joints.")
@restitution_option
@click.option("--friction", default=0.4, show_default=True, help="Coulomb's coefficient.")
@click.option(
    "--spin",
    callback=TRIPLE,
    metavar="X,Y,Z",
    help="Spin of the ball [rad/s]; back spin has Y < 0.",
)
@click.option("--wind", callback=TRIPLE, metavar="X,Y,Z", help="Velocity of the wind [m/s].")
@air_option
@drag_option
@ball_option
@click.option("--robust", "uncertainty", callback=_uncertainty, metavar="ERRORS",
              help="Minimize the scatter of the landing point, for standard deviations such as "
              "speed=0.02,angle=0.01,contact=0.002,drag=0.05 [1, rad, m, 1].")  # fmt: skip
@click.option("--json", "json_file", metavar="FILE", help="Write the plan as JSON; - is stdout.")
@click.option("--view", metavar="FILE.html|.png",
              help="Write a 3-D page of the kick, or a picture of it.")  # fmt: skip
@click.option("--swing", is_flag=True, help="Plan the motion from rest to the impact and to "
              "rest again, within all limits, and show it in the page; for a robot on a support, "
              "the motion from rest to the impact, with its foot above the ground.")  # fmt: skip
@click.option(
    "--plot", metavar="FILE", help="Plot speed, torque and power of the swing: .png, .svg or .pdf."
)
def plan(
    distance: float,
    height: float,
    left: float,
    time: float | None,
    apex: float | None,
    launch_speed: float | None,
    over: list[float] | None,
    beside: list[float] | None,
    wall: Wall | None,
    goal_mouth: bool,
    surface: str | None,
    arc: str,
    leg_options: LegOptions,
    offset: list[float] | None,
    ball_height: float | None,
    ball_at: list[float] | None,
    objective: str | None,
    no_limits: bool,
    restitution: Restitution,
    friction: float,
    spin: list[float] | None,
    wind: list[float] | None,
    air: str,
    drag: str | float | None,
    ball: Ball,
    uncertainty: dict[str, float] | None,
    json_file: str | None,
    view: str | None,
    swing: bool,
    plot: str | None,
) -> None:
    """Find the posture and the joint velocity that send a ball to a target.

    Example: kickdyn plan --distance 30 --time 1.5 --leg human --view kick.html --json -
    """
    if ball_height is not None and ball_at is not None:
        raise InvalidInput("--ball-height and --ball-at are both given: give one of the two")
    if swing and no_limits:
        raise InvalidInput(
            "--swing and --no-limits are both given: a swing is planned within limits"
        )
    for name, value in {"distance": distance, "height": height, "left": left}.items():
        least = 0.0 if name == "distance" else -math.inf
        validation.number(name, value, above=least, at_most=FARTHEST, unit="m")
    if wall is not None:
        check_before(wall, math.hypot(distance, left))
        if all(named is None for named in (time, apex, launch_speed, over, surface)):
            over = [wall.distance, wall.height + OVER]
    named = {"--time": time, "--apex": apex, "--launch-speed": launch_speed, "--over": over}
    given = [name for name, value in named.items() if value is not None]
    if len(given) != 1:
        raise InvalidInput(
            f"{' and '.join(given) or 'nothing'} {'are' if given else 'is'} given besides the "
            f"target: give exactly one of {', '.join(named)}"
        )
    if launch_speed is not None:
        validation.number("launch-speed", launch_speed, above=0, at_most=1e6, unit="m/s")
    goal = Goal(
        (distance, left, height),
        time=time,
        apex=apex,
        speed=launch_speed,
        over=None if over is None else (over[0], over[1]),
        beside=None if beside is None else (beside[0], beside[1]),
    )
    air_of_flight = _windy(with_drag(AIRS[air], drag), wind)
    _check_files(swing, view, plot, json_file, leg_options.leg_name)
    leg = leg_options.load()
    if plot is not None and is_floating(leg):
        raise InvalidInput(f"--plot is {plot!r}: swings are drawn only for robots on a fixed base")
    if uncertainty is not None and objective is not None:
        raise InvalidInput("--robust and --objective are both given: --robust minimizes scatter")
    if uncertainty is not None and swing:
        raise InvalidInput(
            "--robust and --swing are both given: a kick with a swing is planned for the objective "
            "joint-speed or kinetic-energy"
        )
    if ball_height is None and ball_at is None and not is_floating(leg):
        ball_height = _lying_height(leg, ball, offset)
    arguments: dict[str, Any] = {
        "objective": objective or KickObjective.JOINT_SPEED,
        "restitution": restitution,
        "friction": friction,
        "spin": spin or (0.0, 0.0, 0.0),
        "offset": offset,
        "ball_height": ball_height,
        "ball_at": ball_at,
        "limits": not no_limits,
        "arc": arc,
        "surface": surface,
        "swing": swing,
    }
    if uncertainty is not None:
        arguments |= {"objective": KickObjective.SCATTER, "uncertainty": uncertainty}

    def attempt(goal: Goal, **changes: Any) -> KickPlan:
        return plan_kick(leg, goal, ball, air_of_flight, **(arguments | changes))

    with busy("planning the kick") as show:
        try:
            planned = attempt(goal)
        except OutOfReach as error:
            if json_file is not None:
                write_json(json_file, unreachable_json(goal, error))
            raise explain_unreachable(goal, error, attempt) from None
        except InvalidInput as error:
            if suggested := back_spin(goal, arguments["spin"], attempt):
                raise InvalidInput(f"{error}{suggested}") from None
            raise
        if wall is not None:
            try:
                describe_passage(wall, planned)
            except InvalidInput as error:
                raise InvalidInput(f"{error}{clear_wall(wall, planned, attempt)}") from None
        advice = list[str]()
        if not swing and uncertainty is None:  # trying others takes long
            advice += within_limits(planned, attempt, wall)
            advice += clear_ground(planned, attempt) if ball_at is None else ()
        swung = None
        if swing and planned.backswing is None:
            show("planning the swing")
            swung = plan_swing(leg, planned)
    report = PlanReport(planned, swung, wall, goal_mouth, uncertainty, not no_limits, tuple(advice))
    _write(report, json_file, view, plot)


def _check_files(
    swing: bool, view: str | None, plot: str | None, json_file: str | None, leg: str
) -> None:
    """Refuse files that cannot be written before anything is computed."""
    if plot is not None:
        if not swing:
            raise InvalidInput(f"--plot is {plot!r}: it shows the swing, so add --swing")
        from kickdyn.core.plot_style import check_name

        check_name(plot)
    if view is not None:
        check_page_name(view)
    check_files(view, plot, json_file=json_file, inputs=[leg])


def _lying_height(leg: Leg, ball: Ball, offset: list[float] | None) -> float:
    """Return the height of the centre of a ball that lies where the leg stands [m]."""
    standing = leg.posture(leg.configuration()).with_contact_offset(offset)
    foot = float(standing.contact_point[2])
    crouch = 0.0 if leg.contact_normal_cone is None else CROUCH  # a robot's toe must point ahead
    return foot + ball.radius - crouch * foot


def _windy(air: Air | None, wind: list[float] | None) -> Air | None:
    """Return the air with a wind."""
    if wind is None:
        return air
    if air is None:
        raise InvalidInput(f"--wind is {wind}, but --air is none: there is no wind in a vacuum")
    return replace(air, wind=np.array(wind))


def _write(report: PlanReport, json_file: str | None, view: str | None, plot: str | None) -> None:
    """Write a report to the files that are named, and to the screen."""
    sentences = report.sentences()
    if json_file is not None:
        write_json(json_file, report.to_json())
    if json_file != "-":
        from kickdyn.core.console import screen_width, wrapped  # a tenth of a second

        width = screen_width()
        click.echo("\n".join(wrapped(line, width) for line in sentences))
        click.echo("\n".join(wrapped(line, width, indent=8) for line in report.table()))
    if plot is not None and report.swing is not None:
        from kickdyn.core.plot_style import save_figure
        from kickdyn.view.swing_plot import swing_figure

        save_figure(swing_figure(report.swing), plot)
    if view is not None:
        # the page has the warnings itself, and no options
        shown = [x for x in sentences if not x.startswith("Warning: ") and x not in report.advice]
        _write_page(report, view, " ".join(shown))
    if json_file == "-":
        return
    for file in (json_file, view, plot):
        if file is not None:
            click.echo(f"wrote {file}")


def _write_page(report: PlanReport, file: str, caption: str) -> None:
    """Write a 3-D page of the kick, with wall and goal."""
    from kickdyn.view.page import page
    from kickdyn.view.wall_and_goal import goal_boxes, wall_boxes

    plan, swing = report.plan, report.swing
    foot = plan.path.launch.position - np.array([0.0, 0.0, plan.impact.ball.radius])
    boxes = [] if report.wall is None else wall_boxes(foot, plan.goal.ahead, *astuple(report.wall))
    boxes += goal_boxes(foot, float(plan.goal.target[0])) if report.goal_mouth else []
    shown = swing if swing is not None and swing.status == "met" else plan
    made_page = page(shown, caption=caption, scenery=boxes)
    made_page.save(file)
    warn(made_page.warnings)
