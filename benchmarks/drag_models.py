"""How well drag models predict a measured match: `python benchmarks/drag_models.py [TRACK.csv]`.

Every flight of at least 0.4 s that `kd.segments` finds is fitted in its first half (launch and
spin, with `--wind` also a wind), and its second half is predicted. The table has the distance
between prediction and measurement in the second halves: the median over the flights, the quartiles,
the root mean square, and on how many flights each model is the best. A drag coefficient `of the
others` is the median of those that were fitted to the other flights. These are the tables of
docs/explanation/verification.md.
"""

import sys
from pathlib import Path

import numpy as np

import kickdyn as kd

TRACK = Path(__file__).resolve().parent.parent / "data" / "match_ball.csv"
BALL = kd.Ball()
AIRS = {
    **{
        f"drag `{name}`, lift `saturating`": kd.Air(drag=name)
        for name in ("supercritical", "goff-carre", "teamgeist", "brazuca", "tango12", "jabulani")
    },
    "drag 0.155, lift `saturating`": kd.Air(drag=0.155),
    "drag `supercritical`, lift `nathan`": kd.Air(drag="supercritical", lift="nathan"),
}
"""What is compared: the drag models with the default lift, a constant, and another lift."""


def miss(flight: kd.Track, air: kd.Air, *wind: str) -> float:
    """Return the rms distance in the second half of a flight, predicted from the first half [m]."""
    middle = (len(flight) + 1) // 2
    fit = kd.identify(flight[:middle], BALL, air, free=("spin", *wind))
    path = kd.fly(fit.launch, BALL, fit.air, kd.Ground(-99.0))
    later = flight[middle:]
    distance = path.sample(later.times - flight.times[0]).position - later.positions
    return float(np.sqrt((distance**2).sum(axis=1).mean()))


def misses(flights: "list[kd.Track]", *wind: str) -> "dict[str, np.ndarray]":
    """Return the distance in the second half of each flight by model, shape `(flights,)` [m]."""
    found: dict[str, list[float]] = {}
    fits = [kd.identify(flight, BALL, free=("spin", "drag", *wind)) for flight in flights]
    drags = [fit.values.get("drag", np.nan) for fit in fits]  # NaN where it is not determined
    for number, flight in enumerate(flights, start=1):
        others = float(np.nanmedian(np.delete(drags, number - 1)))
        airs = {**AIRS, "drag coefficient of the others, lift `saturating`": kd.Air(drag=others)}
        for name, air in airs.items():
            found.setdefault(name, []).append(miss(flight, air, *wind))
        print(f"\r{number} of {len(flights)} flights", end="", file=sys.stderr, flush=True)
    return {name: np.array(values) for name, values in found.items()}


def main(*words: str) -> None:
    """Print the table."""
    wind = ["wind"] if "--wind" in words else []
    file = next((word for word in words if word != "--wind"), str(TRACK))
    flights = [one for one in kd.segments(kd.Track.from_csv(file), BALL).flights
               if one.duration >= 0.4]  # fmt: skip
    table = misses(flights, *wind)
    least = np.min([*table.values()], axis=0)
    print(f"\n{len(flights)} flights, {sum(f.duration for f in flights):.1f} s\n")
    print("| model | median [cm] | quartiles [cm] | rms [cm] | best on |")
    print("|---|---|---|---|---|")
    for name, values in sorted(table.items(), key=lambda item: float(np.median(item[1]))):
        low, middle, high = 100.0 * np.quantile(values, (0.25, 0.5, 0.75))
        rms = 100.0 * float(np.sqrt(np.mean(values**2)))
        best = int((values <= least).sum())
        print(f"| {name} | {middle:.1f} | {low:.1f} to {high:.1f} | {rms:.1f} | {best} |")


if __name__ == "__main__":
    main(*sys.argv[1:])
