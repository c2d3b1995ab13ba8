"""What the numbers were measured on and with; no names of hosts or people."""

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
)


def machine() -> str:
    """Processor, cores, memory and system, in one line."""
    memory_gib = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**30
    return f"{_processor()}, {cores()} cores, {memory_gib:.0f} GiB of memory, {platform.system()}"


def software() -> str:
    """Versions of what takes part, in one line."""
    return ", ".join([f"Python {platform.python_version()}", *(_named(package) for package in PACKAGES)])


def cores() -> int:
    """Processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _processor() -> str:
    told = Path("/proc/cpuinfo")
    if told.exists():
        for line in told.read_text().splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()


def _named(package: str) -> str:
    try:
        return f"{package} {version(package)}"
    except PackageNotFoundError:
        return f"no {package}"
