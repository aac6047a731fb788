"""The ball and its state of motion."""

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from kickdyn.core import validation
from kickdyn.core.representation import ReprMixin, Row, ValueEquality, format_value, warned
from kickdyn.core.validation import Array, ArrayLike
from kickdyn.errors import InvalidInput

SMALLEST = float(np.finfo(float).tiny)
"""Below it a float64 has fewer digits."""

LARGEST_MASS, LARGEST_RADIUS = 5.0, 0.5
"""Mass [kg] and radius [m] of a ball above which a warning says that the units may be others."""

PRESSURES = 2e3, 1e6
"""Least and largest gauge pressure of a ball [Pa]: a thirtieth of the least, and nine times the
largest, that Law 2 of football allows."""


@dataclass(frozen=True)
class Ball(ReprMixin):
    """A ball, by default a thin spherical shell, as the paper's (after Eq. 23).

    The default is the middle of a size 5 ball's range: 410-450 g and 68-70 cm around
    (IFAB, Laws of the Game 2023/24, Law 2).

    Args:
        mass: mass [kg], above 0. With an infinite mass the ball is an obstacle that cannot move,
            for impacts only.
        radius: radius [m], above 0.
        inertia_factor: moment of inertia over mass times radius squared, above 0. It is 2/3 of a
            thin shell, which is the most a ball can have, and 2/5 of a solid ball. An infinite one
            makes a particle: it has a size in the air and at the contact, but nothing turns it.
        pressure: gauge pressure, of the air inside above that outside [Pa], 2e3 to 1e6; None, the
            default, if it is unknown. Law 2 allows 0.6 to 1.1 atmospheres, about 60e3 to 110e3 Pa.
        shell_share: share of the mass in the shell, 0 to 1, which comes to rest where a foot
            flattens an inflated ball; the rest moves with the centre. The default 1 neglects the
            mass of the air inside, some 3 %.

    Raises:
        InvalidInput: a value outside its range.
    """

    mass: float = 0.43
    radius: float = 0.69 / (2 * math.pi)
    inertia_factor: float = 2.0 / 3.0
    pressure: float | None = None
    shell_share: float = 1.0

    def __post_init__(self) -> None:
        checked = self.__dict__
        immovable = isinstance(self.mass, float) and self.mass == math.inf
        if not immovable:
            checked["mass"] = validation.number("ball mass", self.mass, above=0, unit="kg")
        checked["radius"] = validation.number("ball radius", self.radius, above=0, unit="m")
        if self.pressure is not None:
            low, high = PRESSURES
            checked["pressure"] = validation.number(
                "ball pressure", self.pressure, at_least=low, at_most=high,
                unit="Pa above the air outside; 0.8 bar, or 80 kPa, is 80e3 Pa",
            )  # fmt: skip
        checked["shell_share"] = validation.number(
            "shell share", self.shell_share, at_least=0, at_most=1,
            unit="of the mass of the ball",
        )  # fmt: skip
        if isinstance(self.inertia_factor, float) and self.inertia_factor == math.inf:
            return
        factor = validation.number(
            "inertia factor", self.inertia_factor, above=0, at_most=2.0 / 3.0
        )
        checked["inertia_factor"] = factor
        finite = immovable or SMALLEST <= self.inertia < math.inf
        if not (finite and factor * self.mass >= SMALLEST):
            raise InvalidInput(
                f"ball mass {self.mass:g} kg and radius {self.radius:g} m give an inertia of "
                f"{self.inertia:g} kg m2: mass, inertia and their inverses must be finite, above 0"
            )

    def check_movable(self, what: str) -> None:
        """Raise `InvalidInput` if the ball is an obstacle; `what` needs a movable one."""
        if self.mass == math.inf:
            raise InvalidInput(
                f"ball mass is inf, an obstacle that cannot move: {what} needs a finite mass"
            )

    def _rows(self) -> Iterable[Row]:
        yield "mass", self.mass, "kg"
        yield "radius", self.radius, "m"
        yield "inertia", self.inertia, "kg m2"
        if self.pressure is not None:
            yield "pressure", self.pressure, "Pa"
        yield from warned(self.warnings)

    @property
    def warnings(self) -> tuple[str, ...]:
        """A line if mass or radius fit no ball, but perhaps one in other units."""
        if LARGEST_MASS < self.mass < math.inf or self.radius > LARGEST_RADIUS:
            return (
                f"the ball has {self.mass:g} kg and a radius of {self.radius:g} m: a soccer ball "
                "has 0.43 kg and 0.11 m",
            )
        return ()

    @classmethod
    def paper(cls) -> "Ball":
        """Return the ball of the paper's Table 3: 0.45 kg, radius 0.1 m."""
        return cls(mass=0.45, radius=0.1)

    @property
    def inertia(self) -> float:
        r"""Moment of inertia about any diameter [kg m2], :math:`\frac23 m r^2` of a thin shell."""
        return self.inertia_factor * self.mass * self.radius * self.radius

    @property
    def turning(self) -> float:
        r"""What rotation adds to :math:`1/m` across the normal, :math:`r^2/I` [1/kg]."""
        return 1.0 / (self.inertia_factor * self.mass)

    @property
    def stiffness(self) -> float:
        r"""Stiffness of an inflated ball against a flat plate [N/m], from its pressure.

        .. math:: k = 2 \pi R p

        The ball is a membrane that does not bend nor stretch, which a plate flattens by d where it
        would be cut, a circle of radius a. The pressure p pushes this circle against the plate:

        .. math:: F = p\, \pi a^2 = p\, \pi (2 R d - d^2) \approx 2 \pi R p\, d.

        At 80 kPa the neglected terms, among them the compression of the air, change F by less than
        3 % up to a deflection of 0.3 R; `docs/explanation/compliance.md` compares with
        measurements. The derivation is our own. A soccer ball that falls onto a hard surface is
        compressed by 2.80 mm for each m/s (Dowell & Krebs, British Journal of Sports Medicine 25,
        1991, 34-37); this k gives :math:`\sqrt{m/k}`, 2.79 mm for each m/s at 80 kPa.

        Raises:
            InvalidInput: the ball's pressure is unknown.
        """
        if self.pressure is None:
            raise InvalidInput(
                "ball pressure is None: its stiffness needs it, and so does the restitution "
                "'inflated': Ball(pressure=80e3) [Pa above the air outside], --ball 0.43:0.11:80e3"
            )
        return 2.0 * math.pi * self.radius * self.pressure

    @property
    def cross_section(self) -> float:
        r"""Area across the flow of the air, :math:`\pi r^2` [m2]."""
        return math.pi * self.radius * self.radius

    @property
    def volume(self) -> float:
        r"""Volume, :math:`\frac43 \pi r^3` [m3]; buoyancy is the weight of as much air."""
        return 4.0 / 3.0 * math.pi * self.radius**3


@dataclass(frozen=True, eq=False, init=False, repr=False)
class BallState(ValueEquality):
    """Position, velocity and spin of a ball: one state, or many.

    Shapes `(3,)` make one state; where any argument has n rows, there are n states, and what has
    none is the same for all of them: `BallState(velocity=velocities)` is n launches from the origin
    at time 0.

    Args:
        position: centre of the ball, shape `(3,)` or `(n, 3)` [m, world frame].
        velocity: velocity of the centre, shape `(3,)` or `(n, 3)` [m/s, world frame].
        spin: angular velocity, shape `(3,)` or `(n, 3)` [rad/s, world frame].
        time: time, a number or shape `(n,)` [s].

    Raises:
        InvalidInput: shapes that do not go together, or an entry that is not finite.
    """

    position: Array
    velocity: Array
    spin: Array
    time: float | Array = 0.0

    def __init__(
        self,
        position: ArrayLike = (0.0, 0.0, 0.0),
        velocity: ArrayLike = (0.0, 0.0, 0.0),
        spin: ArrayLike = (0.0, 0.0, 0.0),
        time: ArrayLike = 0.0,
    ) -> None:
        arrays = {
            "position": validation.floats("position", position, unit="m"),
            "velocity": validation.floats("velocity", velocity, unit="m/s"),
            "spin": validation.floats("spin", spin, unit="rad/s"),
            "time": validation.floats("time", time, unit="s"),
        }
        rows: tuple[int, ...] = ()
        for name, array in arrays.items():
            single = () if name == "time" else (3,)
            if array.shape == single:
                continue
            valid = (
                f"{single or 'a number'} or ({rows[0] if rows else 'n'},{' 3' if single else ''})"
            )
            rows = rows or array.shape[:1]
            if array.shape != (*rows, *single):
                raise InvalidInput(f"{name} has shape {array.shape}: it must be {valid}")
        for name, array in arrays.items():
            shape = rows if name == "time" else (*rows, 3)
            value = array if array.shape == shape else np.array(np.broadcast_to(array, shape))
            value.setflags(write=False)
            self.__dict__[name] = value if value.ndim else float(value)

    @classmethod
    def computed(
        cls, position: Array, velocity: Array, spin: Array, time: float | Array = 0.0
    ) -> "BallState":
        """Return one state or n of finite arrays of full shape, which it owns from then on.

        The arrays are not checked, which would take as long as an impact.
        """
        state = cls.__new__(cls)
        try:
            validation.protect(position, velocity, spin)
        except AttributeError:
            raise InvalidInput("position, velocity and spin must be arrays of floats") from None
        state.__dict__.update(position=position, velocity=velocity, spin=spin, time=time)
        return state

    def __repr__(self) -> str:
        if np.ndim(self.position) > 1:
            times = np.broadcast_to(self.time, len(self.position))
            span = (
                f", {format_value(times[0])} to {format_value(times[-1])} s" if times.size else ""
            )
            return f"BallState({times.size} times{span})"
        units = (("position", "m"), ("velocity", "m/s"), ("spin", "rad/s"), ("time", "s"))
        shown = (f"{name}={format_value(getattr(self, name))} {unit}" for name, unit in units)
        return f"BallState({', '.join(shown)})"

    @property
    def speed(self) -> float | Array:
        """Speed of the centre [m/s]."""
        speed = validation.length(self.velocity)
        return float(speed) if np.ndim(speed) == 0 else speed

    @property
    def elevation(self) -> float | Array:
        """Angle of the velocity above the horizontal [rad], -pi/2 to pi/2."""
        horizontal = np.hypot(self.velocity[..., 0], self.velocity[..., 1])
        angle = np.arctan2(self.velocity[..., 2], horizontal)
        return float(angle) if np.ndim(angle) == 0 else angle
