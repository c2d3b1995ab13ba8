"""Requests that are refused: other hosts, origins and methods, without the token, with large bodies."""

import pytest
from hypothesis import given, strategies as st

from uavseg.server.local_server import MAX_BODY, Answer, Gate

GATE = Gate(8000, "secret-token")
OWN = {"host": ["127.0.0.1:8000"]}
TARGET = "/secret-token/jobs/1"


def test_the_page_itself_is_answered() -> None:
    assert GATE.path_of("GET", TARGET, OWN) == "jobs/1"
    own_post = {
        "host": ["localhost:8000"],
        "origin": ["http://localhost:8000"],
        "sec-fetch-site": ["same-origin"],
    }
    assert GATE.path_of("POST", "/secret-token/", own_post) == ""


@pytest.mark.parametrize(
    ("headers", "status"),
    [
        ({}, 421),
        ({"host": ["evil.example:8000"]}, 421),
        ({"host": ["127.0.0.1"]}, 421),
        ({"host": ["127.0.0.1:8000", "127.0.0.1:8000"]}, 421),
        ({**OWN, "origin": ["null"]}, 403),
        ({**OWN, "origin": ["https://127.0.0.1:8000"]}, 403),
        ({**OWN, "origin": ["http://127.0.0.1:8001"]}, 403),
        ({**OWN, "origin": ["http://127.0.0.1:8000", "http://evil.example"]}, 403),
        ({**OWN, "sec-fetch-site": ["cross-site"]}, 403),
        ({**OWN, "sec-fetch-site": ["same-site"]}, 403),
    ],
)
def test_other_hosts_and_sites_are_refused(headers: dict[str, list[str]], status: int) -> None:
    found = GATE.path_of("GET", TARGET, headers)
    assert isinstance(found, Answer)
    assert found.status == status


@pytest.mark.parametrize("method", ["HEAD", "PUT", "OPTIONS", "DELETE", "TRACE", "get", ""])
def test_other_methods_are_refused(method: str) -> None:
    assert isinstance(GATE.path_of(method, TARGET, OWN), Answer)


@given(st.text(max_size=40))
def test_nothing_is_answered_without_the_token(text: str) -> None:
    for target in (text, f"/{text}", f"/{text}/", f"/{text}/secret-token/", f"http://127.0.0.1:8000/{text}"):
        if not target.startswith("/secret-token/"):
            assert isinstance(GATE.path_of("GET", target, OWN), Answer)


@pytest.mark.parametrize(
    ("headers", "status"),
    [
        ({}, 411),
        ({"content-length": ["-1"]}, 411),
        ({"content-length": ["1", "1"]}, 411),
        ({"content-length": ["1e3"]}, 411),
        ({"content-length": ["\u0663"]}, 411),
        ({"content-length": ["5"], "transfer-encoding": ["chunked"]}, 411),
        ({"content-length": [str(MAX_BODY + 1)]}, 413),
        ({"content-length": ["5"], "content-type": ["text/plain"]}, 415),
        ({"content-length": ["5"]}, 415),
    ],
)
def test_bodies_are_short_json_of_known_length(headers: dict[str, list[str]], status: int) -> None:
    found = GATE.body_length(headers)
    assert isinstance(found, Answer)
    assert found.status == status


def test_a_body_as_the_page_sends_it_is_read() -> None:
    assert GATE.body_length({"content-length": ["5"], "content-type": ["application/json"]}) == 5
