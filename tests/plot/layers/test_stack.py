"""Stack of layers: only coarse reads of large rasters."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.plot.layers.maps import BOX, UTM, write
from uavseg.plot.preview import preview
from uavseg.raster.dataset import Dataset
from uavseg.raster.geobox import GeoBox


def test_layers_of_a_large_raster_are_never_read_whole(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    large = GeoBox((3000, 2000), BOX.transform, UTM)
    raster = write(tmp_path / "a.tif", np.zeros(large.shape, np.uint8), large)
    many = write(tmp_path / "s.tif", np.ones(large.shape, np.uint8), large, nodata=0)
    asked = []
    whole = Dataset.read_coarse

    def spy(self: Dataset, max_side: int) -> Any:
        asked.append(max_side)
        return whole(self, max_side)

    def refuse(*_: Any) -> Any:
        raise AssertionError("a full window was read")

    monkeypatch.setattr(Dataset, "read_coarse", spy)
    monkeypatch.setattr(Dataset, "read", refuse)
    preview(raster, tmp_path / "a.png", states=many, width_px=300)
    assert len(asked) == 2 and max(asked) < 1000
