"""Pages: captions, panels, labels, buttons, and each element with its place and shape."""

from functools import cache
from pathlib import Path

import numpy as np

import kickdyn as kd
from kickdyn.view import camera, marks, wall_and_goal
from recorded.cases_impact import on_leg
from recorded.cases_planning import made_motion
from recorded.cases_scene import VARIANTS, made
from recorded.parts import (
    AIR,
    BALL,
    CONTACT,
    GROUND,
    HUMAN,
    LAUNCH,
    MOVING,
    POSTURE,
    V,
    g1,
    measured,
)
from recorded.plain import of_html

VISUALS = """<robot name="shapes"><link name="base"><visual><geometry><box size="0.1 0.2 0.3"/></geometry>
 <material name="red"><color rgba="0.8 0.1 0.2 0.5"/></material></visual></link>
 <joint name="hip" type="revolute"><parent link="base"/><child link="toe"/><origin xyz="0 0 1" rpy="0.1 0 0.2"/>
 <axis xyz="0 -1 0"/><limit lower="-1" upper="2" effort="100" velocity="9"/></joint>
 <link name="toe"><inertial><origin xyz="0 0 -0.2"/><mass value="7"/>
 <inertia ixx="0.08" ixy="0" ixz="0" iyy="0.07" iyz="0" izz="0.02"/></inertial>
 <visual><origin xyz="0.1 0 -0.3" rpy="0 0.3 0"/><geometry><sphere radius="0.05"/></geometry></visual>
 <visual><geometry><cylinder radius="0.03" length="0.4"/></geometry></visual>
 <visual><geometry><mesh filename="box.ply" scale="2 1 1"/></geometry></visual>
 <visual><geometry><mesh filename="lost.stl"/></geometry></visual></link></robot>"""


@cache
def kick(contact=CONTACT):
    return kd.strike(POSTURE, V, BALL, contact, **MOVING)


def shapes():
    import trimesh

    box = trimesh.creation.box((0.1, 0.12, 0.14))
    box.visual.face_colors = np.tile([200, 30, 60, 255], (12, 1))
    box.export("box.ply")
    Path("shapes.urdf").write_text(VISUALS)
    leg = kd.Leg.from_urdf("shapes.urdf", "toe")
    return [kd.page(leg), kd.page(leg.posture([0.4]), caption="bent")]


def path(air=AIR, ground=GROUND):
    return kd.follow(kick().ball_after, BALL, air, ground)


CASES = {
    "kick": lambda: kd.page(kick(), kd.fly(kick().ball_after, BALL, AIR, kd.Ground(-2.0)), caption="a kick"),
    "kick without a path": lambda: kd.page(kick(kd.Contact((2, 0.3, 1), 0.7, 0.5))),
    "kick with a course": lambda: kd.page(kick(), path()),
    "kick of a robot": lambda: kd.page(kd.strike(*on_leg("g1"), **MOVING)),
    "kick of a three-dimensional leg": lambda: kd.page(kd.strike(*on_leg("human 3d"), **MOVING)),
    "kicks": lambda: kd.page({"soft": kick(), "<hard>": kd.strike(*on_leg("testbed"))}, caption="two of them"),
    "flights": lambda: kd.page({"calm": kd.fly(LAUNCH, BALL, kd.Air()), "wind": kd.fly(LAUNCH, BALL, AIR), "course": path()}, caption="three"),
    "a launch": lambda: kd.page(kd.plan_launch(kd.Goal((11, 1, 0.4), time=0.7), BALL, AIR)),
    "a pass": lambda: kd.page([kd.plan_pass(kd.Goal((12, 3, 0), time=1.5), BALL, AIR)]),
    "a fit": lambda: kd.page(kd.identify(measured(), BALL)),
    "leg": lambda: kd.page(HUMAN),
    "posture": lambda: kd.page(POSTURE, caption="bent"),
    "robot": lambda: kd.page(g1()),
    "shapes": shapes,
    "motion": lambda: kd.page(made_motion(), caption="moves"),
    "plan": lambda: kd.page(kd.plan_kick(HUMAN, kd.Goal(14, time=1.1), BALL, AIR)),
    "plan with scenery": lambda: kd.page(
        kd.plan_kick(HUMAN, kd.Goal(14, time=1.1), BALL, AIR),
        scenery=[*wall_and_goal.wall_boxes(np.array([0.2, 0, -0.8]), np.array([1.0, 0, 0]), 6.0, 1.2, 2.0),
                 *wall_and_goal.goal_boxes(np.array([0.2, 0, -0.8]), 14.0, 0.1)]),
    **{f"scene {name}": (lambda name=name: kd.page(made(**VARIANTS[name]))) for name in ("plain", "compliant", "course", "plane")},
    "simulation": lambda: kd.page(kd.simulate(made(**VARIANTS["plane"]), None)),
    "written": lambda: of_html(kd.page(kick(), caption="a <kick>").html),
    "camera": lambda: [camera.camera_for(np.array([[0.0, 0, 0], [1, 0.2, 1]]), np.array([[9.0, 1, 2]]), np.array([1.0, 0.2, 0]), behind=b) for b in (False, True)],
    "stripes": lambda: [camera.stripe_width(x) for x in (0.3, 2.0, 7.0, 25.0, 90.0)],
    "panels of the ball": lambda: list(marks._panels().values()),
}  # fmt: skip
LOOSE = {"": 1e-5, "plan": 1e-3, "plan with scenery": 1e-3}
