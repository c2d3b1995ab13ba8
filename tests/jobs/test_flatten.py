"""Flat fields of jobs: the same for any tiles, kept in block maps, said in metadata, refused where wrong."""

import json
from pathlib import Path

import numpy as np
import pytest
import rasterio
from affine import Affine
from click.testing import CliRunner
from hypothesis import given, strategies as st
from numpy.typing import NDArray
from scipy import ndimage

import uavseg
from uavseg.cli import main
from uavseg.errors import ParameterError, UavsegError
from uavseg.jobs.source.open_source import open_source
from uavseg.options.reading import ReadOptions
from uavseg.raster.grid.geobox import Length, as_length
from uavseg.segmentation.blocks.block_file import read_block_map

DARK = (0, 0.395)


def lit(seed: int = 0, shape: tuple[int, int] = (260, 300)) -> tuple[NDArray[np.uint8], NDArray[np.bool_]]:
    """Dark discs on ground whose light falls from one corner to the other by more than they are darker."""
    rng = np.random.default_rng(seed)
    rows, cols = np.indices(shape)
    dark = np.zeros(shape, bool)
    for row, col in rng.integers(10, 250, (12, 2)):
        dark |= (rows - row) ** 2 + (cols - col) ** 2 < 49
    v = 150 - 90 * (rows + cols) / sum(shape) - 30 * dark + rng.normal(0, 3, shape)
    return np.clip(v, 1, 255).astype(np.uint8), dark


def write(path: Path, image: NDArray[np.uint8], epsg: int | None = 32633) -> str:
    crs = None if epsg is None else rasterio.CRS.from_epsg(epsg)
    profile = {"driver": "GTiff", "height": image.shape[0], "width": image.shape[1], "count": 1}
    with rasterio.open(
        path, "w", **profile, dtype="uint8", nodata=0, crs=crs, transform=Affine(0.5, 0, 5e5, 0, -0.5, 5e6)
    ) as file:
        file.write(image, 1)
    return str(path)


def found_pixels(regions: object, shape: tuple[int, int]) -> NDArray[np.bool_]:
    from rasterio.features import rasterize

    geometry = regions.geometry  # type: ignore[attr-defined]
    if not len(geometry):
        return np.zeros(shape, bool)
    return np.asarray(rasterize(geometry, shape, dtype="uint8"), bool)


def run(*words: str) -> str:
    done = CliRunner().invoke(main, list(words))
    assert done.exit_code == 0, done.output
    return done.output


@pytest.mark.slow
def test_things_under_slow_light_are_found() -> None:
    image, dark = lit()

    def best(flatten: str | None) -> float:
        highs = np.linspace(0.3, 0.45, 9)
        masks = [found_pixels(uavseg.extract(image, (0, h), flatten=flatten), image.shape) for h in highs]
        return max(float((mask & dark).sum() / (mask | dark).sum()) for mask in masks)

    assert best(None) < 0.5 and best("80px") > 0.9


@pytest.mark.slow
@given(st.integers(0, 1000), st.sampled_from([64, 128]), st.sampled_from(["32px", "50px", "300px"]))
def test_tiles_and_threads_change_nothing(seed: int, tile: int, width: str) -> None:
    image = lit(seed, (170, 200))[0]
    whole = uavseg.extract(image, DARK, flatten=width)
    assert uavseg.extract(image, DARK, flatten=width, tile=tile, threads=2).equals(whole)


@pytest.mark.parametrize("name", ["extract", "classes", "levels"])
def test_classes_and_levels_are_of_v_without_the_light(name: str) -> None:
    image, dark = lit()
    if name == "levels":
        found = uavseg.levels(image, breaks=[0.37], flatten="80px")
        found = found[found["level"] == 0]
    elif name == "classes":
        found = uavseg.extract(image, classes={"dark": (0, 0.37), "rest": (0.37, 1)}, flatten="80px")
        found = found[found["class"] == "dark"]
    else:
        found = uavseg.extract(image, (0, 0.37), flatten="80px")
    mask = found_pixels(found, image.shape)
    assert (mask & dark).sum() / (mask | dark).sum() > 0.9


@pytest.mark.slow
@pytest.mark.parametrize("refine", [pytest.param(None, marks=pytest.mark.slow), "none"])
def test_a_block_map_keeps_the_light_that_was_taken_away(tmp_path: Path, refine: str | None) -> None:
    raster, blocks = write(tmp_path / "a.tif", lit()[0]), str(tmp_path / "b.tif")
    said = run("divide", raster, "--flatten", "40", "-o", blocks)
    assert "slow light" in said and "taken away over 40 m" in said
    requested = (0, 0.405) if refine else DARK
    direct = uavseg.extract(raster, requested, flatten=40, refine=refine)
    again = uavseg.extract(blocks, requested, refine=refine)
    assert len(direct) > 1
    columns = ["pixels", "mean", "geometry", "range_low"]
    assert again[columns].equals(direct[columns])
    assert again["mean_value"].isna().all() and direct["mean_value"].isna().all()
    assert uavseg.suggest(blocks) == uavseg.suggest(raster, flatten=40.0)
    saved = read_block_map(blocks)
    assert saved.origin.flatten == "40" and saved.illumination is not None
    assert np.array_equal(saved.blocks.sums, uavseg.divide(raster, flatten=40).sums)


def test_a_block_map_without_it_says_nothing_of_it(tmp_path: Path) -> None:
    raster, blocks = write(tmp_path / "a.tif", lit()[0]), str(tmp_path / "b.tif")
    run("divide", raster, "-o", blocks, "-q")
    saved = read_block_map(blocks)
    assert saved.origin.flatten is None and saved.illumination is None
    with rasterio.open(blocks) as file:
        assert "flatten" not in json.loads(file.tags()["UAVSEG_BLOCK_MAP"])


@pytest.mark.parametrize(
    "flat",
    [
        3,
        {"width": "40"},
        {"width": "40", "step": 12, "target": 5},
        {"width": "40", "step": 4, "target": 5},
        {"width": "40", "step": 8, "target": 70000},
        {"width": "", "step": 8, "target": 5},
        {"width": "40", "step": 16, "target": 5},
    ],
)
def test_a_block_map_with_another_light_is_refused(tmp_path: Path, flat: object) -> None:
    raster, blocks = write(tmp_path / "a.tif", lit()[0]), str(tmp_path / "b.tif")
    run("divide", raster, "--flatten", "40", "-o", blocks, "-q")
    with rasterio.open(blocks, "r+") as file:
        header = json.loads(file.tags()["UAVSEG_BLOCK_MAP"])
        assert header["flatten"]["step"] == 8
        file.update_tags(UAVSEG_BLOCK_MAP=json.dumps(header | {"flatten": flat}))
    with pytest.raises(UavsegError, match="is not a block map that this version reads"):
        uavseg.extract(blocks, DARK)


def test_regions_say_how_they_were_made(tmp_path: Path) -> None:
    raster, out = write(tmp_path / "a.tif", lit()[0]), str(tmp_path / "r.geojson")
    run("extract", raster, "--range", "0,0.42", "--flatten", "80px", "-o", out, "-q")
    assert '"flatten": "80px"' in Path(out).read_text() or '"flatten":"80px"' in Path(out).read_text()
    run("extract", raster, "--range", "0,0.42", "-o", out, "--overwrite", "-q")
    assert "flatten" not in Path(out).read_text()


def test_the_proposed_line_has_the_same_flat_field(tmp_path: Path) -> None:
    raster = write(tmp_path / "a.tif", lit()[0])
    found = json.loads(run("suggest", raster, "--flatten", "40", "--json", "--classes", "2"))
    line = found["ranges"][0]["command"]
    assert " --flatten 40 " in line
    assert found["unit"] == "" and found["ranges"][0]["value_high"] is None
    assert Length(12.5).word == "12.5" and as_length(Length(300.0, in_pixels=True).word) == Length(300, True)


@pytest.mark.slow
def test_a_stopped_run_goes_on_only_with_the_same_light(tmp_path: Path) -> None:
    raster, kept = write(tmp_path / "a.tif", lit()[0]), tmp_path / "kept"
    plain = uavseg.extract(raster, DARK)
    flat = uavseg.extract(raster, DARK, flatten=40, resume=kept)
    assert uavseg.extract(raster, DARK, resume=kept).equals(plain)
    assert uavseg.extract(raster, DARK, flatten=40, resume=kept).equals(flat)
    wider = uavseg.extract(raster, DARK, flatten=80)
    assert uavseg.extract(raster, DARK, flatten=80, resume=kept).equals(wider) and not wider.equals(flat)


@pytest.mark.parametrize(
    "words, said",
    [
        ({"flatten": "20px"}, "at least 32"),
        ({"flatten": 9}, "a flat field of 9 m is 18 pixels"),
        ({"flatten": "1e6px"}, "at most 32,768"),
        ({"flatten": "-4"}, "finite length above 0"),
        ({"flatten": "wide"}, "metres such as 2.5, or pixels"),
        ({"flatten": 40, "range": None, "values": (0, 90)}, "give a range of v"),
        ({"flatten": 40, "range": None, "percentile": (0, 10)}, "give a range of v"),
    ],
)
def test_what_does_not_fit_is_refused(tmp_path: Path, words: dict[str, object], said: str) -> None:
    raster = write(tmp_path / "a.tif", lit()[0])
    with pytest.raises(ParameterError, match=said):
        uavseg.extract(raster, **({"range": DARK} | words))  # type: ignore[arg-type]


def test_metres_need_a_crs_and_blocks_another_flat_field_is_refused(tmp_path: Path) -> None:
    raster = write(tmp_path / "a.tif", lit()[0], None)
    with pytest.raises(ParameterError, match="give the length in pixels, such as 40px"):
        uavseg.extract(raster, DARK, flatten=40)
    blocks = str(tmp_path / "b.tif")
    run("divide", raster, "--flatten", "80px", "-o", blocks, "-q")
    with pytest.raises(ParameterError, match="leave flatten out"):
        uavseg.extract(blocks, DARK, flatten="80px")
    with pytest.raises(ParameterError, match="give a range of v"):
        uavseg.extract(blocks, values=(0, 90))


def test_a_small_thing_in_nodata_and_all_nodata_are_answered() -> None:
    image = np.full((100, 100), np.nan, np.float32)
    with pytest.warns(UserWarning, match="uavseg suggest with the same --flatten shows which v there are"):
        assert len(uavseg.extract(image, (0, 1), flatten="40px", stretch="none")) == 0
    image[40:60, 40:60] = 0.25
    [region] = uavseg.extract(image, (0.2, 0.3), flatten="40px", stretch="none").to_dict("records")
    assert region["pixels"] == 400 and region["mean"] == pytest.approx(0.25, abs=1e-4)


def test_the_width_is_a_word_of_reading() -> None:
    options = ReadOptions(flatten="2.5")
    assert options.flat_field == Length(2.5)
    assert open_source(np.zeros((70, 70), np.uint8), options).origin.flatten == "2.5"  # type: ignore[union-attr]


def test_a_disc_wider_than_the_field_fades_inside() -> None:
    """So the width has to be several times that of what is sought."""
    rows, cols = np.indices((512, 512))
    disc = (rows - 256) ** 2 + (cols - 256) ** 2 < 100**2
    image = ndimage.gaussian_filter(np.where(disc, 200.0, 100.0), 1).astype(np.uint8)
    wide = found_pixels(uavseg.extract(image, (0.55, 1), flatten="600px"), image.shape)
    narrow = found_pixels(uavseg.extract(image, (0.55, 1), flatten="64px"), image.shape)
    assert (wide & disc).sum() > 0.95 * disc.sum() and (narrow & disc).sum() < 0.6 * disc.sum()
