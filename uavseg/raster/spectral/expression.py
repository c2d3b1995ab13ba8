"""Band arithmetic: a text parsed to a syntax tree, checked, and computed by numpy; never run as code.

The tree becomes a list of steps for a stack of arrays. Every step is one function of numpy in double
precision, in the order in which it is written, so neither tiles nor threads change a bit.
"""

import ast
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavseg.errors import BandError, ExpressionError
from uavseg.plain_text import printable

MAX_CHARACTERS = 1000
MAX_DEPTH = 50
CHUNK = 1 << 14  # pixels: what a step holds stays in the processor's cache

Array = NDArray[Any]
Step = tuple[str, float]

_OPERATORS: dict[type, str] = {
    ast.Add: "+",
    ast.Sub: "-",
    ast.Mult: "*",
    ast.Div: "/",
    ast.Pow: "**",
    ast.USub: "negative",
    ast.UAdd: "positive",
}
_FUNCTIONS = {"abs": 1, "sqrt": 1, "exp": 1, "log": 1, "log10": 1, "min": 2, "max": 2}
_UNARY: dict[str, Callable[[Any], Any]] = {
    "negative": np.negative,
    "positive": np.positive,
    "abs": np.abs,
    "sqrt": np.sqrt,
    "exp": np.exp,
    "log": np.log,
    "log10": np.log10,
}


def _power(base: Any, exponent: Any) -> Any:
    """Powers; squares and square roots are exact, which `pow` of a system need not be."""
    if np.ndim(exponent) == 0 and exponent in (2.0, 0.5):
        return np.square(base) if exponent == 2.0 else np.sqrt(base)
    return np.power(base, exponent)


_BINARY: dict[str, Callable[[Any, Any], Any]] = {
    "+": np.add,
    "-": np.subtract,
    "*": np.multiply,
    "/": np.divide,
    "**": _power,
    "min": np.minimum,
    "max": np.maximum,
}


@dataclass(frozen=True, slots=True)
class Expression:
    """Band arithmetic, checked and ready to be computed.

    Parameters
    ----------
    text : str
    bands : tuple of int
        The bands that it uses, counted from 1, in the order of their first use.
    steps : tuple of (str, float)
        In reverse Polish notation: ("band", place in `bands`), ("number", value) or (operation, 0).
    """

    text: str
    bands: tuple[int, ...]
    steps: tuple[Step, ...]

    def compute(self, planes: Array, scales: Sequence[tuple[float, float]] = ()) -> NDArray[np.float32]:
        """The value of each pixel, computed in double precision and rounded to single.

        Parameters
        ----------
        planes : (bands, rows, cols) array
            Of `bands`.
        scales : sequence of (scale, offset), optional
            Of each band: what a stored number is multiplied by, and what is added then.

        Returns
        -------
        values : (rows, cols) float32 array
            Not finite where a step divides by 0, or has no result.
        """
        values = np.empty(planes.shape[1:], np.float32)
        flat, found = [np.ascontiguousarray(plane).reshape(-1) for plane in planes], values.reshape(-1)
        scales = scales or ((1.0, 0.0),) * len(flat)
        with np.errstate(all="ignore"):
            for start in range(0, len(found), CHUNK):
                part = slice(start, start + CHUNK)
                floats = [_in_units(plane[part], *scale) for plane, scale in zip(flat, scales, strict=True)]
                found[part] = self._run(floats)
        return values

    def _run(self, bands: Sequence[Array]) -> Any:
        stack: list[Any] = []
        for operation, value in self.steps:
            if operation == "band":
                stack.append(bands[int(value)])
            elif operation == "number":
                stack.append(np.float64(value))
            elif operation in _UNARY:
                stack.append(_UNARY[operation](stack.pop()))
            else:
                right, left = stack.pop(), stack.pop()
                stack.append(_BINARY[operation](left, right))
        return stack.pop()


def _in_units(plane: Array, scale: float, offset: float) -> NDArray[np.float64]:
    values = plane.astype(np.float64)
    if (scale, offset) != (1.0, 0.0):
        values *= scale
        values += offset
    return values


def parse_expression(text: str, find: Callable[[str], int]) -> Expression:
    """Parse band arithmetic: names of bands, numbers, + - * / **, parentheses and a few functions.

    Parameters
    ----------
    text : str
    find : callable
        The number of the band of a name; BandError if there is none.

    Raises
    ------
    ExpressionError
        If it cannot be parsed, uses anything else, names an unknown band, or names none.

    Examples
    --------
    >>> expression = parse_expression("(nir - red) / (nir + red)", {"nir": 4, "red": 1}.__getitem__)
    >>> expression.bands, expression.compute(np.array([[[3, 0]], [[1, 0]]], np.uint8))
    ((4, 1), array([[0.5, nan]], dtype=float32))
    """
    text = re.sub(r"\s", " ", text).strip()
    if len(text) > MAX_CHARACTERS:
        raise ExpressionError(
            f"the expression has {len(text)} characters; at most {MAX_CHARACTERS} are read: shorten it"
        )
    if not text.isprintable():
        raise _wrong(text, next(n for n, letter in enumerate(text) if not letter.isprintable()), _KNOWN)
    try:
        tree = ast.parse(text, mode="eval").body
    except SyntaxError as error:
        at = error.offset - 1 if error.offset else len(text)  # 0 where more is expected
        raise _wrong(text, at, _syntax_text(text, at)) from error
    except (ValueError, RecursionError, MemoryError) as error:
        raise ExpressionError("the expression cannot be read: it is nested too deeply or not text") from error
    compiler = _Compiler(text, find)
    compiler.add(tree, 1)
    if not compiler.bands:
        raise ExpressionError(f"the expression {printable(text)!r} uses no band; expected as in nir / red")
    return Expression(text, tuple(compiler.bands), tuple(compiler.steps))


class _Compiler:
    """Turns a syntax tree into steps, and refuses what is no band arithmetic."""

    def __init__(self, text: str, find: Callable[[str], int]) -> None:
        self.text = text
        self.find = find
        self.bands: list[int] = []
        self.steps: list[Step] = []

    def add(self, part: ast.expr, depth: int) -> None:
        """The steps of a part of the tree."""
        if depth > MAX_DEPTH:
            raise self._refused(part, f"it is nested more than {MAX_DEPTH} deep")
        if isinstance(part, ast.BinOp):
            self._add_operation(part.op, [part.left, part.right], part, depth)
        elif isinstance(part, ast.UnaryOp):
            self._add_operation(part.op, [part.operand], part, depth)
        elif isinstance(part, ast.Call):
            self._add_call(part, depth)
        elif isinstance(part, ast.Constant):
            self.steps.append(("number", self._number(part)))
        elif isinstance(part, ast.Name):
            self.steps.append(("band", self._band(part)))
        else:
            raise self._refused(part, _KNOWN)

    def _add_operation(self, op: ast.AST, operands: list[ast.expr], part: ast.expr, depth: int) -> None:
        if isinstance(op, ast.BitXor):
            raise self._refused(operands[1], "a power is written **, not ^")
        if type(op) not in _OPERATORS:
            raise self._refused(part, _KNOWN)
        for operand in operands:
            self.add(operand, depth + 1)
        self.steps.append((_OPERATORS[type(op)], 0.0))

    def _add_call(self, part: ast.Call, depth: int) -> None:
        name = part.func.id.lower() if isinstance(part.func, ast.Name) else ""
        if name not in _FUNCTIONS:
            raise self._refused(part, f"the functions are {', '.join(_FUNCTIONS)}")
        if part.keywords or len(part.args) != _FUNCTIONS[name]:
            count = "one value" if _FUNCTIONS[name] == 1 else "two values"
            raise self._refused(part, f"{name} takes {count}")
        for argument in part.args:
            self.add(argument, depth + 1)
        self.steps.append((name, 0.0))

    def _number(self, part: ast.Constant) -> float:
        if type(part.value) not in (int, float):
            raise self._refused(part, _KNOWN)
        try:
            value = float(part.value)  # type: ignore[arg-type]
        except OverflowError:
            value = np.inf
        if not np.isfinite(value):
            raise self._refused(part, "the number is too large")
        return value

    def _band(self, part: ast.Name) -> int:
        try:
            number = self.find(part.id)
        except BandError as error:
            raise self._refused(part, str(error)) from error
        if number not in self.bands:
            self.bands.append(number)
        return self.bands.index(number)

    def _refused(self, part: ast.expr, why: str) -> ExpressionError:
        before = self.text.encode()[: part.col_offset].decode(errors="replace")
        return _wrong(self.text, len(before), why)


_KNOWN = "expected names of bands, numbers, + - * / **, parentheses and functions"


def _wrong(text: str, at: int, why: str) -> ExpressionError:
    """An error that shows where it is: the column, and a caret in front of the place."""
    at = min(max(at, 0), len(text))
    before, after = printable(text[max(at - 60, 0) : at]), printable(text[at : at + 60])
    return ExpressionError(f"the expression is wrong at column {at + 1} (^), {before}^{after}: {why}")


def _syntax_text(text: str, at: int) -> str:
    if text.count("(") != text.count(")"):
        more = "closed" if text.count("(") < text.count(")") else "opened"
        return f"more parentheses are {more} than {'opened' if more == 'closed' else 'closed'}"
    if not text:
        return "it is empty; expected as in (nir - red) / (nir + red)"
    if at >= len(text):
        return "it ends too early"
    return _KNOWN
