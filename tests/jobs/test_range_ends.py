"""Both ends of a range of v belong to it, whatever the type of the pixels and the stretch."""

from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from affine import Affine
from click.testing import CliRunner
from hypothesis import given, strategies as st
from numpy.typing import NDArray
from rasterio.crs import CRS

import uavseg
from uavseg.cli import main
from uavseg.jobs.extract import ExtractRequest, extract
from uavseg.jobs.maps.classify import ClassifyRequest, classify
from uavseg.jobs.ranges.ranges import decided_grey
from uavseg.jobs.segment_classes import ClassesRequest, LevelsRequest, extract_classes, levels
from uavseg.jobs.source.source import ProbabilityMap
from uavseg.occupancy.map_file import stretch_of
from uavseg.raster.formats.geotiff import write_geotiff
from uavseg.raster.grid.geobox import GeoBox
from uavseg.raster.grid.tiling import TilePass, Window
from uavseg.raster.intensity.stretch import Stretch, fit_stretch
from uavseg.raster.read.dataset import Dataset
from uavseg.segmentation.params.segment import (
    IntensityRange,
    Levels,
    Refinement,
    SegmentParams,
    StateLimits,
    ValueClass,
    ValueClasses,
)
from uavseg.segmentation.source import GreySource

UTM = CRS.from_epsg(32633)


def dataset_of(values: NDArray[Any]) -> Dataset:
    return Dataset.of_values(values, GeoBox(values.shape, Affine(1, 0, 5e5, 0, -1, 5e6), UTM), "a.tif")


def source_of(values: NDArray[Any], stretch: str = "none") -> ProbabilityMap:
    dataset = dataset_of(values)
    return ProbabilityMap(dataset, fit_stretch(dataset, stretch, TilePass([Window(0, 0, *values.shape)])))


def in_range(values: NDArray[Any], stretch: Stretch, low: float, high: float) -> NDArray[np.bool_]:
    """Which pixels have a grey in a range."""
    interval = IntensityRange(low, high)
    grey = decided_grey(GreySource(dataset_of(values), stretch), interval.edges, (low, high))
    first, last = interval.greys
    rows, cols = values.shape
    pixels = grey.read(Window(0, 0, rows, cols), 0).grey[:rows, :cols]
    return (pixels >= first) & (pixels <= last)


fractions = st.integers(1, 1000).flatmap(lambda q: st.integers(0, q).map(lambda k: Fraction(k, q)))
pairs = st.tuples(fractions, fractions).filter(lambda ends: float(ends[1]) - float(ends[0]) > 1e-4)


@given(
    pairs, st.sampled_from([np.float32, np.float64]), st.sampled_from([(0.0, 1.0), (0.0, 8.0), (-3.0, 7.0)])
)
def test_floats_are_decided_exactly(
    ends: tuple[Fraction, Fraction], dtype: type[np.floating], span: tuple[float, float]
) -> None:
    low, high = map(float, ends)
    # A bound as the type holds it, and its neighbours in that type, which lie on its two sides.
    here = [dtype(span[0] + end * (span[1] - span[0])) for end in (low, high)]
    values = np.array([[np.nextafter(x, dtype(way)) for way in (-99, x, 99)] for x in here], dtype)
    found = in_range(values, Stretch(*span, "given"), low, high)
    assert found[0, 1] and found[0, 2] and found[1, 0] and found[1, 1], values
    if dtype == np.float32:
        assert found[0, 0] == (low == 0) and found[1, 2] == (high == 1)  # v ends at 0 and 1


@given(st.data())
def test_integers_are_decided_exactly(data: st.DataObject) -> None:
    dtype = data.draw(st.sampled_from([np.uint8, np.int16, np.uint16, np.int32]))
    width = data.draw(st.integers(2, 250) if dtype == np.uint8 else st.integers(2, 32000))
    low, high = sorted(data.draw(st.tuples(*[st.integers(0, width)] * 2).filter(lambda p: p[0] != p[1])))
    steps = np.unique(np.clip([low - 1, low, low + 1, high - 1, high, high + 1], 0, width))
    found = in_range(
        steps.astype(dtype)[None], Stretch(0.0, float(width), "minmax"), low / width, high / width
    )
    assert found[0].tolist() == ((steps >= low) & (steps <= high)).tolist()


@pytest.mark.parametrize("dtype", ["float32", "float64"])
@pytest.mark.parametrize("v", [0.5, 0.25, 0.75, 1 / 3, 0.1, 0.7])
@pytest.mark.parametrize("refine", ["none", "scan", "tv"])
def test_a_raster_of_one_value_lies_in_a_range_that_ends_there(
    v: float, dtype: str, refine: Refinement
) -> None:
    source = source_of(np.full((64, 64), v, dtype))
    for low, high in ((0, v), (v, 1)):
        request = ExtractRequest(IntensityRange(low, high), SegmentParams(refine=refine))
        assert len(extract(source, request).regions) == 1, (low, high)


def test_an_end_that_two_classes_share_belongs_to_the_lower() -> None:
    low, high = ValueClass("a", IntensityRange(0.1, 0.5)), ValueClass("b", IntensityRange(0.5, 0.9))
    for v, name in ((0.1, "a"), (0.5, "a"), (np.nextafter(np.float32(0.5), np.float32(1)), "b"), (0.9, "b")):
        source = source_of(np.full((64, 64), v, np.float32))
        found = extract_classes(source, ClassesRequest(ValueClasses((low, high))))
        assert found.regions.columns["class"].tolist() == [name], v


def test_a_value_on_an_edge_of_levels_belongs_to_the_lower() -> None:
    for k in range(1, 10):
        source = source_of(np.full((64, 64), k / 10, np.float64))
        assert levels(source, LevelsRequest(Levels(0.1))).regions.columns["level"].tolist() == [k - 1]


@pytest.mark.parametrize(("p", "state"), [(0.498, 1), (0.4980001, 2), (0.502, 2), (0.5020001, 3)])
@pytest.mark.parametrize("dtype", ["float32", "float64"])
def test_limits_of_states_belong_to_the_state_below(p: float, state: int, dtype: str) -> None:
    dataset = dataset_of(np.full((64, 64), p, dtype))
    found = classify(ProbabilityMap(dataset, stretch_of(dataset)), ClassifyRequest(StateLimits()))
    assert found.cells[state] == 64 * 64


@pytest.mark.slow
@pytest.mark.parametrize("refine", ["pixels", "tv"])
@pytest.mark.filterwarnings("ignore:no region of low")
@pytest.mark.parametrize("stretch", ["40,90", "none", "minmax"])
def test_a_block_map_decides_ends_as_its_raster_does(refine: str, stretch: str, tmp_path: Path) -> None:
    raster, blocks = tmp_path / "a.tif", tmp_path / "a.blocks.tif"
    values = np.random.default_rng(5).integers(40, 91, (150, 200)).astype(np.uint8)
    if stretch == "none":
        values = (values / 100).clip(0, 1).astype(np.float32)
    write_geotiff(raster, [values], GeoBox(values.shape, Affine(1, 0, 5e5, 0, -1, 5e6), UTM))
    line = ["divide", str(raster), f"--stretch={stretch}", "-o", str(blocks)]
    assert CliRunner().invoke(main, line).exit_code == 0
    for low in (0.2, 0.3, 0.44, 0.46, 0.5, 0.6):
        by_raster, by_blocks = (
            uavseg.extract(source, (low, 1.0), refine=refine, **how)
            for source, how in ((raster, {"stretch": stretch}), (blocks, {}))
        )
        assert by_blocks.geometry.equals(by_raster.geometry)
        assert by_blocks["pixels"].sum() == by_raster["pixels"].sum()
    classes = {"low": (0.0, 0.46), "high": (0.46, 1.0)}
    of_raster, of_blocks = (
        uavseg.extract(source, classes=classes, **how)
        for source, how in ((raster, {"stretch": stretch}), (blocks, {}))
    )
    assert of_blocks.geometry.equals(of_raster.geometry)
