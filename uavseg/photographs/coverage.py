"""Coverage of an area by photographs: gaps, planned photographs that are missing, overlaps, motion blur."""

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, replace
from typing import Any

import numpy as np
import shapely

from uavseg.arrays import Bools, Floats, Integers, Objects
from uavseg.dataclass import dataclass
from uavseg.errors import MissionError, PhotographError, named_errors
from uavseg.execution.executors import steps_done
from uavseg.flight.camera.camera import BLUR_PX, NADIR_DEG, Camera
from uavseg.flight.mission.estimate import flown_path
from uavseg.flight.mission.items import FRAME_AMSL, FRAME_TERRAIN, ROI_LOCATION
from uavseg.flight.mission.mission import Ground as Below, Mission
from uavseg.flight.mission.track import Plane
from uavseg.photographs.ground import Ground
from uavseg.photographs.read import Photograph
from uavseg.raster.geodesy.globe import wrap_lon

Overlaps = dict[str, dict[str, float] | None]
"""Median and least share of a footprint that the next one along a line, or the line beside, shows too."""

COVERED = 0.999  # share of the area that photographs have to show
RIM = 0.05  # of a footprint, by which what a mission plans to show is larger than what has to be covered
SLIVER, LOST = 0.01, 0.0005  # smaller gaps are left out (of a footprint), unless they are more (of the area)
THIN_M = 0.1  # narrower parts of gaps are left out in the same way
MAX_PLANNED = 50_000
PLACES = 30_000  # places in the area at which is counted what photographs show twice and three times
_SPREAD = (0.7548776662466927, 0.5698402909980532)  # R2 sequence: evenly spread, and along no line
_SPARSE = 50  # times as many places are tried where a part is small in its bounds
_STRAIGHT = math.cos(math.radians(15))
_LONGEST_EDGE_M = 300.0  # which bends by less than a centimetre in degrees
_LEAST_M2 = 1.0  # of slivers that a note is about


@dataclass(frozen=True, slots=True)
class Missing:
    """A planned photograph that was not taken: its number, the item that its leg leads to, and its place."""

    number: int
    item: int
    lon: float
    lat: float


@dataclass(frozen=True)
class Coverage:
    """What photographs show of an area, against what a mission plans."""

    planned: int  # photographs
    taken: int
    others: int  # of those that were taken: not near to any planned one
    missing: tuple[Missing, ...]
    area_m2: float
    covered: float  # share of the area that at least one photograph shows
    seen_twice: float  # share of `PLACES` in the area that at least two show
    seen_three_times: float
    gaps: tuple[Any, ...]  # polygons in degrees (lon, lat; WGS 84), largest first
    gap_areas_m2: tuple[float, ...]
    slivers_m2: float  # gaps that are too small to be among them
    overlap: Overlaps
    planned_overlap: Overlaps
    blurred: tuple[str, ...]  # names of those that motion blurs by more than `BLUR_PX`
    blur_not_known: int  # whose exposure time or speed is not known
    notes: tuple[str, ...] = ()

    @property
    def is_whole(self) -> bool:
        """Whether the photographs show the area."""
        return self.covered >= COVERED

    def as_dict(self) -> dict[str, Any]:
        """Return the coverage as plain values, for JSON; without the outlines of gaps."""
        about = asdict(replace(self, gaps=())) | {"gaps": len(self.gaps), "gaps_m2": sum(self.gap_areas_m2)}
        del about["gap_areas_m2"], about["notes"]
        plain: dict[str, Any] = _plain("", about)
        return plain


def _plain(name: str, value: Any) -> Any:
    """Return a value for JSON, cut rather than rounded: 0.99999 of an area is not 1."""
    if isinstance(value, dict):
        return {key: _plain(key, one) for key, one in value.items()}
    if isinstance(value, tuple):
        return [_plain(name, one) for one in value]
    if not isinstance(value, float):
        return value
    scale = 10 ** (8 if name in {"lon", "lat"} else 1 if name.endswith("_m2") else 5)
    return math.floor(value * scale + 1e-6) / scale


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
    seen, notes = ground.each(photographs, lambda one: (one, ground.footprint(one)), steps_done)
    known, outlines = [one for one, _ in seen], _in_metres([outline for _, outline in seen], plane)
    plan = planned_photographs(mission, _lens(camera, known), ground)
    frames = {item.frame for item in mission.items if item.has_position}
    level = (home.altitude_m,) if ground.dem is None or FRAME_AMSL in frames else ()
    below, poses = replace(ground, home=(home.lat, home.lon, *level)), plan.photographs
    with named_errors("what the mission plans to show is not known", PhotographError, MissionError):
        expected = _in_metres(list(map(below.footprint, poses)), plane)
    if area:
        wanted = shapely.union_all(plane.project_polygons(area))
    elif not poses:
        raise MissionError("the mission takes no photographs: name what they should show with --regions")
    else:
        rim = RIM * math.sqrt(np.median(shapely.area(expected)))
        wanted = shapely.buffer(shapely.union_all(expected), -rim, join_style="mitre")
    if not wanted.area > 0:
        raise MissionError("the area that photographs should show is empty")
    sizes = 2 * shapely.minimum_bounding_radius(expected)
    taken = np.column_stack(plane.xy_from_lonlat([one.lon for one in known], [one.lat for one in known]))
    match, others = _matched(plan, taken, sizes)
    if poses and others.all():
        raise PhotographError(
            f"none of {len(known):,} photographs was taken near a place where the mission takes one: are "
            "they of another flight?"
        )
    unseen = shapely.difference(wanted, shapely.union_all(outlines))
    gaps, slivers_m2 = _gaps(wanted, unseen, outlines)
    covered, counts = 1 - unseen.area / wanted.area, _counts(wanted, outlines)
    beside = _beside(plan, expected, sizes)
    blurred, blur_not_known = _blurred(known, outlines, taken, plan, match)
    if ground.dem is None and frames & {FRAME_AMSL, FRAME_TERRAIN}:
        notes.append("the mission follows the ground, which is taken as flat here: give --dem")
    if slivers_m2 > _LEAST_M2:
        notes.append(f"gaps smaller than {SLIVER:.0%} of a photograph, {slivers_m2:.3g} m2, are left out")
    return Coverage(
        planned=len(poses),
        taken=len(photographs),
        others=int(others.sum()),
        missing=tuple(
            Missing(k + 1, int(plan.items[k]), poses[k].lon, poses[k].lat)
            for k in np.flatnonzero(match < 0).tolist()
        ),
        area_m2=float(wanted.area),
        covered=covered,
        seen_twice=min(covered, float(np.mean(counts > 1))),
        seen_three_times=min(covered, float(np.mean(counts > 2))),
        gaps=tuple(_in_degrees(gaps, plane)),
        gap_areas_m2=tuple(shapely.area(gaps).tolist()),
        slivers_m2=slivers_m2,
        overlap=_overlaps(np.where(match >= 0, outlines[match], np.array(None, object)), plan.line, beside),
        planned_overlap=_overlaps(expected, plan.line, beside),
        blurred=blurred,
        blur_not_known=blur_not_known,
        notes=tuple(notes),
    )


@dataclass(frozen=True)
class Planned:
    """Photographs that a mission plans, in the order in which they are taken."""

    photographs: tuple[Photograph, ...]
    xy_m: Floats  # (n, 2), east and north of home
    yaw: Floats  # (n,), radians
    pitch_deg: Floats  # (n,)
    items: Integers  # (n,), number of the item that the leg of each leads to
    line: Integers  # (n,), number of the line that each is on, ascending
    spacing_m: Floats  # (n,), distance to the nearest one on its line; infinite for one alone
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
    path = flown_path(mission)
    if path.photographs.sum() > MAX_PLANNED:
        raise MissionError(f"the mission takes {path.photographs.sum():,} photographs, above {MAX_PLANNED:,}")
    if path.shots and any(item.command == ROI_LOCATION for item in mission.items):
        raise MissionError("the camera looks at places, not along the flight: coverage is that of surveys")
    runs = path.shots
    counts = [run.count for run in runs]
    leg = np.array([run.leg for run in runs], int).repeat(counts)
    share = [one for run in runs for one in np.clip(run.first + run.step * np.arange(run.count), 0, 1)]
    xyz = path.xyz_m[leg] + np.array(share).reshape(-1, 1) * (path.xyz_m[leg + 1] - path.xyz_m[leg])
    along = np.array([path.direction(run.leg) for run in runs]).reshape(-1, 2).repeat(counts, axis=0)
    pitch = np.nan_to_num(path.pitch_deg, nan=NADIR_DEG)[leg]
    single = np.array([run.step == 0 for run in runs], bool).repeat(counts)
    line, spacing_m = _lines(xyz[:, :2], along, pitch, single)
    flown = np.array([number for number, item in enumerate(mission.items, 1) if item.has_position])
    lon, lat = Plane(mission.home.lat, mission.home.lon).lonlat_from_xy(xyz[:, 0], xyz[:, 1])
    yaw = np.arctan2(along[:, 0], along[:, 1])
    poses = np.column_stack([lon, lat, xyz[:, 2], np.degrees(yaw), pitch]).tolist()
    return Planned(
        photographs=tuple(
            Photograph(
                path=f"number {number}",
                **dict(zip(("lon", "lat", "relative_m", "yaw_deg", "pitch_deg"), pose, strict=True)),
                image_px=lens[0],
                focal_px=lens[1],
            )
            for number, pose in enumerate(poses, 1)
        ),
        xy_m=xyz[:, :2],
        yaw=yaw,
        pitch_deg=pitch,
        items=flown[np.minimum(leg, len(flown) - 1)],
        line=line,
        spacing_m=spacing_m,
        is_hovering=bool(single.all()),
    )


def _lines(xy: Floats, along: Floats, pitch: Floats, single: Bools) -> tuple[Integers, Floats]:
    """Number the lines of photographs (n,), and return the distance (n,) to the nearest one on the line.

    A single one that ends a line, before the vehicle turns, has the direction of the line; it is changed.
    """
    line, step_m = np.zeros(len(xy), int), np.full(len(xy) + 1, np.inf)
    for k in range(1, len(xy)):
        step = xy[k] - xy[k - 1]
        length = math.hypot(*step)
        ahead = step @ along[k - 1] > _STRAIGHT * length and length < 1.5 * step_m[k - 1]
        same = pitch[k] == pitch[k - 1] and (single[k] or along[k] @ along[k - 1] > _STRAIGHT)
        line[k] = line[k - 1] + (not (ahead and same))
        if ahead and same:
            step_m[k] = length
            along[k] = along[k - 1] if single[k] else along[k]
    return line, np.minimum(step_m[:-1], step_m[1:])


def _lens(camera: Camera | None, photographs: Sequence[Photograph]) -> tuple[tuple[int, int], float]:
    """Return image size and focal length in pixels: of a camera, or of most photographs."""
    if camera is not None:
        return camera.image_px, camera.focal_px
    counted = Counter((one.image_px, one.focal_px) for one in photographs)
    return max(counted, key=lambda lens: (counted[lens], lens))


def _in_metres(outlines: Sequence[Any], plane: Plane) -> Objects:
    """Return outlines in degrees as outlines on a plane."""
    metres: Objects = shapely.transform(
        np.array([*outlines, None], object)[:-1],
        lambda lonlat: np.column_stack(plane.xy_from_lonlat(lonlat[:, 0], lonlat[:, 1])),
    )
    return metres


def _turned(offset: Floats, yaw: Floats) -> tuple[Floats, Floats]:
    """Return offsets (n, 2), east and north, as lengths ahead and to the right of azimuths in radians."""
    east, north = offset.T
    return east * np.sin(yaw) + north * np.cos(yaw), east * np.cos(yaw) - north * np.sin(yaw)


def _matched(plan: Planned, taken: Floats, sizes: Floats) -> tuple[Integers, Bools]:
    """Return the index (n,) of the photograph that was taken for each planned one, -1 for none, and others.

    It is at most half of the distance between photographs away along the line, and a sixth of the diagonal of
    a footprint, or that, across it. Others (m,) are farther than a footprint from every planned one.
    """
    match, used = np.full(len(sizes), -1), np.zeros(len(taken), bool)
    others = np.full(len(taken), len(sizes) > 0)
    k, n = shapely.STRtree(shapely.points(taken)).query(shapely.points(plan.xy_m), "dwithin", distance=sizes)
    others[n] = False
    ahead, right = _turned(taken[n] - plan.xy_m[k], plan.yaw[k])
    half = np.minimum(plan.spacing_m / 2, sizes / 3)[k]
    fits = (np.abs(ahead) <= half + 1e-6) & (np.abs(right) <= np.maximum(half, sizes[k] / 6))
    k, n, distance = k[fits], n[fits], np.hypot(ahead, right)[fits].round(6)
    for one in np.lexsort((n, k, distance)).tolist():
        if match[k[one]] < 0 and not used[n[one]]:
            match[k[one]], used[n[one]] = n[one], True
    return match, others


def _counts(wanted: Any, outlines: Objects) -> Integers:
    """Return how many outlines show each of about `PLACES` places, evenly spread over an area."""
    places = [shapely.point_on_surface(wanted)]
    for part in shapely.get_parts(wanted):
        low, high = np.array(part.bounds).reshape(2, 2)
        tried = PLACES * min(math.prod(high - low) / wanted.area, _SPARSE * part.area / wanted.area)
        xy = low + np.arange(1, tried + 1)[:, None] * _SPREAD % 1 * (high - low)
        places.extend(shapely.points(xy[shapely.contains_xy(part, xy)]))
    shown = shapely.STRtree(places).query(outlines, "contains")[1]
    counts: Integers = np.bincount(shown, minlength=len(places))
    return counts


def _gaps(wanted: Any, unseen: Any, outlines: Objects) -> tuple[Objects, float]:
    """Return the parts of what no photograph shows, largest first, and the area of those left out.

    Parts narrower than `THIN_M` and steps of a centimetre, where footprints almost meet, are smoothed away.
    """
    opened = shapely.buffer(unseen, -THIN_M / 2, join_style="mitre").buffer(THIN_M / 2, join_style="mitre")
    left = LOST * wanted.area - (unseen.area - opened.area)
    if left < 0:
        opened, left = unseen, LOST * wanted.area
    parts = shapely.get_parts(shapely.simplify(opened, 0.01))
    parts = parts[np.argsort(-shapely.area(parts), kind="stable")]
    sizes = shapely.area(parts)
    kept = (sizes >= SLIVER * np.median(shapely.area(outlines))) | (np.cumsum(sizes[::-1])[::-1] > left)
    return parts[kept], max(float(unseen.area - sizes[kept].sum()), 0.0)


def _in_degrees(gaps: Objects, plane: Plane) -> Objects:
    def lonlat(xy: Floats) -> Floats:
        lon, lat = plane.lonlat_from_xy(xy[:, 0], xy[:, 1])
        return np.column_stack([wrap_lon(lon, plane.lon), lat])

    degrees: Objects = shapely.transform(shapely.segmentize(gaps, _LONGEST_EDGE_M), lonlat)
    return degrees


def _beside(plan: Planned, outlines: Objects, sizes: Floats) -> Integers:
    """Return pairs (m, 2) of a photograph and the nearest parallel line that is beside it on a side."""
    if not len(sizes):
        return np.empty((0, 2), int)
    points, twice = shapely.points(plan.xy_m), np.arange(len(sizes)).repeat(2)
    lines = shapely.linestrings(plan.xy_m[twice], indices=plan.line[twice])
    k, line = shapely.STRtree(lines).query(points, "dwithin", distance=sizes)
    on_line = shapely.line_interpolate_point(lines[line], shapely.line_locate_point(lines[line], points[k]))
    offset, first = shapely.get_coordinates(on_line) - plan.xy_m[k], np.searchsorted(plan.line, line)
    beyond, right = _turned(offset, plan.yaw[first])[0], _turned(offset, plan.yaw[k])[1]
    fits = (np.abs(np.cos(plan.yaw[first] - plan.yaw[k])) > _STRAIGHT) & (np.abs(right) > RIM * sizes[k])
    near = np.flatnonzero(fits & (plan.pitch_deg[first] == plan.pitch_deg[k]))
    near = near[np.lexsort((line[near], np.abs(right[near])))]
    near = near[np.unique(2 * k[near] + (right[near] > 0), return_index=True)[1]]
    near = near[np.abs(beyond[near]) < 1e-3 * sizes[k[near]]]
    pairs: Integers = np.column_stack([k, line])[near]
    shares = _shares_beside(outlines, plan.line, pairs)
    if len(pairs):
        pairs = pairs[shares > np.median(shares) / 2]  # others are of another block
    return pairs


def _shares_beside(outlines: Objects, line: Integers, pairs: Integers) -> Floats:
    """Return the share of outlines that lines show, for pairs (m, 2) of the index of one and a line."""
    strips = {one: shapely.union_all(outlines[line == one]) for one in np.unique(pairs[:, 1]).tolist()}
    beside = np.array([*(strips[one] for one in pairs[:, 1].tolist()), None], object)[:-1]
    chosen = outlines[pairs[:, 0]]
    shares: Floats = shapely.area(shapely.intersection(chosen, beside)) / shapely.area(chosen)
    return shares


def _overlaps(outlines: Objects, line: Integers, pairs: Integers) -> Overlaps:
    """Return overlaps of outlines (n,), None for those missing, along lines and of pairs."""
    there = np.flatnonzero(~shapely.is_missing(outlines))
    before, after = outlines[there[:-1]], outlines[there[1:]]
    shared = shapely.area(shapely.intersection(before, after))
    along = (shared / np.maximum(shapely.area(before), shapely.area(after)))[np.diff(line[there]) == 0]
    beside = _shares_beside(outlines, line, pairs[np.isin(pairs[:, 0], there)])
    return {
        side: {"median": float(np.median(shares)), "least": float(shares.min())} if len(shares) else None
        for side, shares in (("along", along), ("beside", beside))
    }


def _blurred(
    photographs: Sequence[Photograph], outlines: Objects, taken: Floats, plan: Planned, match: Integers
) -> tuple[tuple[str, ...], int]:
    """Return the names of photographs that motion blurs, and how many cannot be judged.

    A speed that a photograph does not tell is that of its line, without waits, unless the vehicle hovers.
    """
    tags = [(one.taken_s, one.exposure_s, one.speed_m_s, math.prod(one.image_px)) for one in photographs]
    taken_s, exposure_s, speed_m_s, pixels = np.array(tags, float).T
    for one in () if plan.is_hovering else np.unique(plan.line).tolist():
        which = match[(plan.line == one) & (match >= 0)]
        seconds, metres = np.abs(np.diff(taken_s[which])), np.hypot(*np.diff(taken[which], axis=0).T)
        flown = seconds <= 5 * np.median(seconds) if len(seconds) else []
        if seconds[flown].sum() > 0:
            mean = metres[flown].sum() / seconds[flown].sum()
            speed_m_s[which] = np.where(np.isnan(speed_m_s[which]), mean, speed_m_s[which])
    moved_px = exposure_s * speed_m_s / np.sqrt(shapely.area(outlines) / pixels)
    names = tuple(photographs[n].path for n in np.flatnonzero(moved_px > BLUR_PX).tolist())
    return names, int(np.isnan(moved_px).sum())
