"""Extraction of the regions of a range into a folder of GeoParquet files, for rasters of any size.

Workers outline, join, measure and write the regions; the driver holds what reaches the borders of partitions.
"""

import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from uavseg.dataclass import dataclass
from uavseg.errors import OutputError, ParameterError
from uavseg.execution.executors import phase
from uavseg.jobs.extract import ExtractRequest, measure, why_none, with_facts
from uavseg.jobs.ranges.ranges import DetectedRange, grey_for
from uavseg.jobs.result.result import Extraction
from uavseg.jobs.source.source import Blocks, Source, detail_of
from uavseg.jobs.source.work import SERIAL, Work
from uavseg.output.atomic import atomic_file
from uavseg.output.renames import recover
from uavseg.regions.formats.export import check_region_folder, write_regions
from uavseg.regions.outline.stitch import concatenate_sums, number_regions
from uavseg.regions.tiles.partitions import PARTITION, PartitionJob, join_partitions
from uavseg.segmentation.refine.thin_lines import ThinLines
from uavseg.segmentation.source import GreySource


@dataclass(frozen=True, slots=True)
class Written:
    """What was written of partitions, which merges by adding."""

    outlined: int = 0  # regions before small ones were dropped
    below_minimum: int = 0  # of too low a confidence
    regions: int = 0  # in files
    files: int = 0
    area: float = 0.0  # of the regions in files
    largest: tuple[int, float] = (0, 0.0)  # pixels and area of the largest

    def __add__(self, other: "Written") -> "Written":
        return Written(
            outlined=self.outlined + other.outlined,
            below_minimum=self.below_minimum + other.below_minimum,
            regions=self.regions + other.regions,
            files=self.files + other.files,
            area=self.area + other.area,
            largest=max(self.largest, other.largest),
        )


def extract_partitions(
    source: Source,
    request: ExtractRequest,
    path: str | os.PathLike[str],
    work: Work = SERIAL,
    overwrite: bool = False,
    side: int = PARTITION,
) -> tuple[Extraction, Written]:
    """Extract regions as `extract` does, and write them to files of a folder; return the rest of the result.

    The regions are the same, apart from their ids: the id of a region is the number of its first pixel,
    counted from 1 row by row. It is in the file of the partition in which that pixel lies, the largest first.
    Neither ids nor files depend on tiles or workers. The workers share the folder, `path`; `side` is that of
    a partition in pixels, a multiple of 64. A ParameterError says that an option needs all regions at once,
    another UavsegError as of `extract`, or that the folder cannot be written.
    """
    check_local(request)
    if isinstance(source, Blocks):
        raise ParameterError(f"a folder of regions is made from rasters; {source.name} is a block map")
    work = work.begun()
    narrow = ThinLines() if request.thin_lines else None
    detail = narrow or detail_of(request.detail, source.geobox, request.segment.refine)
    check_region_folder(path, overwrite)
    stretching, joining, writing = work.over(source, block_map=False).stages(3)
    grey, detected = grey_for(source, request.interval, stretching)
    none = np.empty(0, np.int64)
    found = measure(number_regions(concatenate_sums([]), none, none, []), grey, detected, request)
    found = with_facts(found, source, request)
    with atomic_file(path, overwrite) as made:
        folder = made.absolute()
        folder.mkdir()
        join = partial(join_partitions, grey, detected.interval, request.segment, detail=detail, side=side)
        with _components_in(folder, work, partial(join, joining.windows[0])) as scratch:
            with phase("refinement and outlines"):
                jobs = join(joining, Path(scratch))
            with phase("attributes and files"):
                how = request, found.regions.metadata, scratch, str(folder)
                write = partial(_write_partition, grey, detected, *how)
                written = sum(writing.run(write, jobs), Written())
        recover(folder)  # what workers left that were killed
        if len(list(folder.iterdir())) < written.files:
            raise OutputError(f"files of {path} are not here; workers must share its folder")
        if request.min_confidence is not None:
            found = replace(found, below_minimum=written.below_minimum)
        if not written.files:  # readers find no columns in an empty folder
            write_regions(found.regions, folder / _name(0))
            found = replace(
                found, nothing=why_none(found, written.outlined, grey, detected, request, writing)
            )
    return work.finished(found, *([found.nothing] if found.nothing else [])), written


@contextmanager
def _components_in(folder: Path, work: Work, stage: Callable[..., Any]) -> Iterator[str]:
    """Enter a folder for components: one that is deleted, or that of a stage in the checkpoint."""
    if work.checkpoint is None:
        with TemporaryDirectory(prefix="joins-", dir=folder) as scratch:
            yield scratch
    else:
        from uavseg.execution.checkpoint import stage_folder

        yield str(stage_folder(Path(work.checkpoint).absolute(), stage))


def check_local(request: object) -> ExtractRequest:
    """Refuse what needs all regions at once, and other jobs; return the request."""
    if not isinstance(request, ExtractRequest):
        raise ParameterError("a folder of regions is of one range, not of classes; write classes to a file")
    refused = {
        "filled holes": request.fill_holes is not None,
        "smooth outlines": bool(request.drawing.smooth_m),
        "simplified outlines": bool(request.drawing.simplify_m),
        "the refinement none": request.segment.refine == "none",
    }
    if given := [what for what, is_given in refused.items() if is_given]:
        raise ParameterError(
            f"a folder of regions is written without {given[0]}; leave it out, or write one file"
        )
    return request


def _write_partition(
    grey: GreySource,
    detected: DetectedRange,
    request: ExtractRequest,
    metadata: Mapping[str, Any],
    scratch: str,
    folder: str,
    job: PartitionJob,
) -> Written:
    """Put the regions of a partition together, measure them and write them to its file."""
    outlined = job.outlines(scratch)
    found = measure(outlined, grey, detected, request)
    regions, rings = found.regions, found.rings
    written = Written(outlined=len(outlined.sums.counts), below_minimum=found.below_minimum or 0)
    if not len(regions):
        return written
    corners = rings.vertices[rings.starts[np.searchsorted(rings.labels, regions.columns["id"])]]
    ids = corners.astype(np.int64) @ (grey.shape[1], 1) + 1  # a ring begins at its first pixel
    regions = replace(regions, columns=regions.columns | {"id": ids}, metadata=metadata)
    write_regions(regions, Path(folder, _name(job.number)), overwrite=True)  # one that was sent twice
    pixels, areas = regions.columns["pixels"], regions.columns["area_m2"]
    largest = int(pixels[0]), float(areas[0])
    return replace(written, regions=len(regions), files=1, area=float(areas.sum()), largest=largest)


def _name(number: int) -> str:
    return f"part-{number:06d}.parquet"
