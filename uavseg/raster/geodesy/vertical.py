"""Vertical coordinate reference systems: what heights are measured from, and in which unit."""

import warnings
from collections.abc import Callable
from functools import lru_cache
from typing import Any, Literal

import numpy as np

from uavseg.arrays import Floats
from uavseg.dataclass import dataclass
from uavseg.errors import RasterError
from uavseg.raster.geodesy.globe import parse_crs
from uavseg.warning_filters import changing_filters

SeaHeights = Callable[[Floats, Floats, Floats], Floats]
"""From longitude and latitude in degrees and ellipsoidal heights to heights above the sea, in metres."""

UNITS_M = {
    **dict.fromkeys(("m", "meter", "meters", "metre", "metres"), 1.0),
    **dict.fromkeys(("cm", "centimeter", "centimeters", "centimetre", "centimetres"), 0.01),
    **dict.fromkeys(("dm", "decimeter", "decimeters", "decimetre", "decimetres"), 0.1),
    **dict.fromkeys(("ft", "foot", "feet", "international foot", "international feet"), 0.3048),
    **dict.fromkeys(("us survey foot", "us survey feet", "ftus", "us-ft", "ft-us", "us-foot"), 1200 / 3937),
    **dict.fromkeys(("foot_us", "us_survey_foot", "us foot", "us feet", "us_foot"), 1200 / 3937),
}
"""Metres in a unit of heights, by its names in files (in lower case)."""


@dataclass(frozen=True, slots=True)
class VerticalReference:
    """What heights are measured from.

    That is a geoid or the level of a tide gauge, or the ellipsoid, as satellite positioning has it at first.
    """

    zero: Literal["sea", "ellipsoid", "unknown"] = "unknown"
    name: str = ""  # the name of the vertical CRS, such as "EGM96 height"; empty where there is none
    unit_m: float | None = None  # metres in a unit; None where the CRS does not say


def vertical_reference(wkt: str) -> VerticalReference:
    """Return the vertical part of a CRS, which is compound or has three axes; unknown where there is none.

    A RasterError says that its axis points down: it holds depths.

    Examples
    --------
    >>> from pyproj import CRS
    >>> vertical_reference(CRS("EPSG:26918+6360").to_wkt()).name
    'NAVD88 height (ftUS)'
    >>> vertical_reference(CRS("EPSG:4979").to_wkt()).zero, vertical_reference(CRS("EPSG:4326").to_wkt()).zero
    ('ellipsoid', 'unknown')
    """
    crs = parse_crs(wkt)
    parts = [part for part in crs.sub_crs_list if part.is_vertical]
    vertical, axes = (parts[0], parts[0].axis_info) if parts else (crs, crs.axis_info[2:])
    if not axes:
        return VerticalReference()
    if axes[0].direction.lower() == "down":
        raise RasterError(f"it holds depths below {vertical.name}, not heights")
    ellipsoidal = not parts or "ellipsoid" in vertical.name.lower()
    unit_m = float(axes[0].unit_conversion_factor) or None
    return VerticalReference("ellipsoid" if ellipsoidal else "sea", str(vertical.name), unit_m)


@lru_cache(maxsize=32)
def horizontal_crs(wkt: str) -> Any:
    """Return the pyproj CRS of the plane or globe alone, without heights."""
    crs = parse_crs(wkt)
    parts = [part for part in crs.sub_crs_list if not part.is_vertical]
    return parts[0] if parts else crs.to_2d()


def sea_from_ellipsoid() -> SeaHeights | None:
    """Return the conversion of ellipsoidal heights (WGS 84) to heights above the geoid EGM96.

    None where PROJ has no grid of the geoid on this machine.
    """
    from pyproj import network
    from pyproj.transformer import TransformerGroup

    before = network.is_network_enabled()
    network.set_network_enabled(False)
    try:
        with changing_filters():
            warnings.simplefilter("ignore", UserWarning)  # that the grid is missing: see the result
            group = TransformerGroup("EPSG:4979", "EPSG:4326+5773", always_xy=True, allow_ballpark=False)
    finally:
        network.set_network_enabled(before)
    if not group.transformers:
        return None
    transformer = group.transformers[0]

    def heights(lon: Floats, lat: Floats, height_m: Floats) -> Floats:
        return np.asarray(transformer.transform(lon, lat, height_m)[2], np.float64)

    return heights
