"""Impacts at the extremes: every one is right to the digits its condition allows, or refused."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from kickdyn.accuracy.exact_impact import answers, conditions, exact_impact, given
from kickdyn.accuracy.extremes_row import FULL, Row, compared, refused
from kickdyn.ball import Ball
from kickdyn.contact import Contact
from kickdyn.core.validation import Array
from kickdyn.errors import KickdynError
from kickdyn.impact.impact_result import Impact
from kickdyn.impact.strike import strike
from kickdyn.robot.leg import Leg

FORWARD, DOWN = (1.0, 0.0, 0.0), (0.0, 0.0, -1.0)


class Kick(NamedTuple):
    """A strike to be judged.

    Attributes:
        name: of the case.
        leg, q, v, ball, touch: as for `strike`.
        ball_velocity, ball_spin: likewise.
    """

    name: str
    leg: Leg
    q: ArrayLike
    v: ArrayLike
    ball: Ball
    contact: Contact
    ball_velocity: ArrayLike = (0.0, 0.0, 0.0)
    ball_spin: ArrayLike = (0.0, 0.0, 0.0)

    def struck(self) -> Impact:
        """Return what kickdyn says."""
        return strike(
            self.leg.posture(self.q), self.v, self.ball, self.contact,
            ball_velocity=self.ball_velocity, ball_spin=self.ball_spin,
        )  # fmt: skip


def chain(
    lengths: Sequence[float],
    masses: Sequence[float] | None = None,
    base: ArrayLike = (0.0, 0.0, 0.0),
    turn: Array | None = None,
) -> Leg:
    """Return slender rods that hang from each other, hinged about y; contact at the last one's end.

    Args:
        lengths: of the rods [m].
        masses: [kg]; 1 when not named.
        base: where the first hangs [m].
        turn: of the whole, a rotation.
    """
    model, parent = pin.Model(), 0
    model.name = f"chain of {len(lengths)}"
    place = pin.SE3(np.eye(3) if turn is None else turn, np.array(base, dtype=float))
    for k, size in enumerate(lengths):
        mass = 1.0 if masses is None else masses[k]
        parent = model.addJoint(parent, pin.JointModelRY(), place, f"joint{k + 1}")
        across = mass * size * size / 12.0
        moments = np.diag([across, across, 1e-2 * across])
        rod = pin.Inertia(mass, np.array([0.0, 0.0, -size / 2]), moments)
        model.appendBodyToJoint(parent, rod, pin.SE3.Identity())
        place = pin.SE3(np.eye(3), np.array([0.0, 0.0, -size]))
    model.addFrame(pin.Frame("toe", parent, 0, place, pin.FrameType.OP_FRAME))
    return Leg.from_model(model, "toe")


BENT = (0.4, 0.7, -0.3)
SPEEDS = (-3.0, -5.0, -4.0)
USUAL = (0.45, 0.43, 0.2)
"""Lengths of a leg [m]."""
OBLIQUE = (2.0, 0.3, 1.0)


def postures() -> Iterator[Kick]:
    """Yield straight and nearly straight legs: the foot hardly moves along the normal."""
    leg, still, ball = chain(USUAL), np.zeros(3), Ball()
    coming = {"ball_velocity": (0.3, 0.0, 4.0)}
    for mu in (0.0, 0.4):
        rubs = f", mu {mu:g}"
        contact = Contact(DOWN, 0.8, mu)
        yield Kick(
            "straight leg, normal along it" + rubs, leg, still, still, ball, contact, **coming
        )
        for bend in (1e-3, 1e-6, 1e-9, 1e-12, 1e-200):
            name = f"bent by {bend:g} rad, normal along it"
            yield Kick(name + rubs, leg, (0.0, bend, 0.0), SPEEDS, ball, contact, **coming)
    level = (-math.pi / 2, 0.0, 0.0)
    coming = {"ball_velocity": (-4.0, 0.0, 0.3)}
    contact = Contact(FORWARD, 0.8)
    yield Kick("straight leg at pi/2, normal along it", leg, level, still, ball, contact, **coming)


def masses() -> Iterator[Kick]:
    """Yield mass ratios of 24 decades."""
    contact = Contact(OBLIQUE, 0.8)
    for first, last in ((1.0, 1e-12), (1e-12, 1.0), (1e12, 1.0), (1.0, 1e12)):
        leg = chain(USUAL, (first, math.sqrt(first * last), last))
        yield Kick(f"links of {first:g} to {last:g} kg", leg, BENT, SPEEDS, Ball(), contact)
    for mass in (1e-12, 1e12):
        for mu in (0.0, 0.4):
            contact = Contact(OBLIQUE, 0.8, mu)
            name = f"ball of {mass:g} kg, mu {mu:g}"
            yield Kick(name, chain(USUAL), BENT, SPEEDS, Ball(mass), contact)


def coefficients() -> Iterator[Kick]:
    """Yield the ends of restitution and friction."""
    leg = chain(USUAL)
    for e in (0.0, 1.0, 1.0 - 1e-15):
        for mu in (0.0, 0.1, 0.4):
            yield Kick(
                f"e {'1 - 1e-15' if 0.9 < e < 1 else f'{e:g}'}, mu {mu:g}",
                leg, BENT, SPEEDS, Ball(), Contact(OBLIQUE, e, mu),
            )  # fmt: skip
    for mu in (1e-300, 1e-12, 1e6, 1e300):
        contact = Contact((2.0, 0.8, 1.0), 0.8, mu)
        yield Kick(f"mu {mu:g}", leg, BENT, SPEEDS, Ball(), contact)


def grazes() -> Iterator[Kick]:
    """Yield approaches that hardly are any, and spins beyond all balls."""
    leg, still = chain(USUAL), np.zeros(3)
    for speed in (1e-9, 1e-150, 1e-300, 5e-324):
        for mu in (0.0, 0.4):
            contact, sliding = Contact(FORWARD, 0.8, mu), (-speed, 0.5, 0.2)
            name = f"grazing, n.v = {speed:g} m/s, mu {mu:g}"
            yield Kick(name, leg, BENT, still, Ball(), contact, sliding)
    for spin in (1e6, 1e12, 1e100):
        contact = Contact(OBLIQUE, 0.8, 0.4)
        yield Kick(
            f"spin of {spin:g} rad/s", leg, BENT, SPEEDS, Ball(), contact,
            ball_spin=(0.3 * spin, spin, 0.0),
        )  # fmt: skip


def sizes(longest: int = 500) -> Iterator[Kick]:
    """Yield chains of 1 to 500 joints, lengths of 12 decades, and a base far away."""
    for n in (1, 2, 50, 500):
        if n > longest:
            continue
        rng = np.random.default_rng(n)
        leg = chain([1.0 / n] * n, [1.0 / n] * n)
        q, v = rng.uniform(-0.5, 0.5, n), rng.normal(size=n)
        way = leg.posture(q).point_velocity(v)
        normal = way / np.linalg.norm(way) + (0.1, 0.0, 0.2)
        yield Kick(f"chain of {n}", leg, q, v, Ball(), Contact(normal, 0.8, 0.4))
    lengths = [(1e-6,) * 3, (1e6,) * 3, (1e-6, 1.0, 1e6), (1e6, 1.0, 1e-6)]
    for size in lengths:
        name = "links of " + ", ".join(f"{one:g}" for one in size) + " m"
        contact = Contact(OBLIQUE, 0.8, 0.4)
        yield Kick(name, chain(size), BENT, SPEEDS, Ball(), contact)
    contact = Contact(OBLIQUE, 0.8, 0.4)
    far = (1e9, -1e9, 1e9)
    yield Kick("base at 1e9 m", chain(USUAL, base=far), BENT, SPEEDS, Ball(), contact)


def shorts() -> Iterator[Kick]:
    """Yield short links before long ones, and light ones before heavy: M loses its digits."""
    contact = Contact((2.0, 0.3, 1.0), 0.8, 0.4)
    short = [(0.1, 1.0, 1.0), (0.01, 1.0, 1.0), (0.01, 100.0, 1.0), (1e-3, 1e3, 1.0)]
    for size in [*short, (0.01, 1.0, 0.01), (1.0, 1e-3, 1e3), (1e3, 1e-3, 1.0)]:
        name = "links of " + ", ".join(f"{one:g}" for one in size) + " m"
        yield Kick(name, chain(size), BENT, SPEEDS, Ball(), contact)


def turnings() -> Iterator[Kick]:
    """Yield balls from a shell to nearly a particle, which resists turning by nothing."""
    for factor in (2 / 3, 1e-4, 1e-10, 1e-16, 1e-100, 1e-300):
        ball = Ball(inertia_factor=factor)
        contact = Contact(OBLIQUE, 0.8, 0.4)
        yield Kick(f"inertia factor {factor:.2g}", chain(USUAL), BENT, SPEEDS, ball, contact)


def slows() -> Iterator[Kick]:
    """Yield kicks that slip, ever slower: the law knows no speed."""
    contact = Contact((2.0, 0.8, 1.0), 0.8, 0.4)
    for speed in (1.0, 1e-60, 1e-100, 1e-300):
        v = speed * np.array(SPEEDS)
        yield Kick(f"slip at {speed:g} of the speed", chain(USUAL), BENT, v, Ball(), contact)


def heavies() -> Iterator[Kick]:
    """Yield balls that are heavy beside what they stick to: the impulse loses digits, and says."""
    contact, coming = Contact((0.0, 0.1, -1.0), 0.8, 3.0), (0.3, 0.0, 4.0)
    for mass in (1e3, 1e6, 1e12):
        for bend in (1e-3, 1e-9):
            name = f"ball of {mass:g} kg, bent by {bend:g} rad, mu 3"
            q, spin = (0.0, bend, 0.0), (300.0, 1000.0, 0.0)
            yield Kick(name, chain(USUAL), q, SPEEDS, Ball(mass), contact, coming, spin)
    leg, contact = chain(USUAL, (1e-8, 1e8, 1e-8)), Contact((2.0, 0.3, 1.0), 0.8, 0.4)
    yield Kick("links of 1e-8, 1e8, 1e-8 kg", leg, BENT, SPEEDS, Ball(), contact)


def cancellations() -> Iterator[Kick]:
    """Yield normals across the foot's velocity but for a share: the approach cancels."""
    leg = chain(USUAL)
    way = leg.posture(BENT).point_velocity(SPEEDS)
    way /= np.linalg.norm(way)
    aside = np.array([way[2], 0.0, -way[0]])
    for share in (1e-4, 1e-8, 1e-12, 1e-14, 1e-15, 1e-16):
        contact = Contact(aside + share * way, 0.8, 0.4)
        yield Kick(f"approach of {share:g} of the speed", leg, BENT, SPEEDS, Ball(), contact)


def centrals() -> Iterator[Kick]:
    """Yield feet that come along the normal but for a share: sliding cancels, friction needs it."""
    leg = chain(USUAL)
    normal, aside = np.array([0.8, 0.0, 0.6]), np.array([-0.6, 0.0, 0.8])
    for share in (1e-3, 1e-6, 1e-9, 1e-11, 1e-13):
        v = leg.posture(BENT).joint_velocity(3.0 * (normal + share * aside))
        for mu in (0.05, 3.0):
            name = f"slides at {share:g} of the approach, mu {mu:g}"
            yield Kick(name, leg, BENT, v, Ball(), Contact(normal, 0.8, mu))


def ranks() -> Iterator[Kick]:
    """Yield Jacobians of rank 1 and 2, their empty rows in every order."""
    for joints in (1, 2, 3):
        for order in ((0, 1, 2), (1, 2, 0), (2, 0, 1), (0, 2, 1), (2, 1, 0), (1, 0, 2)):
            turn = np.eye(3)[list(order)]
            turn *= np.linalg.det(turn)
            leg = chain(USUAL[:joints], turn=turn)
            q, v = BENT[:joints], SPEEDS[:joints]
            way = leg.posture(q).point_velocity(v)
            contact = Contact(way / np.linalg.norm(way) + turn @ (0.1, 0.2, 0.1), 0.8, 0.4)
            name = f"{joints} parallel hinges, axes {''.join('xyz'[i] for i in order)}"
            yield Kick(name, leg, q, v, Ball(), contact)


FAMILIES: dict[str, Callable[[], Iterator[Kick]]] = {
    "posture": postures,
    "mass": masses,
    "coefficient": coefficients,
    "approach": grazes,
    "size": sizes,
    "short link": shorts,
    "turning": turnings,
    "slow": slows,
    "heavy ball": heavies,
    "cancelling": cancellations,
    "central": centrals,
    "rank": ranks,
}


def judged(family: str, kick: Kick, samples: int = 3) -> Row:
    """Return how right kickdyn is about a kick."""
    try:
        hit = kick.struck()
    except KickdynError as error:
        return Row(family, kick.name, refusal=str(error))
    structure, scene = given(hit)
    exact = exact_impact(structure, scene)
    found = answers(hit)
    allowed = conditions(structure, scene, exact, 1 if len(hit.v_after) > 10 else samples)
    errors = {name: exact[name].error(value) for name, value in found.items()}
    claims = dict.fromkeys(found, hit.digits)
    claims |= dict.fromkeys(("effective mass", "foot velocity"), FULL)
    claims |= {f"joint {i + 1}": digits for i, digits in enumerate(hit.joint_digits.tolist())}
    return compared(family, kick.name, errors, allowed, claims)


def refusals() -> list[Row]:
    """Return what becomes of NaN and inf in every argument of a strike."""
    return [
        refused(f"{name} = {bad}", made)
        for bad in (math.nan, math.inf, -math.inf)
        for name, made in _spoilt_strikes(bad).items()
    ]


def _spoilt_strikes(bad: float) -> dict[str, Callable[[], object]]:
    leg, ball, contact = chain(USUAL), Ball(), Contact(OBLIQUE, 0.8, 0.4)
    good: dict[str, Any] = {"q": BENT, "v": SPEEDS, "ball_velocity": (0.0,) * 3}
    good["ball_spin"] = (0.0,) * 3

    def attempt(q: ArrayLike, v: ArrayLike, **motion: Any) -> Impact:
        return strike(leg.posture(q), v, ball, contact, **motion)

    tries: dict[str, Callable[[], object]] = {
        name: partial(attempt, **(good | {name: (*value[:2], bad)})) for name, value in good.items()
    }
    return tries | {
        "normal": lambda: Contact((1.0, bad, 0.0), 0.8),
        "restitution": lambda: Contact(FORWARD, bad),
        "friction": lambda: Contact(FORWARD, 0.8, bad),
        "offset": lambda: Contact(FORWARD, 0.8, 0.0, (0.0, bad, 0.0)),
        "ball mass": lambda: Ball(mass=bad),
        "ball radius": lambda: Ball(radius=bad),
        "link mass": lambda: _spoilt("mass", bad),
        "link lever": lambda: _spoilt("lever", np.array([0.0, bad, 0.0])),
        "base": lambda: chain(USUAL, base=(bad, 0.0, 0.0)),
    }


def _spoilt(attribute: str, value: object) -> Leg:
    model = chain(USUAL).model
    setattr(model.inertias[1], attribute, value)
    return Leg.from_model(model, "toe")
