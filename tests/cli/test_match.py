"""`uavseg match`, from the command line to the files."""

import json
import subprocess
import sys
from pathlib import Path

import geopandas
import numpy as np
import pytest
import rasterio
import shapely
from affine import Affine
from click.testing import CliRunner, Result
from geopandas.testing import assert_geodataframe_equal

from uavseg.cli import main

ROOT = Path(__file__).resolve().parents[2]
CENTRE = 400_000 + 2 * 100, 5_000_000 - 2 * 100  # of the field, on the map
LIKE = f"{CENTRE[0]},{CENTRE[1]},100"


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def run(*words: object) -> Result:
    return CliRunner().invoke(main, ["match", *map(str, words)])


def done(*words: object) -> Result:
    result = run(*words)
    assert result.exit_code == 0, result.output
    return result


def contents() -> dict[str, bytes]:
    return {str(path): path.read_bytes() for path in sorted(Path().rglob("*")) if path.is_file()}


def fields(seed: int = 0) -> np.ndarray:
    """A ploughed disc in a meadow of the same mean and deviation, with a column of nodata (0)."""
    rng = np.random.default_rng(seed)
    row, col = np.mgrid[:220, :260]
    meadow = rng.normal(size=(222, 262))
    meadow = meadow[1:-1, 1:-1] + meadow[:-2, 1:-1] + meadow[2:, 1:-1] + meadow[1:-1, :-2] + meadow[1:-1, 2:]
    rows = np.sin(row * 2 * np.pi / 7) + 0.3 * rng.normal(size=row.shape)
    ploughed = (row - 100) ** 2 + (col - 100) ** 2 < 75**2
    image = np.where(ploughed, rows / rows.std(), meadow / meadow.std())
    image = np.clip(128 + 30 * image, 1, 255).astype(np.uint8)
    image[:, 240:244] = 0
    return image


def write(name: str = "a.tif", **place: object) -> str:
    how = {"crs": "EPSG:32618", "transform": Affine(2, 0, 4e5, 0, -2, 5e6), "nodata": 0} | place
    image = fields()
    with rasterio.open(name, "w", "GTiff", *image.shape[::-1], 1, dtype="uint8", **how) as file:
        file.write(image, 1)
    return name


def sample(name: str = "sample.gpkg", crs: str = "EPSG:32618", shape: object = None) -> str:
    disc = shapely.Point(CENTRE).buffer(100) if shape is None else shape
    frame = geopandas.GeoDataFrame(geometry=[disc], crs="EPSG:32618").to_crs(crs)
    frame.to_file(name)
    return name


@pytest.mark.slow
def test_regions_labels_and_what_is_reported() -> None:
    told = done(write(), "--like", LIKE, "-o", "a.gpkg", "--labels", "l.tif").stderr
    regions = geopandas.read_file("a.gpkg")
    with rasterio.open("l.tif") as file:
        labels = file.read(1)
    assert list(regions.columns[:4]) == ["id", "similarity", "confidence", "area_m2"]
    assert np.bincount(labels.ravel())[1:].tolist() == regions["pixels"].tolist()
    assert regions["area_m2"][0] == pytest.approx(np.pi * 150**2, rel=0.05)
    assert labels[100, 100] == 1
    assert f"{len(regions)} -> a.gpkg" in told and "is like it" in told and "pixels, v 0.5" in told


@pytest.mark.slow
def test_the_default_name_and_stdout() -> None:
    assert done(write(), "--like", LIKE, "-q").stderr == ""
    written = Path("a.match.geojson").read_bytes()
    assert done("a.tif", "--like", LIKE, "-q", "-o", "-").stdout_bytes == written


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "crs"),
    [
        ("s.geojson", "EPSG:4326"),
        *(
            pytest.param(*case, marks=pytest.mark.slow)
            for case in [
                ("s.gpkg", "EPSG:32618"),
                ("s.fgb", "EPSG:3857"),
                ("old.geojson", "EPSG:32619"),  # with a crs member
                ("s.shp", "EPSG:4326"),
            ]
        ),
    ],
)
def test_a_sample_may_be_in_any_coordinate_system(name: str, crs: str) -> None:
    write()
    if name == "old.geojson":
        frame = geopandas.GeoDataFrame(geometry=[shapely.Point(CENTRE).buffer(100)], crs="EPSG:32618")
        text = json.loads(frame.to_crs(crs).to_json())
        text["crs"] = {"type": "name", "properties": {"name": "urn:ogc:def:crs:EPSG::32619"}}
        Path(name).write_text(json.dumps(text))
    else:
        sample(name, crs)
    done("a.tif", "--like", name, "-o", "file.fgb", "-q")
    done("a.tif", "--like", LIKE, "-o", "disc.fgb", "-q")
    by_file, by_disc = geopandas.read_file("file.fgb"), geopandas.read_file("disc.fgb")
    assert by_file["pixels"][0] == pytest.approx(by_disc["pixels"][0], rel=0.02)
    assert by_file.geometry[0].intersection(by_disc.geometry[0]).area > 0.97 * by_disc.geometry[0].area


@pytest.mark.slow
@pytest.mark.parametrize("refine", ["pixel", "none"])
def test_tiles_and_threads_change_no_byte(refine: str) -> None:
    write()
    how = ("--like", LIKE, "-o", "a.gpkg", "--labels", "l.tif", "-q", "--overwrite", "--refine", refine)
    how += ("--fill-holes", "200px", "--similarity", "0.7")
    done("a.tif", *how, "--tile", 64, "--threads", 1)
    wanted = contents()
    for tile, threads in ((128, 2), (4096, 1)):
        done("a.tif", *how, "--tile", tile, "--threads", threads)
        assert contents() == wanted


@pytest.mark.slow
def test_a_run_goes_on_where_it_stopped() -> None:
    how = (write(), "--like", LIKE, "-o", "a.fgb", "--tile", 64, "--resume", "kept")
    done(*how)
    wanted = Path("a.fgb").read_bytes()
    told = done(*how, "--overwrite").stderr
    assert "resumed: 20 of 20 tiles were done (score)" in told
    assert Path("a.fgb").read_bytes() == wanted


@pytest.mark.slow
def test_pieces_are_the_whole() -> None:
    write("whole.tif")
    image = fields()
    for name, part in {"left.tif": np.s_[:, :90], "right.tif": np.s_[:, 90:]}.items():
        at = Affine(2, 0, 4e5 + 2 * (part[1].start or 0), 0, -2, 5e6)
        cut = image[part]
        with rasterio.open(
            name, "w", "GTiff", *cut.shape[::-1], 1, dtype="uint8", crs="EPSG:32618", transform=at, nodata=0
        ) as file:
            file.write(cut, 1)
    done("whole.tif", "--like", LIKE, "-o", "one.fgb", "-q")
    done("right.tif", "left.tif", "--like", LIKE, "-o", "two.fgb", "-q", "--tile", 64)
    one, two = (geopandas.read_file(name).drop(columns="source") for name in ("one.fgb", "two.fgb"))
    assert_geodataframe_equal(one, two)


@pytest.mark.slow
def test_the_program_itself_reads_files_of_regions() -> None:
    """It leaves out libraries that a command does not need: these two need them."""
    write()
    sample("s.geojson", "EPSG:4326")
    match = ["match", "a.tif", "--like", "s.geojson", "-o", "a.fgb", "-q"]
    plan = ["plan", "a.fgb", "--altitude", "60", "--home", "auto", "-o", "a.plan", "-q"]
    for words in (match, plan):
        told = subprocess.run([sys.executable, "-m", "uavseg", *words], capture_output=True, text=True)
        assert (told.returncode, told.stderr) == (0, "")
    assert Path("a.plan").exists()


@pytest.mark.slow
def test_nothing_found_is_reported() -> None:
    told = done(write(), "--like", LIKE, "-o", "a.fgb", "--min-area", "1e9").stderr
    assert "nothing is like the sample" in told
    assert len(geopandas.read_file("a.fgb")) == 0


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--like", "0,0,100"], "outside of the raster, which is x 400000 to 400520 by y 4999560 to 5000000"),
        (["--like", LIKE.replace(",100", ",20"), "--by", "texture"], "a radius of 16 pixels (32 m) has"),
        (["--like", LIKE, "--window", "128"], "a radius of 128 pixels (256 m) has"),
        (["--like", "1,2"], "X,Y,RADIUS or a file of polygons"),
        (["--like", "1,2,0"], "a radius above 0"),
        (["--like", "absent.geojson"], "absent.geojson does not exist"),
        (["--like", "points.geojson"], "points.geojson holds Point; regions are polygons"),
        (["--like", "none.geojson"], "none.geojson"),
        (["--like", "far.geojson"], "far.geojson lies outside of the raster"),
        (["--like", "a.tif"], "a.tif cannot be read as regions"),
        (["--like", f"{4e5 + 2 * 242},{CENTRE[1]},3"], "lies on nodata"),
        (["--like", LIKE, "--by", "color", "--window", "16"], "are of texture"),
        (["--like", LIKE, "--similarity", "0"], "a similarity is above 0"),
        (["--like", LIKE, "--intensity", "-1"], "not negative, not -1"),
        (["--like", LIKE, "--window", "33"], "the side of a window is one of"),
        (["--like", LIKE, "--tile", "65"], "a positive multiple of 64"),
        (["--like", LIKE, "--min-area", "much"], "much"),
        (["--like", LIKE, "-o", "a.txt"], "regions are written to .geojson"),
        (["--like", LIKE, "-o", "there.fgb"], "there.fgb exists; give --overwrite"),
        (["--like", LIKE, "--labels", "a.png"], "labels are written as GeoTIFF"),
    ],
    ids=lambda value: " ".join(value[:4]) if isinstance(value, list) else "",
)
def test_bad_input_is_one_line_and_nothing_written(words: list[str], said: str) -> None:
    write()
    Path("there.fgb").write_text("mine")
    sample("points.geojson", "EPSG:4326", shapely.Point(CENTRE))
    sample("far.geojson", "EPSG:4326", shapely.box(0, 0, 9, 9))
    Path("none.geojson").write_text('{"type": "FeatureCollection", "features": []}')
    before = contents()
    result = run("a.tif", *words)
    lines = result.stderr.splitlines()
    assert result.exit_code == 1 and len(lines) == 1 and said in lines[0], result.output
    assert contents() == before


@pytest.mark.slow
def test_a_raster_without_a_place_takes_a_disc_alone() -> None:
    with pytest.warns(rasterio.errors.NotGeoreferencedWarning):
        write("local.tif", crs=None, transform=Affine.identity())
    result = run("local.tif", "--like", sample("s.geojson", "EPSG:4326"), "-o", "a.fgb")
    assert result.exit_code == 1 and "give the sample as X,Y,RADIUS" in result.stderr
    done("local.tif", "--like", "100,100,50", "-o", "a.fgb", "-q")
    assert geopandas.read_file("a.fgb")["pixels"][0] == pytest.approx(np.pi * 75**2, rel=0.05)


def test_a_block_map_has_no_texture() -> None:
    write()
    CliRunner().invoke(main, ["divide", "a.tif", "-o", "blocks.tif", "-q"])
    result = run("blocks.tif", "--like", LIKE)
    assert result.exit_code == 1 and "name the raster itself" in result.stderr


def test_a_sample_must_be_given() -> None:
    assert run(write()).exit_code == 2
