"""A digest of functions and numbers: their text and values count, bytecode does not."""

import linecache
import types

import numpy as np
import pytest

import kickdyn as kd
from kickdyn.core.identity import NotIdentifiedError, digest, source_text

TEXT = '''
import math
import numpy as np

LEVEL = 0.2
unused = 3

def slope(x):
    return LEVEL * x

def drag(reynolds, spin_parameter=0.0, *, scale=1.5):
    """Return a coefficient."""
    assert reynolds > 0
    return slope(scale) + sum([math.exp(-k * LEVEL) for k in range(3)])

def made(level):
    def drag(reynolds, spin_parameter):
        return level
    return drag

enclosed = made(0.3)
one, two = lambda r, s: 0.25, lambda r, s: 0.5
three, four = [lambda r, s: r * LEVEL, lambda r, s: s * LEVEL]
'''


@pytest.fixture
def load(tmp_path):
    """Return the namespace of a module with edits, compiled at a level of optimisation."""

    def loaded(*edits, optimize=0):
        text = TEXT
        for old, new in edits:
            assert old in text
            text = text.replace(old, new)
        file = tmp_path / "coefficients.py"
        file.write_text(text)
        linecache.clearcache()
        module = types.ModuleType("coefficients")
        exec(compile(text, str(file), "exec", optimize=optimize), module.__dict__)
        return module.__dict__

    return loaded


FUNCTIONS = ("drag", "enclosed", "one", "two", "three", "four")


@pytest.mark.parametrize("name", FUNCTIONS)
def test_bytecode_does_not_count(load, name):
    function = load()[name]
    right = digest(function)
    code = function.__code__
    swapped = types.FunctionType(
        code.replace(co_code=code.co_code[::-1], co_flags=code.co_flags ^ 0x20000),
        function.__globals__, name, function.__defaults__, function.__closure__,
    )  # fmt: skip
    swapped.__name__, swapped.__kwdefaults__ = function.__name__, function.__kwdefaults__
    assert digest(swapped) == right
    assert digest(load(optimize=2)[name]) == right
    assert digest(load(("unused = 3", "unused = 4\n\n# elsewhere"))[name]) == right


@pytest.mark.parametrize(("name", "old", "new"), [
    ("drag", "LEVEL = 0.2", "LEVEL = 0.21"),  # a global of a function that it calls
    ("drag", "return LEVEL * x", "return 2 * LEVEL * x"),
    ("drag", "spin_parameter=0.0", "spin_parameter=0.1"), ("drag", "scale=1.5", "scale=1.6"),
    ("drag", "range(3)", "range(4)"), ("drag", "math.exp", "math.cos"),
    ("drag", "import math", "import cmath as math"),
    ("drag", "LEVEL = 0.2", "LEVEL = np.array([0.2])"),
    ("enclosed", "made(0.3)", "made(0.3000001)"), ("one", "0.25", "0.75"),
    ("three", "r * LEVEL", "r * LEVEL * 1.0"), ("four", "LEVEL = 0.2", "LEVEL = -0.2"),
])  # fmt: skip
def test_text_and_values_count(load, name, old, new):
    assert digest(load((old, new))[name]) != digest(load()[name])


def test_a_lambda_counts_with_its_statement(load):
    """Also if it begins in brackets and goes on in the next line."""
    longer = ("r * LEVEL,", "r * LEVEL\n    + 0.1,"), ("r * LEVEL,", "r * LEVEL\n    + 0.4,")
    assert len({digest(load(edit)["three"]) for edit in longer}) == 2
    assert source_text(load()["one"]) == "one, two = lambda r, s: 0.25, lambda r, s: 0.5"


def test_numbers_count_to_twelve_digits_and_by_their_type():
    values = [0.1, -0.1, 1, 1.0, True, "1", None, (1.0,), [1.0], [1.0, 2.0], np.ones(1), {"a": 1.0}]
    assert len({digest(value) for value in values}) == len(values)
    assert digest(0.1) == digest(0.1 * (1 + 1e-14)) == digest(np.float64(0.1))
    assert digest(0.1) != digest(0.1 * (1 + 1e-10))
    assert digest(-0.0) == digest(0.0)
    assert digest(1e-20) != digest(0.0)
    airs = kd.Air(), kd.Air(drag="brazuca"), kd.Air(drag=0.2), kd.Air(drag=0.3), kd.Air(drag=None)
    assert len({digest(air.drag) for air in airs}) == len(airs)


def test_what_has_no_text_is_refused_with_its_name():
    namespace = {}
    exec("def typed(reynolds, spin_parameter): return 0.2", namespace)
    with pytest.raises(NotIdentifiedError, match="'typed' has no source"):
        digest(namespace["typed"])
    leg = kd.Leg.human()
    with pytest.raises(NotIdentifiedError, match="Model"):
        digest(lambda reynolds, spin_parameter: leg.nv)
