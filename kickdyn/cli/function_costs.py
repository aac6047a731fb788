"""What the functions for impacts and flights cost, and how far their answers are from exact ones.

Everything is measured with one kick: posture a of the paper's Table 2, its ball, the foot at 10 m/s
and 30 deg upwards.
"""

import math
import time
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from itertools import chain
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
from matplotlib.figure import Figure

from kickdyn.air import Air
from kickdyn.ball import Ball, BallState
from kickdyn.contact import Contact
from kickdyn.core.plot_style import styled
from kickdyn.core.validation import Array
from kickdyn.flight.batch import MARCH, fly_many
from kickdyn.flight.fly import fly
from kickdyn.flight.follow import follow
from kickdyn.flight.follow_many import follow_many
from kickdyn.impact import strike_kernel
from kickdyn.impact.collide import COLLIDE, collide
from kickdyn.impact.collide_many import collide_many
from kickdyn.impact.impact_result import Impact
from kickdyn.impact.strike import contact_row, joined_state, strike, with_ball
from kickdyn.impact.strike_many import strike_many
from kickdyn.robot.leg import Leg
from kickdyn.scene.launch_and_end import end_of
from kickdyn.scene.scene import Compliance, Scene
from kickdyn.scene.simulate import simulate
from kickdyn.scene.simulate_many import simulate_many
from kickdyn.sweeps import kernel as sweep_kernel
from kickdyn.sweeps.chunk_solver import EVALUATE
from kickdyn.sweeps.sweep import sweep
from kickdyn.sweeps.sweep_kick import Kick

FOOT_SPEED, FRICTION, ROWS = 10.0, 0.4, 10_000

ATTACK = math.radians(30.0)

ANGLES = (5.0, 10.0, -5.0)
"""Of hip, knee and ankle [deg]."""

EXACT = {
    0.0: (4.613865632779877, 0.0, 2.663816565090224),
    FRICTION: (5.20812568168579, 0.0, 2.1244710315260034),
}
"""Impulse on the ball by friction [N s], computed with 50 digits and rounded to float64."""

LEAST_ERROR = 1e-16
"""Least relative error that is drawn: half a unit in the last place."""


_ANSWERS = {
    "strike": "impact", "pin.impulseDynamics, bare": "impact", "strike_many": "impact",
    "sweep": "impact", "collide": "contact", "collide_many": "contact",
    "fly": "flight", "fly_many": "flight", "follow": "path", "follow_many": "path",
    "simulate": "kick", "simulate_many": "kick",
}  # fmt: skip
"""What the functions compute: only the errors of the same answer can be compared."""


class FunctionCost(NamedTuple):
    """One function: processor time of an answer, of many that of a row of a mixture, and errors.

    `rounding` is the relative error by rounding and integration, `model` that by neglecting the
    time of a contact of 10 ms, for Pinocchio also friction; nan where they do not apply.
    `seconds_alike` is the time of a row if all are the same kick.
    """

    function: str
    seconds: float
    is_batch: bool
    rounding: float
    model: float
    seconds_alike: float = math.nan


def kick(friction: float) -> Impact:
    """Return the kick with a coefficient of friction."""
    posture = Leg.human().posture(np.radians(ANGLES))
    attack = np.array([math.cos(ATTACK), 0.0, math.sin(ATTACK)])
    v = posture.joint_velocity(FOOT_SPEED * attack)
    return strike(posture, v, Ball.paper(), Contact(attack, 0.8, friction))


def impulse_dynamics(impact: Impact) -> Callable[[], Array]:
    """Return the calls of Pinocchio alone, with the model of leg and ball made before."""
    space, joint = with_ball(impact.posture.leg, impact.ball.mass, impact.ball.inertia)
    q, v = joined_state(impact.approach)

    def solve() -> Array:
        row = contact_row(impact.approach, space, joint, q)
        pin.impulseDynamics(space.model, space.data, q, v, row, impact.restitution, 0.0)
        return np.asarray(space.data.impulse_c[0] * impact.contact.normal)

    return solve


def measure_functions(report: Callable[[str], None] = lambda _: None) -> list[FunctionCost]:
    """Measure every function, batches in machine code; `report` is called with each name."""
    for code in (strike_kernel.KERNEL, COLLIDE, MARCH, sweep_kernel.KERNEL, EVALUATE):
        code.pays(math.inf)
    rows = []
    for name, run, count, rounding, model, alike in chain(_impacts(), _flights()):
        report(name)
        seconds, of_alike = (_seconds(call) / count if call else math.nan for call in (run, alike))
        rows.append(FunctionCost(name, seconds, count > 1, rounding(), model, of_alike))
    return rows


def _seconds(run: Callable[[], object]) -> float:
    """Return the least processor time of some calls, after one that loads late imports [s]."""
    run()
    least, spent = math.inf, 0.0
    for _ in range(50):
        began = time.process_time()
        run()
        taken = time.process_time() - began
        least, spent = min(least, taken), spent + taken
        if spent > 0.3:
            break
    return least


def _gap(answer: Any, exact: Any) -> float:
    """Return the distance of an answer from an exact one, relative to its size."""
    return float(np.linalg.norm(np.subtract(answer, exact)) / np.linalg.norm(exact))


class MeasuredFunction(NamedTuple):
    """A function to measure: its call for a number of rows, errors, and a call for equal rows."""

    name: str
    run: Callable[[], object]
    rows: int
    rounding: Callable[[], float]
    model: float = math.nan
    run_alike: Callable[[], object] | None = None


def mixture(q: Array, v: Array) -> tuple[Array, Array]:
    """Return q and v of `ROWS` random strikes: a third each stick, slip and miss, then (q, v)."""
    draw, third, leg = np.random.default_rng(0), ROWS // 3, Leg.human()
    drawn = draw.normal(0.0, math.hypot(*v) / math.sqrt(len(v)), (10 * ROWS, len(v)))
    contact = Contact((math.cos(ATTACK), 0.0, math.sin(ATTACK)), 0.8, FRICTION)
    status = strike_many(leg, np.tile(q, (len(drawn), 1)), drawn, Ball.paper(), contact).status
    chosen = np.concatenate([drawn[status == flag][: third + 1] for flag in range(3)])
    rows = draw.permutation(chosen)[:ROWS]
    rows[-1] = v
    return np.tile(q, (ROWS, 1)), rows


def _impacts() -> Iterator[MeasuredFunction]:
    impact, smooth = kick(FRICTION), kick(0.0)
    leg, ball, contact = impact.posture.leg, impact.ball, impact.contact
    q, v = np.radians(ANGLES), impact.v_before
    exact, compliant = EXACT[FRICTION], collide(impact.posture, v, ball, contact, tol=1e-12).impulse
    model = _gap(impact.impulse, compliant)

    yield MeasuredFunction(
        "strike", lambda: strike(leg.posture(q), v, ball, contact).joint_impulses, 1,
        lambda: _gap(impact.impulse, exact), model,
    )  # fmt: skip
    alone, of_smooth = impulse_dynamics(smooth), _gap(smooth.impulse, compliant)
    name = "pin.impulseDynamics, bare"
    yield MeasuredFunction(name, alone, 1, lambda: _gap(alone(), EXACT[0.0]), of_smooth)
    alike, mixed = (np.tile(q, (ROWS, 1)), np.tile(v, (ROWS, 1))), mixture(q, v)

    def batch(
        function: Callable[..., Any], right: Any, model: float = math.nan
    ) -> MeasuredFunction:
        def run(many: tuple[Array, Array] = mixed) -> Array:
            return np.asarray(function(leg, *many, ball, contact).impulse)

        def error() -> float:
            return _gap(run()[-1], right)

        return MeasuredFunction(function.__name__, run, ROWS, error, model, partial(run, alike))

    yield batch(strike_many, exact, model)
    names, steps = leg.joint_names, 0.625 * np.arange(81.0)
    grid = {name: np.radians(low + steps) for name, low in zip(names, (-10, 0, -20), strict=True)}
    angles = {f"{name}_deg": angle for name, angle in zip(names, ANGLES, strict=True)}
    setting = Kick(speed=FOOT_SPEED, attack=ATTACK, friction=FRICTION, ball=ball)

    def of_sweep() -> float:
        data = sweep(leg, grid, setting).swap_dims({name: f"{name}_deg" for name in names})
        impulse = data.sel(angles, method="nearest").impulse
        return abs(float(impulse) / math.hypot(*exact) - 1.0)

    yield MeasuredFunction(
        "sweep", lambda: sweep(leg, grid, setting, threads=1), 81**3, of_sweep, model
    )
    default = collide(impact.posture, v, ball, contact).impulse
    yield MeasuredFunction(
        "collide", lambda: collide(leg.posture(q), v, ball, contact), 1,
        lambda: _gap(default, compliant),
    )  # fmt: skip
    yield batch(collide_many, compliant)


def _flights() -> Iterator[MeasuredFunction]:
    impact, air = kick(FRICTION), Air()
    ball, launch = impact.ball, impact.ball_after
    alike = BallState(*(np.tile(vector, (ROWS, 1)) for vector in
                        (launch.position, launch.velocity, launch.spin)))  # fmt: skip
    draw = np.random.default_rng(0)
    velocity = draw.uniform((5, -5, -2), (30, 5, 15), (ROWS, 3))
    spin = draw.normal(0, 30, (ROWS, 3))
    velocity[-1], spin[-1] = launch.velocity, launch.spin
    mixed = BallState(launch.position, velocity, spin)
    pairs: Any = (fly, fly_many, "landing_position"), (follow, follow_many, "position")
    for single, batch, ends in pairs:
        one, many = partial(single, launch, ball, air), partial(batch, mixed, ball, air)
        exact = end_of(one(tol=1e-13)).position - launch.position

        def error_of_one(one: Any = one, exact: Array = exact) -> float:
            return _gap(end_of(one()).position - launch.position, exact)

        def error_of_many(many: Any = many, exact: Array = exact, ends: str = ends) -> float:
            return _gap(many()[ends].values[-1] - launch.position, exact)

        yield MeasuredFunction(single.__name__, one, 1, error_of_one)
        same = partial(batch, alike, ball, air)
        yield MeasuredFunction(batch.__name__, many, ROWS, error_of_many, run_alike=same)
    kicked = impact.posture, impact.v_before, ball, impact.contact
    scene = Scene(*kicked, air=air, law=Compliance(contact_time=0.01), uncertainty={"v": 0.1})
    calm, reference = scene.replace(uncertainty={}), simulate(scene, None)
    length = reference.end.position - launch.position

    yield MeasuredFunction(
        "simulate", lambda: simulate(calm), 1,
        lambda: _gap(simulate(calm).end.position - launch.position, length),
    )  # fmt: skip
    yield MeasuredFunction(
        "simulate_many", lambda: simulate_many(scene, ROWS), ROWS, lambda: math.nan
    )


def on_front(rows: Sequence[FunctionCost], kind: str) -> set[str]:
    """Return functions faster than all that compute the same as exactly, by error `kind`."""
    front = set()
    for row in rows:
        error = getattr(row, kind)
        rivals = [
            other for other in rows
            if _ANSWERS[other.function] == _ANSWERS[row.function]
            and other.is_batch == row.is_batch
            and max(getattr(other, kind), LEAST_ERROR) <= max(error, LEAST_ERROR)
        ]  # fmt: skip
        if not math.isnan(error) and row.seconds <= min(other.seconds for other in rivals):
            front.add(row.function)
    return front


@styled()
def cost_figure(rows: Sequence[FunctionCost]) -> Figure:
    """Return error against cost, of model and of rounding; slower functions have grey names."""
    figure = Figure(figsize=(11.0, 4.2))
    panels: Any = figure.subplots(1, 2)
    for axes, title, kind in zip(
        panels, ("model: time of the contact neglected", "rounding and integration"),
        ("model", "rounding"), strict=True,
    ):  # fmt: skip
        shown = [(row, max(getattr(row, kind), LEAST_ERROR)) for row in rows
                 if not math.isnan(getattr(row, kind))]  # fmt: skip
        front = on_front(rows, kind)
        for row, error in shown:
            axes.loglog(
                row.seconds, error, "s" if row.is_batch else "o", color="tab:blue",
                fillstyle="none" if row.is_batch else "full",
            )  # fmt: skip
            axes.annotate(
                row.function, (row.seconds, error), (4, 4 if row.function in front else -10),
                fontsize=8, textcoords="offset points",
                color="black" if row.function in front else "gray",
            )  # fmt: skip
        axes.set(title=title, xlabel="time per answer [s]", ylabel="relative error")
        axes.margins(0.2)
        if kind == "model":
            axes.set_ylim(1e-2, 1.0)
    for marker, style, label in (("o", "full", "one"), ("s", "none", "batch, per row")):
        panels[1].loglog([], [], marker, color="tab:blue", fillstyle=style, label=label)
    panels[1].legend(loc="upper left")
    return figure
