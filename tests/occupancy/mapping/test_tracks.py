"""Segments keep their numbers: while they move, touch and part; no number is used twice."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from benchmarks.changes import identity_score
from uavseg.errors import ParameterError
from uavseg.occupancy.mapping.grid import OccupancyGrid
from uavseg.occupancy.mapping.live import MAX_ABSENT_UPDATES, SegmentTracks
from uavseg.segmentation.params.segment import IntensityRange


def picture(*rows: str) -> np.ndarray:
    return np.array([[cell != "." for cell in row] for row in rows])


def number_at(tracks: SegmentTracks, row: int, col: int) -> int:
    return int(tracks.numbers[row, col])


def test_a_segment_appears_moves_and_vanishes() -> None:
    tracks = SegmentTracks((3, 8))
    assert tracks.update(picture("##......", "##......", "........")).appeared == (1,)
    found = tracks.update(picture(".##.....", ".##.....", "........"))
    assert (found.moved, found.appeared, found.vanished) == ((1,), (), ())
    found = tracks.update(picture("....##..", "....##..", "........"))  # farther than its own width
    assert found.moved == (1,) and number_at(tracks, 0, 4) == 1
    found = tracks.update(picture("........", "........", "........"))
    assert found.vanished == (1,) and not tracks.numbers.any()


def test_two_segments_that_touch_and_part_have_their_numbers_again() -> None:
    tracks = SegmentTracks((2, 9))
    tracks.update(picture("##....##.", "##....##."))
    assert (number_at(tracks, 0, 0), number_at(tracks, 0, 6)) == (1, 2)
    tracks.update(picture("##.##....", "##.##...."))
    found = tracks.update(picture("####.....", "####....."))
    assert found.merged == {1: (2,)} and found.vanished == ()
    found = tracks.update(picture("##..##...", "##..##..."))
    assert found.split == {1: (2,)} and found.appeared == ()
    assert (number_at(tracks, 0, 0), number_at(tracks, 0, 4)) == (1, 2)


def test_a_walker_that_passes_a_smaller_box_leaves_it_its_number() -> None:
    tracks = SegmentTracks((4, 14))
    for col in range(11):
        row = np.zeros((4, 14), bool)
        row[0:3, col : col + 3] = True
        row[3, 6:8] = True
        tracks.update(row)
        if col == 0:
            walker, box = number_at(tracks, 0, 1), number_at(tracks, 3, 6)
    assert (number_at(tracks, 0, 11), number_at(tracks, 3, 6)) == (walker, box)


def test_a_part_that_breaks_off_is_new_and_the_larger_one_keeps_the_number() -> None:
    tracks = SegmentTracks((1, 9))
    tracks.update(picture("########."))
    found = tracks.update(picture("#####.##."))
    assert found.split == {1: (2,)} and number_at(tracks, 0, 0) == 1 and number_at(tracks, 0, 6) == 2


def test_a_number_comes_back_at_its_place_for_some_updates() -> None:
    tracks, box, empty = SegmentTracks((1, 4)), picture("##.."), picture("....")
    tracks.update(box)
    for _ in range(MAX_ABSENT_UPDATES - 1):
        tracks.update(empty)
    assert tracks.update(box).appeared == (1,)
    for _ in range(MAX_ABSENT_UPDATES + 1):
        tracks.update(empty)
    assert tracks.update(box).appeared == (2,)


@pytest.mark.slow
@given(st.integers(0, 99999))
@settings(max_examples=40, deadline=None)
def test_no_number_is_used_twice_and_changes_tell_all(seed: int) -> None:
    rng = np.random.default_rng(seed)
    tracks, alive, newest = SegmentTracks((6, 9)), set(), 0
    for _ in range(12):
        inside = rng.random((6, 9)) < rng.choice([0.05, 0.3, 0.5])
        found = tracks.update(inside)
        assert np.array_equal(tracks.numbers > 0, inside)
        there = set(np.unique(tracks.numbers[inside]).tolist())
        fresh = {number for number in there if number > newest}
        parts = {one for several in found.split.values() for one in several}
        assert fresh <= set(found.appeared) | parts
        gone = set(found.vanished) | {one for several in found.merged.values() for one in several}
        assert alive - there <= gone | (alive - there - gone)
        assert set(found.vanished).isdisjoint(there) and set(found.appeared) <= there
        assert (alive | set(found.appeared) | parts) >= there
        newest = max(newest, *there) if there else newest
        alive = there


def test_a_live_map_tells_its_changes() -> None:
    grid = OccupancyGrid.empty((128, 192), 0.05)
    live = grid.segment()
    assert live.changes().appeared == () and not live.numbers().any()
    grid.log_odds[16:48, 16:48] = 5
    grid._recompute()
    assert live.changes().appeared == (1,)
    assert live.numbers().shape == (16, 24) and (live.numbers() == 1).sum() == 16
    assert live.changes(2).appeared == (1,)  # of the unknown cells around
    assert np.array_equal(live.numbers(2) > 0, live.intervals == 2)
    ranged = grid.segment(IntensityRange(0.8, 1))
    assert ranged.changes(2).appeared == (1,)
    with pytest.raises(ParameterError, match="intervals are 1 to 3 here, not 4"):
        live.changes(4)


@pytest.mark.slow
def test_identities_over_sixty_updates_of_a_drawn_scene() -> None:
    assert identity_score(1, 60) >= 0.99
