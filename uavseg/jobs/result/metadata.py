"""Metadata of regions: from what, by which method and with which parameters they were made.

It is the same for the same question on any day and machine: names are those that were given, and there is no
time in it.
"""

import math
import re
from collections.abc import Mapping
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

from uavseg._version import __version__
from uavseg.errors import ParameterError
from uavseg.jobs.ranges.ranges import DetectedRange
from uavseg.jobs.result.result import Drawing, Extraction
from uavseg.jobs.source.source import Blocks, Raster, Source
from uavseg.options.reading import ReadOptions
from uavseg.plain_text import printable
from uavseg.raster.grid.geobox import Length
from uavseg.raster.intensity.stretch import Stretch
from uavseg.raster.spectral.bands import ValueAxis
from uavseg.regions.edit.small import Area
from uavseg.segmentation.blocks.saved_blocks import Origin
from uavseg.segmentation.params.segment import SegmentParams

_BANDS = re.compile(
    r"band (\d{1,6})|luminance of bands (\d{1,6}),(\d{1,6}),(\d{1,6})"
)  # see `BandChoice.name`
# by what they result in
_SAID_OTHERWISE = (
    *("band", "rgb", "index", "expr", "band_names", "stretch"),
    *("skip_bad_tiles", "free_is_white", "collar", "flatten"),
)


def with_metadata(found: Extraction, source: Source, job: str, how: Mapping[str, Any]) -> Extraction:
    """Return a result whose regions say what they were made from, and how.

    `how` are the parameters of the job, as JSON has them; None is left out.
    """
    stretch = found.stretch
    facts = {
        "software": f"uavseg {__version__}",
        "job": job,
        "sources": _names(source),
        "band": found.band_names,
        **_reading(source),
        "stretch": stretch.name,
        "stretch_low": stretch.low,
        "stretch_high": stretch.high,
        **how,
    }
    known = {name: _plain(value) for name, value in facts.items() if value is not None}
    return replace(found, regions=replace(found.regions, metadata=known))


def same_reading(metadata: Mapping[str, Any], raster: Raster) -> ReadOptions | None:
    """Return the options that make of a raster the intensity that regions with some metadata were made from.

    None where the regions are of other files, or their metadata is not what `with_metadata` writes.
    """
    named = metadata.get("sources")
    ours = [Path(name).name for name in _names(raster)]
    if not isinstance(named, list) or [Path(str(name)).name for name in named] != ours:
        return None
    read = str(metadata.get("band"))
    bands = [int(number) for number in re.findall(r"\d+", read)] if _BANDS.fullmatch(read) else []
    try:
        ends = float(metadata["stretch_low"]), float(metadata["stretch_high"])
        return replace(
            raster.options,
            band=bands[0] if len(bands) == 1 else None,
            rgb=(bands[0], bands[1], bands[2]) if len(bands) == 3 else None,
            nodata=metadata.get("nodata"),
            stretch=Stretch(*ends, str(metadata.get("stretch"))),
            index=metadata.get("index"),
            expr=metadata.get("expr"),
            band_names=metadata.get("band_names"),
            flatten=metadata.get("flatten"),
        )
    except (KeyError, ValueError, TypeError, ParameterError):
        return None


def range_facts(detected: DetectedRange | None, axis: ValueAxis | None) -> dict[str, Any]:
    """Return a range of v, and of the raster's values with their unit; None at an open end."""
    if detected is None:
        return {}
    values = [None if math.isnan(end) else float(end) for end in detected.ends]
    metadata: dict[str, Any] = {"range": [detected.interval.low, detected.interval.high]}
    if axis is not None:
        metadata |= {"range_values": values, "unit": axis.unit or None}
    return metadata


def segment_facts(segment: SegmentParams) -> dict[str, Any]:
    """Return how blocks were divided and boundaries refined."""
    step = segment.intensity_step if segment.method == "adaptive" else None
    return {
        "method": segment.method,
        "threshold": segment.threshold,
        "intensity_step": step,
        "refine": segment.refine,
    }


def drawing_facts(
    drawing: Drawing,
    fill_holes: Area | None = None,
    min_area: Area | None = None,
    detail: Length | None = None,
) -> dict[str, Any]:
    """Return what was done to regions after they were outlined."""
    return {
        "detail": None if detail is None else str(detail),
        "fill_holes": _area(fill_holes),
        "min_area": _area(min_area),
        "smooth_outline_m": drawing.smooth_m,
        "simplify_m": drawing.simplify_m,
    }


def confidence_facts(minimum: float | None) -> dict[str, Any]:
    """Return which regions were left out because of their confidence."""
    return {} if minimum is None else {"min_confidence": minimum}


def _area(area: Area | None) -> str | None:
    return None if area is None else f"{area.value:.12g} {'pixels' if area.in_pixels else 'm2'}"


def _names(source: Source) -> tuple[str, ...]:
    """Return the files as they were named; of a block map, those that it was made from."""
    if isinstance(source, Blocks):
        return source.saved.origin.rasters
    given = source.given if isinstance(source, Raster) else ()
    return given or (source.name,)


def _reading(source: Source) -> dict[str, Any]:
    """Return what was chosen in place of what the files say, such as another nodata value."""
    if isinstance(source, Blocks):
        return {"nodata": source.saved.origin.nodata, **_of_origin(source.saved.origin)}
    if not isinstance(source, Raster):
        return {}
    chosen = {field.name: getattr(source.options, field.name) for field in fields(source.options)}
    others = {
        name: value
        for name, value in chosen.items()
        if name not in _SAID_OTHERWISE and not (isinstance(value, bool | tuple | None) and not value)
    }
    return others | _of_origin(source.origin)


def _of_origin(origin: Origin) -> dict[str, str | None]:
    """Return how intensity was made of bands, and whether there was a collar that counts as nodata."""
    words = origin.words
    collar = "nodata" if origin.collar == "auto" else None
    formula = {"index": words.index, "expr": words.expr, "band_names": words.names}
    return {**formula, "collar": collar, "flatten": origin.flatten}


def _plain(value: Any) -> Any:
    """Return a value as JSON has it: the same for 1 and 1.0, and text for what is not finite."""
    if isinstance(value, tuple | list):
        return list(map(_plain, value))
    if isinstance(value, float):
        if not math.isfinite(value):
            return str(value)
        return int(value) if value.is_integer() and abs(value) < 1e15 else float(value)
    return value if value is None or isinstance(value, bool | int) else printable(str(value))
