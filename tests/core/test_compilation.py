import os
import subprocess
import sys

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
