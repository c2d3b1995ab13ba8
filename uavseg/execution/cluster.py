"""Cluster executor: runs items on the workers of a dask.distributed scheduler.

Functions, items and results are sent pickled and compressed, each function once. The items of a worker that
dies are computed again by another.
"""

import logging
import operator
import pickle
import socket
import time
import warnings
import zlib
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from platform import python_version
from typing import Any

from uavseg.errors import ClusterError, UavsegError
from uavseg.execution.executors import Item, Map, Progress, Result, in_order

CONNECT_S = 10.0  # timeout of the connection to the scheduler
NO_WORKERS_S = 60.0  # how long there may be no worker: an adaptive cluster starts without any
IN_FLIGHT = 3  # items for each thread of the workers: one at work, the others being sent
_POLL_S = 2.0  # interval at which the workers are counted

RESULT_PACKAGES = ("numpy", "numba", "llvmlite", "rasterio", "shapely", "pyproj")
"""Packages of which any other release may compute other bytes."""

RESULT_LIBRARIES = {
    "GDAL": ("rasterio", "__gdal_version__"),
    "PROJ in rasterio": ("rasterio", "__proj_version__"),
    "PROJ": ("pyproj", "proj_version_str"),
    "GEOS": ("shapely", "geos_version_string"),
}
"""Libraries inside packages, each with the module and the attribute that hold its version."""


def dask(address: str) -> "Cluster":
    """Executor on the workers of a scheduler; a context manager, to be closed at the end.

    Parameters
    ----------
    address : str
        Of the scheduler, such as tcp://10.0.0.5:8786.

    Raises
    ------
    ClusterError
        If dask.distributed is not installed, no scheduler answers, or a worker has other versions.
    """
    try:
        from distributed import Client
    except ImportError as error:
        raise ClusterError(
            '--scheduler needs dask.distributed; install it with: pip install "uavseg[cluster]"'
        ) from error
    logging.getLogger("distributed").setLevel(logging.CRITICAL)  # what matters is raised as an error
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # about versions of packages, which are checked below
        try:
            client = Client(address, timeout=CONNECT_S, set_as_default=False, name="uavseg")
        except Exception as error:  # its type depends on what is wrong with the address
            reason = " ".join(str(error).split()).rstrip(".")
            raise ClusterError(
                f"no scheduler answers at {address} ({reason}); start one with: dask scheduler"
            ) from error
    cluster = Cluster(client, address)
    try:
        cluster.check_versions()
    except BaseException:
        cluster.close()
        raise
    return cluster


class Cluster:
    """Executor on the workers of a scheduler; see `dask`."""

    def __init__(self, client: Any, address: str) -> None:
        self._client = client
        self._address = address
        self._threads = 0
        self._last_count = -_POLL_S
        self._last_worker = time.monotonic()  # when there was a worker last

    def __call__(
        self, function: Callable[[Item], Result], items: Sequence[Item], progress: Progress | None = None
    ) -> Generator[Result, None, None]:
        """Apply a function to each item; see `executors.Map`."""
        if len(items) == 0:
            return
        self._last_worker = time.monotonic()
        with self._cluster_errors():
            work = self._send(_Work(function, versions()))

            def submit(item: Item) -> Any:
                return self._client.submit(operator.call, work, pack_value(item), pure=False)

            yield from in_order(submit, self._result, self._capacity, items, progress)

    def __enter__(self) -> Map:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Disconnect from the scheduler; unfinished items are cancelled."""
        self._client.close()

    def check_versions(self) -> None:
        """Check that all connected workers have the versions of this process.

        Raises
        ------
        ClusterError
            If one has not.
        """
        ours = versions()
        with self._cluster_errors():
            found = self._client.run(versions, on_error="return")
        for worker, theirs in found.items():
            if isinstance(theirs, Exception):
                raise ClusterError(
                    f"the worker {worker} has no uavseg {ours['uavseg']} ({theirs}); install the same there"
                )
            if theirs != ours:
                raise ClusterError(f"the worker {worker} has {_differences(theirs, ours)}")

    def _send(self, work: "_Work") -> Any:
        """Future of a function on the workers, which pass it on to each other.

        The tasks that make it name only functions of the standard library, so that a worker without uavseg
        fails when it unpickles the function, with an error that says so.
        """
        import cloudpickle

        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", message="Sending large graph")
            pickled = self._client.submit(
                zlib.decompress, zlib.compress(cloudpickle.dumps(work), 1), pure=False
            )
        return self._client.submit(pickle.loads, pickled, pure=False)

    def _result(self, future: Any) -> Any:
        while True:
            try:
                future.exception(timeout=_POLL_S)  # waits without fetching the result
            except TimeoutError:
                self._capacity()
                if time.monotonic() - self._last_worker > NO_WORKERS_S:
                    raise ClusterError(
                        f"the scheduler at {self._address} has no workers; "
                        f"start some with: dask worker {self._address}"
                    ) from None
            else:
                return unpack_value(future.result())

    def _capacity(self) -> int:
        """How many items may be in flight; the number of workers may change."""
        now = time.monotonic()
        if now - self._last_count >= _POLL_S:
            self._last_count, self._threads = now, sum(self._client.nthreads().values())
        if self._threads:
            self._last_worker = now
        return IN_FLIGHT * max(self._threads, 1)

    @contextmanager
    def _cluster_errors(self) -> Iterator[None]:
        """Failures of the cluster as ClusterError."""
        from concurrent.futures import CancelledError

        from distributed import KilledWorker

        try:
            yield
        except UavsegError:
            raise
        except KilledWorker as error:
            raise ClusterError(
                f"workers died one after the other over the same tile, the last {error.last_worker.address}; "
                "is their memory enough? smaller tiles (--tile 1024) need less"
            ) from error
        except CancelledError as error:
            raise self._lost() from error
        except OSError as error:
            if self._client.status == "running":
                raise  # raised by the function itself
            raise self._lost() from error

    def _lost(self) -> ClusterError:
        return ClusterError(f"the scheduler at {self._address} was lost during the run; nothing was written")


@dataclass(frozen=True)
class _Work:
    """A function of packed items, whose errors name the worker.

    Parameters
    ----------
    function : callable
    versions : dict
        Those of the client. A worker may join at any time, so each compares its own with them.
    """

    function: Callable[[Any], Any]
    versions: dict[str, str]

    def __call__(self, item: bytes) -> bytes:
        try:
            if _own_versions() != self.versions:
                raise ClusterError(f"a worker has {_differences(_own_versions(), self.versions)}")
            return pack_value(self.function(unpack_value(item)))
        except UavsegError as error:
            from distributed import get_worker

            where = f"on the worker {get_worker().address}, host {socket.gethostname()}"
            located = type(error)(f"{error} ({where})")
        raise located  # outside of the handler it has no cause: errors of GDAL cannot be pickled


def pack_value(value: object) -> bytes:
    """A value pickled and compressed."""
    return zlib.compress(pickle.dumps(value, pickle.HIGHEST_PROTOCOL), 1)


def unpack_value(content: bytes) -> Any:
    """The value that `pack_value` packed."""
    return pickle.loads(zlib.decompress(content))


def versions() -> dict[str, str]:
    """Versions that must agree between client and workers; of Python and distributed major and minor only."""
    minor = {"distributed": version("distributed"), "Python": python_version()}
    found = {name: ".".join(text.split(".")[:2]) for name, text in minor.items()}
    found |= {name: _version_if_installed(name) for name in RESULT_PACKAGES}
    for name, (module, attribute) in RESULT_LIBRARIES.items():
        found[name] = str(getattr(import_module(module), attribute))
    return {"uavseg": import_module("uavseg").__version__} | found


def _version_if_installed(name: str) -> str:
    """Numba and llvmlite are not installed everywhere."""
    try:
        return version(name)
    except PackageNotFoundError:
        return "not installed"


_own_versions = cache(versions)  # a worker compares them for each item


def _differences(theirs: dict[str, str], ours: dict[str, str]) -> str:
    """Every version that differs, and what to do about it."""
    found = [
        f"{name} {theirs.get(name)} where this side has {here}"
        for name, here in ours.items()
        if theirs.get(name) != here
    ]
    return f"{', '.join(found)}; install the same on both"
