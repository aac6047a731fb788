"""Balls, air, ground, contacts, planes, goals, coefficients: what they say and compute."""

import copy
import math
import pickle

import numpy as np

import kickdyn as kd
from kickdyn import air as air_module
from kickdyn import restitution as restitution_module
from kickdyn.aerodynamics import coefficient_model, drag, lift, spin_decay
from kickdyn.contact import Contact
from kickdyn.core import console, mechanics
from kickdyn.core.representation import format_value
from kickdyn.flight import events
from kickdyn.ground import SURFACES
from kickdyn.scene import pitch
from recorded.parts import AIR, BALL, CALM, GROUND, LAUNCH

REYNOLDS = [2.0, 900.0, 5e4, 9e4, 1.4e5, 2.2e5, 3.1e5, 5e5, 9e5, 3e6]
SPINS = [0.0, 0.05, 0.18, 0.4, 0.9, 1.6]
STATES = kd.BallState(
    [[0, 0, 1], [2, 1, 3]], [[9, 2, 3], [7, -4, 0]], [[1, 2, 3], [4, 5, -6]], [0.1, 0.4]
)


def coefficients(models):
    return {
        name: {
            "values": [[model(re, s) for s in SPINS] for re in REYNOLDS],
            "beyond": model.beyond(np.array(REYNOLDS), np.full(10, 0.5)),
            "again": pickle.loads(pickle.dumps(model))(2.2e5, 0.2),
            "model": [model.kind, model.reynolds, model.spin, model.source],
            "half": coefficient_model.scaled(model, 0.5)(2.2e5, 0.2),
        }
        for name, model in models.items()
    }


def tables(value):
    checked = restitution_module.checked_restitution(value)
    speeds = [0.0, 3.0, 5.0, 9.1, 12.0, 16.0, 20.0, 21.2, 24.0, 40.0]
    return {
        "at": [restitution_module.restitution_at(checked, x) for x in speeds],
        "slope": [restitution_module.restitution_slope(checked, x) for x in speeds],
        "warnings": [restitution_module.range_warnings(checked, x) for x in speeds],
        "least": restitution_module.least_restitution(checked),
        "text": restitution_module.format_restitution(checked),
        "described": restitution_module.describe_restitution(checked, 0.71, 9.0),
        "approach": [restitution_module.approach_speed(checked, x) for x in (2.0, 14.0, 30.0)],
    }


def goals():
    kinds = {
        "time": kd.Goal((11, 1, 0.4), time=0.7, spin=(0, -20, 5)),
        "apex": kd.Goal((11, 1, 0.4), apex=3.0),
        "speed, high": kd.Goal((11, -2, 0.4), speed=15, arc="high"),
        "over": kd.Goal((20, 3, 1), over=(9.15, 2.2)),
        "beside": kd.Goal((20, 0, 1), speed=25, beside=(9, 1), spin=(0, -30, 0)),
        "receiver": kd.Goal((20, 0, 0), time=1.2, receiver_velocity=(2, 1, 0)),
    }
    return {
        name: [
            goal,
            goal.named_values(),
            goal.nominal_times(),
            goal.at(0.3),
            goal.seen_from(np.array([1.0, 2, 0.5]), 0.2),
        ]
        for name, goal in kinds.items()
    } | {name: repr(goal) for name, goal in kinds.items()}


CASES = {
    "balls": lambda: [
        kd.Ball(),
        kd.Ball.paper(),
        BALL,
        kd.Ball(0.05, 0.04, 0.4),
        kd.Ball(math.inf, 0.1),
    ],
    "ball's stiffness": lambda: [
        BALL.stiffness,
        BALL.turning,
        BALL.volume,
        BALL.cross_section,
        BALL.warnings,
    ],
    "odd balls warn": lambda: [kd.Ball(0.43, 0.11, pressure=p).warnings for p in (3e3, 5e4, 2e5)],
    "balls printed": lambda: [repr(kd.Ball()), repr(BALL), BALL._repr_html_()],
    "states": lambda: {
        "one": [LAUNCH, LAUNCH.speed, LAUNCH.elevation, repr(LAUNCH)],
        "many": [
            repr(STATES),
            STATES.speed,
            STATES.elevation,
            repr(kd.BallState([[0, 0, 0]] * 3, time=[0, 1, 4])),
        ],
        "computed": kd.BallState.computed(np.ones(3), np.zeros(3), np.ones(3), 2.0),
        "equal": [
            copy.copy(LAUNCH) == LAUNCH,
            STATES == STATES,
            hash(BALL) == hash(copy.deepcopy(BALL)),
        ],
    },
    "air": lambda: [
        AIR,
        CALM,
        kd.Air(),
        kd.Air.paper(),
        kd.Air(wind=lambda z: (z, 0, 0)),
        kd.Air(0.9, drag=None),
        kd.Air(drag=0.3, lift=0.2, torque=None),
        kd.Air(drag=lambda re, s: 0.2),
    ],
    "air at": lambda: [
        kd.Air.at(30.0),
        kd.Air.at(-5, pressure=9e4),
        kd.Air.at(altitude=2400.0),
        AIR.wind_at(3.0),
        kd.Air(wind=lambda z: (z, 1.0, 0)).wind_at(3.0),
    ],
    "air's formulas": lambda: [
        air_module.density_of(300.0, 9e4),
        air_module.viscosity_of(300.0),
        air_module.standard_atmosphere(1500.0),
        air_module.standard_atmosphere(15e3),
    ],
    "grounds": lambda: [
        GROUND,
        kd.Ground(0.2),
        kd.Ground(0.1, kd.Surface("mud", 0.3, 0.9, 4.0)),
        dict(SURFACES),
    ],
    "surfaces printed": lambda: [repr(kd.Ground(0.1, surface=name)) for name in SURFACES],
    "contacts": lambda: [
        Contact((2, 0.3, 1), e, 0.1, (0.01, 0, -0.02))
        for e in (0.7, "inflated", "peacock-ball", [(5, 0.8), (20, 0.6)])
    ],
    "contacts at speeds": lambda: [
        [Contact((1, 0, 0), e).restitution_at(u, BALL) for u in (1, 8, 15, 30)]
        for e in (0.7, "inflated", "peacock-ball", [(5, 0.8), (20, 0.6)])
    ],
    "contact for a ball": lambda: Contact((1, 0, 2), "inflated").for_ball(BALL),
    **{
        f"restitution {value}": (lambda value=value: tables(value))
        for value in (0.7, "peacock-ball", ((5, 0.8), (12, 0.75), (20, 0.6)))
    },
    "restitution by pressure": lambda: [
        restitution_module.inflated(kd.Ball(0.43, 0.11, pressure=p)) for p in (3e4, 8e4)
    ],
    "restitution's slopes of a ball": lambda: [
        restitution_module.ball_slopes("inflated", BALL, u) for u in (6.0, 18.0)
    ],
    "restitution read": lambda: [
        restitution_module.read_restitution(t) for t in ("0.6", "peacock-ball", "5:0.8,20:0.65")
    ],
    "planes": lambda: [
        kd.Plane((30, 1, 0), (-2, 0, 0), how) for how in ("front", "centre", "back")
    ],
    "gaps of planes": lambda: [
        kd.Plane((30, 1, 0), (-2, 0.5, 0), how).gap(BALL, (28, 1, 2))
        for how in ("front", "centre", "back")
    ],
    "goal lines": lambda: [
        kd.Plane((30, 1, 0), n, how).is_goal_line
        for how in ("front", "back")
        for n in ((1, 0, 0), (1, 0, 1))
    ],
    "goals": goals,
    "walls": lambda: [kd.Wall(9.15, 1.9), kd.Wall(9.15, 1.9, 3.5)],
    "pitch": lambda: {name: item for name, item in vars(pitch).items() if isinstance(item, float)},
    "drag": lambda: coefficients(drag.MODELS),
    "lift": lambda: coefficients(lift.MODELS),
    "spin decay": lambda: coefficients(spin_decay.MODELS),
    "constant coefficients": lambda: [
        drag.constant(0.3)(2e5, 0.1),
        drag.constant(0.3).function(2e5),
        repr(drag.constant(0.3)),
    ],
    "events": lambda: [
        kd.Event("high", lambda s, n: n[0] - s[2], (2.0,)),
        kd.Event("high", lambda s, n: n[0] - s[2], lambda launch: (launch.speed,)).launched(LAUNCH),
        events.drops(STATES.position, BALL, GROUND),
    ],
    "numbers as text": lambda: [
        format_value(x) for x in (True, 1.23456, np.array([1.0, 1e-17, -0.0]), 3, "x", -0.0)
    ],
    "lines": lambda: [
        console.wrapped("one two three four five " * 9, 60, 4, "- "),
        console.notes(["first " * 20, "second"], 50),
    ],
    "cross products": lambda: [
        mechanics.cross(np.array([1.0, 2, 3]), np.array([4.0, -5, 6])),
        mechanics.cross3((1, 2, 3), (4, -5, 6)),
    ],
}
