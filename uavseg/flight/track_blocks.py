"""Survey blocks of tracks, in degrees."""

from collections.abc import Iterable

import numpy as np
import shapely

from uavseg.flight.along import round_degrees
from uavseg.flight.params import PlanParams
from uavseg.flight.plane import Plane
from uavseg.flight.survey_block import Position, SurveyBlock
from uavseg.flight.track import Floats, Track

SLACK = 0.1  # spacings by which outlines are simplified


def blocks_of_tracks(tracks: Iterable[Track], plane: Plane, params: PlanParams) -> tuple[SurveyBlock, ...]:
    """The cells of surveys as `SurveyBlock`s, with the positions that `items_along` gives their waypoints."""
    return tuple(
        SurveyBlock(
            _positions(_simple(part.outline, params.spacing_m or 0.0), plane),
            _positions(part.corners, plane),
            part.angle_deg,
            float(params.spacing_m or 0.0),
            float(params.altitude_m),
            params.photos,
        )
        for track in tracks
        for part in track.parts
    )


def _simple(outline: Floats, spacing_m: float) -> Floats:
    """An outline without corners that do not change which lines are flown over it."""
    if len(outline) < 3:
        return outline
    simple = shapely.simplify(shapely.Polygon(outline), SLACK * spacing_m)
    corners: Floats = shapely.get_coordinates(simple)[:-1]
    return corners


def _positions(xy: Floats, plane: Plane) -> tuple[Position, ...]:
    if not len(xy):
        return ()
    lon, lat = plane.lonlat_from_xy(*np.asarray(xy, np.float64).T)
    return tuple(zip(round_degrees(lat), round_degrees(lon), strict=True))
