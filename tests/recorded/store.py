"""The cases of all files, their answers, and where they are stored."""

import contextlib
import json
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from pathlib import Path

from recorded.differences import differences
from recorded.plain import message, plain

HERE = Path(__file__).resolve().parent
EXPECTED = HERE / "expected"


@dataclass(frozen=True)
class Case:
    """What is computed, and how exactly it is compared.

    Attributes:
        group: name of the file of cases, and of the one with the answers.
        name: of the case.
        answer: computes it; what it raises is an answer, too.
        relative: tolerance of numbers, over the largest one of an array.
        grows: whether new fields, as of a new function, are no difference.
    """

    group: str
    name: str
    answer: Callable[[], object]
    relative: float
    grows: bool = False

    @property
    def label(self) -> str:
        """The name of the case among all."""
        return f"{self.group}: {self.name}"

    def differences(self, known: object, answer: object) -> list[str]:
        """Return a line for each field of an answer that differs from the one known."""
        lines = differences(known, answer, self.relative)
        return [line for line in lines if ": new, " not in line] if self.grows else lines

    def compute(self) -> object:
        """Return the answer as plain values, computed in an empty folder."""
        with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
            try:
                answer = plain(self.answer())
            except Exception as error:
                answer = message(error)
        return json.loads(json.dumps(answer))


@cache
def cases() -> dict[str, Case]:
    """Return all cases by their labels; `LOOSE` of a file has tolerances of its cases."""
    found = {}
    for file in sorted(HERE.glob("cases_*.py")):
        module, group = import_module(f"recorded.{file.stem}"), file.stem.removeprefix("cases_")
        loose, grows = getattr(module, "LOOSE", {}), getattr(module, "GROWS", False)
        for name, answer in module.CASES.items():
            case = Case(group, name, answer, loose.get(name, loose.get("", 1e-6)), grows)
            found[case.label] = case
    return found


@cache
def expected(group: str) -> dict[str, object]:
    """Return the stored answers of a file of cases."""
    file = EXPECTED / f"{group}.json"
    return json.loads(file.read_text(encoding="utf-8")) if file.exists() else {}


def store(group: str, answers: dict[str, object]) -> None:
    """Write the answers of a file of cases: a line for each field of a case."""
    lines = []
    for name, answer in sorted(answers.items()):
        if isinstance(answer, dict) and answer:
            fields = ",\n".join(
                f"  {json.dumps(key)}: {json.dumps(item, ensure_ascii=False)}"
                for key, item in answer.items()
            )
            lines.append(f"{json.dumps(name)}: {{\n{fields}\n}}")
        else:
            lines.append(f"{json.dumps(name)}: {json.dumps(answer, ensure_ascii=False)}")
    EXPECTED.mkdir(exist_ok=True)
    file = EXPECTED / f"{group}.json"
    draft = file.with_suffix(".draft")
    draft.write_text("{\n" + ",\n".join(lines) + "\n}\n", encoding="utf-8")
    draft.replace(file)
