"""A block map written and read is the same to the bit, and its file opens as an ordinary GeoTIFF."""

import json
import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
from affine import Affine
from hypothesis import given, settings, strategies as st
from rasterio.crs import CRS

from uavseg.access import allowing
from uavseg.errors import AccessError, OutputExistsError, RasterError, RasterReadError
from uavseg.raster.grid.geobox import GeoBox
from uavseg.raster.intensity.stretch import Stretch
from uavseg.segmentation.blocks.block_file import (
    Origin,
    SavedBlocks,
    is_block_map,
    read_block_map,
    write_block_map,
)
from uavseg.segmentation.blocks.block_map import BlockMap, find_leaves
from uavseg.segmentation.params.segment import DivisionParams

TAG = "UAVSEG_BLOCK_MAP"
UTM = Affine(0.3, 0, 500000.1, 0, -0.3, 4649776.7)
ORIGIN = Origin(("tile.tif", "/vsicurl/https://example.org/a.tif"), "/data", 2, None, -9999.0)


def saved_map(seed: int = 0, shape: tuple[int, int] = (150, 77)) -> SavedBlocks:
    """Cells within the raster as they may be, and nothing beyond its edge."""
    rng = np.random.default_rng(seed)
    blocks = BlockMap.empty(shape)
    rows, cols = (-(-length // 8) for length in shape)
    counts = rng.integers(0, 65, (rows, cols)) * (rng.random((rows, cols)) > 0.2)
    blocks.counts[:rows, :cols] = counts
    blocks.sums[:rows, :cols] = rng.integers(0, 65536, (rows, cols)) * counts
    ratios = np.where(rng.random(blocks.ratios.shape) < 0.2, np.inf, 1 + rng.random(blocks.ratios.shape))
    blocks.ratios[:] = np.where(reachable(shape, blocks.blocks), ratios, 0)
    geobox = GeoBox(shape, UTM, CRS.from_epsg(32631))
    return SavedBlocks(blocks, geobox, Stretch(0.1, 1 / 3, "percentile:2,98 -> 0.1..0.333"), "band 2", ORIGIN)


def reachable(shape: tuple[int, int], blocks: tuple[int, int]) -> np.ndarray:
    """Which blocks of 64, 32 and 16 begin within the raster; beyond it nothing has texture."""
    found = np.zeros((*blocks, 21), bool)
    for b, c in np.ndindex(blocks):
        k = 0
        for side in (64, 32, 16):
            for r in range(0, 64, side):
                for q in range(0, 64, side):
                    found[b, c, k] = 64 * b + r < shape[0] and 64 * c + q < shape[1]
                    k += 1
    return found


def assert_same(first: SavedBlocks, second: SavedBlocks) -> None:
    assert first.blocks.shape == second.blocks.shape
    for name in ("sums", "counts", "ratios"):
        one, other = getattr(first.blocks, name), getattr(second.blocks, name)
        assert one.dtype == other.dtype and np.array_equal(one, other), name
    assert first.geobox.shape == second.geobox.shape and first.geobox.crs == second.geobox.crs
    assert first.geobox.transform.almost_equals(second.geobox.transform, 1e-9)
    assert (first.stretch.low, first.stretch.high) == (second.stretch.low, second.stretch.high)
    assert (first.stretch.name, first.band_names) == (second.stretch.name, second.band_names)
    assert repr(first.origin) == repr(second.origin)


@pytest.mark.slow
@settings(max_examples=20)
@given(st.integers(0, 999), st.tuples(st.integers(1, 300), st.integers(1, 300)))
def test_written_and_read_is_the_same(
    tmp_path_factory: pytest.TempPathFactory, seed: int, shape: tuple[int, int]
) -> None:
    path = tmp_path_factory.mktemp("blocks") / "a.tif"
    write_block_map(path, saved_map(seed, shape), DivisionParams(1.2, 0.05))
    assert_same(read_block_map(path), saved_map(seed, shape))


@pytest.mark.parametrize(
    "change",
    [
        {"geobox": GeoBox((150, 77), Affine.identity(), None)},
        {"geobox": GeoBox((150, 77), Affine(0, 2, 10, 3, 0, 20), CRS.from_epsg(4326))},
        {"origin": Origin(("a.tif",), ".", None, (3, 2, 1), float("nan"))},
        {"origin": Origin(('ö "1".tif',), "/ein Ordner")},
        {"origin": Origin(("a.tif",), ".", nodata="only:-9999")},
        {"origin": Origin(("a.tif",), ".", nodata="none")},
        {"stretch": Stretch(-1e300, 5e-324, "given")},
    ],
)
def test_the_origin_is_kept(tmp_path: Path, change: dict[str, Any]) -> None:
    with warnings.catch_warnings(action="ignore"):
        write_block_map(tmp_path / "a.tif", replace(saved_map(), **change), DivisionParams(1.2, 0.05))
        assert_same(read_block_map(tmp_path / "a.tif"), replace(saved_map(), **change))


def test_the_same_leaves_come_from_the_file(tmp_path: Path) -> None:
    write_block_map(tmp_path / "a.tif", saved_map(), DivisionParams(1.2, 0.05))
    for X, tau in ((1.2, 0.05), (1.6, np.inf), (np.inf, 0.3)):
        for one, other in zip(
            find_leaves(read_block_map(tmp_path / "a.tif").blocks, DivisionParams(X, tau)),
            find_leaves(saved_map().blocks, DivisionParams(X, tau)),
            strict=True,
        ):
            assert np.array_equal(one, other)


def test_the_file_shows_a_cell_of_8_pixels_as_one_with_named_bands(tmp_path: Path) -> None:
    saved = saved_map(1, (150, 77))
    write_block_map(tmp_path / "a.tif", saved, DivisionParams(1.3, 0.05))
    side, mean = find_leaves(saved.blocks, DivisionParams(1.3, 0.05))
    with rasterio.open(tmp_path / "a.tif") as file:
        assert file.shape == (19, 10) and file.crs.to_epsg() == 32631
        assert file.transform.almost_equals(Affine(2.4, 0, 500000.1, 0, -2.4, 4649776.7), 1e-9)
        assert file.descriptions == ("mean v", "side of the leaf in pixels")
        assert len(file.subdatasets) == 4
        bands = file.read()
    seen = np.where(mean < 0, np.nan, mean).astype(np.float32)
    assert np.array_equal(bands[0], seen[:19, :10], equal_nan=True)
    assert np.array_equal(bands[1], side[:19, :10])
    with rasterio.open(f"GTIFF_DIR:4:{tmp_path / 'a.tif'}") as file:
        assert file.shape == (3, 2) and file.descriptions[:2] == ("R of 64", "R of 32, 0")
        assert file.transform.almost_equals(Affine(19.2, 0, 500000.1, 0, -19.2, 4649776.7), 1e-9)


def test_a_file_that_is_there_is_replaced_only_if_allowed(tmp_path: Path) -> None:
    write_block_map(tmp_path / "a.tif", saved_map(1), DivisionParams(1.2, 0.05))
    with pytest.raises(OutputExistsError, match="overwrite"):
        write_block_map(tmp_path / "a.tif", saved_map(2), DivisionParams(1.2, 0.05))
    assert_same(read_block_map(tmp_path / "a.tif"), saved_map(1))
    write_block_map(tmp_path / "a.tif", saved_map(2), DivisionParams(1.2, 0.05), overwrite=True)
    assert_same(read_block_map(tmp_path / "a.tif"), saved_map(2))


def metadata(path: Path) -> dict[str, Any]:
    with rasterio.open(path) as file:
        found: dict[str, Any] = json.loads(file.tags()[TAG])
    return found


def test_a_nodata_value_of_an_earlier_version_takes_the_place_of_that_of_the_files(tmp_path: Path) -> None:
    write_block_map(path := tmp_path / "a.tif", saved_map(), DivisionParams(1.2, 0.05))
    for number in ("-9999.0", -9999):
        with rasterio.open(path, "r+") as file:
            file.update_tags(**{TAG: json.dumps(metadata(path) | {"nodata": number})})
        assert read_block_map(path).origin.nodata == "only:-9999"


@pytest.mark.parametrize(
    "tag",
    [
        "",
        "{",
        "[]",
        "null",
        "{}",
        *(f"without {name}" for name in ("rows", "low", "stretch", "rasters", "rgb")),
        *("rows=0.5", 'rows="many"', "rows=-64", "cols=null", "nodata=[]", "rasters=7"),
    ],
)
def test_a_damaged_tag_is_reported_with_what_to_do(tmp_path: Path, tag: str) -> None:
    path = tmp_path / "a.tif"
    write_block_map(path, saved_map(), DivisionParams(1.2, 0.05))
    text = metadata(path)
    if tag.startswith("without "):
        del text[tag.removeprefix("without ")]
    elif "=" in tag:
        name, value = tag.split("=")
        text[name] = json.loads(value)
    with rasterio.open(path, "r+") as file:
        file.update_tags(**{TAG: json.dumps(text) if "=" in tag or "without" in tag else tag})
    with pytest.raises(RasterError, match=r"a\.tif is not a block map .* make it again with uavseg divide"):
        read_block_map(path)


def test_another_raster_is_not_a_block_map(tmp_path: Path) -> None:
    how = {"driver": "GTiff", "height": 9, "width": 9, "count": 7, "dtype": "float64", "transform": UTM}
    with rasterio.open(tmp_path / "other.tif", "w", **how):
        pass
    with rasterio.open(tmp_path / "other.tif") as file:
        assert not is_block_map(file)
    with pytest.raises(RasterError, match="is not a block map"):
        read_block_map(tmp_path / "other.tif")


def test_a_file_that_is_not_a_raster_cannot_be_read(tmp_path: Path) -> None:
    (tmp_path / "a.txt").write_text("no raster")
    for name, reason in (("a.txt", "cannot be read"), ("nowhere.tif", "there is no file")):
        with pytest.raises(RasterReadError, match=reason):
            read_block_map(tmp_path / name)


def test_a_block_map_is_recognised(tmp_path: Path) -> None:
    write_block_map(tmp_path / "a.tif", saved_map(), DivisionParams(1.2, 0.05))
    with rasterio.open(tmp_path / "a.tif") as file:
        assert is_block_map(file)


def test_rasters_are_found_where_they_were(tmp_path: Path) -> None:
    (tmp_path / "in").mkdir()
    (tmp_path / "in" / "a.tif").touch()
    (tmp_path / "elsewhere").mkdir()
    origin, beside = Origin(("in/a.tif",), str(tmp_path)), tmp_path / "elsewhere" / "map.tif"
    with allowing(tmp_path / "in"):
        assert origin.allowed_rasters(beside) == [str(tmp_path / "in" / "a.tif")]
    with pytest.raises(AccessError, match="--allow-path"):
        origin.allowed_rasters(beside)


def test_rasters_are_found_beside_the_block_map(tmp_path: Path) -> None:
    (tmp_path / "a.tif").touch()
    (tmp_path / "b.tif").touch()
    assert Origin(("a.tif", "b.tif"), "/gone").find_rasters(tmp_path / "map.tif") == [
        str(tmp_path.resolve() / "a.tif"),
        str(tmp_path.resolve() / "b.tif"),
    ]


def test_an_absolute_path_is_found_from_anywhere(tmp_path: Path) -> None:
    (tmp_path / "a.tif").touch()
    with allowing(tmp_path):
        assert Origin((str(tmp_path / "a.tif"),), "/gone").find_rasters("map.tif") == [
            str(tmp_path / "a.tif")
        ]


def test_rasters_are_found_all_or_none(tmp_path: Path) -> None:
    (tmp_path / "a.tif").touch()
    assert Origin(("a.tif", "b.tif"), str(tmp_path)).find_rasters(tmp_path / "map.tif") is None


def test_remote_paths_are_kept_as_they_are(tmp_path: Path) -> None:
    name = "/vsicurl/https://example.org/a.tif"
    with allowing(allow_network=True):
        assert Origin((name,), str(tmp_path)).allowed_rasters(tmp_path / "map.tif") == [name]
    with pytest.raises(AccessError, match="--allow-network"):
        Origin((name,), str(tmp_path)).allowed_rasters(tmp_path / "map.tif")


def test_a_crop_of_a_block_map_is_refused(tmp_path: Path) -> None:
    write_block_map(tmp_path / "a.tif", saved_map(), DivisionParams(1.2, 0.05))
    with rasterio.open(tmp_path / "a.tif") as file:
        bands, tags, how = file.read(), file.tags(), file.profile
    bands = bands[:, 8:, :]  # as gdal_translate -srcwin does, which keeps tags
    with rasterio.open(tmp_path / "part.tif", "w", **{**how, "height": bands.shape[1]}) as file:
        file.write(bands)
        file.update_tags(**tags)
    with pytest.raises(RasterError, match="is not a block map"):
        read_block_map(tmp_path / "part.tif")
