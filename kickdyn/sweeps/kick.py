"""What all postures of a sweep share: how the foot comes, and what it meets."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from kickdyn.air import Air
from kickdyn.ball import Ball
from kickdyn.contact import Contact
from kickdyn.core import validation
from kickdyn.core.validation import Array
from kickdyn.flight.fly import fly
from kickdyn.impact.impact_result import Impact
from kickdyn.impact.strike import strike
from kickdyn.robot.leg import Posture
from kickdyn.sweeps.speed_use import least_use, least_used, speed_use

Status = Literal["ok", "too fast", "out of reach"]
STATUSES: tuple[Status, ...] = ("ok", "too fast", "out of reach")

CARRY_ERROR = 1e-6
"""What the carry of a large sweep may be off by unless something else is asked for [m]."""


@dataclass(frozen=True, kw_only=True)
class Kick:
    """A foot that arrives at a given velocity and strikes the ball centrally.

    Args:
        speed: of the foot's contact point [m/s], above 0.
        attack: its direction above the horizontal in the x-z plane [rad]; the contact normal is
            the same.
        restitution: coefficient e; 0.8 is what the paper's Table 2 needs.
        friction: coefficient mu; 0.4 is the paper's.
        ball: struck at rest.
        air: for the flight; None is the vacuum.
    """

    speed: float = 1.0
    attack: float = math.radians(30)
    restitution: float = 0.8
    friction: float = 0.4
    ball: Ball = field(default_factory=Ball)
    air: Air | None = field(default_factory=Air)

    def __post_init__(self) -> None:
        validation.number("foot speed", self.speed, above=0, at_most=1e6, unit="m/s")
        limit = math.pi / 2
        validation.number("attack", self.attack, at_least=-limit, at_most=limit, unit="rad")
        Contact(self.direction, self.restitution, self.friction)

    @property
    def direction(self) -> Array:
        """Unit vector of the foot's velocity, shape `(3,)` [world frame]."""
        return np.array([math.cos(self.attack), 0.0, math.sin(self.attack)])

    @property
    def contact(self) -> Contact:
        """The contact, its normal along the foot's velocity."""
        return Contact(self.direction, self.restitution, self.friction)


@dataclass(frozen=True, eq=False)
class Outcome:
    """What one posture makes of a kick.

    Attributes:
        posture: the leg.
        status: `ok`; `too fast`, where a joint would have to exceed its velocity limit; `out of
            reach`, where the foot cannot move along the attack direction at all.
        speed_use: largest joint speed over its limit, the least with which the foot can come so;
            nan out of reach.
        hit: the impact; None out of reach.
        carry: distance to where the ball is back at its launch height [m]; nan out of reach.
    """

    posture: Posture
    status: Status
    speed_use: float
    hit: Impact | None
    carry: float


def kick_from(posture: Posture, kick: Kick) -> Outcome:
    """Strike and fly from one posture.

    The joint velocity is that of least kinetic energy, or, where that is too fast for a joint,
    that of least `speed_use`; the impulse is the same.
    """
    wish = kick.speed * kick.direction
    v = posture.try_joint_velocity(wish)
    if v is None:
        return Outcome(posture, "out of reach", math.nan, None, math.nan)
    use = least_use(posture, wish)
    if use <= 1 < speed_use(posture, v):
        v = least_used(posture, wish)
    hit = strike(posture, v, kick.ball, kick.contact)
    path = fly(hit.ball_after, kick.ball, kick.air)
    return Outcome(posture, "ok" if use <= 1 else "too fast", use, hit, path.range)
