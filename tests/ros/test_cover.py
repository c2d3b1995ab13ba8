"""Coverage of regions by the ROS package: lines, legs, and the share of the area that is said."""

import csv
import json
import math
import re
import subprocess
import sys
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
import yaml
from affine import Affine
from hypothesis import given, settings, strategies as st
from numpy.typing import NDArray
from uavseg_ros import free_space
from uavseg_ros.cover import command, cover

import uavseg
from tests.ros.robots import (
    CLOSET,
    REGIONS,
    SIDE,
    away,
    box,
    invoke,
    map_file,
    placed,
    polygon,
    regions_file,
    rooms,
)
from tests.ros.test_maps import real_map
from uavseg.raster.grid.geobox import GeoBox

RADIUS, WIDTH = 0.15, 0.3
WHOLE = {1: box(0.0, 0.0, 6.4, 3.2)}
EAST = {5: box(3.2, 0.2, 6.2, 3.0)}
Numbers = NDArray[np.float64]


def covered(
    folder: Path, rings: dict[int, Any], *words: Any, origin: tuple[float, float, float] = (0, 0, 0)
) -> tuple[Numbers, list[str], str]:
    """Waypoints (n, 2), the n - 1 parts between them, "line" or "leg", and what was printed."""
    map_, out = map_file(folder, rooms(), origin), folder / "path.csv"
    regions = regions_file(folder, rings, placed(origin))
    given = regions, "--map", map_, "--radius", RADIUS, "--width", WIDTH, "-o", out, "--overwrite"
    ran = invoke(command, *given, *words)
    assert ran.exit_code == 0, ran.output
    return *table(out), ran.stderr


def table(path: Path) -> tuple[Numbers, list[str]]:
    rows = list(csv.DictReader(path.read_text().splitlines()))
    assert rows[-1]["part"] == ""
    return np.array([[float(row["x"]), float(row["y"])] for row in rows]), [row["part"] for row in rows[:-1]]


def legs_of(xy: Numbers, parts: list[str], kind: str | None = None) -> Numbers:
    chosen = [k for k, part in enumerate(parts) if kind in (None, part)]
    return np.stack([xy[:-1], xy[1:]], axis=1)[chosen]


def plain_share(
    cells: NDArray[np.int8], rings: dict[int, Any], lines: Numbers, width: float = WIDTH
) -> float:
    """The share of the free cells with their centre in rings that lie within half a width of lines."""
    rows, cols = np.nonzero(cells == 0)
    centres = shapely.points((np.stack([cols, rows], axis=1) + 0.5) * SIDE)
    centres = centres[shapely.intersects(shapely.union_all([*map(polygon, rings.values())]), centres)]
    away_m = shapely.distance(shapely.multilinestrings(shapely.linestrings(lines)), centres)
    return float((away_m <= width / 2 + 1e-9).mean())


@pytest.mark.slow
@pytest.mark.parametrize("rings", [WHOLE, EAST, REGIONS])
@pytest.mark.parametrize("heading", [[], ["--heading", 30]])
def test_all_of_the_way_keeps_the_radius_and_lines_stay_in_the_region(
    tmp_path: Path, rings: dict[int, Any], heading: list[Any]
) -> None:
    xy, parts, _ = covered(tmp_path, rings, *heading)
    assert away(legs_of(xy, parts), rooms()) >= RADIUS - 1e-9
    inside = shapely.buffer(shapely.union_all([*map(polygon, rings.values())]), 1e-6)
    assert shapely.covers(inside, shapely.linestrings(legs_of(xy, parts, "line"))).all()


@pytest.mark.slow
@pytest.mark.parametrize("rings", [WHOLE, EAST, REGIONS])
@pytest.mark.parametrize("heading", [[], ["--heading", 30]])
def test_the_share_that_is_said_is_counted_cell_by_cell(
    tmp_path: Path, rings: dict[int, Any], heading: list[Any]
) -> None:
    xy, parts, said = covered(tmp_path, rings, *heading)
    found = re.search(r"covered +([\d.]+) % of ([\d.]+) m2 of free area, ([\d.]+) % with the legs", said)
    assert found
    lines, area, all_ = map(float, found.groups())
    assert lines == pytest.approx(100 * plain_share(rooms(), rings, legs_of(xy, parts, "line")), abs=0.06)
    assert all_ == pytest.approx(100 * plain_share(rooms(), rings, legs_of(xy, parts)), abs=0.06)
    free = np.argwhere(rooms() == 0)[:, ::-1] * SIDE + SIDE / 2
    inside = shapely.contains_xy(shapely.union_all([*map(polygon, rings.values())]), *free.T)
    assert area == pytest.approx(inside.sum() * SIDE**2, abs=0.06)
    for number, share in re.findall(r"^    (\d+) +([\d.]+) % of", said, re.MULTILINE):
        ring = {int(number): rings[int(number)]}
        assert float(share) == pytest.approx(
            100 * plain_share(rooms(), ring, legs_of(xy, parts, "line")), abs=0.06
        )


def test_an_open_rectangle_is_covered_whole_by_as_few_lines_as_it_is_high(tmp_path: Path) -> None:
    cells = np.zeros((100, 100), np.int8)
    map_, out = map_file(tmp_path, cells), tmp_path / "path.csv"
    rings = {1: box(1, 1, 4, 2.2)}
    words = "--map", map_, "--radius", 0.2, "--width", 0.4, "-o", out
    ran = invoke(command, regions_file(tmp_path, rings), *words)
    assert ran.exit_code == 0, ran.output
    xy, parts = table(out)
    assert plain_share(cells, rings, legs_of(xy, parts, "line"), 0.4) == 1
    assert parts == ["line", "leg", "line", "leg", "line"]
    assert "covered     100.0 % of 3.6 m2" in ran.stderr and "heading" not in ran.stderr
    np.testing.assert_allclose(np.diff(xy[::2, 1]), xy[2, 1] - xy[0, 1], atol=1e-6)
    assert len(np.unique(xy[:, 1].round(6))) == 3


def test_a_room_with_walls_is_covered_up_to_the_corners(tmp_path: Path) -> None:
    cells = np.full((60, 80), 100, np.int8)
    cells[10:50, 10:70] = 0  # 2 x 3 m
    map_, out = map_file(tmp_path, cells), tmp_path / "path.csv"
    words = "--map", map_, "--radius", 0.2, "--width", 0.5, "-o", out
    ran = invoke(command, regions_file(tmp_path, {1: box(0, 0, 4, 3)}), *words)
    assert ran.exit_code == 0, ran.output
    xy, parts = table(out)
    assert plain_share(cells, {1: box(0, 0, 4, 3)}, legs_of(xy, parts, "line"), 0.5) > 0.98
    lengths = np.diff(legs_of(xy, parts, "line"), axis=1)[:, 0]
    assert (np.abs(lengths[:, 0]) > 2).sum() == 4  # 2 m of 0.5 m each
    assert len(lengths) == 6  # with one along each end


@pytest.mark.slow
@pytest.mark.parametrize("heading", [0, 30, 90, 135.5])
def test_lines_have_the_heading_or_fill_across_it(tmp_path: Path, heading: float) -> None:
    for origin in ((0.0, 0.0, 0.0), (2.0, -3.0, 0.6)):
        xy, parts, said = covered(tmp_path, EAST, "--heading", heading, origin=origin)
        steps = np.diff(legs_of(xy, parts, "line"), axis=1)[:, 0]
        turned = np.degrees(np.arctan2(steps[:, 1], steps[:, 0])) - heading
        lengths = np.hypot(*steps.T)
        across = np.abs((turned + 45) % 90 - 45)
        assert across[lengths > 0.01].max() < 0.01
        along = np.abs((turned + 90) % 180 - 90) < 0.01
        assert lengths[along].sum() > 0.6 * lengths.sum()
        assert f", {heading:g} degrees" in said


@pytest.mark.slow
def test_the_same_bytes_twice_and_the_same_path_on_a_moved_map(tmp_path: Path) -> None:
    xy, parts, said = covered(tmp_path, EAST)
    before = (tmp_path / "path.csv").read_bytes()
    covered(tmp_path, EAST)
    assert (tmp_path / "path.csv").read_bytes() == before
    for origin in ((100.0, -40.0, 0.0), (-3.5, 12.25, 0.7)):
        moved, same, again = covered(tmp_path, EAST, origin=origin)
        np.testing.assert_allclose(moved, placed(origin)(xy), atol=1e-6)
        assert same == parts
        assert re.findall("covered.*", again) == re.findall("covered.*", said)


@pytest.mark.slow
def test_the_path_begins_where_the_robot_is(tmp_path: Path) -> None:
    xy, parts, _ = covered(tmp_path, EAST, "--start", "0.52,2.4")
    assert xy[0].tolist() == [0.52, 2.4] and parts[0] == "leg"
    assert away(legs_of(xy, parts), rooms()) >= RADIUS - 1e-9
    free, _, _ = covered(tmp_path, EAST)
    assert shapely.contains_xy(polygon(EAST[5]), *free[0])


@pytest.mark.slow
def test_waypoints_are_those_of_the_table_in_the_format_of_uavseg_path(tmp_path: Path) -> None:
    xy, parts, _ = covered(tmp_path, EAST)
    rows = list(csv.DictReader((tmp_path / "path.csv").read_text().splitlines()))
    out = tmp_path / "path.yaml"
    words = "--map", tmp_path / "map.yaml", "--radius", RADIUS, "--width", WIDTH, "-o"
    assert invoke(command, tmp_path / "regions.geojson", *words, out).exit_code == 0
    waypoints = yaml.safe_load(out.read_text())["waypoints"]
    assert list(waypoints) == [f"waypoint{k}" for k in range(len(xy))]
    for pose, place, row in zip(waypoints.values(), xy, rows, strict=True):
        assert pose["pose"] == pytest.approx([*place, 0.0], abs=1e-8)
        w, _, _, z = pose["orientation"]
        turn = math.radians(float(row["heading_deg"])) - 2 * math.atan2(z, w)
        assert math.cos(turn) == pytest.approx(1, abs=1e-9)
    geojson = tmp_path / "path.geojson"
    assert invoke(command, tmp_path / "regions.geojson", *words, geojson).exit_code == 0
    features = json.loads(geojson.read_text())["features"]
    assert [one["properties"]["number"] for one in features] == list(range(1, len(features) + 1))
    drawn = [one["geometry"]["coordinates"] for one in features]
    assert all(one[-1] == other[0] for one, other in pairwise(drawn))
    assert [drawn[0][0], *(place for line in drawn for place in line[1:])] == xy.tolist()
    lines = sum(one["properties"]["part"] == "line" for one in features)
    assert lines == parts.count("line")


@pytest.mark.slow
def test_no_waypoint_comes_twice_in_a_row(tmp_path: Path) -> None:
    for rings in (WHOLE, EAST, REGIONS):
        xy, _, _ = covered(tmp_path, rings)
        assert np.hypot(*np.diff(xy, axis=0).T).min() > 0


@st.composite
def drawn_rooms(draw: st.DrawFn) -> NDArray[np.int8]:
    cells = np.zeros((40, 56), np.int8)
    for _ in range(draw(st.integers(0, 6))):
        row, col = draw(st.integers(0, 38)), draw(st.integers(0, 54))
        cells[row : row + draw(st.integers(1, 12)), col : col + draw(st.integers(1, 12))] = 100
    return cells


@pytest.mark.slow
@settings(deadline=None, max_examples=15)
@given(drawn_rooms(), st.sampled_from([0.06, 0.2]), st.sampled_from([0.2, 0.35, 0.6]), st.integers(0, 179))
def test_what_can_be_reached_is_covered_on_drawn_maps(
    cells: NDArray[np.int8], radius: float, width: float, heading: int
) -> None:
    space = space_of(cells, radius)
    region = free_space.MapRegion(1, None, (slice(None), slice(None)), np.ones(cells.shape, bool))
    if not space.drivable.any():
        return
    found = cover(space, [region], width, heading_deg=heading)
    swept = found.sweep
    lines = np.stack([swept.path[:-1], swept.path[1:]], axis=1)[:, :, ::-1]
    lines[..., 1] = cells.shape[0] - lines[..., 1]
    assert away(lines * SIDE, cells) >= radius - 1e-9
    assert swept.by_lines.sum() >= 0.9 * swept.reachable.sum()
    assert (swept.by_path | ~swept.by_lines).all()
    places = np.argwhere(space.parts == free_space.main_part(space, [region]))
    gaps = np.hypot(*(np.argwhere(cells[::-1] == 0)[:, None] - places[None]).transpose(2, 0, 1)).min(axis=1)
    assert swept.reachable.sum() == (gaps * SIDE <= width / 2 + 1e-9).sum()


def space_of(cells: NDArray[np.int8], radius: float) -> free_space.FreeSpace:
    box_ = uavseg.Dataset.of_values  # noqa: F841

    geobox = GeoBox(cells.shape, Affine(SIDE, 0, 0, 0, -SIDE, cells.shape[0] * SIDE), None)
    return free_space.FreeSpace("the map", geobox, SIDE, radius, cells[::-1] == 0)


@given(st.data())
def test_runs_are_those_that_dense_samples_find(data: st.DataObject) -> None:
    seed = data.draw(st.integers(0, 10**6))
    random = np.random.default_rng(seed)
    mask = random.random((7, 9)) < 0.7
    start, end = random.uniform(-1, 8, 2), random.uniform(-1, 10, 2)
    t = np.linspace(0, 1, 4001)
    cells = np.floor(start + t[:, None] * (end - start)).astype(int)
    inside = np.zeros(len(t), bool)
    known = ((cells >= 0) & (cells < mask.shape)).all(axis=1)
    inside[known] = mask[tuple(cells[known].T)]
    runs = free_space.runs_over(mask, start, end)
    length2 = (end - start) @ (end - start)
    for begin, stop in runs:
        a, b = ((place - start) @ (end - start) / length2 for place in (begin, stop))
        assert 0 <= a <= b <= 1
        assert inside[(t > a) & (t < b)].all()
    changes = np.flatnonzero(np.diff(inside.astype(int)))
    if len(changes) < 2 or np.diff(changes).min() > 5:  # no cell that samples may miss
        assert len(runs) == (np.diff(np.concatenate([[0], inside, [0]]).astype(int)) > 0).sum()


@pytest.mark.slow
def test_a_region_without_a_way_is_refused_or_left_out_and_said(tmp_path: Path) -> None:
    map_, out = map_file(tmp_path, rooms()), tmp_path / "path.yaml"
    regions = regions_file(tmp_path, REGIONS | {9: CLOSET})
    words = regions, "--map", map_, "--radius", 0.1, "--width", 0.3, "-o", out
    ran = invoke(command, *words)
    assert ran.exit_code == 1 and not out.exists()
    assert "uavseg: error: no path leads to region 9 with a radius of 0.1 m (with none)" in ran.stderr
    ran = invoke(command, *words, "--allow-unreachable")
    assert ran.exit_code == 0 and "warning: no path leads to region 9" in ran.stderr
    assert out.exists()
    ran = invoke(command, *words, "--ids", 9, "--overwrite")  # alone it is where the robot is
    assert ran.exit_code == 0, ran.output
    ran = invoke(command, *words, "--ids", 9, "--overwrite", "--start", "0.5,2.5")
    assert ran.exit_code == 1 and "no path leads to region 9" in ran.stderr


@pytest.mark.parametrize("ring", [box(2.5, 1.0, 2.55, 1.05), box(2.5, 0.5, 2.55, 1.5)])
def test_a_region_of_a_few_cells_is_covered_too(tmp_path: Path, ring: Any) -> None:
    for heading in (0, 45):
        xy, parts, said = covered(tmp_path, {1: ring}, "--heading", heading)
        assert "covered     100.0 %" in said
        assert plain_share(rooms(), {1: ring}, legs_of(xy, parts, "line")) == 1


@pytest.mark.slow
def test_a_part_of_a_region_without_a_way_is_said(tmp_path: Path) -> None:
    _, _, said = covered(tmp_path, WHOLE)
    found = re.search(r"warning: no path leads to ([\d.]+) m2 of the regions, over which the robot", said)
    assert found and 0.05 < float(found[1]) < 0.5
    _, _, said = covered(tmp_path, EAST, "--ids", 5)
    assert re.search(r"no reach +[\d.]+ m2 along walls", said)


@pytest.mark.slow
def test_coverage_of_a_real_map(shared_data: Path, tmp_path: Path) -> None:
    path, out = shared_data / "maps" / "tb3_sandbox.yaml", tmp_path / "path.csv"
    regions = regions_file(tmp_path, {1: box(-2.4, -2.4, 2.4, 2.4)})
    words = "--map", path, "--radius", 0.12, "--width", 0.3, "--start=-2.0,-0.5", "-o", out
    ran = invoke(command, regions, *words)
    assert ran.exit_code == 0, ran.output
    xy, parts = table(out)
    message = real_map(path)
    corner, cells = message.info.origin.position, message.data.reshape(message.info.height, -1)
    moved = xy - (corner.x, corner.y)
    assert away(legs_of(moved, parts), cells) >= 0.12 - 1e-9
    share = plain_share(cells, {1: box(7.6, 7.6, 12.4, 12.4)}, legs_of(moved, parts, "line"), 0.3)
    assert share > 0.92
    assert f"covered     {100 * share:.1f} % of" in ran.stderr


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (["--width", 0.05], "the width is at least 0.1 m, two cells of "),
        (["--width", "nan"], "two cells of "),
        (["--heading", "inf"], "a heading is a finite number of degrees, not inf"),
        (["--start", "9,9"], "the start 9,9 lies outside of "),
        (["--start", "nan,1"], "the start is two finite numbers, x and y on the map, not nan,1"),
        (["--start", "3.7,0.5"], "has no room for a radius of 0.15 m (its cell is not free)"),
        (["--start", "0.3,1.5"], "has no room for a radius of 0.15 m (at most 0.0"),
        (["--start", "1"], "--start is X,Y in the map's coordinates, such as 12.5,40, not '1'"),
        (["--radius", 0.8], "region 5 has no room for a radius of 0.8 m (at most 0."),
        (["-o", "path.plan"], "path.plan: a path is written to .yaml, .csv or .geojson"),
        (["--ids", "6"], "has no region 6; it has 5"),
    ],
)
def test_what_cannot_be_covered_is_refused_in_one_line(tmp_path: Path, words: list[Any], reason: str) -> None:
    given = {"--radius": RADIUS, "--width": WIDTH, "-o": tmp_path / "path.yaml"} | {words[0]: words[1]}
    pairs = [word for pair in given.items() for word in pair]
    map_, regions = map_file(tmp_path, rooms()), regions_file(tmp_path, EAST)
    before = sorted(tmp_path.iterdir())
    ran = invoke(command, regions, "--map", map_, *pairs)
    assert ran.exit_code == 1
    errors = [line for line in ran.stderr.splitlines() if "warning: " not in line]
    assert len(errors) == 1 and errors[0].startswith("uavseg: error: ") and reason in errors[0]
    assert sorted(tmp_path.iterdir()) == before


def test_nothing_is_overwritten_and_options_are_checked_as_usage(tmp_path: Path) -> None:
    map_, regions = map_file(tmp_path, rooms()), regions_file(tmp_path, EAST)
    words = regions, "--map", map_, "--radius", RADIUS, "--width", WIDTH
    ran = invoke(command, *words, "-o", map_, "--overwrite")
    assert ran.exit_code == 1 and "image: map.pgm" in map_.read_text()
    there = tmp_path / "there.yaml"
    there.write_text("mine")
    ran = invoke(command, *words, "-o", there)
    assert ran.exit_code == 1 and "there.yaml exists; give --overwrite" in ran.stderr
    assert there.read_text() == "mine"
    assert invoke(command, *words).exit_code == 2
    assert invoke(command, *words, "-o", there, "--width", "wide").exit_code == 2


@pytest.mark.slow
def test_the_module_runs_as_a_program(tmp_path: Path) -> None:
    covered(tmp_path, EAST)
    search = [str(Path(uavseg.__file__).parents[1]), str(Path(__file__).parents[2] / "ros" / "uavseg_ros")]
    words = [str(tmp_path / "regions.geojson"), "--map", str(tmp_path / "map.yaml"), "--radius", "0.15"]
    ran = subprocess.run(
        [sys.executable, "-m", "uavseg_ros.cover", *words, "--width", "0.3", "-o", "-", "-q"],
        env={"PYTHONPATH": ":".join(search), "HOME": str(tmp_path)},
        capture_output=True,
        text=True,
    )
    assert ran.returncode == 0 and not ran.stderr, ran.stderr
    assert json.loads(ran.stdout)["features"]
