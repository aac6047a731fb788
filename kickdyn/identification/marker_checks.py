"""Checks of markers before a motion is fitted: units, swapped markers, the side of the leg."""

from collections.abc import Mapping
from itertools import combinations, permutations

import numpy as np
import pinocchio as pin

from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.identification.marker_kinematics import Marker, MarkerKinematics, SolvedFrame
from kickdyn.robot.leg import Leg
from kickdyn.robot.surgery import has_floating_base

LARGEST_EXTENT = 20.0
"""Distance between markers of one body [m] that only other units explain."""

SWAPPED, DOUBTFUL = (0.02, 0.15), (0.005, 0.4)
"""Root mean square distance of a segment's markers from their places [m] above which markers may be
swapped, and the share to which another order of them must reduce it: to be refused, and to be
mentioned. Places may be wrong by a centimetre, too."""

ORDERED_FRAMES = 5
"""Frames in which orders are tried: the median decides, the worst is mentioned."""

MOST_ORDERED = 5
"""Markers of a segment of which all orders are tried; of more of them, exchanges of two."""

SIDEWAYS = 0.02
"""Distance of the pelvis' centre and markers from the hip, sideways, that shows the side [m]."""


def check_units(measured: Array, names: list[str]) -> None:
    """Raise `InvalidInput` for markers in other units, or one that is never seen."""
    for k, name in enumerate(names):
        if not np.isfinite(measured[:, k]).any():
            raise InvalidInput(f"marker {name!r} is not seen in any frame")
    middle = np.nanmedian(measured, axis=0)
    extent = float(np.nanmax(middle, axis=0).max() - np.nanmin(middle, axis=0).min())
    size = float(np.nanmax(np.ptp(middle, axis=0)))
    if min(extent, size) > LARGEST_EXTENT:
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
    """Return lines about segments whose markers another order fits better.

    Raises `InvalidInput` if it is much better. A pelvis that stands on its head does not fit.
    """
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
        tried = frames[np.linspace(0, len(frames) - 1, ORDERED_FRAMES + 2).astype(int)[1:-1]]
        misfits = sorted((_misfit(points[chosen], measured[k, chosen], stands), k) for k in tried)
        # exchanges in a few frames do not change the median
        for (misfit, frame), certain in ((misfits[len(tried) // 2], True), (misfits[-1], False)):
            least, share = SWAPPED if certain else DOUBTFUL
            if misfit < least:
                continue
            seen = measured[frame, chosen]
            best, order = min(
                (_misfit(points[chosen], seen[list(order)], stands), order)
                for order in _orders(len(chosen))
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


def _orders(count: int) -> list[tuple[int, ...]]:
    """Return orders of markers that may have been mistaken for each other."""
    if count <= MOST_ORDERED:
        return list(permutations(range(count)))
    orders = []
    for a, b in combinations(range(count), 2):
        order = list(range(count))
        order[a], order[b] = b, a
        orders.append(tuple(order))
    return orders


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
