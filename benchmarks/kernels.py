"""Nanoseconds per pixel of the kernels, compared with a copy of the same arrays.

    python -m benchmarks.kernels

One thread, one tile of 2048 x 2048 of the synthetic scene; the minimum of several runs.
"""

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

from benchmarks.competitors import LOW, MIN_PIXELS, with_project
from uavseg.units import BLOCK

SIDE = 2048
RUNS = 7


@dataclass(frozen=True, slots=True)
class Speed:
    """One row of the table.

    Parameters
    ----------
    title : str
    ns : float
        Per pixel of the tile.
    copy_ns : float
        For copying each input and output array once, per pixel of the tile.
    remark : str
    """

    title: str
    ns: float
    copy_ns: float
    remark: str = ""


def speeds() -> list[Speed]:
    """All rows, measured in a child process so that the caller needs little memory."""
    command = [sys.executable, "-m", "benchmarks.kernels"]
    output = subprocess.run(
        command, env=with_project(os.environ), check=True, stdout=subprocess.PIPE, text=True
    ).stdout
    return [Speed(*row) for row in json.loads(output)]


@dataclass(frozen=True, slots=True)
class _Case:
    """A timed call on fresh copies of `scratch`; `arrays` are those that it reads or writes."""

    title: str
    call: Callable[..., Any]
    arrays: tuple[Any, ...]
    scratch: tuple[Any, ...] = ()
    remark: str = ""


def _cases() -> Iterator[_Case]:
    import numpy as np
    import rasterio.features

    from uavseg.raster.intensity.stretch import Stretch
    from uavseg.regions.outline.chains import trace_tile
    from uavseg.regions.outline.trace import trace
    from uavseg.segmentation.blocks.block_map import cell_sums
    from uavseg.segmentation.blocks.division import block_ratios
    from uavseg.segmentation.blocks.lbp import contrast_bin_edges, contrast_histogram, lbp_symbols
    from uavseg.segmentation.components import component_sums, label_components
    from uavseg.segmentation.params.segment import IntensityRange
    from uavseg.segmentation.refine.range_scans import refine_by_scans
    from uavseg.segmentation.refine.total_variation import refine_by_tv

    tile = _tile()
    stretch = Stretch(0.0, 255.0, "dtype")
    grey = stretch.apply(tile)  # with a border of one pixel, as the pipeline reads it
    inner = np.ascontiguousarray(grey[1:-1, 1:-1])
    valid = np.ones_like(grey, dtype=np.uint8)
    yield _Case("`Stretch.apply`, 8 to 16 bit", lambda: stretch.apply(tile), (tile, grey))

    sums, counts = cell_sums(grey, valid, 1)
    yield _Case("`block_map.cell_sums`", lambda: cell_sums(grey, valid, 1), (grey, valid))

    bin_edges = contrast_bin_edges(contrast_histogram(grey))
    yield _Case("`lbp.contrast_histogram`", lambda: contrast_histogram(grey), (grey,))
    yield _Case("`lbp.lbp_symbols`", lambda: lbp_symbols(grey, None, bin_edges), (grey, inner))

    starts = np.arange(0, SIDE, BLOCK)
    corners = np.stack(np.meshgrid(starts, starts, indexing="ij"), axis=-1).reshape(-1, 2)
    yield _Case("`division.block_ratios`", lambda: block_ratios(grey, None, bin_edges, corners), (grey,))

    bright = sums >= LOW * 65535.0 * counts
    inside = bright.astype(np.uint8).repeat(8, axis=0).repeat(8, axis=1)
    valid_pixels = np.ones_like(inside)
    in_range = (inner >= LOW * 65535).astype(np.uint8)
    yield _Case(
        "`range_scans.refine_by_scans`",
        lambda mask: refine_by_scans(mask, valid_pixels, in_range),
        (inside, valid_pixels, in_range),
        (inside,),
    )
    greys = IntensityRange(LOW, 1).greys
    yield _Case(
        "`tv.refine_by_tv`",
        lambda mask: refine_by_tv(mask, valid_pixels, inner, greys),
        (in_range, valid_pixels, inner),
        (in_range,),
    )

    refined = refine_by_scans(inside.copy(), valid_pixels, in_range)
    labels, count = label_components(refined)
    yield _Case("`components.label_components`", lambda: label_components(refined), (refined, labels))
    yield _Case("`components.component_sums`", lambda: component_sums(labels, count, inner), (labels, inner))

    sizes = np.bincount(labels.ravel())
    labels[sizes[labels] < MIN_PIXELS] = 0
    framed = np.pad((labels > 0).astype(np.uint8), 1)
    regions = f"{len(np.unique(labels)) - 1} regions"
    yield _Case(
        "`chains.trace_tile`",
        lambda: trace_tile(framed, labels, 1, (0, 0), SIDE),
        (framed, labels),
        remark=f"{regions}, chains of corners",
    )
    yield _Case("`trace.trace`", lambda: trace(labels), (labels,), remark=f"{regions}, rings")
    signed = labels.astype(np.int32)
    yield _Case(
        "rasterio.features.shapes",
        lambda: list(rasterio.features.shapes(signed, signed > 0)),
        (labels,),
        remark=f"{regions}, dictionaries",
    )


def _tile() -> Any:
    """Image of the scene, a (1, 2050, 2050) uint8 array."""
    import numpy as np

    from benchmarks.data import TILE, draw
    from benchmarks.scenes import Scene

    across = range(0, SIDE + TILE, TILE)
    picture = np.block([[draw(Scene(SIDE), row, col)[0] for col in across] for row in across])
    return np.ascontiguousarray(picture[: SIDE + 2, : SIDE + 2])[np.newaxis]


def _seconds(call: Callable[..., Any], scratch: tuple[Any, ...] = ()) -> float:
    """Minimum of several runs, each on copies of `scratch`, after one warm-up run."""
    call(*(array.copy() for array in scratch))
    fastest = float("inf")
    for _ in range(RUNS):
        copies = tuple(array.copy() for array in scratch)
        start = time.perf_counter()
        call(*copies)
        fastest = min(fastest, time.perf_counter() - start)
    return fastest


def _copy_seconds(arrays: tuple[Any, ...]) -> float:
    """Seconds to copy arrays into allocated memory."""
    import numpy as np

    targets = [array.copy() for array in arrays]

    def copy() -> None:
        for target, array in zip(targets, arrays, strict=True):
            np.copyto(target, array)

    return _seconds(copy)


def _measure() -> Iterator[Speed]:
    for case in _cases():
        seconds = _seconds(case.call, case.scratch)
        per_pixel = 1e9 / SIDE**2
        yield Speed(case.title, seconds * per_pixel, _copy_seconds(case.arrays) * per_pixel, case.remark)


if __name__ == "__main__":
    print(json.dumps([(row.title, row.ns, row.copy_ns, row.remark) for row in _measure()]))
