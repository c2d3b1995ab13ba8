"""Kernels as machine code: shipped with the package, or compiled with numba where they run.

A kernel is a plain loop nest: it takes C-contiguous arrays and scalars, allocates nothing and raises nothing;
then its code needs no Python, and calling it releases the interpreter's lock. Importing numba and letting it
set up costs half a second of processor time, as much as a small tile costs altogether, and compiling all
kernels takes a minute. So for x86-64 Linux the package has a shared library of each kernel (`shipped`), for
processors of level x86-64-v4 (AVX-512), of level x86-64-v3 (AVX2) and for all others; `build_kernels`
makes them. LBP takes a third of the time at v4 that it takes at v3.

Where there is none (another platform, a kernel that was changed), a kernel is compiled to an object file the
first time that it is called on a machine, and later runs load it with llvmlite alone. `compiling` uses
private parts of numba and llvmlite. Where they fail for any reason, and on platforms that are not tested,
the same kernels run through ``numba.njit(cache=True)`` instead (the fallback): the same results, after a
slower start, and one note. Two environment variables are for the user:

UAVSEG_CACHE
    The folder of the caches, instead of ``uavseg`` in the user's cache folder.
UAVSEG_JIT
    ``objects`` compiles kernels for this very processor, also on a platform that is not tested; ``numba``
    runs them through ``numba.njit`` everywhere, without a note; ``baseline`` loads the shipped kernels that
    need no more than every x86-64 processor has.
"""

from uavseg._jit.kernels import Kernel, kernel
from uavseg._jit.loop_nest import inlined

__all__ = ["Kernel", "inlined", "kernel"]
