"""The commands and the example of the README run."""

import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import click
import numpy as np
import pytest
import rasterio
from affine import Affine
from rasterio.windows import Window

from tests.occupancy.bags.write_bags import Drive, write_ros1
from uavseg.cli import main
from uavseg.occupancy.ros.ros_map import write_ros_map
from uavseg.raster.geobox import GeoBox

ROOT = Path(__file__).resolve().parents[1]
README = (ROOT / "README.md").read_text()


def blocks(language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", README, re.DOTALL)


COMMANDS = [
    line for block in blocks("sh") for line in block.splitlines() if re.match(r"(rio )?uavseg ", line)
]


def test_the_readme_shows_every_command() -> None:
    shown = {shlex.split(line, comments=True)[1] for line in COMMANDS if line.startswith("uavseg")}
    assert shown == set(main.list_commands(click.Context(main)))


def test_the_example_of_a_live_map_runs() -> None:
    [example] = [block for block in blocks("python") if "OccupancyGrid" in block]
    seen: dict[str, object] = {}
    exec(compile(example, "README.md", "exec"), seen)
    assert seen["update"].blocks.any() and seen["free"].agreeing(2).any()  # type: ignore[attr-defined]


@pytest.mark.slow
def test_the_commands_of_the_readme_run(tmp_path: Path) -> None:
    write_inputs(tmp_path)
    # rio finds installed plugins only: see test_rio.py
    alone = [line for line in COMMANDS if "--connect" not in line]  # with a vehicle: see cli/test_upload.py
    script = ["set -eu", 'uavseg() { "$PYTHON" -m uavseg "$@"; }', "rio() { :; }", *alone]
    how = os.environ | {"PYTHON": sys.executable, "PYTHONPATH": str(ROOT)}
    ran = subprocess.run(
        ["bash", "-c", "\n".join(script)], cwd=tmp_path, env=how, capture_output=True, text=True
    )
    assert ran.returncode == 0, ran.stderr
    for written in (
        "tile.regions.geojson",
        "dark.tif",
        "survey.plan",
        "levels.gpkg",
        "classes.gpkg",
        "p.gpkg",
        "q.gpkg",
        "report.csv",
        "all.gpkg",
        "ploughed.gpkg",
        "states.yaml",
    ):
        assert (tmp_path / written).stat().st_size > 0


def write_inputs(folder: Path) -> None:
    """Write the input files of the commands: parts of the quarry, a field with crop rows, an empty room."""
    shutil.copy(ROOT / "samples" / "quarry.tif", folder / "tile.tif")
    for name in ("mosaic", "tiles"):
        (folder / name).mkdir()
    with rasterio.open(folder / "tile.tif") as quarry:
        mosaic, tiles = {"mosaic/x": 320, "mosaic/y": 448}, {"tiles/p": 0, "tiles/q": 192}
        for name, col in ({"a": 0, "b": 128, "c": 256} | mosaic | tiles).items():
            window = Window(col, 0, 128, 256)
            place = {"crs": quarry.crs, "transform": quarry.window_transform(window)}
            write(folder / f"{name}.tif", quarry.read(1, window=window), **place)
    rows = np.tile(np.arange(512, dtype=np.uint8) // 3 % 2 * 90 + 80, (512, 1))
    rows[:, 256:] = np.random.default_rng(1).integers(80, 171, (512, 256), np.uint8)
    write(folder / "field.tif", rows, crs="EPSG:32633", transform=Affine(1, 0, 500_000, 0, -1, 5_000_100))
    write_ros1(folder / "drive.bag", Drive(1, 4).everything())
    room = GeoBox((100, 100), Affine(0.05, 0, 0, 0, -0.05, 5), None)
    write_ros_map(folder / "map.yaml", np.ones(room.shape, np.uint8), room)


def write(path: Path, image: np.ndarray, **place: Any) -> None:
    with rasterio.open(path, "w", "GTiff", *image.shape[::-1], 1, dtype=image.dtype, **place) as file:
        file.write(image, 1)
