"""MuJoCo: tuned contacts, models, planned motions carried out."""

import re
from dataclasses import replace
from functools import cache
from unittest.mock import patch

import numpy as np
from planned_motions import swinging

import kickdyn as kd
from kickdyn.robot.standing import StandingRobot
from kickdyn.simulators import mujoco_fit, mujoco_kick
from kickdyn.simulators.disturbance import Disturbance
from kickdyn.simulators.mujoco_field import MujocoField
from recorded.cases_planning import made_motion
from recorded.parts import BALL, HUMAN, POSTURE, V, faults, legs, standing

TUNED = kd.Contact((2, 0, 1), 0.7, 0.3)


@cache
def tuned():
    with patch.object(mujoco_fit, "SHAPES", ((1.5, 2.0),)):  # others may be as good
        return kd.tune_mujoco(POSTURE, V, BALL, TUNED, timestep=0.002, contact_time=0.01)


WRITTEN = re.compile('plate|ball|<option|<compiler|name="floor"|sole [07]|foot 0|waist_y|knee')
"""What is in the lines of a model that are kept."""


@cache
def run():
    return kd.run_in_mujoco(swinging())


def ran():
    return {"run": run(), "json": run().to_json(), "warnings": run().warnings}


def failed():
    """What is said of a run that misses, falls or tips."""
    margins = {**run().margins, "centre of pressure": 0.0}
    runs = (
        replace(run(), path=None),
        replace(run(), path=None, upright=False),
        replace(run(), upright=False, margins=margins),
    )
    return [[one.summary, one.warnings, repr(one), one.to_json()] for one in runs] + [
        faults({"track": lambda: runs[0].track, "ball": lambda: kd.run_in_mujoco(swinging(), tuning=tuned())})
    ]  # fmt: skip


def noisy():
    """Runs that differ, one of which misses: what is counted, averaged and printed."""
    after = run().ball_after
    runs = [replace(run(), ball_after=kd.BallState(after.position, after.velocity + change, after.spin), upright=k != 1)
            for k, change in enumerate(((0, 0, 0), (0.5, 0.8, -0.3), (-0.4, 0.1, 0.9)))]  # fmt: skip
    many = kd.NoisyRuns((*runs, replace(run(), path=None)), kd.KickNoise())
    return [
        repr(many),
        many.launch_errors,
        many.means,
        many.deviations,
        many.misses,
        many.to_json(),
    ]


def field():
    """The model of a robot on one foot, its drives, and the first steps of a motion."""
    robot = kd.Leg.from_robot("g1", base="floating", locked={"*wrist*": 0})
    stood = StandingRobot(robot.with_supports("left_ankle_roll_link"))
    motion = made_motion(stood.robot, stood.placement, stood.leg.joint_names)
    posture = motion.robot.posture(motion.q(0.0))
    v = posture.admissible(motion.v(0.0))
    contact = kd.Contact(posture.point_velocity(v), 0.7, 0.3)
    impact = kd.strike(
        posture, v, BALL, contact, ball_velocity=(-0.2, 0.1, 0.05), ball_spin=(1, 2, 3)
    )
    factors = np.linspace(0.9, 1.2, motion.robot.model.njoints - 1)
    made = MujocoField(
        motion,
        impact,
        stood,
        tuned(),
        Disturbance(factors, 0.9, 0.8, 0.004, np.array([0.01, -0.02])),
    )
    made.set_gains(
        stood.leg,
        stood.leg.posture(stood.leg.configuration(motion.robot.joint_values(motion.q(0.0)))).q,
    )
    made.place()
    places, loads = [made.set_ball(t) for t in (-0.3, -0.05)], []
    start = made.data.qpos.copy()
    for k in range(4):
        made.data.ctrl[:] = made.reference(
            motion.begin + k * made.timestep, feed_forward=k % 2 == 0
        )
        made.mujoco.mj_step(made.model, made.data)
        loads.append(made.sole_load())
    return {
        "text": [line for line in made._text(tuned()).replace("><", ">\n<").splitlines() if WRITTEN.search(line)], "stiffness": made.stiffness, "damping": made.damping,
        "bias": made.model.actuator_biasprm, "masses": made.model.body_mass, "inertias": made.model.body_inertia, "start": start,
        "places": places, "loads": loads, "control": made.data.ctrl, "ball": made.ball(0.1), "corners": made.corners, "friction": made.friction,
        "pushes": made.pushes(), "upright": made.is_upright(motion.q(motion.begin)),
    }  # fmt: skip


CASES = {
    "tuned": lambda: [tuned(), tuned().mjcf("shoe"), tuned().warnings, tuned().contact],
    "tuned, missed": lambda: kd.tune_mujoco(POSTURE, V, BALL, TUNED, timestep=0.005, contact_time=0.01).warnings,
    "bodies": lambda: [mujoco_kick.write_bodies(leg.model, {}, limits=limits).splitlines()
                       for leg in (HUMAN, legs("testbed"), legs("human 3d"), legs("mjcf"), standing()) for limits in (False, True)],
    "damping": lambda: [[mujoco_kick.damping_ratio(e), mujoco_kick.release_phase(mujoco_kick.damping_ratio(e))] for e in (0.3, 0.7, 0.95)],
    "goals": lambda: mujoco_fit.find_goals([
        mujoco_fit.KickError("", 0.05, 0.02, 0.03, 0.6), mujoco_fit.KickError("speed x 0.5", 0.06, 0.08, 0.09, 1.1)], 0.03),
    "ran": ran, "failed": failed, "noisy": noisy, "field": field,
}  # fmt: skip
LOOSE = {"": 5e-2, "ran": 5e-2, "field": 1e-3, "bodies": 1e-6, "damping": 1e-6, "goals": 1e-6}
