"""Compare kickdyn at the extremes with 50 digits; exit 1 if an answer is wrong.

python tests/extremes [--json FILE] [--verdicts FILE] [--plot FILE]
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from extremes.extremes_report import extremes
from kickdyn.cli.command import run

if __name__ == "__main__":
    run(extremes)
