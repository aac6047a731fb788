"""Launches, passes, kicks, their scatter and reports; meetings with moving balls; motions."""

from pathlib import Path

import numpy as np
from planned_motions import swinging

import kickdyn as kd
from kickdyn.planning import plan_report, scatter
from kickdyn.planning.interception import reach_of
from kickdyn.planning.launch import OutOfReach
from kickdyn.planning.objectives import KickObjective
from kickdyn.planning.plan_report import PlanReport
from recorded.parts import AIR, BALL, CALM, HUMAN, g1, legs
from recorded.plain import of_file

GOALS = {
    "time": kd.Goal((11, 1, 0.4), time=0.7, spin=(0, -20, 5)),
    "apex": kd.Goal((16, -2, 0.0), apex=3.0),
    "speed": kd.Goal((18, 2, 0.5), speed=19),
    "high": kd.Goal((11, 1, 0.2), speed=15, arc="high"),
    "over": kd.Goal((20, 1, 0.5), over=(9.15, 2.3)),
    "beside": kd.Goal((20, 0, 1), speed=25, beside=(9, 1)),
    "receiver": kd.Goal((16, 0, 0), time=1.2, receiver_velocity=(2, 1, 0)),
}
DENSE = kd.Air(1.3, drag="tango12")
ROLLING = kd.BallState((2.0, 0.0, -0.7042), (-2.5, 0.0, 0.0), (0.0, -22.8, 0.0), 5.0)
FLYING = kd.BallState((4.0, 0.0, -0.3), (-9.0, 0.0, 1.5), (0.0, 5.0, 0.0))


def launched(name, air=AIR, **more):
    launch = kd.plan_launch(GOALS[name], BALL, air, **more)
    return {"launch": launch, "flight": launch.flight, "summary": launch.summary}


def report(plan, **more):
    said = PlanReport(plan, **more)
    return {"sentences": said.sentences(), "table": said.table(), "json": said.to_json()}


def kicked(leg=HUMAN, goal="time", air=AIR, **more):
    plan = kd.plan_kick(leg, GOALS.get(goal, goal), BALL, air, **more)
    return {
        "plan": plan, "q": plan.q, "v": plan.v, "warnings": plan.warnings, "verdict": plan_report.verdict(plan),
        "score": plan_report.score(plan), **report(plan),
    }  # fmt: skip


ROWS = tuple(
    kd.ReachRow(azimuth, elevation, 9.0 + azimuth / 10 - elevation / 7, None, "knee", 12.0 - elevation / 9, 8.0 + azimuth / 30)
    for azimuth in (0.0, -30.0) for elevation in (20.0, 0.0, 45.0)
)  # fmt: skip


def met(leg, goal, incoming, **more):
    plan = kd.plan_kick(leg, goal, BALL, DENSE, incoming=incoming, **more)
    meeting = plan.meeting
    return {
        "plan": plan, "q": plan.q, "v": plan.v, "meeting": meeting,
        "meetings": [[m.time, m.share, m.speed_use, m.reason] for m in plan.meetings],
        "slopes": meeting.landing_slopes, "tolerances": meeting.landing_slopes and meeting.landing_slopes.tolerances,
        "warnings": plan.warnings, "figure": plan.plot(), **report(plan),
    }  # fmt: skip


def replanned():
    plan = kd.plan_kick(HUMAN, kd.Goal(18, time=1.2), BALL, DENSE, incoming=ROLLING)
    seen = kd.BallState((1.6, 0.0, -0.7042), (-2.4, 0.0, 0.0), (0.0, -22.0, 0.0), 5.16)
    again = plan.replan(incoming=seen)
    return [again, again.q, again.v]


def refused(goal, **more):
    try:
        kd.plan_kick(HUMAN, goal, BALL, AIR, **more)
    except kd.KickdynError as error:
        return [
            error,
            plan_report.unreachable_json(goal, error) if isinstance(error, OutOfReach) else None,
        ]
    return None


def motion_of(plan):
    motion = plan.motion
    times = (-0.2, -0.01, 0.1)
    written = {}
    for ending in ("csv", "npz", "yaml", "xml"):
        motion.save(f"kick.{ending}", 50)
        written[ending] = of_file(Path(f"kick.{ending}"))
    samples = motion.samples(50.0)
    return {
        "motion": motion, "samples": samples._asdict(), "joints": samples.joints, "root": samples.root,
        "q": [motion.q(t) for t in times], "v": [motion.v(t) for t in times], "v after": motion.v_after,
        "torque": [motion.torque(t) for t in times], "margins": [motion.margins(t) for t in times],
        "figure": motion.plot(), "written": written, "plan": plan, "warnings": plan.warnings,
        "state": motion.joint_state(-0.1),
        "ground": [motion.ground_wrench(t) for t in times] if motion.placement is not None else None, **report(plan),
    }  # fmt: skip


def refined():
    from kickdyn.simulators.refine_kick import refine_kick

    plan = refine_kick(swinging(), 1)
    return [plan, plan.q, plan.v]


def made_motion(robot=HUMAN, placement=None, joints=None):
    """A motion of splines, which no optimiser decides."""
    from scipy.interpolate import BSpline

    from kickdyn.motion.motion import Motion

    joints = joints or robot.joint_names
    draw = np.random.default_rng(0)
    first, hit, last = draw.uniform(-0.2, 0.2, (3, len(joints)))
    splines = []
    for begin, end, rows in ((-0.53, 0.0, (first, hit)), (0.0, 0.61, (hit, last))):
        knots = np.r_[[begin] * 3, np.linspace(begin, end, 5), [end] * 3]
        table = np.linspace(*rows, 7) + draw.normal(0.0, 0.1, (7, len(joints)))
        table[0], table[-1] = rows
        splines.append(BSpline(knots, table, 3))
    return Motion(robot, joints, *splines, placement)


def spline_motion(standing=False):

    from kickdyn.robot.standing import StandingRobot

    if not standing:
        motion = made_motion()
    else:
        robot = kd.Leg.from_robot("g1", base="floating", locked={"*wrist*": 0})
        stood = StandingRobot(robot.with_supports("left_ankle_roll_link"))
        motion = made_motion(stood.robot, stood.placement, stood.leg.joint_names)
    written, times = {}, (-0.31, -0.02, 0.17, 0.4)
    for ending in ("csv", "npz", "yaml", "xml"):
        motion.save(f"kick.{ending}")
        written[ending] = of_file(Path(f"kick.{ending}"))
    samples = motion.samples(50.0)
    return {
        "motion": motion, "samples": samples._asdict(), "joints": samples.joints, "root": samples.root,
        "q": [motion.q(t) for t in times], "v": [motion.v(t) for t in times], "v after": motion.v_after,
        "torque": [motion.torque(t) for t in times], "figure": motion.plot(), "written": written,
        "state": motion.joint_state(-0.1), "phases": motion.phases,
        "ground": [motion.ground_wrench(t) for t in times] if standing else None,
    }  # fmt: skip


def standing_kick():
    robot = kd.Leg.from_robot("g1", base="floating", legs_only=True)
    return robot.with_supports(kd.Support("left_ankle_roll_link", friction=0.7))


def passes(goal, **more):
    found = kd.plan_pass(goal, BALL, **more)
    return [found, found.state, found.summary, found.course.status]


CASES = {
    **{f"launch, {name}": (lambda name=name: launched(name)) for name in GOALS},
    "launch in vacuum": lambda: launched("time", None),
    "launch, too fast": lambda: kd.plan_launch(kd.Goal(30.0, time=0.5), BALL, AIR, speed_limit=40),
    "launch, spin limit": lambda: kd.plan_launch(
        kd.Goal((20, 0, 1), speed=25, beside=(9, 6)), BALL, AIR, spin_limit=40
    ),
    "launch, too far": lambda: kd.plan_launch(kd.Goal(90.0, speed=20), BALL, AIR),
    "launch of a heavy ball": lambda: kd.plan_launch(
        kd.Goal(9.0, time=1), kd.Ball(float("inf"), 0.1)
    ),
    "pass": lambda: passes(kd.Goal((12, 3, 0), time=1.5)),
    "pass, raised": lambda: passes(
        kd.Goal((6, 1, 0), time=1.3, spin=(0, -10, 20)), air=AIR, angle=0.3
    ),
    "pass on carpet": lambda: passes(kd.Goal((12, 3, 0), time=2.5), surface="carpet", air=CALM),
    "pass, too slow": lambda: passes(kd.Goal(6, time=30)),
    "pass, too fast": lambda: passes(kd.Goal(20, time=0.5), air=AIR, speed_limit=10),
    "pass, to a runner": lambda: passes(kd.Goal(12, time=1.6, receiver_velocity=(1, 2, 0))),
    **{
        f"kick, {name}": (lambda name=name: kicked(goal=name))
        for name in ("apex", "high", "receiver")
    },
    **{
        f"kick, {objective}": (
            lambda objective=objective: kicked(goal=kd.Goal(14, time=1.1), objective=objective)
        )
        for objective in KickObjective
        if objective in ("joint-impulse", "most-joint-impulse", "kinetic-energy")
    },
    "kick over a wall": lambda: report(
        kd.plan_kick(HUMAN, kd.Goal((20, 0, 0.4), over=(9.15, 2.3)), BALL, AIR),
        wall=kd.Wall(9.15, 1.9),
        goal_mouth=True,
    ),
    "kick into a wall": lambda: report(
        kd.plan_kick(HUMAN, kd.Goal((20, 0, 0.4), time=0.95), BALL, AIR), wall=kd.Wall(9.15, 2.9)
    ),
    "kick of a lying ball": lambda: kicked(goal=kd.Goal(14, time=1.1), ball_position=-0.704),
    "kick of a placed ball": lambda: kicked(
        goal=kd.Goal(10, time=1.1), air=CALM, ball_position=(0.35, 0.0, -0.68)
    ),
    "kick, unlimited": lambda: kicked(goal=kd.Goal(45, time=1.6), limits=False),
    "kick, too far": lambda: kicked(goal=kd.Goal(60, time=1.9)),
    "kick with a contact": lambda: kicked(
        goal=kd.Goal(14, time=1.1),
        contact=kd.Contact(restitution="inflated", friction=0.3, offset=(0.02, 0, -0.01)),
    ),
    "kick of a pass": lambda: kicked(goal=kd.Goal(12, time=1.5), surface="turf"),
    "kick by a robot": lambda: kicked(g1(), kd.Goal((4, 1, 0), time=0.8), ball_position=-0.58),
    "kick by a robot's inside": lambda: kicked(
        kd.kick_with(g1(), "inside"), kd.Goal((3, 2, 0), time=0.7)
    ),
    "kick by a testbed": lambda: kicked(legs("testbed"), kd.Goal(1.2, time=0.3)),
    "kick on one foot": lambda: kicked(standing_kick(), kd.Goal(3, time=0.4)),
    "met, rolling": lambda: met(HUMAN, kd.Goal(18, time=1.2), ROLLING),
    "met, flying": lambda: met(HUMAN, kd.Goal((10, 0, 0.3), time=1.0), FLYING),
    "met at a time": lambda: met(
        HUMAN, kd.Goal(18, time=1.2), kd.IncomingBall(ROLLING, meet_at=5.72)
    ),
    "met by a robot": lambda: met(
        g1(),
        kd.Goal((4, 1, 0), time=0.8),
        kd.BallState((1.5, 0.6, -0.58), (-2.0, -0.9, 0.0), (8.0, -17.0, 3.0)),
    ),
    "replanned": replanned,
    "never met": lambda: refused(
        kd.Goal(18, time=1.2), incoming=kd.BallState((5, 3, -0.7), (1, 1, 0))
    ),
    "out of reach": lambda: [
        refused(kd.Goal(300, time=1.2)),
        refused(kd.Goal(60, speed=10)),
        refused(kd.Goal((9, 4, 0), time=0.8)),
    ],
    "reach, figure": lambda: [kd.ReachTable("g1", motion, ROWS).plot() for motion in (True, False)],
    "reach": lambda: [reach_of(HUMAN, BALL), reach_of(g1(), BALL)],
    "scatter": lambda: scatter.scatter(
        kd.plan_kick(g1(), kd.Goal((4, 1, 0), time=0.8), BALL, AIR).impact,
        AIR,
        speed=0.05,
        angle=0.02,
        contact=0.003,
        restitution=0.04,
        drag=0.1,
    ),
    "landing slopes": lambda: scatter.landing_slopes(
        kd.BallState((0.1, 0, 0.2), (12, 2, 6), (3, -20, 8)), BALL, AIR
    ),
    "spline motion": spline_motion,
    "spline motion on one foot": lambda: spline_motion(True),
    "motion": lambda: motion_of(swinging()),
    "refined": lambda: refined(),
}
LOOSE = {"": 1e-4, **{f"launch, {name}": 1e-6 for name in GOALS}, "spline motion": 1e-6, "spline motion on one foot": 1e-6,
         "motion": 2e-2, "refined": 2e-2}  # fmt: skip
