"""The command `kickdyn identify`: flights in a measured track, and what they say of the air."""

import math
from typing import Any

import click

from kickdyn.air import Air
from kickdyn.ball import Ball
from kickdyn.cli.command import busy
from kickdyn.core.files import check_outputs, replacing, write_json
from kickdyn.errors import InvalidInput, KickdynError
from kickdyn.ground import Ground
from kickdyn.identification.identification_result import Identification
from kickdyn.identification.identify import identify as identify_flight
from kickdyn.identification.segments import Segments, segments
from kickdyn.identification.track import Track

SHORTEST = 0.4
"""Duration of a flight from which it is fitted [s]: a shorter one determines no drag."""


@click.command("identify", context_settings={"help_option_names": ["-h", "--help"]})
@click.argument("track_file", metavar="FILE")
@click.option("--start", type=int, metavar="I", help="First sample of one flight to fit.")
@click.option("--end", type=int, metavar="J", help="The sample after its last.")
@click.option(
    "--drag",
    default="constant",
    show_default=True,
    metavar="MODEL",
    help="Fit a constant coefficient, or a factor of a drag model, by its name.",
)
@click.option(
    "--columns",
    default="t,x,y,z",
    show_default=True,
    help="Names of the columns with time [s] and coordinates [m].",
)
@click.option("--ball-mass", type=float, default=Ball().mass, show_default=True, help="[kg].")
@click.option(
    "--ball-radius", type=float, default=round(Ball().radius, 4), show_default=True, help="[m]."
)
@click.option("--ground-height", type=float, default=0.0, show_default=True, help="[m].")
@click.option("--plot", metavar="FILE", help="Write a plot of the longest flight fitted.")
@click.option("--view", metavar="FILE", help="Write a 3-D page of all flights fitted.")
@click.option("--json", "json_file", metavar="FILE", help="Write the numbers; - is stdout.")
def identify(
    track_file: str,
    start: int | None,
    end: int | None,
    drag: str,
    columns: str,
    ball_mass: float,
    ball_radius: float,
    ground_height: float,
    plot: str | None,
    view: str | None,
    json_file: str | None,
) -> None:
    """Find the flights in a measured ball track, and fit launch, spin and drag to each.

    FILE has comma-separated values; its first row names the columns, in seconds and metres, z up.
    With --start or --end, the samples between them are taken for one flight.

    Example: kickdyn identify track.csv --drag brazuca --plot flight.png
    """
    check_outputs(plot, view, json_file=json_file)
    track = Track.from_csv(track_file, [name.strip() for name in columns.split(",")])
    ball, ground = Ball(ball_mass, ball_radius), Ground(ground_height)
    air = Air() if drag == "constant" else Air(drag=drag)
    free = ("spin", "drag" if drag == "constant" else "drag-scale")
    found: Segments | None = None
    if start is None and end is None:
        found = segments(track, ball, ground)
        parts = [
            (part.first + 1, part.last - 1)  # the outermost samples may belong to a touch
            for part in found.parts
            if part.kind == "flight"
            and track.times[part.last - 1] - track.times[part.first] >= SHORTEST
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
    if json_file is not None:
        write_json(json_file, _document(found, fits, failures))
    if json_file != "-":
        _print(found, fits, failures, json_file)
    longest = max(fits, key=lambda fit: fit[1].tracks[0].duration, default=None)
    if plot is not None and longest is not None:
        with replacing(plot) as file:
            longest[1].plot().savefig(file)
    if view is not None and fits:
        from kickdyn.view.page import page  # imports meshcat

        page({f"samples {a}-{b}": fit.flight for (a, b), fit in fits}).save(view)


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
    json_file: str | None,
) -> None:
    """Print the parts of the track, and a line for each flight."""
    if found is not None:
        click.echo(f"{found}\n")
    if len(fits) == 1:
        click.echo(str(fits[0][1]))
    elif fits:
        names = [name for name in fits[0][1].names if name not in ("x", "y", "z", "vx", "vy", "vz")]
        click.echo("samples     speed [m/s]  rms [cm]  " + "".join(f"{name:>20}" for name in names))
        for (first, last), fit in fits:
            cells = "".join(f"{_cell(fit, name):>20}" for name in names)
            speed = float(fit.launch.speed)
            click.echo(f"{f'{first}-{last}':11} {speed:11.2f}  {100 * fit.rms:8.2f}  {cells}")
    else:
        click.echo(f"no flight of {SHORTEST:g} s or more was found")
    for line in failures:
        click.echo(f"not fitted: {line}")
    if json_file is not None:
        click.echo(f"wrote {json_file}")


def _cell(fit: Identification, name: str) -> str:
    """Return a value with its standard deviation, or that it is not determined."""
    if name in fit.undetermined:
        return "not determined"
    return f"{fit.values[name]:.3g} +- {fit.deviations[name]:.2g}"


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
        document["segments"] = [
            {"kind": part.kind, "first": part.first, "last": part.last, "begins": part.begins}
            for part in found.parts
        ]
        for name in ("restitution", "friction", "rolling_deceleration"):
            value = getattr(found, name)
            document[name] = value and {
                "median": value.median,
                "deviation": value.deviation if math.isfinite(value.deviation) else None,
                "samples": value.samples,
            }
    return document
