"""Runs a case in a process forked from this one, in a folder of its own, under limits of memory and time."""

import ctypes
import faulthandler
import hashlib
import io
import os
import resource
import select
import shutil
import signal
import socket
import struct
import sys
import tempfile
import time
import traceback
import warnings
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

from tests.hostile.case import Case

PATIENCE_S = 20.0
MEMORY = 1 << 30  # growth of a process that is a finding
ADDRESSES = 6 << 30  # of virtual memory beyond what this process has
LARGEST_FILE = 1 << 29
SECRET = b"TOPSECRET" * 64
_POLL_MS = 20
_IN_ACCESS, _IN_OPEN = 0x1, 0x20


@dataclass(frozen=True)
class Outcome:
    """What a command did.

    Parameters
    ----------
    code : int
        Exit code; below 0: the signal that ended it.
    out, err : bytes
    seconds, cpu_seconds : float
        On the clock, and of work.
    grown : int
        Bytes by which its resident memory grew, at most.
    made, changed, gone : tuple of str
        Files in its folder.
    outside : tuple of str
        What it did beyond its folder: files read or made there, connections.
    digests : tuple of (str, str)
        Name and hash of what it made.
    """

    code: int
    out: bytes
    err: bytes
    seconds: float
    cpu_seconds: float
    grown: int
    made: tuple[str, ...] = ()
    changed: tuple[str, ...] = ()
    gone: tuple[str, ...] = ()
    outside: tuple[str, ...] = ()
    digests: tuple[tuple[str, str], ...] = ()


@dataclass
class Sandbox:
    """A folder for cases, beside one that none of them may look into, and a port that none may call.

    Parameters
    ----------
    root : Path
        Is made and removed.
    """

    root: Path = field(
        default_factory=lambda: Path(tempfile.mkdtemp(prefix="hostile.", dir=_memory_folder()))
    )

    def __post_init__(self) -> None:
        self.inside, self.outside = self.root / "in", self.root / "outside"
        for folder in (self.inside, self.outside, self.root / "home", self.root / "tmp"):
            folder.mkdir()
        (self.outside / "secret.bin").write_bytes(SECRET)
        (self.outside / "secret.pgm").write_bytes(b"P5\n8 8\n255\n" + SECRET[:64])
        self._server = socket.create_server(("127.0.0.1", 0))
        self._server.setblocking(False)
        self.address = f"127.0.0.1:{self._server.getsockname()[1]}"
        self._inotify = _watch(self.outside)

    def close(self) -> None:
        """Remove the folder."""
        self._server.close()
        if self._inotify is not None:
            os.close(self._inotify)
        shutil.rmtree(self.root)

    def run(self, case: Case) -> list[Outcome]:
        """Run the commands of a case, one after the other, or its call."""
        shutil.rmtree(self.inside)
        self.inside.mkdir()
        for name, content in case.files.items():
            path = self.inside / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content)
        if case.call is not None:
            from tests.hostile.arguments import perform

            call = case.call
            return [self._run(lambda: perform(call), case)]
        return [self._run(partial(_command, command), case) for command in case.commands]

    def _run(self, body: Callable[[], None], case: Case) -> Outcome:
        before, beyond = _digests(self.inside), _digests(self.outside)
        self._read_inotify()
        std = [self.root / name for name in ("stdin", "stdout", "stderr")]
        std[0].write_bytes(case.stdin)
        size, start, worked = _resident(os.getpid()), time.monotonic(), _cpu_of_children()
        pid = os.fork()
        if pid == 0:
            _child(body, self, std, case)
        status, largest, called = self._wait(pid, size, start)
        seconds, worked = time.monotonic() - start, _cpu_of_children() - worked
        after = _digests(self.inside)
        outside = [*(["connection"] if called else []), *self._read_inotify()]
        outside += [f"changed {name}" for name in {*beyond} ^ {*_digests(self.outside)}]
        left = [path.name for path in (*self.root.glob("tmp/*"), *self.root.glob("home/*"))]
        for name in left:
            outside.append(f"left {name}")
            for folder in ("tmp", "home"):
                _remove(self.root / folder / name)
        return Outcome(
            os.waitstatus_to_exitcode(status),
            std[1].read_bytes(),
            std[2].read_bytes(),
            seconds,
            worked,
            largest - size,
            tuple(sorted(after.keys() - before.keys())),
            tuple(sorted(name for name in before.keys() & after.keys() if before[name] != after[name])),
            tuple(sorted(before.keys() - after.keys())),
            tuple(sorted(set(outside))),
            tuple(sorted((name, after[name]) for name in after.keys() - before.keys())),
        )

    def _wait(self, pid: int, size: int, start: float) -> tuple[int, int, bool]:
        """Status of a process, its largest resident memory, and whether it connected to the port."""
        descriptor = os.pidfd_open(pid)
        poll = select.poll()
        poll.register(descriptor, select.POLLIN)
        poll.register(self._server, select.POLLIN)
        called, largest, stopped = False, size, False
        try:
            while True:
                ready = {found for found, _ in poll.poll(_POLL_MS)}
                if self._server.fileno() in ready:
                    called = True
                    self._server.accept()[0].close()
                if descriptor in ready:
                    break
                largest = max(largest, _resident(pid))
                late = time.monotonic() - start > PATIENCE_S
                if (late or largest - size > 2 * MEMORY) and not stopped:
                    stopped = True
                    os.kill(pid, signal.SIGUSR1)  # says where it is
                    time.sleep(0.1)
                    os.killpg(pid, signal.SIGKILL)
        finally:
            os.close(descriptor)
        return os.waitpid(pid, 0)[1], largest, called

    def _read_inotify(self) -> list[str]:
        found: list[str] = []
        if self._inotify is None:
            return found
        while select.select([self._inotify], [], [], 0)[0]:
            data, at = os.read(self._inotify, 1 << 16), 0
            while at < len(data):
                (length,) = struct.unpack_from("I", data, at + 12)
                name = data[at + 16 : at + 16 + length].rstrip(b"\0").decode()
                found += [f"read {name}"] if name else []
                at += 16 + length
        return found


def _memory_folder() -> str | None:
    """A folder that is held in memory, where there is one."""
    return "/dev/shm" if Path("/dev/shm").is_dir() else None


def _watch(folder: Path) -> int | None:
    """An inotify descriptor that tells when a file in a folder is opened or read."""
    libc = ctypes.CDLL(None)
    descriptor = libc.inotify_init1(os.O_NONBLOCK | os.O_CLOEXEC)
    assert descriptor >= 0, "inotify is not to be had"
    assert libc.inotify_add_watch(descriptor, str(folder).encode(), _IN_ACCESS | _IN_OPEN) >= 0
    return int(descriptor)


def _cpu_of_children() -> float:
    """Seconds of work of all children that have ended."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def _resident(pid: int) -> int:
    """Memory of a process in bytes, files aside."""
    try:
        _, resident, shared, *_ = map(int, Path(f"/proc/{pid}/statm").read_text().split())
        return (resident - shared) * resource.getpagesize()
    except (OSError, ValueError):
        return 0


def _digests(folder: Path) -> dict[str, str]:
    """Hash of every file, and of every folder nothing, by name."""
    found = {}
    for top, folders, files in os.walk(os.fsencode(folder)):
        for name in files:
            path = os.path.join(top, name)
            content = Path(os.fsdecode(path)).read_bytes() if os.path.isfile(path) else b"special"
            found[os.fsdecode(os.path.relpath(path, os.fsencode(folder)))] = hashlib.sha1(content).hexdigest()
        for name in folders:
            found[os.fsdecode(os.path.relpath(os.path.join(top, name), os.fsencode(folder)))] = "folder"
    return found


def _remove(path: Path) -> None:
    if path.is_dir():
        shutil.rmtree(path)
    elif path.exists():
        path.unlink()


def _child(body: Callable[[], None], sandbox: Sandbox, std: list[Path], case: Case) -> None:
    """The process of a case; does not return."""
    code = 1
    try:
        os.setsid()
        os.chdir(sandbox.inside)
        for descriptor, path in enumerate(std):
            flags = os.O_RDONLY if descriptor == 0 else os.O_WRONLY | os.O_CREAT | os.O_TRUNC
            os.dup2(os.open(path, flags, 0o600), descriptor)
        _limit()
        sys.stdin = io.TextIOWrapper(os.fdopen(0, "rb", closefd=False), encoding="utf-8")
        sys.stdout = io.TextIOWrapper(os.fdopen(1, "wb", closefd=False), encoding="utf-8")
        sys.stderr = io.TextIOWrapper(
            os.fdopen(2, "wb", closefd=False),
            encoding="utf-8",
            errors="backslashreplace",
            line_buffering=True,
        )
        os.environ.update({"HOME": str(sandbox.root / "home"), "TMPDIR": str(sandbox.root / "tmp")})
        os.environ.update(case.environment)
        tempfile.tempdir = None
        warnings.resetwarnings()
        for quiet in (DeprecationWarning, PendingDeprecationWarning, ImportWarning, ResourceWarning):
            warnings.simplefilter("ignore", quiet, append=True)  # as Python starts
        faulthandler.register(signal.SIGUSR1, file=sys.stderr)
        code = _exit_code(body)
        sys.stdout.flush()
        sys.stderr.flush()
    finally:
        os._exit(code)


def _limit() -> None:
    used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (used + ADDRESSES,) * 2)
    resource.setrlimit(resource.RLIMIT_FSIZE, (LARGEST_FILE,) * 2)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def _exit_code(body: Callable[[], None]) -> int:
    """What the interpreter would exit with."""
    try:
        body()
    except SystemExit as error:
        if error.code is None or isinstance(error.code, int):
            return error.code or 0
        print(error.code, file=sys.stderr)
        return 1
    except BaseException:
        traceback.print_exc()
        return 1
    return 0


def _command(arguments: tuple[str, ...]) -> None:
    from uavseg.__main__ import run

    if "serve" in arguments[:1]:
        from tests.hostile.serving import visit
        from uavseg.api.pages import MapServer

        MapServer.wait = visit  # type: ignore[method-assign]
    sys.argv = ["uavseg", *arguments]
    run()
