"""Segments of several intervals: one interval gives regions of its range, and no pixel is in two or none."""

from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import given, settings, strategies as st

from tests.segmentation.in_memory_dataset import field_of, source_of
from uavseg.execution.executors import serial, threads
from uavseg.raster.grid.tiling import TilePass, Window, tiles
from uavseg.regions.outline.rings import RegionOutlines, rasterise
from uavseg.regions.shapes import LazyPolygons
from uavseg.regions.tiles.class_tiles import ClassesByPixel, outline_refined_classes
from uavseg.regions.tiles.range_tiles import outline_regions
from uavseg.segmentation.params.segment import (
    Breaks,
    IntensityRange,
    Partition,
    SegmentParams,
    ValueClass,
    ValueClasses,
    partition_of_levels,
)
from uavseg.segmentation.pipeline import every_cell
from uavseg.segmentation.source import GreySource

PARAMS = SegmentParams()
seeds = st.integers(0, 100_000)
ends = st.lists(st.integers(0, 100), min_size=2, max_size=6, unique=True).map(
    lambda some: sorted(end / 100 for end in some)
)


def classes_of(*ranges: tuple[float, float]) -> ValueClasses:
    return ValueClasses(tuple(ValueClass(f"{pair}", IntensityRange(*pair)) for pair in ranges))


def outlined(
    source: GreySource, partition: Partition, side: Any = 256, run: Any = serial
) -> tuple[RegionOutlines, np.ndarray]:
    found, classes = outline_refined_classes(
        source, partition, "tv", TilePass(tiles(source.shape, side), run)
    )
    return found, classes.at(found.sums.firsts)


def assert_same(first: RegionOutlines, second: RegionOutlines) -> None:
    for one, other in ((first.rings, second.rings), (first.sums, second.sums)):
        for name in one.__dataclass_fields__:
            assert np.array_equal(getattr(one, name), getattr(other, name)), name


@pytest.mark.slow
@settings(max_examples=25)
@given(seeds, ends)
def test_one_class_gives_the_regions_of_its_range(seed: int, some: list[float]) -> None:
    source, interval = source_of(field_of(seed, (150, 190))), IntensityRange(some[0], some[1])
    cells = every_cell(source.shape)
    expected = outline_regions(source, cells, interval, "tv", TilePass(tiles(source.shape, 64)))
    found, classes = outlined(source, classes_of((some[0], some[1])).partition, 64)
    assert_same(found, expected)
    assert (classes == 1).all()


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("side, run", [(64, serial), ((64, 192), threads(2)), ((192, 64), serial)])
def test_tiles_and_workers_change_nothing(seed: int, side: Any, run: Any) -> None:
    source = source_of(field_of(seed, (201, 230)))
    partition = classes_of((0.1, 0.3), (0.3, 0.45), (0.6, 0.9)).partition
    expected, classes = outlined(source, partition)
    found, found_kinds = outlined(source, partition, side, run)
    assert_same(found, expected)
    assert np.array_equal(found_kinds, classes) and set(classes) == {1, 2, 3}


@pytest.mark.slow
@settings(max_examples=25)
@given(seeds, ends)
def test_levels_over_all_values_cover_each_valid_pixel_once(seed: int, some: list[float]) -> None:
    field = field_of(seed, (150, 190))
    breaks = Breaks(tuple(end for end in some if 0 < end < 1))
    found, _ = outlined(source_of(field), partition_of_levels(breaks), 64)
    labels = rasterise(found.rings, Window(0, 0, 150, 190))
    assert np.array_equal(labels > 0, field.valid)
    assert np.bincount(labels[labels > 0], minlength=1)[1:].tolist() == found.sums.counts.tolist()


@pytest.mark.parametrize("seed", range(3))
def test_polygons_of_adjoining_classes_share_their_borders(seed: int) -> None:
    source = source_of(field_of(seed, (150, 190)))
    found, _ = outlined(source, classes_of((0, 0.3), (0.3, 0.5), (0.5, 1)).partition, 64)
    polygons = LazyPolygons(found.rings, source.dataset.geobox.transform)
    shapes = np.array(list(polygons), object)
    assert shapely.is_valid(shapes).all()
    union = shapely.union_all(shapes)
    assert union.area == pytest.approx(shapely.area(shapes).sum(), abs=1e-6)
    assert union.area == source.dataset.valid.sum()  # neither gaps nor slivers


@pytest.mark.parametrize("seed", range(3))
def test_a_pixel_far_from_all_borders_has_the_kind_of_its_own_value(seed: int) -> None:
    """Independent of the refinement: constant patches of 40 pixels are classified by their value."""
    field = field_of(seed, (160, 200))
    field.values[:] = field.values[20::40, 20::40].repeat(40, 0).repeat(40, 1)[:160, :200]
    field.valid[:] = True
    partition = classes_of((0.2, 0.5), (0.5, 0.7)).partition
    found, classes = outlined(source_of(field), partition, 64)
    labels = rasterise(found.rings, Window(0, 0, 160, 200))
    v = field.values / 255
    expected = np.where((v >= 0.2) & (v <= 0.5), 1, np.where((v > 0.5) & (v <= 0.7), 2, 0))
    assert np.array_equal(np.array([0, *classes])[labels], expected)


def test_kinds_are_known_by_first_pixels_in_any_order() -> None:
    firsts = np.array([[5, 2], [0, 9], [0, 1]])
    classes = ClassesByPixel.of(firsts, np.array([3, 2, 1], np.uint8))
    assert classes.at(np.array([[0, 1], [5, 2]])).tolist() == [1, 3]
