"""Planned kicks carried out in MuJoCo: with a plate and the own foot, corrected, and with noise.

    python benchmarks/kicks_in_mujoco.py [g1-7.9 g1-9.4 g1-11.4 talos humanoid] [--runs 50]
    python benchmarks/kicks_in_mujoco.py t1 --t1 booster_gym/resources/T1/T1_serial.urdf
    python benchmarks/kicks_in_mujoco.py g1 t1 k1 op3 --surfaces --t1 URDF --k1 URDF --op3 MJCF

A line for each kick as it was planned, and after two corrections: errors of the ball's speed and
direction, miss of the target and of the planned flight 3 m away, whether the robot stands 1 s
later, and processor time. A plate at the contact point strikes the ball, or the robot's own foot;
a kick corrected with the plate is also carried out with the own foot. Then, for the kick corrected
with the own foot, a table of both errors with the ball displaced, and for either foot runs with the
noise of `kd.KickNoise()` (masses 2 %, friction 10 %, commands up to 5 ms late, place of the ball
5 mm): how many robots stand, and how the balls scatter.

With `--surfaces`, straight kicks over 2, 3 and 4 m with the surfaces of each robot's foot: change
of direction and speed per cm that the ball is displaced, along and across, by
`plan.sensitivity_to_ball`; for the surface of `kd.choose_surface` also with a motion and in MuJoCo.

T1 is Booster's, of github.com/BoosterRobotics/booster_gym, K1 of BoosterRobotics/booster_assets,
both without rotors, OP3 of the mujoco_menagerie; all on their left foot, with their arms spread.
"""

import argparse
import math
import time
from pathlib import Path

import numpy as np

import kickdyn as kd
from kickdyn.simulators.tune_mujoco import MujocoTuning

BALL, AIR = kd.Ball(), kd.Air()
ARMS = {"*wrist*": 0.0}
HANDS = {"arm_*_[567]_joint": 0.0, "*gripper*": 0.0, "head_*": 0.0}
NEAR = 3.0
"""Distance at which the balls are compared with the planned flight [m]."""

TOE = kd.Contact(friction=0.4, offset=(0.066, -0.0135, 0.133))
"""A point of the humanoid's foot, a sphere of 75 mm, where the ball of its kick meets it."""

DISPLACED = 0.0, 0.01, 0.02, 0.05
"""Displacements of the ball [m]."""

KICKS = (2, 0.5), (3, 0.6), (4, 0.7)
"""Distances of kicks [m] and their times of flight [s]."""

SMALL = kd.Ball(0.2, 0.07)
"""A ball for a robot of half a metre."""

SPREAD = {"*Head*": 0.0, "*Elbow*": 0.0, "*Shoulder_Pitch": 0.0} | {
    "Left_Shoulder_Roll": -1.3, "Right_Shoulder_Roll": 1.3
}  # fmt: skip


def g1() -> kd.Leg:
    """Return G1 with 23 joints on its left foot."""
    robot = kd.Leg.from_robot("g1", base="floating", locked=ARMS)
    return robot.with_supports(kd.Support("left_ankle_roll_link", friction=0.7))


def talos() -> kd.Leg:
    """Return TALOS on its left foot; its planner holds the arms aside of the kicking leg."""
    robot = kd.Leg.from_robot("talos", base="floating", locked=HANDS)
    return robot.with_supports(kd.Support("left_sole_link", friction=0.7))


def humanoid() -> kd.Leg:
    """Return the humanoid of gymnasium on its left foot."""
    import gymnasium

    file = Path(gymnasium.__file__).parent / "envs/mujoco/assets/humanoid.xml"
    return kd.Leg.from_mjcf(file, "right_foot", base="floating").with_supports("left_foot")


def booster(file: str) -> kd.Leg:
    """Return Booster's T1 or K1 on its left foot."""
    robot = kd.Leg.from_urdf(file, "right_foot_link", base="floating", drives=False, locked=SPREAD)
    return robot.with_supports(kd.Support("left_foot_link", friction=0.7))


def op3(file: str) -> kd.Leg:
    """Return ROBOTIS' OP3 on its left foot."""
    locked = {"head*": 0.0, "*_sho_pitch": 0.0, "*_el": 0.0, "l_sho_roll": -0.4, "r_sho_roll": 0.4}
    robot = kd.Leg.from_mjcf(file, "r_ank_roll_link", base="floating", locked=locked)
    return robot.with_supports(kd.Support("l_ank_roll_link", friction=0.7))


def measure_surfaces(robot: kd.Leg, ball: kd.Ball) -> None:
    """Print how kicks with each surface of a foot, without a motion, depend on the ball's place.

    Then, for a kick with the surface that `choose_surface` chooses, the same of its motion, and in
    MuJoCo.
    """
    print("| surface | kick | launch | along | across |\n|---|---|---|---|---|")
    for surface in ("inside", "instep", "outside", "toe"):
        for distance, duration in KICKS:
            goal = kd.Goal(distance, time=duration)
            try:
                plan = kd.plan_kick(kd.kick_with(robot, surface), goal, ball, AIR)
            except kd.InvalidInput as error:
                print(f"| {surface} | {distance} m | {str(error)[:60]} | | |", flush=True)
                continue
            launch = f"{plan.impact.ball_after.speed:.1f} m/s, {plan.status}"
            print(f"| {surface} | {distance} m | {launch} | {in_words(plan)} |", flush=True)
    goal = kd.Goal(KICKS[1][0], time=KICKS[1][1])
    leg = kd.choose_surface(robot, goal, ball, AIR)
    plan = kd.plan_kick(leg, goal, ball, AIR, motion=True)
    print(f"{leg.frame}, with its motion, {plan.status}, {plan.share:.0%} of the launch:")
    changes = simulated_changes(plan, kd.run_in_mujoco(plan).tuning)
    print(f"  planned: {in_words(plan)}\n  MuJoCo: {changes}", flush=True)


def in_words(plan: kd.KickPlan) -> str:
    """Return the changes of a launch by 1 cm as cells of a table."""
    seen = plan.sensitivity_to_ball
    return " | ".join(
        f"{change.direction_deg:.1f}°, {change.speed_percent:.1f} %"
        for change in (seen.along, seen.across)
    )


def simulated_changes(plan: kd.KickPlan, tuning: MujocoTuning) -> list[tuple[float, float]]:
    """Return changes of direction [deg] and speed [%] by 1 cm, along and across, in MuJoCo."""
    first = kd.run_in_mujoco(plan, tuning=tuning).ball_after
    ahead = plan.aim.ahead
    changes = []
    for axis in (ahead, np.cross((0.0, 0.0, 1.0), ahead)):
        pairs = []
        for side in (0.01, -0.01):
            run = kd.run_in_mujoco(plan, tuning=tuning, ball_displacement=side * axis[:2])
            after = run.ball_after
            sine = np.linalg.norm(np.cross(first.velocity, after.velocity))
            angle = math.degrees(math.atan2(sine, first.velocity @ after.velocity))
            change = abs(after.speed / first.speed - 1.0)
            pairs.append((angle, 100 * change) if run.path else (math.inf, math.inf))
        changes.append(tuple(map(max, *pairs)))
    return changes


CASES = {
    "g1-7.9": (g1, kd.Goal(3, time=0.4), None),
    "g1-9.4": (g1, kd.Goal(3.5, time=0.387), None),
    "g1-11.4": (g1, kd.Goal(5, time=0.46), None),
    "talos": (talos, kd.Goal(3, time=0.4), None),
    "humanoid": (humanoid, kd.Goal(1.2, time=0.22), TOE),
}


def describe(run: kd.MujocoRun) -> str:
    """Return the errors of a run as text."""
    return (
        f"speed {run.speed_error:+.1%}, direction {math.degrees(run.direction_error):.1f} deg, "
        f"misses by {100 * run.miss:.1f} cm, by {100 * miss_at(run, NEAR):.1f} cm at {NEAR:g} m, "
        f"{'stands' if run.upright else 'FALLS'}"
    )


def miss_at(run: kd.MujocoRun, distance: float) -> float:
    """Return how far the ball passes from the planned flight at a distance [m]."""
    if run.path is None:
        return math.inf
    plan = run.plan
    start, ahead = plan.impact.ball_before.position, plan.aim.ahead
    plane = kd.Plane(start + distance * ahead, -ahead, "centre")
    wish = kd.BallState(start, plan.launch.velocity, plan.launch.spin)
    ends = [
        kd.fly(ball, BALL, AIR, kd.Ground(-9), plane=plane).landing.position
        for ball in (wish, run.ball_after)
    ]
    return float(np.linalg.norm(ends[1] - ends[0]))


def print_displacements(plan: kd.KickPlan, contact: kd.MujocoRun) -> None:
    """Print errors of speed and direction of displaced balls, in the contact of a run."""
    ahead = plan.aim.ahead
    left = np.cross((0.0, 0.0, 1.0), ahead)
    sides = {"ahead": ahead, "back": -ahead, "left": left, "right": -left}
    print("  | ball | plate | own foot |\n  |---|---|---|")
    for distance in DISPLACED:
        for side, along in sides.items() if distance else [("in its place", ahead)]:
            errors, place = [], distance * along[:2]
            for foot in ("plate", "shapes"):
                run = kd.run_in_mujoco(
                    plan, tuning=contact.tuning, foot=foot, ball_displacement=place
                )
                text = f"{run.speed_error:+.1%}, {math.degrees(run.direction_error):.1f}°"
                text = "missed" if run.path is None else text
                errors.append(text if run.foot == foot else f"{text} (a plate)")
            where = f"{100 * distance:g} cm {side}" if distance else side
            print(f"  | {where} | {' | '.join(errors)} |", flush=True)


ROBOTS = {"g1": (lambda _: g1(), BALL), "t1": (booster, BALL), "k1": (booster, BALL),
          "op3": (op3, SMALL)}  # fmt: skip


def main() -> None:
    """Print the lines of each kick."""
    parser = argparse.ArgumentParser()
    parser.add_argument("cases", nargs="*", default=list(CASES))
    parser.add_argument("--runs", type=int, default=50)
    for robot in ("t1", "k1", "op3"):
        parser.add_argument(f"--{robot}", metavar="FILE", help=f"the file of {robot.upper()}")
    parser.add_argument("--surfaces", action="store_true", help="measure the surfaces of the feet")
    arguments = parser.parse_args()
    if arguments.surfaces:
        for name in arguments.cases:
            make, ball = ROBOTS[name]
            print(f"{name}:")
            measure_surfaces(make(getattr(arguments, name, None)), ball)
        return
    toe = kd.kick_with(booster(arguments.t1), "toe") if arguments.t1 else None
    cases = CASES | {"t1": (lambda: toe, kd.Goal(1.2, time=0.3), None)}
    for name in arguments.cases:
        make, goal, point = cases[name]
        start = time.process_time()
        plan = kd.plan_kick(make(), goal, BALL, AIR, contact=point, motion=True)
        planned = time.process_time() - start
        print(f"{name}, {plan.launch.speed:.2f} m/s: {plan.status}, {planned:.0f} s", flush=True)
        contact = kd.run_in_mujoco(plan)
        corrected = {"planned": plan}
        for foot, text in (("plate", "a plate"), ("shapes", "the own foot")):
            start = time.process_time()
            corrected[foot] = kd.refine_kick(plan, rounds=2, by="mujoco", foot=foot)
            print(f"  corrected twice with {text}: {time.process_time() - start:.0f} s", flush=True)
        for text, plan, foot in (
            ("as planned, a plate", corrected["planned"], "plate"),
            ("as planned, the own foot", corrected["planned"], "shapes"),
            ("corrected with a plate, a plate", corrected["plate"], "plate"),
            ("corrected with a plate, the own foot", corrected["plate"], "shapes"),
            ("corrected with the own foot", corrected["shapes"], "shapes"),
        ):
            run = kd.run_in_mujoco(plan, tuning=contact.tuning, foot=foot)
            print(f"  {text}: {describe(run)}", *run.doubts, sep="\n    ", flush=True)
        print_displacements(plan, contact)
        for foot in ("plate", "shapes") if arguments.runs else ():
            options = {"tuning": contact.tuning, "foot": foot}
            print(foot, kd.run_with_noise(corrected[foot], arguments.runs, **options), flush=True)


if __name__ == "__main__":
    main()
