"""Impacts at the extremes: each is right to the digits its condition allows, or is refused."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike
from references.exact_impact import Quantity, exact_impact, given
from references.exact_leg import DIGITS, Exact, length, mapped, mp

from extremes.extreme_case import FULL, ExtremeCase, compare
from kickdyn.ball import Ball
from kickdyn.contact import Contact
from kickdyn.core.validation import Array
from kickdyn.errors import KickdynError
from kickdyn.impact.impact_result import Impact
from kickdyn.impact.strike import strike
from kickdyn.robot.leg import Leg

FORWARD, DOWN = (1.0, 0.0, 0.0), (0.0, 0.0, -1.0)
OBLIQUE, SIDEWAYS = (2.0, 0.3, 1.0), (2.0, 0.8, 1.0)
"""Normals."""

ROUGH = Contact(OBLIQUE, 0.8, 0.4)
"""A contact with friction."""

BENT, SPEEDS = (0.4, 0.7, -0.3), (-3.0, -5.0, -4.0)
"""Angles of the joints [rad] and their velocities [rad/s]."""

USUAL = (0.45, 0.43, 0.2)
"""Lengths of a leg [m]."""

NUDGE = mp.mpf(10) ** -(DIGITS // 2)
"""Relative change of numbers, by which conditions are estimated."""

LONGEST = 500
"""Joints of the longest chain; the reference takes half a minute for it."""


class ExtremeKick(NamedTuple):
    """A strike that is compared with the reference."""

    name: str
    leg: Leg
    q: ArrayLike
    v: ArrayLike
    ball: Ball
    contact: Contact
    ball_velocity: ArrayLike = (0.0, 0.0, 0.0)
    ball_spin: ArrayLike = (0.0, 0.0, 0.0)

    def impact(self) -> Impact:
        """Return kickdyn's answer."""
        return strike(self.leg.posture(self.q), self.v, self.ball, self.contact,
            ball_velocity=self.ball_velocity, ball_spin=self.ball_spin)  # fmt: skip


def chain(
    lengths: Sequence[float],
    masses: Sequence[float] | None = None,
    base: ArrayLike = (0.0, 0.0, 0.0),
    turn: Array | None = None,
) -> Leg:
    """Return slender rods that hang from each other, hinged about y; contact at the last end."""
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


def usual(
    name: str, contact: Contact, lengths: Sequence[float] = USUAL, **changes: Any
) -> ExtremeKick:
    """Return a kick by a chain that is bent, at usual speeds, of a usual ball, unless changed."""
    parts: dict[str, Any] = {"leg": chain(lengths), "q": BENT, "v": SPEEDS, "ball": Ball()}
    return ExtremeKick(name, contact=contact, **(parts | changes))


def postures() -> Iterator[ExtremeKick]:
    """Yield straight and nearly straight legs: the foot hardly moves along the normal."""
    still, coming = np.zeros(3), {"ball_velocity": (0.3, 0.0, 4.0)}
    for mu in (0.0, 0.4):
        contact, name = Contact(DOWN, 0.8, mu), f", normal along it, mu {mu:g}"
        yield usual("straight leg" + name, contact, q=still, v=still, **coming)
        for bend in (1e-3, 1e-6, 1e-9, 1e-12, 1e-200):
            yield usual(f"bent by {bend:g} rad" + name, contact, q=(0.0, bend, 0.0), **coming)


def masses() -> Iterator[ExtremeKick]:
    """Yield mass ratios of 24 decades."""
    for first, last in ((1.0, 1e-12), (1e-12, 1.0), (1e12, 1.0), (1.0, 1e12)):
        leg = chain(USUAL, (first, math.sqrt(first * last), last))
        yield usual(f"links of {first:g} to {last:g} kg", Contact(OBLIQUE, 0.8), leg=leg)
    for mass in (1e-12, 1e12):
        for mu in (0.0, 0.4):
            contact = Contact(OBLIQUE, 0.8, mu)
            yield usual(f"ball of {mass:g} kg, mu {mu:g}", contact, ball=Ball(mass))


def coefficients() -> Iterator[ExtremeKick]:
    """Yield the ends of restitution and friction."""
    for e in (0.0, 1.0, 1.0 - 1e-15):
        for mu in (0.0, 0.1, 0.4):
            yield usual(f"e {e:.16g}, mu {mu:g}", Contact(OBLIQUE, e, mu))
    for mu in (1e-300, 1e-12, 1e6, 1e300):
        yield usual(f"mu {mu:g}", Contact(SIDEWAYS, 0.8, mu))


def grazes() -> Iterator[ExtremeKick]:
    """Yield approaches that hardly are any, and spins beyond all balls."""
    for speed in (1e-9, 1e-150, 1e-300, 5e-324):
        for mu in (0.0, 0.4):
            name = f"grazing, n.v = {speed:g} m/s, mu {mu:g}"
            sliding = (-speed, 0.5, 0.2)
            yield usual(name, Contact(FORWARD, 0.8, mu), v=np.zeros(3), ball_velocity=sliding)
    for spin in (1e6, 1e12, 1e100):
        yield usual(f"spin of {spin:g} rad/s", ROUGH, ball_spin=(0.3 * spin, spin, 0.0))


def sizes(longest: int = LONGEST) -> Iterator[ExtremeKick]:
    """Yield chains of 1 to 500 joints, lengths of 12 decades, and a base far away."""
    for n in (n for n in (1, 2, 50, 500) if n <= longest):
        rng = np.random.default_rng(n)
        leg = chain([1.0 / n] * n, [1.0 / n] * n)
        q, v = rng.uniform(-0.5, 0.5, n), rng.normal(size=n)
        velocity = leg.posture(q).point_velocity(v)
        normal = velocity / np.linalg.norm(velocity) + (0.1, 0.0, 0.2)
        yield usual(f"chain of {n}", Contact(normal, 0.8, 0.4), leg=leg, q=q, v=v)
    for size in ((1e-6,) * 3, (1e6,) * 3, (1e-6, 1.0, 1e6), (1e6, 1.0, 1e-6)):
        yield usual(_links(size), ROUGH, size)
    yield usual("base at 1e9 m", ROUGH, leg=chain(USUAL, base=(1e9, -1e9, 1e9)))


def short_links() -> Iterator[ExtremeKick]:
    """Yield short links before long ones, and light ones before heavy: M loses its digits."""
    short = [(0.1, 1.0, 1.0), (0.01, 1.0, 1.0), (0.01, 100.0, 1.0), (1e-3, 1e3, 1.0)]
    for size in [*short, (0.01, 1.0, 0.01), (1.0, 1e-3, 1e3), (1e3, 1e-3, 1.0)]:
        yield usual(_links(size), ROUGH, size)


def _links(lengths: Sequence[float]) -> str:
    return f"links of {', '.join(f'{one:g}' for one in lengths)} m"


def heavy_balls() -> Iterator[ExtremeKick]:
    """Yield balls that are heavy beside what they stick to: the impulse loses digits, and says."""
    contact = Contact((0.0, 0.1, -1.0), 0.8, 3.0)
    motion = {"ball_velocity": (0.3, 0.0, 4.0), "ball_spin": (300.0, 1000.0, 0.0)}
    for mass in (1e3, 1e6, 1e12):
        for bend in (1e-3, 1e-9):
            name = f"ball of {mass:g} kg, bent by {bend:g} rad, mu 3"
            yield usual(name, contact, q=(0.0, bend, 0.0), ball=Ball(mass), **motion)
    yield usual("links of 1e-8, 1e8, 1e-8 kg", ROUGH, leg=chain(USUAL, (1e-8, 1e8, 1e-8)))


def cancellations() -> Iterator[ExtremeKick]:
    """Yield normals across the foot's velocity but for a share: the approach cancels."""
    along = chain(USUAL).posture(BENT).point_velocity(SPEEDS)
    along /= np.linalg.norm(along)
    across = np.array([along[2], 0.0, -along[0]])
    for share in (1e-4, 1e-8, 1e-12, 1e-14, 1e-15, 1e-16):
        normal = across + share * along
        yield usual(f"approach of {share:g} of the speed", Contact(normal, 0.8, 0.4))


FAMILIES: dict[str, Callable[[], Iterator[ExtremeKick]]] = {
    "posture": postures, "mass": masses, "coefficient": coefficients, "approach": grazes,
    "size": sizes, "short link": short_links, "heavy ball": heavy_balls,
    "cancelling": cancellations}  # fmt: skip
"""By name of the family."""


def judge(family: str, kick: ExtremeKick) -> ExtremeCase:
    """Return how right kickdyn is about a kick."""
    try:
        impact = kick.impact()
    except KickdynError as error:
        return ExtremeCase(family, kick.name, refusal=str(error))
    structure, scene = given(impact)
    exact = exact_impact(structure, scene)
    found = answers(impact)
    allowed = conditions(structure, scene, exact, 1 if len(impact.v_after) > 10 else 3)
    errors = {name: exact[name].error(value) for name, value in found.items()}
    claims = dict.fromkeys(found, impact.digits)
    claims["foot velocity"] = FULL
    if impact.posture.rounding_gain < 100.0:
        claims["effective mass"] = FULL
    claims |= {f"joint {i + 1}": digits for i, digits in enumerate(impact.joint_digits.tolist())}
    return compare(family, kick.name, errors, allowed, claims)


def conditions(
    structure: dict[str, Any], scene: dict[str, Exact], exact: dict[str, Quantity], samples: int = 4
) -> dict[str, float]:
    r"""Return the condition number of each answer, by name, at least 1.

    It estimates by how many times :math:`\epsilon` an answer changes at most, relative to its
    scale, if every number of the scene changes by up to a share :math:`\epsilon` of itself: float64
    inputs then allow 15 - log10(condition) digits, whatever the algorithm. With the change by all N
    numbers, each up or down at random, of mean square :math:`s^2`, the worst combination of signs
    makes at most :math:`\sqrt N s` (Cauchy-Schwarz); s itself is a mean over a few samples.
    Structure and scene are those of `given`, with their exact answers.
    """
    rng = np.random.default_rng(50)
    squares = dict.fromkeys(exact, 0.0)
    count = 0

    def nudge(value: Any) -> Any:
        nonlocal count
        count += value != 0
        return value * (1 + NUDGE * int(rng.choice((-1, 1))))

    for _ in range(samples):
        nudged = {name: mapped(nudge, values) for name, values in scene.items()}
        moved = exact_impact(structure, nudged)
        for name, one in exact.items():
            if one.scale and mp.isfinite(one.scale):
                change = length(moved[name].exact - one.exact) / one.scale
                squares[name] += float(change / NUDGE) ** 2
    spread = count / samples**2  # numbers per sample, over samples
    return {name: max(1.0, math.sqrt(spread * square)) for name, square in squares.items()}


def answers(impact: Impact) -> dict[str, Any]:
    """Return the answers of `strike`, by the names of `exact_impact`."""
    found: dict[str, Any] = {"impulse": impact.impulse, "effective mass": impact.effective_mass,
        "foot velocity": impact.foot_velocity, "ball velocity": impact.ball_after.velocity,
        "ball spin": impact.ball_after.spin, "joint velocity": impact.v_after,
        "energy lost": impact.energy_lost}  # fmt: skip
    return found | {f"joint {i + 1}": wrench for i, wrench in enumerate(impact.joint_impulses)}


def impact_cases(longest: int = LONGEST) -> Iterator[ExtremeCase]:
    """Yield every impact, chains up to `longest` joints."""
    for family, kicks in FAMILIES.items():
        for kick in sizes(longest) if family == "size" else kicks():
            yield judge(family, kick)
