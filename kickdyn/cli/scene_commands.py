"""The commands for scene files: `kickdyn simulate`, `view` and `tradeoff`."""

import math
from collections.abc import Sequence
from functools import partial
from typing import Any

import click
import numpy as np

from kickdyn.cli.commands import busy, check_page_name, print_wrapped, warn
from kickdyn.cli.option_groups import JsonOptions, PlotOptions, command, scene_argument
from kickdyn.core import validation
from kickdyn.core.files import attributes, plain
from kickdyn.core.plot_style import styled
from kickdyn.errors import InvalidInput
from kickdyn.impact.impact_result import Impact
from kickdyn.scene.simulate import EffectSize, Simulation, simulate_as_instant
from kickdyn.scene.simulate import simulate as simulate_scene
from kickdyn.scene.toml_reader import load_scene


@command("simulate")
@scene_argument
@click.option("--tolerance", type=float, show_default="0.05",
              help="Largest error of the ball's final position [m].")  # fmt: skip
@click.option("--exact", is_flag=True, help="Model all effects, as exactly as possible.")
def simulate(scene_file: str, tolerance: float | None, exact: bool, output: JsonOptions) -> None:
    """Simulate a scene file to a tolerance, and print its error budget.

    SCENE is a TOML file, or the name of one that comes with kickdyn: free_kick, paper_kick,
    pass_to_runner, robocup_carpet, robot_chip, rolling_ball_to_goal, volley, volley_of_cross,
    wet_grass_pass.

    Example: kickdyn simulate free_kick --tolerance 0.01
    """
    output.check(inputs=[scene_file])
    if exact and tolerance is not None:
        raise InvalidInput(f"--exact takes no tolerance: leave out --tolerance {tolerance:g}")
    scene = load_scene(scene_file)
    with busy("simulating"):
        answer = simulate_scene(scene, 0.05 if tolerance is None and not exact else tolerance)
        document = _simulation_document(answer)
    output.write_json(document)
    output.print_rows(answer)
    if output.prints:
        times = (f"{1e3 * size.seconds:.2g} without {size.effect}" for size in answer.effects)
        all_times = ", ".join([f"{1e3 * answer.seconds:.2g} ms", *times])
        print_wrapped(f"processor times, of the path alone for effects in flight: {all_times}")
    output.name_written()


def numbers_of(answer: Simulation) -> dict[str, Any]:
    """Return the numbers of a simulation for JSON, in SI units; null where one is not finite."""
    passage, score = answer.passage, answer.score
    return {
        "scene": answer.scene.name,
        "restitution": answer.impact.restitution,
        "restitution_given": answer.scene.contact.restitution,
        "ball_velocity": answer.launch.velocity.tolist(),
        "ball_spin": answer.launch.spin.tolist(),
        "end": answer.end.position.tolist(),
        "time": float(answer.end.time),
        "wall": passage and {"above": passage.above, "beside": passage.beside},
        "goal_mouth": plain(score),
        **attributes(answer, "error warnings"),
    }


def _simulation_document(answer: Simulation) -> dict[str, Any]:
    numbers = numbers_of(answer)
    numbers |= attributes(answer, "tolerance within_tolerance status method evaluations seconds")
    numbers |= attributes(answer, "model_error numerical_error end_deviation")
    of_joint = "force force_deviation moment moment_deviation"
    numbers["joint_impulses"] = answer.launch_spread and {
        name: attributes(joint, of_joint) for name, joint in answer.launch_spread.joints.items()
    }
    numbers["effects"] = [
        {"modelled": size.effect in answer.modelled, "size": plain(size.end),
         "negligible": size.effect in answer.negligible, **attributes(size, "effect seconds")}
        for size in answer.effects
    ]  # fmt: skip
    return numbers


@command("view")
@scene_argument
@click.option("--out", metavar="FILE.html", type=click.Path(), help="Write the 3-D page.")
@click.option("--png", metavar="FILE.png", type=click.Path(),
              help="Write a picture of the page; needs Chromium.")  # fmt: skip
@click.option("--at", "moment", type=float,
              help="Time since the impact that the picture shows [s].  [default: 0]")  # fmt: skip
def view(
    scene_file: str, out: str | None, png: str | None, moment: float | None, output: JsonOptions
) -> None:
    """Show a scene file: leg, ball, impulses, flight, and its wall or goal.

    SCENE is a TOML file, or the name of one that comes with kickdyn: free_kick, paper_kick,
    pass_to_runner, robocup_carpet, robot_chip, rolling_ball_to_goal, volley, volley_of_cross,
    wet_grass_pass.

    All effects of the scene are modelled, except that a contact of finite time is shown as an
    instantaneous impact; the printed error states how far that moves the end of the flight.

    Example: kickdyn view free_kick --out kick.html --png kick.png
    """
    pages = [file for file in (out, png) if file is not None]
    if not pages and output.json_file is None:
        raise InvalidInput("there is no output: give --out, --png or --json")
    if moment is not None and png is None:
        raise InvalidInput("--at is for a picture: give --png as well")
    for file in pages:
        check_page_name(file)
    output.check(*pages, inputs=[scene_file])
    from kickdyn.view.page import page  # imports meshcat, for which --help need not wait

    scene = load_scene(scene_file)
    with busy("simulating"):
        simulation = simulate_as_instant(scene)
    if moment is not None:
        validation.number("at", moment, at_least=0, at_most=float(simulation.end.time), unit="s")
    output.write_json(_view_document(simulation))
    if output.prints:
        print_wrapped(simulation.summary)
        warn(simulation.warnings)
    if pages:
        with busy("drawing"):
            made_page = page(simulation)
            for file in pages:
                made_page.save(file, moment or 0.0)
        warn(made_page.warnings)
    output.name_written(*pages)


def _view_document(simulation: Simulation) -> dict[str, Any]:
    from kickdyn.view.kick_scene import joint_impulses_in_world

    impact = simulation.impact
    assert isinstance(impact, Impact)
    leg, q = impact.posture.leg, impact.posture.q
    postures = {"angles_deg": leg.angles_deg(q), "positions_m": leg.positions_m(q)}
    impulses = joint_impulses_in_world(impact)
    joints = {
        key: {name: round(value, 9) + 0.0 for name, value in values.items()}
        for key, values in postures.items()
        if values
    }
    return numbers_of(simulation) | {
        "leg": leg.name,
        "frame": leg.frame,
        **joints,
        "impulse": impact.impulse.tolist(),
        "joint_impulses": plain({name: impulse for name, _, impulse in impulses}),
        "foot_speed": float(np.linalg.norm(impact.foot_velocity)),
        "launch_angle": float(simulation.launch.elevation),
        "neglected": dict.fromkeys(simulation.neglected, plain(simulation.model_error)),
    }


LEAST_EFFECT = 1e-9
"""Shorter distances are due to the integrators [m]."""


@command("tradeoff")
@click.option("--scene", metavar="SCENE", help="Measure the effects of a scene: a TOML file, or a "
              "name as for `kickdyn view`.")  # fmt: skip
def tradeoff(scene: str | None, output: PlotOptions) -> None:
    """Measure error and time of the functions for impacts and flights, one by one and in batches.

    With --scene, measure what each effect of a scene changes at the impulse and at the end. The
    plot shows error against time, or the effects.

    Example: kickdyn tradeoff --plot tradeoff.png
    """
    output.check(inputs=[scene])
    if scene is not None:
        loaded = load_scene(scene)
        with busy("measuring"):
            exact = simulate_scene(loaded, None)
            sizes = sorted(
                exact.effects, key=lambda size: math.inf if math.isnan(size.end) else -size.end
            )
        output.save_plot(partial(effect_figure, loaded.name, sizes))
        output.write_json({
            "scene": loaded.name, "status": exact.status,
            "end": exact.end.position.tolist(), "impulse": exact.impact.impulse.tolist(),
            "units": {"end": "m", "impulse": "N s"},
            "effects": plain(sizes),
        })  # fmt: skip
        output.print_rows(exact)
    else:
        _compare_functions(output)
    output.name_written(output.plot)


def _compare_functions(output: PlotOptions) -> None:
    from kickdyn.cli.function_costs import cost_figure, measure_functions  # imports numba

    with busy("measuring") as show:
        rows = measure_functions(show)
    output.save_plot(partial(cost_figure, rows))
    units = {"seconds": "s", "seconds_alike": "s", "rounding": "1", "model": "1"}
    output.write_json({"units": units, "functions": plain(rows)})
    if output.prints:
        lines = [f"{'function':28}{'time [us]':>12}{'rounding':>12}{'model':>12}"]
        for row in rows:
            rounding, model = ("" if math.isnan(error) else f"{error:.1e}"
                               for error in (row.rounding, row.model))  # fmt: skip
            name = row.function + (" (per row)" if row.is_batch else "")
            lines.append(f"{name:28}{1e6 * row.seconds:12.3g}{rounding:>12}{model:>12}".rstrip())
        lines += [
            "",
            "rounding: relative error by rounding and integration; model: by neglecting the time "
            "of the contact, 10 ms; pin.impulseDynamics also neglects friction. Of strikes in "
            "batches a third each sticks, slips and misses; flights have all lengths.",
        ]
        print_wrapped("\n".join(lines))


@styled()
def effect_figure(title: str, sizes: Sequence[EffectSize], tolerance: float = 0.05) -> Any:
    """Return how far neglecting each effect moves the end, as bars beside a tolerance [m]."""
    from matplotlib.figure import Figure  # takes half a second

    figure = Figure(figsize=(8.0, 1.6 + 0.32 * len(sizes)))
    axes: Any = figure.subplots()
    seen = [size.end for size in sizes if size.end > LEAST_EFFECT]
    low, high = min([*seen, tolerance]) / 3.0, max([*seen, tolerance]) * 8.0
    for place, size in enumerate(sizes):
        measured = size.end > LEAST_EFFECT
        if measured:
            axes.barh(place, size.end - low, left=low, color="tab:blue", height=0.65)
        text = "no answer" if size.why_not else f"below {LEAST_EFFECT:g}"
        text = f"{size.end:.2g}" if measured else text
        axes.text(1.15 * (size.end if measured else low), place, text, va="center", fontsize=8)
    axes.axvline(tolerance, color="tab:red", linestyle="--", label=f"tolerance {tolerance:g} m")
    axes.set(title=title, xlabel="neglecting it moves the end by [m]", xscale="log")
    axes.set_xlim(low, high)
    axes.set_yticks(range(len(sizes)), [size.effect for size in sizes])
    axes.set_ylim(len(sizes) - 0.5, -0.5)
    axes.grid(visible=False, axis="y")
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.1)
    return figure
