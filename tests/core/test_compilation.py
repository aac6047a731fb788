import logging
import os
import pickle
import signal
import subprocess
import sys
import time

import pytest

from kickdyn.core import compilation
from kickdyn.core.compilation import calling_beside, is_kept, named
from kickdyn.sweeps import kernel

MODULE = """
import math, sys
import numba
from kickdyn.core.compilation import compiled, named

def part(k):
    def sums(x):  # too long to be copied into who calls it
        total = 0.0
LINES
        return total
    return numba.njit(named(sums, f"sums_{k}"))

one, two = part(1), part(2)

def first(x):
    return one(x)

def second(x):
    return two(x)

for function in ({"1": first, "2": second}[which] for which in sys.argv[1:]):
    print(compiled(function, numba.float64(numba.float64), "a sum")(1.0))
"""
"""Two functions of one factory, each within a kernel that is kept on the disk."""


def test_functions_of_one_factory_are_not_taken_for_each_other(tmp_path):
    long = "\n".join(f"        total += k * math.sin({i} * x)" for i in range(30))
    (tmp_path / "made.py").write_text(MODULE.replace("LINES", long))
    where = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "kept")}

    def said(*which):
        command = [sys.executable, "made.py", *which]
        return subprocess.check_output(command, cwd=tmp_path, env=where, text=True).split()

    alone = [*said("1"), *said("2")]
    assert float(alone[1]) == 2 * float(alone[0])
    assert len(list((tmp_path / "kept").rglob("*.nbc"))) == 2
    assert said("1", "2") == alone


def test_a_kernel_that_was_compiled_is_kept():
    kernel.compiled_kernel()
    assert is_kept(kernel._sweep) is True
    assert is_kept(named(lambda x: x, "never_compiled")) is False


def test_a_function_is_called_in_another_process(tmp_path, caplog):
    with (
        caplog.at_level(logging.INFO),
        calling_beside("a folder", os.mkdir, str(tmp_path / "made")),
    ):
        pass
    assert (tmp_path / "made").is_dir() or len(os.sched_getaffinity(0)) == 1
    with calling_beside("nothing", os.mkdir, lambda: "cannot be pickled"):
        pass
    assert "a folder" in caplog.text
    assert "nothing" not in caplog.text


def test_the_other_process_ends_with_an_error_or_with_its_parent(monkeypatch):
    started = []
    popen = subprocess.Popen
    with monkeypatch.context() as patch:
        patch.setattr(
            subprocess, "Popen", lambda *a, **k: started.append(popen(*a, **k)) or started[0]
        )
        with pytest.raises(KeyboardInterrupt), calling_beside("a minute", time.sleep, 60):
            raise KeyboardInterrupt
    assert [each.returncode for each in started] in ([-signal.SIGTERM], [])
    sent = pickle.dumps((sys.path, "time", "sleep")) + pickle.dumps((60,))
    with popen([sys.executable, "-c", compilation._CALL], stdin=subprocess.PIPE) as orphan:
        orphan.stdin.write(sent)  # and its input ends, as when the parent is killed
    assert orphan.returncode == 1


def test_files_of_the_working_directory_are_not_imported_by_the_other_process(
    tmp_path, monkeypatch
):
    (tmp_path / "pickle.py").write_text("raise SystemExit('planted')")
    monkeypatch.chdir(tmp_path)
    with calling_beside("a folder", os.mkdir, str(tmp_path / "made")):
        pass
    assert (tmp_path / "made").is_dir() or len(os.sched_getaffinity(0)) == 1


PLUS = """
import numba
from kickdyn.core.compilation import compiled, named

def plus(x):
    return x + 1.0

print(compiled(named(plus, "plus"), numba.float64(numba.float64), "a sum")(1.0))
"""


@pytest.fixture
def plus(tmp_path):
    """A process that compiles a function, and the folder in which it keeps that."""
    (tmp_path / "made.py").write_text(PLUS)
    where = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "kept")}

    def run():
        command = [sys.executable, "made.py"]
        return subprocess.run(command, cwd=tmp_path, env=where, capture_output=True, text=True)

    run()
    return run, sorted((tmp_path / "kept").rglob("*.nb?"))


def test_damaged_machine_code_is_compiled_again(plus):
    run, files = plus
    contents = [file.read_bytes() for file in files]
    for kind in ("empty", "garbage", "truncated"):
        for file, content in zip(files, contents, strict=True):
            damaged = {"empty": b"", "garbage": b"garbage"}
            file.write_bytes(damaged.get(kind, content[: len(content) // 2]))
        ended = run()
        assert (ended.stdout, ended.stderr) == ("2.0\n", ""), kind
        assert [len(file.read_bytes()) for file in files] == [*map(len, contents)]


def test_machine_code_that_others_could_have_written_is_not_read(plus, tmp_path):
    run, files = plus
    code = f"open({str(tmp_path / 'planted')!r}, 'w')"
    for file in files:
        file.write_bytes(pickle.dumps(Planted(code)))
    files[0].parent.chmod(0o777)
    ended = run()
    assert ended.stdout == "2.0\n"
    assert ended.stderr.count("\n") == ended.stderr.count("others can write to") == 1
    assert not (tmp_path / "planted").exists()
    files[0].parent.chmod(0o755)
    run()
    assert (tmp_path / "planted").exists()  # what is planted would run


class Planted:
    """What runs a program when it is unpickled."""

    def __init__(self, code):
        self.code = code

    def __reduce__(self):
        return exec, (self.code,)
