"""Style of plots: `@styled()` decorates what makes or writes one."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import matplotlib as mpl

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
    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update(STYLE)
        yield
