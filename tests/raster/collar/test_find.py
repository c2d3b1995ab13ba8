"""Collars are found to the pixel; ground that is black or white at the edge is kept."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import ndimage

from tests.raster.collar.draw_collar import framed, ragged, texture, turned, write
from uavseg.execution.executors import threads
from uavseg.raster.collar import evidence, find, flood
from uavseg.raster.collar.find import without_collar
from uavseg.raster.grid.tiling import TilePass, Window
from uavseg.raster.read.dataset import Dataset, DatasetOverview
from uavseg.raster.spectral.formula import BandWords

SHAPE = (420, 500)
PICTURES = {"turned": turned(SHAPE, 17, 0.38), "ragged": ragged(SHAPE)}
ALONE = TilePass(())


def cleaned(path: Path, **how: Any) -> Dataset:
    return without_collar(Dataset.open(path, **how), ALONE)


def left_out(dataset: Dataset) -> NDArray[np.bool_]:
    """Which pixels are invalid."""
    _, valid = dataset.read(Window(0, 0, *dataset.geobox.shape))
    return np.zeros(dataset.geobox.shape, bool) if valid is None else ~valid


def notes(dataset: Dataset) -> str:
    return " ".join(dataset.warnings)


@pytest.mark.slow
@pytest.mark.parametrize("dtype", [np.uint8, pytest.param(np.uint16, marks=pytest.mark.slow)])
@pytest.mark.parametrize("bands", [1, pytest.param(3, marks=pytest.mark.slow), 4])
@pytest.mark.parametrize("color", ["black", "white"])
@pytest.mark.parametrize("shape", list(PICTURES))
def test_a_sharp_collar_is_left_out_to_the_pixel(
    tmp_path: Path, dtype: type, bands: int, color: str, shape: str
) -> None:
    picture, scale = PICTURES[shape], 1 if dtype is np.uint8 else 40
    image = np.stack([texture(SHAPE, seed).astype(dtype) * scale for seed in range(bands)])
    value = 0 if color == "black" else np.iinfo(dtype).max
    path = write(tmp_path / "a.tif", framed(image, picture, value), photometric="minisblack")
    found = left_out(cleaned(path))
    assert not (found & picture).any()
    assert (~picture & ~found).sum() <= 40  # the tips of acute corners
    share = f"a {color} collar of {100 * found.mean():.0f} % of the raster was treated as nodata"
    assert share in notes(cleaned(path))


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
@pytest.mark.parametrize("expression", ["(b2 - b1) / (b2 + b1)", "b1 - b2", "b1 ** 999999999"])
@pytest.mark.parametrize("nodata", [None, 0])
def test_a_formula_has_the_collar_of_its_bands(
    tmp_path: Path, dtype: type, expression: str, nodata: int | None
) -> None:
    picture, value = PICTURES["turned"], np.iinfo(dtype).max
    image = np.stack([texture(SHAPE, seed).astype(dtype) * (value // 255) for seed in range(2)])
    path = write(tmp_path / "a.tif", framed(image, picture, value), nodata=nodata)
    dataset = cleaned(path, words=BandWords(expr=expression))
    assert dataset.dtype == np.float32 and dataset.collar is not None
    found = dataset.collar.read(Window(0, 0, *SHAPE))
    assert not (found & picture).any() and left_out(dataset)[found].all()
    assert (~picture & ~found).sum() <= 40  # the tips of acute corners


@pytest.mark.parametrize("side", [250, 2000])
def test_an_overview_of_a_formula_has_the_collar_of_its_bands(tmp_path: Path, side: int) -> None:
    image = np.stack([texture(SHAPE, seed) for seed in range(2)])
    path = write(tmp_path / "a.tif", framed(image, PICTURES["turned"], 0))
    words = BandWords(expr="b1 / 2 + sqrt(b2)")
    plain, formula = (
        without_collar(DatasetOverview.of(Dataset.open(path, words=chosen), side), ALONE)
        for chosen in (BandWords(), words)
    )
    assert formula.dtype == np.float32 and notes(formula) == notes(plain) != ""
    assert np.array_equal(left_out(formula), left_out(plain)) and left_out(plain).any()


@pytest.mark.parametrize("quality", [75, pytest.param(90, marks=pytest.mark.slow)])
@pytest.mark.parametrize("bands", [1, 3])
@pytest.mark.parametrize("color", ["black", "white"])
@pytest.mark.parametrize("shape", list(PICTURES))
def test_the_rim_that_jpeg_smeared_goes_too(
    tmp_path: Path, quality: int, bands: int, color: str, shape: str
) -> None:
    picture = PICTURES[shape]
    image = np.stack([texture(SHAPE, seed) for seed in range(bands)])
    jpeg = {"compress": "jpeg", "jpeg_quality": quality}
    jpeg |= {"photometric": "ycbcr", "interleave": "pixel"} if bands == 3 else {}
    path = write(tmp_path / "a.tif", framed(image, picture, 0 if color == "black" else 255), **jpeg)
    found = left_out(cleaned(path))
    assert (~picture & ~found).sum() <= 0.01 * (~picture).sum()
    deep = ndimage.distance_transform_cdt(picture, "chessboard") > evidence.SMEAR + evidence.BLEND
    assert not (found & deep).any() and (found & picture).sum() <= 0.06 * picture.sum()


def test_a_resampled_rim_goes_too(tmp_path: Path) -> None:
    picture = PICTURES["turned"]
    image = ndimage.uniform_filter(framed(texture(SHAPE), picture, 0), 3)
    found = left_out(cleaned(write(tmp_path / "a.tif", image)))
    assert not (~picture & ~found).any()


@pytest.mark.parametrize("quality", [75, 90])
def test_nearly_black_pixels_along_nodata_go_too(tmp_path: Path, quality: int) -> None:
    picture = PICTURES["ragged"]
    jpeg = {"compress": "jpeg", "jpeg_quality": quality, "nodata": 0}
    path = write(tmp_path / "a.tif", framed(texture(SHAPE), picture, 0), **jpeg)
    before, found = left_out(Dataset.open(path)), left_out(cleaned(path))
    assert (~picture & ~before).sum() > 1000
    assert not (~picture & ~found).any()
    assert f"{(found & ~before).sum():,} nearly black pixels along nodata" in notes(cleaned(path))


def test_a_sharp_edge_of_nodata_stays_as_it_is(tmp_path: Path) -> None:
    path = write(tmp_path / "a.tif", framed(texture(SHAPE), PICTURES["ragged"], 0), nodata=0)
    assert cleaned(path).collar is None and not cleaned(path).warnings


@pytest.mark.slow
@pytest.mark.parametrize(
    "side", [(64, 64), *(pytest.param(side, marks=pytest.mark.slow) for side in [(128, 192), (512, 64)])]
)
@pytest.mark.parametrize("jpeg", [False, True])
def test_tiles_and_threads_change_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, side: tuple[int, int], jpeg: bool
) -> None:
    how = {"compress": "jpeg"} if jpeg else {}
    path = write(tmp_path / "a.tif", framed(texture(SHAPE), PICTURES["ragged"], 0), **how)
    expected = cleaned(path)
    for module in (flood, evidence):
        monkeypatch.setattr(module, "flood_tiles", lambda _: side)
    found = without_collar(Dataset.open(path), TilePass((), threads(2)))
    assert np.array_equal(left_out(found), left_out(expected)) and found.warnings == expected.warnings


def test_a_mosaic_has_the_collar_of_the_whole(tmp_path: Path) -> None:
    image = framed(texture(SHAPE), PICTURES["turned"], 0)
    whole = cleaned(write(tmp_path / "whole.tif", image))
    parts = []
    for row in range(0, SHAPE[0], 150):
        for col in range(0, SHAPE[1], 200):
            place = whole.geobox.transform * whole.geobox.transform.translation(col, row)
            part = image[row : row + 150, col : col + 200]
            parts.append(write(tmp_path / f"{row}_{col}.tif", part, transform=place))
    mosaic = without_collar(Dataset.open(parts), ALONE)
    assert np.array_equal(left_out(mosaic), left_out(whole)) and mosaic.warnings == whole.warnings


def test_a_raster_without_constant_corners_is_read_at_its_corners_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    dataset = Dataset.open(write(tmp_path / "a.tif", texture(SHAPE)))
    read, pixels = Dataset.read, []
    monkeypatch.setattr(
        Dataset, "read", lambda self, window: pixels.append(window.rows * window.cols) or read(self, window)
    )
    assert without_collar(dataset, ALONE) is dataset
    assert sum(pixels) == 4 * find.CORNER**2


def shore(seed: int) -> NDArray[np.bool_]:
    """Land beyond a shore that wanders along the lower edge."""
    rng = np.random.default_rng(seed)
    line = gaussian_line(rng, SHAPE[1])
    return np.arange(SHAPE[0])[:, None] < SHAPE[0] - 90 + line


def gaussian_line(rng: np.random.Generator, length: int) -> NDArray[np.float64]:
    line = ndimage.gaussian_filter1d(rng.standard_normal(length), 15)
    return 25 * line / line.std()


@pytest.mark.parametrize("value", [0, 255])
@pytest.mark.parametrize("seed", range(4))
def test_a_drawn_shore_along_the_edge_is_kept(tmp_path: Path, value: int, seed: int) -> None:
    dataset = cleaned(write(tmp_path / "a.tif", framed(texture(SHAPE), shore(seed), value)))
    assert dataset.collar is None


@pytest.mark.parametrize("share", [5, 20, 50])
@pytest.mark.parametrize("bright", [False, True])
@pytest.mark.parametrize("seed", [0, *(pytest.param(k, marks=pytest.mark.slow) for k in (1, 2))])
def test_clipped_ground_is_kept(tmp_path: Path, share: int, bright: bool, seed: int) -> None:
    image = texture(SHAPE, seed).astype(float)
    from_corner = np.hypot(*np.mgrid[: SHAPE[0], : SHAPE[1]])
    image -= 250 * np.exp(-((from_corner / 130) ** 2))  # it gets dark towards a corner
    image = 255 - image if bright else image
    low, high = np.percentile(image, [0, 100 - share] if bright else [share, 100])
    clipped = np.clip((image - low) / (high - low) * 255, 0, 255).astype(np.uint8)
    assert (clipped[:4, :4] == (255 if bright else 0)).all()
    assert cleaned(write(tmp_path / "a.tif", clipped)).collar is None


def test_a_mask_of_few_values_is_kept(tmp_path: Path) -> None:
    mask = np.where(PICTURES["turned"], np.uint8(255), np.uint8(0))
    assert cleaned(write(tmp_path / "a.tif", mask)).collar is None


def test_a_sliver_is_kept(tmp_path: Path) -> None:
    image = texture(SHAPE)
    image[:13, :13] = 0
    assert cleaned(write(tmp_path / "a.tif", image)).collar is None


@pytest.mark.parametrize("dtype", ["int16", "float32", "int8"])
def test_types_in_which_0_may_be_measured_have_no_collar(tmp_path: Path, dtype: str) -> None:
    image = framed((texture(SHAPE) // 2).astype(dtype), PICTURES["turned"], 0)
    assert cleaned(write(tmp_path / "a.tif", image)).collar is None


def test_a_collar_beside_snow_is_left_to_the_user(tmp_path: Path) -> None:
    image = texture(SHAPE, low=120, high=255)
    image[image > 205] = 250
    dataset = cleaned(write(tmp_path / "a.tif", framed(image, PICTURES["ragged"], 255)))
    assert dataset.collar is None
    assert "may be a collar or ground; they were kept: --nodata 255" in notes(dataset)


def test_a_downsampled_read_has_the_same_collar(tmp_path: Path) -> None:
    dataset = cleaned(write(tmp_path / "a.tif", framed(texture(SHAPE), PICTURES["turned"], 0)))
    values, valid, _ = dataset.read_coarse(100)
    assert valid is not None and np.array_equal(valid, values[0] > 0)


def test_an_overview_is_searched_by_itself(tmp_path: Path) -> None:
    path = write(tmp_path / "a.tif", framed(texture(SHAPE), PICTURES["turned"], 0))
    coarse = without_collar(DatasetOverview.of(Dataset.open(path), 250), ALONE)
    found = left_out(coarse)
    assert abs(found.mean() - (~PICTURES["turned"]).mean()) < 0.01
    black = coarse.read(Window(0, 0, *coarse.geobox.shape))[0][0] == 0
    assert (found != black).sum() <= 20


def test_the_fingerprint_knows_the_collar(tmp_path: Path) -> None:
    from uavseg.execution.checkpoint import fingerprint

    path = write(tmp_path / "a.tif", framed(texture(SHAPE), PICTURES["turned"], 0))
    assert fingerprint(cleaned(path)) != fingerprint(Dataset.open(path))
    assert fingerprint(cleaned(path)) == fingerprint(cleaned(path))


@pytest.mark.parametrize("noise", [1.0, 3.0])
@pytest.mark.parametrize("tilt", [0.0, 0.1])
def test_a_pale_sky_above_a_horizon_is_kept(tmp_path: Path, noise: float, tilt: float) -> None:
    """It fades from white, and is no wider in its corners than elsewhere: the user decides."""
    rng, (row, col) = np.random.default_rng(3), np.indices((600, 600))
    horizon = 70 + tilt * col
    ground = 90 + 240 * ndimage.gaussian_filter(rng.normal(size=row.shape), 4) + rng.normal(0, 6, row.shape)
    sky = 235 + 40 * (1 - row / horizon) + rng.normal(0, noise, row.shape)
    image = np.clip(np.where(row < horizon, sky, ground), 1, 255).round().astype(np.uint8)
    write(tmp_path / "a.tif", image)
    found = cleaned(tmp_path / "a.tif")
    assert not left_out(found).any()
    assert (image == 255).mean() > 0.02 and "treated as nodata" not in notes(found)
