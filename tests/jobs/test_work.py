"""Work: one value for tiles, executor, checkpoint, progress and unreadable blocks."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
from affine import Affine

from uavseg.execution.executors import threads
from uavseg.jobs.extract import ExtractRequest, extract
from uavseg.jobs.source.open_source import open_raster
from uavseg.jobs.source.work import SERIAL, Work
from uavseg.raster.read.bad_blocks import BadBlock, record_bad_block
from uavseg.segmentation.params.segment import IntensityRange, SegmentParams

FIRST, SECOND = BadBlock("a.tif", 0, 0, 64, 64), BadBlock("a.tif", 128, 0, 64, 64)
SCENE = np.kron(np.arange(16).reshape(4, 4) * 16, np.ones((40, 40))).astype(np.uint8)


@dataclass(frozen=True)
class Found:
    warnings: tuple[str, ...]


def complain(number: int) -> int:
    record_bad_block((SECOND, FIRST)[number])
    return number


@pytest.mark.parametrize("executor", [SERIAL.executor, threads(2)])
def test_unreadable_blocks_end_in_the_warnings_in_the_order_of_the_file(executor: Any) -> None:
    work = Work(executor=executor).begun()
    assert list(work.map(complain, [0, 1, 0])) == [0, 1, 0]
    found = work.finished(Found(("before",)), "hint")
    assert found.warnings == ("before", str(FIRST), str(SECOND), "hint")


def test_this_thread_is_listened_to_as_well() -> None:
    work = Work().begun()
    with work.reading_here():
        complain(1)
    assert work.finished(Found(())).warnings == (str(FIRST),)


def test_each_job_has_unreadable_blocks_of_its_own() -> None:
    work = Work()
    one, other = work.begun(), work.begun()
    list(one.map(complain, [0]))
    assert one.finished(Found(())).warnings and not other.finished(Found(())).warnings
    assert not work.bad_blocks and work == one == other


def test_the_windows_are_reported_once_when_a_job_begins() -> None:
    begun: list[int] = []
    work = Work(64, started=lambda windows: begun.append(len(windows)))
    extract(open_raster(SCENE), ExtractRequest(IntensityRange(0.5, 1)), work)
    assert begun == [9]


def test_tiles_that_are_found_in_a_checkpoint_are_reported(tmp_path: Path) -> None:
    path = tmp_path / "a.tif"
    place = Affine(2, 0, 0, 0, -2, 0)
    with rasterio.open(path, "w", "GTiff", 160, 160, 1, dtype="uint8", transform=place) as file:
        file.write(SCENE, 1)
    resumed: list[tuple[str, int, int]] = []
    work = Work(64, checkpoint=tmp_path / "kept", resumed=lambda *stage: resumed.append(stage))
    request = ExtractRequest(IntensityRange(0.5, 1), SegmentParams(refine="scan"))
    first = extract(open_raster(path), request, work)
    assert not resumed
    again = extract(open_raster(path), request, work)
    assert ("measure", 9, 9) in resumed
    assert np.array_equal(first.rings.vertices, again.rings.vertices)
