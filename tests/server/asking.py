"""Requests to a local server, as a page sends them."""

import json
import time
import urllib.error
import urllib.request
import warnings
from pathlib import Path
from typing import Any

import uavseg
from tests.photographs.flown import fly

SAMPLE = Path(uavseg.__file__).parents[1] / "samples" / "quarry.tif"


def fetch(url: str, body: Any = None, headers: dict[str, str] | None = None) -> tuple[int, bytes]:
    """Status and content of an answer; with a body, a POST of JSON."""
    content = None if body is None else json.dumps(body).encode()
    own = {} if body is None else {"Content-Type": "application/json"}
    request = urllib.request.Request(url, content, own | (headers or {}))
    try:
        with urllib.request.urlopen(request, timeout=30) as response:
            return response.status, response.read()
    except urllib.error.HTTPError as error:
        return error.code, error.read()


def run_job(url: str, kind: str, body: Any) -> dict[str, Any]:
    """The report of a job at its end."""
    status, content = fetch(f"{url}jobs/{kind}", body)
    report: dict[str, Any] = json.loads(content)
    assert status == 202, report
    while report["state"] == "running":
        time.sleep(0.05)
        report = json.loads(fetch(f"{url}jobs/{report['job']}")[1])
    return report


def surveyed(folder: Path) -> tuple[Path, Path]:
    """A survey over a region of the sample, and a folder with its photographs but for some in the middle."""
    mission, photographs = folder / "survey.plan", folder / "photographs"
    with warnings.catch_warnings(action="ignore"):
        region = uavseg.extract(SAMPLE, (0.55, 1), min_area=500).head(1)
        planned = uavseg.plan(region, altitude=60, home="auto", angle=0, camera="DJI Mavic 3 Enterprise")
    planned.write(mission)
    count = planned.missions[0].estimate.photographs
    fly(mission, photographs, tuple(range(count // 3, 2 * count // 3)))
    return mission, photographs
