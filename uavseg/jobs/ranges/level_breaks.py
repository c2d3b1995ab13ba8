"""Breaks between levels chosen from the raster: multi-level Otsu thresholds, or quantiles."""

from collections.abc import Sequence
from typing import Literal, get_args

import numpy as np

from uavseg.arrays import Integers
from uavseg.dataclass import dataclass
from uavseg.errors import ParameterError, RasterError
from uavseg.segmentation.blocks.block_map import BlockMap
from uavseg.segmentation.blocks.leaves import histogram_of_means
from uavseg.segmentation.params.segment import Breaks, DivisionParams
from uavseg.segmentation.range_choice import MAX_CLASSES, propose_ranges
from uavseg.units import GREY_MAX

BreakRule = Literal["otsu", "quantile"]
_QUANTILES = 5
_MAX_QUANTILES = 100


@dataclass(frozen=True, slots=True)
class BreakChoice:
    """How many levels, and the rule for the breaks between them, from the means of leaves.

    With "otsu" the variance within levels is smallest, as `suggest` has it: 2 to 8 levels, by default as many
    as valleys of the histogram separate. With "quantile" each has the same number of pixels: 2 to 100, by
    default 5. A ParameterError says that one of them is not allowed.
    """

    rule: BreakRule
    count: int | None = None  # of levels

    def __post_init__(self) -> None:
        if self.rule not in get_args(BreakRule):
            raise ParameterError(
                f"breaks are numbers such as 0.2,0.5, otsu, otsu:3, quantile or quantile:4, not {self.rule!r}"
            )
        most = MAX_CLASSES if self.rule == "otsu" else _MAX_QUANTILES
        if self.count is not None and not 2 <= self.count <= most:
            raise ParameterError(f"levels by {self.rule} are 2 to {most} in number, not {self.count}")

    def breaks(self, blocks: BlockMap, division: DivisionParams) -> Breaks:
        """Return the breaks that a block map gives; raise RasterError if it has no valid pixel."""
        histogram = histogram_of_means(blocks, division)
        if not histogram.any():
            raise RasterError("no pixel is valid, so there are no breaks; look at nodata with uavseg info")
        if self.rule == "otsu":
            return Breaks(propose_ranges(histogram, self.count).edges)
        return Breaks(quantile_breaks(histogram, self.count or _QUANTILES))


def quantile_breaks(histogram: Integers, count: int) -> tuple[float, ...]:
    """Return breaks below which 1 / count, 2 / count, ... of the pixels lie; fewer where many have one value.

    The histogram, (65536,), is of pixels by grey.

    Examples
    --------
    >>> histogram = np.zeros(65536, np.int64)
    >>> histogram[[6000, 20000, 40000, 60000]] = 1
    >>> quantile_breaks(histogram, 2)
    (0.4,)
    """
    below = np.cumsum(histogram)
    wanted = np.array([-(-k * int(below[-1]) // count) for k in range(1, count)])
    greys = np.unique(np.searchsorted(below, wanted))
    greys = greys[below[greys] < below[-1]]  # the last grey belongs to the last level
    occupied = np.flatnonzero(histogram)
    after = occupied[np.searchsorted(occupied, greys, "right")]
    return tuple(_break_between(*pair) for pair in zip(greys.tolist(), after.tolist(), strict=True))


def _break_between(low: int, high: int) -> float:
    """Return the number above 0 of the fewest decimals from a grey on that is not nearer to a higher one."""
    for decimals in range(1, 7):  # six decimals, a fifteenth of a grey, always do
        unit = 10**decimals
        found = max(-(-low * unit // GREY_MAX), 1) / unit
        if found < (high - 0.5) / GREY_MAX:
            break
    return float(found)


def breaks_of(breaks: Sequence[float] | str | None) -> Breaks | BreakChoice:
    """Return breaks: numbers (as text between commas too), otsu or quantile, perhaps with a number of levels.

    ParameterError is raised if it is none of them.

    Examples
    --------
    >>> breaks_of("otsu:3"), breaks_of("0.2,0.5")
    (BreakChoice(rule='otsu', count=3), Breaks(edges=(0.2, 0.5)))
    """
    if breaks is not None and not isinstance(breaks, str):
        return Breaks(tuple(float(one) for one in breaks))
    text = breaks or ""
    rule, _, count = text.strip().partition(":")
    try:
        if rule in get_args(BreakRule):
            return BreakChoice(rule, int(count) if ":" in text else None)  # type: ignore[arg-type]
        return Breaks(tuple(float(part) for part in text.split(",")))
    except ValueError as error:
        if isinstance(error, ParameterError):
            raise
        raise ParameterError(
            f"breaks are numbers such as 0.2,0.5, otsu, otsu:3, quantile or quantile:4, not {text!r}"
        ) from None
