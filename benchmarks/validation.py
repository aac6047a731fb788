"""Compare kickdyn with published measurements: `python benchmarks/validation.py`.

It prints the table of docs/explanation/validation.md and the rows of README.md, and writes the
table with the assumptions of each row to validation.csv beside that page, which has the rules of
the verdicts; the functions below follow them.
"""

import csv
import io
import math
import re
from collections.abc import Callable, Iterable, Iterator
from functools import cache
from itertools import product
from pathlib import Path
from typing import NamedTuple

import compliance
import numpy as np
from compliance import INFLATED, distance, head_on, peak_over_mean
from foot_patch import FOOT, OFFSETS, SPEED, kicked, sliding_foot, spin
from inflated_ball import constant, force_over_time, peak_force, restitution, spring_force
from scipy.optimize import brentq
from scipy.stats import qmc

import kickdyn as kd
from kickdyn.aerodynamics import drag, lift
from kickdyn.impact.patch_contact import STIFFNESS_RATIO, FootPatch
from kickdyn.paper.item import MEASURED

ROOT = Path(__file__).resolve().parent.parent
TRACK = ROOT / "data" / "match_ball.csv"
TABLE = ROOT / "docs" / "explanation" / "validation.csv"
SLOW, FAST = 9.1, 21.2
"""Foot speeds of M1 [m/s]."""

MODEL = "peacock-ball"
HERTZ = head_on(15.0).force_model.stiffness
"""Of the spring whose force acts for 10 ms at 15 m/s [N/m^1.5]."""


WALL = sliding_foot(1e4)
"""A foot that hardly gives way."""


class Row(NamedTuple):
    """A row of the table, with its note; rows with a short name are in README.md, too."""

    number: str
    what: str
    measured: str
    ours: str
    verdict: str
    note: str = ""
    short: str = ""


def verdict(inside: Iterable[bool]) -> str:
    """Return the verdict on the values of a row, each of which agrees or not."""
    found = list(inside)
    return "agrees" if all(found) else "**partly**" if any(found) else "**disagrees**"


def within(low: float, high: float, *values: float) -> str:
    """Return the verdict on values where a range or a scatter was measured."""
    return verdict(low <= value <= high for value in values)


def close(*pairs: tuple[float, float]) -> str:
    """Return the verdict on pairs of ours and a measured value without a range."""
    return verdict(abs(ours / measured - 1.0) <= MEASURED for ours, measured in pairs)


def range_within(low: float, high: float, least: float, most: float) -> str:
    """Return the verdict on all values from least to most, where a range was measured."""
    if least > high or most < low:
        return "**disagrees**"
    return "agrees" if low <= least and most <= high else "**partly**"


def percent(change: float, digits: int = 1) -> str:
    """Return a relative change in percent, with its sign."""
    text = f"{100.0 * change:+.{digits}f} %"
    return text if float(text[:-2]) else text[1:]


def sign(change: float, measured: int) -> str:
    """Return the verdict on a trend of which the sign is known."""
    return "same sign" if change * measured > 0.0 else "**disagrees**"


def mechanical_limb() -> Iterator[Row]:
    """Yield the rows of M1: a foot of the mass of M2."""
    slow, fast = (head_on(speed, MODEL, stiffness=HERTZ) for speed in (SLOW, FAST))
    times = 1e3 * slow.visible_contact_time, 1e3 * fast.visible_contact_time
    yield Row(
        "M1", "contact time, foot at 9.1 and 21.2 m/s", "14.75 falling to 11.75 ms, -20 %",
        f"{times[0]:.1f} falling to {times[1]:.1f} ms, {percent(times[1] / times[0] - 1.0, 0)}",
        close((times[0], 14.75), (times[1], 11.75)),
        "Visible contact time. With the spring from pressure it does not depend on the speed.",
        "contact time of a mechanical limb, foot at 9.1 and 21.2 m/s",
    )  # fmt: skip
    ends = [head_on(SLOW, e) for e in (0.66, 0.79)]
    ratios = [float(hit.ball_after.speed) / SLOW for hit in ends]
    yield Row(
        "M1", "ball over foot speed with the measured e, 0.66 to 0.79", "1.37 to 1.48",
        f"{ratios[0]:.2f} to {ratios[1]:.2f}", range_within(1.37, 1.48, *ratios),
        "The mass of the limb is not stated; the foot of M2 stands in.",
    )  # fmt: skip
    hits = [head_on(speed, "inflated") for speed in (SLOW, FAST)]
    ratios = [
        float(hit.ball_after.speed) / speed for hit, speed in zip(hits, (SLOW, FAST), strict=True)
    ]
    yield Row(
        "M1", "the same as the foot moves faster, inflated ball", "falls (r = -0.694)",
        f"{ratios[0]:.2f} falling to {ratios[1]:.2f}", sign(ratios[1] - ratios[0], -1),
    )  # fmt: skip
    values = [
        (float(hit.ball_after.speed) - float(hit.v_after[0])) / speed
        for hit, speed in zip(hits, (SLOW, FAST), strict=True)
    ]
    yield Row(
        "M1", "e, foot at 9.1 and 21.2 m/s, inflated ball", "0.66 to 0.79, no significant trend",
        f"{values[0]:.2f} falling to {values[1]:.2f}", range_within(0.66, 0.79, *sorted(values)),
        "A loss that does not grow with the deflection is missing: the shell of an Australian "
        "football takes more than the fitted factor of a soccer ball, and its pressure is not "
        "stated.",
    )  # fmt: skip
    moved = 1e2 * distance(slow), 1e2 * distance(fast)
    yield Row(
        "M1", "contact distance", "10.7 to 20.2 cm", f"{moved[0]:.1f} to {moved[1]:.1f} cm",
        range_within(10.7, 20.2, *moved),
        f"The ends of the distance that the foot moves in contact differ by "
        f"{percent(moved[0] / 10.7 - 1.0, 0)} and {percent(moved[1] / 20.2 - 1.0, 0)}.",
    )  # fmt: skip


def punts() -> Iterator[Row]:
    """Yield the rows of M2 to M5."""
    masses = [
        compliance.LEG.posture(np.radians(angles)).effective_mass(compliance.ATTACK)
        / compliance.BALL.mass
        for angles in ((40.0, 30.0, -20.0), (5.0, 10.0, -5.0))
    ]
    losses = [22.7 / mass for mass in masses]
    yield Row(
        "M2", "speed that the foot loses where the ball gains 22.7 m/s", "5.0 +- 1.1 m/s",
        f"{losses[0]:.1f} and {losses[1]:.1f} m/s in two postures",
        within(3.9, 6.1, *losses),
        f"The effective mass of the leg is {masses[0]:.1f} ball masses at hip, knee, ankle of 40, "
        f"30, -20 deg, which gives the fastest ball and agrees, and {masses[1]:.1f} at 5, 10, -5 "
        "deg. The abstract has no postures.",
        "speed that the foot loses where the ball gains 22.7 m/s",
    )  # fmt: skip
    gain = float(head_on(1.0).ball_after.speed)
    springs: tuple[float | str, ...] = (head_on(15.0).force_model.stiffness, "pressure")
    kicks = [head_on(22.7 / gain, stiffness=stiffness) for stiffness in springs]
    hit = kicks[0]
    means, ratios = [], []
    for duration in ("visible_contact_time", "contact_time"):
        means.append([INFLATED.mass * 22.7 / getattr(kick, duration) for kick in kicks])
        ratios.append(
            [peak_over_mean(kick) * getattr(kick, duration) / kick.contact_time for kick in kicks]
        )
    low, high, names = 834 - 107, 834 + 107, "of the visible contact, {} while the force acts"
    both = any(
        close((ratio, 1.97)) == within(low, high, mean) == "agrees"
        for pairs in zip(means, ratios, strict=True)
        for mean, ratio in zip(*pairs, strict=True)
    )
    yield Row(
        "M2", "mean force of distance kicks, ball gains 22.7 m/s", "834 +- 107 N",
        f"{means[0][0]:.0f} N {names.format(f'{means[1][0]:.0f} N')}",
        within(low, high, means[0][0], means[1][0]),
        "The abstracts of M2 and M3 do not define the mean: M2 agrees with the visible contact, M3 "
        "with the time for which the force acts. With the spring from pressure the means of M2 "
        f"are {means[0][1]:.0f} and {means[1][1]:.0f} N.",
    )  # fmt: skip
    yield Row(
        "M3", "peak over mean force", "1.97",
        f"{ratios[0][0]:.2f}, mean {names.format(f'{ratios[1][0]:.2f}')}",
        close((ratios[0][0], 1.97), (ratios[1][0], 1.97)),
        f"With the spring from pressure the ratios are {ratios[0][1]:.2f} and {ratios[1][1]:.2f}. "
        "No choice of mean and spring agrees with both M2 and M3.",
    )  # fmt: skip
    assert not both, "the note on M3 says so"
    for name, stiffness in (("Hertz's spring", HERTZ), ("spring from pressure", "pressure")):
        forces = [
            head_on(speed / gain, stiffness=stiffness).peak_force for speed in compliance.MAXIMAL
        ]
        last = 2926.0 / forces[1] * compliance.MAXIMAL[1]  # both forces are nearly proportional
        yield Row(
            "M4", f"peak force of instep kicks, ball at 25.6 to 34.5 m/s, {name}",
            "1610 to 2926 N (three studies)", f"{forces[0]:.0f} to {forces[1]:.0f} N",
            range_within(1610.0, 2926.0, *forces),
            f"With {'the ' if stiffness == 'pressure' else ''}{name}, the force agrees up to a "
            f"ball of about {last:.0f} m/s."
            + (
                " The ball speeds are from M10."
                if stiffness == HERTZ
                else " Its range ends at a foot speed of [13 to 17 "
                "m/s](compliance.md#stiffness-from-pressure)."
            ),
            f"peak force of maximal instep kicks, {name}" if stiffness == HERTZ else "",
        )  # fmt: skip

    def missing(foot: float, ball: float) -> float:
        return float(head_on(foot, "inflated", tol=1e-6).ball_after.speed) - ball

    feet = [brentq(missing, 10.0, 30.0, (speed,), xtol=1e-3) for speed in compliance.MAXIMAL]
    forces = [head_on(speed, "inflated").peak_force for speed in feet]
    yield Row(
        "M4", "peak force of instep kicks, ball at 25.6 to 34.5 m/s, inflated ball",
        "1610 to 2926 N (three studies)", f"{forces[0]:.0f} to {forces[1]:.0f} N",
        range_within(1610.0, 2926.0, *forces),
        "The force of [`restitution=\"inflated\"`](inflated-ball.md#force-on-a-wall) has no fitted "
        "time or stiffness; the foot has 1.95 kg, and a ball of 80 kPa.",
    )  # fmt: skip
    share = hit.contact_time / hit.visible_contact_time
    yield Row(
        "M5", "time of acceleration over visible contact", "about 3/4", f"{share:.2f}",
        close((share, 0.75)), "e is 0.7.",
        "time of acceleration over visible contact",
    )  # fmt: skip
    torque = 0.1 * np.sign(compliance.V) * compliance.LEG.effort_limit
    changes = []
    for pair in (
        [head_on(15.0, contact_time=1e-3 * ms) for ms in (8.0, 12.0)],
        [compliance.through_time(ms) for ms in (8.0, 12.0)],
        [compliance.through_time(ms, torque=torque) for ms in (8.0, 12.0)],
    ):
        slow, fast = (float(one.ball_after.speed) for one in pair)
        changes.append(round(fast / slow - 1.0, 9) + 0.0)
    shown = [percent(change) for change in changes]
    yield Row(
        "M5", "ball speed with a longer contact", "not faster",
        f"8 to 12 ms: {shown[0]} (two masses), {shown[1]} (human leg), {shown[2]} (human leg with "
        "a tenth of its joint torques)",
        verdict(abs(change) <= MEASURED for change in changes),
        "A change of less than 10 % counts as none.",
    )  # fmt: skip


def ankles() -> Iterator[Row]:
    """Yield the rows of M17: the human leg with a free and a stiff ankle, struck at two places."""
    q, along = np.radians([5.0, 10.0, -5.0]), compliance.ATTACK
    posture = compliance.LEG.posture(q)
    stiff = compliance.LEG.with_stiff_joints("ankle").posture(q)
    back = -0.05 * posture.contact_lever / np.linalg.norm(posture.contact_lever)
    masses, balls, values = [], [], []
    for struck in (posture, stiff, posture.with_contact_offset(back)):
        contact = kd.Contact(along, compliance.RESTITUTION, offset=struck.contact_offset)
        hit = kd.strike(struck, compliance.V, compliance.BALL, contact)
        masses.append(struck.effective_mass(along))
        balls.append(float(hit.ball_after.speed))
        apart = hit.ball_after.velocity - struck.point_velocity(hit.v_after)
        values.append(float(along @ apart) / float(along @ hit.foot_velocity))
    yield Row(
        "M17", "effective mass and ball speed with a stiffer ankle", "both grow",
        f"{masses[0]:.2f} to {masses[1]:.2f} kg, {balls[0]:.1f} to {balls[1]:.1f} m/s, ankle free "
        "and stiff",
        sign(min(masses[1] - masses[0], balls[1] - balls[0]), 1),
        "The human leg at hip, knee, ankle of 5, 10, -5 deg, its toe at 14 m/s, a normal 30 deg "
        "up, e = 0.7. Where the normal is along the foot, as at 40, 30, -20 deg, the ankle matters "
        "little.",
    )  # fmt: skip
    yield Row(
        "M17", "ball speed where the ball is struck nearer to the toes", "falls",
        f"{balls[2]:.1f} to {balls[0]:.1f} m/s, 5 cm from the tip of the toes and there",
        sign(balls[0] - balls[2], -1),
        "The same kick, ankle free: the effective mass falls, not e.",
    )  # fmt: skip
    yield Row(
        "M17", "e where the ball is struck nearer to the toes", "falls",
        f"{values[2]:.2f} at both places", sign(round(values[0] - values[2], 9), -1),
        "A foot of kickdyn is one rigid body: toes that bend and take energy are missing.",
    )  # fmt: skip


def beside_the_centre(offset: float, friction: float) -> kd.BallState:
    """Return the ball after a kick at 17 m/s along x, offset [m] from its centre, law `stronge`."""
    across = offset / INFLATED.radius
    contact = kd.Contact((math.sqrt(1.0 - across**2), -across, 0.0), 0.7, friction)
    kick = kd.strike(FOOT, [SPEED, 0.0, 0.0], INFLATED, contact, law="stronge")
    return kick.ball_after


def spin_beside_the_centre(offset: float, friction: float) -> float:
    """Return the size of its spin [rad/s]."""
    return math.hypot(*beside_the_centre(offset, friction).spin)


def curves() -> Iterator[Row]:
    """Yield the rows of M8 and M9: a foot that passes beside the ball's centre."""
    offsets = np.arange(0.0, 0.106, 0.005)
    spins = {mu: [spin_beside_the_centre(x, mu) for x in offsets] for mu in (0.0, 0.4, 1.0)}
    grown = spins[0.4][16] - spins[0.4][4]
    yield Row(
        "M8", "spin as the offset grows", "grows",
        f"{spins[0.4][4]:.0f} to {spins[0.4][16]:.0f} rad/s from 20 to 80 mm, mu = 0.4",
        sign(grown, 1),
    )  # fmt: skip
    patch = {mu: [spin(x, mu) for x in OFFSETS] for mu in (0.0, 0.4, 1.0)}
    last = 1e3 * OFFSETS[-1]
    yield Row(
        "M8", "the same without friction, strip of the foot", "grows",
        f"{patch[0.0][2]:.0f} to {patch[0.0][-1]:.0f} rad/s from 20 to {last:.0f} mm",
        sign(min(np.diff(patch[0.0])), 1),
    )  # fmt: skip
    added = [one - none for one, none in zip(spins[1.0], spins[0.0], strict=True)]
    yield Row(
        "M8", "spin as friction grows", "grows", f"{spins[0.0][20]:.0f}, {spins[0.4][20]:.0f}, "
        f"{spins[1.0][20]:.0f} rad/s with mu = 0, 0.4, 1 at 100 mm",
        sign(min(np.diff([spins[mu][20] for mu in (0.0, 0.4, 1.0)])), 1),
    )  # fmt: skip
    by_strip = [one - none for one, none in zip(patch[1.0], patch[0.0], strict=True)]
    why = (
        "At a point, only friction gives a ball spin ([why](impact.md#spin-without-friction))"
        ". A strip of the foot of 80 mm (`FootPatch`) gives some without friction ([strip of "
        f"the foot](inflated-ball.md#a-strip-of-the-foot)); it is computed up to {last:.0f} mm. "
        "For kicks with spin, fit the friction to measured spin (`kd.infer_impact`)."
    )
    yield Row(
        "M8", "spin that friction of 1 instead of 0 adds", "13 rad/s at most",
        f"{max(added):.0f} rad/s at {1e3 * offsets[int(np.argmax(added))]:.0f} mm, strip of the "
        f"foot {max(by_strip):.0f} rad/s at {1e3 * OFFSETS[int(np.argmax(by_strip))]:.0f} mm",
        within(0.0, 13.0, max(added), max(by_strip)), why,
    )  # fmt: skip
    yield Row(
        "M8", "spin without friction", "not 0",
        f"{max(spins[0.0]):.0f} rad/s, strip of the foot up to {max(patch[0.0]):.0f} rad/s",
        verdict([max(spins[0.0]) > 1.0, max(patch[0.0]) > 1.0]), why, "spin without friction",
    )  # fmt: skip
    most = [1e3 * float(offsets[int(np.argmax(spins[mu]))]) for mu in (0.4, 1.0)]
    strip = [1e3 * OFFSETS[int(np.argmax(patch[mu]))] for mu in (0.4, 1.0)]
    yield Row(
        "M8", "offset of the largest spin", "about 100 mm",
        f"{most[0]:.0f} mm with mu = 0.4, {most[1]:.0f} mm with mu = 1, strip of the foot "
        f"{strip[0]:.0f} and {strip[1]:.0f} mm",
        close(*((value, 100.0) for value in most + strip)),
        "",
    )  # fmt: skip
    at_24 = []
    for x in offsets:
        after = beside_the_centre(x, 0.63)
        at_24.append(24.0 * math.hypot(*after.spin) / float(after.speed))
    reached = 1e3 * float(
        np.interp(106.0, at_24[: int(np.argmax(at_24))], offsets[: int(np.argmax(at_24))])
    )
    angles = np.arange(0.0, 61.0, 10.0)
    hits = [kicked(0.0, 0.63, angle=math.radians(angle)).ball_after for angle in angles]
    swiped = [24.0 * math.hypot(*after.spin) / float(after.speed) for after in hits]
    rising = int(np.argmax(swiped)) + 1
    turned = float(np.interp(106.0, swiped[:rising], angles[:rising]))
    yield Row(
        "M9", "spin of curling free kicks at 24 m/s", "106 rad/s on average",
        f"0 to {max(at_24):.0f} rad/s, strip of the foot 0 to {max(swiped):.0f} rad/s",
        range_within(0.9 * 106.0, 1.1 * 106.0, 0.0, min(max(at_24), max(swiped))),
        f"The offset is not known; {reached:.0f} mm gives 106 rad/s, with mu = 0.63, the largest "
        "measured against leather. The strip strikes the middle of the ball, on a path at 0 to 60 "
        f"deg to its normal; {turned:.0f} deg gives 106 rad/s.",
        "spin of curling free kicks at 24 m/s, over the offset",
    )  # fmt: skip


GRIP = 0.37
"""Tangential over normal stiffness of a patch with which friction adds the spin of M8."""


def bounces() -> Iterator[Row]:
    """Yield the row of M16: a ball at 10 m/s, 45 deg from above, on a wide and heavy foot.

    And the spins of M8, M9 and M16 with one tangential stiffness for all three.
    """
    before = 10.0 * np.array([1.0, 0.0, -1.0]) / math.sqrt(2.0)
    heavy, rest, ends = sliding_foot(1e4), np.zeros(3), []
    for mu, grip in ((0.8, STIFFNESS_RATIO), (0.1, STIFFNESS_RATIO), (0.8, GRIP)):
        patch = FootPatch(math.inf, across=(1, 0, 0), grip=grip)
        contact = kd.Contact((0, 0, 1), "inflated", mu)
        soft = kd.collide(
            heavy, rest, INFLATED, contact, model=patch, ball_velocity=before, tol=1e-7
        )
        rigid = kd.strike(heavy, rest, INFLATED, contact, law="stronge", ball_velocity=before)
        ends.append(soft.ball_after.spin[1] / rigid.ball_after.spin[1] - 1.0)
    yield Row(
        "M16", "spin of a ball after an oblique bounce", "larger than by sliding friction",
        f"{percent(ends[0], 0)} where it grips (mu = 0.8), {percent(ends[1], 0)} where it slides "
        "(mu = 0.1)",
        verdict(end > 0.0 for end in ends[:2]),
        "A ball of 80 kPa at 10 m/s, 45 deg from above, with `FootPatch` against the point of "
        "`kd.strike`. The tangential stiffness gives energy back, so that a ball that grips turns "
        "faster than it rolls; where it slides, the shear must build up first. The stiffness is "
        "that of elastic solids, not measured for a ball. The source explains the spin by a normal "
        "force beside the centre, which a plane does not have here.",
    )  # fmt: skip
    added = max(spin(x, 1.0, grip=GRIP) - spin(x, 0.0) for x in OFFSETS)
    hits = [
        kicked(0.0, 0.63, angle=math.radians(a), grip=GRIP).ball_after for a in range(0, 61, 10)
    ]
    most = max(24.0 * math.hypot(*after.spin) / float(after.speed) for after in hits)
    yield Row(
        "M8", "spin that friction of 1 instead of 0 adds, stiffness fitted", "13 rad/s at most",
        f"{added:.0f} rad/s, strip of the foot with `grip` = {GRIP}", "fitted",
        "One number for M8, M9 and M16: with it, a ball of M16 that grips turns "
        f"{percent(ends[2], 0)} faster than it rolls, and the spin of M9 is 0 to {most:.0f} rad/s "
        f"instead of 106. The default of `FootPatch`, {STIFFNESS_RATIO:.2f}, is derived for "
        "elastic solids.",
    )  # fmt: skip


def hardest(hip_speed: float = 0.0, step: float = 10.0) -> tuple[float, float]:
    """Return ball and foot speed of the fastest kick 30 deg up within the speed limits.

    The postures are a grid of a step [deg] over the joints' ranges. The hip moves forward at a
    speed [m/s] that the impact does not change; seen from the hip, the ball comes towards the foot.
    """
    leg, along = compliance.LEG, compliance.ATTACK
    hip = np.array([hip_speed, 0.0, 0.0])
    ends = np.degrees([leg.lower, leg.upper]).T
    best: tuple[float, kd.Posture | None] = (0.0, None)
    for angles in product(*(np.arange(low, high + 1e-9, step) for low, high in ends)):
        posture = leg.posture(np.radians(angles))
        foot = float(np.abs(along @ posture.jacobian) @ leg.velocity_limit + along @ hip)
        mass = posture.effective_mass(along)
        ball = (1.0 + compliance.RESTITUTION) * foot * mass / (mass + compliance.BALL.mass)
        best = max(best, (ball, posture), key=lambda one: one[0])
    ball, fastest = best
    assert fastest is not None
    v = np.sign(along @ fastest.jacobian) * leg.velocity_limit
    contact = kd.Contact(along, compliance.RESTITUTION)
    running = leg.with_base_velocity(hip).posture(fastest.q)
    impact = kd.strike(running, v, compliance.BALL, contact)
    struck = along @ impact.ball_after.velocity
    assert abs(struck - ball) < 1e-9 * ball
    return ball, float(along @ impact.foot_velocity)


def plans() -> Iterator[Row]:
    """Yield the rows of M10."""
    still, *moving = (hardest(speed) for speed in (0.0, 3.0, 5.0))
    measured = "28.60 to 34.48 m/s; straight approach 25.64 to 32.26 m/s"
    yield Row(
        "M10", "ball speed of maximal instep kicks, hip at rest", measured,
        f"up to {still[0]:.1f} m/s, foot at {still[1]:.1f} m/s",
        range_within(25.64, 34.48, 0.0, still[0]),
        "All joints move at their speed limits, in the posture of the fastest ball, along 30 deg.",
        "ball speed of maximal instep kicks, hip at rest",
    )  # fmt: skip
    (slow, slow_foot), (fast, fast_foot) = moving
    yield Row(
        "M10", "the same, hip moving forward at 3 and 5 m/s", measured,
        f"up to {slow:.1f} and {fast:.1f} m/s, foot at {slow_foot:.1f} and {fast_foot:.1f} m/s",
        range_within(28.60, 34.48, 0.0, fast),
        "The hip speeds (`leg.with_base_velocity`) are assumed; run-ups are about as fast.",
        "ball speed of maximal instep kicks, hip at 3 and 5 m/s",
    )  # fmt: skip


class Swing(NamedTuple):
    """The fastest ball of a surface of the foot: its speed [m/s], and the leg's rotation.

    `time` is the time in which a torque brings the hip's rotation to its speed, from rest [s].
    """

    ball: float
    time: float


def human_leg(surface: str) -> kd.Leg:
    """Return the leg of the subjects of M12, with a surface of the foot as its contact point."""
    return kd.Leg.human(height=1.741, mass=73.0, model="3d", frame=surface)


@cache
def contacts(surface: str) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return joint positions and directions of the ball in which a surface meets it.

    The ball leaves 15 deg up. Postures are a Sobol sequence over the ranges of the joints, with the
    ball up to 45 deg beside the front of the pelvis.
    """
    leg, rising, found = human_leg(surface), math.radians(15.0), []
    cone = leg.contact_normal_cone
    assert cone is not None
    for *shares, side in qmc.Sobol(7, seed=0).random(2**15):
        aside = math.radians(90.0 * side - 45.0)
        along = np.array([math.cos(aside), math.sin(aside), math.tan(rising)]) * math.cos(rising)
        posture = leg.posture(leg.lower + shares * (leg.upper - leg.lower))
        if (cone @ (along @ posture.rotation_world_joint) >= 0.0).all():
            found.append((posture.q, along))
    return found


def fastest_swing(
    surface: str, rotation: float, torque: float, stiff: tuple[str, ...], hip_speed: float = 3.0
) -> Swing:
    """Return the fastest ball 15 deg up with a rotation speed [rad/s] and torque [N m] of the hip.

    Hip and knee flex at their speed limits; the other joints are at rest. The pelvis moves forward
    at a speed [m/s]. The postures are those of `contacts`.
    """
    leg = human_leg(surface).with_stiff_joints(*stiff)
    limits = dict(zip(("hip", "knee"), kd.Leg.human().velocity_limit[:2], strict=True))
    limits["hip_rotation"] = rotation
    speeds = np.array([limits.get(name, 0.0) for name in leg.joint_names])
    axis, best = leg.velocity_index("hip_rotation"), Swing(0.0, 0.0)
    for q, along in contacts(surface):
        posture = leg.posture(q)
        foot = float(np.abs(along @ posture.jacobian) @ speeds) + hip_speed * float(along[0])
        mass = posture.effective_mass(along)
        ball = (1.0 + compliance.RESTITUTION) * foot * mass / (mass + compliance.BALL.mass)
        if ball > best.ball:
            best = Swing(ball, float(posture.inertia[axis, axis]) * rotation / torque)
    return best


def swings() -> Iterator[Row]:
    """Yield the rows of M12."""
    kicks = (
        ("side-foot", "inside", 11.1, 56.0, (21.7, 25.1), "23.4 +- 1.7 m/s"),
        ("instep", "instep", 6.0, 33.0, (25.9, 30.1), "28.0 +- 2.1 m/s"),
    )
    times = []
    for name, surface, rotation, torque, measured, text in kicks:
        free, stiff = (
            fastest_swing(surface, rotation, torque, joints)
            for joints in ((), ("ankle", "subtalar"))
        )
        times.append(1e3 * stiff.time)
        note = (
            "Hip and knee flex at their speed limits and the hip rotates at the measured speed, in "
            "the posture of the fastest ball, 15 deg up, e = 0.7. The other joints are at rest. "
            "That the hip moves forward at 3 m/s is assumed. The foot of a player is neither as "
            "free nor as stiff as ours."
        )
        if len(times) == len(kicks):
            note = (
                f"From rest, the measured torques of 56 and 33 N m bring the hip's rotation alone "
                f"to its speed in {times[0]:.0f} and {times[1]:.0f} ms."
            )
        yield Row(
            "M12", f"ball speed of {name} kicks, hip rotating at {rotation:g} rad/s", text,
            f"up to {free.ball:.1f} and {stiff.ball:.1f} m/s, ankle free and stiff",
            range_within(*measured, 0.0, stiff.ball), note,
        )  # fmt: skip


def air() -> Iterator[Row]:
    """Yield the row of A3."""
    ball, sea = kd.Ball(), kd.Air()
    per_speed = sea.density * 2.0 * ball.radius / sea.viscosity
    pairs = {
        speed: [f(speed * per_speed, 0.0) for f in (drag.supercritical, drag.MODELS["brazuca"])]
        + [lift.saturating(speed * per_speed, 0.2)]
        for speed in (10.0, 25.0)
    }
    low, high = pairs[10.0], pairs[25.0]
    yield Row(
        "A3", "drag and lift from 29 trajectories", "in crisis together",
        f"10 to 25 m/s: C_D {low[0]:.2f} to {high[0]:.2f} (default) and {low[1]:.2f} to "
        f"{high[1]:.2f} "
        f"(`brazuca`), C_L {low[2]:.2f} to {high[2]:.2f}",
        verdict([abs(low[0] - high[0]) > 0.05]),
        "The default lift has a drag crisis, the default drag has none down to 4.8 m/s; `brazuca` "
        "has both ([theory](theory.md#flight)).",
    )  # fmt: skip


def long_flights() -> list[kd.Track]:
    """Return the flights of `data/match_ball.csv` of at least 0.9 s."""
    flights = kd.segments(kd.Track.from_csv(str(TRACK))).flights
    return [one for one in flights if one.duration >= 0.9]


def tracked() -> Iterator[Row]:
    """Yield the row of A1: whole flights of `data/match_ball.csv`."""
    fits = [kd.identify(flight, kd.Ball()) for flight in long_flights()]
    drags = [fit.values["drag"] for fit in fits if "drag" in fit.values]
    yield Row(
        "A1", "C_D fitted to flights of a match", "0.125 to 0.183 (n = 4), an earlier fit of ours",
        f"0.2 (default); {min(drags):.3f} to {max(drags):.3f} fitted by `kd.identify` (n = "
        f"{len(drags)})",
        f"{within(0.125, 0.183, drag.BEYOND_CRISIS)} (default), "
        f"{range_within(0.125, 0.183, min(drags), max(drags))} (fitted)",
        "Ball and wind are unknown, and flights differ [more than the models "
        "do](verification.md#which-drag-model-predicts-flights). Choose the model of a known ball, "
        "or fit a track with `kd.identify`.",
        "drag coefficient in flights of a match",
    )  # fmt: skip


def on_plate(speed: float, ball: kd.Ball = INFLATED) -> kd.Collision:
    """Return the collision of an inflated ball with a heavy foot at a speed [m/s]."""
    contact = kd.Contact((1, 0, 0), "inflated")
    return kd.collide(WALL, [speed, 0.0, 0.0], ball, contact, tol=1e-6)


def peak_of(speed: float, mass: float, diameter: float, pressure: float) -> float:
    """Return the peak force of an inflated ball on a heavy foot [N]."""
    return on_plate(speed, kd.Ball(mass, 0.5 * diameter, pressure=pressure)).peak_force


def sensitivity_shares(
    function: Callable[..., float], ends: list[tuple[float, float]]
) -> list[float]:
    """Return the shares of inputs between their ends in a function, by Cotter's method."""
    low, high = ([end[side] for end in ends] for side in (0, 1))
    sizes = []
    for i, (least, most) in enumerate(ends):
        up = function(*low[:i], most, *low[i + 1 :]) - function(*low)
        down = function(*high) - function(*high[:i], least, *high[i + 1 :])
        sizes.append(0.25 * (abs(down + up) + abs(down - up)))
    return [size / sum(sizes) for size in sizes]


def inflated() -> Iterator[Row]:
    """Yield the rows of M6, M7, M13 to M15 and M18: `Contact(restitution="inflated")`."""
    share = 1.0 / (1.0 + INFLATED.mass / compliance.FOOT_MASS)
    ends = [
        restitution(brentq(lambda u, v=speed: share * (1.0 + restitution(u)) * u - v, 1.0, 23.0))
        for speed in (11.5, 22.2)
    ]
    yield Row(
        "M6", "e of kicks, ball at 11.5 and 22.2 m/s", "falls as the speed grows",
        f"{ends[0]:.3f} falling to {ends[1]:.3f}", sign(ends[1] - ends[0], -1),
        "A ball of 80 kPa with `restitution=\"inflated\"` ([inflated ball](inflated-ball.md)). A "
        "narrow strip of `FootPatch` stops less of the shell; in people, e at the toe is larger "
        "below 15 m/s only.",
    )  # fmt: skip
    areas = []
    for width in (math.inf, 0.04):
        hit = kicked(0.0, 0.0, width)
        areas.append((hit.ball_after.velocity[0] - hit.v_after[0]) / hit.approach_speed)
    yield Row(
        "M6", "e on a small area and on a large one, foot at 17 m/s", "larger on the small one",
        f"{areas[1]:.3f} on a strip of 40 mm, {areas[0]:.3f} on a plane",
        sign(areas[1] - areas[0], 1),
    )  # fmt: skip
    contact = kd.Contact((1, 0, 0), "inflated")
    light, heavy = (
        contact.restitution_at(15.0, kd.Ball(mass, pressure=80e3)) for mass in (0.41, 0.45)
    )
    hard, soft = (restitution(15.0, pressure) for pressure in (110e3, 60e3))
    times = [1e3 * force_over_time(constant(p), 15.0)[0][-1] for p in (110e3, 60e3)]
    yield Row(
        "M7", "what e depends on", "speed, mass, contact time and drag",
        f"at 15 m/s {light:.3f} to {heavy:.3f} with 410 to 450 g, {hard:.3f} to {soft:.3f} with "
        f"a contact of {times[0]:.1f} to {times[1]:.1f} ms (110 to 60 kPa)",
        verdict([light - heavy > 1e-3, hard - soft > 1e-3]),
        "The abstract has no figures. Drag counts because the speed is measured in flight.",
    )  # fmt: skip
    shares = sensitivity_shares(
        peak_of, [(15.0, 30.0), (0.3969, 0.4797), (0.2041, 0.2208), (58.6e3, 111.7e3)]
    )
    yield Row(
        "M13", "shares of speed and pressure in the sensitivity of the peak force on a plate",
        "speed the largest, pressure near 0.25", f"{shares[0]:.2f} and {shares[3]:.2f}",
        verdict([shares[0] == max(shares), abs(shares[3] / 0.25 - 1.0) <= MEASURED]),
        "Cotter's method with the ranges of the source: 15 to 30 m/s, 397 to 480 g, diameters of "
        "204 to 221 mm, 58.6 to 111.7 kPa, and the force of `kd.collide`. At the highest speeds "
        "the deflection exceeds the range of the model.",
    )  # fmt: skip
    excess = [spring_force(speed) / peak_force(speed) - 1.0 for speed in (5.0, 20.0)]
    yield Row(
        "M14", "peak force on a plate, computed from the motion of the geometric centre",
        "too large", f"{percent(excess[0], 0)} and {percent(excess[1], 0)} at 5 and 20 m/s",
        sign(min(excess), 1),
        "The geometric centre moves as on the spring from pressure, whose force is larger than "
        "the [force on the plate](inflated-ball.md#force-on-a-wall).",
    )  # fmt: skip
    # 2.8 % are 0.3 ms, both rounded
    least, most = 0.25 / 0.0285, 0.35 / 0.0275
    times = [1e3 * on_plate(speed).contact_time for speed in (5.93, 19.2)]
    yield Row(
        "M18", "contact time with a plate at 5.93 and 19.2 m/s",
        f"{least:.1f} to {most:.1f} ms (our inference)", f"{times[0]:.1f} and {times[1]:.1f} ms",
        within(least, most, *times),
        "The abstract states an error of contact times as 2.8 % and as 0.3 ms. A ball of 80 kPa. "
        "Compressed air stiffens a fast ball; a loss that prolongs its contact is missing.",
    )  # fmt: skip
    fall = math.sqrt(2.0 * 9.81 * 2.0)
    heights = [2.0 * restitution(fall, pressure) ** 2 for pressure in (60e3, 80e3, 110e3)]
    yield Row(
        "M15", "rebound of a ball that falls 2 m onto steel", "1.35 to 1.55 m at 80 kPa",
        f"{heights[1]:.2f} m; {heights[0]:.2f} and {heights[2]:.2f} m at 60 and 110 kPa", "fitted",
        "The one fitted number of the model, a factor of e, is fitted to the middle of this range.",
    )  # fmt: skip


def grass() -> Iterator[Row]:
    """Yield the row of A6: the surface `carpet`, in air."""
    ball, ground = kd.Ball(), kd.Ground(surface="carpet")
    top = kd.follow(kd.BallState((0, 0, 2.0 + ball.radius)), ball, kd.Air(), ground).flights[1].apex
    rolling = kd.BallState((0, 0, ball.radius), (0.841, 0, 0), (0, 0.841 / ball.radius, 0))
    rolled = kd.follow(rolling, ball, kd.Air(), ground).distance
    yield Row(
        "A6", "rebound from 2 m and roll from 0.841 m/s, artificial grass", "0.50 m and 0.621 m",
        f"{top.position[2] - ball.radius:.2f} m and {rolled:.3f} m", "fitted",
        "The surface `carpet` is fitted to both, without the drag of the air that `kd.follow` has.",
    )  # fmt: skip


PARTS: tuple[Callable[[], Iterator[Row]], ...] = (
    mechanical_limb, punts, ankles, inflated, curves, bounces, plans, swings, tracked, air, grass,
)  # fmt: skip
"""Of the table; `tracked` takes most of the time."""


def lines(rows: "list[Row]") -> list[str]:
    """Return the table of docs/explanation/validation.md."""
    head = ["| | quantity | measured | kickdyn | verdict |", "|---|---|---|---|---|"]
    return [*head, *("| " + " | ".join(row[:5]) + " |" for row in rows)]


def csv_text(rows: "list[Row]") -> str:
    """Return docs/explanation/validation.csv: the rows with their assumptions."""
    file = io.StringIO()
    writer = csv.writer(file, lineterminator="\n")
    writer.writerow(("row", "quantity", "measured", "kickdyn", "verdict", "assumptions"))
    for row in rows:
        note = re.sub(r"\[([^]]+)\]\([^)]+\)", r"\1", row.note)  # links are of the page
        writer.writerow([cell.replace("*", "").replace("`", "") for cell in (*row[:5], note)])
    return file.getvalue()


def short_lines(rows: "list[Row]") -> list[str]:
    """Return the rows of README.md."""
    chosen = [row for row in rows if row.short]
    cells = [(row.number, row.short, row.measured, row.ours, row.verdict) for row in chosen]
    return ["| " + " | ".join(row) + " |" for row in cells]


def main() -> None:
    """Print the table and the rows of README.md, and write the table with its assumptions."""
    rows = [row for part in PARTS for row in part()]
    TABLE.write_text(csv_text(rows), encoding="utf-8")
    print("\n".join([*lines(rows), "", *short_lines(rows)]))


if __name__ == "__main__":
    main()
