"""Options of the jobs that describe regions and name them: describe, recognise."""

from __future__ import annotations

from collections.abc import Sequence

from uavseg.options import texts
from uavseg.options.option import argument, group, option
from uavseg.options.reading import MAP_STRETCH, ONLY_RASTERS, ReadOptions
from uavseg.options.running import TiledJobOptions


class DescribeOptions(TiledJobOptions):
    """Description."""

    source: str = argument("REGIONS|MAP", required=True)
    output: str | None = option(
        "The regions with their measures: .gpkg, .geojson, .fgb, .parquet, .shp or .kml.",
        *("-o", "--output"),
        required=True,
        metavar="PATH",
        python=False,
        basic=True,
    )
    raster: str | None = option(
        "Of REGIONS: measure texture and bands of this raster too.", metavar="RASTER", basic=True
    )
    layer: str | None = option("The layer of REGIONS, if the file has several.", metavar="NAME")
    gap: float = option(
        "Of MAP: objects nearer to each other than this are one.",
        default=0.0,
        type=float,
        metavar="METRES",
        basic=True,
        label="Join objects nearer than (m)",
    )
    min_area: float | str | None = option(
        "Of MAP: leave out objects of less.", metavar="M2|Npx", basic=True, label="Smallest object"
    )
    read: ReadOptions = group(ReadOptions, *ONLY_RASTERS, "index", "expr", "band_names", **MAP_STRETCH)


class RecogniseOptions(DescribeOptions):
    """Recognition."""

    output: str | None = option(
        "The regions with their names: .gpkg, .geojson, .fgb, .parquet, .shp or .kml.",
        *("-o", "--output"),
        metavar="PATH",
        python=False,
        basic=True,
    )
    library: str = option(
        "Described examples with a column 'name', such as --learn writes (.gpkg).",
        required=True,
        metavar="LIBRARY",
        basic=True,
    )
    learn: str | None = option(
        "Add regions to the library as examples of this name, instead of naming them.",
        metavar="NAME",
        basic=True,
    )
    ids: Sequence[int] | None = option(
        "With --learn: the ids of these regions.", metavar="N,N,...", parse=texts.ids, basic=True
    )
    min_probability: float = option(
        "Below it, the name is 'cannot tell'.", default=0.5, type=float, metavar="P", basic=True
    )
