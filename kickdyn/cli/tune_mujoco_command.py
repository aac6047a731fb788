"""The command `kickdyn tune-mujoco`: a ball for MuJoCo that bounces as that of a scene."""

from typing import Any

import click

from kickdyn.accuracy.tune_mujoco import MujocoIntegrator, MujocoTuning
from kickdyn.accuracy.tune_mujoco import tune_mujoco as tune_contact
from kickdyn.cli.command import busy
from kickdyn.core.console import screen_width, wrapped
from kickdyn.core.files import check_outputs, replacing, write_json
from kickdyn.errors import InvalidInput
from kickdyn.impact.laws import ImpactLaw
from kickdyn.scene.toml_reader import load_scene


@click.command("tune-mujoco", context_settings={"help_option_names": ["-h", "--help"]})
@click.argument("scene_file", metavar="SCENE")
@click.option("--timestep", default=0.002, show_default=True, help="Of the simulation [s].")
@click.option(
    "--integrator",
    default="implicitfast",
    show_default=True,
    type=click.Choice([kind.value for kind in MujocoIntegrator]),
    help="Of MuJoCo.",
)
@click.option(
    "--tolerance",
    default=0.03,
    show_default=True,
    help="Error of the ball's velocity that is accepted, relative.",
)
@click.option(
    "--foot",
    default="foot",
    show_default=True,
    metavar="NAME",
    help="Geom of your robot that strikes the ball; a contact with friction names it.",
)
@click.option(
    "--out", metavar="FILE", help="Write the ball as MJCF, for an <include>; - is stdout."
)
@click.option(
    "--scene-out",
    metavar="FILE",
    help="Write a whole MJCF model: the leg and the ball just before they touch.",
)
@click.option("--json", "json_file", metavar="FILE",
              help="Write the numbers; - is stdout.")  # fmt: skip
def tune_mujoco(
    scene_file: str,
    timestep: float,
    integrator: str,
    tolerance: float,
    foot: str,
    out: str | None,
    scene_out: str | None,
    json_file: str | None,
) -> None:
    """Find the contact with which a ball in MuJoCo leaves the foot as in a scene.

    SCENE is a TOML file, or the name of one that comes with kickdyn. Its `contact_time_s` is that
    of the contact; without one, the kick of an instant is sought. Its leg may be an MJCF file.

    Example: kickdyn tune-mujoco free_kick --timestep 0.002 --out ball.xml
    """
    if out == "-" and json_file == "-":
        raise InvalidInput("--out and --json are both -: only one of them can be stdout")
    check_outputs(None if out == "-" else out, scene_out, json_file=json_file)
    scene = load_scene(scene_file)
    if scene.law != ImpactLaw.NEWTON:
        raise InvalidInput(
            f"law is {scene.law.value!r}: a contact of MuJoCo is tuned for 'newton', or for a "
            "contact time"
        )
    if scene.stiffness is not None:
        raise InvalidInput(
            f"stiffness is {scene.stiffness!r}: a contact of MuJoCo is tuned for a contact time, "
            "contact_time_s"
        )
    with busy("tuning"):
        tuning = tune_contact(
            scene.posture, scene.v, scene.ball, scene.contact, timestep=timestep,
            integrator=integrator, contact_time=scene.contact_time, tolerance=tolerance,
            ball_velocity=scene.ball_velocity, ball_spin=scene.ball_spin,
        )  # fmt: skip
    model = tuning.mjcf(foot)
    written = {out: model, scene_out: tuning.scene}
    for file, text in written.items():
        if file not in (None, "-"):
            with replacing(file) as draft:
                draft.write_text(text, encoding="utf-8")
    if json_file is not None:
        write_json(json_file, _document(scene.name, tuning, model))
    if out == "-":
        click.echo(model, nl=False)
    elif json_file != "-":
        width = screen_width()
        click.echo("\n".join(wrapped(line, width, indent=8) for line in str(tuning).splitlines()))
        for file in (out, scene_out, json_file):
            if file is not None:
                click.echo(f"wrote {file}")


def _document(name: str, tuning: MujocoTuning, model: str) -> dict[str, Any]:
    """Return the numbers, and the MJCF of the ball."""
    return {
        "scene": name,
        "timestep": tuning.timestep,
        "integrator": tuning.integrator,
        "solref": list(tuning.solref),
        "solref_time": None if tuning.solref_time is None else list(tuning.solref_time),
        "solimp": list(tuning.solimp),
        "friction": tuning.friction,
        "solreffriction": list(tuning.solreffriction),
        "condim": tuning.condim,
        "margin": tuning.margin,
        "contact_time": tuning.contact_time,
        "errors": [error._asdict() for error in tuning.errors],
        "tolerance": tuning.tolerance,
        "within_tolerance": tuning.within_tolerance,
        "largest_timestep": tuning.largest_timestep,
        "seconds": tuning.seconds,
        "warnings": list(tuning.warnings),
        "mjcf": model,
    }
