"""The command group as a plugin of rio."""

import json
import tomllib
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any

import click
import numpy as np
import pytest
import rasterio
from affine import Affine
from click.testing import CliRunner, Result
from rasterio.rio.main import main_group

from uavseg.cli import main

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


@pytest.mark.parametrize("command", ["extract", "divide", "plan", "info", "preview"])
def test_every_command_is_available(rio: click.Group, command: str) -> None:
    result = run(rio, "uavseg", command, "--help")
    assert result.exit_code == 0 and f"uavseg {command} [OPTIONS]" in result.stdout


def test_global_options_of_rio_do_not_interfere(rio: click.Group, raster: str) -> None:
    result = run(rio, "-v", "uavseg", "divide", raster, "-o", "blocks.tif", "-q")
    assert result.exit_code == 0, result.output
    assert Path("blocks.tif").exists()
