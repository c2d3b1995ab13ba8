"""Warm-up: machine code of all kernels, libraries and the list of fonts, before they are needed."""

import importlib
import time

from uavseg._jit import object_cache, warming
from uavseg.arguments import checked
from uavseg.dataclass import dataclass
from uavseg.errors import OutputError, ParameterError
from uavseg.execution.executors import Progress, usable_cores

_LIBRARIES = (
    *("rasterio", "pyogrio", "geopandas", "pyproj", "shapely", "yaml"),
    *("matplotlib.font_manager", "pymavlink.mavutil"),  # the first makes its list of fonts, once for a user
)


@dataclass(frozen=True, slots=True)
class WarmUp:
    """What was done before the work begins: numbers of kernels, of libraries that were loaded, and seconds.

    The machine code of kernels came with the package (`shipped`), was compiled on this machine before
    (`kept`), or now.
    """

    shipped: int
    kept: int
    compiled: int
    libraries: int
    seconds: float

    def __str__(self) -> str:
        kernels = self.shipped + self.kept + self.compiled
        return (
            f"{kernels} kernels are ready in {self.seconds:.1f} s: {self.shipped} came with the package, "
            f"{self.kept} were compiled before, {self.compiled} now; {self.libraries} libraries were loaded"
        )


@checked
def warm_up(processes: int | None = None, progress: Progress | None = None) -> WarmUp:
    """Load everything once, and compile what has to be compiled, so that later commands start at once.

    On Linux with an x86-64 processor nothing is compiled: kernels come with the package. Elsewhere they are
    compiled into the user's cache, by several processes at once.

    Parameters
    ----------
    processes : int, optional
        How many compile; by default one for each core that the process may use.
    progress : callable, optional
        Called with the number of steps done and the number of steps: one for each kernel and each library.

    Raises
    ------
    ParameterError
        If `processes` is below 1.
    OutputError
        If kernels have to be compiled and no folder can keep them.
    MissingLibraryError
        If a kernel has to be compiled and numba is not installed.

    Examples
    --------
    >>> import uavseg
    >>> done = uavseg.warm_up()
    >>> done.shipped + done.kept + done.compiled > 80
    True
    """
    start = time.perf_counter()
    count = usable_cores() if processes is None else processes
    if count < 1:
        raise ParameterError(f"the number of processes is at least 1, not {count}")
    kernels = warming.all_kernels()
    total = len(kernels) + len(_LIBRARIES)

    def report(done: int) -> None:
        if progress is not None:
            progress(done, total)

    found = warming.warm(kernels, count, report)
    for done, name in enumerate(_LIBRARIES, start=len(kernels) + 1):
        importlib.import_module(name)
        report(done)
    if found["compiled"] and object_cache.is_temporary(object_cache.cache_folder()):
        raise OutputError(
            f"{found['compiled']} kernels were compiled, but no folder can keep them; "
            "name one that only you can write to in UAVSEG_CACHE"
        )
    seconds = time.perf_counter() - start
    return WarmUp(found["shipped"], found["kept"], found["compiled"], len(_LIBRARIES), seconds)
