"""Colours all over a raster: those of each small window, whichever windows are read at once."""

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
from hypothesis import HealthCheck, given, settings, strategies as st
from numpy.typing import NDArray
from rasterio.transform import from_origin
from scipy.ndimage import convolve

from uavseg.raster.grid.tiling import TilePass, spread_windows
from uavseg.raster.intensity.stretch import Stretch
from uavseg.raster.read.dataset import Dataset, stacked
from uavseg.regions.sample.similarity import spread_stretches, window_colors
from uavseg.segmentation.source import GreySource

GREYS = Stretch(0, 65535, "greys")
WEIGHTS = np.outer([1, 4, 6, 4, 1], [1, 4, 6, 4, 1])
PLACE = from_origin(4e5, 5e6, 1, 1)


def write(path: Path, planes: NDArray[np.uint16], block: int | None) -> None:
    layout = {"tiled": True, "blockxsize": block, "blockysize": block} if block else {}
    count, height, width = planes.shape
    size = {"count": count, "height": height, "width": width, "dtype": "uint16", "nodata": 0}
    with rasterio.open(path, "w", "GTiff", crs="EPSG:32618", transform=PLACE, **size, **layout) as file:
        file.write(planes)


def bands_of(path: Path) -> list[GreySource]:
    dataset = Dataset.open(str(path), band=1)
    with rasterio.open(path) as file:
        return [GreySource(dataset.of_band(band, 0), GREYS) for band in file.indexes]


class Counted:
    """An executor that counts what it is called for."""

    count = 0

    def __call__(
        self, function: Callable[[Any], Any], items: Sequence[Any], progress: Any = None
    ) -> Iterator[Any]:
        for item in items:
            self.count += 1
            yield function(item)


@pytest.mark.slow
@given(st.data())
@settings(max_examples=40, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_they_are_those_of_a_plain_version(
    tmp_path_factory: pytest.TempPathFactory, data: st.DataObject
) -> None:
    shape = data.draw(st.integers(1, 500)), data.draw(st.integers(1, 900))
    rng = np.random.default_rng(data.draw(st.integers(0, 99)))
    planes = rng.integers(1, 65536, (data.draw(st.integers(1, 3)), *shape)).astype(np.uint16)
    planes[:, rng.random(shape) < data.draw(st.sampled_from([0, 0.2, 1]))] = 0
    path = tmp_path_factory.mktemp("colours") / "a.tif"
    write(path, planes, data.draw(st.sampled_from([None, 16, 64, 256])))
    found = window_colors(bands_of(path), TilePass([]))
    valid = (planes[0] != 0).astype(np.int64)
    counts = convolve(valid, WEIGHTS, mode="constant")
    means = [
        convolve(plane * valid, WEIGHTS, mode="constant") // np.maximum(counts, 1)
        for plane in planes.astype(np.int64)
    ]
    windows = spread_windows(shape, 32, 12)
    assert len(found) == len(windows)
    for window, colors in zip(windows, found, strict=True):
        part = [mean[window.slices][2::4, 2::4] for mean in means]
        chosen = valid[window.slices][2::4, 2::4] != 0
        assert np.array_equal(colors, np.stack([one[chosen] for one in part], 1))


@pytest.mark.parametrize(
    ("width", "block", "reads"),
    [
        (2048, None, 32),
        (2048, 64, 32),
        (4096, 256, 32),
        pytest.param(2048, 16, 32 * 32, marks=pytest.mark.slow),
    ],
)
def test_windows_of_a_row_are_read_at_once_where_no_other_blocks_are_between(
    tmp_path: Path, width: int, block: int | None, reads: int
) -> None:
    write(tmp_path / "a.tif", np.full((1, 640, width), 7, np.uint16), block)
    counted = Counted()
    window_colors(bands_of(tmp_path / "a.tif"), TilePass([], counted))
    assert counted.count == reads


def test_stretches_of_many_bands_are_those_of_each_window(tmp_path: Path) -> None:
    planes = np.random.default_rng(4).integers(1, 65536, (9, 300, 700)).astype(np.uint16)
    write(tmp_path / "a.tif", planes, 64)
    stack = stacked(Dataset.open(str(tmp_path / "a.tif"), band=1), range(1, 10), None)
    counted = Counted()
    found = spread_stretches(stack, TilePass([], counted))
    inside = [planes[:, *window.slices][:, 2::4, 2::4] for window in spread_windows((300, 700), 32, 12)]
    values = np.concatenate([one.reshape(9, -1) for one in inside], 1)
    lows, highs = np.quantile(values, [0.02, 0.98], axis=1)
    assert counted.count == 25
    assert np.allclose([one.low for one in found], 2 * lows - highs)
    assert np.allclose([one.high for one in found], 2 * highs - lows)


def test_no_pixel_outside_of_the_raster_counts(tmp_path: Path) -> None:
    write(tmp_path / "a.tif", np.full((1, 3, 3), 9, np.uint16), None)
    [colors] = window_colors(bands_of(tmp_path / "a.tif"), TilePass([]))
    assert colors.tolist() == [[9]]
