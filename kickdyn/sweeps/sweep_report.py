"""The report of a sweep, as table, text and JSON: some of its postures; and its plot."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from kickdyn.contact import Contact
from kickdyn.core.files import plain
from kickdyn.core.plot_style import styled
from kickdyn.core.representation import PIPE_WIDTH, PROSE, empty_table, screen_width, wrapped
from kickdyn.core.validation import Array, length
from kickdyn.impact.strike import strike, strike_by_pinocchio
from kickdyn.robot.leg import Leg
from kickdyn.sweeps.dataset import provenance, sweep_warnings, variables_of
from kickdyn.sweeps.grid import DECIMALS, Grid
from kickdyn.sweeps.queries import SpeedMap, Summary, joint_values_by_unit
from kickdyn.sweeps.sweep_kick import Kick, PostureOutcome, PostureStatus, kick_from

PAPER_POSTURES = {
    "Table 2 a": ((5.0, 10.0, -5.0), 1.554),
    "Table 2 b": ((5.0, 10.0, 15.0), 0.944),
    "Table 2 c": ((5.0, 10.0, 40.0), 0.646),
}
"""Hip, knee, ankle [deg] of Fig. 7, the foot at 0, 20 and 45 deg, and Table 2's total [N s].

The paper prints the foot's angle; hip and knee are those that reproduce Table 2 within 0.2 %.
"""


@dataclass(frozen=True, eq=False)
class ReportLine:
    """One posture of the report."""

    label: str  # name of the posture
    angles: dict[str, float]  # joint to value, to nine decimals [deg; m for prismatic joints]
    outcome: PostureOutcome
    values: dict[str, float]  # of each of `dataset.VARIABLES`
    paper: float | None = None  # its impulse on an immovable obstacle [N s], where it prints one
    explanation: str = ""  # reason of the ball speed, of the best and the worst posture

    def as_json(self) -> dict[str, object]:
        """Return plain values, with None for nan."""
        impact, leg = self.outcome.impact, self.outcome.posture.leg
        return {
            "posture": self.label,
            **joint_values_by_unit(self.angles, {name: _unit(leg, name) for name in self.angles}),
            "status": self.outcome.status.value,
            **plain(self.values),
            "free_effective_mass": None if impact is None else plain(impact.free_effective_mass),
            "impulse_vector": None if impact is None else impact.impulse.tolist(),
            "worst_joint": None if impact is None else impact.worst_joint[0],
            "paper_immovable_impulse": self.paper,
            "explanation": self.explanation or None,
        }


def paper_lines(leg: Leg, kick: Kick) -> list[ReportLine]:
    """Return the paper's three postures of the human leg."""
    ours = kick.speed, kick.attack, kick.restitution_used
    as_printed = leg.frame == "toe" and ours == (1.0, math.radians(30), 0.8)  # as in Table 2
    return [
        _line(leg, kick, label, np.radians(angles), paper=total if as_printed else None)
        for label, (angles, total) in PAPER_POSTURES.items()
    ]


def extreme_lines(leg: Leg, grid: Grid, kick: Kick, summary: Summary) -> list[ReportLine]:
    """Return the postures of highest and lowest ball speed; none where no posture counts."""
    if not summary.chosen:
        return []
    lines = (
        _line(leg, kick, "best", grid.configuration(leg, int(summary.best[0, 2]))),
        _line(leg, kick, "worst", grid.configuration(leg, summary.worst)),
    )
    return [replace(line, explanation=_explanation(line, kick)) for line in lines]


def page_lines(
    leg: Leg, grid: Grid, kick: Kick, summary: Summary, lines: Sequence[ReportLine]
) -> list[ReportLine]:
    """Return the postures that a page shows, each explained; none where no posture counts.

    They are the best posture with the fastest foot that its joints' speed limits allow, the best,
    the posture of least impulse in a joint, and the others of the report.
    """
    best = next((line for line in lines if line.label == "best"), None)
    if best is None:
        return []
    least = grid.configuration(leg, int(summary.front[-1, 2]))
    shown = [
        (replace(best, label=f"best, foot {kick.speed:.3g} m/s"), kick),
        (_line(leg, kick, "least joint impulse", least), kick),
        *((line, kick) for line in lines if line is not best),
    ]
    use = best.outcome.speed_use
    if 0.0 < kick.speed / FASTEST < use:
        fast = replace(kick, speed=kick.speed / use * (1 - 1e-9))  # rounding exceeds no limit
        label = f"best, fastest foot {fast.speed:.3g} m/s"
        shown.insert(0, (_line(leg, fast, label, best.outcome.posture.q), fast))
    return [replace(line, explanation=_caption(line, kick)) for line, kick in shown]


FASTEST = 1e6
"""Speed of a foot from which on its joints have no speed limit, in effect [m/s]."""


def _caption(line: ReportLine, kick: Kick) -> str:
    """Return the description of the kick in a posture, as sentences."""
    if line.outcome.impact is None:
        return "The foot cannot move in this direction."
    values = line.values
    return (
        f"The foot meets the ball at {kick.speed:.3g} m/s. The ball leaves at "
        f"{values['ball_speed']:.3g} m/s and flies {values['carry']:.3g} m until it is back at its "
        f"launch height: {_explanation(line, kick)}."
    )


def _line(leg: Leg, kick: Kick, label: str, q: Array, paper: float | None = None) -> ReportLine:
    outcome = kick_from(leg.posture(q), kick)
    joints = leg.display_values(q)
    angles = {name: round(value, DECIMALS) + 0.0 for name, (value, _) in joints.items()}
    return ReportLine(label, angles, outcome, variables_of(outcome, kick), paper)


def _explanation(line: ReportLine, kick: Kick) -> str:
    """Return why the ball leaves as fast as it does, and whether the foot can meet it so."""
    values, posture = line.values, line.outcome.posture
    cone, contact = posture.leg.contact_normal_cone, posture.contact_point
    edges = () if cone is None else (posture.with_contact_offset(row).contact_point for row in cone)
    overlap = ""
    if any(kick.contact.normal @ (edge - contact) <= -1e-9 for edge in edges):
        overlap = (
            f"; with this normal, a ball at {posture.leg.frame} can overlap with the foot "
            "(Leg.contact_normal_cone)"
        )
    return (
        f"the effective mass of the leg is {values['effective_mass']:.3g} kg, "
        f"{values['effective_mass'] / kick.ball.mass:.3g} times the ball's mass; the ball leaves "
        f"at {values['speed_ratio']:.3g} times the foot's speed "
        f"({1 + kick.restitution_used:.3g} if the leg were infinitely heavy); "
        f"its joints need {values['speed_use']:.0%} of their speed limits{overlap}"
    )


def show(leg: Leg, kick: Kick, summary: Summary, lines: Sequence[ReportLine]) -> None:
    """Print the kick, the table and the text as wide as the screen is; no number is cut off."""
    flight = "vacuum" if kick.air is None else f"air {kick.air.density:.4g} kg/m3"
    law = "" if kick.law == "newton" else f"law {kick.law}, "
    title = (
        f"{leg.name}: foot {kick.speed:g} m/s at {math.degrees(kick.attack):g} deg, "
        f"{law}restitution {kick.restitution_used:g}, friction {kick.friction:g}, "
        f"ball {kick.ball.mass:g} kg, radius {kick.ball.radius:.4g} m, {flight}"
    )
    width = min(PROSE, screen_width())
    print(wrapped(title, width))
    Console(highlight=False, width=PIPE_WIDTH).print(table(leg, lines))
    print(text(summary, lines, width))


def _shown_joints(leg: Leg, lines: Sequence[ReportLine]) -> list[str]:
    """Return the joints between the base and the contact frame, and all that are not at 0."""
    model = leg.workspace.model
    path = {str(model.names[joint]) for joint in model.supports[leg.contact_joint]}
    nonzero = {name for line in lines for name, value in line.angles.items() if value}
    return [name for name in leg.single_joints if name in path | nonzero]


def table(leg: Leg, lines: Sequence[ReportLine]) -> Table:
    """Return the table with a column for each posture."""
    rows: dict[str, list[str]] = {
        f"{name}, {_unit(leg, name)}": [f"{line.angles[name]:.4g}" for line in lines]
        for name in _shown_joints(leg, lines)
    }
    rows["effective mass, kg"] = _cells(lines, "effective_mass", ".4g")
    if leg.stiff_joints:
        free = (line.as_json()["free_effective_mass"] for line in lines)
        rows["all joints free, kg"] = ["" if mass is None else f"{mass:.4g}" for mass in free]
    if leg.workspace.model.armature.any():
        for name in ("without rotors", "with rotors", "with stiff joints"):
            hits = (line.outcome.impact for line in lines)
            limits = [hit and hit.posture.effective_mass_limits(hit.contact.normal) for hit in hits]
            rows[f"{name}, kg"] = [f"{masses[name]:.4g}" if masses else "" for masses in limits]
    rows |= {
        "impulse on the ball, N s": _cells(lines, "impulse", ".4f"),
        "ball speed / foot speed": _cells(lines, "speed_ratio", ".4f"),
        "launch angle, deg": _cells(lines, "launch_angle", ".2f", 180 / math.pi),
        "back spin, rad/s": _cells(lines, "back_spin", ".3f"),
        "carry distance, m": _cells(lines, "carry", ".4g"),
        "joint of largest impulse": [str(line.as_json()["worst_joint"] or "") for line in lines],
        "impulse in that joint, N s": _cells(lines, "worst_joint_impulse", ".4f"),
        "impulse on a fixed body, N s": _cells(lines, "immovable_impulse", ".4g"),
    }
    if any(line.paper for line in lines):
        printed = [f"{line.paper:.3f}" if line.paper else "" for line in lines]
        rows["the same in the paper, N s"] = printed
    if any(line.outcome.status is not PostureStatus.OK for line in lines):
        rows["status"] = [line.outcome.status.value for line in lines]
    result = empty_table("")
    result.add_column("posture", no_wrap=True)
    for line in lines:
        result.add_column(line.label, justify="right", no_wrap=True)
    for name, cells in rows.items():
        result.add_row(*map(escape, (name, *cells)))
    return result


def _cells(lines: Sequence[ReportLine], name: str, form: str, scale: float = 1.0) -> list[str]:
    """Return a variable of each line as text, empty where there was no impact."""
    return [
        "" if line.outcome.impact is None else format(scale * line.values[name], form)
        for line in lines
    ]


def text(summary: Summary, lines: Sequence[ReportLine], width: int = PROSE) -> str:
    """Return the text below the table: explanations, counts, and the largest residual.

    A line has at most `width` characters, unless a word is longer.
    """
    sentences = []
    if any(line.label in PAPER_POSTURES for line in lines):
        sentences.append(
            "Table 2 a, b and c have the foot angles of the ICRA 2005 paper's Table 2; hip and "
            "knee are fitted, see kickdyn paper."
        )
    if lines:
        leg = lines[0].outcome.posture.leg
        shown = _shown_joints(leg, lines)
        for line in lines:
            if line.explanation:
                angles = (f"{name} {line.angles[name]:.4g} {_unit(leg, name)}" for name in shown)
                sentences.append(f"{line.label} ({', '.join(angles)}): {line.explanation}.")
        hidden = len(leg.single_joints) - len(shown)
        if hidden:
            hidden_joints = "one other joint is" if hidden == 1 else f"{hidden} other joints are"
            sentences.append(f"The robot's {hidden_joints} at 0; --json lists all.")
    counts = ", ".join(f"{number} {name}" for name, number in summary.counts.items() if number)
    sentences.append(f"{summary.postures} postures: {counts}.")
    if summary.where is not None and summary.chosen:
        among = f"among the {summary.chosen} with status ok"
        sentences.append(f"Best and worst are {among} where {summary.where}.")
    elif summary.where is not None:
        sentences.append(f"No posture is ok where {summary.where}.")
    if math.isfinite(summary.residual):
        power = math.ceil(math.log10(max(summary.residual, 1e-17))) + 1
        most = f"below 1e{power:+03d}"
        sentences.append(f"The relative residuals of restitution and momentum are {most}.")
    if differences := pinocchio_differences(lines):
        power = math.ceil(math.log10(max([*differences, 1e-17]))) + 1
        sentences.append(
            "Without friction, pin.impulseDynamics gives the impulses of all "
            f"{len(differences)} postures above: the relative difference is below 1e{power:+03d}."
        )
    return "\n".join(wrapped(sentence, width) for sentence in sentences)


def pinocchio_differences(lines: Sequence[ReportLine]) -> list[float]:
    """Return the relative differences of the impulses from `pin.impulseDynamics`.

    Both are without friction, which Pinocchio's solver lacks; postures without an impact, or with
    a ball of infinite mass, are left out.
    """
    differences = []
    for hit in (line.outcome.impact for line in lines):
        if hit is not None and math.isfinite(hit.ball.mass):  # Pinocchio's solver takes no other
            contact = Contact(hit.contact.normal, hit.contact.restitution)
            closed = strike(hit.posture, hit.v_before, hit.ball, contact)
            other = strike_by_pinocchio(hit.posture, hit.v_before, hit.ball, contact)
            change = other.impulse - closed.impulse
            differences.append(float(length(change) / length(closed.impulse)))
    return differences


def _unit(leg: Leg, joint: str) -> str:
    return "m" if leg.joint_unit(joint) == "m" else "deg"


def as_json(
    leg: Leg, kick: Kick, summary: Summary, lines: Sequence[ReportLine]
) -> dict[str, object]:
    """Return the report as plain values."""
    where = {} if summary.where is None else {"where": summary.where, "chosen": summary.chosen}
    counts = {name: n for name, n in summary.counts.items() if name != PostureStatus.NOT_COMPUTED}
    return {
        **provenance(leg, kick),
        "warnings": list(sweep_warnings(leg, kick)),
        "restitution_given": kick.contact.restitution,
        "postures": summary.postures,
        "status": counts,
        **where,
        "lines": [line.as_json() for line in lines],
        "pinocchio_difference": max(pinocchio_differences(lines), default=None),
        **summary.as_json(),
    }


_LABEL = "ball speed / foot speed"


@styled()
def sweep_figure(summary: Summary, lines: Sequence[ReportLine] = ()) -> Any:
    """Draw a sweep.

    Args:
        summary: the summary of the sweep; postures that count for it are drawn.
        lines: postures to mark, as in the report.

    Returns:
        A figure: the ratio of ball speed to foot speed over the three joints with most values, by
        pairs (the best over the others), or over the one joint there is; and last that ratio
        against the largest joint impulse, with the postures that no other beats in both.
    """
    from matplotlib.figure import Figure

    foot_speed = float(summary.attributes["foot_speed_m_s"])
    maps = summary.maps
    rows = 2 if len(maps) > 1 else 1
    figure = Figure(figsize=(11, 4.6 * rows))
    panels = figure.subplots(rows, 2).ravel()
    ratios = np.concatenate([speeds.best.ravel() for speeds in maps.values()]) / foot_speed
    span = (np.fmin.reduce(ratios), np.fmax.reduce(ratios))
    for speeds, panel in zip(maps.values(), panels, strict=False):
        _draw_map(figure, panel, speeds, summary, span)
    _draw_front(figure, panels[-1], summary, lines)
    figure.suptitle(_title(summary))
    return figure


def _title(summary: Summary) -> str:
    """Return leg, kick, condition and, of an unfinished sweep, the share that is computed."""
    about = summary.attributes
    title = (
        f"{_plain(about['leg'])}: foot {about['foot_speed_m_s']:g} m/s at "
        f"{about['attack_deg']:g}°, restitution {about['restitution']:g}, "
        f"friction {about['friction']:g}, ball {about['ball_mass_kg']:g} kg"
    )
    if summary.where is not None:
        title += f"\nwhere {_plain(summary.where)}"
    share = summary.postures / sum(summary.counts.values())
    return title if share == 1.0 else f"{title}\nunfinished: {share:.0%} of the postures"


def _draw_map(
    figure: Any, axes: Any, speeds: SpeedMap, summary: Summary, span: tuple[float, float]
) -> None:
    """Draw the best ratio over one joint as a line, over two as a map."""
    reduced = [
        _plain(name)
        for name, values in summary.axes.items()
        if name not in speeds.values and len(values) > 1
    ]
    if reduced:
        axes.set_title(f"best over {', '.join(reduced)}")
    labels = [f"{_plain(name)} [{summary.units[name]}]" for name in speeds.values]
    best = speeds.best / float(summary.attributes["foot_speed_m_s"])
    values = list(speeds.values.values())
    if len(labels) == 1:
        axes.plot(values[0], best, ".-")
        axes.set(xlabel=labels[0], ylabel=_LABEL)
        return
    mesh = axes.pcolormesh(*values, best.T, shading="nearest", vmin=span[0], vmax=span[1])
    figure.colorbar(mesh, ax=axes, label=_LABEL)
    axes.set(xlabel=labels[0], ylabel=labels[1])


def _draw_front(figure: Any, axes: Any, summary: Summary, lines: Sequence[ReportLine]) -> None:
    """Draw ratio against joint impulse: a sample, the front, and the postures of the report."""
    from matplotlib.patheffects import withStroke

    foot_speed = float(summary.attributes["foot_speed_m_s"])
    load, speed, use = summary.sample.T
    dots = axes.scatter(load, speed / foot_speed, c=100 * use, s=7, cmap="cividis")
    figure.colorbar(dots, ax=axes, label="joint speeds needed, % of their limits")
    speed, load, _ = summary.front[::-1].T
    axes.step(load, speed / foot_speed, where="post", color="tab:red", lw=1.2, label="Pareto front")
    for line in lines:
        x, y = line.values["worst_joint_impulse"], line.values["speed_ratio"]
        if np.isfinite(x):
            axes.plot(x, y, "o", markerfacecolor="none", color="tab:red", markersize=8)
            axes.annotate(  # at the side where no posture is better
                line.label, (x, y), xytext=(-6, 2), textcoords="offset points", ha="right",
                color="tab:red", path_effects=[withStroke(linewidth=3, foreground="white")],
            )  # fmt: skip
    if len(load):
        axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.1)
    axes.set(xlabel="largest joint impulse [N s]", ylabel=_LABEL)
    axes.set_title("ball speed against joint impulse", loc="left")
    axes.margins(0.2, 0.1)


def _plain(name: str) -> str:
    """Return a text without formulas: matplotlib reads them between dollars."""
    return name.replace("$", r"\$")
