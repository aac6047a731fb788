"""A 3-D page inside a notebook's output."""

from __future__ import annotations

from html import escape

from kickdyn.core import validation


class Inline:
    """A page, shown in Jupyter where the cell's result goes; kept with the notebook's outputs.

    It runs in a frame of its own that can reach neither the notebook nor the network.

    Args:
        page: HTML, as `kick_page` and `flights_page` return it.
        height: of the frame [px].

    Raises:
        InvalidInput: a height that is not above 0.
    """

    def __init__(self, page: str, height: float = 600) -> None:
        self.page = page
        self.height = validation.number("height", height, above=0, at_most=1e4, unit="px")

    def __repr__(self) -> str:
        """Say what there is to see, where HTML cannot be shown."""
        return f"<a page of {len(self.page) / 1e6:.1f} MB, for a browser>"

    def _repr_html_(self) -> str:
        return (
            f'<iframe srcdoc="{escape(self.page)}" sandbox="allow-scripts" '
            f'style="width: 100%; height: {self.height:.0f}px; border: 0"></iframe>'
        )
