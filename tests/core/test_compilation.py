import os
import pickle
import subprocess
import sys

import pytest

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


@pytest.mark.parametrize("kind", ["empty", "garbage", "truncated"])
def test_damaged_machine_code_is_compiled_again(plus, kind):
    run, files = plus
    sizes = [file.stat().st_size for file in files]
    for file in files:
        content = file.read_bytes()
        half = content[: len(content) // 2]
        file.write_bytes({"empty": b"", "garbage": b"garbage", "truncated": half}[kind])
    ended = run()
    assert (ended.stdout, ended.stderr) == ("2.0\n", "")
    assert [file.stat().st_size for file in files] == sizes


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


class Planted:
    """What runs a program when it is unpickled."""

    def __init__(self, code):
        self.code = code

    def __reduce__(self):
        return exec, (self.code,)
