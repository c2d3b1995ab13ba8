"""Benchmarks of uavseg against the usual alternatives: ``python -m benchmarks``.

Measurements run in child processes, and the parent imports no large library: the peak memory that the system
reports for a child is never less than the memory of the process that started it.
"""
