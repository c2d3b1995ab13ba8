"""Flight patterns of a region: a point, its outline, or survey lines; with notes for the pilot."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from uavseg.flight.legs import leaving_hull, legs_between, outside_m
from uavseg.flight.params import PlanParams
from uavseg.flight.perimeter import default_tolerance_m, perimeter
from uavseg.flight.survey import reverse_path, survey

Floats = NDArray[np.float64]
CandidatePaths = tuple[list[list[Floats]], list[str]]  # candidate paths (N, 2) of each region; notes

MAX_STARTS = 16  # corners at which a perimeter may begin
MAX_UNCOVERED = 0.01  # share of the area that needs no note


@dataclass(frozen=True, slots=True)
class RegionPart:
    """One connected region in metres, and a point (x, y) inside it."""

    polygon: Any
    point: tuple[float, float]


def visits(parts: Sequence[RegionPart], params: PlanParams) -> CandidatePaths:
    """The point inside each region."""
    return [[np.array([part.point])] for part in parts], []


def perimeters(parts: Sequence[RegionPart], params: PlanParams) -> CandidatePaths:
    """The outline of each region, with several corners as candidates for its start."""
    tolerances = [params.tolerance_m or default_tolerance_m(part.polygon) for part in parts]
    candidates = []
    for part, tolerance_m in zip(parts, tolerances, strict=True):
        ring = perimeter(part.polygon, tolerance_m)[:-1]
        starts = range(0, len(ring), -(-len(ring) // MAX_STARTS))
        candidates.append([np.roll(ring, -start, axis=0)[[*range(len(ring)), 0]] for start in starts])
    return candidates, [f"outlines are simplified by up to {max(tolerances):.3g} m (--tolerance)"]


def surveys(parts: Sequence[RegionPart], params: PlanParams) -> CandidatePaths:
    """Survey lines over each region, in either direction, with notes on the legs between them."""
    assert params.spacing_m is not None
    candidates, outside, uncovered, leaving = [], 0.0, 0.0, 0
    for part in parts:
        flown = survey(part.polygon, params.spacing_m, params.angle_deg)
        candidates.append([path.reshape(-1, 2) for one in flown.paths for path in (one, reverse_path(one))])
        legs = legs_between(flown.paths[0])
        outside += float(outside_m(part.polygon, legs).sum())
        uncovered += _uncovered_m2(part.polygon, flown.paths[0], params.spacing_m)
        leaving += len(leaving_hull(part.polygon, legs, params.spacing_m))
    return candidates, _survey_notes(outside, uncovered / sum(part.polygon.area for part in parts), leaving)


def _uncovered_m2(region: Any, path: Floats, spacing_m: float) -> float:
    """Area of a region that is farther than half a spacing from every line, in square metres."""
    swaths = shapely.buffer(shapely.linestrings(path), spacing_m / 2, quad_segs=4)
    return float(shapely.difference(region, shapely.union_all(swaths)).area)


def _survey_notes(outside: float, uncovered: float, leaving: int) -> list[str]:
    notes = []
    if leaving:
        notes.append(
            f"{leaving} legs between survey lines leave the hull of their region by more than a spacing"
        )
    if outside >= 1:
        notes.append(
            f"legs between survey lines lie outside of their regions, inside their hulls, for {outside:.0f} m"
        )
    if uncovered > MAX_UNCOVERED:
        notes.append(
            f"{uncovered:.0%} of the area lies farther than half a spacing from every line; "
            "a narrower spacing or another angle reaches it"
        )
    return notes
