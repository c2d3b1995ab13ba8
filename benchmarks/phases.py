"""Time of `uavseg extract` by function, with one thread.

python -m benchmarks.phases RASTER
"""

import json
import os
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

from benchmarks.competitors import LOW, MIN_PIXELS, with_project

TIMED_FUNCTIONS = (
    ("raster/read/raster_file.py", "read", "decoding: `raster_file.read`"),
    ("raster/intensity/stretch.py", "apply", "8 to 16 bit: `Stretch.apply`"),
    ("segmentation/blocks/leaves.py", "pixels_in_range", "`leaves.pixels_in_range`"),
    ("segmentation/refine/total_variation.py", "refine_by_tv", "total variation: `refine_by_tv`"),
    ("segmentation/components.py", "label_components", "`components.label_components`"),
    ("segmentation/components.py", "component_sums", "`components.component_sums`"),
    ("regions/outline/chains.py", "trace_tile", "`chains.trace_tile`"),
    ("regions/outline/trace.py", "link_rings", "`trace.link_rings`"),
    ("regions/table.py", "make_regions", "areas, lengths, interior points: `make_regions`"),
    ("regions/formats/export.py", "write_regions", "GeoPackage: `export.write_regions`"),
)


@dataclass(frozen=True, slots=True)
class Phase:
    """Cumulative seconds of one function, callees included."""

    title: str
    seconds: float


def phases(raster: Path) -> list[Phase]:
    """All phases, imports first and the total last, measured in a child process."""
    command = [sys.executable, "-m", "benchmarks.phases", str(raster)]
    output = subprocess.run(
        command, env=with_project(os.environ), check=True, stdout=subprocess.PIPE, text=True
    ).stdout
    return [Phase(*row) for row in json.loads(output)]


def _measure(raster: str) -> list[tuple[str, float]]:
    start = time.perf_counter()
    import cProfile
    import pstats
    import tempfile

    from uavseg.jobs.extract import ExtractRequest, extract
    from uavseg.jobs.source.open_source import open_source
    from uavseg.regions.edit.small import Area
    from uavseg.regions.formats import export
    from uavseg.segmentation.params.segment import IntensityRange

    profile = cProfile.Profile()
    imported = time.perf_counter()
    with tempfile.TemporaryDirectory(prefix="uavseg-benchmark-") as folder:
        profile.enable()
        request = ExtractRequest(IntensityRange(LOW, 1), min_area=Area(MIN_PIXELS, True))
        found = extract(open_source(raster), request)
        export.write_regions(found.regions, Path(folder) / "regions.gpkg", overwrite=False)
        profile.disable()
    total = time.perf_counter() - start
    spent = {
        (file.rpartition("uavseg/")[2], function): cumulative
        for (file, _, function), (_, _, _, cumulative, _) in pstats.Stats(profile).stats.items()  # type: ignore[attr-defined]
    }
    rows = [("imports", imported - start)]
    rows += [(title, spent.get((file, function), 0.0)) for file, function, title in TIMED_FUNCTIONS]
    rows.append(("everything else", total - sum(seconds for _, seconds in rows)))
    return [*rows, ("total", total)]


if __name__ == "__main__":
    print(json.dumps(_measure(sys.argv[1])))
