"""The detail of a job: metres and pixels, refusals, and the same regions for any tiles."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import rasterio
from affine import Affine
from hypothesis import given, settings, strategies as st
from numpy.typing import NDArray
from scipy import ndimage

import uavseg
from tests.jobs.test_match_auto import LIKE, overlap, painted, quarters, same, write
from uavseg.errors import ParameterError
from uavseg.execution.executors import threads
from uavseg.jobs.match.match import match
from uavseg.jobs.match.request import MatchRequest
from uavseg.jobs.source.open_source import open_raster
from uavseg.jobs.source.source import detail_of
from uavseg.jobs.source.work import Work
from uavseg.raster.grid.geobox import GeoBox, Length, as_length
from uavseg.segmentation.refine.detail import Detail, PixelDisc, opening_mask

ALL = (0.5, 1)


def patches(seed: int, shape: tuple[int, int] = (170, 200)) -> NDArray[np.uint8]:
    rng = np.random.default_rng(seed)
    smooth = ndimage.gaussian_filter(rng.standard_normal(shape), 3)
    noisy = 128 + 45 * smooth / smooth.std() + rng.normal(0, 12, shape)
    return np.clip(noisy, 1, 255).astype(np.uint8)


def geobox(width: float, height: float, epsg: int | None = 32633, north: float = 5e6) -> GeoBox:
    crs = None if epsg is None else rasterio.CRS.from_epsg(epsg)
    return GeoBox((100, 100), Affine(width, 0, 10.0 if epsg == 4326 else 5e5, 0, -height, north), crs)


def test_metres_are_pixels_along_rows_and_columns() -> None:
    assert detail_of(Length(4), geobox(0.5, 0.5), "tv") == Detail(8, 8)
    assert detail_of(Length(4), geobox(0.5, 2), "tv", cover=True) == Detail(2, 8, True)
    assert detail_of(as_length("7px"), geobox(0.5, 2, None), "tv") == Detail(7, 7)
    assert detail_of(None, geobox(1, 1), "none") is None


def test_degrees_are_measured_on_the_ground() -> None:
    at_60 = detail_of(Length(100), geobox(1e-4, 1e-4, 4326, 60.005), "tv")
    assert at_60 is not None and (at_60.rows, at_60.cols) == (9, 18)  # 11.1 m and 5.6 m


@pytest.mark.parametrize(
    "given, refine, epsg, said",
    [
        ("1px", "tv", 32633, "less than two pixels"),
        (1.2, "tv", 32633, "a detail of 1.2 m is less than two pixels"),
        (500, "tv", 32633, "at most 128 are possible"),
        (1e300, "tv", 32633, "at most 128 are possible"),
        (5, "none", 32633, "these regions end at block edges"),
        (5, "tv", None, "give the length in pixels, such as 5px"),
        (0, "tv", 32633, "a finite length above 0, not 0"),
        ("-3px", "tv", 32633, "a finite length above 0, not -3"),
        ("nan", "tv", 32633, "a finite length above 0, not nan"),
        ("much", "tv", 32633, "metres such as 2.5, or pixels such as 8px, not 'much'"),
    ],
)
def test_a_detail_that_cannot_be_is_refused(
    given: float | str, refine: str, epsg: int | None, said: str
) -> None:
    with pytest.raises(ParameterError, match=said):
        detail_of(as_length(given), geobox(1, 1, epsg), refine)


JOBS: dict[str, Callable[..., object]] = {
    "range": lambda image, **how: uavseg.extract(image, ALL, **how),
    "scan": lambda image, **how: uavseg.extract(image, ALL, refine="scan", **how),
    "classes": lambda image, **how: uavseg.extract(image, classes={"a": (0, 0.4), "b": (0.4, 0.7)}, **how),
    "levels": lambda image, **how: uavseg.levels(image, 0.2, **how),
    "color": lambda image, **how: uavseg.match(image, (60, 60, 12), by="color", **how),
    "texture": lambda image, **how: uavseg.match(image, (60, 60, 34), similarity=0.2, **how),
}


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:color hardly parts", "ignore:nothing is like", "ignore:no region")
@pytest.mark.parametrize("job", JOBS)
@settings(max_examples=5)
@given(seed=st.integers(0, 1000), side=st.integers(2, 30), threads=st.integers(1, 3))
def test_tiles_and_threads_change_nothing(job: str, seed: int, side: int, threads: int) -> None:
    image = patches(seed)
    gaps = image.astype(np.float32)
    if seed % 2:
        gaps[40:90, 120:] = np.nan
    how = {"detail": f"{side}px"}
    whole = JOBS[job](gaps, tile=4096, threads=1, **how)
    assert whole.equals(JOBS[job](gaps, tile=64, threads=threads, **how))  # type: ignore[attr-defined]


def test_no_structure_narrower_than_the_detail_is_extracted() -> None:
    image = np.full((130, 200), 40, np.uint8)
    image[20:60] = image[70:110] = 220
    image[60:70, 90:96] = 220  # a neck
    image[:, 150:154] = 220  # a road
    assert len(uavseg.extract(image, ALL)) == 1
    found = uavseg.extract(image, ALL, detail="9px")
    assert len(found) == 2 and set(found["pixels"]) <= set(range(7900, 8100))
    assert (found["mean"] > 0.8).all()


def test_levels_with_a_detail_cover_all_pixels() -> None:
    image = patches(3)
    found = uavseg.levels(image, 0.2, detail="12px")
    assert found["pixels"].sum() == image.size
    assert len(found) < len(uavseg.levels(image, 0.2)) / 2


def test_a_range_that_nothing_wide_is_in_says_so() -> None:
    image = np.full((128, 128), 40, np.uint8)
    image[60:64] = 220
    with pytest.warns(UserWarning, match="no region has a mean .* and is 8 pixels wide"):
        assert len(uavseg.extract(image, ALL, detail="8px")) == 0


@pytest.mark.slow
def test_a_block_map_is_refined_with_a_detail_or_refuses(tmp_path: Path) -> None:
    path, blocks = tmp_path / "a.tif", tmp_path / "blocks.tif"
    profile = {"driver": "GTiff", "height": 170, "width": 200, "count": 1, "dtype": "uint8"}
    with rasterio.open(
        path, "w", crs="EPSG:32633", transform=Affine(1, 0, 5e5, 0, -1, 5e6), **profile
    ) as out:
        out.write(patches(1), 1)
    from click.testing import CliRunner

    from uavseg.cli import main

    assert CliRunner().invoke(main, ["divide", str(path), "-o", str(blocks)]).exit_code == 0
    assert (
        uavseg.extract(blocks, ALL, detail=8)
        .drop(columns="source")
        .equals(uavseg.extract(path, ALL, detail=8).drop(columns="source"))
    )
    path.unlink()
    for job in (lambda: uavseg.extract(blocks, ALL, detail=8), lambda: uavseg.levels(blocks, 0.2, detail=8)):
        with pytest.raises(ParameterError, match="regions from this block map end at block edges"):
            job()
    with pytest.raises(ParameterError, match="regions end at block edges"):
        uavseg.extract(blocks, ALL, refine="none", detail=8)


@pytest.mark.slow
@pytest.mark.parametrize("side", [6, 14, 30])
def test_of_color_and_texture_together_tiles_and_threads_change_nothing(tmp_path: Path, side: int) -> None:
    planes, truth = quarters("rows", "meadow", 0.2)
    source = open_raster(str(write(tmp_path / "a.tif", planes)))
    request = MatchRequest(LIKE, detail=Length(side, in_pixels=True))
    whole = match(source, request)
    assert whole.compared == "color and texture"
    assert overlap(painted(whole), truth) > 0.85
    inside = painted(whole).view(np.uint8)
    disc = PixelDisc(side, side)
    assert opening_mask(inside, np.ones_like(inside), disc)[inside > 0].all()
    assert same(whole, match(source, request, Work(64, threads(2))))
