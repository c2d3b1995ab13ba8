"""Requests to a local server, as a page sends them."""

import json
import time
import urllib.error
import urllib.request
from typing import Any


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
