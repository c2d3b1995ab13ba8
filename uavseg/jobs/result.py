"""Extraction: regions, and what is needed to tell of them and to paint them."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from uavseg.errors import ParameterError
from uavseg.raster.geobox import GeoBox
from uavseg.raster.intensity.stretch import Stretch
from uavseg.regions.edit.simplify import simplify
from uavseg.regions.outline.region_outlines import RegionOutlines
from uavseg.regions.outline.rings import Rings
from uavseg.regions.shapes import LazyPolygons
from uavseg.regions.smooth.smooth_outlines import smooth_outlines
from uavseg.regions.table import Regions, make_regions
from uavseg.segmentation.blocks.block_file import SavedBlocks
from uavseg.segmentation.source import GreySource


@dataclass(frozen=True)
class Extraction:
    """Regions, and what is needed to tell of them and to paint them.

    Parameters
    ----------
    regions : Regions
    rings : Rings
        Their outlines on pixel edges, neither smoothed nor simplified.
    geobox : GeoBox
        Of the raster.
    stretch : Stretch
        The one that was used.
    band_names : str
    warnings : tuple of str
    """

    regions: Regions
    rings: Rings
    geobox: GeoBox
    stretch: Stretch
    band_names: str
    warnings: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Drawing:
    """How outlines are drawn; attributes stay those of the pixels.

    Parameters
    ----------
    smooth_m : float, optional
        Outlines without stairs, within this many metres of the pixel edges and within half a pixel of them;
        this comes first.
    simplify_m : float, optional
        Outlines keep within about this many metres of what they are then.

    Raises
    ------
    ParameterError
        If one of them is negative or no number.
    """

    smooth_m: float | None = None
    simplify_m: float | None = None

    def __post_init__(self) -> None:
        for metres, what in ((self.smooth_m, "smoothed"), (self.simplify_m, "simplified")):
            if metres is not None and not 0 <= metres < float("inf"):
                raise ParameterError(f"outlines are {what} by metres that are not negative, not {metres:g}")

    def drawn(self, regions: Regions, rings: Rings, geobox: GeoBox) -> Regions:
        """The regions with their outlines drawn so; `rings` are these outlines on the pixel edges."""
        if self.smooth_m:
            rings, geobox = smooth_outlines(rings, self.smooth_m, geobox)
            regions = replace(regions, polygons=LazyPolygons(rings, geobox.transform))
        return simplify(regions, self.simplify_m, geobox) if self.simplify_m else regions


@dataclass(frozen=True, slots=True)
class About:
    """What is told of a raster together with its regions.

    Parameters
    ----------
    name : str
        Without folder.
    geobox : GeoBox
    stretch : Stretch
    band_names : str
    warnings : tuple of str
    """

    name: str
    geobox: GeoBox
    stretch: Stretch
    band_names: str
    warnings: tuple[str, ...]

    @classmethod
    def source(cls, source: GreySource) -> "About":
        """About a raster that is at hand."""
        dataset, stretch = source.dataset, source.stretch
        told = dataset.warnings + stretch.warnings
        return cls(dataset.source, dataset.geobox, stretch, dataset.band_names, told)

    @classmethod
    def saved(cls, saved: SavedBlocks) -> "About":
        """About the raster that a block map was made from."""
        name = saved.origin.rasters[0].rsplit("/", 1)[-1]
        return cls(name, saved.geobox, saved.stretch, saved.band_names, saved.stretch.warnings)


def measured(
    outlined: RegionOutlines,
    about: About,
    low: ArrayLike,
    high: ArrayLike,
    drawing: Drawing = Drawing(),
    more: Mapping[str, NDArray[Any]] = {},
) -> Extraction:
    """Regions with their attributes.

    Parameters
    ----------
    outlined : RegionOutlines
    about : About
    low, high : float or (n,) array
        The interval of intensity of all regions, or of each.
    drawing : Drawing
        How their outlines are drawn.
    more : mapping of str to (n,) array
        Columns that come after the id.
    """
    rings, sums = outlined.rings, outlined.sums
    pixels = np.bincount(rings.labels, rings.pixel_areas(), len(sums.counts) + 1)[1:].astype(np.int64)
    regions = make_regions(rings, sums, about.geobox, (low, high), about.name, pixels)
    columns = {"id": regions.columns["id"], **more} | regions.columns
    regions = drawing.drawn(replace(regions, columns=columns), rings, about.geobox)
    return Extraction(regions, rings, about.geobox, about.stretch, about.band_names, about.warnings)
