"""A robot in a simulator beside the planned one, and a leg alone: poses by forward kinematics."""

from types import SimpleNamespace

import numpy as np
import planned_motions
import pytest
from drawn_scene import SINGLE, DrawnScene, check_joints
from tolerances import agrees

import kickdyn as kd
from kickdyn.view.document import recording_viewer
from kickdyn.view.run_scene import draw_run


@pytest.mark.parametrize("hits", [True, False])
def test_a_simulated_run_is_beside_the_plan_at_the_same_times(hits):
    plan = planned_motions.swinging()
    motion, start, leg = plan.motion, plan.impact.ball_before.position, plan.impact.posture.leg
    t, ahead = np.linspace(motion.begin, motion.end, 300), np.array([5.0, 0.0, 0.0])
    after = kd.BallState(start + 0.1 * np.eye(3)[0], (9.0, 1.0, 8.0), time=0.02)
    run = SimpleNamespace(
        plan=plan, t=t, q=np.array([motion.q(time) + 0.05 for time in t]), summary="",
        ball_position=start + np.outer(np.maximum(t, 0.0), ahead), ball_after=after,
        path=kd.fly(after, kd.Ball(), kd.Air()) if hits else None,
    )  # fmt: skip
    page = kd.page(run)
    scene, pace = DrawnScene(page), page.pace
    offset, forward = scene.point("run"), plan.path.landing.position - start
    assert np.cross((offset[0], offset[1], 0.0), forward)[2] > 0  # to the right of the kick
    for frame in (0, pace.impact, pace.impact + 1, pace.impact + 30, len(pace.times) - 1):
        time = pace.times[frame]
        sample = min(np.searchsorted(t, time), len(t) - 1)
        check_joints(scene, "run/leg", leg, run.q[sample], frame, offset)
        check_joints(scene, "leg", leg, motion.q(time), frame)
        right = start + np.interp(time, t, np.maximum(t, 0.0)) * ahead
        if hits and time >= after.time:
            right = run.path.sample(min(time - after.time, run.path.duration)).position
        agrees(scene.point("run/ball", frame) - offset, right, 10 * SINGLE)
    figure = np.vstack([scene.vertices(node) for node in scene.objects
                        if node.startswith("leg/") and "data" in scene.shape(node)])  # fmt: skip
    for node, place in (("planned/name", 0.0), ("run/name", offset)):
        _, y, z = scene.point(node) - place  # above the middle of the robot
        assert (z > figure[:, 2].max(), abs(y - figure[:, 1].mean()) < 0.02) == (True, True)
    wide = np.array([(0.0, -1.0, 0.0), (0.0, 2.0, 1.0)])
    apart = draw_run(recording_viewer(), run, np.array([1.0, 0.0, 0.0]), wide).offset
    assert apart[1] < -3.0  # by more than the robot's width
    assert ("run/curve" in scene.objects) is hits
    if hits:
        agrees(scene.curve("run/curve")[-1] - offset, run.path.landing.position, 10 * SINGLE)
        assert pace.times[-1] == pytest.approx(after.time + run.path.duration)


def test_a_motion_alone():
    motion = planned_motions.swinging().motion
    page = kd.page(motion)
    times = page.pace.times
    assert times[[0, -1]] == pytest.approx([motion.begin, motion.end])
    assert abs(times[page.pace.impact]) <= np.diff(times).max()
    for frame in (0, page.pace.impact, 200, len(times) - 1):
        check_joints(DrawnScene(page), "leg", motion.robot, motion.q(times[frame]), frame)
    assert all(f"{phase.begin:.4g} to {phase.end:.4g} s" in page.panel for phase in motion.phases)


def test_a_posture_alone():
    posture = kd.Leg.human().posture(np.radians([40.0, 30.0, -20.0]))
    page = kd.page(posture, caption="at the impact")
    check_joints(DrawnScene(page), "leg", posture.leg, posture.q)
    x, y, z = posture.contact_point
    for shown in ("hip</th><td>40°", "knee</th><td>30°", "ankle</th><td>-20°",
                  f"{x:.3f}, {y:.3f}, {z:.3f} m", "at the impact"):  # fmt: skip
        assert shown in page.panel
    assert DrawnScene(page).point("ground")[2] < min(z, 0.0)
