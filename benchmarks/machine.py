"""Hardware and software of a measurement, without names of hosts or people."""

import os
import platform
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

PACKAGES = (
    "numpy",
    "numba",
    "rasterio",
    "opencv-python-headless",
    "scipy",
    "geopandas",
    "pyogrio",
    "scikit-image",
    "networkx",
    "pathfinding",
    "ortools",
    "python-tsp",
)


def machine() -> str:
    """Processor, cores, memory and system, in one line."""
    memory_gib = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**30
    return f"{_processor()}, {cores()} cores, {memory_gib:.0f} GiB of memory, {platform.system()}"


def software() -> str:
    """Versions of Python and of the packages involved, in one line."""
    return ", ".join(
        [f"Python {platform.python_version()}", *(_package_version(package) for package in PACKAGES)]
    )


def cores() -> int:
    """Number of processors available to this process."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _processor() -> str:
    cpuinfo = Path("/proc/cpuinfo")
    if cpuinfo.exists():
        for line in cpuinfo.read_text().splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()


def _package_version(package: str) -> str:
    try:
        return f"{package} {version(package)}"
    except PackageNotFoundError:
        return f"no {package}"
