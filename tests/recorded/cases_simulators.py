"""MuJoCo: tuned contacts, models, planned motions carried out."""

from functools import cache
from unittest.mock import patch

from planned_motions import swinging

import kickdyn as kd
from kickdyn.simulators import mujoco_fit, mujoco_kick
from recorded.parts import BALL, HUMAN, POSTURE, V, legs, standing

TUNED = kd.Contact((2, 0, 1), 0.7, 0.3)


@cache
def tuned():
    with patch.object(mujoco_fit, "SHAPES", ((1.5, 2.0),)):  # others may be as good
        return kd.tune_mujoco(POSTURE, V, BALL, TUNED, timestep=0.002, contact_time=0.01)


def ran():
    run = kd.run_in_mujoco(swinging())
    return {"run": run, "json": run.to_json(), "warnings": run.warnings}


CASES = {
    "tuned": lambda: [tuned(), tuned().mjcf("shoe"), tuned().warnings, tuned().contact],
    "tuned, missed": lambda: kd.tune_mujoco(POSTURE, V, BALL, TUNED, timestep=0.005, contact_time=0.01).warnings,
    "bodies": lambda: [mujoco_kick.write_bodies(leg.model, {}, limits=limits).splitlines()
                       for leg in (HUMAN, legs("testbed"), legs("human 3d"), legs("mjcf"), standing()) for limits in (False, True)],
    "damping": lambda: [[mujoco_kick.damping_ratio(e), mujoco_kick.release_phase(mujoco_kick.damping_ratio(e))] for e in (0.3, 0.7, 0.95)],
    "goals": lambda: mujoco_fit.find_goals([
        mujoco_fit.KickError("", 0.05, 0.02, 0.03, 0.6), mujoco_fit.KickError("speed x 0.5", 0.06, 0.08, 0.09, 1.1)], 0.03),
    "ran": ran,
}  # fmt: skip
LOOSE = {"": 5e-2, "ran": 5e-2, "bodies": 1e-6, "damping": 1e-6, "goals": 1e-6}
