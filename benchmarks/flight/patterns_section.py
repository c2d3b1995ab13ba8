"""Tables of the section patterns."""

import math
from collections.abc import Sequence

from benchmarks.flight.cases import CaseFlown
from benchmarks.flight.lengths import Length
from benchmarks.table import rows, with_provenance

_NAMES = {"ardupilot": "ArduCopter", "px4": "PX4"}


def patterns_table(found: Sequence[CaseFlown], lengths: Sequence[Length]) -> str:
    """Every pattern with its triggers, zones and ground, flown; and lengths against a lower bound."""
    heads = ["field", "pattern", "trigger", "ground", "items", "autopilot", "min", "estimate", "photographs"]
    heads += ["estimated", "covered", "m to zones", "m above ground"]
    cells = [_cells(row, autopilot) for row in found for autopilot in row.calm]
    flown = [(row, autopilot) for row in found for autopilot in row.calm]
    worst = max(flown, key=lambda pair: abs(pair[0].calm[pair[1]].error))
    case, off = worst[0].case, abs(worst[0].calm[worst[1]].error)
    summary = (
        f"The worst estimate of time is off by {off:.1%}: {case.name} by {case.trigger or 'no trigger'} over "
        f"{case.field.name}, {_NAMES[worst[1]]}. Coverage, distances and heights are the least (and "
        "greatest) with and without wind."
    )
    ratios = [
        [
            one.field,
            f"{one.area_m:,.0f}",
            f"{one.tour_m:,.0f}",
            f"{one.lines_m:,.0f}",
            f"{one.legs_m:,.0f}",
            f"{one.over_bound:.2f}",
            f"{one.corridor_over_bound:.2f}",
        ]
        for one in lengths
    ]
    second = rows(
        ["field", "area / spacing, m", "tour, m", "lines, m", "legs, m", "over the bound", "corridor"], ratios
    )
    return with_provenance(f"{rows(heads, cells)}\n\n{summary}\n\n{second}")


def _cells(row: CaseFlown, autopilot: str) -> list[str]:
    calm, both = row.calm[autopilot], (row.calm[autopilot], row.windy[autopilot])
    case = row.case
    covering = case.pattern in ("survey", "corridor")
    zone = min(one.zone_m for one in both)
    low, high = min(one.lowest_m for one in both), max(one.highest_m for one in both)
    return [
        case.field.name,
        case.name,
        case.trigger or "",
        case.terrain or "",
        str(row.items),
        _NAMES[autopilot],
        f"{calm.simulated_s / 60:.1f}",
        f"{calm.error:+.1%}",
        str(calm.photographs or ""),
        str(calm.estimated_photographs or ""),
        f"{min(one.covered for one in both):.2%}" if covering else "",
        "" if math.isinf(zone) else f"{zone:.1f}",
        f"{low:.1f} to {high:.1f}" if case.terrain else "",
    ]
