"""Missions over the fields of the benchmarks, and what planning them takes."""

import math
import time
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from benchmarks.flight.fields import Field, many
from benchmarks.flight.log import Log
from benchmarks.flight.measured import covered, fly, in_metres, least_distance_m
from uavseg.flight.mission.items import WAYPOINT
from uavseg.flight.mission.mission import Mission
from uavseg.flight.planning.planner import plan_missions
from uavseg.jobs.flights.request import flight_params
from uavseg.options.flights import MissionOptions
from uavseg.options.option import build


@dataclass(frozen=True, slots=True)
class Plan:
    """What a plan takes and gives.

    Parameters
    ----------
    field, pattern : str
    flights, items, turns : int
        Turns are the waypoints.
    length_m : float
        Over ground.
    cpu_s, seconds : float
        To plan, the second time: of the processor, and of the clock.
    covered, zone_m : float
        From the simulated flights: share that photographs show, least distance to a keep-out zone.
    """

    field: str
    pattern: str
    flights: int
    items: int
    turns: int
    length_m: float
    cpu_s: float
    seconds: float
    covered: float
    zone_m: float

    @property
    def distance(self) -> str:
        """Least distance to a zone, in words."""
        return "" if math.isinf(self.zone_m) else f"{self.zone_m:.1f}"


def planned(
    field: Field,
    *,
    pattern: str,
    camera: str | None,
    height_m: float,
    speed: float,
    autopilot: str = "ardupilot",
    trigger: str | None = None,
    **options: Any,
) -> Sequence[Mission]:
    """The missions over a field; more options are those of `uavseg.plan`."""
    given = {
        "altitude": height_m,
        "pattern": pattern,
        "camera": camera,
        "trigger": trigger,
        "speed": speed,
        "autopilot": autopilot,
        "tolerance": 3.0,
    }
    params = flight_params(build(MissionOptions, given | options))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return plan_missions(field.polygons, field.points, params, field.home, field.zones)


def measured_plan(field: Field, pattern: str, camera: str | None) -> Plan:
    """Plan twice, the second time with compiled kernels, and fly it."""
    for _ in range(2):
        start, cpu_start = time.perf_counter(), time.process_time()
        missions = planned(field, pattern=pattern, camera=camera, height_m=40.0, speed=8.0)
        seconds, cpu_s = time.perf_counter() - start, time.process_time() - cpu_start
    logs = [fly(mission) for mission in missions]
    photographs = [photograph for log in logs for photograph in log.photographs]
    shown = covered(Log(photographs=photographs), in_metres(field.polygons, field), missions[0].photos)
    zones = in_metres(field.zones, field)
    return Plan(
        field.name,
        pattern,
        len(missions),
        sum(len(mission.items) for mission in missions),
        sum(item.command == WAYPOINT for mission in missions for item in mission.items),
        sum(mission.distance_m for mission in missions),
        cpu_s,
        seconds,
        shown if camera else float("nan"),
        min(least_distance_m(log, zones) for log in logs) if field.zones else float("inf"),
    )


def plans(counts: Sequence[tuple[int, int]] = ((50, 0), (200, 0), (200, 40))) -> list[Plan]:
    """Many regions, with and without keep-out zones."""
    return [
        measured_plan(many(regions, zones), pattern, camera)
        for regions, zones in counts
        for pattern, camera in (("visit", None), ("survey", "DJI Mavic 3 Enterprise"))
    ]
