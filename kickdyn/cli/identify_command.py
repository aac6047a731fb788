"""The command `kickdyn identify`: flights in a measured track, and coefficients of the air."""

from dataclasses import dataclass
from typing import Any, NamedTuple

import click
import numpy as np

from kickdyn.aerodynamics.drag import MODELS
from kickdyn.air import Air
from kickdyn.cli.commands import busy
from kickdyn.cli.option_groups import BallOptions, OutputOptions, command, option, read_drag
from kickdyn.core.files import attributes, plain
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
from kickdyn.identification.segments import COEFFICIENTS, SMOOTHED, SegmentKind, Segments, segments
from kickdyn.identification.track import Track

SHORTEST = 0.4
"""Duration of a flight from which it is fitted [s]: a shorter one determines no drag."""

AVERAGED = {"drag": "drag coefficient", "drag_scale": "factor of the drag model"}
"""Unknowns that are averaged over the flights, with their names on the screen."""


@dataclass(frozen=True)
class MeasurementOptions:
    """How a track is read: its columns or its marker, and the height of the ground."""

    columns: str = option(
        "--columns", default="t,x,y,z",
        help="Names of the columns with time [s] and coordinates [m].",
    )  # fmt: skip
    marker: str | None = option(
        "--marker", metavar="NAME", help="Marker of a C3D file (kickdyn[c3d])."
    )
    ground_height: float = option("--ground-height", default=0.0, help="Height of the ground [m].")

    def load(self, file: str) -> Track:
        """Return the track of a file of values in columns, or of a C3D file."""
        if file.lower().endswith(".c3d"):
            return Track.from_c3d(file, self.marker)
        if self.marker is not None:
            what = f"--marker is {self.marker!r}"
            raise InvalidInput(f"{what}: it is for a C3D file, and {file} does not end in .c3d")
        return Track.from_csv(file, [name.strip() for name in self.columns.split(",")])


class Fit(NamedTuple):
    """A flight that was fitted: its first sample, the one after its last, and the result."""

    first: int
    last: int
    result: Identification


@command("identify")
@click.argument("track_file", metavar="TRACK", type=click.Path())
@click.option("--start", type=int, metavar="I", help="First sample of one flight to fit.")
@click.option("--end", type=int, metavar="J", help="First sample after this flight.")
@click.option("--drag", default="constant", show_default=True, metavar="constant|MODEL|NUMBER",
              help="What is fitted: a constant drag coefficient; a factor of a drag model, by its "
              f"name ({', '.join(MODELS)}); or nothing, with the coefficient kept at a "
              "number.")  # fmt: skip
def identify(
    track_file: str,
    start: int | None,
    end: int | None,
    drag: str,
    measurement: MeasurementOptions,
    ball: BallOptions,
    output: OutputOptions,
) -> None:
    """Find the flights in a measured ball track, and fit launch, spin and drag to each.

    The mean of the drag coefficient over all flights follows, with the scatter from flight to
    flight. The plot shows the longest flight, the 3-D page the 8 longest.

    TRACK is a file of values in columns, which a row names, in seconds and metres or units behind
    the names, with z upwards; or a file that ends in .c3d. With --start or --end, the samples
    between them are one flight.

    Example: kickdyn identify track.csv --drag brazuca --plot flight.png
    """
    model = read_drag(drag, "constant")
    output.check(inputs=[track_file])
    track, struck_ball = measurement.load(track_file), ball.load()
    air = Air() if model == "constant" else Air(drag=model)
    fitted = ["drag" if model == "constant" else "drag-scale"] if isinstance(model, str) else []
    split: Segments | None = None
    if start is None and end is None:
        split = segments(track, struck_ball, Ground(measurement.ground_height))
        ranges = [
            (first := int(np.searchsorted(track.times, flight.times[0])), first + len(flight))
            for flight in split.flights
            if flight.duration >= SHORTEST
        ]
    else:
        ranges = [(start or 0, len(track) if end is None else end)]
        if not 0 <= ranges[0][0] < ranges[0][1] <= len(track):
            raise InvalidInput(
                f"--start {ranges[0][0]} --end {ranges[0][1]}: they must be from 0 to "
                f"{len(track)}, the first less than the second"
            )
    fits, failures = list[Fit](), list[str]()
    with busy("fitting flights") as show:
        for number, (first, last) in enumerate(ranges, start=1):
            show(f"fitting flight {number} of {len(ranges)}")
            try:
                part = track[first:last]
                result = identify_flight(part, struck_ball, air, free=["spin", *fitted])
                fits.append(Fit(first, last, result))
            except KickdynError as error:
                if split is None:
                    raise
                failures.append(f"samples {first}-{last}: {error}")
    output.write_json(_document(split, fits, failures))
    if output.prints:
        _print(split, fits, failures)
    longest_first = sorted(fits, key=lambda fit: -fit.result.track.duration)
    if fits:
        output.save_plot(longest_first[0].result.plot)
    if output.view is not None and fits:
        from kickdyn.view.caption import MOST_FLIGHTS  # imports meshcat

        shown = sorted(longest_first[:MOST_FLIGHTS])
        output.save_page({f"samples {first}-{last}": result for first, last, result in shown})
    output.name_written(*((output.plot, output.view) if fits else ()))


def _print(split: Segments | None, fits: list[Fit], failures: list[str]) -> None:
    lines = [] if split is None else [f"{split}\n"]
    if len(fits) == 1:
        lines.append(str(fits[0].result))
    elif fits:
        names = fits[0].result.names[6:]  # without position and velocity
        heads = [f"{name} [{UNITS[name]}]" if name in UNITS else name for name in names]
        head = "".join(f"{head:>20}" for head in heads)
        lines.append(f"samples     speed [m/s]  left out  rms [cm]  {head}")
        for first, last, result in fits:
            cells = [
                with_deviation(result.values[name], result.deviations[name])
                if name in result.values
                else "not determined"
                for name in names
            ]
            speed, rms = float(result.launch.speed), 100 * result.rms
            numbers = f"{speed:11.2f}  {result.outliers:8}  {rms:8.2f}"
            row = "".join(f"{cell:>20}" for cell in cells)
            lines.append(f"{f'{first}-{last}':11} {numbers}  {row}")
        unknown = "fewer than two flights determine it"
        lines += [
            f"{AVERAGED[name]} over the whole track: {mean or unknown}"
            for name, mean in _means(fits).items()
        ]
        if warned := [fit for fit in fits if fit.result.warnings]:
            lines.append(
                f"{len(warned)} of {len(fits)} flights have warnings: --json FILE writes them, "
                f"--start {warned[0].first} --end {warned[0].last} prints one flight's"
            )
    elif not failures:
        lines.append(
            f"no flight of at least {SHORTEST:g} s was found: times must be in seconds, positions "
            "in metres with z up"
        )
    if split is not None and split.flights:
        short, ends = _unused(split)
        less = f"flights are shorter than {SHORTEST:g} s without their ends and were not fitted"
        lines += [f"{short} of {len(split.flights)} {less}"] if short else []
        lines.append(
            f"{ends} samples within {SMOOTHED:g} s of a flight's ends were not used, because "
            "tracking systems smooth over touches"
        )
    click.echo("\n".join([*lines, *(f"not fitted: {line}" for line in failures)]))


def _means(fits: list[Fit]) -> dict[str, FlightMean | None]:
    results = [fit.result for fit in fits]
    return {
        name: mean_over_flights(results, name)
        for name in AVERAGED
        if results and name in results[0].names
    }


def _unused(split: Segments) -> tuple[int, int]:
    short = sum(flight.duration < SHORTEST for flight in split.flights)
    samples = sum(len(segment) for segment in split.parts if segment.kind is SegmentKind.FLIGHT)
    return short, samples - sum(len(flight) for flight in split.flights)


def _document(split: Segments | None, fits: list[Fit], failures: list[str]) -> dict[str, Any]:
    flights = [
        {
            **{"first": first, "last": last},
            **attributes(result, "rms outliers warnings"),
            "values": {name: result.values.get(name) for name in result.names},
            "deviations": {name: result.deviations.get(name) for name in result.names},
        }
        for first, last, result in fits
    ]
    document: dict[str, Any] = {"flights": flights, "not_fitted": failures}
    if split is not None:
        document |= plain(_means(fits)) | attributes(split, " ".join(["warnings", *COEFFICIENTS]))
        document["too_short"], document["samples_at_ends"] = _unused(split)
        document["segments"] = [attributes(x, "kind first last begins") for x in split.parts]
    return document
