"""Labels as tiles under a VRT: what one GeoTIFF holds, all or nothing."""

import shutil
import subprocess
import threading
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
from affine import Affine
from rasterio.crs import CRS

from uavseg.errors import OutputError, OutputExistsError
from uavseg.execution.executors import threads
from uavseg.raster.formats import geotiff
from uavseg.raster.formats.geotiff import label_windows, write_label_geotiff, write_label_tiles
from uavseg.raster.grid.geobox import GeoBox
from uavseg.raster.grid.tiling import Window

GRID = Affine(0.5, 0, 300000.1, 0, -0.5, 4000000.3)
LOCAL = 'LOCAL_CS["mine",UNIT["metre",1],AXIS["x",EAST],AXIS["y",NORTH]]'
SOUTH_UP = "+proj=tmerc +lat_0=3 +lon_0=7 +k=0.9996 +x_0=1 +y_0=2 +ellps=GRS80 +units=us-ft +no_defs"
MARS = 'GEOGCS["Mars",DATUM["D_Mars",SPHEROID["Mars",3396190,169.8]],PRIMEM["0",0],UNIT["degree",0.0174532925199433],AXIS["Latitude",NORTH],AXIS["Longitude",EAST]]'  # noqa: E501


class Part:
    """A window of an image."""

    def __init__(self, image: np.ndarray, window: Window) -> None:
        self.window = window
        self.pixels = image[window.slices]

    def rasterise(self) -> np.ndarray:
        return self.pixels


@pytest.fixture(autouse=True)
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(geotiff, "LABEL_TILE_SIDE", 128)


def picture(shape: tuple[int, int] = (300, 420)) -> np.ndarray:
    coarse = np.random.default_rng(1).integers(0, 1 << 32, [side // 9 + 1 for side in shape])
    image = np.kron(coarse, np.ones((9, 9), np.int64))[: shape[0], : shape[1]].astype(np.uint32)
    image[:140, 100:300] = 0  # one tile has nothing
    return image


def write(path: Path, image: np.ndarray, transform: Affine = GRID, crs: Any = 32618, **how: Any) -> None:
    box = GeoBox(image.shape, transform, None if crs is None else CRS.from_user_input(crs))
    write_label_tiles(path, [Part(image, window) for window in label_windows(image.shape)], box, **how)


@pytest.mark.parametrize("crs", [32618, 4326, 2056, "EPSG:2193", "EPSG:7405", SOUTH_UP, MARS, LOCAL, None])
@pytest.mark.parametrize("transform", [GRID, Affine(1e-5, 2e-6, 9, 3e-6, -1e-5, 49.1), Affine.identity()])
@pytest.mark.filterwarnings("ignore::rasterio.errors.NotGeoreferencedWarning")
def test_the_vrt_is_the_same_raster_as_one_file(tmp_path: Path, crs: Any, transform: Affine) -> None:
    image = picture()
    write(tmp_path / "a.vrt", image, transform, crs)
    box = GeoBox(image.shape, transform, None if crs is None else CRS.from_user_input(crs))
    write_label_geotiff(tmp_path / "a.tif", [(Window(0, 0, *image.shape), image)], box)
    (tmp_path / "moved").mkdir()
    for name in ("a.vrt", "a.tiles"):  # paths are relative: both may move together
        (tmp_path / name).replace(tmp_path / "moved" / name)
    with rasterio.open(tmp_path / "moved" / "a.vrt") as tiled, rasterio.open(tmp_path / "a.tif") as one:
        assert np.array_equal(tiled.read(1), one.read(1)) and np.array_equal(one.read(1), image)
        assert (tiled.crs, tiled.transform) == (one.crs, one.transform)
        assert (tiled.nodata, tiled.dtypes, tiled.shape) == (0, ("uint32",), one.shape)
    with rasterio.open(tmp_path / "moved" / "a.tiles" / "0002-0001.tif") as tile:
        assert tile.transform.almost_equals(transform @ Affine.translation(128, 256), 1e-9)
        assert tile.crs == one.crs


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("gdalinfo") is None, reason="gdalinfo is not installed")
def test_gdalinfo_reads_it_and_sums_up_the_same(tmp_path: Path) -> None:
    image = picture()
    write(tmp_path / "a.vrt", image)
    write_label_geotiff(tmp_path / "a.tif", [(Window(0, 0, *image.shape), image)],
                 GeoBox(image.shape, GRID, CRS.from_epsg(32618)))  # fmt: skip
    told = [
        subprocess.run(["gdalinfo", "-checksum", path], cwd=tmp_path, capture_output=True, text=True)
        for path in ("a.vrt", "a.tif")
    ]
    metadata = [[line for line in run.stdout.splitlines() if "Checksum" in line or "Origin" in line or
              "PROJCRS" in line or "Pixel Size" in line] for run in told]  # fmt: skip
    assert metadata[0] == metadata[1] and len(metadata[0]) == 4 and told[0].stderr == ""


def test_tiles_without_labels_have_no_file(tmp_path: Path) -> None:
    write(tmp_path / "a.vrt", picture())
    files = sorted(path.name for path in (tmp_path / "a.tiles").iterdir())
    assert files == [f"000{r}-000{c}.tif" for r in range(3) for c in range(4) if (r, c) != (0, 1)]
    write(tmp_path / "b.vrt", np.zeros((200, 200), np.uint32))
    assert list((tmp_path / "b.tiles").iterdir()) == []
    with rasterio.open(tmp_path / "b.vrt") as file:
        assert not file.read(1).any() and file.nodata == 0


def test_the_executor_changes_no_byte(tmp_path: Path) -> None:
    found = []
    for name, run in (("one", threads(1)), ("many", threads(3))):
        (tmp_path / name).mkdir()
        write(tmp_path / name / "a.vrt", picture(), map=run)
        files = sorted(path for path in (tmp_path / name).rglob("*") if path.is_file())
        found.append({path.name: path.read_bytes() for path in files})
    assert found[0] == found[1] and len(found[0]) == 12


def test_existing_files_are_replaced_only_if_allowed(tmp_path: Path) -> None:
    write(tmp_path / "a.vrt", picture())
    before = (tmp_path / "a.vrt").read_bytes()
    with pytest.raises(OutputExistsError, match=r"a\.vrt exists; give --overwrite"):
        write(tmp_path / "a.vrt", picture((128, 128)))
    (tmp_path / "a.vrt").unlink()
    with pytest.raises(OutputExistsError, match=r"a\.tiles exists and is a part of a\.vrt; give --overwrite"):
        write(tmp_path / "a.vrt", picture((128, 128)))
    write(tmp_path / "a.vrt", picture((128, 128)), overwrite=True)
    assert (tmp_path / "a.vrt").read_bytes() != before
    assert [path.name for path in (tmp_path / "a.tiles").iterdir()] == ["0000-0000.tif"]  # none is left over
    assert {path.name for path in tmp_path.iterdir()} == {"a.vrt", "a.tiles"}


@pytest.mark.parametrize("stranger", ["notes.txt", "field.tif"])
def test_a_folder_with_other_files_is_never_replaced(tmp_path: Path, stranger: str) -> None:
    (tmp_path / "a.tiles").mkdir()
    (tmp_path / "a.tiles" / stranger).write_text("precious")
    with pytest.raises(OutputError, match=r"a\.tiles contains something else than label tiles"):
        write(tmp_path / "a.vrt", picture(), overwrite=True)
    assert (tmp_path / "a.tiles" / stranger).read_text() == "precious"
    assert {path.name for path in tmp_path.iterdir()} == {"a.tiles"}


def test_an_unfinished_output_never_appears_and_removes_nothing(tmp_path: Path) -> None:
    write(tmp_path / "a.vrt", picture())
    before = (tmp_path / "a.vrt").read_bytes()
    begun = threading.Event()

    def broken(function: Any, items: Any, progress: Any = None) -> Any:
        yield function(items[0])
        begun.set()
        raise RuntimeError("power cut")

    with pytest.raises(RuntimeError):
        write(tmp_path / "a.vrt", picture(), overwrite=True, map=broken)
    assert begun.is_set() and (tmp_path / "a.vrt").read_bytes() == before
    assert len(list((tmp_path / "a.tiles").iterdir())) == 11
    assert {path.name for path in tmp_path.iterdir()} == {"a.vrt", "a.tiles"}


def test_a_tile_that_a_worker_wrote_elsewhere_is_an_error(tmp_path: Path) -> None:
    def elsewhere(function: Any, items: Any, progress: Any = None) -> Any:
        return (item.window for item in items)

    with pytest.raises(OutputError, match="workers must share the folder of the labels"):
        write(tmp_path / "a.vrt", picture(), map=elsewhere)
    assert list(tmp_path.iterdir()) == []
