"""What `match` compares by default: color, texture within what has the color, or texture alone."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import rasterio
from affine import Affine
from numpy.typing import NDArray

import uavseg
from tests.jobs.test_match import texture
from uavseg.execution.executors import threads
from uavseg.jobs.match.match import Match, match
from uavseg.jobs.match.request import MatchRequest
from uavseg.jobs.source.open_source import open_raster
from uavseg.jobs.source.work import Work
from uavseg.raster.grid.tiling import Window
from uavseg.regions.outline.rings import rasterise
from uavseg.regions.sample.place import Disc

Mask = NDArray[np.bool_]
SHAPE = (256, 320)
WHERE = Affine(1, 0, 1000, 0, -1, 1000)
LIKE = Disc(1070, 930, 45)


def write(path: Path, planes: NDArray[np.uint8]) -> Path:
    profile = {"driver": "GTiff", "count": len(planes), "height": SHAPE[0], "width": SHAPE[1]}
    with rasterio.open(path, "w", **profile, dtype="uint8", crs="EPSG:32633", transform=WHERE) as file:
        file.write(planes)
    return path


def quarters(wanted: str, other: str, hue: float, seed: int = 0) -> tuple[NDArray[np.uint8], Mask]:
    """Above, two textures of one hue; below the same two of another hue. The first is what is wanted."""
    rng = np.random.default_rng(seed)
    left = np.indices(SHAPE)[1] < 160
    above = np.indices(SHAPE)[0] < 136
    grey = np.where(left, texture(wanted, rng, SHAPE), texture(other, rng, SHAPE))
    planes = [grey + np.where(above, 0, hue * way) + rng.normal(0, 0.02, SHAPE) for way in (1, -0.4, -0.6)]
    return np.rint(255 * np.clip(planes, 0, 1)).astype(np.uint8), left & above


def painted(made: Match) -> Mask:
    return rasterise(made.found.rings, Window(0, 0, *SHAPE)) > 0


def overlap(one: Mask, other: Mask) -> float:
    return float((one & other).sum() / (one | other).sum())


def same(one: Match, other: Match) -> bool:
    first, second = (made.found.regions.columns for made in (one, other))
    values = all(repr(first[name].tolist()) == repr(second[name].tolist()) for name in first)
    return values and list(first) == list(second) and bool((painted(one) == painted(other)).all())


@pytest.mark.slow
@pytest.mark.parametrize(("wanted", "other"), [("rows", "meadow"), ("meadow", "rows"), ("forest", "sand")])
def test_of_what_has_the_color_texture_decides(tmp_path: Path, wanted: str, other: str) -> None:
    planes, truth = quarters(wanted, other, 0.2)
    source = open_raster(str(write(tmp_path / "a.tif", planes)))
    both, color, alone = (match(source, MatchRequest(LIKE, by=by)) for by in ("auto", "color", "texture"))
    assert both.compared == "color and texture"
    assert not (painted(both) & ~painted(color)).any()
    assert overlap(painted(both), truth) > 0.9
    assert max(overlap(painted(color), truth), overlap(painted(alone), truth)) < 0.7


@pytest.mark.slow
def test_where_color_says_little_it_is_texture_alone(tmp_path: Path) -> None:
    planes, _ = quarters("rows", "meadow", 0)
    source = open_raster(str(write(tmp_path / "a.tif", planes)))
    made, alone = match(source, MatchRequest(LIKE)), match(source, MatchRequest(LIKE, by="texture"))
    assert made.compared == "texture"
    assert same(made, alone)


@pytest.mark.slow
def test_where_texture_parts_nothing_it_is_color_alone(tmp_path: Path) -> None:
    planes, truth = quarters("sand", "sand", 0.2)
    source = open_raster(str(write(tmp_path / "a.tif", planes)))
    made, alone = match(source, MatchRequest(LIKE)), match(source, MatchRequest(LIKE, by="color"))
    assert made.compared == "color"
    assert same(made, alone)
    rows = np.indices(SHAPE)[0] < 136
    assert overlap(painted(made), rows) > 0.9 and truth.any()


def test_words_of_texture_compare_texture(tmp_path: Path) -> None:
    source = open_raster(str(write(tmp_path / "a.tif", quarters("rows", "meadow", 0.2)[0])))
    made = match(source, MatchRequest(LIKE, window=24))
    assert made.compared == "texture" and made.texture is not None and made.texture.window == 24


@pytest.mark.slow
def test_a_sample_too_small_for_texture_is_compared_by_color_and_a_warning_says_so(tmp_path: Path) -> None:
    path = write(tmp_path / "a.tif", quarters("rows", "meadow", 0)[0])
    with pytest.warns(UserWarning, match="too small to tell by its texture"):
        regions = uavseg.match(path, (1070, 930, 10))
    assert regions.attrs["uavseg"]["by"] == "color"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("radius", "compared"), [(16, "texture"), pytest.param(24, "texture", marks=pytest.mark.slow)]
)
def test_a_radius_of_16_pixels_is_enough_where_texture_is_clear(
    tmp_path: Path, radius: float, compared: str
) -> None:
    planes, truth = quarters("rows", "meadow", 0)
    made = match(open_raster(str(write(tmp_path / "a.tif", planes))), MatchRequest(Disc(1070, 930, radius)))
    assert made.compared == compared
    assert overlap(painted(made), np.indices(SHAPE)[1] < 160) > 0.9 and truth.any()


@pytest.mark.slow
@pytest.mark.parametrize("refine", ["pixel", "none"])
def test_tiles_and_threads_change_nothing(tmp_path: Path, refine: str) -> None:
    planes, _ = quarters("rows", "meadow", 0.2)
    planes[:, 100:110, 40:60] = 0
    request = replace(MatchRequest(LIKE), refine=refine)
    source = open_raster(str(write(tmp_path / "a.tif", planes)))
    whole, parts = match(source, request), match(source, request, Work(64, threads(2)))
    assert whole.compared == parts.compared == "color and texture"
    assert same(whole, parts)
