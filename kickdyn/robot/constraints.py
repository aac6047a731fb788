"""Supports, loops, mimic joints and stiff joints of a leg: constraints on joint velocities.

Supports, loops and mimic joints are rows A v = 0. Stiff joints are rows of the same matrix that an
impact does not change, A (v+ - v) = 0: they may move.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, fields
from functools import cached_property
from itertools import accumulate, combinations, pairwise
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
from scipy.linalg import blas, lapack

from kickdyn.core import validation
from kickdyn.core.representation import ReadOnlyArrays, ValueEquality
from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.robot.joint_table import Gears
from kickdyn.robot.model_validation import frame_id
from kickdyn.robot.names import listed
from kickdyn.robot.surgery import has_floating_base

LOOP_TOLERANCE = 1e-9
"""Largest gap of a loop that counts as closed [m]."""

RANK_TOLERANCE = 1e-9
"""Least fraction of a row, in the metric of inertia, that is independent of the other rows."""


@dataclass(frozen=True, eq=False)
class Support(ValueEquality):
    """A frame that stands on the ground and stays at rest while the ball is struck.

    Attributes:
        frame: name of a frame of the robot.
        point: whether only the origin of the frame is at rest (a point foot), or the whole frame (a
            flat foot, the default).
        friction: Coulomb's coefficient between sole and ground; with None, slipping is not checked.
        sole: corners of the sole, three or more, shape `(k, 3)` [m, support frame]; with None,
            tipping is not checked. The ground is level.

    Raises:
        InvalidInput: a coefficient below 0, corners of the wrong shape, or for a point foot.
    """

    frame: str
    _: KW_ONLY
    point: bool = False
    friction: float | None = None
    sole: Array | None = None

    def __post_init__(self) -> None:
        validation.check_type(str, frame=self.frame)
        vars(self).update(point=validation.flag(f"point of {self.frame}", self.point))
        if self.friction is not None:
            friction = validation.number(f"friction under {self.frame}", self.friction, at_least=0)
            vars(self).update(friction=friction)
        if self.sole is None:
            return
        corners = validation.floats(f"sole of {self.frame}", self.sole, unit="m")
        if self.point or corners.ndim != 2 or corners.shape[1] != 3 or len(corners) < 3:
            raise InvalidInput(
                f"sole of {self.frame} has shape {corners.shape}: it must be (k, 3), the corners "
                "of a flat foot, three or more"
            )
        extent = np.linalg.svd(corners - corners.mean(axis=0), compute_uv=False)
        if not extent[1] > 1e-6 * extent[0]:  # least width of a sole, as a fraction of its length
            raise InvalidInput(
                f"sole of {self.frame} is {corners.tolist()}: its corners must span an area"
            )
        corners.setflags(write=False)
        vars(self).update(sole=corners)

    @property
    def size(self) -> int:
        """Number of velocity components that are 0: 3 of a point foot, 6 of a flat foot."""
        return 3 if self.point else 6


def read_support(entry: str | Mapping[str, Any]) -> Support:
    """Return the support of a frame, or of a table with the attributes of a `Support`."""
    if not isinstance(entry, Mapping):
        return Support(entry)
    keys = [attribute.name for attribute in fields(Support)]
    if "frame" not in entry or not entry.keys() <= set(keys):
        raise InvalidInput(
            f"support has {', '.join(entry) or 'no keys'}: it needs frame, and may have "
            f"{', '.join(keys[1:])}"
        )
    return Support(**entry)


class ConstraintBlock(NamedTuple):
    """Where the impulse of one support or loop acts: on `joint`, and minus it on `other`.

    Attributes:
        rows: of the block in A.
        joint, other: joints of the model; `other` is 0 for the ground.
        rotations_joint_world: from world axes to the axes of `joint` and of `other`, `(3, 3)` each.
        rotation_world_frame: to world axes from the axes of the support or the loop's first frame.
        levers: from the joint's origin to the point, for each joint [m, axes of the joint].
    """

    rows: slice
    joint: int
    other: int
    rotations_joint_world: tuple[Array, Array]
    rotation_world_frame: Array
    levers: tuple[Array, Array]


class Constraints:
    """The supports, loops, mimic joints and stiff joints of a leg, looked up in its model.

    Each has as many rows of A as its entry of `sizes`, 1 of a mimic or stiff joint, from its
    entry of `starts` on; `size` is the number of all. `loop_rows`, `gear_rows` and `stiff_rows`
    are slices of A, `stiff_joints` indices in v, `names` for messages. Raises `InvalidInput`
    for an unknown frame, one given twice, a support on the kicking limb or on the base, or a
    loop in one body.
    """

    def __init__(
        self,
        model: Any,
        contact_joint: int,
        supports: tuple[Support, ...],
        loops: tuple[tuple[str, str], ...],
        gears: Gears,
        stiff_joints: Mapping[str, int],
    ) -> None:
        self.supports, self.loops, self.gears = supports, loops, gears
        self.stiff_joints = list(stiff_joints.values())
        named = [frozenset((s.frame,)) for s in supports] + [frozenset(loop) for loop in loops]
        for ends in named:
            if named.count(ends) > 1:
                raise InvalidInput(f"{' - '.join(sorted(ends))} is constrained twice: name it once")
        supported = [_place(model, support.frame) for support in supports]
        self._looped = [(_place(model, a), _place(model, b)) for a, b in loops]
        # of each block the frame where it starts, None for the ground, and the one where it ends
        self._ends = [*((None, place) for place in supported), *self._looped]
        for support, place in zip(supports, supported, strict=True):
            _check_stance(model, support.frame, place.joint, contact_joint)
        for (a, b), (start, end) in zip(loops, self._looped, strict=True):
            if start.joint == end.joint:
                raise InvalidInput(f"loop {a} - {b} joins a body to itself: name two bodies")
        self.sizes = [support.size for support in supports] + [3] * len(loops)
        self.sizes += [1] * (len(gears.mimics) + len(stiff_joints))
        self.starts = [0, *accumulate(self.sizes)]
        self.size = self.starts[-1]
        first, last = self.starts[len(named)], self.size - len(stiff_joints)
        self.loop_rows = slice(self.starts[len(supports)], first)
        self.gear_rows, self.stiff_rows = slice(first, last), slice(last, self.size)
        self.names = [s.frame for s in supports] + [f"{a} - {b}" for a, b in loops]
        self.names += [f"{mimic.joint}, which mimics {mimic.driver}" for mimic in gears.mimics]
        self.names += [f"{joint}, which is stiff" for joint in stiff_joints]

    def rows(self, model: Any, data: Any, q: Array) -> tuple[Array, list[ConstraintBlock]]:
        """Return A with A v = 0, shape `(size, nv)` [world axes], and where its impulses act.

        Kinematics must have run at `q`. Rows of a support are the velocity of its frame, linear
        then angular; of a loop, of its second frame's origin relative to the first's. Mimic joints
        and stiff joints have no block: their impulses are along joint axes.
        """
        matrix, blocks, span = np.empty((self.size, model.nv)), [], slice(0, 0)
        for (start, end), size in zip(self._ends, self.sizes, strict=False):
            span = slice(span.stop, span.stop + size)
            local, rotation, origin = _motion(model, data, q, end)
            for row in range(0, size, 3):  # linear, then angular
                matrix[span][row : row + 3] = rotation.dot(local[row : row + 3])
            turn, axes = end.rotation_joint_frame.dot(rotation.T), rotation
            joints, turns, levers = (end.joint, 0), (turn, turn), (end.lever, end.lever)
            if start is not None:
                other, axes, start_origin = _motion(model, data, q, start)
                # across a gap, both move as their bodies do at the second origin
                carried = axes @ other[:3] - pin.skew(origin - start_origin) @ (axes @ other[3:])
                matrix[span] -= carried
                joints, levers = (end.joint, start.joint), (end.lever, start.lever)
                turns = turn, start.rotation_joint_frame @ axes.T
            blocks.append(ConstraintBlock(span, *joints, turns, axes, levers))
        matrix[self.gear_rows] = self.gears.rows(q)
        if self.stiff_joints:
            matrix[self.stiff_rows] = 0.0
            matrix[range(self.stiff_rows.start, self.size), self.stiff_joints] = 1.0
        return matrix, blocks

    def bias(self, model: Any, data: Any, q: Array, v: Array) -> Array:
        r"""Return :math:`\dot A v`, shape `(size,)` [m/s2, rad/s2]; it runs the kinematics."""
        pin.forwardKinematics(model, data, q, v, np.zeros(model.nv))

        def acceleration(place: _Place) -> Array:
            pin.updateFramePlacement(model, data, place.frame)
            rates = pin.getFrameClassicalAcceleration(
                model, data, place.frame, pin.LOCAL_WORLD_ALIGNED
            )
            return np.asarray(rates.vector)

        result = np.zeros(self.size)
        for (start, end), row, size in zip(self._ends, self.starts, self.sizes, strict=False):
            result[row : row + size] = acceleration(end)[:size]
            if start is not None:
                result[row : row + size] -= acceleration(start)[:size]
        result[self.gear_rows] = -self.gears.values(q, 2) * v[self.gears.driver_indices] ** 2
        return result

    def gaps(self, model: Any, data: Any) -> Array:
        """Return from the first to the second origin of each loop, shape `(loops, 3)` [m]."""
        for place in (place for pair in self._looped for place in pair):
            pin.updateFramePlacement(model, data, place.frame)
        ends = [[data.oMf[place.frame].translation for place in pair] for pair in self._looped]
        return np.array([second - first for first, second in ends]).reshape(-1, 3)

    def check_closed(self, model: Any, data: Any, where: object) -> None:
        """Raise `InvalidInput` if a loop is open, with its gap."""
        for (a, b), gap in zip(self.loops, self.gaps(model, data), strict=True):
            width = float(np.linalg.norm(gap))
            if not width <= LOOP_TOLERANCE:
                raise InvalidInput(
                    f"loop {a} - {b} is open by {width:.6g} m in {where!r}: at most "
                    f"{LOOP_TOLERANCE:g} m (Leg.close_loops(q) closes it)"
                )

    def close_loops(self, model: Any, data: Any, q: Array, fixed: Sequence[int]) -> Array:
        """Return the configuration of `Leg.close_loops`; `fixed` are indices in v."""
        between = np.zeros(model.nv)  # 1 for joints between the ends of a loop
        for ends in self._looped:
            first_path, second_path = (set(model.supports[end.joint]) for end in ends)
            for joint in first_path ^ second_path:
                between[model.idx_vs[joint] : model.idx_vs[joint] + model.nvs[joint]] = 1.0
        coupled = self.gears.coupled  # a mimic joint moves as its driver does
        between[coupled[(coupled & (between > 0.0)).any(axis=1)].any(axis=0)] = 1.0
        free = between.copy()
        free[fixed] = 0.0
        free[coupled[coupled[:, fixed].any(axis=1)].any(axis=0)] = 0.0
        closed, gaps, rank = self._newton(model, data, q, free)
        if not _is_open(gaps):
            return closed
        away = pin.difference(model, pin.neutral(model), q) * between
        followed, lead = self.gears.follow(pin.integrate(model, q, -away)), away * (1.0 - free)
        stages = max(1, math.ceil(float(np.abs(lead).max()) / 0.1))  # of 0.1 rad or m at most
        for _ in range(stages):
            followed = self.gears.follow(pin.integrate(model, followed, lead / stages))
            followed, led, _ = self._newton(model, data, followed, free)
            if _is_open(led):
                break
        else:
            return np.asarray(followed)
        widths = np.linalg.norm(gaps, axis=1)
        a, b = self.loops[int(np.argmax(widths))]
        raise InvalidInput(
            f"loop {a} - {b} stays open by {widths.max():.6g} m: from there the loops cannot be "
            f"closed (rank {rank} of {gaps.size} rows)"
        )

    def _newton(self, model: Any, data: Any, q: Array, free: Array) -> tuple[Array, Array, int]:
        """Return the best configuration of Newton's method, its gaps, and the last step's rank."""
        best, narrowest, rank = q, np.full((len(self.loops), 3), np.inf), 0
        for _ in range(50):
            pin.forwardKinematics(model, data, q)
            gaps = self.gaps(model, data)
            if np.abs(gaps).max() < np.abs(narrowest).max():
                best, narrowest = q, gaps
            elif not _is_open(narrowest):  # as narrow as rounding allows
                break
            rows = self.rows(model, data, q)[0][self.loop_rows.start : self.stiff_rows.start]
            wanted = np.concatenate([-gaps.ravel(), np.zeros(len(self.gears.mimics))])
            step, _, step_rank, _ = np.linalg.lstsq(rows * free, wanted, rcond=1e-9)
            step, rank = step * free, int(step_rank)
            longest = float(np.abs(step).max())
            step *= 0.5 / longest if longest > 0.5 else 1.0
            q = self.gears.follow(pin.integrate(model, q, step))
        return np.asarray(best), narrowest, rank


class ConstraintProjector(ReadOnlyArrays):
    r"""Projects on the velocities with A v = 0, orthogonally in the metric of inertia.

    With :math:`M = L L^T` and :math:`W = L^{-1} A^T = Q R`, a velocity :math:`L^{-T} w` satisfies
    the constraints if :math:`Q^T w = 0`, and :math:`w - Q Q^T w` is its projection.

    Attributes:
        constraints: of the leg.
        rows: A, shape `(size, nv)` [world axes].
        blocks: where each support's and loop's impulse acts; mimic joints have none.
        rank: of A; below its number of rows, some are redundant.
        independent: indices of as many rows as the rank.
    """

    def __init__(
        self,
        constraints: Constraints,
        rows: Array,
        blocks: list[ConstraintBlock],
        whitened: Array,
        where: object,
    ) -> None:
        self.constraints, self.rows, self.blocks = constraints, rows, blocks
        self._whitened = whitened
        lengths = np.sqrt(np.einsum("ij,ij->j", whitened, whitened))
        self._length = np.where(lengths > RANK_TOLERANCE * lengths.max(), lengths, math.inf)
        packed, pivots, tau, _, _ = lapack.dgeqp3(whitened / self._length)
        steps = min(whitened.shape)
        self.rank = sum(abs(entry) > RANK_TOLERANCE for entry in packed.diagonal().tolist())
        self.independent = pivots[: self.rank] - 1
        self._factor = packed[: self.rank, : self.rank]
        basis, _, _ = lapack.dorgqr(packed[:, :steps], tau)
        self._basis = basis[:, : self.rank]
        if self.rank == rows.shape[1]:
            raise InvalidInput(
                f"{listed(constraints.names)} contradict each other: together they have rank "
                f"{self.rank} of {len(rows)} rows, and leave none of {rows.shape[1]} degrees of "
                f"freedom in {where!r}"
            )
        for array in (rows, self._basis, self.independent):
            array.setflags(write=False)

    def project(self, whitened: Array) -> Array:
        """Return w - Q Q^T w of whitened velocities or impulses w, as columns if several."""
        return np.asarray(whitened - self._basis.dot(self._basis.T.dot(whitened)))

    def impulses(self, whitened: Array) -> Array:
        """Return the constraints' impulses after L^-1 times an impulse, shape `(size,)`."""
        blocked = self._basis.T.dot(whitened)
        if self.rank == len(self.rows):
            scaled = blas.dtrsv(self._factor, -blocked)
            answer = np.empty(self.rank)
            answer[self.independent] = scaled
            return np.asarray(answer / self._length)
        return np.asarray(self._least_impulses @ -blocked)

    def correction(self, rates: Array) -> Array:
        """Return the shortest whitened velocity w with W^T w = rates, shape `(size,)`."""
        scaled = (rates / self._length)[self.independent]
        return np.asarray(self._basis.dot(blas.dtrsv(self._factor, scaled, trans=1)))

    def find_violation(self, v: Array) -> tuple[str, float, str] | None:
        """Return the constraint that a velocity breaks most, speed and unit; None if rounding."""
        speeds, fastest = abs(self.rows.dot(v)).tolist(), max(map(abs, v.tolist()))
        reaches, starts = abs(self.rows).sum(axis=1).tolist(), self.constraints.starts
        # of the three parts of a velocity, one alone may be rounding
        triples = [(k, min(k + 3, b)) for a, b in pairwise(starts) for k in range(a, b, 3)]
        if all(max(speeds[a:b]) <= 1e-9 * max(reaches[a:b]) * fastest for a, b in triples):
            return None
        worst = speeds.index(max(speeds))
        broken = next(i for i, end in enumerate(starts[1:]) if worst < end)
        unit = "m/s" if worst - starts[broken] < 3 else "rad/s"
        if self.constraints.sizes[broken] == 1:
            unit = "rad/s or m/s"
        return self.constraints.names[broken], speeds[worst], unit

    @cached_property
    def _least_impulses(self) -> Array:
        """From Q^T w to the smallest impulses that give it: W's pseudo-inverse on its range."""
        return np.asarray(np.linalg.pinv(self._basis.T @ self._whitened, rcond=RANK_TOLERANCE))


def find_open_loops(model: Any, data: Any) -> list[tuple[str, str]]:
    """Return the pairs of frames that look like the two ends of a loop which was cut open.

    They are links without mass, fixed to their bodies, at one place while all joints are at 0;
    neither body carries the other.
    """
    frames = list(model.frames)
    carrying = {int(frame.parentFrame) for frame in frames}
    ends = [
        number
        for number, frame in enumerate(frames)
        if frame.type == pin.FrameType.BODY
        and number not in carrying
        and frames[frame.parentFrame].type == pin.FrameType.FIXED_JOINT
        and frame.inertia.mass == frames[frame.parentFrame].inertia.mass == 0.0
    ]
    pin.forwardKinematics(model, data, pin.neutral(model))
    origins = [pin.updateFramePlacement(model, data, end).translation.copy() for end in ends]
    pairs = []
    for (i, first), (j, second) in combinations(zip(ends, origins, strict=True), 2):
        # largest distance of frames that coincide [m]: a URDF has about as many digits
        if np.linalg.norm(first - second) <= 1e-6:
            joints = [int(frames[end].parentJoint) for end in (i, j)]
            if not any(a in list(model.supports[b]) for a, b in (joints, joints[::-1])):
                pairs.append((str(frames[i].name), str(frames[j].name)))
    return pairs


class _Place(NamedTuple):
    """A frame, the rotation from its axes to its joint's, and its origin in the joint's."""

    frame: int
    joint: int
    rotation_joint_frame: Array
    lever: Array


def _place(model: Any, name: str) -> _Place:
    number = frame_id(model, name)
    joint, pose = int(model.frames[number].parentJoint), model.frames[number].placement
    return _Place(number, joint, pose.rotation.copy(), pose.translation.copy())


def _motion(model: Any, data: Any, q: Array, place: _Place) -> tuple[Array, Array, Array]:
    """Return a frame's Jacobian in its own axes, its rotation to world axes, and its origin."""
    placement = pin.updateFramePlacement(model, data, place.frame)
    rotation, origin = placement.rotation.copy(), placement.translation.copy()
    local = pin.computeFrameJacobian(model, data, q, place.frame, pin.LOCAL).reshape(6, model.nv)
    return local, rotation, origin


def _is_open(gaps: Array) -> bool:
    return bool(np.abs(gaps).max() > LOOP_TOLERANCE / 10)


def _check_stance(model: Any, name: str, joint: int, contact_joint: int) -> None:
    if joint == 0:
        raise InvalidInput(f"support {name} is fixed to the base: it stands already")
    # a floating base is on every path, and no limb
    base = 1 if has_floating_base(model) else 0
    below = joint != base and joint in list(model.supports[contact_joint])
    above = contact_joint != base and contact_joint in list(model.supports[joint])
    if joint == contact_joint or below or above:
        raise InvalidInput(
            f"support {name} is on the kicking limb, which moves "
            f"{model.names[contact_joint]}: name a frame of another limb"
        )
