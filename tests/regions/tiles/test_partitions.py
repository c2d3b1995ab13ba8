"""Partitions: their regions are those of the whole raster, whatever their side and the tiles are."""

from collections.abc import Callable, Iterator
from dataclasses import fields
from itertools import count
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
import rasterio
from affine import Affine
from hypothesis import given, settings, strategies as st
from numpy.typing import NDArray

from uavseg.errors import OutputError
from uavseg.execution.executors import Map, serial, threads
from uavseg.raster.grid.tiling import TilePass, tiles
from uavseg.raster.intensity.stretch import Stretch
from uavseg.raster.read.dataset import Dataset
from uavseg.regions.outline.rings import RegionOutlines
from uavseg.regions.tiles.partitions import PartitionJob, join_partitions
from uavseg.regions.tiles.range_tiles import outline_regions
from uavseg.segmentation.params.segment import IntensityRange, SegmentParams
from uavseg.segmentation.pipeline import every_cell
from uavseg.segmentation.source import GreySource

Image = NDArray[np.uint8]
Sourced = Callable[[Image], GreySource]
BRIGHT = IntensityRange(0.5, 0.8)
PIXELS = SegmentParams(refine="pixels")
SIDES = [64, 128, 192, 512]


@pytest.fixture(scope="session")
def sourced(tmp_path_factory: pytest.TempPathFactory) -> Sourced:
    """Grey of an 8-bit image in which 0 is nodata; a stretch that clips what is brighter than 200."""
    folder, numbers = tmp_path_factory.mktemp("partitions"), count()

    def write(image: Image) -> GreySource:
        path = folder / f"{next(numbers)}.tif"
        rows, cols = image.shape
        place = {"crs": "EPSG:32618", "transform": Affine(2, 0, 4e5, 0, -2, 5e6), "nodata": 0}
        with rasterio.open(path, "w", "GTiff", cols, rows, 1, dtype="uint8", **place) as file:
            file.write(image, 1)
        return GreySource(Dataset.open(path), Stretch(0.0, 200.0, "0,200"))

    return write


def scene(seed: int) -> Image:
    """Patches of some brightness with noise, and nodata: some regions are most of the image."""
    rng = np.random.default_rng(seed)
    shape = tuple(rng.integers(1, 400, 2))
    grain = int(rng.choice([2, 9, 40]))
    coarse = rng.choice([40, 120, 150, 220], (shape[0] // grain + 1, shape[1] // grain + 1))
    image = np.kron(coarse, np.ones((grain, grain), int))[: shape[0], : shape[1]]
    image = np.clip(image + rng.normal(0, rng.choice([2, 30]), shape), 1, 255).astype(np.uint8)
    image[rng.random(shape) < 0.01] = 0
    return image


def outlines_of(
    source: GreySource, side: int, tile: int, folder: str, run: Map = serial
) -> list[tuple[PartitionJob, RegionOutlines]]:
    tile_pass = TilePass(tiles(source.shape, tile), run)
    jobs = join_partitions(source, BRIGHT, PIXELS, tile_pass, Path(folder), side=side)
    return [(job, job.outlines(folder)) for job in jobs]


Region = tuple[bytes | None, ...]


def regions_of(outlined: RegionOutlines) -> Iterator[Region]:
    """Everything that is known of each region, as bytes: its rings, in order, and its sums."""
    rings, sums = outlined.rings, outlined.sums
    assert np.array_equal(np.unique(rings.labels), np.arange(1, len(sums.counts) + 1))
    excess = np.zeros_like(sums.counts) if sums.excess is None else sums.excess
    for k in range(len(sums.counts)):
        of_region = np.flatnonzero(rings.labels == k + 1)
        shape = [rings.vertices[rings.starts[r] : rings.starts[r + 1]].tobytes() for r in of_region]
        exteriors = rings.exteriors[of_region].tobytes()
        columns = {field.name: getattr(sums, field.name) for field in fields(sums)} | {"excess": excess}
        known = [None if column is None else column[k].tobytes() for column in columns.values()]
        yield (*shape, exteriors, *known)


@pytest.mark.slow
@given(st.integers(0, 10**6), st.sampled_from(SIDES), st.sampled_from(SIDES))
@settings(max_examples=25)
def test_the_regions_of_all_partitions_are_those_of_the_raster(
    sourced: Sourced, seed: int, side: int, tile: int
) -> None:
    source = sourced(scene(seed))
    whole = outline_regions(
        source, every_cell(source.shape), BRIGHT, "pixels", TilePass(tiles(source.shape, 512))
    )
    with TemporaryDirectory() as folder:
        parts = [outlined for _, outlined in outlines_of(source, side, tile, folder)]
    found = [region for outlined in parts for region in regions_of(outlined)]
    assert sorted(found) == sorted(regions_of(whole))


@pytest.mark.slow
@given(st.integers(0, 10**6), st.sampled_from(SIDES[:3]))
@settings(max_examples=20)
def test_a_region_is_of_the_partition_of_its_first_pixel_and_the_largest_comes_first(
    sourced: Sourced, seed: int, side: int
) -> None:
    source = sourced(scene(seed))
    with TemporaryDirectory() as folder:
        for job, outlined in outlines_of(source, side, 64, folder):
            firsts, window = outlined.sums.firsts, tiles(source.shape, side)[job.number]
            assert (firsts // side * side == (window.row, window.col)).all()
            order = np.lexsort((firsts[:, 1], firsts[:, 0], -outlined.sums.counts))
            assert np.array_equal(order, np.arange(len(order)))


@pytest.mark.slow
@given(st.integers(0, 10**6))
@settings(max_examples=20)
def test_tiles_and_threads_change_nothing(sourced: Sourced, seed: int) -> None:
    source = sourced(scene(seed))
    with TemporaryDirectory() as one, TemporaryDirectory() as other:
        first = [list(regions_of(part)) for _, part in outlines_of(source, 128, 64, one)]
        second = [list(regions_of(part)) for _, part in outlines_of(source, 128, 192, other, threads(3))]
    assert first == second


def test_a_folder_that_is_not_shared_is_an_error(sourced: Sourced, tmp_path: Path) -> None:
    def elsewhere(function, items, progress=None):  # type: ignore[no-untyped-def]
        results = list(serial(function, items))
        for file in tmp_path.iterdir():
            file.unlink()
        yield from results

    with pytest.raises(OutputError, match="workers must share the folder of the output"):
        outlines_of(sourced(scene(3)), 64, 64, str(tmp_path), elsewhere)


def test_a_raster_without_regions_has_no_jobs(sourced: Sourced, tmp_path: Path) -> None:
    assert outlines_of(sourced(np.full((70, 70), 10, np.uint8)), 64, 64, str(tmp_path)) == []
