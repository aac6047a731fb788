"""What a user types about postures, `knee < 30 and worst_joint_impulse <= 2`: read, never run.

Python's parser gives the tree; what is not in the short list below is refused before anything is
computed.
"""

from __future__ import annotations

import ast
import operator
from collections.abc import Callable, Mapping
from typing import Any, Literal

import numpy as np

from kickdyn.errors import InvalidInput

Kind = Literal["condition", "number"]

LONGEST = 1000
"""Characters; nobody types more."""

DEEPEST = 50
"""Levels of parts within parts, far from what Python can follow."""

_ARITHMETIC: dict[type[ast.AST], Callable[..., Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: np.divide,
    ast.USub: operator.neg,
    ast.UAdd: operator.pos,
}
_COMPARISONS: dict[type[ast.AST], Callable[..., Any]] = {
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
    ast.Eq: operator.eq,
    ast.NotEq: operator.ne,
}
_LANGUAGE = "names, numbers, + - * /, < <= > >= == !=, and, or, not, ( )"


class Expression:
    """A condition or a number, posture by posture.

    Comparisons may be chained; a name that Python would not take stands in quotes. Angles are in
    degrees. What is divided by 0 is infinite or nan, and nan fulfils no comparison but `!=`.

    Args:
        text: as typed.
        units: of the names that may occur.
        kind: what it must come to.

    Raises:
        InvalidInput: not an expression of the language, an unknown name, or of the other kind.
    """

    def __init__(self, text: str, units: Mapping[str, str], kind: Kind = "condition") -> None:
        self.text, self._units = text, units
        if not isinstance(text, str) or len(text) > LONGEST:
            raise InvalidInput(
                f"an expression is text of up to {LONGEST} characters, not {str(text)[:40]!r}"
            )
        try:
            self._tree = ast.parse(text.strip(), mode="eval").body
            found = self._kind(self._tree)
        except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
            if isinstance(error, InvalidInput):
                raise
            raise self._refused(f"cannot be read: it is made of {_LANGUAGE}") from None
        if found != kind:
            example = "ball_speed > 1" if kind == "condition" else "ball_speed"
            raise self._refused(f"is a {found}, a {kind} is wanted, such as {example}")

    @property
    def names(self) -> frozenset[str]:
        """Joints and results that it needs."""
        return frozenset(_name(node) for node in ast.walk(self._tree)) - {""}

    def __call__(self, column: Callable[[str], Any]) -> Any:
        """Return its value, given the values of a name: an array, or a scalar of constants."""
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            return _value(self._tree, column)

    def _kind(self, node: ast.AST, depth: int = 1) -> Kind:
        """Return what a node comes to, after looking at everything in it."""
        if depth > DEEPEST:
            raise self._refused(f"is more than {DEEPEST} levels deep")
        if name := _name(node):
            if name not in self._units:
                known = ", ".join(f"{each} [{unit}]" for each, unit in self._units.items())
                raise self._refused(f"names {name!r}, which is unknown: there are {known}")
            return "number"
        match node:
            case ast.Constant(value=int() | float() as value) if not isinstance(value, bool):
                if not -1e300 < value < 1e300:
                    raise self._refused("holds a number beyond 1e300")
                return "number"
            case ast.BinOp(left=left, op=op, right=right) if type(op) in _ARITHMETIC:
                return self._all(depth, "number", left, right)
            case ast.UnaryOp(op=ast.USub() | ast.UAdd(), operand=operand):
                return self._all(depth, "number", operand)
            case ast.UnaryOp(op=ast.Not(), operand=operand):
                return self._all(depth, "condition", operand)
            case ast.BoolOp(values=values):
                return self._all(depth, "condition", *values)
            case ast.Compare(left=left, ops=ops, comparators=others) if all(
                type(op) in _COMPARISONS for op in ops
            ):
                self._all(depth, "number", left, *others)
                return "condition"
        part = ast.unparse(node)
        raise self._refused(f"has {part[:40]!r} in it: it is made of {_LANGUAGE}")

    def _all(self, depth: int, kind: Kind, *nodes: ast.AST) -> Kind:
        for node in nodes:
            if (found := self._kind(node, depth + 1)) != kind:
                raise self._refused(f"has the {found} {ast.unparse(node)!r} where a {kind} belongs")
        return kind

    def _refused(self, why: str) -> InvalidInput:
        return InvalidInput(f"expression {self.text[:100]!r} {why}")


def _name(node: ast.AST) -> str:
    """Return the joint or result that a node names, or nothing."""
    match node:
        case ast.Name(id=name):
            return name
        case ast.Constant(value=str() as name) if name:
            return name
    return ""


def _value(node: ast.AST, column: Callable[[str], Any]) -> Any:
    if name := _name(node):
        return column(name)
    match node:
        case ast.Constant(value=int() | float() as number):
            return np.float64(number)
        case ast.BinOp(left=left, op=op, right=right):
            return _ARITHMETIC[type(op)](_value(left, column), _value(right, column))
        case ast.UnaryOp(op=ast.Not(), operand=operand):
            return np.logical_not(_value(operand, column))
        case ast.UnaryOp(op=op, operand=operand):
            return _ARITHMETIC[type(op)](_value(operand, column))
        case ast.BoolOp(op=op, values=values):
            join = np.logical_and if isinstance(op, ast.And) else np.logical_or
            return join.reduce(np.broadcast_arrays(*(_value(each, column) for each in values)))
        case ast.Compare(left=left, ops=ops, comparators=others):
            terms = [_value(each, column) for each in (left, *others)]
            held = [
                _COMPARISONS[type(op)](a, b)
                for op, a, b in zip(ops, terms, terms[1:], strict=False)
            ]
            return np.logical_and.reduce(np.broadcast_arrays(*held))
    raise AssertionError(ast.dump(node))  # refused when it was read
