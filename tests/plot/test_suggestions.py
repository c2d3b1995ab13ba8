"""A picture of suggested ranges shows their colours where they are."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from affine import Affine
from matplotlib.colors import to_rgb
from matplotlib.image import imread

from uavseg.errors import OutputError, OutputExistsError
from uavseg.jobs.open_source import Raster
from uavseg.jobs.suggest import Suggestions, suggest
from uavseg.plot.frame import Frame
from uavseg.plot.layers.range_layer import COLORS, RangeLayer, colors_of, spread
from uavseg.plot.suggestions import draw_suggestions
from uavseg.raster.dataset import Dataset
from uavseg.raster.geobox import GeoBox
from uavseg.raster.intensity.stretch import StretchSpec


def raster(image: np.ndarray) -> Dataset:
    return Dataset.of_values(image, GeoBox(image.shape, Affine.identity(), None), "halves.tif")


def halves() -> np.ndarray:
    image = np.full((160, 240), 0.0, np.float32)
    image[:, 120:] = 0.9
    image[:64, :64] = np.nan
    return image


def found_in(image: np.ndarray) -> tuple[Suggestions, Dataset]:
    dataset = raster(image)
    return suggest(Raster(dataset, StretchSpec("none"))), dataset


def has(picture: np.ndarray, color: tuple[float, ...]) -> bool:
    return bool((np.abs(picture[..., :3] - color).max(axis=-1) < 0.02).sum() > 500)


@pytest.mark.parametrize("with_raster", [True, False])
def test_ranges_are_in_their_colours_over_grey(tmp_path: Path, with_raster: bool) -> None:
    found, dataset = found_in(halves())
    path = draw_suggestions(found, tmp_path / "look.png", dataset if with_raster else None)
    picture = imread(path)
    dark, bright = (np.array(to_rgb(color)) for color in colors_of(2))
    assert has(picture, dark) and has(picture, bright)  # bars of the histogram
    assert not has(picture, 0.42 * dark + 0.58)  # nothing is coloured where there are no data
    half = picture[:, : picture.shape[1] // 2]
    assert has(half, 0.42 * dark)  # over black
    assert has(half, 0.42 * bright + 0.58 * 0.9)
    again = draw_suggestions(found, tmp_path / "again.png", dataset if with_raster else None)
    assert again.read_bytes() == path.read_bytes()


def test_one_class_and_flat_rasters_are_drawn_too(tmp_path: Path) -> None:
    for k, shape in enumerate([(70, 70), (1, 3000), (2000, 9)]):
        found, dataset = found_in(np.full(shape, 0.3, np.float32))
        height, width = imread(draw_suggestions(found, tmp_path / f"{k}.png", dataset)).shape[:2]
        assert width == 1600 and 400 < height < 2000


def test_a_picture_is_a_png_and_replaces_nothing(tmp_path: Path) -> None:
    found, _ = found_in(halves())
    with pytest.raises(OutputError, match=r"call it look\.png"):
        draw_suggestions(found, tmp_path / "look.jpg")
    (tmp_path / "look.png").write_text("mine")
    with pytest.raises(OutputExistsError, match="--overwrite"):
        draw_suggestions(found, tmp_path / "look.png")
    assert draw_suggestions(found, tmp_path / "look.png", overwrite=True).stat().st_size > 1000


def test_every_range_has_a_colour_of_its_own() -> None:
    for count in range(1, len(COLORS) + 1):
        assert len(set(colors_of(count))) == count


@pytest.mark.parametrize("most", [10, 100, 5000])
def test_cells_are_spread_over_exactly_the_raster(most: int) -> None:
    box = GeoBox((75, 133), Affine(2, 0, 100, 0, -2, 900), None)
    cells = np.arange(16 * 24, dtype=np.uint8).reshape(16, 24)
    picture, pixels = spread(cells, Frame(box), most)
    assert max(picture.shape) <= max(most, 133) and (most < 133 or picture.shape == box.shape)
    assert np.allclose(pixels * (picture.shape[1], picture.shape[0]), Frame(box).pixels * (133, 75))
    if most > 133:
        assert np.array_equal(picture, cells.repeat(8, 0).repeat(8, 1)[:75, :133])


def test_ranges_of_a_large_raster_are_thinned() -> None:
    found, _ = found_in(halves())
    layer = RangeLayer.of(found.intervals, 2, Frame(replace(found.source.geobox)), 60)
    assert layer.intervals.shape == (40, 60)
    assert set(layer.intervals[:, :30].ravel()) == {0, 1} and set(layer.intervals[:, 30:].ravel()) == {2}
