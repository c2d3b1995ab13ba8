"""Classes of `uavseg extract` and `uavseg plan`, and breaks of `uavseg levels`, from the command line."""

import json
from pathlib import Path

import geopandas
import numpy as np
import pytest
import rasterio
import shapely
from affine import Affine
from click.testing import CliRunner, Result
from geopandas.testing import assert_geodataframe_equal
from matplotlib.image import imread

import uavseg
from uavseg.cli import main

THREE = ("--class", "dark=0,0.3", "--class", "mid=0.3,0.55", "--class", "bright=0.55,1")
MAPPING = {"dark": (0, 0.3), "mid": (0.3, 0.55), "bright": (0.55, 1)}


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    rng = np.random.default_rng(2)
    patches = rng.choice([30, 100, 200], (12, 14)).repeat(20, 0).repeat(20, 1)
    image = np.clip(patches + rng.normal(0, 5, patches.shape), 1, 255).astype(np.uint8)
    image[40:60, 90:130] = 0
    place = {"crs": "EPSG:32618", "transform": Affine(2, 0, 4e5, 0, -2, 5e6), "nodata": 0}
    with rasterio.open("a.tif", "w", "GTiff", *image.shape[::-1], 1, dtype="uint8", **place) as file:
        file.write(image, 1)
    return tmp_path


def run(*words: object) -> Result:
    return CliRunner().invoke(main, [*map(str, words)])


def done(*words: object) -> Result:
    result = run(*words)
    assert result.exit_code == 0, result.output
    return result


def read(name: str) -> np.ndarray:
    with rasterio.open(name) as file:
        return np.asarray(file.read(1))


def test_one_class_has_the_regions_of_its_range_and_a_column_more() -> None:
    done("extract", "a.tif", "--range", "0.3,0.55", "-o", "range.fgb", "-q")
    done("extract", "a.tif", "--class", "mid=0.3,0.55", "-o", "class.fgb", "-q")
    one, other = geopandas.read_file("class.fgb"), geopandas.read_file("range.fgb")
    assert set(one["class"]) == {"mid"} and list(one.columns[:2]) == ["id", "class"] and len(one) > 3
    assert_geodataframe_equal(one.drop(columns="class"), other)


@pytest.mark.parametrize("ending", ["geojson", "gpkg", "fgb", "parquet", "shp", "kml"])
def test_every_format_holds_the_class_of_each_region(ending: str) -> None:
    done("extract", "a.tif", *THREE, "-o", f"a.{ending}", "--labels", "l.tif")
    read_file = geopandas.read_parquet if ending == "parquet" else geopandas.read_file
    found = read_file(f"a.{ending}").sort_values("id")
    labels, image = read("l.tif"), read("a.tif")
    assert np.array_equal(labels > 0, image > 0)  # the classes cover all of v, and each pixel is in one
    limits = {"dark": (0, 70), "mid": (70, 150), "bright": (150, 256)}
    numbers = found["id"].astype(str).str.removeprefix("region.").astype(int)  # KML has texts
    for number, name in zip(numbers, found["class"], strict=True):
        low, high = limits[name]
        assert low < np.median(image[labels == number]) < high


def test_adjoining_classes_share_borders_without_gaps_or_overlaps() -> None:
    done("extract", "a.tif", *THREE, "-o", "a.gpkg")
    shapes = geopandas.read_file("a.gpkg").geometry
    union = shapely.union_all(shapes)
    assert union.area == pytest.approx(shapes.area.sum()) == 4 * np.count_nonzero(read("a.tif"))
    assert sum(len(part.interiors) for part in shapely.get_parts(union)) == 1  # the nodata


@pytest.mark.slow
def test_classes_of_a_file_have_colours_and_the_same_regions() -> None:
    Path("c.csv").write_text('Name,Range,Colour\ndark,"0,0.3",#2040FF\nmid,"0.3,0.55",\nbright,"0.55,1",\n')
    Path("low.csv").write_text("class,low,high\ndark,0,0.3\nmid,0.3,0.55\nbright,0.55,1\n")
    Path("c.yaml").write_text(
        "- {name: dark, range: [0, 0.3], color: '#2040ff'}\n- {name: mid, range: '0.3,0.55'}\n"
        "- {name: bright, low: 0.55, high: 1}\n"
    )
    Path("map.yaml").write_text(
        "classes:\n  dark: [0, 0.3]\n  mid: {range: [0.3, 0.55]}\n  bright: [0.55, 1]\n"
    )
    done("extract", "a.tif", *THREE, "-o", "a.fgb")
    plain = geopandas.read_file("a.fgb")
    for name in ("c.csv", "low.csv", "c.yaml", "map.yaml"):
        done("extract", "a.tif", "--classes", name, "-o", "b.fgb", "--overwrite")
        found = geopandas.read_file("b.fgb")
        if name.startswith("c."):
            assert dict(zip(found["class"], found.pop("color"), strict=True))["dark"] == "#2040ff"
        assert_geodataframe_equal(found, plain)


def test_several_ranges_are_classes_named_after_them() -> None:
    told = done("extract", "a.tif", "--range", "0.55,1", "--range", "0,0.3", "-o", "a.fgb").stderr
    found = geopandas.read_file("a.fgb")
    assert set(found["class"]) == {"0.55,1", "0,0.3"} and "classes     0.55,1 " in told
    assert found.groupby("class")["range_low"].unique().map(list).to_dict() == {
        "0.55,1": [0.55],
        "0,0.3": [0],
    }


def test_python_and_the_command_give_the_same() -> None:
    done("extract", "a.tif", *THREE, "-o", "a.parquet", "--fill-holes", "300px", "--min-area", "100px")
    found = uavseg.extract("a.tif", classes=MAPPING, fill_holes="300px", min_area="100px")
    assert_geodataframe_equal(found, geopandas.read_parquet("a.parquet"))
    done("levels", "a.tif", "--breaks", "otsu:3", "-o", "b.parquet")
    assert_geodataframe_equal(uavseg.levels("a.tif", breaks="otsu:3"), geopandas.read_parquet("b.parquet"))


@pytest.mark.slow
def test_tiles_threads_block_maps_checkpoints_and_each_give_the_same_bytes() -> None:
    done("extract", "a.tif", *THREE, "-o", "a.fgb")
    wanted = Path("a.fgb").read_bytes()
    done("divide", "a.tif", "-o", "blocks.tif")
    for source, how in (
        ("a.tif", ("--tile", 64, "--threads", 1)),
        ("a.tif", ("--tile", 128, "--threads", 2, "--resume", "kept")),
        ("a.tif", ("--tile", 128, "--resume", "kept")),
        ("blocks.tif", ()),
    ):
        done("extract", source, *THREE, "-o", "b.fgb", "--overwrite", *how)
        assert Path("b.fgb").read_bytes() == wanted
    done("extract", "a.tif", *THREE, "--each", "-o", "{stem}.each.fgb")
    assert Path("a.each.fgb").read_bytes() == wanted
    uavseg.each(uavseg.extract, "a.tif", "{stem}.py.fgb", classes=MAPPING)
    assert Path("a.py.fgb").read_bytes() == wanted


def test_a_hole_that_is_filled_takes_regions_of_other_classes_with_it() -> None:
    image = np.full((128, 128), 30, np.uint8)
    image[50:60, 50:60] = 100
    image[52:56, 52:56] = 200
    with pytest.warns(UserWarning, match=r"no region of mid .* is left once holes are filled"):
        found = uavseg.extract(image, classes=MAPPING, fill_holes="200px")
    assert found["class"].tolist() == ["dark"] and found["pixels"].tolist() == [128 * 128]
    with pytest.warns(UserWarning, match=r"no region of bright \(0\.55,1\) is left"):
        found = uavseg.extract(image, classes=MAPPING, fill_holes="50px")
    assert found["class"].tolist() == ["dark", "mid"] and found["pixels"].tolist() == [128 * 128 - 100, 100]


def test_levels_are_refined_and_share_borders() -> None:
    done("levels", "a.tif", "--breaks", "0.3,0.55", "-o", "l.fgb")
    done("extract", "a.tif", *THREE, "-o", "c.fgb")
    levels, classes = geopandas.read_file("l.fgb"), geopandas.read_file("c.fgb")
    assert classes["class"].map({"dark": 0, "mid": 1, "bright": 2}).tolist() == levels["level"].tolist()
    assert_geodataframe_equal(levels.drop(columns="level"), classes.drop(columns="class"))
    image = read("a.tif")
    done("levels", "a.tif", "--breaks", "0.3,0.55", "-o", "r.fgb", "--labels", "r.tif")
    done("levels", "a.tif", "--breaks", "0.3,0.55", "--refine", "none", "-o", "n.fgb", "--labels", "n.tif")
    own = np.digitize(image / 255, [0.3, 0.55])
    wrong = {}
    for name in "rn":
        level = np.array([-1, *geopandas.read_file(f"{name}.fgb").sort_values("id")["level"]])
        wrong[name] = np.mean((level[read(f"{name}.tif")] != own)[image > 0])
    assert wrong["r"] < 0.002 < 0.05 < wrong["n"]  # patches of 20 pixels do not end at blocks of 8


@pytest.mark.parametrize(
    ("breaks", "count"), [("otsu:3", 3), ("otsu:2", 2), ("otsu", 0), ("quantile", 5), ("quantile:4", 4)]
)
def test_breaks_by_a_rule(breaks: str, count: int) -> None:
    told = done("levels", "a.tif", "--breaks", breaks, "-o", "l.fgb").stderr
    levels = geopandas.read_file("l.fgb")
    assert f"{levels['level'].nunique()} by {breaks.split(':')[0]}: 0.." in told
    assert levels["level"].nunique() == count or not count
    if breaks.startswith("otsu:"):
        suggested = {one.range for one in uavseg.suggest("a.tif", count)}
        assert set(zip(levels["range_low"], levels["range_high"], strict=True)) <= suggested
    if breaks.startswith("quantile"):
        shares = levels.groupby("level")["pixels"].sum() / levels["pixels"].sum()
        assert shares.to_numpy() == pytest.approx(1 / count, abs=0.12)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--class", "a=0,0.5", "--class", "b=0.4,1"], "the classes a (0,0.5) and b (0.4,1) overlap"),
        (["--range", "0,0.5", "--range", "0.4,1"], "the classes 0,0.5 (0,0.5) and 0.4,1 (0.4,1) overlap"),
        (["--class", "a=0,0.5", "--class", "a=0.5,1"], "2 classes have the name a"),
        (["--class", "water"], "--class is NAME=LO,HI, such as water=0,0.2, not 'water'"),
        (["--class", "=0,0.5"], "the class of 0,0.5 has no name"),
        (["--class", "a=0;0.5"], "the range of the class a is two numbers between commas"),
        (["--class", "a=0,1", "--range", "0,1"], "--range and --class do not go together"),
        ([], "Missing option '--range'"),
        (["--class", "a=0,1", "--values", "3,4"], "--values and --class do not go together"),
        (["--range", "0,0.5", "--range", "0.5,1", "--values", "3,4"], "do not go together"),
        (
            ["--class", "a=0,1", "--refine", "scan"],
            "refined together by tv, pixels or none; scan is for one range",
        ),
        (["--classes", "none.csv"], "there is no file none.csv"),
        (["--classes", "bad.csv"], "'colors' is not known; expected columns name and range"),
        (["--classes", "split.csv"], "has 3 fields and the header 2; a range with a comma stands in quotes"),
        (["--classes", "empty.csv"], "it has no classes"),
        (["--classes", "color.csv"], "the color of the class a is written #rrggbb, not 'red'"),
        (["--classes", "over.csv"], "over.csv: the classes a (0,0.5) and b (0.4,1) overlap"),
        (["--classes", "bad.yaml"], "it is not YAML"),
        (["--classes", "list.yaml"], "it has no list of classes"),
        (["--classes", "a.tif"], "classes are read from .csv or .yaml"),
        (["--class", "a=0,1", "--mission-class", "a"], "give --mission too"),
        (
            ["--class", "a=0,1", "--mission", "a.plan", "--mission-class", "b"],
            "there is no class b; the classes are a",
        ),
        ([*THREE, "--mission", "a.plan"], "say which class the mission flies over"),
    ],
)
def test_bad_words_are_refused_in_a_line(words: list[str], said: str) -> None:
    Path("bad.csv").write_text("name,low,high,colors\na,0,1,red\n")
    Path("split.csv").write_text("name,range\na,0,0.5\n")
    Path("empty.csv").write_text("name,range\n")
    Path("color.csv").write_text("name,low,high,color\na,0,1,red\n")
    Path("over.csv").write_text("name,low,high\na,0,0.5\nb,0.4,1\n")
    Path("bad.yaml").write_text("a: [0, 1\n")
    Path("list.yaml").write_text("- a\n")
    before = sorted(Path().iterdir())
    result = run("extract", "a.tif", "-o", "out.fgb", *words)
    assert result.exit_code in (1, 2) and said in result.stderr.replace("\n", " "), result.stderr
    assert "Traceback" not in result.output and sorted(Path().iterdir()) == before


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--breaks", "0.5,0.2"], "breaks increase, above 0 and below 1"),
        (["--breaks", "0.2,1"], "breaks increase, above 0 and below 1"),
        (["--breaks", "jenks"], "otsu, otsu:3, quantile or quantile:4, not 'jenks'"),
        (["--breaks", "otsu:"], "not 'otsu:'"),
        (["--breaks", "otsu:9"], "levels by otsu are 2 to 8 in number, not 9"),
        (["--breaks", "quantile:1"], "levels by quantile are 2 to 100 in number, not 1"),
        (["--breaks", "otsu", "--width", "0.1"], "give --width P, or --breaks"),
        ([], "give --width P, or --breaks"),
        (["--width", "0.001", "--refine", "tv"], "up to 127 are refined to the pixel"),
    ],
)
def test_bad_breaks_are_refused_in_a_line(words: list[str], said: str) -> None:
    result = run("levels", "a.tif", "-o", "out.fgb", *words)
    assert result.exit_code in (1, 2) and said in result.stderr and not Path("out.fgb").exists()


HOW = ("--home", "45.1497,-76.2712", "--altitude", "40", "--allow-edge", "--max-altitude", "120")


def places(name: str) -> geopandas.GeoDataFrame:
    return geopandas.read_file(name).to_crs("EPSG:4326")


def test_a_plan_leads_over_one_class_and_keeps_out_of_another() -> None:
    done("extract", "a.tif", *THREE, "-o", "a.gpkg", "--min-area", "2000px")
    regions = places("a.gpkg")
    done("plan", "a.gpkg", "--class", "dark", "-o", "dark.geojson", *HOW)
    done("plan", "a.gpkg", "--where", "class == 'dark'", "-o", "where.geojson", *HOW)
    assert Path("dark.geojson").read_bytes() == Path("where.geojson").read_bytes()
    dark = regions[regions["class"] == "dark"]
    result = json.loads(
        done("plan", "a.gpkg", "--class", "dark", "-o", "b.geojson", "--json", "-q", *HOW).stdout
    )
    assert result["regions"] == len(dark) > 1
    how = {"altitude": 40, "home": (45.1497, -76.2712), "allow_edge": True}
    with pytest.warns(UserWarning, match="altitude of home"):
        planned = uavseg.plan("a.gpkg", classes="dark", **how)
    assert planned.regions == len(dark)
    refused = run("plan", "a.gpkg", "--class", "swamp", "-o", "x.geojson", *HOW)
    assert (
        refused.exit_code == 1
        and "no region is of the class swamp; there are bright, dark, mid" in refused.stderr
    )
    both = run("plan", "a.gpkg", "--class", "dark", "--avoid-class", "dark", "-o", "x.geojson", *HOW)
    assert both.exit_code == 1 and "the class dark is to be flown over and kept out of" in both.stderr


def test_no_leg_enters_a_class_that_is_kept_out_of() -> None:
    done("extract", "a.tif", *THREE, "-o", "a.gpkg", "--min-area", "2000px")
    regions = places("a.gpkg")
    water = shapely.union_all(regions[regions["class"] == "bright"].geometry)
    home = regions[regions["class"] == "mid"].geometry.representative_point().iloc[0]
    how = ("--home", f"{home.y},{home.x}", "--altitude", 40, "--allow-edge", "--avoid-margin", 1)
    for name, words in (("free", ()), ("kept", ("--avoid-class", "bright"))):
        found = run("plan", "a.gpkg", "--class", "mid", "-o", f"{name}.geojson", *how, *words)
        if found.exit_code:  # a region with no way around the bright ones is refused, and named
            assert words and "zone" in found.stderr
            return
        flown = geopandas.read_file(f"{name}.geojson")
        lines = flown[flown.geometry.geom_type == "LineString"].geometry
        assert shapely.intersects(shapely.union_all(lines), water) != bool(words)


@pytest.mark.slow
def test_a_mission_over_classes_is_over_the_class_that_is_named() -> None:
    how = ("--min-area", "2000px", "--altitude", 40, "--home", "auto", "--allow-edge", "--overwrite")
    requested = ("--class", "dark=0,0.3", "--class", "mid=0.3,0.55")
    report = done(
        "extract",
        "a.tif",
        *requested,
        *how,
        "-o",
        "a.gpkg",
        "--mission",
        "m.geojson",
        "--mission-class",
        "mid",
    )
    count = (places("a.gpkg")["class"] == "mid").sum()
    assert f"m.geojson: {count} region" in report.stderr
    one = done("extract", "a.tif", "--class", "mid=0.3,0.55", *how, "-o", "b.gpkg", "--mission", "n.geojson")
    assert f"n.geojson: {count} region" in one.stderr  # of one class there is nothing to choose
    again = run(
        *(
            "extract",
            "a.tif",
            *requested,
            *how,
            "-o",
            "a.gpkg",
            "--mission",
            "m.geojson",
            "--mission-class",
            "mid",
        ),
        *("--avoid-class", "dark", "--avoid-margin", 0.5),
    )
    assert ("that --min-area drops" in again.stderr) == (again.exit_code == 0)


@pytest.mark.slow
def test_preview_draws_regions_in_the_colours_of_their_classes() -> None:
    Path("c.csv").write_text("name,low,high,color\ndark,0,0.3,#0000ff\nbright,0.55,1,#ff0000\n")
    done("extract", "a.tif", "--classes", "c.csv", "-o", "a.gpkg")
    done("preview", "a.tif", "--regions", "a.gpkg", "-o", "a.png", "--width", 600)
    red, _, blue = (255 * imread("a.png")[:, :, :3].transpose(2, 0, 1)).astype(int)
    assert (red - blue > 100).sum() > 500 and (blue - red > 100).sum() > 500


def test_the_style_has_the_colours_of_classes() -> None:
    Path("c.csv").write_text("name,low,high,color\ndark,0,0.3,#0102ff\nbright,0.55,1,\n")
    done("extract", "a.tif", "--classes", "c.csv", "-o", "a.gpkg", "--style", "qml")
    style = Path("a.qml").read_text()
    assert 'attr="class"' in style and 'value="dark"' in style and 'value="bright"' in style
    assert "1,2,255" in style
