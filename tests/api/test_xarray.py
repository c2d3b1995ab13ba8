"""The accessor of xarray: the functions of uavseg over a DataArray."""

from pathlib import Path

import numpy as np
import pytest
import rasterio
from affine import Affine

import uavseg

rioxarray = pytest.importorskip("rioxarray")
pytest.importorskip("uavseg.xarray")


@pytest.fixture
def name(tmp_path: Path) -> str:
    image = np.full((80, 90), 30, np.uint8)
    image[16:56, 16:64] = 200
    place = {"crs": "EPSG:32618", "transform": Affine(2, 0, 4e5, 0, -2, 5e6)}
    path = str(tmp_path / "tile.tif")
    with rasterio.open(path, "w", "GTiff", 90, 80, 1, dtype="uint8", **place) as file:
        file.write(image, 1)
    return path


def test_a_range_gives_the_regions_of_the_file(name: str) -> None:
    with rioxarray.open_rasterio(name) as array:
        found = array.uavseg.extract((0.55, 1))
    expected = uavseg.extract(name, (0.55, 1))
    assert found.crs == expected.crs and found.geometry.geom_equals(expected.geometry).all()
    assert found["pixels"].tolist() == expected["pixels"].tolist() == [40 * 48]


def test_every_method_is_a_function_of_the_package() -> None:
    from uavseg.xarray import UavsegAccessor

    methods = [name for name in vars(UavsegAccessor) if not name.startswith("_")]
    assert len(methods) == 7 and set(methods) <= set(uavseg.__all__)


@pytest.mark.parametrize(("job", "choices"), [("info", []), ("divide", []), ("levels", [0.5])])
def test_jobs_of_an_array_are_those_of_the_file(name: str, job: str, choices: list[float]) -> None:
    with rioxarray.open_rasterio(name) as array:
        found = getattr(array.uavseg, job)(*choices)
    expected = getattr(uavseg, job)(name, *choices)
    if job == "divide":
        assert np.array_equal(found.sums, expected.sums) and np.array_equal(found.ratios, expected.ratios)
    elif job == "levels":
        assert found.geometry.geom_equals(expected.geometry).all()
    else:
        assert type(found) is type(expected) and found.as_dict().keys() == expected.as_dict().keys()
