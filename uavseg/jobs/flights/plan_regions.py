"""Regions and keep-out zones of a plan, in degrees, from whatever holds them."""

import os
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from uavseg.errors import ParameterError
from uavseg.execution.executors import phase
from uavseg.plain_text import shown
from uavseg.regions.table import Regions

if TYPE_CHECKING:
    from geopandas import GeoDataFrame

    from uavseg.jobs.source.source import Source


def open_regions(
    source: "str | os.PathLike[str] | bytes | GeoDataFrame | Regions", layer: str | None = None
) -> Regions:
    """Return regions in degrees from a file (a layer of it), the content of one, a frame or another job.

    A RegionError says that the file cannot be read, has no polygons or not only polygons, or no coordinate
    system.
    """
    if isinstance(source, Regions):
        return in_degrees(source)
    from uavseg.regions.formats import read

    if isinstance(source, str | os.PathLike | bytes):
        with phase("reading of regions"):
            return read.read_regions(source, layer)
    if not hasattr(source, "geometry") or not hasattr(source, "columns"):
        raise ParameterError(f"regions is a file of polygons or a GeoDataFrame, not {shown(source)}")
    return read.regions_of_frame(source)


def in_degrees(regions: Regions) -> Regions:
    """Return regions of a raster in WGS 84, with the coordinates that GeoJSON gets.

    OutputError is raised if they have no place on the Earth.
    """
    from uavseg.regions.wgs84.to_wgs84 import wgs84_geometries

    polygons: Any = wgs84_geometries(regions)
    return replace(regions, polygons=polygons, wkt="EPSG:4326")


def zone_polygons(avoid: Sequence[Any], raster: "Source | None" = None) -> list[Any]:
    """Return polygons in degrees of keep-out zones: files, frames, regions, or ranges of intensity.

    A range stands for its regions in the raster. A RegionError says that a file cannot be read, a
    ParameterError that there is a range and no raster, or that a range is wrong or finds nothing to keep out
    of, an OutputError that the raster has no place on the Earth.
    """
    result: list[Any] = []
    for zone in avoid:
        is_range = isinstance(zone, tuple | list)
        result += list((_in_range(zone, raster) if is_range else open_regions(zone)).polygons)
    return result


def _in_range(ends: Sequence[Any], raster: "Source | None") -> Regions:
    """Return the regions of a raster in a range of intensity."""
    from uavseg.jobs.extract import ExtractRequest, extract
    from uavseg.segmentation.params.segment import IntensityRange

    if len(ends) != 2:
        raise ParameterError(f"a range of intensity is two numbers, such as 0,0.2, not {shown(ends)}")
    if raster is None:
        raise ParameterError(
            f"the keep-out zones {ends[0]:g},{ends[1]:g} are a range of intensity; name the raster in which "
            "they are looked for (--raster)"
        )
    interval = IntensityRange(float(ends[0]), float(ends[1]))
    found = extract(raster, ExtractRequest(interval)).regions
    if not len(found):
        raise ParameterError(
            f"no region of {raster.name} has a mean v in the range {interval.low:g},{interval.high:g} of "
            "--avoid, so there is nothing to keep out of; uavseg info shows which v there are"
        )
    return in_degrees(found)
