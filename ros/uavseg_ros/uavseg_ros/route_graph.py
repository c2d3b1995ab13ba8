"""Route graphs for Nav2's route server: places in the regions of a map, and straight free ways between them.

The format is that of ``GeoJsonGraphFileLoader`` in nav2_route of ros-navigation/navigation2: points with `id`
and `frame`, and lines with `id`, `startid` and `endid`. No id is given twice, to nodes or to edges.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavseg.cli import write
from uavseg.cli.command import job_command
from uavseg.cli.terminal.say import Reporter
from uavseg.dataclass import dataclass
from uavseg.errors import OutputError, ParameterError, RegionError
from uavseg.occupancy.paths.clearance import clearance
from uavseg.occupancy.paths.path_text import feature_collection
from uavseg.options.option import group, option
from uavseg.options.running import output_option
from uavseg_ros import free_space, programs
from uavseg_ros.free_space import Cell, FreeSpace, MapRegion
from uavseg_ros.robot_options import ProgramOptions, RobotOptions

MAX_ID = 65_535  # of the 16 bits that ids have in nav2_msgs/action/ComputeRoute


@dataclass(frozen=True, eq=False)
class RouteGraph:
    """Nodes, which are cells of a map, and the straight edges between them, each for both directions."""

    regions: tuple[MapRegion, ...]  # one for each of the first nodes
    cells: NDArray[np.int64]  # (n, 2): row and column of the nodes
    edges: NDArray[np.int64]  # (m, 2): indices of two nodes each
    ways: int  # number of pairs of regions that were joined
    geojson: str

    def length_m(self, space: FreeSpace) -> float:
        """Return the sum of the lengths of the edges in metres, each counted once."""
        return float(_lengths_m(self.cells, self.edges, space).sum())


def plan_graph(
    space: FreeSpace, regions: Sequence[MapRegion], part: int, nearest: int = 8, frame: str = "map"
) -> RouteGraph:
    """Plan ways between regions over one part of the drivable cells, and join them to a graph.

    The node of a region is its drivable cell that is farthest from obstacles and from its own edge. Ways are
    planned between each region and the nearest others, and along the minimum spanning tree of the straight
    distances, so that the graph is connected. Corners of ways are nodes too; ways that bend at one cell share
    its node.

    Parameters
    ----------
    regions : sequence of MapRegion
        Each has cells in the part.
    nearest : int
        Number of nearest regions to which each is joined.

    Raises
    ------
    ParameterError
        If `nearest` is below 1.
    RegionError
        If there are fewer than two regions, one has no cell of its own, or an id does not fit into 16 bits.
    """
    if nearest < 1:
        raise ParameterError(f"each region is joined to 1 or more others, not to {nearest}")
    if len(regions) < 2:
        raise RegionError(f"a graph joins two regions or more, and there is {len(regions)}")
    wrong = next((one for one in regions if not 0 <= one.id <= MAX_ID), None)
    if wrong is not None:
        raise RegionError(f"{wrong}: ids of nodes are whole numbers from 0 to {MAX_ID}; give it another id")
    stations = station_cells(space, regions, part)
    index = {cell: k for k, cell in enumerate(stations)}
    edges: dict[tuple[int, int], None] = {}
    pairs = neighbour_pairs(np.array(stations), nearest)
    for here, there in pairs:
        corners = [tuple(cell) for cell in space.path(stations[here], stations[there]).tolist()]
        nodes = [index.setdefault(cell, len(index)) for cell in corners]
        edges |= dict.fromkeys((min(pair), max(pair)) for pair in pairwise(nodes))
    cells, ends = np.array(list(index)), np.array(list(edges))
    features = list(_features(space, regions, cells, ends, frame))
    return RouteGraph(
        regions=tuple(regions),
        cells=cells,
        edges=ends,
        ways=len(pairs),
        geojson=feature_collection(features),
    )


def station_cells(space: FreeSpace, regions: Sequence[MapRegion], part: int) -> list[Cell]:
    """Return the cell of each region that is farthest from obstacles and from its edge, each only once.

    Of equals the highest counts, then the leftmost.
    """
    taken = np.zeros(space.free.shape, np.bool_)
    result: list[Cell] = []
    for region in regions:
        inner = clearance(region.mask & space.free[region.box])
        inner[~region.mask | (space.parts[region.box] != part) | taken[region.box]] = -1.0
        row, col = (int(one) for one in np.unravel_index(np.argmax(inner), inner.shape))
        if inner[row, col] < 0:
            raise RegionError(f"{region} has no cell besides those of other regions; leave one of them out")
        taken[region.box][row, col] = True
        result.append((region.box[0].start + row, region.box[1].start + col))
    return result


def neighbour_pairs(places: NDArray[np.int64], nearest: int) -> list[tuple[int, int]]:
    """Return pairs of places (n, 2): each with its nearest, and those of the minimum spanning tree.

    Distances are straight. Of equals the pair of the lowest indices comes first.

    Examples
    --------
    >>> neighbour_pairs(np.array([[0, 0], [0, 1], [0, 2], [0, 9]]), 1)
    [(0, 1), (1, 2), (2, 3)]
    """
    count = len(places)
    squares = ((places[:, None] - places[None]) ** 2).sum(axis=2)
    first, second = np.triu_indices(count, 1)
    order = np.lexsort((second, first, squares[first, second]))
    chosen, tree = set(), list(range(count))
    for here, there in zip(first[order].tolist(), second[order].tolist(), strict=True):
        if tree[here] != tree[there]:
            old = tree[there]
            tree = [tree[here] if one == old else one for one in tree]
            chosen.add((here, there))
    for here in range(count):
        others = np.lexsort((np.arange(count), squares[here]))
        for there in [k for k in others.tolist() if k != here][:nearest]:
            chosen.add((min(here, there), max(here, there)))
    return sorted(chosen)


def _lengths_m(cells: NDArray[np.int64], edges: NDArray[np.int64], space: FreeSpace) -> NDArray[np.float64]:
    steps = cells[edges[:, 1]] - cells[edges[:, 0]]
    return np.asarray(np.hypot(*steps.T) * space.side_m)


def _features(
    space: FreeSpace,
    regions: Sequence[MapRegion],
    cells: NDArray[np.int64],
    edges: NDArray[np.int64],
    frame: str,
) -> Iterator[tuple[dict[str, Any], dict[str, Any]]]:
    """Yield properties and geometries: nodes of regions, which have their ids, corners, then edges."""
    ids = [region.id for region in regions]
    ids += range(max(ids) + 1, max(ids) + 1 + len(cells) - len(ids))
    if max(ids) + 2 * len(edges) > MAX_ID:
        raise RegionError(
            f"the graph has {len(ids):,} nodes and {2 * len(edges):,} edges, and ids end at {MAX_ID:,}; give "
            "fewer regions or neighbours (--nearest), or smaller ids"
        )
    places = space.xy(cells + 0.5).tolist()
    for k, (number, place) in enumerate(zip(ids, places, strict=True)):
        about: dict[str, Any] = {"id": number, "frame": frame}
        if k < len(regions):
            named = {"name": regions[k].name} if regions[k].name else {}
            about["metadata"] = {"region": regions[k].id} | named
        yield about, {"type": "Point", "coordinates": place}
    lengths = _lengths_m(cells, edges, space).round(6).tolist()
    number = max(ids)
    for (here, there), length_m in zip(edges.tolist(), lengths, strict=True):
        for start, end in ((here, there), (there, here)):
            number += 1
            about = {"id": number, "startid": ids[start], "endid": ids[end], "cost": length_m}
            yield about, {"type": "MultiLineString", "coordinates": [[places[start], places[end]]]}


class RouteGraphOptions(ProgramOptions):
    """Graph."""

    robot: RobotOptions = group(RobotOptions)
    output: str = output_option("The graph: .geojson; - is stdout.", "PATH")
    nearest: int = option(
        "Join each region to its N nearest, by straight distance, and all to one graph.",
        default=8,
        minimum=1,
        metavar="N",
        basic=True,
    )
    frame: str = option("Frame of the map.", default="map", metavar="NAME", basic=True)


@job_command("route_graph", RouteGraphOptions)
def command(options: RouteGraphOptions, reporter: Reporter) -> None:
    """Make a route graph of REGIONS for Nav2's route server.

    REGIONS are polygons in the coordinates of the map. Each is a node, which has the id of the region; so is
    each corner of the ways between them. All edges are straight, keep the radius of the robot, and are there
    in both directions.
    """
    from uavseg.output.atomic import check_target

    output, overwrite, robot = options.output, options.files.overwrite, options.robot
    if output != "-":
        if not output.lower().endswith((".geojson", ".json")):
            raise OutputError(f"{output}: a route graph is GeoJSON; name a .geojson")
        check_target(output, overwrite)
    write.keep_inputs([output], robot.regions, robot.map)
    space, regions, notes = robot.read()
    part = free_space.main_part(space, regions)
    reached, refused = robot.split_reachable(space, regions, part)
    graph = plan_graph(space, reached, part, options.nearest, options.frame)
    reporter.finish([*space.warnings, *notes, *refused])
    write.write_text(output, graph.geojson, overwrite)
    length_m = graph.length_m(space)
    reporter.table(
        regions=f"{len(reached):,} of {len(regions):,}",
        ways=f"{graph.ways:,}",
        nodes=f"{len(graph.cells):,}, {len(graph.cells) - len(reached):,} of them at corners",
        edges=f"{2 * len(graph.edges):,}, {length_m:,.1f} m in each direction",
        written=write.shown(output),
    )


def main() -> None:
    """Run the command, with the arguments of the process."""
    programs.run(command)


if __name__ == "__main__":
    main()
