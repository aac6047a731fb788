"""kickdyn: what happens when a leg strikes a ball, and where the ball goes."""

from __future__ import annotations

import os
from importlib import import_module
from typing import TYPE_CHECKING

from kickdyn._version import __version__ as __version__

# a .numba_config.yaml of the working directory has no say in where machine code is read from
os.environ.setdefault("NUMBA_CACHE_DIR", "")
os.environ.setdefault("NUMBA_CACHE_LOCATOR_CLASSES", "")

if TYPE_CHECKING:  # loaded when they are asked for: see below
    from kickdyn.air import Air as Air
    from kickdyn.ball import Ball as Ball
    from kickdyn.ball import BallState as BallState
    from kickdyn.contact import Contact as Contact
    from kickdyn.errors import EnergyCreated as EnergyCreated
    from kickdyn.errors import InvalidInput as InvalidInput
    from kickdyn.errors import KickdynError as KickdynError
    from kickdyn.errors import NoImpact as NoImpact
    from kickdyn.errors import SceneError as SceneError
    from kickdyn.errors import UrdfError as UrdfError
    from kickdyn.flight.batch import fly_many as fly_many
    from kickdyn.flight.flight_result import Flight as Flight
    from kickdyn.flight.fly import fly as fly
    from kickdyn.flight.follow import Course as Course
    from kickdyn.flight.follow import follow as follow
    from kickdyn.ground import Ground as Ground
    from kickdyn.ground import Surface as Surface
    from kickdyn.impact.collide import Collision as Collision
    from kickdyn.impact.collide import collide as collide
    from kickdyn.impact.hertz import HertzContact as HertzContact
    from kickdyn.impact.hertz import contact_stiffness as contact_stiffness
    from kickdyn.impact.impact_result import Impact as Impact
    from kickdyn.impact.joint_load import JointLoad as JointLoad
    from kickdyn.impact.joint_load import joint_loads as joint_loads
    from kickdyn.impact.laws import normal_impulse as normal_impulse
    from kickdyn.impact.pinocchio_impact import EngineImpact as EngineImpact
    from kickdyn.impact.pinocchio_impact import engine_strike as engine_strike
    from kickdyn.impact.sensitivity import Sensitivity as Sensitivity
    from kickdyn.impact.sensitivity import sensitivity as sensitivity
    from kickdyn.impact.strike import strike as strike
    from kickdyn.impact.uncertainty import Uncertainty as Uncertainty
    from kickdyn.impact.uncertainty import uncertainty as uncertainty
    from kickdyn.impact.unilateral import UnilateralImpact as UnilateralImpact
    from kickdyn.impact.unilateral import unilateral_strike as unilateral_strike
    from kickdyn.plane import Plane as Plane
    from kickdyn.planning.goal import Goal as Goal
    from kickdyn.planning.kick import plan_kick as plan_kick
    from kickdyn.planning.kick_plan import KickPlan as KickPlan
    from kickdyn.planning.launch import LaunchPlan as LaunchPlan
    from kickdyn.planning.launch import plan_launch as plan_launch
    from kickdyn.planning.launch_family_solver import plan_launches as plan_launches
    from kickdyn.planning.launch_result import Launch as Launch
    from kickdyn.planning.launch_result import Launches as Launches
    from kickdyn.planning.passes import Pass as Pass
    from kickdyn.planning.passes import plan_pass as plan_pass
    from kickdyn.planning.swing import plan_swing as plan_swing
    from kickdyn.planning.swing_result import Swing as Swing
    from kickdyn.robot.constraints import Support as Support
    from kickdyn.robot.leg import Leg as Leg
    from kickdyn.robot.posture import Posture as Posture
    from kickdyn.scene.scene import Scene as Scene
    from kickdyn.scene.simulate import simulate as simulate
    from kickdyn.scene.simulation import Simulation as Simulation
    from kickdyn.scene.toml_reader import load_scene as load_scene
    from kickdyn.sweeps.opened import open_sweep as open_sweep

_LATE = {
    "Air": "kickdyn.air",
    "Ball": "kickdyn.ball",
    "BallState": "kickdyn.ball",
    "Support": "kickdyn.robot.constraints",
    "Contact": "kickdyn.contact",
    "EnergyCreated": "kickdyn.errors",
    "InvalidInput": "kickdyn.errors",
    "KickdynError": "kickdyn.errors",
    "NoImpact": "kickdyn.errors",
    "SceneError": "kickdyn.errors",
    "UrdfError": "kickdyn.errors",
    "fly_many": "kickdyn.flight.batch",
    "fly": "kickdyn.flight.fly",
    "Course": "kickdyn.flight.follow",
    "follow": "kickdyn.flight.follow",
    "Flight": "kickdyn.flight.flight_result",
    "Ground": "kickdyn.ground",
    "Surface": "kickdyn.ground",
    "Collision": "kickdyn.impact.collide",
    "collide": "kickdyn.impact.collide",
    "EngineImpact": "kickdyn.impact.pinocchio_impact",
    "engine_strike": "kickdyn.impact.pinocchio_impact",
    "HertzContact": "kickdyn.impact.hertz",
    "contact_stiffness": "kickdyn.impact.hertz",
    "JointLoad": "kickdyn.impact.joint_load",
    "joint_loads": "kickdyn.impact.joint_load",
    "normal_impulse": "kickdyn.impact.laws",
    "Impact": "kickdyn.impact.impact_result",
    "Sensitivity": "kickdyn.impact.sensitivity",
    "sensitivity": "kickdyn.impact.sensitivity",
    "strike": "kickdyn.impact.strike",
    "Uncertainty": "kickdyn.impact.uncertainty",
    "uncertainty": "kickdyn.impact.uncertainty",
    "UnilateralImpact": "kickdyn.impact.unilateral",
    "unilateral_strike": "kickdyn.impact.unilateral",
    "Leg": "kickdyn.robot.leg",
    "Plane": "kickdyn.plane",
    "Launch": "kickdyn.planning.launch_result",
    "Launches": "kickdyn.planning.launch_result",
    "Goal": "kickdyn.planning.goal",
    "KickPlan": "kickdyn.planning.kick_plan",
    "plan_kick": "kickdyn.planning.kick",
    "LaunchPlan": "kickdyn.planning.launch",
    "plan_launch": "kickdyn.planning.launch",
    "plan_launches": "kickdyn.planning.launch_family_solver",
    "Pass": "kickdyn.planning.passes",
    "plan_pass": "kickdyn.planning.passes",
    "plan_swing": "kickdyn.planning.swing",
    "Swing": "kickdyn.planning.swing_result",
    "Posture": "kickdyn.robot.posture",
    "load_scene": "kickdyn.scene.toml_reader",
    "Scene": "kickdyn.scene.scene",
    "Simulation": "kickdyn.scene.simulation",
    "simulate": "kickdyn.scene.simulate",
    "open_sweep": "kickdyn.sweeps.opened",
}

__all__ = list(_LATE)


if not TYPE_CHECKING:  # which would take any name for known

    def __getattr__(name: str) -> object:
        """Load a name when it is asked for: commands that only say how they are used need none."""
        if name not in _LATE:
            raise AttributeError(f"module 'kickdyn' has no attribute {name!r}")
        found = globals()[name] = getattr(import_module(_LATE[name]), name)
        return found


def __dir__() -> list[str]:
    """Name what is loaded late, too."""
    return sorted([*globals(), *_LATE])
