"""What tests see refused or warned of is compared whole with what was recorded.

Of each test, the errors of kickdyn that `pytest.raises` caught, what refused command lines
printed, and the warnings and summaries that the test read from a result are kept.
`pytest --record-refusals PATHS` records those of the tests that run.
"""

import contextlib
import json
import re
import sys
from collections.abc import Callable, Iterable, Iterator
from functools import cache, cached_property, partial
from pathlib import Path

import pytest
from click.testing import CliRunner

import kickdyn as kd
from kickdyn.errors import KickdynError
from recorded.differences import differences
from recorded.plain import text_of
from recorded.store import EXPECTED, expected, store

GROUP = "refusals"
BAD_INPUT = 2
"""Exit code of a command that refuses its input."""
FOLDER = re.compile(r"[\w./-]*/pytest-of-[^/]+/pytest-[^/]+/(?:popen-gw\d+/)?[^/\s]+")
"""The temporary folder of a test."""
READ = ("warnings", "summary")
"""Properties of results whose text is kept where a test reads them."""
TESTS = str(Path(__file__).resolve().parents[1])
SOLVERS = ("motion/", "simulators/")
"""Tests whose warnings depend on solvers and engines of other packages: refusals only."""
UNSTEADY = (
    "flight/test_fly.py::test_an_endless_fall",
    "flight/test_integrate.py::test_endless_integration",
    "identification/test_fit_motion.py::test_refused[<lambda>-markers7",
    "identification/test_fit_motion.py::test_refused[<lambda>-markers8",
    "sweeps/test_cluster.py",
)
"""Tests whose refusals depend on rounding, or on when a process ends."""


def pytest_addoption(parser):
    parser.addoption("--record-refusals", action="store_true", help="record what is refused")


@contextlib.contextmanager
def _kept(said: set[str], *, reads: bool) -> Iterator[None]:
    """Add to `said` what a test sees refused and, with `reads`, what it reads of results."""
    raises, invoke = pytest.raises, CliRunner.invoke
    _watch_properties()

    @contextlib.contextmanager
    def raising(*kinds, **options):
        with raises(*kinds, **options) as caught:
            yield caught
        if isinstance(caught.value, KickdynError):
            said.add(_of_kickdyn(caught.value))

    def invoked(runner, *arguments, **options):
        ended = invoke(runner, *arguments, **options)
        if isinstance(ended.exception, KickdynError):
            said.add(_of_kickdyn(ended.exception))
        elif ended.exit_code == BAD_INPUT:
            said.add(_without_folders(ended.stderr))
        return ended

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(pytest, "raises", raising)
        patch.setattr(CliRunner, "invoke", invoked)
        if reads:
            patch.setattr(f"{__name__}._reader", said.update)
        yield


_reader: Callable[[Iterable[str]], None] = set().update


@cache
def _watch_properties() -> None:
    """Make the properties of all results say what tests read."""
    for name in kd.__all__:
        getattr(kd, name)  # imports its module
    modules = [sys.modules[name] for name in list(sys.modules) if name.startswith("kickdyn.")]
    for kind in {kind for module in modules for kind in vars(module).values()
                 if isinstance(kind, type) and kind.__module__.startswith("kickdyn.")}:  # fmt: skip
        for name in READ:
            member = vars(kind).get(name)
            if isinstance(member, property | cached_property):
                setattr(kind, name, property(partial(_read, member), doc=member.__doc__))


def _read(member: property, instance: object) -> object:
    value = member.__get__(instance)
    if sys._getframe(1).f_code.co_filename.startswith(TESTS):
        _reader(map(_without_folders, [value] if isinstance(value, str) else value))
    return value


def _of_kickdyn(error: BaseException) -> str:
    """Return the message of an error without the words of other packages."""
    said = _without_folders(f"{type(error).__name__}: {error}")
    cause = error.__cause__ or error.__context__
    while cause is not None:
        text = _without_folders(" ".join(str(cause).split()))
        if not isinstance(cause, KickdynError) and " " in text:
            said = said.replace(text, "...")
        cause = cause.__cause__ or cause.__context__
    return said


def _without_folders(text: str) -> str:
    """Return a text without what depends on the machine, as the folder of a test."""
    if FOLDER.search(text) and "..." in text:
        return "a long name"  # it is cut in its middle, wherever that is here
    text = re.sub(r"[\d,]+ (?=of [\d,]+ postures are stored)", "N ", FOLDER.sub("TMP", text))
    return text_of(re.sub(r"kickdyn \d[\w.]*", "kickdyn N", text))


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item):
    if getattr(getattr(item, "function", None), "is_hypothesis_test", False):
        return (yield)  # other versions draw other examples
    name, known = item.nodeid.removeprefix("tests/"), expected(GROUP)
    if name.startswith(UNSTEADY):
        return (yield)
    recording = item.config.getoption("--record-refusals")
    if not (recording or name in known):
        return (yield)
    kept: set[str] = set()
    with _kept(kept, reads=not name.startswith(SOLVERS)):
        outcome = yield
    said = json.loads(json.dumps(sorted(kept)))
    if recording:
        known.pop(name, None)
        known.update({name: said} if said else {})
        return outcome
    found = differences(known[name], said)
    assert not found, "\n".join(["refused otherwise; if meant: --record-refusals", *found])
    return outcome


def pytest_sessionfinish(session):
    if session.config.getoption("--record-refusals"):
        store(GROUP, expected(GROUP))
        print(f"\n{EXPECTED / GROUP}.json is written")
