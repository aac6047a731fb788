"""Uncertainty of an impact: covariances of its sources, propagated to its results."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from kickdyn.core import validation
from kickdyn.core.representation import ROUNDING, Printed, ReadOnlyArrays
from kickdyn.core.validation import Array, ArrayLike, length, read_only
from kickdyn.errors import InvalidInput
from kickdyn.impact.approach import EPS, Approach
from kickdyn.impact.contact_problem import Solution
from kickdyn.impact.leg_response import (
    NO_CONSTRAINTS,
    axis_projectors,
    joint_impulses,
    leg_response,
)
from kickdyn.impact.sensitivity import UNITS, Branch, Sensitivity, impulse_by_velocity
from kickdyn.restitution import restitution_slope
from kickdyn.robot.leg import Posture

MAX_SPREAD = 1e100
"""Above it, variances would leave double precision."""

MAX_ANGLE_SPREAD = 1.0
"""Largest standard deviation of an angle [rad]: covariances describe small changes."""

SHOWN_JOINTS = 6
"""Number of joints in the table, those with the largest impulses."""

UNIT_OF = {
    "impulse_size": "N s",
    "speed": "m/s",
    "impulse": "N s",
    "velocity": "m/s",
    "spin": "rad/s",
}
"""Every result and its unit."""

COLUMNS = {
    "impulse_size": "impulse size",
    "speed": "ball speed",
    "velocity": "velocity vector",
    "spin": "spin vector",
}
"""Results in the table, and their titles."""


@dataclass(frozen=True, eq=False)
class JointUncertainty(ReadOnlyArrays):
    r"""Uncertainty of the impulse and of the load of one joint, as `Impact.joint_impulses` has it.

    Attributes:
        force: size of the linear impulse [N s].
        force_deviation: its standard deviation [N s]. Peak forces of `joint_loads` have the same
            relative deviation, at a contact time that is certain.
        moment: size of the angular impulse [N m s].
        moment_deviation: its standard deviation [N m s]; where the size is 0, the root of the trace
            of the covariance matrix of the vector.
        impulse: covariance of the impulse, linear then angular, shape `(6, 6)`
            [N s, N m s, axes of the joint].
        structure, axis: covariances of the two parts of `JointLoad`, each of shape `(6, 6)`.
        by_source: for each source, the standard deviation of the size of the linear impulse if this
            source were the only one [N s].
    """

    force: float
    force_deviation: float
    moment: float
    moment_deviation: float
    impulse: Array
    structure: Array
    axis: Array
    by_source: Mapping[str, float]


@dataclass(frozen=True, eq=False, repr=False)
class Uncertainty(Printed):
    r"""Covariances of an impact's results, and the contribution of each source to them.

    To first order, :math:`\Sigma_y = \sum_x J_x \Sigma_x J_x^T` over independent sources x (JCGM
    100:2008, 5.1 and 5.2). `print` shows these contributions as a table, the uncertainty budget.

    Attributes:
        impulse: covariance of the impulse on the ball, shape `(3, 3)` [N2 s2, world frame].
        velocity: covariance of the velocity of the ball after the impact, shape `(3, 3)`
            [m2/s2, world frame].
        spin: covariance of the spin of the ball after the impact, shape `(3, 3)`
            [rad2/s2, world frame].
        impulse_size: standard deviation of the length of the impulse vector [N s].
        speed: standard deviation of the speed of the ball after the impact [m/s]. This one and
            `impulse_size` leave out what only rotates the vector. For a ball brought to rest it is
            the root of the trace of its covariance.
        joints: uncertainty of the impulse and load of each joint, by name.
        by_source: for each source, the covariance of every result if this source were the only one;
            for `impulse_size` and `speed` they are variances.
        branch: `frictionless`, `stick` or `slip`.
        branch_sigmas: number of standard deviations to the other branch. The first order is valid
            on one branch only: below about 2, the covariances are rough.
    """

    impulse: Array
    velocity: Array
    spin: Array
    impulse_size: float
    speed: float
    joints: Mapping[str, JointUncertainty]
    by_source: Mapping[str, Mapping[str, Array]]
    branch: Branch
    branch_sigmas: float

    def share(self, result: str) -> dict[str, float]:
        """Return the share of each source in the variance of a result; 0 where it is certain.

        Args:
            result: `impulse_size`, `speed`, or a vector, whose variance is the trace of its
                covariance: `impulse`, `velocity` or `spin`; or the name of a joint, for the size of
                its linear impulse.

        Raises:
            InvalidInput: another result.
        """
        if isinstance(result, str) and result in self.joints:
            variances = {name: x**2 for name, x in self.joints[result].by_source.items()}
        elif isinstance(result, str) and result in UNIT_OF:
            variances = {n: float(np.trace(of[result])) for n, of in self.by_source.items()}
        else:
            choices = ", ".join((*UNIT_OF, *self.joints))
            raise InvalidInput(f"result {result!r} is unknown: choose {choices}")
        total = sum(variances.values())
        return {
            name: float(variance / total) if total else 0.0 for name, variance in variances.items()
        }

    def __str__(self) -> str:
        """Return the budget: standard deviation and share of the variance by source."""
        units = "".join(f"{UNIT_OF[result]:>9}{'share':>7}" for result in COLUMNS)
        lines = [
            f"{'':13}" + "".join(f"{title:>16}" for title in COLUMNS.values()),
            f"{'source':13}{units}",
        ]
        shares = {result: self.share(result) for result in COLUMNS}
        deviations = {result: self._deviation(result) for result in COLUMNS}
        for source in self.by_source:
            line = f"{source:13}"
            for result, deviation in deviations.items():
                share = shares[result][source]
                size = math.sqrt(share) * deviation if share > ROUNDING**2 else 0.0
                line += f"{size:9.3g}" + (f"{share:7.1%}" if deviation else f"{'':7}")
            lines.append(line.rstrip())
        all_sources = "".join(f"{deviation:9.3g}{'':7}" for deviation in deviations.values())
        lines.append(f"{'all':13}{all_sources}".rstrip())
        lines.append("standard deviations; for vectors: root of the trace of the covariance matrix")
        if self.branch is not Branch.FRICTIONLESS:
            sticks = self.branch is Branch.STICK
            verb, other = ("sticks", "slipping") if sticks else ("slips", "sticking")
            lines.append(
                f"the contact {verb}; {other} is {self.branch_sigmas:.2g} standard deviations away"
            )
        most = sorted((joint.force for joint in self.joints.values()), reverse=True)[:SHOWN_JOINTS]
        shown = {name: joint for name, joint in self.joints.items() if joint.force >= most[-1]}
        width = max(map(len, shown))
        lines += ["", f"{'joint':{width}}{'impulse N s':>14}{'+-':>9}{'moment N m s':>15}{'+-':>9}"]
        for name, joint in shown.items():
            least = ROUNDING * joint.force  # moments below are rounding
            moments = (x if x > least else 0.0 for x in (joint.moment, joint.moment_deviation))
            lines.append(
                f"{name:{width}}{joint.force:14.4g}{joint.force_deviation:9.3g}"
                "{:15.4g}{:9.3g}".format(*moments)
            )
        if others := len(self.joints) - len(shown):
            lines.append(f"{others} more with smaller impulses: see `joints`")
        return "\n".join(lines)

    def _deviation(self, result: str) -> float:
        """Return the standard deviation of a result; of a vector, the root of the trace."""
        return math.sqrt(sum(float(np.trace(by[result])) for by in self.by_source.values()))


def uncertainty(
    slopes: Sensitivity,
    posture: Posture,
    impulse: Array,
    velocity: Array,
    joint_impulses: Array,
    spread: Mapping[str, ArrayLike],
) -> Uncertainty:
    """Propagate uncertainties of sources through an impact, as `Impact.uncertainty` says.

    The impulse is on the ball [N s], and the velocity the ball's after the impact [m/s], `(3,)`.
    """
    if not spread:
        raise InvalidInput(f"no source is named: choose among {', '.join(UNITS)}")
    unknown = [name for name in spread if name not in UNITS]
    if unknown:
        raise InvalidInput(f"source {unknown[0]!r} is unknown: choose among {', '.join(UNITS)}")
    by_source: dict[str, Mapping[str, Array]] = {}
    joints_by_source: dict[str, Array] = {}
    margin_deviation = 0.0
    for name, value in spread.items():
        margin_slope = slopes.margin_slope[name]
        covariance = source_covariance(name, value, margin_slope.shape[1])
        jacobians = {
            "impulse_size": _size_rows(impulse) @ slopes.impulse[name],
            "speed": _size_rows(velocity) @ slopes.velocity[name],
            "impulse": slopes.impulse[name],
            "velocity": slopes.velocity[name],
            "spin": slopes.spin[name],
        }
        by_source[name] = {
            result: read_only(rows @ covariance @ rows.T) for result, rows in jacobians.items()
        }
        joints = slopes.joint_impulses[name]
        joints_by_source[name] = joints @ covariance @ joints.transpose(0, 2, 1)
        size = float(np.abs(margin_slope).max()) or 1.0  # its square may overflow
        unit = margin_slope / size
        variance = max(float((unit @ covariance @ unit.T)[0, 0]), 0.0)
        margin_deviation = math.hypot(margin_deviation, size * math.sqrt(variance))
    totals = {
        result: read_only(np.sum([results[result] for results in by_source.values()], axis=0))
        for result in UNIT_OF
    }
    sigmas = slopes.margin / margin_deviation if margin_deviation > 0.0 else math.inf
    size, speed = (float(np.sqrt(np.trace(totals.pop(name)))) for name in ("impulse_size", "speed"))
    return Uncertainty(
        **totals, impulse_size=size, speed=speed,
        joints=_joints(posture, joint_impulses, joints_by_source),
        by_source=by_source, branch=slopes.branch,
        branch_sigmas=0.0 if slopes.at_boundary else sigmas,
    )  # fmt: skip


def _joints(
    posture: Posture, joint_impulses: Array, by_source: Mapping[str, Array]
) -> dict[str, JointUncertainty]:
    """Return the uncertainty of each joint from its covariances by source, `(njoints, 6, 6)`."""

    def deviation(vector: Array, covariance: Array, rounding: float = 0.0) -> float:
        rows = _size_rows(vector, rounding)
        return math.sqrt(max(float(np.trace(rows @ covariance @ rows.T)), 0.0))

    answer = {}
    projectors = axis_projectors(posture)
    for k, (name, impulse) in enumerate(zip(posture.leg.joint_names, joint_impulses, strict=True)):
        covariance = np.sum([of_source[k] for of_source in by_source.values()], axis=0)
        axis = projectors[k]
        structure = np.eye(6) - axis
        force = math.hypot(*impulse[:3])
        answer[name] = JointUncertainty(
            force=force,
            force_deviation=deviation(impulse[:3], covariance[:3, :3]),
            moment=math.hypot(*impulse[3:]),
            moment_deviation=deviation(impulse[3:], covariance[3:, 3:], ROUNDING * force),
            impulse=read_only(covariance),
            structure=read_only(structure @ covariance @ structure.T),
            axis=read_only(axis @ covariance @ axis.T),
            by_source={
                source: deviation(impulse[:3], of_source[k, :3, :3])
                for source, of_source in by_source.items()
            },
        )
    return answer


def _size_rows(vector: Array, rounding: float = 0.0) -> Array:
    """Return the derivative of a vector's size by the vector; of 0, by each of its entries.

    A vector that is not longer than `rounding` is 0.
    """
    size = math.hypot(*vector)
    return vector[None] / size if size > rounding else np.eye(3)


def source_covariance(name: str, value: ArrayLike, size: int) -> Array:
    """Return a source's covariance, shape `(size, size)`, or raise `InvalidInput`."""
    array = validation.floats(f"spread of {name}", value, unit=UNITS[name])
    largest = float(np.abs(array).max(initial=0.0))
    if largest > MAX_SPREAD:
        raise InvalidInput(f"spread of {name} is {array.tolist()}: at most {MAX_SPREAD:g}")
    if array.shape == (size, size) and size > 1:
        lowest = float(np.linalg.eigvalsh(array)[0])
        asymmetry = float(np.abs(array - array.T).max())
        if asymmetry > 1e-9 * largest or lowest < -1e-9 * largest:
            raise InvalidInput(
                f"covariance of {name} differs from its transpose by {asymmetry:.3g} and has a "
                f"smallest eigenvalue of {lowest:.3g}: it must be symmetric and positive "
                "semidefinite"
            )
    elif array.shape not in ((), (size,)):
        shapes = "a number" if size == 1 else f"a number, ({size},) or ({size}, {size})"
        raise InvalidInput(f"spread of {name} has shape {array.shape}: it must be {shapes}")
    elif (array < 0).any():
        raise InvalidInput(f"spread of {name} is {array.tolist()}: it must be 0 or more")
    else:
        array = np.eye(size) * array**2
    deviation = math.sqrt(max(array.diagonal().max(), 0.0))
    if UNITS[name] == "rad" and deviation > MAX_ANGLE_SPREAD:
        raise InvalidInput(
            f"spread of {name} is {deviation:g} rad: it must be at most {MAX_ANGLE_SPREAD:g}, "
            "because covariances describe small changes"
        )
    return array


ROUNDINGS = 4.0
"""Number of roundings of each term of a sum; measured, see above."""


class Rounding(NamedTuple):
    """Shares that may be rounding: of the impulse, and of each joint's linear one, `(njoints,)`."""

    impulse: float
    joints: Array


def digits_left(share: float | Array) -> Array:
    """Return the number of digits that a share of rounding leaves, 0 to 16."""
    return np.asarray(np.clip(-np.log10(np.maximum(share, 1e-17)), 0.0, 16.0))


def estimate_rounding(approach: Approach, solution: Solution, joints: Array) -> Rounding:
    r"""Estimate which shares of the impulses are rounding.

    The relative velocity u, the Jacobian and M carry rounding. With the leg's responses to unit
    impulses along contact axes, it changes the velocity after the impact by at most :math:`\delta =
    \Delta G\,|p| + \Delta u`, and this changes the impulse by :math:`|C|\,\delta` with the
    derivative C of the contact law. Joints' impulses have shape `(njoints, 6)` [N s, N m s].
    """
    posture, problem, before = approach.posture, approach.contact_problem(), approach.ball_before
    (contact,) = problem.contacts
    rotations, relative = problem.in_contact_axes()
    (axes,), matrix = rotations, problem.delassus(rotations)
    still = np.zeros(posture.leg.nv)
    responses = [leg_response(posture, still, axis) for axis in axes.T]
    jumps = np.column_stack([response.v_after for response in responses])
    roots, sums = np.sqrt(matrix.diagonal()), np.sqrt(posture.inertia.diagonal()) @ abs(jumps)
    spread = _spread(posture, jumps)
    by_matrices = np.outer(roots, roots) + np.outer(sums, sums)
    matrix_error = np.hypot(by_matrices, spread[:, None] + spread)
    terms = abs(posture.jacobian).dot(abs(approach.v)) + abs(before.velocity)
    terms += abs(posture.transport_velocity)
    error = abs(axes.T).dot(terms) + _spread(posture, approach.v[:, None])
    error[:2] += approach.ball.radius * float(length(before.spin))
    impulse, tangential = solution.impulses[0], solution.tangential_impulses[0]
    p = np.append(axes[:, :2].T @ tangential, contact.normal @ impulse)
    turn = restitution_slope(approach.contact.restitution, approach.speed) * approach.speed
    error = np.hypot(length(matrix_error * p), (1.0 + contact.restitution + abs(turn)) * error)
    sliding = None if solution.sticking[0] else (relative + matrix @ p)[:2]
    slope = impulse_by_velocity(contact.friction, matrix, sliding, p)
    change = ROUNDINGS * EPS * length(slope * error)
    size = max(float(length(p)), np.finfo(float).tiny)  # below, float64 has fewer digits
    transmitted = np.column_stack(
        [length(response.joint_impulses[:, :3]) for response in responses]
    )
    lost = transmitted @ change + _of_joints(posture, impulse, joints)
    sizes = np.maximum(length(joints[:, :3]), np.finfo(float).tiny)
    return Rounding(float(length(change)) / size, lost / sizes)


def _of_joints(posture: Posture, impulse: Array, joints: Array) -> Array:
    """Return the rounding of joints' linear impulses where the impulse has none, `(njoints,)`.

    It shows in the difference between the answers of M and of `pin.aba`.
    """
    share = 32.0 * len(joints) * EPS
    lost = share * float(length(impulse))
    if posture.constraint_projector is not None:
        return np.full(len(joints), lost * posture.rounding_gain)
    jump = posture.solve(-impulse.dot(posture.jacobian))
    other, _ = joint_impulses(posture, jump, -impulse, NO_CONSTRAINTS)
    return np.asarray(lost + 2.0 * length((joints - other)[:, :3]))


def _spread(posture: Posture, velocities: Array) -> Array:
    """Return the sum of the speeds that joints give the foot, however much of it cancels [m/s].

    Velocities of the joints are columns, `(nv, n)`.
    """
    leg, space = posture.leg, posture.leg.workspace
    model, data = space.model, space.data
    pin.forwardKinematics(model, data, posture.q)
    total, reach = np.zeros(velocities.shape[1]), float(length(posture.contact_lever))
    joint = leg.contact_joint
    while joint:
        index = model.idx_vs[joint]
        motion = (
            np.reshape(data.joints[joint].S, (6, -1)) @ velocities[index : index + model.nvs[joint]]
        )
        total += length(motion[:3].T) + reach * length(motion[3:].T)
        reach += float(length(data.liMi[joint].translation))
        joint = model.parents[joint]
    return total
