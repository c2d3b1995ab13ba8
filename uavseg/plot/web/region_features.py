"""Regions of any origin as GeoJSON features in WGS 84."""

import math
import os
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from uavseg.jobs.flights.plan_regions import open_regions
from uavseg.jobs.result.result import SourceInfo
from uavseg.jobs.web_map.content import STEPS
from uavseg.regions.formats.about_file import about_file
from uavseg.regions.formats.metadata import METADATA_KEY

DEFAULT_RANGE = (550, 1000)
_DECIMALS = 9  # of degrees: a tenth of a millimetre


def read_collection(regions: Any) -> dict[str, Any]:
    """Regions of a file or a GeoDataFrame as a GeoJSON FeatureCollection in WGS 84.

    Parameters
    ----------
    regions : path or GeoDataFrame

    Returns
    -------
    collection : dict
        With the metadata of the regions, where they have some, as in a GeoJSON file.

    Raises
    ------
    RegionError
        If they cannot be read or have no place on Earth.
    ParameterError
        If they are neither a file nor a GeoDataFrame.
    """
    found = open_regions(regions)
    columns = {name: _values(column) for name, column in found.columns.items()}
    rounded = shapely.transform(shapely.orient_polygons(found.polygons), lambda xy: xy.round(_DECIMALS))
    features = [
        {
            "type": "Feature",
            "properties": {name: values[n] for name, values in columns.items()},
            "geometry": shapely.geometry.mapping(polygon),
        }
        for n, polygon in enumerate(rounded)
    ]
    is_path = isinstance(regions, str | os.PathLike)
    made = about_file(regions).metadata if is_path else regions.attrs.get(METADATA_KEY)
    return {"type": "FeatureCollection", **({METADATA_KEY: made} if made else {}), "features": features}


def other_intensity(collection: dict[str, Any] | None, info: SourceInfo) -> str | None:
    """A note where regions say that they were made from another intensity than a page shows."""
    made = (collection or {}).get(METADATA_KEY, {})
    stretch = info.stretch
    theirs = made.get("band"), made.get("stretch_low"), made.get("stretch_high")
    if None in theirs or theirs == (info.band_names, stretch.low, stretch.high):
        return None
    return (
        f"the regions were made from {made['band']}, stretch {made.get('stretch')}; the slider shows "
        f"{info.band_names}, stretch {stretch.name}, where their range means something else"
    )


def first_range(collection: dict[str, Any] | None, info: SourceInfo) -> tuple[int, int]:
    """Where the slider begins, in steps: the range of all regions, where it is one of the intensity shown."""
    if other_intensity(collection, info):
        return DEFAULT_RANGE
    features = [] if collection is None else collection["features"]
    found = {tuple(one["properties"].get(name) for name in ("range_low", "range_high")) for one in features}
    if len(found) != 1:
        return DEFAULT_RANGE
    [ends] = found
    if not all(isinstance(end, float | int) and 0 <= end <= 1 for end in ends):
        return DEFAULT_RANGE
    low, high = (round(end * STEPS) for end in ends)
    low = min(low, STEPS - 1)
    return low, max(high, low + 1)  # the ends of the slider are never the same


def _values(column: NDArray[Any]) -> list[Any]:
    """Values as JSON has them: floats with up to twelve significant digits; other kinds as text."""
    return [_value(value) for value in np.asarray(column).tolist()]


def _value(value: Any) -> Any:
    if isinstance(value, float):
        return float(f"{value:.12g}") if math.isfinite(value) else None
    return value if value is None or isinstance(value, bool | int | str) else str(value)
