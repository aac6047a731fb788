"""Changes the code on purpose and counts how often a test notices: `make mutants`.

A mutant is a copy of kickdyn with one small change: an operator, a comparison, a branch or a
constant. The tests of the package that holds the change run on it; one of them should fail. Which
changes are made follows from the seed and from the text of each function alone, so that a change
elsewhere in the code leaves the selection as it is.
"""

from __future__ import annotations

import argparse
import ast
import hashlib
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from itertools import islice, takewhile
from pathlib import Path
from queue import Queue
from typing import NamedTuple

ROOT = Path(__file__).resolve().parent.parent
TIMEOUT = 3600.0
"""Longest that one run of pytest may wait [s]: for changes that let the tests wait for ever."""
CPU_TIME = 600
"""Most processor time of one run of pytest [s], which does not depend on what else is running."""

BINARY = {ast.Add: "-", ast.Sub: "+", ast.Mult: "/", ast.Div: "*", ast.Pow: "*"}
COMPARISON = {
    **{ast.Lt: ">=", ast.LtE: ">", ast.Gt: "<=", ast.GtE: "<", ast.Eq: "!=", ast.NotEq: "=="},
    **{ast.In: "not in", ast.NotIn: "in", ast.Is: "is not", ast.IsNot: "is"},
}
CALLS = {"min": "max", "max": "min", "minimum": "maximum", "maximum": "minimum"}
CALLS |= {"sin": "cos", "cos": "sin", "any": "all", "all": "any"}
SKIPPED = (ast.Raise, ast.Assert, ast.JoinedStr, ast.AnnAssign)
"""What is not changed: messages, annotations of types."""
NO_END = "no end"
"""What is noted of a mutant whose tests do not end: it is counted apart."""
PICTURES = ("figure", "plot", "draw")
"""Functions whose constants are not changed: they are sizes and places in a picture."""


class Mutant(NamedTuple):
    """One change: the file, the function, the line's number, and the line before and after."""

    file: str
    function: str
    line: int
    before: str
    after: str

    @property
    def package(self) -> str:
        """The folder of the file below kickdyn/, "" for a module that stands in it."""
        return Path(self.file).parts[1] if len(Path(self.file).parts) > 2 else ""

    def __str__(self) -> str:
        before, after = self.before.strip(), self.after.strip()
        return f"{self.file}:{self.line} {self.function}\n    - {before}\n    + {after}"


def _replacements(node: ast.AST, lines: list[str]) -> Iterator[tuple[ast.AST, ast.AST | None, str]]:
    """Yield what to write where: between two nodes, or instead of one if the second is None."""
    match node:
        case ast.BinOp() if type(node.op) in BINARY and not _is_text(node):
            yield node.left, node.right, BINARY[type(node.op)]
        case ast.Compare(ops=[op]) if type(op) in COMPARISON:
            yield node.left, node.comparators[0], COMPARISON[type(op)]
        case ast.BoolOp():
            yield node.values[0], node.values[1], "or" if isinstance(node.op, ast.And) else "and"
        case ast.UnaryOp(op=ast.Not() | ast.USub(), operand=operand):
            if not isinstance(operand, ast.Constant):
                yield node, None, _source(operand, lines)
        case ast.IfExp():
            body, orelse = _source(node.body, lines), _source(node.orelse, lines)
            yield node, None, f"{orelse} if {_source(node.test, lines)} else {body}"
        case ast.Constant(value=float(value)) if 1e-3 < abs(value) < 1e3:
            yield node, None, repr(round(1.5 * value, 9))
        case ast.Call(func=ast.Name() | ast.Attribute() as func):
            name = func.id if isinstance(func, ast.Name) else func.attr
            if name in CALLS:
                old = _source(func, lines)
                yield func, None, old[: len(old) - len(name)] + CALLS[name]


def _is_text(node: ast.BinOp) -> bool:
    """Whether an operation joins or fills in text."""
    texts = (ast.JoinedStr, ast.List, ast.Tuple)
    return any(
        isinstance(part, texts) or isinstance(getattr(part, "value", 0), str)
        for side in (node.left, node.right)
        for part in ast.walk(side)
    )


def _source(node: ast.AST, lines: list[str]) -> str:
    """Return the text of a node that stands on one line, as it is written."""
    return lines[node.lineno - 1].encode()[node.col_offset : node.end_col_offset].decode()


def _changed(
    first: ast.AST, second: ast.AST | None, new: str, lines: list[str]
) -> tuple[str, str] | None:
    """Return the line before and after, None if what changes is spread over several."""
    line = lines[first.lineno - 1].encode()
    if first.end_lineno != first.lineno:
        return None
    if second is None:
        start, end = first.col_offset, first.end_col_offset
    else:
        if second.lineno != first.lineno:
            return None
        start, end = first.end_col_offset, second.col_offset
        gap = line[start:end].decode()
        if "(" in gap or ")" in gap:  # parentheses stay where they are
            closing, opening = gap.count(")"), gap.count("(")
            new = ")" * closing + f" {new} " + "(" * opening
        else:
            new = f" {new} "
    after = line[:start].decode() + new + line[end:].decode()
    return (line.decode(), after) if after != line.decode() else None


def mutants_of(file: Path) -> Iterator[Mutant]:
    """Yield all changes that a file could have, in the order of its text."""
    text = file.read_text("utf-8")
    lines = text.splitlines()

    def visit(node: ast.AST, function: str) -> Iterator[Mutant]:
        if isinstance(node, SKIPPED):
            return
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            function = f"{function}.{node.name}".lstrip(".")
            children: list[ast.AST] = [*node.body]
        else:
            children = list(ast.iter_child_nodes(node))
            layout = isinstance(node, ast.Constant) and any(w in function for w in PICTURES)
            for first, second, new in _replacements(node, lines) if function else ():
                found = _changed(first, second, new, lines)
                if found and not layout:
                    name = file.relative_to(ROOT).as_posix()
                    yield Mutant(name, function, first.lineno, *found)
        for child in children:
            yield from visit(child, function)

    yield from visit(ast.parse(text), "")


def is_valid(mutant: Mutant) -> bool:
    """Whether the changed file can be parsed."""
    lines = (ROOT / mutant.file).read_text("utf-8").splitlines()
    lines[mutant.line - 1] = mutant.after
    try:
        ast.parse("\n".join(lines))
    except SyntaxError:
        return False
    return True


def chosen(share: float, seed: int) -> list[Mutant]:
    """Return a share of all mutants, at least four of each package.

    Each mutant has a number between 0 and 1, which follows from its text and the seed, and is
    chosen if that is below the share. So new code adds to the selection, and displaces others only
    in a package that has just four.
    """
    by_package: dict[str, list[Mutant]] = {}
    for file in sorted((ROOT / "kickdyn").rglob("*.py")):
        for mutant in mutants_of(file):
            by_package.setdefault(mutant.package, []).append(mutant)

    def number(mutant: Mutant) -> float:
        """Return the number of a mutant."""
        key = (seed, mutant.file, mutant.function, mutant.before.strip(), mutant.after.strip())
        return int(hashlib.sha256(repr(key).encode()).hexdigest(), 16) / 2**256

    found: list[Mutant] = []
    for mutants in by_package.values():
        ordered = filter(is_valid, sorted(mutants, key=number))
        found += islice(ordered, 4)
        found += takewhile(lambda mutant: number(mutant) < share, ordered)
    return sorted(found)


def tests_of(mutant: Mutant) -> list[list[str]]:
    """Return what pytest is called with: the file's own tests, then those of its package."""
    stem = f"test_{Path(mutant.file).stem}.py"
    folder = f"tests/{mutant.package}" if mutant.package else "tests"
    own = [f"{folder}/{stem}"] if (ROOT / folder / stem).exists() else []
    if not mutant.package:
        return [own] if own else [["tests/test_package.py"]]
    others = [path.relative_to(ROOT).as_posix() for path in (ROOT / folder).rglob("test_*.py")]
    return [calls for calls in (own, sorted(set(others) - set(own))) if calls]


def noticed_by(mutant: Mutant, copy: Path) -> str:
    """Return the test that fails on a copy of the project with the mutant's change, or ""."""
    file = copy / mutant.file
    lines = file.read_text("utf-8").splitlines()
    lines[mutant.line - 1] = mutant.after
    file.write_text("\n".join(lines) + "\n", "utf-8")
    try:
        return next(filter(None, (_failure(calls, copy) for calls in tests_of(mutant))), "")
    finally:
        shutil.copy2(ROOT / mutant.file, file)


def _failure(calls: list[str], copy: Path) -> str:
    """Return the first test that fails in a copy of the project, NO_END if they do not end."""
    command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", *calls]
    environment = {**os.environ, "PYTHONPATH": str(copy), "PYTHONDONTWRITEBYTECODE": "1"}
    limited = ["prlimit", f"--cpu={CPU_TIME}", *command]
    try:
        run = subprocess.run(
            limited, cwd=copy, env=environment, capture_output=True, text=True, timeout=TIMEOUT
        )
    except subprocess.TimeoutExpired:
        return NO_END
    if run.returncode in (-signal.SIGXCPU, -signal.SIGKILL):
        return NO_END
    if run.returncode < 0:  # pytest itself ended by a signal, as SIGSEGV
        return calls[0]
    if run.returncode > 2:
        raise RuntimeError(f"pytest {' '.join(calls)} ended with {run.returncode}: {run.stdout}")
    if run.returncode == 0:
        return ""
    failed = re.search(r"^(?:FAILED|ERROR) ([^ \n]*)", run.stdout, re.MULTILINE)
    return failed[1] if failed else calls[0]


def _copy_project(folder: Path) -> Path:
    """Copy all files that git tracks to a new folder and return it."""
    tracked = subprocess.run(
        ["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, check=True
    ).stdout.decode()
    for name in filter(None, tracked.split("\0")):
        if (ROOT / name).exists():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, folder / name, follow_symlinks=False)
    return folder


def main() -> int:
    """Run the mutants, print those that no test noticed, and return 1 if they are too many."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--share", type=float, default=0.0105, help="of all changes there could be")
    parser.add_argument("--seed", type=int, default=7)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--only", default="kickdyn", help="files whose path begins like this")
    parser.add_argument("--list", action="store_true", help="print the mutants, run none")
    parser.add_argument("--json", type=Path, help="write the outcome of each mutant here")
    options = parser.parse_args()
    mutants = [m for m in chosen(options.share, options.seed) if m.file.startswith(options.only)]
    if options.list:
        print(*mutants, sep="\n")
        return 0
    with tempfile.TemporaryDirectory() as folder:
        copies: Queue[Path] = Queue()
        for job in range(options.jobs):
            copies.put(_copy_project(Path(folder) / str(job)))

        def run(mutant: Mutant) -> str:
            copy = copies.get()
            try:
                found = noticed_by(mutant, copy)
            finally:
                copies.put(copy)
            print(f"{found or 'UNNOTICED'}: {mutant}", flush=True)
            return found

        outcomes: list[str] = []
        with ThreadPoolExecutor(options.jobs) as pool:
            for found in pool.map(run, mutants):
                outcomes.append(found)
                if options.json:
                    pairs = zip(mutants, outcomes, strict=False)
                    rows = [{**mutant._asdict(), "noticed_by": by} for mutant, by in pairs]
                    options.json.write_text(json.dumps(rows, indent=1))
    packages = Counter(m.package for m in mutants)
    missed = Counter(m.package for m, by in zip(mutants, outcomes, strict=True) if not by)
    for package, count in packages.items():
        print(f"{package or 'kickdyn':14} {count - missed[package]:3} of {count:3}")
    noticed = sum(by not in ("", NO_END) for by in outcomes)
    print(f"{noticed} of {len(outcomes)} noticed, {outcomes.count(NO_END)} whose tests do not end")
    return 0 if noticed >= 0.95 * (len(outcomes) - outcomes.count(NO_END)) else 1


if __name__ == "__main__":
    raise SystemExit(main())
