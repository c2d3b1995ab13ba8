"""Where v is cut into intervals: a range, the limits of states, levels.

Each of them cuts 0..1 at some edges. A value on an edge belongs to the interval below it.
"""

import math
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from uavseg.errors import IntensityRangeError, ParameterError
from uavseg.units import FREE, GREY_MAX

_MOST_LEVELS = 65535  # v has 65536 values


class Cut(Protocol):
    """What cuts 0..1 into intervals."""

    @property
    def edges(self) -> tuple[float, ...]:
        """Where it is cut, increasing; an edge belongs to the interval below it."""


@dataclass(frozen=True, slots=True)
class IntensityRange:
    """An interval of v with both ends in it.

    Raises
    ------
    IntensityRangeError
        If not 0 <= low < high <= 1.
    """

    low: float
    high: float

    def __post_init__(self) -> None:
        if not 0 <= self.low < self.high <= 1:
            raise IntensityRangeError(
                f"an intensity range wants 0 <= low < high <= 1, not {self.low:g},{self.high:g}"
            )

    @property
    def edges(self) -> tuple[float, float]:
        """Edges of what lies below the range, in it and above it."""
        return math.nextafter(self.low, -1.0), self.high

    @property
    def greys(self) -> tuple[int, int]:
        """The smallest and the largest grey g whose v = g / 65535 lies in the range."""
        low = max(math.ceil(self.low * GREY_MAX) - 1, 0)
        high = min(math.floor(self.high * GREY_MAX) + 1, GREY_MAX)
        while low / GREY_MAX < self.low:
            low += 1
        while high / GREY_MAX > self.high:
            high -= 1
        return low, high


@dataclass(frozen=True, slots=True)
class StateLimits:
    """What probability of being occupied makes a cell free, unknown or occupied: the paper's limits.

    Parameters
    ----------
    free_below : float
        Up to here, and here too, a cell is free.
    occupied_above : float
        Above here it is occupied; here, and down to the other limit, unknown.

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
                "the limits of the states want 0 <= free below < occupied above <= 1, "
                f"not {self.free_below:g} and {self.occupied_above:g}"
            )

    @property
    def edges(self) -> tuple[float, float]:
        """The two limits."""
        return self.free_below, self.occupied_above

    def of(self, v: Any) -> NDArray[np.uint8]:
        """The state of each probability: 1 free, 2 unknown, 3 occupied."""
        states: NDArray[np.uint8] = (np.searchsorted(self.edges, v) + FREE).astype(np.uint8)
        return states

    @property
    def table(self) -> NDArray[np.uint8]:
        """The state of every grey g, whose v = g / 65535: a (65536,) uint8 array."""
        return self.of(np.arange(GREY_MAX + 1) / GREY_MAX)


@dataclass(frozen=True, slots=True)
class Levels:
    """0..1 cut into levels of equal width, the last of which may be narrower.

    Parameters
    ----------
    width : float
        P. Level k, from 0, is what lies above k P and not above (k + 1) P; level 0 has 0 too.

    Raises
    ------
    ParameterError
        If the width is not above 0 and at most 1, or so small that there would be more levels than greys.

    Examples
    --------
    >>> Levels(0.3).bounds
    (0.0, 0.3, 0.6, 0.9, 1.0)
    """

    width: float

    def __post_init__(self) -> None:
        if not 0 < self.width <= 1:
            raise ParameterError(f"the width of a level is above 0 and at most 1, not {self.width:g}")
        if 1 / self.width > _MOST_LEVELS:
            raise ParameterError(
                f"levels of {self.width:g} are finer than grey is, which has {_MOST_LEVELS + 1} values; "
                "give a larger width"
            )

    @property
    def count(self) -> int:
        """Number of levels."""
        return math.ceil(1 / self.width - 1e-9)

    @property
    def edges(self) -> tuple[float, ...]:
        """The edges between levels."""
        return tuple(round(k * self.width, 12) for k in range(1, self.count))

    @property
    def bounds(self) -> tuple[float, ...]:
        """The edges with 0 and 1: level k lies between bounds k and k + 1."""
        return (0.0, *self.edges, 1.0)
