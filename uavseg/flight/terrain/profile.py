"""Ground profile along a path: exact bounds of the bilinear surface on every leg."""

from collections.abc import Callable

import numpy as np

from uavseg.arrays import Floats, Integers
from uavseg.dataclass import dataclass
from uavseg.errors import MissionError
from uavseg.raster.elevation.dem import Dem
from uavseg.raster.geodesy.globe import geod_wgs84

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
    first = dem.heights_m(lon[:1], lat[:1])
    check_known(dem, lon[:1], lat[:1], first)
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
        height = dem.heights_m(lon, lat)
        check_known(dem, lon, lat, height)
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
        height = dem.heights_m(lon, lat)
        check_known(dem, lon, lat, height)
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
    count = int(pixels / STEP_PIXELS) + 2 if np.isfinite(pixels) else 2
    share = np.linspace(0, 1, count)
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


def check_known(dem: Dem, lon: Floats, lat: Floats, height_m: Floats) -> None:
    """Raise MissionError with the first place of (n,) arrays whose height is NaN, and what the DEM covers."""
    unknown = np.flatnonzero(np.isnan(height_m))
    if not len(unknown):
        return
    k = int(unknown[0])
    raise MissionError(
        f"{dem.name} has no height of the ground at lat {lat[k]:.6f}, lon {lon[k]:.6f}, where the flight "
        f"leads; it covers {dem.covered()}{_hole(dem, lon[k], lat[k])}: give one that covers the whole flight"
    )


def _hole(dem: Dem, lon: float, lat: float) -> str:
    row, col = dem.pixels(np.array([lon]), np.array([lat]))
    rows, cols = dem.sampler.dataset.geobox.shape
    inside = 0 <= row[0] <= rows and 0 <= col[0] <= cols
    return " with a hole there (nodata, or no height from -500 to 9000 m)" if inside else ""
