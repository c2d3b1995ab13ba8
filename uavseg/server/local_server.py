"""HTTP server on 127.0.0.1 with a random port and a token in its address, and its queue of jobs.

Host, origin, token, method and size of a request are checked before anything else.
"""

import hmac
import io
import json
import logging
import re
import secrets
import shutil
import socket
import threading
import time
from collections import OrderedDict
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from contextvars import copy_context
from dataclasses import field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

from uavseg.dataclass import dataclass
from uavseg.errors import UavsegError
from uavseg.execution.executors import Progress
from uavseg.output.disk import recording_written
from uavseg.plain_text import printable

MAX_BODY = 1 << 20
_MAX_TARGET = 500
_JSON = "application/json"
_HEADERS = {
    "Cache-Control": "no-store",
    "Content-Security-Policy": "frame-ancestors 'none'",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
}
_LENGTH = re.compile(r"[0-9]{1,9}")
MAX_REQUESTS = 64  # that are open at the same time: a map that is zoomed cancels many, and sends others
_MAX_ANSWERS = 4  # that are computed at the same time
MAX_ARRIVING = 64  # requests that have not sent a token yet; one more ends the oldest
TIMEOUT_S = 20.0  # for a whole request to arrive, and for its answer to leave
logger = logging.getLogger(__name__)
KEPT = 20
_STOPPING_S = 5.0  # a job stops at its next step; its files are deleted after it


@dataclass(frozen=True, slots=True)
class Answer:
    """A response; with a file name it is a download."""

    content: bytes
    media_type: str = _JSON
    status: int = 200
    file_name: str = ""


def json_answer(value: Any, status: int = 200) -> Answer:
    """Encode a value as JSON, with a status of HTTP."""
    return Answer(json.dumps(value, allow_nan=False).encode(), status=status)


def refusal(status: int, text: str) -> Answer:
    """Return an answer that says why a request is refused."""
    return json_answer({"error": text}, status)


@dataclass(frozen=True, slots=True)
class Gate:
    """Check of requests: their host, origin, token, method and size.

    A page of another site can make a browser send requests to 127.0.0.1, also under its domain name (DNS
    rebinding). It does not know the token, and cannot choose the headers Host and Origin.
    """

    port: int
    token: str

    @property
    def hosts(self) -> tuple[str, str]:
        """Return the names of the server."""
        return f"127.0.0.1:{self.port}", f"localhost:{self.port}"

    def path_of(self, method: str, target: str, headers: Mapping[str, list[str]]) -> str | Answer:
        """Return the path behind the token of a request that is allowed, such as "jobs/1".

        `headers` has all values of each header, by its name in lower case.
        """
        if method not in {"GET", "POST"}:
            return refusal(405, "only GET and POST are known here")
        if headers.get("host", []) not in [[host] for host in self.hosts]:
            return refusal(421, "this server answers to 127.0.0.1 alone")
        origins = [[f"http://{host}"] for host in self.hosts]
        if "origin" in headers and headers["origin"] not in origins:
            return refusal(403, "requests of other sites are refused")
        if headers.get("sec-fetch-site", ["none"]) not in [["none"], ["same-origin"]]:
            return refusal(403, "requests of other sites are refused")
        if len(target) > _MAX_TARGET or not target.isascii():
            return refusal(414, "the address is too long, or not plain")
        parts = target.split("/", 2)
        token = parts[1] if len(parts) == 3 and not parts[0] else ""
        if not hmac.compare_digest(token.encode(), self.token.encode()):
            return refusal(404, "there is nothing here; open the address that uavseg serve printed")
        return parts[2]

    @staticmethod
    def body_length(headers: Mapping[str, list[str]]) -> int | Answer:
        """Return the length of the body of a POST."""
        lengths = headers.get("content-length", [])
        if "transfer-encoding" in headers or len(lengths) != 1 or not _LENGTH.fullmatch(lengths[0]):
            return refusal(411, "a body has a Content-Length")
        if int(lengths[0]) > MAX_BODY:
            return refusal(413, f"a body has at most {MAX_BODY} bytes")
        if headers.get("content-type") != [_JSON]:
            return refusal(415, f"a body is {_JSON}")
        return int(lengths[0])


Answering = Callable[[str, str, bytes], Answer]
"""Method, path behind the token and body -> answer."""


class LocalServer(ThreadingHTTPServer):
    """Server for requests of this computer that know the token; port 0 is any that is free.

    `answering` is called with method, path and body, in a thread of the request.
    """

    daemon_threads = True
    request_queue_size = 64
    allow_reuse_address = False

    def __init__(self, answering: Answering, port: int = 0) -> None:
        self._slots = threading.BoundedSemaphore(MAX_REQUESTS)
        self._arriving: dict[socket.socket, None] = {}  # the oldest first
        self._lock = threading.Lock()
        self.computing = threading.BoundedSemaphore(_MAX_ANSWERS)
        super().__init__(("127.0.0.1", port), _Handler)
        self.answering = answering
        self.gate = Gate(self.server_address[1], secrets.token_urlsafe(24))

    @property
    def url(self) -> str:
        """Return the address of the page, with the token."""
        return f"http://127.0.0.1:{self.gate.port}/{self.gate.token}/"

    def process_request(self, request: Any, client_address: Any) -> None:
        """Answer in a thread; requests without a token take no slots of those with one."""
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
        """Answer, and forget the connection."""
        try:
            super().process_request_thread(request, client_address)
        finally:
            self._arrived(request)

    def _arrived(self, request: Any) -> None:
        with self._lock:
            self._arriving.pop(request, None)

    @contextmanager
    def slot(self, request: Any) -> Iterator[bool]:
        """Take a slot of requests that know the token; yields False if all are taken."""
        self._arrived(request)
        is_free = self._slots.acquire(blocking=False)
        try:
            yield is_free
        finally:
            if is_free:
                self._slots.release()

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Log an error, such as a connection that broke off."""
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

    def log_message(self, format: str, *args: Any) -> None:
        """Log nothing: addresses hold the token."""

    def send_error(self, code: int, message: str | None = None, explain: str | None = None) -> None:
        """Refuse without repeating anything of the request."""
        status = 405 if code == 501 else code
        self._send(refusal(status, "the request is not understood"))

    def do_GET(self) -> None:
        headers = {name.lower(): self.headers.get_all(name, []) for name in self.headers}
        path = self.server.gate.path_of(self.command, self.path, headers)
        if isinstance(path, Answer):
            self._send(path)
            return
        with self.server.slot(self.connection) as is_free:
            if is_free:
                self._answer_allowed(path, headers)
            else:
                self._send(refusal(503, "too many requests are open; ask again"))

    do_POST = do_GET  # noqa: N815 - as the standard library calls it

    def _answer_allowed(self, path: str, headers: dict[str, list[str]]) -> None:
        body = b""
        if self.command == "POST":
            length = self.server.gate.body_length(headers)
            if isinstance(length, Answer):
                self._send(length)
                return
            body = self.rfile.read(length)
            if len(body) < length:
                self._send(refusal(400, "the body ends too early"))
                return
        try:
            with self.server.computing:
                answer = self.server.answering(self.command, path, body)
        except UavsegError as error:
            answer = refusal(400, printable(str(error)))
        except Exception:
            logger.exception("an answer failed")
            answer = refusal(500, "the program failed; its log says how")
        self._send(answer)

    def _send(self, answer: Answer) -> None:
        self.close_connection = True
        self.connection.settimeout(TIMEOUT_S)
        try:
            self.send_response(answer.status)
            self.send_header("Content-Type", answer.media_type)
            self.send_header("Content-Length", str(len(answer.content)))
            for name, value in _HEADERS.items():
                self.send_header(name, value)
            if answer.file_name:
                self.send_header("Content-Disposition", f'attachment; filename="{answer.file_name}"')
            self.end_headers()
            if self.command != "HEAD":
                self.wfile.write(answer.content)
        except (ConnectionError, TimeoutError):
            logger.debug("the connection was closed before the answer")


class _UntilDeadline(io.RawIOBase):
    """Bytes of a connection until a deadline of the monotonic clock."""

    def __init__(self, connection: socket.socket, deadline: float) -> None:
        self._connection, self._deadline = connection, deadline

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: Any) -> int:
        left_s = self._deadline - time.monotonic()
        if left_s <= 0:
            raise TimeoutError("the request did not arrive in time")
        self._connection.settimeout(left_s)
        return self._connection.recv_into(buffer)


class BusyError(UavsegError, RuntimeError):
    """Another job is running."""


class StoppedError(Exception):
    """Stop of a job on request."""


@dataclass
class Task:
    """A job and its result."""

    number: int
    folder: Path  # of its files
    state: str = "running"  # or "done", "failed" or "stopped"
    done: int = 0
    total: int = 0
    error: str = ""
    answer: Any = None  # values of JSON
    files: dict[str, Path] = field(default_factory=dict)  # by their names
    stop: threading.Event = field(default_factory=threading.Event)

    def progress(self, done: int, total: int) -> None:
        """Note the progress; raises StoppedError where the job is to stop."""
        if self.stop.is_set():
            raise StoppedError
        self.done, self.total = done, total

    def report(self) -> dict[str, Any]:
        """Return state, progress and result as values of JSON."""
        same = {name: getattr(self, name) for name in ("state", "done", "total", "error", "answer")}
        return {"job": self.number, **same, "files": sorted(self.files)}


Job = Callable[[Path, Progress], tuple[Any, dict[str, Path]]]
"""Folder for files, and progress -> answer as values of JSON, files by name."""


class Tasks:
    """Queue that runs one job at a time in another thread; the folder is for the files of all jobs."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._lock = threading.Lock()
        self._count = 0
        self._running: threading.Thread | None = None
        self._tasks: OrderedDict[int, Task] = OrderedDict()

    def begin(self, job: Job) -> Task:
        """Begin a job; BusyError if one is running."""
        with self._lock:
            if any(task.state == "running" for task in self._tasks.values()):
                raise BusyError("a job is running; wait for it, or stop it")
            self._count += 1
            folder = self._folder / str(self._count)
            folder.mkdir()
            task = self._tasks[self._count] = Task(self._count, folder)
            while len(self._tasks) > KEPT:
                shutil.rmtree(self._tasks.popitem(last=False)[1].folder, ignore_errors=True)
            context = copy_context()
            self._running = threading.Thread(target=context.run, args=(_run, task, job), daemon=True)
            self._running.start()
        return task

    def find(self, number: int) -> Task | None:
        """Return a job that is kept."""
        with self._lock:
            return self._tasks.get(number)

    def stop_all(self) -> None:
        """Stop the running job, and wait for it, for some seconds at most."""
        with self._lock:
            for task in self._tasks.values():
                task.stop.set()
        if self._running is not None:
            self._running.join(_STOPPING_S)


def _run(task: Task, job: Job) -> None:
    try:
        with recording_written():  # its files are not those of the command
            task.answer, task.files = job(task.folder, task.progress)
        task.state = "done"
    except StoppedError:
        task.error, task.state = "stopped", "stopped"
    except UavsegError as error:
        task.error, task.state = printable(str(error)), "failed"
    except BaseException:
        task.error, task.state = "the program failed; its log says how", "failed"
        raise
