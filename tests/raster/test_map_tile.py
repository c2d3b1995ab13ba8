"""Tiles of a web map show what is segmented: the pixels and the validity of `Dataset.read`."""

from pathlib import Path
from typing import Any

import geopandas
import numpy as np
import pytest
import rasterio
import shapely
from affine import Affine
from rasterio.enums import ColorInterp

from uavseg.jobs.source.open_source import open_raster
from uavseg.jobs.source.source import Raster
from uavseg.jobs.source.work import SERIAL
from uavseg.jobs.web_map.content import has_map_tiles, read_map_tile
from uavseg.options.reading import ReadOptions
from uavseg.raster.grid.tiling import Window

pytest.importorskip("rio_tiler")

ZOOM, TILE = 18, (140_000, 93_000)
PIXEL = 2 * np.pi * 6378137 / 256 / 2**ZOOM
ROWS, COLS = 300, 330  # the tile begins at row 20 and column 30
RNG = np.random.default_rng(3)


def write(path: Path, bands: Any, col: float = 0, **how: Any) -> Path:
    """A raster whose pixels are those of the tiles."""
    colors, palette = how.pop("colorinterp", None), how.pop("palette", None)
    bands = np.asarray(bands)
    x = (TILE[0] * 256 - 30 + col) * PIXEL - np.pi * 6378137
    y = np.pi * 6378137 - (TILE[1] * 256 - 20) * PIXEL
    profile = {"driver": "GTiff", "count": len(bands), "dtype": bands.dtype, "crs": "EPSG:3857"}
    shape = {"height": bands.shape[1], "width": bands.shape[2]}
    transform = Affine(PIXEL, 0, x, 0, -PIXEL, y)
    with rasterio.open(path, "w", **profile, **shape, transform=transform, **how) as file:
        file.write(bands)
        if colors:
            file.colorinterp = colors
        if palette:
            file.write_colormap(1, palette)
    return path


def some(count: int, dtype: str = "uint8", low: int = 0, high: int = 256) -> np.ndarray:
    return RNG.integers(low, high, (count, ROWS, COLS)).astype(dtype)


def collared() -> np.ndarray:
    image = some(1, low=40)
    image[:, :40], image[:, :, :70], image[:, -30:], image[:, :, -60:] = 0, 0, 0, 0
    return image


def one_of(path: Path, kind: str) -> Raster:
    rgba = [ColorInterp.red, ColorInterp.green, ColorInterp.blue, ColorInterp.alpha]
    if kind == "collar":
        return open_raster(write(path / "a.tif", collared()))
    if kind == "collar kept":
        return open_raster(write(path / "a.tif", collared()), ReadOptions(collar="keep"))
    if kind == "nodata":
        return open_raster(write(path / "a.tif", some(1, high=4), nodata=0))
    if kind == "nodata that may be a color":
        return open_raster(write(path / "a.tif", some(3, high=3), nodata=0, photometric="RGB"))
    if kind == "nodata of the user":
        return open_raster(write(path / "a.tif", some(1, "int16", -4, 4), nodata=0), ReadOptions(nodata=-3.0))
    if kind == "not a number":
        values = some(1, "float32")
        values[values < 60] = np.nan
        return open_raster(write(path / "a.tif", values))
    if kind == "alpha":
        bands = some(4, high=3)
        bands[3] *= 100  # 0, 100, 200: translucent pixels are valid
        return open_raster(write(path / "a.tif", bands, colorinterp=rgba))
    if kind == "palette":
        palette = {k: (10 * k, 250 - 10 * k, 7, 255 if k else 0) for k in range(20)}
        return open_raster(write(path / "a.tif", some(1, high=20), photometric="palette", palette=palette))
    if kind == "white is zero":
        return open_raster(write(path / "a.tif", some(1), photometric="MINISWHITE"))
    if kind == "index":
        names = ReadOptions(index="ndvi", band_names="blue,green,red,nir")
        return open_raster(write(path / "a.tif", some(4, "uint16", 0, 5000), nodata=0), names)
    if kind == "expression":
        return open_raster(write(path / "a.tif", some(2)), ReadOptions(expr="b2 / (b1 - 100)"))
    if kind == "second band of another type":
        file = write(path / "a.tif", some(1))
        other = write(path / "b.tif", RNG.random((1, ROWS, COLS)).astype(np.float32))
        return open_raster(stacked(path / "c.vrt", file, other), ReadOptions(band=2))
    left = some(1, high=3)
    right = some(1, high=3)
    off = 0.3 if kind == "warped mosaic" else 0
    files = [write(path / "a.tif", left, nodata=0), write(path / "b.tif", right, col=100 + off, nodata=0)]
    return open_raster(files, ReadOptions(warp=bool(off)))


def stacked(path: Path, *files: Path) -> Path:
    """Files as bands of a VRT."""
    bands = ""
    for number, (file, kind) in enumerate(zip(files, ("Byte", "Float32"), strict=True), start=1):
        source = f'<SourceFilename relativeToVRT="1">{file.name}</SourceFilename><SourceBand>1</SourceBand>'
        bands += (
            f'<VRTRasterBand dataType="{kind}" band="{number}"><SimpleSource>{source}</SimpleSource>'
            "</VRTRasterBand>"
        )
    with rasterio.open(files[0]) as file:
        numbers = ", ".join(map(repr, file.transform.to_gdal()))
        head = f"<SRS>EPSG:3857</SRS><GeoTransform>{numbers}</GeoTransform>"
    path.write_text(f'<VRTDataset rasterXSize="{COLS}" rasterYSize="{ROWS}">{head}{bands}</VRTDataset>')
    return path


KINDS = [
    *("collar", "collar kept", "nodata", "nodata that may be a color", "nodata of the user", "not a number"),
    *("alpha", "palette", "white is zero", "index", "expression", "second band of another type", "mosaic"),
    "warped mosaic",
]


@pytest.mark.parametrize("kind", KINDS)
def test_a_tile_has_the_pixels_that_are_segmented(kind: str, tmp_path: Path) -> None:
    raster = one_of(tmp_path, kind)
    dataset = raster.cleaned(SERIAL.over(raster))
    assert (dataset.collar is not None) == (kind == "collar")
    assert has_map_tiles(dataset)
    for across, down in [(0, 0), (1, 0), (-1, -1)]:
        found = read_map_tile(dataset, (ZOOM, TILE[0] + across, TILE[1] + down))
        row, col = 20 + 256 * down, 30 + 256 * across
        window = Window(max(row, 0), max(col, 0), 0, 0)
        ends = min(row + 256, dataset.geobox.shape[0]), min(col + 256, dataset.geobox.shape[1])
        window = Window(window.row, window.col, ends[0] - window.row, ends[1] - window.col)
        values, valid = dataset.read(window)
        expected = np.zeros((256, 256), bool)
        here = (
            slice(window.row - row, window.row - row + window.rows),
            slice(window.col - col, window.col - col + window.cols),
        )
        expected[here] = True if valid is None else valid
        if not expected.any():
            assert found is None
            continue
        assert found is not None
        assert np.array_equal(found[1], expected)
        inside = expected[here]
        assert found[0].dtype == values.dtype
        assert np.array_equal(found[0][(slice(None), *here)][:, inside], values[:, inside])


def test_there_is_no_tile_beside_a_raster(tmp_path: Path) -> None:
    raster = one_of(tmp_path, "mosaic")
    assert read_map_tile(raster.dataset, (ZOOM, TILE[0] + 5, TILE[1])) is None


def test_arrays_have_no_tiles() -> None:
    assert not has_map_tiles(open_raster(np.zeros((70, 70), np.uint8)).dataset)


@pytest.mark.parametrize("kind", ["bounds", "area"])
def test_of_a_part_there_are_the_pixels_that_are_read(kind: str, tmp_path: Path) -> None:
    image = some(1, low=1)
    path = write(tmp_path / "a.tif", image)
    with rasterio.open(path) as file:
        (west, north), (east, south) = file.transform @ (60, 50), file.transform @ (200, 180)
    area = shapely.Point((west + east) / 2, (north + south) / 2).buffer((east - west) / 3)
    geopandas.GeoDataFrame(geometry=[area], crs=3857).to_file(tmp_path / "area.gpkg")
    part = {"bounds": (west, south, east, north), "area": None}[kind]
    options = ReadOptions(bounds=part, aoi=tmp_path / "area.gpkg" if kind == "area" else None)
    dataset = open_raster(path, options).dataset
    _, valid = dataset.read(Window(0, 0, *dataset.geobox.shape))
    x, y = ~file.transform @ (dataset.geobox.transform.c, dataset.geobox.transform.f)
    here = Window(round(y) - 20, round(x) - 30, *dataset.geobox.shape).slices
    expected = np.zeros((256, 256), bool)
    expected[here] = True if valid is None else valid
    found = read_map_tile(dataset, (ZOOM, *TILE))
    assert found is not None and 5000 < expected.sum() < 256 * 256
    assert np.array_equal(found[1], expected)
    assert np.array_equal(found[0][0][expected], image[0, 20 : 20 + 256, 30 : 30 + 256][expected])
    assert read_map_tile(dataset, (ZOOM, TILE[0] + 1, TILE[1])) is None  # the raster reaches there
