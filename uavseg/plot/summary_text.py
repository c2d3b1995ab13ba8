"""Text reports of rasters, with a bar chart of the histogram, and of files of regions."""

import json
from pathlib import PurePath
from typing import Any

from uavseg.raster.summary import HISTOGRAM_BINS, Summary
from uavseg.regions.formats.metadata import RegionFile

_EIGHTHS = " ▏▎▍▌▋▊▉█"
_WIDTH = 40  # characters of the longest bar
_IN_OTHER_LINES = ("range_values", "unit", "stretch_low", "stretch_high")  # metadata in the line of another


def summary_text(summary: Summary) -> str:
    """Format a summary, one property per line."""
    megapixels, share = summary.rows * summary.cols / 1e6, summary.nodata_share
    percent = "none" if share == 0 else f"{100 * share:.2f} %" if share >= 0.0001 else "less than 0.01 %"
    looked_at = f"from a coarse look: {summary.counted} pixels of {summary.rows * summary.cols}"
    counted = f"all {summary.counted} counted" if summary.exact else looked_at
    rows = [
        ("file", _files(summary)),
        ("size", f"{summary.cols} x {summary.rows} pixels, {megapixels:.3g} megapixels; {summary.driver}"),
        ("CRS", _crs(summary)),
        ("ground", _ground(summary)),
        ("extent", _extent(summary.bounds)),
        ("centre", "" if summary.center is None else "lat {1:.6f}, lon {0:.6f}".format(*summary.center)),
        ("bands", _bands(summary)),
        ("intensity", f"{summary.used}, stretched by {summary.stretch}"),
        ("nodata", f"{percent} of the pixels ({counted})"),
        ("v", _moments(summary)),
        ("values", _values(summary)),
    ]
    lines = [f"{name:<10} {text}" for name, text in rows if text]
    notes = [f"note       {warning}" for warning in summary.warnings]
    command = ["", f"try        {summary.command}"] if summary.command else []
    bars = ["", *_bars(summary)] if summary.valid else []
    return "\n".join([*lines, *notes, *bars, *command])


def text_bar(share: float, width: int = _WIDTH) -> str:
    """Draw a bar of block characters whose length is a share of `width`, to an eighth of a character.

    Examples
    --------
    >>> text_bar(0.5, 4), text_bar(0.28125, 4), text_bar(0.0, 4)
    ('██', '█▏', '')
    """
    eighths = round(share * width * 8)
    return "█" * (eighths // 8) + _EIGHTHS[eighths % 8].strip()


def _bars(summary: Summary) -> list[str]:
    largest, total = max(*summary.histogram, 1), max(summary.valid, 1)
    values = [_bin_values(summary, n) for n in range(HISTOGRAM_BINS)]
    width = max(map(len, values))
    lines = []
    for n, count in enumerate(summary.histogram):
        drawn = text_bar(count / largest) or ("▏" if count else "")
        label = f"{n / HISTOGRAM_BINS:.2f}-{(n + 1) / HISTOGRAM_BINS:.2f}"
        lines.append(f"{label:<10} {values[n]:<{width}}{drawn:<{_WIDTH}} {100 * count / total:5.1f} %")
    return lines


def _files(summary: Summary) -> str:
    first, others = summary.paths[0], len(summary.paths) - 1
    if others == 0:
        return first
    return f"{first} and {others} more, one mosaic (the last: {PurePath(summary.paths[-1]).name})"


def _crs(summary: Summary) -> str:
    if summary.crs is None:
        local = "none: coordinates are local" + (" and in metres" if summary.in_metres else "")
        return local if summary.located else "none: coordinates are pixels"
    return summary.crs + (f" (EPSG:{summary.epsg})" if summary.epsg else "")


def _ground(summary: Summary) -> str:
    across, along = summary.resolution
    unit = "m" if summary.in_metres else "units"
    size = f"{across:.4g}" if abs(across / along - 1) < 1e-3 else f"{across:.4g} x {along:.4g}"
    return f"{size} {unit} per pixel; {across * summary.cols:.4g} x {along * summary.rows:.4g} {unit} in all"


def _extent(bounds: tuple[float, float, float, float] | None) -> str:
    if bounds is None:
        return ""
    left, bottom, right, top = (f"{value:.10g}" for value in bounds)
    return f"x {left} to {right}, y {bottom} to {top}"


def _bands(summary: Summary) -> str:
    nodatas = {nodata for _, _, nodata in summary.bands}
    shared = f", nodata {_decimal(nodatas.pop())}" if len(nodatas) == 1 and nodatas != {None} else ""
    named = zip(summary.bands, summary.names, strict=True)
    texts = []
    for n, ((dtype, color, nodata), name) in enumerate(named, start=1):
        own = f" (nodata {_decimal(nodata)})" if nodata is not None and not shared else ""
        texts.append(f"{n}: {dtype} {_band_name(color, name)}{own}")
    limit = 24 if any(summary.names) else 8
    shown = texts if len(texts) <= limit else [*texts[: limit - 1], f"... {len(texts)} in all"]
    return "; ".join(shown) + shared


def _band_name(color: str, name: str) -> str:
    """Return the names of a band, with its colour where they do not say it."""
    if not name:
        return color
    return name if color in (*name.split(", "), "undefined", "gray") else f"{name}, {color}"


def _moments(summary: Summary) -> str:
    if summary.valid == 0:
        return "there is no valid pixel" if summary.exact else "there is no valid pixel among those looked at"
    return f"mean {summary.mean:.3f}, standard deviation {summary.std:.3f}"


def _values(summary: Summary) -> str:
    """Return the values of v = 0 and 1, and how they are stored where that differs."""
    axis = summary.axis
    if axis is None or summary.valid == 0:
        return ""
    low, high = axis.values([0, 1]).tolist()
    unit, scale = f" {axis.unit}" if axis.unit else "", axis.scale
    stored = f" = {scale.scale:.10g} x stored + {scale.offset:.10g}"
    suffix = "" if (scale.scale, scale.offset) == (1, 0) else stored
    return f"v = 0 is {low:.6g}{unit}, v = 1 is {high:.6g}{unit}, mean {summary.mean_value:.6g}{unit}{suffix}"


def _bin_values(summary: Summary, n: int) -> str:
    if summary.axis is None or summary.valid == 0:
        return ""
    low, high = summary.axis.values([n / HISTOGRAM_BINS, (n + 1) / HISTOGRAM_BINS]).tolist()
    return f"{low:.5g} to {high:.5g}  "


def _decimal(value: float | None) -> str:
    return f"{value:.10g}" if value is not None else "none"


def region_file_text(file: RegionFile) -> str:
    """Format what a file of regions holds, and how they were made."""
    layer = "" if file.layer is None else f", layer {file.layer}"
    others = f" and {file.others} more" if file.others else ""
    rows = [
        ("file", file.path),
        ("format", f"{file.format}{layer}{others}"),
        ("regions", f"{file.regions:,} ({file.geometry})"),
        ("CRS", file.crs or "none: coordinates are local"),
        ("extent", _extent(file.bounds)),
        ("columns", ", ".join(file.columns)),
    ]
    lines = [f"{name:<16} {text}" for name, text in rows if text]
    if not file.metadata:
        return "\n".join([*lines, "", "The file does not say how its regions were made."])
    names = [name for name in file.metadata if name not in _IN_OTHER_LINES]
    made = [f"{name:<16} {_metadata_text(name, file.metadata)}" for name in names]
    return "\n".join([*lines, "", *made])


def _metadata_text(name: str, metadata: dict[str, Any]) -> str:
    value = metadata[name]
    if name == "range":
        values = metadata.get("range_values") or [None, None]
        unit = f" {metadata['unit']}" if isinstance(metadata.get("unit"), str) else ""
        known = "" if values == [None, None] else f"; values {_ends(values)}{unit}"
        return f"v {_ends(value)}{known}"
    if isinstance(value, list) and all(isinstance(part, str | int | float) for part in value):
        return ", ".join(map(_plain, value))
    return _plain(value)


def _ends(pair: Any) -> str:
    """Format an interval, open where an end is missing."""
    if not isinstance(pair, list) or len(pair) != 2:
        return _plain(pair)
    low, high = pair
    if low is None or high is None:
        return f"up to {_plain(high)}" if low is None else f"{_plain(low)} and more"
    return f"{_plain(low)} to {_plain(high)}"


def _plain(value: Any) -> str:
    if isinstance(value, str):
        return value
    return f"{value:.10g}" if isinstance(value, float) else json.dumps(value)
