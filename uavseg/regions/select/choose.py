"""Select regions by id, by a condition on their attributes (`--where`), and by size."""

import ast
import re
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from uavseg.arrays import Bools
from uavseg.errors import RegionError, caused_errors
from uavseg.expressions import ALWAYS, ARITHMETIC, LOGIC, Evaluator, Tristate
from uavseg.plain_text import first_of
from uavseg.regions.table import Regions

MAX_LISTED = 10  # ids in a message
MAX_CHARACTERS = 2000  # of a condition
_KEYWORD = re.compile(r"""'(?:\\.|[^'\\])*'|"(?:\\.|[^"\\])*"|\bclass\b""")
_CLASS = "class_column_"  # stands for the column class, which has the name of a keyword


def select_regions(
    regions: Regions,
    ids: Sequence[int] | None = None,
    largest: int | None = None,
    condition: str | None = None,
) -> Regions:
    """Select the regions that have one of the ids and fulfil the condition; of these, the largest.

    They stay in their original order. `largest` is the number to keep at most, by `area_m2`; of equal ones
    the first. For conditions see `uavseg.regions.select.choose.where`. A RegionError says that an id does not
    exist, the condition is not understood, or no region is left.
    """
    kept = np.ones(len(regions), dtype=bool)
    if ids is not None:
        known = regions.columns["id"]
        missing = sorted(set(ids) - set(known.tolist()))
        if missing:
            raise RegionError(
                f"there is no region {_listed(missing)}; there are {_listed(np.unique(known).tolist())}"
            )
        kept &= np.isin(known, list(ids))
    if condition is not None:
        kept &= where(regions.columns, condition)
    if largest is not None:
        if largest < 1:
            raise RegionError(f"expected at least 1 largest region, got {largest}")
        area = np.where(kept, regions.columns["area_m2"], -np.inf)
        first = np.argsort(-area, kind="stable")[:largest]
        kept = kept & np.isin(np.arange(len(regions)), first)
    if not kept.any():
        raise RegionError(f"none of the {len(regions)} regions is selected; give weaker conditions")
    return regions.select(np.flatnonzero(kept))


def of_classes(regions: Regions, names: Sequence[str]) -> Bools:
    """Return the mask of the regions that are of some classes, by their column `class`.

    A RegionError says that no class is named, there is no such column, or no region of one of the classes.
    """
    if not names:
        raise RegionError("no class is named; leave classes out to take the regions of all")
    if "class" not in regions.columns:
        raise RegionError(
            f"these regions have no classes, so none is {names[0]}; "
            "uavseg extract --class NAME=LO,HI makes them"
        )
    column = np.array([str(value) for value in regions.columns["class"]], object)
    known = sorted(set(column.tolist()))
    for name in names:
        if name not in known:
            raise RegionError(
                f"no region is of the class {name}; there are {first_of(known, MAX_LISTED) or 'none'}"
            )
    return np.isin(column, list(names))


def _listed(ids: Sequence[int]) -> str:
    shown = ", ".join(map(str, ids[:MAX_LISTED]))
    return shown if len(ids) <= MAX_LISTED else f"{shown}, ... {ids[-1]} ({len(ids)} in all)"


def where(columns: Mapping[str, NDArray[Any]], condition: str) -> Bools:
    """Return the mask of the regions that fulfil a condition; not where a missing number leaves it unknown.

    The condition may hold names of columns, numbers, texts in quotes, comparisons, `and`, `or`, `not`,
    `+ - * /`, and `in` and `not in` with a list. Nothing else: it is not run as Python.

    Columns, (N,), are numbers, booleans or texts. A comparison with a missing number (NaN) is neither true
    nor false, with `!=` and under `not` as well; `mean > 0.6 or id == 4` is true where its other side is. A
    missing text is the empty text.

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
    large = f"the condition {condition[:60]!r} is too large a calculation; make it simpler"
    refusing = caused_errors(large, RegionError, OverflowError, RecursionError, form="{}")
    with np.errstate(all="ignore"), refusing:
        answer = _Condition(columns, condition).evaluate(tree)
    if not isinstance(answer, Tristate):
        raise RegionError(
            f"the condition {condition!r} is not a condition; compare with a value, as in mean > 0.7"
        )
    return np.array(np.broadcast_to(answer.true, count))


def _parse(condition: str) -> ast.expr:
    if len(condition) > MAX_CHARACTERS:
        raise RegionError(f"the condition has {len(condition)} characters; at most {MAX_CHARACTERS} are read")
    try:
        # A text in quotes stays as it is.
        named = _KEYWORD.sub(lambda found: _CLASS if found[0] == "class" else found[0], condition.strip())
        return ast.parse(named, mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        one_equals = "=" in condition and not any(two in condition for two in ("==", "<=", ">=", "!="))
        hint = "; equality is written ==" if one_equals else ""
        raise RegionError(
            f'the condition {condition[:60]!r} cannot be read; expected as in "mean > 0.7"{hint}'
        ) from error


class _Condition(Evaluator):
    """Conditions on columns, by their names."""

    nodes = frozenset({ast.Constant, ast.Name, ast.BoolOp, ast.UnaryOp, ast.BinOp, ast.Compare})
    operators: ClassVar = {**ARITHMETIC, **LOGIC}

    def __init__(self, columns: Mapping[str, NDArray[Any]], condition: str) -> None:
        self.columns = columns
        self.condition = condition

    def look_up(self, part: ast.Name) -> Any:
        name = "class" if part.id == _CLASS else part.id
        if name not in self.columns:
            known = ", ".join(self.columns)
            raise RegionError(f"these regions have no {name!r}; they have {known}")
        return _plain(self.columns[name])

    def constant(self, part: ast.Constant) -> Any:
        if isinstance(part.value, bool):
            return ALWAYS if part.value else ~ALWAYS
        if not isinstance(part.value, int | float | str):
            raise self.refused(part)
        return np.str_(part.value) if isinstance(part.value, str) else np.float64(part.value)

    def refused(self, part: ast.expr, why: str = "") -> RegionError:
        return RegionError(
            f"the condition {self.condition!r}: {ast.unparse(part)!r} is not understood; "
            "use names, numbers, texts, comparisons, and, or, not, in [...], + - * /"
        )

    def mistaken(self, why: str) -> RegionError:
        return RegionError(f"the condition {self.condition!r}{why}")


def _plain(column: NDArray[Any]) -> Any:
    """Return a column as numbers, booleans or texts; a missing text is empty."""
    if column.dtype.kind in "iuf":
        return column.astype(np.float64)
    if column.dtype.kind == "b":
        return Tristate(column, ~column)
    return np.array(["" if value is None or value != value else str(value) for value in column])
