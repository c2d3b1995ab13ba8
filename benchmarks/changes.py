"""Maps that change: two maps compared, numbers of live segments, evidence that fades; on drawn scenes.

    python -m benchmarks.changes                  # the three tables, about ten minutes
    python -m benchmarks.changes --scenes 3 --updates 60 --scans 1000

Compared: scenes of two rooms with boxes, of which one is taken away, one is added and one is moved between
the runs. The second map lies in a frame that is shifted and turned. A change is found if a region of its kind
lies on it; a region is false if it lies on none. The plain difference is of trinary maps, cell by cell.

Numbers: maps are drawn cell by cell, with a door that swings, boxes that come and go, and two walkers. A true
segment is a connected set of solid cells of 8 x 8 pixels, known by the largest object in it. IDF1 is that of
Ristani et al. 2016: one global matching of true and found numbers, twice the updates in which they agree,
over all true and found ones.

Fading: scans from random places in one scene; cells on the outlines of walls and boxes that were occupied
after 200 scans, and are not at any time later; occupied cells farther than two cells from any outline; and
how many scans that see all of a place free the cells of a box that was taken away, after 50 scans with it.
"""

from __future__ import annotations

import argparse
import math
from collections import Counter
from collections.abc import Iterator, Sequence

import numpy as np
import shapely
from affine import Affine
from numpy.typing import NDArray
from rasterio.features import rasterize
from scipy import ndimage
from scipy.optimize import linear_sum_assignment

from uavseg.dataclass import dataclass
from uavseg.occupancy.mapping.grid import OccupancyGrid
from uavseg.occupancy.mapping.live import LiveSegmentation
from uavseg.occupancy.mapping.pending import GreyMap
from uavseg.occupancy.mapping.scan import Pose, Scan
from uavseg.occupancy.several_maps import Evidence, PlacedMap, changed_objects, moved, register
from uavseg.occupancy.simulation.simulate import RangeFinder, Scene
from uavseg.raster.grid.geobox import local_geobox
from uavseg.units import FREE, GREY_MAX, OCCUPIED

CELL_M, SIZE_M, SIGMA_M = 0.05, (9.0, 6.0), 0.03
SHIFTS = {
    "as it is": (0.0, 0.0, 0.0),
    "1 cell": (1.0, 0.0, 0.0),
    "(1.5, -1) cells": (1.5, -1.0, 0.0),
    "(2, 1) cells, 1 degree": (2.0, 1.0, 1.0),
    "(-3, 3) cells, -1.9 degrees": (-3.0, 3.0, -1.9),
}
SENSOR = RangeFinder(SIGMA_M, 8.0, fov_deg=360.0, step_deg=0.5)
Box = tuple[float, float, float, float]  # x, y, half sides
Frame = tuple[float, float, float]  # cells x, cells y, degrees
Mask = NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class Pair:
    """Two states of a place: walls, and boxes before and after."""

    walls: tuple[Box, ...]
    before: tuple[Box, ...]
    after: tuple[Box, ...]

    def scene(self, boxes: Sequence[Box]) -> Scene:
        """Return a state of the place as a scene."""
        return Scene(polygons=[_corners(box) for box in (*self.walls, *boxes)])


def _corners(box: Box) -> NDArray[np.float64]:
    x, y, half_x, half_y = box
    signs = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
    return (x, y) + signs * (half_x, half_y)


def draw_pair(seed: int) -> Pair:
    """Draw two rooms with a door, six boxes that stay, one that goes, one that comes, one that moves."""
    random = np.random.default_rng([seed, 1])
    width, height = SIZE_M
    door = random.uniform(1.5, 4.5)
    middle, thick = random.uniform(3.8, 5.2), 0.075
    walls = [(width / 2, 0.5, 4.0, thick), (width / 2, height - 0.5, 4.0, thick)]
    walls += [(0.5, height / 2, thick, 2.5), (width - 0.5, height / 2, thick, 2.5)]
    low, high = door - 0.45, door + 0.45
    walls.append((middle, (0.5 + low) / 2, thick, (low - 0.5) / 2))
    walls.append((middle, (high + height - 0.5) / 2, thick, (height - 0.5 - high) / 2))
    placed: list[Box] = []
    while len(placed) < 10:
        place = random.uniform(1, width - 1), random.uniform(1, height - 1)
        box = (*place, random.uniform(0.12, 0.3), random.uniform(0.12, 0.3))
        if abs(box[0] - middle) > 0.7 and all(_gap(box, one) > 0.25 for one in (*placed, *walls)):
            placed.append(box)
    stay, gone, new, source, target = placed[:6], placed[6], placed[7], placed[8], placed[9]
    return Pair(tuple(walls), (*stay, gone, source), (*stay, new, (*target[:2], *source[2:])))


def _gap(one: Box, other: Box) -> float:
    return max(abs(one[k] - other[k]) - one[k + 2] - other[k + 2] for k in (0, 1))


def run_map(scene: Scene, seed: int, frame: Frame = (0.0, 0.0, 0.0), poses: int = 40) -> OccupancyGrid:
    """Merge scans from free places into a map, in a frame that is moved around the middle of the map."""
    random, grid = np.random.default_rng([seed, 2]), empty_grid()
    for pose in places(scene, poses, random):
        scan = SENSOR.scan(scene, pose, random)
        x, y = place_of((pose.x, pose.y), frame)
        seen = Pose(x, y, heading_rad=pose.heading_rad + math.radians(frame[2]))
        grid.merge(Scan(seen, scan.angles, scan.ranges, scan.max_range_m, scan.sigma_m))
    return grid


def empty_grid(**fading: float) -> OccupancyGrid:
    """Return a grid without observations, of a size that holds the rooms."""
    shape = round(SIZE_M[1] / CELL_M), round(SIZE_M[0] / CELL_M)
    return OccupancyGrid(local_geobox(shape, CELL_M, (0.0, 0.0)), **fading)


def places(scene: Scene, count: int, random: np.random.Generator) -> Iterator[Pose]:
    """Yield random poses that are 20 cm from anything solid."""
    around = np.linspace(0, math.tau, 16)
    while count:
        x, y = random.uniform(0.8, SIZE_M[0] - 0.8), random.uniform(0.8, SIZE_M[1] - 0.8)
        if not scene.contains(x + 0.2 * np.cos(around), y + 0.2 * np.sin(around)).any():
            count -= 1
            yield Pose(x, y, heading_rad=random.uniform(0, math.tau))


def place_of(xy: tuple[float, float], frame: Frame) -> tuple[float, float]:
    """Return where a place lies in the frame that is moved by cells and degrees around the middle."""
    turn = math.radians(frame[2])
    u, v = xy[0] - SIZE_M[0] / 2, xy[1] - SIZE_M[1] / 2
    x = SIZE_M[0] / 2 + u * math.cos(turn) - v * math.sin(turn) + frame[0] * CELL_M
    return x, SIZE_M[1] / 2 + u * math.sin(turn) + v * math.cos(turn) + frame[1] * CELL_M


# Two maps


def compare_table(scenes: int) -> None:
    """Print recall and false changes of `compare`, and of a plain difference, by shift."""
    print("| second map | found | false | false, plain difference | shift within | angle within |")
    print("|---|--:|--:|--:|--:|--:|")
    for name, frame in SHIFTS.items():
        found, false, plain, far, turned = 0, 0, 0, 0.0, 0.0
        for seed in range(scenes):
            pair = draw_pair(seed)
            grids = run_map(pair.scene(pair.before), seed), run_map(pair.scene(pair.after), seed + 100, frame)
            first, second = (Evidence(PlacedMap("", one.probabilities, one.geobox)) for one in grids)
            lies = register(first, second)
            far = max(far, math.hypot(lies.shift[0] - frame[0], lies.shift[1] - frame[1]))
            turned = max(turned, abs(lies.angle_deg - frame[2]))
            for one, other, motion, boxes, back in (
                (first, second, lies.motion, pair.before[6:], lies.back),
                (second, first, lies.back, pair.after[6:], None),
            ):
                truth = [shapely.Polygon([place_of(tuple(c), frame) for c in _corners(box)]) for box in boxes]
                labels, kinds = changed_objects(one, other, motion, lies.cell_m)
                place = lies.motion if back is not None else Affine.identity()
                hits, wrong = _judged(
                    one, labels, [int(k) + 1 for k in np.flatnonzero(kinds == 1)], truth, place
                )
                found, false = found + hits, false + wrong
                mask = (one.states == OCCUPIED) & (other.states == FREE)
                groups, count = ndimage.label(mask, np.ones((3, 3)))
                kept = [k for k in range(1, count + 1) if (groups == k).sum() >= 3]
                plain += _judged(one, groups, kept, truth, Affine.identity())[1]
        wanted = 4 * scenes
        print(f"| {name} | {found} of {wanted} | {false} | {plain} | {far:.2f} cells | {turned:.2f}° |")


def _judged(
    one: Evidence, labels: NDArray[np.generic], which: list[int], truth: list[shapely.Polygon], place: Affine
) -> tuple[int, int]:
    """Return how many true changes were found, and how many regions lie on none."""
    hits, wrong = set(), 0
    for k in which:
        rows, cols = (np.argwhere(labels == k) + 0.5).T
        points = shapely.points(moved(place, np.column_stack(one.geobox.xy_from_pixel(rows, cols))))
        near = [n for n, box in enumerate(truth) if (shapely.distance(box, points) < 0.15).any()]
        hits |= set(near)
        wrong += not near
    return len(hits), wrong


# Numbers of live segments

_FINE_M, _WIDTH, _HEIGHT = 0.0125, 9.6, 6.4


def identity_score(seed: int, updates: int) -> float:
    """Return the IDF1 of the numbers of occupied segments over the updates of a drawn scene."""
    random = np.random.default_rng([seed, 9])
    shape = round(_HEIGHT / _FINE_M), round(_WIDTH / _FINE_M)
    place = Affine(_FINE_M, 0, 0, 0, -_FINE_M, _HEIGHT)
    grey_map = GreyMap.empty(shape)
    live: LiveSegmentation | None = None
    agreeing: Counter[tuple[str, int]] = Counter()
    true, found = 0, 0
    for objects in _moving_scene(seed, updates):
        ids = rasterize([(one, k) for k, one in enumerate(objects.values(), 1)], shape, transform=place)
        edge = ndimage.maximum_filter(ids, 3) != ndimage.minimum_filter(ids, 3)
        occupied = (ids > 0) ^ (edge & (random.random(shape) < 0.2))
        p = np.where(occupied, np.clip(random.normal(0.9, 0.05, shape), 0, 1), 0.0025)
        grey_map.set_grey((GREY_MAX * p + 0.5).astype(np.uint16))
        live = live or LiveSegmentation(grey_map)
        live.changes()
        numbers = live.numbers()[: shape[0] // 8, : shape[1] // 8]
        segments = _true_segments(ids, list(objects))
        present = [int(one) for one in np.unique(numbers) if one]
        true, found = true + len(segments), found + len(present)
        for one in present:
            here = numbers == one
            shared, name = max((int((here & where).sum()), name) for name, where in segments.items())
            agreeing[name, one] += 2 * shared >= here.sum()
    names, ids_found = sorted({name for name, _ in agreeing}), sorted({one for _, one in agreeing})
    matrix = np.array([[agreeing[name, one] for one in ids_found] for name in names])
    rows, cols = linear_sum_assignment(-matrix)
    return float(2 * matrix[rows, cols].sum() / (true + found))


def _true_segments(ids: NDArray[np.int64], names: list[str]) -> dict[str, Mask]:
    """Return connected solid cells of 8 x 8 pixels, by the object that has most of them."""
    rows, cols = ids.shape[0] // 8, ids.shape[1] // 8
    cells = ids.reshape(rows, 8, cols, 8).transpose(0, 2, 1, 3).reshape(rows, cols, 64)
    labels, count = ndimage.label((cells > 0).mean(axis=2) > 0.5, np.ones((3, 3)))
    segments: dict[str, Mask] = {}
    for label in range(1, count + 1):
        here = labels == label
        name = names[int(np.bincount(cells[here].ravel(), minlength=len(names) + 1)[1:].argmax())]
        if name not in segments or here.sum() > segments[name].sum():
            segments[name] = here
    return segments


def _moving_scene(seed: int, updates: int) -> Iterator[dict[str, shapely.Geometry]]:
    """Yield the objects of a scene: walls with a swinging door, boxes of which two come and go, walkers."""
    random = np.random.default_rng([seed, 3])
    w, h, middle, door = _WIDTH, _HEIGHT, random.uniform(4.2, 5.4), random.uniform(2.2, 4.2)
    outer = shapely.box(0.2, 0.2, w - 0.2, h - 0.2) - shapely.box(0.45, 0.45, w - 0.45, h - 0.45)
    walls = outer | shapely.box(middle - 0.125, 0.3, middle + 0.125, door - 0.5)
    inner = shapely.box(middle - 0.125, door + 0.5, middle + 0.125, h - 0.8)
    lanes = [(1.2, middle - 1.2), (middle + 1.2, w - 1.2)]
    boxes: list[shapely.Geometry] = []
    keep_off = [walls, inner, shapely.Point(middle, door).buffer(0.8)]
    keep_off += [shapely.LineString([(x0, h / 2), (x1, h / 2)]).buffer(0.3) for x0, x1 in lanes]
    for _ in range(20_000):
        x, y = random.uniform(1, w - 1), random.uniform(1, h - 1)
        a, b = random.uniform(0.2, 0.35, 2)
        box = shapely.box(x - a, y - b, x + a, y + b)
        if len(boxes) < 6 and min(box.distance(one) for one in (*boxes, *keep_off)) > 0.5:
            boxes.append(box)
    for k in range(updates):
        angle = math.radians(90 * abs(math.sin(math.tau * k / updates)))
        tip = middle + 0.9 * math.sin(angle), door + 0.5 - 0.9 * math.cos(angle)
        leaf = shapely.LineString([(middle, door + 0.5), tip]).buffer(0.125, cap_style="flat")
        objects = {"walls": walls, "inner wall and door": inner | leaf}
        for n, box in enumerate(boxes):
            if not (n == 0 and k > 0.35 * updates) and not (n == 1 and k < 0.5 * updates):
                objects[f"box {n}"] = box
        for n, (x0, x1) in enumerate(lanes):
            along = (0.1 + 0.03 * n) * k % (2 * (x1 - x0))
            x = x0 + min(along, 2 * (x1 - x0) - along)
            objects[f"walker {n}"] = shapely.Point(x, h / 2).buffer(0.3)
        yield objects


# Evidence that fades

FADING: dict[str, dict[str, float]] = {
    "plain log-odds, ±6": {},
    "clamped, ±2 (OctoMap: 0.12 to 0.97)": {"clamp": 2.0},
    "half life of 10 scans": {"half_life": 10.0},
    "half life of 100 scans": {"half_life": 100.0},
    "forget_after=3": {"forget_after": 3},
    "forget_after=10": {"forget_after": 10},
}


def static_cells(pair: Pair) -> tuple[Mask, Mask]:
    """Return the cells on the outlines of walls and boxes, and those within two cells of them."""
    grid = empty_grid()
    x, y = grid.geobox.xy_from_pixel(*(np.indices(grid.geobox.shape) + 0.5))
    half = CELL_M / 2
    solids = [shapely.Polygon(_corners(box)).exterior for box in (*pair.walls, *pair.before)]
    lines = shapely.union_all(solids)
    cells: Mask = shapely.intersects(shapely.box(x - half, y - half, x + half, y + half), lines)
    return cells, ndimage.distance_transform_edt(~cells) <= 2


def cleared_cells(fading: dict[str, float], scans: int, warm: int = 200) -> tuple[int, int, int]:
    """Return static cells that were occupied, those of them cleared at any time, and stray occupied cells."""
    pair, random = draw_pair(0), np.random.default_rng(5)
    scene, grid = pair.scene(pair.before), empty_grid(**fading)
    static, near = static_cells(pair)
    known = cleared = np.zeros(static.shape, bool)
    for n, pose in enumerate(places(scene, scans, random)):
        grid.merge(SENSOR.scan(scene, pose, random))
        if n == warm:
            known = static & (grid.log_odds > 0)
        cleared = cleared | (known & (grid.log_odds <= 0))
    return int(known.sum()), int(cleared.sum()), int(((grid.log_odds > 0) & ~near).sum())


def scans_until_gone(fading: dict[str, float], seed: int, limit: int = 200) -> list[int]:
    """Return for each of two boxes that went after how many scans that see all of its place it is free."""
    pair, random = draw_pair(seed), np.random.default_rng([seed, 6])
    grid, scenes = empty_grid(**fading), [pair.scene(boxes) for boxes in (pair.before, pair.after)]
    for pose in places(scenes[0], 50, random):
        grid.merge(SENSOR.scan(scenes[0], pose, random))
    x, y = grid.geobox.xy_from_pixel(*(np.indices(grid.geobox.shape) + 0.5))
    others = shapely.MultiPolygon([shapely.Polygon(_corners(one)) for one in (*pair.walls, *pair.after)])
    off = shapely.distance(shapely.points(x, y), others) > 0.25
    held = [
        off
        & (np.abs(x - box[0]) < box[2] + 0.15)
        & (np.abs(y - box[1]) < box[3] + 0.15)
        & (grid.log_odds > 0)
        for box in pair.before[6:]
    ]
    left, seen = [limit] * len(held), [0] * len(held)
    for pose in places(scenes[1], limit, random):
        grid.merge(SENSOR.scan(scenes[1], pose, random))
        for k, (box, cells) in enumerate(zip(pair.before[6:], held, strict=True)):
            if left[k] == limit:
                seen[k] += _sees(scenes[1], pose, box)
                left[k] = limit if (cells & (grid.log_odds > 0)).any() else seen[k]
    return left


def _sees(scene: Scene, pose: Pose, box: Box) -> bool:
    """Return whether nothing hides a corner of where a box stood, nor 30 cm behind it."""
    dx, dy = (_corners(box) - (pose.x, pose.y)).T
    return bool((scene.cast(pose.x, pose.y, np.arctan2(dy, dx)) > np.hypot(dx, dy) + 0.3).all())


def fading_table(scans: int, scenes: int) -> None:
    """Print what each kind of fading clears of what stands, and how soon it forgets what went."""
    print("| evidence | static cells | cleared | stray cells | scans until gone: median, mean, largest |")
    print("|---|--:|--:|--:|--:|")
    for name, fading in FADING.items():
        known, cleared, stray = cleared_cells(fading, scans)
        until = [n for seed in range(scenes) for n in scans_until_gone(fading, seed)]
        shown = f"{int(np.median(until))}, {np.mean(until):.1f}, {max(until)}"
        print(f"| {name} | {known:,} | {cleared:,} | {stray:,} | {shown} |", flush=True)


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--scenes", type=int, default=10)
    parser.add_argument("--updates", type=int, default=200)
    parser.add_argument("--scans", type=int, default=10_000)
    given = parser.parse_args()
    compare_table(given.scenes)
    scores = [identity_score(seed, given.updates) for seed in range(given.scenes)]
    print(
        f"\nIDF1 over {given.updates} updates: mean {np.mean(scores):.4f}, each",
        *(f"{s:.4f}" for s in scores),
        "\n",
    )
    fading_table(given.scans, given.scenes)


if __name__ == "__main__":
    main()
