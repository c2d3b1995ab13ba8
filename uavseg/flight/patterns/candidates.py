"""Flight patterns of a region: a point, its outline, lines over it, a circle; with notes for the pilot."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from uavseg.errors import MissionError
from uavseg.flight.avoid.enclosing import MANY_CORNERS, enclosing
from uavseg.flight.cover.corridor import corridor, is_long_and_thin
from uavseg.flight.cover.space import COARSE
from uavseg.flight.cover.strips import LEAST_LINE_M
from uavseg.flight.cover.survey import CoverParams, Survey
from uavseg.flight.cover.survey import surveys as cover_region
from uavseg.flight.mission.track import HOVER_S, Track
from uavseg.flight.params.pattern import (
    LEAST_MARGIN_M,
    CorridorParams,
    OrbitParams,
    PerimeterParams,
    SurveyParams,
    VisitParams,
)
from uavseg.flight.params.plan import PlanParams
from uavseg.flight.patterns.orbit import orbit, orbit_trigger_m
from uavseg.flight.patterns.perimeter import default_tolerance_m
from uavseg.flight.patterns.photo_notes import photo_notes
from uavseg.flight.patterns.rings import OffsetRings, offset_rings

Floats = NDArray[np.float64]
MAX_STARTS = 16  # corners at which a ring may begin
MAX_CANDIDATES = 4000  # of all regions, so that their distances fit into memory
BRAKING_M_S2 = 2.5
MIN_LEG_S = 1.0
"""By default no leg of a perimeter is shorter than what the vehicle flies in this time."""
WORTHWHILE = 0.85  # of the cost of a survey: a corridor that costs less is suggested


@dataclass(frozen=True, slots=True)
class RegionPart:
    """One connected region in metres, a point (x, y) inside it, and where that is, for messages."""

    polygon: Any
    point: tuple[float, float]
    place: str = ""


@dataclass(frozen=True, slots=True)
class Candidates:
    """Tracks among which a planner chooses.

    Parameters
    ----------
    tracks : list of lists of Track
        For each thing to fly over or along its candidates, which may be reversed.
    places : list of str
        Where the region of each is, for messages.
    notes : list of str
        For the pilot.
    surveys : list of Survey, optional
        The surveys whose tracks they are.
    """

    tracks: list[list[Track]]
    places: list[str]
    notes: list[str]
    surveys: Sequence[Survey] = ()


def visits(parts: Sequence[RegionPart], params: PlanParams) -> Candidates:
    """The point inside each region."""
    assert isinstance(params.how, VisitParams)
    shot = params.photos is not None and params.photos.trigger == "hover"
    hold = np.array([max(params.how.hold_s, HOVER_S * shot)])
    none = Track.of_path(np.zeros((1, 2)))
    tracks = [
        [replace(none, xy=np.array([part.point]), hold_s=hold, shots=np.array([shot]))] for part in parts
    ]
    return Candidates(tracks, _places(parts), photo_notes(params, "one photograph over each region"))


def perimeters(parts: Sequence[RegionPart], params: PlanParams) -> Candidates:
    """The outline of each region, with several corners as candidates for its start."""
    assert isinstance(params.how, PerimeterParams)
    min_leg_m = params.how.min_leg_m
    min_leg_m = MIN_LEG_S * params.speed_m_s if min_leg_m is None else min_leg_m
    tolerances = [params.tolerance_m or default_tolerance_m(part.polygon) for part in parts]
    found = [
        offset_rings(part.polygon, params.how, tolerance, min_leg_m)
        for part, tolerance in zip(parts, tolerances, strict=True)
    ]
    rings = [(ring, part.place) for one, part in zip(found, parts, strict=True) for ring in one.rings]
    if not rings:
        raise MissionError(
            f"every region is narrower than {-2 * params.how.offset_m:g} m, so nothing is left inside at an "
            f"offset of {params.how.offset_m:g} m; give one that is nearer to 0"
        )
    note = f"outlines are simplified by up to {max(tolerances):.3g} m (--tolerance)"
    notes = [note, *_ring_notes(found, min_leg_m), *photo_notes(params)]
    tracks = [Track.of_line(ring, params.photos, params.altitude_m) for ring, _ in rings]
    return Candidates(_started_anywhere(tracks), [place for _, place in rings], notes)


def surveys(parts: Sequence[RegionPart], params: PlanParams) -> Candidates:
    """Survey lines over each region."""
    how = params.how
    assert params.spacing_m is not None and isinstance(how, SurveyParams)
    cover = CoverParams(
        params.spacing_m,
        params.angle_deg,
        *_line_ends(params),
        turn_m=_turn_m(params),
        lead_m=how.turnaround_m,
        crosshatch=how.crosshatch,
    )
    regions = _grown(parts, how.margin_m)
    found = [cover_region(region, cover) for region in regions]
    tracks = [
        [_lines_track(list(way.lines), list(way.outer), way.legs, params) for way in ways] for ways in found
    ]
    notes = [*_outline_notes(parts, params), *photo_notes(params)]
    if how.turnaround_m:
        notes.append(f"each line has {how.turnaround_m:g} m of straight flight outside before and after it")
    notes += _corridor_note(regions, [ways[0] for ways in found], params)
    return Candidates(tracks, _places(parts), notes, [way for ways in found for way in ways])


def corridors(parts: Sequence[RegionPart], params: PlanParams) -> Candidates:
    """Lines along the middle of each region."""
    assert params.spacing_m is not None and isinstance(params.how, CorridorParams)
    regions = _grown(parts, params.how.margin_m)
    found = [corridor(region, params.spacing_m, *_line_ends(params)) for region in regions]
    tracks = [[_lines_track(one.lines, one.lines, one.legs, params)] for one in found]
    notes = [*_outline_notes(parts, params), *photo_notes(params)]
    return Candidates(tracks, _places(parts), notes)


def orbits(parts: Sequence[RegionPart], params: PlanParams) -> Candidates:
    """A circle around each region, with the camera towards its middle."""
    assert isinstance(params.how, OrbitParams)
    found = [orbit(part.polygon, params.how.margin_m, params.speed_m_s) for part in parts]
    tracks, triggers = [], []
    for one, part in zip(found, parts, strict=True):
        track = Track.of_path(one.ring)
        if params.photos is not None:
            triggers.append(orbit_trigger_m(params.photos, one, part.polygon, params.altitude_m))
            track = Track.with_photos(one.ring, params.photos, triggers[-1])
        tracks.append(replace(track, look_at=np.tile(one.centre, (len(track.xy) - 1, 1))))
    notes = []
    small = sum(one.radius_m == one.least_radius_m for one in found)
    if small:
        notes.append(
            f"{small} of {len(found)} circles have a radius of {found[0].least_radius_m:.1f} m, the smallest "
            f"at {params.speed_m_s:g} m/s"
        )
    often = f"a photograph every {min(triggers):.1f} m or more" if triggers else ""
    notes += photo_notes(params, often) or ["no photographs are taken; give a camera (--camera) for that"]
    return Candidates(_started_anywhere(tracks), _places(parts), notes)


def _places(parts: Sequence[RegionPart]) -> list[str]:
    return [part.place for part in parts]


def _grown(parts: Sequence[RegionPart], margin_m: float) -> list[Any]:
    if margin_m < LEAST_MARGIN_M:
        return [part.polygon for part in parts]
    reach_m = _outline_reach_m(margin_m)
    return [shapely.buffer(enclosing(part.polygon, reach_m), margin_m) for part in parts]


def _outline_reach_m(margin_m: float) -> float:
    """How far outlines of fewer corners reach beyond regions that are grown by a margin."""
    return max(margin_m / 8, 1.0)


def _line_ends(params: PlanParams) -> tuple[float, float]:
    """How far photographs show ground beyond the ends of lines, and the length of the shortest line."""
    photos, height = params.photos, params.altitude_m
    return (
        (0.0, LEAST_LINE_M) if photos is None else (photos.line_reach_m(height), photos.least_line_m(height))
    )


def _turn_m(params: PlanParams) -> float:
    return params.speed_m_s**2 / BRAKING_M_S2


def _lines_track(
    lines: Sequence[Floats], outer: Sequence[Floats], legs: Sequence[Floats], params: PlanParams
) -> Track:
    """Lines with photographs; straight legs before and after them, and legs between, without."""
    tracks = []
    for k, (line, longer) in enumerate(zip(lines, outer, strict=True)):
        if k:
            tracks.append(Track.of_way(legs[k - 1]))
        if (longer[0] != line[0]).any():
            tracks.append(Track.of_path(np.stack([longer[0], line[0]])))
        tracks.append(Track.of_line(line, params.photos, params.altitude_m))
        if (longer[-1] != line[-1]).any():
            tracks.append(Track.of_path(np.stack([line[-1], longer[-1]])))
    return Track.joined(tracks)


def _started_anywhere(tracks: Sequence[Track]) -> list[list[Track]]:
    """Closed tracks with several of their corners as candidates for the start."""
    most = max(min(MAX_STARTS, MAX_CANDIDATES // len(tracks)), 1)
    candidates = []
    for track in tracks:
        corners = len(track.xy) - 1
        candidates.append([track.started_at(k) for k in range(0, corners, -(-corners // most))])
    return candidates


def _ring_notes(found: Sequence[OffsetRings], min_leg_m: float) -> list[str]:
    notes = []
    narrow = sum(not one.rings for one in found)
    if narrow:
        notes.append(f"{narrow} of {len(found)} regions are too narrow for the offset and not flown")
    holes = sum(one.holes for one in found)
    if holes:
        notes.append(f"the outlines of {holes} hole{'s' * (holes != 1)} are not flown (--holes fly)")
    moved = max(one.moved_m for one in found)
    if moved:
        notes.append(
            f"for legs of {min_leg_m:g} m or more, corners are left out: paths lie up to {moved:.1f} m "
            "beside the outline (--min-leg)"
        )
    short = sum(one.has_short_legs for one in found)
    if short:
        notes.append(f"{short} of {len(found)} regions are too small for legs of {min_leg_m:g} m (--min-leg)")
    return notes


def _outline_notes(parts: Sequence[RegionPart], params: PlanParams) -> list[str]:
    """A note where `_grown` and `flight_space` take outlines of fewer corners."""
    assert params.spacing_m is not None and isinstance(params.how, SurveyParams | CorridorParams)
    many = sum(shapely.get_num_coordinates(part.polygon) > MANY_CORNERS for part in parts)
    if not many:
        return []
    margin_m = params.how.margin_m
    reach_m = COARSE * params.spacing_m + (_outline_reach_m(margin_m) if margin_m >= LEAST_MARGIN_M else 0)
    return [
        f"{many} of {len(parts)} regions have outlines of more than {MANY_CORNERS} corners: they are "
        f"simplified and reach up to {reach_m:.3g} m farther, and holes of less than "
        f"{params.spacing_m**2:.3g} m2 are flown over"
    ]


def _corridor_note(regions: Sequence[Any], flown: Sequence[Survey], params: PlanParams) -> list[str]:
    """A note where corridors would take clearly less time."""
    assert params.spacing_m is not None
    if params.angle_deg is not None or params.how != SurveyParams():
        return []
    bent = [
        k
        for k, region in enumerate(regions)
        if shapely.get_num_coordinates(region) <= MANY_CORNERS and is_long_and_thin(region, params.spacing_m)
    ]
    before = after = 0.0
    for k in bent:
        other = corridor(regions[k], params.spacing_m, *_line_ends(params))
        before += flown[k].length_m + _turn_m(params) * flown[k].turns
        after += other.length_m + _turn_m(params) * other.turns
    if not bent or after > WORTHWHILE * before:
        return []
    return [
        f"{len(bent)} of {len(regions)} regions are long, thin and bent: --pattern corridor would take about "
        f"{100 * (1 - after / before):.0f} % less over them"
    ]
