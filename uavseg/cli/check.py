"""`uavseg check`: what a mission file holds, and who would refuse it."""

from __future__ import annotations

from typing import Any

from uavseg.cli.command import job_command
from uavseg.cli.terminal.say import Reporter, say, show
from uavseg.errors import MissionError
from uavseg.options.flights import CheckOptions


@job_command("check", CheckOptions)
def command(options: CheckOptions) -> None:
    """Read the mission in FILE (.plan, .waypoints, .kml, .geojson, .kmz or .csv) back, and tell what it
    holds, how long it takes, and which autopilots, programs and aircraft would refuse it.

    Exit code 1: FILE cannot be read, its mission would not be safe, leaves its fence, comes near to a zone of
    --avoid, exceeds a limit, or the autopilot refuses it.
    """
    from uavseg.jobs.flights.check import check, check_request

    quiet = Reporter(options.messages).quiet
    found = check(options.file, check_request(options))
    if options.as_json:
        import json

        show(json.dumps(found.as_dict(), indent=2, allow_nan=False))
    elif not quiet:
        rows = _rows(found.as_dict())
        for one in found.verdicts:
            rows[one.who] = "accepts it" if one.accepts else f"refuses it: {one.reason}"
        width = max(map(len, rows))
        show("\n".join(f"{name:<{width}}  {value}" for name, value in rows.items()))
    for warning in () if quiet else found.warnings:
        say(f"note: {warning}")
    if found.problems:
        more = f" (and {len(found.problems) - 1} more)" if len(found.problems) > 1 else ""
        raise MissionError(f"{options.file}: {found.problems[0]}{more}")


def _rows(about: dict[str, Any]) -> dict[str, str]:
    from uavseg.flight.mission.estimate import duration_text

    fence, home = about["fence"], about["home"]
    slowest, fastest = f"{about['slowest_m_s']:.4g}", f"{about['fastest_m_s']:.4g}"
    speed = fastest if slowest == fastest else f"{slowest} to {fastest}"
    autopilot = "any autopilot" if about["autopilot"] == "generic" else about["autopilot"]
    return {
        "items": f"{about['items']:,} ({about['waypoints']:,} waypoints), for {autopilot}",
        "home": f"{home['lat']:.7f},{home['lon']:.7f}, {home['altitude_m']:g} m above the sea",
        "heights": f"{about['lowest_m']:g} to {about['highest_m']:g} m above home",
        "distance": f"{about['distance_m'] / 1000:.2f} km at {speed} m/s",
        "time": duration_text(about["duration_s"]),
        "photographs": f"{about['photographs']:,}",
        "fence": f"{fence['inclusions']} to stay inside, {fence['exclusions']} to keep out of",
        "rally points": f"{about['rally_points']}",
    }
