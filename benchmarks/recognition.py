"""Recognition of incompletely seen shapes, compared with classical descriptors.

    python -m benchmarks.recognition [--scenes 100] [--views 1 2 4] [--processes 2]

Ten shapes of random size (0.8 to 1.6 m across), rotation and position, seen by a simulated range finder
(sigma 3 cm, beams 0.5 degrees apart) from 1, 2 or 4 poses evenly spread on a circle of 2 m, so two are
opposite each other; cells of 2.5 cm. Ours has one example of each shape, learned from twelve views of another
size and rotation. The others are nearest neighbour or a random forest, leave-one-out (or out of bag) among
all other scenes of the same number of views: examples as incomplete as what is asked.
"""

import argparse
import json
import math
import tempfile
import time
import warnings
from collections.abc import Callable, Iterable
from importlib.util import find_spec
from multiprocessing import Pool
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import uavseg
from uavseg.occupancy.mapping.grid import OccupancyGrid
from uavseg.occupancy.mapping.scan import Pose
from uavseg.occupancy.simulation.scenes import lens_outline
from uavseg.occupancy.simulation.simulate import RangeFinder, Scene, Simulation
from uavseg.raster.grid.geobox import local_geobox

Floats = NDArray[np.float64]

CELL_M, SIDE_M, DISTANCE_M, SIGMA_M = 0.025, 4.0, 2.0, 0.03
GAP_M = 1.0  # what one object falls apart into, seen from one side, is nearer together than this
EXAMPLE_VIEWS, EXAMPLE_SEED = 12, 1_000_000


def _regular(corners: int) -> list[tuple[float, float]]:
    angles = (math.tau * k / corners for k in range(corners))
    return [(math.cos(angle), math.sin(angle)) for angle in angles]


_CORNERS: dict[str, Any] = {
    "disc": _regular(180),
    "square": [(0, 0), (1, 0), (1, 1), (0, 1)],
    "rectangle": [(0, 0), (2, 0), (2, 1), (0, 1)],
    "triangle": _regular(3),
    "L": [(0, 0), (3, 0), (3, 1), (1, 1), (1, 3), (0, 3)],
    "T": [(1, 0), (2, 0), (2, 2), (3, 2), (3, 3), (0, 3), (0, 2), (1, 2)],
    "cross": [
        *[(1, 0), (2, 0), (2, 1), (3, 1), (3, 2), (2, 2)],
        *[(2, 3), (1, 3), (1, 2), (0, 2), (0, 1), (1, 1)],
    ],
    "lens": lens_outline(0, 0, height=1.1, edge=1.0, waist=0.5),
    "hexagon": _regular(6),
    "U": [(0, 0), (3, 0), (3, 3), (2, 3), (2, 1), (1, 1), (1, 3), (0, 3)],
}


def _unit(corners: Any) -> Floats:
    """Return corners around the middle of their box, whose longer side becomes 1."""
    ring = np.asarray(corners, np.float64)
    return np.asarray((ring - (ring.min(axis=0) + ring.max(axis=0)) / 2) / np.ptp(ring, axis=0).max())


SHAPES = {name: _unit(corners) for name, corners in _CORNERS.items()}


def scene_map(name: str, views: int, seed: int) -> OccupancyGrid:
    """Return the map of one shape of random size, rotation and position, seen from poses around it."""
    random = np.random.default_rng([list(SHAPES).index(name), views, seed])
    size, turn, start = random.uniform(0.8, 1.6), random.uniform(0, math.tau), random.uniform(0, math.tau)
    rotation = np.array([[math.cos(turn), math.sin(turn)], [-math.sin(turn), math.cos(turn)]])
    ring = SHAPES[name] * size @ rotation + random.uniform(-0.1, 0.1, 2)
    angles = [start + math.tau * k / views for k in range(views)]
    poses = [
        Pose(DISTANCE_M * math.cos(a), DISTANCE_M * math.sin(a), heading_rad=a + math.pi) for a in angles
    ]
    cells = round(SIDE_M / CELL_M)
    return Simulation(
        scene=Scene(polygons=[ring]),
        sensor=RangeFinder(sigma_m=SIGMA_M, max_range_m=4.0, fov_deg=100.0, step_deg=0.5),
        poses=poses,
        geobox=local_geobox((cells, cells), CELL_M, (-SIDE_M / 2, -SIDE_M / 2)),
    ).run(seed)


def make_library(folder: Path, without: str = "") -> Path:
    """Learn one example of each shape, but for one."""
    path = folder / f"library{without}.gpkg"
    for name in SHAPES:
        if name != without:
            example = scene_map(name, EXAMPLE_VIEWS, EXAMPLE_SEED)
            uavseg.recognise(example, path, learn=name, ids=[1], gap=GAP_M)
    return path


def named(job: tuple[str, int, int, str]) -> dict[str, Any]:
    """Recognise the object of one scene; of several, the largest."""
    name, views, seed, library = job
    grid = scene_map(name, views, seed)
    start = time.perf_counter()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        found = uavseg.recognise(grid, library, gap=GAP_M, threads=1).frame().iloc[0]
    columns = ("name", "nearest", "probability", "misfit", "seen_outline")
    seconds = time.perf_counter() - start
    return {"truth": name, "views": views, "seconds": seconds, **{key: found[key] for key in columns}}


def descriptors(job: tuple[str, int, int]) -> dict[str, list[float]]:
    """Return the classical descriptors of the occupied cells of one scene."""
    from skimage.measure import moments_central, moments_hu, moments_normalized, regionprops
    from skimage.morphology import convex_hull_image

    occupied = scene_map(*job).probabilities > 0.6
    points = np.argwhere(occupied).astype(np.float64)
    from_middle = points - points.mean(axis=0)
    radius = np.hypot(*from_middle.T)
    sector = (np.arctan2(*from_middle.T) % math.tau / math.tau * 32).astype(int)
    profile = np.array([radius[sector == k].max(initial=0.0) for k in range(32)])
    few = points[:: math.ceil(len(points) / 300)]
    pairs = np.hypot(*(few[:, None] - few[None]).transpose(2, 0, 1))[np.triu_indices(len(few), 1)]
    region = regionprops(occupied.astype(np.uint8))[0]
    hull = convex_hull_image(occupied)

    def hu(mask: Any) -> list[float]:
        moments = moments_hu(moments_normalized(moments_central(mask.astype(float))))
        return [float(-np.sign(one) * np.log10(abs(one) + 1e-30)) for one in moments]

    properties = [region.eccentricity, region.solidity, region.extent, region.euler_number]
    ratio = [region.axis_minor_length / region.axis_major_length, region.perimeter**2 / region.area]
    return {
        "Hu moments": hu(occupied),
        "Hu moments of the convex hull": hu(hull),
        "radial profile": np.abs(np.fft.rfft(profile / profile.mean())).tolist(),
        "distances of pairs": (np.histogram(pairs / pairs.mean(), 32, (0, 3))[0] / len(pairs)).tolist(),
        "regionprops": [*hu(occupied), *hu(hull), *map(float, properties), *map(float, ratio)],
    }


def nearest_neighbour(features: Floats, truth: NDArray[np.str_]) -> float:
    """Return the share that the nearest other scene names right, with standardised features."""
    scaled = (features - features.mean(axis=0)) / np.maximum(features.std(axis=0), 1e-12)
    apart = ((scaled[:, None] - scaled[None]) ** 2).sum(axis=2)
    np.fill_diagonal(apart, np.inf)
    return float((truth[apart.argmin(axis=1)] == truth).mean())


def random_forest(features: Floats, truth: NDArray[np.str_]) -> float | None:
    """Return the out-of-bag share that a random forest names right; None without scikit-learn."""
    if find_spec("sklearn") is None:
        return None
    from sklearn.ensemble import RandomForestClassifier

    forest = RandomForestClassifier(500, oob_score=True, random_state=0).fit(features, truth)
    return float(forest.oob_score_)


def expected_calibration_error(probability: Floats, right: NDArray[np.bool_]) -> float:
    """Return the mean difference of probability and share of right ones, over ten bins."""
    number = np.minimum((probability * 10).astype(int), 9)
    parts = [(number == k) for k in range(10)]
    return float(sum(abs(probability[one].sum() - right[one].sum()) for one in parts) / len(right))


def run(jobs: Iterable[Any], function: Callable[[Any], Any], processes: int) -> list[Any]:
    """Run jobs in processes, results in order."""
    with Pool(processes) as pool:
        return pool.map(function, jobs, 5)


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--scenes", type=int, default=100, help="of each shape")
    parser.add_argument("--views", type=int, nargs="+", default=[1, 2, 4])
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument(
        "--unknown", type=int, default=20, help="scenes of each shape left out of the library"
    )
    parser.add_argument("--json", type=Path, help="also write what was found, scene by scene")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        library = str(make_library(Path(folder)))
        without = {name: str(make_library(Path(folder), name)) for name in SHAPES}
        everything: list[dict[str, Any]] = []
        for views in given.views:
            scenes = [(name, views, seed) for name in SHAPES for seed in range(given.scenes)]
            rows = run([(*scene, library) for scene in scenes], named, given.processes)
            left = [(*scene, without[scene[0]]) for scene in scenes if scene[2] < given.unknown]
            unknown = run(left, named, given.processes)
            everything += rows + [{**row, "unknown": True} for row in unknown]
            print(_summary(views, rows, unknown), flush=True)
            truth = np.array([scene[0] for scene in scenes])
            found = run(scenes, descriptors, given.processes)
            for name in found[0]:
                features = np.array([one[name] for one in found])
                forest = random_forest(features, truth) if name == "regionprops" else None
                more = "" if forest is None else f", random forest {forest:.3f}"
                print(
                    f"  {name}: nearest neighbour {nearest_neighbour(features, truth):.3f}{more}", flush=True
                )
    if given.json:
        given.json.write_text(json.dumps(everything), encoding="utf-8")


def _summary(views: int, rows: list[dict[str, Any]], unknown: list[dict[str, Any]]) -> str:
    truth, nearest, name = (np.array([row[key] for row in rows]) for key in ("truth", "nearest", "name"))
    probability = np.array([row["probability"] for row in rows])
    right, is_named = nearest == truth, name != "cannot tell"
    seconds = np.median([row["seconds"] for row in rows])
    brier = ((probability - right) ** 2).mean()
    refused = np.mean([row["name"] == "cannot tell" for row in unknown]) if unknown else math.nan
    wrong = [f"{a} as {b}" for a, b in zip(truth[~right], nearest[~right], strict=True)]
    common = ", ".join(f"{one} {wrong.count(one)}" for one in sorted(set(wrong), key=wrong.count)[::-1][:6])
    return (
        f"{views} views: nearest right {right.mean():.3f}; named {is_named.mean():.3f}, of these right "
        f"{right[is_named].mean() if is_named.any() else math.nan:.3f}; Brier {brier:.3f}, calibration error "
        f"{expected_calibration_error(probability, right):.3f}; left out of the library and 'cannot tell' "
        f"{refused:.3f}; {seconds:.2f} s\n  {common}"
    )


if __name__ == "__main__":
    main()
