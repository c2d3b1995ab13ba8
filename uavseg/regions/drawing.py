"""Outline generalisation: smoothing, then simplification; attributes stay those of the pixels."""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from uavseg.errors import ParameterError

if TYPE_CHECKING:
    from uavseg.raster.geobox import GeoBox
    from uavseg.regions.outline.rings import Rings
    from uavseg.regions.table import Regions


@dataclass(frozen=True, slots=True)
class Drawing:
    """How outlines are smoothed and simplified; attributes stay those of the pixels.

    Parameters
    ----------
    smooth_m : float, optional
        Largest distance in metres of smoothed outlines from the pixel edges, at most half a pixel; smoothing
        comes first.
    simplify_m : float, optional
        Tolerance in metres of the simplification that follows, see `simplify`.

    Raises
    ------
    ParameterError
        If one of them is negative or not finite.
    """

    smooth_m: float | None = None
    simplify_m: float | None = None

    def __post_init__(self) -> None:
        for metres, what in ((self.smooth_m, "smoothed"), (self.simplify_m, "simplified")):
            if metres is not None and not 0 <= metres < float("inf"):
                raise ParameterError(f"outlines are {what} by metres that are not negative, not {metres:g}")

    def drawn(self, regions: "Regions", rings: "Rings", geobox: "GeoBox") -> "Regions":
        """The regions with their outlines smoothed and simplified.

        Parameters
        ----------
        regions : Regions
        rings : Rings
            Their outlines on the pixel edges.
        geobox : GeoBox
        """
        if self.smooth_m:
            from uavseg.regions.shapes import LazyPolygons
            from uavseg.regions.smooth.smooth_outlines import smooth_outlines

            rings, geobox = smooth_outlines(rings, self.smooth_m, geobox)
            regions = replace(regions, polygons=LazyPolygons(rings, geobox.transform))
        if self.simplify_m:
            from uavseg.regions.edit.simplify import simplify

            regions = simplify(regions, self.simplify_m, geobox)
        return regions
