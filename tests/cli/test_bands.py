"""Options that choose bands: what they find, what they say, and that every command takes them."""

import json
from pathlib import Path

import geopandas
import numpy as np
import pytest
import rasterio
from affine import Affine
from click.testing import CliRunner, Result

from uavseg.cli import main
from uavseg.segmentation.blocks.block_file import read_block_map

RED, NIR = 90, 60  # of the field; in the discs they change places


def scene() -> np.ndarray:
    """Four bands: discs in a field that only the ratio of red and near infrared shows; grey is the same."""
    row, col = np.indices((160, 200))
    inside = ((row % 80 - 40) ** 2 + (col % 100 - 50) ** 2) < 25**2
    red, nir = np.where(inside, NIR, RED), np.where(inside, RED, NIR)
    noise = np.random.default_rng(2).integers(-4, 5, (4, 160, 200))
    return (np.stack([red, np.full_like(red, 70), np.full_like(red, 50), nir]) + noise).astype(np.uint8)


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty folder to work in, with rasters with and without names of bands."""
    monkeypatch.chdir(tmp_path)
    how = {"crs": "EPSG:32618", "transform": Affine(2, 0, 4e5, 0, -2, 5e6), "dtype": "uint8"}
    for name in ("named.tif", "plain.tif"):
        with rasterio.open(name, "w", "GTiff", height=160, width=200, count=4, **how) as file:
            file.write(scene())
            if name == "named.tif":
                file.descriptions = ("Red", "Green", "Blue", "Band 4 - NIR")
    return tmp_path


def run(*arguments: object) -> Result:
    return CliRunner().invoke(main, [str(argument) for argument in arguments])


def regions(*arguments: object) -> geopandas.GeoDataFrame:
    result = run("extract", *arguments, "--range", "0.55,1", "-o", "out.fgb", "--overwrite")
    assert result.exit_code == 0, result.output
    return geopandas.read_file("out.fgb")


def test_an_index_finds_what_no_band_alone_tells_from_noise() -> None:
    found = regions("named.tif", "--index", "ndvi")
    assert len(found) == 4
    assert found["pixels"].to_numpy() == pytest.approx(np.pi * 25**2, rel=0.03)
    assert found["mean"].to_numpy() == pytest.approx((1 + 30 / 150) / 2, abs=0.01)


@pytest.mark.slow
def test_an_index_an_expression_and_numbers_give_the_same_regions() -> None:
    known = regions("named.tif", "--index", "ndvi").geometry
    stretched = ("--stretch", "-1,1")
    for words in (
        ("named.tif", "--expr", "(nir - red) / (nir + red)", *stretched),
        ("plain.tif", "--expr", "(b4 - b1) / (b4 + b1)", *stretched),
        ("plain.tif", "--index", "NDVI", "--band-names", "red,green,blue,nir"),
        ("plain.tif", "--index", "ndvi", "--band-names", "nir=4,red=1"),
    ):
        assert regions(*words).geometry.equals(known), words


@pytest.mark.slow
def test_a_band_is_taken_by_name_or_number() -> None:
    known = regions("plain.tif", "--band", 4, "--stretch", "40,110")
    assert len(known) == 4
    for name in ("nir", "NIR", "B4", "4", " nir "):
        found = regions("named.tif", "--band", name, "--stretch", "40,110")
        assert found.equals(known.assign(source="named.tif"))
    colors = [
        regions("named.tif", "--rgb", names, "--stretch", "40,90") for names in ("NIR,red,green", "4,1,2")
    ]
    assert len(colors[0]) > 0 and colors[0].equals(colors[1])


@pytest.mark.slow
@pytest.mark.parametrize(
    "line",
    [
        "suggest named.tif --classes 2",
        "levels named.tif --width 0.1 -o out.geojson",
        "match named.tif --like 400100,4999920,60 -o out.geojson",
        "divide named.tif -o out.tif",
        "original named.tif -o out.tif",
        "preview named.tif -o out.png --width 300",
        "info named.tif",
        "classify named.tif --stretch -1,1 -o out.tif",
    ],
)
def test_every_command_that_reads_rasters_takes_an_index(line: str) -> None:
    result = run(*line.split(), "--index", "ndvi")
    assert result.exit_code == 0, result.output


def test_suggested_commands_keep_the_index_and_the_names() -> None:
    words = ["--index", "ndvi", "--band-names", "red,green,blue,nir"]
    result = run("suggest", "plain.tif", "--classes", "2", "--json", *words)
    for one in json.loads(result.stdout)["ranges"]:
        assert "--index ndvi" in one["command"] and "--band-names red,green,blue,nir" in one["command"]


@pytest.mark.slow
def test_a_block_map_remembers_its_formula_and_is_refined_with_it() -> None:
    assert run("divide", "plain.tif", "--expr", "(b4 - b1) / (b4 + b1)", "-o", "blocks.tif").exit_code == 0
    assert read_block_map("blocks.tif").origin.words.expr == "(b4 - b1) / (b4 + b1)"
    whole = regions("plain.tif", "--expr", "(b4 - b1) / (b4 + b1)")
    assert regions("blocks.tif").geometry.equals(whole.geometry)
    assert run("divide", "named.tif", "--band", "nir", "-o", "other.tif").exit_code == 0
    assert read_block_map("other.tif").origin.band == 4
    assert regions("other.tif").geometry.equals(regions("named.tif", "--band", "4").geometry)


@pytest.mark.slow
def test_regions_say_of_which_formula_and_bands_they_are() -> None:
    words = ["--expr", "(nir - b1) / (nir + b1)", "--band-names", "nir=4"]
    for line in (
        ["extract", "plain.tif", "--range", "0.5,1"],
        ["match", "plain.tif", "--like", "400100,4999920,60"],
    ):
        assert run(*line, *words, "-o", "out.geojson", "--overwrite").exit_code == 0
        metadata = str(json.loads(Path("out.geojson").read_text()) | {"features": []})
        assert "'expr': '(nir - b1) / (nir + b1)'" in metadata and "'band_names': 'nir=4'" in metadata
        assert "'index'" not in metadata and "BandWords" not in metadata


def test_info_shows_names_and_describes_a_raster_of_many_bands() -> None:
    assert "4: uint8 Band 4 - NIR, nir" in run("info", "named.tif").stdout
    names = [band["name"] for band in json.loads(run("info", "named.tif", "--json").stdout)["bands"]]
    assert names == ["Red", "Green", "Blue", "Band 4 - NIR, nir"]
    planes = np.concatenate([scene(), scene()])
    how = {"crs": "EPSG:32618", "transform": Affine(2, 0, 4e5, 0, -2, 5e6), "dtype": "uint8"}
    with rasterio.open("many.tif", "w", "GTiff", height=160, width=200, count=8, **how) as file:
        file.write(planes)
        file.descriptions = tuple("abcdefgh")
    shown = run("info", "many.tif")
    assert "8: uint8 h" in shown.stdout and "no band is chosen" in shown.stdout
    refused = run("extract", "many.tif", "--range", "0.5,1")
    assert refused.exit_code == 1 and "has 8 bands" in refused.stderr and "8: h" in refused.stderr


@pytest.mark.parametrize(
    ("words", "code", "text"),
    [
        (["--band", "nri"], 1, "no band is named 'nri'; the bands are 1: Red; 2: Green; 3: Blue; 4: Band 4"),
        (["--band", "0"], 2, "counted from 1"),
        (["--band", ""], 2, "a number or a name"),
        (["--rgb", "1,2"], 2, "three bands"),
        (["--rgb", "nir,red,gren"], 1, "no band is named 'gren'"),
        (["--index", "ndbi"], 1, "ndbi = (swir1 - nir) / (swir1 + nir): no band is named 'swir1'"),
        (["--index", "NVDI"], 1, "known are ndvi, gndvi"),
        (["--expr", "(ner - red) / (nir + red)"], 1, "column 2 (^), (^ner - red)"),
        (["--expr", "__import__('os').system('touch bad')"], 1, "functions are"),
        (["--expr", "nir", "--index", "ndvi"], 1, "not both"),
        (["--expr", "nir", "--band", "1"], 1, "one of them"),
        (["--band-names", "red,green"], 1, "4 bands, and 2 names"),
    ],
)
def test_what_is_wrong_is_one_line_and_nothing_is_written(words: list[str], code: int, text: str) -> None:
    result = run("extract", "named.tif", "--range", "0.5,1", "-o", "out.geojson", *words)
    assert result.exit_code == code and text in result.stderr
    assert code == 2 or result.stderr.count("\n") == 1
    assert not Path("out.geojson").exists() and not Path("bad").exists()
