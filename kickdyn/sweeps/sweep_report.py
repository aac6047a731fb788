"""A sweep in words: the table on the screen, and the same as JSON."""

from __future__ import annotations

import math
from collections.abc import Sequence
from textwrap import fill

from rich import box
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from kickdyn.core.console import PROSE, WIDE, fits, screen_width
from kickdyn.robot.leg import Leg
from kickdyn.sweeps.kick import Kick
from kickdyn.sweeps.provenance import provenance
from kickdyn.sweeps.summary import Line


def table(leg: Leg, kick: Kick, lines: Sequence[Line], width: int = WIDE) -> Table:
    """Return the table of the summary's postures: a line each, or a column where that is too wide.

    Args:
        leg: the leg.
        kick: what the postures share.
        lines: the postures.
        width: of the screen, in characters.
    """
    flight = "vacuum" if kick.air is None else f"air {kick.air.density:.4g} kg/m3"
    title = (
        f"{escape(leg.name)}: foot {kick.speed:g} m/s at {math.degrees(kick.attack):g} deg, "
        f"e {kick.restitution:g}, mu {kick.friction:g}, "
        f"ball {kick.ball.mass:g} kg, radius {kick.ball.radius:.4g} m, {flight}"
    )
    joints = leg.single_joints  # a floating base has no one angle
    units = {name: "m" if leg.joint_unit(name) == "m" else "deg" for name in joints}
    heads = (" / " if len(joints) <= 3 else " /\n").join(joints)
    paper = any(line.paper for line in lines)
    odd = any(line.outcome.status != "ok" for line in lines)
    head = (
        "posture",
        escape(heads) + "\n" + ", ".join(sorted({*units.values()})),
        "eff. mass\nkg",
        "impulse\nN s",
        "ball /\nfoot",
        "launch\ndeg",
        "back spin\nrad/s",
        "carry\nm",
        "worst joint\nN s",
        "immovable\nN s",
        *(("Table 2\nN s",) if paper else ()),
        *(("status",) if odd else ()),
    )
    rows = [
        (
            line.label,
            " / ".join(f"{value:.4g}" for value in line.angles.values()),
            *_numbers(line),
            *((f"{line.paper:.3f}" if line.paper else "",) if paper else ()),
            *((line.outcome.status,) if odd else ()),
        )
        for line in lines
    ]
    upright = _laid(title, head, rows)
    if fits(upright, width):
        return upright
    names = [name.replace("\n", ", ").replace("/, ", "/ ") for name in head]
    first, _, *others = zip(names, *rows, strict=True)
    angles = [
        (f"{escape(name)}, {unit}", *(f"{line.angles[name]:.4g}" for line in lines))
        for name, unit in units.items()
    ]
    loads = others[6][0], *(cell.replace(" ", "\n") for cell in others[6][1:])
    others[6] = loads  # the joint's name over its number
    return _laid(title, first, [*angles, *others])


def show(
    leg: Leg,
    kick: Kick,
    counted: dict[str, int],
    residual: float,
    lines: Sequence[Line],
    chosen: tuple[str, int] | None = None,
) -> None:
    """Print table and text as wide as the screen is; no number is cut off."""
    width = screen_width()
    Console(highlight=False, width=WIDE).print(table(leg, kick, lines, width))
    print(text(counted, residual, lines, chosen, min(PROSE, width)))


def _laid(title: str, head: Sequence[str], rows: Sequence[Sequence[str]]) -> Table:
    result = Table(
        title=title,
        title_justify="left",
        title_style="bold",
        box=box.SIMPLE_HEAD,
        pad_edge=False,
        padding=(0, 1),
    )
    for number, name in enumerate(head):
        result.add_column(name, justify="right" if number else "left", no_wrap=True)
    for row in rows:
        result.add_row(*row)
    return result


def _numbers(line: Line) -> list[str]:
    n, hit = line.numbers, line.outcome.hit
    if hit is None:
        return [""] * 8
    return [
        f"{n['effective_mass']:.4g}",
        f"{n['impulse']:.4f}",
        f"{n['speed_ratio']:.4f}",
        f"{math.degrees(n['launch_angle']):.2f}",
        f"{n['back_spin']:.3f}",
        f"{n['carry']:.4g}",
        escape(hit.worst_joint[0]) + f" {n['worst_joint_impulse']:.4f}",
        f"{n['immovable_impulse']:.4g}",
    ]


def text(
    counted: dict[str, int],
    residual: float,
    lines: Sequence[Line],
    chosen: tuple[str, int] | None = None,
    width: int = PROSE,
) -> str:
    """Return what is to be said below the table: why, how many, how exact.

    Args:
        counted: postures by status.
        residual: the largest of restitution and momentum.
        lines: of the summary.
        chosen: a condition, and how many postures that are ok fulfil it.
        width: of a line, in characters; a word that is longer is not broken.
    """
    said = [f"{line.label} ({line.posture()}): {line.why}." for line in lines if line.why]
    parts = ", ".join(f"{number} {name}" for name, number in counted.items() if number)
    said.append(f"{sum(counted.values())} postures: {parts}.")
    if chosen is not None:
        said.append(f"Best and worst are of the {chosen[1]} that are ok where {chosen[0]}.")
    if math.isfinite(residual):
        power = math.ceil(math.log10(max(residual, 1e-17))) + 1
        said.append(f"Restitution and momentum hold to 1e{power:+03d} in every one.")
    return "\n".join(fill(each, width, break_long_words=False) for each in said)


def as_json(
    leg: Leg,
    kick: Kick,
    counted: dict[str, int],
    lines: Sequence[Line],
    chosen: tuple[str, int] | None = None,
) -> dict[str, object]:
    """Return the summary as plain values."""
    return {
        **provenance(leg, kick),
        "postures": sum(counted.values()),
        "status": counted,
        **({} if chosen is None else {"where": chosen[0], "chosen": chosen[1]}),
        "lines": [line.as_json() for line in lines],
    }
