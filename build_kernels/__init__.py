"""Compiling the kernels of `uavseg` when the package is built; nothing of it is installed."""
