"""The command `kickdyn simulate`: where the ball of a scene ends, and how exact that is."""

from typing import Any

import click

from kickdyn.cli.command import Command, busy
from kickdyn.cli.option_groups import JsonOptions, scene_argument, takes
from kickdyn.core.console import screen_width, wrapped
from kickdyn.core.files import finite
from kickdyn.scene.simulate import Simulation
from kickdyn.scene.simulate import simulate as simulate_scene
from kickdyn.scene.toml_reader import load_scene


@click.command("simulate", Command)
@scene_argument
@click.option(
    "--tolerance",
    default=0.05,
    show_default=True,
    help="Largest error of the ball's final position [m].",
)
@click.option("--exact", is_flag=True, help="Model all effects, whatever the tolerance.")
@takes(output=JsonOptions)
def simulate(scene_file: str, tolerance: float, exact: bool, output: JsonOptions) -> None:
    """Simulate a scene file to a tolerance, and print its error budget.

    SCENE is a TOML file, or the name of one that comes with kickdyn: free_kick, paper_kick,
    robocup_carpet, robot_chip, volley, wet_grass_pass.

    Example: kickdyn simulate free_kick --tolerance 0.01
    """
    output.check(inputs=[scene_file])
    scene = load_scene(scene_file)
    with busy("simulating"):
        answer = simulate_scene(scene, None if exact else tolerance)
        document = _document(answer)
    output.write_json(document)
    if output.prints:
        width = screen_width()
        click.echo("\n".join(wrapped(line, width, indent=8) for line in str(answer).splitlines()))
    output.name_written()


def _document(answer: Simulation) -> dict[str, Any]:
    """Return the numbers of the answer; a number that is not finite is null."""
    return {
        "scene": answer.scene.name,
        "tolerance": answer.tolerance,
        "within_tolerance": answer.within_tolerance,
        "status": answer.status,
        "end": answer.end.position.tolist(),
        "time": float(answer.end.time),
        "ball_velocity": answer.launch.velocity.tolist(),
        "ball_spin": answer.launch.spin.tolist(),
        "error": finite(answer.error),
        "model_error": finite(answer.model_error),
        "numerical_error": finite(answer.numerical_error),
        "end_deviation": finite(answer.end_deviation),
        "method": answer.method,
        "restitution": answer.impact.restitution,
        "restitution_given": answer.scene.contact.restitution,
        "evaluations": answer.evaluations,
        "effects": [
            {
                "effect": name,
                "modelled": name in answer.modelled,
                "negligible": name in answer.negligible,
                "size": finite(size),
            }
            for name, size in answer.effect_sizes.items()
        ],
        **answer.pitch_numbers(),
        "warnings": [*answer.scene.notes, *answer.warnings],
    }
