"""`uavseg plan` and `uavseg resume`: a mission over regions, and the rest of one; the report of missions."""

import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from uavseg.cli.command import job_command
from uavseg.cli.terminal.say import Reporter, say, show, showing_phases
from uavseg.cli.write import check_output, write_plan_output
from uavseg.options.flights import PlanOptions
from uavseg.options.missions import ResumeOptions

if TYPE_CHECKING:
    from uavseg.flight.mission.estimate import Estimate
    from uavseg.flight.mission.mission import Mission

Paths = Sequence[str | Path]


@job_command("plan", PlanOptions)
def command(options: PlanOptions, reporter: Reporter) -> None:
    """Plan a flight over REGIONS, a file of polygons (- is GeoJSON from standard input).

    Take off at home, fly to or over the chosen regions in a short order, return. The file is for
    QGroundControl (.plan), Mission Planner (.waypoints), DJI Pilot 2 (.kmz), Litchi (.csv), or to look at
    (.kml, .geojson). Length, time with turns, photographs and energy are estimates, without wind
    unless --wind gives one.
    """
    from uavseg.flight.formats import files
    from uavseg.jobs.flights.plan import plan
    from uavseg.jobs.flights.request import open_regions, plan_request, widths_of, zone_polygons

    output, overwrite, avoid = options.output, options.files.overwrite, options.mission.safety.avoid
    if options.footprints and not options.as_json:
        raise click.UsageError("--footprints are a part of --json; give both")
    files.file_options(output, **asdict(options.mission.files))
    names = [zone for zone in avoid if isinstance(zone, str)]
    check_output(output, overwrite, options.regions, options.raster, names, options.mission.terrain.dem)
    request = plan_request(options)
    regions = click.open_file("-", "rb").read() if options.regions == "-" else options.regions
    with showing_phases(reporter.quiet):
        found = open_regions(regions, options.layer, widths_of(request.flight))
        raster = None
        if options.raster is not None:
            from uavseg.jobs.source.open_source import open_source

            raster = open_source(options.raster)
        zones, notes = zone_polygons(options.mission.safety, raster)
        planned = plan(found, request, zones, raster, notes)
    paths, unwritten = write_plan_output(planned, output, overwrite, options.mission.files)
    notes = [*planned.warnings, *unwritten]
    if options.as_json:
        written = missions_json(
            planned.missions, planned.regions, paths, notes, with_footprints=options.footprints
        )
        show(json.dumps(written, allow_nan=False))
    if not reporter.quiet:
        report(planned.missions, planned.regions, paths, notes)


@job_command("resume", ResumeOptions)
def resume(options: ResumeOptions, reporter: Reporter) -> None:
    """Plan the rest of MISSION (any file that uavseg check reads), whose flight was cut.

    Take off as before, fly to the last photograph, take it again, and go on with what is left; camera,
    gimbal and speed are set as they were. Fence and rally points stay.
    """
    from uavseg.flight.formats import files
    from uavseg.jobs.flights.plan import resume

    quiet, output, overwrite = reporter.quiet, options.output, options.files.overwrite
    files.file_options(output, **asdict(options.mission_files))
    check_output(output, overwrite, options.file, options.start if isinstance(options.start, str) else None)
    with showing_phases(quiet):
        planned = resume(options.file, options.start)
    paths, unwritten = write_plan_output(planned, output, overwrite, options.mission_files)
    if not quiet:
        report(planned.missions, 0, paths, [*planned.warnings, *unwritten])


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
