"""Flight patterns of a region: a point, its outline, or survey lines; with notes for the pilot."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from uavseg.flight.cover.survey import CoverParams
from uavseg.flight.cover.survey import surveys as cover_region
from uavseg.flight.params import PlanParams
from uavseg.flight.perimeter import default_tolerance_m, perimeter
from uavseg.flight.targets import RegionPart
from uavseg.flight.track import Track

Floats = NDArray[np.float64]
CandidateTracks = tuple[
    list[list[Track]], list[str]
]  # candidate tracks of each region, which may be reversed; notes

MAX_STARTS = 16  # corners at which a perimeter may begin
MAX_CANDIDATES = 4000  # of all regions, so that their distances fit into memory
BRAKING_M_S2 = 2.5


def visits(parts: Sequence[RegionPart], params: PlanParams) -> CandidateTracks:
    """The point inside each region."""
    return [[Track.of_path(np.array([part.point]))] for part in parts], []


def perimeters(parts: Sequence[RegionPart], params: PlanParams) -> CandidateTracks:
    """The outline of each region, with several corners as candidates for its start."""
    tolerances = [params.tolerance_m or default_tolerance_m(part.polygon) for part in parts]
    most = max(min(MAX_STARTS, MAX_CANDIDATES // len(parts)), 1)
    candidates = []
    for part, tolerance_m in zip(parts, tolerances, strict=True):
        ring = perimeter(part.polygon, tolerance_m)[:-1]
        starts = range(0, len(ring), -(-len(ring) // most))
        rings = [np.roll(ring, -start, axis=0)[[*range(len(ring)), 0]] for start in starts]
        candidates.append([Track.of_path(one) for one in rings])
    return candidates, [f"outlines are simplified by up to {max(tolerances):.3g} m (--tolerance)"]


def surveys(parts: Sequence[RegionPart], params: PlanParams) -> CandidateTracks:
    """Survey lines over each region."""
    assert params.spacing_m is not None
    photos, height = params.photos, params.altitude_m
    reach = 0.0 if photos is None else photos.reach_m(height)
    turn = params.speed_m_s**2 / BRAKING_M_S2
    cover = CoverParams(params.spacing_m, params.angle_deg, reach, turn)
    candidates = []
    for part in parts:
        ways = cover_region(part.polygon, cover)
        candidates.append([Track.of_survey(way, photos, height) for way in ways])
    return candidates, _photo_notes(params)


def _photo_notes(params: PlanParams) -> list[str]:
    photos, height = params.photos, params.altitude_m
    if photos is None:
        return ["no photographs are taken; give a camera (--camera) for that"]
    across, along = photos.camera.footprint_m(height, photos.pitch_deg)
    return [
        f"{photos.camera.name} at {height:.1f} m over flat ground: "
        f"{100 * photos.camera.gsd_m(height, photos.pitch_deg):.2f} cm per pixel, footprint "
        f"{across:.0f} x {along:.0f} m, lines {params.spacing_m:.1f} m apart, a photograph every "
        f"{photos.trigger_m(height):.1f} m"
    ]
