"""Speeds of legs: what photographs allow, as few changes as save time, and points to slow down at."""

from itertools import combinations, pairwise

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from tests.flight.small_regions import box, planned
from uavseg.flight.camera.camera import Camera, Overlap, Photos
from uavseg.flight.mission.items import CAMERA_DISTANCE, CHANGE_SPEED, WAYPOINT
from uavseg.flight.mission.mission import Mission
from uavseg.flight.mission.track import Track
from uavseg.flight.params.plan import PlanParams
from uavseg.flight.terrain.follow import CHANGE_S, fewest_changes, speeds_of, with_speeds

CAMERA = Camera("slow", (13.2, 8.8), (5472, 3648), 8.8, 2.5)
PHOTOS = Photos(CAMERA, Overlap(75, 70))
LEGS = st.lists(
    st.tuples(st.floats(1, 500), st.sampled_from([0.0, 2.0, 6.0, 11.0, 12.5])), min_size=1, max_size=8
)


def params(**more: object) -> PlanParams:
    return PlanParams(50, "survey", 20.0, photos=PHOTOS, **({"speed_m_s": 12.0} | more))


def track_of(legs: list[tuple[float, float]]) -> Track:
    """Legs with a length and a trigger distance; each turns to the left or the right by a right angle."""
    heading = np.pi / 2 * (np.arange(len(legs)) % 2)
    lengths, triggers = np.array(legs).T
    steps = lengths[:, None] * np.column_stack([np.cos(heading), np.sin(heading)])
    xy = np.concatenate([[[100.0, 0.0]], np.cumsum(steps, axis=0) + np.array([100.0, 0.0])])
    return Track(xy, triggers, triggers > 0)


def limits_of(track: Track) -> np.ndarray:
    most = [PHOTOS.max_speed_m_s(50, trigger) if trigger else np.inf for trigger in track.trigger_m]
    return np.minimum(np.array(most), 12.0)


@pytest.mark.slow
@given(legs=LEGS)
@settings(max_examples=80)
def test_no_other_changes_of_speed_save_more(legs: list[tuple[float, float]]) -> None:
    track = track_of(legs)
    limit, length = limits_of(track), np.array([length for length, _ in legs])

    def seconds(speed: np.ndarray) -> float:
        return float((length / speed).sum() + CHANGE_S * np.count_nonzero(np.diff(speed)))

    found = fewest_changes(track, params())
    assert (found <= limit).all()
    least = np.inf
    inner = range(1, len(legs))
    for cuts in (cuts for count in range(len(legs)) for cuts in combinations(inner, count)):
        ends = [0, *cuts, len(legs)]
        runs = pairwise(ends)
        least = min(least, seconds(np.concatenate([np.full(b - a, limit[a:b].min()) for a, b in runs])))
    assert seconds(found) == pytest.approx(least)


@given(legs=LEGS, autopilot=st.sampled_from(["ardupilot", "px4"]))
@settings(max_examples=80)
def test_speeds_keep_the_path_and_are_low_before_a_line(
    legs: list[tuple[float, float]], autopilot: str
) -> None:
    track, requested = track_of(legs), params(autopilot=autopilot)
    flown = with_speeds(track, np.zeros(2), requested)
    speeds, length = (
        speeds_of(flown, requested),
        np.hypot(*np.diff(flown.xy, axis=0, prepend=np.zeros((1, 2))).T),
    )
    if not np.isfinite(flown.speed_m_s).any():
        assert flown is track
    assert flown.length_m + length[0] == pytest.approx(track.length_m + 100)
    for place in track.xy:
        assert np.abs(flown.xy - place).sum(axis=1).min() < 1e-9
    assert (speeds[1:] <= limits_of(flown) + 1e-9).all()
    for slower in np.flatnonzero(np.diff(speeds) < 0) + 1:  # a way before it ends by so much
        slow = np.flatnonzero(np.append(flown.trigger_m, 1)[slower - 1 :] > 0)[0] + slower
        if not flown.trigger_m[slower - 2 : slower - 1].any():
            before, after = speeds[slower - 1], speeds[slower]
            braking = (before**2 - after**2) / (2 * 3.0)  # at 3 m/s2, more than either autopilot takes
            assert length[slower:slow].sum() >= braking


def test_a_fast_enough_camera_changes_nothing() -> None:
    track = track_of([(100, 12.5), (50, 0.0)])
    assert with_speeds(track, np.zeros(2), params(speed_m_s=2.0)) is track
    hover = PlanParams(50, "survey", 20.0, photos=Photos(CAMERA, trigger="hover"), speed_m_s=15)
    assert with_speeds(track, np.zeros(2), hover) is track


def lines_and_ways(mission: Mission) -> tuple[list[float], list[float]]:
    speed, trigger, lines, ways = 0.0, 0.0, [], []
    for item in mission.items:
        if item.command == CHANGE_SPEED:
            speed = float(item.params[1] or 0)
        elif item.command == CAMERA_DISTANCE:
            trigger = float(item.params[0] or 0)
        elif item.command == WAYPOINT:
            (lines if trigger else ways).append(speed)
            if trigger:
                assert speed <= PHOTOS.max_speed_m_s(50, trigger) * 1.001
    return lines, ways


@pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])
def test_ways_are_fast_and_lines_slow(autopilot: str) -> None:
    regions = [box(100, 100, 120, 90), box(600, 100, 20, 20), box(1000, 500, 150, 90)]
    more = {"pattern": "survey", "spacing_m": 20.0, "photos": PHOTOS, "autopilot": autopilot}
    mission = planned(regions, altitude_m=50, speed_m_s=12.0, **more)
    lines, ways = lines_and_ways(mission)
    assert max(lines) < 6 and max(ways) == 12
    assert mission.speed_range_m_s == (min(lines), 12)
    [note] = [note for note in mission.notes if "is lowered from 12 m/s" in note]
    assert "needs 2.5 s between photographs" in note and "at 12 m/s" in note
    slow = planned(regions, altitude_m=50, speed_m_s=min(lines), **more)
    assert mission.duration_s < 0.8 * slow.duration_s


@pytest.mark.slow
def test_one_short_line_does_not_slow_down_the_others() -> None:
    regions = [box(100, 100, 200, 90), box(600, 100, 40, 9)]
    survey = {"pattern": "survey", "spacing_m": 20.0, "photos": PHOTOS, "angle_deg": None}
    mission = planned(regions, altitude_m=50, speed_m_s=5.0, **survey)
    lines, _ = lines_and_ways(mission)
    assert min(lines) < 0.9 * max(lines)
