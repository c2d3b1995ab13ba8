"""Tracks: joined, reversed, cut and started elsewhere, they do the same at the same places."""

import math
from dataclasses import fields, replace

import numpy as np
import pytest
from hypothesis import given, strategies as st

from uavseg.flight.camera.camera import Camera, Overlap, Photos
from uavseg.flight.mission.track import HOVER_S, SAME_PLACE_M, Plane, Track

CAMERA = Camera("wide", (13.2, 8.8), (5472, 3648), 8.8, 0.5)
RING = np.array([[0, 0], [100, 0], [100, 60], [0, 60], [0, 0.0]])


def shots(track: Track) -> set[tuple[float, float]]:
    return {(round(x, 6), round(y, 6)) for x, y in track.xy[track.shots].tolist()}


@given(
    st.lists(st.tuples(st.floats(-500, 500), st.floats(-500, 500)), min_size=2, max_size=6), st.floats(5, 90)
)
def test_photographs_in_hover_overlap_along_the_line(
    corners: list[tuple[float, float]], every: float
) -> None:
    line = Track.with_photos(np.array(corners), Photos(CAMERA, trigger="hover"), every)
    stops = line.xy[line.shots]
    assert (np.hypot(*(stops[[0, -1]] - np.array(corners)[[0, -1]]).T) <= SAME_PLACE_M).all()
    assert (np.hypot(*np.diff(stops, axis=0).T) <= every + 1e-6).all()
    assert (line.hold_s[line.shots] == HOVER_S).all() and not line.hold_s[~line.shots].any()
    left_out_m = (
        Track.of_path(np.array(corners)).length_m - line.length_m
    )  # of corners that are stops, or nearly
    assert -1e-6 <= left_out_m <= 2 * SAME_PLACE_M * len(corners)
    assert line.is_line.all() and not line.trigger_m.any()


def test_a_line_of_no_length_is_photographed_once() -> None:
    for trigger in ("distance", "interval", "hover"):
        line = Track.of_line(np.zeros((2, 2)), Photos(CAMERA, trigger=trigger), 60).without_repeats()
        assert line.shots.tolist() == [True] and not len(line.trigger_m)


@pytest.mark.parametrize("trigger", ["distance", "interval", "hover", "none"])
@pytest.mark.parametrize("start", [0, 1, 3])
def test_a_ring_may_start_at_any_corner(trigger: str, start: int) -> None:
    ring = Track.with_photos(RING, Photos(CAMERA, Overlap(75, 70), trigger=trigger), 15)
    moved = ring.started_at(start)
    assert (moved.xy[0] == moved.xy[-1]).all() and (moved.xy[0] == ring.xy[start]).all()
    assert moved.length_m == pytest.approx(ring.length_m) and shots(moved) == shots(ring)
    assert sorted(moved.trigger_m) == sorted(ring.trigger_m)


def test_the_reverse_does_the_same_at_the_same_places() -> None:
    line = Track.with_photos(RING[:4], Photos(CAMERA, trigger="hover"), 17)
    back = line.reversed()
    assert shots(back) == shots(line) and (back.reversed().xy == line.xy).all()
    assert (back.hold_s == line.hold_s[::-1]).all()


@given(st.lists(st.integers(1, 4), min_size=1, max_size=6), st.integers(0, 10**6))
def test_tracks_joined_at_once_are_those_joined_one_after_another(corners: list[int], seed: int) -> None:
    rng = np.random.default_rng(seed)
    tracks = []
    for count in corners:  # some of one corner, which is that of both neighbours
        track = Track.of_path(rng.random((count, 2)))
        tracks.append(replace(track, hold_s=rng.integers(0, 3, count) / 2, shots=rng.random(count) < 0.5))
    at_once, one_by_one = Track.joined(tracks), tracks[0]
    for track in tracks[1:]:
        one_by_one = Track.joined([one_by_one, track])
    for field in fields(Track):
        assert np.array_equal(getattr(at_once, field.name), getattr(one_by_one, field.name), equal_nan=True)


def test_joined_tracks_share_a_corner_and_what_is_done_there() -> None:
    one = Track.with_photos(np.array([[0, 0], [30, 0.0]]), Photos(CAMERA, trigger="hover"), 15)
    way = Track.transit(np.array([[30, 0], [30, 20.0]]))
    both = Track.joined([one, way, Track.of_path(np.array([[30, 20], [0, 20.0]]))])
    assert both.xy.tolist() == [[0, 0], [15, 0], [30, 0], [30, 20], [0, 20]]
    assert both.shots.tolist() == [True, True, True, False, False]
    assert both.is_line.tolist() == [True, True, False, True]
    assert both.line_runs() == [(0, 2), (3, 4)]
    assert shots(both.part(1, 3)) == {(15, 0), (30, 0)}


def test_a_piece_of_a_leg_has_no_photograph_where_it_was_cut() -> None:
    line = Track.with_photos(np.array([[0, 0], [30, 0.0]]), Photos(CAMERA, trigger="hover"), 30)
    piece = line.leg(0, np.array([[0, 0], [12, 0.0]]))
    assert shots(piece) == {(0, 0)} and piece.hold_s.tolist() == [HOVER_S, 0]


def test_places_in_degrees_are_those_in_metres() -> None:
    plane = Plane(47.0, 8.0)
    look_at = np.tile([50.0, 30.0], (4, 1))
    track = Track(RING, np.zeros(4), np.ones(4, bool), look_at=look_at).in_degrees(plane)
    x, y = plane.xy_from_lonlat(*track.look_at.T)
    assert np.allclose(x, 50) and np.allclose(y, 30)
    assert np.isnan(Track.of_path(RING).in_degrees(plane).look_at).all()
    assert math.isclose(float(plane.xy_from_lonlat(*track.xy[1])[0]), 100, abs_tol=1e-6)
