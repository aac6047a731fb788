"""What the page says beside the picture."""

from __future__ import annotations

import math
from html import escape

import numpy as np

from kickdyn.flight.flight_result import Flight
from kickdyn.flight.follow import Course
from kickdyn.impact.impact_result import Impact
from kickdyn.view.impulses import JOINT, LEAST
from kickdyn.view.kick_scene import Drawn
from kickdyn.view.marks import ARROW, CURVE
from kickdyn.view.playback import Pace

FEW = 4
"""Joints up to which the angles are in sight; of more, they are folded with what passes through."""

Row = tuple[str, str]


def caption_panel(hit: Impact, path: Flight | Course, drawn: Drawn, caption: str) -> str:
    """Return the caption as HTML; every name in it is escaped."""
    few = len(hit.posture.leg.joint_names) <= FEW
    said = f"<p>{escape(caption)}</p>\n" if caption else ""
    shown = [*(_angles(hit).items() if few else ()), *_numbers(hit, path, drawn)]
    return (
        f'<aside id="caption">\n<h1>{escape(hit.posture.leg.name or "leg")}</h1>\n{said}'
        f"{_table(shown)}\n{'' if few else _folded(hit)}</aside>"
    )


def _table(rows: list[Row]) -> str:
    lines = (
        f"<tr{LONG if len(value) > MOST else ''}><th>{head}</th><td>{value}</td></tr>"
        for head, value in rows
    )
    return "<table>\n" + "\n".join(lines) + "\n</table>"


MOST = 16
LONG = ' class="long"'
"""Rows that get a line of their own where they stand side by side."""


def _angles(hit: Impact) -> dict[str, str]:
    leg = hit.posture.leg
    if leg.nv != len(leg.joint_names):
        return {}  # a floating base has no one angle
    return {
        _name(name): f"{value:.4g} m" if unit == "m" else f"{value:.1f}°"
        for name, (value, unit) in leg.display_values(hit.posture.q).items()
    }


def _folded(hit: Impact) -> str:
    """Return the joints that move or transmit something to speak of, the most loaded first."""
    names = [_name(name) for name in hit.posture.leg.joint_names]
    sizes = dict(zip(names, np.linalg.norm(hit.joint_impulses[:, :3], axis=1), strict=True))
    angles, least = _angles(hit), LEAST * max(sizes.values())
    moving = dict(zip(names, hit.v_before, strict=True)) if angles else {}
    rows = [
        (name, ", ".join([*([angles[name]] if angles else []), f"{size:.3g} N s"]))
        for name, size in sorted(sizes.items(), key=lambda one: -one[1])
        if size > least or moving.get(name)
    ]
    what = "angle and impulse" if angles else "impulse"
    head = f"<summary>{len(rows)} joints: {what} {_key(JOINT)}</summary>"
    return f"<details>{head}\n{_table(rows)}\n</details>\n"


def _name(name: str) -> str:
    """Return a joint's name as HTML, which may be broken after an underscore."""
    return escape(name).replace("_", "_<wbr>")


def _numbers(hit: Impact, path: Flight | Course, drawn: Drawn) -> list[Row]:
    if isinstance(path, Course):
        way = [
            (f"way {_key(CURVE)}", f"{path.distance:.4g} m along the ground"),
            ("time", f"{path.duration:.4g} s"),
            ("speed there", f"{float(path.rest.speed):.4g} m/s"),
        ]
    else:
        aloft = " (still aloft)" if path.status == "aloft" else ""
        flown = "to the plane" if path.status == "at-plane" else "carry"
        way = [
            (f"{flown} {_key(CURVE)}", f"{path.range:.4g} m{aloft}"),
            ("flight time", f"{path.duration:.4g} s"),
            ("flight", escape(path.method)),
        ]
    return [
        (f"impulse {_key(ARROW)}", f"{float(np.linalg.norm(hit.impulse)):.4g} N s"),
        *_worst(hit),
        ("foot speed", f"{float(np.linalg.norm(hit.foot_velocity)):.4g} m/s"),
        ("ball speed", f"{float(hit.ball_after.speed):.4g} m/s"),
        *((("ball / foot", f"{hit.speed_ratio:.4g}"),) if hit.foot_velocity.any() else ()),
        ("launch angle", f"{round(math.degrees(float(hit.ball_after.elevation)), 1) + 0.0:.1f}°"),
        ("spin", _spin(hit)),
        *way,
        ("shown", _pace(drawn.pace)),
        ("stripes", f"{drawn.stripe:g} m"),
    ]


def _worst(hit: Impact) -> list[Row]:
    name, size = hit.worst_joint
    return [(f"worst joint {_key(JOINT)}", f"{size:.4g} N s at {_name(name)}")]


def _spin(hit: Impact) -> str:
    spin = float(np.linalg.norm(hit.ball_after.spin))
    rounding = 1e-12 * float(hit.ball_after.speed) / hit.ball.radius
    return f"{0.0 if spin < rounding else spin:.4g} rad/s"


def _key(colour: int) -> str:
    return f'<span class="key" style="background:#{colour:06x}"></span>'


def _pace(pace: Pace) -> str:
    if math.isclose(pace.strike, pace.flight, rel_tol=1e-3):
        return _times(pace.strike)
    return f"strike {_times(pace.strike)}, flight {_times(pace.flight)}"


def _times(slower: float) -> str:
    return f"{slower:.3g} times slower" if slower >= 1 else f"{1 / slower:.3g} times faster"
