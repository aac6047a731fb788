"""Style of plots, for which `@styled()` decorates what makes one, and writing them."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import numpy as np

from kickdyn.core.files import FileName, checked_ending, replacing

ENDINGS = (".png", ".svg", ".pdf")
"""Endings of the formats that plots are written in."""

COLUMN_WIDTH = 3.5
"""Width of one column of a journal [in]."""

STYLE: dict[Any, Any] = {
    "figure.constrained_layout.use": True,
    "figure.dpi": 96,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.titlesize": "medium",
    "figure.titlesize": "medium",
    "grid.alpha": 0.3,
    "legend.frameon": False,
    "legend.fontsize": "small",
    "lines.linewidth": 1.8,
    "image.cmap": "viridis",
}
"""Settings of matplotlib, which a notebook passes to `rcParams.update`."""


@contextmanager
def styled() -> Iterator[None]:
    """Draw in this style and matplotlib's defaults, whatever was set before.

    A `matplotlibrc` in the working directory, which may come from anyone, could have LaTeX run.
    """
    import matplotlib as mpl  # takes half a second

    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update(STYLE)
        yield


def check_name(path: FileName) -> None:
    """Raise `InvalidInput` unless the name ends as a picture's does."""
    checked_ending(path, ENDINGS, "plots are written as")


def save_figure(figure: Any, path: FileName) -> None:
    """Write a figure as PNG, SVG or PDF, by its ending; raise `InvalidInput` if that fails."""
    check_name(path)
    with replacing(path) as draft, styled():  # labels of ticks are made here
        figure.savefig(draft, dpi=150)


@styled()
def joint_figure(sizes: Mapping[str, float], deviations: Mapping[str, float]) -> Any:
    """Draw the sizes of the linear impulses in the joints [N s], with their standard deviations."""
    from matplotlib.figure import Figure

    names = [name.replace("$", r"\$") for name in sizes]  # matplotlib reads formulas there
    figure = Figure(figsize=(COLUMN_WIDTH, max(1.2, 0.35 * len(names) + 0.6)))
    axes = figure.subplots()
    spread = [deviations.get(name, 0.0) for name in sizes] if deviations else None
    axes.barh(np.arange(len(names)), list(sizes.values()), xerr=spread, capsize=3, color="0.65")
    axes.set_yticks(np.arange(len(names)), names)
    axes.invert_yaxis()
    axes.set_xlabel("impulse in the joint [N s]")
    axes.grid(visible=False, axis="y")
    return figure
