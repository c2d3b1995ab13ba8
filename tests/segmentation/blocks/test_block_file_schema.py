"""The description of a block map: each value of another kind is refused, and named."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from affine import Affine
from rasterio.crs import CRS

from uavseg.errors import RasterError
from uavseg.raster.grid.geobox import GeoBox
from uavseg.raster.intensity.stretch import Stretch
from uavseg.segmentation.blocks import block_file
from uavseg.segmentation.blocks.block_file import Origin, SavedBlocks, read_block_map, write_block_map
from uavseg.segmentation.in_memory import block_map_of_array
from uavseg.segmentation.params.segment import DivisionParams

WRONG: dict[str, tuple[Any, ...]] = {
    "rows": ("100", 0, -1, 1.5, True, None, [1], 10**400, 2**40, 500),
    "cols": (None, {}, 10**9),
    "low": ("0", None, float("nan"), float("inf"), [], 10**400),
    "high": (True, "a"),
    "stretch": (None, 3, ["a"]),
    "bands": (None, 1, {}),
    "rasters": ([], "a.tif", [1], [None], [""], {"a": 1}, ["a\x1b.tif"], 5),
    "folder": (None, 1, ["a"], ""),
    "band": ("1", 0, -1, [1], 1.5, True),
    "rgb": (1, [1], [1, 2], [1, 2, "3"], "123", []),
    "nodata": ("abc", [], {}, True),
}


@pytest.fixture
def saved() -> SavedBlocks:
    grey = np.random.default_rng(0).integers(0, 65536, (100, 90)).astype(np.uint16)
    geobox = GeoBox(grey.shape, Affine(2, 0, 5e5, 0, -2, 5e6), CRS.from_epsg(32633))
    return SavedBlocks(
        block_map_of_array(grey), geobox, Stretch(0.0, 65535.0, "none"), "band 1", Origin(("a.tif",), "/maps")
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=[] if name in ("rows", "stretch", "nodata") else pytest.mark.slow)
        for name in WRONG
    ],
)
def test_a_value_of_another_kind_is_refused(
    tmp_path: Path, saved: SavedBlocks, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    import json

    text = block_file.header_text(saved)
    for number, value in enumerate(WRONG[name]):
        content = json.loads(text) | {name: value}
        monkeypatch.setattr(block_file, "header_text", lambda _, content=content: json.dumps(content))
        path = tmp_path / f"{number}.tif"
        write_block_map(path, saved, DivisionParams(1.2, 0.05))
        with pytest.raises(RasterError, match="not a block map that this version reads") as caught:
            read_block_map(path)
        assert name in str(caught.value) or "cells do not cover" in str(caught.value)


@pytest.mark.slow
def test_a_description_that_is_no_object_is_refused(
    tmp_path: Path, saved: SavedBlocks, monkeypatch: pytest.MonkeyPatch
) -> None:
    for number, text in enumerate(("[]", "5", "{", "", '{"rows": ' + "[" * 5000)):
        monkeypatch.setattr(block_file, "header_text", lambda _, text=text: text or " ")
        write_block_map(tmp_path / f"{number}.tif", saved, DivisionParams(1.2, 0.05))
        with pytest.raises(RasterError, match="not a block map"):
            read_block_map(tmp_path / f"{number}.tif")
