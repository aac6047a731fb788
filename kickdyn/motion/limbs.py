"""Limbs that a kick does not move, put where they are not in the way of its motion."""

from collections.abc import Collection, Sequence

import numpy as np

from kickdyn.core.validation import Array
from kickdyn.motion.kick_task import KickTask
from kickdyn.motion.separation import Surroundings
from kickdyn.robot.kicking_chain import rest_configuration
from kickdyn.robot.leg import Leg

ASIDE, ASIDE_DRAWN = 0.02, 400
"""Distance of limbs that stay aside of a motion from other bodies [m], and number of postures of a
limb that are drawn."""


def idle_limbs(robot: Leg, legs: Leg) -> list[list[int]]:
    """Return the limbs that legs do not move, as the joints of each, which carry nothing else."""
    model, limbs = robot.model, []
    parents = [int(parent) for parent in model.parents]
    for tip in set(range(1, model.njoints)) - {*parents}:
        limb = [tip]
        while (joint := parents[limb[-1]]) and parents.count(joint) == 1:
            limb.append(joint)
        if not {str(model.names[joint]) for joint in limb} & {*legs.joint_names}:
            limbs.append(limb)
    return limbs


def frames_of(leg: Leg, joints: Sequence[int]) -> list[str]:
    """Return the frames that joints carry."""
    return [str(frame.name) for frame in leg.model.frames if int(frame.parentJoint) in joints]


def limbs_aside(
    task: KickTask, leg: Leg, postures: Array, limbs: Sequence[Sequence[int]]
) -> dict[str, float]:
    """Return angles of the joints of limbs that are in the way of a motion, by name.

    Of angles that are drawn, they are those nearest to rest that keep all bodies of a limb by
    `ASIDE` from the other ones; where none do, the limb stays at rest.

    Args:
        task: the kick.
        leg: with the limbs.
        postures: of the motion, shape `(k, nq)` of that leg.
        limbs: joints of each.
    """
    neutral, draw, times = rest_configuration(leg), np.random.default_rng(0), len(postures)
    postures = postures.copy()
    lower, upper = leg.model.lowerPositionLimit, leg.model.upperPositionLimit
    every = Surroundings(task.robot, leg, task.target.ball.radius)
    at_rest = {gap.frames for gap in every.gaps(neutral, None, ASIDE)}
    shifted: dict[str, float] = {}
    for limb in limbs:
        columns = [leg.joint_names.index(str(leg.model.names[joint])) for joint in limb]
        pairs, order = every.only(frames_of(leg, limb)), list(range(times))
        room = 0.05 * (upper - lower)[columns]
        size = ASIDE_DRAWN, len(columns)
        drawn = draw.uniform(lower[columns] + room, upper[columns] - room, size) - neutral[columns]
        drawn *= draw.uniform(0.0, 1.0, (ASIDE_DRAWN, 1))  # many of them near rest
        for change in [0.0 * drawn[0], *drawn[np.argsort(np.linalg.norm(drawn, axis=1))]]:
            angles = neutral[columns] + change
            postures[:, columns] = angles
            hit = next((row for row in order if _touches(pairs, postures[row], at_rest)), None)
            if hit is None:
                break
            order.remove(hit)  # most other angles fail there too
            order.insert(0, hit)
        else:
            postures[:, columns] = angles = neutral[columns]
        if (angles != neutral[columns]).any():
            shifted |= {leg.joint_names[n]: float(x) for n, x in zip(columns, angles, strict=True)}
    return shifted


def _touches(near: Surroundings, q: Array, at_rest: Collection[tuple[str, str]]) -> bool:
    """Return whether bodies are nearer than `ASIDE`, or inside each other if they are at rest."""
    gaps = near.gaps(q, None, ASIDE)
    return any(gap.place.depth > 0.0 or gap.frames not in at_rest for gap in gaps)
