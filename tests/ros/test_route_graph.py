"""Route graphs of the ROS package, read as Nav2's route server reads them."""

import json
import math
import subprocess
import sys
from itertools import combinations
from pathlib import Path
from typing import Any

import geopandas
import numpy as np
import pytest
import shapely
from hypothesis import given, strategies as st
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components, minimum_spanning_tree, shortest_path
from uavseg_ros.route_graph import command, neighbour_pairs

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

RADIUS = 0.2


class Graph:
    """What GeoJsonGraphFileLoader of nav2_route takes from a file; what it would refuse is an error here."""

    def __init__(self, text: str) -> None:
        content = json.loads(text)
        assert "crs" not in content
        features = content["features"]
        nodes = [one for one in features if one["geometry"]["type"] == "Point"]
        edges = [one for one in features if one["geometry"]["type"] in ("MultiLineString", "LineString")]
        assert nodes and edges and len(nodes) + len(edges) == len(features)
        self.places: dict[int, tuple[float, float]] = {}
        self.metadata: dict[int, dict[str, Any]] = {}
        self.edges: dict[int, tuple[int, int]] = {}
        self.costs: dict[int, float] = {}
        for node in nodes:
            properties = node["properties"]
            number = self.unsigned(properties["id"])
            assert number not in self.places
            assert isinstance(properties["frame"], str)
            x, y = node["geometry"]["coordinates"]
            self.places[number] = float(x), float(y)
            self.metadata[number] = properties.get("metadata", {})
            assert all(isinstance(value, int | float | str) for value in self.metadata[number].values())
        for edge in edges:
            properties = edge["properties"]
            number, start, end = (self.unsigned(properties[key]) for key in ("id", "startid", "endid"))
            assert start in self.places and end in self.places
            assert number not in self.edges
            self.edges[number] = start, end
            self.costs[number] = float(properties["cost"])
            [line] = edge["geometry"]["coordinates"]
            assert [tuple(one) for one in line] == [self.places[start], self.places[end]]
        assert not self.places.keys() & self.edges.keys()

    @staticmethod
    def unsigned(value: Any) -> int:
        assert type(value) is int and 0 <= value < 2**16
        return value

    @property
    def lines(self) -> Any:
        return np.array([[self.places[start], self.places[end]] for start, end in self.edges.values()])

    def matrix(self) -> Any:
        index = {number: k for k, number in enumerate(self.places)}
        ends = np.array([[index[start], index[end]] for start, end in self.edges.values()])
        lengths = np.hypot(*(self.lines[:, 1] - self.lines[:, 0]).T)
        return coo_array((lengths, ends.T), shape=(len(index), len(index))).tocsr()

    def length(self, start: int, goal: int) -> float:
        ids = list(self.places)
        lengths = shortest_path(self.matrix(), indices=ids.index(start))
        return float(lengths[ids.index(goal)])


def graph_of(folder: Path, *words: Any, origin: tuple[float, float, float] = (0, 0, 0), **named: str) -> str:
    map_, out = map_file(folder, rooms(), origin), folder / "graph.geojson"
    regions = regions_file(folder, REGIONS, placed(origin), **named)
    ran = invoke(command, regions, "--map", map_, "--radius", RADIUS, "-o", out, "--overwrite", *words)
    assert ran.exit_code == 0, ran.output
    return out.read_text()


@pytest.mark.parametrize("radius", [0.05, 0.125, 0.225, 0.275])
def test_all_points_of_each_edge_keep_the_radius(tmp_path: Path, radius: float) -> None:
    graph = Graph(graph_of(tmp_path, "--radius", radius))
    assert away(graph.lines, rooms()) >= radius - 1e-9


@pytest.mark.parametrize("nearest", [1, 2, 8])
def test_each_edge_has_one_back_and_costs_its_length(tmp_path: Path, nearest: int) -> None:
    graph = Graph(graph_of(tmp_path, "--nearest", nearest))
    both = list(graph.edges.values())
    assert len(set(both)) == len(both) and {(b, a) for a, b in both} == set(both)
    for number, cost in graph.costs.items():
        start, end = (graph.places[one] for one in graph.edges[number])
        assert cost == pytest.approx(math.dist(start, end), abs=1e-6) and cost > 0


@pytest.mark.parametrize("nearest", [1, 2, 8])
def test_the_graph_is_connected_and_regions_are_the_nodes_of_their_ids(tmp_path: Path, nearest: int) -> None:
    graph = Graph(graph_of(tmp_path, "--nearest", nearest, r1="dock", r7="store"))
    assert connected_components(graph.matrix())[0] == 1
    for number, ring in REGIONS.items():
        assert shapely.contains_xy(polygon(ring), *graph.places[number])
        assert graph.metadata[number]["region"] == number
    assert {number for number, about in graph.metadata.items() if about} == set(REGIONS)
    assert graph.metadata[1]["name"] == "dock" and graph.metadata[7]["name"] == "store"
    places = np.array(list(graph.places.values()))
    assert (places > 0).all() and (places < np.array([6.4, 3.2])).all()


def test_routes_are_as_short_as_the_paths_of_uavseg(tmp_path: Path) -> None:
    graph = Graph(graph_of(tmp_path))
    clearance = RADIUS + SIDE * math.sqrt(0.5)
    for start, goal in combinations(REGIONS, 2):
        ends = graph.places[start], graph.places[goal]
        way = uavseg.path(tmp_path / "map.yaml", (0, 0.45), *ends, clearance=clearance, smooth=True)
        assert graph.length(start, goal) <= way.length_m + 1e-6
        assert graph.length(start, goal) >= 0.98 * way.length_m  # others may join it


@pytest.mark.slow
def test_the_node_of_a_region_is_farthest_from_walls_and_from_its_edge(tmp_path: Path) -> None:
    graph = Graph(graph_of(tmp_path))
    free = rooms() == 0
    for number, ring in REGIONS.items():
        rows, cols = np.nonzero(free)
        centres = (np.stack([cols, rows], axis=1) + 0.5) * SIDE
        centres = centres[shapely.contains_xy(polygon(ring), *centres.T)]
        cells = np.full(free.shape, 100, np.int8)
        cells[tuple((centres[:, ::-1] / SIDE).astype(int).T)] = 0
        best = max(away(np.array([[one, one]]), cells) for one in centres)
        place = np.array([[graph.places[number]] * 2])
        assert away(place, cells) == pytest.approx(best)


def test_the_same_bytes_twice_and_the_same_graph_on_a_moved_map(tmp_path: Path) -> None:
    text = graph_of(tmp_path)
    assert graph_of(tmp_path) == text
    graph, origin = Graph(text), (-3.5, 12.25, 0.7)
    moved = Graph(graph_of(tmp_path, origin=origin))
    assert moved.edges == graph.edges
    places = np.array(list(graph.places.values()))
    np.testing.assert_allclose(list(moved.places.values()), placed(origin)(places), atol=1e-8)
    shifted = Graph(graph_of(tmp_path, origin=(100.0, -40.0, 0.0)))
    np.testing.assert_allclose(list(shifted.places.values()), places + np.array([100, -40]), atol=1e-8)


@given(
    st.lists(st.tuples(st.integers(0, 9), st.integers(0, 9)), min_size=2, max_size=9, unique=True), st.data()
)
def test_pairs_are_the_nearest_and_a_minimum_spanning_tree(places: Any, data: st.DataObject) -> None:
    count, xy = len(places), np.array(places)
    nearest = data.draw(st.integers(1, count))
    pairs = neighbour_pairs(xy, nearest)
    assert pairs == sorted(set(pairs)) and all(a < b for a, b in pairs)
    lengths = np.hypot(*(xy[:, None] - xy[None]).transpose(2, 0, 1))
    weights = np.zeros((count, count))
    for a, b in pairs:
        weights[a, b] = lengths[a, b]
    tree, whole = (minimum_spanning_tree(one).sum() for one in (weights, np.triu(lengths)))
    assert tree == pytest.approx(whole)
    for here in range(count):
        joined = sorted(lengths[here, a + b - here] for a, b in pairs if here in (a, b))
        expected = sorted(np.delete(lengths[here], here))[:nearest]
        assert joined[: len(expected)] == pytest.approx(expected)
    if nearest >= count - 1:
        assert pairs == list(combinations(range(count), 2))


def test_a_region_that_cannot_be_reached_is_refused_or_left_out_and_said(tmp_path: Path) -> None:
    map_, out = map_file(tmp_path, rooms()), tmp_path / "graph.geojson"
    regions = regions_file(tmp_path, REGIONS | {9: CLOSET})
    words = regions, "--map", map_, "--radius", 0.1, "-o", out
    ran = invoke(command, *words)
    assert ran.exit_code == 1 and not out.exists()
    last = ran.stderr.strip().splitlines()[-1]
    assert last.startswith(
        "uavseg: error: no path leads to region 9 with a radius of 0.1 m (with none); leave"
    )
    ran = invoke(command, *words, "--allow-unreachable")
    assert ran.exit_code == 0 and "warning: no path leads to region 9" in ran.stderr
    assert "5 of 6" in ran.stderr
    assert {about["region"] for about in Graph(out.read_text()).metadata.values() if about} == set(REGIONS)


def test_the_radius_that_a_refusal_names_is_the_largest(tmp_path: Path) -> None:
    cells = rooms()
    cells[40:54, 70:78] = 100  # the door is half a metre wide
    map_, out = map_file(tmp_path, cells), tmp_path / "graph.geojson"
    words = regions_file(tmp_path, REGIONS), "--map", map_, "-o", out, "--overwrite", "--radius"
    ran = invoke(command, *words, 0.28)
    assert ran.exit_code == 1
    named = float(ran.stderr.split("(at most ")[1].split(" m)")[0])
    assert 0.15 < named < 0.25
    assert invoke(command, *words, named).exit_code == 0
    assert away(Graph(out.read_text()).lines, cells) >= named - 1e-9
    assert invoke(command, *words, named + 0.002).exit_code == 1


def test_a_graph_over_a_real_map(shared_data: Path, tmp_path: Path) -> None:
    path, out = shared_data / "maps" / "tb3_sandbox.yaml", tmp_path / "graph.geojson"
    rings = {
        1: box(-2, -1.8, -1, -0.6),
        2: box(0.2, -0.6, 1, 0.6),
        3: box(1.2, 0.2, 2.4, 1.6),
        4: box(-1, 1.3, 1, 2.5),
    }
    regions = regions_file(tmp_path, rings)
    ran = invoke(command, regions, "--map", path, "--radius", 0.17, "-o", out)
    assert ran.exit_code == 0, ran.output
    graph, message = Graph(out.read_text()), real_map(path)
    corner = message.info.origin.position
    cells = message.data.reshape(message.info.height, -1)
    assert away(graph.lines - (corner.x, corner.y), cells) >= 0.17 - 1e-9
    assert connected_components(graph.matrix())[0] == 1 and set(rings) < set(graph.places)


@pytest.mark.parametrize(
    ("rings", "words", "reason"),
    [
        ({1: REGIONS[1]}, [], "a graph joins two regions or more, and there is 1"),
        (
            {1: REGIONS[1], 70000: REGIONS[2]},
            [],
            "region 70000: ids of nodes are whole numbers from 0 to 65535",
        ),
        ({1: REGIONS[1], 65000: REGIONS[7]}, ["--nearest", 1], None),
        ({1: REGIONS[1], 65535: REGIONS[7]}, [], "edges, and ids end at 65,535; give fewer regions"),
        (REGIONS, ["--radius", -1], "the radius of a robot is metres, not below 0, not -1"),
        (REGIONS, ["--radius", "nan"], "not below 0, not nan"),
        (REGIONS, ["--radius", 0.9], "region 1 has no room for a radius of 0.9 m (at most 0."),
        (REGIONS, ["--ids", "1,5"], "has no region 5; it has 1, 2, 3, 4, 7"),
        (REGIONS, ["--ids", "1"], "a graph joins two regions or more, and there is 1"),
        (REGIONS, ["--passable-below", 2], "up to a probability above 0, at most 1, not 2"),
        (REGIONS | {8: box(9, 9, 10, 10)}, [], "region 8 has no cell of "),
        (REGIONS | {8: box(3.55, 0.1, 3.85, 1)}, [], "region 8 has no free cell; leave it out"),
    ],
)
def test_what_cannot_be_a_graph_is_refused_in_one_line(
    tmp_path: Path, rings: dict[int, Any], words: list[Any], reason: str | None
) -> None:
    map_, out = map_file(tmp_path, rooms()), tmp_path / "graph.geojson"
    before = sorted(tmp_path.iterdir())
    given = [] if "--radius" in words else ["--radius", RADIUS]
    ran = invoke(command, regions_file(tmp_path, rings), "--map", map_, "-o", out, *given, *words)
    if reason is None:
        assert ran.exit_code == 0, ran.output
        return
    assert ran.exit_code == 1
    errors = [line for line in ran.stderr.splitlines() if "warning: " not in line]
    assert len(errors) == 1 and errors[0].startswith("uavseg: error: ") and reason in errors[0]
    assert sorted(tmp_path.iterdir()) == sorted({*before, tmp_path / "regions.geojson"})


def test_files_that_do_not_fit_are_refused_and_nothing_is_overwritten(tmp_path: Path) -> None:
    map_, regions = map_file(tmp_path, rooms()), regions_file(tmp_path, REGIONS)
    words = "--map", map_, "--radius", RADIUS
    there = tmp_path / "there.geojson"
    there.write_text("mine")

    def reason(*given: Any) -> str:
        ran = invoke(command, *given)
        assert ran.exit_code == 1
        return ran.stderr.strip().splitlines()[-1]

    assert "there.geojson exists; give --overwrite" in reason(regions, *words, "-o", there)
    assert there.read_text() == "mine"
    assert "a route graph is GeoJSON; name a .geojson" in reason(
        regions, *words, "-o", tmp_path / "graph.yaml"
    )
    before = regions.read_text()
    assert reason(regions, *words, "-o", regions, "--overwrite") and regions.read_text() == before
    frame = geopandas.GeoDataFrame({"id": [1]}, geometry=[polygon(REGIONS[1])], crs="EPSG:32632")
    frame.to_file(tmp_path / "placed.gpkg")
    assert "has a CRS" in reason(tmp_path / "placed.gpkg", *words, "-o", tmp_path / "new.geojson")
    assert "does not exist" in reason(tmp_path / "none.geojson", *words, "-o", tmp_path / "new.geojson")
    twice = json.loads(before)
    twice["features"].append(twice["features"][0])
    (tmp_path / "twice.geojson").write_text(json.dumps(twice))
    assert "has 2 regions with the id 1" in reason(tmp_path / "twice.geojson", *words, "-o", "new.geojson")
    samples = Path(uavseg.__file__).resolve().parents[1] / "samples" / "quarry.tif"
    assert "has a CRS" in reason(regions, "--map", samples, "--radius", 1, "-o", tmp_path / "new.geojson")


@pytest.mark.slow
def test_the_module_runs_as_a_program_with_the_codes_of_uavseg(tmp_path: Path) -> None:
    map_, regions = map_file(tmp_path, rooms()), regions_file(tmp_path, REGIONS)
    program = [sys.executable, "-m", "uavseg_ros.route_graph", str(regions), "--map", str(map_)]
    search = [str(Path(uavseg.__file__).parents[1]), str(Path(__file__).parents[2] / "ros" / "uavseg_ros")]

    def run(*words: str) -> Any:
        environment = {"PYTHONPATH": ":".join(search), "HOME": str(tmp_path)}
        return subprocess.run([*program, *words], env=environment, capture_output=True, text=True)

    ran = run("--radius", "0.2", "-o", "-", "-q")
    assert ran.returncode == 0, ran.stderr
    assert ran.stdout == graph_of(tmp_path)
    usage = run("--radius", "0.2")
    assert (
        usage.returncode == 2 and "Usage: ros2 run uavseg_ros route_graph [OPTIONS] REGIONS" in usage.stderr
    )
    assert run("--radius", "0.2", "-o", "-", "--nearest", "0").returncode == 2
    wrong = run("--radius", "3", "-o", "-", "-q")
    assert (
        wrong.returncode == 1
        and wrong.stderr.startswith("uavseg: error: region 1 has no room")
        and not wrong.stdout
    )
