"""Files are written whole or not at all; a digest of functions and numbers has text and values."""

import linecache
import types

import numpy as np
import pytest

import kickdyn as kd
from kickdyn.core.files import check_outputs, check_writable, replacing, shipped, write_json
from kickdyn.core.identity import NotIdentifiedError, digest, source_text
from kickdyn.errors import InvalidInput


def contents(folder):
    return {file.name: file.read_text() for file in folder.iterdir()}


def test_the_file_appears_whole_and_a_failure_leaves_the_old_one(tmp_path):
    with replacing(tmp_path / "a.txt") as draft:
        draft.write_text("new")
        assert (draft.suffix, (tmp_path / "a.txt").exists()) == (".txt", False)
    assert contents(tmp_path) == {"a.txt": "new"}
    with pytest.raises(KeyError), replacing(tmp_path / "a.txt") as draft:  # noqa: PT012
        draft.write_text("half")
        raise KeyError
    assert contents(tmp_path) == {"a.txt": "new"}


@pytest.mark.parametrize("exists", [True, False])
def test_a_link_is_refused_and_its_file_is_left_alone(tmp_path, exists):
    """In a folder that others may write to, it may lead to a file of the user."""
    precious, link = tmp_path / "precious.txt", tmp_path / "out.json"
    if exists:
        precious.write_text("precious")
    link.symlink_to(precious)
    with pytest.raises(InvalidInput, match=r"out\.json .*link"):
        write_json(str(link), {"x": 1})
    assert precious.exists() == exists
    assert not exists or precious.read_text() == "precious"


@pytest.mark.parametrize(("name", "word"), [
    ("", "empty"), ("missing/a.txt", "written"), ("a.txt/b.txt", "written"), (".", "folder"),
    ("a" * 300, "written"), ("loop", "written"), ("dangling", "written"), ("a\0b", "written"),
    ("a b/" * 500 + "c.txt", "written"), ("/dev/null", "regular")
], ids=lambda text: repr(text[:20]))  # fmt: skip
def test_places_that_cannot_be_written_are_refused_in_short(tmp_path, monkeypatch, name, word):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a.txt").write_text("a file is no folder")
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    (tmp_path / "dangling").symlink_to(tmp_path / "nowhere" / "x")
    with pytest.raises(InvalidInput, match=word) as refused:
        check_writable(name)
    assert len(str(refused.value)) < 300


def test_outputs_are_writable_and_distinct(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "old.png").touch()
    (tmp_path / "-").mkdir()  # no file can be made there, nor need be
    assert check_outputs() == check_outputs(json_file="-") == []
    assert check_outputs(None, "b.png", tmp_path / "c.html", json_file="a.json") == []
    assert check_outputs("old.png", "new.png", inputs=["human", None]) == ["old.png"]
    for outputs, options, word in (
        (["a.json"], {"json_file": "./a.json"}, r"a\.json .*two outputs"),
        (["b", "b"], {}, "b .*two outputs"),
        (["no/b"], {}, "no/b"),
        ([None], {"json_file": "no/a.json"}, r"no/a\.json"),
        (["old.png"], {"inputs": ["./old.png"]}, r"old\.png .*input"),
    ):
        with pytest.raises(InvalidInput, match=word):
            check_outputs(*outputs, **options)
    assert {file.name for file in tmp_path.iterdir()} == {"-", "old.png"}


def test_shipped_files_are_in_the_checkout_or_in_the_wheel(tmp_path, monkeypatch):
    for folder, file in (("urdf", "leg_human.urdf"), ("scenes", "volley.toml")):
        assert (shipped(folder) / file).is_file()
    place = tmp_path / "kickdyn" / "core" / "files.py"
    monkeypatch.setattr("kickdyn.core.files.__file__", str(place))
    assert shipped("urdf") == tmp_path / "urdf"
    (tmp_path / "kickdyn" / "urdf").mkdir(parents=True)
    assert shipped("urdf") == tmp_path / "kickdyn" / "urdf"


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
