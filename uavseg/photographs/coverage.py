"""Coverage of an area by photographs: gaps, planned photographs that are missing, overlaps, motion blur."""

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from uavseg.arrays import Bools, Floats, Integers
from uavseg.dataclass import dataclass
from uavseg.errors import MissionError, PhotographError
from uavseg.execution.executors import steps_done
from uavseg.flight.camera.camera import BLUR_PX, NADIR_DEG, Camera
from uavseg.flight.mission.estimate import flown_path
from uavseg.flight.mission.items import FRAME_AMSL, FRAME_TERRAIN, ROI_LOCATION
from uavseg.flight.mission.mission import Ground as Below
from uavseg.flight.mission.mission import Mission
from uavseg.flight.mission.track import Plane
from uavseg.flight.mission.vehicle import default_vehicle
from uavseg.photographs.ground import Ground
from uavseg.photographs.photograph import Photograph
from uavseg.photographs.read import grouped
from uavseg.raster.geodesy.globe import wrap_lon

Objects = NDArray[np.object_]

COVERED = 0.999
"""Share of the area that photographs have to show."""
RIM = 0.05  # of a footprint, by which what a mission plans to show is larger than what has to be covered
SLIVER, LOST = 0.01, 0.0005  # smaller gaps are left out (of a footprint), unless they are more (of the area)
THIN_M = 0.1  # narrower parts of gaps are left out in the same way
MAX_PLANNED = 50_000
_STRAIGHT = math.cos(math.radians(15))
_STEEP_DEG = -85.0  # below, lines flown in opposite directions show the same
_LONGEST_EDGE_M = 300.0  # which bends by less than a centimetre in degrees
_LEAST_M2 = 1.0  # of slivers that a note is about
_NOWHERE = shapely.Polygon()


@dataclass(frozen=True, slots=True)
class Missing:
    """A planned photograph that was not taken: its number, the item that its leg leads to, and its place."""

    number: int
    item: int
    lon: float
    lat: float


@dataclass(frozen=True, slots=True)
class Overlaps:
    """Median and least share of a footprint that the next one along a line, and the line beside, show too.

    None where there are no two.
    """

    along: tuple[float, float] | None
    beside: tuple[float, float] | None

    def as_dict(self) -> dict[str, Any]:
        """Return them as plain values, for JSON."""
        both = {"along": self.along, "beside": self.beside}
        return {
            name: None if found is None else dict(zip(("median", "least"), map(_rounded, found), strict=True))
            for name, found in both.items()
        }


@dataclass(frozen=True)
class Coverage:
    """What photographs show of an area, against what a mission plans."""

    planned: int  # photographs
    taken: int
    others: int  # of those that were taken: not near to any planned one
    missing: tuple[Missing, ...]
    area_m2: float
    seen: tuple[float, float, float]  # shares of the area that at least one, two and three show
    gaps: tuple[Any, ...]  # polygons in degrees (lon, lat; WGS 84), largest first
    gap_areas_m2: tuple[float, ...]
    slivers_m2: float  # gaps that are too small to be among them
    overlaps: Overlaps
    planned_overlaps: Overlaps
    blurred: tuple[str, ...]  # names of those that motion blurs by more than `BLUR_PX`
    not_judged: int  # whose exposure time or speed is not known
    notes: tuple[str, ...] = ()

    @property
    def is_whole(self) -> bool:
        """Whether the photographs show the area."""
        return self.seen[0] >= COVERED

    def as_dict(self) -> dict[str, Any]:
        """Return the coverage as plain values, for JSON; without the outlines of gaps."""
        return {
            "planned": self.planned,
            "taken": self.taken,
            "others": self.others,
            "missing": [
                {"number": one.number, "item": one.item, "lon": round(one.lon, 8), "lat": round(one.lat, 8)}
                for one in self.missing
            ],
            "area_m2": round(self.area_m2, 1),
            "covered": _rounded(self.seen[0]),
            "seen_twice": _rounded(self.seen[1]),
            "seen_three_times": _rounded(self.seen[2]),
            "gaps": len(self.gaps),
            "gaps_m2": round(sum(self.gap_areas_m2), 1),
            "slivers_m2": round(self.slivers_m2, 1),
            "overlap": self.overlaps.as_dict(),
            "planned_overlap": self.planned_overlaps.as_dict(),
            "blurred": list(self.blurred),
            "blur_not_known": self.not_judged,
        }


def _rounded(share: float) -> float:
    return math.floor(share * 1e5 + 1e-6) / 1e5  # what is not whole is not told as whole


def coverage(
    mission: Mission,
    photographs: Sequence[Photograph],
    ground: Ground,
    camera: Camera | None = None,
    area: Sequence[Any] = (),
) -> Coverage:
    """Compare photographs with a mission, and find what they do not show of an area.

    The area is polygons in degrees (lon, lat; WGS 84), by default what the mission plans to show without a
    rim of `RIM` of a footprint, by which positions may be off. The camera is by default that of most
    photographs. A PhotographError says that none of them shows ground, or lies near the mission; a
    MissionError that it plans no photographs, or what they show is not known.
    """
    home = mission.home
    plane = Plane(home.lat, home.lon)
    known, outlines, notes = _outlines(photographs, ground, plane)
    if not known:
        raise PhotographError("; ".join(["no photograph shows ground", *notes]))
    planned = planned_photographs(mission, _lens(camera, known), ground)
    frames = {item.frame for item in mission.items if item.has_position}
    level = (home.altitude_m,) if ground.dem is None or FRAME_AMSL in frames else ()
    below = replace(ground, home=(home.lat, home.lon, *level))
    poses, expected, why = _outlines(planned.photographs, below, plane)
    if len(poses) < len(planned.photographs):
        raise MissionError(f"what the mission plans to show is not known: {why[0]}")
    plan, taken = _places(poses, plane), _places(known, plane)
    if area:
        wanted = shapely.union_all(plane.project_polygons(area))
    elif not len(plan):
        raise MissionError("the mission takes no photographs: name what they should show with --regions")
    else:
        rim = RIM * math.sqrt(np.median(shapely.area(expected)))
        wanted = shapely.buffer(shapely.union_all(expected), -rim, join_style="mitre")
    if not wanted.area > 0:
        raise MissionError("the area that photographs should show is empty")
    sizes = 2 * shapely.minimum_bounding_radius(expected)
    others = _others(taken, plan, sizes)
    if len(plan) and others.all():
        raise PhotographError(
            f"none of {len(known):,} photographs was taken near a place where the mission takes one: are "
            "they of another flight?"
        )
    match = _matched(plan, taken, planned, np.sqrt(shapely.area(expected)))
    shown = [shapely.intersection(wanted, one) for one in _seen(outlines)]
    gaps, slivers_m2 = _gaps(wanted, shapely.difference(wanted, shown[0]), outlines)
    pairs = _beside(planned, plan, sizes)
    shares = _shares_beside(expected, planned.line, pairs)
    pairs = pairs[shares > np.median(shares) / 2] if len(pairs) else pairs  # others are of another block
    there = np.flatnonzero(match >= 0)
    blurred, not_judged = _blurred(known, outlines, taken, planned, match)
    if ground.dem is None and frames & {FRAME_AMSL, FRAME_TERRAIN}:
        notes.append("the mission follows the ground, which is taken as flat here: give --dem")
    if slivers_m2 > _LEAST_M2:
        notes.append(f"gaps smaller than {SLIVER:.0%} of a photograph, {slivers_m2:.3g} m2, are left out")
    return Coverage(
        planned=len(plan),
        taken=len(photographs),
        others=int(others.sum()),
        missing=tuple(
            Missing(k + 1, int(planned.items[k]), poses[k].lon, poses[k].lat)
            for k in np.flatnonzero(match < 0).tolist()
        ),
        area_m2=float(wanted.area),
        seen=(shown[0].area / wanted.area, shown[1].area / wanted.area, shown[2].area / wanted.area),
        gaps=tuple(_in_degrees(gaps, plane)),
        gap_areas_m2=tuple(shapely.area(gaps).tolist()),
        slivers_m2=slivers_m2,
        overlaps=_overlaps(
            outlines[match[there]], planned.line[there], pairs[np.isin(pairs[:, 0], there)], there
        ),
        planned_overlaps=_overlaps(expected, planned.line, pairs, np.arange(len(plan))),
        blurred=blurred,
        not_judged=not_judged,
        notes=tuple(notes),
    )


@dataclass(frozen=True)
class Planned:
    """Photographs that a mission plans, in the order in which they are taken."""

    photographs: tuple[Photograph, ...]
    items: Integers  # (n,), number of the item that the leg of each leads to
    line: Integers  # (n,), number of the line that each is on, ascending
    spacing_m: Floats  # (n,), distance to the nearest one on its line; 0 for one alone
    is_hovering: bool  # whether the vehicle stops for each


def planned_photographs(
    mission: Mission, lens: tuple[tuple[int, int], float], ground: Ground | None = None
) -> Planned:
    """Return the photographs of a mission for a lens: columns and rows of the image, focal length in pixels.

    The camera looks along the flight. With an elevation model, heights above the terrain are those above it.
    A MissionError says that the camera looks at places, or that there are more than `MAX_PLANNED`.
    """
    if ground is not None and ground.dem is not None:
        known = [(mission.home.lat, mission.home.lon)]
        known += [(one.lat, one.lon) for one in mission.items if one.has_position]
        lat, lon = np.array(known).T
        heights = dict(zip(known, ground.heights_m(lon, lat).tolist(), strict=True))
        mission = replace(mission, ground=Below(below_m=heights, lowest_m=0.0, highest_m=0.0))
    path = flown_path(mission, mission.vehicle or default_vehicle(mission.autopilot))
    if path.photographs.sum() > MAX_PLANNED:
        raise MissionError(f"the mission takes {path.photographs.sum():,} photographs, above {MAX_PLANNED:,}")
    if path.photographs.any() and any(item.command == ROI_LOCATION for item in mission.items):
        raise MissionError("the camera looks at places, not along the flight: coverage is that of surveys")
    runs = path.shots
    shares = [np.clip(run.first + run.step * np.arange(run.count), 0, 1) for run in runs]
    places = [path.places_m(run.leg, at) for run, at in zip(runs, shares, strict=True)]
    xyz = np.concatenate([np.empty((0, 3)), *places])
    counts = [run.count for run in runs]
    along = np.repeat(np.array([path.direction(run.leg) for run in runs]).reshape(-1, 2), counts, axis=0)
    pitch = np.nan_to_num(path.pitch_deg, nan=NADIR_DEG)[[run.leg for run in runs]].repeat(counts)
    single = np.array([run.step == 0 for run in runs], bool).repeat(counts)
    line, spacing_m = _lines(xyz[:, :2], along, pitch, single)
    flown = [number for number, item in enumerate(mission.items, 1) if item.has_position]
    leg = np.array([min(run.leg, len(flown) - 1) for run in runs], int).repeat(counts)
    lon, lat = Plane(mission.home.lat, mission.home.lon).lonlat_from_xy(xyz[:, 0], xyz[:, 1])
    yaw = np.degrees(np.arctan2(along[:, 0], along[:, 1]))
    return Planned(
        photographs=tuple(
            Photograph(
                path=f"number {k + 1}",
                lon=float(lon[k]),
                lat=float(lat[k]),
                relative_m=float(xyz[k, 2]),
                yaw_deg=float(yaw[k]),
                pitch_deg=float(pitch[k]),
                image_px=lens[0],
                focal_px=lens[1],
            )
            for k in range(len(xyz))
        ),
        items=np.array(flown)[leg],
        line=line,
        spacing_m=spacing_m,
        is_hovering=bool(single.all()),
    )


def _lines(xy: Floats, along: Floats, pitch: Floats, single: Bools) -> tuple[Integers, Floats]:
    """Number the lines of photographs (n,), and return the distance (n,) to the nearest one on the line.

    A single one that ends a line, before the vehicle turns, has the direction of the line; it is changed.
    """
    line, step_m, first = np.zeros(len(xy), int), np.zeros(len(xy)), 0
    for k in range(1, len(xy)):
        step = xy[k] - xy[k - 1]
        length = math.hypot(*step)
        ahead = length > 0 and step @ along[first] > _STRAIGHT * length and pitch[k] == pitch[first]
        near = not step_m[k - 1] or length < 1.5 * step_m[k - 1]
        if ahead and near and (single[k] or along[k] @ along[first] > _STRAIGHT):
            line[k], step_m[k] = line[k - 1], length
            along[k] = along[first] if single[k] else along[k]
        else:
            line[k], first = line[k - 1] + 1, k
    after = np.append(step_m[1:], 0)[: len(xy)]
    return line, np.where((step_m > 0) & (after > 0), np.minimum(step_m, after), np.maximum(step_m, after))


def _lens(camera: Camera | None, photographs: Sequence[Photograph]) -> tuple[tuple[int, int], float]:
    """Return image size and focal length in pixels: of a camera, or of most photographs."""
    if camera is not None:
        return camera.image_px, camera.focal_mm * camera.image_px[0] / camera.sensor_mm[0]
    counted = Counter((one.image_px, one.focal_px) for one in photographs)
    return max(counted, key=lambda lens: (counted[lens], lens))


def _outlines(
    photographs: Sequence[Photograph], ground: Ground, plane: Plane
) -> tuple[list[Photograph], Objects, list[str]]:
    """Return the photographs that show ground, its outlines in metres, and notes on the others and doubts."""
    known: list[Photograph] = []
    found, left_out, doubts = [], [], []
    for number, one in enumerate(photographs, 1):
        try:
            found.append(ground.footprint(one))
            known.append(one)
            doubts += [(one.path, note) for note in ground.notes(one)]
        except PhotographError as error:
            left_out.append((one.path, str(error)))
        steps_done(number, len(photographs))
    metres = shapely.transform(
        np.array([*found, None], object)[:-1],
        lambda lonlat: np.column_stack(plane.xy_from_lonlat(lonlat[:, 0], lonlat[:, 1])),
    )
    return known, _areas(metres), [*grouped("left out, as ", left_out), *grouped("", doubts)]


def _areas(shapes: Objects) -> Objects:
    """Return shapes without the points and lines in which polygons touch."""
    other = ~np.isin(shapely.get_type_id(shapes), (3, 6))
    shapes[other] = shapely.buffer(shapes[other], 0)
    return shapes


def _places(photographs: Sequence[Photograph], plane: Plane) -> Floats:
    lonlat = np.array([(one.lon, one.lat) for one in photographs]).reshape(-1, 2)
    return np.column_stack(plane.xy_from_lonlat(lonlat[:, 0], lonlat[:, 1]))


def _others(taken: Floats, plan: Floats, sizes: Floats) -> Bools:
    """Return which photographs (n,) are farther than a footprint from every planned one."""
    others = np.zeros(len(taken), bool)
    if len(plan):
        near, distance = shapely.STRtree(shapely.points(plan)).query_nearest(
            shapely.points(taken), return_distance=True, all_matches=False
        )
        others[near[0]] = distance > sizes[near[1]]
    return others


def _matched(plan: Floats, taken: Floats, planned: Planned, sides: Floats) -> Integers:
    """Return the index (n,) of the photograph that was taken for each planned one; -1 for none.

    It is at most half of the distance between photographs away along the line, and a quarter of a footprint,
    or that, across it.
    """
    match = np.full(len(plan), -1)
    if not len(plan):
        return match
    ahead = np.where(planned.spacing_m > 0, planned.spacing_m, sides) / 2
    aside = np.maximum(ahead, sides / 4)
    k, n = shapely.STRtree(shapely.points(taken)).query(
        shapely.points(plan), "dwithin", distance=np.hypot(ahead, aside)
    )
    yaw = np.radians([one.yaw_deg for one in planned.photographs])[k]
    east, north = (taken[n] - plan[k]).T
    along, across = east * np.sin(yaw) + north * np.cos(yaw), east * np.cos(yaw) - north * np.sin(yaw)
    fits = (np.abs(along) <= ahead[k] + 1e-6) & (np.abs(across) <= aside[k])
    k, n, distance = k[fits], n[fits], np.hypot(along, across)[fits].round(6)
    used = np.zeros(len(taken), bool)
    for one in np.lexsort((n, k, distance)).tolist():
        if match[k[one]] < 0 and not used[n[one]]:
            match[k[one]], used[n[one]] = n[one], True
    return match


def _seen(outlines: Objects) -> tuple[Any, Any, Any]:
    """Return the ground that at least one, two and three of n outlines show, n > 0, by halves."""
    one, two, three = outlines, np.full(len(outlines), _NOWHERE), np.full(len(outlines), _NOWHERE)
    while len(one) > 1:
        if len(one) % 2:
            one, two, three = (np.append(shapes, _NOWHERE) for shapes in (one, two, three))
        (a1, a2, a3), (b1, b2, b3) = zip(*((s[::2], s[1::2]) for s in (one, two, three)), strict=True)
        one = shapely.union(a1, b1)
        two = shapely.union_all([a2, b2, _areas(shapely.intersection(a1, b1))], axis=0)
        once_more = [_areas(shapely.intersection(a2, b1)), _areas(shapely.intersection(a1, b2))]
        three = shapely.union_all([a3, b3, *once_more], axis=0)
    return one[0], two[0], three[0]


def _gaps(wanted: Any, unseen: Any, outlines: Objects) -> tuple[Objects, float]:
    """Return the parts of what no photograph shows, largest first, and the area of those left out.

    Parts narrower than `THIN_M` and steps of a centimetre, where footprints almost meet, are smoothed away.
    """
    opened = shapely.buffer(
        shapely.buffer(unseen, -THIN_M / 2, join_style="mitre"), THIN_M / 2, join_style="mitre"
    )
    left = LOST * wanted.area - (unseen.area - opened.area)
    if left < 0:
        opened, left = unseen, LOST * wanted.area
    parts = shapely.get_parts(_areas(np.array([shapely.simplify(opened, 0.01)], object)))
    parts = parts[np.argsort(-shapely.area(parts), kind="stable")]
    sizes = shapely.area(parts)
    small = sizes < SLIVER * np.median(shapely.area(outlines))
    dropped = small & (np.cumsum(sizes[::-1])[::-1] <= left)
    return parts[~dropped], max(float(unseen.area - sizes[~dropped].sum()), 0.0)


def _in_degrees(gaps: Objects, plane: Plane) -> Objects:
    def lonlat(xy: Floats) -> Floats:
        lon, lat = plane.lonlat_from_xy(xy[:, 0], xy[:, 1])
        return np.column_stack([wrap_lon(lon, plane.lon), lat])

    degrees: Objects = shapely.transform(shapely.segmentize(gaps, _LONGEST_EDGE_M), lonlat)
    return degrees


def _beside(planned: Planned, plan: Floats, sizes: Floats) -> Integers:
    """Return pairs (m, 2) of a photograph and the nearest line on a side of it, parallel and beside it."""
    first = np.flatnonzero(np.diff(planned.line, prepend=-1))
    count = np.diff(np.append(first, len(plan)))
    yaw = np.radians([planned.photographs[k].yaw_deg for k in first])
    pitch = np.array([planned.photographs[k].pitch_deg for k in first])
    pairs = [np.empty((0, 2), int)]
    for a in range(len(first)):
        u = np.array([math.sin(yaw[a]), math.cos(yaw[a])])
        t, across = plan @ u, plan @ np.array([u[1], -u[0]])
        low, high = np.minimum.reduceat(t, first), np.maximum.reduceat(t, first)
        offset = np.add.reduceat(across, first) / count
        offset -= offset[a]
        turn = np.cos(yaw - yaw[a])
        parallel = (np.abs(turn) if pitch[a] < _STEEP_DEG else turn) > _STRAIGHT
        rows = np.arange(first[a], first[a] + count[a])
        outside = np.maximum(low - t[rows, None], t[rows, None] - high)
        known = (outside < sizes[rows, None]) & parallel & (pitch == pitch[a])
        for side in (-1, 1):
            away = np.where(known & (side * offset > RIM * sizes[rows, None]), np.abs(offset), np.inf)
            nearest = away.argmin(axis=1)
            near = (away.min(axis=1) < sizes[rows]) & (outside[rows - first[a], nearest] <= 1e-6)
            pairs.append(np.column_stack([rows, nearest])[near])
    return np.concatenate(pairs)


def _shares_beside(outlines: Objects, line: Integers, pairs: Integers) -> Floats:
    """Return the share of outlines that lines show, for pairs (m, 2) of the index of one and a line."""
    strips = {one: shapely.union_all(outlines[line == one]) for one in np.unique(pairs[:, 1]).tolist()}
    beside = np.array([*(strips[one] for one in pairs[:, 1].tolist()), None], object)[:-1]
    chosen = outlines[pairs[:, 0]]
    shares: Floats = shapely.area(shapely.intersection(chosen, beside)) / shapely.area(chosen)
    return shares


def _overlaps(outlines: Objects, line: Integers, pairs: Integers, which: Integers) -> Overlaps:
    """Return overlaps of outlines, those of some planned photographs, in pairs of all of them and lines."""
    before, after = outlines[:-1], outlines[1:]
    larger = np.maximum(shapely.area(before), shapely.area(after))
    along = (shapely.area(shapely.intersection(before, after)) / larger)[line[:-1] == line[1:]]
    beside = _shares_beside(
        outlines, line, np.column_stack([np.searchsorted(which, pairs[:, 0]), pairs[:, 1]])
    )
    return Overlaps(
        *((float(np.median(one)), float(one.min())) if len(one) else None for one in (along, beside))
    )


def _blurred(
    photographs: Sequence[Photograph], outlines: Objects, taken: Floats, planned: Planned, match: Integers
) -> tuple[tuple[str, ...], int]:
    """Return the names of photographs that motion blurs, and how many cannot be judged.

    A speed that a photograph does not tell is that of its line, without waits, unless the vehicle hovers.
    """
    unknown = [math.nan if one is None else one for one in (p.speed_m_s for p in photographs)]
    speed = np.array(unknown, float)
    for one in () if planned.is_hovering else np.unique(planned.line).tolist():
        which = match[(planned.line == one) & (match >= 0)]
        seconds = np.abs(np.diff(np.array([photographs[n].taken_s for n in which], float)))
        metres = np.hypot(*np.diff(taken[which], axis=0).T)
        flown = (seconds > 0) & (seconds <= 5 * np.nanmedian(seconds)) if np.isfinite(seconds).any() else []
        if np.any(flown):
            mean = metres[flown].sum() / seconds[flown].sum()
            speed[which] = np.where(np.isnan(speed[which]), mean, speed[which])
    exposure = np.array([math.nan if p.exposure_s is None else p.exposure_s for p in photographs])
    pixels = np.array([math.prod(p.image_px) for p in photographs])
    moved_px = exposure * speed / np.sqrt(shapely.area(outlines) / pixels)
    names = tuple(photographs[n].path for n in np.flatnonzero(moved_px > BLUR_PX).tolist())
    return names, int(np.isnan(moved_px).sum())
