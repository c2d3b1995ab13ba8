"""What a GeoPackage of regions holds: ``python -m benchmarks.answers PATH``."""

import json
import os
import subprocess
import sys
from pathlib import Path

from benchmarks.competitors import with_project


def answer(path: Path) -> tuple[int, float, int]:
    """How many polygons, their area in the units of the CRS squared, and how many are invalid.

    Told by a process of its own, so that the caller stays small.
    """
    command = [sys.executable, "-m", "benchmarks.answers", str(path)]
    told = subprocess.run(
        command, env=with_project(os.environ), check=True, capture_output=True, text=True
    ).stdout
    polygons, area, invalid = json.loads(told)
    return polygons, area, invalid


def _look(path: Path) -> tuple[int, float, int]:
    import pyogrio.raw
    import shapely

    polygons = shapely.from_wkb(pyogrio.raw.read(path)[2])
    return len(polygons), float(shapely.area(polygons).sum()), int((~shapely.is_valid(polygons)).sum())


if __name__ == "__main__":
    print(json.dumps(_look(Path(sys.argv[1]))))
