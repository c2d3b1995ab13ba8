"""What missions photograph: the regions with their margin, whatever the trigger is."""

import pytest
import shapely
from hypothesis import given, settings, strategies as st

from tests.flight.cover.cover_fields import fields
from tests.flight.patterns.photographed import photographs
from tests.flight.small_regions import degrees, planned
from uavseg.flight.camera.camera import Camera, Overlap, Photos
from uavseg.flight.mission.track import Plane
from uavseg.flight.params.plan import CorridorParams, LimitParams, SurveyParams

CAMERA = Camera("wide", (13.2, 8.8), (5472, 3648), 8.8, 0.5)
PLANE = Plane(47.0, 8.0)


def shown(
    mission: object, photos: Photos, height_m: float, angle_deg: float | None = None
) -> shapely.Geometry:
    taken = photographs(mission, PLANE, angle_deg)  # type: ignore[arg-type]
    return shapely.union_all([one.footprint(photos, height_m) for one in taken])


@pytest.mark.slow
@given(
    fields(),
    st.sampled_from(["distance", "interval", "hover"]),
    st.sampled_from([(75, 70), (60, 40), (20, 10)]),
    st.sampled_from([20.0, 60.0]),
    st.sampled_from([0.0, 12.0]),
    st.sampled_from([0.0, 30.0, 107.0]),
)
@settings(max_examples=60)
def test_photographs_show_regions_with_their_margin(
    field: shapely.Polygon, trigger: str, overlap: tuple[int, int], height: float, margin: float, angle: float
) -> None:
    photos = Photos(CAMERA, Overlap(*overlap), trigger=trigger)
    mission = planned(
        [degrees(field)],
        altitude_m=height,
        pattern="survey",
        spacing_m=photos.spacing_m(height),
        photos=photos,
        angle_deg=angle,
        limits=LimitParams(max_items=65_000),
        how=SurveyParams(margin),
    )
    region = field.buffer(margin)
    missed = region.difference(shown(mission, photos, height, angle)).area
    assert missed <= 1e-3 * region.area


@pytest.mark.parametrize("trigger", ["distance", "hover"])
def test_corridors_show_bent_regions(trigger: str) -> None:
    field = shapely.LineString([(0, 0), (200, 30), (260, 200), (500, 220)]).buffer(30)
    photos = Photos(CAMERA, Overlap(70, 60), trigger=trigger)
    mission = planned(
        [degrees(field)],
        altitude_m=40,
        pattern="corridor",
        spacing_m=photos.spacing_m(40),
        photos=photos,
        limits=LimitParams(max_items=65_000),
        how=CorridorParams(5.0),
    )
    region = field.buffer(5)
    assert region.difference(shown(mission, photos, 40)).area <= 1e-3 * region.area
