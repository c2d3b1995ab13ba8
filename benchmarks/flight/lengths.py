"""Length of surveys against a lower bound: the area over the spacing, and the tour between regions."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely

from benchmarks.flight.fields import Field
from benchmarks.flight.measured import in_metres
from uavseg.flight.cover.corridor import corridor
from uavseg.flight.cover.lines import path_length
from uavseg.flight.cover.survey import CoverParams, surveys
from uavseg.flight.order.tour import Stops, short_tour


@dataclass(frozen=True, slots=True)
class Length:
    """How long the survey of a field is; metres.

    Parameters
    ----------
    field : str
    area_m : float
        Area over spacing: what lines without any overlap would have.
    tour_m : float
        The shortest tour over the regions, between those of their places that are nearest to each other.
    lines_m, legs_m : float
        Lines, and legs between them within regions, without the ways between regions.
    corridor_m : float
        Lines and legs of corridors.
    """

    field: str
    area_m: float
    tour_m: float
    lines_m: float
    legs_m: float
    corridor_m: float

    @property
    def over_bound(self) -> float:
        """Lines, legs and the tour, relative to area over spacing and the tour."""
        return (self.lines_m + self.legs_m + self.tour_m) / (self.area_m + self.tour_m)

    @property
    def corridor_over_bound(self) -> float:
        """The same of corridors."""
        return (self.corridor_m + self.tour_m) / (self.area_m + self.tour_m)


def length_of(field: Field, spacing_m: float, reach_m: float) -> Length:
    """The survey of a field with lines so far apart, whose photographs reach beyond their ends."""
    regions = [in_metres([polygon], field) for polygon in field.polygons]
    flown = [surveys(region, CoverParams(spacing_m, reach_m=reach_m))[0] for region in regions]
    along = [corridor(region, spacing_m, reach_m) for region in regions]
    apart = np.array(shapely.distance(np.array(regions)[:, None], np.array(regions)[None]))
    tour = 0.0
    if len(regions) > 1:
        stops = Stops.of([np.array([[k, k]]) for k in range(1, len(regions))])
        order = [0, *(stop + 1 for stop, _ in short_tour(stops, apart, 0, 0))]
        tour = float(apart[order, np.roll(order, -1)].sum())
    return Length(
        field.name,
        sum(region.area for region in regions) / spacing_m,
        tour,
        sum(float(np.hypot(*(one.lines[:, 1] - one.lines[:, 0]).T).sum()) for one in flown),
        sum(path_length(leg) for one in flown for leg in one.legs),
        sum(one.length_m for one in along),
    )


def lengths(fields: Sequence[Field], spacing_m: float, reach_m: float) -> list[Length]:
    """The same of many fields."""
    return [length_of(field, spacing_m, reach_m) for field in fields]
