"""The numbers of a kick, or of several flights, as a panel of HTML beside the picture."""

import math
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from typing import Any

import meshcat.geometry as shapes
import numpy as np
import trimesh

from kickdyn.core.representation import format_value
from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.flight.follow import Course
from kickdyn.impact.impact_result import Impact
from kickdyn.view import marks
from kickdyn.view.kick_scene import JOINT_ARROW, LEAST_JOINT_IMPULSE
from kickdyn.view.leg_figure import BallPath, curve_of

Row = tuple[str, str]
"""What it is and its value, both HTML."""


def kick_panel(
    impact: Impact,
    path: BallPath,
    text: str,
    warnings: Sequence[str] = (),
    more: Iterable[tuple[str, object, str]] = (),
) -> str:
    """Return the panel of a kick, with lines of plain text and `more` rows of a result."""
    name = impact.posture.leg.name
    rows = [("leg", _name(name))] if name else []
    joint, size = impact.worst_joint
    after = impact.ball_after
    speed, spin = float(after.speed), float(np.linalg.norm(after.spin))
    if spin < 1e-12 * speed / impact.ball.radius:  # rounding
        spin = 0.0
    of_ball = f"{np.linalg.norm(impact.impulse):.4g} N s"
    rows += [
        (f"impulse on ball {colour_key(marks.ARROW)}", of_ball),
        (f"worst joint {colour_key(JOINT_ARROW)}", f"{size:.4g} N s at {_name(joint)}"),
        ("effective mass", f"{impact.effective_mass:.4g} kg"),
        ("foot speed", f"{np.linalg.norm(impact.foot_velocity):.4g} m/s"),
        ("ball speed", f"{speed:.4g} m/s"),
        ("ball / foot speed", f"{impact.speed_ratio:.4g}" if impact.foot_velocity.any() else ""),
        ("launch angle", f"{round(math.degrees(float(after.elevation)), 1) + 0.0:.1f}°"),
        ("spin", f"{spin:.4g} rad/s"),
    ]
    rows = [row for row in rows if row[1]] + [*_path_rows(path), *html_rows(more)]
    title = f"Ball at {speed:.4g} m/s"
    return panel_of(title, rows, text, _joints(impact), warnings)


def html_rows(rows: Iterable[tuple[str, object, str]]) -> list[Row]:
    """Return rows of a result as HTML."""
    return [(escape(head), escape(f"{format_value(x)} {unit}".strip())) for head, x, unit in rows]


def panel_of(
    title: str, rows: Sequence[Row], text: str = "", end: str = "", warnings: Sequence[str] = ()
) -> str:
    """Return a panel: title, a sentence of the text, table, warnings, more text, HTML `end`."""
    lead, stop, further = text.partition(". ")
    head = f"<h1>{escape(title)}</h1>\n" + (f"<p>{escape(lead + stop)}</p>\n" if text else "")
    lines = "".join(f'<p class="warning">{escape(warning)}</p>\n' for warning in warnings)
    more = f"<p>{escape(further)}</p>\n" if further else ""
    if len(more) > 300:  # a text of more characters is folded
        more = f"<details><summary>explanation</summary>\n{more}</details>\n"
    return f"{head}{_table(rows)}\n{lines}{more}{end}"


def colour_key(colour: int) -> str:
    """Return a small square of a colour."""
    return f'<span class="key" style="background:#{colour:06x}"></span>'


def _table(rows: Sequence[Row], short: int = 12) -> str:
    """Return rows as a table; where rows stand side by side, longer values have their own line."""
    long = ' class="long"'
    lines = (
        f"<tr{long if len(value) > short else ''}><th>{head}</th><td>{value}</td></tr>"
        for head, value in rows
    )
    return "<table>\n" + "\n".join(lines) + "\n</table>"


def _name(name: str) -> str:
    """Return a joint's name as HTML, which may be broken after an underscore."""
    return escape(name).replace("_", "_<wbr>")


def _joints(impact: Impact) -> str:
    """Return the joints that move or transmit an impulse, the largest first; many are folded."""
    leg = impact.posture.leg
    values = leg.display_values(impact.posture.q)
    norms = np.linalg.norm(impact.joint_impulses[:, :3], axis=1).tolist()
    rows = []
    named = zip(norms, leg.joint_names, strict=True)
    for size, name in sorted(named, key=lambda row: -round(row[0], 9)):  # rounding orders nothing
        value, unit = values.get(name, (0.0, ""))  # a floating base has no single angle
        shown = {"m": f"{value:.4g} m, ", "deg": f"{value:.1f}°, "}.get(unit, "")
        moves = name in values and impact.v_before[leg.velocity_index(name)]
        if moves or size > LEAST_JOINT_IMPULSE * max(norms):
            rows.append((_name(name), f"{shown}{size:.3g} N s"))
    key = colour_key(JOINT_ARROW)
    summary = f"{len(rows)} joints: angle, and impulse on the body below {key}"
    start = f"<details{' open' * (len(rows) <= 4)}><summary>{summary}</summary>"
    return f"{start}\n{_table(rows, short=16)}\n</details>\n"


def _path_rows(path: BallPath) -> list[Row]:
    if isinstance(path, Course):
        methods = "; ".join(dict.fromkeys(flight.method for flight in path.flights))
        return [
            (f"path {colour_key(marks.CURVE)}", f"{path.distance:.4g} m along the ground"),
            ("time", f"{path.duration:.4g} s"),
            ("final speed", f"{float(path.rest.speed):.4g} m/s"),
            ("flight", escape(methods)),
        ]
    aloft = " (still aloft)" if path.status == "aloft" else ""
    length = "distance" if path.status == "at-plane" else "range"
    return [
        (f"{length} {colour_key(marks.CURVE)}", f"{path.range:.4g} m{aloft}"),
        ("flight time", f"{path.duration:.4g} s"),
        ("flight", escape(path.method)),
    ]


COLOURS = (0xE63946, 0x2456D6, 0xF4A300, 0x6A2FB5, 0x0E8F8F, 0x8C5A2B, 0xD81E9B, 0x7FE3F5)
MOST_FLIGHTS = len(COLOURS)
"""Flights of one picture."""

MOST_DOTS = 12
"""About how many measured positions of a flight are drawn."""

DOT_COLOUR = 0x111111


def draw_flights(
    viewer: Any,
    paths: Mapping[str, BallPath],
    title: str,
    measured: Mapping[str, Array],
) -> str:
    """Draw flights over one lawn, and dots of measured positions by name; return their legend."""
    if not 0 < len(paths) <= MOST_FLIGHTS:
        raise InvalidInput(f"there are {len(paths)} flights: one page compares 1 to {MOST_FLIGHTS}")
    curves = [curve_of(path) for path in paths.values()]
    points = np.vstack(curves)
    reference = next(iter(paths.values()))
    start = reference.launch.position
    radius = (reference.flights[0] if isinstance(reference, Course) else reference).ball.radius
    distances = np.hypot(*(points - points[0])[:, :2].T)
    length, forward = distances.max(), marks.level_direction(points[distances.argmax()] - points[0])
    size = max(float(np.ptp(points, axis=0).max()), radius)
    column = np.array([start, start + 0.3 * size * marks.UP_AXIS])
    foreground = marks.box_corners(column, 0.02 * size)
    camera = marks.camera_for(foreground, marks.box_corners(points, radius), forward)
    marks.set_stage(viewer, camera, points)
    rows, right = [], np.cross(forward, marks.UP_AXIS)
    for number, (name, path) in enumerate(paths.items()):
        curve, colour = curves[number], COLOURS[number]
        width = 1.5 * camera.curve_width(curve)
        marks.draw_curve(viewer[f"curve/{number}"], curve, width, right, colour)
        if name in measured:
            places = measured[name][:: max(len(measured[name]) // MOST_DOTS, 1)]
            solid, size_of_dots = trimesh.creation.icosahedron(), 0.0035 * size
            corners = (places[:, None] + size_of_dots * solid.vertices).reshape(-1, 3)
            faces = 12 * np.arange(len(places))[:, None, None] + solid.faces
            dots = shapes.TriangularMeshGeometry(corners, faces.reshape(-1, 3))
            viewer[f"dots/{number}"].set_object(dots, marks.overlay(DOT_COLOUR))
        rows.append((f"{colour_key(colour)} {escape(name)}", _length(path)))
    marks.draw_ball(viewer["ball"], radius, start)
    stripe = marks.stripe_width(size)
    floor = np.array([*start[:2], points[:, 2].min() - radius])
    marks.draw_ground(viewer["ground"], floor, forward, stripe, 3 * size)
    marks.draw_distances(viewer["distances"], floor, forward, stripe, length)
    marks.draw_axes(viewer["axes"], floor, stripe / 2)
    if measured:
        dots = f"about {MOST_DOTS} positions per flight"
        rows.append((f"{colour_key(DOT_COLOUR)} measured", dots))
    origin = "first sample" if measured else "launch"
    rows.append(("distances, heights", f"from the {origin}"))
    return panel_of(title, rows)


def _length(path: BallPath) -> str:
    if isinstance(path, Course):
        return f"{path.distance:.4g} m along the ground, {path.duration:.3g} s"
    return f"{path.range:.3g} m, rises {path.height:.3g} m, {path.duration:.3g} s"
