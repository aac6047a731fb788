"""The command `kickdyn check`: what kickdyn sees in a file, and what comes next."""

from dataclasses import replace

import click

from kickdyn.cli.check_file import check as check_file
from kickdyn.cli.command import Command, print_wrapped
from kickdyn.cli.option_groups import JsonOptions, takes
from kickdyn.errors import InvalidInput, shortened


@click.command("check", Command)
@click.argument("file", metavar="FILE", type=click.Path())
@click.option("--package-dir", "package_dirs", multiple=True, metavar="DIR",
              type=click.Path(exists=True, file_okay=False),
              help="ROS package with meshes of a robot, or a folder that contains it; "
              "repeatable.")  # fmt: skip
@takes(output=JsonOptions)
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
        shown = replace(found, problems=(), commands=())
        print_wrapped("\n".join(repr(shown).splitlines()[1:]), indent=8)
        for command in found.commands:
            click.echo(f"next: {command}")  # in one line, to be copied
    output.name_written()
    if found.problems:
        raise InvalidInput(*(f"{shortened(file)}: {line}" for line in found.problems))
