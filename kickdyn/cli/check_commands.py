"""What is in a file, and what a recorded motion does (`kickdyn check`, `kickdyn check-motion`)."""

from dataclasses import dataclass, replace

import click

from kickdyn.cli.check_file import check as check_file
from kickdyn.cli.commands import busy
from kickdyn.cli.leg_options import LegOptions
from kickdyn.cli.option_groups import (
    BallOptions,
    JsonOptions,
    OutputOptions,
    PointOptions,
    command,
    option,
)
from kickdyn.errors import InvalidInput, shortened
from kickdyn.motion.check_motion import check_motion as check_recorded
from kickdyn.motion.read_motion import BREADTH_FIRST, OF_MODEL, read_motion


@command("check")
@click.argument("file", metavar="FILE", type=click.Path())
@click.option("--package-dir", "package_dirs", multiple=True, metavar="DIR",
              type=click.Path(exists=True, file_okay=False),
              help="ROS package with meshes of a robot, or a folder that contains it; "
              "repeatable.")  # fmt: skip
def check(file: str, package_dirs: tuple[str, ...], output: JsonOptions) -> None:
    """Say what kickdyn sees in a file, what is wrong with it, and what to run next.

    FILE is a robot (.urdf, .xml, .mjcf), markers (.c3d, .trc), joint angles (.mot, .sto), the track
    of a ball (.csv) or a scene (.toml). The exit code is 2 if the file has problems.

    Example: kickdyn check my_robot.urdf --package-dir meshes
    """
    output.check(inputs=[file])
    found = check_file(file, package_dirs)
    output.write_json(found.to_json())
    if output.prints and found.rows:
        output.print_rows(replace(found, problems=(), commands=()))
        for command in found.commands:
            click.echo(f"next: {command}")  # in one line, to be copied
    output.name_written()
    if found.problems:
        raise InvalidInput(*(f"{shortened(file)}: {line}" for line in found.problems))


@dataclass(frozen=True)
class RecordingOptions:
    """How a file of a motion is read, and the ground."""

    base: str | None = option(
        "--base", type=click.Choice(["floating", "fixed"]),
        help="Base of the robot.  [default: floating; fixed for human and testbed]",
    )  # fmt: skip
    rate: float | None = option("--rate", help="Rate of the frames [Hz]; an .npz file has it.")
    joints: str | None = option(
        "--joints", metavar=f"NAME,NAME,...|{BREADTH_FIRST}|{OF_MODEL}", help="Order of the joints "
        "in the file.  [default: the names in the file, or the order of the model]",
    )  # fmt: skip
    quaternion: str = option(
        "--quaternion", default="xyzw", type=click.Choice(["xyzw", "wxyz"]),
        help="Order of the base's quaternions in a .csv file.",
    )  # fmt: skip
    impact_at: float | None = option(
        "--impact-at", metavar="T",
        help="Time of an impact in the motion [s], across which nothing is smoothed.",
    )  # fmt: skip
    ground: float | None = option(
        "--ground",
        help="Height of the ground [m].  [default: 0; on a fixed base, as low as the foot]",
    )  # fmt: skip


@command("check-motion")
@click.argument("file", metavar="FILE", type=click.Path())
def check_motion(
    file: str,
    leg: LegOptions,
    recording: RecordingOptions,
    contact: PointOptions,
    ball: BallOptions,
    output: OutputOptions,
) -> None:
    """Compute the ball that a motion would strike in each frame, and the limits that it breaks.

    FILE is .csv (position of the base, quaternion, joints; of a fixed base the joints alone) or
    .npz. The whole robot moves. Broken limits are results: the exit code is 0.

    Example: kickdyn check-motion kick.csv --leg g1 --rate 50 --json kick.json --view kick.html
    """
    output.check(inputs=[file, leg.leg_name])
    robot, struck = leg.load(whole=True, base=recording.base), ball.load()
    joints = recording.joints
    with busy("reading the motion") as show:
        motion = read_motion(
            file, robot, rate=recording.rate, contact=recording.impact_at,
            joints=joints.split(",") if joints and "," in joints else joints,
            quaternion=recording.quaternion,
        )  # fmt: skip
        show("striking balls")
        found = check_recorded(
            motion, robot, struck, contact.contact(), ground=recording.ground
        )  # fmt: skip
    output.write_json(found.to_json())
    output.print_rows(motion, found)
    output.save_plot(found.plot)
    output.save_page(found)
    output.name_written(output.plot, output.view)
