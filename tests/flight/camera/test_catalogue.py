"""The catalogue: its size and order, names and their neighbours, and cameras in files."""

import json
import math
from pathlib import Path

import pytest
from click.testing import CliRunner

from uavseg.cli import main
from uavseg.errors import ParameterError
from uavseg.flight.camera.camera import camera_named, cameras, find_cameras, read_camera

OWN = {
    "sensor_width_mm": 13.2,
    "sensor_height_mm": 8.8,
    "image_width_px": 5472,
    "image_height_px": 3648,
    "focal_mm": 8.8,
}


def test_there_are_many_cameras_each_once_and_sorted() -> None:
    names = [camera.name for camera in cameras()]
    assert len(names) >= 40 and len(set(names)) == len(names)
    assert names == sorted(names, key=str.lower)


def test_pixels_are_square() -> None:
    for camera in cameras():
        across, along = (mm / px for mm, px in zip(camera.sensor_mm, camera.image_px, strict=True))
        assert abs(across / along - 1) < 0.006, camera.name


@pytest.mark.parametrize(
    ("name", "diagonal_deg"),
    [
        ("DJI Mavic 3 Enterprise", 84),
        ("DJI Mavic 3 Multispectral", 73.9),
        ("DJI Matrice 30", 84),
        ("DJI Zenmuse H20", 82.9),
        ("DJI Zenmuse H30", 82.1),
        ("DJI Zenmuse P1 35 mm", 63.5),
        ("DJI Phantom 4", 94),
        ("DJI Phantom 4 RTK", 84),
        ("DJI Mini 4 Pro", 82.1),
    ],
)
def test_listed_sensors_and_lenses_give_usual_fields_of_view(name: str, diagonal_deg: float) -> None:
    """The angles are not taken from sheets: a size or focal length that is mistyped is seen by them."""
    camera = camera_named(name)
    half = math.hypot(*camera.sensor_mm) / 2 / camera.focal_mm
    assert half == pytest.approx(math.tan(math.radians(diagonal_deg / 2)), rel=0.03)


def test_fields_of_view_are_those_of_lenses_on_drones() -> None:
    for camera in cameras():
        assert 0.3 < camera.sensor_mm[0] / camera.focal_mm < 2.2, camera.name
        assert 0.1 <= camera.min_interval_s <= 3, camera.name


def test_every_camera_is_found_by_its_name_in_any_case() -> None:
    for camera in cameras():
        assert camera_named(camera.name.upper()) == camera
        assert camera in find_cameras(camera.name)


def test_part_of_a_name_serves_if_it_is_clear() -> None:
    assert camera_named("phantom 4 rtk").name == "DJI Phantom 4 RTK"
    with pytest.raises(ParameterError, match=r"several cameras are called phantom: DJI Phantom 3"):
        camera_named("phantom")


def test_the_nearest_names_are_offered() -> None:
    with pytest.raises(ParameterError, match=r"no camera called DJI Mavik 3; .*DJI Mavic 3"):
        camera_named("DJI Mavik 3")
    with pytest.raises(ParameterError, match=r"uavseg cameras lists"):
        camera_named("@@@@")


def test_a_camera_of_one_s_own(tmp_path: Path) -> None:
    path = tmp_path / "own.json"
    path.write_text(json.dumps(OWN))
    assert camera_named(path).name == "own" and camera_named(path).min_interval_s == 0
    path.write_text(json.dumps(OWN | {"name": "Mine", "min_interval_s": 1.5}))
    assert camera_named(path).name == "Mine" and read_camera(path).min_interval_s == 1.5


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[1]", "expected a JSON object"),
        ("{", "cannot be read as a camera"),
        (json.dumps({**OWN, "focus": 1}), "expected a JSON object"),
        (json.dumps({k: v for k, v in OWN.items() if k != "focal_mm"}), "expected a JSON object"),
        (json.dumps({**OWN, "focal_mm": "wide"}), "focal_mm of a camera is a number, not 'wide'"),
        (json.dumps({**OWN, "focal_mm": [1]}), "focal_mm of a camera is a number"),
        (json.dumps({**OWN, "image_width_px": 1e400}), "a whole number of pixels, not inf"),
        (json.dumps({**OWN, "image_width_px": 5472.5}), "a whole number of pixels, not 5472.5"),
        (json.dumps({**OWN, "image_width_px": 10**350}), "image_width_px of a camera is too large"),
        (json.dumps({**OWN, "image_width_px": True}), "image_width_px of a camera is a number, not True"),
        (json.dumps({**OWN, "focal_mm": 1e300}), "at most 1e.07, not .*1e.300"),
        (json.dumps({**OWN, "min_interval_s": 1e300}), "is 0 to 1e.07 s, not 1e.300"),
        (json.dumps({**OWN, "name": ["a"]}), "name of a camera is a word, not \\['a'\\]"),
        ("[" * 5000, "cannot be read as a camera"),
        (" " * 200_000, "too much"),
    ],
)
def test_a_file_that_is_no_camera_is_refused(tmp_path: Path, text: str, words: str) -> None:
    path = tmp_path / "bad.json"
    path.write_text(text)
    with pytest.raises(ParameterError, match=words):
        camera_named(path)


def test_the_command_writes_cameras_as_files_have_them(tmp_path: Path) -> None:
    listed = CliRunner().invoke(main, ["cameras", "phantom", "--json"])
    entries = json.loads(listed.output)
    assert len(entries) == len(find_cameras("phantom")) > 3
    for entry in entries:
        (tmp_path / "own.json").write_text(json.dumps(entry))
        assert read_camera(tmp_path / "own.json") == camera_named(entry["name"])
