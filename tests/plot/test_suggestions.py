"""Pictures of suggested ranges: colours in their positions."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.colors import to_rgb
from matplotlib.image import imread

from tests.plot.halves import found_in, halves
from uavseg.errors import OutputError, OutputExistsError
from uavseg.plot.suggestions import draw_suggestions, range_colors
from uavseg.raster.spectral.bands import BandScale, ValueAxis


def has(picture: np.ndarray, color: tuple[float, ...]) -> bool:
    return bool((np.abs(picture[..., :3] - color).max(axis=-1) < 0.02).sum() > 500)


@pytest.mark.slow
@pytest.mark.parametrize("with_raster", [True, pytest.param(False, marks=pytest.mark.slow)])
def test_ranges_are_in_their_colours_over_grey(tmp_path: Path, with_raster: bool) -> None:
    found, dataset = found_in(halves())
    path = draw_suggestions(found, tmp_path / "look.png", dataset if with_raster else None)
    picture = imread(path)
    dark, bright = (np.array(to_rgb(color)) for color in range_colors(2))
    assert has(picture, dark) and has(picture, bright)  # bars of the histogram
    assert not has(picture, 0.42 * dark + 0.58)  # nothing is coloured where there are no data
    half = picture[:, : picture.shape[1] // 2]
    assert has(half, 0.42 * dark)  # over black
    assert has(half, 0.42 * bright + 0.58 * 0.9)
    again = draw_suggestions(found, tmp_path / "again.png", dataset if with_raster else None)
    assert again.read_bytes() == path.read_bytes()


@pytest.mark.slow
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


@pytest.mark.slow
def test_a_scale_beyond_floats_has_no_axis_of_values(tmp_path: Path) -> None:
    """A damaged block map may say anything of its scale."""
    found, _ = found_in(halves())
    axis = ValueAxis(0.0, 255.0, BandScale(1e308))
    odd = replace(found, source=replace(found.source, axis=axis))
    with np.errstate(over="ignore"):
        assert draw_suggestions(odd, tmp_path / "odd.png", None).is_file()


@pytest.mark.slow
def test_a_scale_of_one_value_has_no_axis_of_values(tmp_path: Path) -> None:
    """Matplotlib would warn of limits that are the same."""
    found, _ = found_in(halves())
    same = replace(found, source=replace(found.source, axis=ValueAxis(7.0, 7.0, BandScale(1.0))))
    assert draw_suggestions(same, tmp_path / "same.png", None).is_file()
