"""`uavseg divide`, and `uavseg extract` from what it wrote."""

from pathlib import Path
from typing import Any

import geopandas
import numpy as np
import pytest
import rasterio
from affine import Affine
from click.testing import CliRunner, Result
from pandas.testing import assert_frame_equal

import uavseg
from uavseg.cli import main
from uavseg.occupancy.ros.ros_map import write_ros_map
from uavseg.raster.grid.geobox import local_geobox
from uavseg.segmentation.blocks.block_file import read_block_map

RANGE = ("--range", "0.55,1")


def write(path: Path, image: np.ndarray, col: int = 0, **how: Any) -> Path:
    planes = image[None] if image.ndim == 2 else image
    size = {"count": len(planes), "height": planes.shape[1], "width": planes.shape[2]}
    place = {"crs": "EPSG:32618", "transform": Affine(2, 0, 4e5 + 2 * col, 0, -2, 5e6)}
    with rasterio.open(path, "w", "GTiff", dtype=planes.dtype.name, **size, **(place | how)) as file:
        file.write(planes)
    return path


def scene(rows: int = 150, cols: int = 170) -> np.ndarray:
    """Bright discs in a dark field with noise, and a corner of nodata (0)."""
    rng = np.random.default_rng(3)
    row, col = np.indices((rows, cols))
    bright = ((row % 70 - 30) ** 2 + (col % 80 - 40) ** 2) < 25**2
    image = np.clip(np.where(bright, 190, 50) + rng.normal(0, 12, (rows, cols)), 1, 255)
    image[:20, :30] = 0
    return image.astype(np.uint8)


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty folder to work in, with one raster."""
    monkeypatch.chdir(tmp_path)
    write(tmp_path / "tile.tif", scene(), nodata=0)
    return tmp_path


def run(*arguments: object) -> Result:
    return CliRunner().invoke(main, [str(argument) for argument in arguments])


def done(*arguments: object) -> Result:
    result = run(*arguments)
    assert result.exit_code == 0, result.output
    return result


def regions(*arguments: object) -> geopandas.GeoDataFrame:
    done("extract", *arguments, *RANGE, "-o", "out.fgb", "--overwrite", "-q")
    frame = geopandas.read_file("out.fgb")
    Path("out.fgb").unlink()
    return frame


def same(one: geopandas.GeoDataFrame, other: geopandas.GeoDataFrame) -> None:
    assert_frame_equal(one.drop(columns=["geometry", "source"]), other.drop(columns=["geometry", "source"]))
    assert one.geometry.to_wkb().tolist() == other.geometry.to_wkb().tolist()


# The file


def test_a_block_map_is_a_raster_of_cells_that_shows_means_and_leaves() -> None:
    result = done("divide", "tile.tif", "-o", "blocks.tif")
    assert result.stdout == "" and {p.name for p in Path().iterdir()} == {"tile.tif", "blocks.tif"}
    with rasterio.open("blocks.tif") as file:
        assert file.shape == (19, 22) and file.crs.to_epsg() == 32618
        assert file.transform == Affine(16, 0, 4e5, 0, -16, 5e6)
        mean, side = file.read(1), file.read(2)
        assert file.descriptions[:2] == ("mean v", "side of the leaf in pixels")
        assert np.isnan(file.nodata)
    assert set(np.unique(side)) <= {8, 16, 32, 64}
    assert 0.6 < mean[30 // 8, 40 // 8] < 0.8 and np.nanmin(mean) < 0.3


def test_what_is_reported_at_the_end() -> None:
    rows = dict(
        line.split(maxsplit=1) for line in done("divide", "tile.tif", "-o", "b.tif").stderr.splitlines()
    )
    assert rows["blocks"] == "9 of 64 x 64 -> b.tif"
    assert rows["stretch"] == "dtype -> 0..255" and rows["band"] == "band 1" and float(rows["seconds"]) >= 0


def test_quiet_says_nothing_and_plain_progress_rises_to_100() -> None:
    assert done("divide", "tile.tif", "-o", "b.tif", "-q").output == ""
    lines = done(
        "divide", "tile.tif", "-o", "c.tif", "-q", "--progress", "plain", "--tile", 64
    ).stderr.splitlines()
    percents = [int(line.removeprefix("progress ")) for line in lines]
    assert percents == sorted(set(percents)) and percents[-1] == 100


def test_it_loads_back_with_its_origin(folder: Path) -> None:
    done("divide", "tile.tif", "-o", "blocks.tif", "--band", 1, "--nodata", "nan", "--stretch", "10,200")
    saved = read_block_map("blocks.tif")
    assert saved.geobox.shape == (150, 170) and (saved.stretch.low, saved.stretch.high) == (10, 200)
    assert saved.origin.rasters == ("tile.tif",) and saved.origin.folder == str(folder)
    assert saved.origin.band == 1 and saved.origin.nodata is not None and np.isnan(saved.origin.nodata)


# From it


@pytest.mark.slow
@pytest.mark.parametrize(
    "options",
    [
        (),
        *(
            pytest.param(options, marks=pytest.mark.slow)
            for options in [
                ("--refine", "smooth"),
                ("--method", "paper"),
                ("--threshold", 1.6, "--intensity-step", 0.1),
            ]
        ),
    ],
    ids=str,
)
def test_a_block_map_answers_as_its_raster_does(options: tuple[object, ...]) -> None:
    done("divide", "tile.tif", "-o", "blocks.tif", "-q")
    same(regions("blocks.tif", *options), regions("tile.tif", *options))


@pytest.mark.slow
def test_a_block_map_of_a_mosaic_with_chosen_bands(folder: Path) -> None:
    image = np.stack([scene() // 2, scene()])
    write(folder / "west.tif", image[:, :, :100], nodata=0)
    write(folder / "east.tif", image[:, :, 100:], 100, nodata=0)
    done("divide", "west.tif", "east.tif", "--band", 2, "-o", "blocks.tif", "-q")
    found = regions("blocks.tif")
    same(found, regions("west.tif", "east.tif", "--band", 2))
    same(found, regions("tile.tif"))


def test_without_the_raster_regions_end_at_cells(folder: Path) -> None:
    done("divide", "tile.tif", "-o", "blocks.tif", "-q")
    Path("tile.tif").unlink()
    result = done("extract", "blocks.tif", *RANGE, "-o", "out.gpkg", "--labels", "labels.tif")
    [warning] = [line for line in result.stderr.splitlines() if "warning" in line]
    assert "tile.tif is not where it was, so regions end at block edges" in warning
    frame = geopandas.read_file("out.gpkg")
    assert len(frame) and frame.is_valid.all() and frame["std"].isna().all()
    assert ((frame["mean"] >= 0.55) & (frame["mean"] <= 1)).all()
    with rasterio.open("labels.tif") as file:
        assert file.shape == (150, 170)
        labels = file.read(1)
    assert list(frame["pixels"]) == np.bincount(labels.reshape(-1))[1:].tolist()
    assert np.array_equal(labels, labels[::8, ::8].repeat(8, 0).repeat(8, 1)[:150, :170])
    quiet = done("extract", "blocks.tif", *RANGE, "-o", "two.gpkg", "--refine", "none")
    assert "warning" not in quiet.stderr


@pytest.mark.parametrize("extension", ["geojson", "gpkg", "fgb", "parquet", "shp", "kml"])
def test_a_deviation_that_is_not_known_is_null_in_every_format(extension: str) -> None:
    done("divide", "tile.tif", "-o", "blocks.tif", "-q")
    done("extract", "blocks.tif", *RANGE, "-o", f"out.{extension}", "--refine", "none")
    read = geopandas.read_parquet if extension == "parquet" else geopandas.read_file
    frame = read(f"out.{extension}")
    assert len(frame) and frame["std"].isna().all()
    assert b"NaN" not in Path(f"out.{extension}").read_bytes() or extension not in ("geojson", "kml")


@pytest.mark.slow
def test_a_raster_is_found_beside_its_block_map_when_both_have_moved(folder: Path) -> None:
    done("divide", "tile.tif", "-o", "blocks.tif", "-q")
    wanted = regions("tile.tif")
    (folder / "moved").mkdir()
    for name in ("tile.tif", "blocks.tif"):
        Path(name).rename(folder / "moved" / name)
    same(regions("moved/blocks.tif"), wanted)


def test_a_block_map_of_another_folder_finds_its_raster(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    done("divide", "tile.tif", "-o", "blocks.tif", "-q")
    wanted = regions("tile.tif")
    (folder / "elsewhere").mkdir()
    monkeypatch.chdir(folder / "elsewhere")
    same(regions("../blocks.tif"), wanted)


def refused(*arguments: object) -> str:
    before = {path.name for path in Path().iterdir()}
    result = run(*arguments)
    assert result.exit_code == 1 and result.stdout == "", result.output
    assert len(result.stderr.splitlines()) == 1 and result.stderr.startswith("uavseg: error: ")
    assert {path.name for path in Path().iterdir()} == before
    return result.stderr


def test_a_raster_that_changed_is_refused() -> None:
    done("divide", "tile.tif", "-o", "blocks.tif", "-q")
    image = scene()
    image[40, 40] += 30
    write(Path("tile.tif"), image, nodata=0)
    assert "make the block map again" in refused("extract", "blocks.tif", *RANGE)
    done("extract", "blocks.tif", *RANGE, "--refine", "none", "-q")


def test_a_block_map_and_a_raster_are_no_mosaic() -> None:
    done("divide", "tile.tif", "-o", "blocks.tif", "-q")
    refused("extract", "blocks.tif", "tile.tif", *RANGE)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ("missing.tif -o b.tif", "missing.tif"),
        ("tile.tif -o tile.tif", "exists; give --overwrite"),
        ("tile.tif -o b.yaml", "b.yaml: a block map is written as GeoTIFF; name a .tif"),
        ("tile.tif -o none/b.tif", "the folder none does not exist"),
        ("tile.tif -o b.tif --band 3", "band 3"),
        ("tile.tif -o b.tif --tile 70", "multiple of 64"),
        ("tile.tif -o b.tif --stretch x", "a stretch is one of"),
        ("tile.tif -o b.tif --threads -1", "threads"),
        ("tile.tif -o b.tif --threshold -1", "at least 0"),
    ],
)
def test_what_cannot_be_is_refused_in_one_sentence(arguments: str, message: str) -> None:
    assert message in refused("divide", *arguments.split())


def test_the_output_must_be_named() -> None:
    result = run("divide", "tile.tif")
    assert result.exit_code == 2 and "--output" in result.stderr


# Robots' maps


def write_map(path: str) -> None:
    states = np.full((130, 150), 2, np.uint8)
    states[20:90, 30:120] = 1
    states[40:60, 70:75] = 3
    write_ros_map(path, states, local_geobox(states.shape, 0.1, (3, 4)))


@pytest.mark.slow
def test_a_ros_map_is_divided_and_its_block_map_answers_as_the_map_does() -> None:
    Path("maps").mkdir()
    write_map("maps/hall.yaml")
    done("divide", "maps/hall.yaml", "-o", "blocks.tif")
    requested = ("--range", "0,0.45", "--overwrite", "-q", "-o")
    for name, source in (("own.geojson", "maps/hall.yaml"), ("saved.geojson", "blocks.tif")):
        done("extract", source, *requested, name)
    own, saved = geopandas.read_file("own.geojson"), geopandas.read_file("saved.geojson")
    assert len(own) == 1 and own.pixels[0] == 70 * 90 - 100
    same(own, saved)
    for name, source in (("own.fgb", "maps/hall.yaml"), ("saved.fgb", "blocks.tif")):
        done("levels", source, "--width", "0.4", "-q", "-o", name)
    same(geopandas.read_file("own.fgb"), geopandas.read_file("saved.fgb"))
    done("preview", "maps/hall.yaml", "--leaves", "blocks.tif", "-o", "leaves.png", "--width", "300")
    blocks = uavseg.divide("maps/hall.yaml")
    assert np.array_equal(blocks.sums, read_block_map("blocks.tif").blocks.sums)
    shifted = Path("maps/hall.yaml").read_text().replace("origin: [3", "origin: [9")
    Path("maps/hall.yaml").write_text(shifted)
    assert "does not lie where it lay" in run("extract", "blocks.tif", *requested, "no.geojson").stderr
    Path("maps/hall.yaml").unlink()
    gone = done("extract", "blocks.tif", "--range", "0,0.45", "-o", "gone.geojson")
    assert "maps/hall.yaml is not where it was" in gone.stderr


def test_what_is_read_whole_is_not_resumed() -> None:
    write_map("hall.yaml")
    refused = run("divide", "hall.yaml", "-o", "b.tif", "--resume", "kept")
    assert refused.exit_code == 1 and "nothing to resume" in refused.stderr
    done("divide", "hall.yaml", "-o", "b.tif")
    refused = run("extract", "b.tif", "--range", "0,0.45", "-o", "r.geojson", "--resume", "kept")
    assert refused.exit_code == 1 and "nothing to resume" in refused.stderr
