"""Regions like a sample by several bands: colours of equal grey are told apart, whatever the tiles."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
from affine import Affine
from numpy.typing import NDArray

from uavseg.errors import BandError, ParameterError, SampleError
from uavseg.execution.executors import threads
from uavseg.jobs.match.match import Match, match
from uavseg.jobs.match.request import MatchRequest
from uavseg.jobs.source.open_source import open_raster
from uavseg.jobs.source.work import SERIAL, Work
from uavseg.options.reading import ReadOptions
from uavseg.raster.grid.tiling import Window
from uavseg.regions.outline.rings import rasterise
from uavseg.regions.sample.place import Disc

SHAPE = (256, 320)
COLORS = MatchRequest(Disc(1110, 890, 50), bands=("red", "green", "blue"), by="texture")
GREY = replace(COLORS, bands=())


def truth() -> NDArray[np.bool_]:
    """A disc and a bar."""
    row, col = np.indices(SHAPE)
    disc = (row - 110) ** 2 + (col - 110) ** 2 < 80**2
    return disc | ((col > 230) & (col < 290) & (row > 40))


def colored(seed: int = 0) -> NDArray[np.uint8]:
    """A picture in which the disc and the bar have another colour, of the same luminance and texture."""
    rng = np.random.default_rng(seed)
    sign, noise = np.where(truth(), 1, -1), rng.normal(0, 5, SHAPE)
    red, green = 120 + noise + 8 * sign / 0.2126 * 0.3, 120 + noise - 8 * sign / 0.7152 * 0.3
    blue = 120 + noise + rng.normal(0, 3, SHAPE)
    return np.rint(np.clip([red, green, blue], 0, 255)).astype(np.uint8)


@pytest.fixture
def picture(tmp_path: Path) -> Path:
    return write(tmp_path / "picture.tif", colored())


def write(path: Path, planes: NDArray[Any], **how: Any) -> Path:
    size = dict(zip(("count", "height", "width"), planes.shape, strict=True)) | {"dtype": planes.dtype.name}
    place = {"crs": "EPSG:32618", "transform": Affine(1, 0, 1000, 0, -1, 1000), "photometric": "RGB"}
    with rasterio.open(path, "w", "GTiff", **size, **(place | how)) as file:
        file.write(planes)
    return path


def found(path: Path, request: MatchRequest, work: Work = SERIAL) -> Match:
    return match(open_raster(str(path)), request, work)


def overlap(made: Match, expected: NDArray[np.bool_]) -> float:
    painted = rasterise(made.found.rings, Window(0, 0, *SHAPE)) > 0
    return float((painted & expected).sum() / (painted | expected).sum())


def test_colours_of_equal_grey_are_found_and_grey_alone_does_not_tell_them(picture: Path) -> None:
    luminance = np.tensordot([0.2126, 0.7152, 0.0722], colored().astype(float), 1)
    assert abs(luminance[truth()].mean() - luminance[~truth()].mean()) < 0.5
    assert overlap(found(picture, COLORS), truth()) > 0.95
    assert overlap(found(picture, GREY), truth()) < 0.6


def test_regions_end_at_cells_where_nothing_is_refined(picture: Path) -> None:
    assert overlap(found(picture, replace(COLORS, refine="none")), truth()) > 0.7


@pytest.mark.slow
def test_tiles_and_threads_change_nothing(picture: Path) -> None:
    known = found(picture, COLORS)
    assert len(known.found.regions) == 2
    for side, run in ((64, threads(2)), (128, threads(1))):
        other = found(picture, COLORS, Work(side, run, run))
        for one, two in zip(
            known.found.regions.columns.values(), other.found.regions.columns.values(), strict=True
        ):
            assert np.array_equal(one, two, equal_nan=one.dtype.kind == "f")
        assert np.array_equal(known.found.rings.vertices, other.found.rings.vertices)


def test_nodata_in_a_band_is_not_matched(tmp_path: Path) -> None:
    planes = colored()
    planes[2, 100:, 230:290] = 255
    path = write(tmp_path / "holed.tif", planes.astype(np.int16), nodata=255, photometric="MINISBLACK")
    words = replace(COLORS, bands=(1, 2, 3))
    made = match(open_raster(str(path), ReadOptions(band=1)), words)
    painted = rasterise(made.found.rings, Window(0, 0, *SHAPE)) > 0
    assert painted[120:, 235:285].mean() < 0.2 and painted[60:90, 235:285].mean() > 0.9


@pytest.mark.parametrize(
    ("bands", "kind", "words"),
    [((4,), ParameterError, "no band 4"), (("nir",), BandError, "no band is named 'nir'")],
)
def test_unknown_bands_are_refused(
    picture: Path, bands: tuple[int | str, ...], kind: type[Exception], words: str
) -> None:
    with pytest.raises(kind, match=words):
        found(picture, replace(COLORS, bands=bands))


def test_bands_without_intensity_are_refused() -> None:
    with pytest.raises(ParameterError, match="texture alone"):
        replace(COLORS, intensity=float("inf"))


def test_a_sample_without_a_valid_pixel_in_a_band_is_refused(tmp_path: Path) -> None:
    planes = colored().astype(np.float32)
    planes[1] = np.nan
    path = write(tmp_path / "empty.tif", planes, photometric="MINISBLACK")
    with pytest.raises(SampleError, match="no valid pixel in band 2"):
        match(open_raster(str(path), ReadOptions(band=1)), replace(COLORS, bands=(2,)))
