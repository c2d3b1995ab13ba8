"""Table of the section flights."""

import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from benchmarks.flight.fields import Field, drawn, of_sample
from benchmarks.flight.measured import Flown, simulate
from benchmarks.flight.plans import planned
from benchmarks.table import rows, with_provenance

HEIGHT_M, CAMERA, SPEEDS = 50.0, "DJI Mavic 3 Enterprise", (5.0, 10.0)
PATTERNS = ("survey", "perimeter", "visit")
WINDS = ((5.0, 3.0, 0.0), (0.0, 8.0, 0.0))  # 5.8 and 8 m/s


@dataclass(frozen=True, slots=True)
class Row:
    """A field flown in a pattern: its flights by autopilot and speed, without wind and in each of `WINDS`."""

    field: str
    pattern: str
    items: int
    calm: dict[tuple[str, float], Flown]
    windy: dict[tuple[str, float], list[Flown]]


def fields() -> list[Field]:
    """Drawn fields, and the regions of samples."""
    return [*drawn(), of_sample("quarry.tif", 0.55, 200), of_sample("shore.tif", 0.5, 500)]


def flown(some: Sequence[Field], report: Callable[[str], None]) -> Iterator[Row]:
    """Plan and simulate each field in each pattern."""
    for field, pattern in itertools.product(some, PATTERNS):
        calm, windy, items = {}, {}, 0
        for autopilot, speed in itertools.product(("ardupilot", "px4"), SPEEDS):
            missions = planned(
                field,
                pattern=pattern,
                camera=CAMERA if pattern == "survey" else None,
                height_m=HEIGHT_M,
                speed=speed,
                autopilot=autopilot,
            )
            items = max(items, sum(len(mission.items) for mission in missions))
            calm[autopilot, speed] = simulate(missions, field)
            windy[autopilot, speed] = [simulate(missions, field, wind) for wind in WINDS]
        report(f"flights: {field.name}, {pattern}")
        yield Row(field.name, pattern, items, calm, windy)


def flights_table(found: Sequence[Row]) -> str:
    """Estimates of time against simulated flights; photographs and coverage with and without wind."""
    heads = ["field", "pattern", "items"]
    for name in ("ArduCopter", "PX4"):
        heads += [f"{name}, min", *(f"estimate at {speed:g} m/s" for speed in SPEEDS)]
    heads += ["photographs", "estimated", "covered"]
    cells = []
    for row in found:
        line = [row.field, row.pattern, str(row.items)]
        for autopilot in ("ardupilot", "px4"):
            line.append(f"{row.calm[autopilot, SPEEDS[0]].simulated_s / 60:.1f}")
            line += [f"{row.calm[autopilot, speed].error:+.1%}" for speed in SPEEDS]
        one = row.calm["ardupilot", SPEEDS[0]]
        least = min(each.covered for each in (*row.calm.values(), *itertools.chain(*row.windy.values())))
        line += [str(one.photographs or ""), str(one.estimated_photographs or "")]
        line.append("" if math.isnan(least) else f"{least:.2%}")
        cells.append(line)
    off = [abs(one.error) for row in found for one in row.calm.values()]
    worst = [
        max(abs(each[k].error) for row in found for each in row.windy.values()) for k in range(len(WINDS))
    ]
    winds = " and ".join(
        f"by {one:.1%} at {math.hypot(*wind):.1f} m/s" for one, wind in zip(worst, WINDS, strict=True)
    )
    lost = [
        one.estimated_photographs - one.photographs
        for row in found
        for one in (*row.calm.values(), *itertools.chain(*row.windy.values()))
    ]
    summary = (
        f"The worst estimate is off by {max(off):.1%} (mean {sum(off) / len(off):.1%}) without wind, "
        f"and in a wind that is given {winds}. Photographs differ by at most "
        f"{max(map(abs, lost))} from the estimate. Coverage is the least of all flights of a row, with and "
        "without wind."
    )
    return with_provenance(f"{rows(heads, cells)}\n\n{summary}")
