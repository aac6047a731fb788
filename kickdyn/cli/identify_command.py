"""The command `kickdyn identify`: flights in a measured track, and what they say of the air."""

from typing import Any

import click
import numpy as np

from kickdyn.aerodynamics.drag import MODELS
from kickdyn.air import Air
from kickdyn.ball import Ball
from kickdyn.cli.air_options import read_drag
from kickdyn.cli.ball_option import checked_ball
from kickdyn.cli.command import Command, busy, check_files, check_page_name, offers
from kickdyn.core.files import write_json
from kickdyn.core.plot_style import check_name, save_figure
from kickdyn.errors import InvalidInput, KickdynError
from kickdyn.ground import Ground
from kickdyn.identification.identification_result import (
    UNITS,
    FlightMean,
    Identification,
    mean_over_flights,
    with_deviation,
)
from kickdyn.identification.identify import identify as identify_flight
from kickdyn.identification.segments import SMOOTHED, SegmentKind, Segments, segments
from kickdyn.identification.track import Track

SHORTEST = 0.4
"""Duration of a flight from which it is fitted [s]: a shorter one determines no drag."""

AVERAGED = {"drag": "drag coefficient", "drag_scale": "factor of the drag model"}
"""The values of which a mean over the flights is given, and their names on the screen."""


@click.command("identify", Command)
@click.argument("track_file", metavar="TRACK")
@click.option("--start", type=int, metavar="I", help="First sample of one flight to fit.")
@click.option("--end", type=int, metavar="J", help="First sample after this flight.")
@click.option(
    "--drag",
    default="constant",
    show_default=True,
    metavar="constant|MODEL|NUMBER",
    callback=read_drag,
    shell_complete=offers(lambda _: ("constant", *MODELS)),
    help="What is fitted: a constant drag coefficient; a factor of a drag model, by its name "
    f"({', '.join(MODELS)}); or nothing, with the coefficient kept at a number.",
)
@click.option(
    "--columns",
    default="t,x,y,z",
    show_default=True,
    help="Names of the columns with time [s] and coordinates [m].",
)
@click.option("--marker", metavar="NAME", help="Marker of a C3D file; needs kickdyn[c3d].")
@click.option("--ball-mass", type=float, default=Ball().mass, show_default=True,
              help="Mass of the ball [kg].")  # fmt: skip
@click.option(
    "--ball-radius",
    type=float,
    default=round(Ball().radius, 4),
    show_default=True,
    help="Radius of the ball [m].",
)
@click.option("--ground-height", type=float, default=0.0, show_default=True,
              help="Height of the ground [m].")  # fmt: skip
@click.option("--plot", metavar="FILE", help="Plot the longest flight: .png, .svg or .pdf.")
@click.option("--view", metavar="FILE.html|.png",
              help="Write a 3-D page of the 8 longest flights, or a picture of it.")  # fmt: skip
@click.option("--json", "json_file", metavar="FILE", help="Write the result as JSON; - is stdout.")
def identify(
    track_file: str,
    start: int | None,
    end: int | None,
    drag: str | float,
    columns: str,
    marker: str | None,
    ball_mass: float,
    ball_radius: float,
    ground_height: float,
    plot: str | None,
    view: str | None,
    json_file: str | None,
) -> None:
    """Find the flights in a measured ball track, and fit launch, spin and drag to each.

    The mean of the drag coefficient over all flights follows, with the scatter from flight to
    flight.

    TRACK is a file of comma-separated values, whose first row names the columns, in seconds and
    metres, with z upwards; or a file that ends in .c3d. With --start or --end, the samples between
    them are one flight.

    Example: kickdyn identify track.csv --drag brazuca --plot flight.png
    """
    if plot is not None:
        check_name(plot)
    if view is not None:
        check_page_name(view)
    check_files(plot, view, json_file=json_file, inputs=[track_file])
    if track_file.lower().endswith(".c3d"):
        track = Track.from_c3d(track_file, marker)
    elif marker is not None:
        raise InvalidInput(
            f"--marker is {marker!r}: it is for a C3D file, and {track_file} does not end in .c3d"
        )
    else:
        track = Track.from_csv(track_file, [name.strip() for name in columns.split(",")])
    ball = checked_ball(ball_mass, ball_radius, "--ball-mass", "--ball-radius")
    ground = Ground(ground_height)
    air = Air() if drag == "constant" else Air(drag=drag)
    fitted = ["drag" if drag == "constant" else "drag-scale"] if isinstance(drag, str) else []
    free = ["spin", *fitted]
    found: Segments | None = None
    if start is None and end is None:
        found = segments(track, ball, ground)
        parts = [
            (first := int(np.searchsorted(track.times, one.times[0])), first + len(one))
            for one in found.flights
            if one.duration >= SHORTEST
        ]
    else:
        parts = [_range(track, start, end)]
    fits: list[tuple[tuple[int, int], Identification]] = []
    failures: list[str] = []
    with busy("fitting flights") as tell:
        for number, (first, last) in enumerate(parts, start=1):
            tell(f"fitting flight {number} of {len(parts)}")
            try:
                fits.append(
                    ((first, last), identify_flight(track[first:last], ball, air, free=free))
                )
            except KickdynError as error:
                if found is None:
                    raise
                failures.append(f"samples {first}-{last}: {error}")
    wrote: list[str] = []
    if json_file is not None:
        write_json(json_file, _document(found, fits, failures))
        wrote += [] if json_file == "-" else [json_file]
    if json_file != "-":
        _print(found, fits, failures)
    order = sorted(fits, key=lambda fit: -fit[1].tracks[0].duration)
    if plot is not None and order:
        save_figure(order[0][1].plot(), plot)
        wrote.append(plot)
    if view is not None and order:
        from kickdyn.view.comparison import MOST  # imports meshcat
        from kickdyn.view.page import page

        shown = sorted(order[:MOST], key=lambda fit: fit[0])
        page({f"samples {a}-{b}": fit for (a, b), fit in shown}).save(view)
        which = f", the {MOST} longest of {len(fits)} flights" if len(fits) > MOST else ""
        wrote.append(f"{view}{which}")
    if json_file != "-":
        for line in wrote:
            click.echo(f"wrote {line}")


def _range(track: Track, start: int | None, end: int | None) -> tuple[int, int]:
    """Return the indices of one flight, checked."""
    first, last = start or 0, len(track) if end is None else end
    if not 0 <= first < last <= len(track):
        raise InvalidInput(
            f"--start {first} --end {last}: they must be from 0 to {len(track)}, the first less "
            "than the second"
        )
    return first, last


def _print(
    found: Segments | None,
    fits: list[tuple[tuple[int, int], Identification]],
    failures: list[str],
) -> None:
    """Print the parts of the track, a line for each flight, and what they say together."""
    if found is not None:
        click.echo(f"{found}\n")
    if len(fits) == 1:
        click.echo(str(fits[0][1]))
    elif fits:
        names = [name for name in fits[0][1].names if name not in ("x", "y", "z", "vx", "vy", "vz")]
        heads = [f"{name} [{UNITS[name]}]" if name in UNITS else name for name in names]
        click.echo(
            "samples     speed [m/s]  left out  rms [cm]  "
            + "".join(f"{head:>20}" for head in heads)
        )
        for (first, last), fit in fits:
            cells = "".join(f"{_cell(fit, name):>20}" for name in names)
            speed, aside = float(fit.launch.speed), int((~fit.used).sum())
            numbers = f"{speed:11.2f}  {aside:8}  {100 * fit.rms:8.2f}"
            click.echo(f"{f'{first}-{last}':11} {numbers}  {cells}")
        for name, mean in _means(fits).items():
            text = mean or "fewer than two flights determine it"
            click.echo(f"{AVERAGED[name]} over the whole track: {text}")
        warned = [part for part, fit in fits if fit.warnings]
        if warned:
            click.echo(
                f"{len(warned)} of {len(fits)} flights have warnings: --json FILE writes them, "
                f"--start {warned[0][0]} --end {warned[0][1]} prints those of one flight"
            )
    elif not failures:
        click.echo(
            f"no flight of at least {SHORTEST:g} s was found: times must be in seconds, positions "
            "in metres with z up"
        )
    if found is not None and found.flights:
        short, ends = _unused(found)
        if short:
            click.echo(
                f"{short} of {len(found.flights)} flights are shorter than {SHORTEST:g} s without "
                "their ends and were not fitted"
            )
        click.echo(
            f"{ends} samples within {SMOOTHED:g} s of a flight's ends were not used, because "
            "tracking systems smooth over touches"
        )
    for line in failures:
        click.echo(f"not fitted: {line}")


def _means(fits: list[tuple[tuple[int, int], Identification]]) -> dict[str, FlightMean | None]:
    """Return the mean of the drag coefficient, or of the factor, over the flights, by its name."""
    flights = [fit for _, fit in fits]
    return {
        name: mean_over_flights(flights, name)
        for name in AVERAGED
        if flights and name in flights[0].names
    }


def _unused(found: Segments) -> tuple[int, int]:
    """Return how many flights are too short to fit, and the number of samples at their ends."""
    short = sum(one.duration < SHORTEST for one in found.flights)
    all_of_them = sum(len(part) for part in found.parts if part.kind is SegmentKind.FLIGHT)
    return short, all_of_them - sum(len(one) for one in found.flights)


def _cell(fit: Identification, name: str) -> str:
    """Return a value with its standard deviation, or that it is not determined."""
    if name in fit.undetermined:
        return "not determined"
    return with_deviation(fit.values[name], fit.deviations[name])


def _document(
    found: Segments | None,
    fits: list[tuple[tuple[int, int], Identification]],
    failures: list[str],
) -> dict[str, Any]:
    """Return all numbers; what the measurement does not determine is null."""
    document: dict[str, Any] = {
        "flights": [
            {
                "first": first,
                "last": last,
                "rms": fit.rms,
                "outliers": int(fit.used.size - fit.used.sum()),
                "values": {name: fit.values.get(name) for name in fit.names},
                "deviations": {name: fit.deviations.get(name) for name in fit.names},
                "warnings": [*fit.warnings],
            }
            for (first, last), fit in fits
        ],
        "not_fitted": failures,
    }
    if found is not None:
        document |= {name: mean and mean._asdict() for name, mean in _means(fits).items()}
        document["too_short"], document["samples_at_ends"] = _unused(found)
        document["warnings"] = [*found.warnings]
        document["segments"] = [
            {"kind": part.kind, "first": part.first, "last": part.last, "begins": part.begins}
            for part in found.parts
        ]
        for name in ("restitution", "friction", "rolling_deceleration"):
            value = getattr(found, name)
            document[name] = value and value._asdict()
    return document
