"""Every pattern with every trigger, keep-out zones and terrain: missions that are planned and flown."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
import shapely

from benchmarks.flight.fields import Field, degrees, drawn, of_sample
from benchmarks.flight.hills import elevation_model, rise_m
from benchmarks.flight.lengths import Length, lengths
from benchmarks.flight.measured import Flown, simulate
from benchmarks.flight.plans import planned
from uavseg.jobs.flights.request import photos_of
from uavseg.options.flights import PatternOptions, PhotoOptions

HEIGHT_M, SPEED, CAMERA = 50.0, 5.0, "DJI Mavic 3 Enterprise"
WIND = (5.0, 3.0, 0.0)
TRIGGERS = ("distance", "interval", "hover")
NOTHING = PatternOptions()


@dataclass(frozen=True, slots=True)
class Case:
    """What is flown.

    Parameters
    ----------
    field : Field
    pattern : str
    trigger : str, optional
        None without a camera.
    words : PatternOptions
    terrain : str, optional
        How the ground is followed.
    """

    field: Field
    pattern: str
    trigger: str | None = None
    words: PatternOptions = NOTHING
    terrain: str | None = None

    @property
    def name(self) -> str:
        """The pattern and what is said about it."""
        said = [
            f"{what} {value:g} m"
            for what, value in (
                ("offset", self.words.offset),
                ("margin", self.words.margin),
                ("turnaround", self.words.turnaround),
            )
            if value is not None
        ]
        said += ["crosshatch"] * self.words.crosshatch + ["holes"] * (self.words.holes == "fly")
        return ", ".join([self.pattern, *said])


@dataclass(frozen=True, slots=True)
class CaseFlown:
    """A case with its flights, by autopilot, without and with wind."""

    case: Case
    items: int
    calm: dict[str, Flown]
    windy: dict[str, Flown]


def cases() -> list[Case]:
    """All cases."""
    field = {one.name: one for one in drawn()}
    road = shapely.LineString([(60, 60), (260, 90), (320, 260), (560, 280)]).buffer(25)
    field["road"] = Field("road", (degrees(road),))
    quarry = of_sample("quarry.tif", 0.55, 200)
    some = [
        *(Case(field["ring"], "survey", trigger) for trigger in TRIGGERS),
        *(Case(quarry, "survey", trigger) for trigger in TRIGGERS),
        Case(field["letter E"], "survey", "distance", PatternOptions(margin=12.0)),
        Case(field["letter E"], "survey", "distance", PatternOptions(crosshatch=True)),
        Case(field["letter E"], "survey", "distance", PatternOptions(turnaround=30.0)),
        *(Case(field["road"], "corridor", trigger) for trigger in TRIGGERS),
        Case(field["spiral"], "corridor", "distance"),
        *(Case(field["ring"], "perimeter", trigger, PatternOptions(offset=10.0)) for trigger in TRIGGERS),
        Case(field["ring"], "perimeter", None, PatternOptions(offset=-5.0, holes="fly")),
        *(Case(field["12 ponds"], "orbit", trigger) for trigger in TRIGGERS),
        Case(field["12 ponds"], "visit", "hover", PatternOptions(hold=5.0)),
    ]
    zones = (
        shapely.box(160, 100, 200, 140),
        shapely.Point(40, 40).buffer(12),
        shapely.box(290, 180, 330, 260),
    )
    apart = replace(field["rectangle"], name="rectangle, 3 zones", zones=tuple(map(degrees, zones)))
    some += [Case(apart, "survey", trigger) for trigger in TRIGGERS]
    some += [Case(apart, "perimeter", "distance"), Case(apart, "corridor", "distance")]
    some += [Case(replace(field["12 ponds"], name="12 ponds, 5 zones", zones=_between()), "visit", "hover")]
    for mode in ("absolute", "relative", "frame"):
        some.append(Case(field["rectangle"], "survey", "distance", terrain=mode))
        some.append(Case(field["ring"], "survey", "interval", terrain=mode))
        some.append(Case(field["road"], "corridor", "hover", terrain=mode))
        some.append(Case(field["ring"], "perimeter", "distance", terrain=mode))
    return some


def _between() -> tuple[Any, ...]:
    """Zones among the ponds, at least 25 m from each, and from home."""
    ponds = shapely.union_all([*drawn()[-1].polygons])
    draw = np.random.default_rng(4)
    found: list[Any] = []
    while len(found) < 5:
        zone = degrees(shapely.Point(draw.uniform(100, 800, 2)).buffer(20))
        wide = shapely.buffer(zone, 4e-4)  # degrees: at least 30 m
        if not shapely.intersects(wide, shapely.union_all([ponds, *found])):
            found.append(zone)
    return tuple(found)


def fly_cases(some: Sequence[Case], report: Callable[[str], None]) -> Iterator[CaseFlown]:
    """Plan and simulate each case for both autopilots; those with heights above the terrain for ArduPilot."""
    with ExitStack() as stack:
        dem = stack.enter_context(elevation_model()) if any(case.terrain for case in some) else None
        for case in some:
            calm, windy, items = {}, {}, 0
            rise = rise_m if case.terrain else None
            ground = {"dem": dem, "terrain": case.terrain} if case.terrain else {}
            home = case.field.home[:2] if case.terrain else case.field.home
            for autopilot in ("ardupilot",) if case.terrain == "frame" else ("ardupilot", "px4"):
                missions = planned(
                    replace(case.field, home=home),
                    pattern=case.pattern,
                    camera=CAMERA if case.trigger else None,
                    trigger=case.trigger,
                    height_m=HEIGHT_M,
                    speed=SPEED,
                    autopilot=autopilot,
                    **asdict(case.words),
                    **ground,
                )
                items = max(items, sum(len(mission.items) for mission in missions))
                calm[autopilot] = simulate(missions, case.field, rise=rise)
                windy[autopilot] = simulate(missions, case.field, WIND, rise)
            report(f"flights: {case.field.name}, {case.name}, {case.trigger}, {case.terrain}")
            yield CaseFlown(case, items, calm, windy)


def survey_lengths() -> list[Length]:
    """Lengths of surveys over the drawn fields and the samples, with the camera and height of the cases."""
    photos = photos_of(PhotoOptions(camera=CAMERA))
    assert photos is not None
    fields = [*drawn(), of_sample("quarry.tif", 0.55, 200), of_sample("shore.tif", 0.5, 500)]
    return lengths(fields, photos.spacing_m(HEIGHT_M), photos.line_reach_m(HEIGHT_M))
