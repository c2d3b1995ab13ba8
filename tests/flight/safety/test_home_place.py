"""A place for home beside many regions: they are united group by group, and a long search can be followed."""

import os
import signal
import subprocess
import sys
import time
from typing import Any

import numpy as np
import pytest
import shapely

from tests.flight.pixel_regions import pixel_region
from tests.flight.small_regions import HOME, box, degrees, inside
from uavseg.errors import MissionError
from uavseg.execution.executors import watched
from uavseg.flight.avoid import enclosing
from uavseg.flight.mission.track import Plane
from uavseg.flight.params.plan import PlanParams
from uavseg.flight.planning.planner import plan_missions
from uavseg.flight.safety.keep_out import CLEARANCE_M, home_outside

PLANE = Plane(47.0, 8.0)


def metres(place: tuple[float, float]) -> Any:
    return np.column_stack(PLANE.xy_from_lonlat(place[1], place[0]))[0]


def ring_of_boxes(radius_m: float, count: int) -> list[Any]:
    """Boxes of 8 m on a circle, nearer to each other than twice the clearance."""
    around = np.linspace(0, 2 * np.pi, count, endpoint=False)
    xy = np.round(radius_m * np.column_stack([np.cos(around), np.sin(around)]))
    return [box(x - 4, y - 4, 8, 8) for x, y in xy.tolist()]


@pytest.mark.slow
@pytest.mark.parametrize("corners", [100, pytest.param(1000, marks=pytest.mark.thorough), 20_000])
def test_groups_of_any_size_give_a_place_at_the_usual_distance(
    corners: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(enclosing, "GROUP_CORNERS", corners)
    regions = [degrees(polygon) for polygon in pixel_region(300, 5)]
    home = metres(home_outside(regions, inside(regions)))
    distance = shapely.distance(shapely.union_all(PLANE.project_polygons(regions)), shapely.Point(home))
    assert 0.95 * CLEARANCE_M <= distance <= 1.2 * CLEARANCE_M


@pytest.mark.parametrize("corners", [30, 20_000])
def test_a_ring_of_many_regions_encloses_what_lies_in_it(
    corners: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(enclosing, "GROUP_CORNERS", corners)
    regions = ring_of_boxes(100, 24)
    home = metres(home_outside(regions, inside(regions)))
    assert np.hypot(*home) > 100
    open_ring = regions[:-3]
    assert np.hypot(*metres(home_outside(open_ring, inside(open_ring)))) < 100


def test_few_regions_are_united_as_before() -> None:
    """The place is a corner of what the clearance around the union of all regions and zones is."""
    regions, zone = [box(0, 0, 50, 40), box(45, 20, 60, 40), box(150, 0, 20, 20)], box(0, -80, 100, 30)
    home = metres(home_outside(regions, inside(regions), [zone], 10.0))
    flat = shapely.union_all(PLANE.project_polygons(regions))
    edge = shapely.buffer(flat, CLEARANCE_M, quad_segs=4).boundary
    assert shapely.distance(edge, shapely.Point(home)) < 0.02


@pytest.mark.slow
def test_no_call_unites_many_regions(monkeypatch: pytest.MonkeyPatch) -> None:
    regions = [box(12.0 * (k % 100), 12.0 * (k // 100), 4, 4) for k in range(8000)]
    monkeypatch.setattr(enclosing, "GROUP_CORNERS", 2000)
    united, union_all = [], shapely.union_all

    def counted(areas: Any, *words: Any) -> Any:
        united.append(int(shapely.get_num_coordinates(areas).sum()))
        return union_all(areas, *words)

    monkeypatch.setattr(shapely, "union_all", counted)
    shown: list[tuple[str | None, int, int]] = []
    with watched(lambda *state: shown.append(state)):
        home_outside(regions, [(8.001, 47.001)])
    assert max(united) < 5 * 2000 < 8000 * 5  # corners; the clearance makes 20 of 5
    assert all(phase == "" and done <= total for phase, done, total in shown) and len(shown) > 20


def test_too_many_regions_are_refused_before_any_work(monkeypatch: pytest.MonkeyPatch) -> None:
    def projected(*_: Any) -> None:
        raise AssertionError("polygons are projected before they are counted")

    monkeypatch.setattr(Plane, "project_polygons", projected)
    regions = [box(12.0 * (k % 70), 12.0 * (k // 70), 4, 4) for k in range(4001)]
    with pytest.raises(MissionError, match="4,001 regions, and at most 4,000 are ordered"):
        plan_missions(regions, [(8.0, 47.0)] * 4001, PlanParams(60), HOME)


SEARCH = """
from tests.flight.small_regions import box
from uavseg.flight.safety.keep_out import home_outside

regions = [box(12.0 * (k % 400), 12.0 * (k // 400), 4, 4) for k in range(160_000)]
print("begun", flush=True)
home_outside(regions, [(8.001, 47.001)])
print("ended", flush=True)
"""


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="Windows sends no SIGINT to another process")
def test_the_search_ends_soon_after_an_interrupt() -> None:
    process = subprocess.Popen(
        [sys.executable, "-c", SEARCH], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    with process:
        assert process.stdout is not None
        assert process.stdout.readline() == "begun\n"
        time.sleep(1)
        process.send_signal(signal.SIGINT)
        try:
            rest, errors = process.communicate(timeout=60)
        finally:
            process.kill()
    assert rest == ""
    assert "KeyboardInterrupt" in errors
