"""Measure the error of kicks in MuJoCo against the time step, with tuned contacts and its defaults.

    python benchmarks/mujoco_tuning.py --plot docs/images/mujoco_tuning.png

The human leg kicks a size 5 ball at 14 m/s, in a posture and with joint velocities of
docs/explanation/compliance.md: frictionless along the swing, and with friction 0.4 off it, where
the ball slides over the foot first. The ball is that of `collide` with a contact of 10 ms. Errors
are the largest of eight kicks that reach the ball at different moments within a time step.

Joint impulses are compared with those of `strike`, because `collide` has none: the sum over the
steps of the force in each joint, less what it would be without the ball. The leg turns within
10 ms, so that a difference remains however small the step is.
"""

from concurrent.futures import ProcessPoolExecutor
from typing import NamedTuple

import click
import numpy as np
import pinocchio as pin
from matplotlib.figure import Figure

import kickdyn as kd
from kickdyn.accuracy.mujoco_kick import MujocoContact, MujocoKick
from kickdyn.accuracy.tune_mujoco import find_best, find_error, kick_cases
from kickdyn.core.plot_style import save_figure, styled
from kickdyn.impact.impact_result import Impact

POSTURE = kd.Leg.human().posture(np.radians([40, 30, -20]))
V = np.array([8.25, -18.15, 2.48])  # rad/s
NORMALS = {0.0: (0.866, 0.0, 0.5), 0.4: (1.0, 0.0, 0.0)}
CONTACT_TIME = 0.010  # s
RESTITUTIONS = (0.3, 0.5, 0.7, 0.9)
STEPS = (5e-4, 1e-3, 2e-3, 5e-3)  # s
INTEGRATORS = ("implicitfast", "Euler", "RK4")
ALL_INTEGRATORS = 0.7
"""Restitution of which all integrators are compared; of the others, the first one is taken."""
DEFAULTS = "defaults"


class Row(NamedTuple):
    """Errors of a contact in per cent, of the direction in degrees.

    `around` is the largest error of the speed of the ball at 0.5 to 1.5 times all velocities,
    `joints` that of a joint impulse, relative to the largest one.
    """

    friction: float
    restitution: float
    integrator: str
    step: float
    contact: str
    speed: float
    direction: float
    around: float
    joints: float


def joint_error(kick: MujocoKick, impact: Impact) -> float:
    """Return the largest error of a joint's impulse, relative to the largest impulse."""
    leg = impact.posture.leg
    data = leg.model.createData()
    pin.forwardKinematics(leg.model, data, impact.posture.q)
    own = np.array(
        [data.oMi[k + 1].rotation @ part[:3] for k, part in enumerate(impact.joint_impulses)]
    )
    found = kick.run(0.5, joint_impulses=True).joint_impulses
    return float(np.linalg.norm(found - own, axis=1).max() / np.linalg.norm(own, axis=1).max())


def measure(friction: float, restitution: float) -> list[Row]:
    """Return the rows of a restitution."""
    contact = kd.Contact(NORMALS[friction], restitution, friction)
    impact = kd.strike(POSTURE, V, kd.Ball(), contact)
    cases = kick_cases(impact.approach, CONTACT_TIME)[:5]
    rows = []
    compared = INTEGRATORS if restitution == ALL_INTEGRATORS else INTEGRATORS[:1]
    for integrator in compared:
        for step in STEPS:
            tuned = find_best(cases, step, integrator, CONTACT_TIME).contact
            for name, one in (("tuned", tuned), (DEFAULTS, MujocoContact(friction=friction))):
                kicks = [MujocoKick(case.approach, step, one, integrator, True) for case in cases]
                errors = [find_error(*pair, one) for pair in zip(cases, kicks, strict=True)]
                rows.append(
                    Row(
                        friction, restitution, integrator, step, name, 100 * errors[0].speed,
                        float(np.degrees(errors[0].direction)),
                        100 * max(error.speed for error in errors),
                        100 * joint_error(kicks[0], impact),
                    )
                )  # fmt: skip
    return rows


def select(rows: list[Row], **wanted: object) -> list[Row]:
    """Return the rows with these values."""
    return [row for row in rows if all(getattr(row, k) == v for k, v in wanted.items())]


def table(heads: dict[str, list[Row]]) -> str:
    """Return a table: a line for each head, in each cell what is tuned and the defaults."""
    lines = [
        "| | " + " | ".join(f"{1e3 * step:g} ms" for step in STEPS) + " |",
        "|---" * (1 + len(STEPS)) + "|",
    ]
    for head, chosen in heads.items():
        cells = []
        for step in STEPS:
            one, other = (select(chosen, step=step, contact=c)[0] for c in ("tuned", DEFAULTS))
            cells.append(
                f"{one.speed:.1f} %, {one.direction:.1f}°, {one.around:.1f} %, {one.joints:.0f} % "
                f"({other.speed:.0f} %, {other.direction:.1f}°, {other.joints:.0f} %)"
            )
        lines.append(f"| {head} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


@styled()
def figure(rows: list[Row]) -> Figure:
    """Return a figure of the errors against the time step."""
    drawn = Figure(figsize=(9, 6))
    axes = drawn.subplots(2, 2, sharex=True, sharey="row")
    shown = [("speed", "error of ball speed, %"), ("direction", "error of direction, deg")]
    for (quantity, label), line in zip(shown, axes, strict=True):
        for friction, panel in zip(NORMALS, line, strict=True):
            for number, e in enumerate(RESTITUTIONS):
                for contact, style in (("tuned", "-o"), (DEFAULTS, ":")):
                    chosen = select(
                        rows, friction=friction, restitution=e, contact=contact,
                        integrator="implicitfast",
                    )  # fmt: skip
                    panel.loglog(
                        [1e3 * row.step for row in chosen],
                        [getattr(row, quantity) for row in chosen],
                        style, color=f"C{number}", markersize=3, label=f"e = {e:g}, {contact}",
                    )  # fmt: skip
            panel.set_title("frictionless" if friction == 0 else f"friction {friction:g}")
            panel.set_xticks([1e3 * step for step in STEPS], [f"{1e3 * s:g}" for s in STEPS])
            panel.minorticks_off()
        line[0].set_ylabel(label)
    for panel in axes[1]:
        panel.set_xlabel("time step, ms")
    handles, labels = axes[0][0].get_legend_handles_labels()
    drawn.legend(handles, labels, ncols=4, loc="outside lower center")
    return drawn


@click.command()
@click.option("--plot", help="Draw the errors: .png, .svg or .pdf.")
def main(plot: str | None) -> None:
    """Print the tables, and draw them."""
    kinds = [(friction, e) for friction in NORMALS for e in RESTITUTIONS]
    with ProcessPoolExecutor(2) as pool:
        rows = [row for part in pool.map(measure, *zip(*kinds, strict=True)) for row in part]
    fast = select(rows, integrator="implicitfast")
    print(
        table(
            {
                f"mu = {mu:g}, e = {e:g}": select(fast, friction=mu, restitution=e)
                for mu, e in kinds
            },
        )
    )
    print()
    middle = select(rows, restitution=ALL_INTEGRATORS)
    heads = {
        f"mu = {mu:g}, {integrator}": select(middle, friction=mu, integrator=integrator)
        for mu in NORMALS
        for integrator in INTEGRATORS
    }
    print(table(heads))
    if plot is not None:
        save_figure(figure(rows), plot)


if __name__ == "__main__":
    main()
