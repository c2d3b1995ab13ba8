"""How the cost grows: with the raster, with its kind of pixels, with threads, and for a second question."""

import os
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from benchmarks.competitors import COMPETITORS, LOW, Job, with_project
from benchmarks.decode import decoding_s
from benchmarks.machine import cores
from benchmarks.measure import Cost, cost, median
from benchmarks.scenes import FOLDER, Scene, ready

REPEATED = 8192  # side of the scene that larger rasters repeat
ANOTHER_RANGE = "0.3,0.5"

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
    """Medians of `uavseg extract` over a raster, beside decoding it once with as many threads."""

    scene: Scene
    taken: Cost
    decoding_s: float

    @property
    def decoded_bytes(self) -> int:
        """Of all bands."""
        return self.scene.side**2 * self.scene.bytes_per_pixel


def repeated(side: int, folder: Path = FOLDER) -> Path:
    """A raster of any multiple of 8192 in side: one scene again and again, as a VRT."""
    tile = ready(Scene(REPEATED), folder)
    path = folder / f"repeated-{side}.vrt"
    starts = range(0, side, REPEATED)
    parts = [
        _PART.format(name=tile.name, tile=REPEATED, row=row, col=col) for row in starts for col in starts
    ]
    path.write_text(_VRT.format(side=side, parts="\n".join(parts)))
    return path


def growing(sides: Sequence[int], rounds: int, tell: Callable[[str], None]) -> list[Run]:
    """`uavseg extract` over larger and larger rasters."""
    return [
        _run(Scene(side), ready(Scene(side)) if side < REPEATED else repeated(side), rounds, tell)
        for side in sides
    ]


def kinds(side: int, names: Sequence[str], rounds: int, tell: Callable[[str], None]) -> list[Run]:
    """`uavseg extract` over the same scene in other kinds of pixels."""
    return [_run(Scene(side, name), ready(Scene(side, name)), rounds, tell) for name in names]


def _run(scene: Scene, raster: Path, rounds: int, tell: Callable[[str], None]) -> Run:
    floors, costs = [], []
    for number in range(rounds):
        floors.append(decoding_s(raster, cores()))
        with tempfile.TemporaryDirectory(prefix="uavseg-benchmark-") as folder:
            [command] = COMPETITORS[0].commands(Job(scene, raster, Path(folder) / "regions.gpkg"))
            costs.append(cost(command, with_project(os.environ), Path(folder)))
        tell(f"{scene.title} round {number + 1}: {costs[-1].wall_s:.2f} s, decoding {floors[-1]:.2f} s")
    return Run(scene, median(costs), statistics.median(floors))


@dataclass(frozen=True, slots=True)
class Again:
    """Medians: a first range, the block map of everything, and another range answered from it.

    The last two are seconds within one process that has loaded all it needs: a first range of the raster, and
    labels and polygons of another range from the block map.
    """

    first: Cost
    dividing: Cost
    another: Cost
    first_s: float
    another_s: float


def again(side: int, rounds: int, tell: Callable[[str], None]) -> Again:
    """Another range from a saved block map, at block edges: the whole process, and the regions alone."""
    raster = str(ready(Scene(side)))
    costs: dict[str, list[Cost]] = {"first": [], "dividing": [], "another": []}
    within = []
    with tempfile.TemporaryDirectory(prefix="uavseg-benchmark-") as folder:
        uavseg = [sys.executable, "-m", "uavseg"]
        edges = ["--range", ANOTHER_RANGE, "--refine", "none"]
        commands = {
            "first": [*uavseg, "extract", raster, "--range", f"{LOW},1", "-o", "first.gpkg"],
            "dividing": [*uavseg, "divide", raster, "-o", "blocks.tif"],
            "another": [*uavseg, "extract", "blocks.tif", *edges, "-o", "another.gpkg"],
        }
        for number in range(rounds):
            for name, command in commands.items():
                costs[name].append(
                    cost([*command, "-q", "--overwrite"], with_project(os.environ), Path(folder))
                )
                tell(f"{side}² {name} round {number + 1}: {costs[name][-1].wall_s:.2f} s")
            within.append(_told("again", raster, str(Path(folder) / "blocks.tif")))
    first, dividing, another = (median(taken) for taken in costs.values())
    first_s, another_s = (statistics.median(column) for column in zip(*within, strict=True))
    return Again(first, dividing, another, first_s, another_s)


def threading(side: int, rounds: int) -> list[tuple[int, float, float]]:
    """For one thread and for two: seconds of the segmentation, and of two equal pieces of pure computing.

    The second says what two threads can gain on the machine at all.
    """
    raster = str(ready(Scene(side)))
    taken = [
        _told("segment", raster, "1")
        + _told("segment", raster, "2")
        + _told("compute", "1")
        + _told("compute", "2")
        for _ in range(rounds)
    ]
    one, two, alone, both = (statistics.median(column) for column in zip(*taken, strict=True))
    return [(1, one, alone), (2, two, both)]


def _told(*arguments: str) -> tuple[float, ...]:
    """The numbers that a process of this module prints."""
    command = [sys.executable, "-m", "benchmarks.scale", *arguments]
    told = subprocess.run(command, env=with_project(os.environ), check=True, stdout=subprocess.PIPE).stdout
    return tuple(float(number) for number in told.split())


def _again(raster: str, blocks: str) -> tuple[float, float]:
    """Polygons of a first range from the raster, and of another at block edges from a loaded block map."""
    import time

    import numpy as np

    from uavseg.execution.executors import threads
    from uavseg.jobs.extract import ExtractRequest, extract
    from uavseg.jobs.open_source import open_source
    from uavseg.jobs.work import Work
    from uavseg.segmentation.intervals import IntensityRange
    from uavseg.segmentation.params import SegmentParams

    saved, source = open_source(blocks), open_source(raster)
    segment = SegmentParams(refine="none")
    extract(saved, ExtractRequest(IntensityRange(0.7, 1), segment))  # loads all that is needed
    begun = time.perf_counter()
    work = Work(executor=threads())
    np.asarray(extract(source, ExtractRequest(IntensityRange(LOW, 1)), work).regions.polygons)
    between = time.perf_counter()
    low, high = map(float, ANOTHER_RANGE.split(","))
    np.asarray(extract(saved, ExtractRequest(IntensityRange(low, high), segment)).regions.polygons)
    return between - begun, time.perf_counter() - between


def _segment(raster: str, count: str) -> tuple[float]:
    """Division, segments, refinement and outlines of a raster that is in the system's cache."""
    import time

    from uavseg.execution.executors import threads
    from uavseg.raster.dataset import Dataset
    from uavseg.raster.intensity.stretch import fit_stretch
    from uavseg.raster.tile_pass import TilePass
    from uavseg.regions.tiles.range_tiles import outline_regions
    from uavseg.segmentation.intervals import IntensityRange
    from uavseg.segmentation.params import SegmentParams
    from uavseg.segmentation.pipeline import cells_to_refine, measure_block_map_for
    from uavseg.segmentation.source import GreySource

    dataset, interval, how, work = (
        Dataset.open(raster),
        IntensityRange(LOW, 1),
        SegmentParams(),
        threads(int(count)),
    )
    tile_pass = TilePass.over(dataset, map=work)
    source = GreySource(dataset, fit_stretch(dataset, "auto", tile_pass))
    start = time.perf_counter()
    blocks = measure_block_map_for(source, interval, how, tile_pass)
    inside = cells_to_refine(blocks, interval, how)
    outline_regions(source, inside, interval, how.refine, tile_pass)
    return (time.perf_counter() - start,)


def _compute(count: str) -> tuple[float]:
    """Two equal pieces of work that share nothing, by one thread or by two."""
    import time

    import numpy as np

    from uavseg.execution.executors import threads
    from uavseg.segmentation.blocks.lbp import contrast_histogram

    dice = np.random.default_rng(1)
    pieces = [dice.integers(0, 65536, (2048, 2048), np.uint16) for _ in range(2)]
    contrast_histogram(pieces[0])
    start = time.perf_counter()
    for _ in range(40):
        list(threads(int(count))(contrast_histogram, pieces))
    return (time.perf_counter() - start,)


if __name__ == "__main__":
    measures: dict[str, Callable[..., tuple[float, ...]]] = {
        "again": _again,
        "segment": _segment,
        "compute": _compute,
    }
    print(*measures[sys.argv[1]](*sys.argv[2:]))
