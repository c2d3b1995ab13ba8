"""Conditions on the attributes of regions, as text: parsed to a syntax tree and evaluated, never run as code.

Missing numbers follow SQL's three-valued logic (Kleene's): what is compared with one is unknown, `not`
leaves it unknown, `and` and `or` decide it only where the other side does, and a region is chosen where the
whole is true.
"""

import ast
import operator
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavseg.errors import RegionError

MAX_CHARACTERS = 2000  # of a condition

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
    """Mask of the regions that fulfil a condition; where a missing number leaves it unknown, they do not.

    The condition may hold names of columns, numbers, texts in quotes, comparisons, `and`, `or`, `not`,
    `+ - * /`, and `in` and `not in` with a list. Nothing else: it is not run as Python.

    Parameters
    ----------
    columns : mapping of str to (N,) array
        Numbers, booleans or texts. A comparison with a missing number (NaN) is neither true nor false, with
        `!=` and under `not` as well; `mean > 0.6 or id == 4` is true where its other side is. A missing
        text is the empty text.
    condition : str

    Raises
    ------
    RegionError
        If the condition cannot be parsed, uses other syntax, names a column that does not exist, or compares
        a number with a text.

    Examples
    --------
    >>> columns = {"mean": np.array([0.5, 0.8]), "source": np.array(["a.tif", "b.tif"], object)}
    >>> where(columns, "mean > 0.7 and source in ['b.tif', 'c.tif']")
    array([False,  True])
    >>> where({"mean": np.array([0.5, 0.8, np.nan])}, "not mean > 0.7")
    array([ True, False, False])
    """
    tree = _parse(condition)
    count = len(next(iter(columns.values())))
    with np.errstate(all="ignore"):
        try:
            answer = _Evaluator(columns, condition).evaluate(tree)
        except (OverflowError, RecursionError) as error:
            raise RegionError(
                f"the condition {condition[:60]!r} is too large a calculation; make it simpler"
            ) from error
    if not isinstance(answer, _Truth):
        raise RegionError(
            f"the condition {condition!r} is not a condition; compare with a value, as in mean > 0.7"
        )
    return np.array(np.broadcast_to(answer.true, count))


def _parse(condition: str) -> ast.expr:
    if len(condition) > MAX_CHARACTERS:
        raise RegionError(f"the condition has {len(condition)} characters; at most {MAX_CHARACTERS} are read")
    try:
        return ast.parse(_KEYWORD.sub(_as_name, condition.strip()), mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        one_equals = "=" in condition and not any(two in condition for two in ("==", "<=", ">=", "!="))
        hint = "; equality is written ==" if one_equals else ""
        raise RegionError(
            f'the condition {condition[:60]!r} cannot be read; expected as in "mean > 0.7"{hint}'
        ) from error


_KEYWORD = re.compile(r"""'(?:\\.|[^'\\])*'|"(?:\\.|[^"\\])*"|\bclass\b""")
_CLASS = "class_column_"  # stands for the column class, which has the name of a keyword


def _as_name(found: re.Match[str]) -> str:
    """A text in quotes as it is, and the keyword class as a name."""
    return _CLASS if found[0] == "class" else found[0]


@dataclass(frozen=True, slots=True)
class _Truth:
    """Three-valued truth of regions: masks of true and of false; unknown elsewhere."""

    true: Any
    false: Any

    def __and__(self, other: "_Truth") -> "_Truth":
        return _Truth(self.true & other.true, self.false | other.false)

    def __or__(self, other: "_Truth") -> "_Truth":
        return _Truth(self.true | other.true, self.false & other.false)

    def __invert__(self) -> "_Truth":
        return _Truth(self.false, self.true)


_ALWAYS = _Truth(np.True_, np.False_)


class _Evaluator:
    """Evaluates the nodes of a syntax tree, by their type."""

    def __init__(self, columns: Mapping[str, NDArray[Any]], condition: str) -> None:
        self.columns = columns
        self.condition = condition

    def evaluate(self, part: ast.expr) -> Any:
        kind = getattr(self, f"_{type(part).__name__.lower()}", None)
        if kind is None:
            raise self._refused(part)
        return kind(part)

    def _constant(self, part: ast.Constant) -> Any:
        if not isinstance(part.value, bool | int | float | str):
            raise self._refused(part)
        if isinstance(part.value, bool):
            return _ALWAYS if part.value else ~_ALWAYS
        return np.str_(part.value) if isinstance(part.value, str) else np.float64(part.value)

    def _name(self, part: ast.Name) -> Any:
        name = "class" if part.id == _CLASS else part.id
        if name not in self.columns:
            known = ", ".join(self.columns)
            raise RegionError(f"these regions have no {name!r}; they have {known}")
        return _plain(self.columns[name])

    def _boolop(self, part: ast.BoolOp) -> Any:
        combine = operator.and_ if isinstance(part.op, ast.And) else operator.or_
        answer = self._truth(part.values[0])
        for value in part.values[1:]:
            answer = combine(answer, self._truth(value))
        return answer

    def _unaryop(self, part: ast.UnaryOp) -> Any:
        if isinstance(part.op, ast.Not):
            return ~self._truth(part.operand)
        if isinstance(part.op, ast.USub | ast.UAdd):
            value = self._number(part.operand)
            return -value if isinstance(part.op, ast.USub) else value
        raise self._refused(part)

    def _binop(self, part: ast.BinOp) -> Any:
        if type(part.op) not in _CALCULATE:
            raise self._refused(part)
        return _CALCULATE[type(part.op)](self._number(part.left), self._number(part.right))

    def _compare(self, part: ast.Compare) -> _Truth:
        answer = _ALWAYS
        left = part.left
        for operation, right in zip(part.ops, part.comparators, strict=True):
            answer = answer & self._compared(left, operation, right)
            left = right
        return answer

    def _compared(self, left: ast.expr, operation: ast.cmpop, right: ast.expr) -> _Truth:
        if isinstance(operation, ast.In | ast.NotIn):
            if not isinstance(right, ast.List | ast.Tuple):
                raise RegionError(f"the condition {self.condition!r}: in needs a list, as in [1, 4, 7]")
            answer = ~_ALWAYS
            for choice in right.elts:
                answer = answer | self._compared(left, ast.Eq(), choice)
            return answer if isinstance(operation, ast.In) else ~answer
        if type(operation) not in _COMPARE:
            raise self._refused(left)
        first, second = self.evaluate(left), self.evaluate(right)
        if _is_text(first) != _is_text(second):
            raise RegionError(f"the condition {self.condition!r} compares a number with a text")
        known = _known(first) & _known(second)
        found = _COMPARE[type(operation)](_values(first), _values(second))
        return _Truth(found & known, ~found & known)

    def _truth(self, part: ast.expr) -> _Truth:
        value = self.evaluate(part)
        if not isinstance(value, _Truth):
            raise RegionError(f"the condition {self.condition!r}: {ast.unparse(part)} is not a condition")
        return value

    def _number(self, part: ast.expr) -> Any:
        value = self.evaluate(part)
        if _is_text(value) or isinstance(value, _Truth):
            raise RegionError(f"the condition {self.condition!r}: {ast.unparse(part)} is not a number")
        return value

    def _refused(self, part: ast.AST) -> RegionError:
        return RegionError(
            f"the condition {self.condition!r}: {ast.unparse(part)!r} is not understood; "
            "use names, numbers, texts, comparisons, and, or, not, in [...], + - * /"
        )


def _plain(column: NDArray[Any]) -> Any:
    """A column as numbers, booleans or texts; a missing text is empty."""
    if column.dtype.kind in "iuf":
        return column.astype(np.float64)
    if column.dtype.kind == "b":
        return _Truth(column, ~column)
    return np.array(["" if value is None or value != value else str(value) for value in column])


def _is_text(value: Any) -> bool:
    return not isinstance(value, _Truth) and bool(np.asarray(value).dtype.kind == "U")


def _known(value: Any) -> Any:
    """Where a value is not missing."""
    if isinstance(value, _Truth):
        return value.true | value.false
    return np.True_ if _is_text(value) else ~np.isnan(value)


def _values(value: Any) -> Any:
    return value.true if isinstance(value, _Truth) else value
