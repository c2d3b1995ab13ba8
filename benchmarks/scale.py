"""Scaling with size, pixel type and threads, all commands by size, and a second range of a block map."""

import os
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from benchmarks.competitors import COMPETITORS, LOW, Job, with_project
from benchmarks.decode import decoding_s
from benchmarks.machine import cores
from benchmarks.measure import Cost, cost, median
from benchmarks.scenes import FOLDER, Scene, ensure_raster

REPEATED = 8192  # side of the scene that the larger rasters repeat
SECOND_RANGE = "0.3,0.5"

_VRT = """<VRTDataset rasterXSize="{side}" rasterYSize="{side}">
  <SRS>EPSG:32633</SRS>
  <GeoTransform>500000, 0.5, 0, 5000000, 0, -0.5</GeoTransform>
  <VRTRasterBand dataType="Byte" band="1" blockXSize="512" blockYSize="512">
{parts}
  </VRTRasterBand>
</VRTDataset>
"""
_PART = """    <SimpleSource>
      <SourceFilename relativeToVRT="1">{name}</SourceFilename>
      <SrcRect xOff="0" yOff="0" xSize="{tile}" ySize="{tile}"/>
      <DstRect xOff="{col}" yOff="{row}" xSize="{tile}" ySize="{tile}"/>
    </SimpleSource>"""


@dataclass(frozen=True, slots=True)
class Run:
    """Medians of `uavseg extract` on a raster, and of decoding it once with the same number of threads."""

    scene: Scene
    cost: Cost
    decoding_s: float

    @property
    def decoded_bytes(self) -> int:
        """Decoded size of all bands."""
        return self.scene.side**2 * self.scene.bytes_per_pixel


def repeated(side: int, folder: Path = FOLDER) -> Path:
    """A VRT that repeats one scene; its side is a multiple of 8192."""
    tile = ensure_raster(Scene(REPEATED), folder)
    path = folder / f"repeated-{side}.vrt"
    starts = range(0, side, REPEATED)
    parts = [
        _PART.format(name=tile.name, tile=REPEATED, row=row, col=col) for row in starts for col in starts
    ]
    path.write_text(_VRT.format(side=side, parts="\n".join(parts)))
    return path


def scaling(sides: Sequence[int], rounds: int, report: Callable[[str], None]) -> list[Run]:
    """`uavseg extract` on rasters of increasing size."""
    return [
        _run(Scene(side), ensure_raster(Scene(side)) if side < REPEATED else repeated(side), rounds, report)
        for side in sides
    ]


def pixel_types(side: int, names: Sequence[str], rounds: int, report: Callable[[str], None]) -> list[Run]:
    """`uavseg extract` on the same scene with different pixel types."""
    return [_run(Scene(side, name), ensure_raster(Scene(side, name)), rounds, report) for name in names]


def _run(scene: Scene, raster: Path, rounds: int, report: Callable[[str], None]) -> Run:
    floors, costs = [], []
    for number in range(rounds):
        floors.append(decoding_s(raster, cores()))
        with tempfile.TemporaryDirectory(prefix="uavseg-benchmark-") as folder:
            [command] = COMPETITORS[0].commands(Job(scene, raster, Path(folder) / "regions.gpkg"))
            costs.append(cost(command, with_project(os.environ), Path(folder)))
        report(f"{scene.title} round {number + 1}: {costs[-1].wall_s:.2f} s, decoding {floors[-1]:.2f} s")
    return Run(scene, median(costs), statistics.median(floors))


@dataclass(frozen=True, slots=True)
class Reuse:
    """Medians of a first range, of a block map, and of a second range from the block map.

    `first_s` and `second_s` are seconds within one process, with imports and kernels loaded: the first
    range from the raster, and labels and polygons of the second range from the block map.
    """

    first: Cost
    division: Cost
    second: Cost
    first_s: float
    second_s: float


def reuse(side: int, rounds: int, report: Callable[[str], None]) -> Reuse:
    """A second, unrefined range from a saved block map: the whole process, and within one process."""
    raster = str(ensure_raster(Scene(side)))
    costs: dict[str, list[Cost]] = {"first": [], "division": [], "second": []}
    within = []
    with tempfile.TemporaryDirectory(prefix="uavseg-benchmark-") as folder:
        uavseg = [sys.executable, "-m", "uavseg"]
        unrefined = ["--range", SECOND_RANGE, "--refine", "none"]
        commands = {
            "first": [*uavseg, "extract", raster, "--range", f"{LOW},1", "-o", "first.gpkg"],
            "division": [*uavseg, "divide", raster, "-o", "blocks.tif"],
            "second": [*uavseg, "extract", "blocks.tif", *unrefined, "-o", "second.gpkg"],
        }
        for number in range(rounds):
            for name, command in commands.items():
                costs[name].append(
                    cost([*command, "-q", "--overwrite"], with_project(os.environ), Path(folder))
                )
                report(f"{side}² {name} round {number + 1}: {costs[name][-1].wall_s:.2f} s")
            within.append(_run_child("reuse", raster, str(Path(folder) / "blocks.tif")))
    first, division, second = (median(runs) for runs in costs.values())
    first_s, second_s = (statistics.median(column) for column in zip(*within, strict=True))
    return Reuse(first, division, second, first_s, second_s)


SAMPLE = "500064,4999936,32"  # x, y and radius in metres, within the smallest scene
COMMANDS = {
    "extract": ("extract", "--range", f"{LOW},1", "-o", "regions.gpkg"),
    "extract to GeoJSON": ("extract", "--range", f"{LOW},1", "-o", "regions.geojson"),
    "extract --method paper": ("extract", "--range", f"{LOW},1", "--method", "paper", "-o", "paper.gpkg"),
    "extract --mission": (
        *("extract", "--range", f"{LOW},1", "--min-area", "400", "-o", "flown.gpkg"),
        *("--mission", "flight.plan", "--altitude", "60", "--home", "auto"),
    ),
    "extract, three classes": (
        *("extract", "--class", "dark=0,0.3", "--class", "middle=0.3,0.6", "--class", "light=0.6,1"),
        *("-o", "classes.gpkg"),
    ),
    "levels": ("levels", "--width", "0.1", "-o", "levels.gpkg"),
    "levels, small segments merged": ("levels", "--width", "0.1", "--min-area", "50px", "-o", "merged.gpkg"),
    "suggest": ("suggest",),
    "match": ("match", "--like", SAMPLE, "-o", "match.gpkg"),
    "divide": ("divide", "-o", "blocks.tif"),
    "info": ("info",),
    "map": ("map", "-o", "map.html"),
    "preview": ("preview", "-o", "preview.png"),
    "serve, until the page is there": ("serve",),
}
FIRST_PAGE = """
import signal, subprocess, sys, urllib.request
with subprocess.Popen(sys.argv[1:], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as served:
    urllib.request.urlopen(served.stdout.readline().strip()).read()
    served.send_signal(signal.SIGINT)
"""


def commands(
    rasters: Mapping[int, Path], rounds: int, report: Callable[[str], None]
) -> dict[str, dict[int, Cost]]:
    """Medians of each command that reads a whole raster, by the side of the raster; all in turn."""
    costs: dict[str, dict[int, list[Cost]]] = {name: {side: [] for side in rasters} for name in COMMANDS}
    with tempfile.TemporaryDirectory(prefix="uavseg-benchmark-") as folder:
        for side, raster in rasters.items():
            for number in range(rounds):
                for name, (verb, *how) in COMMANDS.items():
                    command = [sys.executable, "-m", "uavseg", verb, str(raster), *how]
                    command += [] if verb in ("suggest", "info", "serve") else ["-q", "--overwrite"]
                    if verb == "serve":
                        command = [sys.executable, "-c", FIRST_PAGE, *command]
                    costs[name][side].append(cost(command, with_project(os.environ), Path(folder)))
                    report(f"{side}² {name} round {number + 1}: {costs[name][side][-1].wall_s:.2f} s")
    return {name: {side: median(runs) for side, runs in found.items()} for name, found in costs.items()}


def thread_scaling(side: int, rounds: int) -> list[tuple[int, float, float]]:
    """For one thread and for two: seconds of the segmentation, and of two independent computations.

    The independent computations give the largest speed-up that the machine allows.
    """
    raster = str(ensure_raster(Scene(side)))
    seconds = [
        _run_child("segment", raster, "1")
        + _run_child("segment", raster, "2")
        + _run_child("compute", "1")
        + _run_child("compute", "2")
        for _ in range(rounds)
    ]
    one, two, alone, both = (statistics.median(column) for column in zip(*seconds, strict=True))
    return [(1, one, alone), (2, two, both)]


def _run_child(*arguments: str) -> tuple[float, ...]:
    """Run this module in a child process and read the numbers that it prints."""
    command = [sys.executable, "-m", "benchmarks.scale", *arguments]
    output = subprocess.run(command, env=with_project(os.environ), check=True, stdout=subprocess.PIPE).stdout
    return tuple(float(number) for number in output.split())


def _measure_reuse(raster: str, blocks: str) -> tuple[float, float]:
    """Seconds of a first range from the raster, and of a second, unrefined one from a loaded block map."""
    import time

    import numpy as np

    from uavseg.execution.executors import threads
    from uavseg.jobs.extract import ExtractRequest, extract
    from uavseg.jobs.source.open_source import open_source
    from uavseg.jobs.source.work import Work
    from uavseg.segmentation.params.segment import IntensityRange, SegmentParams

    saved, source = open_source(blocks), open_source(raster)
    segment = SegmentParams(refine="none")
    extract(saved, ExtractRequest(IntensityRange(0.7, 1), segment))  # imports modules and loads kernels
    begun = time.perf_counter()
    work = Work(executor=threads())
    np.asarray(extract(source, ExtractRequest(IntensityRange(LOW, 1)), work).regions.polygons)
    between = time.perf_counter()
    low, high = map(float, SECOND_RANGE.split(","))
    np.asarray(extract(saved, ExtractRequest(IntensityRange(low, high), segment)).regions.polygons)
    return between - begun, time.perf_counter() - between


def _measure_segmentation(raster: str, count: str) -> tuple[float]:
    """Seconds of division, segment creation, refinement and tracing of a raster in the page cache."""
    import time

    from uavseg.execution.executors import threads
    from uavseg.raster.grid.tiling import TilePass
    from uavseg.raster.intensity.stretch import fit_stretch
    from uavseg.raster.read.dataset import Dataset
    from uavseg.regions.tiles.range_tiles import outline_regions
    from uavseg.segmentation.params.segment import IntensityRange, SegmentParams
    from uavseg.segmentation.pipeline import cells_to_refine, measure_block_map_for
    from uavseg.segmentation.source import GreySource

    dataset, interval, how, work = (
        Dataset.open(raster),
        IntensityRange(LOW, 1),
        SegmentParams(),
        threads(int(count)),
    )
    tile_pass = TilePass(dataset.windows(), map=work)
    source = GreySource(dataset, fit_stretch(dataset, "auto", tile_pass))
    start = time.perf_counter()
    blocks = measure_block_map_for(source, interval, how, tile_pass)
    inside = cells_to_refine(blocks, interval, how)
    outline_regions(source, inside, interval, how.refine, tile_pass)
    return (time.perf_counter() - start,)


def _measure_independent_work(count: str) -> tuple[float]:
    """Seconds of two independent computations without shared data, with one thread or two."""
    import time

    import numpy as np

    from uavseg.execution.executors import threads
    from uavseg.segmentation.blocks.lbp import contrast_histogram

    rng = np.random.default_rng(1)
    images = [rng.integers(0, 65536, (2048, 2048), np.uint16) for _ in range(2)]
    contrast_histogram(images[0])
    start = time.perf_counter()
    for _ in range(40):
        list(threads(int(count))(contrast_histogram, images))
    return (time.perf_counter() - start,)


if __name__ == "__main__":
    measures: dict[str, Callable[..., tuple[float, ...]]] = {
        "reuse": _measure_reuse,
        "segment": _measure_segmentation,
        "compute": _measure_independent_work,
    }
    print(*measures[sys.argv[1]](*sys.argv[2:]))
