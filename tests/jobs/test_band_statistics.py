"""Statistics of bands: those of the pixels of a region, whatever tiles, threads and files there are."""

import sys
import warnings
from collections.abc import Sequence
from contextlib import chdir
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
import shapely
from affine import Affine
from click.testing import CliRunner
from numpy.typing import NDArray
from rasterio.enums import ColorInterp
from rasterio.features import rasterize
from rasterio.mask import mask

pytest.importorskip("exactextract", reason="exactextract is not installed")

import geopandas
from geopandas.testing import assert_geodataframe_equal

import uavseg
from uavseg.cli import main
from uavseg.errors import MissingLibraryError, ParameterError, RasterReadError
from uavseg.jobs.result import result as results

Image = NDArray[Any]
NORTH_UP = Affine(2, 0, 4e5, 0, -2, 5e6)
TURNED = Affine.translation(4e5, 5e6) * Affine.rotation(30) * Affine.scale(2, -3)
WORDS: dict[str, Any] = {"range": (0.5, 1), "refine": "pixels", "stats": "bands"}
NO_LIBRARY = '--stats needs exactextract: pip install "uavseg[stats]"'


def picture(bands: int, dtype: str, seed: int = 0, shape: tuple[int, int] = (130, 150)) -> Image:
    """Bright discs on a dark ground with noise, which differs by band: (bands, rows, cols)."""
    rng, (rows, cols) = np.random.default_rng(seed), np.indices(shape)
    bright = np.zeros(shape, bool)
    for row, col, radius in ((30, 40, 22), (90, 60, 30), (64, 128, 15)):
        bright |= (rows - row) ** 2 + (cols - col) ** 2 < radius**2
    values = 60 + 90 * bright + rng.integers(0, 30, (bands, *shape)) + 5 * np.arange(bands)[:, None, None]
    return values.astype(dtype)


def write(path: Path, image: Image, transform: Affine = NORTH_UP, **tags: Any) -> Path:
    """A GeoTIFF; `tags` are attributes of the open file, and `nodata`."""
    profile = {"count": len(image), "height": image.shape[1], "width": image.shape[2], "dtype": image.dtype}
    profile |= {"crs": "EPSG:32632", "transform": transform, "nodata": tags.pop("nodata", None)}
    with rasterio.open(path, "w", **profile, tiled=True, blockxsize=64, blockysize=64) as file:
        file.write(image)
        for name, value in tags.items():
            setattr(file, name, value)
    return path


def uint8(path: Path) -> tuple[Path, Image, list[str]]:
    image = picture(3, "uint8")
    return write(path / "rgb.tif", image), image.astype(float), ["red", "green", "blue"]


def uint16_with_nodata(path: Path) -> tuple[Path, Image, list[str]]:
    image = picture(2, "uint16", 1)
    holes = np.random.default_rng(5).random(image.shape) < 0.1
    image[1] = np.where(holes[1], 999, image[1])
    where = write(path / "deep.tif", image, nodata=999, scales=(0.5, 0.25), offsets=(-3, 7))
    values = image * np.array([0.5, 0.25])[:, None, None] + np.array([-3, 7])[:, None, None]
    return where, np.where(image == 999, np.nan, values), ["b1", "b2"]


def float_with_nan(path: Path) -> tuple[Path, Image, list[str]]:
    image = picture(2, "float32", 2) / np.float32(7)
    image[1, 40:100:3, ::5] = np.nan
    named = write(path / "float.tif", image, TURNED, descriptions=("B04, red", "Height of trees"))
    return named, image.astype(float), ["red", "height_of_trees"]


KINDS = {"uint8": uint8, "uint16, nodata, scale": uint16_with_nodata, "float, NaN, turned": float_with_nan}


def columns(frame: Any, names: Sequence[str]) -> Image:
    """Mean, std, min and max of the bands, (regions, bands, 4)."""
    table = [[frame[f"{one}_{name}"] for one in ("mean", "std", "min", "max")] for name in names]
    return np.moveaxis(np.array(table, float), 2, 0)


def labels_of(frame: Any, path: Path) -> NDArray[np.int32]:
    with rasterio.open(path) as file:
        shapes = zip(frame.geometry, frame["id"], strict=True)
        return np.asarray(rasterize(shapes, file.shape, transform=file.transform, dtype="int32"))


def plain(values: Image, weights: Image) -> list[float]:
    """Mean, std, min and max of values that are not NaN, with weights of one shape."""
    there = (weights > 0) & np.isfinite(values)
    if not there.any():
        return [np.nan] * 4
    values, weights = values[there], weights[there]
    mean = np.average(values, weights=weights)
    std = np.sqrt(np.average((values - mean) ** 2, weights=weights))
    return [float(mean), float(std), float(values.min()), float(values.max())]


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_they_are_those_of_the_pixels_of_the_label(kind: str, tmp_path: Path) -> None:
    path, values, names = KINDS[kind](tmp_path)
    words = WORDS | ({} if len(names) == 3 else {"band": 1})
    frame = uavseg.extract(path, **words)
    labels = labels_of(frame, path)
    assert len(frame) >= 3 and np.array_equal(np.bincount(labels.ravel())[1:], frame["pixels"])
    wanted = [[plain(band, labels == label) for band in values] for label in frame["id"]]
    assert columns(frame, names) == pytest.approx(np.array(wanted), rel=1e-9, abs=1e-9, nan_ok=True)
    added = [f"{one}_{name}" for one in ("mean", "std", "min", "max") for name in names]
    before = uavseg.extract(path, **words | {"stats": None})
    assert list(frame.columns) == [*before.columns[:-1], *added, "geometry"]
    assert_geodataframe_equal(frame[list(before.columns)], before)
    assert frame.attrs["uavseg"] == before.attrs["uavseg"] | {"stats": "bands"}
    for more in ({"tile": 64}, {"tile": 64, "threads": 3}, {"tile": 1024, "threads": 1}):
        assert_geodataframe_equal(frame, uavseg.extract(path, **words, **more))


def test_the_windows_that_are_read_make_no_difference_but_of_rounding(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, _, names = uint8(tmp_path)
    whole = columns(uavseg.extract(path, **WORDS), names)
    monkeypatch.setattr(results, "_SIDE", 64)
    assert columns(uavseg.extract(path, **WORDS), names) == pytest.approx(whole, rel=1e-12)


def test_rasterio_masks_the_same_pixels(tmp_path: Path) -> None:
    path, _, names = uint8(tmp_path)
    frame = uavseg.extract(path, **WORDS)
    with rasterio.open(path) as file:
        masked = [mask(file, [polygon], filled=False)[0] for polygon in frame.geometry]
    wanted = [[[band.mean(), band.std(), band.min(), band.max()] for band in one] for one in masked]
    assert columns(frame, names) == pytest.approx(np.array(wanted, float), rel=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize(
    "drawn", [{"simplify": 5}, {"smooth_outline": 1}, {"smooth_outline": 1, "simplify": 3}]
)
def test_a_pixel_counts_by_the_part_of_it_in_the_region(drawn: dict[str, Any], tmp_path: Path) -> None:
    path, values, names = uint8(tmp_path)
    frame = uavseg.extract(path, **WORDS, min_area="40px", **drawn)
    rows, cols = np.indices(values.shape[1:])
    x, y = NORTH_UP * (cols, rows)
    boxes = shapely.box(x, y - 2, x + 2, y)
    parts = [shapely.area(shapely.intersection(boxes, polygon)) / 4 for polygon in frame.geometry]
    assert any(((part > 0.01) & (part < 0.99)).any() for part in parts)
    wanted = [[plain(band, np.where(part < 1e-6, 0, part)) for band in values] for part in parts]
    assert columns(frame, names) == pytest.approx(
        np.array(wanted), rel=1e-5
    )  # exactextract has float32 parts


@pytest.mark.slow
def test_outlines_along_the_edges_of_windows_are_cut_exactly(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """exactextract 0.3 itself may crash where an outline runs along the edge of what it reads at a time."""
    monkeypatch.setattr(results, "_SIDE", 64)
    coarse = np.random.default_rng(9).integers(0, 2, (1, 40, 40)) * 200
    image = coarse.repeat(16, 1).repeat(16, 2).astype("uint8")
    image[0, 100:500, 60:70] = 200
    path = write(tmp_path / "a.tif", np.concatenate([image, picture(1, "uint8", 10, image.shape[1:])]))
    frame = uavseg.extract(path, **WORDS, band=1)
    with rasterio.open(path) as file:
        values = file.read().astype(float)
    labels = labels_of(frame, path)
    wanted = [[plain(band, labels == label) for band in values] for label in frame["id"]]
    assert len(frame) > 20 and columns(frame, ["b1", "b2"]) == pytest.approx(np.array(wanted), rel=1e-9)


def test_large_values_are_no_warning(tmp_path: Path) -> None:
    image = picture(2, "float64")
    image[1] *= 1e300
    frame = uavseg.extract(write(tmp_path / "a.tif", image), **WORDS, band=1, stretch="0,255", tile=64)
    assert (frame["max_b2"] > 1e302).all() and (frame["mean_b2"] > 1e302).all()


def test_a_mosaic_gives_what_one_file_gives(tmp_path: Path) -> None:
    path, values, _ = uint8(tmp_path)
    image = values.astype("uint8")
    west = write(tmp_path / "west.tif", image[:, :, :70])
    east = write(tmp_path / "east.tif", image[:, :, 64:], NORTH_UP * Affine.translation(64, 0))
    one, two = (uavseg.extract(source, **WORDS).drop(columns="source") for source in (path, [west, east]))
    assert_geodataframe_equal(one, two)


def test_arrays_and_single_bands_have_them() -> None:
    values = picture(2, "float32", 8)
    for image, names in ((values, ["b1", "b2"]), (values[0], ["b1"])):
        frame = uavseg.extract(image, **WORDS, **({"band": 1} if image.ndim == 3 else {}), stretch="0,255")
        shapes = zip(frame.geometry, frame["id"], strict=True)
        labels = rasterize(shapes, values.shape[1:], transform=Affine.identity(), dtype="int32")
        planes = image.reshape(-1, *values.shape[1:]).astype(float)
        wanted = [[plain(band, labels == label) for band in planes] for label in frame["id"]]
        assert len(frame) and columns(frame, names) == pytest.approx(np.array(wanted), rel=1e-9)


def test_an_area_of_interest_bounds_and_alpha_leave_pixels_out(tmp_path: Path) -> None:
    image = picture(4, "uint8")
    image[3] = np.where(np.random.default_rng(3).random(image.shape[1:]) < 0.2, 0, 255)
    colors = (ColorInterp.red, ColorInterp.green, ColorInterp.blue, ColorInterp.alpha)
    path, area = write(tmp_path / "a.tif", image, colorinterp=colors), tmp_path / "area.gpkg"
    disc = shapely.Point(4e5 + 140, 5e6 - 120).buffer(90)
    geopandas.GeoDataFrame(geometry=[disc], crs="EPSG:32632").to_file(area)
    bounds = (4e5 + 30, 5e6 - 240, 4e5 + 220, 5e6 - 20)
    frame = uavseg.extract(path, **WORDS, aoi=area, bounds=bounds, fill_holes="9px")
    assert [name for name in frame.columns if name.startswith("mean_")] == [
        *("mean_value", "mean_red", "mean_green", "mean_blue")
    ]
    rows, cols = np.indices(image.shape[1:])
    x, y = NORTH_UP * (cols + 0.5, rows + 0.5)
    left_out = (image[3] == 0) | ~shapely.contains_xy(disc, x, y)
    values = np.where(left_out, np.nan, image[:3].astype(float))
    labels = labels_of(frame, path)
    assert (left_out & (labels > 0)).any()
    wanted = [[plain(band, labels == label) for band in values] for label in frame["id"]]
    found = columns(frame, ["red", "green", "blue"])
    assert found == pytest.approx(np.array(wanted), rel=1e-9, nan_ok=True)


@pytest.mark.filterwarnings("ignore:nodata 160 counts beside that of the file:UserWarning")
@pytest.mark.parametrize("nodata", [160, "only:160", "none"])
def test_nodata_that_is_named_is_that_of_each_band(nodata: Any, tmp_path: Path) -> None:
    image = picture(2, "uint8", 4)
    path = write(tmp_path / "a.tif", image, nodata=165)
    frame = uavseg.extract(path, **WORDS, band=1, nodata=nodata, stretch="0,255", fill_holes="99px")
    gone = {160: [160, 165], "only:160": [160], "none": []}[nodata]
    values, labels = np.where(np.isin(image, gone), np.nan, image.astype(float)), labels_of(frame, path)
    wanted = [[plain(band, labels == label) for band in values] for label in frame["id"]]
    assert columns(frame, ["b1", "b2"]) == pytest.approx(np.array(wanted), rel=1e-9, nan_ok=True)


def test_a_region_without_values_of_a_band_has_none(tmp_path: Path) -> None:
    image = picture(2, "float32", 6)
    image[1] = np.nan
    frame = uavseg.extract(write(tmp_path / "a.tif", image), **WORDS, band=1, stretch="0,255")
    assert len(frame) and np.isnan(columns(frame, ["b2"])).all() and np.isfinite(columns(frame, ["b1"])).all()


def test_where_there_is_no_region_there_are_the_columns(tmp_path: Path) -> None:
    path, _, names = uint8(tmp_path)
    with pytest.warns(UserWarning, match="no region has"):
        frame = uavseg.extract(path, **WORDS | {"range": (0.99, 1)}, stretch="0,255")
    assert columns(frame, names).shape == (0, 3, 4)


@pytest.mark.parametrize(
    ("descriptions", "names"),
    [
        (("", "Band 8 - NIR", "Digital surface model (m)"), ["b1", "nir", "digital_surface_model_m"]),
        (("red", "Red", ""), ["b1", "b2", "b3"]),
        (("value", "x", "y"), ["b1", "b2", "b3"]),
        (("b2", "", "; DROP TABLE regions"), ["b1", "b2", "b3"]),
        (("Ä" * 60, "\n \n", "a.b"), ["ä" * 40, "b2", "a_b"]),
    ],
)
def test_names_of_bands(descriptions: tuple[str, ...], names: list[str], tmp_path: Path) -> None:
    gray = (ColorInterp.gray, ColorInterp.undefined, ColorInterp.undefined)
    path = write(tmp_path / "a.tif", picture(3, "uint8"), colorinterp=gray, descriptions=descriptions)
    frame = uavseg.extract(path, **WORDS, band=1)
    assert [name for name in frame.columns if name.startswith("std_")] == [f"std_{name}" for name in names]
    assert len(frame) and np.isfinite(columns(frame, names)).all()


@pytest.mark.parametrize("suffix", [".gpkg", ".geojson", ".parquet", ".fgb", ".shp"])
def test_files_hold_the_columns(suffix: str, tmp_path: Path) -> None:
    if suffix == ".parquet":
        pytest.importorskip("pyarrow", reason="pyarrow is not installed")
    path, _, names = uint8(tmp_path)
    output = tmp_path / f"regions{suffix}"
    words = [
        "extract",
        path,
        "--range",
        "0.5,1",
        "--refine",
        "pixels",
        "--stats",
        "bands",
        "-q",
        "-o",
        output,
    ]
    done = CliRunner().invoke(main, list(map(str, words)))
    assert done.exit_code == 0 and not done.stderr, done.output
    read = geopandas.read_parquet if suffix == ".parquet" else geopandas.read_file
    found, wanted = read(output).sort_values("id"), uavseg.extract(path, **WORDS)
    assert columns(found, names) == pytest.approx(columns(wanted, names), rel=1e-11)


def test_a_shapefile_in_which_two_names_would_be_one_is_refused(tmp_path: Path) -> None:
    names = ("rededge1", "rededge2")
    path, output = write(tmp_path / "a.tif", picture(2, "uint8"), descriptions=names), tmp_path / "a.shp"
    words = f"extract {path} --band 1 --range 0.5,1 --stats bands -q -o {output}"
    done = CliRunner().invoke(main, words.split())
    assert done.exit_code != 0 and "ten characters: two columns share one" in done.stderr
    assert [one.name for one in tmp_path.iterdir()] == ["a.tif"]
    assert CliRunner().invoke(main, words.replace(".shp", ".gpkg").split()).exit_code == 0


@pytest.mark.slow
def test_each_raster_has_its_own(tmp_path: Path) -> None:
    paths = [write(tmp_path / f"{n}.tif", picture(2, "uint8", n)) for n in range(2)]
    done = uavseg.each(uavseg.extract, paths, f"{tmp_path}/{{stem}}.gpkg", **WORDS, band=1)
    assert [one.error for one in done] == [None, None]
    for path in paths:
        frame = geopandas.read_file(path.with_suffix(".gpkg"), layer="regions")
        alone = uavseg.extract(path, **WORDS, band=1)
        assert columns(frame, ["b1", "b2"]).tolist() == columns(alone, ["b1", "b2"]).tolist()


@pytest.mark.slow
def test_levels_classes_and_a_folder_have_them_too(tmp_path: Path) -> None:
    pytest.importorskip("pyarrow", reason="pyarrow is not installed")
    path, values, names = uint8(tmp_path)
    classes = uavseg.extract(path, classes={"dark": (0, 0.4), "bright": (0.5, 1)}, stats="bands")
    for frame in (classes, uavseg.levels(path, 0.3, stats="bands")):
        labels = labels_of(frame, path)
        wanted = [[plain(band, labels == label) for band in values] for label in frame["id"]]
        assert columns(frame, names) == pytest.approx(np.array(wanted), rel=1e-9)
    folder, one = tmp_path / "regions.parquet", uavseg.extract(path, **WORDS)
    uavseg.extract_to(f"{folder}/", path, **WORDS)
    parts = geopandas.read_parquet(folder)
    assert sorted(columns(parts, names).tolist()) == sorted(columns(one, names).tolist())


def test_without_the_library_one_line_says_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    uint8(tmp_path)
    monkeypatch.setitem(sys.modules, "exactextract", None)
    with chdir(tmp_path):
        for output in ("a.gpkg", "a.parquet/"):
            words = ["extract", "rgb.tif", "--range", "0.5,1", "--stats", "bands", "-o", output]
            done = CliRunner().invoke(main, words)
            assert done.exit_code != 0 and not done.stdout
            assert done.stderr == f"uavseg: error: {NO_LIBRARY}\n"
        with pytest.raises(MissingLibraryError) as raised:
            uavseg.extract("rgb.tif", **WORDS)
    assert str(raised.value) == NO_LIBRARY
    assert [one.name for one in tmp_path.iterdir()] == ["rgb.tif"]


def test_what_has_no_values_of_bands_is_refused_before_any_work(tmp_path: Path) -> None:
    path, values, _ = uint8(tmp_path)
    blocks, palette = tmp_path / "blocks.tif", tmp_path / "palette.tif"
    done = CliRunner().invoke(main, ["divide", str(path), "-o", str(blocks), "-q"])
    assert done.exit_code == 0, done.output
    indices = (values[:1] // 100).astype("uint8")
    write(palette, indices)
    with rasterio.open(palette, "r+") as file:
        file.write_colormap(1, {0: (0, 0, 0, 255), 1: (200, 200, 200, 255)})
    apart = [
        write(
            tmp_path / f"{n}.tif",
            picture(2, "uint16"),
            Affine(2, 0, 4e5 + 300 * n, 0, -2, 5e6),
            scales=(1, n + 1),
        )
        for n in range(2)
    ]
    refused = {
        "give it in place of its block map": blocks,
        "has a palette": palette,
        "different scales": apart,
    }
    for why, source in refused.items():
        words = {"band": 1} if source is apart else {}
        with pytest.raises(ParameterError, match=why), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            uavseg.extract(source, range=(0.5, 1), stats="bands", **words)
    with pytest.raises(ParameterError, match="\"bands\" or None, not 'pixels'"):
        uavseg.extract(path, **WORDS | {"stats": "pixels"})


def test_a_band_that_cannot_be_read_is_an_error_or_a_warning(tmp_path: Path) -> None:
    image = picture(2, "uint8")
    path = tmp_path / "a.tif"
    profile = {"count": 2, "height": 130, "width": 150, "dtype": "uint8", "transform": NORTH_UP}
    profile |= {"crs": "EPSG:32632", "tiled": True, "blockxsize": 64, "blockysize": 64}
    with rasterio.open(path, "w", **profile, interleave="band", compress="deflate") as file:
        file.write(image)
    content = bytearray(path.read_bytes())
    last = content.rindex(b"\x78", 0, len(content) - 3000)  # within the last blocks, of band 2
    content[last - 200 : last + 200] = bytes(400)
    path.write_bytes(content)
    assert len(uavseg.extract(path, **WORDS | {"stats": None}, band=1))
    with pytest.raises(RasterReadError, match=r"a\.tif"):
        uavseg.extract(path, **WORDS, band=1)
    with pytest.warns(UserWarning, match="cannot be read in rows") as warned:
        frame = uavseg.extract(path, **WORDS, band=1, skip_bad_tiles=True)
    assert len({str(one.message) for one in warned}) == len(warned)
    assert np.isfinite(columns(frame, ["b1"])).all()
