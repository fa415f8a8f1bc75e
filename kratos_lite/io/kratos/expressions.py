"""Expressions of run files, such as ``0.003*t`` or ``x if t<1 else 0``: parsed, never executed.

Two dialects: Kratos' own, where ``^`` (or ``**``) groups from the left, a sign binds tighter than
a power (``-x^2`` is ``x²``) and ``log`` is the decimal logarithm; and Python's, in which Kratos'
check processes state the expected values.  Measured against Kratos 10.4.4.
"""

from __future__ import annotations

import ast
import operator
import re
from collections.abc import Callable, Mapping
from functools import reduce
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from kratos_lite.errors import nearest
from kratos_lite.typing import Array

MAX_DEPTH = 50
"""Deepest nesting of brackets."""
_TOKEN = re.compile(
    r"\s*((?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?(?![\w.])|[A-Za-z_]\w*|\*\*|[<>=!]=|[-+*/^%(),<>])",
    re.ASCII,
)
_BRACKET = "ä"
"""Stands before a bracket that calls no function: the syntax tree of Python would forget the bracket."""
_NUMPY = "sin cos tan sinh cosh tanh exp sqrt log10 floor ceil abs".split()
_FUNCTIONS: dict[str, tuple[int, Callable[..., Any]]] = {
    **{name: (1, getattr(np, name)) for name in _NUMPY},
    **{name: (1, getattr(np, "arc" + name[1:])) for name in ("asin", "acos", "atan")},
    "pow": (2, np.power), "atan2": (2, np.arctan2), "min": (2, np.minimum), "max": (2, np.maximum),
}  # fmt: skip
_OPERATORS: dict[type[ast.AST], Callable[..., Any]] = {
    ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul, ast.Div: np.divide,
    ast.Pow: np.power, ast.UAdd: operator.pos, ast.USub: operator.neg,
    ast.Lt: operator.lt, ast.Gt: operator.gt, ast.LtE: operator.le, ast.GtE: operator.ge,
    ast.Eq: operator.eq, ast.NotEq: operator.ne,
}  # fmt: skip
ONE_IF = "Kratos takes one 'if' at the outermost level only"
_CONSTANTS = {"pi": np.pi, "e": np.e}


def evaluate(text: str, variables: Mapping[str, ArrayLike], python: bool = False) -> Array:
    """Return the value of an expression, broadcast over its variables; ValueError where it is none.

    >>> evaluate("0.5*x^2 + t", {"x": [1.0, 2.0], "t": 1.0})
    array([1.5, 3. ])
    """
    try:
        expression = _Expression(text, variables, python)
        with np.errstate(all="ignore"):
            value = np.asarray(expression.value(expression.root), dtype=float)
    except (SyntaxError, MemoryError, RecursionError):
        raise ValueError(f"expression {text[:100]!r} is not understood") from None
    if not np.isfinite(value).all():
        raise ValueError(f"expression {text!r} is not finite everywhere it is used")
    return value


class _Expression:
    """The syntax tree of an expression."""

    def __init__(self, text: str, variables: Mapping[str, ArrayLike], python: bool) -> None:
        self.text, self.python = text, python
        self.names = _CONSTANTS | {name: np.asarray(value, dtype=float) for name, value in variables.items()}
        logarithms = {"log": np.log, "fabs": np.abs} if python else {"log": np.log10, "ln": np.log}
        self.functions = _FUNCTIONS | {name: (1, function) for name, function in logarithms.items()}
        self.operators = _OPERATORS | {ast.Mod: np.mod if python else np.fmod}
        self.root = ast.parse(self._in_python(), mode="eval").body

    def _in_python(self) -> str:
        """Return the words as Python writes them, with a mark before each bracket that calls no function."""
        words, place, depth = [""], 0, 0
        while match := _TOKEN.match(self.text, place):
            word, place = match.group(1), match.end()
            depth += {"(": 1, ")": -1}.get(word, 0)
            if depth > MAX_DEPTH:
                raise ValueError(f"expression {self.text[:40]!r}…: nested deeper than {MAX_DEPTH}")
            if word == "(" and (not words[-1].isidentifier() or words[-1] in ("if", "else")):
                words.append(_BRACKET)
            is_number = word[0].isdigit() or word[0] == "."
            words.append(
                repr(float(word)) if is_number else "**" if word == "^" and not self.python else word
            )
        if remaining := self.text[place:].strip():
            raise ValueError(f"expression {self.text!r}: {remaining[:20]!r} is not understood")
        return " ".join(words).strip()

    def value(self, node: ast.expr) -> Any:
        match node:
            case ast.Constant(value=float(number)):
                value: Any = np.float64(number)
            case ast.Name():
                value = self._named(node.id, self.names)
            case ast.BinOp(op=ast.Pow()) | ast.UnaryOp() if not self.python:
                value = reduce(np.power, self._powers(node))
            case ast.UnaryOp(op=ast.UAdd() | ast.USub() as op):
                value = self.operators[type(op)](self.value(node.operand))
            case ast.BinOp(left=left, op=op, right=right) if type(op) in self.operators:
                value = self.operators[type(op)](self.value(left), self.value(right))
            case ast.Call(func=ast.Name(id=name), keywords=[]):
                value = self._call(name, [self.value(argument) for argument in node.args])
            case ast.IfExp(test=ast.Compare(left=left, ops=[op], comparators=[right])) if (
                type(op) in self.operators
            ):
                if node is not self.root and not self.python:
                    raise ValueError(f"expression {self.text!r}: {ONE_IF}")
                condition = self.operators[type(op)](self.value(left), self.value(right))
                value = np.where(condition, self.value(node.body), self.value(node.orelse))
            case _:
                raise SyntaxError
        return value

    def _powers(self, node: ast.expr) -> list[Any]:
        """Return what Kratos raises to each other from the left, each with the signs before it."""
        if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Pow):
            return [self.value(node.left), *self._powers(node.right)]
        if isinstance(node, ast.UnaryOp) and type(node.op) in self.operators:
            first, *others = self._powers(node.operand)
            return [self.operators[type(node.op)](first), *others]
        return [self.value(node)]

    def _call(self, name: str, values: list[Any]) -> Any:
        count, function = (1, operator.pos) if name == _BRACKET else self._named(name, self.functions)
        if len(values) != count:
            raise ValueError(f"expression {self.text!r}: {name} takes {count} value(s); got {len(values)}")
        return function(*values)

    def _named(self, name: str, among: Mapping[str, Any]) -> Any:
        if name not in among:
            known = [*self.names, *self.functions]
            raise ValueError(
                f"expression {self.text!r}: {name!r} is not known.{nearest(name, known)} "
                f"Known are {', '.join(known)}"
            )
        return among[name]
