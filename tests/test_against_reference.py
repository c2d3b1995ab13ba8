"""Labels agree with the reference implementation at every pixel."""

import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np
import pytest
import rasterio
from affine import Affine
from numpy.typing import NDArray

from uavseg.execution.executors import Map, serial, threads
from uavseg.jobs.extract import ExtractRequest, extract
from uavseg.jobs.source.source import Raster
from uavseg.jobs.source.work import Work
from uavseg.raster.grid.geobox import GeoBox
from uavseg.raster.grid.tiling import TilePass, Window, tiles
from uavseg.raster.intensity.stretch import Stretch, StretchSpec
from uavseg.raster.read.dataset import Dataset
from uavseg.regions.outline.rings import RegionOutlines, rasterise
from uavseg.regions.tiles.range_tiles import outline_regions
from uavseg.segmentation.blocks.leaves import cells_in_range
from uavseg.segmentation.params.segment import IntensityRange, SegmentParams
from uavseg.segmentation.pipeline import measure_block_map_for
from uavseg.segmentation.source import GreySource

CHUNK = 10
RASTERS = range(0, 240, CHUNK)
FILES = range(1000, 1040, 10)
RUNNERS: list[tuple[int, Map]] = [(64, serial), (128, threads(2))]


def some_fast(chunks: range, thorough: float = float("inf")) -> list[Any]:
    """The chunks, those after the first marked slow, and thorough from some on."""
    slow = [
        pytest.param(first, marks=pytest.mark.slow if first < thorough else pytest.mark.thorough)
        for first in chunks[1:]
    ]
    return [chunks[0], *slow]


class Case(NamedTuple):
    """A raster, the request, and the expected labels."""

    values: NDArray[Any]
    valid: NDArray[np.bool_]
    bounds: tuple[float, float]
    interval: IntensityRange
    params: SegmentParams
    labels: NDArray[np.uint32]


def cases(reference: ModuleType, seed: int, decided: bool = True) -> Iterator[Case]:
    """The paper's method and the adaptive one, unrefined and scanned, on one random raster.

    Greys alone decide where values do not (`decided`), as under a stretch without a range.
    """
    values, valid, low, high = reference.random_raster(seed)
    lo, hi, X, tau = reference.random_choices(seed)
    for method, step in (("paper", None), ("adaptive", 0.05 if tau is None else tau)):
        for refine in ("none", "scan"):
            how = {"X": X, "tau": step, "refine": refine, "decided": decided}
            labels = reference.extract(values, valid, low, high, lo, hi, **how)
            params = SegmentParams(method, X, step or 0.0, refine)
            yield Case(values, valid, (low, high), IntensityRange(lo, hi), params, labels)


@dataclass(frozen=True)
class InMemory:
    """A dataset in memory: an array, read by window."""

    values: NDArray[Any]
    valid: NDArray[np.bool_]

    @property
    def geobox(self) -> GeoBox:
        return GeoBox(self.valid.shape, Affine.identity(), None)

    def is_empty(self, window: Window) -> bool:
        return not self.valid[window.slices].any()

    def read(self, window: Window) -> tuple[NDArray[Any], NDArray[np.bool_] | None]:
        valid = self.valid[window.slices]
        return self.values[window.slices][None], None if valid.all() else valid


def segmented(case: Case, side: int, run: Map) -> RegionOutlines:
    """The regions by the package, tile by tile."""
    source = GreySource(InMemory(case.values, case.valid), Stretch(*case.bounds, ""))
    windows = tiles(source.shape, side)
    blocks = measure_block_map_for(source, case.interval, case.params, TilePass(windows, run))
    inside = cells_in_range(blocks, case.interval, case.params.division)
    return outline_regions(source, inside, case.interval, case.params.refine, TilePass(windows, run))


def labels_of(rings: Any, shape: tuple[int, int]) -> NDArray[np.uint32]:
    return rasterise(rings, Window(0, 0, *shape))


def describe(seed: int, case: Case, side: int) -> str:
    return f"seed {seed}, tiles of {side}, {case.params}"


@pytest.mark.slow
@pytest.mark.parametrize(
    "first", some_fast(RASTERS, thorough=120), ids=lambda first: f"seeds {first} to {first + CHUNK - 1}"
)
def test_labels_are_those_of_the_reference(reference: ModuleType, first: int) -> None:
    different = []
    for seed in range(first, first + CHUNK):
        for case in cases(reference, seed, decided=False):
            for side, run in RUNNERS:
                found = segmented(case, side, run)
                if not np.array_equal(labels_of(found.rings, case.valid.shape), case.labels):
                    different.append(describe(seed, case, side))
                pixels = np.bincount(case.labels.ravel(), minlength=1)[1:]
                if not np.array_equal(found.sums.counts, pixels):
                    different.append("sums of " + describe(seed, case, side))
    assert not different


def write(path: Path, values: NDArray[Any], valid: NDArray[np.bool_], seed: int) -> None:
    """A GeoTIFF that marks invalid pixels by NaN, by a nodata value, or if no value is free by a mask."""
    pixels, nodata = values.copy(), None
    if values.dtype.kind == "f":
        nodata = (None, -9999.0)[seed % 2]
        pixels[~valid] = np.nan if nodata is None else nodata
    else:
        limits = np.iinfo(values.dtype)
        free = np.setdiff1d(np.arange(limits.min, limits.max + 1), values[valid])
        if len(free) and seed % 4:
            nodata = int(free[seed % len(free)])
            pixels[~valid] = nodata
    blocks = {"tiled": True, "blockxsize": 16, "blockysize": 32} if seed % 3 else {}
    rows, cols = values.shape
    how = {"driver": "GTiff", "height": rows, "width": cols, "count": 1, "dtype": values.dtype.name}
    with (
        warnings.catch_warnings(action="ignore"),
        rasterio.Env(GDAL_TIFF_INTERNAL_MASK=True),
        rasterio.open(path, "w", nodata=nodata, **how, **blocks) as file,
    ):
        file.write(pixels, 1)
        if nodata is None and values.dtype.kind != "f":
            file.write_mask(valid)


@pytest.mark.slow
@pytest.mark.parametrize("first", some_fast(FILES), ids=lambda first: f"seeds {first} to {first + 9}")
def test_regions_of_a_file_are_those_of_the_reference(
    reference: ModuleType, tmp_path: Path, first: int
) -> None:
    different = []
    for seed in range(first, first + 10):
        values, valid, low, high = reference.random_raster(seed)
        write(tmp_path / f"{seed}.tif", values, valid, seed)
        dataset = Dataset.open(tmp_path / f"{seed}.tif")
        given = StretchSpec("given", (Fraction(low), Fraction(high)))
        side, run = [(192, serial), (64, threads(2))][seed % 2]
        for case in cases(reference, seed):
            found = extract(
                Raster(dataset, given), ExtractRequest(case.interval, case.params), Work(side, run)
            )
            if not np.array_equal(labels_of(found.rings, valid.shape), case.labels):
                different.append(describe(seed, case, side))
            pixels = np.bincount(case.labels.ravel(), minlength=1)[1:]
            if not np.array_equal(found.regions.columns["pixels"], pixels):
                different.append("pixels of " + describe(seed, case, side))
    assert not different


@pytest.mark.slow
def test_the_rasters_are_of_every_kind(reference: ModuleType) -> None:
    seeds = range(RASTERS.stop)
    rasters = [reference.random_raster(seed) for seed in seeds]
    assert {raster[0].dtype.name for raster in rasters} == {"uint8", "uint16", "int16", "float32", "float64"}
    assert min(min(raster[1].shape) for raster in rasters) <= 2
    assert max(max(raster[1].shape) for raster in rasters) > 190
    assert sum(not raster[1].all() for raster in rasters) > 60
    assert sum(len(np.unique(case.labels)) > 3 for seed in seeds[:20] for case in cases(reference, seed)) > 20
