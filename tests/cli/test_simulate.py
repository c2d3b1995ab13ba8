"""`uavseg simulate`, from the command line to the files."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
from click.testing import CliRunner, Result
from PIL import Image

from uavseg.cli import main
from uavseg.occupancy.ros.ros_map import read_ros_map

SCENE: dict[str, Any] = {
    "map": {"rows": 50, "cols": 70, "cell": 0.05, "origin": [-1, 2]},
    "circles": [{"center": [0.5, 3], "radius": 0.3}],
    "sensor": {"sigma": 0.02, "range": 1.5, "fov": 60, "step": 0.5},
    "poses": [{"at": [-0.5, 3]}, {"at": [0.5, 4], "heading": 270}],
}


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def scene(folder: Path) -> str:
    (folder / "scene.json").write_text(json.dumps(SCENE))
    return "scene.json"


def run(*words: str) -> Result:
    return CliRunner().invoke(main, ["simulate", *words])


def done(*words: str) -> Result:
    result = run(*words)
    assert result.exit_code == 0, result.output
    return result


def read(path: str) -> np.ndarray:
    with rasterio.open(path) as file:
        return np.asarray(file.read())


@pytest.mark.parametrize("name", ["lens", "circles"])
def test_a_map_its_picture_and_its_truth(name: str) -> None:
    told = done(name, "-o", "map.tif", "--png", "map.png", "--truth", "truth.tif").stderr
    with rasterio.open("map.tif") as file:
        assert (file.dtypes, file.shape, file.crs) == (("float32",), (320, 320), None)
        assert file.transform[:6] == pytest.approx((0.01, 0, 0, 0, -0.01, 3.2))
        assert file.tags()["scene"] == name and file.tags()["seed"] == "0"
        p = file.read(1)
    assert p.min() >= 0 and p.max() <= 1
    assert (np.asarray(Image.open("map.png")) == np.floor(255 * p.astype(float) + 0.5)).all()
    with rasterio.open("truth.tif") as file:
        states, solid, visible = file.read()
        assert file.dtypes == ("uint8",) * 3
    assert set(np.unique(states)) == {1, 2, 3}
    assert ((states == 3) == ((solid == 1) & (visible == 1))).all()
    assert ((states == 1) == ((solid == 0) & (visible == 1))).all()
    assert "320 x 320 cells of 0.01 m" in told and "map.tif, map.png, truth.tif" in told


def test_a_ros_map_has_the_states_of_the_map_of_probabilities() -> None:
    done("circles", "-o", "map.tif")
    done("circles", "-o", "map.yaml")
    found = read("map.tif")
    states = np.where(found <= 0.25, 0, np.where(found >= 0.65, 1, 0.5))
    assert np.array_equal(read_ros_map("map.yaml").probabilities, states[0].astype(np.float32))


def test_the_same_seed_writes_the_same_bytes() -> None:
    for name, seed in (("a.tif", "5"), ("b.tif", "5"), ("c.tif", "6")):
        done("lens", "-o", name, "--seed", seed, "-q")
    a, b, c = (Path(name).read_bytes() for name in ("a.tif", "b.tif", "c.tif"))
    assert a == b != c


@pytest.mark.slow
def test_another_process_writes_the_same_bytes(folder: Path) -> None:
    done("circles", "-o", "here.tif", "--png", "here.png", "-q")
    words = ["simulate", "circles", "-o", "there.tif", "--png", "there.png", "-q"]
    subprocess.run([sys.executable, "-m", "uavseg", *words], check=True, cwd=folder)
    assert Path("here.tif").read_bytes() == Path("there.tif").read_bytes()
    assert Path("here.png").read_bytes() == Path("there.png").read_bytes()


def test_a_scene_from_a_file(scene: str) -> None:
    done(scene, "-o", "map.tif", "--truth", "truth.tif")
    with rasterio.open("map.tif") as file:
        assert file.shape == (50, 70) and file.bounds == pytest.approx((-1, 2, 2.5, 4.5))
        p = file.read(1)
    row, col = 30, int((0.2 + 1) / 0.05)  # where the first pose meets the circle
    assert p[row - 1 : row + 1, col : col + 2].max() > 0.9
    assert p[row, col - 10] < 0.2 and p[0, 0] == 0.5


def test_the_sensor_can_be_changed(scene: str) -> None:
    seen = {}
    for name, words in {
        "as it is": [],
        "one pose": ["--poses", "1"],
        "narrow": ["--fov", "20"],
        "short": ["--max-range", "0.5"],
        "sparse": ["--step", "10"],
    }.items():
        done(scene, "-o", "map.tif", "--overwrite", *words)
        seen[name] = int((read("map.tif") != 0.5).sum())
    assert all(seen[name] < seen["as it is"] for name in seen if name != "as it is")
    sharp, wide = (
        done(scene, "-o", f"{sigma}.tif", "--sigma", sigma) and read(f"{sigma}.tif")
        for sigma in ("0.001", "0.1")
    )
    assert (sharp > 0.5).sum() < (wide > 0.5).sum()


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["none.json"], "none.json: there is no such file"),
        (["lens", "--sigma", "-1"], "deviation of ranges is a number above 0, not -1"),
        (["lens", "--max-range", "nan"], "maximum range is a number above 0, not nan"),
        (["lens", "--fov", "400"], "field of view is more than 0 and at most 360 degrees, not 400"),
        (["lens", "--step", "0"], "angular step is a number above 0, not 0"),
        (["lens", "--poses", "9"], "lens has 5 poses, and 9 are asked for"),
        (["lens", "--truth", "map.tif"], "two outputs have the same name"),
        (["lens", "--png", "nowhere/map.png"], "the folder nowhere does not exist"),
        (["lens", "--png", "map.jpg"], "map.jpg: the picture of a map is a PNG; name a .png"),
        (["lens", "--truth", "t.yaml"], "t.yaml: the truth of a scene is written as GeoTIFF; name a .tif"),
        (["lens", "-o", "map.json"], "map.json: a map is written to .yaml for a ROS map, or to .tif"),
        (["lens", "--truth", "there.tif"], "there.tif exists; give --overwrite"),
    ],
)
def test_what_cannot_be_is_reported_in_one_line_and_nothing_is_written(words: list[str], told: str) -> None:
    Path("there.tif").write_text("mine")
    result = run("-o", "map.tif", *words)  # of two -o the last counts
    assert result.exit_code == 1
    assert result.stderr.startswith("uavseg: error: ") and told in result.stderr
    assert result.stderr.count("\n") == 1
    assert [path.name for path in Path().iterdir()] == ["there.tif"]


@pytest.mark.parametrize("words", [["lens"], ["lens", "-o", "m.tif", "--seed", "-1"], ["-o", "m.tif"]])
def test_wrong_words_are_a_usage_error(words: list[str]) -> None:
    assert run(*words).exit_code == 2
    assert not list(Path().iterdir())


def test_quiet_says_nothing() -> None:
    assert done("lens", "-o", "map.tif", "-q").output == ""
