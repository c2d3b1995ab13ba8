"""Previews: any raster gives a picture, faults are reported before anything is written."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from affine import Affine
from PIL import Image

from tests.plot.pictures import a_mission, box_of, colored, table, write
from uavseg.errors import (
    MissionError,
    OutputError,
    OutputExistsError,
    ParameterError,
    RasterError,
    RegionError,
)
from uavseg.plot.preview import preview


@pytest.mark.parametrize(
    "transform, crs",
    [
        (Affine.identity(), None),
        (Affine(0.5, 0, 10, 0, -0.5, 90), None),
        (Affine(1e-5, 0, 10, 0, -1e-5, 60), "EPSG:4326"),
        (Affine.translation(4e5, 4.9e6) * Affine.rotation(33) * Affine.scale(0.1, -0.1), "EPSG:32618"),
        (Affine(1e-5, 0, 10, 0, -1e-5, 89.9999), "EPSG:4326"),
    ],
)
@pytest.mark.filterwarnings("ignore::rasterio.errors.NotGeoreferencedWarning")
def test_any_place_gives_a_picture_with_its_region(transform: Affine, crs: Any, tmp_path: Path) -> None:
    raster = write(tmp_path / "a.tif", np.full((60, 90), 128, np.uint8), transform, crs)
    out = preview(raster, tmp_path / "a.png", table([box_of(transform, 5, 5, 55, 85)], crs), width_px=300)
    with Image.open(out) as picture:
        assert picture.size[0] == 300
    assert 0.02 < colored(out).mean() < 0.9


@pytest.mark.parametrize("shape", [(1, 1), (3, 400), (400, 3)])
def test_any_shape_gives_a_picture_of_usable_size(shape: tuple[int, int], tmp_path: Path) -> None:
    with Image.open(
        preview(write(tmp_path / "a.tif", np.ones(shape, np.uint8)), tmp_path / "a.png")
    ) as drawn:
        size = drawn.size
    assert size[0] == 1400 and 400 < size[1] < 2400


def test_faults_are_reported_before_anything_is_written(tmp_path: Path) -> None:
    raster = write(tmp_path / "a.tif", np.ones((20, 20), np.uint8))
    local = write(tmp_path / "local.tif", np.ones((20, 20), np.uint8), Affine(2, 0, 0, 0, -2, 0), None)
    (tmp_path / "there.png").write_text("mine")
    (tmp_path / "no.gpkg").write_text("mine")
    flight = a_mission([(-76.5, 44.2), (-76.5, 44.201)])
    out = tmp_path / "out.png"
    for wrong, arguments in [
        (OutputExistsError, (raster, tmp_path / "there.png")),
        (OutputError, (raster, tmp_path / "out.jpg")),
        (ParameterError, (raster, out, None, None, 20)),
        (RegionError, (raster, out, tmp_path / "missing.geojson")),
        (RegionError, (raster, out, tmp_path / "no.gpkg")),
        (MissionError, (raster, out, None, tmp_path / "missing.plan")),
        (RasterError, (local, out, None, flight)),
    ]:
        with pytest.raises(wrong) as caught:
            preview(*arguments[:4], **({"width_px": arguments[4]} if len(arguments) > 4 else {}))
        assert "\n" not in str(caught.value) and len(str(caught.value)) > 20
        assert not out.exists() and (tmp_path / "there.png").read_text() == "mine"
