"""Files that come with kickdyn: in the wheel beside the code, in a checkout beside the package."""

from __future__ import annotations

from pathlib import Path


def shipped(folder: str) -> Path:
    """Return the path of a folder that comes with kickdyn, `urdf` or `scenes`."""
    here = Path(__file__).resolve().parent
    packaged = here / folder
    return packaged if packaged.exists() else here.parent / folder
