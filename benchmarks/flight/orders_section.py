"""Tables of the section orders."""

import math
from collections.abc import Sequence

from benchmarks.flight.order import Tour
from benchmarks.flight.plans import Plan
from benchmarks.table import rows, with_provenance


def orders_table(tours: Sequence[Tour], plans: Sequence[Plan]) -> str:
    """Lengths of tours relative to the best that was found, and complete plans."""
    best = {
        name: min(tour.length_m for tour in tours if tour.places == name)
        for name in {t.places for t in tours}
    }
    cells = [
        [
            t.places,
            t.method,
            f"{t.length_m:,.0f}",
            f"{t.length_m / best[t.places] - 1:+.2%}",
            f"{t.cpu_s:.2f}",
        ]
        for t in tours
    ]
    first = rows(["home and", "order by", "metres", "longer than the best", "CPU, s"], cells)
    classes = [
        [
            *(p.field, p.pattern, str(p.flights), f"{p.items:,}", f"{p.length_m / 1000:.1f}", f"{p.turns:,}"),
            *(
                "" if math.isnan(p.covered) else f"{p.covered:.2%}",
                p.distance,
                f"{p.cpu_s:.1f}",
                f"{p.seconds:.1f}",
            ),
        ]
        for p in plans
    ]
    heads = [
        "regions",
        "pattern",
        "flights",
        "items",
        "km",
        "turns",
        "covered",
        "m to zones",
        "CPU to plan, s",
        "clock, s",
    ]
    return with_provenance(f"{first}\n\n{rows(heads, classes)}")
