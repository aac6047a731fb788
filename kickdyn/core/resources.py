"""Files that come with kickdyn: in the wheel inside the package, in a checkout beside it."""

from __future__ import annotations

from pathlib import Path


def shipped(folder: str) -> Path:
    """Return the path of a folder that comes with kickdyn, `urdf` or `scenes`."""
    package = Path(__file__).resolve().parents[1]
    packaged = package / folder
    return packaged if packaged.exists() else package.parent / folder
