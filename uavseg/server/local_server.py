"""HTTP server on 127.0.0.1 with a random port and a token in its address."""

import io
import json
import logging
import secrets
import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

from uavseg.errors import UavsegError
from uavseg.plain_text import printable
from uavseg.server.gate import Gate, Refusal

MAX_REQUESTS = 64  # that are open at the same time: a map that is zoomed gives up many, and asks for others
MAX_ANSWERS = 4  # that are computed at the same time
MAX_ARRIVING = 64  # requests without a token as yet; one more ends the oldest
TIMEOUT_S = 20.0  # for a whole request to arrive, and for its answer to leave
POLICY = "frame-ancestors 'none'"

logger = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Answer:
    """A response.

    Parameters
    ----------
    content : bytes
    kind : str
        Its media type.
    status : int
    file_name : str
        Under which it is saved, if it is a download.
    """

    content: bytes
    kind: str = "application/json"
    status: int = 200
    file_name: str = ""


def json_answer(value: Any, status: int = 200) -> Answer:
    """A value as JSON."""
    return Answer(json.dumps(value, allow_nan=False).encode(), status=status)


Answering = Callable[[str, str, bytes], Answer]
"""Method, path behind the token and body -> answer."""


class LocalServer(ThreadingHTTPServer):
    """Answers requests of this computer that know the token.

    Parameters
    ----------
    answering : callable
        Called with method, path and body, in a thread of the request.
    port : int
        0 is any that is free.
    """

    daemon_threads = True
    request_queue_size = 64
    allow_reuse_address = False

    def __init__(self, answering: Answering, port: int = 0) -> None:
        self._slots = threading.BoundedSemaphore(MAX_REQUESTS)
        self._arriving: dict[socket.socket, None] = {}  # the oldest first
        self._lock = threading.Lock()
        self.computing = threading.BoundedSemaphore(MAX_ANSWERS)
        super().__init__(("127.0.0.1", port), _Handler)
        self.answering = answering
        self.gate = Gate(self.server_address[1], secrets.token_urlsafe(24))

    @property
    def url(self) -> str:
        """The address of the page, with the token."""
        return f"http://127.0.0.1:{self.gate.port}/{self.gate.token}/"

    def process_request(self, request: Any, client_address: Any) -> None:
        """Answer in a thread; who has shown no token as yet takes no place of those who have."""
        with self._lock:
            self._arriving[request] = None
            if len(self._arriving) > MAX_ARRIVING:
                with suppress(OSError):
                    oldest = next(iter(self._arriving))
                    del self._arriving[oldest]
                    oldest.shutdown(socket.SHUT_RDWR)  # its thread reads the end, and closes it
        try:
            super().process_request(request, client_address)
        except BaseException:
            self._arrived(request)
            raise

    def process_request_thread(self, request: Any, client_address: Any) -> None:
        """Answer, and let the next one in."""
        try:
            super().process_request_thread(request, client_address)
        finally:
            self._arrived(request)

    def _arrived(self, request: Any) -> None:
        with self._lock:
            self._arriving.pop(request, None)

    @contextmanager
    def slot(self, request: Any) -> Iterator[bool]:
        """One of the places of requests that know the token; False if all are taken."""
        self._arrived(request)
        is_free = self._slots.acquire(blocking=False)
        try:
            yield is_free
        finally:
            if is_free:
                self._slots.release()

    def handle_error(self, request: Any, client_address: Any) -> None:
        """A connection that broke off is no error of ours; others are logged."""
        logger.debug("a request failed", exc_info=True)


class _Handler(BaseHTTPRequestHandler):
    server: LocalServer
    server_version, sys_version = "uavseg", ""
    protocol_version = "HTTP/1.0"  # a connection for each request
    timeout = TIMEOUT_S

    def setup(self) -> None:
        """Read against a deadline: a timeout alone begins again with each byte."""
        super().setup()
        self.rfile = io.BufferedReader(_UntilDeadline(self.connection, time.monotonic() + TIMEOUT_S))

    def do_GET(self) -> None:
        self._answer()

    def do_POST(self) -> None:
        self._answer()

    def log_message(self, format: str, *args: Any) -> None:
        """Addresses hold the token: nothing is logged."""

    def send_error(self, code: int, message: str | None = None, explain: str | None = None) -> None:
        """Refuse without repeating anything of the request."""
        status = 405 if code == 501 else code
        self._send(json_answer({"error": "the request is not understood"}, status))

    def _answer(self) -> None:
        headers: dict[str, list[str]] = {}
        for name, value in self.headers.items():
            headers.setdefault(name.lower(), []).append(value)
        path = self.server.gate.path_of(self.command, self.path, headers)
        if isinstance(path, Refusal):
            self._refuse(path)
            return
        with self.server.slot(self.connection) as is_free:
            if is_free:
                self._answer_allowed(path, headers)
            else:
                self._refuse(Refusal(503, "too many requests are open; ask again"))

    def _answer_allowed(self, path: str, headers: dict[str, list[str]]) -> None:
        body = b""
        if self.command == "POST":
            length = self.server.gate.body_length(headers)
            if isinstance(length, Refusal):
                self._refuse(length)
                return
            body = self.rfile.read(length)
            if len(body) < length:
                self._refuse(Refusal(400, "the body ends too early"))
                return
        try:
            with self.server.computing:
                answer = self.server.answering(self.command, path, body)
        except UavsegError as error:
            answer = json_answer({"error": printable(str(error))}, 400)
        except Exception:
            logger.exception("an answer failed")
            answer = json_answer({"error": "the program failed; its log says how"}, 500)
        self._send(answer)

    def _refuse(self, refusal: Refusal) -> None:
        self._send(json_answer({"error": refusal.words}, refusal.status))

    def _send(self, answer: Answer) -> None:
        self.close_connection = True
        self.connection.settimeout(TIMEOUT_S)
        try:
            self.send_response(answer.status)
            self.send_header("Content-Type", answer.kind)
            self.send_header("Content-Length", str(len(answer.content)))
            self.send_header("Cache-Control", "no-store")
            self.send_header("Content-Security-Policy", POLICY)
            self.send_header("Cross-Origin-Resource-Policy", "same-origin")
            self.send_header("Referrer-Policy", "no-referrer")
            self.send_header("X-Content-Type-Options", "nosniff")
            if answer.file_name:
                self.send_header("Content-Disposition", f'attachment; filename="{answer.file_name}"')
            self.end_headers()
            if self.command != "HEAD":
                self.wfile.write(answer.content)
        except (ConnectionError, TimeoutError):
            logger.debug("the connection was closed before the answer")


class _UntilDeadline(io.RawIOBase):
    """What a connection sends until a moment of the clock."""

    def __init__(self, connection: socket.socket, ends_at: float) -> None:
        self._connection, self._ends_at = connection, ends_at

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: Any) -> int:
        left_s = self._ends_at - time.monotonic()
        if left_s <= 0:
            raise TimeoutError("the request did not arrive in time")
        self._connection.settimeout(left_s)
        return self._connection.recv_into(buffer)
