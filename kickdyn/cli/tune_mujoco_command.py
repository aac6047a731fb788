"""The command `kickdyn tune-mujoco`: a ball for MuJoCo that bounces as kickdyn's."""

import math
from collections.abc import Sequence
from typing import Any

import click
import numpy as np
from click.core import ParameterSource

from kickdyn.ball import Ball
from kickdyn.cli.ball_option import ball_option
from kickdyn.cli.command import Command, busy, check_files, offers, warn
from kickdyn.cli.leg_options import LegOptions, joints_to_set, leg_options
from kickdyn.cli.number_options import foot_options, offset_option
from kickdyn.cli.restitution_option import restitution_option
from kickdyn.cli.scene_argument import scene_names
from kickdyn.contact import Contact
from kickdyn.core.console import screen_width, wrapped
from kickdyn.core.files import replacing, write_json
from kickdyn.errors import InvalidInput
from kickdyn.impact.collide import CONTACT_TIME
from kickdyn.restitution import Restitution
from kickdyn.robot.leg import Leg
from kickdyn.robot.mjcf_file import MjcfFile
from kickdyn.robot.names import unknown
from kickdyn.scene.scene import Scene
from kickdyn.scene.toml_reader import load_scene
from kickdyn.simulators.mujoco_fit import MujocoIntegrator
from kickdyn.simulators.tune_mujoco import MujocoTuning
from kickdyn.simulators.tune_mujoco import tune_mujoco as tune_contact
from kickdyn.sweeps.grid import read_postures


@click.command("tune-mujoco", Command)
@click.argument("scene_file", metavar="[SCENE]", required=False,
                shell_complete=offers(scene_names, files=True))  # fmt: skip
@leg_options
@click.option("--joint", "joints", multiple=True, metavar="NAME=VALUE",
              shell_complete=offers(joints_to_set),
              help="Value of a joint [deg; m for prismatic joints]; repeatable.  "
              "[default: 0, or its ref in an MJCF file]")  # fmt: skip
@offset_option
@foot_options(speed=5.0, attack=0.0)
@restitution_option
@click.option("--friction", default=0.4, show_default=True, help="Coulomb's coefficient.")
@ball_option
@click.option("--contact-time", default=CONTACT_TIME, show_default=True,
              help="Time for which the contact force acts [s].")  # fmt: skip
@click.option("--timestep", default=0.002, show_default=True, help="Time step of MuJoCo [s].")
@click.option(
    "--integrator",
    default="implicitfast",
    show_default=True,
    type=click.Choice([kind.value for kind in MujocoIntegrator]),
    help="Integrator of MuJoCo.",
)
@click.option(
    "--tolerance",
    default=0.03,
    show_default=True,
    help="Largest accepted relative error of the ball's speed.",
)
@click.option(
    "--foot",
    "feet",
    multiple=True,
    metavar="NAME",
    help="Geom of your robot that strikes the ball, for the contact pair with friction; "
    "repeatable.  [default: the one of --frame in an MJCF file, else foot]",
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
              help="Write the result as JSON; - is stdout.")  # fmt: skip
def tune_mujoco(
    scene_file: str | None,
    leg_options: LegOptions,
    joints: tuple[str, ...],
    offset: list[float] | None,
    speed: float,
    attack: float,
    restitution: Restitution,
    friction: float,
    ball: Ball,
    contact_time: float,
    timestep: float,
    integrator: str,
    tolerance: float,
    feet: tuple[str, ...],
    out: str | None,
    scene_out: str | None,
    json_file: str | None,
) -> None:
    """Find contact parameters with which MuJoCo launches the ball as kickdyn does.

    The kick is that of a leg, or of SCENE, a TOML file or the name of one that comes with kickdyn.
    The leg may be an MJCF file. Its joints move with the least kinetic energy that gives the foot
    its velocity. For a scene with an instantaneous impact, the contact time is 10 ms.

    Example: kickdyn tune-mujoco --leg human --joint knee=30 --timestep 0.002 --out ball.xml
    """
    if out == "-" and json_file == "-":
        raise InvalidInput("--out and --json are both -: only one of them can be stdout")
    inputs = [scene_file, leg_options.leg_name]
    check_files(None if out == "-" else out, scene_out, json_file=json_file, inputs=inputs)
    _check_source(scene_file)
    if scene_file is not None:
        scene = load_scene(scene_file)
    else:
        leg = leg_options.load()
        angle = math.radians(attack)
        direction = np.array([math.cos(angle), 0.0, math.sin(angle)])
        posture = leg.posture(leg.configuration(_angles(leg, joints))).with_contact_offset(offset)
        warn(posture.warnings)
        scene = Scene(
            leg, posture.q, posture.joint_velocity(speed * direction), ball,
            Contact(direction, restitution, friction, offset=offset), contact_time=contact_time,
            name=leg.name,
        )  # fmt: skip
    if scene.law != "newton":
        raise InvalidInput(
            f"law is {scene.law!r}: a contact of MuJoCo is tuned for 'newton', or for a "
            "contact time"
        )
    if scene.stiffness is not None:
        raise InvalidInput(
            f"stiffness is {scene.stiffness!r}: a contact of MuJoCo is tuned for a contact time, "
            "contact_time_s"
        )
    _check_feet(scene.leg, feet)
    if scene.contact.friction and not feet:
        feet = find_foot(scene.leg)
    with busy("tuning"):
        tuning = tune_contact(
            scene.posture, scene.v, scene.ball, scene.contact, timestep=timestep,
            integrator=integrator, contact_time=scene.contact_time or CONTACT_TIME,
            dissipation=scene.dissipation, tolerance=tolerance,
            ball_velocity=scene.ball_velocity, ball_spin=scene.ball_spin,
        )  # fmt: skip
    model = tuning.mjcf(*feet)
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


def _check_source(scene_file: str | None) -> None:
    """Raise `InvalidInput` unless either a scene or a leg is named on the command line."""
    context = click.get_current_context()
    given = {
        option.opts[0]
        for option in context.command.params
        if context.get_parameter_source(option.name or "") is ParameterSource.COMMANDLINE
    }
    if scene_file is None:
        if "--leg" not in given:
            raise InvalidInput("there is no kick: give a SCENE, or a leg with --leg")
        return
    ours = {"--timestep", "--integrator", "--tolerance", "--foot", "--out", "--scene-out", "--json"}
    of_kick = sorted(given - ours - {"scene_file"})
    if of_kick:
        raise InvalidInput(
            f"{' and '.join(of_kick)} cannot be named beside the scene {scene_file}, which has "
            "the whole kick"
        )


def _angles(leg: Leg, joints: Sequence[str]) -> dict[str, float]:
    """Return the values of joints that `--joint` names, and of others [rad; m].

    Joints of an MJCF file that are not named are where MuJoCo begins with them.
    """
    values = read_postures(leg, joints) if joints else {}
    for name, several in values.items():
        if len(several) != 1:
            raise InvalidInput(f"joint {name!r} has {len(several)} values: a kick has one posture")
    mimicking = {mimic.joint for mimic in leg.mimics}
    starts = leg.file.starts if isinstance(leg.file, MjcfFile) else {}
    free = {
        name: start
        for name, start in starts.items()
        if name in leg.joint_names and name not in mimicking
    }
    return free | {name: float(several[0]) for name, several in values.items()}


def _check_feet(leg: Leg, feet: Sequence[str]) -> None:
    """Raise `InvalidInput` for a name that no geom of the leg's MJCF file has."""
    if feet and isinstance(leg.file, MjcfFile):
        compiled = leg.file.compile()
        names = [str(compiled.geom(geom).name) for geom in range(compiled.ngeom)]
        for foot in feet:
            if foot not in names:
                known = [name for name in names if name]
                raise InvalidInput(unknown("geom", foot, leg.name, known))


def find_foot(leg: Leg) -> tuple[str, ...]:
    """Return the geom of a leg's contact frame in its MJCF; none where the leg has no such file.

    Raises `InvalidInput` if the frame is a body or a site of a body that has several geoms, or one
    without a name.
    """
    if not isinstance(leg.file, MjcfFile):
        return ()
    import mujoco  # an optional package

    model, frame = leg.file.compile(), leg.frame
    kinds = mujoco.mjtObj
    body = mujoco.mj_name2id(model, kinds.mjOBJ_BODY, frame)
    if body < 0 and (site := mujoco.mj_name2id(model, kinds.mjOBJ_SITE, frame)) >= 0:
        body = int(model.site_bodyid[site])
    if body < 0:
        return (frame,)
    names = [
        model.geom(geom).name for geom in range(model.ngeom) if model.geom_bodyid[geom] == body
    ]
    if len(names) == 1 and names[0]:
        return (names[0],)
    known = ", ".join(name for name in names if name) or "none with a name"
    raise InvalidInput(
        f"which geom of {frame!r} strikes the ball? MuJoCo needs its name for friction: name it "
        f"with --foot (there are {known}), or choose --friction 0"
    )


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
        "wanted_contact_time": tuning.wanted_contact_time,
        "errors": [error._asdict() for error in tuning.errors],
        "tolerance": tuning.tolerance,
        "within_tolerance": tuning.within_tolerance,
        "goals": [{**goal._asdict(), "met": goal.met} for goal in tuning.goals],
        "largest_timestep": tuning.largest_timestep,
        "second_push": tuning.second_push,
        "seconds": tuning.seconds,
        "warnings": list(tuning.warnings),
        "mjcf": model,
    }
