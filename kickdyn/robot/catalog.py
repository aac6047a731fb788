"""Legs by the names that command lines have for them."""

from __future__ import annotations

from pathlib import Path

from kickdyn.core.files import exists
from kickdyn.errors import InvalidInput, UrdfError
from kickdyn.robot.example_robots import ROBOTS
from kickdyn.robot.leg import Leg
from kickdyn.robot.urdf_file import shipped_urdf

SHIPPED = {"human": "leg_human.urdf", "testbed": "leg_testbed.urdf"}

LEGS = tuple(dict.fromkeys([*SHIPPED, *ROBOTS]))
"""Names of legs: ours first, which hide a robot of the same name."""


def load_leg(name: str, frame: str | None = None) -> Leg:
    """Return one of the shipped legs, a robot's, or a URDF file's; raise `InvalidInput`."""
    if name in SHIPPED:
        return Leg.from_urdf(shipped_urdf(SHIPPED[name]), frame or "toe")
    if name in ROBOTS:
        return _limb(Leg.from_robot(name, frame, legs_only=True))
    if not exists(name) and not Path(name).suffix:
        raise InvalidInput(f"leg {name!r} is neither {', '.join(LEGS)} nor a file")
    try:
        return Leg.from_urdf(name, frame or "toe")
    except UrdfError:
        raise
    except InvalidInput as error:  # what else can be wrong is the frame
        said = str(error) if frame else f"no --frame is named, and {error}"
        raise InvalidInput(said) from None


def _limb(leg: Leg) -> Leg:
    """Lock what does not move the foot: on a fixed base it has no say."""
    model = leg.workspace.model
    moving = {model.names[joint] for joint in model.supports[leg.contact_joint]}
    return leg.locked({name: 0.0 for name in leg.joint_names if name not in moving})
