r"""The contact of an inflated ball with a strip of a foot: edges, grip and slip.

The ball stays a sphere of radius R with its mass in the centre. A flat strip of width 2 b presses
out what of the sphere is beyond the plane and over the strip, the volume V. With the pressure p(V),
the forces are those of the potential :math:`\int p\, dV`: :math:`p A` along the normal, on the
area A of the disc over the strip, and :math:`-p\, \partial V / \partial c` across it, where the
strip's edges dent the ball at the distance c of its centre from the middle of the strip. They act
through the centre, because a turned sphere has the same V. The shell that the rim of the disc stops
over the strip loses its momentum there, which turns the ball. `docs/explanation/inflated-ball.md`
derives it and says what was tried; all of it is our own.
"""

import math
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from kickdyn.core import validation
from kickdyn.core.validation import Array, ArrayLike
from kickdyn.errors import InvalidInput
from kickdyn.impact.approach import Approach
from kickdyn.impact.compliant_contact import CompliantContact, Kinematics, Torque
from kickdyn.impact.contact_phases import RESTING, SLIPS, contact_axes
from kickdyn.impact.force_model import GAS_EXPONENT, InflatedForce, compression_work, gauge_pressure
from kickdyn.robot.foot_surfaces import foot_surfaces

STIFFNESS_RATIO = 2.0 / 3.0
r"""Ratio of the tangential to the normal stiffness of incompressible elastic bodies that touch,
:math:`2 (1 - \nu) / (2 - \nu)` at :math:`\nu = 1/2` (Mindlin 1949; Johnson 1985, Eq. 7.43). It is
not measured for an inflated ball."""

NODES, WEIGHTS = (half.tolist() for half in np.polynomial.legendre.leggauss(12))


@dataclass(frozen=True)
class FootPatch:
    """A flat strip of a foot that meets an inflated ball, long enough along itself.

    Args:
        width: across the strip, above 0 [m]; `inf` is a plane.
        offset: of the ball's centre from the middle of the strip at first contact, across it [m].
        across: direction in which the width is measured, shape `(3,)` [world frame]; the part
            across the contact normal counts. None is the level one.
        grip: tangential over normal stiffness of the patch, above 0, see `STIFFNESS_RATIO`.

    Raises:
        InvalidInput: a value outside its range.
    """

    width: float
    offset: float = 0.0
    across: ArrayLike | None = None
    grip: float = STIFFNESS_RATIO

    def __post_init__(self) -> None:
        values: dict[str, object] = {
            "offset": validation.number("patch offset", self.offset, unit="m"),
            "grip": validation.number("patch grip", self.grip, above=0),
        }
        if not (isinstance(self.width, float) and self.width == math.inf):
            values["width"] = validation.number("patch width", self.width, above=0, unit="m")
        if self.across is not None:
            values["across"] = tuple(validation.direction("patch direction", self.across).tolist())
        self.__dict__.update(values)


def patch_of(approach: Approach) -> FootPatch:
    """Return the patch of the surface that a leg kicks with, by the shapes of its foot.

    It is centred on the leg's contact frame, from which the offset of the contact is measured.
    """
    posture, leg = approach.posture, approach.posture.leg
    surfaces = foot_surfaces(leg)
    if leg.frame not in surfaces:
        raise InvalidInput(
            f"model is 'patch': the contact frame {leg.frame} is not a surface of the foot "
            f"({', '.join(surfaces)}): kick_with(leg, surface), or give model=FootPatch(width)"
        )
    sideways = _across(approach.contact.normal, None)
    beside = posture.contact_point - leg.posture(posture.q).with_contact_offset(None).contact_point
    size = surfaces[leg.frame].size
    assert size is not None  # of a surface that was derived
    return FootPatch(float(size[0]), float(sideways @ beside))


def _across(normal: Array, direction: ArrayLike | None) -> Array:
    """Return the unit vector across the strip."""
    chosen = np.cross((0.0, 0.0, 1.0), normal) if direction is None else np.asarray(direction)
    if direction is None and math.hypot(*chosen) < 1e-6:
        chosen = np.array([0.0, 1.0, 0.0])
    along = chosen - (chosen @ normal) * normal
    if math.hypot(*along) < 1e-6:
        raise InvalidInput(f"patch direction is {chosen.tolist()}: it must not be the normal")
    return np.asarray(along / math.hypot(*along))


class Overlap(NamedTuple):
    """What of a sphere is beyond a plane and over a strip of it."""

    volume: float  # V [m3]
    area: float  # A, of the disc over the strip [m2], the slope of V over the deflection
    across: float  # slope of V over the distance c of the centre from the middle [m2]
    area_slopes: tuple[float, float]  # slopes of A over the deflection and over c [m]
    # integrals of 1, x, x^2 and y^2 over the angles of the arcs of the rim over the strip, x across
    # and y along it from the foot of the centre [1, m, m2, m2]
    rim: tuple[float, float, float, float]


NOTHING = Overlap(0.0, 0.0, 0.0, (0.0, 0.0), (0.0, 0.0, 0.0, 0.0))


def overlap(deflection: float, centre: float, radius: float, half: float) -> Overlap:
    """Return the overlap of a sphere and a strip of half a width, at a distance of the centre."""
    square = deflection * (2.0 * radius - deflection)
    if deflection <= 0.0:
        return NOTHING
    a, height = math.sqrt(square), radius - deflection
    low, high = max(-a, -half - centre), min(a, half - centre)
    if low >= high:
        return NOTHING
    first, last = math.asin(low / a), math.asin(high / a)
    angle, sines = last - first, math.sin(2.0 * last) - math.sin(2.0 * first)
    volume = 0.0
    for node, weight in zip(NODES, WEIGHTS, strict=True):
        turn = first + 0.5 * angle * (1.0 + node)
        x, chord = a * math.sin(turn), a * math.cos(turn)
        volume += 0.5 * angle * weight * chord * _segment(chord, x, height, radius)
    edges = [math.sqrt(max(square - x * x, 0.0)) for x in (low, high)]
    dents = [_segment(e, x, height, radius) for e, x in zip(edges, (low, high), strict=True)]
    return Overlap(
        volume,
        square * (angle + 0.5 * sines),
        dents[0] - dents[1],
        (2.0 * height * angle, 2.0 * (edges[0] - edges[1])),
        (
            2.0 * angle, 2.0 * (edges[0] - edges[1]), square * (angle - 0.5 * sines),
            square * (angle + 0.5 * sines),
        ),
    )  # fmt: skip


def _segment(half_chord: float, x: float, height: float, radius: float) -> float:
    """Return the area of the slice of a cap at x, whose chord on the plane is given [m2]."""
    return (radius * radius - x * x) * math.atan2(half_chord, height) - height * half_chord


@dataclass(frozen=True)
class PatchForce:
    """What the forces of a patch follow from."""

    ball: InflatedForce  # pressure, and loss of the shell
    half: float  # half the width of the strip [m]
    shear: float  # tangential stiffness of the patch over its area [N/m3]

    def separation(self, largest: float) -> float:
        """Return 0: the ball keeps no dent."""
        return 0.0


class PatchContact(CompliantContact):
    r"""Leg and ball with a patch: the column has two more entries, the shear of the patch [m].

    The bristles of the patch stick to foot and ball: their mean shear follows the sliding w and
    relaxes as friction reaches its largest size; new area is not sheared yet (a model of Dahl, as
    LuGre's without Stribeck's effect):

    .. math:: f = -k_s A\, \xi, \qquad \dot \xi = w - \frac{k_s A}{\mu N} |w|\, \xi
        - \frac{\max(\dot A, 0)}{A}\, \xi .

    A phase begins and ends by the volume, which `deflection` turns into that of a plane that
    presses out as much.
    """

    def __init__(
        self, approach: Approach, patch: FootPatch, torque: Array | Torque, expected: float,
        tol: float,
    ) -> None:  # fmt: skip
        ball = approach.ball
        is_inflated = approach.contact.restitution == "inflated"
        lossless = InflatedForce.of(ball)
        shell = lossless if is_inflated else InflatedForce(
            ball.mass, ball.radius, lossless.pressure, 0.0, approach.restitution, GAS_EXPONENT
        )  # fmt: skip
        expected_deflection = approach.speed * math.sqrt(approach.reduced_mass() / ball.stiffness)
        shear = patch.grip * lossless.pressure / expected_deflection
        self.patch_force = PatchForce(shell, 0.5 * patch.width, shear)
        self.patch, self.lowest = patch, ball.radius  # height of the centre so far [m]
        reach = 0.5 * patch.width + ball.radius
        if abs(patch.offset) >= reach:
            raise InvalidInput(
                f"patch offset is {patch.offset:g} m: a strip of {patch.width:g} m does not meet a "
                f"ball of radius {ball.radius:g} m; it must be less than {reach:g} in size"
            )
        self._volume = 4.0 / 3.0 * math.pi * ball.radius**3
        super().__init__(approach, self.patch_force, torque, expected, tol)  # type: ignore[arg-type]

    def _arguments(self) -> tuple[Any, ...]:
        return self.approach, self.patch, self._torque, self.expected

    def _set_axes(self, world_axes: Array) -> None:
        normal = self.approach.contact.normal
        super()._set_axes(contact_axes(normal, _across(normal, self.patch.across)))

    def _first_lane(self) -> SimpleNamespace:
        """Return the lane at first contact: in place of the sliding, edges end a phase (2)."""
        lane = super()._first_lane()
        lane.kind[:], lane.along[:] = SLIPS, -1.0
        lane.resting[:] = RESTING * self.tol * self.ball.radius
        lane.rest[:] = math.inf
        return lane

    def start(self) -> Array:
        """Return the first column."""
        return np.concatenate([super().start(), [0.0, 0.0]])

    def scales(self) -> Array:
        """Return the scale of each entry of a column, for absolute tolerances."""
        return np.concatenate([super().scales(), [self.approach.speed * self.expected] * 2])

    def begin_phase(self, which: int) -> bool:
        """Begin the phase after an end of one: the disc may have crossed an edge of the strip."""
        lane = self.lane
        if which < 2:
            return super().begin_phase(which)
        margins = self._margins
        least = max(min(margins), 0.0) + 1e-9 * self.ball.radius  # both, where it is in the middle
        for k, margin in enumerate(margins):
            lane.along[k, 0] *= -1.0 if margin <= least else 1.0
        return False

    def _edge_margins(self, contact: Kinematics, lane: Any) -> tuple[float, float]:
        """Return the values that are 0 where the rim of the disc crosses an edge of the strip.

        The forces are smooth between. `along` is 1 for an edge that cuts the disc, else -1.
        """
        radius, half = self.ball.radius, self.patch_force.half
        square, beside = radius**2 - contact.height**2, self._beside(contact)
        low, high = lane.along[:, 0].tolist()
        return (
            low * (square - (half + beside) ** 2) / radius,
            high * (square - (half - beside) ** 2) / radius,
        )

    def _beside(self, contact: Kinematics) -> float:
        """Return the distance of the ball's centre from the middle of the strip [m]."""
        return float(self.patch.offset + contact.point[0] - self._arm[0])

    def overlap(self, contact: Kinematics) -> Overlap:
        """Return the overlap of ball and strip."""
        radius, beside = self.ball.radius, self._beside(contact)
        return overlap(radius - contact.height, beside, radius, self.patch_force.half)

    def deflection(self, contact: Kinematics) -> float:
        """Return the deflection by a plane that presses out the same volume [m].

        It is negative where they are apart.
        """
        volume = self.overlap(contact).volume
        if volume <= 0.0:
            return min(self.ball.radius - contact.height, -1e-12 * self.ball.radius)
        turn = math.acos(max(1.0 - 2.0 * volume / self._volume, -1.0))
        return self.ball.radius * (1.0 + 2.0 * math.cos((2.0 * math.pi - turn) / 3.0))

    def flattened(self, y: Array) -> float:
        """Return the depth of the plane of the strip in the sphere [m]."""
        return self.ball.radius - self.kinematics(self.state(y)).height

    def _growth(self, contact: Kinematics, shape: Overlap) -> float:
        """Return the rate of the volume [m3/s] over the area [m2]."""
        closing = -contact.relative[2]
        if shape.area == 0.0:  # before the strip touches
            return closing
        return closing + shape.across / shape.area * self._rate_across(contact)

    def _rate_across(self, contact: Kinematics) -> float:
        """Return the rate of the distance of the centre from the middle of the strip [m/s]."""
        _, ball_spin, _, spin = contact.motion
        return contact.relative[0] + contact.height * (ball_spin[1] - spin[1])

    def evaluate(self, t: float, y: Array, lane: Any) -> tuple[Array, Array]:
        """Return the derivative of a column and the force on the ball; fill in the lane."""
        state = self.state(y)
        contact = self.kinematics(state)
        shape, law, w3 = self.overlap(contact), self.patch_force, contact.relative[2]
        shell, height, largest = law.ball, contact.height, float(lane.largest[0])
        self.lowest = min(self.lowest, height)
        share = 1.0 if largest == 0.0 else shell.shell_restitution**2
        pressure = gauge_pressure(shape.volume / self._volume, shell.pressure, shell.gas_exponent)
        size, edge = share * pressure * shape.area, -share * pressure * shape.across
        lost, growth = 0.0, self._growth(contact, shape)
        if largest == 0.0 and shape.area > 0.0:
            lost = (1.0 - shell.shell_restitution**2) * pressure * growth * shape.area
        stopped, moment1, moment2 = self._stopped_shell(contact, shape)
        _, ball_spin, _, spin = contact.motion
        lost -= stopped * w3
        lost -= moment1 * (ball_spin[0] - spin[0]) + moment2 * (ball_spin[1] - spin[1])
        size += stopped
        (f1, f2), sheared, rubbed = self._bristles(contact, shape, size, y[-2:])
        lost += rubbed
        torque = self._torque_at(t, state)
        inertia, acting = self._acting(state, contact, torque)
        local = pin.computeJointJacobian(self.model, self.data, state.q, self.leg.contact_joint)
        about = self._axes[:, :2].dot((moment1, moment2 + height * edge))
        acting[:, 3] += acting[:, :3].dot((-f1 - edge, -f2, -size)) - local[3:].T.dot(about)
        total = acting[:, 3].copy()
        acceleration = self._response(state, inertia, acting)[:, 3]
        pushed = None
        if self.leg.constraints is not None:
            pushed = inertia.dot(acceleration) - total
        forces = contact.axes.dot(
            ((f1 + edge, height * f2 + moment1), (f2, -height * f1 + moment2), (size, 0.0))
        ).T
        lane.height[0], lane.deflection[0] = height, self.deflection(contact)
        lane.sliding[:, 0] = contact.relative
        lane.ends[0, 0] = growth if largest == 0.0 else lane.deflection[0]
        # the volume may still grow by the error of the time at which it stops growing
        beyond = largest * (1.0 + 1e-9) - lane.deflection[0]
        lane.ends[1, 0] = beyond if largest > 0.0 else math.inf
        self._margins = self._edge_margins(contact, lane)
        lane.ends[2, 0] = min(self._margins)
        rates = self._rates(state, acceleration, forces, lost, (torque, pushed))
        return np.concatenate([rates, sheared]), forces[0]

    def _stopped_shell(self, contact: Kinematics, shape: Overlap) -> tuple[float, float, float]:
        """Return force and moments of the shell that the rim of the disc stops [N, N m]."""
        shell, w3 = self.patch_force.ball, contact.relative[2]
        _, ball_spin, _, spin = contact.motion
        turn1, turn2 = ball_spin[0] - spin[0], ball_spin[1] - spin[1]
        angle, x, xx, yy = shape.rim
        flux = shell.shell_share * self.ball.mass / (4.0 * math.pi * self.ball.radius)
        flux *= max(-w3, 0.0)
        if turn2 * x <= w3 * angle:  # the shell at the rim recedes
            flux = 0.0
        return flux * (-w3 * angle + turn2 * x), -flux * turn1 * yy, -flux * (turn2 * xx - w3 * x)

    def _bristles(
        self, contact: Kinematics, shape: Overlap, size: float, shear: Array
    ) -> tuple[tuple[float, float], tuple[float, float], float]:
        """Return friction on the ball [N], rate of the shear [m/s] and power lost [W]."""
        largest = self.approach.contact.friction * size
        if largest <= 0.0 or shape.area <= 0.0:
            return (0.0, 0.0), (0.0, 0.0), 0.0
        (w1, w2, w3), (s1, s2) = contact.relative, shear.tolist()
        stiffness = self.patch_force.shear * shape.area
        slopes = shape.area_slopes
        growth = slopes[1] * self._rate_across(contact) - slopes[0] * w3
        if s1 == 0.0 == s2:  # as the contact begins, half of the shear is that of new area
            return (0.0, 0.0), (0.5 * w1, 0.5 * w2), 0.0
        relaxing = math.hypot(w1, w2) * stiffness / largest
        fading = relaxing + max(growth, 0.0) / shape.area
        squared = self.patch_force.shear * (s1 * s1 + s2 * s2)
        lost = squared * (shape.area * relaxing + 0.5 * abs(growth))
        return (
            (-stiffness * s1, -stiffness * s2), (w1 - fading * s1, w2 - fading * s2), lost,
        )  # fmt: skip

    def energy(self, y: Array, largest: float) -> float:
        """Return kinetic and potential energy of leg, ball, air and bristles [J]."""
        shape, shell = self.overlap(self.kinematics(self.state(y))), self.patch_force.ball
        missing = shape.volume / self._volume
        work = compression_work(missing, shell.pressure, shell.gas_exponent)
        stored = shell.shell_restitution**2 * self._volume * work
        sheared = 0.5 * self.patch_force.shear * shape.area * float(y[-2:] @ y[-2:])
        return self.energy_of(self.state(y)) + stored + sheared
