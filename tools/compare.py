"""Compare the results of a revision with those of the working tree.

    python tools/compare.py HEAD~3                  # all cases but the slow ones
    python tools/compare.py main flight strike      # cases whose names contain one of the words
    python tools/compare.py --list                  # the cases with their tolerances

The cases of `compare_cases.py`, always those of the working tree, are computed in a temporary copy
of the revision and in the working tree, at the same time and by the same Python. What differs by
more than its tolerance in a public attribute of a result is printed; nothing is stored.

The exit status is 0 if no result differs, 1 if one does or cannot be computed, and 2 for bad input.
What the working tree lacks is a difference, what only the revision lacks is none. Texts, such as
representations, printed tables and messages, are listed apart, and are differences with `--texts`.
"""

import argparse
import enum
import io
import os
import pickle
import re
import signal
import subprocess
import sys
import tarfile
import tempfile
import traceback
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from decimal import Decimal
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple, NoReturn

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
TOLERANCE = 1e-9  # of closed forms, relative to the largest entry of an array
NEGLIGIBLE = 1e-4  # the tolerance of smaller arrays is relative to this size
DEEPEST = 3  # number of results inside of each other whose attributes are compared
WORDS = 4  # number of words from which a string is a text; a shorter one is a value, as a name
# Types of arguments: inside of a result, their fields are compared, but not their properties.
ARGUMENT = re.compile(
    "Air|Ball|BallState|Contact|Goal|Ground|Leg|Plane|Posture|Scene|Surface|Track"
)
SKIPPED = re.compile(
    "_.*|.*_sha256|approach|constraint_projector|evaluations|file|history|html"
    "|iterations|kickdyn_version|leg_response|model|pages|response|rounding|scenes|seconds"
    "|solution|source|viewer|workspace"
)  # attributes and keys that vary from run to run, or are steps on the way to a result
NUMBER = re.compile(r"(?<![\w.])[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?(?!\w|\.\w)")
UNKNOWN = re.compile("No kickdyn attribute|unexpected keyword argument|has no attribute")
LOST, NEW = "missing in the working tree", "missing in the revision only"
DIFFERS, TEXTS, FAILS = "differs", "texts", "fails in both, and is not compared"


class Text(str):
    """A string for people."""


class Answer(NamedTuple):
    """A case in one tree: values by their paths, or what the tree lacks, or how the case fails."""

    fields: Mapping[str, Any] = {}
    missing: str = ""
    failure: str = ""


def flatten(value: Any, path: str, fields: dict[str, Any], depth: int = 0) -> None:
    """Add arrays, strings and texts of a value to fields, by attributes, keys and indices."""
    if isinstance(value, enum.Enum):
        value = value.value
    if isinstance(value, str):
        fields[path] = Text(value) if "\n" in value or len(value.split()) >= WORDS else str(value)
    elif value is None or isinstance(value, bool | os.PathLike):
        fields[path] = str(value)
    elif isinstance(value, int | float | complex | np.generic | np.ndarray):
        array = np.asarray(value)
        if array.dtype.kind in "biufc":
            fields[path] = array
        else:
            flatten(array.tolist() if array.ndim else str(array), path, fields, depth)
    elif isinstance(value, Exception):
        fields[f"{path}.error"], fields[f"{path}.message"] = type(value).__name__, Text(value)
    elif not isinstance(value, type):
        for name, item in parts(value, depth):
            dot = "." if path and name and not name.startswith("[") else ""
            flatten(item, f"{path}{dot}{name}", fields, depth + (package(value) == "kickdyn"))


def package(value: Any) -> str:
    """Return the package that defines the class of a value."""
    return type(value).__module__.partition(".")[0]


def parts(value: Any, depth: int) -> Iterator[tuple[str, Any]]:
    """Yield the parts of a value with the ends of their paths."""
    if isinstance(value, Mapping) or hasattr(value, "_asdict"):
        items = value.items() if isinstance(value, Mapping) else value._asdict().items()
        names = ((str(getattr(key, "value", key)), item) for key, item in items)
        yield from ((name, item) for name, item in names if not SKIPPED.fullmatch(name))
    elif isinstance(value, list | tuple | set | frozenset):
        value = sorted(value, key=str) if isinstance(value, set | frozenset) else value
        try:
            array = np.array(value)
        except (TypeError, ValueError):  # datasets, or lists of unequal lengths
            array = np.array(None)
        if array.dtype.kind in "iufc" and array.size:
            yield "", array
        else:
            yield from (("[number]", len(value)), *((f"[{i}]", x) for i, x in enumerate(value)))
    elif package(value) == "xarray":
        yield "attributes", dict(value.attrs)
        for name, variable in getattr(value, "variables", {"values": value}).items():
            yield str(name), variable.values
            yield f"{name}.dimensions", "/".join(map(str, variable.dims))
            yield f"{name}.attributes", dict(variable.attrs)
    elif package(value) == "matplotlib":
        yield "lines", [[np.array(x.get_xydata(), float) for x in y.lines] for y in value.axes]
        yield "bars", [[x.get_window_extent().bounds for x in y.patches] for y in value.axes]
    elif package(value) == "umsgpack":  # the bytes of numbers
        kinds = {0x15: np.int32, 0x16: np.uint32, 0x17: np.float32}
        yield "", np.frombuffer(value.data, kinds.get(value.type, np.uint8))
    elif package(value) == "kickdyn" and depth <= DEEPEST:
        kind = type(value)
        brief = depth > 0 and ARGUMENT.fullmatch(kind.__name__)
        names = {*getattr(kind, "__dataclass_fields__", ()), *getattr(value, "__dict__", ())}
        for base in () if brief else kind.__mro__:
            members = vars(base).items()
            names |= {name for name, x in members if isinstance(x, property | cached_property)}
        for name in sorted(name for name in names if not SKIPPED.fullmatch(name)):
            try:
                item = getattr(value, name)
            except Exception as error:
                item = error
            if not (brief and package(item) == "kickdyn"):
                yield name, item
        if depth == 0:
            yield "text", Text(value)
            yield "html text", Text(getattr(value, "_repr_html_", str)())


def compute(folder: Path, labels: Sequence[str]) -> None:
    """Write the answers of cases to files of a folder by their numbers."""
    import compare_cases

    tree = os.environ["PYTHONPATH"]
    assert str(compare_cases.kd.__file__).startswith(tree), compare_cases.kd.__file__
    signal.signal(signal.SIGALRM, signal.default_int_handler)
    for number, label in enumerate(labels):
        with tempfile.TemporaryDirectory(dir=folder) as place:
            os.chdir(place)
            signal.alarm(600)  # [s]
            answer = answer_of(compare_cases.CASES[label])
            signal.alarm(0)
            os.chdir(folder)
        fields = {path: _steady(item, tree) for path, item in answer.fields.items()}
        (folder / str(number)).write_bytes(pickle.dumps(answer._replace(fields=fields)))


def answer_of(case: Any) -> Answer:
    """Return what a case computes."""
    fields = dict[str, Any]()
    try:
        flatten(case(), "", fields)
    except (Exception, KeyboardInterrupt) as error:
        line = f"{type(error).__name__}: {error}".partition("\n")[0]
        if isinstance(error, AttributeError | TypeError) and UNKNOWN.search(line):
            return Answer(missing=line)
        if package(error) != "kickdyn":
            frame = traceback.extract_tb(error.__traceback__)[-1]
            return Answer(failure=f"{line} in {Path(frame.filename).name}, {frame.name}")
        fields = {}
        flatten(error, "", fields)
    return Answer(fields)


def _steady(value: Any, tree: str) -> Any:
    """Return a value; a string without folders, addresses, versions and times."""
    if not isinstance(value, str):
        return value
    text = re.sub(rf"{re.escape(tree)}/(kickdyn/\.\./)?", "", value)
    text = re.sub(re.escape(tempfile.gettempdir()) + r"[\w./-]*", "TMP", text)
    text = re.sub(r"0x[0-9a-f]{6,}|\d+ evaluations|kickdyn \d[\w.]*", "N", text)
    text = re.sub(r"(took|seconds=?) ?[-+.\de]+", "T", text)
    if "[ms]" in text:  # a table with processor times, its last numbers
        text = re.sub(r"((?: +[-+.\de]+)+) +[-+.\de]+(?= |$)", r"\1 T", text, flags=re.MULTILINE)
    return type(value)(text)


def field_difference(old: Any, new: Any, tolerance: float) -> tuple[float, str] | None:
    """Return the size of a difference and a line about it, or None if it is rounding only."""
    if isinstance(old, str) or isinstance(new, str):
        same = type(old) is type(new) and old == new
        return None if same else (np.inf, f" {_short(old)} became {_short(new)}")
    if old.shape != new.shape:
        return np.inf, f" shape {old.shape} became {new.shape}"
    pair = np.array([np.atleast_1d(old), np.atleast_1d(new)])
    pair = pair.astype(complex if pair.dtype.kind == "c" else float)
    size = np.abs(pair[np.isfinite(pair)]).max(initial=NEGLIGIBLE)
    with np.errstate(invalid="ignore"):
        errors = np.nan_to_num(np.abs(pair[0] - pair[1]), nan=np.inf)
    errors[(pair[0] == pair[1]) | np.isnan(pair).all(axis=0)] = 0.0
    if not (number := np.count_nonzero(errors > tolerance * size)):
        return None
    place = np.unravel_index(errors.argmax(), errors.shape)
    index, count = f"[{', '.join(map(str, place))}]", f" ({number} of {errors.size} entries)"
    line = f" {pair[0][place]} became {pair[1][place]}"
    return errors[place] / size, f"{index}{line}{count}" if old.ndim else line


def text_difference(old: str, new: str) -> str:
    """Return the first lines that differ in words, or in more than a number's last digit."""
    lines, others = (re.split(r"</tr>|</div>|\n", text) for text in (old, new))
    for pair in zip(lines, others, strict=False):
        words = [re.sub(r"\s+|[-─━]{3,}", " ", NUMBER.sub("#", line)).split() for line in pair]
        numbers = zip(*(map(Decimal, NUMBER.findall(line)) for line in pair), strict=False)
        if words[0] != words[1] or not all(_same_digits(*two) for two in numbers):
            return f"{_short(pair[0])} became {_short(pair[1])}"
    return "" if len(lines) == len(others) else f"{len(lines)} lines became {len(others)}"


def _same_digits(one: Decimal, other: Decimal) -> bool:
    unit = min(int(x.as_tuple().exponent) for x in (one, other))
    return float(abs(one - other)) <= max(1.01 * 10.0**unit, 1e-12)


def _short(value: Any) -> str:
    text = repr(value.strip()) if isinstance(value, str) else str(value)
    return text if len(text) <= 120 else f"{text[:117]}..."


def compare(label: str, old: Answer, new: Answer, tolerance: float, report: Any) -> None:
    """Add sizes and lines of what differs to a report by case, and places of the other kinds."""
    faults = [answer.missing or answer.failure for answer in (old, new)]
    if all(faults):
        report[FAILS][faults[1]].append(label)
    elif missing := old.missing or new.missing:
        report[LOST if new.missing else NEW][missing].append(label)
    elif any(faults):
        line = " became ".join(fault or "a result" for fault in faults)
        report[DIFFERS][label].append((np.inf, line))
    else:
        for path in {**old.fields, **new.fields}:
            pair, place = (old.fields.get(path), new.fields.get(path)), f"{label}: {path}"
            if pair[0] is None or pair[1] is None:
                kind = LOST if pair[1] is None else NEW
                name = re.sub(r"\[\d+\]", "", path).rpartition(".")[2] or "result"
                if any(isinstance(value, Text) for value in pair):
                    kind, name = TEXTS, f"{name} {kind}"
                report[kind][name].append(place)
            elif all(isinstance(value, Text) for value in pair):
                if pair[0] != pair[1] and (line := text_difference(*pair)):
                    report[TEXTS][line].append(place)
            elif difference := field_difference(*pair, tolerance):
                report[DIFFERS][label].append((difference[0], path + difference[1]))


def print_report(report: Any, most: int | None) -> None:
    """Print what differs, with at most so many fields of a case, those that differ most."""
    for label, differences in report[DIFFERS].items():
        lines = [line for _, line in sorted(differences, key=lambda item: -item[0])]
        more = [f"and {len(lines[most:])} more fields"] if lines[most or len(lines) :] else []
        print(f"{label}:", *lines[:most], *more, sep="\n    ")
    for kind in (LOST, NEW, FAILS, TEXTS):
        print(*[f"{kind}:\n"] * bool(report[kind]), end="")
        for what, places in report[kind].items():
            more = f" and {len(places) - 1} more" if len(places) > 1 else ""
            print(f"    {what}: {places[0]}{more}")
    counts = [f"{kind}: {len(report[kind])}" for kind in (LOST, NEW, FAILS, TEXTS)]
    fields = sum(map(len, report[DIFFERS].values()))
    print(f"{fields} fields differ in {len(report[DIFFERS])} cases", *counts, sep="; ")


def export(revision: str, folder: Path) -> str:
    """Write the files of a revision to a folder; return its short name."""
    parse = ["git", "rev-parse", "--short", "--verify", "--quiet", "--end-of-options"]
    found = subprocess.run([*parse, f"{revision}^{{commit}}"], capture_output=True, cwd=ROOT)
    if not (name := found.stdout.decode().strip()):
        refuse(f"unknown revision {revision!r}: give a commit, branch or tag, such as HEAD~3")
    archive = subprocess.run(["git", "archive", name], capture_output=True, check=True, cwd=ROOT)
    with tarfile.open(fileobj=io.BytesIO(archive.stdout)) as files:
        files.extractall(folder, filter="tar")
    return name


def answers_of(trees: Sequence[Path], folder: Path, labels: Sequence[str]) -> list[list[Answer]]:
    """Return the answers of each tree; trees are computed in parallel, by a process each."""
    fixed = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "NO_COLOR"), "1")
    fixed |= {"PYTHONHASHSEED": "0", "MPLBACKEND": "agg", "COLUMNS": "110"}
    places = [folder / f"answers{index}" for index in range(len(trees))]
    workers: list[subprocess.Popen[bytes]] = []
    try:
        for tree, place in zip(trees, places, strict=True):
            place.mkdir()
            command = [sys.executable, __file__, "--compute", place, *labels]
            env = os.environ | fixed | {"PYTHONPATH": str(tree), "TMPDIR": str(place)}
            with (place / "log").open("w") as log:
                workers.append(subprocess.Popen(command, stdout=log, stderr=log, env=env))
        for worker in workers:
            worker.wait()
    finally:
        for worker in workers:
            worker.kill()
            worker.wait()
    return [[_read(place, str(number)) for number in range(len(labels))] for place in places]


def _read(place: Path, name: str) -> Answer:
    if (place / name).exists():
        return pickle.loads((place / name).read_bytes())  # type: ignore[no-any-return]
    lines = (place / "log").read_text(errors="replace").splitlines() or ["it was killed"]
    return Answer(failure=f"not reached, for the process ended: {lines[-1]}")


def refuse(fault: str) -> NoReturn:
    """Exit with 2 after a line on standard error."""
    print(f"compare: {fault}", file=sys.stderr)
    sys.exit(2)


def main() -> int:
    """Compare a revision with the working tree; return the exit status."""
    form = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=form)
    add = parser.add_argument
    add("revision", nargs="?", help="commit, branch or tag to compare with")
    add("words", nargs="*", help="compute only cases whose names contain one of them")
    add("--tolerance", type=float, default=TOLERANCE, help="relative, unless a case has a larger")
    add("--slow", action="store_true", help="compute motions, too")
    add("--texts", action="store_true", help="texts are differences, too")
    add("--all", action="store_true", help="print every field that differs, not the worst 8")
    add("--list", action="store_true", help="print the cases, and compute nothing")
    options = parser.parse_intermixed_args()
    if not (0.0 <= options.tolerance < 1.0 and (options.revision or options.list)):
        refuse("a revision, such as HEAD~3, and a tolerance of 0 to 1 are needed")
    sys.path.insert(0, str(ROOT))
    try:
        from compare_cases import CASES, TOLERANCES
    except Exception as error:
        sys.exit(f"compare: the working tree cannot compute cases: {error!r}")
    words = [*([options.revision or ""] if options.list else ()), *options.words]
    tolerances = {
        label: max(options.tolerance, TOLERANCES.get(label.partition(":")[0], 0.0))
        for label in CASES
        if (options.slow or options.list or not label.startswith("slow"))
        and (not words or any(word.lower() in label.lower() for word in words))
    }
    if not tolerances:
        refuse(f"no case has any of the words {' '.join(words)}: --list prints the cases")
    if options.list:
        print(*(f"{size:<7.0e} {label}" for label, size in tolerances.items()), sep="\n")
        return 0
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        with tempfile.TemporaryDirectory(prefix="kickdyn-compare-") as folder:
            name = export(options.revision, Path(folder, "tree"))
            print(f"{len(tolerances)} cases in {name} and in the working tree", file=sys.stderr)
            answers = answers_of([Path(folder, "tree"), ROOT], Path(folder), list(tolerances))
    except KeyboardInterrupt:
        return 130
    report: Any = defaultdict(lambda: defaultdict(list))
    for (label, tolerance), *pair in zip(tolerances.items(), *answers, strict=True):
        compare(label, *pair, tolerance, report)
    print_report(report, None if options.all else 8)
    return int(any(report[kind] for kind in (DIFFERS, LOST, FAILS, *[TEXTS] * options.texts)))


if __name__ == "__main__":
    sys.exit(compute(Path(sys.argv[2]), sys.argv[3:]) if "--compute" in sys.argv[1:2] else main())
