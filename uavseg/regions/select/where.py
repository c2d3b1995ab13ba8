"""Conditions on the attributes of regions, as text: read as a tree and answered, never run as code."""

import ast
import operator
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavseg.errors import RegionError

LONGEST = 2000  # characters of a condition

_COMPARE: dict[type, Callable[[Any, Any], Any]] = {
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
    ast.Eq: operator.eq,
    ast.NotEq: operator.ne,
}
_CALCULATE: dict[type, Callable[[Any, Any], Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
}


def where(columns: Mapping[str, NDArray[Any]], condition: str) -> NDArray[np.bool_]:
    """Which regions fulfil a condition.

    The condition may hold names of columns, numbers, texts in quotes, comparisons, `and`, `or`, `not`,
    `+ - * /`, and `in` and `not in` with a list. Nothing else: it is not run as Python.

    Parameters
    ----------
    columns : mapping of str to (N,) array
        Numbers or texts. A comparison with a missing number (NaN) is not fulfilled.
    condition : str

    Raises
    ------
    RegionError
        If the condition cannot be read, asks for something else, names no column or compares a number
        with a text.

    Examples
    --------
    >>> columns = {"mean": np.array([0.5, 0.8]), "source": np.array(["a.tif", "b.tif"], object)}
    >>> where(columns, "mean > 0.7 and source in ['b.tif', 'c.tif']")
    array([False,  True])
    """
    tree = _parsed(condition)
    count = len(next(iter(columns.values())))
    with np.errstate(all="ignore"):
        try:
            answer = _Answer(columns, condition).of(tree)
        except (OverflowError, RecursionError) as error:
            raise RegionError(
                f"the condition {condition[:60]!r} is too large a calculation; make it simpler"
            ) from error
    if np.asarray(answer).dtype != bool:
        raise RegionError(
            f"the condition {condition!r} is no condition; compare with something, as in mean > 0.7"
        )
    return np.array(np.broadcast_to(answer, count))


def _parsed(condition: str) -> ast.expr:
    if len(condition) > LONGEST:
        raise RegionError(f"the condition has {len(condition)} characters; at most {LONGEST} are read")
    try:
        return ast.parse(condition.strip(), mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        one_equals = "=" in condition and not any(two in condition for two in ("==", "<=", ">=", "!="))
        hint = "; equality is written ==" if one_equals else ""
        raise RegionError(
            f'the condition {condition[:60]!r} cannot be read; expected as in "mean > 0.7"{hint}'
        ) from error


class _Answer:
    """Answers parts of a condition, each by the kind of part it is."""

    def __init__(self, columns: Mapping[str, NDArray[Any]], condition: str) -> None:
        self.columns = columns
        self.condition = condition

    def of(self, part: ast.expr) -> Any:
        kind = getattr(self, f"_{type(part).__name__.lower()}", None)
        if kind is None:
            raise self._refused(part)
        return kind(part)

    def _constant(self, part: ast.Constant) -> Any:
        if not isinstance(part.value, bool | int | float | str):
            raise self._refused(part)
        return np.bool_(part.value) if isinstance(part.value, bool) else _exact(part.value)

    def _name(self, part: ast.Name) -> Any:
        if part.id not in self.columns:
            known = ", ".join(self.columns)
            raise RegionError(f"these regions have no {part.id!r}; they have {known}")
        return _plain(self.columns[part.id])

    def _boolop(self, part: ast.BoolOp) -> Any:
        combine = np.logical_and if isinstance(part.op, ast.And) else np.logical_or
        answer = self._truth(part.values[0])
        for value in part.values[1:]:
            answer = combine(answer, self._truth(value))
        return answer

    def _unaryop(self, part: ast.UnaryOp) -> Any:
        if isinstance(part.op, ast.Not):
            return np.logical_not(self._truth(part.operand))
        if isinstance(part.op, ast.USub | ast.UAdd):
            value = self._number(part.operand)
            return -value if isinstance(part.op, ast.USub) else value
        raise self._refused(part)

    def _binop(self, part: ast.BinOp) -> Any:
        if type(part.op) not in _CALCULATE:
            raise self._refused(part)
        return _CALCULATE[type(part.op)](self._number(part.left), self._number(part.right))

    def _compare(self, part: ast.Compare) -> Any:
        answer: Any = np.True_
        left = part.left
        for operation, right in zip(part.ops, part.comparators, strict=True):
            answer = np.logical_and(answer, self._compared(left, operation, right))
            left = right
        return answer

    def _compared(self, left: ast.expr, operation: ast.cmpop, right: ast.expr) -> Any:
        if isinstance(operation, ast.In | ast.NotIn):
            if not isinstance(right, ast.List | ast.Tuple):
                raise RegionError(f"the condition {self.condition!r}: after in comes a list, as in [1, 4, 7]")
            answer: Any = np.False_
            for choice in right.elts:
                answer = np.logical_or(answer, self._compared(left, ast.Eq(), choice))
            return answer if isinstance(operation, ast.In) else np.logical_not(answer)
        if type(operation) not in _COMPARE:
            raise self._refused(left)
        first, second = self.of(left), self.of(right)
        if _is_text(first) != _is_text(second):
            raise RegionError(f"the condition {self.condition!r} compares a number with a text")
        return _COMPARE[type(operation)](first, second)

    def _truth(self, part: ast.expr) -> Any:
        value = self.of(part)
        if np.asarray(value).dtype != bool:
            raise RegionError(f"the condition {self.condition!r}: {ast.unparse(part)} is no condition")
        return value

    def _number(self, part: ast.expr) -> Any:
        value = self.of(part)
        if _is_text(value) or np.asarray(value).dtype == bool:
            raise RegionError(f"the condition {self.condition!r}: {ast.unparse(part)} is no number")
        return value

    def _refused(self, part: ast.AST) -> RegionError:
        return RegionError(
            f"the condition {self.condition!r}: {ast.unparse(part)!r} is not understood; "
            "use names, numbers, texts, comparisons, and, or, not, in [...], + - * /"
        )


def _exact(value: float | str) -> Any:
    return np.str_(value) if isinstance(value, str) else np.float64(value)


def _plain(column: NDArray[Any]) -> NDArray[Any]:
    """A column as numbers, truths or texts; a missing text is empty."""
    if column.dtype.kind in "iuf":
        return column.astype(np.float64)
    if column.dtype.kind == "b":
        return column
    return np.array(["" if value is None or value != value else str(value) for value in column])


def _is_text(value: Any) -> bool:
    return bool(np.asarray(value).dtype.kind == "U")
