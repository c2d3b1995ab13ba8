"""A scheduler and four workers as processes of their own, on loopback."""

import json
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

PATIENCE_S = 60
ROOT = Path(__file__).resolve().parents[2]
QUIET = ["--no-dashboard", "--host", "127.0.0.1"]


class Processes:
    """A scheduler, and workers that can be started and killed."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.workers: list[subprocess.Popen[bytes]] = []
        self.known = folder / "scheduler.json"
        self._all = [self._start("scheduler", "--port", "0", "--scheduler-file", self.known)]
        self.address = self._address()

    def add(self, count: int, address: str | None = None, path: str = str(ROOT)) -> None:
        """Start workers, without waiting for them."""
        for _ in range(count):
            where = ["--nthreads", "1", "--no-nanny", "--memory-limit", "0", "--local-directory", self.folder]
            self.workers.append(self._start("worker", address or self.address, *where, path=path))
            self._all.append(self.workers[-1])

    def stop(self) -> None:
        """Kill all processes."""
        for process in reversed(self._all):
            process.kill()
            process.wait()

    def _start(self, what: str, *options: object, path: str = str(ROOT)) -> "subprocess.Popen[bytes]":
        command = [sys.executable, "-m", "dask", what, *QUIET, *map(str, options)]
        how = os.environ | {"PYTHONPATH": path, "NO_PROXY": "127.0.0.1", "no_proxy": "127.0.0.1"}
        with (self.folder / f"{what}.log").open("ab") as log:
            return subprocess.Popen(command, stdout=log, stderr=log, env=how, cwd=self.folder)

    def _address(self) -> str:
        end = time.monotonic() + PATIENCE_S
        while time.monotonic() < end:
            try:
                return str(json.loads(self.known.read_text())["address"])
            except (OSError, ValueError):
                time.sleep(0.05)
        raise TimeoutError((self.folder / "scheduler.log").read_text())


@pytest.fixture(scope="module")
def processes(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Processes]:
    """A scheduler with four workers that are connected to it."""
    distributed = pytest.importorskip("distributed", reason="dask.distributed is not installed")
    started = Processes(tmp_path_factory.mktemp("cluster"))
    try:
        started.add(4)
        with distributed.Client(started.address, set_as_default=False, timeout=PATIENCE_S) as client:
            client.wait_for_workers(4, timeout=PATIENCE_S)
        yield started
    finally:
        started.stop()
