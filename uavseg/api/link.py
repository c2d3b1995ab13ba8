"""Upload of missions to vehicles, and download."""

from __future__ import annotations

import os

from uavseg.api._values import progress_of, warn
from uavseg.arguments import checked
from uavseg.flight.mission.mission import Mission
from uavseg.jobs.flights.link import LinkRequest, Progress
from uavseg.jobs.flights.link import download as run_download
from uavseg.jobs.flights.link import upload as run_upload


@checked
def upload(
    mission: str | os.PathLike[str] | Mission,
    *,
    connect: str,
    timeout: float = 10.0,
    while_armed: bool = False,
    progress: Progress | bool | None = None,
) -> None:
    """Send a mission to a vehicle with its fence and rally points, read them back and compare.

    What a vehicle is sent are heartbeats of a ground station and the MAVLink mission protocol: nothing arms
    or starts it. A fence and rally points that the mission does not have are left as they are.

    Parameters
    ----------
    mission : path or Mission
        A .plan or .waypoints file, or what `plan` gives.
    connect : str
        Where the vehicle is: udpout:HOST:PORT, udpin:HOST:PORT, tcp:HOST:PORT or serial:DEVICE[:BAUD].
    timeout : float
        Seconds to wait for an answer, and without progress.
    while_armed : bool
        Whether the mission of a vehicle whose motors are armed may be replaced: it may be flying, and
        ArduPilot replaces the items one by one. Otherwise nothing is sent to it.
    progress : callable, optional
        Called with (done, total) for each item that is sent or read back.

    Raises
    ------
    MissionError
        If the file cannot be read, or the mission is for another autopilot.
    UnverifiedError
        If the vehicle accepted the mission, which could then not be read back.
    LinkError
        If the vehicle is armed, cannot be reached, refuses, falls silent, is not alone on the link, or holds
        something else afterwards.

    Examples
    --------
    >>> import uavseg
    >>> uavseg.upload("fly.plan", connect="udpout:192.168.4.1:14550")  # doctest: +SKIP
    """
    request = LinkRequest(connect, timeout)
    warn(run_upload(mission, request, progress_of(progress), while_armed).warnings)


@checked
def download(*, connect: str, timeout: float = 10.0, progress: Progress | bool | None = None) -> Mission:
    """The mission that a vehicle holds, with its fence and rally points.

    Parameters
    ----------
    connect : str
        Where the vehicle is: udpout:HOST:PORT, udpin:HOST:PORT, tcp:HOST:PORT or serial:DEVICE[:BAUD].
    timeout : float
        Seconds to wait for an answer, and without progress.
    progress : callable, optional
        Called with (done, total) for each item of a list.

    Returns
    -------
    mission : Mission
        Its `warnings` are warnings too.

    Raises
    ------
    MissionError
        If the vehicle holds no mission, or one that would not be safe.
    LinkError
        If the vehicle cannot be reached, refuses, falls silent, or is not alone on the link.
    """
    found = run_download(LinkRequest(connect, timeout), progress_of(progress))
    warn(found.warnings)
    return found.mission
