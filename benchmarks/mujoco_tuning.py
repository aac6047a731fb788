"""Measure the error of kicks in MuJoCo against the time step, with tuned contacts and its defaults.

    python benchmarks/mujoco_tuning.py --csv FILE.csv --plot FILE.png

The human leg kicks a size 5 ball at 14 m/s, in a posture and with joint velocities of
docs/explanation/compliance.md: frictionless along the swing, and with friction 0.4 off it, where
the ball slides over the foot first. The ball is that of `collide` with a contact of 10 ms. Errors
are the largest of eight kicks that reach the ball at different moments within a time step.

Joint impulses are the sum over the steps of the force in each joint, less what it would be without
the ball, and are compared with those of `collide` and of `strike`.

The tables printed are parts of the file that `--csv` writes. It takes some minutes on two cores.
"""

import csv
from collections.abc import Iterable
from concurrent.futures import ProcessPoolExecutor
from itertools import product
from typing import NamedTuple

import click
import mujoco
import numpy as np
from matplotlib.figure import Figure

import kickdyn as kd
from kickdyn.core.plot_style import save_figure, styled
from kickdyn.core.validation import Array
from kickdyn.simulators.mujoco_fit import (
    SHAPES,
    SPEEDS,
    find_best,
    find_error,
    fit_contact,
    kick_cases,
)
from kickdyn.simulators.mujoco_kick import MujocoContact, MujocoKick, pair, row

POSTURE = kd.Leg.human().posture(np.radians([40, 30, -20]))
V = np.array([8.25, -18.15, 2.48])  # rad/s
NORMALS = {0.0: (0.866, 0.0, 0.5), 0.4: (1.0, 0.0, 0.0)}
CONTACT_TIME = 0.010  # s
TOLERANCE = 0.03  # the default of `tune_mujoco`
RESTITUTIONS = (0.3, 0.5, 0.7, 0.9)
STEPS = (1e-4, 2e-4, 5e-4, 1e-3, 2e-3, 5e-3)  # s
INTEGRATORS = ("implicitfast", "Euler", "RK4")
TUNED, DEFAULTS = "tuned", "defaults"
CONES: dict[str, dict[str, int]] = {
    "elliptic cone": {},
    "elliptic cone, impratio 1": {"impratio": 1},
    "elliptic cone, 20 iterations of noslip": {"noslip_iterations": 20},
    "pyramidal cone": {"cone": 0},
}
"""Options of MuJoCo beside the elliptic cone and impratio 100, which `tune_mujoco` takes."""


class Row(NamedTuple):
    """Errors of a contact: relative ones in per cent, directions in degrees, spins in rad/s.

    `around` is of kicks at 0.5 to 1.5 times all velocities; `joints` and `joints_strike` are the
    largest error of a joint's linear impulse, relative to the largest impulse, against `collide`
    and `strike`. `floor` is the restitution of the same ball on a floor, at 5 m/s.
    """

    friction: float
    restitution: float
    integrator: str
    step_ms: float
    contact: str
    speed: float
    direction: float
    spin: float
    speed_around: float
    direction_around: float
    joints: float
    joints_strike: float
    floor: float


def measure(friction: float, restitution: float, integrator: str, step: float) -> list[Row]:
    """Return the row of the tuned contact, and that of MuJoCo's defaults."""
    contact = kd.Contact(NORMALS[friction], restitution, friction)
    impact = kd.strike(POSTURE, V, kd.Ball(), contact)
    hit = kd.collide(POSTURE, V, kd.Ball(), contact, contact_time=CONTACT_TIME)
    cases = kick_cases(impact.approach, CONTACT_TIME)[: 1 + len(SPEEDS)]
    tuned = find_best(cases, step, integrator, CONTACT_TIME, TOLERANCE).contact
    rows = []
    for name, one in ((TUNED, tuned), (DEFAULTS, MujocoContact(friction=friction))):
        kicks = [MujocoKick(case.approach, step, one, integrator, gravity=True) for case in cases]
        errors = [find_error(*pair, one) for pair in zip(cases, kicks, strict=True)]
        found = joint_impulses(kicks[0])
        rows.append(
            Row(
                friction, restitution, integrator, 1e3 * step, name, 100 * errors[0].speed,
                float(np.degrees(errors[0].direction)), errors[0].spin,
                100 * max(error.speed for error in errors),
                float(np.degrees(max(error.direction for error in errors))),
                joint_error(found, hit.joint_impulses), joint_error(found, impact.joint_impulses),
                bounce(one, integrator, step),
            )
        )  # fmt: skip
    return rows


def joint_impulses(kick: MujocoKick) -> Array:
    """Return the impulse in each joint, shape `(njoints, 3)` [N s, in the frame of the joint].

    It is of the force on the body that the joint moves, less what it would be without the ball, of
    a contact that begins in the middle of a time step.
    """
    step, model, data = kick.timestep, kick.model, kick.data
    names = list(kick.approach.posture.leg.model.names)[1:]
    forces, pushed = np.zeros((model.nbody, 3)), False

    def joint_forces(disabled: int) -> Array:
        model.opt.disableflags = disabled
        mujoco.mj_forward(model, data)
        mujoco.mj_rnePostConstraint(model, data)
        model.opt.disableflags = 0
        axes = data.xmat.reshape(-1, 3, 3)  # of each body, in the world's
        return np.asarray(np.einsum("bij,bi->bj", axes, data.cfrc_int[:, 3:]))

    kick.start(0.5 * step)
    while kick.pushes() or not pushed:
        pushed = kick.pushes() or pushed
        forces += step * (joint_forces(0) - joint_forces(mujoco.mjtDisableBit.mjDSBL_CONTACT))
        mujoco.mj_step(model, data)
    return forces[[model.body(name).id for name in names]]


def joint_error(found: Array, wanted: Array) -> float:
    """Return the largest error of a joint's linear impulse, in per cent of the largest impulse."""
    own = wanted[:, :3]
    return float(
        100 * np.linalg.norm(found - own, axis=1).max() / np.linalg.norm(own, axis=1).max()
    )


def bounce(contact: MujocoContact, integrator: str, step: float, speed: float = 5.0) -> float:
    """Return the restitution of the ball that falls on a floor."""
    ball, margin = kd.Ball(), contact.margin
    model = mujoco.MjModel.from_xml_string(f"""<mujoco>
  <option timestep="{step!r}" integrator="{integrator}" cone="elliptic" gravity="0 0 0"/>
  <worldbody>
    <geom name="floor" type="plane" size="1 1 1"/>
    <body pos="0 0 {ball.radius + 0.5 * step * speed!r}"><freejoint/>
      <inertial pos="0 0 0" mass="{ball.mass!r}" diaginertia="{row([ball.inertia] * 3)}"/>
      <geom name="ball" type="sphere" size="{ball.radius - margin!r}"/>
    </body>
  </worldbody>
  <contact>{pair(contact, "floor")}</contact>
</mujoco>""")
    data = mujoco.MjData(model)
    data.qvel[2] = -speed
    while data.ncon == 0 or data.qvel[2] < 0.0:
        mujoco.mj_step(model, data)
    while data.ncon:
        mujoco.mj_step(model, data)
    return float(data.qvel[2]) / speed


def direction_errors(e: float, margin: bool, options: dict[str, int], step: float) -> float:
    """Return the error of the direction with friction, with or without a margin [deg]."""
    friction = 0.4
    contact = kd.Contact(NORMALS[friction], e, friction)
    approach = kd.strike(POSTURE, V, kd.Ball(), contact).approach
    cases = kick_cases(approach, CONTACT_TIME)
    plain = MujocoContact(friction=friction, margin=cases[0].deflection if margin else 0.0)
    kicks = [MujocoKick(case.approach, step, plain, INTEGRATORS[0], gravity=True) for case in cases]
    for kick in kicks:
        for name, value in options.items():
            setattr(kick.model.opt, name, value)
    fits = [
        fit_contact(cases, kicks, CONTACT_TIME, shape, INTEGRATORS[0], TOLERANCE)
        for shape in SHAPES
    ]
    best = min((fit for fit in fits if fit is not None), key=lambda fit: fit.score)
    return float(np.degrees(best.errors[0].direction))


def friction_table() -> str:
    """Return a table of the error of the direction with friction, by MuJoCo's options."""
    lines = ["| e = 0.7, mu = 0.4 | 0.5 ms | 2 ms |", "|---|---|---|"]
    for name, options in CONES.items():
        for margin in (True, False):
            cells = [
                f"{direction_errors(0.7, margin, options, step):.1f}°" for step in (5e-4, 2e-3)
            ]
            lines.append(f"| {name}, {'with' if margin else 'no'} margin | {' | '.join(cells)} |")
    return "\n".join(lines)


def select(rows: Iterable[Row], **wanted: object) -> list[Row]:
    """Return the rows with these values."""
    return [row for row in rows if all(getattr(row, k) == v for k, v in wanted.items())]


def table(lines: dict[str, list[str]]) -> str:
    """Return a table with a column for each time step."""
    heads = ["| | " + " | ".join(f"{1e3 * step:g} ms" for step in STEPS) + " |"]
    heads.append("|---" * (1 + len(STEPS)) + "|")
    return "\n".join(
        [*heads, *(f"| {head} | " + " | ".join(c) + " |" for head, c in lines.items())]
    )


def tables(rows: list[Row]) -> str:
    """Return the tables of docs/how-to/mujoco.md."""

    def worst(quantity: str, chosen: list[Row]) -> float:
        """Return the largest value of a quantity."""
        return max(getattr(row, quantity) for row in chosen)

    steps = [1e3 * step for step in STEPS]
    errors, integrators, joints = {}, {}, {}
    for mu, e in product(NORMALS, RESTITUTIONS):
        near = select(rows, friction=mu, restitution=e, integrator=INTEGRATORS[0])
        pairs = [
            [select(near, step_ms=step, contact=contact)[0] for contact in (TUNED, DEFAULTS)]
            for step in steps
        ]
        errors[f"mu = {mu:g}, e = {e:g}"] = [
            f"{one.speed:.1f} %, {one.direction:.1f}°, {one.speed_around:.1f} % "
            f"({other.speed:.0f} %, {other.direction:.1f}°)"
            for one, other in pairs
        ]
        joints[f"mu = {mu:g}, e = {e:g}"] = [
            f"{one.joints:.0f} %, {one.joints_strike:.0f} % ({other.joints:.0f} %)"
            for one, other in pairs
        ]
    for mu, integrator in product(NORMALS, INTEGRATORS):
        near = select(rows, friction=mu, integrator=integrator, contact=TUNED)
        integrators[f"mu = {mu:g}, {integrator}"] = [
            f"{worst('speed', at):.1f} %, {worst('direction', at):.1f}°"
            for at in (select(near, step_ms=step) for step in steps)
        ]
    return "\n\n".join(table(lines) for lines in (errors, integrators, joints))


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
                        [row.step_ms for row in chosen],
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
@click.option("--csv", "file", help="Write all rows.")
@click.option("--plot", help="Draw the errors: .png, .svg or .pdf.")
def main(file: str | None, plot: str | None) -> None:
    """Print the tables, and write and draw all rows."""
    runs = list(product(NORMALS, RESTITUTIONS, INTEGRATORS, STEPS))
    with ProcessPoolExecutor(2) as pool:
        rows = [row for part in pool.map(measure, *zip(*runs, strict=True)) for row in part]
    if file is not None:
        with open(file, "w", encoding="utf-8", newline="") as out:  # noqa: PTH123
            writer = csv.writer(out, lineterminator="\n")
            writer.writerow(Row._fields)
            writer.writerows(
                [f"{x:.4g}" if isinstance(x, float) else x for x in row] for row in rows
            )
    print(tables(rows), friction_table(), sep="\n\n")
    if plot is not None:
        save_figure(figure(rows), plot)


if __name__ == "__main__":
    main()
