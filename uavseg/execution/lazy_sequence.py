"""Lazy sequence: items are made when they are indexed, so that a map's many jobs are never held at once."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from operator import index
from typing import Generic, TypeVar, overload

Item = TypeVar("Item", covariant=True)


@dataclass(frozen=True, slots=True)
class LazySequence(Sequence[Item], Generic[Item]):
    """A sequence of which each item is made anew whenever it is asked for.

    It pickles, and has a fingerprint, if `make_item` does: a function of a module or a `partial` of one.

    Parameters
    ----------
    length : int
    make_item : callable
        From a position 0..length - 1 to the item there.

    Examples
    --------
    >>> squares = LazySequence(5, lambda k: k * k)
    >>> squares[-1], list(squares[1:4])
    (16, [1, 4, 9])
    """

    length: int
    make_item: Callable[[int], Item]

    def __len__(self) -> int:
        return self.length

    @overload
    def __getitem__(self, which: int) -> Item: ...

    @overload
    def __getitem__(self, which: slice) -> "LazySequence[Item]": ...

    def __getitem__(self, which: int | slice) -> "Item | LazySequence[Item]":
        positions = range(self.length)
        if isinstance(which, slice):
            return lazy_selection(self, positions[which])
        return self.make_item(positions[index(which)])


def lazy_selection(items: Sequence[Item], positions: Sequence[int]) -> LazySequence[Item]:
    """The items at some positions of a sequence, each taken when it is asked for."""
    return LazySequence(len(positions), partial(_selected, items, positions))


def _selected(items: Sequence[Item], positions: Sequence[int], k: int) -> Item:
    return items[positions[k]]
