"""Every row of the table of every result: its name, its number, its unit, and no row besides."""

import html
import math
import re
from dataclasses import replace
from functools import cache, partial
from importlib import import_module
from pkgutil import walk_packages

import numpy as np
import pytest
from scipy.interpolate import BSpline

import kickdyn as kd
from kickdyn.core.representation import ReprMixin
from kickdyn.identification.infer_impact import RestitutionFit
from kickdyn.identification.track import Track
from kickdyn.motion.motion import Motion
from kickdyn.planning.goal import PlannedLaunch
from kickdyn.planning.reach import ReachRow, ReachTable
from kickdyn.simulators.mujoco_fit import KickError
from kickdyn.simulators.run_in_mujoco import MujocoRun
from kickdyn.simulators.tune_mujoco import MujocoGoal, MujocoTuning

BALL = kd.Ball(0.41, 0.105, pressure=80e3)
GROUND = kd.Ground(-0.95, surface="turf")
LEG = kd.Leg.human()
POSTURE = LEG.posture([0.7, 0.5, -0.3])
V = (6.6, -14.5, 6.6)
INCOMING = {"ball_velocity": (-3, 1, 0.5), "ball_spin": (5, -8, 3)}
CONTACT = kd.Contact((2, 0.3, 1), "peacock-ball", 0.02)
AIR = kd.Air(density=1.1, wind=(1, 2, 0.5), torque=None)


def table(shown):
    """Return name, value and unit of each row of a notebook's table, as text."""
    cell = r"<t[hd][^>]*>(.*?)</t[hd]>"
    rows = re.findall(rf"<tr>{cell}{cell}{cell}</tr>", shown._repr_html_())
    return [tuple(map(html.unescape, row)) for row in rows]


def text(value):
    """Return a number or a vector with four digits, and a text as it is."""
    if isinstance(value, str):
        return str(value)
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, int):
        return str(value)
    if np.ndim(value):
        value = np.asarray(value, dtype=float)
        value = np.where(np.abs(value) < 1e-12 * np.abs(value).max(), 0.0, value)  # rounding
        return f"({', '.join(map(text, value.tolist()))})"
    return f"{value + 0.0:.4g}"


def plus_minus(value, deviation, digits=4):
    return f"{value:.{digits}g} +- {deviation:.2g}"


def of_ball(ball):
    return {
        "mass": (ball.mass, "kg"),
        "radius": (ball.radius, "m"),
        "inertia": (2 / 3 * ball.mass * ball.radius**2, "kg m2"),
        "pressure": (ball.pressure, "Pa"),
    }


def of_ground(ground):
    surface = ground.surface
    return {
        "height": (ground.height, "m"),
        "surface": (surface.name, ""),
        "restitution": (surface.restitution, ""),
        "friction": (surface.friction, ""),
        "rolling deceleration": (surface.rolling_deceleration, "m/s2"),
    }


def of_hard_ground(ground):
    return {"height": (ground.height, "m"), "surface": ("none: flights end on it", "")}


def of_air(air):
    return {
        "density": (air.density, "kg/m3"),
        "viscosity": (air.viscosity, "Pa s"),
        "wind": (air.wind, "m/s"),
        "drag": ("supercritical", ""),
        "lift": ("saturating", ""),
        "spin decay": ("not modelled", ""),
        "buoyancy": (True, ""),
    }


def of_contact(contact):
    return {
        "normal": (np.array([2, 0.3, 1]) / math.sqrt(5.09), ""),
        "restitution": (0.7, ""),
        "friction": (contact.friction, ""),
        "offset": ((0.01, 0.0, -0.02), "m"),
    }


def of_plane(plane):
    return {
        "point": ((30.0, 1.0, 0.0), "m"),
        "normal": ((-1.0, 0.0, 0.0), ""),
        "reached by": (f"the ball's {plane.reached_by}", ""),
    }


def of_leg(leg):
    rows = {
        "robot": (leg.name, ""),
        "contact frame": ("toe", ""),
        "mass": (sum(body.mass for body in leg.model.inertias), "kg"),
    }
    for joint, name in enumerate(leg.joint_names):
        low, high = leg.model.lowerPositionLimit[joint], leg.model.upperPositionLimit[joint]
        rows[f"joint {name}"] = (f"{low:.4g} to {high:.4g}", "rad")
    return rows


def of_posture(posture):
    degrees = np.degrees(posture.q).tolist()
    rows = {name: (x, "deg") for name, x in zip(LEG.joint_names, degrees, strict=True)}
    return rows | {
        "leg": (posture.leg.name, ""),
        "contact point": (posture.contact_point, "m"),
        "condition": (posture.condition, ""),
        "stiff joints": ("ankle", ""),
    }


def of_ball_after(hit):
    """What a strike and a contact that takes time have in common."""
    before, after = hit.ball_before, hit.ball_after
    return {
        "impulse on the ball": (BALL.mass * (after.velocity - before.velocity), "N s"),
        "ball after": (after.velocity, "m/s"),
        "spin after": (after.spin, "rad/s"),
        "energy lost": (hit.energy_lost, "J"),
    }


def of_impact(impact):
    foot = impact.posture.jacobian @ impact.v_before
    sizes = np.linalg.norm(impact.joint_impulses[:, :3], axis=1)
    joint = impact.posture.leg.joint_names[int(sizes.argmax())]
    slope = (0.696 - 0.729) / (21.2 - 9.1)  # of the table "peacock-ball"
    normal = impact.contact.normal
    across = np.linalg.norm(impact.impulse - (impact.impulse @ normal) * normal)
    slides = across > 0.99 * impact.contact.friction * float(impact.impulse @ normal)
    return of_ball_after(impact) | {
        "law": ("newton" if slides else "newton, sticks", ""),
        "restitution": (0.729 + slope * (impact.approach.speed - 9.1), ""),
        "effective mass": (impact.posture.effective_mass(normal), "kg"),
        "foot before": (foot, "m/s"),
        "ball over foot speed": (impact.ball_after.speed / np.linalg.norm(foot), ""),
        f"worst joint, {joint}": (sizes.max(), "N s"),
        "residuals": ("below 1e-14", ""),
        "condition": (impact.posture.condition, ""),
        "digits at least": (math.floor(impact.digits), ""),
    }


def of_stiff_impact(impact):
    """A stiff joint and rotors add rows: 1 / (n J M^-1 J^T n), and M without and with them."""
    normal, posture = impact.contact.normal, impact.posture
    free = posture.leg.with_stiff_joints().posture(posture.q)
    limits = posture.effective_mass_limits(normal)
    return of_impact(impact) | {
        "drives": ("with rotors, stiff ankle", ""),
        "with all joints free": (free.effective_mass(normal), "kg"),
        "work of the motors": (impact.motor_work, "J"),
        **{f"limit {name}": (mass, "kg") for name, mass in limits.items()},
        "limit with stiff joints": ("infinite (base or foot fixed)", ""),
    }


def of_collision(hit):
    return of_ball_after(hit) | {
        "contact time": (1e3 * hit.contact_time, "ms"),
        "visible contact time": (1e3 * hit.visible_contact_time, "ms"),
        "peak force": (hit.peak_force, "N"),
        "deflection": (1e3 * hit.deflection, "mm"),
        "energy residual": (hit.energy_residual, ""),
    }


SOURCES = {
    "q": "rad", "v": "(rad/s)", "restitution": "1", "friction": "1", "normal": "rad",
    "ball_mass": "kg", "ball_radius": "m", "ball_velocity": "(m/s)", "ball_spin": "(rad/s)",
    "link_mass": "kg",
}  # fmt: skip


def of_sensitivity(slopes, branch, unit):
    largest = {
        name: np.linalg.svd(rows, compute_uv=False)[0] for name, rows in slopes.impulse.items()
    }
    return {
        "branch": (branch, ""),
        "margin": (slopes.margin, unit),
        **{
            f"impulse by {name}, at most": (largest[name], f"N s per {per}")
            for name, per in SOURCES.items()
        },
        **{
            f"joint impulse by {name}, at most": (
                max(np.linalg.svd(rows[:3], compute_uv=False)[0] for rows in joints),
                f"N s per {SOURCES[name]}",
            )
            for name, joints in slopes.joint_impulses.items()
        },
    }


def of_flight(flight):
    moved = flight.landing.position - flight.launch.position
    return {
        "status": ("landed", ""),
        "launch": (flight.launch.velocity, "m/s"),
        "spin": (flight.launch.spin, "rad/s"),
        "range": (math.hypot(*moved[:2]), "m"),
        "height": (flight.apex.position[2] - flight.launch.position[2], "m"),
        "duration": (flight.landing.time, "s"),
        "landing": (flight.landing.position, "m"),
        "landing speed": (math.hypot(*flight.landing.velocity), "m/s"),
        "method": (f"{flight.method}, {flight.evaluations} evaluations", ""),
    }


def of_course(course, status):
    moved = course.rest.position - course.launch.position
    return {
        "status": (status, ""),
        "launch": (course.launch.velocity, "m/s"),
        "bounces": (len(course.bounces), ""),
        "distance": (math.hypot(*moved[:2]), "m"),
        "duration": (course.rest.time, "s"),
        "end": (course.rest.position, "m"),
    }


def of_goal(goal):
    return {
        "target": ((11.0, 1.0, 0.0), "m"),
        "time": (0.7, "s"),
        "spin": ((0.0, -20.0, 5.0), "rad/s"),
        "distance": (math.hypot(11, 1), "m"),
    }


def of_curved_goal(goal):
    return {
        "target": ((20.0, 0.0, 1.0), "m"),
        "speed": (25.0, "m/s"),
        "beside": ((9.0, 1.0), "m"),
        "arc": ("high", ""),
        "distance": (20.0, "m"),
    }


def of_launch(launch):
    vx, vy, vz = launch.velocity.tolist()
    rows = {
        "status": (launch.status, ""),
        "speed": (math.hypot(vx, vy, vz), "m/s"),
        "angle": (math.degrees(math.atan2(vz, math.hypot(vx, vy))), "deg"),
        "azimuth": (math.degrees(math.atan2(vy, vx)), "deg"),
        "spin": (launch.spin, "rad/s"),
        "time": (launch.flight.duration, "s"),
        "largest error": (np.abs(launch.errors).max(), ""),
        "iterations": (launch.iterations, ""),
    }
    for other in launch.others:
        vx, vy, vz = other.velocity.tolist()
        angle = math.degrees(math.atan2(vz, math.hypot(vx, vy)))
        rows["another"] = (f"{math.hypot(vx, vy, vz):.4g} m/s, {angle:.4g} deg", "")
    return rows


def of_unreachable(launch):
    return of_launch(launch) | {
        "status": ("unreachable: speed-limit", ""),
        "nearest": (repr(launch.reached), ""),
    }


def of_pass(launch):
    return {
        "status": ("met", ""),
        "launch": (launch.course.launch.velocity, "m/s"),
        "time": (launch.course.rest.time, "s"),
        "aside": (launch.aside, "m"),
        "bounces": (0, ""),
    }


def of_plan(plan):
    impact, flight, target = plan.impact, plan.path, plan.goal.target
    end = flight.sample(flight.duration).position - flight.launch.position
    speeds = np.abs(impact.v_before) / LEG.velocity_limit
    return {
        "status": ("met", ""),
        "posture": (impact.posture.q, "rad"),
        "joint velocity": (impact.v_before, "rad/s"),
        "impulse on the ball": (impact.impulse, "N s"),
        "launch": (impact.ball_after.velocity, "m/s"),
        "landing error": (np.linalg.norm(end - target), "m"),
        "time error": (plan.time_error, "s"),
        "objective joint-speed": (
            np.mean(speeds**2),
            "(mean square of the joint speeds over their limits)",
        ),
        "share of the speed limit": (np.max(speeds), ""),
        "share of the torque limit": (plan.torque_use, ""),
    }


def of_motion(motion):
    return {
        "joints": ("hip, knee, ankle", ""),
        "begin": (-0.5, "s"),
        "end": (0.75, "s"),
    }


def incoming_ball():
    return kd.IncomingBall(kd.BallState((2, 0.1, -0.7), (-2.5, 0.2, 0), (0, -20, 1)))


def of_incoming_ball(ball):
    state = ball.state
    return {
        "position": (state.position, "m"),
        "velocity": (state.velocity, "m/s"),
        "spin": (state.spin, "rad/s"),
    }


@cache
def meetings():
    rolls = kd.BallState((2, 0, -0.7042), (-2.5, 0, 0), (0, -22.8, 0))
    return kd.plan_kick(kd.Leg.human(), kd.Goal(18, time=1.2), kd.Ball(), incoming=rolls).meetings


def of_meeting(meeting):
    met = {"time": (meeting.ball.time, "s"), "place": (meeting.ball.position, "m")}
    if meeting.impact is None:
        return {**met, "no kick": (meeting.reason, "")}
    use = np.abs(meeting.impact.v_before / meeting.impact.posture.leg.velocity_limit).max()
    return {
        **met,
        "share of the change of velocity": (1.0, ""),
        "share of the speed limit": (use, ""),
    }


def of_scene(scene):
    leg, incoming = scene.posture, scene.incoming
    return {
        "name": ("a kick", ""),
        "leg": (LEG.name, ""),
        "contact point": (leg.contact_point, "m"),
        "foot speed": (np.linalg.norm(leg.jacobian @ V), "m/s"),
        "ball": ("0.41 kg, radius 0.105 m", ""),
        "ball's velocity": (incoming.velocity, "m/s"),
        "ball's spin": (incoming.spin, "rad/s"),
        "air": ("1.1 kg/m3, drag, lift", ""),
    } | {name: (value, "") for name, value, _ in table(scene) if name in ("contact", "ground")}


def of_track(track):
    steps = np.diff(track.times)
    return {
        "samples": (len(steps) + 1, ""),
        "duration": (steps.sum(), "s"),
        "median interval": (np.sort(steps)[steps.size // 2], "s"),
        "lowest corner": (np.min(track.positions, 0), "m"),
        "highest corner": (np.max(track.positions, 0), "m"),
    }


def of_identification(fit):
    """`used` counts samples; a value has its deviation from the covariance."""
    deviations = dict(zip(fit.names, np.sqrt(np.diag(fit.covariance)), strict=True))
    values = dict(zip(fit.names, fit.estimates, strict=True))
    units = dict.fromkeys(("x", "y", "z"), "m") | dict.fromkeys(("vx", "vy", "vz"), "m/s")
    rows = {
        "samples": (f"{np.count_nonzero(fit.used)} of {len(fit.track)} used", ""),
        "rms distance": (math.sqrt((fit.residuals[fit.used] ** 2).sum(axis=1).mean()), "m"),
    }
    for name in fit.values:
        rows[name] = plus_minus(values[name], deviations[name]), units.get(name, "rad/s")
        if name == "drag":
            rows[name] = rows[name][0], ""
    for name, reason in fit.undetermined.items():
        size = deviations[name]
        assert re.search(r"is (\S+) rad/s", reason)[1] == (
            f"{size:.2g}" if size < 99.5 else f"{size:.0f}"
        )
        assert ("over half the value" in reason) == (size <= 20.0)
        rows[name] = f"not determined: {reason}", ""
    assert set(fit.names) == set(fit.values) | set(fit.undetermined)
    return rows


def of_inferred(found):
    sizes = np.linalg.norm(found.joint_impulses[:, :3], axis=1)
    rows = {
        "impulse on the ball": (found.impulse, "N s"),
        "normal": (found.normal, ""),
        "contact point": (found.contact_point, "m"),
        "approach speed": (found.approach_speed, "m/s"),
        f"worst joint, {LEG.joint_names[sizes.argmax()]}": (sizes.max(), "N s"),
    }
    for name in ("restitution", "friction", "residual"):
        value, deviation = getattr(found, name), found.deviations.get(name)
        rows[name] = f"{value:.4g}" if deviation is None else plus_minus(value, deviation), ""
    return rows


def of_body(track):
    return {
        "frames": (10, ""),
        "duration": (0.09, "s"),
        "markers": ("a, b", ""),
        "angles": (", ".join(track.angles), ""),
        "gaps of b": (2, "frames"),
    }


def of_leg_motion(_):
    return {
        "frames": (9, ""),
        "duration": (0.08, "s"),
        "contact": ("0.0900 +- 0.001", "s"),
        "incomplete frames": (1, ""),
    }


def of_contact_motion(at):
    rows = {"foot velocity": (at.foot_velocity, "m/s")}
    for k, name in enumerate(LEG.joint_names):
        rows[f"speed of {name}"] = plus_minus(at.v[k], at.v_deviations[k]), "rad/s"
    return rows


def of_restitution_fit(fit):
    return {
        "at 8 m/s": ("0.7 +- 0.02", ""),
        "at 16.5 m/s": ("0.61 +- 0.034", ""),
        "scatter of a kick": (0.05, ""),
    }


def of_learner(learner):
    units = {"wind_x": "m/s", "wind_y": "m/s", "elevation": "rad", "azimuth": "rad"}
    rows = {
        name: (plus_minus(value, learner.deviations[name], 3), units.get(name, ""))
        for name, value in learner.estimates.items()
    }
    for name in ("scatter", "uncertainty"):
        covariance = getattr(learner, f"landing_{name}")
        rows[f"landing {name}"] = math.sqrt(np.linalg.eigvalsh(covariance).sum()), "m"
    return rows | {
        "kicks": (1, ""),
        "next launch": (learner.command.velocity, "m/s"),
        "done": (learner.is_done, ""),
    }


def of_tuning(tuning):
    return {
        "time step": (2.0, "ms, implicitfast"),
        "solref": ("-30000 -40", ""),
        "solimp": ("0.9 0.95 0.001 0.5 2", ""),
        "condim": (3, ""),
        "friction": (0.4, ""),
        "solreffriction": ("-1 -55", "(of a <pair>)"),
        "margin": (7.0, "mm"),
        "contact time": (9.0, "ms, 10 ms asked for"),
        "error, this kick": ("speed 2.00%, direction 3.00 deg, spin 0.6 rad/s", ""),
        "error, speed x 0.5": ("speed 8.00%, direction 9.00 deg, spin 1.1 rad/s", ""),
        "goal, speed": ("at most 3.0%: 2.0%,", "met"),
        "goal, direction": ("at most 1 deg: 3 deg,", "MISSED"),
        "within tolerance": ("no", ""),
    }


def of_run(run):
    moved, wish = run.ball_after.velocity, run.plan.launch.velocity
    cosine = moved @ wish / np.linalg.norm(moved) / np.linalg.norm(wish)
    end = run.path.landing.position - run.plan.impact.ball_before.position
    return {
        "launch": (moved, "m/s"),
        "speed error": (f"{100 * (np.linalg.norm(moved) / np.linalg.norm(wish) - 1):+.1f}%", ""),
        "direction error": (math.degrees(math.acos(cosine)), "deg"),
        "miss of the target": (np.linalg.norm(end - run.plan.goal.target), "m"),
        "delay of the contact": (4.0, "ms"),
        "upright": (True, ""),
        "margin, torque": (0.1, ""),
        "margin, centre of pressure": (0.02, "m"),
    }


def noisy_runs():
    run, other = mujoco_run(), mujoco_run()
    faster = replace(other.ball_after, velocity=1.2 * other.ball_after.velocity)
    return kd.NoisyRuns((run, replace(other, ball_after=faster, upright=False)), kd.KickNoise())


def of_noisy_runs(noisy):
    first, second = (run.ball_after.velocity for run in noisy.runs)
    wish = noisy.runs[0].plan.launch.velocity
    errors = [100 * (np.linalg.norm(one) / np.linalg.norm(wish) - 1) for one in (first, second)]
    azimuth = math.degrees(math.atan2(first[1], first[0]) - math.atan2(wish[1], wish[0]))
    rise = [math.degrees(math.asin(v[2] / np.linalg.norm(v))) for v in (first, wish)]
    return {
        "upright": ("1 of 2", ""),
        "hit the ball": ("2 of 2", ""),
        "speed error": (f"{np.mean(errors):+.1f} +- {np.std(errors, ddof=1):.1f}", "%"),
        "azimuth error": (f"{azimuth:+.1f} +- 0.0", "deg"),
        "elevation error": (f"{rise[0] - rise[1]:+.1f} +- 0.0", "deg"),
        "miss, 50% of the runs": (f"up to {noisy.runs[0].miss:.3g}", "m"),
        "miss, 90% of the runs": (f"up to {noisy.runs[0].miss:.3g}", "m"),
    }


@cache
def impact():
    return kd.strike(POSTURE, V, BALL, CONTACT, **INCOMING)


@cache
def stiff_impact():
    leg = LEG.with_stiff_joints("ankle").with_armature({"hip": 0.05, "knee": 0.02})
    return kd.strike(leg.posture(POSTURE.q), V, BALL, replace(CONTACT, friction=2.0), **INCOMING)


@cache
def plan():
    return kd.plan_kick(LEG, kd.Goal((11, 1, 0), time=0.7), BALL, AIR)


@cache
def motion():
    knots = [-0.5, -0.5, 0, 0], [0, 0, 0.75, 0.75]
    splines = [BSpline(ends, [POSTURE.q, 0.9 * POSTURE.q], 1) for ends in knots]
    return Motion(LEG, LEG.joint_names, *splines)


@cache
def tuning():
    return MujocoTuning(
        (-3e4, -40.0), (0.9, 0.95, 0.001, 0.5, 2.0), 0.4, (-1.0, -55.0), 3, 0.007, 0.002,
        "implicitfast", 0.009, 0.010,
        (KickError("", 0.05, 0.02, math.radians(3), 0.6),
         KickError("speed x 0.5", 0.06, 0.08, math.radians(9), 1.1)),
        0.03, (MujocoGoal("speed", 0.02, 0.03),
               MujocoGoal("direction", math.radians(3), math.radians(1))),
        "<mujoco/>", BALL, np.array([1.0, 2.0, 3.0]),
    )  # fmt: skip


def mujoco_run():
    launch = plan().impact.ball_after
    after = replace(launch, velocity=1.1 * launch.velocity + [0, 1, 0])
    path, rows = kd.fly(after, BALL, AIR, kd.Ground(-2.0)), np.zeros((2, 3))
    margins = {"torque": 0.1, "centre of pressure": 0.02}
    return MujocoRun(
        plan(), tuning(), np.zeros(2), rows, rows, rows, after, 0.004, path, True, margins
    )


def measured(count=50, uneven=0.0):
    start = kd.BallState((0, 0, 1), (18, 2, 9), (0, -40, 20))
    flight = kd.fly(start, BALL, kd.Air(drag=0.25))
    times = np.linspace(0.0, 0.8 * flight.duration, count) ** (1.0 + uneven)
    noise = np.random.default_rng(2).normal(0.0, 0.004, (count, 3))
    return Track(times, flight.sample(times).position + noise)


def identified():
    track = measured()
    track = Track(track.times, track.positions + 0.5 * (np.arange(50) == 20)[:, None])
    return kd.identify(track, BALL, kd.Air(drag=0.2), free=["spin", "drag"])


def learner():
    taught = kd.Learner(kd.Goal(30.0, time=1.5), BALL, AIR, restitution=0.7)
    taught.observe((28.0, 0.5), 1.4)
    return taught


def inferred():
    kick = impact()
    before, after = kick.ball_before, kick.ball_after
    return kd.infer_impact(POSTURE, V, BALL, before, after)


def body():
    points = np.zeros((10, 2, 3))
    points[3:5, 1] = np.nan
    angles = {name: np.arange(10.0) / 50 for name in LEG.joint_names}
    angles["hip"][9] = np.nan
    return kd.BodyTrack(np.arange(10) / 100, ["a", "b"], points, angles=angles)


def leg_motion():
    names = dict(zip(LEG.joint_names, LEG.joint_names, strict=True))
    return kd.fit_motion(body(), LEG, angles=names, contact=(0.09, 0.0014))


def scene(**more):
    return kd.Scene(
        POSTURE, V, BALL, CONTACT, air=AIR, ground=kd.Ground(-2.0), name="a kick",
        incoming=kd.BallState(velocity=(-3, 1, 0.5), spin=(5, -8, 3)), **more,
    )  # fmt: skip


WALL = kd.Plane((30, 0, 0), (-1, 0, 0))
"""It is reached in the air, so that the course has a flight more than bounces."""


def reach_table():
    rows = (ReachRow(-10.0, 20.0, 21.43, 23.0, "speed of knee", 31.26, 44.32),
            ReachRow(0.0, 35.0, 18.71, None, "", 26.54, 37.98))  # fmt: skip
    return ReachTable("robot", True, rows)


def of_reach(shown):
    return {
        "robot": ("robot", ""),
        "limits": ("of the motion", ""),
        "-10, 20 deg": ("21.43 m/s, 31.3 m on carpet, 44.3 m on turf", ""),
        "0, 35 deg": ("18.71 m/s, 26.5 m on carpet, 38 m on turf", ""),
    }


SHOWN = {
    "ball": (lambda: BALL, of_ball),
    "incoming ball": (incoming_ball, of_incoming_ball),
    "meeting": (lambda: next(m for m in meetings() if m.impact is not None), of_meeting),
    "ground": (lambda: kd.Ground(0.2, surface=kd.Surface("mud", 0.3, 0.9, 4.0)), of_ground),
    "hard ground": (lambda: kd.Ground(0.2), of_hard_ground),
    "air": (lambda: AIR, of_air),
    "contact": (lambda: kd.Contact((2, 0.3, 1), 0.7, 0.1, offset=(0.01, 0, -0.02)), of_contact),
    "plane": (lambda: kd.Plane((30, 1, 0), (-2, 0, 0), "centre"), of_plane),
    "impact": (impact, of_impact),
    "stiff impact": (stiff_impact, of_stiff_impact),
    "stick": (lambda: kd.strike(POSTURE, V, BALL, kd.Contact((2, 0.3, 1), 0.7, 2.0)).sensitivity(),
              partial(of_sensitivity, branch="stick", unit="N s")),
    "slip": (lambda: kd.strike(POSTURE, V, BALL, kd.Contact((2, 0.3, 1), 0.7, 0.02)).sensitivity(),
             partial(of_sensitivity, branch="slip", unit="m/s")),
    "flight": (lambda: kd.fly(impact().ball_after, BALL, AIR, kd.Ground(-2.0)), of_flight),
    "course": (lambda: kd.follow(impact().ball_after, BALL, AIR, GROUND),
               partial(of_course, status="at-rest")),
    "to a wall": (lambda: kd.follow(impact().ball_after, BALL, AIR, GROUND, plane=WALL),
                  partial(of_course, status="at-plane")),
    "goal": (lambda: kd.Goal((11, 1, 0), time=0.7, spin=(0, -20, 5)), of_goal),
    "curved": (lambda: kd.Goal((20, 0, 1), speed=25, beside=(9, 1), arc="high"), of_curved_goal),
    "launch": (lambda: kd.plan_launch(kd.Goal((11, 1, 0), speed=16), BALL, AIR), of_launch),
    "too far": (lambda: kd.plan_launch(kd.Goal(30.0, time=0.5), BALL, AIR, speed_limit=40),
                of_unreachable),
    "pass": (lambda: kd.plan_pass(kd.Goal((12, 3, 0), time=1.5), BALL, None), of_pass),
    "plan": (plan, of_plan),
    "motion": (motion, of_motion),
    "scene": (lambda: scene(), lambda shown: of_scene(shown) | {"law": ("newton", "")}),
    "slow scene": (lambda: scene(law=kd.Compliance(contact_time=0.008)),
                   lambda shown: of_scene(shown) | {"contact time": (8.0, "ms")}),
    "stiff scene": (lambda: scene(law=kd.Compliance(stiffness=7e5)),
                    lambda shown: of_scene(shown) | {"stiffness": (7e5, "N/m^1.5")}),
    "leg": (lambda: LEG, of_leg),
    "posture": (lambda: LEG.with_stiff_joints("ankle").posture(POSTURE.q), of_posture),
    "track": (lambda: measured(uneven=0.1), of_track),
    "identification": (identified, of_identification),
    "inferred": (inferred, of_inferred),
    "body": (body, of_body),
    "leg motion": (leg_motion, of_leg_motion),
    "contact motion": (lambda: leg_motion().at_contact(), of_contact_motion),
    "restitution": (
        lambda: RestitutionFit(np.array([[8, 0.7], [16.5, 0.61]]), np.array([0.02, 0.034]), 0.05),
        of_restitution_fit,
    ),
    "learner": (learner, of_learner),
    "tuning": (tuning, of_tuning),
    "run": (mujoco_run, of_run),
    "noisy runs": (noisy_runs, of_noisy_runs),
    "reach": (reach_table, of_reach),
}  # fmt: skip

BY_HAND = {"restitution", "tuning"}
"""Results that are made here without the function that gives them."""


@cache
def made(name):
    return SHOWN[name][0]()


def warnings_of(shown):
    if isinstance(shown, kd.Goal | kd.Pass | Track | RestitutionFit):
        return ()
    return getattr(shown.flight if isinstance(shown, PlannedLaunch) else shown, "warnings", ())


@pytest.mark.parametrize("name", SHOWN)
def test_a_table_has_the_numbers_of_its_object(name):
    shown, expected = made(name), SHOWN[name][1]
    rows = table(shown)
    warnings = [value for row, value, _ in rows if row == "warning"]
    wanted = {row: (text(value), unit) for row, (value, unit) in expected(shown).items()}
    assert {row: (value, unit) for row, value, unit in rows if row != "warning"} == wanted
    lines = [line.partition("; ")[0] if name == "plan" else line for line in warnings_of(shown)]
    if len(lines) > 3 and name != "identification":
        lines[3:] = [f"and {len(lines) - 3} more: see `warnings` (of a command: --json)"]
    assert warnings == lines
    if type(shown).__repr__ is ReprMixin.__repr__:  # a terminal shows the same rows
        printed = [" ".join(line.split()) for line in str(shown).splitlines()[1:]]
        assert printed == [" ".join(" ".join(row).split()) for row in rows]


@pytest.mark.parametrize("name", [name for name in SHOWN if name not in BY_HAND])
def test_arrays_of_what_has_a_table_cannot_be_written_to(name):
    for key, value in getattr(made(name), "__dict__", {}).items():
        for array in value.values() if isinstance(value, dict) else [value]:
            assert key[0] == "_" or not isinstance(array, np.ndarray) or not array.flags.writeable


def test_every_class_with_a_table_is_compared():
    for module in walk_packages(kd.__path__, "kickdyn."):
        if not module.name.endswith("__main__") and module.name != "kickdyn.posture_sweep":
            import_module(module.name)

    def below(kind):
        return {kind} | {further for direct in kind.__subclasses__() for further in below(direct)}

    compared = {type(made(name)) for name in SHOWN} | {kd.Collision}
    tables = {kind for kind in below(ReprMixin) - {ReprMixin} if "_rows" in vars(kind)}
    assert {kind for kind in tables if kind.__module__.startswith("kickdyn.")} <= compared


def test_the_table_of_a_contact_that_takes_time():
    hit = kd.collide(POSTURE, V, BALL, kd.Contact((2, 0.3, 1), 0.7, 0.1), **INCOMING)
    rows = {name: (value, unit) for name, value, unit in table(hit) if name != "warning"}
    assert rows.keys() == of_collision(hit).keys()
    for name, (value, unit) in of_collision(hit).items():
        assert rows[name][1] == unit
        numbers = [float(number) for number in re.findall(r"[-+.\de]+", rows[name][0])]
        least = 5e-3 * np.abs(value).max()  # gravity acts in the contact time, too
        assert numbers == pytest.approx(np.ravel(value).tolist(), rel=5e-3, abs=4 * least)
