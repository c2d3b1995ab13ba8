"""Stack of layers: drawing order, and coarse reads of large rasters only."""

from pathlib import Path
from typing import Any

import geopandas
import numpy as np
import pytest
import shapely

from tests.plot.layers.maps import BOX, MOST, UTM, write
from uavseg.plot.layers.raster_layers import StatesLayer
from uavseg.plot.layers.region_layer import LevelsLayer, RegionLayer
from uavseg.plot.page.page import Frame
from uavseg.plot.preview import make_layers, preview
from uavseg.raster.grid.geobox import GeoBox
from uavseg.raster.read.dataset import Dataset


def test_layers_of_a_large_raster_are_never_read_whole(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    large = GeoBox((3000, 2000), BOX.transform, UTM)
    raster = write(tmp_path / "a.tif", np.zeros(large.shape, np.uint8), large)
    many = write(tmp_path / "s.tif", np.ones(large.shape, np.uint8), large, nodata=0)
    requested = []
    whole = Dataset.read_coarse

    def spy(self: Dataset, max_side: int) -> Any:
        requested.append(max_side)
        return whole(self, max_side)

    def refuse(*_: Any) -> Any:
        raise AssertionError("a full window was read")

    monkeypatch.setattr(Dataset, "read_coarse", spy)
    monkeypatch.setattr(Dataset, "read", refuse)
    preview(raster, tmp_path / "a.png", states=many, width_px=300)
    assert len(requested) == 2 and max(requested) < 1000


def test_layers_are_drawn_from_the_ground_up_and_only_those_with_a_source(tmp_path: Path) -> None:
    box = shapely.box(4e5 + 5, 5e6 - 40, 4e5 + 60, 5e6 - 20)
    table = geopandas.GeoDataFrame({"id": [1], "level": [1]}, geometry=[box], crs=UTM)
    all_states = write(tmp_path / "s.tif", np.ones(BOX.shape, np.uint8), nodata=0)
    layers = make_layers(Frame(BOX), MOST, levels=table, states=all_states, regions=table)
    assert [type(layer) for layer in layers] == [LevelsLayer, StatesLayer, RegionLayer]
    assert make_layers(Frame(BOX), MOST) == []
    for layer in layers:
        assert all(layer.title_parts(True)) and all(layer.title_parts(False))
