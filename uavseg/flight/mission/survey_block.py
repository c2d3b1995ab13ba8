"""Survey blocks: parts of a survey that a ground station could plan again from their outline."""

from dataclasses import dataclass

import shapely

from uavseg.flight.camera.photos import Photos

Position = tuple[float, float]  # lat, lon in degrees, WGS 84
NEARLY_CONVEX = 0.9  # of the area of its convex hull


@dataclass(frozen=True, slots=True)
class SurveyBlock:
    """One cell of a survey, and the waypoints of the lines over it.

    Parameters
    ----------
    outline : tuple of (lat, lon)
        The cell in degrees, without a repetition of the first vertex; empty if it has holes.
    waypoints : tuple of (lat, lon)
        Starts and ends of its lines in the order in which they are flown, or in reverse; empty if it is flown
        otherwise than line by line.
    angle_deg : float
        Azimuth of the lines, clockwise from north.
    spacing_m, height_m : float
        Distance between the lines, and their height above home.
    photos : Photos, optional
        How it is photographed.
    """

    outline: tuple[Position, ...]
    waypoints: tuple[Position, ...]
    angle_deg: float
    spacing_m: float
    height_m: float
    photos: Photos | None = None

    @property
    def is_editable(self) -> bool:
        """Whether lines over it cross its outline twice, or nearly so, however they are turned."""
        if len(self.outline) < 3 or len(self.waypoints) < 2:
            return False
        cell = shapely.Polygon([(lon, lat) for lat, lon in self.outline])
        return bool(cell.is_valid and cell.area >= NEARLY_CONVEX * cell.convex_hull.area)
