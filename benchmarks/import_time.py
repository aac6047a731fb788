"""Time `import kickdyn` against what it cannot do without: `python benchmarks/import_time.py`.

Each import in a process of its own, the two in turns; the least of each counts.
"""

from __future__ import annotations

import subprocess
import sys
import time

PEER = "import numpy, scipy.integrate, pinocchio"
ROUNDS = 15


def seconds(code: str) -> float:
    """Return how long a fresh Python takes to run a line [s]."""
    began = time.perf_counter()
    subprocess.run([sys.executable, "-c", code], check=True)
    return time.perf_counter() - began


def main() -> None:
    """Measure and print."""
    times = [(seconds(PEER), seconds("import kickdyn")) for _ in range(ROUNDS)]
    peer, ours = (min(column) for column in zip(*times, strict=True))
    print(f"{PEER}: {peer:.3f} s")
    print(f"import kickdyn: {ours:.3f} s, {ours / peer:.2f} times")


if __name__ == "__main__":
    main()
