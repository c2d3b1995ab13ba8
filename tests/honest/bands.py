"""Bands, indices and band arithmetic: the mean of v is that of numpy over the bands of the file."""

from collections.abc import Iterator
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import rasterio
from rasterio.enums import ColorInterp

import uavseg
from tests.honest import plain
from tests.honest.findings import far, unlike
from tests.honest.patterns import any_pattern, holes
from tests.honest.picture import SPANS, any_shape, as_type, quiet
from tests.hostile.judging import Finding

NAMES = ("blue", "green", "red", "nir")
EXPRESSIONS = {  # text, and what it is by numpy: a value where all of its bands are valid
    "(nir - red) / (nir + red)": lambda b: (b["nir"] - b["red"]) / (b["nir"] + b["red"]),
    "b4 / (b1 + 1)": lambda b: b["nir"] / (b["blue"] + 1),
    "0.5 * green + 0.5 * red": lambda b: 0.5 * b["green"] + 0.5 * b["red"],
    "b2 - b3": lambda b: b["green"] - b["red"],
    "nir": lambda b: b["nir"],
}
INDICES = {
    "ndvi": lambda b: (b["nir"] - b["red"]) / (b["nir"] + b["red"]),
    "ndwi": lambda b: (b["green"] - b["nir"]) / (b["green"] + b["nir"]),
}


def case(rng: Random, folder: Path) -> Iterator[Finding]:
    """Four bands, asked for one of them, three, an index or a formula."""
    shape = any_shape(rng, 257)
    dtype = rng.choice(["uint8", "uint16", "int16", "float32"])
    span = (0.0, 1.0) if dtype == "float32" else rng.choice([ends for ends in SPANS[dtype] if ends[0] >= 0])
    values = np.stack([as_type(any_pattern(rng, shape), span, dtype) for _ in NAMES])
    valid, nodata = np.ones(shape, bool), None
    if rng.random() < 0.4:
        valid, nodata = holes(rng, shape), {"uint8": 0, "uint16": 0, "int16": -9999}.get(dtype, -1.0)
        values[values == nodata] += 1
        values[:, ~valid] = nodata
    crs, transform = "EPSG:32633", rasterio.Affine(1, 0, 500000, 0, -1, 4500000)
    profile = {"driver": "GTiff", "dtype": dtype, "count": 4, "height": shape[0], "width": shape[1]}
    how = {"nodata": nodata, "crs": crs, "transform": transform, "interleave": rng.choice(["pixel", "band"])}
    order = rng.sample(range(4), 4) if rng.random() < 0.5 else [0, 1, 2, 3]  # of the bands in the file
    with quiet(), rasterio.open(folder / "x.tif", "w", **profile | how) as file:
        file.write(values[order])
        file.colorinterp = [
            {"blue": ColorInterp.blue, "green": ColorInterp.green, "red": ColorInterp.red}.get(
                NAMES[n], ColorInterp.undefined
            )
            for n in order
        ]
        for number, n in enumerate(order, start=1):
            file.set_band_description(number, NAMES[n])
    yield from requested(rng, folder / "x.tif", values.astype(np.float64), valid, transform, order, span)


def requested(
    rng: Random,
    path: Path,
    values: Any,
    valid: Any,
    transform: Any,
    order: list[int],
    span: tuple[float, float],
) -> Iterator[Finding]:
    """One question to the bands."""
    bands = dict(zip(NAMES, values, strict=True))
    kind = rng.choice(["band", "name", "luminance", "rgb", "index", "expr"])
    how: dict[str, Any] = {"stretch": f"{span[0]!r},{span[1]!r}"}
    low, high = span
    if kind == "band":
        n = rng.randrange(4)
        how["band"], number = order.index(n) + 1, bands[NAMES[n]]
    elif kind == "name":
        name = rng.choice(NAMES)
        how["band"], number = rng.choice([name, name.upper()]), bands[name]
    elif kind == "luminance":
        number = np.tensordot(
            plain.LUMINANCE, np.stack([bands[name] for name in ("red", "green", "blue")]), 1
        )
    elif kind == "rgb":
        three = rng.sample(range(4), 3)
        how["rgb"] = tuple(order.index(n) + 1 for n in three)
        number = np.tensordot(plain.LUMINANCE, values[three], 1)
    else:
        table = INDICES if kind == "index" else EXPRESSIONS
        text = rng.choice(sorted(table))
        how[kind] = text
        with np.errstate(all="ignore"):
            number = table[text](bands)
        low, high = (-1.0, 1.0) if kind == "index" else (-3.0, span[1])
        how["stretch"] = f"{low!r},{high!r}"
        valid = valid & np.isfinite(number)
        if ("b1" in text or "b2" in text) and order != [0, 1, 2, 3]:
            return  # numbers of bands are those of the file
    if not valid.any():
        return
    found = uavseg.extract(path, range=(0, 1), refine="none", collar="keep", threads=1, **how)
    about = f"{kind} {how.get('expr', how.get('index', ''))}"
    covered = plain.drawn_pixels(found.geometry, valid.shape, transform)
    yield from unlike("PLACE", about, covered, valid.astype(np.uint8))
    mean = float(np.average(found["mean"], weights=found["pixels"]))
    yield from far("MEAN", about, mean, float(plain.v_of(number[valid], low, high).mean()), 0, 1.5 / 65535)
