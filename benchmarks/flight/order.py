"""Order of many regions from home and back: length and time against python-tsp and OR-Tools."""

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from importlib.util import find_spec

import numpy as np
from numpy.typing import NDArray
from pyproj import Proj

from benchmarks.flight.fields import Field
from benchmarks.flight.measured import MARGIN_M, in_metres
from uavseg.flight.order.tour import Stops, short_tour
from uavseg.flight.safety.keep_out import KeepOut

Floats = NDArray[np.float64]

LONG_S = 60  # of the long search, by which the others are measured


@dataclass(frozen=True, slots=True)
class Tour:
    """One row of the table: a closed tour over places, place 0 being home."""

    places: str
    method: str
    length_m: float
    cpu_s: float


def tours(
    counts: Sequence[int] = (50, 200), field: Field | None = None, long_s: int = LONG_S
) -> Iterator[Tour]:
    """Each method on places drawn at random, and on the regions of a field, around its keep-out zones."""
    matrices = {f"{count} places": _random_distances(count) for count in counts}
    if field is not None:
        matrices[field.name] = ways_between(field)
    for name, distances in matrices.items():
        _by_uavseg(distances)  # compiles the kernels
        for method, find in _methods(long_s):
            start = time.process_time()
            order = find(distances)
            yield Tour(name, method, _length(distances, order), time.process_time() - start)


def _random_distances(count: int) -> Floats:
    places = np.random.default_rng(count).uniform(0, 1000, (count + 1, 2))
    distances: Floats = np.hypot(*(places[:, None] - places[None]).transpose(2, 0, 1))
    return distances


def ways_between(field: Field) -> Floats:
    """Shortest ways between home and a point in each region, around keep-out zones with their margin."""
    flat = Proj(proj="aeqd", lat_0=field.home[0], lon_0=field.home[1], datum="WGS84")
    places = np.array([(0.0, 0.0), *(flat(*point) for point in field.points)])
    zones = [in_metres([zone], field) for zone in field.zones]
    space = KeepOut(zones, MARGIN_M).space
    ways: Floats = space.paths(places[space.is_free(places)]).lengths
    return ways


def _methods(long_s: int) -> Iterator[tuple[str, Callable[[Floats], list[int]]]]:
    yield "**uavseg**", _by_uavseg
    if find_spec("python_tsp"):
        yield "python-tsp: 2-opt", lambda d: _by_python_tsp(d, "2-opt")
        yield "python-tsp: Lin-Kernighan", lambda d: _by_python_tsp(d, "lk")
    if find_spec("ortools"):
        yield "OR-Tools: first solution and descent", lambda d: _by_ortools(d, 0)
        yield "OR-Tools: guided local search, 5 s", lambda d: _by_ortools(d, 5)
        yield f"OR-Tools: guided local search, {long_s} s", lambda d: _by_ortools(d, long_s)


def _length(distances: Floats, order: list[int]) -> float:
    """Length of the closed tour; checks that it is one."""
    if sorted(order) != list(range(len(distances))):
        raise ValueError("a tour does not lead to each place once")
    return float(distances[order, np.roll(order, -1)].sum())


def _by_uavseg(distances: Floats) -> list[int]:
    stops = Stops.of([np.array([[place, place]]) for place in range(1, len(distances))])
    return [0, *(stop + 1 for stop, _ in short_tour(stops, distances, 0, 0))]


def _by_python_tsp(distances: Floats, method: str) -> list[int]:
    from python_tsp.heuristics import solve_tsp_lin_kernighan, solve_tsp_local_search

    if method == "lk":
        order, _ = solve_tsp_lin_kernighan(distances)
    else:
        order, _ = solve_tsp_local_search(distances, perturbation_scheme="two_opt")
    return [int(place) for place in order]


def _by_ortools(distances: Floats, seconds: int) -> list[int]:
    from ortools.constraint_solver import pywrapcp, routing_enums_pb2

    whole = np.round(distances * 1000).astype(int).tolist()
    manager = pywrapcp.RoutingIndexManager(len(whole), 1, 0)
    routing = pywrapcp.RoutingModel(manager)
    transit = routing.RegisterTransitCallback(
        lambda a, b: whole[manager.IndexToNode(a)][manager.IndexToNode(b)]
    )
    routing.SetArcCostEvaluatorOfAllVehicles(transit)
    parameters = pywrapcp.DefaultRoutingSearchParameters()
    parameters.first_solution_strategy = routing_enums_pb2.FirstSolutionStrategy.PATH_CHEAPEST_ARC
    if seconds:
        parameters.local_search_metaheuristic = routing_enums_pb2.LocalSearchMetaheuristic.GUIDED_LOCAL_SEARCH
        parameters.time_limit.FromSeconds(seconds)
    solution = routing.SolveWithParameters(parameters)
    order, index = [], routing.Start(0)
    while not routing.IsEnd(index):
        order.append(manager.IndexToNode(index))
        index = solution.Value(routing.NextVar(index))
    return order
