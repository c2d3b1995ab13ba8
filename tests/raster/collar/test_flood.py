"""A streamed flood is that of the whole raster, whatever its tiles and executor are."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from numpy.typing import NDArray
from scipy import ndimage

from tests.raster.collar.draw_collar import write
from uavseg.execution.executors import threads
from uavseg.raster.collar import flood
from uavseg.raster.collar.flood import flood_from_edges
from uavseg.raster.grid.tiling import TilePass, Window
from uavseg.raster.read.dataset import Dataset

EIGHT = np.ones((3, 3))


def plain_flood(passable: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """The same in memory: pixels whose neighbours are passable, connected to the edge."""
    opened = ndimage.binary_erosion(passable, EIGHT, border_value=1)
    labels, _ = ndimage.label(opened, EIGHT)
    edge = np.concatenate([labels[0], labels[-1], labels[:, 0], labels[:, -1]])
    return np.isin(labels, np.setdiff1d(edge, 0))


def winding(seed: int) -> NDArray[np.uint8]:
    """Zeros in winding corridors, so that the flood enters tiles many times."""
    rng = np.random.default_rng(seed)
    coarse = ndimage.zoom((rng.random((24, 28)) < 0.55).astype(np.uint8), 10, order=0)
    return np.where(coarse, 0, 90).astype(np.uint8)[:233, :271]


@pytest.mark.slow
@pytest.mark.parametrize("side", [(64, 64), (128, 64), (64, 320), (1024, 1024)])
@given(seed=st.integers(0, 1000))
@settings(max_examples=10)
def test_tiles_change_nothing(
    tmp_path_factory: pytest.TempPathFactory, side: tuple[int, int], seed: int
) -> None:
    image = winding(seed)
    dataset = Dataset.open(write(tmp_path_factory.mktemp("a") / "a.tif", image))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(flood, "flood_tiles", lambda _: side)
        found = flood_from_edges(dataset, 0, TilePass((), threads(2)))
    assert np.array_equal(found.read(Window(0, 0, *image.shape)), plain_flood(image == 0))


def test_only_tiles_that_are_reached_are_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    image = np.full((1024, 1024), 90, np.uint8)
    image[:100, :100] = 0
    image[500:600, 500:600] = 0  # not connected to the edge
    dataset = Dataset.open(write(tmp_path / "a.tif", image))
    monkeypatch.setattr(flood, "flood_tiles", lambda _: (128, 128))
    read, windows = Dataset.read, []
    monkeypatch.setattr(Dataset, "read", lambda self, window: windows.append(window) or read(self, window))
    found = flood_from_edges(dataset, 0, TilePass(()))
    assert found.read(Window(0, 0, 1024, 1024)).sum() == 99 * 99
    tiles_read = [window for window in windows if window.rows > 2 and window.cols > 2]
    assert 1 <= len(tiles_read) <= 4


def test_nodata_is_passable(tmp_path: Path) -> None:
    image = np.full((200, 200), 90, np.uint8)
    image[:, :20], image[50:100, 20:60] = 7, 0
    dataset = Dataset.open(write(tmp_path / "a.tif", image, nodata=7))
    found = flood_from_edges(dataset, 0, TilePass(())).read(Window(0, 0, 200, 200))
    assert np.array_equal(found, plain_flood(np.isin(image, (0, 7))))
    assert found[60, 40]
    assert not flood_from_edges(dataset, None, TilePass(())).read(Window(0, 0, 200, 200))[60, 40]
