"""Tracks on a local plane: paths over one region, and what the vehicle does on their legs and at corners."""

import math
from collections.abc import Sequence
from dataclasses import field, fields, replace
from functools import lru_cache
from itertools import pairwise
from typing import Any

import numpy as np
import shapely

from uavseg.arrays import Bools, Floats, Integers, Objects
from uavseg.dataclass import dataclass
from uavseg.flight.camera.camera import Photos
from uavseg.flight.mission.items import DEGREE_DECIMALS, Position
from uavseg.raster.geodesy.globe import wrap_lon

SAME_PLACE_M = 1e-3
HOVER_S = 1.0  # the vehicle stands still before a photograph in hover (ArduPilot takes whole seconds)
_NONE: Floats = np.empty(0)
LONGEST_EDGE_DEG = 0.005  # a straight edge in degrees bends by less than a centimetre over it


@dataclass(frozen=True, slots=True)
class Plane:
    """Azimuthal equidistant projection (WGS 84) around a centre: accurate to 5e-5 within 100 km of it."""

    lat: float
    lon: float

    def xy_from_lonlat(self, lon: Any, lat: Any) -> tuple[Floats, Floats]:
        """Return metres east and north of the centre."""
        x, y = _projection(self.lat, self.lon)(np.asarray(lon, float), np.asarray(lat, float))
        return x, y

    def lonlat_from_xy(self, x: Any, y: Any) -> tuple[Floats, Floats]:
        """Return degrees, longitude in [-180, 180]."""
        lon, lat = _projection(self.lat, self.lon)(np.asarray(x, float), np.asarray(y, float), inverse=True)
        return lon, lat

    def positions(self, xy: Floats) -> tuple[Position, ...]:
        """Return latitude and longitude in degrees of places (n, 2), rounded to a millimetre."""
        lon, lat = self.lonlat_from_xy(*xy.T)
        return tuple(map(tuple, np.round(np.column_stack([lat, lon]), DEGREE_DECIMALS).tolist()))

    def project_polygons(self, polygons: Sequence[Any] | Objects) -> Objects:
        """Densify polygons in degrees (lon, lat) and project them to metres, all at once.

        They are densified ring by ring: what GEOS densifies whole it also makes valid, and a hole that
        touches the border was seen to be lost.
        """
        count = len(polygons)
        parts, owners = shapely.get_parts(np.array([*polygons, None], object)[:-1], return_index=True)
        rings, owned = shapely.get_rings(parts, return_index=True)
        rings = shapely.segmentize(shapely.force_2d(rings), LONGEST_EDGE_DEG)
        lonlat = shapely.get_coordinates(rings)
        ends = np.cumsum([0, *shapely.get_num_coordinates(rings)])
        flat = shapely.from_ragged_array(
            shapely.GeometryType.POLYGON,
            np.column_stack(self.xy_from_lonlat(lonlat[:, 0], lonlat[:, 1])),
            (ends, np.searchsorted(owned, np.arange(len(parts) + 1))),
        )
        first = np.searchsorted(owners, np.arange(count + 1))
        drawn = np.empty(count, object)
        single = np.diff(first) == 1
        drawn[single] = flat[first[:-1][single]]
        for k in np.flatnonzero(~single).tolist():
            drawn[k] = shapely.MultiPolygon(list(flat[first[k] : first[k + 1]]))
        return drawn


def plane_around(bounds: Floats, lon: float) -> Plane:
    """Return the plane around the middle of bounding boxes.

    `bounds` (N, 4) are west, south, east, north in degrees. Longitudes are relative to `lon`, so boxes on
    both sides of the antimeridian are neighbours.
    """
    east = wrap_lon(bounds[:, [0, 2]] - lon)
    middle = lon + (east.min() + east.max()) / 2
    return Plane((bounds[:, 1].min() + bounds[:, 3].max()) / 2, float(wrap_lon(middle)))


@lru_cache(maxsize=256)
def _projection(lat: float, lon: float) -> Any:
    from pyproj import Proj

    return Proj(proj="aeqd", lat_0=lat, lon_0=lon, datum="WGS84")


@dataclass(frozen=True, slots=True, eq=False)
class Track:
    """A path over a region, with n corners and n - 1 legs.

    Legs with the same distance between photographs, one after another, are one line. Legs that are not lines,
    but transits from line to line, may be replaced by any other path. Optional fields have neutral defaults.
    """

    xy: Floats  # (n, 2), corners in metres
    trigger_m: Floats  # (n - 1,), distance between photographs on the leg to the next corner; 0 for none
    is_line: Bools  # (n - 1,), whether a leg is what the flight is for, such as a survey line
    hold_s: Floats = field(default_factory=_NONE.copy)  # (n,), wait at each corner
    shots: Bools = field(default_factory=lambda: _NONE.astype(bool))  # (n,), single photographs
    look_at: Floats = field(default_factory=_NONE.copy)  # (n - 1, 2), target of the camera, or NaN
    # (n - 1,), gimbal pitch on the leg where there are several; NaN for that of the leg before
    pitch_deg: Floats = field(default_factory=_NONE.copy)
    # (n,), on the leg to each corner; the first one leads from home. NaN for the mission's speed
    speed_m_s: Floats = field(default_factory=_NONE.copy)

    def __post_init__(self) -> None:
        corners, legs = len(self.xy), len(self.is_line)
        for name, default in (
            ("hold_s", np.zeros(corners)),
            ("shots", np.zeros(corners, bool)),
            ("look_at", np.full((legs, 2), np.nan)),
            ("pitch_deg", np.full(legs, np.nan)),
            ("speed_m_s", np.full(corners, np.nan)),
        ):
            if not len(getattr(self, name)):
                object.__setattr__(self, name, default)

    @classmethod
    def of_path(cls, xy: Floats) -> "Track":
        """Make lines without photographs."""
        return cls(xy, np.zeros(len(xy) - 1), np.ones(len(xy) - 1, bool))

    @classmethod
    def transit(cls, xy: Floats) -> "Track":
        """Make legs that lead from line to line."""
        return cls(xy, np.zeros(len(xy) - 1), np.zeros(len(xy) - 1, bool))

    @classmethod
    def of_line(cls, xy: Floats, photos: Photos | None, height_m: float) -> "Track":
        """Make a line of one leg or more that is photographed from its start to its end."""
        if photos is None:
            return cls.of_path(xy)
        return cls.with_photos(xy, photos, photos.line_trigger_m(_length(xy), height_m))

    @classmethod
    def with_photos(cls, xy: Floats, photos: Photos, trigger_m: float) -> "Track":
        """Make a line with photographs at most a distance apart, by the trigger of the camera."""
        if photos.trigger == "none":
            return cls.of_path(xy)
        length = _length(xy)
        if photos.trigger == "hover":
            return _hovering(xy, math.ceil(length / trigger_m - 1e-6))
        if length <= SAME_PLACE_M:  # a leg of no length cannot trigger
            return replace(cls.of_path(xy), shots=np.arange(len(xy)) == 0)
        return replace(cls.of_path(xy), trigger_m=np.full(len(xy) - 1, trigger_m))

    @classmethod
    def joined(cls, tracks: Sequence["Track"]) -> "Track":
        """Join tracks of which each begins where the one before it ends."""
        arrays = {name: np.concatenate([getattr(track, name) for track in tracks]) for name in _FIELDS}
        number = np.repeat(np.arange(len(tracks)), [len(track.xy) for track in tracks])
        return cls(**_merged(arrays, np.arange(len(number)) - number))

    @property
    def length_m(self) -> float:
        """Length in metres."""
        return _length(self.xy)

    def reversed(self) -> "Track":
        """Return the track from its end to its start."""
        return Track(**{name: getattr(self, name)[::-1] for name in _FIELDS})

    def part(self, first: int, last: int) -> "Track":
        """Return the track from one corner to a later one, or the same."""
        corners, legs = slice(first, last + 1), slice(first, last)
        return Track(**{name: getattr(self, name)[legs if name in OF_LEGS else corners] for name in _FIELDS})

    def part_from(self, first: int) -> "Track":
        """Return the track from a corner to its end."""
        return self.part(first, len(self.xy) - 1)

    def leg(self, number: int, xy: Floats) -> "Track":
        """Return a piece (2, 2) of one leg, with holds and photographs only at corners of the track."""
        whole = self.part(number, number + 1)
        same = np.hypot(*(whole.xy - xy).T) <= SAME_PLACE_M
        return replace(whole, xy=xy, hold_s=np.where(same, whole.hold_s, 0.0), shots=whole.shots & same)

    @property
    def pitch_changes(self) -> list[tuple[int, int]]:
        """The last leg of each gimbal pitch, and the first one of the next."""
        known = np.flatnonzero(np.isfinite(self.pitch_deg)).tolist()
        return [(one, two) for one, two in pairwise(known) if self.pitch_deg[one] != self.pitch_deg[two]]

    def line_runs(self) -> list[tuple[int, int]]:
        """Return the first and last corner of each run of lines, or the only corner twice."""
        if not len(self.is_line):
            return [(0, 0)]
        edges = np.flatnonzero(np.diff(self.is_line, prepend=False, append=False))
        return [(int(first), int(last)) for first, last in edges.reshape(-1, 2)]

    def started_at(self, corner: int) -> "Track":
        """Return a closed track that starts, and ends, at another of its corners."""
        if not corner:
            return self
        around = Track.joined([self.part_from(corner), self.part(0, corner)])
        around.shots[-1] = False  # it was taken at the start, which is the same place
        return around

    def without_repeats(self) -> "Track":
        """Return the track, without speeds, with one corner where several follow at the same place."""
        moved = leg_lengths(self.xy) > SAME_PLACE_M
        corners = {name: getattr(self, name) for name in ("xy", "hold_s", "shots")}
        legs = {name: getattr(self, name)[moved] for name in OF_LEGS}
        return Track(**_merged(corners, np.r_[0, np.cumsum(moved)]), **legs)

    def in_degrees(self, plane: Plane) -> "Track":
        """Return the track with places as longitude and latitude."""
        xy, look_at = (np.column_stack(plane.lonlat_from_xy(*one.T)) for one in (self.xy, self.look_at))
        return replace(self, xy=xy, look_at=np.where(np.isfinite(self.look_at), look_at, np.nan))


_FIELDS = tuple(field.name for field in fields(Track))
OF_LEGS = ("trigger_m", "is_line", "look_at", "pitch_deg")


def _merged(arrays: dict[str, Any], place: Integers) -> dict[str, Any]:
    """Return arrays of a track with one corner for each place: its first one, with all holds and shots."""
    first = np.flatnonzero(np.diff(place, prepend=-1))
    corners = {name: array[first] for name, array in arrays.items() if name not in OF_LEGS}
    merged = {
        "hold_s": np.maximum.reduceat(arrays["hold_s"], first),
        "shots": np.logical_or.reduceat(arrays["shots"], first),
    }
    return {**arrays, **corners, **merged}


def _hovering(xy: Floats, count: int) -> Track:
    """Make a line with a stop and a photograph at its start, its end, and count - 1 places between."""
    if not count:
        is_first = np.arange(len(xy)) == 0
        return replace(Track.of_path(xy), shots=is_first, hold_s=HOVER_S * is_first)
    at = np.r_[0.0, np.cumsum(leg_lengths(xy))]
    stops = np.linspace(0, at[-1], count + 1)
    known = at[np.abs(at[:, None] - stops).min(axis=1) > SAME_PLACE_M]
    distances = np.sort(np.concatenate([stops, known]))
    corners = np.column_stack([np.interp(distances, at, xy[:, k]) for k in (0, 1)])
    shots = np.isin(distances, stops)
    return replace(Track.of_path(corners), shots=shots, hold_s=np.where(shots, HOVER_S, 0.0))


def _length(xy: Floats) -> float:
    return float(leg_lengths(xy).sum())


def leg_lengths(xy: Floats) -> Floats:
    """Return the lengths (n - 1,) of the legs of a path (n, 2)."""
    lengths: Floats = np.hypot(*np.diff(xy, axis=0).T)
    return lengths
