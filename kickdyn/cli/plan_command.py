"""From a goal back to the kick (`kickdyn plan`)."""

import math
from dataclasses import astuple, dataclass, fields, replace
from typing import TYPE_CHECKING, Any

import click
import numpy as np

from kickdyn.air import Air
from kickdyn.ball import Ball, BallState
from kickdyn.cli.commands import busy, print_wrapped
from kickdyn.cli.leg_options import LegOptions
from kickdyn.cli.option_groups import (
    AirOptions,
    BallOptions,
    Numbers,
    OutputOptions,
    PointOptions,
    Vector,
    command,
    option,
)
from kickdyn.core import validation
from kickdyn.errors import InvalidInput
from kickdyn.ground import SURFACES
from kickdyn.motion.motion_file import check_motion_name
from kickdyn.planning.goal import FARTHEST, Goal
from kickdyn.planning.interception import IncomingBall
from kickdyn.planning.kick import BOTH_FEET, plan_kick
from kickdyn.planning.kick_plan import KickPlan
from kickdyn.planning.kick_terms import OBJECTIVES
from kickdyn.planning.launch import SPEED_LIMIT, OutOfReach
from kickdyn.planning.moving_kick import plan_trap
from kickdyn.planning.plan_report import (
    WALL_CLEARANCE,
    PlanReport,
    describe_passage,
    unreachable_json,
)
from kickdyn.planning.surface_choice import choose_surface
from kickdyn.robot.leg import Leg
from kickdyn.robot.standing import is_floating
from kickdyn.scene.scene import Wall, check_before, read_wall

if TYPE_CHECKING:
    from kickdyn.simulators.repeated_runs import NoisyRuns
    from kickdyn.simulators.run_in_mujoco import MujocoRun


@dataclass(frozen=True)
class GoalOptions:
    """The target, the flight to it, and obstacles."""

    distance: float | None = option("--distance", help="Distance of the target, along x [m].")
    height: float = option(
        "--height", default=0.0,
        help="Height of the target above the initial position of the ball, centre to centre [m].",
    )  # fmt: skip
    left: float = option(
        "--left", default=0.0, help="Distance of the target to the left of the x axis [m]."
    )
    time: float | None = option("--time", help="Time of flight to the target [s].")
    apex: float | None = option("--apex", help="Greatest height of the flight above its start [m].")
    launch_speed: float | None = option(
        "--launch-speed", help="Speed of the ball at its launch [m/s]."
    )
    over: tuple[float, float] | None = option(
        "--over", type=Numbers("DISTANCE:HEIGHT"),
        help="A point that the ball's centre passes, such as one above a wall [m].",
    )  # fmt: skip
    beside: tuple[float, float] | None = option(
        "--beside", type=Numbers("DISTANCE:LEFT"), help="Point beside the line to the target that "
        "the ball passes [m]; side spin curves the flight.",
    )  # fmt: skip
    wall: str | None = option(
        "--wall", metavar="DISTANCE:HEIGHT[:WIDTH]", help="A wall across the line to the target "
        "[m], 2.5 m wide by default. A ball that hits it is an error. Without --time, --apex, "
        "--launch-speed and --over, the ball passes 0.1 m above it.",
    )  # fmt: skip
    goal_mouth: bool = option(
        "--goal", help="Draw a goal 7.32 m wide and 2.44 m high, straight ahead at the target's "
        "distance, and report whether the ball enters it.",
    )  # fmt: skip
    surface: str | None = option(
        "--pass", metavar="SURFACE", type=click.Choice(list(SURFACES)),
        help="Play the ball along the ground in --time, on a surface such as turf or carpet.",
    )  # fmt: skip
    spin: Vector = option("--spin", help="Spin of the ball [rad/s]; back spin has Y < 0.")
    receiver_velocity: Vector = option(
        "--receiver-velocity",
        help="Velocity of a receiver who is at the target when the ball starts [m/s].",
    )  # fmt: skip

    def read_wall(self) -> Wall | None:
        """Return the wall; raise `InvalidInput` if it does not stand before the target."""
        if self.wall is None or self.distance is None:
            return None
        wall = read_wall(self.wall)
        check_before(wall, math.hypot(self.distance, self.left))
        return wall

    def load(self) -> Goal:
        """Return the goal; above a wall the ball passes, unless an option describes the flight."""
        if self.distance is None:
            raise InvalidInput("Missing option '--distance': only --trap has no target")
        validation.number("distance", self.distance, above=0, at_most=FARTHEST, unit="m")
        wall, over = self.read_wall(), self.over
        flight = (self.time, self.apex, self.launch_speed, over, self.surface)
        if wall is not None and all(value is None for value in flight):
            over = (wall.distance, wall.height + WALL_CLEARANCE)
        return Goal(
            (self.distance, self.left, self.height), time=self.time, apex=self.apex,
            speed=self.launch_speed, over=over, beside=self.beside,
            spin=self.spin or (0.0, 0.0, 0.0),
            receiver_velocity=self.receiver_velocity or (0.0, 0.0, 0.0),
        )  # fmt: skip


@dataclass(frozen=True)
class KickOptions:
    """Where the ball lies, what is minimized, and whether the motion is planned."""

    ball_height: float | None = option(
        "--ball-height", help="Height of the ball's centre [m, world frame]. By default, the ball "
        "is as low as the foot of the straight leg (-0.7042 m for human), of a robot with bent "
        "knees and hips 10 % lower, or it lies on the ground z = 0 of a robot on a support. In "
        "Python, the height is free by default.",
    )  # fmt: skip
    ball_at: Vector = option(
        "--ball-at", help="Position of the ball's centre [m, world frame], in place of "
        "--ball-height. Only the self-motion of the leg remains free.",
    )  # fmt: skip
    ball_position: Vector = option(
        "--ball-position", help="Position of the centre of a ball that moves, at time 0 [m, world "
        "frame]; distance, height and side of the target are measured from there.",
    )  # fmt: skip
    ball_velocity: Vector = option(
        "--ball-velocity",
        help="Its velocity then [m/s]; without a vertical part, the ball is on the ground.",
    )  # fmt: skip
    ball_spin: Vector = option("--ball-spin", help="Its spin then [rad/s].  [default: none]")
    meet_at: float | None = option(
        "--meet-at", help="Time at which it is met [s].  [default: the best]"
    )
    trap: Vector = option(
        "--trap",
        help="Leave the ball with this velocity [m/s], such as 0,0,0, in place of a target.",
    )  # fmt: skip
    objective: str | None = option(
        "--objective", type=click.Choice([name.value for name in OBJECTIVES]),
        help="Quantity that is minimized, or maximized where the name begins with most.  [default: "
        "joint-speed]",
    )  # fmt: skip
    no_limits: bool = option(
        "--no-limits", help="Ignore the speed and torque limits of the joints."
    )
    motion: bool = option(
        "--motion", help="Plan the motion of all joints from rest to the impact and to rest again, "
        "within all limits, and show it in the page.",
    )  # fmt: skip
    both_feet: bool = option(
        "--both-feet",
        help="With --motion: start and end on both feet, in place of the supporting one.",
    )  # fmt: skip
    choose_surface: bool = option(
        "--choose-surface", help="Kick with the inside, instep, outside or toe of the foot of "
        "--frame: the surface that meets the goal and depends least on where the ball lies.",
    )  # fmt: skip

    def check(self) -> None:
        """Raise `InvalidInput` for options that exclude each other."""
        if self.ball_height is not None and self.ball_at is not None:
            raise InvalidInput("--ball-height and --ball-at are both given: give one of the two")
        needed = {"--ball-position": self.ball_position, "--ball-velocity": self.ball_velocity}
        missing = [name for name, value in needed.items() if value is None]
        for name in ("ball_position", "ball_velocity", "ball_spin", "meet_at", "trap"):
            if getattr(self, name) is not None and missing:
                raise InvalidInput(
                    f"{' and '.join(missing)} missing: --{name.replace('_', '-')} is for a moving "
                    "ball, which needs a position and a velocity"
                )
        if not missing and (self.ball_height is not None or self.ball_at is not None):
            raise InvalidInput("--ball-position excludes --ball-height and --ball-at")
        if not missing and self.motion:
            raise InvalidInput("--ball-position excludes --motion: a motion strikes a ball at rest")
        if self.both_feet and not self.motion:
            raise InvalidInput("--both-feet is given: it needs the motion, so add --motion")

    def load_goal(self, goal: GoalOptions) -> Goal | tuple[float, float, float]:
        """Return the goal, or the velocity of a trap, which excludes the options of a goal."""
        if self.trap is None:
            return goal.load()
        chosen = [entry.metadata["names"][0] for entry in fields(goal) if getattr(goal, entry.name)]
        chosen += ["--motion"] if self.motion else []
        chosen += ["--choose-surface"] if self.choose_surface else []
        if chosen:
            raise InvalidInput(f"--trap excludes {', '.join(chosen)}: a trap has no target")
        return self.trap

    def arguments(self, leg: Leg, ball: Ball, offset: tuple[float, ...] | None) -> dict[str, Any]:
        """Return these options as arguments of `plan_kick`; the ball lies where the leg stands."""
        height, incoming = self.ball_height, None
        if self.ball_position is not None and self.ball_velocity is not None:
            spin = self.ball_spin or (0.0, 0.0, 0.0)
            state = BallState(self.ball_position, self.ball_velocity, spin)
            incoming = IncomingBall(state, meet_at=self.meet_at)
        elif height is None and self.ball_at is None:
            height = height_of_ball(leg, ball, offset)
        return {
            "objective": self.objective,
            "ball_position": height if self.ball_at is None else self.ball_at,
            "incoming": incoming,
            "limits": not self.no_limits,
            "motion": BOTH_FEET if self.both_feet else self.motion,
        }


def height_of_ball(leg: Leg, ball: Ball, offset: tuple[float, ...] | None) -> float | None:
    """Return the height of a ball at the foot of the straight leg [m]; None on a floating base."""
    if is_floating(leg):
        return None
    standing = leg.posture(leg.configuration()).with_contact_offset(offset)
    foot = float(standing.contact_point[2])
    # A robot's toe must point ahead: when it kicks, its hips are lower by a tenth of the height of
    # the straight leg. The knees would be bent by 52 degrees if it stood on that foot.
    crouch = 0.0 if leg.contact_normal_cone is None else 0.1
    return foot + ball.radius - crouch * foot


@dataclass(frozen=True)
class PlanOutputOptions(OutputOptions):
    """Where the plan and its motion are written, and whether the motion is carried out."""

    out: str | None = option(
        "--out", metavar="FILE",
        help="Write the motion, 100 times a second: .csv, .npz, .yaml (ROS 2) or .xml (MuJoCo).",
    )  # fmt: skip
    run: str | None = option(
        "--run", type=click.Choice(["mujoco"]), help="Carry the motion out in a simulator, report "
        "the ball and the robot, and show them in the page beside the plan.",
    )  # fmt: skip
    corrections: int | None = option(
        "--corrections", type=click.IntRange(1, 10), metavar="N", help="Correct the motion N "
        "times, 1 to 10, with the result of the simulator, before it is written and carried out.",
    )  # fmt: skip
    noisy_runs: int | None = option(
        "--noisy-runs", type=click.IntRange(1, 10_000), metavar="N",
        help="Carry it out N more times, with different masses, friction, delays and ball "
        "positions, and report how many robots stay upright and how the balls scatter.",
    )  # fmt: skip
    foot: str | None = option(
        "--foot", type=click.Choice(["shapes", "plate"]),
        help="What strikes the ball in the simulator: the shapes of the robot's own foot, or a "
        "plate at the contact point.  [default: shapes]",
    )  # fmt: skip

    def check_motion(self, planned: bool, incoming: bool) -> None:
        """Raise `InvalidInput` for options that need a motion where none is planned."""
        plot = None if incoming else self.plot
        for name, value in (("plot", plot), ("out", self.out), ("run", self.run)):
            if value is not None and not planned:
                raise InvalidInput(f"--{name} is {value!r}: it needs the motion, so add --motion")
        if self.run is not None:
            from kickdyn.simulators.mujoco_kick import load_mujoco

            load_mujoco()  # before a plan that takes a minute
        for name in ("corrections", "noisy_runs", "foot"):
            if (value := getattr(self, name)) is not None and self.run is None:
                what = f"--{name.replace('_', '-')} is {value}"
                raise InvalidInput(f"{what}: it needs a simulator, so add --run mujoco")
        if self.out is not None:
            check_motion_name(self.out)


@dataclass(frozen=True)
class WindyAirOptions(AirOptions):
    """The air, and the velocity of the wind [m/s]."""

    wind: Vector = option("--wind", help="Velocity of the wind [m/s].")

    def load(self) -> Air | None:
        """Return the air; None in a vacuum."""
        air = super().load()
        if self.wind is None:
            return air
        if air is None:
            what = f"--wind is {list(self.wind)}"
            raise InvalidInput(f"{what}, but --air is none: there is no wind in a vacuum")
        validation.number("wind", math.hypot(*self.wind), at_most=SPEED_LIMIT, unit="m/s")
        return replace(air, wind=np.array(self.wind))


@command("plan")
def plan(
    goal: GoalOptions,
    leg: LegOptions,
    contact: PointOptions,
    kick: KickOptions,
    air: WindyAirOptions,
    ball: BallOptions,
    output: PlanOutputOptions,
) -> None:
    """Find the posture and the joint velocity that send a ball to a target.

    The plot shows speeds, torques and margins of the motion; of a ball that moves, when it can be
    met and how exact that must be.

    Example: kickdyn plan --distance 30 --time 1.5 --leg human --view kick.html --json -
    """
    kick.check()
    target, wall = kick.load_goal(goal), goal.read_wall()
    output.check_motion(kick.motion, kick.ball_position is not None)
    output.check(output.out, inputs=[leg.leg_name])
    struck_ball, windy_air, robot = ball.load(), air.load(), leg.load()
    with busy("planning the kick"):
        try:
            arguments = kick.arguments(robot, struck_ball, contact.offset)
            if isinstance(target, tuple):
                arguments = {name: arguments[name] for name in ("incoming", "objective", "limits")}
                planned = plan_trap(
                    robot, ball=struck_ball, air=windy_air, velocity=target,
                    contact=contact.contact(), **arguments,
                )  # fmt: skip
            else:
                flight: dict[str, Any] = {"contact": contact.contact(), "surface": goal.surface}
                if kick.choose_surface:
                    robot = choose_surface(robot, target, struck_ball, windy_air, **flight)
                planned = plan_kick(robot, target, struck_ball, windy_air, **flight, **arguments)
        except OutOfReach as error:
            if isinstance(target, Goal):
                output.write_json(unreachable_json(target, error))
            raise
        if wall is not None:
            describe_passage(wall, planned)  # raises if the ball hits it
    run, noisy = None, None
    if output.run is not None:
        planned, run, noisy = _carry_out(planned, output)
    report = PlanReport(planned, wall, goal.goal_mouth)
    sentences, motion = report.sentences(), planned.motion
    if kick.choose_surface:
        sentences.append(f"The ball is struck with the {planned.leg.frame} of the foot.")
    if output.out is not None and motion is not None:
        motion.save(output.out)
    document = report.to_json()
    results = {name: result for name, result in (("run", run), ("noisy_runs", noisy)) if result}
    document |= {name: result.to_json() for name, result in results.items()}
    output.write_json(document)
    if output.prints:
        print_wrapped("\n".join(sentences), indent=0)
        output.print_rows(planned, planned.impact)
        for result in results.values():
            click.echo(f"\n{result}")
    output.save_plot(planned.plot)
    if output.view is not None:
        from kickdyn.view.wall_and_goal import goal_boxes, wall_boxes  # imports meshcat

        foot = planned.path.launch.position - np.array([0.0, 0.0, planned.impact.ball.radius])
        boxes = [] if wall is None else wall_boxes(foot, planned.aim.ahead, *astuple(wall))
        boxes += goal_boxes(foot, float(planned.aim.target[0])) if goal.goal_mouth else []
        output.save_page(run or planned, caption=" ".join(sentences), scenery=boxes)
    output.name_written(output.plot, output.view, output.out)


def _carry_out(
    planned: KickPlan, output: PlanOutputOptions
) -> "tuple[KickPlan, MujocoRun, NoisyRuns | None]":
    from kickdyn.simulators.repeated_runs import refine_kick, run_with_noise
    from kickdyn.simulators.run_in_mujoco import run_in_mujoco

    foot = output.foot or "shapes"
    with busy("carrying the motion out in MuJoCo") as show:
        if output.corrections is not None:
            show("correcting the motion by MuJoCo")
            planned = refine_kick(planned, rounds=output.corrections, by="mujoco", foot=foot)
        run, noisy = run_in_mujoco(planned, foot=foot), None
        if output.noisy_runs is not None:
            options: Any = {"tuning": run.tuning, "progress": show, "foot": foot}
            noisy = run_with_noise(planned, output.noisy_runs, **options)
    return planned, run, noisy
