"""Layer of levels: segments in the grey of their interval."""

from pathlib import Path
from typing import Any

import geopandas
import numpy as np
import pytest
import shapely

from tests.plot.layers.maps import BOX, UTM, of_raster, write
from uavseg.errors import RegionError
from uavseg.plot.layers import region_layer as levels_layer
from uavseg.plot.page.page import Frame
from uavseg.plot.preview import preview


def segments(crs: Any = UTM, **columns: Any) -> geopandas.GeoDataFrame:
    left = shapely.box(4e5, 5e6 - 64, 4e5 + 48, 5e6)
    right = shapely.box(4e5 + 48, 5e6 - 64, 4e5 + 96, 5e6)
    return geopandas.GeoDataFrame(columns, geometry=[left, right], crs=crs)


@pytest.mark.slow
def test_levels_are_as_grey_as_their_interval(tmp_path: Path) -> None:
    raster = write(tmp_path / "a.tif", np.full((128, 192), 7, np.uint8))
    table = segments(level=[1, 3], range_low=[0.0, 0.6], range_high=[0.3, 0.9])
    table.to_file(tmp_path / "levels.gpkg")
    table.to_parquet(tmp_path / "levels.parquet")
    for given_ in (table, tmp_path / "levels.gpkg", tmp_path / "levels.parquet"):
        out = preview(raster, tmp_path / "a.png", levels=given_, overwrite=True)
        dark, light = of_raster(out, 0.3, 0.25), of_raster(out, 0.3, 0.75)
        assert (np.abs(dark - 0.15 * 255) < 2).all() and (np.abs(light - 0.75 * 255) < 2).all()


def test_levels_without_intervals_are_spread_evenly() -> None:
    assert levels_layer.LevelsLayer.of(segments(level=[1, 2]), Frame(BOX)).greys.tolist() == [0, 1]
    assert levels_layer.LevelsLayer.of(segments(level=[0, 0]), Frame(BOX)).greys.tolist() == [0, 0]
    with pytest.raises(RegionError, match="no column level"):
        levels_layer.LevelsLayer.of(segments(id=[1, 2]), Frame(BOX))
