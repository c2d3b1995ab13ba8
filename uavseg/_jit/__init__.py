"""Ahead-of-time compilation of kernels with numba: an object cache on disk, and numba itself as the fallback.

Importing numba and letting it set up costs half a second of processor time, as much as a small tile costs
altogether. So a kernel is compiled to an object file the first time that it is called on a machine, and
later runs load the machine code with llvmlite alone (a millisecond). A kernel is a plain loop nest: it takes
C-contiguous arrays and scalars, allocates nothing and raises nothing; then its code needs no Python, and
calling it releases the interpreter's lock.

`compiling` uses private parts of numba and llvmlite. Where they fail for any reason, and on platforms that
are not tested, the same kernels run through ``numba.njit(cache=True)`` instead (`fallback`): the same
results, after a slower start, and one note. Two environment variables are for the user:

UAVSEG_CACHE
    The folder of the caches, instead of ``uavseg`` in the user's cache folder.
UAVSEG_JIT
    ``numba`` runs kernels through ``numba.njit`` everywhere, without a note; ``objects`` tries object files
    even on a platform that is not tested.
"""

from uavseg._jit.kernels import Kernel, kernel
from uavseg._jit.loop_nest import inlined

__all__ = ["Kernel", "inlined", "kernel"]
