"""Options of photographs from the air: the ground that they show, and their camera."""

from __future__ import annotations

from collections.abc import Sequence

from uavseg.options import texts
from uavseg.options.flights import Paths
from uavseg.options.option import Options, option


class PoseOptions(Options):
    """Ground."""

    dem: Paths = option(
        "Elevation model of the ground; may be repeated, for a mosaic.  [default: flat ground, as high as the "
        "place of takeoff]",
        metavar="DEM.tif",
        multiple=True,
        parse=texts.or_none,
        basic=True,
        label="Elevation model",
    )
    home: Sequence[float] | None = option(
        "Place of takeoff, and its metres above the sea. Give it where heights above takeoff are surer than "
        "altitudes, or are not known.",
        metavar="LAT,LON[,M]",
        parse=texts.numbers("--home is LAT,LON or LAT,LON,M in degrees and metres"),
        basic=True,
        label="Place of takeoff",
    )
