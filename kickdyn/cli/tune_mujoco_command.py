"""The command `kickdyn tune-mujoco`: a ball for MuJoCo that bounces as kickdyn's."""

from collections.abc import Iterable
from dataclasses import dataclass

import click

from kickdyn.cli.commands import busy, print_wrapped
from kickdyn.cli.option_groups import JsonOptions, command, option, scene_argument
from kickdyn.core.files import attributes, replacing
from kickdyn.errors import InvalidInput
from kickdyn.impact.force_model import CONTACT_TIME
from kickdyn.robot.leg import Leg
from kickdyn.robot.mjcf_file import MjcfFile, find_body
from kickdyn.robot.names import unknown
from kickdyn.scene.scene import Compliance
from kickdyn.scene.toml_reader import load_scene
from kickdyn.simulators.mujoco_fit import MujocoIntegrator
from kickdyn.simulators.tune_mujoco import tune_mujoco as tune_contact

NUMBERS = (
    "timestep integrator solref solimp friction solreffriction condim margin contact_time "
    "wanted_contact_time tolerance within_tolerance warnings errors"
)
"""Attributes of `MujocoTuning` that are written as JSON."""


@dataclass(frozen=True)
class MujocoOptions:
    """How MuJoCo simulates the kick, and how exact the tuned contact must be."""

    timestep: float = option("--timestep", default=0.002, help="Time step of MuJoCo [s].")
    integrator: str = option(
        "--integrator", default="implicitfast", help="Integrator of MuJoCo.",
        type=click.Choice([kind.value for kind in MujocoIntegrator]),
    )  # fmt: skip
    tolerance: float = option(
        "--tolerance", default=0.03, help="Largest accepted relative error of the ball's speed."
    )
    feet: tuple[str, ...] = option(
        "--foot", multiple=True, metavar="NAME",
        help="Geom of your robot that strikes the ball, for the contact pair with friction; "
        "repeatable.  [default: the one of the leg's frame in an MJCF file, else foot]",
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
        super().check(None if self.out == "-" else self.out, self.scene_out, *files, inputs=inputs)


@command("tune-mujoco")
@scene_argument
def tune_mujoco(scene_file: str, mujoco: MujocoOptions, output: MjcfOptions) -> None:
    """Find contact parameters with which MuJoCo launches the ball as kickdyn does.

    The kick is described by SCENE: a TOML file, whose leg may be an MJCF file, or the name of a
    scene that comes with kickdyn. For an instantaneous impact, the contact time is 10 ms.

    Example: kickdyn tune-mujoco volley --timestep 0.002 --out ball.xml
    """
    output.check(inputs=[scene_file])
    scene = load_scene(scene_file)
    compliance = scene.law if isinstance(scene.law, Compliance) else Compliance()
    if scene.law not in ("newton", compliance):
        what = "a contact of MuJoCo is tuned for 'newton', or for a contact time"
        raise InvalidInput(f"law is {scene.law!r}: {what}")
    if compliance.stiffness is not None:
        raise InvalidInput(
            f"stiffness is {compliance.stiffness!r}: a contact of MuJoCo is tuned for a contact "
            "time, contact_time_s"
        )
    feet = striking_geoms(scene.leg, mujoco.feet, needed=scene.contact.friction > 0.0)
    with busy("tuning"):
        tuning = tune_contact(
            scene.posture, scene.v, scene.ball, scene.contact, timestep=mujoco.timestep,
            integrator=mujoco.integrator, contact_time=compliance.contact_time or CONTACT_TIME,
            tolerance=mujoco.tolerance, ball_velocity=scene.incoming.velocity,
            ball_spin=scene.incoming.spin,
        )  # fmt: skip
    model = tuning.mjcf(*feet)
    for file, text in ((output.out, model), (output.scene_out, tuning.scene)):
        if file not in (None, "-"):
            with replacing(file) as draft:
                draft.write_text(text, encoding="utf-8")
    document = {"scene": scene.name, **attributes(tuning, NUMBERS), "mjcf": model}
    document["goals"] = [{**goal._asdict(), "met": goal.met} for goal in tuning.goals]
    output.write_json(document)
    if output.out == "-":
        click.echo(model, nl=False)
    elif output.prints:
        print_wrapped(str(tuning))
        output.name_written(output.out, output.scene_out)


def striking_geoms(leg: Leg, names: tuple[str, ...], *, needed: bool) -> tuple[str, ...]:
    """Return the geoms of a leg's MJCF that strike the ball: those named, or the contact frame's.

    Without such a file there are only those named. Raises `InvalidInput` for a name that is no
    geom; or, if a geom is needed, for a frame that is a body or a site of a body that has several
    geoms, or one without a name.
    """
    if not isinstance(leg.file, MjcfFile):
        return names
    compiled, frame = leg.file.compile(), leg.frame
    every = [str(compiled.geom(i).name) for i in range(compiled.ngeom)]
    for name in names:
        if name not in every:
            raise InvalidInput(unknown("geom", name, leg.file.name, [*filter(None, every)]))
    if names or not needed:
        return names
    body = find_body(compiled, frame)
    geoms = [name for name, owner in zip(every, compiled.geom_bodyid, strict=True) if owner == body]
    if frame in geoms:
        return (frame,)
    if len(geoms) == 1 and geoms[0]:
        return (geoms[0],)
    choices = ", ".join(filter(None, geoms)) or "none with a name"
    raise InvalidInput(
        f"which geom of {frame!r} strikes the ball? MuJoCo needs its name for friction: name it "
        f"with --foot (there are {choices}), or choose a contact without friction"
    )
