"""Survey blocks of surveys: runs of neighbouring lines, with outlines, in degrees."""

from collections.abc import Iterable, Iterator

import numpy as np
import shapely

from uavseg.arrays import Floats
from uavseg.flight.cover.survey import Survey
from uavseg.flight.mission.items import DEGREE_DECIMALS
from uavseg.flight.mission.mission import NEARLY_CONVEX, Position, SurveyBlock
from uavseg.flight.mission.plane import Plane
from uavseg.flight.params.plan import PlanParams

SLACK = 0.1  # spacings by which outlines are simplified
NEIGHBOURS = 1.05  # spacings between lines of one block, at most


def blocks_of_surveys(surveys: Iterable[Survey], plane: Plane, params: PlanParams) -> tuple[SurveyBlock, ...]:
    """Return the runs of neighbouring lines of surveys, with the positions of their waypoints in the mission.

    Surveys whose lines have straight legs before and after them have none, nor have those that are not
    photographed by distance: a ground station would fly them differently.
    """
    if params.spacing_m is None or (params.photos is not None and params.photos.trigger != "distance"):
        return ()
    return tuple(
        SurveyBlock(
            outline=_positions(_outline(lines), plane),
            waypoints=_positions(lines.reshape(-1, 2), plane),
            angle_deg=flown.angle_deg,
            spacing_m=float(params.spacing_m),
            height_m=float(params.altitude_m),
            photos=params.photos,
        )
        for flown in surveys
        if np.array_equal(flown.lines, flown.outer)
        for lines in _runs(flown, params.spacing_m)
    )


def _runs(flown: Survey, spacing_m: float) -> Iterator[Floats]:
    """Yield lines (k, 2, 2), k > 1, that follow each other a spacing apart, joined by straight legs."""
    lines = flown.lines
    along = np.array([np.sin(np.radians(flown.angle_deg)), np.cos(np.radians(flown.angle_deg))])
    across = lines.mean(axis=1) @ np.array([along[1], -along[0]])
    is_parallel = np.abs((lines[:, 1] - lines[:, 0]) @ np.array([along[1], -along[0]])) < 1e-3
    near = np.abs(np.diff(across)) <= NEIGHBOURS * spacing_m
    straight = np.array([len(leg) == 2 for leg in flown.legs], bool)
    same = near & straight & is_parallel[1:] & is_parallel[:-1]
    same[1:] &= np.sign(np.diff(across))[1:] == np.sign(np.diff(across))[:-1]
    todo = np.split(lines, np.flatnonzero(~same) + 1)[::-1]
    while todo:  # runs over concave places are divided where the ends of lines jump most
        run = todo.pop()
        if len(run) < 2:
            continue
        outline = shapely.Polygon(_outline(run))
        if len(run) == 2 or outline.area >= NEARLY_CONVEX * outline.convex_hull.area:
            yield run
            continue
        ends = np.sort(run @ along, axis=1)
        split = int(np.abs(np.diff(ends, axis=0)).sum(axis=1).argmax()) + 1
        todo += [run[split:], run[:split]]


def _outline(lines: Floats) -> Floats:
    """Return the outline of the strips of evenly spaced lines, with few corners."""
    along = lines[0, 1] - lines[0, 0]
    ahead = (lines @ along)[:, 1] > (lines @ along)[:, 0]
    turned = np.where(ahead[:, None, None], lines, lines[:, ::-1])
    step = (lines[-1] - lines[0]).mean(axis=0)
    across = np.array([-along[1], along[0]]) / max(float(np.hypot(*along)), 1e-9)
    spacing_m = abs(float(step @ across)) / (len(lines) - 1)
    half = np.sign(step @ across) * across * spacing_m / 2
    left = np.concatenate([turned[:1, 0] - half, turned[1:-1, 0], turned[-1:, 0] + half])
    right = np.concatenate([turned[:1, 1] - half, turned[1:-1, 1], turned[-1:, 1] + half])
    simple = shapely.simplify(shapely.Polygon(np.concatenate([left, right[::-1]])), SLACK * spacing_m)
    corners: Floats = shapely.get_coordinates(simple)[:-1]
    return corners


def _positions(xy: Floats, plane: Plane) -> tuple[Position, ...]:
    lon, lat = plane.lonlat_from_xy(*xy.T)
    return tuple(map(tuple, np.round(np.column_stack([lat, lon]), DEGREE_DECIMALS).tolist()))
