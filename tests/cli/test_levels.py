"""`uavseg levels`, from the command line to the files."""

from pathlib import Path

import geopandas
import numpy as np
import pytest
import rasterio
import shapely
from affine import Affine
from click.testing import CliRunner, Result
from geopandas.testing import assert_geodataframe_equal

import uavseg
from uavseg.cli import main
from uavseg.occupancy.ros.ros_map import write_ros_map
from uavseg.raster.grid.geobox import local_geobox

ROOT = Path(__file__).resolve().parents[2]
QUARRY = ROOT / "samples" / "quarry.tif"


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def run(*words: object) -> Result:
    return CliRunner().invoke(main, ["levels", *map(str, words)])


def done(*words: object) -> Result:
    result = run(*words)
    assert result.exit_code == 0, result.output
    return result


def contents() -> dict[str, bytes]:
    return {str(path): path.read_bytes() for path in sorted(Path().rglob("*")) if path.is_file()}


def read(name: str) -> np.ndarray:
    with rasterio.open(name) as file:
        return np.asarray(file.read(1))


def scene(seed: int, shape: tuple[int, int]) -> np.ndarray:
    """Patches with noise and nodata (0)."""
    rng = np.random.default_rng(seed)
    coarse = rng.integers(20, 240, (shape[0] // 24 + 1, shape[1] // 24 + 1))
    image = np.kron(coarse, np.ones((24, 24)))[: shape[0], : shape[1]] + rng.normal(0, 6, shape)
    image = np.clip(image, 1, 255).astype(np.uint8)
    image[rng.random(shape) < 0.03] = 0
    image[50:80, 30:90] = 0
    return image


def write(name: str, image: np.ndarray) -> str:
    place = {"crs": "EPSG:32618", "transform": Affine(2, 0, 4e5, 0, -2, 5e6), "nodata": 0}
    with rasterio.open(name, "w", "GTiff", *image.shape[::-1], 1, dtype=image.dtype.name, **place) as file:
        file.write(image, 1)
    return name


def test_every_valid_pixel_is_in_one_segment_and_each_has_its_level() -> None:
    image = scene(1, (210, 170))
    told = done(write("a.tif", image), "--width", 0.1, "-o", "a.gpkg", "--labels", "l.tif").stderr
    segments, labels = geopandas.read_file("a.gpkg"), read("l.tif")
    assert list(segments.columns[:2]) == ["id", "level"]
    assert np.array_equal(labels > 0, image > 0)
    assert np.bincount(labels.ravel())[1:].tolist() == segments["pixels"].tolist()
    assert segments["pixels"].is_monotonic_decreasing
    assert segments["range_low"].to_numpy() == pytest.approx(segments["level"].to_numpy() * 0.1)
    assert segments["range_high"].to_numpy() == pytest.approx(segments["level"].to_numpy() * 0.1 + 0.1)
    assert segments.area.to_numpy() == pytest.approx(4 * segments["pixels"].to_numpy())
    for row in segments.head(20).itertuples():
        own = image[labels == row.id] / 255
        assert (own.mean(), own.std()) == pytest.approx((row.mean, row.std), abs=1e-5)
    assert f"  segments    {len(segments)} -> a.gpkg" in told and "of 10 are there, each 0.1 of v (" in told


def test_the_default_name_and_stdout() -> None:
    assert done(QUARRY, "--width", 0.5, "-q").stderr == ""
    written = Path("quarry.levels.geojson").read_bytes()
    assert done(QUARRY, "--width", 0.5, "-q", "-o", "-").stdout_bytes == written


@pytest.mark.slow
@pytest.mark.parametrize(
    "width", [0.1, *(pytest.param(width, marks=pytest.mark.slow) for width in (0.15, 0.002))]
)
def test_tiles_and_threads_change_no_byte(width: float) -> None:
    write("a.tif", scene(2, (330, 270)))
    how = ("--width", width, "-o", "a.gpkg", "--labels", "l.tif", "-q", "--overwrite")
    done("a.tif", *how, "--tile", 64, "--threads", 1)
    wanted = contents()
    for tile, threads in ((128, 2), (192, 1), (4096, 2)):
        done("a.tif", *how, "--tile", tile, "--threads", threads)
        assert contents() == wanted


def test_a_level_of_everything_is_one_segment() -> None:
    write("a.tif", np.maximum(scene(3, (100, 100)), 1))
    done("a.tif", "--width", 1, "-o", "a.fgb", "-q")
    segments = geopandas.read_file("a.fgb")
    assert segments[["level", "pixels", "range_low", "range_high"]].to_numpy().tolist() == [[0, 10000, 0, 1]]


def test_a_block_map_answers_as_its_raster_does() -> None:
    write("a.tif", np.maximum(scene(4, (200, 150)), 1))
    CliRunner().invoke(main, ["divide", "a.tif", "-o", "blocks.tif", "-q"])
    how = ("--width", 0.15, "-q", "--labels")
    done("a.tif", "-o", "a.fgb", *how, "a.l.tif")
    done("blocks.tif", "-o", "b.fgb", *how, "b.l.tif")
    assert Path("a.l.tif").read_bytes() == Path("b.l.tif").read_bytes()
    one, other = (geopandas.read_file(f"{name}.fgb").drop(columns="std") for name in "ab")
    assert_geodataframe_equal(one, other)


def test_the_segments_of_a_level_are_the_regions_of_its_range() -> None:
    """Without refinement, extracting (0.2, 0.3] finds what the third level is made of."""
    write("a.tif", scene(5, (200, 150)))
    above = float(np.nextafter(0.2, 1))
    done("a.tif", "--width", 0.1, "--refine", "none", "-o", "a.gpkg", "-q")
    how = ["extract", "a.tif", "--range", f"{above!r},0.3"]
    result = CliRunner().invoke(main, [*how, "--refine", "none", "-o", "b.gpkg", "-q"])
    assert result.exit_code == 0, result.output
    levels, regions = geopandas.read_file("a.gpkg"), geopandas.read_file("b.gpkg")
    third = levels[levels["level"] == 2].reset_index(drop=True)
    assert len(third) == len(regions) > 1
    assert third["pixels"].tolist() == regions["pixels"].tolist()
    assert third.geometry.geom_equals(regions.geometry).all()


def test_small_segments_are_dropped_and_borders_simplified_together() -> None:
    write("a.tif", np.maximum(scene(6, (200, 150)), 1))
    how = ("--min-area", "300px", "--small", "drop", "--simplify", 20)
    done("a.tif", "--width", 0.2, "-o", "a.fgb", *how, "-q")
    segments = geopandas.read_file("a.fgb")
    assert segments["pixels"].min() >= 300 and segments.geometry.is_valid.all()
    assert segments.geometry.union_all().area == pytest.approx(segments.area.sum())


def test_small_segments_become_part_of_their_neighbours() -> None:
    image = write("a.tif", scene(6, (200, 150)))
    done(image, "--width", 0.1, "-o", "a.gpkg", "--min-area", "300px", "-q", "--labels", "l.tif")
    segments, labels = geopandas.read_file("a.gpkg"), read("l.tif")
    assert np.array_equal(labels > 0, read("a.tif") > 0)
    assert np.bincount(labels.ravel())[1:].tolist() == segments["pixels"].tolist()
    assert 1 < len(segments) < 50 and segments["pixels"].min() >= 300
    assert segments["range_low"].to_numpy() == pytest.approx(segments["level"].to_numpy() * 0.1)
    for row in segments.itertuples():
        own = read("a.tif")[labels == row.id] / 255
        assert (own.mean(), own.std()) == pytest.approx((row.mean, row.std), abs=1e-5)
    done(image, "--width", 0.1, "-o", "b.fgb", "--min-area", "300px", "-q", "--small", "drop")
    assert geopandas.read_file("b.fgb")["pixels"].sum() < segments["pixels"].sum()


@pytest.mark.slow
@pytest.mark.parametrize("small", ["merge", "drop"])
def test_merged_and_smooth_segments_are_the_same_bytes_for_all_tiles(small: str) -> None:
    write("a.tif", scene(8, (330, 270)))
    how = ("--width", 0.1, "-o", "a.gpkg", "--labels", "l.tif", "-q", "--overwrite", "--min-area", 700)
    how += ("--small", small, "--smooth-outline", 1)
    done("a.tif", *how, "--tile", 64, "--threads", 1)
    wanted = contents()
    for tile, threads in ((128, 2), (4096, 1)):
        done("a.tif", *how, "--tile", tile, "--threads", threads)
        assert contents() == wanted


def test_a_block_map_merges_as_its_raster_does() -> None:
    write("a.tif", np.maximum(scene(4, (200, 150)), 1))
    CliRunner().invoke(main, ["divide", "a.tif", "-o", "blocks.tif", "-q"])
    how = ("--width", 0.15, "-q", "--min-area", "500px", "--smooth-outline", 1, "--labels")
    done("a.tif", "-o", "a.fgb", *how, "a.l.tif")
    done("blocks.tif", "-o", "b.fgb", *how, "b.l.tif")
    assert Path("a.l.tif").read_bytes() == Path("b.l.tif").read_bytes()
    one, other = (geopandas.read_file(f"{name}.fgb").drop(columns="std") for name in "ab")
    assert_geodataframe_equal(one, other)


@pytest.mark.slow
def test_smooth_borders_stay_shared_and_may_be_simplified_then() -> None:
    write("a.tif", scene(6, (200, 150)))
    kept = geopandas.read_file
    for more in ((), ("--simplify", 9)):
        done("a.tif", "--width", 0.2, "-o", "a.fgb", "--smooth-outline", 1, *more, "-q", "--overwrite")
        segments = kept("a.fgb")
        assert segments.is_valid.all() and shapely.coverage_is_valid(segments.geometry.to_numpy())
        assert segments.geometry.union_all().area == pytest.approx(segments.area.sum())
        assert segments["area_m2"].sum() == pytest.approx(4 * segments["pixels"].sum(), rel=1e-3)
    done("a.tif", "--width", 0.2, "-o", "b.fgb", "-q")
    assert kept("b.fgb")["perimeter_m"].tolist() == segments["perimeter_m"].tolist()


@pytest.mark.slow
def test_regular_segments_share_borders_and_are_the_same_bytes_for_all_tiles() -> None:
    write("a.tif", scene(6, (200, 150)))
    how = ("--width", 0.2, "-o", "a.fgb", "--regularize", 6, "-q", "--overwrite")
    done("a.tif", *how, "--tile", 64, "--threads", 1)
    wanted, segments = Path("a.fgb").read_bytes(), geopandas.read_file("a.fgb")
    assert segments.is_valid.all() and shapely.coverage_is_valid(segments.geometry.to_numpy())
    assert segments.geometry.union_all().area == pytest.approx(segments.area.sum())
    done("a.tif", *how, "--tile", 4096, "--threads", 2)
    assert Path("a.fgb").read_bytes() == wanted
    done("a.tif", "--width", 0.2, "-o", "b.fgb", "-q")
    assert not geopandas.read_file("b.fgb").geometry.equals(segments.geometry)


def test_a_run_goes_on_where_it_stopped() -> None:
    write("a.tif", scene(7, (200, 150)))
    how = ("a.tif", "--width", 0.1, "-o", "a.fgb", "--tile", 64, "--resume", "kept")
    done(*how)
    wanted = Path("a.fgb").read_bytes()
    assert "resumed: 12 of 12 tiles were done (outline)" in done(*how, "--overwrite").stderr
    assert Path("a.fgb").read_bytes() == wanted


def test_nothing_valid_is_no_segment_and_that_is_said() -> None:
    write("a.tif", np.zeros((70, 80), np.uint8))
    assert "no segment is left" in done("a.tif", "--width", 0.1, "-o", "a.fgb").stderr
    assert len(geopandas.read_file("a.fgb")) == 0


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--width", "0"], "width of a level is above 0 and at most 1, not 0"),
        (["--width", "1.5"], "width of a level is above 0 and at most 1, not 1.5"),
        (["--width", "-0.1"], "width of a level"),
        (["--width", "nan"], "width of a level"),
        (["--width", "1e-6"], "give a larger width"),
        (["--width", "0.1", "-o", "a.txt"], "regions are written to .geojson"),
        (["--width", "0.1", "-o", "there.fgb"], "there.fgb exists; give --overwrite"),
        (["--width", "0.1", "--labels", "a.png"], "labels are written as GeoTIFF"),
        (["--width", "0.1", "--tile", "65"], "a positive multiple of 64"),
        (["--width", "0.1", "--intensity-step", "2"], "an intensity step lies in 0..1"),
        (["--width", "0.1", "--min-area", "much"], "much"),
        (["--width", "0.1", "--smooth-outline", "-1"], "smoothed by metres that are not negative, not -1"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_bad_input_is_one_line_and_nothing_written(words: list[str], said: str) -> None:
    Path("there.fgb").write_text("mine")
    result = run(QUARRY, *words)
    lines = result.stderr.splitlines()
    assert result.exit_code == 1 and len(lines) == 1 and said in lines[0], result.output
    assert contents() == {"there.fgb": b"mine"}


def ros_map() -> str:
    states = np.ones((100, 90), int)
    states[20:60, 30:80] = 3
    states[70:, :] = 2
    write_ros_map("map.yaml", states, local_geobox(states.shape, 0.05, (0, 0)))
    return "map.yaml"


def test_a_ros_map_has_levels_too() -> None:
    done(ros_map(), "--width", 0.1, "-o", "a.gpkg", "-q", "--labels", "l.tif")
    segments = geopandas.read_file("a.gpkg")
    assert {0, 4, 9} <= set(segments["level"]) and segments["pixels"].sum() == 9000
    assert segments["level"][read("l.tif")[95, 45] - 1] == 4  # unknown: one half belongs to the lower
    assert uavseg.levels("map.yaml", 0.1)["pixels"].tolist() == segments["pixels"].tolist()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--nodata", "0"], "neither bands nor nodata"),
        (["--rgb", "1,2,3"], "neither bands nor nodata"),
        (["--stretch", "minmax"], "which are not stretched"),
        (["--resume", "kept"], "nothing to resume"),
        (["map.yaml"], "no part of a mosaic"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_options_that_mean_nothing_to_a_ros_map_are_refused(words: list[str], said: str) -> None:
    result = run(ros_map(), *words, "--width", 0.1)
    assert result.exit_code == 1 and said in result.stderr and len(result.stderr.splitlines()) == 1
    assert set(contents()) == {"map.yaml", "map.pgm"}


def test_a_width_must_be_given() -> None:
    assert run(QUARRY).exit_code == 2


@pytest.mark.slow
def test_both_faces_say_what_google_earth_does_with_many_corners() -> None:
    image = np.full((190, 190), 200, np.uint8)
    image[1:180:2, 1:180:2] = 20  # 8100 holes of a pixel in one segment
    name = write("holes.tif", image)
    how = ("--width", 0.5, "--refine", "pixels")
    [line] = [line for line in done(name, *how, "-o", "holes.kml").stderr.splitlines() if "warning" in line]
    assert "more than 30,000 corners (up to 32,404), which Google Earth draws wrongly or not at all" in line
    assert "warning" not in done(name, *how, "-o", "holes.gpkg").stderr
    with pytest.warns(UserWarning, match="Google Earth draws wrongly") as caught:
        uavseg.each(uavseg.levels, [name], "each_{stem}.kml", width=0.5, refine="pixels")
    [text] = [str(one.message) for one in caught]
    assert text.endswith(line.removeprefix("uavseg: warning: "))
    assert Path("each_holes.kml").read_bytes() == Path("holes.kml").read_bytes()
