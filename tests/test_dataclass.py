"""Frozen dataclasses behave as those of the standard library do."""

import copy
import dataclasses
import inspect
import pickle
from dataclasses import field
from functools import cached_property
from typing import Any

import pytest
from hypothesis import given, strategies as st

from uavseg.dataclass import dataclass as ours

DECORATORS = {"standard": dataclasses.dataclass, "shared": ours}


def point(dataclass: Any, slots: bool) -> Any:
    @dataclass(frozen=True, slots=slots)
    class Point:
        """A point."""

        x: int
        y: float = 1.5
        tags: list[int] = field(default_factory=list)
        note: str = field(default="a", repr=False, compare=False)
        z: int = field(default=7, kw_only=True)

        def __post_init__(self) -> None:
            if self.x == 13:
                raise ValueError("not 13")

    return Point


def answer(make: Any) -> Any:
    try:
        return make()
    except Exception as error:  # which one is what is compared
        return type(error)


def described(cls: Any, *calls: Any) -> list[Any]:
    """Describe the values that calls of a class give, and what the class shows of itself."""
    made = [answer(lambda args=args, given=given: cls(*args, **given)) for args, given in calls]
    values = [value for value in made if isinstance(value, cls)]
    return [
        [dataclasses.asdict(value) if value in values else value for value in made],
        made[0] == made[1],
        [(repr(value), answer(lambda value=value: hash(value))) for value in values],
        cls.__match_args__,
        str(inspect.signature(cls)).replace("<factory>", "[]"),
    ]


CALLS = st.tuples(
    st.lists(st.sampled_from([0, 13, 2.5, [1]]), max_size=6),
    st.dictionaries(st.sampled_from(["x", "y", "tags", "note", "z", "other"]), st.integers(0, 14)),
)


@pytest.mark.slow
@given(CALLS, CALLS, st.booleans())
def test_calls_values_comparisons_and_texts_are_those_of_the_standard_library(
    one: Any, other: Any, slots: bool
) -> None:
    answers = [described(point(dataclass, slots), one, other) for dataclass in DECORATORS.values()]
    assert answers[0] == answers[1]


@pytest.mark.parametrize("slots", [False, True])
def test_a_value_is_not_changed_but_replaced(slots: bool) -> None:
    value = point(ours, slots)(1)
    with pytest.raises(dataclasses.FrozenInstanceError):
        value.x = 2
    with pytest.raises(dataclasses.FrozenInstanceError):
        del value.x
    moved = dataclasses.replace(value, x=2, z=5)
    assert (moved.x, moved.y, moved.z, value.x) == (2, 1.5, 5, 1)
    with pytest.raises(ValueError, match="not 13"):
        dataclasses.replace(value, x=13)


@ours(frozen=True, slots=True)
class Slotted:
    a: int
    b: tuple[int, ...] = ()


@ours(frozen=True)
class Cached:
    a: int

    @cached_property
    def double(self) -> int:
        return 2 * self.a


@ours(frozen=True)
class Longer(Cached):
    b: int = 3

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Longer) and self.b == other.b

    def __hash__(self) -> int:
        return self.b


@pytest.mark.parametrize("value", [Slotted(1, (2,)), Cached(4), Longer(1, 2)])
def test_values_are_copied_and_pickled(value: Any) -> None:
    assert copy.copy(value) == copy.deepcopy(value) == pickle.loads(pickle.dumps(value)) == value
    assert repr(copy.copy(value)) == repr(value)


def test_properties_are_kept_and_methods_of_a_class_win() -> None:
    assert Cached(4).double == 8 and vars(Cached(4)) == {"a": 4}
    assert not hasattr(Slotted(1), "__dict__")
    assert Longer(1, 2) == Longer(5, 2) and Longer(1).double == 2
    assert Cached(1) != Longer(1) and len({Cached(1), Cached(1), Longer(9, 9)}) == 2


def test_without_equality_a_value_is_equal_to_itself_alone() -> None:
    @ours(frozen=True, slots=True, eq=False)
    class Held:
        a: int

    one = Held(1)
    assert one == one and one != Held(1) and len({one, Held(1)}) == 2


def test_what_is_not_frozen_or_is_ordered_is_as_ever() -> None:
    @ours
    class Counted:
        n: int = 0

    @ours(frozen=True, order=True)
    class Ranked:
        n: int

    counted = Counted()
    counted.n += 1
    assert counted == Counted(1) and sorted([Ranked(2), Ranked(1)]) == [Ranked(1), Ranked(2)]
