"""The options of command lines that say which leg kicks, and how it is held."""

import re
from collections.abc import Callable
from functools import wraps
from pathlib import Path
from typing import Any, NamedTuple

import click

from kickdyn.cli.command import offers, warn
from kickdyn.cli.named_legs import LEGS, load_leg
from kickdyn.core import validation
from kickdyn.errors import InvalidInput
from kickdyn.robot.constraints import Support
from kickdyn.robot.leg import Leg
from kickdyn.robot.model_validation import frame_id


class LegOptions(NamedTuple):
    """What the options of `leg_options` say.

    Attributes:
        leg_name: a name of `named_legs.LEGS`, or a file.
        frame: the contact frame; None is the default of `load_leg`.
        loops: pairs of frames' names.
        supports: that the robot stands on.
        package_dirs: folders for the meshes of a URDF file.
        locked: joints that do not move, with their values [deg; m for prismatic joints].
        stiff_joints: joints' names.
    """

    leg_name: str
    frame: str | None
    loops: tuple[tuple[str, str], ...]
    supports: tuple[Support, ...]
    package_dirs: tuple[str, ...]
    locked: dict[str, float]
    stiff_joints: tuple[str, ...]

    def load(self) -> Leg:
        """Return the leg, its warnings written to standard error.

        A leg that stands on a support has a floating base, which could not move otherwise.
        """
        base = "floating" if self.supports else "fixed"
        try:
            leg = load_leg(self.leg_name, self.frame, base, self.package_dirs, self.locked)
        except InvalidInput:
            if self.supports:  # a support that the leg has not explains more than a floating base
                fixed = load_leg(self.leg_name, self.frame, "fixed", self.package_dirs, self.locked)
                for support in self.supports:
                    frame_id(fixed.model, support.frame)
            raise
        if self.supports:
            leg = leg.with_supports(*self.supports)
        if self.loops:
            leg = leg.with_loops(*self.loops)
        if self.stiff_joints:
            leg = leg.with_stiff_joints(*self.stiff_joints)
        warn(leg.warnings)
        return leg


def _read_locked(_: click.Context, __: click.Option, texts: tuple[str, ...]) -> dict[str, float]:
    """Return the joints that `--lock` names, with their values [deg; m for prismatic joints]."""
    locked: dict[str, float] = {}
    for text in texts:
        name, _equals, value = text.rpartition("=")
        try:
            if not name or name in locked:
                raise ValueError
            locked[name] = validation.number(name, float(value))
        except ValueError:
            once = ", once for each joint" if name in locked else " [deg; m]"
            raise InvalidInput(f"--lock is {text!r}: it must be JOINT=VALUE{once}") from None
    return locked


def _read_loops(
    _: click.Context, __: click.Option, texts: tuple[str, ...]
) -> tuple[tuple[str, str], ...]:
    """Return the pairs of frames that `--loop` names."""
    loops = []
    for text in texts:
        first, colon, second = text.partition(":")
        if not (colon and first and second):
            raise InvalidInput(f"--loop is {text!r}: it must be two frames, A:B")
        loops.append((first, second))
    return tuple(loops)


def _read_supports(
    _: click.Context, __: click.Option, texts: tuple[str, ...]
) -> tuple[Support, ...]:
    """Return the supports that `--support` names."""
    supports = []
    for text in texts:
        frame, colon, friction = text.partition(":")
        try:
            supports.append(Support(frame, friction=float(friction) if colon else None))
        except ValueError:
            raise InvalidInput(
                f"--support is {text!r}: it must be a frame, or FRAME:FRICTION such as foot:0.6, "
                "with a finite friction of at least 0"
            ) from None
    return tuple(supports)


def _completed_leg(context: click.Context) -> Leg | None:
    """Return the leg that a command line names so far; None where it cannot be read."""
    name = context.params.get("leg_name") or "human"
    frames = [context.params.get("frame")]
    if Path(name).is_file():  # whose frames need not have the default's name
        text = Path(name).read_text("utf-8", errors="replace")
        frames += re.findall(r'<(?:link|body)\s[^>]*?name="([^"]+)"', text)[-1:]
    for frame in frames:
        try:
            return load_leg(name, frame)
        except (InvalidInput, OSError):
            pass
    return None


def joint_names(context: click.Context) -> list[str]:
    """Return the names of the joints of the leg that a command line names."""
    leg = _completed_leg(context)
    return [] if leg is None else [*leg.joint_names]


def joints_to_set(context: click.Context) -> list[str]:
    """Return the same names with an `=`, after which a value follows."""
    return [f"{name}=" for name in joint_names(context)]


def frame_names(context: click.Context) -> list[str]:
    """Return the names of the frames of the leg that a command line names."""
    leg = _completed_leg(context)
    frames = [] if leg is None else [frame.name for frame in leg.model.frames][1:]
    return [*dict.fromkeys(frames)]


_OPTIONS = (
    click.option("--leg", "leg_name", default="human", metavar="human|testbed|FILE|ROBOT",
                 show_default=True, shell_complete=offers(lambda _: LEGS, files=True),
                 help="A leg of kickdyn, a URDF or MJCF file, or the leg of a robot of the extra "
                 "kickdyn[robots] on a fixed base (g1, talos, ...)."),
    click.option("--frame", metavar="NAME", shell_complete=offers(frame_names),
                 help="Link or joint whose origin strikes the ball.  [default: toe; for a robot, "
                 "its right foot]"),
    click.option("--lock", "locked", multiple=True, metavar="JOINT=VALUE", callback=_read_locked,
                 shell_complete=offers(joints_to_set),
                 help="Lock a joint at a value [deg; m for prismatic joints], or all joints that a "
                 "pattern matches, as 'LFinger*=0'; repeatable."),
    click.option("--loop", "loops", multiple=True, metavar="A:B", callback=_read_loops,
                 shell_complete=offers(frame_names),
                 help="Close a kinematic loop, which a URDF file cannot have, by a ball joint "
                 "between the origins of two frames; repeatable."),
    click.option("--support", "supports", multiple=True, metavar="FRAME[:FRICTION]",
                 callback=_read_supports, shell_complete=offers(frame_names),
                 help="Foot that stands on the ground, and its coefficient of friction there. The "
                 "base then floats, and a robot has both legs; repeatable."),
    click.option("--stiff", "stiff_joints", multiple=True, metavar="JOINT",
                 shell_complete=offers(joint_names),
                 help="Joint whose velocity the impact does not change, as with a high gear ratio; "
                 "repeatable."),
    click.option("--package-dir", "package_dirs", multiple=True, metavar="DIR",
                 type=click.Path(exists=True, file_okay=False),
                 help="ROS package with meshes of a URDF file, or a folder that contains it; "
                 "repeatable."),
)  # fmt: skip


def leg_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Return a command with the options of a leg, which it takes as one argument `leg_options`."""

    @wraps(command)
    def with_options(*args: Any, **given: Any) -> Any:
        options = LegOptions(**{name: given.pop(name) for name in LegOptions._fields})
        return command(*args, leg_options=options, **given)

    for option in reversed(_OPTIONS):
        with_options = option(with_options)
    return with_options
