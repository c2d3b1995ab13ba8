"""Report of missions: a table on stderr, or JSON."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from uavseg.cli.terminal.say import say

if TYPE_CHECKING:
    from uavseg.flight.mission.estimate import Estimate
    from uavseg.flight.mission.mission import Mission


Paths = Sequence[str | Path]


def report(missions: "Sequence[Mission]", regions: int, paths: Paths, notes: Sequence[str]) -> None:
    """Print estimates of missions on stderr, and notes on them."""
    from uavseg.flight.mission.estimate import estimate_text

    flights = [(Path(path).stem, mission.estimate) for mission, path in zip(missions, paths, strict=True)]
    for mission, path, (_, found) in zip(missions, paths, flights, strict=True):
        over = f"{regions} region{'s' * (regions != 1)}, " if regions and len(paths) == 1 else ""
        estimate = estimate_text(found.distance_m, found.duration_s)
        say(f"{path}: {over}{len(mission.items)} items, {estimate}")
    for line in flight_table(flights):
        say(line)
    if missions[0].autopilot != "ardupilot" and str(paths[0]).lower().endswith(".waypoints"):
        say("note: PX4 will face north at each item of a .waypoints file; a .plan leaves it free")
    for note in notes:
        say(f"note: {note}")


def flight_table(flights: "Sequence[tuple[str, Estimate]]") -> list[str]:
    """Return lines of a table: what each flight takes and gives; without the columns that no flight has."""
    rows = [_cells(name, found) for name, found in flights]
    kept = [head for head in rows[0] if any(row[head] for row in rows)]
    widths = {head: max(len(head), *(len(row[head]) for row in rows)) for head in kept}
    sides = {head: "<" if head == kept[0] else ">" for head in kept}
    lines = [{head: head for head in kept}, *rows]
    return ["  ".join(f"{row[head]:{sides[head]}{widths[head]}}" for head in kept).rstrip() for row in lines]


def _cells(name: str, found: "Estimate") -> dict[str, str]:
    return {
        "flight": name,
        "km": f"{found.distance_m / 1000:.2f}",
        "time": _clock(found.duration_s),
        "climb": _clock(found.climb_s),
        "legs": _clock(found.flight_s),
        "hold": _clock(found.hold_s) if found.hold_s else "",
        "return": _clock(found.return_s) if found.return_s else "",
        "landing": _clock(found.landing_s) if found.landing_s else "",
        "photographs": str(found.photographs) if found.photographs else "",
        "cm/pixel": "" if found.gsd_m is None else f"{100 * found.gsd_m:.2f}",
        "hectares": "" if found.photographed_m2 is None else f"{found.photographed_m2 / 1e4:.2f}",
        "Wh": "" if found.energy_wh is None else f"{found.energy_wh:.0f}",
        "battery": "" if found.battery is None else f"{100 * found.battery:.0f}%",
    }


def _clock(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes}:{rest:02d}"


def missions_json(
    missions: "Sequence[Mission]", regions: int, paths: Paths, warnings: Sequence[str], with_footprints: bool
) -> dict[str, Any]:
    """Return what programs read of missions: files, estimates and warnings, perhaps footprints."""
    shown = _footprints if with_footprints else lambda mission: {}
    return {
        "regions": regions,
        "autopilot": missions[0].autopilot,
        "flights": [
            {"file": str(path), "items": len(mission.items), **mission.estimate.as_dict(), **shown(mission)}
            for mission, path in zip(missions, paths, strict=True)
        ],
        "warnings": list(warnings),
    }


def _footprints(mission: "Mission") -> dict[str, Any]:
    """Return the corners (lon, lat) of what each photograph shows, in degrees to a millimetre; or why not."""
    from uavseg.flight.mission.estimate import footprints

    found = footprints(mission)
    return {"footprints": found.lonlat.round(8).tolist(), "footprints_note": found.note}
