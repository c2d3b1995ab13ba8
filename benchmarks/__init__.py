"""How fast uavseg is beside what people would run instead: ``python -m benchmarks``.

Only `data`, `kernels`, `answers` and the scripts in `peers` import anything heavy, and each runs in a process
of its own: the peak memory that the system reports for a child is never less than that of the process which
started it.
"""
