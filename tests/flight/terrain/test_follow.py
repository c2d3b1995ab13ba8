"""Flights over the ground of a DEM: height above it on every leg, speeds, triggers, the way home."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings, strategies as st

from tests.flight.terrain.dems import HOME, Surface, cliff, cone, draw, hills, noise, plane, write
from tests.flight.terrain.flights import GEOD, PLANE, TRIGGERS, ZIGZAG, flown, follow, slopes, track
from uavseg.errors import MissionError
from uavseg.flight.camera.camera import Camera, Photos
from uavseg.flight.mission.items import (
    CAMERA_DISTANCE,
    CHANGE_SPEED,
    FRAME_AMSL,
    FRAME_RELATIVE,
    FRAME_TERRAIN,
    WAYPOINT,
    HomePosition,
)
from uavseg.flight.params.plan import PlanParams
from uavseg.flight.planning.along import items_along
from uavseg.raster.elevation.dem import Dem

EPSILON_M = 0.02  # coordinates are rounded to a millimetre, and ground may be steep

gentle = st.one_of(
    st.builds(plane, st.floats(-0.5, 0.5), st.floats(-0.5, 0.5)),
    st.builds(cone, st.floats(5, 200), st.floats(300, 700), st.floats(-300, 300), st.floats(-300, 300)),
    st.builds(hills, st.floats(5, 120), st.integers(0, 99), st.floats(300, 900)),
)
paths = st.lists(st.tuples(st.integers(-900, 900), st.integers(-900, 900)), min_size=1, max_size=6)


@pytest.mark.slow
@given(gentle, paths, st.floats(0.5, 20), st.floats(40, 120), st.sampled_from([3.0, 11.0, 47.0]))
@settings(max_examples=20, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_the_height_above_the_ground_is_within_the_tolerance_everywhere(
    tmp_path: Path,
    surface: Surface,
    path: list[tuple[int, int]],
    tolerance_m: float,
    altitude_m: float,
    pixel_m: float,
) -> None:
    dem = Dem.open(draw(tmp_path / "a.tif", surface, pixel_m, 1200))
    found = follow(dem, path, altitude_m=altitude_m, tolerance_m=tolerance_m, climb_m_s=10, descent_m_s=10)
    above = flown(dem, found)
    assert above.min() >= altitude_m - tolerance_m - EPSILON_M
    assert above.max() <= altitude_m + tolerance_m + EPSILON_M
    assert found.ground is not None
    assert (
        found.ground.lowest_m - EPSILON_M <= above.min() and above.max() <= found.ground.highest_m + EPSILON_M
    )


@pytest.mark.slow
@given(
    st.one_of(st.builds(cliff, st.floats(10, 100), st.floats(-300, 300)), st.builds(noise, st.floats(1, 60))),
    paths,
    st.floats(0.5, 20),
    st.floats(0.3, 12),
    st.floats(0.5, 5),
    st.floats(0.5, 5),
)
@settings(max_examples=20, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_steep_ground_is_never_approached_and_no_leg_is_steeper_than_the_vehicle(
    tmp_path: Path,
    surface: Surface,
    path: list[tuple[int, int]],
    tolerance_m: float,
    speed_m_s: float,
    climb_m_s: float,
    descent_m_s: float,
) -> None:
    dem = Dem.open(draw(tmp_path / "a.tif", surface, 10.0, 1200))
    rates = {"climb_m_s": climb_m_s, "descent_m_s": descent_m_s}
    found = follow(dem, path, speed_m_s=speed_m_s, tolerance_m=tolerance_m, **rates)
    assert flown(dem, found).min() >= 60 - tolerance_m - EPSILON_M
    length, rise = slopes(dem, found)
    seconds = length / found.heights.speed_m_s
    assert (rise <= climb_m_s * seconds + 0.02).all() and (-rise <= descent_m_s * seconds + 0.02).all()
    assert (found.heights.speed_m_s <= speed_m_s).all()
    assert (found.heights.speed_m_s >= min(speed_m_s, 1.0)).all()


def test_flat_ground_and_a_plane_need_no_points(tmp_path: Path) -> None:
    for surface in (plane(0, 0), plane(0.1, 0.05)):
        found = follow(Dem.open(draw(tmp_path / "a.tif", surface)), triggers=TRIGGERS)
        assert not found.heights.added.any()
        corners = np.column_stack(PLANE.xy_from_lonlat(*found.track.xy.T))[: len(ZIGZAG)]
        assert np.allclose(corners, ZIGZAG, atol=0.01)
        assert found.track.trigger_m[: len(TRIGGERS)].tolist() == list(TRIGGERS)
        assert (found.heights.speed_m_s == 5).all()


def test_fewer_points_are_added_with_a_larger_tolerance(tmp_path: Path) -> None:
    dem = Dem.open(draw(tmp_path / "a.tif", hills(150)))
    counts = [int(follow(dem, tolerance_m=tolerance).heights.added.sum()) for tolerance in (1, 3, 10, 30)]
    assert counts == sorted(counts, reverse=True) and counts[0] > 2 * counts[-1]


def test_photographs_go_on_over_an_added_point(tmp_path: Path) -> None:
    dem = Dem.open(draw(tmp_path / "a.tif", cone(150, 500)))
    found = follow(dem, triggers=TRIGGERS)
    assert found.heights.added.any()
    items = items_along(found.track, HomePosition(*HOME), photographed(), found.heights)
    assert sum(item.command == WAYPOINT for item in items) == len(found.track.xy) > len(ZIGZAG) + 4
    triggers = [item.params for item in items if item.command == CAMERA_DISTANCE]
    # a line ends where the next one begins, or with a distance of 0: as without a DEM
    plain = items_along(track(*found_lonlat(), TRIGGERS), HomePosition(*HOME), photographed())
    assert triggers == [item.params for item in plain if item.command == CAMERA_DISTANCE]
    places = [(item.lat, item.lon) for item in items if item.command == WAYPOINT]
    started = [places[sum(i.command == WAYPOINT for i in items[:k]) - 1] for k, item in enumerate(items)
               if item.command == CAMERA_DISTANCE]  # fmt: skip
    x, y = PLANE.xy_from_lonlat([lon for _, lon in started], [lat for lat, _ in started])
    assert np.allclose(np.column_stack([x, y]), ZIGZAG, atol=0.02)


def photographed() -> PlanParams:
    photos = Photos(Camera("DJI Phantom 4 Pro", (13.2, 8.8), (5472, 3648), 8.8, 2))
    return PlanParams(60, "survey", 30.0, photos=photos)


def found_lonlat() -> Any:
    return PLANE.lonlat_from_xy(*np.array(ZIGZAG, float).T)


def test_the_speed_is_set_before_a_steep_leg_and_back_after_it(tmp_path: Path) -> None:
    dem = Dem.open(draw(tmp_path / "a.tif", lambda x, y: 400 + np.clip(x, 0, 200) + 0 * y))
    found = follow(dem, [(-300, 0), (500, 0)], home=PLANE.lonlat_from_xy(-500.0, 0.0)[::-1], tolerance_m=2)
    items = items_along(found.track, HomePosition(*HOME), PlanParams(60), found.heights)
    speed, on_legs = 5.0, []
    for item in items:
        if item.command == CHANGE_SPEED:
            speed = item.params[1] or 0.0
        elif item.command == WAYPOINT:
            on_legs.append(speed)
    assert on_legs == found.heights.speed_m_s.tolist() and speed == 5
    up = on_legs[: int(np.argmax(found.heights.height_m)) + 1]
    assert up[0] == 5 and min(up) == 2.5 and on_legs[-1] == 5  # a slope of 1 is climbed at 2.5 m/s
    assert any("the speed is lowered" in note for note in found.notes)


def test_a_cliff_is_crossed_high_enough_and_reported(tmp_path: Path) -> None:
    dem = Dem.open(draw(tmp_path / "a.tif", cliff(80), pixel_m=2.0, half_m=800))
    found = follow(dem, [(-300, 0), (300, 0)], home=PLANE.lonlat_from_xy(-500.0, 0.0)[::-1])
    [note] = [note for note in found.notes if "steeper than" in note]
    assert "m higher above the ground" in note
    assert found.ground is not None and found.ground.lowest_m >= 55
    assert found.ground.highest_m > 60 + 5


def test_heights_above_home_differ_from_those_above_the_sea_by_its_ground(tmp_path: Path) -> None:
    dem = Dem.open(draw(tmp_path / "a.tif", cone(150, 500, 0, 700)))
    absolute, relative = (follow(dem, mode=mode) for mode in ("absolute", "relative"))
    assert (absolute.heights.frame, relative.heights.frame) == (FRAME_AMSL, FRAME_RELATIVE)
    assert np.allclose(absolute.heights.height_m - relative.heights.height_m, 400, atol=1e-2)
    assert any("take off there" in note for note in relative.notes)
    low = Dem.open(draw(tmp_path / "b.tif", plane(0.3, 0)))
    with pytest.raises(MissionError, match=r"m below home at lat 47\.00.*--terrain absolute"):
        follow(low, mode="relative")


def test_the_terrain_of_the_vehicle_needs_no_points_but_slower_legs(tmp_path: Path) -> None:
    plain = follow(None, mode="frame", triggers=TRIGGERS)
    assert plain.heights.frame == FRAME_TERRAIN and (plain.heights.height_m == 60).all()
    assert len(plain.track.xy) == len(ZIGZAG) and plain.ground is None
    assert ["the vehicle itself knows" in note for note in plain.notes] == [True]
    dem = Dem.open(draw(tmp_path / "a.tif", hills(40)))
    followed = follow(dem, mode="frame", triggers=TRIGGERS)
    assert (followed.heights.height_m == 60).all() and followed.heights.frame == FRAME_TERRAIN
    steep = follow(Dem.open(draw(tmp_path / "b.tif", hills(300))), mode="frame")
    assert steep.heights.speed_m_s.min() < 5
    changes = np.flatnonzero(np.diff(steep.heights.speed_m_s) != 0)
    assert set(np.flatnonzero(steep.heights.added)) <= set(changes)


@pytest.mark.parametrize(
    ("height_m", "words"), [(40.0, "comes within 21 m of the ground"), (90.0, "leads into the ground")]
)
def test_an_early_return_towards_a_hill_is_noted(tmp_path: Path, height_m: float, words: str) -> None:
    dem = Dem.open(draw(tmp_path / "a.tif", cone(height_m, 100, 400, 0), pixel_m=5.0, half_m=1000))
    found = follow(dem, [(0, 600), (800, 600), (800, 0), (800, 600), (0, 600)])
    [note] = [note for note in found.notes if "early is level" in note]
    assert words in note and "set it higher" in note
    flat = Dem.open(draw(tmp_path / "b.tif", plane(0, 0)))
    assert not [note for note in follow(flat, [(0, 600), (800, 0)]).notes if "early is level" in note]


def test_an_early_return_over_a_valley_is_noted(tmp_path: Path) -> None:
    dem = Dem.open(draw(tmp_path / "a.tif", cone(-90, 200, 400, 0), pixel_m=5.0, half_m=1000))
    found = follow(dem, [(0, 600), (800, 600), (800, 0), (800, 600), (0, 600)])
    [note] = [note for note in found.notes if "early is level" in note]
    assert "m above lower ground, and 120 m are allowed" in note
    assert 140 < float(note.split("leads ")[1].split(" m")[0]) < 151


@pytest.mark.parametrize("height_m", [20.0, 200.0])
def test_a_hill_on_the_way_back_is_flown_over(tmp_path: Path, height_m: float) -> None:
    dem = Dem.open(draw(tmp_path / "a.tif", cone(height_m, 150, 400, 0), pixel_m=5.0, half_m=1000))
    found = follow(dem, [(0, 600), (800, 600), (800, 0)], tolerance_m=25)
    leads_home = [note for note in found.notes if "lead home" in note]
    [rise] = [note for note in found.notes if "set the autopilot's return altitude" in note]
    match = re.search(
        r"rises to (\d+) m above home, at lat 47\.002\d+, lon 9\.005\d+.* to (\d+) m at least", rise
    )
    assert match and int(match[1]) == pytest.approx(height_m * (1 - 2.5 * 2**0.5 / 150), abs=1.1)
    assert int(match[2]) >= int(match[1]) + 60
    if height_m < 25:
        assert not leads_home and GEOD.inv(*found.track.xy[-1], HOME[1], HOME[0])[2] > 700
        return
    assert leads_home
    assert GEOD.inv(*found.track.xy[-1], HOME[1], HOME[0])[2] < 0.01
    assert flown(dem, found).min() >= 35 - EPSILON_M


@pytest.mark.parametrize(
    ("path", "words"),
    [
        ([(300, 300), (300, 900), (300, 300)], r"lat 47\.00\d+, lon 9\.00\d+.* with a hole there"),
        (
            [(300, 300), (2000, 300)],
            r"lat 47\.00\d+, lon 9\.01\d+, where .* leads; it covers lat 46\.9",
        ),
        ([(2000, 300)], "give one that covers the whole flight"),
        ([(900, 300), (900, -300), (-900, -300)], "hole"),  # only on the way back
    ],
)
def test_ground_that_is_not_known_is_an_error_that_names_the_place(
    tmp_path: Path, path: Any, words: str
) -> None:
    def holed(x: Any, y: Any) -> Any:
        holes = ((np.abs(x - 300) < 50) & (np.abs(y - 600) < 50)) | (np.hypot(x + 450, y + 150) < 80)
        return np.where(holes, np.nan, 400.0)

    dem = Dem.open(draw(tmp_path / "a.tif", holed))
    with pytest.raises(MissionError, match=words):
        follow(dem, path)


def test_a_hole_beside_the_flight_is_a_note(tmp_path: Path) -> None:
    dem = Dem.open(
        draw(tmp_path / "a.tif", lambda x, y: np.where(np.hypot(x - 300, y - 300) < 50, np.nan, 400.0))
    )
    found = follow(dem, [(0, 600), (600, 600), (600, 0)])
    assert any("holes between the flight and home" in note for note in found.notes)


def test_a_missing_value_is_never_flat_ground(tmp_path: Path) -> None:
    dem = Dem.open(draw(tmp_path / "a.tif", plane(0, 0), nodata=400.0))
    with pytest.raises(MissionError, match="has no height of the ground"):
        follow(dem)


def test_a_path_that_touches_home_and_repeats_places_is_flown(tmp_path: Path) -> None:
    dem = Dem.open(draw(tmp_path / "a.tif", hills(60)))
    for path in ([(0, 0)], [(0, 0), (0, 0), (200, 0), (200, 0), (0, 0)], [(0, 0), (0.0004, 0), (90, 0)]):
        above = flown(dem, follow(dem, path))
        assert above.min() >= 55 - EPSILON_M and above.max() <= 65 + EPSILON_M


def test_a_leg_over_too_many_pixels_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("uavseg.flight.terrain.altitude_profile.MAX_PIXELS", 100)
    dem = Dem.open(draw(tmp_path / "a.tif", plane(0, 0), pixel_m=2.0))
    with pytest.raises(MissionError, match="give a coarser one"):
        follow(dem)


def test_models_in_degrees_are_followed_too(tmp_path: Path) -> None:
    from affine import Affine

    col, row = np.meshgrid(np.arange(600), np.arange(600))
    values = 300 + 40 * np.sin(col / 20) * np.cos(row / 30)
    path = write(tmp_path / "a.tif", values, Affine(1e-4, 0, 8.97, 0, -1e-4, 47.03), 4326, unit="ft")
    dem = Dem.open(path)
    above = flown(dem, follow(dem, tolerance_m=2.0))
    assert above.min() >= 58 - EPSILON_M and above.max() <= 62 + EPSILON_M
