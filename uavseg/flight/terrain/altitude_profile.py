"""Altitude profile of a flight over the ground: bounds of the ground on legs, waypoints, speeds on slopes."""

from collections.abc import Callable

import numpy as np

from uavseg.arrays import Floats, Integers
from uavseg.dataclass import dataclass
from uavseg.errors import MissionError
from uavseg.flight.params.plan import FRAME, PlanParams
from uavseg.raster.elevation.dem import Dem
from uavseg.raster.geodesy.globe import geod_wgs84

SLOWEST_M_S = 1.0  # a vehicle is not slowed down further: it is raised before ground that is steeper
SPEED_STEP_M_S = 0.5  # speeds of slow legs are multiples of it, so that those of neighbours often agree
FIRST_WINDOW = 128  # samples that are examined first for the end of a line
GAP = 0.1  # share of the tolerance that the bounds of the ground may be apart
Places = Callable[[Floats], tuple[Floats, Floats]]

STEP_PIXELS = 0.9  # between the first samples: no line of pixel centres is crossed twice
MAX_PIXELS = 1_000_000  # of one leg
MAX_HALVINGS = 8
MIN_SHARE = 1e-9  # of a leg: crossings that are nearer to each other are one
SHORT_M = 1e-3  # a shorter leg is a point


@dataclass(frozen=True, slots=True, eq=False)
class GroundProfile:
    """Heights of the ground along a path, at n samples."""

    lon: Floats  # (n,): degrees
    lat: Floats  # (n,)
    along_m: Floats  # (n,) float64: distance from the start of the path; it never decreases
    upper_m: Floats  # (n,): straight lines between these heights are not below the ground
    lower_m: Floats  # (n,): and those between these not above it
    corners: Integers  # (k,) int64: the samples that are the corners of the path


def profile_along(dem: Dem, lon: Floats, lat: Floats, gap_m: float) -> GroundProfile:
    """Compute the profile of the ground along geodesic lines.

    Between the lines of pixel centres that a leg crosses, the bilinear surface is a parabola along it. It
    lies within the triangle of its ends and its control point (that of a Bezier curve), so that a sample in
    the middle bounds it exactly. Where the bounds are farther apart than `gap_m`, pieces are halved.

    `lon` and `lat` (k,) are the corners of the path in degrees; the bounds may be farther apart, in metres,
    only where the ground is nearly vertical. A MissionError names a place on the path where the DEM has no
    height.
    """
    first = known_heights_m(dem, lon[:1], lat[:1])
    parts = [(lon[:1], lat[:1], np.zeros(1), first, first)]
    corners, total = [0], 0.0
    for k in range(len(lon) - 1):
        leg = _leg(dem, (lon[k], lat[k]), (lon[k + 1], lat[k + 1]), gap_m)
        parts.append((*leg[:2], total + leg[2], *leg[3:]))
        total += float(leg[2][-1])
        corners.append(corners[-1] + len(leg[0]))
    lons, lats, along, upper, lower = (np.concatenate(column) for column in zip(*parts, strict=True))
    return GroundProfile(
        lon=lons, lat=lats, along_m=along, upper_m=upper, lower_m=lower, corners=np.array(corners, np.int64)
    )


def _leg(
    dem: Dem, start: tuple[float, float], end: tuple[float, float], gap_m: float
) -> tuple[Floats, Floats, Floats, Floats, Floats]:
    """Return longitude, latitude, distance and bounds at the samples of a leg, without its start."""
    geod = geod_wgs84()
    azimuth, _, length = geod.inv(*start, *end)
    if length < SHORT_M:
        lon, lat = np.array([end[0]]), np.array([end[1]])
        height = known_heights_m(dem, lon, lat)
        return lon, lat, np.array([length]), height, height

    def places(share: Floats) -> tuple[Floats, Floats]:
        ones = np.ones(len(share))
        lon, lat, _ = geod.fwd(start[0] * ones, start[1] * ones, azimuth * ones, length * share)
        lon[share == 0], lat[share == 0] = start
        lon[share == 1], lat[share == 1] = end
        return lon, lat

    ends = _crossings(dem, places)
    for _ in range(MAX_HALVINGS):
        share = np.empty(2 * len(ends) - 1)
        share[::2], share[1::2] = ends, (ends[1:] + ends[:-1]) / 2
        lon, lat = places(share)
        height = known_heights_m(dem, lon, lat)
        control = 2 * height[1::2] - (height[:-1:2] + height[2::2]) / 2
        apart = np.abs(control - height[1::2]) > gap_m
        if not apart.any():
            break
        ends = np.sort(np.concatenate([ends, share[1::2][apart]]))
    upper, lower = height.copy(), height.copy()
    upper[1::2], lower[1::2] = np.maximum(control, height[1::2]), np.minimum(control, height[1::2])
    return lon[1:], lat[1:], (length * share)[1:], upper[1:], lower[1:]


def _crossings(dem: Dem, places: Places) -> Floats:
    """Return the shares of a leg at which it begins, ends, or crosses a line of pixel centres."""
    row, col = dem.pixels(*places(np.linspace(0, 1, 9)))
    pixels = float(max(np.abs(np.diff(row)).sum(), np.abs(np.diff(col)).sum()))
    if np.isfinite(pixels) and pixels > MAX_PIXELS:
        raise MissionError(
            f"a leg crosses {pixels:,.0f} pixels of {dem.name}, and at most {MAX_PIXELS:,} are followed; "
            "give a coarser one (gdalwarp -tr)"
        )
    share = np.linspace(0, 1, int(pixels / STEP_PIXELS) + 2 if np.isfinite(pixels) else 2)
    crossings = [share[:1], share[-1:]]
    for position in dem.pixels(*places(share)):
        line = position - 0.5
        low, high = np.minimum(line[:-1], line[1:]), np.maximum(line[:-1], line[1:])
        crossed = np.ceil(low)
        at = np.flatnonzero((crossed <= high) & (high > low))
        part = (crossed[at] - line[at]) / (line[at + 1] - line[at])
        crossings.append(share[at] + part * (share[at + 1] - share[at]))
    shares = np.unique(np.concatenate(crossings))
    shares = shares[np.append(True, np.diff(shares) > MIN_SHARE)]
    return np.append(shares[:-1], 1.0)


def known_heights_m(dem: Dem, lon: Floats, lat: Floats) -> Floats:
    """Return heights of the ground at places (n,), as `Dem.heights_m`.

    A MissionError has the first place whose height is NaN, and what the DEM covers.
    """
    height_m = dem.heights_m(lon, lat)
    unknown = np.flatnonzero(np.isnan(height_m))
    if not len(unknown):
        return height_m
    k = int(unknown[0])
    row, col = dem.pixels(lon[k : k + 1], lat[k : k + 1])
    rows, cols = dem.sampler.dataset.geobox.shape
    inside = 0 <= row[0] <= rows and 0 <= col[0] <= cols
    hole = " with a hole there (nodata, or no height from -500 to 9000 m)" if inside else ""
    raise MissionError(
        f"{dem.name} has no height of the ground at lat {lat[k]:.6f}, lon {lon[k]:.6f}, where the flight "
        f"leads; it covers {dem.covered()}{hole}: give one that covers the whole flight"
    )


@dataclass(frozen=True, slots=True, eq=False)
class AltitudeProfile:
    """Heights of a flight over the ground, from home along a path."""

    ground: GroundProfile  # with n samples
    target_m: Floats  # (n,): height of the flight above the zero of the DEM, not simplified
    chosen: Integers  # (m,): the samples between which the flight is straight; home is the first
    speed_m_s: Floats  # (m - 1,): between the chosen samples

    @property
    def height_m(self) -> Floats:
        """Height of the flight at each sample, above the zero of the DEM."""
        at = self.ground.along_m
        return np.interp(at, at[self.chosen], self.target_m[self.chosen])


def fly_over(dem: Dem, lon: Floats, lat: Floats, params: PlanParams, speeds: Floats) -> AltitudeProfile:
    """Compute the flight over the ground from the first of these corners to the last.

    `lon` and `lat` (k,) are the corners in degrees, home first, and `speeds` (k - 1,) those of each leg,
    where it is not too steep. A MissionError says that the DEM does not cover the path.
    """
    terrain = params.terrain
    assert terrain is not None
    tolerance_m = terrain.tolerance_for(params.altitude_m)
    ground = profile_along(dem, lon, lat, GAP * tolerance_m)
    slowest = min(SLOWEST_M_S, float(speeds.min()))
    climb, descent = rates_m_s(params)
    early = terrain.mode != FRAME and climbs_early(params.autopilot)
    limited = limit_slopes(ground.along_m, ground.upper_m, climb / slowest, descent / slowest)
    target = limited + params.altitude_m
    chosen, speed_m_s = [np.zeros(1, np.int64)], []
    corners = ground.corners.tolist()
    for start, end, speed in zip(corners[:-1], corners[1:], speeds.tolist(), strict=True):
        rates = Rates(climb, descent, speed)
        part = slice(start, end + 1)
        at, height = ground.along_m[part], target[part]
        off_m = (1 - GAP) * tolerance_m
        points = points_climbed_early(at, height, off_m, rates) if early else points_within(at, height, off_m)
        chosen.append(start + np.array(points[1:], np.int64))
        speed_m_s.append(rates.speeds(np.diff(at[points]), np.diff(height[points])))
    return AltitudeProfile(
        ground=ground, target_m=target, chosen=np.concatenate(chosen), speed_m_s=np.concatenate(speed_m_s)
    )


@dataclass(frozen=True, slots=True, eq=False)
class LegPoints:
    """Points of legs, the last of each at its end."""

    share: Floats  # of the leg, from its start to each point, (n,)
    height_m: Floats  # at the start of the first and at each point, (n + 1,)
    speed_m_s: Floats  # on the part before each point, (n,)


def points_of_leg(dem: Dem, leg: tuple[float, ...], params: PlanParams) -> LegPoints:
    """Compute the points of one leg over the ground.

    `leg` is (lon, lat, lon, lat, speed_m_s). A MissionError says that the DEM does not cover it.
    """
    ends = np.array(leg[:4]).reshape(2, 2)
    flight = fly_over(dem, ends[:, 0], ends[:, 1], params, np.array(leg[4:]))
    chosen, speed = flight.chosen, flight.speed_m_s
    assert params.terrain is not None
    if params.terrain.mode == FRAME:  # the vehicle follows the ground itself
        kept = np.append(np.diff(speed) != 0, True)
        chosen, speed = np.append(chosen[0], chosen[1:][kept]), speed[kept]
    along = flight.ground.along_m[chosen]
    share = along[1:] / along[-1] if along[-1] > 0 else np.linspace(0, 1, len(along))[1:]
    return LegPoints(share=share, height_m=flight.target_m[chosen], speed_m_s=speed)


def climbs_early(autopilot: str) -> bool:
    """Return whether a vehicle approaches the height of the next waypoint at once, and not along the leg.

    PX4 computes the velocities over ground and in height independently of each other (PositionSmoothing.cpp,
    since 2025); ArduCopter follows the straight line.
    """
    return autopilot != "ardupilot"


@dataclass(frozen=True, slots=True)
class Rates:
    """Speeds of a vehicle: climb, descent, and over ground where it is not slowed down."""

    climb_m_s: float
    descent_m_s: float
    speed_m_s: float

    def speeds(self, length_m: Floats, rise_m: Floats) -> Floats:
        """Return the speed on each leg: that of the mission, or a lower one where the ground is too steep."""
        rate = np.where(rise_m > 0, self.climb_m_s, self.descent_m_s)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            limit = np.where(np.abs(rise_m) > 1e-6, length_m * rate / np.abs(rise_m), np.inf)
        stepped = np.floor(limit / SPEED_STEP_M_S + 1e-6) * SPEED_STEP_M_S
        slowest = min(SLOWEST_M_S, self.speed_m_s)
        return np.where(limit >= self.speed_m_s, self.speed_m_s, np.maximum(stepped, slowest))


def points_climbed_early(along_m: Floats, height_m: Floats, tolerance_m: float, rates: Rates) -> list[int]:
    """Choose samples between which straight and early climbs stay within a tolerance.

    It climbs or descends at the beginning of each leg until the height of its end is reached. Each leg is as
    long as possible; one between neighbouring samples is always flown. `along_m` and `height_m` (n,) are
    distance along the path and height of all samples.

    Examples
    --------
    >>> at = np.arange(0.0, 101, 10)
    >>> points_climbed_early(at, 0.1 * at, 4.0, Rates(3, 1.5, 5))
    [0, 5, 10]
    """
    last, chosen = len(along_m) - 1, [0]
    while chosen[-1] < last:
        first = end = chosen[-1]
        while end < last:
            along, climbed = (one[first : end + 2] - one[first] for one in (along_m, height_m))
            if not _is_within(along, climbed, tolerance_m, rates):
                break
            end += 1
        chosen.append(max(end, first + 1))
    return chosen


def heights_climbed_early(
    ground: GroundProfile, height_m: Floats, speeds: Floats, rates_m_s: tuple[float, float]
) -> Floats:
    """Compute heights of a vehicle that changes its height at the start of each leg.

    They are at the n samples of the ground. `height_m` (k,) are those at its corners, `speeds` (k - 1,) over
    ground are of the legs between them, and the rates are those of climb and descent.
    """
    corners = ground.corners
    leg = np.clip(np.searchsorted(corners, np.arange(len(ground.along_m))) - 1, 0, len(corners) - 2)
    rise = np.diff(height_m)[leg]
    slope = np.where(rise > 0, *rates_m_s) / speeds[leg]
    flown_m = ground.along_m - ground.along_m[corners[leg]]
    heights: Floats = height_m[leg] + np.sign(rise) * np.minimum(flown_m * slope, np.abs(rise))
    return np.where(np.isin(np.arange(len(heights)), corners[1:]), height_m[leg + 1], heights)


def _is_within(along_m: Floats, climbed_m: Floats, tolerance_m: float, rates: Rates) -> bool:
    """Return whether a leg from the first of these samples to the last is within the tolerance of all."""
    rise, length = float(climbed_m[-1]), float(along_m[-1])
    slope = (rates.climb_m_s if rise > 0 else rates.descent_m_s) / rates.speeds(along_m[-1:], climbed_m[-1:])
    early = np.minimum(along_m * slope, abs(rise)) * np.sign(rise)
    straight = along_m / length * rise if length > 0 else early
    return bool(max(np.abs(early - climbed_m).max(), np.abs(straight - climbed_m).max()) <= tolerance_m)


def rates_m_s(params: PlanParams) -> tuple[float, float]:
    """Return how fast the vehicle climbs and descends on a leg."""
    assert params.terrain is not None
    return params.terrain.rates_m_s(params.flown_by)


def points_within(along_m: Floats, height_m: Floats, tolerance_m: float) -> list[int]:
    """Choose few samples of a profile whose straight lines stay within a tolerance of all others.

    From each chosen sample, the farthest one that a line reaches which passes all samples between within the
    tolerance; the slopes that do so are a cone that only narrows (J. Sklansky and V. Gonzalez, Fast polygonal
    approximation of digitized curves, Pattern Recognition 12, 1980).

    `along_m` (n,) increases, or is all the same for a leg without length; the tolerance is vertical. The
    results are indices, the first and the last sample among them.

    Examples
    --------
    >>> points_within(np.arange(5.0), np.array([0.0, 1, 2, 1, 0]), 0.1)
    [0, 2, 4]
    >>> points_within(np.arange(5.0), np.array([0.0, 1, 2, 1, 0]), 2.0)
    [0, 4]
    """
    chosen, last = [0], len(along_m) - 1
    if along_m[last] == along_m[0]:
        return [0, last]
    while chosen[-1] < last:
        chosen.append(_farthest(along_m, height_m, tolerance_m, chosen[-1]))
    return chosen


def _farthest(along_m: Floats, height_m: Floats, tolerance_m: float, start: int) -> int:
    """Find the farthest sample that one line reaches."""
    window = FIRST_WINDOW
    while True:
        end = min(start + 1 + window, len(along_m))
        step, rise = (one[start + 1 : end] - one[start] for one in (along_m, height_m))
        low = np.maximum.accumulate((rise - tolerance_m) / step)
        high = np.minimum.accumulate((rise + tolerance_m) / step)
        slope = rise / step
        reached = np.flatnonzero((slope >= low) & (slope <= high))
        if low[-1] > high[-1] or end == len(along_m):
            return start + 1 + int(reached[-1])
        window *= 2


def limit_slopes(along_m: Floats, height_m: Floats, climb: float, descent: float) -> Floats:
    """Compute the lowest profile above another that climbs and descends no steeper than these slopes.

    `along_m` (n,) never decreases; the slopes are metres per metre, above 0.

    Examples
    --------
    >>> limit_slopes(np.arange(5.0), np.array([0.0, 0, 8, 0, 0]), climb=3, descent=5)
    array([2., 5., 8., 3., 0.])
    """
    after = np.maximum.accumulate(height_m + descent * along_m) - descent * along_m
    before = np.maximum.accumulate((height_m - climb * along_m)[::-1])[::-1] + climb * along_m
    return np.maximum(after, before)
