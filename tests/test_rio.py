"""The command group as a plugin of rio."""

import json
import os
import shutil
import subprocess
import sys
import tomllib
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any

import click
import geopandas
import numpy as np
import pytest
import rasterio
from affine import Affine
from click.testing import CliRunner, Result
from rasterio.rio.main import main_group

from uavseg.cli import main

pytestmark = pytest.mark.slow

PLUGINS = "rasterio.rio_plugins"


@pytest.fixture
def rio(monkeypatch: pytest.MonkeyPatch) -> click.Group:
    """The command group of rio with the plugin, whether or not the package is installed."""
    monkeypatch.setattr(main_group, "commands", dict(main_group.commands))
    installed = [point for point in entry_points(group=PLUGINS) if point.name == "uavseg"]
    main_group.add_command(installed[0].load() if installed else main)
    return main_group


def run(rio: click.Group, *arguments: Any) -> Result:
    return CliRunner().invoke(rio, [str(argument) for argument in arguments])


@pytest.fixture
def raster(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    monkeypatch.chdir(tmp_path)
    image = np.full((80, 90), 30, np.uint8)
    image[16:56, 16:64] = 200
    place = {"crs": "EPSG:32618", "transform": Affine(2, 0, 4e5, 0, -2, 5e6)}
    with rasterio.open("tile.tif", "w", "GTiff", 90, 80, 1, dtype="uint8", **place) as file:
        file.write(image, 1)
    return "tile.tif"


def test_the_plugin_is_declared() -> None:
    text = (Path(__file__).resolve().parents[1] / "pyproject.toml").read_text()
    project = tomllib.loads(text)["project"]
    assert project["entry-points"][PLUGINS] == {"uavseg": "uavseg.cli:main"}
    assert project["scripts"] == {"uavseg": "uavseg.__main__:run"}


def test_the_installed_plugin_is_this_group() -> None:
    installed = [point for point in entry_points(group=PLUGINS) if point.name == "uavseg"]
    if not installed:
        pytest.skip("the package is not installed, so it has no entry points")
    assert installed[0].value == "uavseg.cli:main"


def test_rio_lists_the_group_with_one_line(rio: click.Group) -> None:
    [line] = [line for line in run(rio, "--help").stdout.splitlines() if line.strip().startswith("uavseg")]
    assert line.split(maxsplit=1)[1] == "From a raster to regions to a mission."


def test_extract_runs_under_rio(rio: click.Group, raster: str) -> None:
    result = run(rio, "uavseg", "extract", raster, "--range", "0.55,1", "-o", "-", "-q")
    assert result.exit_code == 0, result.output
    [feature] = json.loads(result.stdout)["features"]
    assert feature["properties"]["pixels"] == 40 * 48


def test_rio_and_uavseg_give_the_same_output(rio: click.Group, raster: str) -> None:
    arguments = ["extract", raster, "--range", "0.55,1", "-o", "-"]
    assert run(rio, "uavseg", *arguments).stdout == CliRunner().invoke(main, arguments).stdout


def test_errors_are_reported_under_rio(rio: click.Group, raster: str) -> None:
    result = run(rio, "uavseg", "extract", raster, "--range", "1,0")
    assert result.exit_code == 1 and result.stderr.startswith("uavseg: error: expected an intensity range")
    assert run(rio, "uavseg", "extract", raster).exit_code == 2


@pytest.mark.parametrize("command", main.list_commands(click.Context(main)))
def test_every_command_is_available(rio: click.Group, command: str) -> None:
    result = run(rio, "uavseg", command, "--help")
    assert result.exit_code == 0 and f"uavseg {command} [OPTIONS]" in result.stdout


def test_global_options_of_rio_do_not_interfere(rio: click.Group, raster: str) -> None:
    result = run(rio, "-v", "uavseg", "divide", raster, "-o", "blocks.tif", "-q")
    assert result.exit_code == 0, result.output
    assert Path("blocks.tif").exists()


# Pipes, with the real programs


def program(name: str) -> str:
    """The path of a program, beside this Python or elsewhere."""
    found = shutil.which(name, path=str(Path(sys.executable).parent)) or shutil.which(name)
    if found is None:
        pytest.skip(f"{name} is not installed")
    return found


def piped(given: bytes, name: str, *words: str) -> bytes:
    """What a program writes that reads `given`."""
    own = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    return subprocess.run(
        [program(name), *words], input=given, stdout=subprocess.PIPE, check=True, env=own
    ).stdout


def streamed(raster: str, *words: str, start: tuple[str, ...] = (sys.executable, "-m", "uavseg")) -> bytes:
    """What `uavseg extract -o -` writes, as a program."""
    paths = [str(Path(__file__).resolve().parents[1]), os.environ.get("PYTHONPATH", "")]
    line = [*start, "extract", raster, "--range", "0.55,1", "-q", "-o", "-", *words]
    own = os.environ | {"PYTHONPATH": os.pathsep.join(paths)}
    return subprocess.run(line, stdout=subprocess.PIPE, check=True, env=own).stdout


BOUNDS = (400032, 4999888, 400128, 4999968)  # of the bright field, in metres
CODES = {"--geographic": 4326, "--projected": 32618}


@pytest.mark.parametrize("form", ["--collection", "--sequence", "--rs"])
@pytest.mark.parametrize("place", ["--geographic", "--projected"])
def test_streams_hold_the_same_features(raster: str, form: str, place: str) -> None:
    text = streamed(raster, form, place)
    if form == "--collection":
        whole = json.loads(text)
        assert ("crs" in whole) == (place == "--projected")
        [feature] = whole["features"]
    else:
        assert text.endswith(b"\n") and text.startswith(b"\x1e" if form == "--rs" else b"{")
        [feature] = [json.loads(line.removeprefix(b"\x1e")) for line in text.splitlines()]
    frame = geopandas.GeoDataFrame.from_features([feature], crs=CODES[place])
    assert frame.to_crs(32618).total_bounds == pytest.approx(BOUNDS, abs=0.02)


def test_the_plugin_as_a_program_writes_the_same_stream(raster: str) -> None:
    if not [point for point in entry_points(group=PLUGINS) if point.name == "uavseg"]:
        pytest.skip("the package is not installed, so rio does not know it")
    words = ("--projected", "--sequence")
    assert streamed(raster, *words, start=(program("rio"), "uavseg")) == streamed(raster, *words)


def test_rio_mask_reads_a_projected_stream(raster: str) -> None:
    piped(streamed(raster, "--projected"), "rio", "mask", raster, "masked.tif", "-j", "-")
    with rasterio.open(raster) as whole, rasterio.open("masked.tif") as masked:
        image, kept = whole.read(1), masked.read(1)
    assert np.array_equal(kept, np.where(image == 200, 200, 0)) and kept.any()


@pytest.mark.parametrize("words", [["--sequence"], ["--rs"], ["--sequence", "--projected"]])
def test_fio_collects_and_loads_a_stream(raster: str, words: list[str]) -> None:
    collected = piped(streamed(raster, *words), "fio", "collect")
    crs = "EPSG:32618" if "--projected" in words else "EPSG:4326"
    piped(collected, "fio", "load", "--driver", "GPKG", "--src-crs", crs, "--dst-crs", "EPSG:32618", "f.gpkg")
    frame = geopandas.read_file("f.gpkg")
    assert frame["pixels"].tolist() == [40 * 48]
    assert frame.total_bounds == pytest.approx(BOUNDS, abs=0.02)


@pytest.mark.parametrize("form", ["--collection", "--sequence", "--rs"])
@pytest.mark.parametrize("place", ["--geographic", "--projected"])
def test_ogr2ogr_reads_a_stream(raster: str, form: str, place: str) -> None:
    text = streamed(raster, form, place)
    named = form == "--collection" or place == "--geographic"
    words = [] if named else ["-a_srs", "EPSG:32618"]  # a sequence cannot name its CRS
    piped(text, "ogr2ogr", "-f", "GPKG", *words, "o.gpkg", "/vsistdin/")
    frame = geopandas.read_file("o.gpkg")
    assert frame.crs.to_epsg() == CODES[place] and frame["pixels"].tolist() == [40 * 48]
    assert frame.to_crs(32618).total_bounds == pytest.approx(BOUNDS, abs=0.02)


def test_a_projected_sequence_says_its_crs(rio: click.Group, raster: str) -> None:
    words = ["uavseg", "extract", raster, "--range", "0.55,1", "-o", "-", "--projected"]
    assert "these coordinates are in EPSG:32618" in run(rio, *words, "--sequence").stderr
    assert "warning" not in run(rio, *words).stderr


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (["-o", "x.geojson", "--projected"], "give them with -o -"),
        (["-o", "x.geojson", "--collection"], "give them with -o -"),
        (["--rs"], "give them with -o -"),
        (["-o", "-", "--rs", "--collection"], "give one of the two"),
    ],
)
def test_forms_of_streams_are_for_streams(raster: str, words: list[str], text: str) -> None:
    result = CliRunner().invoke(main, ["extract", raster, "--range", "0.55,1", *words])
    assert result.exit_code == 2 and text in result.stderr


def test_coordinates_of_another_world_need_to_be_projected(rio: click.Group, raster: str) -> None:
    moon = "+proj=longlat +R=1737400 +no_defs"
    with rasterio.open(raster) as file:
        image = file.read()
    place = {"crs": moon, "transform": Affine(0.001, 0, 10, 0, -0.001, 20)}
    with rasterio.open("moon.tif", "w", "GTiff", 90, 80, 1, dtype="uint8", **place) as file:
        file.write(image)
    words = ["uavseg", "extract", "moon.tif", "--range", "0.55,1", "-q", "-o", "-"]
    assert run(rio, *words).exit_code == 1
    result = run(rio, *words, "--projected")
    assert result.exit_code == 0 and "1737400" in json.loads(result.stdout)["crs"]["properties"]["name"]


# Names of rio's own options


def test_bands_are_chosen_as_in_rio(rio: click.Group, raster: str) -> None:
    line = ["uavseg", "extract", raster, "--range", "0.55,1", "-o", "-"]
    expected = run(rio, *line, "--band", "1").stdout
    assert expected and run(rio, *line, "--bidx", "1").stdout == expected == run(rio, *line, "-b", "1").stdout
    assert run(rio, *line, "--bidx", "2").exit_code == 1


def test_every_command_that_reads_rasters_has_the_names_of_rio() -> None:
    for name in main.list_commands(click.Context(main)):
        command = main.get_command(click.Context(main), name)
        assert command is not None
        options = {option for parameter in command.params for option in parameter.opts}
        if "--band" in options:
            assert options >= {"-b", "--bidx", "--nodata"}, name
        if "-q" in options and name != "warm-up":  # which decides nothing
            assert "-v" in options, name
        if options & {"-o", "--output"} and name != "suggest":
            assert "--overwrite" in options and "-q" in options, name
