"""Expressions of run files, such as ``0.003*t`` or ``x if t<1 else 0``: parsed, never executed.

Two dialects: Kratos' own, where ``^`` (or ``**``) groups from the left, a sign binds tighter than
a power (``-x^2`` is ``x²``) and ``log`` is the decimal logarithm; and Python's, in which Kratos'
check processes state the expected values.  Measured against Kratos 10.4.4.
"""

from __future__ import annotations

import operator
import re
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kratos_lite.errors import nearest

MAX_DEPTH = 50
"""Deepest nesting of brackets and signs."""
_TOKEN = re.compile(
    r"\s*((?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?(?![\w.])|[A-Za-z_]\w*|\*\*|[<>=!]=|[-+*/^%(),<>])",
    re.ASCII,
)
_ONE = ("sin", "cos", "tan", "sinh", "cosh", "tanh", "exp", "sqrt", "log10", "floor", "ceil", "abs")
_TWO: dict[str, Callable[..., Any]] = {
    "pow": np.power, "atan2": np.arctan2, "min": np.minimum, "max": np.maximum,
}  # fmt: skip
_COMPARE: dict[str, Callable[..., Any]] = {
    "<": operator.lt,
    ">": operator.gt,
    "<=": operator.le,
    ">=": operator.ge,
    "==": operator.eq,
    "!=": operator.ne,
}
_CONSTANTS = {"pi": np.pi, "e": np.e}


def _functions(python: bool) -> dict[str, tuple[int, Callable[..., Any]]]:
    found: dict[str, tuple[int, Callable[..., Any]]] = {name: (1, getattr(np, name)) for name in _ONE}
    found |= {name: (1, getattr(np, "arc" + name[1:])) for name in ("asin", "acos", "atan")}
    found |= {name: (2, function) for name, function in _TWO.items()}
    found |= (
        {"log": (1, np.log), "fabs": (1, np.abs)} if python else {"log": (1, np.log10), "ln": (1, np.log)}
    )
    return found


def evaluate(text: str, variables: Mapping[str, ArrayLike], python: bool = False) -> NDArray[np.float64]:
    """Return the value of an expression, broadcast over the variables.

    Parameters
    ----------
    text : numbers, ``+ - * / % ^ **``, brackets, ``a if b < c else d``, ``pi``, ``e``, and sin cos tan
        asin acos atan atan2 sinh cosh tanh exp sqrt log log10 ln floor ceil abs pow min max.
    variables : values by name, such as ``x``, ``y``, ``z``, ``t``.
    python : read the text as Python does, not as Kratos does.

    Raises
    ------
    ValueError
        If the text is anything else, or a value is not finite.

    Examples
    --------
    >>> evaluate("0.5*x^2 + t", {"x": [1.0, 2.0], "t": 1.0})
    array([1.5, 3. ])
    """
    parser = _Parser(text, variables, python)
    with np.errstate(all="ignore"):
        value = np.asarray(parser.choice(0), dtype=float)
    if parser.tokens[parser.at]:
        raise parser.wrong()
    if not np.isfinite(value).all():
        raise ValueError(f"expression {text!r} is not finite everywhere it is used")
    return value


class _Parser:
    """Recursive descent that computes while it reads."""

    def __init__(self, text: str, variables: Mapping[str, ArrayLike], python: bool) -> None:
        self.text, self.python, self.at = text, python, 0
        self.variables = {name: np.asarray(value, dtype=float) for name, value in variables.items()}
        self.functions = _functions(python)
        self.tokens: list[str] = []
        place = 0
        while match := _TOKEN.match(text, place):
            self.tokens.append(match.group(1))
            place = match.end()
        if text[place:].strip():
            raise ValueError(f"expression {text!r}: {text[place:].strip()[:20]!r} is not understood")
        self.tokens.append("")

    def wrong(self) -> ValueError:
        found = repr(self.tokens[self.at]) if self.tokens[self.at] else "the end"
        return ValueError(f"expression {self.text!r}: {found} is not expected there")

    def take(self, *words: str) -> str:
        """Step over one of the words and return it, or return an empty string."""
        token = self.tokens[self.at]
        if token and token in words:
            self.at += 1
            return token
        return ""

    def need(self, word: str) -> None:
        if not self.take(word):
            raise self.wrong()

    def choice(self, depth: int) -> Any:
        if depth > MAX_DEPTH:
            raise ValueError(f"expression {self.text[:40]!r}…: nested deeper than {MAX_DEPTH}")
        value = self.sum(depth)
        if not self.take("if"):
            return value
        if depth and not self.python:
            raise ValueError(f"expression {self.text!r}: Kratos takes one 'if' at the outermost level only")
        left = self.sum(depth)
        sign = self.take(*_COMPARE)
        if not sign:
            raise self.wrong()
        condition = _COMPARE[sign](left, self.sum(depth))
        self.need("else")
        return np.where(condition, value, self.choice(depth + 1))

    def sum(self, depth: int) -> Any:
        value = self.product(depth)
        while sign := self.take("+", "-"):
            other = self.product(depth)
            value = value + other if sign == "+" else value - other
        return value

    def product(self, depth: int) -> Any:
        factor = self.python_factor if self.python else self.kratos_factor
        value = factor(depth)
        while sign := self.take("*", "/", "%"):
            other = factor(depth)
            if sign == "%":
                value = np.mod(value, other) if self.python else np.fmod(value, other)
            else:
                value = value * other if sign == "*" else np.divide(value, other)
        return value

    def kratos_factor(self, depth: int) -> Any:
        value = self.signed(depth)
        while self.take("^", "**"):
            value = np.power(value, self.signed(depth))
        return value

    def signed(self, depth: int) -> Any:
        factor = 1.0
        while sign := self.take("+", "-"):
            factor = -factor if sign == "-" else factor
        return factor * self.atom(depth)

    def python_factor(self, depth: int) -> Any:
        if depth > MAX_DEPTH:
            raise ValueError(f"expression {self.text[:40]!r}…: nested deeper than {MAX_DEPTH}")
        if sign := self.take("+", "-"):
            value = self.python_factor(depth + 1)
            return -value if sign == "-" else value
        value = self.atom(depth)
        return np.power(value, self.python_factor(depth + 1)) if self.take("**") else value

    def atom(self, depth: int) -> Any:
        if self.take("("):
            value = self.choice(depth + 1)
            self.need(")")
            return value
        token = self.tokens[self.at]
        if token[:1].isdigit() or token[:1] == ".":
            self.at += 1
            return np.float64(token)
        if not token or not (token[0].isalpha() or token[0] == "_") or token in ("if", "else"):
            raise self.wrong()
        self.at += 1
        if token in self.functions and self.take("("):
            return self.call(token, depth)
        if token in self.variables:
            return self.variables[token]
        if token in _CONSTANTS:
            return np.float64(_CONSTANTS[token])
        known = [*self.variables, *_CONSTANTS, *self.functions]
        raise ValueError(
            f"expression {self.text!r}: {token!r} is not known.{nearest(token, known)} "
            f"Known are {', '.join(known)}"
        )

    def call(self, name: str, depth: int) -> Any:
        count, function = self.functions[name]
        values = [self.choice(depth + 1)]
        while self.take(","):
            values.append(self.choice(depth + 1))
        self.need(")")
        if len(values) != count:
            raise ValueError(f"expression {self.text!r}: {name} takes {count} value(s); got {len(values)}")
        return function(*values)
