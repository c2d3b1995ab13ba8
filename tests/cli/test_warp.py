"""`--warp`: a raster of which one half lies on another grid is answered as the whole one is."""

import json
from pathlib import Path
from typing import Any

import geopandas
import numpy as np
import pytest
import rasterio
from affine import Affine
from click.testing import CliRunner, Result
from rasterio.warp import Resampling, calculate_default_transform, reproject

import uavseg
from uavseg.cli import main
from uavseg.raster.grid.tiling import Window

QUARRY = Path(__file__).parents[2] / "samples" / "quarry.tif"
RANGE = ("--range", "0.7,1")
RUN = ("--tile", "64", "--threads", "2")
NOTE = "read by nearest neighbour on the pixel grid of left.tif (pixels of "


def run(*arguments: object) -> Result:
    return CliRunner().invoke(main, [*map(str, arguments)])


def done(*arguments: object) -> Result:
    result = run(*arguments)
    assert result.exit_code == 0, result.output
    return result


def save(name: str, pixels: np.ndarray, **how: Any) -> None:
    size = {"count": len(pixels), "height": pixels.shape[1], "width": pixels.shape[2]}
    with rasterio.open(name, "w", "GTiff", dtype=pixels.dtype.name, **size, **how) as file:
        file.write(pixels)


def halve(raster: Path, crs: str, step: float = 1.0) -> None:
    """Write the left half of a raster, and the right half, with some overlap, warped to another CRS."""
    with rasterio.open(raster) as file:
        pixels, grid, own = file.read([1]), file.transform, file.crs
    cut, nodata = pixels.shape[2] // 2, 0 if pixels.dtype.kind == "u" else -9999
    pixels = np.maximum(pixels, 1) if nodata == 0 else pixels  # so that no pixel of it is nodata
    save("whole.tif", pixels, crs=own, transform=grid, nodata=nodata)
    save("left.tif", pixels[:, :, :cut], crs=own, transform=grid, nodata=nodata)
    right, place = pixels[:, :, cut - 4 :], grid * Affine.translation(cut - 4, 0)
    bounds = rasterio.transform.array_bounds(*right.shape[1:], place)
    there, width, height = calculate_default_transform(own, crs, *right.shape[:0:-1], *bounds)
    there, width, height = there * Affine.scale(step), round(width / step), round(height / step)
    warped = np.full((1, height, width), nodata, pixels.dtype)
    how = {"src_transform": place, "src_crs": own, "dst_transform": there, "dst_crs": crs}
    reproject(right, warped, **how, dst_nodata=nodata, resampling=Resampling.nearest)
    save("right.tif", warped, crs=crs, transform=there, nodata=nodata)


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty folder to work in, with both halves of the quarry: the right one in the next UTM zone."""
    monkeypatch.chdir(tmp_path)
    halve(QUARRY, "EPSG:32611")
    return tmp_path


def assert_near(found: geopandas.GeoDataFrame, whole: geopandas.GeoDataFrame, pixel: float) -> None:
    """Check that regions differ from those of the whole by less than a pixel along their outlines."""
    a, b = found.union_all(), whole.union_all()
    assert a.symmetric_difference(b).area < 0.7 * pixel * b.length
    assert abs(a.area - b.area) < 0.1 * pixel * b.length


@pytest.mark.slow
def test_regions_are_those_of_the_whole_raster() -> None:
    refused = run("extract", "left.tif", "right.tif", *RANGE, "-o", "no.gpkg")
    assert refused.exit_code == 1 and "give --warp (warp=True)" in refused.stderr
    found = done("extract", "left.tif", "right.tif", "--warp", *RANGE, "-o", "found.gpkg")
    assert found.stderr.count(NOTE) == 1 and "right.tif (pixels of 0.50" in found.stderr
    done("extract", "whole.tif", *RANGE, "-o", "whole.gpkg")
    frames = [geopandas.read_file(name) for name in ("found.gpkg", "whole.gpkg")]
    assert_near(*frames, 0.5)
    largest = [frame.area_m2.nlargest(4).to_numpy() for frame in frames]
    assert np.allclose(*largest, rtol=0.01) and largest[0][3] > 1000
    made = done("info", "found.gpkg").stdout
    assert "warp             true" in made and "left.tif, right.tif" in made


def test_a_half_that_is_south_up_gives_the_very_same_regions() -> None:
    with rasterio.open("whole.tif") as file:
        pixels, grid, crs = file.read(), file.transform, file.crs
    place = grid * Affine.translation(300, pixels.shape[1]) * Affine.scale(1, -1)
    save("right.tif", pixels[:, ::-1, 300:], crs=crs, transform=place, nodata=0)
    both = uavseg.Dataset.open(["left.tif", "right.tif"], warp=True)
    assert both.geobox == uavseg.Dataset.open("whole.tif").geobox
    done("extract", "left.tif", "right.tif", "--warp", *RANGE, "-o", "found.geojson")
    done("extract", "whole.tif", *RANGE, "-o", "whole.geojson")
    found, whole = (
        json.loads(Path(f"{name}.geojson").read_text())["features"] for name in ("found", "whole")
    )
    for feature in (*found, *whole):
        del feature["properties"]["source"]
    assert found == whole and len(found) > 5


@pytest.mark.slow
@pytest.mark.parametrize("command", ["extract", "levels"])
def test_tiles_threads_and_a_second_run_change_no_byte(command: str) -> None:
    how = (*RANGE,) if command == "extract" else ("--width", "0.25")
    how = (command, "left.tif", "right.tif", "--warp", *how)
    done(*how, "-o", "a.fgb", "--labels", "a.tif", "--tile", "1024", "--threads", "1")
    done(*how, "-o", "b.fgb", "--labels", "b.tif", *RUN)
    done(*how, "-o", "c.fgb", "--labels", "c.tif", *RUN, "--resume", "kept")
    done(*how, "-o", "c.fgb", "--labels", "c.tif", *RUN, "--resume", "kept", "--overwrite")
    for ending in ("fgb", "tif"):
        contents = {Path(f"{name}.{ending}").read_bytes() for name in "abc"}
        assert len(contents) == 1


@pytest.mark.slow
def test_a_part_of_it_has_the_pixels_of_the_whole() -> None:
    bounds = (512440.3, 5478380.2, 512600.7, 5478500.9)
    whole = uavseg.Dataset.open(["left.tif", "right.tif"], warp=True)
    done("divide", "left.tif", "right.tif", "--warp", "--bounds", ",".join(map(str, bounds)), "-o", "map.tif")
    with rasterio.open("map.tif") as file:
        header = json.loads(file.tags()["UAVSEG_BLOCK_MAP"])
    assert header["warp"] is True and (header["rows"], header["cols"]) == (242, 320)
    col, row = (round(one) for one in ~whole.geobox.transform * (512440.5, 5478501))
    values, valid = whole.read(Window(row, col, header["rows"], header["cols"]))
    with rasterio.open("GTIFF_DIR:3:map.tif") as file:
        counts = file.read(1)
    assert counts.sum() == (values[0].size if valid is None else valid.sum())
    of_map = done("extract", "map.tif", *RANGE, "-o", "of_map.fgb")  # refined with both files
    of_rasters = ("left.tif", "right.tif", "--warp", "--bounds", ",".join(map(str, bounds)))
    done("extract", *of_rasters, *RANGE, "-o", "of_rasters.fgb")
    found, expected = (geopandas.read_file(f"{name}.fgb") for name in ("of_map", "of_rasters"))
    assert list(found.pixels) == list(expected.pixels) and found.geometry.equals(expected.geometry)
    assert "block edges" not in of_map.stderr


@pytest.mark.slow
def test_a_summary_names_the_files_that_are_warped_and_the_line_to_try_warps_them() -> None:
    summary = json.loads(done("info", "left.tif", "right.tif", "--warp", "--json").stdout)
    assert [one for one in summary["warnings"] if one.startswith(NOTE)]
    assert summary["command"].startswith("uavseg extract left.tif right.tif --warp --range")
    assert NOTE in done("info", "left.tif", "right.tif", "--warp").stdout
    with pytest.warns(UserWarning, match="read by nearest neighbour on the pixel grid of left"):
        uavseg.extract(["left.tif", "right.tif"], (0.7, 1), warp=True)


def test_both_halves_are_drawn_without_a_seam() -> None:
    done("preview", "left.tif", "right.tif", "--warp", "-o", "p.png", "--width", "640")
    dataset = uavseg.Dataset.open(["left.tif", "right.tif"], warp=True)
    with rasterio.open("whole.tif") as file:
        whole, grid = file.read(1).astype(int), file.transform
    rows, cols = whole.shape
    col, row = (round(one) for one in ~dataset.geobox.transform * (grid.c, grid.f))
    values, valid = dataset.read(Window(row + 2, col, rows - 4, cols - 2))
    assert valid is None or valid.all()
    off = np.abs(values[0].astype(int) - whole[2:-2, :-2])
    assert not off[:, : cols // 2].any()  # where both have pixels, the first file wins
    assert np.median(off) < 3  # and the others are neighbours


@pytest.mark.slow
def test_one_raster_is_its_own_grid() -> None:
    done("extract", "whole.tif", *RANGE, "-o", "a.fgb")
    said = done("extract", "whole.tif", "--warp", *RANGE, "-o", "b.fgb").stderr
    a, b = (geopandas.read_file(f"{name}.fgb") for name in "ab")
    assert a.equals(b) and "nearest" not in said
    done("extract", "left.tif", "right.tif", "--each", "--warp", *RANGE, "-o", "{stem}.fgb")
    assert {"left.fgb", "right.fgb"} <= {path.name for path in Path().iterdir()}


@pytest.mark.slow
def test_it_is_refused_where_there_is_nothing_to_warp() -> None:
    done("divide", "whole.tif", "-o", "map.tif")
    refused = run("extract", "map.tif", "--warp", *RANGE, "-o", "no.gpkg")
    assert "answered as a whole" in refused.stderr and "leave warp out" in refused.stderr
    done("extract", "whole.tif", *RANGE, "-o", "r.gpkg")
    assert "warp" in run("info", "r.gpkg", "--warp").stderr
    assert not Path("no.gpkg").exists()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "crs", "interval", "step"),
    [
        ("imagery/naip_forest_gap_1m.tif", "EPSG:4326", "0.6,1", 1.0),
        ("imagery/naip_potholes_2015.tif", "EPSG:5070", "0,0.25", 1.0),
        ("imagery/landsat8_greenland_B5.tif", "EPSG:3413", "0.5,1", 1.0),
        ("imagery/uav_forest_snow_clearing_mask.tif", "EPSG:32610", "0.6,1", 1.0),
        ("dem/ny_dsm_2m.tif", "EPSG:32618", "0.5,1", 0.5),
    ],
)
def test_halves_of_real_rasters_are_those_of_the_whole(
    shared_data: Path, name: str, crs: str, interval: str, step: float
) -> None:
    for old in ("left.tif", "right.tif", "whole.tif"):
        Path(old).unlink()
    if not (shared_data / name).exists():
        pytest.skip(f"{name} is not there")
    halve(shared_data / name, crs, step)
    with rasterio.open("whole.tif") as file:
        stretch = (
            "0,255" if file.dtypes[0] == "uint8" else ",".join(map(str, np.percentile(file.read(), [2, 98])))
        )
        pixel = abs(file.transform.a)
    how = ("--range", interval, "--stretch", stretch, "--collar", "keep", "--refine", "pixels")
    done("extract", "left.tif", "right.tif", "--warp", *how, "-o", "found.gpkg")
    done("extract", "whole.tif", *how, "-o", "whole.gpkg")
    frames = [geopandas.read_file(each) for each in ("found.gpkg", "whole.gpkg")]
    assert_near(*frames, pixel)
