"""The level ground that a ball lands on, and the surfaces that it bounces and rolls on."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from kickdyn.core import validation
from kickdyn.core.representation import ReprMixin, Row
from kickdyn.errors import InvalidInput
from kickdyn.restitution import Restitution, checked_restitution, format_restitution

COEFFICIENTS = ("restitution", "friction", "rolling_deceleration", "tangential_restitution")
"""Names of the numbers of a surface."""


@dataclass(frozen=True)
class Surface:
    """Coefficients by which a ball bounces and rolls on a level surface.

    Args:
        name: name of the surface in messages and results.
        restitution: ratio of the vertical speeds after and before a bounce, 0 to 1; or as of
            `Contact`, a table over the vertical speed or a model: with `inflated` the ground is
            rigid, and the ratio follows from the ball and its pressure.
        friction: Coulomb's coefficient of friction, 0 or more.
        rolling_deceleration: deceleration of a rolling ball without the drag of the air [m/s2],
            above 0.
        tangential_restitution: coefficient :math:`e_t`, -1 to 1: a bounce in which the ball grips
            turns the slip u of its lowest point into :math:`-e_t u`.
        source: source of the numbers.
        deviations: standard deviations of the coefficients by their names, as in
            `Segments.surface`, where they were measured. They do not change any motion.

    Raises:
        InvalidInput: a coefficient outside its range, or a deviation of something else.
    """

    name: str
    restitution: Restitution
    friction: float
    rolling_deceleration: float
    tangential_restitution: float = 0.0
    source: str = ""
    deviations: Mapping[str, float] = field(default_factory=dict, hash=False)

    def __post_init__(self) -> None:
        self.__dict__["restitution"] = checked_restitution(self.restitution, "ground restitution")
        validation.number("ground friction", self.friction, at_least=0)
        validation.number("rolling deceleration", self.rolling_deceleration, above=0, unit="m/s2")
        grip = self.tangential_restitution
        validation.number("tangential restitution", grip, at_least=-1, at_most=1)
        validation.check_type(Mapping, deviations=self.deviations)
        for name, value in self.deviations.items():
            if name not in COEFFICIENTS:
                raise InvalidInput(
                    f"deviations has {validation.brief(name)}: its names are "
                    f"{', '.join(COEFFICIENTS)}"
                )
            validation.number(f"deviation of {name}", value, at_least=0)


SURFACES = {
    surface.name: surface
    for surface in (
        Surface(
            "turf",
            0.60,
            0.7,
            0.75,
            source="FIFA turf: rebound 0.60-0.85 m from 2 m; angled rebound keeps 45-70 % of the "
            "speed (derived); roll 4-10 m from a 1 m ramp (derived)",
        ),
        Surface(
            "wet-grass",
            0.60,
            0.4,
            0.59,
            source="as turf, at its fast end: roll 10 m (derived); friction of leather, 0.37-0.45 "
            "on 7 of 9 match balls (Proceedings 2020, 49(1):92)",
        ),
        Surface(
            "hard-floor",
            0.82,
            0.4,
            0.49,
            source="FIFA ball rebound 135 cm from 2 m on steel (derived); EN 12234 roll 12 m "
            "(derived); friction as wet-grass",
        ),
        Surface(
            "steel",
            "inflated",
            0.4,
            0.49,
            source="rigid: restitution from speed and pressure of the ball, fitted to a rebound on "
            "steel (inflated ball); friction and rolling as hard-floor",
        ),
        Surface(
            "carpet",
            0.50,
            0.7,
            0.57,
            source="RoboCup ball on 30 mm artificial grass: 2 m to 0.5 m; stops from 0.841 m/s in "
            "0.621 m (Webots); friction as turf",
        ),
    )
}
"""Every surface by name."""


@dataclass(frozen=True, repr=False)
class Ground(ReprMixin):
    """A level plane.

    Args:
        height: height of the ground [m, world frame z].
        surface: name of one of `kickdyn.ground.SURFACES`, or a `Surface`, on which `follow` lets
            the ball bounce and roll. `fly` needs none.

    Raises:
        InvalidInput: a height that is not finite, or an unknown surface.
    """

    height: float = 0.0
    surface: str | Surface | None = None

    def __post_init__(self) -> None:
        self.__dict__["height"] = validation.number("ground height", self.height, unit="m")
        if isinstance(self.surface, str):
            if self.surface not in SURFACES:
                raise InvalidInput(
                    f"surface {self.surface!r} is unknown: choose {', '.join(SURFACES)}, "
                    "or pass a Surface"
                )
            self.__dict__["surface"] = SURFACES[self.surface]
        elif not (self.surface is None or isinstance(self.surface, Surface)):
            raise InvalidInput(f"surface is {self.surface!r}: it must be a name or a Surface")

    def __repr__(self) -> str:
        name = self.surface.name if isinstance(self.surface, Surface) else None
        return f"Ground(height={self.height:g}, surface={name!r})"

    def _rows(self) -> Iterable[Row]:
        yield "height", self.height, "m"
        if isinstance(self.surface, Surface):
            yield "surface", self.surface.name, ""
            yield "restitution", format_restitution(self.surface.restitution), ""
            yield "friction", self.surface.friction, ""
            yield "rolling deceleration", self.surface.rolling_deceleration, "m/s2"
        else:
            yield "surface", "none: flights end on it", ""
