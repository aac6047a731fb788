"""Drives of joints, rotors behind gears with their limits, and the files that list them."""

from collections.abc import Mapping
from dataclasses import dataclass
from os import PathLike
from pathlib import Path

from kickdyn.core import validation
from kickdyn.core.files import read_toml, shipped
from kickdyn.errors import FaultyFile, InvalidInput

MAX_REFLECTED_INERTIA = 10.0
"""Largest inertia of a rotor as seen from its joint [kg m2; kg for prismatic joints]."""


@dataclass(frozen=True)
class Drive:
    r"""The motor of a joint, behind a gear.

    The rotor turns n times as fast as the joint, and adds the reflected inertia :math:`J n^2` to
    the joint's entry of M. Its small angular momentum along other axes is neglected.

    Attributes:
        rotor_inertia: J, of the rotor about its own axis [kg m2].
        gear: n, turns of the rotor per turn of the joint; 1 if the inertia is that at the joint [1;
            rad/m for prismatic joints].
        torque_limit: largest torque at the joint [N m; N if prismatic]; None keeps the file's.
        speed_limit: largest speed of the joint [rad/s; m/s if prismatic]; None keeps the file's.
        friction: of the gear, a torque against the joint's motion, which holds a joint at rest up
            to this size [N m; N if prismatic]; it acts in a contact that takes time, `collide`.
        stiffness: of position control, whose reference moves on with the velocity before the impact
            [N m/rad; N/m if prismatic]; likewise.

    Raises:
        InvalidInput: a value that is not finite, negative, a gear of 0, or a reflected inertia
            above 10 kg m2.
    """

    rotor_inertia: float
    gear: float = 1.0
    torque_limit: float | None = None
    speed_limit: float | None = None
    friction: float = 0.0
    stiffness: float = 0.0

    def __post_init__(self) -> None:
        validation.number("rotor inertia", self.rotor_inertia, at_least=0, unit="kg m2")
        if not validation.number("gear", self.gear):
            raise InvalidInput(
                "gear is 0: it must be the number of rotor turns per turn of the joint"
            )
        if self.reflected_inertia > MAX_REFLECTED_INERTIA:
            raise InvalidInput(
                f"rotor inertia times gear squared is {self.reflected_inertia:g} kg m2: it must be "
                f"at most {MAX_REFLECTED_INERTIA:g} kg m2; is the gear already in the inertia?"
            )
        for name in ("torque_limit", "speed_limit"):
            if getattr(self, name) is not None:
                validation.number(name.replace("_", " "), getattr(self, name), at_least=0)
        validation.number("friction", self.friction, at_least=0, unit="N m")
        validation.number("stiffness", self.stiffness, at_least=0, unit="N m/rad")

    @property
    def reflected_inertia(self) -> float:
        r"""Inertia of the rotor as seen from the joint, :math:`J n^2` [kg m2; kg if prismatic]."""
        return self.rotor_inertia * self.gear * self.gear  # a power overflows with an exception


KEYS = {
    "rotor_inertia_kg_m2": "rotor_inertia",
    "gear": "gear",
    "torque_limit_n_m": "torque_limit",
    "speed_limit_rad_s": "speed_limit",
    "friction_n_m": "friction",
    "stiffness_n_m_rad": "stiffness",
}
"""Keys of a joint in a file of drives, and the attributes of `Drive` that they set."""


def read_drives(path: str | PathLike[str]) -> dict[str, Drive]:
    """Read a TOML file of drives, by names of joints or patterns as of a shell.

    The file has a table `[joints]` with a table for each joint or pattern, whose keys are `KEYS`
    (`rotor_inertia_kg_m2` is required), and may have a text `source`. Raises `FaultyFile`, with a
    line for each fault.
    """
    source, document = str(path), read_toml(path)
    faults = [
        f"{key} is unknown: the file of drives has source and [joints]"
        for key in document
        if key not in ("source", "joints")
    ]
    joints = document.get("joints")
    if not isinstance(joints, dict):
        line = 'has no [joints]: it needs lines such as "knee" = { rotor_inertia_kg_m2 = 1e-5 }'
        raise FaultyFile(source, [*faults, line])
    drives = {}
    for joint, values in joints.items():
        unknown = values.keys() - KEYS.keys() if isinstance(values, dict) else {repr(values)}
        if unknown:
            faults.append(f"{joint} has {', '.join(sorted(unknown))}: choose {', '.join(KEYS)}")
        elif "rotor_inertia_kg_m2" not in values:
            faults.append(f"{joint} has no rotor_inertia_kg_m2: 0 is valid")
        else:
            try:
                drives[joint] = Drive(**{KEYS[key]: value for key, value in values.items()})
            except InvalidInput as error:
                faults += [f"{joint}: {line}" for line in error.faults]
    if faults:
        raise FaultyFile(source, faults)
    return drives


def load_drives(drives: Mapping[str, Drive] | str | PathLike[str]) -> dict[str, Drive]:
    """Return drives by joint or pattern, from a file where one is named."""
    if isinstance(drives, str | PathLike):
        return read_drives(drives)
    checked = validation.mapping("drives", drives)
    for joint, drive in checked.items():
        validation.check_type(Drive, **{f"drive of {joint}": drive})
    return checked


def catalogued_drives(robot: str) -> Path | None:
    """Return the file of a robot's drives that comes with kickdyn; None if there is none."""
    path = shipped("drives") / f"{robot.removesuffix('_reduced')}.toml"
    return path if path.exists() else None
