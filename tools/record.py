"""Records the answers that `tests/recorded` compares: python tools/record.py [words of a case].

It prints what changes. Read that before you commit: each line is a change that users will see.
"""

from __future__ import annotations

import argparse
import sys
import time
import warnings
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests"))

from recorded.store import cases, expected, store


def main() -> None:
    """Compute the cases whose labels have all words, print what changed, and store it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("words", nargs="*", help="record only cases whose labels have these words")
    parser.add_argument("--slow", type=float, metavar="S", help="name cases that take longer")
    chosen = parser.parse_args()
    warnings.simplefilter("error")
    warnings.filterwarnings("ignore", "zmq.eventloop.ioloop is deprecated", DeprecationWarning)
    changed = 0
    for group in sorted({case.group for case in cases().values()}):
        members = [case for case in cases().values() if case.group == group]
        known = expected(group)
        answers = {case.name: known[case.name] for case in members if case.name in known}
        for case in members:
            if not all(word in case.label for word in chosen.words):
                continue
            begin = time.process_time()
            answer = case.compute()
            seconds = time.process_time() - begin
            if chosen.slow is not None and seconds > chosen.slow:
                print(f"{case.label}: {seconds:.2f} s")
            if case.name not in answers:
                print(f"{case.label}: new")
            else:
                lines = case.differences(answers[case.name], answer)
                if not lines and not case.grows:
                    continue  # rounding of this machine is not stored
                print(*(f"{case.label}: {line}" for line in lines[:20]), sep="\n")
            answers[case.name] = answer
            changed += 1
        store(group, answers)
    print(f"{changed} of {len(cases())} answers recorded anew")


if __name__ == "__main__":
    main()
