"""Partitions of v into intervals: classes with names, and levels between breaks."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavseg.arguments import checked
from uavseg.errors import IntensityRangeError, ParameterError
from uavseg.segmentation.params.segment import IntensityRange, Levels
from uavseg.units import GREY_LEVELS, GREY_MAX, MAX_REFINED

_MAX_NAME = 80


@dataclass(frozen=True, slots=True)
class Partition:
    """The intervals between increasing edges in 0..1, each with a kind.

    Parameters
    ----------
    edges : tuple of float
        Increasing; a value on an edge belongs to the interval below it.
    kinds : tuple of int
        The kind of each interval, one more than there are edges: 1, 2, ..., or 0 for nothing.
    bounds : tuple of float
        The ends of the intervals as they were asked for.
    """

    edges: tuple[float, ...]
    kinds: tuple[int, ...]
    bounds: tuple[float, ...]

    @property
    def count(self) -> int:
        """The number of kinds."""
        return max(self.kinds)

    @property
    def grey_table(self) -> NDArray[np.uint8]:
        """The kind of every grey g, whose v = g / 65535: a (65536,) uint8 array; at most 255 kinds."""
        v = np.arange(GREY_LEVELS) / GREY_MAX
        return np.array(self.kinds, np.uint8)[np.searchsorted(np.array(self.edges, np.float64), v)]

    def of_intervals(self, intervals: NDArray[Any]) -> NDArray[Any]:
        """Kinds of cells from their intervals, counted from 1; 0 stays 0.

        Parameters
        ----------
        intervals : uint8 or uint32 array
            From `leaves.cell_intervals`.
        """
        table = np.array([0, *self.kinds], intervals.dtype)
        return np.asarray(table[intervals])


@checked
@dataclass(frozen=True, slots=True)
class Breaks:
    """Levels between given edges over 0..1.

    Parameters
    ----------
    edges : tuple of float
        Increasing, above 0 and below 1. A value on an edge belongs to the level below it.

    Raises
    ------
    ParameterError
        If they are not.

    Examples
    --------
    >>> Breaks((0.2, 0.5)).bounds
    (0.0, 0.2, 0.5, 1.0)
    """

    edges: tuple[float, ...]

    def __post_init__(self) -> None:
        bounds = (0.0, *self.edges, 1.0)
        if not all(low < high for low, high in pairwise(bounds)):
            given = ",".join(f"{edge:g}" for edge in self.edges)
            raise ParameterError(f"breaks increase, above 0 and below 1, such as 0.2,0.5; got {given}")
        if len(self.edges) >= GREY_MAX:
            raise ParameterError(
                f"there are {len(self.edges)} breaks, and no more than {GREY_MAX - 1} differ"
            )

    @property
    def count(self) -> int:
        """Number of levels."""
        return len(self.edges) + 1

    @property
    def bounds(self) -> tuple[float, ...]:
        """The edges with 0 and 1 at the ends: level k lies between bounds k and k + 1."""
        return (0.0, *self.edges, 1.0)


def partition_of_levels(levels: Levels | Breaks) -> Partition:
    """The partition whose kinds are the levels, counted from 1."""
    return Partition(levels.edges, tuple(range(1, levels.count + 1)), levels.edges)


@dataclass(frozen=True, slots=True)
class ValueClass:
    """A class of ground: its name, the range of v that belongs to it, and the colour it is drawn in.

    Parameters
    ----------
    name : str
    interval : IntensityRange
    color : str, optional
        As "#rrggbb".

    Raises
    ------
    ParameterError
        If the name is empty, too long or not printable.
    """

    name: str
    interval: IntensityRange
    color: str | None = None

    def __post_init__(self) -> None:
        if not self.name.strip():
            raise ParameterError(
                f"the class of {self.interval.low:g},{self.interval.high:g} has no name; give it one, "
                "such as water=0,0.2"
            )
        if len(self.name) > _MAX_NAME or not self.name.isprintable():
            raise ParameterError(
                f"the name of a class has up to {_MAX_NAME} printable characters, not {self.name[:40]!r}"
            )

    def __str__(self) -> str:
        return f"{self.name} ({self.interval.low:g},{self.interval.high:g})"


@dataclass(frozen=True, slots=True)
class ValueClasses:
    """Classes whose ranges do not overlap; kind k is the k-th of them, from 1.

    A range includes both its ends. Where two ranges share an end, it belongs to the lower of them.

    Parameters
    ----------
    classes : tuple of ValueClass

    Raises
    ------
    ParameterError
        If there are none or too many, two have the same name, or two overlap.

    Examples
    --------
    >>> low, high = ValueClass("water", IntensityRange(0, 0.2)), ValueClass("sand", IntensityRange(0.2, 0.6))
    >>> ValueClasses((high, low)).partition.kinds
    (0, 2, 1, 0)
    """

    classes: tuple[ValueClass, ...]

    def __post_init__(self) -> None:
        if not 1 <= len(self.classes) <= MAX_REFINED:
            raise ParameterError(f"expected 1 to {MAX_REFINED} classes, got {len(self.classes)}")
        names = [one.name for one in self.classes]
        for name in names:
            if names.count(name) > 1:
                raise ParameterError(f"{names.count(name)} classes have the name {name}; give each its own")
        for one, other in pairwise(_sorted(self.classes)):
            if other.interval.low < one.interval.high:
                raise IntensityRangeError(
                    f"the classes {one} and {other} overlap; ranges of classes may share an end and no more"
                )

    @property
    def partition(self) -> Partition:
        """The partition whose kinds are the classes, counted from 1."""
        edges: list[float] = []
        kinds = [0]
        for one in _sorted(self.classes):
            kind = self.classes.index(one) + 1
            low, high = one.interval.low, one.interval.high
            if edges and edges[-1] == low:
                kinds[-1] = kind
            else:
                edges.append(math.nextafter(low, -1.0))
                kinds.append(kind)
            edges.append(high)
            kinds.append(0)
        bounds = sorted({end for one in self.classes for end in (one.interval.low, one.interval.high)})
        return Partition(tuple(edges), tuple(kinds), tuple(bounds))


def _sorted(classes: Sequence[ValueClass]) -> list[ValueClass]:
    return sorted(classes, key=lambda one: one.interval.low)
