"""Tracks, segments and fits of the measured ball and of made ones; motions and impacts of legs."""

from functools import cache

import numpy as np
import pinocchio as pin

import kickdyn as kd
from kickdyn.identification.identification_result import mean_over_flights
from recorded.parts import AIR, BALL, HUMAN, POSTURE, ROOT, V, measured

MATCH = ROOT / "data" / "match_ball.csv"
FIRST, LAST = 2813, 2896
PLANAR = {f"{name}_{i}": (name, place) for name in HUMAN.joint_names for i, place in enumerate(
    [(0.05, 0.03, -0.1), (0.04, -0.04, -0.02), (-0.03, 0.01, 0.05)])}  # fmt: skip


@cache
def match():
    track = kd.Track.from_csv(MATCH)
    return kd.Track(track.times[FIRST:LAST], track.positions[FIRST:LAST])


@cache
def half():
    """A part of the match with flights, bounces and rolling."""
    track = kd.Track.from_csv(MATCH)
    return kd.Track(track.times[2600:3500], track.positions[2600:3500])


def bouncing(noise=0.003, surface=None, count=420):
    ground = kd.Ground(0.0, surface or kd.Surface("court", 0.72, 0.6, 0.5))
    air = kd.Air(drag=0.22)
    start = kd.BallState((0, 0, 0.4), (9, 2, 6), (4, -30, 12))
    course = kd.follow(start, BALL, air, ground)
    times = np.linspace(0.0, min(course.duration, 7.0), count)
    draw = np.random.default_rng(5).normal(0.0, noise, (count, 3))
    return kd.Track(times, course.sample(times).position + draw)


def fitted(track=None, air=None, **more):
    fit = kd.identify(measured() if track is None else track, BALL, air or kd.Air(drag=0.2), **more)
    return {
        "fit": fit, "covariance": fit.covariance, "residuals": fit.residuals, "used": fit.used,
        "estimates": fit.estimates,
    }  # fmt: skip


def spoilt():
    track = measured(noise=0.01)
    places = track.positions.copy()
    places[[7, 30]] += [[0.4, -0.3, 0.6], [-0.5, 0.2, 0.1]]
    return kd.Track(track.times, places)


def correlated():
    track, noise = measured(noise=0.0), np.random.default_rng(8).normal(0.0, 0.01, (60, 3))
    for k in range(1, 60):
        noise[k] += 0.7 * noise[k - 1]
    return kd.Track(track.times, track.positions + noise)


def state(t):
    return np.array(
        [0.3 + 0.7 * np.tanh((t + 0.06) / 0.09), 1.1 - np.tanh(t / 0.06), 0.1 * np.sin(9 * t)]
    )


def body(noise=0.001, rate=300.0):
    times = np.arange(-0.2, 0.0, 1.0 / rate)
    model, data = HUMAN.model, HUMAN.model.createData()
    points = np.zeros((len(times), len(PLANAR), 3))
    for k, t in enumerate(times):
        pin.framesForwardKinematics(model, data, state(t))
        for m, (name, place) in enumerate(PLANAR.values()):
            points[k, m] = data.oMf[model.getFrameId(name)].act(np.array(place))
    points += np.random.default_rng(1).normal(0.0, noise, points.shape)
    points[10:14, 1] = np.nan
    points[20, 4] += 0.05
    return kd.BodyTrack(times, list(PLANAR), points)


def moved(**more):
    motion = kd.fit_motion(body(), HUMAN, PLANAR, **{"contact": 0.0, **more})
    return {
        "motion": motion, "q": motion.q(-0.1), "v": motion.v(-0.1), "deviations": motion.deviations(-0.1),
        "at contact": motion.at_contact(), "figure": motion.plot(), "two joints": motion.plot(["knee", "hip"]),
    }  # fmt: skip


def by_angles():
    times = np.arange(40) / 200 - 0.19
    angles = {
        name: np.array([state(t)[k] for t in times]) for k, name in enumerate(HUMAN.joint_names)
    }
    track = kd.BodyTrack(times, angles=angles)
    motion = kd.fit_motion(
        track, HUMAN, angles={name: name for name in HUMAN.joint_names}, contact=0.0
    )
    return {"track": track, "motion": motion, "at": motion.at_contact()}


def hit(**more):
    contact = kd.Contact((2, 0.3, 1), 0.7, 0.1)
    return kd.strike(
        POSTURE, V, BALL, contact, ball_velocity=(-3, 1, 0.5), ball_spin=(5, -8, 3), **more
    )


def inferred(**more):
    kick = hit()
    after = kick.ball_after
    after = kd.BallState(
        after.position,
        after.velocity + np.array([0.1, -0.05, 0.08]),
        after.spin + np.array([0.3, -0.2, 0.1]),
    )
    return kd.infer_impact(POSTURE, V, BALL, kick.ball_before, after, **more)


def inferred_from_track():
    motion = kd.fit_motion(body(0.0), HUMAN, PLANAR, contact=0.0)
    at = motion.at_contact()
    contact = kd.Contact((1, 0.02, 0.3), 0.7, 0.1)
    kick = kd.strike(at.posture, at.v, BALL, contact)
    before = np.arange(-0.1, 0.0, 0.005)
    after = np.arange(0.015, 0.12, 0.005)
    flight = kd.fly(kick.ball_after, BALL, kd.Air(), kd.Ground(-5.0))
    places = [np.tile(kick.ball_before.position, (len(before), 1)), flight.sample(after).position]
    track = kd.Track(np.r_[before, after], np.vstack(places))
    return [kd.infer_impact(motion, track, BALL), at]


def restitution(knots=2):
    draw = np.random.default_rng(6)
    kicks = []
    for speed in np.linspace(6, 20, 9):
        v = np.array(V) * speed / 12.0
        contact = kd.Contact((2, 0.3, 1), 0.85 - 0.01 * speed + 0.01 * draw.normal(), 0.1)
        kick = kd.strike(POSTURE, v, BALL, contact)
        kicks.append(kd.infer_impact(
            POSTURE, v, BALL, kick.ball_before, kick.ball_after, velocity_deviation=0.1 + 0.01 * speed))  # fmt: skip
    return kd.fit_restitution(kicks, knots)


def taught(leg=None, **more):
    learner = kd.Learner(
        kd.Goal((30.0, 1.0, 0.0), time=1.5), BALL, AIR, leg, restitution=0.7, **more
    )
    shown = [repr(learner), learner.command if leg is None else learner.command.launch]
    learner.observe((28.0, 0.5), 1.4)
    shown += [learner.estimates, learner.deviations, learner.landing_scatter]
    learner.observe((31.0, 1.4), 1.55)
    return [*shown, learner, learner.landing_uncertainty, learner.warnings]


def taught_by_tracks():
    learner = kd.Learner(kd.Goal(30.0, time=1.5), BALL, AIR)
    flight = kd.fly(learner.command, BALL, kd.Air(drag=0.24))
    times = np.linspace(0.02, 0.9, 40)
    learner.observe(kd.Track(times, flight.sample(times).position))
    return learner


def found(track, **more):
    split = kd.segments(track, **more)
    return {
        "split": split, "parts": split.parts, "flights": len(split.flights), "text": str(split),
        "surface": _surface(split),
    }  # fmt: skip


def _surface(split):
    try:
        return split.surface
    except kd.KickdynError as error:
        return error


def trc(unit, size):
    points = np.arange(24.0).reshape(4, 2, 3) / 10
    lines = ["PathFileType\t4\t(X/Y/Z)\tkick.trc", "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits",
             f"100\t100\t{len(points)}\t2\t{unit}", "Frame#\tTime\ta\t\t\tb\t\t", "\t\tX1\tY1\tZ1\tX2\tY2\tZ2", ""]  # fmt: skip
    for k, row in enumerate(points):
        turned = row[:, [0, 2, 1]] * (1, 1, -1)
        lines.append(
            "\t".join([str(k + 1), f"{k / 100}", *(repr(float(size * x)) for x in turned.ravel())])
        )
    from pathlib import Path

    Path("kick.trc").write_text("\n".join(lines))
    return kd.BodyTrack.from_trc("kick.trc")


def mot():
    from pathlib import Path

    rows = ["\t".join(f"{x:.4f}" for x in (k / 100, 10 * k, -3 * k + 1, 0.2 * k)) for k in range(5)]
    Path("kick.mot").write_text("\n".join([
        "Coordinates", "version=1", "nRows=5", "nColumns=4", "inDegrees=yes", "endheader",
        "time\thip_flexion_r\tknee_angle_r\tankle_angle_r", *rows]))  # fmt: skip
    return kd.BodyTrack.from_mot("kick.mot")


def c3d():
    import ezc3d

    content, points = ezc3d.c3d(), np.ones((4, 2, 40))
    points[:3] = 1000 * np.random.default_rng(0).normal(1, 0.1, (3, 2, 40))
    points[:3, 1, 3] = np.nan
    parameters = content["parameters"]["POINT"]
    parameters["UNITS"]["value"], parameters["RATE"]["value"] = ["mm"], [250.0]
    parameters["LABELS"]["value"] = ("ball", "b")
    content["header"]["points"]["first_frame"] = 7
    content["data"]["points"] = points
    content.write("kick.c3d")
    return [kd.BodyTrack.from_c3d("kick.c3d"), kd.Track.from_c3d("kick.c3d", "ball")]


CASES = {
    "track": lambda: [kd.Track.from_csv(MATCH), match(), measured()],
    "match, one flight": lambda: fitted(match()),
    "match, brazuca": lambda: fitted(match(), kd.Air(drag="brazuca"), free=("spin", "drag-scale")),
    "match, no spin": lambda: fitted(match(), free=("drag",)),
    "match, wind": lambda: fitted(match(), kd.Air(wind=(1.0, -2.0, 0.0)), free=("spin", "drag")),
    "match, segments": lambda: found(half()),
    "match, mean": lambda: [
        mean_over_flights([kd.identify(match(), BALL), kd.identify(measured(), BALL)], name)
        for name in ("drag", "vx")
    ],
    "made": fitted,
    "made, launch only": lambda: fitted(air=kd.Air(drag=0.25), free=()),
    "made, in wind": lambda: fitted(
        measured(air=kd.Air(drag=0.25, wind=(3, 1, 0))), kd.Air(drag=0.2, wind=(3, 1, 0))
    ),
    "made, with outliers": lambda: fitted(spoilt()),
    "made, correlated": lambda: fitted(correlated()),
    "made, short": lambda: fitted(measured(20)),
    "made, bias": lambda: fitted(air=kd.Air(drag=0.4), free=("spin",)),
    "plot": lambda: [kd.identify(match(), BALL).plot()],
    "bouncing": lambda: found(bouncing()),
    "bouncing, grippy": lambda: found(bouncing(surface=kd.Surface("grass", 0.6, 0.9, 1.2, 0.2))),
    "bouncing, ground and ball": lambda: found(
        bouncing(), ball=BALL, ground=kd.Ground(0.0), air=kd.Air(drag=0.22)
    ),
    "bouncing, noisy": lambda: found(bouncing(0.02)),
    "body": lambda: [body(), body().gaps],
    "body files": lambda: [trc("mm", 1000.0), trc("m", 1.0), mot()],
    "c3d": c3d,
    "motion": moved,
    "motion, not scaled": lambda: moved(scale=False),
    "motion, other contact": lambda: moved(contact=-0.05),
    "motion by angles": by_angles,
    "inferred": inferred,
    "inferred with deviations": lambda: inferred(
        velocity_deviation=0.2, spin_deviation=2.0, joint_deviation=0.1
    ),
    "inferred from a track": inferred_from_track,
    "figure of inferred": lambda: inferred(joint_deviation=0.1).plot(),
    "restitution": restitution,
    "restitution, one knot": lambda: restitution(1),
    "learner": taught,
    "learner with a leg": lambda: taught(HUMAN),
    "learner by tracks": taught_by_tracks,
}
LOOSE = {
    "": 1e-5,
    "learner": 1e-4,
    "motion by angles": 1e-3,
    "learner with a leg": 1e-3,
    "learner by tracks": 1e-4,
    "learner with a prior": 1e-4,
}
