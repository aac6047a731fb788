"""The command `kickdyn tune-mujoco`: a ball for MuJoCo that bounces as kickdyn's."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import click
import numpy as np
from click.core import ParameterSource

from kickdyn.cli.command import Command, busy, offers, print_wrapped, warn
from kickdyn.cli.leg_options import LegOptions, joints_at_zero
from kickdyn.cli.option_groups import (
    BallOptions,
    FootOptions,
    JsonOptions,
    PointOptions,
    option,
    scene_names,
    takes,
)
from kickdyn.core.files import replacing
from kickdyn.errors import InvalidInput
from kickdyn.impact.collide import CONTACT_TIME
from kickdyn.robot.leg import Leg
from kickdyn.robot.mjcf_file import MjcfFile, find_body
from kickdyn.scene.scene import Compliance, Scene
from kickdyn.scene.toml_reader import load_scene
from kickdyn.simulators.mujoco_fit import MujocoIntegrator
from kickdyn.simulators.tune_mujoco import MujocoTuning
from kickdyn.simulators.tune_mujoco import tune_mujoco as tune_contact
from kickdyn.sweeps.grid import read_postures

PLAIN = (
    *("timestep", "integrator", "solref", "solimp", "friction", "solreffriction"),
    *("condim", "margin", "contact_time", "wanted_contact_time", "tolerance", "within_tolerance"),
    "warnings",
)
"""Attributes of `MujocoTuning` that JSON can hold as they are."""


@dataclass(frozen=True)
class MujocoOptions:
    """How MuJoCo simulates the kick, and how exact the tuned contact must be."""

    contact_time: float = option(
        "--contact-time", default=CONTACT_TIME, show_default=True,
        help="Time for which the contact force acts [s].",
    )  # fmt: skip
    timestep: float = option(
        "--timestep", default=0.002, show_default=True, help="Time step of MuJoCo [s]."
    )
    integrator: str = option(
        "--integrator", default="implicitfast", show_default=True,
        type=click.Choice([kind.value for kind in MujocoIntegrator]), help="Integrator of MuJoCo.",
    )  # fmt: skip
    tolerance: float = option(
        "--tolerance", default=0.03, show_default=True,
        help="Largest accepted relative error of the ball's speed.",
    )  # fmt: skip
    feet: tuple[str, ...] = option(
        "--foot", multiple=True, metavar="NAME",
        help="Geom of your robot that strikes the ball, for the contact pair with friction; "
        "repeatable.  [default: the one of --frame in an MJCF file, else foot]",
    )  # fmt: skip


@dataclass(frozen=True)
class MjcfOptions(JsonOptions):
    """Where the ball, the whole model and the numbers are written."""

    out: str | None = option(
        "--out", metavar="FILE", type=click.Path(),
        help="Write the ball as MJCF, for an <include>; - is stdout.",
    )  # fmt: skip
    scene_out: str | None = option(
        "--scene-out", metavar="FILE", type=click.Path(),
        help="Write a whole MJCF model: the leg and the ball just before they touch.",
    )  # fmt: skip

    def check(self, *files: str | None, inputs: Iterable[str | None] = ()) -> None:
        """Raise `InvalidInput` unless the files named by options, and `files`, can be written."""
        if self.out == "-" and not self.prints:
            raise InvalidInput("--out and --json are both -: only one of them can be stdout")
        named = None if self.out == "-" else self.out
        super().check(named, self.scene_out, *files, inputs=inputs)


@click.command("tune-mujoco", Command)
@click.argument("scene_file", metavar="[SCENE]", required=False,
                shell_complete=offers(scene_names, files=True))  # fmt: skip
@takes(leg=LegOptions)
@click.option("--joint", "joints", multiple=True, metavar="NAME=VALUE",
              shell_complete=offers(joints_at_zero),
              help="Value of a joint [deg; m for prismatic joints]; repeatable.  "
              "[default: 0, or its ref in an MJCF file]")  # fmt: skip
@takes(
    foot=FootOptions, contact=PointOptions, ball=BallOptions, mujoco=MujocoOptions,
    output=MjcfOptions, settings={"speed": {"default": 5.0}, "attack": {"default": 0.0}},
)  # fmt: skip
def tune_mujoco(
    scene_file: str | None,
    leg: LegOptions,
    joints: tuple[str, ...],
    foot: FootOptions,
    contact: PointOptions,
    ball: BallOptions,
    mujoco: MujocoOptions,
    output: MjcfOptions,
) -> None:
    """Find contact parameters with which MuJoCo launches the ball as kickdyn does.

    The kick is described by the options of a leg, or by SCENE: a TOML file, or the name of a scene
    that comes with kickdyn.
    The leg may be an MJCF file. Its joints move with the least kinetic energy that gives the foot
    its velocity. For a scene with an instantaneous impact, the contact time is 10 ms.

    Example: kickdyn tune-mujoco --leg human --joint knee=30 --timestep 0.002 --out ball.xml
    """
    output.check(inputs=[scene_file, leg.leg_name])
    _check_source(scene_file)
    if scene_file is not None:
        scene = load_scene(scene_file)
    else:
        robot = leg.load()
        posture = robot.posture(robot.configuration(_angles(robot, joints)))
        posture = posture.with_contact_offset(contact.offset)
        warn(posture.warnings)
        v = posture.joint_velocity(foot.velocity)
        scene = Scene(
            posture, v, ball.load(), contact.contact(foot.direction),
            Compliance(contact_time=mujoco.contact_time), name=robot.name,
        )  # fmt: skip
    compliance = Compliance()
    if isinstance(scene.law, Compliance):
        compliance = scene.law
    elif scene.law != "newton":
        raise InvalidInput(
            f"law is {scene.law!r}: a contact of MuJoCo is tuned for 'newton', or for a "
            "contact time"
        )
    if compliance.stiffness is not None:
        raise InvalidInput(
            f"stiffness is {compliance.stiffness!r}: a contact of MuJoCo is tuned for a contact "
            "time, contact_time_s"
        )
    feet = mujoco.feet or (find_foot(scene.leg) if scene.contact.friction else ())
    with busy("tuning"):
        tuning = tune_contact(
            scene.posture, scene.v, scene.ball, scene.contact, timestep=mujoco.timestep,
            integrator=mujoco.integrator, contact_time=compliance.contact_time or CONTACT_TIME,
            dissipation=compliance.dissipation, tolerance=mujoco.tolerance,
            ball_velocity=scene.incoming.velocity, ball_spin=scene.incoming.spin,
        )  # fmt: skip
    model = tuning.mjcf(*feet)
    for file, text in ((output.out, model), (output.scene_out, tuning.scene)):
        if file not in (None, "-"):
            with replacing(file) as draft:
                draft.write_text(text, encoding="utf-8")
    output.write_json(_document(scene.name, tuning, model))
    if output.out == "-":
        click.echo(model, nl=False)
    elif output.prints:
        print_wrapped(str(tuning))
        output.name_written(output.out, output.scene_out)


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


def find_foot(leg: Leg) -> tuple[str, ...]:
    """Return the geom of a leg's contact frame in its MJCF; none where the leg has no such file.

    Raises `InvalidInput` if the frame is a body or a site of a body that has several geoms, or one
    without a name.
    """
    if not isinstance(leg.file, MjcfFile):
        return ()
    compiled, frame = leg.file.compile(), leg.frame
    geoms = np.flatnonzero(compiled.geom_bodyid == find_body(compiled, frame))
    names = [str(compiled.geom(int(geom)).name) for geom in geoms]
    if frame in names:
        return (frame,)
    if len(names) == 1 and names[0]:
        return (names[0],)
    known = ", ".join(filter(None, names)) or "none with a name"
    raise InvalidInput(
        f"which geom of {frame!r} strikes the ball? MuJoCo needs its name for friction: name it "
        f"with --foot (there are {known}), or choose --friction 0"
    )


def _document(name: str, tuning: MujocoTuning, model: str) -> dict[str, Any]:
    """Return the numbers, and the MJCF of the ball."""
    return {
        "scene": name,
        **{key: getattr(tuning, key) for key in PLAIN},
        "errors": [error._asdict() for error in tuning.errors],
        "goals": [{**goal._asdict(), "met": goal.met} for goal in tuning.goals],
        "mjcf": model,
    }
