"""Table 2 and Fig. 7: the external impulse of three postures of the human leg."""

from functools import cache

import numpy as np

from kickdyn.contact import Contact
from kickdyn.core.validation import Array
from kickdyn.impact.impact_result import Impact
from kickdyn.impact.laws import normal_impulse
from kickdyn.impact.strike import strike
from kickdyn.paper.assumptions import BALL, RESTITUTION, direction
from kickdyn.paper.fig_1 import OBSTACLE
from kickdyn.paper.item import FITTED, Finding, Item, near, shape
from kickdyn.robot.leg import Leg, Posture

NAME = "Table 2"
SPEED = 1.0  # [m/s]
ATTACK = direction(30.0)
ROWS = {
    "a": (0.0, 1.346, 0.777, 1.554),
    "b": (20.0, 0.817, 0.472, 0.944),
    "c": (45.0, 0.559, 0.323, 0.646),
}
"""Angle of the foot to the ground [deg]; X, Y and total [N s]."""

TOTALS = np.array([total for *_, total in ROWS.values()])
HIP_DEG, KNEE_DEG = 5.0, 10.0
"""Fitted, together with e; the paper prints neither."""


def postures() -> dict[str, Posture]:
    """Return the posture of every row: the foot points down, which is our inference."""
    leg = Leg.human()
    return {
        name: leg.posture(np.radians([HIP_DEG, KNEE_DEG, down + HIP_DEG - KNEE_DEG]))
        for name, (down, *_) in ROWS.items()
    }


def impact_of(posture: Posture) -> Impact:
    """Return the impact of a posture on the obstacle."""
    v = posture.joint_velocity(SPEED * ATTACK)
    return strike(posture, v, OBSTACLE, Contact(ATTACK, RESTITUTION))


def items() -> list[Item]:
    """Return the table without the ball's term, the bound with it, and the paper's words."""
    angles, masses = search(1.0)
    needed = TOTALS / SPEED / masses  # 1 + e, were the obstacle immovable
    spread, middle = np.ptp(np.log(needed), axis=1) / 2, np.sqrt(needed.max(1) * needed.min(1))
    fits = (spread <= FITTED) & (middle <= 2.0)
    shank, e = angles[fits] @ (1.0, -1.0), middle[fits] - 1
    why = (
        "impact on an immovable obstacle; hip, knee and the restitution e are fitted to the three "
        f"totals, which determine only hip minus knee ({shank.min():g} to {shank.max():g} deg) and "
        f"e ({e.min():.2f} to {e.max():.2f}): {fits.sum()} of {len(fits)} postures fit"
    )
    source = f"Eq. (10) without the ball's term, e = 0.8, hip {HIP_DEG:g} and knee {KNEE_DEG:g} deg"
    result, totals = [], []
    for (name, posture), most in zip(postures().items(), masses.max(axis=0), strict=True):
        _, *printed = ROWS[name]
        impact = impact_of(posture)
        totals.append(float(np.linalg.norm(impact.impulse)))
        for axis, share, paper in zip((" X", " Y", ""), (*ATTACK[::2], 1.0), printed, strict=True):
            ours = totals[-1] * float(share)
            verdict = near(ours, paper, FITTED, Finding.FITTED)
            result.append(Item(f"{NAME} {name}{axis}", paper, ours, "N s", verdict, why, source))
        joint, inside = impact.worst_joint
        title, inner = f"{NAME} {name}, in the {joint}", "the largest of the joint impulses"
        result.append(Item(title, None, inside, "N s", Finding.OURS, inner, source))
        ours = normal_impulse(SPEED, RESTITUTION, impact.effective_mass, BALL.mass)
        bound, sure = (normal_impulse(SPEED, e, most, BALL.mass) for e in (RESTITUTION, 1.0))
        limit = (
            "with the mass of the ball in Eq. (10), no hip and knee angle of a search gives more "
            f"than {bound:.2g} N s at e = {RESTITUTION:g}, or {sure:.2g} N s at e = 1"
        )
        verdict = Finding.FITTED if printed[-1] <= sure else Finding.NOT_REACHABLE
        title, printed_source = f"{NAME} {name} with the ball", "Eq. (10) as printed, e = 0.8"
        result.append(Item(title, printed[-1], ours, "N s", verdict, limit, printed_source))
    return [*result, *_words(totals)]


@cache
def search(sign: float) -> tuple[Array, Array]:
    """Return hips and knees `(k, 2)` [deg], and effective masses for (a) to (c) `(k, 3)` [kg].

    The foot points down by the printed angles (sign 1) or up (sign -1), even beyond its range.
    """
    leg = Leg.human()
    angles = [(hip, knee) for hip in np.arange(-30.0, 126.0, 5.0) for knee in np.arange(141.0)]
    masses = [
        leg.posture(np.radians((hip, knee, sign * down + hip - knee))).effective_mass(ATTACK)
        for hip, knee in angles
        for down, *_ in ROWS.values()
    ]
    return np.array(angles), np.reshape(masses, (-1, len(ROWS)))


def _words(totals: list[float]) -> list[Item]:
    """Return least errors of other readings, and how the totals fit the words of Section V.A."""
    down, up = search(1.0)[1], search(-1.0)[1]
    obstacle, ball, foot_up = (
        100 * float(np.ptp(np.log(TOTALS / masses), axis=1).min() / 2)
        for masses in (down, 1 / (1 / down + 1 / BALL.mass), up)
    )
    first, *_, last = (90 + down + HIP_DEG - KNEE_DEG for down, *_ in ROWS.values())
    straight = (
        'the paper says "the posture of straight ankle transmits large external impulse"; this '
        f"holds if the straight ankle is the ankle of (a), {first:g} deg between shank and foot"
    )
    small = (
        'the paper says that the impulse "becomes smaller for the small angle of the ankle"; here '
        f"it falls while the angle between shank and foot grows from {first:g} to {last:g} deg; "
        "with the foot turned up, no posture of a search gives the totals"
    )
    why = (
        "of the three totals for the postures of a search, with any factor 1 + e; without the "
        f"ball's term it is {obstacle:.2f} %: that Table 2 is an impact on an immovable obstacle "
        "is an inference from this"
    )
    falls, missed = shape(totals == sorted(totals, reverse=True)), Finding.NOT_REACHABLE
    return [
        Item(f"{NAME} a over c", None, totals[0] / totals[2], "1", falls, straight, "Section V.A"),
        Item(
            f"{NAME} least error, foot turned up", None, foot_up, "%", missed, small, "Section V.A"
        ),
        Item(f"{NAME} least error, with the ball", None, ball, "%", missed, why, "Eq. (10)"),
    ]
