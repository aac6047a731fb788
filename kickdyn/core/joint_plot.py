"""The picture of the impulses in the joints of a leg, with error bars."""

from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure

from kickdyn.core.plot_style import COLUMN_WIDTH, styled


@styled()
def joint_figure(sizes: Mapping[str, float], deviations: Mapping[str, float]) -> Figure:
    """Draw the sizes of the linear impulses in the joints [N s], with their standard deviations."""
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
