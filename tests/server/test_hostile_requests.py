"""Hostile requests leave the server answering, and none of them gets what the raster is not."""

import errno
import json
import logging
import random
import re
import socket
import threading
import time
import warnings
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import pytest

import uavseg
from tests.server.asking import fetch
from uavseg.api.pages import MapServer
from uavseg.cli.terminal.say import library_messages
from uavseg.server import local_server
from uavseg.server.local_server import MAX_ARRIVING, MAX_REQUESTS, Answer, LocalServer, json_answer

SAMPLE = Path(uavseg.__file__).parents[1] / "samples" / "quarry.tif"
HUGE = 10**398
METHODS = (
    "GET",
    "POST",
    "PUT",
    "HEAD",
    "OPTIONS",
    "DELETE",
    "TRACE",
    "CONNECT",
    "get",
    "",
    "G\x00T",
    "A" * 70000,
)
VERSIONS = ("1.1", "1.1", "1.1", "1.1", "1.0", "1.0", "2", "9.9", "")
PATHS = (
    *("", "jobs/1", "jobs/extract", "jobs/match", "jobs/plan", "jobs/1/stop", "jobs/1/files/regions.gpkg"),
    *(
        "tiles/3/1/2",
        "tiles/99/0/0",
        "tiles/0/0/-1",
        "tiles/3/9/9",
        "../../etc/passwd",
        "..%2f..%2fetc%2fpasswd",
    ),
    *(
        "jobs/1/files/../../../etc/passwd",
        "jobs/1/files/..",
        "jobs/1/files/%2e%2e",
        "//etc/passwd",
        "\x00",
        "?a=b",
    ),
    *("file:///etc/passwd", "jobs/" + "9" * 400, "tiles/1/1/1" * 30, "jobs/extract/../plan", "#", "\xff\xfe"),
)
BODIES = (
    *(b"", b"{}", b"[]", b"null", b"[" * 100000, b"{" * 1000, b"\xff\xfe", b'{"low": 1e999, "high": NaN}'),
    *(
        b'{"low": "0", "high": 1}',
        b'{"low": 0.5, "high": 0.4}',
        b'{"low": 0, "high": 1, "like": "/etc/passwd"}',
    ),
    *(b'{"job": 1, "altitude": -5}', b'{"job": 1, "altitude": 60, "camera": "/etc/passwd", "spacing": 1}'),
    *(
        b'{"job": 1, "altitude": 60, "zones": [[[0,0],[1,1],[0,1],[1,0]]]}',
        b'{"center": [91, 0], "edge": [0, 0]}',
    ),
    *(b'{"low": %d, "high": 1}' % HUGE, b'{"job": 1, "ids": [%d], "altitude": 60}' % HUGE),
    *(b'{"center": [%d, 0], "edge": [0, 0]}' % HUGE, b'{"job": 1, "altitude": %d}' % HUGE),
    *(b'{"center": "/etc/passwd", "edge": [0, 0]}', b'{"job": 1e308, "altitude": 60}', b"9" * 5000),
)
HEADERS = (
    *("Origin: http://evil.example", "Origin: null", "Host: evil.example", "Content-Length: -1", "X" * 70000),
    *("Content-Length: 99999999999", "Transfer-Encoding: chunked", "Content-Length: abc", "Range: bytes=0-"),
    *(
        "Content-Type: text/plain",
        "Expect: 100-continue",
        "Connection: keep-alive",
        ": ",
        " folded",
        "A\x00: b",
    ),
)


@pytest.fixture(scope="module")
def server() -> Iterator[MapServer]:
    with warnings.catch_warnings(action="ignore"):  # without rio-tiler there are no tiles
        found = uavseg.serve(SAMPLE, size=300)
    with found:
        yield found


def hostile(draw: random.Random, token: str, port: int) -> bytes:
    """A request that is wrong in some places, or right by chance."""
    known = draw.random() < 0.7
    target = (
        f"/{token if known else draw.choice([token[:-1], '', 'x', token + 'x', '..'])}/{draw.choice(PATHS)}"
    )
    lines = [f"{draw.choices(METHODS, [20, 20] + [1] * 10)[0]} {target} HTTP/{draw.choice(VERSIONS)}"]
    body = draw.choice(BODIES)
    if draw.random() < 0.9:
        lines.append(f"Host: 127.0.0.1:{port}")
    if draw.random() < 0.8:
        lines += ["Content-Type: application/json", f"Content-Length: {len(body)}"]
    lines += draw.choices(HEADERS, k=draw.choice([0, 0, 0, 1, 2]))
    if draw.random() < 0.02:
        lines += [f"H{n}: v" for n in range(200)]
    content = "\r\n".join(lines).encode("latin-1") + b"\r\n\r\n" + body
    if draw.random() < 0.1:
        content = content[: draw.randrange(len(content))]
    if draw.random() < 0.05:
        content = draw.randbytes(draw.randrange(2000))
    return content


def answer_to(content: bytes, port: int) -> bytes:
    """What comes back until the connection is closed; half a request is given up by us."""
    received = b""
    with socket.create_connection(("127.0.0.1", port), timeout=30) as connection:
        try:
            connection.sendall(content)
            connection.shutdown(socket.SHUT_WR)
            while part := connection.recv(1 << 16):
                received += part
        except TimeoutError:
            raise
        except OSError as error:  # refused before all was sent
            assert error.errno in {errno.ECONNRESET, errno.EPIPE, errno.ENOTCONN}, error
    return received


@pytest.mark.slow
@pytest.mark.slow
@pytest.mark.parametrize(
    "count",
    [200, pytest.param(2000, marks=pytest.mark.slow), pytest.param(10_000, marks=pytest.mark.thorough)],
)
def test_hostile_requests_leave_it_answering(count: int, server: MapServer) -> None:
    draw = random.Random(count)
    token = server.url.split("/")[3]
    port = int(server.url.split(":")[2].split("/")[0])
    answered = 0
    for _ in range(count):
        found = answer_to(hostile(draw, token, port), port)
        answered += found.startswith(b"HTTP/1.0 ")
        assert not found or found.startswith((b"HTTP/1.0 ", b"{", b"<")), found[:80]
        assert b"root:" not in found
        assert b" 500 " not in found.split(b"\r\n", 1)[0], found[:300]
        assert b"Traceback" not in found
    assert answered > count / 2
    status, page = fetch(server.url)
    assert status == 200
    assert page.startswith(b"<!DOCTYPE html>")


def test_many_connections_that_say_nothing_are_let_go(server: MapServer) -> None:
    port = int(server.url.split(":")[2].split("/")[0])
    idle = [socket.create_connection(("127.0.0.1", port)) for _ in range(60)]
    for connection in idle:
        connection.close()
    for _ in range(100):
        try:
            status, _ = fetch(server.url)
            break
        except OSError:
            continue
    assert status == 200


@pytest.mark.parametrize(
    ("kind", "body", "name"),
    [
        ("extract", {"low": HUGE, "high": 1}, "low"),
        ("extract", {"low": 0, "high": -HUGE}, "high"),
        ("extract", {"low": 0, "high": 1, "min_area": HUGE}, "min_area"),
        ("match", {"center": [HUGE, 0], "edge": [0, 0]}, "lat"),
        ("plan", {"job": 1, "altitude": HUGE}, "altitude"),
        ("plan", {"job": HUGE, "altitude": 60}, "job"),
        ("plan", {"job": 1, "altitude": 60, "ids": [HUGE]}, "ids"),
        ("plan", {"job": 1, "altitude": 60, "zones": [[[0, 0], [1, 1], [HUGE, 0]]]}, "lat"),
    ],
)
def test_numbers_beyond_those_of_a_float_are_refused(
    kind: str, body: Any, name: str, server: MapServer
) -> None:
    status, content = fetch(f"{server.url}jobs/{kind}", body)
    assert status == 400
    assert re.fullmatch(rf"{name} (is a|are whole) numbers?", json.loads(content)["error"])


@pytest.mark.slow
def test_connections_that_show_no_token_keep_nobody_out(server: MapServer) -> None:
    port = int(server.url.split(":")[2].split("/")[0])
    held = [socket.create_connection(("127.0.0.1", port)) for _ in range(150)]
    try:
        for connection in held[-MAX_ARRIVING:]:
            connection.sendall(b"GET /")  # the others were let go
        for _ in range(3):
            assert fetch(server.url)[0] == 200
    finally:
        for connection in held:
            connection.close()


def test_more_requests_with_the_token_than_there_are_places_are_refused(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    taken = threading.Semaphore(0)

    class Counting(LocalServer):
        @contextmanager
        def slot(self, request: Any) -> Iterator[bool]:
            with super().slot(request) as is_free:
                taken.release()
                yield is_free

    monkeypatch.setattr(local_server, "TIMEOUT_S", 600.0)  # a busy machine takes its time
    served = Counting(lambda method, path, body: json_answer(None))
    threading.Thread(target=served.serve_forever, args=(0.01,), daemon=True).start()
    head = (
        f"POST /{served.gate.token}/jobs/extract HTTP/1.1\r\nHost: {served.gate.hosts[0]}\r\n"
        "Content-Type: application/json\r\n"
    )
    with ExitStack() as held:
        held.callback(served.server_close)
        held.callback(served.shutdown)
        for _ in range(MAX_REQUESTS):
            connection = held.enter_context(socket.create_connection(served.server_address))
            connection.sendall(f"{head}Content-Length: 5\r\n\r\n1".encode())
            assert taken.acquire(timeout=60), "a request with the token has no place"
        for _ in range(3):
            assert fetch(served.url) == (503, b'{"error": "too many requests are open; ask again"}')
        connection.close()  # its body ends too early, and its place is free again
        for _ in range(1000):
            if fetch(served.url)[0] == 200:
                break
            time.sleep(0.02)
        else:
            pytest.fail("the place of a closed connection was not given back")


@pytest.mark.parametrize("start", ["GET /x", "POST /{token}/jobs/extract HTTP/1.1\r\nHost: 127.0.0.1"])
def test_a_request_has_a_deadline_as_a_whole(start: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(local_server, "TIMEOUT_S", 0.3)
    served = LocalServer(lambda method, path, body: json_answer(None))
    threading.Thread(target=served.serve_forever, args=(0.01,), daemon=True).start()
    try:
        with socket.create_connection(served.server_address, timeout=0.02) as connection:
            connection.sendall(start.format(token=served.gate.token).encode())
            for _ in range(500):
                try:
                    connection.sendall(b"x")
                    assert connection.recv(1000) == b""
                    break
                except TimeoutError:
                    continue
                except ConnectionError:
                    break
            else:
                pytest.fail("a request that never ends was read on and on")
    finally:
        served.shutdown()
        served.server_close()


def test_the_log_of_an_error_of_the_program_says_where_it_came_from(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(logging.getLogger(), "handlers", [])  # those of pytest

    def failing(method: str, path: str, body: bytes) -> Answer:
        raise KeyError("what was\x1b missing")

    served = LocalServer(failing)
    threading.Thread(target=served.serve_forever, args=(0.01,), daemon=True).start()
    try:
        with library_messages():
            status, content = fetch(served.url)
    finally:
        served.shutdown()
        served.server_close()
    assert status == 500 and b"missing" not in content and b"its log says how" in content
    log = capsys.readouterr().err
    assert log.startswith("uavseg: error: an answer failed\nTraceback (most recent call last):\n")
    assert "KeyError: 'what was\\x1b missing'\n" in log and "in failing" in log
    assert served.gate.token not in log and "library" not in log
