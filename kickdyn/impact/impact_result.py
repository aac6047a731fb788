"""The result of a strike, with the residuals that prove it."""

import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from kickdyn.ball import BallState
from kickdyn.core import validation
from kickdyn.core.mechanics import largest
from kickdyn.core.representation import (
    ROUNDING,
    Printed,
    Row,
    format_value,
    freeze_arrays,
    stored,
    warned,
)
from kickdyn.core.validation import Array, ArrayLike
from kickdyn.errors import InvalidInput
from kickdyn.impact.approach import AfterApproach, Approach
from kickdyn.impact.contact_problem import Solution
from kickdyn.impact.force_model import LONGEST_CONTACT, SHORTEST_CONTACT
from kickdyn.impact.laws import LAWS, names_of_laws
from kickdyn.impact.leg_response import Footing, LegResponse, axis_projectors, footing, leg_response
from kickdyn.impact.sensitivity import Sensitivity
from kickdyn.impact.uncertainty import (
    Rounding,
    Uncertainty,
    digits_left,
    estimate_rounding,
    uncertainty,
)
from kickdyn.robot.constraints import ConstraintBlock, Support

RESIDUAL_ROUNDING = 1e-14
"""Residuals below it are rounding, whose digits differ from processor to processor."""


@dataclass(frozen=True, eq=False, repr=False)
class Impact(AfterApproach):
    """The result of a strike, with residuals by which it can be checked.

    Motion after the impact is computed when it is first read, and then stored.

    Attributes:
        approach: leg and ball just before the impact.
        law: name of the impact law.
        solution: the impulse that the law returned.
        response: response of the leg, where it was computed together with the impulse; None if
            it follows from the impulse.
    """

    approach: Approach
    law: str
    solution: Solution
    response: LegResponse | None = field(default=None, kw_only=True)
    _ball_after: BallState | None = field(default=None, kw_only=True)

    @stored
    def ball_after(self) -> BallState:
        """State of the ball just after the impact."""
        if self._ball_after is not None:
            return self._ball_after
        impulses, tangential = self.solution.impulses, self.solution.tangential_impulses
        return self.approach.ball_body().after(self.ball_before, impulses, tangential)

    @property
    def impulse(self) -> Array:
        """Impulse on the ball, shape `(3,)` [N s, world frame]; the leg takes the opposite."""
        return np.asarray(self.solution.impulses[0])

    @property
    def energy_lost(self) -> float:
        """Energy lost to restitution and friction [J]; negative where the law creates energy.

        It is the kinetic energy that leg and ball lose, plus `motor_work`.
        """
        return self.solution.energy_lost

    @property
    def motor_work(self) -> float:
        """Work of the motors that keep the velocities of stiff joints [J]; 0 without any."""
        projector = self.posture.constraint_projector
        if projector is None:
            return 0.0
        rows, joints = projector.constraints.stiff_rows, projector.constraints.stiff_joints
        return float(self.constraint_impulses[rows] @ self.v_before[joints])

    @property
    def sticking(self) -> bool:
        """Whether friction can stop the sliding of the contact points; False without friction.

        By `newton` and `stronge` the points then separate without sliding; `paper` leaves the
        ball's rotation out, so that they slide all the same.
        """
        return self.solution.sticking[0]

    @cached_property
    def effective_mass(self) -> float:
        r"""Mass :math:`1 / (n^T J M^{-1} J^T n)` of the leg along the normal [kg], or inf."""
        return self.posture.effective_mass(self.contact.normal)

    @property
    def free_effective_mass(self) -> float:
        """Effective mass of the leg if its stiff joints were free [kg], or inf."""
        return self.posture.without_stiff_joints.effective_mass(self.contact.normal)

    @property
    def drive_limit(self) -> str:
        """Limit in which the impact has the drives of joints, as in `effective_mass_limits`.

        It is `with rotors` or `without rotors` of the free joints, with the names of stiff ones. A
        drive between free and stiff takes a contact that takes time, `collide`.
        """
        leg = self.posture.leg
        free = "with rotors" if leg.workspace.model.armature.any() else "without rotors"
        return f"{free}{', stiff ' if leg.stiff_joints else ''}{', '.join(leg.stiff_joints)}"

    @stored
    def leg_response(self) -> LegResponse:
        """The response of the leg to the impulse; its parts are attributes of the impact, too."""
        if self.response is not None:
            return self.response
        return leg_response(self.approach.posture, self.approach.v, self.solution.impulses[0])

    @property
    def v_after(self) -> Array:
        """Joint velocity after the impact, shape `(nv,)` [rad/s; m/s for prismatic joints]."""
        return self.leg_response.v_after

    @property
    def joint_impulses(self) -> Array:
        """Impulse of each joint's parent on its child, shape `(njoints, 6)` [N s, N m s].

        Each row has the linear, then the angular impulse, about the joint's origin and in the
        joint's frame; rows are in the order of `leg.joint_names`. The row of a stiff joint includes
        the impulse by which its motor holds.
        """
        return self.leg_response.joint_impulses

    @property
    def constraint_impulses(self) -> Array:
        """Impulses of the constraints, stacked as in `posture.constraint_projector.rows`.

        Those of supports and loops, which `support_impulses` and `loop_impulses` have by name, have
        world axes, impulses of mimic and stiff joints act along the joint [N s, N m s].
        """
        return self.leg_response.constraint_impulses

    @property
    def support_impulses(self) -> dict[str, Array]:
        """Impulse of the ground on each supporting foot, by the name of the support's frame.

        That of a flat foot has the linear, then the angular impulse about the origin of the frame,
        shape `(6,)`; for a point foot it is linear, shape `(3,)` [N s, N m s, world axes].
        """
        impulses = self.constraint_impulses
        return {support.frame: impulses[block.rows] for support, block in self._supports()}

    @property
    def loop_impulses(self) -> dict[tuple[str, str], Array]:
        """Impulse on the second frame of each loop, shape `(3,)` [N s, world axes].

        The impulse on the first frame is the opposite.
        """
        projector, impulses = self.posture.constraint_projector, self.constraint_impulses
        if projector is None:
            return {}
        rows = impulses[projector.constraints.loop_rows].reshape(-1, 3)
        return dict(zip(projector.constraints.loops, rows, strict=True))

    @property
    def footing(self) -> dict[str, Footing]:
        """How each support moves on ground that can push but not pull; see `Footing`.

        Where a support does not stand, `unilateral_strike` computes what happens.
        """
        impulses, size = self.constraint_impulses, math.hypot(*self.impulse)
        return {
            support.frame: footing(support, impulses[block.rows], block.rotation_world_frame, size)
            for support, block in self._supports()
        }

    @property
    def restitution_residual(self) -> float:
        r"""Residual :math:`|u_n^+ + e\, u_n^-| / |u_n^-|` of Newton's restitution along the normal.

        It is not 0 with the law `paper`, whose restitution is along the attack direction, and with
        `stronge`, whose restitution is one of work, where these differ from Newton's.
        """
        approach = self.approach
        foot_velocity_after = approach.posture.point_velocity(self.leg_response.v_after)
        relative = self.ball_after.velocity - foot_velocity_after
        separation = float(approach.contact.normal.dot(relative))
        return abs(separation - approach.restitution * approach.speed) / approach.speed

    @property
    def momentum_residual(self) -> float:
        r"""Joint-space momentum that Newton-Euler does not account for, over :math:`\|J\| |p|`."""
        scale = self.posture.jacobian_norm * math.hypot(*self.impulse.tolist())
        return largest(self.leg_response.unbalanced) / scale if scale else 0.0

    @property
    def creates_energy(self) -> bool:
        """Whether the law added energy to leg and ball, beyond rounding.

        Law `newton` can, with friction at an eccentric contact; law `paper` can, through the spin;
        law `stronge` never does.
        """
        surface_speed = self.ball.radius * np.abs(self.ball_before.spin).max()
        speeds = (self.foot_velocity, self.ball_before.velocity, surface_speed)
        fastest = max(float(np.abs(speed).max()) for speed in speeds)
        return bool(self.energy_lost < -1e-12 * float(np.abs(self.impulse).max()) * fastest)

    @property
    def speed_ratio(self) -> float:
        """Speed of the ball after the impact over the foot's before it; inf if the foot rests."""
        foot = math.hypot(*self.foot_velocity)
        return float(self.ball_after.speed) / foot if foot else math.inf

    @property
    def worst_joint(self) -> tuple[str, float]:
        """Name of the joint that transmits the largest linear impulse, and that impulse [N s].

        Of joints in one point, which transmit the same, it is the first.
        """
        sizes = np.linalg.norm(self.joint_impulses[:, :3], axis=1)
        worst = int(np.argmax(sizes >= (1.0 - ROUNDING) * sizes.max()))
        return self.posture.leg.joint_names[worst], float(sizes[worst])

    @cached_property
    def rounding(self) -> Rounding:
        """Shares of the impulse and of the joints' linear impulses that may be rounding."""
        rounding = estimate_rounding(self.approach, self.solution, self.joint_impulses)
        freeze_arrays(rounding)
        return rounding

    @property
    def digits(self) -> float:
        """Estimate of how many decimal digits of the impulse are correct, 0 to 16.

        Velocities after the impact may have fewer, where they cancel. Few are left for a speed of
        approach near the rounding of its terms, a ball many times heavier than the leg that it
        sticks to, and friction that nearly jams the contact.
        """
        return float(digits_left(self.rounding.impulse))

    @property
    def joint_digits(self) -> Array:
        """Estimate of how many digits of each joint's linear impulse are correct, `(njoints,)`."""
        return digits_left(self.rounding.joints)

    @property
    def warnings(self) -> tuple[str, ...]:
        """A line for each joint outside its range, or faster before the impact than its limit.

        Another line says so where the restitution is used outside its table.
        """
        return self.approach.warnings()

    @validation.check_arguments
    def sensitivity(self, *, of_leg: bool = True) -> Sensitivity:
        """Return the derivatives of this impact by everything that it depends on.

        Args:
            of_leg: whether to include `q`, `v` and `link_mass`, which take most of the time.

        Raises:
            InvalidInput: a law without sensitivities, a support that moves after
                `unilateral_strike`, or a joint whose axes depend on its own angles (universal,
                composite, Euler angles).
        """
        differentiate = LAWS[self.law].differentiate
        if differentiate is None:
            able = names_of_laws("differentiate")
            raise InvalidInput(f"impact law {self.law!r} has no sensitivities: choose {able}")
        slopes: Sensitivity = differentiate(
            self.approach, self.solution, self.ball_after, self.leg_response, of_leg=of_leg
        )
        return slopes

    def uncertainty(self, **spread: ArrayLike) -> Uncertainty:
        """Return the covariances of the results that follow from the covariances of their sources.

        Args:
            **spread: standard deviations by the name of a source
                (`kickdyn.impact.sensitivity.UNITS` has names and units): one number for all of its
                components; one for each, shape `(n,)`; or their covariance, shape `(n, n)`. Sources
                are independent. The deviation of `normal` is the angle by which this direction
                tilts to each side [rad].

        Raises:
            InvalidInput: an unknown source, a wrong shape, a negative or infinite deviation, a
                covariance that is not symmetric and positive semidefinite, or what `sensitivity`
                refuses.

        Example:
            >>> import kickdyn as kd
            >>> posture = kd.Leg.human().posture([0.7, 0.5, -0.3])
            >>> contact = kd.Contact(normal=(2, 0, 1), restitution=0.8)
            >>> impact = kd.strike(posture, [6.6, -14.5, 6.6], kd.Ball(), contact)
            >>> spread = impact.uncertainty(v=0.1, restitution=0.03)
            >>> round(spread.speed, 2)  # standard deviation [m/s]
            0.31
            >>> round(spread.joints["knee"].force_deviation, 3)  # [N s]
            0.046
        """
        return uncertainty(
            self.sensitivity(), self.posture, self.impulse, self.ball_after.velocity,
            self.joint_impulses, spread,
        )  # fmt: skip

    def plot(self, **spread: ArrayLike) -> Any:
        """Return a matplotlib Figure of the linear impulses in the joints, in journal width.

        Args:
            **spread: standard deviations as for `uncertainty`; with them, error bars show one
                standard deviation to each side.

        Raises:
            InvalidInput: what `uncertainty` refuses.
        """
        from kickdyn.core.plot_style import joint_figure

        sizes = np.linalg.norm(self.joint_impulses[:, :3], axis=1).tolist()
        joints = self.uncertainty(**spread).joints if spread else {}
        deviations = {name: joint.force_deviation for name, joint in joints.items()}
        return joint_figure(dict(zip(self.posture.leg.joint_names, sizes, strict=True)), deviations)

    def _supports(self) -> list[tuple[Support, ConstraintBlock]]:
        """Return the leg's supports, each with its rows of the constraints."""
        projector = self.posture.constraint_projector
        if projector is None:
            return []
        return list(zip(projector.constraints.supports, projector.blocks, strict=False))

    def _rows(self) -> Iterable[Row]:
        joint, most = self.worst_joint
        yield "law", self.law + (", sticks" if self.sticking else ""), ""
        if not isinstance(self.contact.restitution, float):
            yield "restitution", self.restitution, ""
        yield "impulse on the ball", self.impulse, "N s"
        yield "effective mass", self.effective_mass, "kg"
        if self.posture.leg.stiff_joints:
            yield "with all joints free", self.free_effective_mass, "kg"
        if self.drive_limit != "without rotors":
            yield "drives", self.drive_limit, ""
        if self.posture.leg.workspace.model.armature.any():
            for limit, mass in self.posture.effective_mass_limits(self.contact.normal).items():
                row = (mass, "kg") if math.isfinite(mass) else ("infinite (base or foot fixed)", "")
                yield f"limit {limit}", *row
        yield "foot before", self.foot_velocity, "m/s"
        yield "ball after", self.ball_after.velocity, "m/s"
        yield "spin after", self.ball_after.spin, "rad/s"
        yield "ball over foot speed", self.speed_ratio, ""
        yield f"worst joint, {joint}", most, "N s"
        yield "energy lost", self.energy_lost, "J"
        if self.posture.leg.stiff_joints:
            yield "work of the motors", self.motor_work, "J"
        residuals = np.array([self.restitution_residual, self.momentum_residual])
        rounding = bool((residuals < RESIDUAL_ROUNDING).all())
        yield "residuals", f"below {RESIDUAL_ROUNDING:g}" if rounding else residuals, ""
        yield "condition", self.posture.condition, ""
        yield "digits at least", math.floor(self.digits), ""
        yield from warned(self.warnings)


@dataclass(frozen=True, eq=False, repr=False)
class JointLoad(Printed):
    """The load of one joint: the impulses of its parent on its child, about its origin in its axes.

    Attributes:
        joint: name of the joint.
        structure: part of the impulse that bearings and links transmit, linear then angular, shape
            `(6,)` [N s, N m s].
        axis: part of the impulse along the degrees of freedom of the joint, shape `(6,)`
            [N s, N m s]. It is 0 in a passive joint but for the inertia of its rotor; in a stiff
            joint it is the impulse of its motor.
        peak_force: peak force of both parts together [N]; None without a contact time.
        peak_moment: peak moment of both parts together [N m]; None without a contact time.
    """

    joint: str
    structure: Array
    axis: Array
    peak_force: float | None
    peak_moment: float | None

    def __str__(self) -> str:
        """Return the linear parts in a line: on the structure, along the axis, and the peak."""
        structure, along = (np.linalg.norm(load[:3]) for load in (self.structure, self.axis))
        axis = f", {format_value(along)} N s along the axis" if along > ROUNDING * structure else ""
        peak = "" if self.peak_force is None else f", peak {format_value(self.peak_force)} N"
        return f"JointLoad({self.joint}: {format_value(float(structure))} N s{axis}{peak})"


@validation.check_arguments
def joint_loads(impact: Impact, contact_time: float | None = None) -> dict[str, JointLoad]:
    r"""Return the load of every joint by name, in the model's order.

    Args:
        impact: an impact by any law.
        contact_time: T [s], 1e-9 to 0.1. With it, the peak of a half-sine pulse is estimated for
            each joint, :math:`\frac{\pi}{2} p / T`. This assumes that all joints feel the pulse at
            once, as rigid bodies do, and that the contact force rises and falls like the force of a
            spring. None estimates no peaks.

    Raises:
        InvalidInput: no impact, or a contact time outside 1e-9 to 0.1 s.

    Example:
        >>> import kickdyn as kd
        >>> posture = kd.Leg.human().posture([0.7, 0.5, -0.3])
        >>> contact = kd.Contact(normal=(2, 0, 1), restitution=0.8)
        >>> impact = kd.strike(posture, [6.6, -14.5, 6.6], kd.Ball(), contact)
        >>> loads = kd.joint_loads(impact, contact_time=0.01)
        >>> round(loads["knee"].peak_force)  # [N]
        389
    """
    per_time = None
    if contact_time is not None:
        time = validation.number(
            "contact time", contact_time,
            at_least=SHORTEST_CONTACT, at_most=LONGEST_CONTACT, unit="s",
        )  # fmt: skip
        per_time = math.pi / 2 / time
    leg, loads = impact.posture.leg, {}
    for name, impulse, projector in zip(
        leg.joint_names, impact.joint_impulses, axis_projectors(impact.posture), strict=True
    ):
        along = projector @ impulse
        force, moment = (
            None if per_time is None else per_time * float(np.linalg.norm(vector))
            for vector in (impulse[:3], impulse[3:])
        )
        loads[name] = JointLoad(name, impulse - along, along, force, moment)
    return loads
