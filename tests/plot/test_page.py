"""Pages: equal units in x and y, everything in view, one kind of file."""

from pathlib import Path

import matplotlib
import pytest
from affine import Affine
from hypothesis import given, settings, strategies as st

from tests.plot.pictures import UTM
from uavseg.errors import OutputError, OutputExistsError
from uavseg.plot.page.page import check_png_target, fit_axes, new_figure, raster_caption, save_figure
from uavseg.raster.grid.geobox import GeoBox

LENGTHS = st.floats(0.1, 1e5)


@pytest.mark.slow
@settings(max_examples=40)
@given(st.floats(-1e4, 1e4), st.floats(-1e4, 1e4), LENGTHS, LENGTHS, st.floats(1, 12), st.floats(1, 12))
def test_a_view_is_shown_whole_with_equal_units(
    x: float, y: float, across: float, up: float, width: float, height: float
) -> None:
    ax = new_figure(width, height, 72).add_axes((0, 0, 1, 1))
    point = fit_axes(ax, (x, x + across, y, y + up), width, height)
    (left, right), (bottom, top) = ax.get_xlim(), ax.get_ylim()
    slack = 1e-6 * (across + up)
    assert left <= x + slack and x + across <= right + slack and bottom <= y + slack and y + up <= top + slack
    assert (right - left) / width == pytest.approx(72 * point) == pytest.approx((top - bottom) / height)
    assert right - left == pytest.approx(across) or top - bottom == pytest.approx(up)  # and no larger


def test_equal_pages_are_equal_files(tmp_path: Path) -> None:
    for name in ("a.png", "b.png"):
        figure = new_figure(2, 1, 50)
        figure.text(0.1, 0.5, "one")
        save_figure(figure, tmp_path / name)
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()


def test_a_picture_is_a_new_png(tmp_path: Path) -> None:
    assert check_png_target(tmp_path / "a.PNG", False) == tmp_path / "a.PNG"
    with pytest.raises(OutputError, match=r"call it a\.png, not a\.jpg"):
        check_png_target(tmp_path / "a.jpg", False)
    (tmp_path / "a.png").write_text("mine")
    with pytest.raises(OutputExistsError):
        check_png_target(tmp_path / "a.png", False)
    assert check_png_target(tmp_path / "a.png", True) == tmp_path / "a.png"


def test_a_caption_has_size_crs_resolution_bands_and_grey() -> None:
    box = GeoBox((50, 60), Affine(2, 0, 4e5, 0, -2, 5e6), UTM)
    assert (
        raster_caption(box, "band 1", "grey: dtype")
        == "60 x 50 pixels · EPSG:32618 · 2 m/pixel · band 1 · grey: dtype"
    )
    local = GeoBox((50, 60), Affine(2, 0, 0, 0, -2, 0), None)
    assert "no coordinate reference system" in raster_caption(local, "band 1", "grey: dtype")
    assert raster_caption(local, "band 1", "grey: \ud800").endswith("grey: \\ud800")


def test_settings_of_the_caller_change_no_layout(tmp_path: Path) -> None:

    pictures = []
    for constrained in (False, True):
        with matplotlib.rc_context({"figure.constrained_layout.use": constrained}):
            figure = new_figure(3.0, 2.0, 50)
            figure.add_axes((0.3, 0.3, 0.5, 0.5))
            save_figure(figure, tmp_path / f"{constrained}.png")
        pictures.append((tmp_path / f"{constrained}.png").read_bytes())
    assert pictures[0] == pictures[1]
