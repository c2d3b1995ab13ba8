"""A disk that fills up at any moment is reported for every format: a file that appears is complete."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pyproj
import pytest
import shapely

from uavseg.errors import OutputError
from uavseg.regions.formats import export
from uavseg.regions.formats.export import is_complete
from uavseg.regions.table import Regions

resource = pytest.importorskip("resource", reason="only Unix limits the size of files")
FORMATS = ["geojson", "gpkg", "fgb", "parquet", "shp", "kml"]
COUNTS = [0, 1, 17, 300]  # FlatGeobuf's index has nodes of 16
UTM = pyproj.CRS.from_epsg(32618).to_wkt()


def squares(count: int) -> Regions:
    x, y = np.random.default_rng(count).random((2, count)) * 1e4
    columns = {
        "id": np.arange(1, count + 1),
        "area_m2": np.full(count, 400.0),
        "pixels": np.full(count, 100),
        "mean": y / 1e4,
        "source": np.full(count, "a.tif", object),
    }
    return Regions(columns, shapely.box(4e5 + x, 5e6 + y, 4e5 + x + 20, 5e6 + y + 20), UTM)


@contextmanager
def room_for(size: int) -> Iterator[None]:
    """Files of at most so many bytes."""
    usual = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, usual[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, usual)


@pytest.mark.parametrize("count", COUNTS)
@pytest.mark.parametrize("extension", FORMATS)
def test_a_file_that_appears_on_a_full_disk_is_complete(tmp_path: Path, extension: str, count: int) -> None:
    (tmp_path / "whole").mkdir()
    export.write_regions(squares(count), tmp_path / "whole" / f"a.{extension}")
    whole = {path.name: path.read_bytes() for path in (tmp_path / "whole").iterdir()}
    sizes = {len(data) - less for data in whole.values() for less in (1, len(data) // 2)}
    for size in sorted(sizes | {max(map(len, whole.values())) - 4096} - {0}):
        if size < 0:
            continue
        (tmp_path / str(size)).mkdir()
        with room_for(size), pytest.raises(OutputError, match="cannot") as told:
            export.write_regions(squares(count), tmp_path / str(size) / f"a.{extension}")
        assert "\n" not in str(told.value) and len(str(told.value)) < 300
        assert list((tmp_path / str(size)).iterdir()) == []


@pytest.mark.parametrize("count", COUNTS)
@pytest.mark.parametrize("extension", ["fgb", "shp"])
def test_a_file_is_complete_with_all_its_regions_and_bytes(
    tmp_path: Path, extension: str, count: int
) -> None:
    path = tmp_path / f"a.{extension}"
    export.write_regions(squares(count), path)
    assert is_complete(path, count)
    assert not is_complete(path, count + 1)
    for part in (path, *(path.with_suffix(end) for end in (".shx", ".dbf", ".prj") if extension == "shp")):
        data = part.read_bytes()
        for keep in (len(data) - 1, len(data) // 2, 0):
            part.write_bytes(data[:keep])
            assert not is_complete(path, count)
        part.write_bytes(data)
    assert is_complete(path, count)
