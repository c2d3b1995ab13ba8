"""Parameters of the segmentation: intervals of v, partitions into them, thresholds of the division."""

import math
from itertools import pairwise
from math import inf
from typing import Literal, Protocol

import numpy as np
from numpy.typing import ArrayLike

from uavseg.arguments import checked
from uavseg.arrays import Uint8s
from uavseg.dataclass import dataclass
from uavseg.errors import IntensityRangeError, ParameterError
from uavseg.units import FREE, GREY_LEVELS, GREY_MAX, MAX_PIXEL_CLASSES

Method = Literal["paper", "adaptive"]
Refinement = Literal["none", "pixels", "scan", "smooth", "tv"]
PIXELWISE = ("pixels", "tv")  # refinements that decide each pixel, whatever the leaves are


@dataclass(frozen=True, slots=True)
class DivisionParams:
    """Thresholds above which a block is divided into its four children."""

    threshold: float  # X: divided where R = G_max / G_min is larger
    step: float  # tau: and where the means of the children differ by more; infinite for no such test


@checked
@dataclass(frozen=True, slots=True)
class SegmentParams:
    """Parameters of the segmentation.

    Refinement is by total variation by default, which decides each pixel by its denoised value, and by scans
    with the paper's method; "pixels" is a threshold: each pixel by its own value. With the others leaves
    decide, and scans and local means move their boundaries.

    A ParameterError says that a parameter is out of bounds.
    """

    method: Method = "adaptive"  # "adaptive": by texture and intensity, "paper": by texture alone
    threshold: float = 1.2  # X, at least 0: a block is divided where R = G_max / G_min is larger
    intensity_step: float = 0.05  # tau: "adaptive" also divides where means of children differ by more
    refine: Refinement = None  # type: ignore[assignment]  # the default depends on the method

    def __post_init__(self) -> None:
        if self.refine is None:
            object.__setattr__(self, "refine", "scan" if self.method == "paper" else "tv")  # type: ignore[unreachable]
        if self.method not in ("paper", "adaptive"):
            raise ParameterError(f"a method is paper or adaptive, not {self.method!r}")
        if self.refine not in ("none", "pixels", "scan", "smooth", "tv"):
            raise ParameterError(f"a refinement is none, pixels, scan, smooth or tv, not {self.refine!r}")
        if not self.threshold >= 0:
            raise ParameterError(f"the threshold X of the division is at least 0, not {self.threshold:g}")
        if not 0 <= self.intensity_step <= 1:
            raise ParameterError(f"an intensity step lies in 0..1, not {self.intensity_step:g}")

    @property
    def decides_pixels(self) -> bool:
        """Whether grey, denoised or not, decides each pixel, and no leaf does."""
        return self.refine in PIXELWISE

    @property
    def division(self) -> DivisionParams:
        """X and tau; the paper's method has no intensity test."""
        return DivisionParams(self.threshold, self.intensity_step if self.method == "adaptive" else inf)


class Intervals(Protocol):
    """A partition of 0..1 into intervals."""

    @property
    def edges(self) -> tuple[float, ...]:
        """Edges between the intervals, increasing; an edge belongs to the interval below it."""


@checked
@dataclass(frozen=True, slots=True)
class IntensityRange:
    """A closed interval of v: both ends belong to it; IntensityRangeError if not 0 <= low < high <= 1."""

    low: float
    high: float

    def __post_init__(self) -> None:
        if not 0 <= self.low < self.high <= 1:
            raise IntensityRangeError(
                f"expected an intensity range with 0 <= low < high <= 1, got {self.low:g},{self.high:g}"
            )

    @property
    def edges(self) -> tuple[float, float]:
        """Edges of the three intervals: below the range, in it and above it."""
        return math.nextafter(self.low, -1.0), self.high

    @property
    def greys(self) -> tuple[int, int]:
        """Smallest and largest grey g whose v = g / 65535 lies in the range."""
        low = max(math.ceil(self.low * GREY_MAX) - 1, 0)
        high = min(math.floor(self.high * GREY_MAX) + 1, GREY_MAX)
        while low / GREY_MAX < self.low:
            low += 1
        while high / GREY_MAX > self.high:
            high -= 1
        return low, high


@checked
@dataclass(frozen=True, slots=True)
class StateLimits:
    """Probabilities of occupancy that separate free, unknown and occupied cells.

    The defaults are the paper's.

    Parameters
    ----------
    free_below : float
        A cell is free at this probability and below.
    occupied_above : float
        A cell is occupied above this probability, and unknown at it and down to the other limit.

    Raises
    ------
    ParameterError
        If not 0 <= free_below < occupied_above <= 1.

    Examples
    --------
    >>> StateLimits().of([0.2, 0.498, 0.5, 0.502, 0.503])
    array([1, 1, 2, 2, 3], dtype=uint8)
    """

    free_below: float = 0.498
    occupied_above: float = 0.502

    def __post_init__(self) -> None:
        if not 0 <= self.free_below < self.occupied_above <= 1:
            raise ParameterError(
                "expected limits of states with 0 <= free below < occupied above <= 1, "
                f"got {self.free_below:g} and {self.occupied_above:g}"
            )

    @property
    def edges(self) -> tuple[float, float]:
        """Both limits."""
        return self.free_below, self.occupied_above

    @checked
    def of(self, v: ArrayLike) -> Uint8s:
        """Return the state of each probability: 1 free, 2 unknown, 3 occupied."""
        return (np.searchsorted(self.edges, v) + FREE).astype(np.uint8)

    @property
    def table(self) -> Uint8s:
        """State of every grey g, whose v = g / 65535: a (65536,) uint8 array."""
        return self.of(np.arange(GREY_LEVELS) / GREY_MAX)


class _OfLevels:
    """Levels that cover 0..1, by the edges between them."""

    __slots__ = ()

    @property
    def count(self: Intervals) -> int:
        """Number of levels."""
        return len(self.edges) + 1

    @property
    def bounds(self: Intervals) -> tuple[float, ...]:
        """Edges with 0 and 1 at the ends: level k lies between bounds k and k + 1."""
        return (0.0, *self.edges, 1.0)


@checked
@dataclass(frozen=True, slots=True)
class Levels(_OfLevels):
    """Levels of equal width over 0..1; the last may be narrower.

    Level k, from 0, holds the values above k P up to (k + 1) P with P the `width`; level 0 also holds 0. A
    ParameterError says that the width is not above 0 and at most 1, or so small that there are more levels
    than greys.

    Examples
    --------
    >>> Levels(0.3).bounds
    (0.0, 0.3, 0.6, 0.9, 1.0)
    """

    width: float

    def __post_init__(self) -> None:
        if not 0 < self.width <= 1:
            raise ParameterError(f"the width of a level is above 0 and at most 1, not {self.width:g}")
        if 1 / self.width > GREY_MAX:
            why = f"levels of {self.width:g} are finer than the {GREY_LEVELS} greys"
            raise ParameterError(f"{why}; give a larger width")

    @property
    def edges(self) -> tuple[float, ...]:
        """Edges between levels."""
        return tuple(round(k * self.width, 12) for k in range(1, math.ceil(1 / self.width - 1e-9)))


_MAX_NAME = 80


@dataclass(frozen=True, slots=True)
class Partition:
    """Intervals between edges in 0..1, each with the number of a class."""

    edges: tuple[float, ...]  # increasing; a value on an edge belongs to the interval below it
    classes: tuple[int, ...]  # 1, 2, ..., or 0 for none; one more than there are edges
    bounds: tuple[float, ...]  # the requested ends of the intervals

    @property
    def count(self) -> int:
        """Number of classes."""
        return max(self.classes)

    @property
    def grey_table(self) -> Uint8s:
        """Class of every grey g, whose v = g / 65535: a (65536,) uint8 lookup table; at most 255 classes."""
        v = np.arange(GREY_LEVELS) / GREY_MAX
        return np.array(self.classes, np.uint8)[np.searchsorted(np.array(self.edges, np.float64), v)]


@checked
@dataclass(frozen=True, slots=True)
class Breaks(_OfLevels):
    """Levels between given edges over 0..1; a value on an edge belongs to the level below it.

    A ParameterError says that the edges do not increase, above 0 and below 1.

    Examples
    --------
    >>> Breaks((0.2, 0.5)).bounds
    (0.0, 0.2, 0.5, 1.0)
    """

    edges: tuple[float, ...]

    def __post_init__(self) -> None:
        if not all(low < high for low, high in pairwise(self.bounds)):
            given = ",".join(f"{edge:g}" for edge in self.edges)
            raise ParameterError(f"breaks increase, above 0 and below 1, such as 0.2,0.5; got {given}")
        if len(self.edges) >= GREY_MAX:
            most = f"no more than {GREY_MAX - 1} differ"
            raise ParameterError(f"there are {len(self.edges)} breaks, and {most}")


def partition_of_levels(levels: Levels | Breaks) -> Partition:
    """Return the partition whose classes are the levels, counted from 1."""
    return Partition(levels.edges, tuple(range(1, levels.count + 1)), levels.edges)


@dataclass(frozen=True, slots=True)
class ValueClass:
    """Class of ground: its name, its range of v, and the colour it is drawn in ("#rrggbb").

    A name that is empty, too long or not printable is refused with ParameterError.
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

    A range includes both its ends. Where two ranges share an end, it belongs to the lower of them. A
    ParameterError says that there are none or too many, two have the same name, or two overlap.

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
