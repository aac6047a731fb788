r"""`fit_motion`: the motion of a leg from markers, or from joint angles, with deviations.

In each frame, inverse kinematics gives the configuration q whose markers are nearest to the
measured ones, in the sense of least squares. Its information matrix is :math:`J^T J / \sigma^2`,
with the Jacobian J of the markers and their noise :math:`\sigma`, estimated from the residuals. A
smoothing spline goes through these configurations, one before and one after the impact.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import combinations, permutations
from typing import Any

import numpy as np
import pinocchio as pin

from kickdyn.core import validation
from kickdyn.core.validation import Array, read_only
from kickdyn.errors import InvalidInput
from kickdyn.identification.body_track import BodyTrack
from kickdyn.identification.leg_motion import LEAST_FRAMES, LegMotion, Moment, contact_moment
from kickdyn.identification.marker_kinematics import (
    LARGEST_RMS_DISTANCE,
    MARKER_NOISE,
    Marker,
    MarkerKinematics,
    SolvedFrame,
    place_deviation,
    scaled_leg,
    spread_frames,
)
from kickdyn.identification.track import Track
from kickdyn.robot.leg import Leg
from kickdyn.robot.model_validation import frame_id
from kickdyn.robot.surgery import has_floating_base

SWAPPED, DOUBTFUL = (0.02, 0.15), (0.005, 0.4)
"""Root mean square distance of a segment's markers from their places [m] above which markers may be
swapped, and the share to which another order of them must reduce it: to be refused, and to be
mentioned. Places may be wrong by a centimetre, too."""

SIDEWAYS = 0.02
"""Distance of the pelvis' centre and markers from the hip, sideways, that shows the side [m]."""


TRANSLATIONS = ("pelvis_tx", "pelvis_ty", "pelvis_tz")
"""Coordinates of the origin of the pelvis [m]."""

ROTATIONS = {"pelvis_tilt": "Z", "pelvis_list": "X", "pelvis_rotation": "Y"}
"""Coordinates of the turn of the pelvis and their axes, in their order [rad]."""

PELVIS = (*TRANSLATIONS, *ROTATIONS)
"""Names of all coordinates of the pelvis."""

HIP, LEG_LENGTH = (-0.0707, -0.0661, 0.0835), 0.396 + 0.43
"""Right hip from the origin of the pelvis, and distance from hip to ankle, of the model [m]."""

Z_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
"""Rotation from OpenSim's axes to x forward, y left, z up."""

JUMP, LEAST_JUMP = 8.0, 0.01
"""Distance of a marker in one frame above which a motion has a warning: over the marker's median,
and at least [m]. Noise alone gives 4."""

LARGEST_OFFSET = 2.0
"""Coordinate of a marker on its segment [m] that only other units explain."""

LARGEST_ANGLE = 4.0 * math.pi
"""Angle of a joint [rad] that only degrees explain."""

LEAST_NOISE = 1e-7
"""Least noise of a marker [m]; with less, the smoothing would lose its digits."""

Place = str | tuple[str, Any]
"""Where a marker is: a frame of the leg, at its origin, or with a point in its axes [m]."""


def base_configurations(leg: Leg, coordinates: Mapping[str, Array]) -> Array:
    """Return configurations of the floating base, shape `(n, 7)`, NaN where one is not known.

    OpenSim's axes are x forward, y up and z to the right. The pelvis turns about its own z (tilt),
    x (list) and y (rotation); its origin is between the anterior superior iliac spines, and the hip
    as in Delp et al. 1990 (IEEE Trans Biomed Eng 37:757), scaled by the length of the leg.
    """
    from scipy.spatial.transform import Rotation  # takes 0.1 s

    model = leg.workspace.model
    length = sum(np.linalg.norm(pose.translation) for pose in list(model.jointPlacements)[3:])
    right = np.sign(model.inertias[1].lever[1])  # the middle of the pelvis is on the left
    hip = Z_UP @ (HIP * np.array([1.0, 1.0, right])) * length / LEG_LENGTH
    origin = np.column_stack([coordinates[name] for name in TRANSLATIONS]) @ Z_UP.T
    angles = np.column_stack([coordinates[name] for name in ROTATIONS])
    complete = np.isfinite(np.hstack([origin, angles])).all(axis=1)
    q = np.full((len(complete), 7), np.nan)
    rotations = Rotation.from_euler("".join(ROTATIONS.values()), angles[complete]).as_matrix()
    for k, turn in zip(np.flatnonzero(complete), Z_UP @ rotations @ Z_UP.T, strict=True):
        q[k] = pin.SE3ToXYZQUAT(pin.SE3(turn, origin[k] + turn @ hip))
    return q


@validation.check_arguments
def fit_motion(
    track: BodyTrack,
    leg: Leg,
    markers: Mapping[str, Place] | None = None,
    *,
    angles: Mapping[str, str] | None = None,
    contact: float | Sequence[float] | Track | None = None,
    scale: bool = True,
) -> LegMotion:
    """Return the motion of a leg from the track of its markers, or of its joint angles.

    Args:
        track: measured markers, or joint angles.
        leg: the leg, on a floating base if its hip moves. Supports and loops do not count.
        markers: where each marker is on the leg: `{"knee": "shank"}` is the origin of the link
            shank, `{"tibia": ("shank", (0.03, 0, -0.2))}` a point in its axes [m]. Others do not
            count.
        angles: for a track of angles, its coordinate for each joint of the leg, with a minus for
            the other direction: `{"knee": "-knee_angle_r"}`. A floating base is placed by the
            coordinates `pelvis_tx` to `pelvis_rotation` of OpenSim. The deviation of angles is
            taken to be 0.5 degrees, of `pelvis_tx` to `tz` 9 mm.
        contact: when the contact begins, across which nothing is smoothed: a time [s]; a time and
            its standard deviation, `(t, deviation)`; or the `Track` of the ball on the same clock,
            from which both are computed.
        scale: whether to estimate the lengths of segments from the markers; masses stay, radii of
            gyration scale with lengths. Places of markers that do not fit are estimated, too.

    Raises:
        InvalidInput: an unknown marker or frame, too few markers for a segment, markers that do not
            fit the leg, another unit or vertical axis, or too few frames.
    """
    moment = None if contact is None else contact_moment("contact", contact)
    if moment and not track.times[0] < moment.time <= track.times[-1] + 0.02:
        raise InvalidInput(
            f"contact is {moment.time:g} s: the track is from {track.times[0]:g} to "
            f"{track.times[-1]:g} s"
        )
    if angles is not None:
        return _from_angles(track, leg, validation.mapping("angles", angles), moment)
    named = validation.mapping("markers", markers)
    places = {name: _place(leg, name, place) for name, place in named.items()}
    if not places:
        raise InvalidInput("markers is empty: it must say where each marker is on the leg")
    names = list(places)
    measured = track.positions[:, [track.find_marker(name) for name in names]]
    check_units(measured, names)
    check_side(leg, places)
    doubts = check_order(leg, places, measured)
    unscaled = MarkerKinematics(leg.workspace.model, list(places.values()))
    # the lengths are initially the leg's, in a few frames only
    frames = unscaled.solve_track(measured, spread_frames(measured))
    frames = {k: frame for k, frame in frames.items() if frame.complete}
    check_determined(leg, unscaled, frames)
    fitted, scales, at = None, {}, list(places.values())
    if scale:
        fitted = scaled_leg(leg, places, measured, frames)
        if deviation := place_deviation(fitted, measured, frames):
            fitted = scaled_leg(leg, places, measured, frames, deviation)
            distances = 1e3 * np.linalg.norm(fitted.offsets, axis=1)
            worst = int(np.argmax(distances))
            doubts.append(
                "the places of the markers, or the height of the leg, do not fit: the places were "
                f"moved by {distances.mean():.2g} mm on average, {names[worst]!r} by "
                f"{distances[worst]:.2g} mm; constant errors of the angles are left, which the "
                "deviations at a contact contain"
            )
        leg, scales, at = fitted.leg, fitted.scales, fitted.places
    kinematics = MarkerKinematics(leg.workspace.model, at)
    begin = next(iter(frames.values())).q
    frames = kinematics.solve_track(measured, range(len(measured)), begin)
    solved, gaps = list(frames.values()), track.gaps
    configurations = np.array([frame.q for frame in solved])
    information = np.array([frame.jacobian.T @ frame.jacobian for frame in solved])
    return _judged(LegMotion(
        leg, track.times, configurations, information, moment, 0.0, {}, scales,
        {name: gap for name in names if (gap := gaps.get(track.markers[track.find_marker(name)]))},
        tuple(k for k in range(len(measured)) if k not in frames or not frames[k].complete),
        tuple(doubts), tuple(frames), fitted,
    ), places, measured, frames)  # fmt: skip


def _from_angles(
    track: BodyTrack, leg: Leg, angles: Mapping[str, str], contact: Moment | None
) -> LegMotion:
    model, names = leg.workspace.model, leg.single_joints
    notes: tuple[str, ...] = ()
    tracked = [name for name in PELVIS if name in track.angles]
    floats = has_floating_base(model)
    if floats and len(tracked) < len(PELVIS):
        raise InvalidInput(
            "angles need a leg on a fixed base, because they do not place a floating one: take "
            "base='fixed', and leg.with_base_velocity for the velocity of the hip; or a track that "
            f"also has {', '.join(name for name in PELVIS if name not in tracked)}"
        )
    if set(angles) != set(names) or leg.nq != len(names) + 7 * floats:
        raise InvalidInput(
            f"angles is {validation.brief(dict(angles))}: it must name one coordinate for each of "
            f"{', '.join(names)}, joints of one angle each"
        )
    if tracked and not floats:
        notes = (
            f"coordinates {', '.join(tracked)} of the track do not count, because the base of the "
            "leg is fixed and upright: a leg with base='floating' takes them",
        )
    q = np.empty((len(track), leg.nq))
    if floats:
        for name in ROTATIONS:
            check_angle(track, name)
        q[:, :7] = base_configurations(leg, track.angles)
    for joint, coordinate in angles.items():
        name = str(coordinate).removeprefix("-")
        if name not in track.angles:
            available = validation.brief(list(track.angles))
            left_out = "".join(f"; {line}" for line in track.warnings)
            raise InvalidInput(f"angle {name!r} is not in the track: it has {available}{left_out}")
        sign = -1.0 if str(coordinate).startswith("-") else 1.0
        q[:, model.idx_qs[model.getJointId(joint)]] = sign * track.angles[name]
        check_angle(track, name)
    known_frames = np.isfinite(q).all(axis=1)
    if known_frames.sum() < LEAST_FRAMES:
        raise InvalidInput(
            f"track has {int(known_frames.sum())} frames with all angles: at least {LEAST_FRAMES} "
            "are needed"
        )
    # deviation of angles of a file, which gives none [rad]; of translations, as many metres
    information = np.tile(np.eye(leg.nv) / math.radians(0.5) ** 2, (int(known_frames.sum()), 1, 1))
    return LegMotion(
        leg, track.times[known_frames], q[known_frames], information, contact, 0.0, {}, {}, {},
        tuple(np.flatnonzero(~known_frames).tolist()), notes,
        tuple(np.flatnonzero(known_frames).tolist()),
    )  # fmt: skip


def check_angle(track: BodyTrack, name: str) -> None:
    """Raise `InvalidInput` for an angle that is in degrees."""
    largest = float(np.nanmax(np.abs(track.angles[name]), initial=0.0))
    if largest > LARGEST_ANGLE:
        raise InvalidInput(
            f"angle {name!r} is up to {largest:.4g}, as in degrees: angles must be in radians, or "
            "the MOT file must say inDegrees=yes before endheader"
        )


def _place(leg: Leg, name: str, place: Place) -> Marker:
    try:
        frame, point = (place, (0.0, 0.0, 0.0)) if isinstance(place, str) else tuple(place)
    except (TypeError, ValueError):
        raise InvalidInput(
            f"place of marker {name!r} is {validation.brief(place)}: it must be a frame or "
            "(frame, point)"
        ) from None
    number = frame_id(leg.workspace.model, frame)
    offset = validation.vector(f"point of marker {name!r}", point, 3, unit="m")
    if np.abs(offset).max() > LARGEST_OFFSET:
        raise InvalidInput(
            f"point of marker {name!r} is {offset.tolist()}, up to {np.abs(offset).max():g} m from "
            f"the origin of {frame}: it must be in metres, at most {LARGEST_OFFSET:g} m from it"
        )
    return Marker(number, offset)


def _judged(
    motion: LegMotion,
    places: Mapping[str, Marker],
    measured: Array,
    frames: Mapping[int, SolvedFrame],
) -> LegMotion:
    """Return a motion with noise and residuals, or raise `InvalidInput` where these are large."""
    names = list(places)
    complete = len(measured) - len(motion.undetermined)
    if complete < LEAST_FRAMES:
        raise InvalidInput(
            f"track has {complete} frames whose markers determine the leg: at least "
            f"{LEAST_FRAMES} are needed"
        )
    missed = np.full((len(measured), len(names), 3), np.nan)
    spare = 0
    for k, frame in frames.items():
        missed[k, frame.seen] = frame.missed.reshape(-1, 3)
        spare += frame.missed.size - frame.rank
    distances = np.linalg.norm(missed, axis=2)
    mean = np.sqrt(np.nanmean(distances**2, axis=0))
    largest, few = float(np.nanmax(distances)), "; in a few frames, NaN leaves it out"
    if float(np.nanmax(mean)) > LARGEST_RMS_DISTANCE:
        few = ""
    # distance of one marker in one frame [m] above which it is another marker; skin moves less
    if not few or largest > 0.1:
        frame_number, worst = np.unravel_index(int(np.nanargmax(distances)), distances.shape)
        name = names[int(worst)]
        doubts = "".join(f"; {line}" for line in motion.notes if repr(name) in line)
        model, means = motion.leg.workspace.model, np.nanmean(measured, axis=0)
        joints = np.array([model.frames[frame].parentJoint for frame, _ in places.values()])
        up = means[joints == joints.min()].mean(0) - means[joints == joints.max()].mean(0)
        hint = " (y seems to point up: see `up`)" if up[1] > abs(up[2]) else ""
        raise InvalidInput(
            f"marker {name!r} is {largest:.3g} m "
            f"from its place on the leg in frame {int(frame_number)}: markers are swapped, on the "
            f"other leg, or on another segment{hint}{few}{doubts}"
        )
    square = float(np.nansum(distances**2))
    noise = max(math.sqrt(square / spare) if spare > 0 else MARKER_NOISE, LEAST_NOISE)
    return replace(
        motion,
        times=read_only(motion.times[list(motion.frames)]),
        information=read_only(motion.information / noise**2),
        noise=noise,
        residuals=dict(zip(names, mean.tolist(), strict=True)),
        notes=(*motion.notes, *_jumps(names, distances)),
    )


def _jumps(names: list[str], distances: Array) -> Iterable[str]:
    """Return a line about the frame in which markers are farthest from their places, if far."""
    limits = np.maximum(JUMP * np.nanmedian(distances, axis=0), LEAST_JUMP)
    far = np.where(distances > limits, distances, 0.0)
    worst, others = int(far.max(axis=1).argmax()), int(far.any(axis=1).sum()) - 1
    markers = ", ".join(
        f"{names[k]!r} by {1e3 * far[worst, k]:.2g} mm"
        for k in np.argsort(-far[worst])
        if far[worst, k]
    )
    if markers:
        yield (
            f"markers miss their places on the leg in frame {worst}, {markers}"
            + (f", and in {others} other frames" if others else "")
            + ": the first jumps, or is swapped, and distorts the velocities; NaN leaves it out"
        )


def check_units(measured: Array, names: list[str]) -> None:
    """Raise `InvalidInput` for markers in other units, or one that is never seen."""
    for k, name in enumerate(names):
        if not np.isfinite(measured[:, k]).any():
            raise InvalidInput(f"marker {name!r} is not seen in any frame")
    middle = np.nanmedian(measured, axis=0)
    extent = float(np.nanmax(middle, axis=0).max() - np.nanmin(middle, axis=0).min())
    size = float(np.nanmax(np.ptp(middle, axis=0)))
    # distance between markers of one body [m] that only other units explain
    if min(extent, size) > 20.0:
        raise InvalidInput(
            f"markers are up to {size:.4g} m apart, as in millimetres or centimetres: positions "
            "must be in metres"
        )


def check_side(leg: Leg, places: Mapping[str, Marker]) -> None:
    """Raise `InvalidInput` if the pelvis' markers are on the wrong side of the leg's hip."""
    model = leg.workspace.model
    if not has_floating_base(model):
        return
    on_base = {
        name: float(model.frames[frame].placement.act(point)[1])
        for name, (frame, point) in places.items()
        if model.frames[frame].parentJoint == 1
    }
    centre = float(model.inertias[1].lever[1])
    middle = float(np.mean(list(on_base.values()))) if on_base else 0.0
    if min(abs(centre), abs(middle)) > SIDEWAYS and centre * middle < 0.0:
        side, other = ("right", "left") if centre > 0.0 else ("left", "right")
        raise InvalidInput(
            f"markers {', '.join(on_base)} are {abs(middle):.3g} m to the {side} of the hip, but "
            f"the pelvis of a {side} leg is on its {other}: the leg has the wrong side, or the "
            "places of the markers have the wrong sign of y"
        )


def check_order(leg: Leg, places: Mapping[str, Marker], measured: Array) -> list[str]:
    """Return lines about segments whose markers another order fits better; raise if far better."""
    model, names = leg.workspace.model, list(places)
    joints = [model.frames[frame].parentJoint for frame, _ in places.values()]
    points = np.array([model.frames[frame].placement.act(p) for frame, p in places.values()])
    doubts = []
    for joint in sorted(set(joints)):
        chosen = [k for k, parent in enumerate(joints) if parent == joint]
        frames = np.flatnonzero(np.isfinite(measured[:, chosen]).all(axis=(1, 2)))
        if len(chosen) < 3 or not frames.size:
            continue
        stands = joint == 1 and has_floating_base(model)
        # frames in which orders are tried: the median decides, the worst is mentioned
        tried = frames[np.linspace(0, len(frames) - 1, 5 + 2).astype(int)[1:-1]]
        misfits = sorted((_misfit(points[chosen], measured[k, chosen], stands), k) for k in tried)
        # exchanges in a few frames do not change the median
        for (misfit, frame), certain in ((misfits[len(tried) // 2], True), (misfits[-1], False)):
            least, share = SWAPPED if certain else DOUBTFUL
            if misfit < least:
                continue
            seen = measured[frame, chosen]
            numbers = range(len(chosen))
            swaps = [{a: b, b: a} for a, b in combinations(numbers, 2)]
            exchanged = [tuple(swap.get(k, k) for k in numbers) for swap in swaps]
            # of many markers, exchanges of two are tried instead of all orders
            orders = list(permutations(numbers)) if len(chosen) <= 5 else exchanged
            best, order = min(
                (_misfit(points[chosen], seen[list(order)], stands), order) for order in orders
            )
            if best > share * misfit:
                continue
            swapped = ", ".join(repr(names[chosen[k]]) for k, at in enumerate(order) if k != at)
            distances = (
                f"in frame {frame}: they are {misfit:.2g} m from their places as they are named, "
                f"{best:.2g} m if exchanged"
            )
            if certain:
                raise InvalidInput(f"markers {swapped} are swapped {distances}")
            doubts.append(f"markers {swapped} may be swapped {distances}")
    return doubts


def _misfit(points: Array, seen: Array, stands: bool) -> float:
    """Return the distance of points from a rigid body's, at its best pose (Kabsch 1976) [m]."""
    offsets, targets = points - points.mean(axis=0), seen - seen.mean(axis=0)
    left, _, right = np.linalg.svd(targets.T @ offsets)
    left[:, -1] *= np.linalg.det(left @ right)
    rotation = left @ right
    distance = float(np.sqrt(np.mean(np.sum((targets - offsets @ rotation.T) ** 2, axis=1))))
    # upside down: as far from its place as its width
    return distance + float(stands and rotation[2, 2] < -0.5) * float(np.ptp(offsets))


def check_determined(
    leg: Leg, kinematics: MarkerKinematics, frames: Mapping[int, SolvedFrame]
) -> None:
    """Raise `InvalidInput` if no frame has markers that determine every joint."""
    if frames:
        return
    model, last = leg.workspace.model, kinematics.last
    if last is None:
        raise InvalidInput(
            f"too few markers: no frame has the {-(-model.nv // 3)} or more that {model.nv} "
            "coordinates need"
        )
    free = np.abs(np.linalg.svd(last.jacobian)[2][-1])
    joints = np.repeat(np.arange(1, model.njoints), list(model.nvs)[1:])
    joint = int(joints[int(np.argmax(free))])
    marked = [model.frames[frame].parentJoint for frame, _ in kinematics.places]
    links = {frame.parentJoint: frame.name for frame in reversed(list(model.frames))
             if frame.type == pin.FrameType.BODY}  # fmt: skip
    counts = []
    for segment in range(1, model.njoints):
        if model.inertias[segment].mass > 0.0:
            seen = sum(bool(last.seen[k]) for k, parent in enumerate(marked) if parent == segment)
            counts.append(f"{seen} on {links.get(segment, model.names[segment])}")
    raise InvalidInput(
        "too few markers: those that are seen do not determine joint "
        f"{leg.joint_names[joint - 1]} in any frame; they are {', '.join(counts)}: three on each "
        "segment that are not on one line are always enough"
    )
