"""Number, area and validity of the polygons of a GeoPackage: ``python -m benchmarks.polygon_stats PATH``."""

import json
import os
import subprocess
import sys
from pathlib import Path

from benchmarks.competitors import with_project


def polygon_stats(path: Path) -> tuple[int, float, int]:
    """Number of polygons, total area in squared units of the CRS, and number of invalid polygons.

    Runs in a child process, so that the caller needs little memory.
    """
    command = [sys.executable, "-m", "benchmarks.polygon_stats", str(path)]
    output = subprocess.run(
        command, env=with_project(os.environ), check=True, capture_output=True, text=True
    ).stdout
    polygons, area, invalid = json.loads(output)
    return polygons, area, invalid


def _read_stats(path: Path) -> tuple[int, float, int]:
    import pyogrio.raw
    import shapely

    polygons = shapely.from_wkb(pyogrio.raw.read(path)[2])
    return len(polygons), float(shapely.area(polygons).sum()), int((~shapely.is_valid(polygons)).sum())


if __name__ == "__main__":
    print(json.dumps(_read_stats(Path(sys.argv[1]))))
