"""Reproducibility: tiles, workers, order and storage do not change a byte of the output."""

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import chdir
from itertools import count, pairwise
from pathlib import Path
from typing import Any

import geopandas
import numpy as np
import pytest
import rasterio
from affine import Affine
from click.testing import CliRunner
from geopandas.testing import assert_geodataframe_equal
from hypothesis import given, settings, strategies as st
from numpy.typing import NDArray

import uavseg
from uavseg.cli import main

ROOT = Path(__file__).resolve().parents[1]
QUARRY = ROOT / "samples" / "quarry.tif"
FORMATS = ["geojson", "gpkg", "fgb", "parquet", "shp", "kml"]
TILES = [64, 128, 256, 4096]
RANGE = ["--range", "0.55,1"]
HOME = ["--altitude", "60", "--home", "auto"]


@pytest.fixture(scope="session")
def fresh(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """An iterator of new, empty folders."""
    base = tmp_path_factory.mktemp("bytes")

    def folder(number: int) -> Path:
        (base / str(number)).mkdir()
        return base / str(number)

    return map(folder, count())


def run(*arguments: object) -> None:
    result = CliRunner().invoke(main, [str(argument) for argument in arguments])
    assert result.exit_code == 0, result.output


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in sorted(folder.iterdir())}


def assert_same(one: dict[str, bytes], other: dict[str, bytes]) -> None:
    assert one.keys() == other.keys()
    assert [name for name in one if one[name] != other[name]] == []


def write(path: Path, image: NDArray[Any], row: int = 0, col: int = 0, **how: Any) -> Path:
    place = {"crs": "EPSG:32618", "transform": Affine(2, 0, 4e5 + 2 * col, 0, -2, 5e6 - 2 * row), "nodata": 0}
    rows, cols = image.shape
    with rasterio.open(path, "w", "GTiff", cols, rows, 1, dtype=image.dtype.name, **(place | how)) as file:
        file.write(image, 1)
    return path


def scene(seed: int, shape: tuple[int, int], kind: str) -> NDArray[Any]:
    """Patches with noise and nodata (0), of 8 or 16 bits or as floats."""
    rng = np.random.default_rng(seed)
    grain = int(rng.choice([4, 13, 40]))
    coarse = rng.integers(50, 240, (shape[0] // grain + 1, shape[1] // grain + 1))
    image = np.kron(coarse, np.ones((grain, grain)))[: shape[0], : shape[1]]
    image = np.clip(image + rng.normal(0, rng.choice([1, 20]), shape), 1, 255).astype(np.uint8)
    gone = np.kron(rng.random(coarse.shape) < 0.15, np.ones((grain, grain)))[: shape[0], : shape[1]]
    image = np.where(gone > 0, 0, image) * {"uint8": 1, "uint16": 99, "float32": 0.01}[kind]
    return image.astype(kind)


def outputs(raster: Path, folder: Path, *options: object) -> dict[str, bytes]:
    """All output files of a raster."""
    running = [
        value
        for k, word in enumerate(options)
        if word in ("--tile", "--threads")
        for value in options[k : k + 2]
    ]
    with chdir(raster.parent):  # regions and block maps hold the path of their raster
        for extension in FORMATS:
            labels = ["--labels", folder / "labels.tif"] if extension == "kml" else []
            target = folder / f"out.{extension}"
            run("extract", raster.name, *RANGE, "-o", target, "-q", *labels, *options)
        run("divide", raster.name, "-o", folder / "blocks.tif", "-q", *running)
    return contents(folder)


# Tiles and threads


@pytest.mark.slow
@settings(max_examples=4)
@given(
    seed=st.integers(0, 10**6),
    shape=st.tuples(st.integers(1, 300), st.integers(1, 300)),
    kind=st.sampled_from(["uint8", "uint16", "float32"]),
    refine=st.sampled_from(["none", "scan", "smooth", "tv", "pixels"]),
    method=st.sampled_from(["paper", "adaptive"]),
)
def test_tiles_and_threads_do_not_change_the_output(
    fresh: Iterator[Path], seed: int, shape: tuple[int, int], kind: str, refine: str, method: str
) -> None:
    raster = write(next(fresh) / "tile.tif", scene(seed, shape, kind))
    how = ("--refine", refine, "--method", method, "--fill-holes", "30px")
    wanted = outputs(raster, next(fresh), *how, "--tile", 64, "--threads", 1)
    for k, tile in enumerate(TILES):
        assert_same(wanted, outputs(raster, next(fresh), *how, "--tile", tile, "--threads", 1 + (k + 1) % 2))


@pytest.mark.slow
def test_the_output_of_a_sample_is_the_same_for_every_tile_size(fresh: Iterator[Path]) -> None:
    wanted = outputs(QUARRY, next(fresh))
    for k, tile in enumerate(TILES):
        assert_same(wanted, outputs(QUARRY, next(fresh), "--tile", tile, "--threads", 1 + k % 2))


@pytest.mark.slow
def test_the_output_does_not_depend_on_the_hash_seed(fresh: Iterator[Path]) -> None:
    found = []
    for seed in ("1", "2"):
        folder = next(fresh)
        options = ["-o", "a.gpkg", "--labels", "a.tif", "--mission", "a.plan", *HOME, "--spacing", "40"]
        command = [sys.executable, "-m", "uavseg", "extract", str(QUARRY), *RANGE, "-q", *options]
        how = os.environ | {"PYTHONPATH": str(ROOT), "PYTHONHASHSEED": seed}
        subprocess.run(command, check=True, cwd=folder, env=how, timeout=120)
        found.append(contents(folder))
    assert_same(*found)
    assert len(found[0]) == 3


@pytest.mark.slow
def test_missions_do_not_depend_on_the_tile_size(fresh: Iterator[Path]) -> None:
    found = []
    for tile in (64, 4096):
        with chdir(next(fresh)):
            for path in ("a.plan", "a.waypoints"):
                run("extract", QUARRY, *RANGE, "--mission", path, *HOME, "--tile", tile, "-q", "--overwrite")
            found.append(contents(Path()))
    assert_same(*found)


@pytest.mark.slow
def test_overwriting_gives_the_same_bytes(fresh: Iterator[Path]) -> None:
    with chdir(next(fresh)):
        for _ in range(2):
            run("extract", QUARRY, *RANGE, "-o", "a.gpkg", "--labels", "a.tif", "-q", "--overwrite")
            before = contents(Path())
        run("extract", QUARRY, *RANGE, "-o", "a.gpkg", "--labels", "a.tif", "-q", "--overwrite")
        assert_same(before, contents(Path()))


@pytest.mark.slow
def test_a_block_map_gives_the_same_bytes_as_its_raster(fresh: Iterator[Path]) -> None:
    with chdir(next(fresh)):
        run("divide", QUARRY, "-o", "blocks.tif", "-q", "--tile", 128)
        for source, name in ((QUARRY, "raster"), ("blocks.tif", "blocks")):
            outputs = ("-o", f"{name}.fgb", "--labels", f"{name}.labels.tif")
            run("extract", source, *RANGE, *outputs, "-q", "--allow-path", Path(QUARRY).parent)
        found = contents(Path())
    assert found["raster.fgb"] == found["blocks.fgb"]
    assert found["raster.labels.tif"] == found["blocks.labels.tif"]


# Storage and mosaics


@pytest.mark.slow
@settings(max_examples=8)
@given(seed=st.integers(0, 10**6), kind=st.sampled_from(["uint8", "uint16", "float32"]), data=st.data())
def test_a_mosaic_in_any_order_equals_the_whole_raster(
    fresh: Iterator[Path], seed: int, kind: str, data: st.DataObject
) -> None:
    rows, cols = data.draw(st.tuples(st.integers(2, 200), st.integers(2, 200)))
    image = scene(seed, (rows, cols), kind)
    folder = next(fresh)
    whole = write(folder / "whole.tif", image)
    across, down = (data.draw(st.lists(st.integers(1, n - 1), max_size=2, unique=True)) for n in (rows, cols))
    pieces = [
        write(folder / f"{top}-{left}.tif", image[top:bottom, left:right], top, left)
        for top, bottom in parts(across, rows)
        for left, right in parts(down, cols)
    ]
    ordered = data.draw(st.permutations(pieces))
    with chdir(folder):
        run("extract", whole, *RANGE, "-o", "one.fgb", "--labels", "one.tif", "-q")
        run("extract", *ordered, *RANGE, "-o", "many.fgb", "--labels", "many.tif", "-q", "--tile", 64)
        assert Path("one.tif").read_bytes() == Path("many.tif").read_bytes()
        one, many = (geopandas.read_file(name) for name in ("one.fgb", "many.fgb"))
    assert_geodataframe_equal(one.drop(columns="source"), many.drop(columns="source"))
    assert set(many["source"]) <= {ordered[0].name}


def parts(cuts: list[int], end: int) -> list[tuple[int, int]]:
    return list(pairwise([0, *sorted(cuts), end]))


@pytest.mark.slow
def test_consistent_overlaps_do_not_change_the_result(fresh: Iterator[Path]) -> None:
    folder, image = next(fresh), scene(3, (150, 160), "uint8")
    whole = write(folder / "whole.tif", image)
    pieces = [write(folder / "a.tif", image[:100]), write(folder / "b.tif", image[40:, 30:], 40, 30),
              write(folder / "c.tif", image[90:, :90], 90)]  # fmt: skip
    wanted = uavseg.extract(whole, (0.55, 1)).drop(columns="source")
    for order in ((0, 1, 2), (2, 1, 0), (1, 0, 2)):
        found = uavseg.extract([pieces[k] for k in order], (0.55, 1)).drop(columns="source")
        assert_geodataframe_equal(found, wanted)


@pytest.mark.slow
@pytest.mark.parametrize(
    "stored",
    [
        {"tiled": True, "blockxsize": 64, "blockysize": 16},
        *(
            pytest.param(stored, marks=pytest.mark.slow)
            for stored in [{"compress": "deflate", "predictor": 2}, {"interleave": "pixel", "BIGTIFF": "YES"}]
        ),
    ],
    ids=str,
)
def test_the_storage_of_a_file_does_not_change_the_output(
    fresh: Iterator[Path], stored: dict[str, Any]
) -> None:
    image = scene(8, (180, 210), "uint16")
    plain = outputs(write(next(fresh) / "tile.tif", image), next(fresh))
    other = outputs(write(next(fresh) / "tile.tif", image, **stored), next(fresh))
    for found in (plain, other):
        found.pop("blocks.tif")  # it holds the path of its raster
    assert_same(plain, other)
