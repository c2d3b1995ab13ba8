"""`uavseg next-view` and `uavseg explore`: what they write, and what they refuse."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result
from PIL import Image

import uavseg
from uavseg.cli import main
from uavseg.occupancy.map_file import write_map
from uavseg.raster.grid.geobox import local_geobox


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    p = np.full((60, 80), 0.5, np.float32)  # a room of 4 m x 5 m, known but for its door and one corner
    p[10:50, 10:60] = 0.1
    p[9, 9:61] = p[50, 9:61] = p[9:51, 9] = p[9:51, 60] = 0.9
    p[25:35, 60] = 0.1
    p[9:18, 9:20] = 0.5
    write_map("room.yaml", p, local_geobox(p.shape, 0.1, (0.0, 0.0)))


def run(*arguments: object) -> Result:
    return CliRunner().invoke(main, [*map(str, arguments)])


def test_views_are_ranked_and_their_ways_begin_at_the_pose() -> None:
    result = run("next-view", "room.yaml", "--pose", "3,3", "--range", 4, "-o", "views.geojson")
    assert result.exit_code == 0, result.output
    features = json.loads(Path("views.geojson").read_text())["features"]
    views = [one for one in features if "view" in one["properties"]]
    ways = [one for one in features if "way_to" in one["properties"]]
    assert [one["properties"]["view"] for one in views] == [*range(1, len(views) + 1)]
    scores = [one["properties"]["score"] for one in views]
    assert scores[0] == 1.0 and all(0 < score <= 1 for score in scores)
    assert all(one["properties"]["gain_bits"] > 0 for one in views)
    for view, way in zip(views, ways, strict=True):
        line = np.array(way["geometry"]["coordinates"])
        assert np.allclose(line[0], (3.05, 2.95)) and np.allclose(line[-1], view["geometry"]["coordinates"])
        length = np.hypot(*np.diff(line, axis=0).T).sum()
        assert way["properties"]["length_m"] == pytest.approx(length)
        assert view["properties"]["distance_m"] == pytest.approx(length, abs=1e-6)
    assert "score 1.00" in result.stderr


def test_a_known_map_has_no_next_view_and_says_so() -> None:
    p = np.full((40, 40), 0.9, np.float32)
    p[5:35, 5:35] = 0.1
    write_map("known.yaml", p, local_geobox(p.shape, 0.1, (0.0, 0.0)))
    result = run("next-view", "known.yaml", "--pose", "2,2", "--range", 3, "-o", "-")
    assert result.exit_code == 0 and json.loads(result.stdout)["features"] == []
    assert "there is no next view" in result.stderr


@pytest.mark.parametrize(
    ("pose", "reason"),
    [("7.5,3", "is unknown"), ("3,1", "is occupied"), ("30,3", "outside of the map"), ("3", "two or three")],
)
def test_where_no_robot_stands_is_refused(pose: str, reason: str) -> None:
    result = run("next-view", "room.yaml", "--pose", pose, "--range", 4, "-o", "views.geojson")
    assert result.exit_code == 1 and reason in result.stderr and len(result.stderr.splitlines()) == 1
    assert not Path("views.geojson").exists()


def test_a_live_grid_has_views() -> None:
    grid = uavseg.OccupancyGrid.empty((64, 64), cell_m=0.1)
    grid.merge(uavseg.Scan(uavseg.Pose(3.2, 3.2), np.linspace(0, 6, 200), np.full(200, np.inf), 1.5, 0.03))
    found = uavseg.next_views(grid, (3.2, 3.2), 1.5)
    assert found.views and found.views[0].score == 1.0


@pytest.mark.slow
def test_a_drive_writes_all_that_is_asked_for() -> None:
    line = ["explore", "lens", "--range", 1, "--step", 2, "-o", "drive.geojson", "--table", "drive.csv"]
    line += ["--map", "map.tif", "--animation", "drive.gif"]
    result = run(*line)
    assert result.exit_code == 0, result.output
    features = json.loads(Path("drive.geojson").read_text())["features"]
    with Path("drive.csv").open() as file:
        rows = list(csv.DictReader(file))
    about = features[0]["properties"]
    assert about["known"] > 0.99 and about["scans"] == len(rows)
    assert float(rows[-1]["driven_m"]) == pytest.approx(about["length_m"])
    known = [int(row["known_cells"]) for row in rows]
    assert known[-1] > 2 * known[0]
    assert np.diff(known).min() > -5  # what speaks for and against a cell may cancel out
    with Image.open("drive.gif") as picture:
        assert 20 < picture.n_frames <= 151
    assert run("info", "map.tif").exit_code == 0
    again = run(*line)
    assert again.exit_code == 1 and "exists" in again.stderr


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (["lens", "-o", "drive.txt"], "is written to .geojson"),
        (["lens", "-o", "d.geojson", "--animation", "d.mp4"], "is written to .gif"),
        (["room.yaml", "-o", "d.geojson", "--start", "3,3"], "say how far it sees"),
        (["room.yaml", "-o", "d.geojson", "--range", "3"], "--start"),
        (["room.yaml", "-o", "d.geojson", "--range", "3", "--start", "3,1"], "inside something solid"),
    ],
)
def test_bad_input_of_a_drive(words: list[str], reason: str) -> None:
    result = run("explore", *words)
    assert result.exit_code == 1 and reason in result.stderr
    assert len(result.stderr.splitlines()) == 1 and sorted(path.suffix for path in Path().iterdir()) == [
        ".pgm",
        ".yaml",
    ]
