"""How a robot and its surroundings differ from the model for which a kick was planned."""

from dataclasses import dataclass, fields
from typing import NamedTuple

import numpy as np

from kickdyn.core import validation
from kickdyn.core.validation import Array


class Disturbance(NamedTuple):
    """One difference of a simulated kick from its plan.

    Attributes:
        masses: factors of mass and inertia of the bodies of the robot, shape `(n,)`.
        ground_friction, ball_friction: factors of the coefficients of friction.
        delay: time by which commands reach the drives late [s].
        place: displacement of the ball along x and y, shape `(2,)` [m, world frame].
    """

    masses: Array
    ground_friction: float
    ball_friction: float
    delay: float
    place: Array


@dataclass(frozen=True)
class KickNoise:
    """How much simulated kicks differ from their plan, see `run_in_mujoco`.

    All but the delay are normal, cut off at three standard deviations. The default values are
    choices of ours, not measurements.

    Attributes:
        mass: standard deviation of the mass of each body of the robot, relative, at most 0.3.
        friction: that of the coefficients of friction of ground and ball, relative, at most 0.3.
        delay: largest time by which all commands of a kick reach the drives late, uniform from 0
            on [s], at most 0.1.
        place: standard deviation of the position of the ball along x, and along y [m], at most 0.1.

    Raises:
        InvalidInput: a value out of range.
    """

    mass: float = 0.02
    friction: float = 0.1
    delay: float = 0.005
    place: float = 0.005

    def __post_init__(self) -> None:
        for entry in fields(self):
            most = 0.3 if entry.name in ("mass", "friction") else 0.1
            validation.number(entry.name, getattr(self, entry.name), at_least=0, at_most=most)


def draw(noise: KickNoise, seed: int, bodies: int) -> Disturbance:
    """Return the disturbance of a seed, for a robot of so many bodies."""
    random = np.random.default_rng(seed)
    delay = noise.delay * float(random.uniform())
    normal = np.clip(random.normal(size=bodies + 4), -3.0, 3.0)
    ground, ball = (1.0 + noise.friction * normal[:2]).tolist()
    return Disturbance(
        masses=1.0 + noise.mass * normal[4:],
        ground_friction=ground,
        ball_friction=ball,
        delay=delay,
        place=noise.place * normal[2:4],
    )
