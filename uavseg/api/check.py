"""Check of mission files."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Any

from uavseg.access import Folders, allowing
from uavseg.api._values import listed_zones, warn
from uavseg.arguments import checked
from uavseg.flight.mission.mission import Mission
from uavseg.jobs.flights.check import MissionCheck, check_request
from uavseg.jobs.flights.check import check as run_check
from uavseg.options.flights import CheckOptions
from uavseg.options.option import build


@checked
def check(
    mission: str | os.PathLike[str] | Mission,
    *,
    autopilot: str | None = None,
    avoid: Any = (),
    avoid_margin: float = 10.0,
    max_altitude: float | None = None,
    max_distance: float | None = None,
    dem: str | os.PathLike[str] | Sequence[str | os.PathLike[str]] | None = None,
    allow_path: Folders = (),
    allow_network: bool = False,
) -> MissionCheck:
    """Read a mission file back, and say what it holds, who would refuse it and whether it is safe.

    Parameters
    ----------
    mission : path or Mission
        A .plan, .waypoints, .kml, .geojson, .kmz or .csv file, or what `plan` gives.
    autopilot : {"ardupilot", "px4", "generic"}, optional
        What it is checked for; by default what the file is for, if its format says so.
    avoid : path, GeoDataFrame, or a sequence of these
        Keep-out zones, which no leg and no rally point may come near to.
    avoid_margin : float
        Least distance to them in metres.
    max_altitude, max_distance : float, optional
        Metres that the mission must not exceed, above home or with `dem` above the ground, and from home.
    dem : path or sequence of paths, optional
        Elevation model: no leg comes nearer to the ground than 5 m. Several files are one mosaic.
    allow_path, allow_network
        As of `extract`.

    Returns
    -------
    found : MissionCheck
        Its `problems` are why the mission must not be flown, its `verdicts` who takes it; `as_dict()` is what
        `uavseg check --json` prints. Its `warnings` are warnings too.

    Raises
    ------
    MissionError
        If the file cannot be read, or holds a mission that would not be safe: which item, and why.
    UavsegError
        If zones or an elevation model cannot be read, or a parameter is wrong.

    Examples
    --------
    >>> import uavseg
    >>> uavseg.check("fly.plan", autopilot="px4").problems  # doctest: +SKIP
    ()
    """
    options = build(CheckOptions, locals() | {"avoid": listed_zones(avoid)})
    with allowing(allow_path, allow_network):
        found = run_check(mission, check_request(options))
    warn(found.warnings)
    return found
