"""Survey blocks of tracks, in degrees."""

from collections.abc import Iterable

import numpy as np

from uavseg.flight.along import round_degrees
from uavseg.flight.params import PlanParams
from uavseg.flight.plane import Plane
from uavseg.flight.survey_block import Position, SurveyBlock
from uavseg.flight.track import Floats, Track


def blocks_of_tracks(tracks: Iterable[Track], plane: Plane, params: PlanParams) -> tuple[SurveyBlock, ...]:
    """The cells of surveys as `SurveyBlock`s, with the positions that `items_along` gives their waypoints."""
    return tuple(
        SurveyBlock(
            _positions(part.outline, plane),
            _positions(part.corners, plane),
            part.angle_deg,
            float(params.spacing_m or 0.0),
            float(params.altitude_m),
            params.photos,
        )
        for track in tracks
        for part in track.parts
    )


def _positions(xy: Floats, plane: Plane) -> tuple[Position, ...]:
    if not len(xy):
        return ()
    lon, lat = plane.lonlat_from_xy(*np.asarray(xy, np.float64).T)
    return tuple(zip(round_degrees(lat), round_degrees(lon), strict=True))
