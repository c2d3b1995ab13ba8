"""Text report of a raster summary, with a bar chart of the histogram."""

from pathlib import PurePath

from uavseg.raster.summary import HISTOGRAM_BINS, Summary

_EIGHTHS = " ▏▎▍▌▋▊▉█"
_WIDTH = 40  # characters of the longest bar


def summary_text(summary: Summary) -> str:
    """A summary as text, one fact per line."""
    rows = [
        ("file", _files(summary)),
        ("size", f"{summary.cols} x {summary.rows} pixels, {_megapixels(summary)}; {summary.driver}"),
        ("CRS", _crs(summary)),
        ("ground", _ground(summary)),
        ("extent", _extent(summary)),
        ("centre", _center(summary)),
        ("bands", _bands(summary)),
        ("intensity", f"{summary.used}, stretched by {summary.stretch}"),
        ("nodata", f"{_percent(summary.nodata_share)} of the pixels ({_counted(summary)})"),
        ("v", _moments(summary)),
        ("values", _values(summary)),
    ]
    facts = [f"{name:<10} {text}" for name, text in rows if text]
    notes = [f"note       {warning}" for warning in summary.warnings]
    line = ["", f"try        {summary.command}"] if summary.command else []
    bars = ["", *_bars(summary)] if summary.valid else []
    return "\n".join([*facts, *notes, *bars, *line])


def text_bar(share: float, width: int = _WIDTH) -> str:
    """A bar of block characters whose length is a share of `width`, to an eighth of a character.

    Examples
    --------
    >>> text_bar(0.5, 4), text_bar(0.28125, 4), text_bar(0.0, 4)
    ('██', '█▏', '')
    """
    eighths = round(share * width * 8)
    return "█" * (eighths // 8) + _EIGHTHS[eighths % 8].strip()


def _bars(summary: Summary) -> list[str]:
    """One line for each bin of v."""
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


def _megapixels(summary: Summary) -> str:
    return f"{summary.rows * summary.cols / 1e6:.3g} megapixels"


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


def _extent(summary: Summary) -> str:
    left, bottom, right, top = (f"{value:.10g}" for value in summary.bounds)
    return f"x {left} to {right}, y {bottom} to {top}"


def _center(summary: Summary) -> str:
    if summary.center is None:
        return ""
    lon, lat = summary.center
    return f"lat {lat:.6f}, lon {lon:.6f}"


def _bands(summary: Summary) -> str:
    nodatas = {nodata for _, _, nodata in summary.bands}
    shared = f", nodata {_number(nodatas.pop())}" if len(nodatas) == 1 and nodatas != {None} else ""
    named = zip(summary.bands, summary.names, strict=True)
    texts = [
        f"{n}: {dtype} {_band_name(color, name)}"
        + (f" (nodata {_number(nodata)})" if nodata is not None and not shared else "")
        for n, ((dtype, color, nodata), name) in enumerate(named, start=1)
    ]
    most = 24 if any(summary.names) else 8
    shown = texts if len(texts) <= most else [*texts[: most - 1], f"... {len(texts)} in all"]
    return "; ".join(shown) + shared


def _band_name(color: str, name: str) -> str:
    """The names of a band, with its colour where they do not say it."""
    return (
        color
        if not name
        else name
        if color in (*name.split(", "), "undefined", "gray")
        else f"{name}, {color}"
    )


def _moments(summary: Summary) -> str:
    if summary.valid == 0:
        return "there is no valid pixel" if summary.exact else "there is no valid pixel among those looked at"
    return f"mean {summary.mean:.3f}, standard deviation {summary.std:.3f}"


def _values(summary: Summary) -> str:
    """The values of v = 0 and 1, and how they are stored where that is not as they are."""
    axis = summary.axis
    if axis is None or summary.valid == 0:
        return ""
    low, high = axis.values([0, 1]).tolist()
    unit, scale = f" {axis.unit}" if axis.unit else "", axis.scale
    stored = f" = {scale.scale:.10g} x stored + {scale.offset:.10g}"
    kept = "" if (scale.scale, scale.offset) == (1, 0) else stored
    return f"v = 0 is {low:.6g}{unit}, v = 1 is {high:.6g}{unit}, mean {summary.mean_value:.6g}{unit}{kept}"


def _bin_values(summary: Summary, n: int) -> str:
    """The values of a bin of the histogram."""
    if summary.axis is None or summary.valid == 0:
        return ""
    low, high = summary.axis.values([n / HISTOGRAM_BINS, (n + 1) / HISTOGRAM_BINS]).tolist()
    return f"{low:.5g} to {high:.5g}  "


def _number(value: float | None) -> str:
    return f"{value:.10g}" if value is not None else "none"


def _percent(share: float) -> str:
    return "none" if share == 0 else f"{100 * share:.2f} %" if share >= 0.0001 else "less than 0.01 %"


def _counted(summary: Summary) -> str:
    if summary.exact:
        return f"all {summary.counted} counted"
    return f"from a coarse look: {summary.counted} pixels of {summary.rows * summary.cols}"
