"""Bounds and areas of interest: the same as a file that was cut out, for every command that reads rasters."""

import json
import warnings
from pathlib import Path
from typing import Any

import geopandas
import numpy as np
import pytest
import rasterio
import shapely
from affine import Affine
from click.testing import CliRunner
from hypothesis import given, strategies as st
from numpy.typing import NDArray
from PIL import Image
from rasterio.features import geometry_mask
from rasterio.windows import from_bounds

import uavseg
from uavseg.cli import main
from uavseg.errors import UavsegError
from uavseg.jobs.source.open_source import open_source
from uavseg.options.reading import ReadOptions
from uavseg.raster.grid.tiling import Window

PLACE = Affine(0.5, 0, 5e5, 0, -0.5, 5e6)
TURNED = PLACE @ Affine.rotation(30)
SAMPLES = Path(__file__).parents[2] / "samples"


def picture(seed: int = 0, shape: tuple[int, int] = (200, 260)) -> NDArray[np.uint8]:
    rng = np.random.default_rng(seed)
    rows, cols = np.indices(shape)
    wide = 127 + 60 * np.sin(rows / 23) * np.cos(cols / 31)
    return np.clip(wide + rng.normal(0, 12, shape), 1, 255).astype(np.uint8)


def write(
    path: Path, image: NDArray[Any], place: Affine = PLACE, nodata: float | None = 0, epsg: int | None = 32633
) -> str:
    crs = None if epsg is None else rasterio.CRS.from_epsg(epsg)
    profile = {"driver": "GTiff", "height": image.shape[0], "width": image.shape[1], "count": 1}
    with rasterio.open(
        path, "w", **profile, dtype=image.dtype.name, nodata=nodata, crs=crs, transform=place
    ) as file:
        file.write(image, 1)
    return str(path)


def write_area(path: Path, *polygons: Any, epsg: int | None = 32633) -> str:
    crs = None if epsg is None else f"EPSG:{epsg}"
    geopandas.GeoDataFrame(geometry=list(polygons), crs=crs).to_file(path)
    return str(path)


def pixels(source: Any, **how: Any) -> tuple[NDArray[Any], NDArray[np.bool_], Affine]:
    """Values with 0 where they are not valid, validity and transform of all of a source."""
    dataset = open_source(source, ReadOptions(**how)).dataset  # type: ignore[union-attr]
    values, valid = dataset.read(Window(0, 0, *dataset.geobox.shape))
    valid = np.ones(dataset.geobox.shape, bool) if valid is None else valid
    return np.where(valid, values[0], 0), valid, dataset.geobox.transform


def run(*words: str) -> str:
    done = CliRunner().invoke(main, list(words))
    assert done.exit_code == 0, done.output
    return done.stdout


def features(path: Path) -> Any:
    """Regions of a file, without the name of their raster and how it was read."""
    found = json.loads(path.read_text())["features"]
    for one in found:
        del one["properties"]["source"]
    return found


ends = st.tuples(st.floats(-20, 150), st.floats(-20, 150), st.floats(1, 150), st.floats(1, 150))


@given(ends)
def test_bounds_hold_pixels_whose_centres_lie_between_them(some: tuple[float, float, float, float]) -> None:
    image = picture()
    west, south, width, height = some
    bounds = (west, south - 100, west + width, south + height - 100)
    x, y = np.arange(260) / 2 + 0.25, -np.arange(200) / 2 - 0.25
    cols = np.flatnonzero((bounds[0] <= x) & (x < bounds[2]))
    rows = np.flatnonzero((bounds[1] < y) & (y <= bounds[3]))
    placed = (image, Affine(0.5, 0, 0, 0, -0.5, 0))
    dataset = uavseg.Dataset.of_values(placed[0], uavseg.GeoBox(image.shape, placed[1], None), "a")
    if not (len(rows) and len(cols)):
        with pytest.raises(UavsegError, match="holds no pixel of what is read"):
            open_source(dataset, ReadOptions(bounds=bounds))
        return
    values, valid, place = pixels(dataset, bounds=bounds)
    assert valid.all()
    np.testing.assert_array_equal(values, image[np.ix_(rows, cols)])
    assert place @ (0, 0) == (cols[0] / 2, -rows[0] / 2)


@pytest.mark.slow
@given(st.floats(1, 129), st.floats(-99, -1))
def test_parts_beside_each_other_have_every_pixel_once(x: float, y: float) -> None:
    image = picture()
    box = uavseg.GeoBox(image.shape, Affine(0.5, 0, 0, 0, -0.5, 0), None)
    dataset = uavseg.Dataset.of_values(image, box, "a")
    counts = []
    for bounds in ((-9, -900, x, y), (-9, y, x, 9), (x, -900, 900, y), (x, y, 900, 9)):
        counts.append(pixels(dataset, bounds=bounds)[0].size)
    assert sum(counts) == image.size


@pytest.mark.parametrize("turned", [False, True])
def test_an_area_is_as_rasterio_draws_it(turned: bool, tmp_path: Path) -> None:
    place, image = TURNED if turned else PLACE, picture()
    raster = write(tmp_path / "a.tif", image, place)
    (x, y), (x2, y2) = place @ (90, 60), place @ (200, 140)
    hole = shapely.Point(x, y).buffer(20).difference(shapely.Point(x, y).buffer(7))
    other = shapely.Polygon([(x2, y2), (x2 + 30, y2 + 3), (x2 + 4, y2 + 22)])
    area = write_area(tmp_path / "a.gpkg", hole, other)
    expected = geometry_mask([hole, other], image.shape, place, invert=True)
    rows, cols = np.nonzero(expected)
    inside = slice(rows.min(), rows.max() + 1), slice(cols.min(), cols.max() + 1)
    values, valid, found = pixels(raster, aoi=area)
    row, col = (round(number) for number in (~place @ (found.c, found.f))[::-1])
    whole = np.zeros(image.shape, bool)
    whole[row : row + valid.shape[0], col : col + valid.shape[1]] = valid
    np.testing.assert_array_equal(whole, expected)
    assert 0 <= valid.size - expected[inside].size <= 2 * sum(valid.shape)  # a row that has no centre inside
    np.testing.assert_array_equal(values[valid], image[expected])


def test_bounds_of_a_turned_raster_are_those_of_the_map(tmp_path: Path) -> None:
    raster, image = write(tmp_path / "a.tif", picture(), TURNED), picture()
    cols, rows = np.meshgrid(np.arange(260) + 0.5, np.arange(200) + 0.5)
    x, y = TURNED @ (cols, rows)
    bounds = (x.mean() - 21.3, y.mean() - 11.7, x.mean() + 30.1, y.mean() + 25.2)
    expected = (bounds[0] < x) & (x < bounds[2]) & (bounds[1] < y) & (y < bounds[3])
    values, valid, _ = pixels(raster, bounds=bounds)
    assert valid.sum() == expected.sum() > 1000
    np.testing.assert_array_equal(values[valid], image[expected])


def test_bounds_and_an_area_go_together(tmp_path: Path) -> None:
    raster = write(tmp_path / "a.tif", picture())
    disc = shapely.Point(5e5 + 40, 5e6 - 50).buffer(20)
    area = write_area(
        tmp_path / "a.geojson", geopandas.GeoSeries([disc], crs=32633).to_crs(4326)[0], epsg=4326
    )
    bounds = (5e5 + 35, 5e6 - 90, 5e5 + 90, 5e6 - 45)
    both = pixels(raster, aoi=area, bounds=bounds)[1].sum()
    expected = geometry_mask([disc & shapely.box(*bounds)], (200, 260), PLACE, invert=True).sum()
    assert both == expected > 500


@pytest.mark.slow
@pytest.mark.parametrize("tile", [64, 128, None])
@pytest.mark.parametrize("collar", ["auto", "keep"])
def test_regions_are_those_of_a_file_that_rasterio_cut_out(
    tile: int | None, collar: str, tmp_path: Path
) -> None:
    image = picture()
    image[:30, 40:] = image[:, 230:] = 0  # a black collar, not tagged
    raster = write(tmp_path / "a.tif", image, nodata=None)
    bounds = (5e5 + 20, 5e6 - 80, 5e5 + 125, 5e6)
    with rasterio.open(raster) as file:
        window = from_bounds(*bounds, file.transform).round_offsets().round_lengths()
        cut = write(tmp_path / "b.tif", file.read(1, window=window), file.window_transform(window), None)
    words = ["--range", "0.5,1", "--collar", collar, "-q", *(("--tile", str(tile)) if tile else ())]
    given_bounds = ",".join(f"{number:.12g}" for number in bounds)
    run("extract", raster, *words, "--bounds", given_bounds, "-o", str(tmp_path / "a.geojson"))
    run("extract", cut, *words, "-o", str(tmp_path / "b.geojson"))
    assert features(tmp_path / "a.geojson") == features(tmp_path / "b.geojson") != []
    made = json.loads((tmp_path / "a.geojson").read_text())["uavseg"]
    assert made["bounds"] == list(bounds)


@pytest.mark.slow
def test_an_area_is_as_nodata_beyond_it(tmp_path: Path) -> None:
    """A raster whose file has nodata there, at the same place, gives the same regions, pictures and sums."""
    image = picture()
    area_shape = shapely.Polygon([(5e5 + 3, 5e6 - 4), (5e5 + 120, 5e6 - 20), (5e5 + 60, 5e6 - 95)])
    raster = write(tmp_path / "a.tif", image)
    area = write_area(tmp_path / "area.fgb", area_shape)
    values, valid, place = pixels(raster, aoi=area)
    cut = write(tmp_path / "b.tif", np.where(valid, values, 0).astype(np.uint8), place)
    for name, source, words in (("a", raster, ["--aoi", area]), ("b", cut, [])):
        run("extract", source, *words, "--range", "0.5,1", "-q", "-o", str(tmp_path / f"{name}.geojson"))
        run("levels", source, *words, "--width", "0.2", "-q", "-o", str(tmp_path / f"{name}.l.geojson"))
        run("preview", source, *words, "-q", "-o", str(tmp_path / f"{name}.png"))
    assert features(tmp_path / "a.geojson") == features(tmp_path / "b.geojson") != []
    assert features(tmp_path / "a.l.geojson") == features(tmp_path / "b.l.geojson") != []
    one, other = (np.asarray(Image.open(tmp_path / f"{name}.png")) for name in "ab")
    assert one.shape == other.shape
    np.testing.assert_array_equal(one[100:-100], other[100:-100])  # titles name the file
    about = json.loads(run("info", raster, "--aoi", area, "--json"))
    same = json.loads(run("info", cut, "--json"))
    assert about["histogram"] == same["histogram"] and about["rows"] == same["rows"] < 200


def test_a_mosaic_is_cut_as_one_raster(tmp_path: Path) -> None:
    image = np.add.outer(np.arange(200) // 2, np.arange(260) // 2).astype(np.uint8)
    whole = write(tmp_path / "whole.tif", image, nodata=None)
    parts = [
        write(
            tmp_path / f"{row}{col}.tif",
            image[row : row + 100, col : col + 130],
            PLACE @ Affine.translation(col, row),
            None,
        )
        for row in (0, 100)
        for col in (0, 130)
    ]
    area = write_area(tmp_path / "area.gpkg", shapely.Point(5e5 + 60, 5e6 - 45).buffer(38.3))
    for how in ({"aoi": area}, {"bounds": (5e5 + 10, 5e6 - 66.2, 5e5 + 90, 5e6 - 20)}):
        one, several = pixels(whole, **how), pixels(parts, **how)
        for expected, found in zip(one, several, strict=True):
            np.testing.assert_array_equal(np.asarray(expected), np.asarray(found))
        coarse = [
            open_source(source, ReadOptions(**how)).dataset.read_coarse(64) for source in (whole, parts)
        ]  # type: ignore[union-attr, arg-type]
        assert coarse[0][2] == coarse[1][2]
        differences = coarse[0][0].astype(int) - coarse[1][0]  # nearest pixels, of files of other sizes
        assert abs(differences).max() <= 9


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["bounds", "aoi"])
def test_a_block_map_answers_for_its_part(kind: str, tmp_path: Path) -> None:
    raster = write(tmp_path / "a.tif", picture())
    area = write_area(tmp_path / "area.gpkg", shapely.Point(5e5 + 60, 5e6 - 45).buffer(30))
    part = {"aoi": ["--aoi", area], "bounds": ["--bounds", f"{5e5 + 10},{5e6 - 80},{5e5 + 100},{5e6 - 9}"]}[
        kind
    ]
    blocks = str(tmp_path / "blocks.tif")
    run("divide", raster, *part, "-o", blocks, "-q")
    run("extract", blocks, "--range", "0.5,1", "-o", str(tmp_path / "a.geojson"), "-q")
    run("extract", raster, *part, "--range", "0.5,1", "-o", str(tmp_path / "b.geojson"), "-q")
    assert features(tmp_path / "a.geojson") == features(tmp_path / "b.geojson") != []
    with pytest.raises(UavsegError, match=r"uavseg divide takes these.*; leave aoi out"):
        uavseg.extract(blocks, (0.5, 1), aoi=area)
    if kind == "aoi":  # a file that the block map names is not opened where that is not allowed
        elsewhere = tmp_path / "elsewhere"
        elsewhere.mkdir()
        moved = elsewhere / "blocks.tif"
        moved.write_bytes(Path(blocks).read_bytes())
        done = CliRunner().invoke(
            main, ["extract", str(moved), "--range", "0.5,1", "-o", str(elsewhere / "o.geojson")]
        )
        assert done.exit_code == 1 and "--allow-path" in done.output, done.output


@pytest.mark.slow
def test_every_command_that_reads_rasters_takes_them(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    raster = write(tmp_path / "a.tif", picture())
    bounds = f"{5e5 + 10},{5e6 - 80},{5e5 + 100},{5e6 - 9}"
    monkeypatch.chdir(tmp_path)
    for words in (
        "match {} --like 500050,4999960,8 -o m.geojson",
        "suggest {} --json",
        "original {} -o o.tif",
        "compare {} {} --range 0.5,1 -o c.geojson",
        "map {} -o page.html",
    ):
        run(*words.format(raster, raster).split(), "--bounds", bounds)
    assert rasterio.open(tmp_path / "o.tif").bounds == (5e5 + 10, 5e6 - 80, 5e5 + 100, 5e6 - 9)
    line = next(
        word for word in run("suggest", raster, "--bounds", bounds).splitlines() if "uavseg extract" in word
    )
    assert "--bounds 500010,4999920,500100,4999991" in line


@pytest.mark.parametrize(
    ("how", "said"),
    [
        ({"bounds": (0, 0, 1, 1)}, "--bounds holds no pixel of what is read, which is x 500000 to 500130"),
        ({"bounds": (2, 0, 1, 1)}, "bounds are west, south, east and north in the raster's coordinates, not"),
        ({"bounds": (float("nan"), 0, 1, 1)}, "bounds are west, south"),
        ({"bounds": (0, 0, 1)}, "bounds is four numbers or None"),
        ({"bounds": (5e5 + 0.3, 5e6 - 9, 5e5 + 0.4, 5e6)}, "holds no pixel"),
        ({"aoi": "gone.gpkg"}, "gone.gpkg does not exist"),
        ({"aoi": "far.gpkg"}, "far.gpkg holds no pixel of what is read"),
        ({"aoi": "hole.gpkg"}, "no pixel has its centre within"),
        ({"aoi": "local.gpkg"}, "local.gpkg has no coordinate system"),
        ({"aoi": "a.tif"}, "a.tif"),
    ],
)
def test_what_holds_no_pixel_is_refused(
    how: dict[str, Any], said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    write(tmp_path / "a.tif", picture())
    write_area(tmp_path / "far.gpkg", shapely.Point(6e5, 5e6).buffer(9))
    ring = shapely.Point(5e5 + 50, 5e6 - 50).buffer(0.4).exterior.buffer(0.01)
    write_area(tmp_path / "hole.gpkg", ring)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        write_area(tmp_path / "local.gpkg", shapely.box(0, 0, 9, 9), epsg=None)
    with pytest.raises(UavsegError, match=said):
        uavseg.extract("a.tif", (0.5, 1), **how)
    assert {path.suffix for path in tmp_path.iterdir()} == {".tif", ".gpkg"}


def test_a_raster_without_crs_takes_an_area_without_one(tmp_path: Path) -> None:
    raster = write(tmp_path / "a.tif", picture(), epsg=None)
    path = tmp_path / "local.gpkg"
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        write_area(path, shapely.box(5e5 + 10, 5e6 - 30, 5e5 + 40, 5e6 - 10), epsg=None)
    assert pixels(raster, aoi=str(path))[1].sum() == 60 * 40
    with warnings.catch_warnings(action="ignore"):
        write_area(tmp_path / "local.geojson", shapely.box(5e5 + 10, 5e6 - 30, 5e5 + 40, 5e6 - 10), epsg=None)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        found = uavseg.extract(raster, (0, 1), aoi=str(tmp_path / "local.geojson"), stretch="dtype")
    assert any("coordinates of GeoJSON, which are degrees elsewhere" in str(one.message) for one in caught)
    assert found["pixels"].sum() == 60 * 40
    write_area(tmp_path / "utm.gpkg", shapely.box(5e5 + 10, 5e6 - 30, 5e5 + 40, 5e6 - 10))
    with pytest.raises(UavsegError, match="has a CRS and the raster has none"):
        pixels(raster, aoi=str(tmp_path / "utm.gpkg"))


def test_a_file_of_regions_has_no_part(tmp_path: Path) -> None:
    area = write_area(tmp_path / "area.gpkg", shapely.box(0, 0, 1, 1))
    for how in ({"bounds": (0, 0, 1, 1)}, {"aoi": area}, {"warp": True}):
        with pytest.raises(UavsegError, match="bounds, aoi, warp and skip_bad_tiles are for rasters"):
            uavseg.info(area, **how)  # type: ignore[arg-type]


def test_an_area_is_not_replaced(tmp_path: Path) -> None:
    raster = write(tmp_path / "a.tif", picture())
    area = write_area(tmp_path / "area.gpkg", shapely.box(5e5 + 10, 5e6 - 30, 5e5 + 40, 5e6 - 10))
    before = Path(area).read_bytes()
    words = ["extract", raster, "--range", "0.5,1", "--aoi", area, "-o", area, "--overwrite"]
    done = CliRunner().invoke(main, words)
    assert done.exit_code == 1 and "area.gpkg" in done.output
    assert Path(area).read_bytes() == before


@pytest.mark.slow
def test_a_resumed_run_is_of_the_same_part(tmp_path: Path) -> None:
    raster, done = write(tmp_path / "a.tif", picture()), str(tmp_path / "done")
    for k, bounds in enumerate(((5e5, 5e6 - 99, 5e5 + 90, 5e6), (5e5, 5e6 - 90, 5e5 + 90, 5e6))):
        word = ",".join(f"{number:.12g}" for number in bounds)
        words = ("--range", "0.5,1", "--bounds", word, "-q", "--tile", "64")
        run("extract", raster, *words, "--resume", done, "-o", str(tmp_path / f"a{k}.geojson"))
        run("extract", raster, *words, "-o", str(tmp_path / f"b{k}.geojson"))
        assert features(tmp_path / f"a{k}.geojson") == features(tmp_path / f"b{k}.geojson")


def test_a_sample_is_cut_as_rio_clip_does(tmp_path: Path) -> None:
    cut = str(tmp_path / "west.tif")
    from rasterio.rio.main import main_group

    bounds = "512340,5478340,512500,5478620"
    clipped = CliRunner().invoke(
        main_group, ["clip", str(SAMPLES / "quarry.tif"), cut, "--bounds", bounds.replace(",", " ")]
    )
    assert clipped.exit_code == 0, clipped.output
    run(
        "extract",
        str(SAMPLES / "quarry.tif"),
        "--range",
        "0.55,1",
        "--bounds",
        bounds,
        "-o",
        str(tmp_path / "a.geojson"),
    )
    run("extract", cut, "--range", "0.55,1", "-o", str(tmp_path / "b.geojson"))
    assert features(tmp_path / "a.geojson") == features(tmp_path / "b.geojson") != []
