"""`--co NAME=VALUE` of every command that writes a GeoTIFF: the same pixels, stored as asked for."""

from pathlib import Path

import click
import numpy as np
import pytest
import rasterio
from click.testing import CliRunner, Result
from rasterio.rio.options import creation_options as of_rio

import uavseg
from tests.occupancy.bags.write_bags import Drive, write_ros1
from uavseg.cli import main
from uavseg.errors import ParameterError
from uavseg.segmentation.blocks.block_file import read_block_map

ZSTD = ("--co", "COMPRESS=ZSTD", "--co", "ZSTD_LEVEL=3", "--co", "PREDICTOR=2", "--co", "BIGTIFF=YES")
DISC = "400050,4999950,20"
LINES = {  # each with the rasters that it writes
    "extract tile.tif --range 0.5,1 -o r.fgb --labels out.tif": ["out.tif"],
    "extract tile.tif --range 0.5,1 -o r.fgb --labels out.vrt": ["out.vrt"],
    "extract tile.tif --each --range 0.5,1 -o r.{stem}.fgb --labels out.{stem}.tif": ["out.tile.tif"],
    "levels tile.tif --width 0.25 -o r.fgb --labels out.tif": ["out.tif"],
    f"match tile.tif --like {DISC} --by color -o r.fgb --labels out.tif": ["out.tif"],
    "classify map.tif -o states.tif --labels out.tif": ["states.tif", "out.tif"],
    "classify map.tif -o states.yaml --labels out.tif": ["out.tif"],
    "divide tile.tif -o out.tif": ["out.tif"],
    "original tile.tif --sweeps 1 -o out.tif": ["out.tif"],
    "simulate lens --poses 1 -o out.tif --truth truth.tif": ["out.tif", "truth.tif"],
    "build-map run.bag -o out.tif": ["out.tif"],
    "merge-maps map.tif -o out.tif": ["out.tif"],
}


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An empty folder with sources."""
    monkeypatch.chdir(tmp_path)
    rng = np.random.default_rng(3)
    row, col = np.indices((130, 150))
    image = np.clip(np.where((row // 50 + col // 50) % 2, 190, 50) + rng.normal(0, 9, row.shape), 1, 255)
    place = {"crs": "EPSG:32618", "transform": rasterio.transform.from_origin(4e5, 5e6, 1, 1)}
    size = {"driver": "GTiff", "height": 130, "width": 150, "count": 1}
    with rasterio.open("tile.tif", "w", **size, **place, dtype="uint8", nodata=0) as file:
        file.write(image.astype(np.uint8), 1)
    with rasterio.open("map.tif", "w", **size, **place, dtype="float32") as file:
        file.write(np.where(row < 70, 0.1, 0.9).astype(np.float32), 1)


def run(line: str, *more: str) -> Result:
    return CliRunner().invoke(main, [*line.split(), *more])


def pixels(names: list[str]) -> list[np.ndarray]:
    found = []
    for name in names:
        with rasterio.open(name) as file:
            found.append(file.read())
    return found


@pytest.mark.slow
@pytest.mark.parametrize("line", LINES)
def test_rasters_hold_the_same_pixels_stored_as_asked_for(line: str) -> None:
    if "run.bag" in line:
        write_ros1(Path("run.bag"), Drive(1, 3).everything())
    names = LINES[line]
    assert run(line, "-q").exit_code == 0
    expected = pixels(names)
    result = run(line, "-q", "--overwrite", *ZSTD)
    assert result.exit_code == 0, result.output
    for one, other in zip(expected, pixels(names), strict=True):
        assert one.dtype == other.dtype and np.array_equal(one, other, equal_nan=one.dtype.kind == "f")
    tiles = [*Path().glob("out.tiles/*.tif")] if names == ["out.vrt"] else [Path(name) for name in names]
    assert tiles
    for tile in tiles:
        with rasterio.open(tile) as file:
            assert file.tags(ns="IMAGE_STRUCTURE")["COMPRESSION"] == "ZSTD"
        assert tile.read_bytes()[2] == 43, "a BigTIFF"


@pytest.mark.slow
def test_a_block_map_holds_the_same_whatever_it_is_stored_as() -> None:
    for name, how in (("a.tif", ()), ("b.tif", ZSTD)):
        assert run(f"divide tile.tif -o {name} -q", *how).exit_code == 0
    one, other = read_block_map("a.tif"), read_block_map("b.tif")
    for name in ("sums", "counts", "ratios"):
        assert np.array_equal(getattr(one.blocks, name), getattr(other.blocks, name))


def test_labels_of_each_are_those_of_python() -> None:
    line = "extract tile.tif --each --range 0.5,1 -o r.{stem}.fgb --labels out.{stem}.tif -q"
    assert run(line, *ZSTD).exit_code == 0
    content = Path("out.tile.tif").read_bytes()
    words = {"COMPRESS": "ZSTD", "ZSTD_LEVEL": 3, "PREDICTOR": 2, "BIGTIFF": "YES"}
    uavseg.each(
        uavseg.extract,
        "tile.tif",
        "r.{stem}.fgb",
        labels="out.{stem}.tif",
        creation_options=words,
        overwrite=True,
        range=(0.5, 1),
    )
    assert Path("out.tile.tif").read_bytes() == content


def test_a_map_of_a_bag_is_that_of_python() -> None:
    write_ros1(Path("run.bag"), Drive(1, 3).everything())
    words = ["COMPRESS=LZW", "PREDICTOR=3"]
    line = "build-map run.bag -o out.tif -q --co COMPRESS=LZW --co PREDICTOR=3"
    assert run(line).exit_code == 0
    content = Path("out.tif").read_bytes()
    uavseg.build_map("run.bag").write("out.tif", True, dict(word.split("=") for word in words))
    assert Path("out.tif").read_bytes() == content
    with pytest.raises(ParameterError, match=r"no output is one"):
        uavseg.build_map("run.bag").write("out.yaml", creation_options={"COMPRESS": "LZW"})
    assert not Path("out.yaml").exists()


@pytest.mark.parametrize("line", LINES)
def test_another_option_is_refused_before_the_work(line: str) -> None:
    if "run.bag" in line:
        write_ros1(Path("run.bag"), Drive(1, 3).everything())
    before = sorted(Path().iterdir())
    result = run(line, "--co", "COMPRESS=JPEG")
    assert result.exit_code == 1 and result.stderr.count("\n") == 1, result.output
    assert "COMPRESS=JPEG is not one of the lossless compressions NONE, DEFLATE, LZW" in result.stderr
    assert sorted(Path().iterdir()) == before


@pytest.mark.parametrize(
    "line",
    [
        "extract tile.tif --range 0.5,1 -o r.fgb",
        "extract tile.tif --each --range 0.5,1 -o r.{stem}.fgb",
        "levels tile.tif --width 0.25 -o r.fgb",
        f"match tile.tif --like {DISC} --by color -o r.fgb",
        "classify map.tif -o states.yaml",
        "simulate lens --poses 1 -o out.yaml",
        "build-map run.bag -o out.yaml",
        "merge-maps map.tif -o out.yaml",
    ],
)
def test_the_option_is_refused_where_no_geotiff_is_written(line: str) -> None:
    if "run.bag" in line:
        write_ros1(Path("run.bag"), Drive(1, 3).everything())
    before = sorted(Path().iterdir())
    result = run(line, "--co", "COMPRESS=LZW")
    assert result.exit_code == 1 and "no output is one; name a .tif" in result.stderr
    assert sorted(Path().iterdir()) == before


def test_the_predictor_of_floats_is_refused_for_labels() -> None:
    result = run("divide tile.tif -o out.tif --co PREDICTOR=3")
    assert result.exit_code == 1 and "uint32 is stored" in result.stderr and not Path("out.tif").exists()


def test_every_command_that_writes_a_geotiff_has_the_option_of_rio() -> None:
    @of_rio
    def plain() -> None: ...

    [name] = [option for option in plain.__click_params__[0].opts if option == "--co"]  # type: ignore[attr-defined]
    having = set()
    for command in main.list_commands(click.Context(main)):
        found = main.get_command(click.Context(main), command)
        assert found is not None
        if any(name in parameter.opts for parameter in found.params):
            having.add(command)
    assert having == {line.split()[0] for line in LINES}
