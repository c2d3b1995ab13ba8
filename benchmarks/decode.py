"""Time to decode a raster once: the lower bound for every method.

python -m benchmarks.decode RASTER THREADS
"""

import os
import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from benchmarks.competitors import with_project

ROWS = 512  # a strip of the raster's own tiles


def decoding_s(raster: Path, threads: int) -> float:
    """Seconds to decode all bands, measured in a child process."""
    command = [sys.executable, "-m", "benchmarks.decode", str(raster), str(threads)]
    return float(
        subprocess.run(command, env=with_project(os.environ), check=True, stdout=subprocess.PIPE).stdout
    )


def _decode(raster: str, threads: int) -> float:
    import rasterio
    from rasterio.windows import Window

    own = threading.local()

    def strip(row: int) -> None:
        if not hasattr(own, "file"):
            own.file = rasterio.open(raster)
        file = own.file
        file.read(window=Window(0, row, file.width, min(ROWS, file.height - row)))

    with rasterio.Env(GDAL_CACHEMAX=64), rasterio.open(raster) as file:
        rows = range(0, file.height, ROWS)
    start = time.perf_counter()
    with rasterio.Env(GDAL_CACHEMAX=64), ThreadPoolExecutor(threads) as pool:
        list(pool.map(strip, rows))
    return time.perf_counter() - start


if __name__ == "__main__":
    print(_decode(sys.argv[1], int(sys.argv[2])))
