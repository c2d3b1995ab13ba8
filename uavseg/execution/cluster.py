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
from functools import cache
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from platform import python_version
from typing import Any

from uavseg.dataclass import dataclass
from uavseg.errors import ClusterError, UavsegError, caused_errors
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
    """Connect to the workers of a scheduler; the executor is a context manager, to be closed at the end.

    `address` is that of the scheduler, such as tcp://10.0.0.5:8786. A ClusterError says that dask.distributed
    is not installed, that no scheduler answers, or that a worker has other versions.
    """
    missing = '--scheduler needs dask.distributed; install it with: pip install "uavseg[cluster]"'
    with caused_errors(missing, ClusterError, ImportError, form="{}"):
        from distributed import Client
    logging.getLogger("distributed").setLevel(logging.CRITICAL)  # errors are raised
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # about versions of packages, which are checked below
        try:
            client = Client(address, timeout=CONNECT_S, set_as_default=False, name="uavseg")
        except Exception as error:  # its type depends on what is wrong with the address
            why = f"no scheduler answers at {address} ({' '.join(str(error).split()).rstrip('.')})"
            raise ClusterError(f"{why}; start one with: dask scheduler") from error
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
        """Refuse connected workers with other versions than this process."""
        ours = versions()
        with self._cluster_errors():
            versions_by_worker = self._client.run(versions, on_error="return")
        for worker, theirs in versions_by_worker.items():
            if isinstance(theirs, Exception):
                raise ClusterError(
                    f"the worker {worker} has no uavseg {ours['uavseg']} ({theirs}); install the same there"
                )
            if theirs != ours:
                raise ClusterError(f"the worker {worker} has {_differences(theirs, ours)}")

    def _send(self, work: "_Work") -> Any:
        """Send a function to the workers, which pass it on to each other; returns its future."""
        import cloudpickle

        # The tasks that make it name only functions of the standard library, so that a worker without uavseg
        # fails when it unpickles the function, with an error that says so.
        packed = zlib.compress(cloudpickle.dumps(work), 1)
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", message="Sending large graph")
            pickled = self._client.submit(zlib.decompress, packed, pure=False)
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
        """Return how many items may be in flight; the number of workers may change."""
        now = time.monotonic()
        if now - self._last_count >= _POLL_S:
            self._last_count, self._threads = now, sum(self._client.nthreads().values())
        if self._threads:
            self._last_worker = now
        return IN_FLIGHT * max(self._threads, 1)

    @contextmanager
    def _cluster_errors(self) -> Iterator[None]:
        """Raise failures of the cluster as ClusterError."""
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
    """A function of packed items, whose errors name the worker."""

    function: Callable[[Any], Any]
    # Of the client, with which each worker compares its own: it may join at any time.
    versions: dict[str, str]

    def __call__(self, item: bytes) -> bytes:
        try:
            if _local_versions() != self.versions:
                raise ClusterError(f"a worker has {_differences(_local_versions(), self.versions)}")
            return pack_value(self.function(unpack_value(item)))
        except UavsegError as error:
            from distributed import get_worker

            where = f"on the worker {get_worker().address}, host {socket.gethostname()}"
            located = type(error)(f"{error} ({where})")
        raise located  # outside of the handler it has no cause: errors of GDAL cannot be pickled


def pack_value(value: object) -> bytes:
    """Pickle and compress a value."""
    return zlib.compress(pickle.dumps(value, pickle.HIGHEST_PROTOCOL), 1)


def unpack_value(content: bytes) -> Any:
    """Unpack the value that `pack_value` packed."""
    return pickle.loads(zlib.decompress(content))


def versions() -> dict[str, str]:
    """Return the versions that must agree; of Python and distributed major and minor only."""
    minor = {"distributed": version("distributed"), "Python": python_version()}
    by_name = {name: ".".join(text.split(".")[:2]) for name, text in minor.items()}
    by_name |= {name: _version_if_installed(name) for name in RESULT_PACKAGES}
    for name, (module, attribute) in RESULT_LIBRARIES.items():
        by_name[name] = str(getattr(import_module(module), attribute))
    return {"uavseg": import_module("uavseg").__version__} | by_name


def _version_if_installed(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:  # numba and llvmlite are not needed everywhere
        return "not installed"


_local_versions = cache(versions)  # a worker compares them for each item


def _differences(theirs: dict[str, str], ours: dict[str, str]) -> str:
    """Describe every version that differs, and what to do about it."""
    differing = {name: theirs.get(name) for name, here in ours.items() if theirs.get(name) != here}
    texts = [f"{name} {there} where this side has {ours[name]}" for name, there in differing.items()]
    return f"{', '.join(texts)}; install the same on both"
