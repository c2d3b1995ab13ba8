"""Numbers of flights against a proven optimum: OR-tools (CP-SAT) as the judge, up to 20 regions.

python -m benchmarks.flight.division
"""

import itertools
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from uavseg.flight.avoid.free_space import FreeSpace
from uavseg.flight.mission.track import Track, leg_lengths
from uavseg.flight.planning.split import FlightLimits, items_of, short_route, split_route

Floats = NDArray[np.float64]
SPEED_M_S, FIXED_S = 5.0, 90.0
SECONDS = 20.0  # for the judge
HOME = np.zeros(2)


def limits(seconds: float) -> FlightLimits:
    """Limits of flights at one speed, with the time of takeoff and landing."""

    def costs(track: Track) -> tuple[Floats, Floats]:
        return leg_lengths(track.xy) / SPEED_M_S, np.zeros(len(track.is_line))

    return FlightLimits(
        seconds=seconds,
        items=np.inf,
        fixed_s=FIXED_S,
        fixed_items=0,
        count=items_of,
        costs=costs,
        ways=lambda home, places, lengths: (lengths / SPEED_M_S, lengths / SPEED_M_S),
    )


def flights_of(places: Floats, seconds: float) -> list[float]:
    """The time of each of our flights over places (n, 2)."""
    tracks = [[Track.of_path(place[None])] for place in places]
    allowed = limits(seconds)
    found = split_route(short_route(tracks, HOME, FreeSpace(), [allowed], SPEED_M_S), allowed)
    assert sum(len(track.xy) for track in found) == len(places)
    return [
        float(leg_lengths(np.concatenate([HOME[None], track.xy, HOME[None]])).sum()) / SPEED_M_S + FIXED_S
        for track in found
    ]


def fewest_flights(places: Floats, seconds: float) -> tuple[int, bool]:
    """The least number of flights over places by CP-SAT, and whether it is proven."""
    from ortools.sat.python import cp_model

    points = np.concatenate([HOME[None], places])
    times = np.rint(10 * np.hypot(*(points[:, None] - points).transpose(2, 0, 1)) / SPEED_M_S).astype(int)
    most = int(10 * (seconds - FIXED_S))
    model = cp_model.CpModel()
    reached = [model.new_int_var(0, most, "") for _ in points]
    arcs, out = [], []
    for i, j in itertools.permutations(range(len(points)), 2):
        is_flown = model.new_bool_var("")
        arcs.append((i, j, is_flown))
        if i == 0:
            out.append(is_flown)
            model.add(reached[j] >= int(times[0, j])).only_enforce_if(is_flown)
        elif j == 0:
            model.add(reached[i] + int(times[i, 0]) <= most).only_enforce_if(is_flown)
        else:
            model.add(reached[j] >= reached[i] + int(times[i, j])).only_enforce_if(is_flown)
    model.add_multiple_circuit(arcs)
    model.minimize(sum(out))
    solver = cp_model.CpSolver()
    solver.parameters.max_time_in_seconds = SECONDS
    solver.parameters.num_workers = 2
    status = solver.solve(model)
    return round(solver.objective_value), status == cp_model.OPTIMAL


def cases() -> Iterator[tuple[Floats, float]]:
    """Random places around home, and limits that need two flights to six."""
    for seed in range(24):
        draw = np.random.default_rng(seed)
        count = int(draw.integers(6, 21))
        places = draw.uniform(-1000, 1000, (count, 2))
        yield places, FIXED_S + float(draw.uniform(1.1, 2.2)) * 2 * np.hypot(*places.T).max() / SPEED_M_S


def main() -> None:
    """Print our number of flights, the judge's, and how alike ours are."""
    ours, judged, proven = [], [], 0
    for places, seconds in cases():
        found = flights_of(places, seconds)
        number, is_proven = fewest_flights(places, seconds)
        ours.append(len(found))
        judged.append(number)
        proven += is_proven
        alike = min(found) / max(found)
        print(f"{len(places)} regions: {len(found)} flights, {number} by CP-SAT ({is_proven}), {alike:.2f}")
    more = sum(a > b for a, b in zip(ours, judged, strict=True))
    print(f"more flights than the judge in {more} of {len(ours)}; {proven} are proven optima")


if __name__ == "__main__":
    main()
