"""Legs between lines that are too short to be flown, as where a line ends beside a corner of a zone."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from uavseg.flight.avoid.free_space import FreeSpace
from uavseg.flight.mission.track import Track

Floats = NDArray[np.float64]

LEAST_LEG_M = 0.7
"""A little more than the shortest leg that Litchi flies, 0.6 m."""


def without_short_legs(track: Track, space: FreeSpace) -> Track:
    """A track whose ways between lines have no leg shorter than 0.7 m, where free space allows that.

    A corner of a way so near to another one is left out if the leg past it is free. Else the line that ends
    beside it ends that much earlier.
    """
    track, k = replace(track, xy=track.xy.copy()), 1
    while k < len(track.xy) - 1:
        if not _is_of_way(track, k) or _lengths(track.xy[k - 1 : k + 2]).min() >= LEAST_LEG_M:
            k += 1
        elif space.sees(track.xy[k - 1, None], track.xy[k + 1, None])[0]:
            track = Track.joined([track.part(0, k - 1), _straight(track, k), track.part_from(k + 1)])
            k = max(k - 1, 1)  # the corner before has another leg now
        else:
            _shorten_line(track, k, space)
            k += 1
    return track


def _is_of_way(track: Track, k: int) -> bool:
    """Whether a corner lies between legs that may be replaced by any other way, and nothing is done there."""
    return not (track.is_line[k - 1 : k + 1].any() or track.shots[k] or track.hold_s[k])


def _straight(track: Track, k: int) -> Track:
    """A way from the corner before one to the corner after it."""
    return Track.of_way(track.xy[[k - 1, k + 1]])


def _shorten_line(track: Track, k: int, space: FreeSpace) -> None:
    """Move the ends of lines that are too near to a corner back along them, in place, where that is free."""
    for end, inward in ((k - 1, -1), (k + 1, 1)):
        leg, other = (end - 1 if inward < 0 else end), end + inward
        if not 0 <= other < len(track.xy) or not track.is_line[leg]:
            continue
        corner, along = track.xy[end].copy(), track.xy[other] - track.xy[end]
        length_m = float(np.hypot(*along))
        if _lengths(track.xy[[end, k]])[0] >= LEAST_LEG_M or length_m < 2 * LEAST_LEG_M:
            continue
        track.xy[end] += along * (LEAST_LEG_M / length_m)
        short = _lengths(track.xy[[end, k]])[0] < LEAST_LEG_M
        if short or not space.sees(track.xy[end, None], track.xy[k, None])[0]:
            track.xy[end] = corner


def _lengths(xy: Floats) -> Floats:
    lengths: Floats = np.hypot(*np.diff(xy, axis=0).T)
    return lengths
