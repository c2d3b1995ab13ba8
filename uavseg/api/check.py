"""Check of mission files."""

from __future__ import annotations

import os

from uavseg.api._values import warn
from uavseg.arguments import checked
from uavseg.flight.mission import Mission
from uavseg.jobs.check import CheckRequest, MissionCheck
from uavseg.jobs.check import check as run_check


@checked
def check(mission: str | os.PathLike[str] | Mission, *, autopilot: str | None = None) -> MissionCheck:
    """Read a mission file back, and say what it holds and who would refuse it.

    Parameters
    ----------
    mission : path or Mission
        A .plan, .waypoints, .kml, .geojson, .kmz or .csv file, or what `plan` gives.
    autopilot : {"ardupilot", "px4", "generic"}, optional
        What it is checked for; by default what the file is for, if its format says so.

    Returns
    -------
    found : MissionCheck
        Its `problems` are why the mission must not be flown, its `verdicts` who takes it; `as_dict()` is what
        `uavseg check --json` prints. Its `warnings` are warnings too.

    Raises
    ------
    MissionError
        If the file cannot be read, or holds a mission that would not be safe: which item, and why.

    Examples
    --------
    >>> import uavseg
    >>> uavseg.check("fly.plan", autopilot="px4").problems  # doctest: +SKIP
    ()
    """
    found = run_check(mission, CheckRequest(autopilot))
    warn(found.warnings)
    return found
