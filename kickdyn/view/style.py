"""How plots look: `plt.rcParams.update(STYLE)`."""

from __future__ import annotations

STYLE = {
    "figure.constrained_layout.use": True,
    "figure.dpi": 96,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.titlesize": "medium",
    "grid.alpha": 0.3,
    "legend.frameon": False,
    "legend.fontsize": "small",
    "lines.linewidth": 1.8,
    "image.cmap": "viridis",
}
"""Settings of matplotlib; colours stay its own, `tab:blue` and on."""
