"""Reclassification: partitions of v into intervals, as named classes or as levels between breaks."""

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from uavseg.arguments import checked
from uavseg.errors import IntensityRangeError, ParameterError
from uavseg.segmentation.params.segment import IntensityRange, Levels
from uavseg.units import GREY_LEVELS, GREY_MAX, MAX_PIXEL_CLASSES

_MAX_NAME = 80


@dataclass(frozen=True, slots=True)
class Partition:
    """Intervals between increasing edges in 0..1, each with the number of a class.

    Parameters
    ----------
    edges : tuple of float
        Increasing; a value on an edge belongs to the interval below it.
    classes : tuple of int
        The class of each interval, one more than there are edges: 1, 2, ..., or 0 for none.
    bounds : tuple of float
        The requested ends of the intervals.
    """

    edges: tuple[float, ...]
    classes: tuple[int, ...]
    bounds: tuple[float, ...]

    @property
    def count(self) -> int:
        """Number of classes."""
        return max(self.classes)

    @property
    def grey_table(self) -> NDArray[np.uint8]:
        """Class of every grey g, whose v = g / 65535: a (65536,) uint8 lookup table; at most 255 classes."""
        v = np.arange(GREY_LEVELS) / GREY_MAX
        return np.array(self.classes, np.uint8)[np.searchsorted(np.array(self.edges, np.float64), v)]


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
        """Edges with 0 and 1 at the ends: level k lies between bounds k and k + 1."""
        return (0.0, *self.edges, 1.0)


def partition_of_levels(levels: Levels | Breaks) -> Partition:
    """Return the partition whose classes are the levels, counted from 1."""
    return Partition(levels.edges, tuple(range(1, levels.count + 1)), levels.edges)


@dataclass(frozen=True, slots=True)
class ValueClass:
    """Class of ground: its name, its range of v, and the colour it is drawn in ("#rrggbb").

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
    """Classes whose ranges do not overlap, numbered from 1.

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
    >>> ValueClasses((high, low)).partition.classes
    (0, 2, 1, 0)
    """

    classes: tuple[ValueClass, ...]

    def __post_init__(self) -> None:
        if not 1 <= len(self.classes) <= MAX_PIXEL_CLASSES:
            raise ParameterError(f"expected 1 to {MAX_PIXEL_CLASSES} classes, got {len(self.classes)}")
        names = [one.name for one in self.classes]
        for name in names:
            if names.count(name) > 1:
                raise ParameterError(f"{names.count(name)} classes have the name {name}; give each its own")
        for one, other in pairwise(self._by_value()):
            if other.interval.low < one.interval.high:
                raise IntensityRangeError(
                    f"the classes {one} and {other} overlap; ranges of classes may share an end and no more"
                )

    @property
    def partition(self) -> Partition:
        """Partition whose classes are these, counted from 1."""
        edges: list[float] = []
        numbers = [0]
        for one in self._by_value():
            number = self.classes.index(one) + 1
            low, high = one.interval.low, one.interval.high
            if edges and edges[-1] == low:
                numbers[-1] = number
            else:
                edges.append(math.nextafter(low, -1.0))
                numbers.append(number)
            edges.append(high)
            numbers.append(0)
        bounds = sorted({end for one in self.classes for end in (one.interval.low, one.interval.high)})
        return Partition(tuple(edges), tuple(numbers), tuple(bounds))

    def _by_value(self) -> list[ValueClass]:
        return sorted(self.classes, key=lambda one: one.interval.low)
