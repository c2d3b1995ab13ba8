"""Drawing of outlines: smoothed and simplified, with attributes that stay those of the pixels."""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from uavseg.errors import ParameterError

if TYPE_CHECKING:
    from uavseg.raster.geobox import GeoBox
    from uavseg.regions.outline.rings import Rings
    from uavseg.regions.table import Regions


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
        If one of them is negative or not a number.
    """

    smooth_m: float | None = None
    simplify_m: float | None = None

    def __post_init__(self) -> None:
        for metres, what in ((self.smooth_m, "smoothed"), (self.simplify_m, "simplified")):
            if metres is not None and not 0 <= metres < float("inf"):
                raise ParameterError(f"outlines are {what} by metres that are not negative, not {metres:g}")

    def drawn(self, regions: "Regions", rings: "Rings", geobox: "GeoBox") -> "Regions":
        """The regions with their outlines drawn this way.

        Parameters
        ----------
        regions : Regions
        rings : Rings
            Their outlines on the pixel edges.
        geobox : GeoBox
        """
        if self.smooth_m:
            from uavseg.regions.shapes import Shapes
            from uavseg.regions.smooth.smooth_outlines import smoothed

            rings, geobox = smoothed(rings, self.smooth_m, geobox)
            regions = replace(regions, polygons=Shapes(rings, geobox.transform))
        if self.simplify_m:
            from uavseg.regions.edit.simplify import simplify

            regions = simplify(regions, self.simplify_m, geobox)
        return regions
