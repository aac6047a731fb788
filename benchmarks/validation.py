"""Compare kickdyn with published measurements: `python benchmarks/validation.py`.

It prints the table of docs/explanation/validation.md and, after it, that of README.md. The rules of
the verdicts are on that page; the functions below follow them.
"""

import math
from collections.abc import Callable, Iterable, Iterator
from itertools import product
from pathlib import Path
from typing import NamedTuple

import compliance
import numpy as np
import spin_offset
from compliance import INFLATED, distance, head_on, peak_over_mean

import kickdyn as kd
from kickdyn.aerodynamics import drag, lift
from kickdyn.impact.force_model import Dissipation
from kickdyn.paper import tables_4_5
from kickdyn.paper.assumptions import DEFAULT
from kickdyn.paper.item import MEASURED

TRACK = Path(__file__).resolve().parent.parent / "data" / "match_ball.csv"
SLOW, FAST = 9.1, 21.2
"""Foot speeds of M1 [m/s]."""

MODEL = "peacock-ball"
HERTZ = head_on(15.0).force_model.stiffness
"""Of the spring whose force acts for 10 ms at 15 m/s [N/m^1.5]."""


class Row(NamedTuple):
    """A row of the table; rows with a short name are in README.md, too."""

    number: str
    what: str
    measured: str
    ours: str
    verdict: str
    why: str = ""
    short: str = ""


def verdict(inside: Iterable[bool]) -> str:
    """Return the verdict on the values of a row, each of which is inside or not."""
    found = list(inside)
    return "inside" if all(found) else "**partly**" if any(found) else "**outside**"


def within(low: float, high: float, *values: float) -> str:
    """Return the verdict on values where a range or a scatter was measured."""
    return verdict(low <= value <= high for value in values)


def close(*pairs: tuple[float, float]) -> str:
    """Return the verdict on pairs of ours and a measured value without a range."""
    return verdict(abs(ours / measured - 1.0) <= MEASURED for ours, measured in pairs)


def range_within(low: float, high: float, least: float, most: float) -> str:
    """Return the verdict on all values from least to most, where a range was measured."""
    if least > high or most < low:
        return "**outside**"
    return "inside" if low <= least and most <= high else "**partly**"


def percent(change: float, digits: int = 1) -> str:
    """Return a relative change in percent, with its sign."""
    text = f"{100.0 * change:+.{digits}f} %"
    return text if float(text[:-2]) else text[1:]


def sign(change: float, measured: int) -> str:
    """Return the verdict on a trend of which the sign is known."""
    return "same sign" if change * measured > 0.0 else "**outside**, not this sign"


def leg_ratio(speed: float, restitution: float | str) -> float:
    """Return ball over foot speed of the human leg through Hertz's spring."""
    contact = kd.Contact(compliance.ATTACK, restitution)
    v = compliance.V * (speed / 14.0)
    hit = kd.collide(compliance.POSTURE, v, compliance.BALL, contact, stiffness=HERTZ)
    foot = compliance.POSTURE.jacobian @ v
    return float(hit.ball_after.speed) / math.hypot(*foot)


def mechanical_limb() -> Iterator[Row]:
    """Yield the rows of M1: a foot of the mass of M2 with Hertz's spring."""
    slow, fast = (head_on(speed, MODEL, stiffness=HERTZ) for speed in (SLOW, FAST))
    balls = [float(hit.ball_after.speed) for hit in (slow, fast)]
    ratios = balls[0] / SLOW, balls[1] / FAST
    fitted = f"e is `{MODEL}`, a line through these data; the effective mass is that of M2"
    yield Row(
        "M1", "ball speed, foot at 9.1 and 21.2 m/s", "13.0 and 29.7 m/s",
        f"{balls[0]:.1f} and {balls[1]:.1f} m/s", "fitted", fitted,
    )  # fmt: skip
    yield Row(
        "M1", "ball over foot speed", "1.37 to 1.48", f"{ratios[1]:.3f} to {ratios[0]:.3f}",
        "fitted", fitted,
    )  # fmt: skip
    trend = ratios[1] / ratios[0] - 1.0
    yield Row(
        "M1", "ball over foot speed, foot at 21.2 against 9.1 m/s", "falls (r = -0.694)",
        f"{percent(trend)} with `{MODEL}`", f"fitted, {sign(trend, -1)}",
        "it falls because the fitted e falls; with one number for e, ball over foot speed of two "
        "masses is the same at all speeds, because every equation of the impact is proportional "
        "to speed",
    )  # fmt: skip
    legs = [leg_ratio(FAST, e) / leg_ratio(SLOW, e) - 1.0 for e in (MODEL, compliance.RESTITUTION)]
    yield Row(
        "M1", "the same with the human leg, by `collide`", "falls (r = -0.694)",
        f"{percent(legs[0], 2)} with `{MODEL}`", f"fitted, {sign(legs[0], -1)}",
        f"with e = {compliance.RESTITUTION} at all speeds it rises, by {percent(legs[1])}, mostly "
        "because the foot moves and turns further under the ball in a fast kick",
    )  # fmt: skip
    times = 1e3 * slow.visible_contact_time, 1e3 * fast.visible_contact_time
    yield Row(
        "M1", "contact time", "14.75 falling to 11.75 ms, -20 %",
        f"{times[0]:.1f} falling to {times[1]:.1f} ms, {percent(times[1] / times[0] - 1.0, 0)}",
        close((times[0], 14.75), (times[1], 11.75)),
        "the visible contact; the stiffness is that of a force of 10 ms at 15 m/s, for which the "
        "visible contact is within the 9 to 14 ms of other kicks (review in M3). The time falls "
        "with the fifth root of speed with Hertz's spring, and is constant with the one from "
        "pressure",
        "contact time of a mechanical limb, foot at 9.1 and 21.2 m/s",
    )  # fmt: skip
    moved = 1e2 * distance(slow), 1e2 * distance(fast)
    yield Row(
        "M1", "contact distance", "10.7 to 20.2 cm", f"{moved[0]:.1f} to {moved[1]:.1f} cm",
        range_within(10.7, 20.2, *moved),
        f"inside except for the ends, which differ by {percent(moved[0] / 10.7 - 1.0, 0)} and "
        f"{percent(moved[1] / 20.2 - 1.0, 0)} from those of the measured range; kickdyn's distance "
        "is the path of the foot while ball and foot touch, the abstract does not define its own",
    )  # fmt: skip
    e = [hit.restitution for hit in (slow, fast)]
    yield Row(
        "M1", "e", "0.66 to 0.79, no significant trend", f"{e[0]:.3f} to {e[1]:.3f}",
        "fitted", "e is an input",
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
        f"by momentum, 22.7 m/s over effective mass over ball mass, {masses[0]:.1f} and "
        f"{masses[1]:.1f}, with hip, knee and ankle at 40, 30, -20 deg, where `kickdyn "
        "posture-sweep` finds the largest ball speed, and at 5, 10, -5 deg, posture a of the "
        "paper's Table 2; the first is inside. The abstract has no postures",
        "speed that the foot loses where the ball gains 22.7 m/s",
    )  # fmt: skip
    gain = float(head_on(1.0).ball_after.speed)
    every = [
        head_on(22.7 / gain, stiffness=k, dissipation=kind)
        for kind in Dissipation
        for k in (head_on(15.0, dissipation=kind).force_model.stiffness, "pressure")
    ]
    hit = every[0]  # walton-braun is the first dissipation, Hertz's spring the first spring
    which, means, ratios = "the abstract does not define its mean", [], []
    for duration in ("visible_contact_time", "contact_time"):
        means.append([INFLATED.mass * 22.7 / getattr(one, duration) for one in every])
        ratios.append(
            [peak_over_mean(one) * getattr(one, duration) / one.contact_time for one in every]
        )
    low, high, names = 834 - 107, 834 + 107, "of the visible contact, {} while the force acts"
    both = any(
        close((ratio, 1.97)) == within(low, high, mean) == "inside"
        for pairs in zip(means, ratios, strict=True)
        for mean, ratio in zip(*pairs, strict=True)
    )
    yield Row(
        "M2", "mean force of distance kicks, ball gains 22.7 m/s", "834 +- 107 N",
        f"{means[0][0]:.0f} N {names.format(f'{means[1][0]:.0f} N')}",
        within(low, high, means[0][0], means[1][0]),
        f"{which}; the first is inside. The values are those of a soccer ball with Hertz's spring; "
        f"with the spring from pressure they are {means[0][1]:.0f} and {means[1][1]:.0f} N. The "
        "abstract has no ball speed for accuracy kicks (588 +- 64 N), so that these cannot be "
        "compared",
    )  # fmt: skip
    yield Row(
        "M3", "peak over mean force", "1.97",
        f"{ratios[0][0]:.2f}, mean {names.format(f'{ratios[1][0]:.2f}')}",
        close((ratios[0][0], 1.97), (ratios[1][0], 1.97)),
        f"{which}; the second is inside. The ratios are those of Hertz's spring; with the spring "
        f"from pressure they are {ratios[0][1]:.2f} and {ratios[1][1]:.2f}. No choice of mean, "
        "spring and dissipation has both M2 and M3 inside. The source gives no ball speed for its "
        "forces (2062 and 1045 N)",
    )  # fmt: skip
    assert not both, "a remark on M3 says so"
    for name, stiffness, why in (
        ("Hertz's spring", HERTZ, ""),
        ("spring from pressure", "pressure",
         ". The linear spring is valid within 3 % up to a foot speed of 13 m/s, and within 10 % up "
         "to 17 m/s; these kicks are faster, and the neglected terms increase the force "
         "([finite contact time](compliance.md#stiffness-from-pressure))"),
    ):  # fmt: skip
        forces = [
            head_on(speed / gain, stiffness=stiffness).peak_force for speed in compliance.MAXIMAL
        ]
        last = 2926.0 / forces[1] * compliance.MAXIMAL[1]  # both forces are nearly proportional
        yield Row(
            "M4", f"peak force of instep kicks, ball at 25.6 to 34.5 m/s, {name}",
            "1610 to 2926 N (three studies)", f"{forces[0]:.0f} to {forces[1]:.0f} N",
            range_within(1610.0, 2926.0, *forces),
            f"inside up to a ball of about {last:.0f} m/s; the ball speeds are those of M10, "
            f"because the abstracts do not give those of the forces{why}",
            f"peak force of maximal instep kicks, {name}" if stiffness == HERTZ else "",
        )  # fmt: skip
    share = hit.contact_time / hit.visible_contact_time
    yield Row(
        "M5", "time of acceleration over visible contact", "about 3/4", f"{share:.2f}",
        close((share, 0.75)), "with the hysteretic spring at e = 0.7; with a damped spring it is 1",
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
        "a change of less than 10 % counts as none; larger torques would add more",
    )  # fmt: skip


def restitution() -> Iterator[Row]:
    """Yield the rows of M6 and M7."""
    contact = kd.Contact((1, 0, 0), MODEL)
    fall = contact.restitution_at(15.0) - contact.restitution_at(10.0)
    yield Row(
        "M6", "e as the impact gets faster", "falls", f"{fall:+.3f} from 10 to 15 m/s, `{MODEL}`",
        f"fitted to M1, {sign(fall, -1)}",
        "`peacock-ball` is a line through the data of M1; the abstract of M6 has no numbers, and a "
        "constant e has no trend",
    )  # fmt: skip
    yield Row(
        "M6", "e of a small contact area (toe) against a large one (instep)",
        "larger; in people only below about 15 m/s", "no such quantity", "not comparable",
        "e is an input of every rigid and one-spring model, and neither has the shape of the foot: "
        "give each kind of kick its own table",
    )  # fmt: skip
    yield Row(
        "M7", "e over speed, mass, contact time and drag; travel distance with a variable e",
        "e depends on all; distance is better predicted", "e depends on speed only",
        "not comparable",
        "only the abstract could be read, which has neither the formula nor numbers; likewise that "
        "of the earlier paper of the same laboratory (Choi, Yi & Kwon, ICRA 2011)",
    )  # fmt: skip


def curves() -> Iterator[Row]:
    """Yield the rows of M8 and M9: a foot that passes beside the ball's centre."""
    offsets = np.arange(0.0, 0.106, 0.005)
    spins = {mu: [spin_offset.rigid_spin(x, mu) for x in offsets] for mu in (0.0, 0.4, 1.0)}
    grown = spins[0.4][16] - spins[0.4][4]
    yield Row(
        "M8", "spin as the offset grows", "grows",
        f"{spins[0.4][4]:.0f} to {spins[0.4][16]:.0f} rad/s from 20 to 80 mm, mu = 0.4",
        sign(grown, 1),
    )  # fmt: skip
    added = [one - none for one, none in zip(spins[1.0], spins[0.0], strict=True)]
    yield Row(
        "M8", "spin as friction grows", "grows", f"{spins[0.0][20]:.0f}, {spins[0.4][20]:.0f}, "
        f"{spins[1.0][20]:.0f} rad/s with mu = 0, 0.4, 1 at 100 mm",
        sign(min(np.diff([spins[mu][20] for mu in (0.0, 0.4, 1.0)])), 1),
    )  # fmt: skip
    why = (
        "the normal force on a rigid ball, with or without a spring, points to its centre, so that "
        "only friction gives it spin; in finite element models the pressure on the deformed ball "
        "does, too ([models that were tried](impact.md#spin-without-friction))"
    )
    yield Row(
        "M8", "spin that friction of 1 instead of 0 adds", "13 rad/s at most",
        f"{max(added):.0f} rad/s at {1e3 * offsets[int(np.argmax(added))]:.0f} mm",
        within(0.0, 13.0, max(added)), why,
    )  # fmt: skip
    yield Row(
        "M8", "spin without friction", "not 0", f"{max(spins[0.0]):.0f} rad/s",
        verdict([max(spins[0.0]) > 1e-9]), why, "spin without friction",
    )  # fmt: skip
    most = [1e3 * float(offsets[int(np.argmax(spins[mu]))]) for mu in (0.4, 1.0)]
    yield Row(
        "M8", "offset of the largest spin", "about 100 mm",
        f"{most[0]:.0f} mm with mu = 0.4, {most[1]:.0f} mm with mu = 1",
        close(*((value, 100.0) for value in most)),
        "the contact slips beyond it; the ball's radius is 110 mm",
    )  # fmt: skip
    at_24 = []
    for x in offsets:
        after = spin_offset.rigid_impact(x, 0.63).ball_after
        at_24.append(24.0 * math.hypot(*after.spin) / float(after.speed))
    reached = 1e3 * float(
        np.interp(106.0, at_24[: int(np.argmax(at_24))], offsets[: int(np.argmax(at_24))])
    )
    yield Row(
        "M9", "spin of curling free kicks at 24 m/s", "106 rad/s on average",
        f"0 to {max(at_24):.0f} rad/s", range_within(0.9 * 106.0, 1.1 * 106.0, 0.0, max(at_24)),
        f"over the offset, which is not known; 106 rad/s at {reached:.0f} mm, with mu = 0.63, the "
        "largest measured against leather (`kd.Contact`); the law is proportional to speed",
        "spin of curling free kicks at 24 m/s, over the offset",
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
    impact = kd.strike(fastest, v, compliance.BALL, contact, ball_velocity=-hip)
    struck = along @ (impact.ball_after.velocity + hip)
    assert abs(struck - ball) < 1e-9 * ball
    return ball, float(along @ (impact.foot_velocity + hip))


def plans() -> Iterator[Row]:
    """Yield the rows of M10 and M11."""
    still, *moving = (hardest(speed) for speed in (0.0, 3.0, 5.0))
    measured = "28.60 to 34.48 m/s; straight approach 25.64 to 32.26 m/s"
    limits = (
        "all joints at the speed limits of `Leg.human()`, in the posture of the largest ball "
        "speed, along 30 deg, e = 0.7, at the toe, which is farther from the joints than the instep"
    )
    yield Row(
        "M10", "ball speed of maximal instep kicks, hip at rest", measured,
        f"up to {still[0]:.1f} m/s, foot at {still[1]:.1f} m/s",
        range_within(25.64, 34.48, 0.0, still[0]),
        f"{limits}. This is below both ranges; that players who aim kick at 85 % of their speed "
        "is beyond models of the impact",
        "ball speed of maximal instep kicks, hip at rest",
    )  # fmt: skip
    (slow, slow_foot), (fast, fast_foot) = moving
    yield Row(
        "M10", "the same, hip moving forward at 3 and 5 m/s", measured,
        f"up to {slow:.1f} and {fast:.1f} m/s, foot at {slow_foot:.1f} and {fast_foot:.1f} m/s",
        range_within(28.60, 34.48, 0.0, fast),
        "as above; the speeds of the hip are assumed, of the size of a run-up's. The slower of the "
        "measured kicks can be reached in both ranges, the fastest in neither. Other causes, "
        "such as faster joints or a leg that turns out of its plane, were not tested",
        "ball speed of maximal instep kicks, hip at 3 and 5 m/s",
    )  # fmt: skip
    yield Row(
        "M11", "effective mass of the foot: instep, inside, toe",
        "0.298 +- 0.123, 0.381 +- 0.199, 0.225 +- 0.077 kg",
        "no such quantity", "not comparable",
        "the source models the foot as a point mass and attributes the energy loss of the ball "
        "to this mass, so that its value depends on e; the effective mass of Eq. (10) depends on "
        "the posture, which is not given, but not on e",
    )  # fmt: skip


def air() -> Iterator[Row]:
    """Yield the rows of A2 to A4."""
    ball, sea = kd.Ball(), kd.Air()
    per_speed = sea.density * 2.0 * ball.radius / sea.viscosity
    values = [f(20.0 * per_speed, 0.0) for f in (drag.supercritical, drag.goff_carre)]
    yield Row(
        "A2", "C_D without spin, above the crisis", "about 0.2",
        f"{values[0]:.2f} (default), {values[1]:.2f} (`goff-carre`), at 20 m/s",
        f"fitted (default), {close((values[1], 0.2))} (`goff-carre`)",
        "the default is this source's value; `goff-carre` is by the same authors for another ball "
        "(Eur. J. Phys. 31, 2010), and is 0.155 beyond its crisis",
    )  # fmt: skip
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
        "the default lift has a crisis, the default drag none down to 4.8 m/s, because the ball of "
        "A1 has none; use `brazuca` for both. The abstract has no coefficients",
    )  # fmt: skip
    yield Row(
        "A4", "lift of 24 golf shots (two pull requests of an open project)",
        "not followed by a lift that saturates",
        "the default lift saturates", "not comparable",
        "golf balls have dimples and spin parameters beyond 0.3, to which measurements of soccer "
        "balls extend, so that they are not comparable",
    )  # fmt: skip


def test_bed() -> Iterator[Row]:
    """Yield the rows of Tables 4 and 5."""
    found = tables_4_5.fit(DEFAULT)
    least, most = found.middle
    fitted = "posture and scale of the foot speed are fitted to the rows of 30 and 50 deg"
    for row in tables_4_5.ROWS:
        why = fitted
        if row is tables_4_5.MIDDLE:
            why = (
                f"{fitted}; all postures that fit these give {least:.1f} to {most:.1f} m, and the "
                "one with the smallest scale, which is shown, the largest distance"
            )
        elif row in tables_4_5.PREDICTED:
            vacuum = tables_4_5.in_vacuum(row)
            why = (
                "the launch is the fitted one of 7.5 m, in proportion to the foot speed; distance "
                f"in proportion to its square, as in vacuum, is {vacuum:.2f} m "
                f"({percent(vacuum / row.experiment - 1.0)})"
            )
        yield Row(
            row.name[:7],
            f"distance, foot at {row.foot_speed} m/s, contact at {row.contact_deg:.0f} deg",
            f"{row.experiment} m (the paper's simulation: {row.simulation} m)",
            f"{tables_4_5.kick(row, found, DEFAULT).range:.2f} m", "fitted", why,
        )  # fmt: skip


def long_flights() -> list[kd.Track]:
    """Return the flights of `data/match_ball.csv` of at least 0.9 s."""
    flights = kd.segments(kd.Track.from_csv(str(TRACK))).flights
    return [one for one in flights if one.duration >= 0.9]


def miss(flight: kd.Track, model: str) -> float:
    """Return the rms distance [cm] of a flight's samples, launch and spin fitted."""
    fit = kd.identify(flight, kd.Ball(), kd.Air(drag=model), free=("spin",))
    return rms_of(fit)


def rms_of(fit: kd.Identification) -> float:
    """Return the root mean square distance of all samples [cm]."""
    return 100.0 * float(np.sqrt((fit.residuals**2).sum(axis=-1).mean()))


def tracked() -> Iterator[Row]:
    """Yield the rows of A1: whole flights of `data/match_ball.csv`."""
    ball, flights = kd.Ball(), long_flights()
    found: dict[str, list[float]] = {}
    for name in ("supercritical", "goff-carre", "teamgeist", "brazuca", "jabulani"):
        found[f"`{name}`"] = [miss(one, name) for one in flights]
    level = kd.Air(drag=drag.BEYOND_CRISIS)
    fits = [kd.identify(one, ball, level, free=("spin", "drag")) for one in flights]
    found["C_D fitted"] = [rms_of(fit) for fit in fits]
    free = [kd.identify(one, ball) for one in flights]
    drags = [fit.values["drag"] for fit in free if "drag" in fit.values]
    n = len(flights)
    yield Row(
        "A1", "rms miss of whole flights [cm], launch and spin fitted",
        "`goff-carre` 2.8, 2.8, 2.5, 4.9; `teamgeist` 3.2, 5.2, 2.4, 7.7; `brazuca` 11.9, 14.7, "
        "3.1, 8.7; `jabulani` 48.9, 18.9, 10.5, 12.2; C_D fitted 3.4, 1.6, 1.3, 0.9",
        "; ".join(
            f"{name} {np.median(misses):.1f} ({min(misses):.1f} to {max(misses):.1f})"
            for name, misses in found.items()
        ),
        "not comparable",
        f"fits made for this comparison; median and range of the {n} flights of at least 0.9 s "
        "that `kd.segments` finds in the minute that comes with kickdyn; which samples the four "
        "flights had is not known",
    )  # fmt: skip
    yield Row(
        "A1", "C_D fitted to flights of a match", "0.125 to 0.183 (n = 4), an earlier fit of ours",
        f"0.2 (default); {min(drags):.3f} to {max(drags):.3f} fitted by `kd.identify` (n = "
        f"{len(drags)})",
        f"{within(0.125, 0.183, drag.BEYOND_CRISIS)} (default), "
        f"{range_within(0.125, 0.183, min(drags), max(drags))} (fitted)",
        "ball and wind are unknown, and flights differ more than the models do "
        "([verification](verification.md#which-drag-model-predicts-flights)): "
        "no default can be inside all of them",
        "drag coefficient in flights of a match",
    )  # fmt: skip


PARTS: tuple[Callable[[], Iterator[Row]], ...] = (
    mechanical_limb, punts, restitution, curves, plans, tracked, air, test_bed,
)  # fmt: skip
"""Of the table; `tracked` takes most of the time."""


def lines(rows: "list[Row]") -> list[str]:
    """Return the table of docs/explanation/validation.md."""
    head = ["| | quantity | measured | kickdyn | verdict |", "|---|---|---|---|---|"]
    return [*head, *("| " + " | ".join(row[:5]) + " |" for row in rows)]


def remarks(rows: "list[Row]") -> list[str]:
    """Return the remarks under that table, those of equal words once."""
    of_rows: dict[tuple[str, str], list[str]] = {}
    for row in rows:
        if row.why:
            of_rows.setdefault((row.number, row.why), []).append(row.what)
    return [
        f"- **{number}, {'; '.join(names)}:** {why}." for (number, why), names in of_rows.items()
    ]


def short_lines(rows: "list[Row]") -> list[str]:
    """Return the rows of README.md."""
    chosen = [row for row in rows if row.short]
    cells = [(row.number, row.short, row.measured, row.ours, row.verdict) for row in chosen]
    return ["| " + " | ".join(row) + " |" for row in cells]


def main() -> None:
    """Print the table, its remarks, and the rows of README.md."""
    rows = [row for part in PARTS for row in part()]
    print("\n".join([*lines(rows), "", *remarks(rows), "", *short_lines(rows)]))


if __name__ == "__main__":
    main()
