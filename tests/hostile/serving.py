"""A visit to a local server: it is asked for what a page asks for, and then it ends."""

import json
import re
from typing import TYPE_CHECKING

from tests.server.asking import fetch, run_job

if TYPE_CHECKING:
    from uavseg.api.pages import MapServer

ANSWERS = {200, 204, 404}


def visit(server: "MapServer") -> None:
    """Ask for the page, tiles of what it shows and the regions of a range; fails where an answer is no answer.

    Parameters
    ----------
    server : MapServer
        In place of whose `wait` this is.
    """
    status, page = fetch(server.url)
    assert status == 200, f"the page: {status}"
    [data] = re.findall(rb'<script type="application/json" id="data">(.*?)</script>', page, re.DOTALL)
    west, _, _, north = json.loads(data)["image"]["bounds"]
    for zoom in (0, 18):
        x = min(int((west + 180) / 360 * 2**zoom), 2**zoom - 1)
        for kind in ("tiles", "codes"):
            status, content = fetch(f"{server.url}{kind}/{zoom}/{x}/{_row(north, zoom)}")
            assert status in ANSWERS or _is_said(status, content), f"{kind}: {status} {content!r}"
    report = run_job(server.url, "extract", {"low": 0.4, "high": 1})
    assert report["state"] in ("done", "failed"), report
    assert report["state"] == "done" or "its log says how" not in report["error"], report


def _row(lat: float, zoom: int) -> int:
    from math import asinh, pi, radians, tan

    return min(max(int((1 - asinh(tan(radians(lat))) / pi) / 2 * 2**zoom), 0), 2**zoom - 1)


def _is_said(status: int, content: bytes) -> bool:
    """Whether an answer says that the raster cannot be read."""
    return status == 400 and bool(json.loads(content)["error"])
