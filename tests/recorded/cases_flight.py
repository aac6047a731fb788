"""Flights, bounces and rolling: one by one, many at once, with wind, spin, planes and events."""

import numpy as np

import kickdyn as kd
from kickdyn.flight import derivatives
from recorded.parts import AIR, BALL, CALM, GROUND, LAUNCH

HARD = kd.Ground(-0.4)
AIRS = {
    "vacuum": None, "wind": AIR, "calm": CALM, "default": kd.Air(), "paper": kd.Air.paper(),
    "sheared": kd.Air(wind=lambda z: (2.0 + 0.5 * z, 1.0, 0.1)), "goff": kd.Air(drag="goff-carre", lift="nathan"),
    "own": kd.Air(drag=lambda re, s: 0.2 + 1e-8 * re, lift=0.15, torque="tavares", buoyancy=False),
    "sphere": kd.Air(drag="sphere", lift=None, torque=None), "jabulani": kd.Air(drag="jabulani"),
    "teamgeist": kd.Air(drag="teamgeist", lift="wang"), "no drag": kd.Air(drag=None),
}  # fmt: skip
GOAL_LINE = kd.Plane((14, 0, 0), (-1, 0.1, 0), "back")
SLOW = kd.BallState((0, 0, -0.4), (4, 1.5, 1.0), (10, 30, -5))
SLIDING = kd.BallState((0, 0, GROUND.height + BALL.radius), (6, 1, 0), (2, -30, 5))
TURF, CARPET = kd.Ground(-0.95, "turf"), kd.Ground(-0.95, "carpet")
GRIPPY = kd.Ground(-0.95, kd.Surface("court", 0.75, 0.7, 0.3, 0.4))


def sampled(path):
    times = np.linspace(0.0, path.duration, 7)
    orient = {"orientation": path.orientation(times[1:4])} if isinstance(path, kd.Flight) else {}
    return {
        "path": path,
        "samples": path.sample(times),
        "states": [path.sample(t) for t in times[2:4]],
        **orient,
    }


def flown(air, ground=HARD, state=LAUNCH, **more):
    return sampled(kd.fly(state, BALL, air, ground, **more))


def followed(air, ground, state=LAUNCH, **more):
    return sampled(kd.follow(state, BALL, air, ground, **more))


def launches(count=6):
    draw = np.random.default_rng(7)
    return kd.BallState(
        draw.normal((0, 0, 1), 0.1, (count, 3)), draw.normal((16, 1, 7), 3.0, (count, 3)),
        draw.normal(0, 25, (count, 3)), draw.uniform(0, 1, count),
    )  # fmt: skip


def high(state, numbers):
    return numbers[0] - state[2]


ENDS = {
    "high": kd.Event("high", high, (2.5,)),
    "low": kd.Event("low", lambda s, n: s[2] - n[0] + 9.0 - s[0], (0.5,)),
}


def slopes(air, end, **more):
    def launch(values):
        wind = kd.Air(1.1, wind=(values[3], 1, 0), drag="brazuca")
        return kd.BallState(velocity=values[:3], spin=(8, -40, 25)), air and wind

    values = np.array([17.0, 3.0, 9.0, 1.5])
    one = derivatives.fly_with_slopes(
        launch, values, derivatives.INCREMENT * values, BALL, end, **more
    )
    return [one.states(0.5), one.slopes(0.5), one.position(0.5), one.velocity(0.5),
            one.slopes_at_plane(np.array([-1.0, 0.1, 0.0]), 0.5)]  # fmt: skip


CASES = {
    "warnings": lambda: [
        kd.fly(
            kd.BallState((0, 0, 1), (speed, 0, 1), spin),
            kd.Ball(),
            kd.Air(drag="brazuca", lift="wang"),
        ).warnings
        for speed, spin in ((3.0, (0, 0, 0)), (60.0, (0, -9, 0)), (9.0, (0, -150, 0)))
    ],
    **{f"through {name}": (lambda air=air: flown(air)) for name, air in AIRS.items()},
    "to a plane": lambda: flown(AIR, plane=GOAL_LINE),
    "arrival": lambda: kd.fly(LAUNCH, BALL, AIR, HARD, plane=GOAL_LINE).arrival(9.0),
    "aloft": lambda: flown(CALM, time_limit=0.8),
    "loose": lambda: flown(AIR, tol=1e-4),
    "steps": lambda: flown(AIR, max_step=0.05),
    "event": lambda: flown(AIR, ends=[ENDS["high"], ENDS["low"]]),
    "dropped": lambda: flown(CALM, HARD, kd.BallState((0, 0, 5))),
    "from below": lambda: flown(CALM, kd.Ground(2.0)),
    "no ground": lambda: flown(CALM, None, SLOW),
    "very fast": lambda: (
        kd.fly(kd.BallState(velocity=(70, 0, 20), spin=(0, 0, 300)), BALL, kd.Air()).warnings
    ),
    "course on turf": lambda: followed(AIR, TURF),
    "course on carpet": lambda: followed(CALM, CARPET),
    "course on a court": lambda: followed(AIR, GRIPPY),
    "course in vacuum": lambda: followed(None, TURF),
    "course to a plane": lambda: followed(AIR, TURF, plane=GOAL_LINE),
    "course to a plane on the ground": lambda: followed(
        CALM, CARPET, SLIDING, plane=kd.Plane((4, 0, 0), (-1, 0, 0))
    ),
    "slides and rolls": lambda: followed(CALM, TURF, SLIDING),
    "bounces low": lambda: followed(CALM, GRIPPY, SLOW),
    "course in time": lambda: followed(AIR, TURF, time_limit=1.7),
    "course with an event": lambda: followed(CALM, TURF, ends=[ENDS["high"]]),
    "course without a ground": lambda: followed(AIR, None),
    **{
        f"many through {name}": (lambda air=air: kd.fly_many(launches(), BALL, air, HARD))
        for name, air in AIRS.items()
        if name in ("vacuum", "wind", "sheared", "goff", "own")
    },
    "many, error": lambda: kd.fly_many(launches(3), BALL, AIR, HARD, error=True),
    "many to a plane": lambda: kd.fly_many(launches(), BALL, AIR, HARD, plane=GOAL_LINE),
    "many to an event": lambda: kd.fly_many(launches(), BALL, CALM, HARD, ends=[ENDS["high"]]),
    "many on own ground": lambda: kd.fly_many(launches(3), BALL, CALM),
    "many courses": lambda: kd.follow_many(launches(), BALL, AIR, TURF),
    "many courses, court": lambda: kd.follow_many(launches(), BALL, CALM, GRIPPY),
    "many courses in vacuum": lambda: kd.follow_many(launches(), BALL, None, CARPET),
    "many courses to a plane": lambda: kd.follow_many(launches(), BALL, AIR, TURF, plane=GOAL_LINE),
    "many courses in time": lambda: kd.follow_many(launches(), BALL, AIR, TURF, time_limit=1.5),
    "slopes": lambda: slopes(AIR, 0.9),
    "slopes, central": lambda: slopes(AIR, 0.9, central=True),
    "slopes in vacuum": lambda: slopes(None, 0.9),
    "slopes at a plane": lambda: slopes(AIR, GOAL_LINE),
    "slopes at a plane in vacuum": lambda: slopes(None, GOAL_LINE),
    "slopes, out of reach": lambda: slopes(AIR, kd.Plane((300, 0, 0), (-1, 0, 0))),
}
