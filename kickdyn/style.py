"""How plots look: `@rc_context(STYLE)` on what makes one; a notebook updates its `rcParams`."""

from __future__ import annotations

from typing import Any

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
"""Settings of matplotlib; colours stay its own, `tab:blue` and on."""
