"""Joints by name: ranges, units, warnings of limits, mimic joints, and configurations."""

import math
from collections.abc import Container, Iterable, Mapping, Sequence
from functools import cached_property
from typing import Any, NamedTuple, Self

import numpy as np
import pinocchio as pin
from numpy.polynomial import Polynomial
from numpy.polynomial.polynomial import polyder, polyval
from numpy.typing import NDArray

from kickdyn.core import validation
from kickdyn.core.validation import Array, ArrayLike, read_only
from kickdyn.errors import InvalidInput
from kickdyn.robot.names import expand_patterns, unknown

LIMIT_TOLERANCE = 1e-6
"""By how much a range may be passed without a warning [rad; m]; a speed limit, as a share of it."""

DEGREES = (
    "every nonzero angle is beyond 2 pi and beyond the joint's range: these look like degrees, and "
    "q is in radians"
)
"""Warning of angles that look like degrees."""


class Mimic(NamedTuple):
    r"""A joint that moves with another, its driver: :math:`q = b + a\,x + c_2 x^2 + c_3 x^3 ...`.

    Attributes:
        joint, driver: names of joints of one degree of freedom whose q is one number; x is the
            driver's.
        multiplier: a [rad or m of the joint, per rad or m of the driver].
        offset: b [rad or m].
        higher: :math:`c_2, c_3, ...`, as of the knee of a muscle model; empty for a gear or a belt.
    """

    joint: str
    driver: str
    multiplier: float
    offset: float
    higher: tuple[float, ...] = ()

    @classmethod
    def of(cls, joint: str, driver: str, polynomial: Polynomial) -> Self:
        """Return the joint that follows a driver by a polynomial of its q."""
        coefficients = np.trim_zeros(polynomial.coef, "b").tolist()
        offset, multiplier, *higher = coefficients + [0.0] * (2 - len(coefficients))
        return cls(joint, driver, multiplier, offset, tuple(higher))

    def value(self, x: Any, order: int = 0) -> Any:
        """Return q at values x of the driver, or its derivative of an order by x."""
        coefficients = np.array([self.offset, self.multiplier, *self.higher])
        return polyval(x, polyder(coefficients, order))


def resolve_mimics(mimics: Iterable[Mimic]) -> tuple[Mimic, ...]:
    """Return mimic joints whose drivers mimic none, or raise `InvalidInput` for a loop of them."""
    resolved, couplings = [], {mimic.joint: mimic for mimic in mimics}
    for joint, (_, driver, *line, higher) in couplings.items():
        polynomial, passed = Polynomial([*line[::-1], *higher]), {joint}
        while driver in couplings:
            if driver in passed:
                raise InvalidInput(f"joints {', '.join(sorted(passed))} mimic each other in a loop")
            passed.add(driver)
            _, driver, *line, higher = couplings[driver]
            polynomial = polynomial(Polynomial([*line[::-1], *higher]))
        resolved.append(Mimic.of(joint, driver, polynomial))
    return tuple(resolved)


class Gears:
    r"""The mimic joints of a model, which move as a gear or a belt between two joints makes them.

    A gear is one more row of the constraints :math:`A v = 0`. It acts on its two joints along their
    axes; forces on other bodies, as of the bearings of a belt, are left out.

    Attributes:
        mimics: as given; no driver is a mimic joint itself.
        coupled: which joints each moves together, shape `(n, nv)`.
    """

    def __init__(self, model: Any, mimics: Sequence[Mimic]) -> None:
        self.mimics = tuple(mimics)
        names = list(model.names)
        pairs = [(names.index(m.joint), names.index(m.driver)) for m in self.mimics]
        self._places = [model.idx_qs[joint] for joint, _ in pairs]
        self._drivers = [model.idx_qs[driver] for _, driver in pairs]
        self.driver_indices = [model.idx_vs[driver] for _, driver in pairs]
        self._indices = [model.idx_vs[joint] for joint, _ in pairs]
        self.coupled = np.zeros((len(pairs), model.nv), dtype=bool)
        numbers = range(len(pairs))
        self.coupled[numbers, self._indices] = self.coupled[numbers, self.driver_indices] = True

    def values(self, q: Array, order: int = 0) -> Array:
        """Return where drivers at q put the joints, or its derivative of an order by the driver."""
        driven = zip(self.mimics, q[self._drivers], strict=True)
        return np.array([mimic.value(x, order) for mimic, x in driven])

    def rows(self, q: Array) -> Array:
        r"""Return a row :math:`\dot q - (dq/dx)\,\dot x = 0` for each joint, shape `(n, nv)`."""
        rows, numbers = np.zeros(self.coupled.shape), range(len(self.mimics))
        rows[numbers, self._indices] = 1.0
        rows[numbers, self.driver_indices] -= self.values(q, 1)
        return rows

    def follow(self, q: Array) -> Array:
        """Return q with the mimic joints where their drivers put them, shape `(nq,)`."""
        followed = np.array(q)
        followed[self._places] = self.values(q)
        return followed

    def check(self, q: Array, named: Container[str] | None = None) -> Array:
        """Return `follow(q)`; raise `InvalidInput` if a mimic joint, of `named`, is elsewhere."""
        followed = self.follow(q)
        for mimic, place in zip(self.mimics, self._places, strict=True):
            # by how much a mimic joint may be off the value that its driver gives it [rad; m]
            slack = 1e-9 * max(1.0, abs(followed[place]))
            checked = named is None or mimic.joint in named
            if checked and not abs(q[place] - followed[place]) <= slack:
                raise InvalidInput(
                    f"joint {mimic.joint} is {q[place]:g}: it mimics {mimic.driver}, which puts it "
                    f"at {followed[place]:g} (leave mimic joints out of q)"
                )
        return followed


class InDegrees(dict[str, float]):
    """Values of joints by name [deg; m for prismatic joints], as commands and files have them."""


class JointTable:
    """The joints of a model by name; a subclass has its `_model`, a `pin.Model`, and `file`."""

    _model: Any
    file: Any

    @cached_property
    def mimics(self) -> tuple[Mimic, ...]:
        """Joints that move with another one, as the file says; the model has both or none."""
        names, present = set(self.joint_names), list[Mimic]()
        for mimic in resolve_mimics(() if self.file is None else self.file.mimics):
            if mimic.joint in names and mimic.driver in names:
                present.append(mimic)
            elif mimic.joint in names or mimic.driver in names:
                raise InvalidInput(
                    f"joint {mimic.joint!r} mimics {mimic.driver!r}: the model must have both or "
                    "none"
                )
        return tuple(present)

    @cached_property
    def name(self) -> str:
        """Name of the robot."""
        return str(self._model.name)

    @cached_property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints in the order of the model, without its universe."""
        return tuple(self._model.names)[1:]

    @cached_property
    def nq(self) -> int:
        """Size of a configuration."""
        return int(self._model.nq)

    @cached_property
    def nv(self) -> int:
        """Size of a velocity."""
        return int(self._model.nv)

    @cached_property
    def lower(self) -> Array:
        """Lower limits of the joints, shape `(nq,)` [rad; m for prismatic joints]."""
        return read_only(self._model.lowerPositionLimit)

    @cached_property
    def upper(self) -> Array:
        """Upper limits of the joints, shape `(nq,)` [rad; m for prismatic joints]."""
        return read_only(self._model.upperPositionLimit)

    @cached_property
    def velocity_limit(self) -> Array:
        """Largest speed of each joint, shape `(nv,)` [rad/s; m/s for prismatic joints]."""
        return _limits(self._model.velocityLimit)

    @cached_property
    def effort_limit(self) -> Array:
        """Largest torque of each joint, `effort` in a URDF, `(nv,)` [N m; N for prismatic]."""
        return _limits(self._model.effortLimit)

    @cached_property
    def gears(self) -> Gears:
        """The mimic joints of the model."""
        return Gears(self._model, self.mimics)

    @cached_property
    def _columns(self) -> dict[str, int]:
        names, model = self.joint_names, self._model
        return {name: model.idx_vs[k] for k, name in enumerate(names, 1) if model.nvs[k] == 1}

    @property
    def single_joints(self) -> list[str]:
        """Names of the joints of one degree of freedom."""
        return list(self._columns)

    def configuration(self, angles: Mapping[str, float] | None = None) -> Array:
        """Return q, shape `(nq,)`, with joints at their values by name and all others at 0.

        Values are in radians, or metres for prismatic joints. In q, a joint without limits has
        cosine and sine, a floating base position and quaternion; mimic joints are where their
        drivers put them.
        """
        step, named = np.zeros(self.nv), validation.mapping("angles", angles)
        for name, value in named.items():
            step[self.velocity_index(name)] = validation.number(f"joint {name}", value)
        q = np.asarray(pin.integrate(self._model, pin.neutral(self._model), step))
        return self.gears.check(q, named)

    def check_configuration(self, q: ArrayLike) -> Array:
        """Return q, shape `(nq,)`, as a copy; raise `InvalidInput` if it is no configuration.

        A short q, with one angle for each continuous joint in place of its cosine and sine, and
        without mimic joints, is accepted too.
        """
        if type(q) is not np.ndarray and isinstance(q, Mapping):
            raise InvalidInput(
                f"q is {dict(q)!r}: it must be {self.nq} numbers; Leg.configuration makes them "
                "from angles by joint name"
            )
        if self._short_form is None:
            checked = validation.vector("q", q, self.nq, many="strike_many")
        else:
            checked = self._expanded(q, *self._short_form)
        if self.nq != self.nv and not pin.isNormalized(self._model, checked, 1e-9):
            raise InvalidInput(
                f"q is {checked.tolist()}: quaternions (xyzw, last) and the (cos, sin) pairs of "
                "continuous joints must have length 1 (Leg.configuration makes one from angles)"
            )
        return checked

    def joint_values(self, q: ArrayLike) -> dict[str, float]:
        """Return the value of each joint of one degree of freedom by name [rad; m if prismatic]."""
        q = self.check_configuration(q)
        step = pin.difference(self._model, pin.neutral(self._model), q)
        return {name: float(step[column]) for name, column in self._columns.items()}

    def angles_deg(self, q: ArrayLike) -> dict[str, float]:
        """Return the angles of the revolute joints by name [deg]; q has shape `(nq,)`."""
        return {name: x for name, (x, unit) in self.display_values(q).items() if unit == "deg"}

    def positions_m(self, q: ArrayLike) -> dict[str, float]:
        """Return the positions of the prismatic joints by name [m]; q has shape `(nq,)`."""
        return {name: x for name, (x, unit) in self.display_values(q).items() if unit == "m"}

    def display_values(self, q: ArrayLike) -> dict[str, tuple[float, str]]:
        """Return `joint_values` in degrees or metres, each with its unit, `deg` or `m`."""
        return {
            name: (x, "m") if self.joint_unit(name) == "m" else (math.degrees(x), "deg")
            for name, x in self.joint_values(q).items()
        }

    def velocity_index(self, joint: str) -> int:
        """Return the index in v of a joint; raise `InvalidInput` unless it has one."""
        return int(self._model.idx_vs[self._number(joint)])

    def joint_unit(self, joint: str) -> str:
        """Return `m` for a prismatic joint, `rad` for any other of one degree of freedom."""
        kind = self._model.joints[self._number(joint)].shortname()
        return "m" if kind.startswith("JointModelP") else "rad"

    def joint_range(self, joint: str) -> tuple[float, float]:
        """Return the limits of a joint, lower and upper [rad or m]; -pi and pi if continuous."""
        number = self._number(joint)
        if self._model.nqs[number] != 1:
            return -math.pi, math.pi
        index = self._model.idx_qs[number]
        return float(self.lower[index]), float(self.upper[index])

    def outside_range(self, q: ArrayLike) -> list[str]:
        """Return a line for each joint of one degree of freedom that is outside its range."""
        lines = []
        for name, (value, unit) in self.display_values(q).items():
            scale = 1.0 if unit == "m" else math.degrees(1.0)
            low, high = (scale * end for end in self.joint_range(name))
            if not low - scale * LIMIT_TOLERANCE <= value <= high + scale * LIMIT_TOLERANCE:
                span = f"{low:.5g} to {high:.5g}"
                lines.append(f"{name} at {value:.5g} {unit} is outside its range {span} {unit}")
        return [*lines, DEGREES] if look_like_degrees(self, self.check_configuration(q)) else lines

    @cached_property
    def angle_bounds(self) -> list[tuple[list[int], list[float]]]:
        """Of q and of a short q: places of angles, and by which size they look like degrees."""
        model, mimicking = self._model, {mimic.joint for mimic in self.mimics}
        short = list(range(model.nq)) if self._short_form is None else self._short_form[0].tolist()
        turning = [name for name in self.single_joints if self.joint_unit(name) == "rad"]
        names = [name for name in turning if name not in mimicking]
        numbers = [1 + self.joint_names.index(name) for name in names]
        reaches = [max(map(abs, self.joint_range(name))) for name in names]
        bounds = [max(math.tau, reach if reach < math.inf else 0.0) for reach in reaches]
        places = [model.idx_qs[k] + int(model.nqs[k] == 2) for k in numbers]  # sine if continuous
        return [(places, bounds), ([short.index(model.idx_qs[k]) for k in numbers], bounds)]

    def too_fast(self, v: ArrayLike) -> list[str]:
        """Return a line for each joint of one degree of freedom that is faster than its limit."""
        lines, speeds = [], np.abs(validation.vector("v", v, self.nv))
        for name in self.single_joints:
            index = self.velocity_index(name)
            speed, limit = float(speeds[index]), float(self.velocity_limit[index])
            if limit == 0.0 and speed > 0.0:
                lines.append(f"{name} moves, its speed limit is 0")
            elif speed > (1.0 + LIMIT_TOLERANCE) * limit:
                lines.append(f"{name} at {100.0 * speed / limit:.4g} % of its speed limit")
        return lines

    def _number(self, joint: str) -> int:
        """Return Pinocchio's number of a joint of one degree of freedom; raise `InvalidInput`."""
        if not isinstance(joint, str) or joint not in self.joint_names:
            raise InvalidInput(unknown("joint", joint, self.name, self.joint_names))
        number = 1 + self.joint_names.index(joint)
        if self._model.nvs[number] != 1:
            raise InvalidInput(f"joint {joint!r} has {self._model.nvs[number]} degrees of freedom")
        return number

    def _expanded(
        self, q: ArrayLike, places: NDArray[np.int64], angles: NDArray[np.bool_]
    ) -> Array:
        """Return q, shape `(nq,)`, of the same or of a short one, see `_short_form`."""
        values = validation.floats("q", q)
        if values.shape == places.shape:
            full = np.zeros(self.nq)
            full[places] = np.where(angles, np.cos(values), values)
            full[places[angles] + 1] = np.sin(values[angles])
            return self.gears.follow(full)
        if values.shape == (self.nq,):
            return self.gears.check(values)
        raise InvalidInput(
            f"q has shape {values.shape}: it must be {places.shape}, with one angle for each "
            f"continuous joint and no mimic joints, or ({self.nq},), with all that "
            "Leg.configuration returns"
        )

    @cached_property
    def _short_form(self) -> tuple[NDArray[np.int64], NDArray[np.bool_]] | None:
        """Places of a short q in q, and which are continuous joints' angles; None if q itself."""
        model, places, angles = self._model, list[int](), list[bool]()
        mimicking = {mimic.joint for mimic in self.mimics}
        for joint in range(1, model.njoints):
            if model.names[joint] not in mimicking:
                turns = (model.nqs[joint], model.nvs[joint]) == (2, 1)
                size = 1 if turns else model.nqs[joint]
                places += range(model.idx_qs[joint], model.idx_qs[joint] + size)
                angles += [turns] * size
        return None if len(places) == model.nq else (np.array(places), np.array(angles))

    def expand_joint_names(self, values: Mapping[str, float]) -> dict[str, float]:
        """Return values by joint from those by joint or pattern, or raise `InvalidInput`."""
        values = validation.mapping("values", values)
        for name in values:
            if not expand_patterns({name: 0.0}, self.single_joints):
                self.velocity_index(name)  # raises
        return expand_patterns(values, self.single_joints)

    def _values_to_lock(self, wanted: Mapping[str, float]) -> dict[str, float]:
        """Return the values of the joints that `wanted` names or matches [rad; m if prismatic]."""
        values = self.expand_joint_names(wanted)
        named = [*values]
        direct = () if self.file is None else self.file.mimics
        for mimic in (*self.mimics, *direct):
            if mimic.driver in named and mimic.joint not in wanted:
                values.pop(mimic.joint, None)
        if not isinstance(wanted, InDegrees):
            return values
        turning = {name for name in values if self.joint_unit(name) == "rad"}
        checked = {name: validation.number(f"joint {name}", x) for name, x in values.items()}
        return {name: math.radians(x) if name in turning else x for name, x in checked.items()}


def look_like_degrees(joints: JointTable, q: Array) -> NDArray[np.bool_]:
    """Return whether angles of configurations, `(..., nq)` or short, seem to be in degrees."""
    columns, bounds = joints.angle_bounds[q.shape[-1] != joints.nq]
    sizes = np.abs(q[..., columns])
    return np.asarray(((sizes > bounds) | (sizes == 0.0)).all(axis=-1) & sizes.any(axis=-1))


def _limits(limits: Array) -> Array:
    """Return limits with inf for the largest float, with which Pinocchio starts a joint."""
    return read_only(np.where(limits >= np.finfo(float).max, math.inf, limits))
