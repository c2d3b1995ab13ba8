"""`uavseg classify`, from the command line to the files."""

import json
import warnings
from contextlib import chdir
from pathlib import Path
from typing import Any

import geopandas
import numpy as np
import pytest
import rasterio
from affine import Affine
from click.testing import CliRunner, Result
from rasterio.errors import NotGeoreferencedWarning

from uavseg.cli import main
from uavseg.occupancy.map_file import open_map
from uavseg.occupancy.ros.ros_map import pgm_bytes, write_ros_map
from uavseg.raster.formats.png import write_png
from uavseg.raster.grid.geobox import GeoBox
from uavseg.raster.grid.tiling import Window
from uavseg.regions.formats import export
from uavseg.segmentation.params.segment import StateLimits

BOX = GeoBox((100, 150), Affine(0.05, 0, -2, 0, -0.05, 6), None)
MODES = ["trinary", "scale", "raw"]
ALLOWED = ["--allow-lost-obstacles"]


def room() -> np.ndarray:
    """A free room with two thick things in it, a thin wall, and nothing known around it."""
    p = np.full(BOX.shape, 0.5, np.float32)
    p[8:90, 11:140] = 0.05
    p[20:45, 30:62] = 0.9
    p[60:81, 90:97] = 0.95
    p[8:90, 70] = 0.97
    return p


def write(name: str, values: np.ndarray, nodata: float | None = None, **how: Any) -> str:
    place = {"transform": BOX.transform, "nodata": nodata} | how
    with rasterio.open(name, "w", "GTiff", *values.shape[::-1], 1, dtype=values.dtype.name, **place) as file:
        file.write(values, 1)
    return name


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    write("map.tif", room())
    return tmp_path


def run(*words: object) -> Result:
    return CliRunner().invoke(main, ["classify", *map(str, words)])


def done(*words: object) -> Result:
    result = run(*words)
    assert result.exit_code == 0, result.output
    return result


def refused(*words: object) -> str:
    """The one line of a refusal, which leaves nothing behind."""
    before = contents()
    result = run(*words)
    lines = result.stderr.splitlines()
    assert result.exit_code == 1 and len(lines) == 1 and result.stdout == "", result.output
    assert contents() == before
    return lines[0].removeprefix("uavseg: error: ")


def contents(folder: Path = Path()) -> dict[str, bytes]:
    return {str(path): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


def read(name: str) -> np.ndarray:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", NotGeoreferencedWarning)  # of states of a picture
        with rasterio.open(name) as file:
            return np.asarray(file.read(1))


def grey_picture(name: str, v: np.ndarray, free_is_white: bool = False) -> str:
    """A picture of probabilities; where free is white, as map savers write it."""
    grey = np.rint(255 * v) if not free_is_white else np.select([v < 0.5, v > 0.5], [254, 0], 205)
    if name.endswith(".pgm"):
        Path(name).write_bytes(pgm_bytes(grey.astype(np.uint8)))
    else:
        write_png(Path(name), grey.astype(np.uint8))
    return name


def ros_map(mode: str) -> str:
    """A ROS map of that mode."""
    states = StateLimits().of(room())
    write_ros_map(f"{mode}.yaml", states, BOX, mode=mode)
    return f"{mode}.yaml"


def table_of(result: Result) -> dict[str, str]:
    lines = [line for line in result.stderr.splitlines() if line.startswith("  ")]
    return {line[2:14].strip(): line[14:] for line in lines}


def test_states_objects_and_labels_and_what_is_reported() -> None:
    table = table_of(done("map.tif", "-o", "s.tif", "--objects", "o.geojson", "--labels", "l.tif"))
    states, labels = read("s.tif"), read("l.tif")
    with rasterio.open("s.tif") as file:
        assert (file.dtypes, file.nodata, file.transform) == (("uint8",), 0, BOX.transform)
        assert file.descriptions == ("state: 1 free, 2 unknown, 3 occupied",)
    objects = geopandas.read_file("o.geojson")
    assert objects["id"].tolist() == list(range(1, len(objects) + 1))
    assert (np.diff(objects["pixels"]) <= 0).all()
    assert np.array_equal(labels > 0, states == 3)
    assert np.bincount(labels.ravel())[1:].tolist() == objects["pixels"].tolist()
    biggest = objects.iloc[0]
    assert biggest["pixels"] >= 25 * 32 and biggest["mean"] == pytest.approx(0.9, abs=0.01)
    bounds = [biggest[name] for name in ("x_min", "y_min", "x_max", "y_max")]
    assert bounds == pytest.approx(biggest.geometry.bounds)
    assert bounds == pytest.approx([-2 + 30 * 0.05, 6 - 45 * 0.05, -2 + 62 * 0.05, 6 - 20 * 0.05])
    assert biggest["area_m2"] == pytest.approx(25 * 32 * 0.0025)
    assert (states[room() > 0.502] == 3).all() and table["restored"].startswith("82 cells")
    assert table["hazard"].startswith(f"0 of {(room() > 0.502).sum():,} cells")
    unseen = ((states == 1) & (room() == 0.5)).sum()
    assert table["unseen"].startswith(f"{unseen} cells") and "lost" not in table
    assert table["largest"].endswith("square units (800 pixels)")
    assert table["objects"] == f"{len(objects)} -> o.geojson"
    for state, name in ((1, "free"), (2, "unknown"), (3, "occupied")):
        assert table[name].startswith(f"{(states == state).sum():,} (")
    assert "no data" not in table


def test_the_default_name_and_quiet() -> None:
    assert done("map.tif", "-q").stderr == ""
    assert read("map.states.tif").shape == BOX.shape


def test_objects_may_go_to_stdout() -> None:
    found = json.loads(done("map.tif", "-o", "s.tif", "--objects", "-", "-q").stdout)
    assert {"x_min", "y_max", "area_m2", "mean"} <= found["features"][0]["properties"].keys()


@pytest.mark.parametrize("suffix", sorted(set(export._WRITERS) - {".kml"}))
def test_objects_in_every_format(suffix: str) -> None:
    done("map.tif", "-o", "s.tif", "--objects", f"o{suffix}", "-q")
    if suffix == ".parquet":
        objects = geopandas.read_parquet(f"o{suffix}")
    else:
        objects = geopandas.read_file(f"o{suffix}")
    objects = objects.sort_values("id")  # a FlatGeobuf is ordered by place
    assert objects["x_min"].min() == pytest.approx(min(objects.bounds["minx"]))
    assert len(objects) > 1 and objects["pixels"].is_monotonic_decreasing


def test_objects_of_a_map_on_the_earth_have_metres() -> None:
    write("utm.tif", room(), crs="EPSG:32618", transform=Affine(2, 0, 4e5, 0, -2, 5e6))
    done("utm.tif", "-o", "s.tif", "--objects", "o.gpkg", "--min-area", "900", "-q")
    objects = geopandas.read_file("o.gpkg")
    assert (objects["area_m2"] >= 900).all() and objects.crs.to_epsg() == 32618
    assert objects["area_m2"].to_numpy() == pytest.approx(4 * objects["pixels"].to_numpy(), rel=2e-3)
    assert objects.iloc[0]["x_min"] == 4e5 + 60


def test_small_objects_are_dropped_and_states_stay() -> None:
    done("map.tif", "-o", "a.tif", "--objects", "a.fgb", "-q")
    done("map.tif", "-o", "b.tif", "--objects", "b.fgb", "--labels", "b.l.tif", "--min-area", "200px", "-q")
    assert Path("a.tif").read_bytes() == Path("b.tif").read_bytes()
    pixels = geopandas.read_file("a.fgb")["pixels"]
    assert geopandas.read_file("b.fgb")["pixels"].tolist() == pixels[pixels >= 200].tolist()
    assert read("b.l.tif").max() == (pixels >= 200).sum()


def test_without_refinement_states_end_at_blocks() -> None:
    done("map.tif", "-o", "s.tif", "--refine", "none", "-q", *ALLOWED)
    states = read("s.tif")
    cells = states[:96, :144].reshape(12, 8, 18, 8)
    assert (cells == cells[:, :1, :, :1]).all()


def test_limits_move_states() -> None:
    done("map.tif", "-o", "s.tif", "--free-below", "0.01", "--occupied-above", "0.6", "-q")
    assert set(np.unique(read("s.tif"))) == {2, 3}


@pytest.mark.parametrize("tile", [64, 128, 4096])
@pytest.mark.parametrize("refine", ["scan", "none"])
def test_tiles_and_threads_change_no_byte(tile: int, refine: str) -> None:
    values = np.tile(room(), (3, 2))
    values[100:130, 20:50] = np.nan
    write("big.tif", values)
    how = ("--objects", "o.fgb", "--labels", "l.tif", "-q", "--refine", refine, "--overwrite", *ALLOWED)
    done("big.tif", "-o", "s.tif", *how, "--tile", 192, "--threads", 1)
    wanted = contents()
    done("big.tif", "-o", "s.tif", *how, "--tile", tile, "--threads", 2)
    assert contents() == wanted


def test_a_run_goes_on_where_it_stopped() -> None:
    how = ("--tile", 64, "--resume", "kept", "--objects", "o.fgb")
    done("map.tif", "-o", "s.tif", *how)
    wanted = {name: Path(name).read_bytes() for name in ("s.tif", "o.fgb")}
    again = done("map.tif", "-o", "s.tif", *how, "--overwrite")
    assert "resumed: 6 of 6 tiles were done (encode)" in again.stderr
    assert {name: Path(name).read_bytes() for name in wanted} == wanted


# ROS maps


@pytest.mark.parametrize("given", MODES)
@pytest.mark.parametrize("written", MODES)
def test_a_ros_map_is_read_back_to_the_same_states(given: str, written: str) -> None:
    done(ros_map(given), "-o", "s.tif", "-q")
    done(f"{given}.yaml", "-o", "out.yaml", "--mode", written, "-q")
    dataset, _ = open_map("out.yaml")
    values, _ = dataset.read(Window(0, 0, *BOX.shape))
    assert np.array_equal(StateLimits().of(values[0]), read("s.tif"))
    assert dataset.geobox.transform.almost_equals(BOX.transform)
    assert set(np.unique(read("s.tif"))) == {1, 2, 3}


def test_a_ros_map_is_classified_as_the_raster_of_its_probabilities() -> None:
    done(ros_map("trinary"), "-o", "a.tif", "-q")
    write("p.tif", open_map("trinary.yaml")[0].read(Window(0, 0, *BOX.shape))[0][0])
    done("p.tif", "-o", "b.tif", "-q")
    assert np.array_equal(read("a.tif"), read("b.tif"))


def test_nodata_is_unknown_to_ros_and_that_is_said() -> None:
    values = room()
    values[30:60, 100:130] = np.nan
    write("holes.tif", values)
    done("holes.tif", "-o", "s.tif", "-q")
    result = done("holes.tif", "-o", "out.yml")
    assert (
        f"warning: a ROS map knows no nodata: {900:,} cells without data are unknown in out.yml"
        in result.stderr
    )
    assert table_of(result)["no data"].startswith("900 (6.0 %)")
    values, _ = open_map("out.yml")[0].read(Window(0, 0, *BOX.shape))
    states = read("s.tif")
    assert (states[30:60, 100:130] == 0).all()
    assert np.array_equal(StateLimits().of(values[0]), np.where(states == 0, 2, states))


# What is refused


@pytest.fixture(scope="module")
def drawn(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder for all refusals, each of which leaves it as it was."""
    with chdir(tmp_path_factory.mktemp("drawn")):
        write("map.tif", room())
        write("there.tif", room())
        Path("there.pgm").write_text("mine")
        grey_picture("there.png", room())
        write("nothing.tif", np.full((70, 80), np.nan, np.float32))
        write("high.tif", np.full((70, 80), 7, np.float32))
        write("stretched.tif", room(), transform=Affine(2, 0, 0, 0, -1, 0))
        good = "resolution: 0.05\norigin: [0, 0, 0]\nnegate: 0\noccupied_thresh: 0.6\nfree_thresh: 0.2\n"
        ros_map("raw")
        Path("good.yaml").write_text(f"image: raw.pgm\n{good}")
        Path("lone.yaml").write_text(f"image: lone.pgm\n{good}")
        Path("overlap.yaml").write_text(f"image: raw.pgm\n{good}".replace("0.2", "0.7"))
        Path("negative.yaml").write_text(f"image: raw.pgm\n{good}".replace("0.05", "-0.05"))
        Path("nan.yaml").write_text(f"image: raw.pgm\n{good}".replace("0.05", ".nan"))
        CliRunner().invoke(main, ["divide", "map.tif", "-o", "blocks.tif", "-q"])
        return Path.cwd()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (
            ["map.tif", "--free-below", "0.6"],
            "limits of states with 0 <= free below < occupied above <= 1",
        ),
        (["map.tif", "--occupied-above", "nan"], "expected limits of states"),
        (["map.tif", "-o", "s.png"], "states are written to .tif, or to .yaml for a ROS map"),
        (["map.tif", "-o", "there.tif"], "there.tif exists; give --overwrite"),
        (["map.tif", "-o", "there.yaml"], "there.pgm exists; give --overwrite"),
        (["map.tif", "--objects", "there.tif"], "regions are written to .geojson"),
        (["map.tif", "--labels", "there.tif"], "there.tif exists"),
        (["map.tif", "-o", "s.tif", "--labels", "./s.tif"], "two outputs have the same name"),
        (["map.tif", "-o", "no/s.tif"], "the folder no does not exist"),
        (["map.tif", "--objects", "o.kml"], "no place on the globe"),
        (["map.tif", "--tile", "100"], "a positive multiple of 64"),
        (["map.tif", "--min-area", "5", "--objects", "o.fgb"], "give the area in pixels, such as 5px"),
        (["none.tif"], "none.tif"),
        (["none.yaml"], "there is no file none.yaml"),
        (["nothing.tif"], "nothing.tif has no valid cell: all of it is nodata or NaN"),
        (["high.tif"], "a map of probabilities lies in 0..1 and this one holds 7"),
        (["stretched.tif", "-o", "s.yaml"], "square cells"),
        (["lone.yaml"], "lone.yaml names a file that cannot be read: there is no file lone.pgm"),
        (["overlap.yaml"], "free_thresh (0.7) lies below occupied_thresh (0.6)"),
        (["negative.yaml"], "resolution is metres per cell, a number above 0, not -0.05"),
        (["nan.yaml"], "resolution is metres per cell, a number above 0, not nan"),
        (["good.yaml", "--nodata", "0"], "leave band, rgb and nodata out"),
        (["good.yaml", "--resume", "kept"], "leave resume out"),
        (["map.tif", "--method", "paper"], "1 obstacle of map.tif has no occupied cell"),
        (["map.tif", "--refine", "none"], "(--allow-lost-obstacles)"),
        (
            ["raw.pgm"],
            "raw.pgm is a picture without its YAML file, which says whether free is white or black",
        ),
        (["raw.pgm"], "give raw.yaml, which is beside it, or else --free-is-white or --free-is-black"),
        (["there.png"], "give the YAML file of the map, or else --free-is-white or --free-is-black"),
        (["good.yaml", "--free-is-white"], "are for a picture without its YAML file"),
        (["map.tif", "--free-is-black"], "are for a picture without its YAML file"),
        (["raw.pgm", "--free-is-white", "--stretch", "0,100"], "no bands, nodata or stretch to choose"),
        (["there.pgm", "--free-is-white"], "there.pgm"),
        (["blocks.tif"], "is a block map; states are refined with the map, so give the map itself"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_bad_input_is_one_line_and_nothing_written(
    drawn: Path, monkeypatch: pytest.MonkeyPatch, words: list[str], said: str
) -> None:
    monkeypatch.chdir(drawn)
    assert said in refused(*words)


def test_overwriting_is_allowed_when_asked() -> None:
    done("map.tif", "-o", "s.tif", "-q")
    done("map.tif", "-o", "s.tif", "-q", "--overwrite", "--method", "paper", *ALLOWED)


def test_a_disk_that_fills_up_leaves_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    import uavseg.segmentation.states.state_image as stateimage

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(stateimage, "pack_codes", full)
    assert "No space left on device" in refused("map.tif", "-o", "s.tif")


def test_a_map_in_per_cent_is_stretched_where_that_is_asked_for() -> None:
    write("percent.tif", np.rint(room() * 100).astype(np.uint8))
    write("exact.tif", (np.rint(room() * 100) / 100).astype(np.float32))
    done("percent.tif", "--stretch", "0,100", "-o", "a.tif")
    done("exact.tif", "-o", "b.tif")
    with rasterio.open("a.tif") as first, rasterio.open("b.tif") as second:
        assert np.array_equal(first.read(1), second.read(1))
        assert set(np.unique(first.read(1))) == {1, 2, 3}
    write("scores.tif", room() * 100)
    line = refused("scores.tif", "-o", "c.tif")
    assert "lies in 0..1" in line and "--stretch LOW,HIGH" in line
    done("scores.tif", "--stretch", "0,100", "-o", "c.tif")


def test_a_ros_map_is_not_stretched_by_auto_either() -> None:
    write_ros_map("map.yaml", np.where(room() < 0.5, 1, 2), BOX)
    done("map.yaml", "-o", "own.tif")
    table = table_of(done("map.yaml", "-o", "auto.tif", "--stretch", "auto"))
    assert np.array_equal(read("own.tif"), read("auto.tif")) and set(np.unique(read("auto.tif"))) == {1, 2}
    assert table["stretch"] == "none -> 0..1"


# Thin obstacles


def test_lost_obstacles_may_be_accepted() -> None:
    result = done("map.tif", "-o", "s.tif", "--method", "paper", "--allow-lost-obstacles")
    assert "warning: 1 obstacle of map.tif has no occupied cell in these states" in result.stderr
    assert table_of(result)["lost"] == "1 obstacles without an occupied cell"
    assert table_of(result)["hazard"].startswith("82 of")
    assert (read("s.tif")[8:90, 70] == 1).all()


@pytest.mark.parametrize("mode", MODES)
def test_a_ros_map_keeps_its_thin_wall(mode: str) -> None:
    result = done(ros_map(mode), "-o", "out.yaml", "--objects", "o.geojson")
    values = open_map("out.yaml")[0].read(Window(0, 0, *BOX.shape))[0][0]
    assert (values[room() > 0.502] == 1).all()
    assert table_of(result)["largest"] == "2.0 m2 (800 pixels)"
    walls = geopandas.read_file("o.geojson")
    assert sorted(walls["pixels"]) == [82, 147, 800]


# Pictures without their YAML file


@pytest.mark.parametrize("ending", ["pgm", "png"])
def test_a_picture_is_read_once_its_polarity_is_known(ending: str) -> None:
    done(ros_map("trinary"), "-o", "wanted.tif", "-q")
    grey_picture(f"white.{ending}", room(), free_is_white=True)
    grey_picture(f"black.{ending}", room())
    result = done(f"white.{ending}", "--free-is-white", "-o", "white.tif", "--objects", "o.fgb")
    assert np.array_equal(read("white.tif"), read("wanted.tif"))
    assert table_of(result)["largest"] == "800.0 square pixels (800 pixels)"
    done(f"black.{ending}", "--free-is-black", "-o", "black.tif", "-q")
    done("map.tif", "-o", "floats.tif", "-q")
    assert (read("black.tif") == read("floats.tif")).mean() > 0.98


def test_path_knows_no_polarity_either() -> None:
    grey_picture("white.pgm", room(), free_is_white=True)
    words = [
        "path",
        "white.pgm",
        "--range",
        "0,0.45",
        "--start",
        "20,15",
        "--goal",
        "60,80",
        "-o",
        "p.geojson",
    ]
    refused = CliRunner().invoke(main, words)
    assert refused.exit_code == 1 and "--free-is-white or --free-is-black" in refused.stderr
    assert CliRunner().invoke(main, [*words, "--free-is-white"]).exit_code == 0


# The YAML file, wherever a raster is given


@pytest.mark.slow
@pytest.mark.parametrize(
    "words",
    [
        ["info", "trinary.yaml"],
        ["suggest", "trinary.yaml", "--classes", "3", "-o", "s.png"],
        ["extract", "trinary.yaml", "--range", "0.6,1", "-o", "r.geojson"],
        ["preview", "trinary.yaml", "-o", "p.png", "--width", "300"],
        ["divide", "trinary.yaml", "-o", "b.tif"],
        ["original", "trinary.yaml", "-o", "l.tif", "--sweeps", "1"],
    ],
    ids=lambda words: words[0],
)
def test_commands_on_rasters_take_a_ros_map(words: list[str]) -> None:
    ros_map("trinary")
    result = CliRunner().invoke(main, words)
    assert result.exit_code == 0, result.output
    if words[0] == "info":
        assert "coordinates are local and in metres" in result.stdout and "0.05 m per pixel" in result.stdout
        assert "try        uavseg extract trinary.yaml" in result.stdout
    if words[0] == "suggest":
        assert "uavseg extract trinary.yaml --range" in result.stdout and Path("s.png").stat().st_size > 1000
    if words[0] == "extract":
        assert geopandas.read_file("r.geojson")["area_m2"].max() == pytest.approx(800 * 0.0025)
        assert " m2 (" in result.stderr


def test_match_says_that_a_ros_map_is_no_raster() -> None:
    result = CliRunner().invoke(main, ["match", ros_map("trinary"), "--like", "x.geojson"])
    assert result.exit_code == 1 and len(result.stderr.splitlines()) == 1


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("aisle", [1, 3, 4, 8])
def test_a_classified_map_of_racks_is_classified_as_itself(mode: str, aisle: int) -> None:
    p = room()
    p[10:88, 72:136] = np.where(np.arange(64) // aisle % 2, 0.05, 0.95)
    p = np.select([p < 0.5, p > 0.5], [0.0, 1.0], 0.5)
    write("racks.tif", p.astype(np.float32))
    done("racks.tif", "-o", "once.yaml", "--mode", mode)
    done("once.yaml", "-o", "twice.yaml", "--mode", mode)
    images = [next(Path().glob(f"{name}.p*")).read_bytes() for name in ("once", "twice")]
    assert images[0] == images[1]
    done("twice.yaml", "-o", "states.tif")
    assert np.array_equal(read("states.tif"), StateLimits().of(p))


def test_states_are_classified_as_themselves() -> None:
    """A raster of states is read as states: its numbers are no probabilities of 255."""
    done("map.tif", "-o", "once.tif")
    done("once.tif", "-o", "twice.tif")
    assert np.array_equal(read("once.tif"), read("twice.tif")) and len(np.unique(read("once.tif"))) == 3
    again = CliRunner().invoke(
        main,
        ["path", "once.tif", "--range", "0,0.4", "--start", "-1,4", "--goal", "0.5,1.6", "-o", "way.geojson"],
    )
    assert again.exit_code == 0, again.output


def test_what_a_ros_map_may_not_mean_is_one_line() -> None:
    name = ros_map("trinary")
    text = Path(name).read_text()
    Path(name).write_text(text.replace("free_thresh: 0.196", "free_thresh: 0.25"))
    assert done(name, "-o", "states.tif").stderr.count("of grey 205") == 1
    Path(name).write_text(text.replace("0.196", "19.6").replace("0.65", "65"))
    assert "as per cent they are 0.65 and 0.196" in refused(name, "--overwrite")
    Path(name).write_text(text + "negate: 1\n")
    assert "'negate' 2 times" in refused(name, "--overwrite")
