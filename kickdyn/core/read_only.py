"""Arrays that nobody can write to, and objects that keep theirs so in copies."""

from __future__ import annotations

from types import MappingProxyType
from typing import Any

import numpy as np


class ReadOnly:
    """What does not change, nor do its copies: numpy's pickles forget that an array is read-only.

    Arrays, and mappings of such, are sealed again as a copy is made or unpickled.
    """

    def __getstate__(self) -> dict[str, Any]:
        """Return the attributes, mappings that cannot be pickled opened."""
        return {name: _opened(value) for name, value in self.__dict__.items()}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Take the attributes, and seal them."""
        self.__dict__.update({name: _sealed(value) for name, value in state.items()})


class _Opened(dict[Any, Any]):
    """A `MappingProxyType` on its way: it cannot be pickled itself."""


def _opened(value: Any) -> Any:
    if isinstance(value, MappingProxyType):
        return _Opened({key: _opened(part) for key, part in value.items()})
    return value


def _sealed(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        value.setflags(write=False)
    elif isinstance(value, dict):
        parts = {key: _sealed(part) for key, part in value.items()}
        return MappingProxyType(parts) if isinstance(value, _Opened) else parts
    elif isinstance(value, tuple):  # its arrays; the tuple itself does not change
        for part in value:
            _sealed(part)
    return value
