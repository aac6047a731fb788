r"""`fit_motion`: the motion of a leg from markers, or from joint angles, with deviations.

In each frame, inverse kinematics gives the configuration q whose markers are nearest to the
measured ones, in the sense of least squares. Its information matrix is :math:`J^T J / \sigma^2`,
with the Jacobian J of the markers and their noise :math:`\sigma`, estimated from the residuals.

The motion over time is a smoothing spline through these configurations: a B-spline of degree 5,
:math:`x(t)`, in the tangent space at one configuration, that minimises

.. math:: \sum_k |x(t_k) - x_k|^2_{W_k} + \sum_j \lambda_j \int \ddddot x_j^2 \, dt

with the information matrices :math:`W_k`. Read as a Gaussian prior of the fourth derivative, the
penalty gives deviations (Wahba 1983, J. R. Stat. Soc. B 45:133), and each :math:`\lambda_j` is the
one of largest restricted likelihood. Frames before and after the impact have splines of their own,
so that nothing is smoothed across it.
"""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
from scipy.interpolate import BSpline
from scipy.optimize import minimize_scalar

from kickdyn.core import validation
from kickdyn.core.representation import ReprMixin, Row, warned
from kickdyn.core.validation import Array, read_only
from kickdyn.errors import InvalidInput, KickdynError
from kickdyn.identification.body_track import BodyTrack
from kickdyn.robot.leg import Leg, Posture
from kickdyn.robot.model_validation import frame_id
from kickdyn.robot.surgery import has_floating_base

LARGEST_RESIDUAL = 0.05
"""Root mean square distance of markers [m] above which they are swapped or on other segments."""

LARGEST_EXTENT = 20.0
"""Distance between markers of one body [m] that only other units explain."""

LEAST_NOISE = 1e-7
"""Least noise of a marker [m]; with less, the smoothing would lose its digits."""

LEAST_FRAMES = 8
"""Fewer frames before a contact do not determine a velocity with its deviation."""

CONTACT_WINDOW = 0.15
"""Time before a contact whose frames the motion at the contact is smoothed from [s]."""

ROUGHNESS = 4
"""Order of the derivative that the penalty of smoothing is on."""

KNOT_SPACING, MOST_KNOTS = 0.01, 60
"""Least time between knots [s], and most intervals between them."""

SCALED_FRAMES = 40
"""Frames from which the lengths of segments are estimated."""

SCALE_DEVIATION, MARKER_NOISE = 0.1, 1e-3
"""Deviation of a segment's length from the leg's, relative, and noise of a marker [m]: their ratio
decides where markers do not determine a length."""

ANGLE_DEVIATION = math.radians(0.5)
"""Deviation of angles of a file, which gives none [rad]; of translations, as many metres."""

Place = str | tuple[str, Any]
"""Where a marker is: a frame of the leg, at its origin, or with a point in its axes [m]."""


@dataclass(frozen=True, eq=False, repr=False)
class ContactMotion(ReprMixin):
    """The motion of a leg at one time, from the frames before it, with its covariance.

    Attributes:
        posture: posture of the leg.
        v: joint velocity, shape `(nv,)` [rad/s; m/s].
        covariance: of q, in its tangent space, and v together, shape `(2 nv, 2 nv)`.
    """

    posture: Posture
    v: Array
    covariance: Array

    @property
    def q_deviations(self) -> Array:
        """Standard deviations of q, in its tangent space, shape `(nv,)` [rad; m]."""
        return np.sqrt(self.covariance.diagonal()[: self.v.size])

    @property
    def v_deviations(self) -> Array:
        """Standard deviations of the joint velocity, shape `(nv,)` [rad/s; m/s]."""
        return np.sqrt(self.covariance.diagonal()[self.v.size :])

    @property
    def foot_velocity(self) -> Array:
        """Velocity of the contact point, shape `(3,)` [m/s, world frame]."""
        return self.posture.point_velocity(self.v)

    def _rows(self) -> Iterable[Row]:
        leg = self.posture.leg
        yield "foot velocity", self.foot_velocity, "m/s"
        for name in leg.single_joints:
            k = leg.velocity_index(name)
            yield f"speed of {name}", f"{self.v[k]:.4g} +- {self.v_deviations[k]:.2g}", "rad/s"
        yield from warned(self.posture.warnings)


class Marker(NamedTuple):
    """A marker on a leg: number of its frame, and its place there [m]."""

    frame: int
    point: Array


@dataclass(frozen=True, eq=False, repr=False)
class LegMotion(ReprMixin):
    """The motion of a leg that is fitted to markers or joint angles.

    Attributes:
        leg: the leg, with segments as long as those of the person.
        times: times of the frames that determine the configuration, shape `(n,)` [s].
        configurations: configuration of each of these frames alone, shape `(n, nq)` [rad; m].
        information: information matrix of each, in the tangent space, shape `(n, nv, nv)`.
        contact: time of the impact, across which nothing is smoothed [s]; None without one.
        noise: standard deviation of a coordinate of a marker [m], from the residuals.
        residuals: root mean square distance of each marker from the leg's [m], by name.
        scales: length of each segment over that of the leg that was given, by joint.
        gaps: frames in which a marker is not seen, by name.
        undetermined: frames of the track that are left out because their markers do not determine
            the configuration.
    """

    leg: Leg
    times: Array
    configurations: Array
    information: Array
    contact: float | None
    noise: float
    residuals: Mapping[str, float]
    scales: Mapping[str, float]
    gaps: Mapping[str, tuple[int, ...]]
    undetermined: tuple[int, ...]

    def q(self, t: float) -> Array:
        """Return the smoothed configuration at a time [s], shape `(nq,)` [rad; m]."""
        return self._piece_at(t).state(t)[0]

    def v(self, t: float) -> Array:
        """Return the smoothed joint velocity at a time [s], shape `(nv,)` [rad/s; m/s]."""
        return self._piece_at(t).state(t)[1]

    def deviations(self, t: float) -> tuple[Array, Array]:
        """Return the standard deviations of q and v at a time [s], each of shape `(nv,)`."""
        variances = self._piece_at(t).state(t)[2].diagonal()
        deviations = np.sqrt(np.maximum(variances, 0.0))
        return deviations[: self.leg.nv], deviations[self.leg.nv :]

    def at_contact(self, time: float | None = None) -> ContactMotion:
        """Return posture and joint velocity just before a contact, from the frames before it.

        Args:
            time: time of the contact [s]; None is the one that `fit_motion` was given.

        Raises:
            InvalidInput: no time, a time without frames shortly before it, or too few of them.
        """
        if time is None and self.contact is None:
            raise InvalidInput("time is None: fit_motion was given no contact either")
        moment = validation.number("time", self.contact if time is None else time, unit="s")
        window = (self.times < moment) & (self.times >= moment - CONTACT_WINDOW)
        interval = float(np.median(np.diff(self.times)))
        if window.sum() < LEAST_FRAMES or moment - self.times[window][-1] > 3.0 * interval:
            unseen = ", ".join(self.gaps) or "none"
            raise InvalidInput(
                f"contact at {moment:g} s has {int(window.sum())} frames in the {CONTACT_WINDOW:g} "
                f"s before it that determine the leg, and must have {LEAST_FRAMES}, up to "
                f"{3.0 * interval:.3g} s before it; frames are from {self.times[0]:g} to "
                f"{self.times[-1]:g} s, markers with gaps: {unseen}"
            )
        q, v, covariance = self._smoothed(window).state(moment)
        return ContactMotion(self.leg.posture(q), read_only(v), read_only(covariance))

    def _smoothed(self, chosen: Any) -> "_Spline":
        model = self.leg.workspace.model
        return _Spline(
            model, self.times[chosen], self.configurations[chosen], self.information[chosen]
        )

    @cached_property
    def _pieces(self) -> list["_Spline"]:
        """Splines of the frames before and after the contact, those with enough frames."""
        contact = math.inf if self.contact is None else self.contact
        sides = (self.times < contact, self.times >= contact)
        return [self._smoothed(side) for side in sides if side.sum() >= LEAST_FRAMES]

    def _piece_at(self, t: float) -> "_Spline":
        moment = validation.number("t", t, unit="s")
        for piece in self._pieces:
            if piece.begin <= moment <= piece.end:
                return piece
        spans = " and ".join(f"{piece.begin:g} to {piece.end:g}" for piece in self._pieces)
        raise InvalidInput(f"t is {moment:g} s: the motion is known from {spans or 'no time'} s")

    def _rows(self) -> Iterable[Row]:
        yield "frames", len(self.times), ""
        yield "duration", float(self.times[-1] - self.times[0]), "s"
        if self.residuals:
            yield "noise of a coordinate", 1e3 * self.noise, "mm"
        for name, residual in self.residuals.items():
            yield f"residual of {name}", 1e3 * residual, "mm"
        for joint, scale in self.scales.items():
            yield f"length behind {joint}", scale, "of the leg's"
        for name, frames in self.gaps.items():
            yield f"gaps of {name}", len(frames), "frames"
        if self.undetermined:
            yield "frames left out", len(self.undetermined), ""


@validation.check_arguments
def fit_motion(
    track: BodyTrack,
    leg: Leg,
    markers: Mapping[str, Place] | None = None,
    *,
    angles: Mapping[str, str] | None = None,
    contact: float | None = None,
    scale: bool = True,
) -> LegMotion:
    """Return the motion of a leg from the track of its markers, or of its joint angles.

    Args:
        track: measured markers, or joint angles.
        leg: the leg, on a floating base if its hip moves. Supports and loops do not count.
        markers: where each marker is on the leg: `{"knee": "shank"}` is the origin of the link
            shank, `{"tibia": ("shank", (0.03, 0, -0.2))}` a point in its axes [m]. Markers of the
            track that are not named do not count.
        angles: for a track of angles, its coordinate for each joint of the leg, with a minus where
            it has the other direction: `{"knee": "-knee_angle_r"}`. Each joint must be named. The
            deviation of angles is taken for 0.5 degrees.
        contact: time of the impact [s], across which nothing is smoothed.
        scale: whether to estimate the lengths of segments from the markers. Masses stay, radii of
            gyration scale with lengths.

    Raises:
        InvalidInput: an unknown marker or frame, too few markers for a segment, markers that do
            not fit the leg, another unit or vertical axis, or too few frames.
    """
    if contact is not None:
        contact = validation.number("contact", contact, unit="s")
        if not track.times[0] < contact <= track.times[-1] + 0.02:
            raise InvalidInput(
                f"contact is {contact:g} s: the track is from {track.times[0]:g} to "
                f"{track.times[-1]:g} s"
            )
    if angles is not None:
        return _from_angles(track, leg, validation.mapping("angles", angles), contact)
    named = validation.mapping("markers", markers)
    places = {name: _place(leg, name, place) for name, place in named.items()}
    for name in places:
        if name not in track.markers:
            raise InvalidInput(
                f"marker {name!r} is not in the track: its markers are "
                f"{validation.brief(list(track.markers))}"
            )
    if not places:
        raise InvalidInput("markers is empty: it must say where each marker is on the leg")
    names = list(places)
    measured = track.positions[:, [track.markers.index(name) for name in names]]
    _check_units(measured, names)
    first = _Kinematics(leg.workspace.model, list(places.values()))
    # the lengths are first those of the leg, in a few frames only
    frames = first.solve_track(measured, _spread(measured))
    _check_determined(leg, first, frames)
    scales: dict[str, float] = {}
    if scale:
        leg, scales = _scaled(leg, places, measured, frames)
    kinematics = _Kinematics(leg.workspace.model, _scaled_places(leg, places, scales))
    frames = kinematics.solve_track(measured, range(len(measured)))
    return _judged(LegMotion(
        leg, track.times, *kinematics.stack(frames), contact, 0.0, {}, scales,
        {name: gap for name, gap in track.gaps.items() if name in places},
        tuple(k for k in range(len(measured)) if k not in frames),
    ), kinematics, names, measured, frames)  # fmt: skip


def _from_angles(
    track: BodyTrack, leg: Leg, angles: Mapping[str, str], contact: float | None
) -> LegMotion:
    """Return the motion of a leg whose joint angles are measured."""
    if set(angles) != set(leg.joint_names) or leg.nq != len(leg.joint_names):
        joints = ", ".join(leg.joint_names)
        raise InvalidInput(
            f"angles is {validation.brief(dict(angles))}: it must name one coordinate for each of "
            f"{joints}, joints of one angle each"
        )
    q = np.empty((len(track), leg.nq))
    for joint, coordinate in angles.items():
        name = str(coordinate).removeprefix("-")
        if name not in track.angles:
            known = validation.brief(list(track.angles))
            raise InvalidInput(f"angle {name!r} is not in the track: it has {known}")
        sign = -1.0 if str(coordinate).startswith("-") else 1.0
        q[:, leg.velocity_index(joint)] = sign * track.angles[name]
    known_frames = np.isfinite(q).all(axis=1)
    if known_frames.sum() < LEAST_FRAMES:
        raise InvalidInput(
            f"track has {int(known_frames.sum())} frames with all angles: at least {LEAST_FRAMES}"
        )
    information = np.tile(np.eye(leg.nv) / ANGLE_DEVIATION**2, (int(known_frames.sum()), 1, 1))
    return LegMotion(
        leg, track.times[known_frames], q[known_frames], information, contact, 0.0, {}, {}, {},
        tuple(np.flatnonzero(~known_frames).tolist()),
    )  # fmt: skip


def _place(leg: Leg, name: str, place: Place) -> Marker:
    """Return where a marker is on a leg, or raise `InvalidInput`."""
    try:
        frame, point = (place, (0.0, 0.0, 0.0)) if isinstance(place, str) else tuple(place)
    except (TypeError, ValueError):
        raise InvalidInput(
            f"place of marker {name!r} is {validation.brief(place)}: it must be a frame or "
            "(frame, point)"
        ) from None
    number = frame_id(leg.workspace.model, frame)
    return Marker(number, validation.vector(f"point of marker {name!r}", point, 3, unit="m"))


def _check_units(measured: Array, names: list[str]) -> None:
    """Raise `InvalidInput` for markers in other units, or with another axis up."""
    for k, name in enumerate(names):
        if not np.isfinite(measured[:, k]).any():
            raise InvalidInput(f"marker {name!r} is seen in no frame")
    middle = np.nanmedian(measured, axis=0)
    extent = float(np.nanmax(middle, axis=0).max() - np.nanmin(middle, axis=0).min())
    size = float(np.nanmax(np.ptp(middle, axis=0)))
    if min(extent, size) > LARGEST_EXTENT:
        raise InvalidInput(
            f"markers are up to {size:.4g} m apart, as in millimetres: positions must be in metres"
        )


def _spread(measured: Array) -> list[int]:
    """Return up to `SCALED_FRAMES` frames with most markers, spread over the track."""
    seen = np.isfinite(measured).all(axis=2).sum(axis=1)
    full = np.flatnonzero(seen == seen.max())
    chosen = full[np.linspace(0, len(full) - 1, SCALED_FRAMES).astype(int)]
    return [int(k) for k in np.unique(chosen)]


class _Frame(NamedTuple):
    """A frame that is solved: configuration, Jacobian of its markers and what is missed [m]."""

    q: Array
    jacobian: Array
    missed: Array
    seen: Array


class _Kinematics:
    """Inverse kinematics of the markers on a model."""

    def __init__(self, model: Any, places: list[Marker]) -> None:
        self.model, self.data, self.places = model, model.createData(), places
        single = [j for j in range(1, model.njoints) if model.nqs[j] == model.nvs[j] == 1]
        limits = [(model.lowerPositionLimit[i], model.upperPositionLimit[i]) for i in model.idx_qs]
        self._single = [model.idx_qs[j] for j in single if np.isfinite(limits[j]).all()]
        self.last: _Frame | None = None

    def markers(self, q: Array, seen: Array) -> tuple[Array, Array]:
        """Return positions `(3 k,)` and Jacobian `(3 k, nv)` of the markers that are seen."""
        model, data = self.model, self.data
        pin.computeJointJacobians(model, data, q)
        pin.updateFramePlacements(model, data)
        points, rows = [], []
        for k in np.flatnonzero(seen):
            frame, point = self.places[k]
            pose = data.oMf[frame]
            arm = pose.rotation @ point
            by_q = np.reshape(
                pin.getFrameJacobian(model, data, frame, pin.LOCAL_WORLD_ALIGNED), (6, -1)
            )
            points.append(pose.translation + arm)
            rows.append(by_q[:3] - pin.skew(arm) @ by_q[3:])
        return np.concatenate(points), np.vstack(rows)

    def solve(self, q: Array, measured: Array, seen: Array) -> _Frame:
        """Return the nearest configuration from a start, by damped Gauss-Newton steps."""
        target = measured[seen].ravel()
        points, jacobian = self.markers(q, seen)
        missed, damping = target - points, 1e-8
        for _ in range(40):
            gram = jacobian.T @ jacobian
            step = np.linalg.solve(gram + damping * np.eye(len(gram)), jacobian.T @ missed)
            near = pin.integrate(self.model, q, step)
            points, by_q = self.markers(near, seen)
            error = target - points
            if error @ error <= missed @ missed * (1.0 + 1e-12) + 1e-30:
                q, jacobian, missed = near, by_q, error
                damping *= 0.1 if damping > 1e-14 else 1.0
                if float(np.abs(step).max()) < 1e-12:
                    break
            elif float(np.abs(step).max()) < 1e-10:
                break
            else:
                damping *= 100.0
        return _Frame(q, jacobian, missed, seen)

    def determines(self, frame: _Frame) -> bool:
        """Return whether the markers of a frame determine every joint."""
        values = np.linalg.svd(frame.jacobian, compute_uv=False)
        return len(values) == self.model.nv and bool(values[-1] > 1e-3 * values[0])

    def solve_track(self, measured: Array, chosen: Iterable[int]) -> dict[int, _Frame]:
        """Return the solved frames that determine the configuration, by number."""
        solved: dict[int, _Frame] = {}
        start = None
        for k in chosen:
            seen = np.isfinite(measured[k]).all(axis=1)
            if 3 * int(seen.sum()) < self.model.nv:
                continue
            best = (
                self.first(measured[k], seen)
                if start is None
                else self.solve(start, measured[k], seen)
            )
            if self.determines(best):
                solved[k], start = best, best.q
            elif start is None and not solved:
                self.last = best
        return solved

    def _starts(self, measured: Array, seen: Array) -> list[Array]:
        """Return configurations to start from: bent legs, a floating base at the markers."""
        model, starts = self.model, []
        middle = measured[seen].mean(axis=0)
        turns = (0.0, 2.0, 4.0) if has_floating_base(model) else (0.0,)
        for bend in (0.0, 0.4, 1.0, -0.4):
            for turn in turns:
                step = np.full(model.nv, bend)
                if len(turns) > 1:
                    step[:6] = (0.0, 0.0, 0.0, 0.0, 0.0, turn)
                q = self._inside(pin.integrate(model, pin.neutral(model), step))
                if len(turns) > 1:
                    points, _ = self.markers(q, seen)
                    q[:3] += middle - points.reshape(-1, 3).mean(axis=0)
                starts.append(q)
        return starts

    def _inside(self, q: Array) -> Array:
        """Return a configuration with angles less whole turns, then clipped to their ranges."""
        single = self._single
        low, high = self.model.lowerPositionLimit[single], self.model.upperPositionLimit[single]
        middle, inside = 0.5 * (low + high), q.copy()
        turns = np.round((q[single] - middle) / (2.0 * np.pi))
        inside[single] = np.clip(q[single] - 2.0 * np.pi * turns, low, high)
        return inside

    def first(self, measured: Array, seen: Array) -> _Frame:
        """Return the nearest configuration of a first frame, in the ranges of joints if possible.

        Several configurations can have the same markers, as hips turned by 180 degrees.
        """
        solved = []
        for q in self._starts(measured, seen):
            frame = self.solve(q, measured, seen)
            solved += [frame, self.solve(self._inside(frame.q), measured, seen)]
        least = min(float(frame.missed @ frame.missed) for frame in solved)
        near = [f for f in solved if f.missed @ f.missed <= 1.001 * least + 1e-12]
        return min(near, key=lambda f: float(np.abs(f.q - self._inside(f.q)).sum()))

    def stack(self, frames: Mapping[int, _Frame]) -> tuple[Array, Array]:
        """Return configurations and Gram matrices of frames."""
        return (
            np.array([frame.q for frame in frames.values()]),
            np.array([frame.jacobian.T @ frame.jacobian for frame in frames.values()]),
        )


def _check_determined(leg: Leg, kinematics: _Kinematics, frames: Mapping[int, _Frame]) -> None:
    """Raise `InvalidInput` if no frame has markers that determine every joint."""
    if frames:
        return
    last = kinematics.last
    joint = "any joint"
    if last is not None:
        free = np.linalg.svd(last.jacobian)[2][-1]
        names = np.repeat(leg.joint_names, list(leg.workspace.model.nvs)[1:])
        joint = str(names[int(np.argmax(np.abs(free)))])
    raise InvalidInput(
        f"too few markers: in no frame do those that are seen determine {joint}; add one on a "
        "segment behind it"
    )


def _scaled(
    leg: Leg, places: Mapping[str, Marker], measured: Array, frames: Mapping[int, _Frame]
) -> tuple[Leg, dict[str, float]]:
    """Return the leg with segments as long as the markers have them, and their scales.

    The configurations are eliminated from the normal equations of each frame (Schur complement).
    """
    joints = leg.joint_names
    scales = np.ones(len(joints))
    starts = {k: frame.q for k, frame in frames.items()}
    scaled = leg
    prior = (MARKER_NOISE / SCALE_DEVIATION) ** 2
    for _ in range(20):
        numbers = dict(zip(joints, scales.tolist(), strict=True))
        kinematics = _Kinematics(scaled.workspace.model, _scaled_places(scaled, places, numbers))
        normal, right = prior * np.eye(len(joints)), prior * (1.0 - scales)
        for k, start in starts.items():
            frame = kinematics.solve(start, measured[k], np.isfinite(measured[k]).all(axis=1))
            starts[k] = frame.q
            by_scale = _by_scale(kinematics, frame, scales)
            basis = np.linalg.qr(frame.jacobian)[0]
            across = by_scale - basis @ (basis.T @ by_scale)
            normal += across.T @ across
            right += across.T @ frame.missed
        step = np.linalg.solve(normal, right)
        scales = np.clip(scales + step, 0.5, 2.0)
        scaled = leg.with_model(_scaled_model(leg, scales))
        if float(np.abs(step).max()) < 1e-13:
            break
    return scaled, dict(zip(joints, scales.tolist(), strict=True))


def _by_scale(kinematics: _Kinematics, frame: _Frame, scales: Array) -> Array:
    """Return the derivatives of the markers by the scales of segments, `(3 k, joints)`."""
    model, data = kinematics.model, kinematics.data
    kinematics.markers(frame.q, frame.seen)
    rows = []
    for k in np.flatnonzero(frame.seen):
        number, point = kinematics.places[k]
        joint = model.frames[number].parentJoint
        by_scale = np.zeros((3, len(scales)))
        chain = [i for i in model.supports[joint] if i]
        for before, after in pairwise(chain):
            reach = data.oMi[before].rotation @ model.jointPlacements[after].translation
            by_scale[:, before - 1] += reach / scales[before - 1]
        if joint:
            local = model.frames[number].placement.act(point)
            by_scale[:, joint - 1] += data.oMi[joint].rotation @ local / scales[joint - 1]
        rows.append(by_scale)
    return np.vstack(rows)


def _scaled_model(leg: Leg, scales: Array) -> Any:
    """Return the model with the segment behind each joint scaled; masses stay."""
    model = leg.model
    for joint in range(1, model.njoints):
        parent = model.parents[joint]
        if parent:
            model.jointPlacements[joint].translation *= scales[parent - 1]
        size, inertia = scales[joint - 1], model.inertias[joint]
        model.inertias[joint] = pin.Inertia(
            inertia.mass, size * inertia.lever, size**2 * inertia.inertia
        )
    for frame in model.frames:
        if frame.parentJoint:
            placement = frame.placement.copy()
            placement.translation = placement.translation * scales[frame.parentJoint - 1]
            frame.placement = placement
    return model


def _scaled_places(
    leg: Leg, places: Mapping[str, Marker], scales: Mapping[str, float]
) -> list[Marker]:
    """Return the places of markers, scaled with their segments."""
    frames, names = leg.workspace.model.frames, leg.joint_names
    answer = []
    for frame, point in places.values():
        joint = frames[frame].parentJoint
        scale = scales.get(names[joint - 1], 1.0) if joint else 1.0
        answer.append(Marker(frame, scale * point))
    return answer


def _judged(
    motion: LegMotion,
    kinematics: _Kinematics,
    names: list[str],
    measured: Array,
    frames: Mapping[int, _Frame],
) -> LegMotion:
    """Return a motion with noise and residuals, or raise `InvalidInput` where these are large."""
    if len(frames) < LEAST_FRAMES:
        raise InvalidInput(
            f"track has {len(frames)} frames whose markers determine the leg: at least "
            f"{LEAST_FRAMES} are needed"
        )
    missed = np.full((len(measured), len(names), 3), np.nan)
    spare = 0
    for k, frame in frames.items():
        missed[k, frame.seen] = frame.missed.reshape(-1, 3)
        spare += frame.missed.size - kinematics.model.nv
    distances = np.linalg.norm(missed, axis=2)
    mean = np.sqrt(np.nanmean(distances**2, axis=0))
    if float(np.sqrt(np.nanmean(distances**2))) > LARGEST_RESIDUAL:
        largest = float(np.nanmax(distances))
        frame_number, worst = np.unravel_index(int(np.nanargmax(distances)), distances.shape)
        middle = np.ptp(np.nanmedian(measured, axis=0), axis=0)
        hint = " (y seems to point up: see `up`)" if middle[1] > 2.0 * middle[2] else ""
        raise InvalidInput(
            f"marker {names[int(worst)]!r} is {largest:.3g} m "
            f"from its place on the leg in frame {int(frame_number)}: markers are swapped, on the "
            f"other leg, or on another segment{hint}"
        )
    square = float(np.nansum(distances**2))
    noise = max(math.sqrt(square / spare) if spare > 0 else MARKER_NOISE, LEAST_NOISE)
    chosen = np.array(list(frames))
    return replace(
        motion,
        times=read_only(motion.times[chosen]),
        information=read_only(motion.information / noise**2),
        noise=noise,
        residuals=dict(zip(names, mean.tolist(), strict=True)),
    )


class _Spline:
    """A smoothing spline through configurations with information matrices."""

    def __init__(self, model: Any, times: Array, q: Array, information: Array) -> None:
        self.model, self.begin, self.end = model, float(times[0]), float(times[-1])
        self.reference = q[-1]
        x = np.array([pin.difference(model, self.reference, one) for one in q])
        # information by x, whose tangent space is that of the reference
        moved = np.array([pin.dIntegrate(model, self.reference, one, pin.ARG1) for one in x])
        weights = moved.transpose(0, 2, 1) @ information @ moved
        duration = self.end - self.begin
        count = int(np.clip(duration / KNOT_SPACING, 4, min(MOST_KNOTS, len(times))))
        inner = np.linspace(self.begin, self.end + 2.0 * duration / len(times), count + 1)
        knots = np.concatenate([[inner[0]] * 5, inner, [inner[-1]] * 5])
        self.basis = BSpline(knots, np.eye(len(knots) - 6), 5)
        b = self.basis(times)
        nodes, gauss = np.polynomial.legendre.leggauss(3)
        width = inner[1] - inner[0]
        at = (inner[:-1, None] + 0.5 * width * (1.0 + nodes)).ravel()
        third = (
            self.basis.derivative(ROUGHNESS)(at)
            * np.sqrt(0.5 * width * np.tile(gauss, count))[:, None]
        )
        penalty = third.T @ third
        variances = np.linalg.inv(weights).diagonal(axis1=1, axis2=2)
        smoothing = [
            _restricted_likelihood(b, penalty, x[:, j], variances[:, j]) for j in range(x.shape[1])
        ]
        nv, size = x.shape[1], b.shape[1]
        normal = np.einsum("kjl,ka,kb->jalb", weights, b, b, optimize=True)
        for j, strength in enumerate(smoothing):
            normal[j, :, j, :] += strength * penalty
        right = np.einsum("kjl,kl,ka->ja", weights, x, b, optimize=True).ravel()
        normal = normal.reshape(nv * size, nv * size)
        self._covariance = np.linalg.inv(normal).reshape(nv, size, nv, size)
        self._coefficients = np.linalg.solve(normal, right).reshape(nv, size)

    def state(self, t: float) -> tuple[Array, Array, Array]:
        """Return q, v and the covariance of both, `(2 nv, 2 nv)`, at a time [s]."""
        rows = np.array([self.basis(t), self.basis.derivative()(t)])
        x, rate = rows @ self._coefficients.T
        moved = pin.dIntegrate(self.model, self.reference, x, pin.ARG1)
        covariance = np.einsum("sa,jalb,tb->sjtl", rows, self._covariance, rows, optimize=True)
        turned = np.einsum("ij,sjtl,kl->sitk", moved, covariance, moved, optimize=True)
        size = 2 * len(x)
        q = pin.integrate(self.model, self.reference, x)
        return q, moved @ rate, turned.reshape(size, size)


def _restricted_likelihood(b: Array, penalty: Array, y: Array, variances: Array) -> float:
    """Return the strength of the penalty of largest restricted likelihood for one coordinate."""
    gram, right = b.T @ (b / variances[:, None]), b.T @ (y / variances)
    rank = len(penalty) - ROUGHNESS
    scale = float(np.trace(gram) / np.trace(penalty))

    def cost(exponent: float) -> float:
        strength = scale * 10.0**exponent
        system = gram + strength * penalty
        sign, size = np.linalg.slogdet(system)
        if sign <= 0.0:
            return math.inf
        return float(size - rank * math.log(strength) - right @ np.linalg.solve(system, right))

    grid = np.arange(-14.0, 6.0)
    best = grid[int(np.argmin([cost(exponent) for exponent in grid]))]
    found = minimize_scalar(cost, bounds=(best - 1.0, best + 1.0), method="bounded")
    if not found.success:
        raise KickdynError("the smoothing of this motion was not found")
    return float(scale * 10.0 ** float(found.x))
