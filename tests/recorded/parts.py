"""What several files of cases use: nothing here is at rest, symmetrical or of a simple value."""

from functools import cache
from pathlib import Path

import numpy as np

import kickdyn as kd
from kickdyn.robot.urdf_file import shipped_urdf

ROOT = Path(__file__).resolve().parents[2]
BALL = kd.Ball(0.41, 0.105, pressure=80e3)
GROUND = kd.Ground(-0.95, surface="turf")
AIR = kd.Air(density=1.1, wind=(1, 2, 0.5), drag="brazuca")
CALM = kd.Air(1.15, drag="tango12", lift="wang")
HUMAN = kd.Leg.human()
POSTURE = HUMAN.posture([0.7, 0.5, -0.3])
V = (6.6, -14.5, 6.6)
CONTACT = kd.Contact((2, 0.3, 1), "peacock-ball", 0.02)
MOVING = {"ball_velocity": (-3, 1, 0.5), "ball_spin": (5, -8, 3)}
LAUNCH = kd.BallState((0.1, -0.2, 0.3), (17.0, 3.0, 9.0), (8.0, -40.0, 25.0), 0.4)
"""A ball in flight: its drag varies with `brazuca`, and it bends aside."""

BOX = """<mujoco model="kicker">
 <compiler angle="radian" autolimits="true"/>
 <default><geom type="capsule" size="0.04" density="900"/></default>
 <worldbody><body name="pelvis" pos="0.1 0 1">
  <geom name="trunk" type="box" size="0.1 0.15 0.1" density="700"/>
  <joint name="yaw" type="hinge" axis="0 0 1" range="-1 1.2" armature="0.02" damping="0.1"/>
  <body name="thigh" pos="0 0.1 -0.1" quat="0.99 0.1 0.05 -0.02">
   <joint name="hip" axis="0 -1 0.1" range="-1 2" armature="0.03" frictionloss="0.2"/>
   <geom name="upper" fromto="0 0 0 0.02 0 -0.4"/>
   <body name="shank" pos="0.02 0 -0.4">
    <joint name="knee" axis="0 1 0" range="-0.1 2.4" armature="0.01"/>
    <joint name="rail" type="slide" axis="0 0 -1" range="-0.05 0.1" armature="0.5"/>
    <geom name="lower" fromto="0 0 0 0 0 -0.38" size="0.03"/>
    <body name="foot" pos="0 0 -0.4">
     <inertial pos="0.05 0.01 -0.02" quat="0.9 0.1 0 0.4" mass="1.1" diaginertia="0.002 0.004 0.005"/>
     <geom name="shoe" type="box" pos="0.06 0 -0.02" size="0.11 0.04 0.03" mass="0"/>
     <site name="toe" pos="0.17 0 -0.02"/>
    </body></body></body></body>
 </worldbody>
 <actuator><motor joint="hip" gear="60" ctrlrange="-1.5 1"/><motor joint="knee" gear="50" ctrlrange="-1 1"/>
 <motor joint="yaw" gear="30" ctrllimited="true" ctrlrange="-1 1"/></actuator>
</mujoco>"""

MIMIC = """<robot name="geared">
  <link name="base"/>
  <joint name="hip" type="revolute"><parent link="base"/><child link="thigh"/><origin xyz="0 0.1 1" rpy="0 0 0.1"/>
    <axis xyz="0 -1 0"/><limit lower="-1" upper="2" effort="100" velocity="9"/></joint>
  <link name="thigh"><inertial><origin xyz="0 0 -0.2"/><mass value="7"/>
    <inertia ixx="0.08" ixy="0.001" ixz="0" iyy="0.07" iyz="0" izz="0.02"/></inertial>
    <visual><geometry><cylinder radius="0.05" length="0.3"/></geometry></visual></link>
  <joint name="knee" type="revolute"><parent link="thigh"/><child link="shank"/><origin xyz="0 0 -0.4"/>
    <axis xyz="0 1 0"/><limit lower="0" upper="2.5" effort="80" velocity="20"/></joint>
  <link name="shank"><inertial><mass value="3"/>
    <inertia ixx="0.05" ixy="0" ixz="0" iyy="0.04" iyz="0" izz="0.03"/></inertial></link>
  <joint name="heel" type="revolute"><parent link="shank"/><child link="foot"/><origin xyz="0 0 -0.4"/>
    <axis xyz="0 1 0"/><limit lower="-2" upper="2" effort="50" velocity="30"/>
    <mimic joint="knee" multiplier="-0.6" offset="0.2"/></joint>
  <link name="foot"><inertial><origin xyz="0.05 0 0"/><mass value="1"/>
    <inertia ixx="0.004" ixy="0" ixz="0" iyy="0.006" iyz="0" izz="0.005"/></inertial></link>
  <joint name="tip" type="fixed"><parent link="foot"/><child link="toe"/><origin xyz="0.15 0 -0.03"/></joint>
  <link name="toe"/>
</robot>"""


@cache
def g1():
    return kd.Leg.from_robot("g1", legs_only=True)


@cache
def standing(friction=0.6):
    sole = [(x, y, -0.035) for x in (-0.05, 0.12) for y in (-0.03, 0.03)]
    robot = kd.Leg.from_robot("g1", "right_ankle_roll_link", base="floating", drives=False)
    return robot.with_supports(kd.Support("left_ankle_roll_link", friction=friction, sole=sole))


@cache
def legs(name):
    """Return a leg of a kind by a short name."""
    match name:
        case "testbed":
            return kd.Leg.testbed()
        case "fourbar":
            return kd.Leg.from_urdf(shipped_urdf("leg_fourbar.urdf")).with_loops(
                ("shank_pin", "rocker_b_tip")
            )
        case "run-up":
            return HUMAN.with_base_velocity((3.0, 0.0, 0.4), (0.2, -1.0, 0.3))
        case "bolt":
            return kd.Leg.from_robot("bolt", base="floating")
        case "g1":
            return g1()
        case "human 3d":
            return kd.Leg.human(height=1.65, mass=58, sex="female", side="left", model="3d")
        case "held":
            return standing()
        case "mjcf":
            Path("kicker.xml").write_text(BOX)
            return kd.Leg.from_mjcf("kicker.xml", "toe")
        case "mimic":
            Path("geared.urdf").write_text(MIMIC)
            return kd.Leg.from_urdf("geared.urdf", "toe")
    raise KeyError(name)


def measured(count=60, noise=0.004, seed=2, ball=BALL, air=None):
    """Return samples of a flight with noise."""
    start = kd.BallState((0, 0, 1), (18, 2, 9), (3, -40, 20))
    flight = kd.fly(start, ball, air or kd.Air(drag=0.25))
    times = np.linspace(0.0, 0.8 * flight.duration, count)
    draw = np.random.default_rng(seed).normal(0.0, noise, (count, 3))
    return kd.Track(times, flight.sample(times).position + draw)


def faults(calls):
    """Return what each call says in refusal."""
    from recorded.plain import message

    said = {}
    for name, call in calls.items():
        try:
            call()
        except Exception as error:
            said[name] = message(error)
        else:
            said[name] = "accepted"
    return said
