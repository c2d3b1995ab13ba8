"""A raster that changed after its block map was made is refused, wherever it changed; a copy is not."""

import shutil
import warnings
from pathlib import Path

import numpy as np
import pytest
import rasterio
from affine import Affine
from click.testing import CliRunner
from hypothesis import given, strategies as st

import uavseg
from uavseg.cli import main
from uavseg.errors import ParameterError, RasterError
from uavseg.jobs.source.source import SAMPLED, sampled_blocks
from uavseg.units import BLOCK

SHAPE = (448, 500)  # 56 blocks: each of them is looked at
PLACE = Affine(0.5, 0, 500_000, 0, -0.5, 5_000_000)
AGAIN = "make the block map again with uavseg divide, or give --refine none"


def scene(shape: tuple[int, int] = SHAPE) -> np.ndarray:
    """A bright field in one corner; the rest is dark, so that its tiles are not refined."""
    image = np.random.default_rng(1).integers(20, 40, shape).astype(np.uint8)
    image[10:60, 10:60] = 200
    return image


def write(
    path: Path, image: np.ndarray, transform: Affine | None = PLACE, crs: str | None = "EPSG:32633"
) -> Path:
    how = {"driver": "GTiff", "height": image.shape[0], "width": image.shape[1], "count": 1, "dtype": "uint8"}
    with rasterio.open(path, "w", **how, crs=crs, transform=transform) as file:
        file.write(image, 1)
    return path


def divide(raster: Path, blocks: Path) -> None:
    words = ["divide", str(raster), "-o", str(blocks), "-q", "--threads", "1"]
    result = CliRunner().invoke(main, words, catch_exceptions=False)
    assert result.exit_code == 0, result.output


@pytest.fixture
def blocks(tmp_path: Path) -> Path:
    """A block map beside its raster."""
    raster = write(tmp_path / "tile.tif", scene())
    divide(raster, tmp_path / "blocks.tif")
    return tmp_path / "blocks.tif"


def extracted(blocks: Path, **words: object) -> int:
    return len(uavseg.extract(blocks, (0.5, 1), tile=64, threads=1, **words))


@pytest.mark.slow
@pytest.mark.parametrize(
    "place",
    [
        (300, 300),
        *(pytest.param(place, marks=pytest.mark.slow) for place in [(447, 499), (100, 20), (0, 499)]),
    ],
)
def test_a_pixel_changed_where_nothing_is_in_range_is_found(place: tuple[int, int], blocks: Path) -> None:
    assert extracted(blocks) == 1
    image = scene()
    image[place] += 1
    write(blocks.with_name("tile.tif"), image)
    with pytest.raises(RasterError, match=f"tile.tif is not as it was when its block map was made; {AGAIN}"):
        extracted(blocks)
    with pytest.raises(RasterError, match="is not as it was"):
        uavseg.levels(blocks, breaks=[0.5], tile=64, threads=1)
    with pytest.raises(RasterError, match="is not as it was"):
        uavseg.suggest(blocks, tile=64, threads=1)
    assert extracted(blocks, refine="none") == 1


@pytest.mark.slow
def test_another_raster_of_the_same_size_is_found_however_large_it_is(tmp_path: Path) -> None:
    image = scene((1600, 1600))
    raster = write(tmp_path / "tile.tif", image)
    divide(raster, tmp_path / "blocks.tif")
    assert extracted(tmp_path / "blocks.tif") == 1
    image[64:] = image[64:][::-1]  # the field stays as it is
    write(raster, image)
    with pytest.raises(RasterError, match="is not as it was"):
        extracted(tmp_path / "blocks.tif")


@pytest.mark.parametrize(
    ("transform", "crs"),
    [
        (PLACE * Affine.translation(1, 0), "EPSG:32633"),
        (PLACE * Affine.scale(1.01), "EPSG:32633"),
        (PLACE * Affine.rotation(1), "EPSG:32633"),
        (PLACE, "EPSG:32634"),
        (PLACE, "EPSG:25830"),
        (PLACE, None),
    ],
)
def test_a_raster_that_was_moved_is_found(transform: Affine, crs: str | None, blocks: Path) -> None:
    write(blocks.with_name("tile.tif"), scene(), transform, crs)
    with pytest.raises(RasterError, match=f"tile.tif does not lie where it lay .*; {AGAIN}"):
        extracted(blocks)
    assert extracted(blocks, refine="none") == 1


def test_another_size_is_found(blocks: Path) -> None:
    write(blocks.with_name("tile.tif"), scene((448, 501)))
    with pytest.raises(ParameterError, match="has not the size of the raster"):
        extracted(blocks)


@pytest.mark.slow
def test_copies_of_both_files_and_a_raster_that_is_written_again_pass(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    copies = tmp_path / "copies"
    copies.mkdir()
    divide(write(Path("tile.tif"), scene()), Path("blocks.tif"))
    for name in ("tile.tif", "blocks.tif"):
        shutil.copy(tmp_path / name, copies / name)  # with another time
    (tmp_path / "tile.tif").unlink()
    assert extracted(copies / "blocks.tif") == 1
    with rasterio.open(copies / "tile.tif") as file:
        how = file.profile | {"compress": "deflate", "tiled": True, "blockxsize": 64, "blockysize": 64}
    with rasterio.open(copies / "tile.tif", "w", **how) as file:
        file.write(scene(), 1)
    assert extracted(copies / "blocks.tif") == 1


@pytest.mark.slow
@pytest.mark.parametrize(
    "crs", ["+proj=tmerc +lat_0=50 +lon_0=15 +datum=WGS84", "EPSG:4326", "EPSG:2154", None]
)
def test_a_raster_of_any_system_lies_where_its_block_map_lies(crs: str | None, tmp_path: Path) -> None:
    place = Affine(1e-5, 2e-6, 15.1, 2e-6, -1e-5, 47.3) if crs == "EPSG:4326" else PLACE
    raster = write(tmp_path / "tile.tif", scene(), place, crs)
    divide(raster, tmp_path / "blocks.tif")
    with warnings.catch_warnings(action="ignore"):  # without a CRS, coordinates are local
        assert extracted(tmp_path / "blocks.tif") == 1


def test_the_same_raster_gives_the_same_block_map(blocks: Path, tmp_path: Path) -> None:
    divide(tmp_path / "tile.tif", tmp_path / "again.tif")
    assert (tmp_path / "again.tif").read_bytes() == blocks.read_bytes()


@given(st.integers(1, 2000), st.integers(1, 2000))
def test_the_sample_is_of_different_blocks_and_always_the_same(rows: int, cols: int) -> None:
    found = sampled_blocks((rows, cols), SAMPLED)
    total = -(-rows // BLOCK) * -(-cols // BLOCK)
    assert len(set(found)) == len(found) == min(SAMPLED, total)
    assert found == sampled_blocks((rows, cols), SAMPLED)
    for window in found:
        assert window.row % BLOCK == window.col % BLOCK == 0
        assert window.row + window.rows == min(window.row + BLOCK, rows)
        assert window.col + window.cols == min(window.col + BLOCK, cols)
