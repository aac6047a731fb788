"""Results can be pickled and copied; a deep copy shares nothing, and all arrays are read-only."""

import copy
import pickle
from functools import partial

import numpy as np
import pytest
from one_of_each import MADE, one, sticking

WAYS = {
    "pickle": lambda original: pickle.loads(pickle.dumps(original)),
    "deepcopy": copy.deepcopy,
    "copy": copy.copy,
}
BY_HAND = {"tuning", "restitution"}
"""Made in the tests without the function that gives them, which protects their arrays."""

MORE = {
    "uncertainty": lambda: sticking().uncertainty(q=0.1, normal=0.02),
    "hold": lambda: one("standing impact").posture.constraint_projector,
}
ORIGINALS = {name: partial(one, name) for name in MADE.keys() - BY_HAND} | MORE


def arrays(value):
    """Yield all arrays of a value, of mappings and of tuples."""
    if isinstance(value, np.ndarray):
        yield value
    elif isinstance(value, dict | tuple):
        for entry in value.values() if isinstance(value, dict) else value:
            yield from arrays(entry)


def writeable(result):
    """Return the public attributes with arrays that can be written to."""
    public = {key: value for key, value in vars(result).items() if key[0] != "_"}
    return [key for key, value in public.items() if any(a.flags.writeable for a in arrays(value))]


@pytest.mark.parametrize("name", sorted(ORIGINALS))
def test_copies_are_the_same_and_read_only(name):
    original = ORIGINALS[name]()
    if not hasattr(original, "__dict__"):
        pytest.skip("it has slots")
    assert writeable(original) == []
    for way, copied in WAYS.items():
        result = copied(original)
        assert type(result) is type(original)
        assert "object at 0x" in repr(original) or repr(result) == repr(original)
        assert writeable(result) == []
        of_copy = list(arrays(vars(result)))
        of_original = list(arrays({key: getattr(original, key) for key in vars(result)}))
        for one_array, other in zip(of_copy, of_original, strict=True):
            np.testing.assert_array_equal(one_array, other)
            assert way == "copy" or other.size == 0 or not np.shares_memory(one_array, other)
