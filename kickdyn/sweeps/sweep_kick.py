"""One kick from one posture: the foot's velocity, the joint speeds it needs, impact and flight."""

import math
from dataclasses import dataclass, field
from enum import StrEnum

import numpy as np

from kickdyn.air import Air
from kickdyn.ball import Ball
from kickdyn.contact import Contact
from kickdyn.core import validation
from kickdyn.core.validation import Array, ArrayLike
from kickdyn.errors import KickdynError
from kickdyn.flight.fly import fly
from kickdyn.impact.impact_result import Impact
from kickdyn.impact.laws import find_law
from kickdyn.impact.strike import strike
from kickdyn.robot.leg import Posture

ROUNDING = 1e-12
"""Relative size below which a sum of products is taken for the rounding error of its terms."""

FLIGHT_TOLERANCE = 1e-11
"""Relative tolerance of every flight of a sweep: carries are then right to 1e-8."""

UNLIMITED = 1e300
"""Velocity limit from which on there is none: Pinocchio's default is the largest float64."""

LARGEST_RATIO = 1e12
"""Limits larger than the least one by this factor do not bound the slowest joint velocity."""


@dataclass(frozen=True, kw_only=True)
class Kick:
    r"""A foot that arrives with a given velocity and strikes a resting ball centrally.

    The contact point moves with :math:`v\,n`, and :math:`n` is also the contact normal:
    :math:`n = (\cos\alpha, 0, \sin\alpha)` with the attack angle :math:`\alpha`.

    Args:
        speed: speed :math:`v` of the contact point of the foot [m/s], above 0.
        attack: attack angle :math:`\alpha`, from the horizontal upwards in the x-z plane [rad], in
            :math:`[-\pi/2, \pi/2]`; 30 degrees by default.
        restitution: coefficient e, or a table or model of it over the speed of approach, as for
            `Contact`. The foot approaches with its speed. 0.8 reproduces the paper's Table
            2.
        friction: Coulomb's coefficient mu, at most 1e9; 0.4 is the paper's.
        law: impact law, as for `strike`.
        ball: the ball, at rest before the impact.
        air: air in which the ball flies; None is the vacuum.

    Raises:
        InvalidInput: a value outside its range.
    """

    speed: float = 1.0
    attack: float = math.radians(30)
    restitution: float | str | ArrayLike = 0.8
    friction: float = 0.4
    law: str = "newton"
    ball: Ball = field(default_factory=Ball)
    air: Air | None = field(default_factory=Air)

    def __post_init__(self) -> None:
        validation.number("foot speed", self.speed, above=0, at_most=1e6, unit="m/s")
        validation.number("friction", self.friction, at_least=0, at_most=1e9)
        object.__setattr__(self, "law", find_law(self.law).name)
        limit = math.pi / 2
        validation.number("attack", self.attack, at_least=-limit, at_most=limit, unit="rad")
        validation.check_type(Ball, ball=self.ball)
        self.ball.check_movable("a sweep")
        validation.check_type(Air, type(None), air=self.air)
        object.__setattr__(self, "restitution", self.contact.restitution)

    @property
    def direction(self) -> Array:
        """Unit vector n of the foot's velocity, shape `(3,)` [world frame]."""
        return np.array([math.cos(self.attack), 0.0, math.sin(self.attack)])

    @property
    def contact(self) -> Contact:
        """The contact, with its normal along the velocity of the foot."""
        return Contact(self.direction, self.restitution, self.friction).for_ball(self.ball)

    @property
    def restitution_used(self) -> float:
        """Coefficient e at the speed of the foot, with which it approaches in every posture."""
        return self.contact.restitution_at(self.speed)


class PostureStatus(StrEnum):
    """Whether a leg can kick from a posture.

    `ok`: some joint velocity within the limits moves the foot as asked. `too-fast`: each joint
    velocity that does so exceeds a limit. `out-of-reach`: the foot cannot move in the direction of
    the kick at all (a stretched leg along itself); there is no impact. `not-closed`: the leg's
    loops cannot be closed there, with all joints in their ranges; there is no posture.
    `not-computed`: the sweep has not come to the posture yet.
    """

    OK = "ok"
    TOO_FAST = "too-fast"
    OUT_OF_REACH = "out-of-reach"
    NOT_CLOSED = "not-closed"
    NOT_COMPUTED = "not-computed"

    @property
    def flag(self) -> int:
        """The number that stands for the status in a dataset; -1 is `not-computed`."""
        return -1 if self is PostureStatus.NOT_COMPUTED else list(PostureStatus).index(self)


@dataclass(frozen=True, eq=False)
class PostureOutcome:
    """The result of a kick from one posture.

    Attributes:
        posture: the posture of the leg.
        status: whether the leg can kick so.
        speed_use: the least possible value of the largest joint speed over its limit; nan where the
            posture is out of reach.
        impact: the impact; None out of reach.
        carry: horizontal distance to where the ball is back at its launch height [m]; nan out of
            reach.
    """

    posture: Posture
    status: PostureStatus
    speed_use: float
    impact: Impact | None
    carry: float


def kick_from(posture: Posture, kick: Kick) -> PostureOutcome:
    """Strike and fly from one posture.

    The joint velocity has the least kinetic energy, or, where that velocity exceeds a joint's
    limit, the least `speed_use`. The impulse on the ball is the same for both, because it depends
    on the velocity of the foot only.
    """
    foot_velocity = kick.speed * kick.direction
    v = posture.try_joint_velocity(foot_velocity)
    if v is None:
        return PostureOutcome(posture, PostureStatus.OUT_OF_REACH, math.nan, None, math.nan)
    slowest = slowest_joint_velocity(posture, foot_velocity)
    use = speed_use(posture, slowest)
    if use <= 1 < speed_use(posture, v):
        v = slowest
    impact = strike(posture, v, kick.ball, kick.contact, kick.law)
    path = fly(impact.ball_after, kick.ball, kick.air, tol=FLIGHT_TOLERANCE)
    status = PostureStatus.OK if use <= 1 else PostureStatus.TOO_FAST
    return PostureOutcome(posture, status, use, impact, path.range)


def speed_use(posture: Posture, v: Array) -> float:
    r"""Return the largest joint speed over its limit, :math:`\max_i |v_i| / l_i`.

    The joint velocity v has shape `(nv,)` [rad/s; m/s for prismatic joints].
    """
    limit, needed = posture.leg.velocity_limit, np.abs(v)
    limit = np.where(limit > UNLIMITED, math.inf, limit)
    use = np.divide(needed, limit, out=np.where(needed > 0, np.inf, 0.0), where=limit > 0)
    return float(use.max())


def slowest_joint_velocity(posture: Posture, foot_velocity: Array) -> Array:
    r"""Return the joint velocity of least `speed_use` that moves the contact point as asked.

    More than three joints, or two in a plane, can move a foot in many ways. The least
    :math:`t = \max_i |v_i| / l_i` under :math:`J v = w`, and under the rows of supports and loops,
    is a linear programme. Where only joints whose limit is 0 could move the foot so, the velocity
    of least kinetic energy is returned, whose `speed_use` is inf.

    The velocity w of the contact point is within reach, shape `(3,)` [m/s, world frame]. The joint
    velocity has shape `(nv,)` [rad/s; m/s] and is right to rounding.
    """
    from scipy.optimize import linprog  # its import takes a quarter of a second

    posture = posture.without_stiff_joints
    least_energy = posture.try_joint_velocity(foot_velocity)
    assert least_energy is not None
    constraints, all_rows = posture.constraint_projector, posture.jacobian
    if constraints is not None:
        all_rows = np.vstack([all_rows, constraints.rows])
    moves = posture.leg.velocity_limit > 0
    rows, limit = all_rows[:, moves], posture.leg.velocity_limit[moves]
    least = min(limit.min(initial=math.inf), UNLIMITED)
    limited = limit <= min(LARGEST_RATIO * least, UNLIMITED)
    unit = np.minimum(limit, 1e3 * least)  # of a joint's velocity: the solver's tolerances are 1e-7
    columns = rows * unit
    speed, size = validation.length(foot_velocity), np.abs(columns).max(initial=0.0) or 1.0
    bound, bounds = np.eye(limit.size)[limited], (limit / unit)[limited, None]
    solution = linprog(
        np.append(np.zeros(limit.size), 1.0),
        A_ub=np.vstack([np.hstack([bound, -bounds]), np.hstack([-bound, -bounds])]),
        b_ub=np.zeros(2 * len(bound)),
        A_eq=np.column_stack([columns / size, np.zeros(len(rows))]),
        b_eq=all_rows @ (least_energy / speed),
        bounds=[(None, None)] * limit.size + [(0.0, None)],
        method="highs",
    )
    if solution.status == 2:  # infeasible: a joint that must move has limit 0
        return least_energy
    if not solution.success:
        raise KickdynError(f"no joint velocity found for {posture!r}: {solution.message}")
    v = np.zeros(least_energy.size)
    v[moves] = speed / size * unit * solution.x[:-1]  # to the solver's tolerance
    v[moves] += np.linalg.lstsq(rows, all_rows @ (least_energy - v), rcond=ROUNDING)[0]
    gap = np.abs(posture.point_velocity(v) - foot_velocity).max()
    return v if gap <= 1e-9 * np.abs(foot_velocity).max() else least_energy
