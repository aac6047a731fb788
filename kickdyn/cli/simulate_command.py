"""The command `kickdyn simulate`: where the ball of a scene ends, and how exact that is."""

from typing import Any

import click

from kickdyn.cli.command import Command, busy, print_wrapped
from kickdyn.cli.option_groups import JsonOptions, scene_argument, takes
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
    pass_to_runner, robocup_carpet, robot_chip, rolling_ball_to_goal, volley, volley_of_cross,
    wet_grass_pass.

    Example: kickdyn simulate free_kick --tolerance 0.01
    """
    output.check(inputs=[scene_file])
    scene = load_scene(scene_file)
    with busy("simulating"):
        answer = simulate_scene(scene, None if exact else tolerance)
        document = _document(answer)
    output.write_json(document)
    if output.prints:
        print_wrapped(answer.text(times=True))
    output.name_written()


JOINT_NUMBERS = ("force", "force_deviation", "moment", "moment_deviation")
"""Numbers of `JointUncertainty` in JSON [N s, N m s]."""


def numbers_of(answer: Simulation) -> dict[str, Any]:
    """Return the numbers of a simulation for JSON, in SI units; null where one is not finite."""
    passage, score = answer.passage, answer.score
    return {
        "scene": answer.scene.name,
        "restitution": answer.impact.restitution,
        "restitution_given": answer.scene.contact.restitution,
        "ball_velocity": answer.launch.velocity.tolist(),
        "ball_spin": answer.launch.spin.tolist(),
        "end": answer.end.position.tolist(),
        "time": float(answer.end.time),
        "error": finite(answer.error),
        "wall": passage and {"above": passage.above, "beside": passage.beside},
        "goal_mouth": score and score._asdict(),
        "warnings": list(answer.warnings),
    }


def _document(answer: Simulation) -> dict[str, Any]:
    """Return the numbers of a simulation, its tolerance and its effects."""
    numbers = numbers_of(answer)
    for name in ("tolerance", "within_tolerance", "status", "method", "evaluations", "seconds"):
        numbers[name] = getattr(answer, name)
    for name in ("model_error", "numerical_error", "end_deviation"):
        numbers[name] = finite(getattr(answer, name))
    numbers["joint_impulses"] = answer.launch_spread and {
        name: {key: finite(getattr(joint, key)) for key in JOINT_NUMBERS}
        for name, joint in answer.launch_spread.joints.items()
    }
    numbers["effects"] = [
        {
            "effect": size.effect,
            "modelled": size.effect in answer.modelled,
            "negligible": size.effect in answer.negligible,
            "size": finite(size.end),
            "seconds": size.seconds,
        }
        for size in answer.effects
    ]
    return numbers
