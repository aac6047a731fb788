"""The joints that a kick moves, taken out of a leg or a whole robot."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.robot.leg import Leg
from kickdyn.robot.surgery import angle_model, coordinate_indices, reduce_model

UNLIMITED = 100.0
"""Speed that counts as the limit where no joint has one [rad/s]: faster than any that kicks."""


@dataclass(frozen=True, eq=False)
class KickingChain:
    """The joints between a fixed base and the contact frame, and where the whole robot has them.

    On a fixed base, an impact on the chain and its equations of motion are the same as of the whole
    robot, whose other joints stay where `rest_configuration` has them.

    Attributes:
        leg: the chain alone, all other joints locked; the whole robot, if there are none.
        qs, vs: indices of its joints in the robot's q and v.
    """

    leg: Leg
    qs: NDArray[np.int64]
    vs: NDArray[np.int64]

    def robot_state(self, robot: Leg, q: Array, v: Array) -> tuple[Array, Array]:
        """Return q and v of the robot from the chain's, all other joints at rest."""
        configuration, velocity = rest_configuration(robot), np.zeros(robot.nv)
        configuration[self.qs], velocity[self.vs] = q, v
        return configuration, velocity


def assumed_speed_limit(leg: Leg) -> Array:
    """Return the limits of the joints' speeds, shape `(nv,)` [rad/s; m/s for prismatic joints].

    A joint without one, or with 0, has the largest limit of the joints of its unit; inf without
    any.
    """
    limit = np.where(leg.velocity_limit > 0.0, leg.velocity_limit, np.inf)
    units = {name: leg.joint_unit(name) for name in leg.single_joints}
    for unit in {*units.values()}:
        columns = [leg.velocity_index(name) for name in units if units[name] == unit]
        known = limit[columns][np.isfinite(limit[columns])]
        limit[columns] = np.where(
            np.isfinite(limit[columns]), limit[columns], known.max(initial=0.0) or np.inf
        )
    return limit


def rest_configuration(robot: Leg, others: Mapping[str, float] | None = None) -> Array:
    """Return q with every joint at the value of its range that is nearest to 0, shape `(nq,)`.

    Joints of several degrees of freedom are at 0, mimic joints where their drivers put them.
    `others` are values of joints that are elsewhere [rad; m for prismatic joints].
    """
    following = {mimic.joint for mimic in robot.mimics}
    ranges = {name: robot.joint_range(name) for name in robot.single_joints}
    nearest = {name: min(max(low, 0.0), high) for name, (low, high) in ranges.items()}
    nearest.update(others or {})
    return robot.configuration({
        name: value for name, value in nearest.items() if value and name not in following
    })  # fmt: skip


def kicking_chain(
    robot: Leg, *, branches: bool = False, others: Mapping[str, float] | None = None
) -> KickingChain:
    """Return the joints that move a robot's contact frame.

    Args:
        robot: a leg or a whole robot, on a fixed base.
        branches: whether to keep the joints that branch off the chain too. They do not move the
            contact frame, but an impact there moves them.
        others: as for `rest_configuration`, of joints that are taken out.

    Raises:
        InvalidInput: without `branches`, a joint has more than one coordinate, as a floating base
            has; or one of the joints mimics another or is mimicked.
    """
    model = robot.model
    joints = path = [int(joint) for joint in model.supports[robot.contact_joint]][1:]
    if branches:
        joints = [int(joint) for joint in model.subtrees[path[0]]]
    elif wide := [str(model.names[joint]) for joint in path if model.nqs[joint] != 1]:
        raise InvalidInput(
            f"joint {wide[0]!r} moves the contact frame of {robot.name} by more than one "
            "coordinate: every joint of the kicking chain must have one, and the base must be fixed"
        )
    names = {str(model.names[joint]) for joint in joints}
    for mimic in robot.mimics:
        if mimic.joint in names or mimic.driver in names:
            raise InvalidInput(
                f"joint {mimic.joint!r} mimics {mimic.driver!r}: kicks are planned without mimic "
                f"joints in the kicking limb; lock {mimic.driver!r}, which locks both (Leg.locked, "
                f"--lock {mimic.driver}=VALUE)"
            )
    leg = robot
    if locked := [name for name in robot.joint_names if name not in names]:
        leg = robot.with_model(reduce_model(model, locked, rest_configuration(robot, others)))
    return KickingChain(leg, *coordinate_indices(model, joints))


def with_angles(robot: Leg) -> Leg:
    """Return a robot whose continuous joints have one angle in q, from -pi to pi, as plans do."""
    model = robot.workspace.model
    has_continuous = (2, 1) in zip(model.nqs, model.nvs, strict=True)
    return robot.with_model(angle_model(robot.model)) if has_continuous else robot
