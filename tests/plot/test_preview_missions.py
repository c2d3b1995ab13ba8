"""Previews of missions alone: any format gives a picture, in colours of its own, or one clear error."""

import warnings
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from tests.plot.pictures import a_mission, colored
from uavseg.errors import MissionError, OutputError, OutputExistsError, ParameterError, RasterReadError
from uavseg.flight.formats import files
from uavseg.plot.layers.mission_layer import FLIGHT_COLORS
from uavseg.plot.preview_missions import preview_missions

SQUARE = [(-76.5, 44.2), (-76.498, 44.2), (-76.498, 44.201), (-76.5, 44.201)]


def has_color(path: Path, color: str) -> bool:
    rgb = np.array([int(color[k : k + 2], 16) for k in (1, 3, 5)])
    image = np.asarray(Image.open(path).convert("RGB")).astype(int)
    return bool((np.abs(image - rgb).max(axis=2) < 12).sum() > 30)


@pytest.mark.parametrize("suffix", [*files.FORMATS])
def test_any_format_gives_a_picture(suffix: str, tmp_path: Path) -> None:
    path = tmp_path / f"fly{suffix}"
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of formats without home
        files.write_mission(a_mission(SQUARE), path)
        out = preview_missions(path, tmp_path / "fly.png", width_px=500)
    with Image.open(out) as picture:
        assert picture.size[0] == 500
    assert 0.002 < colored(out).mean() < 0.2


@pytest.mark.slow
def test_several_flights_have_different_colors(tmp_path: Path) -> None:
    east = [(lon + 0.004, lat) for lon, lat in SQUARE]
    out = preview_missions([a_mission(SQUARE), a_mission(east)], tmp_path / "two.png")
    one = preview_missions(a_mission(SQUARE), tmp_path / "one.png")
    assert has_color(out, FLIGHT_COLORS[0]) and has_color(out, FLIGHT_COLORS[1])
    assert has_color(one, FLIGHT_COLORS[0]) and not has_color(one, FLIGHT_COLORS[1])


@pytest.mark.slow
def test_equal_missions_give_equal_bytes_wherever_they_come_from(tmp_path: Path) -> None:
    files.write_mission(a_mission(SQUARE), tmp_path / "flight 1.plan")
    pictures = [
        preview_missions(given, tmp_path / f"{n}.png", width_px=300).read_bytes()
        for n, given in enumerate((a_mission(SQUARE), [a_mission(SQUARE)], tmp_path / "flight 1.plan"))
    ]
    assert pictures[0] == pictures[1] == pictures[2]


@pytest.mark.parametrize(
    "lonlats",
    [
        [(179.9999, 10), (-179.9995, 10.001)],
        pytest.param([(8, 89.999), (9, 89.9995)], marks=pytest.mark.slow),
        [(1, 0.0)],
    ],
)
def test_any_place_on_earth_gives_a_picture(lonlats: list[tuple[float, float]], tmp_path: Path) -> None:
    out = preview_missions(a_mission(lonlats), tmp_path / "a.png", width_px=400)
    with Image.open(out) as picture:
        assert picture.size[0] == 400 and picture.size[1] < 800
    assert colored(out).any()


def test_home_that_is_not_in_a_file_is_reported(tmp_path: Path) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        files.write_mission(a_mission(SQUARE), tmp_path / "fly.csv")
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        preview_missions(tmp_path / "fly.csv", tmp_path / "fly.png", width_px=300)
    assert any("does not hold home" in str(one.message) for one in caught)


def test_faults_are_reported_before_anything_is_written(tmp_path: Path) -> None:
    flight, out = a_mission(SQUARE), tmp_path / "out.png"
    (tmp_path / "there.png").write_text("mine")
    (tmp_path / "dem.tif").write_text("mine")
    for wrong, arguments, more in [
        (OutputExistsError, (flight, tmp_path / "there.png"), {}),
        (OutputError, (flight, tmp_path / "out.jpg"), {}),
        (ParameterError, (flight, out), {"width_px": 20}),
        (MissionError, (tmp_path / "missing.plan", out), {}),
        (MissionError, ([], out), {}),
        (RasterReadError, (flight, out), {"dem": tmp_path / "dem.tif"}),
    ]:
        with pytest.raises(wrong) as caught:
            preview_missions(*arguments, **more)  # type: ignore[arg-type]
        assert "\n" not in str(caught.value) and len(str(caught.value)) > 20
        assert not out.exists() and (tmp_path / "there.png").read_text() == "mine"
