"""How sure regions are, and those that are too unsure left out."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from uavseg.errors import ParameterError
from uavseg.regions.confidence import (
    Parting,
    class_confidence_of,
    confidence_of,
    keep_confident,
    match_confidence_of,
    texture_confidence_of,
)
from uavseg.regions.outline.rings import RegionOutlines

COLUMN = "confidence"


def check_least(least: float | None, refine: str = "") -> None:
    """Check a minimum confidence before any work.

    Parameters
    ----------
    least : float, optional
    refine : str
        How regions are refined; those that end at block edges have no confidence.

    Raises
    ------
    ParameterError
        If it is not within 0 and 1, or there will be none to compare it with.
    """
    if least is None:
        return
    if not 0 <= least <= 1:
        raise ParameterError(f"a minimum confidence is within 0 and 1, not {least:g}")
    if refine == "none":
        raise ParameterError(
            "regions that end at block edges have no confidence; refine them, or leave the minimum "
            "confidence out"
        )


def nothing_sure(count: int, least: float | None) -> str:
    """The hint where all regions were left out because of their confidence."""
    regions = "the only region has" if count == 1 else f"all {count:,} regions have"
    return f"{regions} a confidence of less than {least:g}; a smaller minimum keeps more"


@dataclass(frozen=True, eq=False)
class Doubt:
    """The confidence of regions, and the least that is wanted.

    Parameters
    ----------
    confidence : (n,) float64 array
        0 to 1; NaN where it is not known.
    least : float, optional
    """

    confidence: NDArray[np.float64]
    least: float | None = None

    @classmethod
    def of(
        cls, outlined: RegionOutlines, ends: tuple[ArrayLike, ArrayLike], refine: str, least: float | None
    ) -> "Doubt":
        """Of regions, by the range of v that they were found with.

        Parameters
        ----------
        outlined : RegionOutlines
            With the sums of what the range is of.
        ends : (float, float) or two (n,) arrays
        refine : str
            With "none" the confidence is not known.
        least : float, optional
        """
        if refine == "none":
            return cls.unknown(outlined, least)
        return cls(confidence_of(outlined, *ends), least)

    @classmethod
    def of_matches(
        cls,
        outlined: RegionOutlines,
        alike: tuple[NDArray[np.float64], float],
        refine: str,
        least: float | None,
    ) -> "Doubt":
        """Of regions like a sample.

        Parameters
        ----------
        outlined : RegionOutlines
            With the sums of likeness.
        alike : pair of (n,) float64 array and float
            The similarity of each, and by how much color parts the sample from the raster.
        refine, least
            As of `of`.
        """
        if refine == "none":
            return cls.unknown(outlined, least)
        return cls(match_confidence_of(outlined, *alike), least)

    @classmethod
    def of_classes(
        cls,
        outlined: RegionOutlines,
        alike: tuple[NDArray[np.float64], NDArray[np.float64]],
        refine: str,
        least: float | None,
    ) -> "Doubt":
        """Of regions of classes that samples were given of.

        Parameters
        ----------
        outlined : RegionOutlines
            With the sums of likeness of each to its class.
        alike : two (n,) float64 arrays
            Of the class of each, the mean likeness of its samples, and by how much that exceeds the raster's.
        refine, least
            As of `of`.
        """
        if refine == "none":
            return cls.unknown(outlined, least)
        return cls(class_confidence_of(outlined, *alike), least)

    @classmethod
    def of_textures(
        cls,
        outlined: RegionOutlines,
        parting: Parting,
        refine: str,
        least: float | None,
    ) -> "Doubt":
        """Of regions whose texture is like a sample's.

        Parameters
        ----------
        outlined : RegionOutlines
        parting : Parting
            How clearly texture parts the sample from the raster.
        refine, least
            As of `of`.
        """
        if refine == "none":
            return cls.unknown(outlined, least)
        return cls(texture_confidence_of(outlined, parting), least)

    @classmethod
    def unknown(cls, outlined: RegionOutlines, least: float | None = None) -> "Doubt":
        """Of regions whose confidence is not known."""
        return cls(np.full(len(outlined.sums.counts), np.nan), least)

    def applied(self, outlined: RegionOutlines) -> tuple[RegionOutlines, NDArray[np.bool_]]:
        """The regions that are sure enough, numbered anew, and which were kept.

        Raises
        ------
        ParameterError
            If their confidence is not known, and a least one is wanted.
        """
        if self.least is None:
            return outlined, np.ones(len(self.confidence), bool)
        if np.isnan(self.confidence).any():
            raise ParameterError(
                "the confidence of these regions is not known, because they end at block edges; leave the "
                "minimum confidence out"
            )
        return keep_confident(outlined, self.confidence, self.least)
