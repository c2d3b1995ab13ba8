"""Flight patterns of a region: a point, its outline, lines over it, a circle; with notes for the pilot."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import shapely

from uavseg.arrays import Bools, Floats
from uavseg.dataclass import dataclass
from uavseg.errors import MissionError
from uavseg.flight.avoid.enclosing import MANY_CORNERS, enclosing
from uavseg.flight.camera.camera import NADIR_DEG, Photos
from uavseg.flight.cover.corridor import corridor, is_long_and_thin
from uavseg.flight.cover.lines import COARSE, MIN_LINE_M
from uavseg.flight.cover.survey import MIN_TRIES, Costs, CoverParams, Survey, surveys as cover_region
from uavseg.flight.mission.duration import CALM, leg_seconds
from uavseg.flight.mission.track import HOVER_S, Track
from uavseg.flight.params import plan
from uavseg.flight.patterns.perimeter import OffsetRings, default_tolerance_m, offset_rings

SEARCHED, MAX_TRIES = 120, 60  # surveys of all regions that are planned to the end; of one
MAX_CHOICES = 20  # surveys of one region of which the fastest flight is chosen
MAX_STARTS = 16  # corners at which a ring may begin
MAX_CANDIDATES = 4000  # of all regions, so that their distances fit into memory
BRAKING_M_S2 = 2.5
MIN_LEG_S = 1.0  # by default no leg of a perimeter is shorter than what the vehicle flies in this time
WORTHWHILE = 0.85  # of the cost of a survey: a corridor that costs less is suggested

MIN_RADIUS_M = 5.0
LATERAL_M_S2 = 2.5  # across the direction of flight: at 5 m/s a circle has a radius of 10 m at least
SAGITTA, MAX_SAGITTA_M = 0.02, 3.0  # share of the radius by which corners may lie outside of the circle
MAX_CORNERS = 72
LARGEST_STEP_DEG = 15.0  # between directions of photographs; with more, matching of photographs fails
NO_PHOTOS = "no photographs are taken; give a camera (--camera) for that"


@dataclass(frozen=True, slots=True)
class RegionPart:
    """One connected region in metres, a point (x, y) inside it, and its position, for messages."""

    polygon: Any
    point: tuple[float, float]
    place: str = ""


@dataclass(frozen=True, slots=True)
class Candidates:
    """Tracks among which a planner chooses."""

    tracks: list[list[Track]]  # for each region or ring; they may be reversed
    places: list[str]  # position of the region of each, for messages
    notes: list[str]  # for the pilot
    surveys: Sequence[Survey] = ()  # of the tracks


def visits(parts: Sequence[RegionPart], params: plan.PlanParams) -> Candidates:
    """Return tracks to the point inside each region."""
    assert isinstance(params.how, plan.VisitParams)
    shot = params.photos is not None and params.photos.trigger == "hover"
    hold = np.array([max(params.how.hold_s, HOVER_S * shot)])
    none = Track.of_path(np.zeros((1, 2)))
    none = replace(none, hold_s=hold, shots=np.array([shot]))
    tracks = [[replace(none, xy=np.array([part.point]))] for part in parts]
    return Candidates(tracks, _places(parts), _photo_notes(params, "one photograph over each region"))


def perimeters(parts: Sequence[RegionPart], params: plan.PlanParams) -> Candidates:
    """Return tracks along the outline of each region, with several corners as candidates for the start."""
    assert isinstance(params.how, plan.PerimeterParams)
    min_leg_m = MIN_LEG_S * params.speed_m_s if params.how.min_leg_m is None else params.how.min_leg_m
    tolerances = [params.tolerance_m or default_tolerance_m(part.polygon) for part in parts]
    offsets = [
        offset_rings(part.polygon, params.how, tolerance, min_leg_m)
        for part, tolerance in zip(parts, tolerances, strict=True)
    ]
    rings = [(ring, part.place) for one, part in zip(offsets, parts, strict=True) for ring in one.rings]
    if not rings:
        raise MissionError(
            f"every region is narrower than {-2 * params.how.offset_m:g} m, so nothing is left inside at an "
            f"offset of {params.how.offset_m:g} m; give one that is nearer to 0"
        )
    note = f"outlines are simplified by up to {max(tolerances):.3g} m (--tolerance)"
    notes = [note, *_ring_notes(offsets, min_leg_m), *_photo_notes(params)]
    tracks = [Track.of_line(ring, params.photos, params.altitude_m) for ring, _ in rings]
    return Candidates(_started_anywhere(tracks), [place for _, place in rings], notes)


def surveys(parts: Sequence[RegionPart], params: plan.PlanParams, home: Floats | None = None) -> Candidates:
    """Return tracks of survey lines over each region.

    The effort is shared: `SEARCHED` surveys are planned to the end, but `MIN_TRIES` at least for each region.
    They are compared by their times; for one region with the flight from `home` (2,) and the return. With
    several gimbal pitches each region has one track.
    """
    how = params.how
    assert params.spacing_m is not None and isinstance(how, plan.SurveyParams)
    reach_m, min_m = _line_ends(params)
    is_many = len(parts) > 1
    cover = CoverParams(
        spacing_m=params.spacing_m,
        angle_deg=params.angle_deg,
        reach_m=reach_m,
        min_m=min_m,
        costs=_line_costs(params),
        lead_m=how.turnaround_m,
        crosshatch=how.crosshatch,
        tries=min(max(SEARCHED // len(parts), MIN_TRIES), MAX_TRIES),
        home=None if home is None or is_many or how.crosshatch else tuple(home.tolist()),
    )
    regions = _grown(parts, how.margin_m)
    notes = [*_outline_notes(parts, params), *_photo_notes(params)]
    if len(params.passes) > 1:
        around = [_from_all_sides(region, params, replace(cover, home=None)) for region in regions]
        tracks, choices = [[track] for track, _ in around], [down for _, down in around]
    else:
        kept = max(MAX_CHOICES // len(regions), 2)
        choices = [_distinct(cover_region(region, cover), params.spacing_m)[:kept] for region in regions]
        tracks = [[_lines_track(one.lines, one.outer, one.legs, params) for one in some] for some in choices]
        notes += _corridor_note(regions, [some[0] for some in choices], params)
    if how.turnaround_m:
        notes.append(f"each line has {how.turnaround_m:g} m of straight flight outside before and after it")
    return Candidates(tracks, _places(parts), notes, surveys=[survey for some in choices for survey in some])


def _distinct(found: Sequence[Survey], apart_m: float) -> list[Survey]:
    """Return surveys without those that begin and end less than a distance from where a cheaper one does."""
    kept: list[Survey] = []
    ends = np.empty((0, 2, 2))
    for flown in found:
        own = np.stack([flown.outer[0, 0], flown.outer[-1, 1]])
        off_m = [np.hypot(*(ends - one).T).max(axis=0) for one in (own, own[::-1])]
        if not (np.minimum(*off_m) < apart_m).any():
            kept.append(flown)
            ends = np.concatenate([ends, own[None]])
    return kept


def _from_all_sides(region: Any, params: plan.PlanParams, cover: CoverParams) -> tuple[Track, list[Survey]]:
    """Join the lines of all gimbal pitches; those of a tilted camera in two azimuths, each there and back."""
    # Return the track, and the surveys straight down.
    tracks: list[Track] = []
    down: list[Survey] = []
    for one in params.passes:
        assert one.photos is not None and one.spacing_m is not None
        cover = replace(cover, spacing_m=one.spacing_m)
        is_tilted = one.photos.pitch_deg > NADIR_DEG
        if is_tilted:
            reach_m, min_m = one.photos.side_reach_m(one.altitude_m), one.photos.min_line_m(one.altitude_m)
            cover = replace(cover, reach_m=reach_m, min_m=min_m, crosshatch=False)
        for _ in range(1 + is_tilted):
            flown = cover_region(region, cover)[0]
            track = _lines_track(flown.lines, flown.outer, flown.legs, one)
            end = tracks[-1].xy[-1] if tracks else track.xy[0]
            is_turned = math.dist(track.xy[-1], end) < math.dist(track.xy[0], end)
            tracks.append(track.reversed() if is_turned else track)
            cover = replace(cover, angle_deg=flown.angle_deg + 90 * is_tilted)
        down += [] if is_tilted else [flown]
        tracks += [track.reversed() for track in tracks[-2:]] if is_tilted else []
    joined = tracks[:1]
    for before, after in pairwise(tracks):
        joined += [Track.transit(np.array([before.xy[-1], after.xy[0]])), after]
    return Track.joined(joined), down


def corridors(parts: Sequence[RegionPart], params: plan.PlanParams) -> Candidates:
    """Return tracks of lines along the middle of each region."""
    assert params.spacing_m is not None and isinstance(params.how, plan.CorridorParams)
    regions = _grown(parts, params.how.margin_m)
    flown = [corridor(region, params.spacing_m, *_line_ends(params)) for region in regions]
    tracks = [[_lines_track(one.lines, one.lines, one.legs, params)] for one in flown]
    return Candidates(tracks, _places(parts), [*_outline_notes(parts, params), *_photo_notes(params)])


def orbits(parts: Sequence[RegionPart], params: plan.PlanParams) -> Candidates:
    """Return tracks of a circle around each region, with the camera towards its middle."""
    assert isinstance(params.how, plan.OrbitParams)
    circles = [orbit(part.polygon, params.how.margin_m, params.speed_m_s) for part in parts]
    tracks, triggers = [], []
    for one, part in zip(circles, parts, strict=True):
        track = Track.of_path(one.ring)
        if params.photos is not None:
            triggers.append(orbit_trigger_m(params.photos, one, part.polygon, params.altitude_m))
            track = Track.with_photos(one.ring, params.photos, triggers[-1])
        tracks.append(replace(track, look_at=np.tile(one.centre, (len(track.xy) - 1, 1))))
    notes = []
    small = sum(one.radius_m == one.min_radius_m for one in circles)
    if small:
        notes.append(
            f"{small} of {len(circles)} circles have a radius of {circles[0].min_radius_m:.1f} m, "
            f"the smallest at {params.speed_m_s:g} m/s"
        )
    often = f"a photograph every {min(triggers):.1f} m or more" if triggers else ""
    notes += _photo_notes(params, often) or [NO_PHOTOS]
    return Candidates(_started_anywhere(tracks), _places(parts), notes)


def _places(parts: Sequence[RegionPart]) -> list[str]:
    return [part.place for part in parts]


def _grown(parts: Sequence[RegionPart], margin_m: float) -> list[Any]:
    if margin_m < plan.MIN_MARGIN_M:
        return [part.polygon for part in parts]
    return [shapely.buffer(enclosing(part.polygon, _outline_reach_m(margin_m)), margin_m) for part in parts]


def _outline_reach_m(margin_m: float) -> float:
    """Return the distance by which outlines of fewer corners exceed regions that are grown by a margin."""
    return max(margin_m / 8, 1.0)


def _line_ends(params: plan.PlanParams) -> tuple[float, float]:
    """Return the ground that photographs show past the ends of lines, and the length of the shortest line."""
    photos, height = params.photos, params.altitude_m
    return (0.0, MIN_LINE_M) if photos is None else (photos.line_reach_m(height), photos.min_line_m(height))


def _line_costs(params: plan.PlanParams) -> Costs:
    """Return the function that estimates the time of legs, for `CoverParams`."""
    vehicle, photos = params.flown_by, params.photos
    height, speed = params.altitude_m, params.speed_m_s
    # one of unknown direction favours no azimuth
    wind = CALM if params.wind is None or params.wind.from_deg is None else params.wind

    def seconds(xy: Floats, speeds: Floats | float, stops: Bools) -> Floats:
        path = np.column_stack([xy, np.full(len(xy), height)])
        return leg_seconds(path, speeds, vehicle, stops, wind=wind)

    on_lines = speed
    if photos is not None:
        trigger_m = photos.trigger_m(height)
        on_lines = min(speed, photos.max_speed_m_s(height, trigger_m))
        if photos.trigger == "hover":
            one = seconds(np.array([[0.0, 0.0], [trigger_m, 0.0]]), speed, np.ones(2, bool))
            on_lines = trigger_m / (HOVER_S + float(one[0]))
    speeds = np.array([speed, on_lines, vehicle.return_speed_m_s])  # as WAY, LINE, RETURN
    return lambda xy, kind, stops: seconds(xy, speeds[kind], stops)


def _turn_m(params: plan.PlanParams) -> float:
    return params.speed_m_s**2 / BRAKING_M_S2


def _lines_track(
    lines: Iterable[Floats], outer: Iterable[Floats], legs: Sequence[Floats], params: plan.PlanParams
) -> Track:
    """Join lines with photographs to straight legs before and after them, and legs between, without."""
    tracks = []
    for k, (line, longer) in enumerate(zip(lines, outer, strict=True)):
        if k:
            tracks.append(Track.transit(legs[k - 1]))
        if (longer[0] != line[0]).any():
            tracks.append(Track.of_path(np.stack([longer[0], line[0]])))
        tracks.append(Track.of_line(line, params.photos, params.altitude_m))
        if (longer[-1] != line[-1]).any():
            tracks.append(Track.of_path(np.stack([line[-1], longer[-1]])))
    track = Track.joined(tracks)
    pitch_deg = NADIR_DEG if params.photos is None else params.photos.pitch_deg
    return replace(track, pitch_deg=np.where(track.is_line, pitch_deg, np.nan))


def _started_anywhere(tracks: Sequence[Track]) -> list[list[Track]]:
    """Return each closed track with several of its corners as candidates for the start."""
    max_starts = max(min(MAX_STARTS, MAX_CANDIDATES // len(tracks)), 1)
    starts = [range(0, len(track.xy) - 1, -(-(len(track.xy) - 1) // max_starts)) for track in tracks]
    return [[track.started_at(k) for k in some] for track, some in zip(tracks, starts, strict=True)]


def _ring_notes(offsets: Sequence[OffsetRings], min_leg_m: float) -> list[str]:
    notes = []
    if narrow := sum(not one.rings for one in offsets):
        notes.append(f"{narrow} of {len(offsets)} regions are too narrow for the offset and not flown")
    if holes := sum(one.holes for one in offsets):
        notes.append(f"the outlines of {holes} hole{'s' * (holes != 1)} are not flown (--holes fly)")
    if moved := max(one.moved_m for one in offsets):
        notes.append(
            f"for legs of {min_leg_m:g} m or more, corners are left out: paths lie up to {moved:.1f} m "
            "beside the outline (--min-leg)"
        )
    if short := sum(one.has_short_legs for one in offsets):
        notes.append(
            f"{short} of {len(offsets)} regions are too small for legs of {min_leg_m:g} m (--min-leg)"
        )
    return notes


def _outline_notes(parts: Sequence[RegionPart], params: plan.PlanParams) -> list[str]:
    """Return a note where `_grown` and `flight_space` take outlines of fewer corners."""
    assert params.spacing_m is not None and isinstance(params.how, plan.SurveyParams | plan.CorridorParams)
    many = sum(shapely.get_num_coordinates(part.polygon) > MANY_CORNERS for part in parts)
    if not many:
        return []
    margin_m = params.how.margin_m
    reach_m = COARSE * params.spacing_m + (_outline_reach_m(margin_m) if margin_m >= plan.MIN_MARGIN_M else 0)
    return [
        f"{many} of {len(parts)} regions have outlines of more than {MANY_CORNERS} corners: they are "
        f"simplified and reach up to {reach_m:.3g} m farther, and holes of less than "
        f"{params.spacing_m**2:.3g} m2 are flown over"
    ]


def _corridor_note(regions: Sequence[Any], flown: Sequence[Survey], params: plan.PlanParams) -> list[str]:
    """Return a note where corridors would take clearly less time."""
    assert params.spacing_m is not None
    if params.angle_deg is not None or params.how != plan.SurveyParams():
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


def _photo_notes(params: plan.PlanParams, how_often: str = "") -> list[str]:
    """Return notes about the photographs of a mission; by default they are taken along lines."""
    photos, height = params.photos, params.altitude_m
    if photos is None:
        return [NO_PHOTOS] if params.pattern in plan.COVERING else []
    across, along = photos.camera.footprint_m(height, photos.pitch_deg)
    lines = f"lines {params.spacing_m:.1f} m apart, " if params.spacing_m is not None else ""
    ground = "over flat ground" if params.terrain is None else "above the ground"
    often = how_often or f"a photograph every {photos.trigger_m(height):.1f} m"
    view = (
        f"footprint {across:.0f} x {along:.0f} m, "
        if params.pattern != "orbit"
        else "the camera looks at the middle of each region, at the height of home, "
    )
    notes = [
        f"{photos.camera.name} at {height:.1f} m {ground}: "
        f"{100 * photos.camera.gsd_m(height, photos.pitch_deg):.2f} cm per pixel, {view}{lines}{often}"
    ]
    if photos.flatter_deg:
        each = [(one.photos or photos, _photo_notes(one)[0]) for one in params.passes]
        notes = [f"gimbal pitch {one.pitch_deg:g}: {note}" for one, note in each]
        outside_m = max(0.0, *(-one.side_reach_m(height) for one, _ in each))
        notes.append(
            "with the gimbal tilted, each place is photographed from four sides: lines begin and end up to "
            f"{outside_m:.0f} m outside of the regions"
        )
    if photos.trigger == "none":
        every = photos.trigger_m(height)
        notes.append(
            "the mission does not trigger the camera: start it by other means, with a photograph at least "
            f"every {every:.1f} m ({every / params.speed_m_s:.1f} s at {params.speed_m_s:g} m/s)"
        )
    elif photos.trigger != "distance":
        notes.append(
            "photographs are taken with IMAGE_START_CAPTURE (2000): try on the ground that the camera of "
            "this vehicle does so"
        )
    return notes


@dataclass(frozen=True, slots=True, eq=False)
class Orbit:
    """A circle around a region."""

    centre: tuple[float, float]  # in metres
    radius_m: float  # no point of the path is nearer to the centre
    min_radius_m: float  # the smallest at the speed of the vehicle; the radius where the region is small
    ring: Floats  # (n, 2), closed


def orbit(region: Any, margin_m: float, speed_m_s: float) -> Orbit:
    """Return the circle at a margin around the smallest circle around a region in metres, as waypoints.

    PX4 has no LOITER_TURNS in missions, and ArduPilot stores its radius in whole metres, up to 255 m, or in
    tens.

    Examples
    --------
    >>> circle = orbit(shapely.box(-30, -40, 30, 40), 10, 5)
    >>> round(circle.radius_m, 6), [round(abs(x), 6) for x in circle.centre]
    (60.0, [0.0, 0.0])
    """
    x, y = shapely.get_coordinates(shapely.centroid(shapely.minimum_bounding_circle(region)))[0].tolist()
    enclosing = float(np.hypot(*(shapely.get_coordinates(region.exterior) - (x, y)).T).max())
    min_radius = max(MIN_RADIUS_M, speed_m_s**2 / LATERAL_M_S2)
    radius = max(enclosing + margin_m, min_radius)
    sagitta = min(SAGITTA * radius, MAX_SAGITTA_M)
    count = min(math.ceil(math.pi / math.acos(radius / (radius + sagitta))), MAX_CORNERS)
    turn = 2 * math.pi * np.arange(count + 1) / count
    outer = radius / math.cos(math.pi / count)
    ring = np.column_stack([x + outer * np.sin(turn), y + outer * np.cos(turn)])
    ring[-1] = ring[0]
    return Orbit(centre=(x, y), radius_m=radius, min_radius_m=min_radius, ring=ring)


def orbit_trigger_m(photos: Photos, circle: Orbit, region: Any, height_m: float) -> float:
    """Return the distance in metres between the photographs of an orbit.

    Neighbouring images share the front overlap of their width at the nearest point of the region, by its
    slant distance, and their directions differ by 15 degrees at most. The region is in metres, and
    `height_m` above the ground.
    """
    near = math.hypot(float(shapely.distance(shapely.LineString(circle.ring), region)), height_m)
    across = near * photos.camera.sensor_mm[0] / photos.camera.focal_mm
    step = circle.radius_m * math.radians(LARGEST_STEP_DEG)
    return min(across * (1 - photos.overlap.front / 100), step)
