"""`kickdyn view`: a scene file as a 3-D page or a picture."""

from typing import Any

import click
import numpy as np

from kickdyn.cli.command import Command, busy, check_page_name, print_wrapped, warn
from kickdyn.cli.option_groups import JsonOptions, scene_argument, takes
from kickdyn.cli.simulate_command import numbers_of
from kickdyn.core import validation
from kickdyn.core.files import finite
from kickdyn.errors import InvalidInput
from kickdyn.impact.impact_result import Impact
from kickdyn.scene.simulate import Simulation, simulate_as_instant
from kickdyn.scene.toml_reader import load_scene


@click.command("view", Command)
@scene_argument
@click.option("--out", metavar="FILE.html", type=click.Path(), help="Write the 3-D page.")
@click.option("--png", metavar="FILE.png", type=click.Path(),
              help="Write a picture of the page; needs Chromium.")  # fmt: skip
@click.option("--at", "moment", type=float,
              help="Time since the impact that the picture shows [s].  [default: 0]")  # fmt: skip
@takes(output=JsonOptions)
def view(
    scene_file: str, out: str | None, png: str | None, moment: float | None, output: JsonOptions
) -> None:
    """Show a scene file: leg, ball, impulses, flight, and its wall or goal.

    SCENE is a TOML file, or the name of one that comes with kickdyn: free_kick, paper_kick,
    pass_to_runner, robocup_carpet, robot_chip, rolling_ball_to_goal, volley, volley_of_cross,
    wet_grass_pass.

    All effects of the scene are modelled, except that a contact of finite time is shown as an
    instantaneous impact; the printed error states how far that moves the end of the flight.

    Example: kickdyn view free_kick --out kick.html --png kick.png
    """
    pages = [file for file in (out, png) if file is not None]
    if not pages and output.json_file is None:
        raise InvalidInput("there is no output: give --out, --png or --json")
    if moment is not None and png is None:
        raise InvalidInput("--at is for a picture: give --png as well")
    for file in pages:
        check_page_name(file)
    output.check(*pages, inputs=[scene_file])
    from kickdyn.view.page import page  # imports meshcat, for which --help need not wait

    scene = load_scene(scene_file)
    with busy("simulating"):
        simulation = simulate_as_instant(scene)
    if moment is not None:
        validation.number("at", moment, at_least=0, at_most=float(simulation.end.time), unit="s")
    output.write_json(_document(simulation))
    if output.prints:
        print_wrapped(simulation.summary)
    if pages:
        with busy("drawing"):
            made_page = page(simulation)
            for file in pages:
                made_page.save(file, moment or 0.0)
        warn(made_page.warnings)
    output.name_written(*pages)


def _document(simulation: Simulation) -> dict[str, Any]:
    """Return the numbers of a scene: SI units, joint angles in degrees as given."""
    from kickdyn.view.kick_scene import joint_impulses_in_world

    impact = simulation.impact
    assert isinstance(impact, Impact)
    leg, q = impact.posture.leg, impact.posture.q
    postures = {"angles_deg": leg.angles_deg(q), "positions_m": leg.positions_m(q)}
    impulses = joint_impulses_in_world(impact)
    return numbers_of(simulation) | {
        "leg": leg.name,
        "frame": leg.frame,
        **{
            key: {name: round(value, 9) + 0.0 for name, value in values.items()}
            for key, values in postures.items()
            if values
        },
        "impulse": impact.impulse.tolist(),
        "joint_impulses": {name: impulse.tolist() for name, _, impulse in impulses},
        "foot_speed": float(np.linalg.norm(impact.foot_velocity)),
        "launch_angle": float(simulation.launch.elevation),
        "neglected": dict.fromkeys(simulation.neglected, finite(simulation.model_error)),
    }
