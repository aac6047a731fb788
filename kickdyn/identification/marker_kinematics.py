"""Inverse kinematics of markers on a leg, and the lengths of segments that fit them best."""

import math
from collections.abc import Iterable, Mapping
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from kickdyn.core.validation import Array
from kickdyn.robot.leg import Leg
from kickdyn.robot.surgery import has_floating_base

SCALED_FRAMES = 40
"""Frames from which the lengths of segments are estimated."""

SCALE_DEVIATION, MARKER_NOISE = 0.1, 1e-3
"""Deviation of a segment's length from the leg's, relative, and noise of a marker [m]: their ratio
decides where markers do not determine a length."""


LARGEST_PLACE_DEVIATION, SMALL_STEP = 0.02, 1e-4
"""Largest standard deviation of the places of markers [m], and step of these places [m] and of
lengths at which their estimation ends."""

LARGEST_RMS_DISTANCE = 0.05
"""Root mean square distance of a marker [m] above which it is swapped or on another segment."""

LEAST_SHARE = 3e-3
"""Singular value of a frame's Jacobian, over the largest, below which it determines nothing: with
a dozen markers, 1 mm of noise turns a joint by 5 degrees there, more than is linear."""

KEPT = (MARKER_NOISE / 0.3) ** 2
"""Weight of the configuration of the frame before [m2], which a frame is expected to have within
0.3 rad, where the markers do not determine it."""


class Marker(NamedTuple):
    """A marker on a leg: number of its frame, and its place there [m]."""

    frame: int
    point: Array


def spread_frames(measured: Array) -> list[int]:
    """Return up to `SCALED_FRAMES` frames with most markers, spread over the track."""
    seen = np.isfinite(measured).all(axis=2).sum(axis=1)
    full = np.flatnonzero(seen == seen.max())
    chosen = full[np.linspace(0, len(full) - 1, SCALED_FRAMES).astype(int)]
    return [int(k) for k in np.unique(chosen)]


class SolvedFrame(NamedTuple):
    """A solved frame: configuration, Jacobian of its markers, residual [m], and markers seen."""

    q: Array
    jacobian: Array
    missed: Array
    seen: Array

    @property
    def rank(self) -> int:
        """Number of coordinates that the markers determine."""
        return _rank(self.jacobian)

    @property
    def complete(self) -> bool:
        """Whether the markers determine every coordinate."""
        return self.rank == int(self.jacobian.shape[1])


def _rank(jacobian: Array) -> int:
    values = np.linalg.svd(jacobian, compute_uv=False)
    return int((values > LEAST_SHARE * values[0]).sum())


class MarkerKinematics:
    """Inverse kinematics of the markers on a model."""

    def __init__(self, model: Any, places: list[Marker]) -> None:
        self.model, self.data, self.places = model, model.createData(), places
        single = [j for j in range(1, model.njoints) if model.nqs[j] == model.nvs[j] == 1]
        limits = [(model.lowerPositionLimit[i], model.upperPositionLimit[i]) for i in model.idx_qs]
        self._single = [model.idx_qs[j] for j in single if np.isfinite(limits[j]).all()]
        self.last: SolvedFrame | None = None
        # numbers of the markers, their places, and their velocities by the frame's, `(3, 6)`
        self._by_frame: dict[int, tuple[list[int], Array, Array]] = {}
        for frame in {place.frame for place in places}:
            numbers = [k for k, place in enumerate(places) if place.frame == frame]
            points = np.array([places[k].point for k in numbers])
            velocities = np.array([np.hstack([np.eye(3), -pin.skew(p)]) for p in points])
            self._by_frame[frame] = (numbers, points, velocities)

    def markers(self, q: Array, seen: Array) -> tuple[Array, Array]:
        """Return positions `(3 k,)` and Jacobian `(3 k, nv)` of the markers that are seen."""
        model, data = self.model, self.data
        pin.computeJointJacobians(model, data, q)
        pin.updateFramePlacements(model, data)
        points, rows = np.empty((len(seen), 3)), np.empty((len(seen), 3, model.nv))
        for frame, (numbers, places, velocities) in self._by_frame.items():
            pose = data.oMf[frame]
            points[numbers] = pose.translation + places @ pose.rotation.T
            by_q = np.reshape(pin.getFrameJacobian(model, data, frame, pin.LOCAL), (6, -1))
            rows[numbers] = pose.rotation @ (velocities @ by_q)
        return points[seen].ravel(), rows[seen].reshape(-1, model.nv)

    def solve(self, q: Array, measured: Array, seen: Array, kept: float = 0.0) -> SolvedFrame:
        """Return the nearest configuration from a start, whose distance has the weight `kept`."""
        target, start, displacement = measured[seen].ravel(), q, np.zeros(self.model.nv)
        points, jacobian = self.markers(q, seen)
        missed, damping = target - points, 1e-8
        for _ in range(40):
            gram, slope = jacobian.T @ jacobian, jacobian.T @ missed - kept * displacement
            step = np.linalg.solve(gram + (damping + kept) * np.eye(len(gram)), slope)
            candidate = pin.integrate(self.model, q, step)
            points, by_q = self.markers(candidate, seen)
            error = target - points
            further = pin.difference(self.model, start, candidate) if kept else displacement
            cost = missed @ missed + kept * (displacement @ displacement)
            if error @ error + kept * (further @ further) <= cost * (1.0 + 1e-12) + 1e-30:
                q, jacobian, missed, displacement = candidate, by_q, error, further
                damping *= 0.1 if damping > 1e-14 else 1.0
                if float(np.abs(step).max()) < 1e-12:
                    break
            elif float(np.abs(step).max()) < 1e-10:
                break
            else:
                damping *= 100.0
        return SolvedFrame(q, jacobian, missed, seen)

    def solve_track(
        self, measured: Array, chosen: Iterable[int], start: Array | None = None
    ) -> dict[int, SolvedFrame]:
        """Return the solved frames by number, from the first one that is complete."""
        solved: dict[int, SolvedFrame] = {}
        for k in chosen:
            seen = np.isfinite(measured[k]).all(axis=1)
            if not seen.any() or (not solved and 3 * int(seen.sum()) < self.model.nv):
                continue
            if start is None:
                best = self.first(measured[k], seen)
            else:
                _, jacobian = self.markers(start, seen)
                weight = KEPT if _rank(jacobian) < self.model.nv else 0.0
                best = self.solve(start, measured[k], seen, weight)
            if not solved and not best.complete:
                self.last = best
                continue
            solved[k], start = best, best.q
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
        single = self._single
        low, high = self.model.lowerPositionLimit[single], self.model.upperPositionLimit[single]
        middle, inside = 0.5 * (low + high), q.copy()
        turns = np.round((q[single] - middle) / (2.0 * np.pi))
        inside[single] = np.clip(q[single] - 2.0 * np.pi * turns, low, high)
        return inside

    def first(self, measured: Array, seen: Array) -> SolvedFrame:
        """Return the nearest configuration of a first frame, in the joints' ranges if possible."""
        solved = []
        for q in self._starts(measured, seen):
            frame = self.solve(q, measured, seen)
            solved += [frame, self.solve(self._inside(frame.q), measured, seen)]
        least = min(float(frame.missed @ frame.missed) for frame in solved)
        candidates = [f for f in solved if f.missed @ f.missed <= 1.001 * least + 1e-12]
        return min(candidates, key=lambda f: float(np.abs(f.q - self._inside(f.q)).sum()))


class FittedLeg(NamedTuple):
    """A leg with segments as long as the markers have them.

    Scales are lengths by joint over those of the given leg, offsets are moves of the markers'
    places `(markers, 3)` [m]; the covariance is that of scales and, if they are estimated,
    offsets.
    """

    leg: Leg
    scales: dict[str, float]
    places: list[Marker]
    offsets: Array
    covariance: Array

    def slopes(self, q: Array) -> Array:
        """Return by how much scales and offsets change q if the markers stay, `(nv, values)`."""
        kinematics = MarkerKinematics(self.leg.workspace.model, self.places)
        _, jacobian = kinematics.markers(q, np.ones(len(self.places), dtype=bool))
        frame = SolvedFrame(q, jacobian, np.zeros(0), np.ones(len(self.places), dtype=bool))
        scales = np.array(list(self.scales.values()))
        by_value = _by_scale(kinematics, frame, scales, self.offsets)
        if len(self.covariance) > len(scales):
            by_value = np.hstack([by_value, _by_place(kinematics, frame)])
        return np.asarray(-np.linalg.pinv(jacobian) @ by_value)


def scaled_leg(
    leg: Leg,
    places: Mapping[str, Marker],
    measured: Array,
    frames: Mapping[int, SolvedFrame],
    place_deviation: float = 0.0,
) -> FittedLeg:
    """Return the leg with segments as long as the markers have them, places too if they deviate.

    The configurations are eliminated from the normal equations of each frame (Schur complement).
    """
    joints, count = leg.joint_names, 3 * len(places) * bool(place_deviation)
    values = np.concatenate([np.ones(len(joints)), np.zeros(count)])  # scales and offsets
    nominal, starts = values.copy(), {k: frame.q for k, frame in frames.items()}
    deviations = np.repeat([SCALE_DEVIATION, place_deviation], [len(joints), count])
    prior, scaled, displaced = np.diag((MARKER_NOISE / deviations) ** 2), leg, list(places.values())
    scales, offsets = values[: len(joints)], np.zeros((len(places), 3))
    for _ in range(20):
        normal, right = prior.copy(), prior @ (nominal - values)
        kinematics = MarkerKinematics(scaled.workspace.model, displaced)
        for k, start in starts.items():
            frame = kinematics.solve(start, measured[k], np.isfinite(measured[k]).all(axis=1))
            starts[k] = frame.q
            by_value = _by_scale(kinematics, frame, scales, offsets)
            if count:
                by_value = np.hstack([by_value, _by_place(kinematics, frame)])
            basis = np.linalg.qr(frame.jacobian)[0]
            reduced = by_value - basis @ (basis.T @ by_value)
            normal += reduced.T @ reduced
            right += reduced.T @ frame.missed
        step = np.linalg.solve(normal, right)
        values += step
        scales = values[: len(joints)] = np.clip(values[: len(joints)], 0.5, 2.0)
        scaled = leg.with_model(_scaled_model(leg, scales))
        if count:
            offsets = values[len(joints) :].reshape(-1, 3)
        factors = [1.0, *scales]  # of the base, then of the joints
        carriers = [leg.workspace.model.frames[frame].parentJoint for frame, _ in places.values()]
        displaced = [
            Marker(place.frame, factors[joint] * place.point + offset)
            for place, joint, offset in zip(places.values(), carriers, offsets, strict=True)
        ]
        if float(np.abs(step).max()) < (SMALL_STEP if count else 1e-13):
            break
    numbers = dict(zip(joints, scales.tolist(), strict=True))
    covariance = np.asarray(MARKER_NOISE**2 * np.linalg.inv(normal), dtype=float)
    return FittedLeg(scaled, numbers, displaced, offsets, covariance)


def place_deviation(fitted: FittedLeg, measured: Array, frames: Mapping[int, SolvedFrame]) -> float:
    """Return the standard deviation of the places of markers that residuals show, or 0 [m].

    It is 0 if scatter explains the mean residuals, or one is so large that it is another
    marker.
    """
    model, places = fitted.leg.workspace.model, fitted.places
    kinematics = MarkerKinematics(model, places)
    residuals = np.full((len(frames), len(places), 3), np.nan)
    for row, (k, start) in enumerate(frames.items()):
        frame = kinematics.solve(start.q, measured[k], start.seen)
        kinematics.markers(frame.q, frame.seen)
        numbers = np.flatnonzero(frame.seen)
        for number, missed in zip(numbers, frame.missed.reshape(-1, 3), strict=True):
            residuals[row, number] = kinematics.data.oMf[places[number].frame].rotation.T @ missed
    seen = np.isfinite(residuals[..., 0]).sum(axis=0)
    residuals, seen = residuals[:, seen > 1], seen[seen > 1, None]
    if (
        not seen.size
        or np.nanmean((residuals**2).sum(axis=2), axis=0).max() > LARGEST_RMS_DISTANCE**2
    ):
        return 0.0
    means = np.nanmean(residuals, axis=0)
    of_scatter = np.nanvar(residuals, axis=0, ddof=1) / seen
    shown = means.size / max(means.size - model.nv, 1)
    square = shown * (float(np.mean(means**2)) - 2.0 * float(np.mean(of_scatter)))
    return min(math.sqrt(max(square, 0.0)), LARGEST_PLACE_DEVIATION)


def _by_place(kinematics: MarkerKinematics, frame: SolvedFrame) -> Array:
    """Return the derivatives of the markers by their places, `(3 k, 3 markers)`."""
    rows = np.zeros((len(frame.seen), 3, len(frame.seen), 3))
    for k, place in enumerate(kinematics.places):
        rows[k, :, k] = kinematics.data.oMf[place.frame].rotation
    return np.reshape(rows[frame.seen], (-1, 3 * len(frame.seen)))


def _by_scale(
    kinematics: MarkerKinematics, frame: SolvedFrame, scales: Array, offsets: Array
) -> Array:
    """Return the derivatives of the markers by scales of segments, shape `(3 k, joints)`."""
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
            local = model.frames[number].placement.act(point - offsets[k])
            by_scale[:, joint - 1] += data.oMi[joint].rotation @ local / scales[joint - 1]
        rows.append(by_scale)
    return np.vstack(rows)


def _scaled_model(leg: Leg, scales: Array) -> Any:
    """Return the model with the segment behind each joint scaled; masses stay."""
    model, factors = leg.model, [1.0, *scales]  # of the base, then of the joints
    for joint in range(1, model.njoints):
        model.jointPlacements[joint].translation *= factors[model.parents[joint]]
        size, inertia = factors[joint], model.inertias[joint]
        lever, moments = size * inertia.lever, size**2 * inertia.inertia
        model.inertias[joint] = pin.Inertia(inertia.mass, lever, moments)
    for frame in model.frames:
        placement = frame.placement.copy()
        placement.translation = placement.translation * factors[frame.parentJoint]
        frame.placement = placement
    return model
