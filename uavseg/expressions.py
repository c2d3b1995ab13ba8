"""Expressions as text: a syntax tree evaluated node by node by numpy, and never run as code.

Two vocabularies share it: band arithmetic (``--expr``) and conditions on the attributes of regions
(``--where``). Comparisons have three-valued logic (Kleene's, as in SQL): what is compared with a missing
number is unknown, `not` leaves it unknown, and `and` and `or` decide it only where the other side does.
"""

import ast
import operator
from collections.abc import Callable, Mapping
from typing import Any, ClassVar

import numpy as np

from uavseg.dataclass import dataclass

ARITHMETIC: dict[type, Callable[..., Any]] = {
    ast.Add: np.add,
    ast.Sub: np.subtract,
    ast.Mult: np.multiply,
    ast.Div: np.divide,
    ast.USub: np.negative,
    ast.UAdd: np.positive,
}
LOGIC: dict[type, Callable[..., Any]] = {
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
    ast.Eq: operator.eq,
    ast.NotEq: operator.ne,
    ast.And: operator.and_,
    ast.Or: operator.or_,
    ast.Not: operator.invert,
}


@dataclass(frozen=True, slots=True)
class Tristate:
    """Three-valued truth of each element: masks of true and of false; unknown elsewhere."""

    true: Any
    false: Any

    def __and__(self, other: "Tristate") -> "Tristate":
        return Tristate(self.true & other.true, self.false | other.false)

    def __or__(self, other: "Tristate") -> "Tristate":
        return Tristate(self.true | other.true, self.false & other.false)

    def __invert__(self) -> "Tristate":
        return Tristate(self.false, self.true)


ALWAYS = Tristate(np.True_, np.False_)


class Evaluator:
    """Evaluate a syntax tree; a subclass has the vocabulary and the messages.

    The vocabulary is the `nodes` and `operators` that there may be, and `functions`, in lower case, with how
    many values they take. `max_depth` is how deep nodes may lie in each other; None for no limit.
    """

    nodes: ClassVar[frozenset[type]]
    operators: ClassVar[Mapping[type, Callable[..., Any]]]
    functions: ClassVar[Mapping[str, tuple[Callable[..., Any], int]]] = {}
    max_depth: ClassVar[int | None] = None
    _depth = 0

    def look_up(self, part: ast.Name) -> Any:
        """Return the value of a name: an array, or a Tristate."""
        raise NotImplementedError

    def constant(self, part: ast.Constant) -> Any:
        """Return the value of a constant: a number or a text of numpy, or a Tristate."""
        raise NotImplementedError

    def refused(self, part: ast.expr, why: str = "") -> Exception:
        """The error for what the vocabulary does not have; `why` is empty where nothing more is known."""
        raise NotImplementedError

    def mistaken(self, why: str) -> Exception:
        """Return the error for values that do not fit each other; `why` goes on after the text."""
        raise NotImplementedError

    def evaluate(self, part: ast.expr) -> Any:
        """Return the value of a node: an array or a number of numpy, or a Tristate."""
        if self.max_depth is not None and self._depth >= self.max_depth:
            raise self.refused(part, f"it is nested more than {self.max_depth} deep")
        if type(part) not in self.nodes:
            raise self.refused(part)
        self._depth += 1
        value = _NODES[type(part)](self, part)
        self._depth -= 1
        return value

    def _operator(self, op: ast.AST, part: ast.expr) -> Callable[..., Any]:
        if type(op) not in self.operators:
            raise self.refused(part)
        return self.operators[type(op)]

    def _unary(self, part: ast.UnaryOp) -> Any:
        operate = self._operator(part.op, part)
        is_logic = isinstance(part.op, ast.Not)
        return operate(self._truth(part.operand) if is_logic else self._operand(part.operand))

    def _binary(self, part: ast.BinOp) -> Any:
        if isinstance(part.op, ast.BitXor) and ast.Pow in self.operators:
            raise self.refused(part.right, "a power is written **, not ^")
        operate = self._operator(part.op, part)
        return operate(self._operand(part.left), self._operand(part.right))

    def _call(self, part: ast.Call) -> Any:
        name = part.func.id.lower() if isinstance(part.func, ast.Name) else ""
        if name not in self.functions:
            raise self.refused(part, f"the functions are {', '.join(self.functions)}")
        function, count = self.functions[name]
        if part.keywords or len(part.args) != count:
            raise self.refused(part, f"{name} takes {'one value' if count == 1 else 'two values'}")
        return function(*map(self._operand, part.args))

    def _logic(self, part: ast.BoolOp) -> Tristate:
        operate = self._operator(part.op, part)
        answer = self._truth(part.values[0])
        for value in part.values[1:]:
            answer = operate(answer, self._truth(value))
        return answer

    def _comparison(self, part: ast.Compare) -> Tristate:
        answer, left = ALWAYS, part.left
        for operation, right in zip(part.ops, part.comparators, strict=True):
            answer = answer & self._compared(left, operation, right)
            left = right
        return answer

    def _compared(self, left: ast.expr, operation: ast.cmpop, right: ast.expr) -> Tristate:
        if isinstance(operation, ast.In | ast.NotIn):
            if not isinstance(right, ast.List | ast.Tuple):
                raise self.mistaken(": in needs a list, as in [1, 4, 7]")
            answer = ~ALWAYS
            for choice in right.elts:
                answer = answer | self._compared(left, ast.Eq(), choice)
            return answer if isinstance(operation, ast.In) else ~answer
        operate = self._operator(operation, left)
        first, second = self.evaluate(left), self.evaluate(right)
        if _is_text(first) != _is_text(second):
            raise self.mistaken(" compares a number with a text")
        known = _known(first) & _known(second)
        found = operate(_values(first), _values(second))
        return Tristate(found & known, ~found & known)

    def _truth(self, part: ast.expr) -> Tristate:
        value = self.evaluate(part)
        if not isinstance(value, Tristate):
            raise self.mistaken(f": {ast.unparse(part)} is not a condition")
        return value

    def _operand(self, part: ast.expr) -> Any:
        value = self.evaluate(part)
        if isinstance(value, Tristate) or _is_text(value):
            raise self.mistaken(f": {ast.unparse(part)} is not a number")
        return value


_NODES: dict[type, Callable[[Any, Any], Any]] = {
    ast.Constant: lambda evaluator, part: evaluator.constant(part),
    ast.Name: lambda evaluator, part: evaluator.look_up(part),
    ast.UnaryOp: Evaluator._unary,
    ast.BinOp: Evaluator._binary,
    ast.Call: Evaluator._call,
    ast.BoolOp: Evaluator._logic,
    ast.Compare: Evaluator._comparison,
}


def _is_text(value: Any) -> bool:
    return not isinstance(value, Tristate) and bool(value.dtype.kind == "U")


def _known(value: Any) -> Any:
    """Return where a value is not missing."""
    if isinstance(value, Tristate):
        return value.true | value.false
    return np.True_ if _is_text(value) else ~np.isnan(value)


def _values(value: Any) -> Any:
    return value.true if isinstance(value, Tristate) else value
