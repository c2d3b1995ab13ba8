"""`--connectivity 8` on the command line: every format, what is recorded, what is flown, what is refused."""

import json
from pathlib import Path
from typing import Any

import geopandas
import numpy as np
import pyarrow.parquet
import pytest
import shapely
from click.testing import CliRunner
from skimage.measure import label

from tests.cli.test_extract import RANGE, extracted, folder, picture, run, write  # noqa: F401 (a fixture)
from tests.jobs.test_pixels import speckled
from uavseg.cli import main
from uavseg.flight.formats.files import read_mission

FORMATS = ("geojson", "gpkg", "fgb", "parquet", "shp", "kml")
STEPS = "##...... .#...... ..##.... ..##..#. ......#. .###...# .#.#.... ....##.."
APART = "........ .###.##. .#.#.##. .###.... ........ .####... ........"
PIXELS = (*RANGE, "--refine", "pixels")


def frame(path: str) -> Any:
    return geopandas.read_parquet(path) if path.endswith("parquet") else geopandas.read_file(path)


@pytest.mark.parametrize("extension", FORMATS)
@pytest.mark.parametrize("more", [(), ("--smooth-outline", 1), ("--simplify", 3)], ids=str)
def test_files_hold_valid_regions_of_several_polygons(extension: str, more: tuple[Any, ...]) -> None:
    write(Path("noise.tif"), speckled(3, (90, 110)).clip(1))
    found = {}
    for connectivity in (4, 8):
        name = f"{connectivity}.{extension}"
        extracted("noise.tif", *PIXELS, "--connectivity", connectivity, "-o", name, "-q", *more)
        found[connectivity] = frame(name)
    four, eight = found[4].geometry.to_numpy(), found[8].geometry.to_numpy()
    assert len(eight) < len(four) and shapely.get_num_geometries(eight).sum() == len(four)
    assert shapely.is_valid(eight).all() and np.isclose(shapely.area(eight).sum(), shapely.area(four).sum())


@pytest.mark.slow
def test_tiles_and_threads_change_no_byte() -> None:
    write(Path("noise.tif"), speckled(5, (200, 210)).clip(1))
    words = (*PIXELS, "--connectivity", 8, "-q", "--overwrite")
    contents = set()
    for more in ((), ("--tile", 64, "--threads", 1), ("--tile", 128, "--threads", 3)):
        extracted("noise.tif", *words, "-o", "a.gpkg", "--labels", "a.tif", *more)
        contents.add((Path("a.gpkg").read_bytes(), Path("a.tif").read_bytes()))
    assert len(contents) == 1


@pytest.mark.slow
def test_another_connectivity_goes_on_from_the_same_tiles() -> None:
    write(Path("noise.tif"), speckled(5, (200, 210)).clip(1))
    for connectivity, more in ((4, ("--resume", "done")), (8, ("--resume", "done")), (8, ())):
        name = f"{connectivity}{len(more)}.fgb"
        extracted("noise.tif", *PIXELS, "--connectivity", connectivity, "-q", "-o", name, *more)
    assert Path("82.fgb").read_bytes() == Path("80.fgb").read_bytes() != Path("42.fgb").read_bytes()


def test_without_a_contact_only_the_record_differs() -> None:
    """By default the connectivity is 4, which is not recorded."""
    write(Path("apart.tif"), picture(APART))
    for name, more in (("none", ()), ("4", ("--connectivity", 4)), ("8", ("--connectivity", 8))):
        extracted("apart.tif", *PIXELS, "-q", "-o", f"{name}.geojson", *more)
    default, four, eight = (Path(f"{name}.geojson").read_text() for name in ("none", "4", "8"))
    assert default == four and '"connectivity"' not in four
    assert eight.replace(', "connectivity": 8', "").replace(',"connectivity":8', "") == four != eight


def test_levels_have_it_too() -> None:
    write(Path("steps.tif"), picture(STEPS))
    words = ["levels", "steps.tif", "--width", "0.5", "--refine", "pixels", "-q", "-o"]
    for connectivity in "48":
        line = [*words, f"{connectivity}.fgb", "--connectivity", connectivity]
        assert CliRunner().invoke(main, line).exit_code == 0
    four, eight = (frame(f"{name}.fgb") for name in "48")
    assert [len(four), len(eight)] == [
        label(picture(STEPS), background=0, connectivity=n).max() for n in (1, 2)
    ]
    assert four["pixels"].sum() == eight["pixels"].sum()


@pytest.mark.slow
@pytest.mark.parametrize("pattern", [(), ("--spacing", 20), ("--pattern", "perimeter")], ids=str)
def test_a_mission_flies_each_polygon_of_a_region(pattern: tuple[Any, ...]) -> None:
    """As of any MultiPolygon: the same places as over the regions of connectivity 4."""
    write(Path("steps.tif"), picture(STEPS))
    flight = ("--mission", "m.plan", "--altitude", 50, "--home", "45.1457,-76.2711", "--allow-edge", *pattern)
    flown = []
    for connectivity in (4, 8):
        extracted("steps.tif", *PIXELS, "--connectivity", connectivity, "-q", "--overwrite", *flight)
        items = [item for item in read_mission(Path("m.plan")).items if item.lat]
        flown.append(sorted((item.command, round(item.lat, 6), round(item.lon, 6)) for item in items))
    assert len(flown[0]) > 5 and np.allclose(*flown, rtol=0, atol=2e-6)  # parts are flown on a grid of 1 mm


def test_it_is_refused_in_one_sentence() -> None:
    for words, code, message in (
        (("--connectivity", 6), 2, "'6' is not one of '4', '8'"),
        (
            ("--connectivity", 8, "-o", "a.parquet/"),
            1,
            "a folder of regions is written without connectivity 8",
        ),
    ):
        result = run("tile.tif", *RANGE, *words)
        assert result.exit_code == code and message in result.stderr and "Traceback" not in result.output
    assert [path.name for path in Path().iterdir()] == ["tile.tif"]


def test_what_was_done_is_recorded() -> None:
    write(Path("steps.tif"), picture(STEPS))
    extracted("steps.tif", *PIXELS, "--connectivity", 8, "-q", "-o", "a.parquet")
    assert json.loads(pyarrow.parquet.read_schema("a.parquet").metadata[b"uavseg"])["connectivity"] == 8
