"""Libraries of kicks, carried out in MuJoCo so that their kicks are corrected."""

import math
import pickle
from collections.abc import Callable
from concurrent.futures import Executor
from functools import lru_cache, partial

import numpy as np

from kickdyn.core import validation
from kickdyn.core.executors import STOPPED, in_order, reason_of_stop
from kickdyn.core.files import replacing
from kickdyn.core.validation import Array
from kickdyn.errors import Unfinished
from kickdyn.planning.goal import Goal
from kickdyn.planning.kick_library import KickLibrary
from kickdyn.planning.kick_reader import launch_axes, launch_velocity, write_kicks
from kickdyn.simulators.mujoco_kick import load_mujoco
from kickdyn.simulators.run_in_mujoco import run_in_mujoco
from kickdyn.simulators.tune_mujoco import MujocoTuning

FLIGHT_TIME = 0.05
"""Time of the short flights to the goals of nodes [s]."""


@validation.check_arguments
def correct_library(
    library: KickLibrary,
    *,
    tuning: MujocoTuning | None = None,
    executor: Executor | None = None,
    progress: Callable[[str, int, int], None] | None = None,
) -> KickLibrary:
    """Carry out the motions of a library in MuJoCo, so that its kicks meet their goals there.

    Each motion of a node is carried out once, as planned, by `run_in_mujoco` with its default
    contact and the robot's own foot. The launches are stored in the library's file. From then on,
    `library.kick` interpolates them as it interpolates the motions, and takes the motion whose ball
    has in MuJoCo the launch that meets the goal. A standing robot is turned about the ball by the
    error of the azimuth. The error of the interpolation remains. Goals near the ends of the ranges
    have no such motion. Runs that are stored are not repeated, so that the same call continues
    after an interruption.

    Args:
        library: of `kick_library`.
        tuning: contact of all motions, as for `run_in_mujoco`; it saves most of the time. None is
            a contact for each motion.
        executor: of processes or of a cluster, as for `sweep`; None computes here.
        progress: is called with `runs`, how many are done, and of how many.

    Returns:
        The library, read from its file.

    Raises:
        InvalidInput: MuJoCo missing.
        Unfinished: interrupted by Ctrl-C, a full disk or lost workers.
    """
    load_mujoco()
    points = library.reader.node_points
    arrays = dict(library.reader.arrays)
    launches = arrays.pop("simulated", np.full((len(points), 3), np.nan)).copy()
    plain = KickLibrary(library.file, library.robot)
    plain.reader.arrays.pop("simulated", None)
    numbers = np.flatnonzero(np.isnan(launches[:, 0]) & ~np.isnan(points[:, 0]))
    run = partial(_simulated_launch, pickle.dumps(plain), tuning=tuning)
    try:
        results = in_order(executor, run, points[numbers])
        for count, (number, launch) in enumerate(zip(numbers, results, strict=True), start=1):
            launches[number] = launch
            with replacing(library.file) as draft, draft.open("wb") as out:
                write_kicks(out, arrays | {"simulated": launches})
            if progress is not None:
                progress("runs", count, len(numbers))
    except STOPPED as error:
        raise Unfinished(
            f"{reason_of_stop(error)}: {np.isfinite(launches[:, 0]).sum()} runs are stored in "
            f"{library.file}; to continue, run it again"
        ) from None
    return KickLibrary(library.file, library.robot)


@lru_cache(maxsize=1)
def _unpickled(library: bytes) -> KickLibrary:
    return pickle.loads(library)  # type: ignore[no-any-return]


def _simulated_launch(pickled: bytes, point: Array, tuning: MujocoTuning | None) -> Array:
    """Return speed, elevation and azimuth of the ball that a library's kick gives, or NaN."""
    fall = np.array([0.0, 0.0, -0.5 * 9.81 * FLIGHT_TIME**2])
    goal = Goal(FLIGHT_TIME * launch_velocity(point) + fall, time=FLIGHT_TIME)
    plan = _unpickled(pickled).plan(goal, ball_position=point[3:])
    run = run_in_mujoco(plan, tuning=tuning)
    return np.full(3, math.nan) if run.path is None else launch_axes(run.ball_after.velocity)
