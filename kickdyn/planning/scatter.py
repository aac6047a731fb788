r"""Scatter of the landing for errors of the foot, the contact and the air, to first order.

With the derivatives :math:`S` of the landing by the launch, and :math:`L_i` of the launch by the
errors of a source with standard deviation :math:`\sigma_i`,

.. math:: \Sigma = \sum_i \sigma_i^2\, S L_i (S L_i)^T.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from kickdyn.air import Air
from kickdyn.core import validation
from kickdyn.core.mechanics import cross
from kickdyn.core.representation import ReadOnlyArrays, freeze_arrays
from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput, KickdynError
from kickdyn.flight.derivatives import fly_with_launch_slopes
from kickdyn.impact.impact_result import Impact
from kickdyn.plane import Plane

UNITS = {"speed": "1", "angle": "rad", "contact": "m", "restitution": "1", "drag": "1"}
"""Sources of error, with units.

Foot speed, relative; direction of the foot's velocity and place of the contact on the ball, each
upwards and sideways; restitution; drag coefficient, relative.
"""

FLIGHT_TOL = 1e-11
"""Relative tolerance of the flight."""


@dataclass(frozen=True, eq=False)
class Scatter(ReadOnlyArrays):
    """Where the ball comes down to the height it lay at.

    Attributes:
        mean: shape `(2,)` [m], x and y from the start.
        covariance: shape `(2, 2)` [m2].
        by_source: what the covariance would be if the source were the only one.
    """

    mean: Array
    covariance: Array
    by_source: Mapping[str, Array]

    def __post_init__(self) -> None:
        freeze_arrays(vars(self))

    @property
    def radius(self) -> float:
        """Root mean square distance from the mean [m]."""
        return math.sqrt(float(np.trace(self.covariance)))


def scatter(impact: Impact, air: Air | None = None, **spread: float) -> Scatter:
    """Carry standard deviations through strike and flight, to first order.

    Args:
        impact: a strike, law `newton`, of a ball that flies up.
        air: None is the vacuum.
        **spread: standard deviation by source, see `UNITS`; angle and contact for either
            direction. Sources are independent.

    Raises:
        InvalidInput: an unknown source or none, a value below 0, another law, or no landing.
    """
    if not spread:
        raise InvalidInput(f"no source is named: choose among {', '.join(UNITS)}")
    for name, value in spread.items():
        if name not in UNITS:
            raise InvalidInput(f"source {name!r} is unknown: choose among {', '.join(UNITS)}")
        validation.number(f"spread of {name}", value, at_least=0, at_most=1, unit=UNITS[name])
    state, ball = impact.ball_after, impact.ball
    level = Plane(state.position, (0.0, 0.0, 1.0), "centre")
    try:
        path = fly_with_launch_slopes(state, ball, air, level, FLIGHT_TOL)
    except KickdynError:
        path = None
    if path is None or not path.end > 0.0:
        raise InvalidInput("the ball does not fly up and come down: there is no landing to scatter")
    by_launch = path.slopes_at_plane(level.normal, path.end)[0][:2]  # and by the drag, last
    slopes, foot = impact.sensitivity(of_leg=False), impact.foot_velocity
    by = {
        source: np.vstack([slopes.velocity[source], slopes.spin[source]])
        for source in ("normal", "restitution")
    }
    # the foot faster is the ball slower; only their relative velocity makes the impulse
    by_ball = slopes.impulse["ball_velocity"] / ball.mass, slopes.spin["ball_velocity"]
    by_foot = -np.vstack(by_ball)
    launch = {
        "speed": by_foot @ foot[:, None],
        "angle": by_foot @ (math.hypot(*foot) * _across(foot)),
        "contact": by["normal"] @ (-_across(impact.contact.normal) / ball.radius),
        "restitution": by["restitution"],
    }
    landing = {source: by_launch[:, :6] @ change for source, change in launch.items()}
    landing["drag"] = by_launch[:, 6:]
    by_source = {name: value**2 * landing[name] @ landing[name].T for name, value in spread.items()}
    mean = path.position(path.end)[:2]
    return Scatter(mean, np.sum(list(by_source.values()), axis=0), by_source)


def _across(direction: Array) -> Array:
    """Return the unit vectors upwards and sideways across a direction, as columns."""
    along = direction / math.hypot(*direction)
    left = np.array([-along[1], along[0], 0.0])
    if np.linalg.norm(left) < 1e-9:  # the direction is vertical
        left = np.array([0.0, 1.0, 0.0])
    left /= np.linalg.norm(left)
    return np.column_stack([cross(along, left), left])
