"""Ranges: plain things on a plain ground are found to the pixel, both ends of a range included."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import rasterio
from numpy.typing import NDArray

import uavseg
from tests.honest import plain
from tests.honest.findings import differ, unlike
from tests.honest.picture import DTYPES, SPANS, Picture, any_layout, as_type, quiet, write_tiff
from tests.hostile.judging import Finding
from uavseg.segmentation.params.segment import SegmentParams

LEVELS = (0.0, 0.1, 0.2, 0.25, 0.3, 0.5, 0.6, 0.75, 0.9, 1.0)


def has_pixels() -> bool:
    """Whether pixels can be classified by their own values alone."""
    try:
        return SegmentParams(refine="pixels").refine == "pixels"
    except ValueError:
        return False


def plain_things(rng: Random, shape: tuple[int, int]) -> NDArray[np.float64]:
    """Rectangles of 48 pixels and more that keep 48 pixels apart, each of one value."""
    field = np.full(shape, rng.choice(LEVELS))
    for row in range(0, shape[0], 128):
        for col in range(0, shape[1], 128):
            down, right = (_stretch(rng, start, size) for start, size in zip((row, col), shape, strict=True))
            field[down, right] = rng.choice(LEVELS)
    return field


def _stretch(rng: Random, start: int, size: int) -> slice:
    """One side of a rectangle, which leaves no strip of less than 3 pixels at the edge."""
    first = start + rng.randint(3, 24)
    last = first + rng.randint(48, 56)
    return slice(first, last if last + 3 <= size else size)


def case(rng: Random, folder: Path) -> Iterator[Finding]:
    """Things of known values, asked for by v or in values, with the ends of the range on some of them."""
    shape = rng.choice([64, 100, 128, 200, 256, 257]), rng.choice([64, 100, 128, 200, 256, 300])
    dtype = rng.choice(DTYPES)
    span = rng.choice(SPANS[dtype])
    values = as_type(plain_things(rng, shape), span, dtype)
    picture = Picture(values[np.newaxis], np.ones(shape, bool), span)
    picture = replace(picture, by="all")
    how = {} if rng.random() < 0.5 else any_layout(rng, picture)
    if str(how.get("compress", "")).startswith(("jpeg", "lerc", "webp")):
        how = {}
    write_tiff(folder / "x.tif", picture, how)
    scale, offset = (
        (rng.choice([0.1, 2.0, -1.0, 0.0001]), rng.choice([0.0, -273.15, 7.0]))
        if rng.random() < 0.3
        else (1.0, 0.0)
    )
    if (scale, offset) != (1.0, 0.0):
        with quiet(), rasterio.open(folder / "x.tif", "r+") as file:
            file.scales, file.offsets = (scale,), (offset,)
    yield from requested(rng, folder / "x.tif", values, span, scale, offset)


def requested(
    rng: Random, path: Path, values: Any, span: tuple[float, float], scale: float, offset: float
) -> Iterator[Finding]:
    """A range in v or in values."""
    known = np.unique(values).tolist()
    low, high = sorted(rng.choices(known, k=2)) if rng.random() < 0.7 else (known[0], rng.choice(known))
    if low == high and len(known) > 1 and rng.random() < 0.8:
        low, high = known[0], known[1]
    dtype, how = values.dtype.name, {"collar": "keep", "threads": 1}
    if has_pixels() and rng.random() < 0.5:
        how["refine"] = "pixels"
    kind = rng.choice(["values", "values", "open", "v"])
    numbers = values.astype(np.float64)
    if kind == "v":
        ends = (
            (0.0, float(np.iinfo(dtype).max))
            if dtype in ("uint8", "uint16")
            else (float(span[0]), float(span[1]))
        )
        stretch = (
            "dtype"
            if dtype in ("uint8", "uint16")
            else "none"
            if span == (0.0, 1.0)
            else f"{ends[0]!r},{ends[1]!r}"
        )
        v = (numbers - ends[0]) / (ends[1] - ends[0])
        bounds = sorted(((float(one) - ends[0]) / (ends[1] - ends[0])) for one in (low, high))
        if not 0 <= bounds[0] < bounds[1] <= 1:
            return
        expected = (v >= bounds[0]) & (v <= bounds[1])
        how |= {"range": (bounds[0], bounds[1]), "stretch": stretch}
        about = f"v {dtype} {stretch}"
    else:
        scaled = numbers * scale + offset
        steps = np.abs(np.diff(np.array(known, np.float64) * scale + offset))
        if len(known) > 1 and steps.min() < 1e-9 * np.abs(scaled).max():
            return  # the offset hides the differences
        first, last = sorted((float(low) * scale + offset, float(high) * scale + offset))
        if kind == "open":
            how["values"] = rng.choice([(first, None), (None, last)])
            expected = scaled >= first if how["values"][1] is None else scaled <= last
        else:
            how["values"] = (first, last)
            expected = (scaled >= first) & (scaled <= last)
            if first == last:
                return
        about = f"{kind} {dtype}{'' if (scale, offset) == (1.0, 0.0) else ' scaled'}"
    found = uavseg.extract(path, **how)
    with quiet(), rasterio.open(path) as file:
        transform = file.transform
    covered = plain.drawn_pixels(found.geometry, values.shape, transform)
    yield from unlike("THRESHOLD", about, covered, expected.astype(np.uint8))
    yield from differ("PIXELS", about, int(found["pixels"].sum()), int(np.count_nonzero(covered)))
