"""The work done by others: a map over the workers of a dask.distributed scheduler.

What travels is pickled and compressed: the function once for each map, then an item there and its result
back. Whatever a worker that dies had done or was doing is done again by another.
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
from importlib.metadata import version
from platform import python_version
from typing import Any

from uavseg.errors import ClusterError, UavsegError
from uavseg.execution.executors import Item, Map, Progress, Result, in_order

CONNECT_S = 10.0  # how long a scheduler is waited for
NO_WORKERS_S = 60.0  # how long there may be no worker at all: a cluster that grows by itself begins so
IN_FLIGHT = 3  # items for each thread of the workers: one at work, the others on their way
_LOOK_S = 2.0  # how often the workers are counted

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
    """A map over the workers of a scheduler, to be closed at the end.

    Parameters
    ----------
    address : str
        Of the scheduler, such as tcp://10.0.0.5:8786.

    Raises
    ------
    ClusterError
        If dask.distributed is not installed, nobody answers there, or workers have other versions.
    """
    try:
        from distributed import Client
    except ImportError as error:
        raise ClusterError(
            'a scheduler wants dask.distributed; install it with: pip install "uavseg[cluster]"'
        ) from error
    logging.getLogger("distributed").setLevel(logging.CRITICAL)  # what matters is raised
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of other versions of packages, which are looked at below
        try:
            client = Client(address, timeout=CONNECT_S, set_as_default=False, name="uavseg")
        except Exception as error:  # of many kinds, by what is wrong with the address
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
    """A map over the workers of a scheduler; see `dask`."""

    def __init__(self, client: Any, address: str) -> None:
        self._client = client
        self._address = address
        self._threads = 0
        self._looked = -_LOOK_S
        self._seen = time.monotonic()  # when there last was a worker

    def __call__(
        self, function: Callable[[Item], Result], items: Sequence[Item], progress: Progress | None = None
    ) -> Generator[Result, None, None]:
        """Apply a function to each item; see `parallel.Map`."""
        if len(items) == 0:
            return
        self._seen = time.monotonic()
        with self._telling():
            work = self._sent(_Work(function, versions()))

            def begin(item: Item) -> Any:
                return self._client.submit(operator.call, work, packed(item), pure=False)

            yield from in_order(begin, self._result, self._room, items, progress)

    def __enter__(self) -> Map:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Let go of the scheduler; what was begun is given up."""
        self._client.close()

    def check_versions(self) -> None:
        """See that the workers that are there run what runs here.

        Raises
        ------
        ClusterError
            If one does not.
        """
        ours = versions()
        with self._telling():
            found = self._client.run(versions, on_error="return")
        for worker, theirs in found.items():
            if isinstance(theirs, Exception):
                raise ClusterError(
                    f"the worker {worker} has no uavseg {ours['uavseg']} ({theirs}); install the same there"
                )
            if theirs != ours:
                raise ClusterError(f"the worker {worker} has {_differences(theirs, ours)}")

    def _sent(self, work: "_Work") -> Any:
        """A function where the workers get it from each other; made again from its bytes if it is lost.

        Only words of Python's own are named on the way, so that a worker that lacks uavseg says so.
        """
        import cloudpickle

        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", message="Sending large graph")
            text = self._client.submit(zlib.decompress, zlib.compress(cloudpickle.dumps(work), 1), pure=False)
        return self._client.submit(pickle.loads, text, pure=False)

    def _result(self, future: Any) -> Any:
        while True:
            try:
                future.exception(timeout=_LOOK_S)  # waits, and fetches no result
            except TimeoutError:
                self._room()
                if time.monotonic() - self._seen > NO_WORKERS_S:
                    raise ClusterError(
                        f"the scheduler at {self._address} has no workers; "
                        f"start some with: dask worker {self._address}"
                    ) from None
            else:
                return unpacked(future.result())

    def _room(self) -> int:
        """How many items may be under way; workers come and go."""
        now = time.monotonic()
        if now - self._looked >= _LOOK_S:
            self._looked, self._threads = now, sum(self._client.nthreads().values())
        if self._threads:
            self._seen = now
        return IN_FLIGHT * max(self._threads, 1)

    @contextmanager
    def _telling(self) -> Iterator[None]:
        """What goes wrong between here and the workers, in one sentence."""
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
                raise  # the work's own
            raise self._lost() from error

    def _lost(self) -> ClusterError:
        return ClusterError(f"the scheduler at {self._address} was lost on the way; nothing was written")


@dataclass(frozen=True)
class _Work:
    """A function of packed items that says on which worker something was wrong.

    Parameters
    ----------
    function : callable
    versions : dict
        Those of the client. A worker may join at any time, so each compares its own.
    """

    function: Callable[[Any], Any]
    versions: dict[str, str]

    def __call__(self, item: bytes) -> bytes:
        try:
            if _own_versions() != self.versions:
                raise ClusterError(f"a worker has {_differences(_own_versions(), self.versions)}")
            return packed(self.function(unpacked(item)))
        except UavsegError as error:
            from distributed import get_worker

            place = f"on the worker {get_worker().address}, host {socket.gethostname()}"
            wrong = type(error)(f"{error} ({place})")
        raise wrong  # out here it has no cause: those of GDAL cannot be pickled


def packed(value: object) -> bytes:
    """A value as it travels."""
    return zlib.compress(pickle.dumps(value, pickle.HIGHEST_PROTOCOL), 1)


def unpacked(content: bytes) -> Any:
    """The value that was packed."""
    return pickle.loads(zlib.decompress(content))


def versions() -> dict[str, str]:
    """What must be the same on both sides; of Python and distributed the first and second number."""
    minor = {"distributed": version("distributed"), "Python": python_version()}
    found = {name: ".".join(text.split(".")[:2]) for name, text in minor.items()}
    found |= {name: version(name) for name in RESULT_PACKAGES}
    for name, (module, attribute) in RESULT_LIBRARIES.items():
        found[name] = str(getattr(import_module(module), attribute))
    return {"uavseg": import_module("uavseg").__version__} | found


_own_versions = cache(versions)  # of a worker, which compares them for each tile


def _differences(theirs: dict[str, str], ours: dict[str, str]) -> str:
    """Every version that differs, and what to do."""
    found = [
        f"{name} {theirs.get(name)} where this side has {here}"
        for name, here in ours.items()
        if theirs.get(name) != here
    ]
    return f"{', '.join(found)}; install the same on both"
