import grp
import os
import pickle
import pwd
import subprocess
import sys
from types import SimpleNamespace

import numba
import pytest

from kickdyn.core import compilation

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


@pytest.mark.slow
def test_functions_of_one_factory_are_not_taken_for_each_other(tmp_path):
    long = "\n".join(f"        total += k * math.sin({i} * x)" for i in range(30))
    (tmp_path / "made.py").write_text(MODULE.replace("LINES", long))
    where = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "kept")}

    def printed(*which):
        command = [sys.executable, "made.py", *which]
        return subprocess.check_output(command, cwd=tmp_path, env=where, text=True).split()

    alone = [*printed("1"), *printed("2")]
    assert float(alone[1]) == 2 * float(alone[0])
    assert printed("1", "2") == alone


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


@pytest.mark.slow
def test_damaged_machine_code_is_compiled_again(plus):
    run, files = plus
    contents = [file.read_bytes() for file in files]
    for kind in ("empty", "garbage", "truncated"):
        for file, content in zip(files, contents, strict=True):
            damaged = {"empty": b"", "garbage": b"garbage"}
            file.write_bytes(damaged.get(kind, content[: len(content) // 2]))
        ended = run()
        assert (ended.stdout, ended.stderr) == ("2.0\n", ""), kind


def test_machine_code_that_others_could_have_written_is_not_read(plus, tmp_path):
    run, files = plus
    code = f"open({str(tmp_path / 'planted')!r}, 'w')"
    for file in files:
        file.write_bytes(pickle.dumps(Planted(code)))
    files[0].parent.chmod(0o777)
    ended = run()
    assert ended.stdout == "2.0\n"
    assert "NUMBA_CACHE_DIR" in ended.stderr
    assert not (tmp_path / "planted").exists()
    files[0].parent.chmod(0o755)
    run()
    assert (tmp_path / "planted").exists()  # what is planted would run


@pytest.mark.parametrize(("mode", "kept"), [(0o777, False), (0o1777, True), (0o755, True)])
def test_machine_code_is_not_kept_where_others_can_replace_its_folder(plus, tmp_path, mode, kept):
    run, files = plus
    for file in files:
        file.unlink()
    (tmp_path / "kept").chmod(mode)
    ended = run()
    assert ended.stdout == "2.0\n"
    assert (str(tmp_path / "kept") in ended.stderr) != kept
    assert len(list((tmp_path / "kept").rglob("*.nb?"))) == kept * len(files)


class Planted:
    """What runs a program when it is unpickled."""

    def __init__(self, code):
        self.code = code

    def __reduce__(self):
        return exec, (self.code,)


@pytest.mark.parametrize(
    ("name", "members", "private"),
    [("me", ("me",), True), ("me", ("me", "you"), False), ("staff", (), False)],
)
def test_a_folder_of_a_group_is_private_if_the_group_is_that_of_the_user_alone(
    name, members, private, tmp_path, monkeypatch
):
    tmp_path.chmod(0o775)
    monkeypatch.setattr(pwd, "getpwuid", lambda _: SimpleNamespace(pw_name="me"))
    group = SimpleNamespace(gr_name=name, gr_mem=list(members))
    monkeypatch.setattr(grp, "getgrgid", lambda _: group)
    function = SimpleNamespace(stats=SimpleNamespace(cache_path=str(tmp_path)))
    monkeypatch.setattr(numba, "njit", lambda **_: lambda _: function)
    assert (compilation.cache_folder(len) is not None) == private
