"""Label rasters: one file and many tiles hold the same pixels, those that the outlines enclose."""

from pathlib import Path

import numpy as np
import pytest
import rasterio
from affine import Affine
from hypothesis import given, settings, strategies as st
from rasterio.crs import CRS

from uavseg.errors import OutputExistsError, ParameterError
from uavseg.execution.executors import threads
from uavseg.raster.grid.geobox import GeoBox
from uavseg.regions.formats.export import check_labels, is_vrt, label_strips, write_label_raster
from uavseg.regions.outline.trace import trace

LABELS = np.kron(np.random.default_rng(3).integers(0, 9, (7, 5)), np.ones((41, 60), int)).astype(np.uint32)
BOX = GeoBox(LABELS.shape, Affine(2, 0, 4e5, 0, -2, 5e6), CRS.from_epsg(32618))


@given(st.integers(1, 300), st.integers(1, 300), st.integers(0, 10**6))
@settings(max_examples=20)
def test_strips_are_the_whole_raster_from_top_to_bottom(rows: int, cols: int, seed: int) -> None:
    labels = np.random.default_rng(seed).integers(0, 3, (rows, cols)).astype(np.uint32)
    made, below = np.zeros_like(labels), 0
    for window, part in label_strips(trace(labels), labels.shape):
        assert window.row == below and window.col == 0 and window.cols == cols
        made[window.slices] = part
        below += window.rows
    assert below == rows and np.array_equal(made, labels)


@pytest.mark.parametrize("name", ["labels.tif", "labels.vrt"])
@pytest.mark.parametrize("workers", [1, 3])
def test_the_pixels_are_those_that_outlines_enclose(tmp_path: Path, name: str, workers: int) -> None:
    write_label_raster(tmp_path / name, trace(LABELS), BOX, threads(workers))
    with rasterio.open(tmp_path / name) as file:
        assert np.array_equal(file.read(1), LABELS)
        assert file.transform == BOX.transform and file.crs == BOX.crs


def test_a_file_is_replaced_only_if_that_is_allowed(tmp_path: Path) -> None:
    for name in ("labels.tif", "labels.vrt"):
        write_label_raster(tmp_path / name, trace(LABELS), BOX)
        with pytest.raises(OutputExistsError):
            check_labels(tmp_path / name)
        with pytest.raises(OutputExistsError):
            write_label_raster(tmp_path / name, trace(LABELS), BOX)
        write_label_raster(tmp_path / name, trace(LABELS), BOX, overwrite=True)


@pytest.mark.parametrize("name", ["labels.png", "labels", "labels.tif.gz"])
def test_an_unknown_extension_is_refused(tmp_path: Path, name: str) -> None:
    with pytest.raises(ParameterError, match=r"name a \.tif, or a \.vrt"):
        check_labels(tmp_path / name)


def test_the_extension_may_be_in_capitals() -> None:
    assert is_vrt("LABELS.VRT") and not is_vrt("labels.tif")
