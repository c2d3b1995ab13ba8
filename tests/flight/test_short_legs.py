"""Short legs between lines: left out where the way past them is free, else the line ends earlier."""

import numpy as np
import pytest
import shapely
from hypothesis import given, strategies as st

from uavseg.flight.avoid.free_space import FreeSpace
from uavseg.flight.camera.camera import Camera, Photos
from uavseg.flight.mission.track import Track
from uavseg.flight.planning.split import MIN_LEG_M, without_short_legs

PHOTOS = Photos(Camera("wide", (13.2, 8.8), (5472, 3648), 8.8, 0.5))
OPEN = FreeSpace()
WALL = FreeSpace(obstacles=[shapely.box(40, -50, 60, 0)])


def line(*corners: tuple[float, float]) -> Track:
    return Track.of_line(np.array(corners, float), PHOTOS, 60)


def way(*corners: tuple[float, float]) -> Track:
    return Track.transit(np.array(corners, float))


def test_a_corner_beside_the_end_of_a_line_is_left_out_where_the_way_past_it_is_free() -> None:
    there = line((0, 0), (30, 0))
    back = line((30, 20), (0, 20))
    found = without_short_legs(Track.joined([there, way((30, 0), (30.2, 0.1), (30, 20)), back]), OPEN)
    assert found.xy.tolist() == [[0, 0], [30, 0], [30, 20], [0, 20]]
    assert found.is_line.tolist() == [True, False, True] and (found.trigger_m > 0).tolist() == [1, 0, 1]


def test_a_corner_that_loses_the_next_one_is_looked_at_again() -> None:
    corners = [(0, 0), (0, 0.8), (0.69, 0.95), (0, 1)]
    track = Track.joined([line((-9, 0), corners[0]), way(*corners), line(corners[-1], (-9, 20))])
    assert without_short_legs(track, OPEN).xy.tolist() == [[-9, 0], [0, 0], [0, 1], [-9, 20]]


def test_else_the_line_beside_it_ends_earlier() -> None:
    track = Track.joined([line((0, -0.2), (40, -0.2)), way((40, -0.2), (40, 0), (60, 0), (70, -30))])
    found = without_short_legs(track, WALL)
    assert found.xy.tolist() == [[0, -0.2], [40 - MIN_LEG_M, -0.2], [40, 0], [60, 0], [70, -30]]


def test_corners_of_lines_and_places_with_a_photograph_stay() -> None:
    fine = line((0, 0), (10, 0), (10.2, 0.1), (10.2, 9))
    assert (without_short_legs(fine, OPEN).xy == fine.xy).all()
    shots = np.array([0, 1, 0], bool)
    stop = Track(np.array([[0, 0], [0.1, 0], [9, 0.0]]), np.zeros(2), np.zeros(2, bool), shots=shots)
    assert (without_short_legs(stop, OPEN).xy == stop.xy).all()


@pytest.mark.slow
@given(
    st.lists(st.tuples(st.floats(-80, 180), st.floats(-80, 80)), min_size=4, max_size=8),
    st.lists(st.tuples(st.floats(-0.6, 0.6), st.floats(-0.6, 0.6)), min_size=8, max_size=8),
)
def test_no_leg_leaves_free_space_and_ends_of_lines_move_no_farther_than_the_least_leg(
    places: list[tuple[float, float]], beside: list[tuple[float, float]]
) -> None:
    """Lines between places; each way to the next line begins and ends with a short leg."""
    corners = np.array(places[: len(places) // 2 * 2])
    tracks: list[Track] = []
    for k in range(0, len(corners), 2):
        if tracks:
            near = [tracks[-1].xy[-1] + beside[k], corners[k] + beside[k - 1]]
            tracks.append(Track.transit(np.array([tracks[-1].xy[-1], *near, corners[k]])))
        tracks.append(Track.of_line(corners[k : k + 2], PHOTOS, 60))
    track = Track.joined(tracks)
    for space in (WALL, OPEN):
        found = without_short_legs(track, space)
        assert found.is_line.sum() == len(corners) // 2
        if space.sees(track.xy[:-1], track.xy[1:]).all():
            assert space.sees(found.xy[:-1], found.xy[1:]).all()
        ends = [found.xy[np.flatnonzero(found.is_line) + side] - corners[side::2] for side in (0, 1)]
        assert all((np.hypot(*moved.T) <= MIN_LEG_M + 1e-9).all() for moved in ends)
    between = ~(found.is_line[1:] | found.is_line[:-1])  # corners of ways, in the open
    legs = np.hypot(*np.diff(found.xy, axis=0).T)
    assert (np.minimum(legs[1:], legs[:-1])[between] >= MIN_LEG_M).all()
