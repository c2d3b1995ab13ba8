"""Regions in partitioned GeoParquet: the same as in one file, whatever partitions, tiles and workers are."""

import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import count
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pytest
import rasterio
from affine import Affine
from hypothesis import given, settings, strategies as st
from numpy.typing import NDArray

pytest.importorskip("pyarrow", reason="pyarrow is not installed")

import geopandas
from pyarrow import dataset as arrow_dataset

from uavseg.errors import OutputError, OutputExistsError, ParameterError
from uavseg.execution.checkpoint import stage_name
from uavseg.execution.executors import Progress, threads
from uavseg.jobs.extract import ExtractRequest, extract, extract_partitions
from uavseg.jobs.result.result import Drawing
from uavseg.jobs.source.source import Raster
from uavseg.jobs.source.work import SERIAL, Work
from uavseg.raster.grid.geobox import Length
from uavseg.raster.intensity.value_range import ValueRange
from uavseg.raster.read.dataset import Dataset
from uavseg.regions.edit.small import Area
from uavseg.segmentation.params.segment import IntensityRange, SegmentParams

Image = NDArray[Any]
Written = Callable[[Image], Raster]
BRIGHT = ExtractRequest(IntensityRange(0.5, 0.8))
REQUESTS = {
    "tv": BRIGHT,
    "pixels": replace(BRIGHT, segment=SegmentParams(refine="pixels")),
    "paper": replace(BRIGHT, segment=SegmentParams(method="paper")),
    "scan": replace(BRIGHT, segment=SegmentParams(refine="scan")),
    "smooth": replace(BRIGHT, segment=SegmentParams(refine="smooth", threshold=2)),
    "detail": replace(BRIGHT, detail=Length(5, in_pixels=True)),
    "thin lines": replace(BRIGHT, thin_lines=True),
    "area": replace(BRIGHT, min_area=Area(30, in_pixels=True)),
    "confidence": replace(BRIGHT, min_confidence=0.3),
    "values": replace(BRIGHT, interval=ValueRange(100, 200)),
}


@pytest.fixture(scope="session")
def written(tmp_path_factory: pytest.TempPathFactory) -> Written:
    """A raster in UTM in which 0 is nodata."""
    folder, numbers = tmp_path_factory.mktemp("rasters"), count()

    def write(image: Image) -> Raster:
        path = folder / f"{next(numbers)}.tif"
        rows, cols = image.shape
        place = {"crs": "EPSG:32618", "transform": Affine(2, 0, 4e5, 0, -2, 5e6), "nodata": 0}
        with rasterio.open(path, "w", "GTiff", cols, rows, 1, dtype=image.dtype.name, **place) as file:
            file.write(image, 1)
        return Raster(Dataset.open(path))

    return write


def scene(seed: int, kind: str = "uint8") -> Image:
    """Patches of some brightness with noise."""
    rng = np.random.default_rng(seed)
    shape = tuple(rng.integers(60, 300, 2))
    grain = int(rng.choice([5, 30]))
    coarse = rng.choice([40, 120, 150, 220], (shape[0] // grain + 1, shape[1] // grain + 1))
    image = np.kron(coarse, np.ones((grain, grain), int))[: shape[0], : shape[1]]
    return np.clip(image + rng.normal(0, 10, shape), 1, 255).astype(kind)


def rows_of(frame: geopandas.GeoDataFrame) -> list[tuple[Any, ...]]:
    """Rows of a frame without ids, in an order of their own; floats and coordinates to the last bit."""
    columns = frame.drop(columns=["id", "geometry"])
    values = [columns[name].to_numpy().tolist() for name in columns]
    exact = [[one.hex() if isinstance(one, float) else one for one in column] for column in values]
    return sorted(zip(frame.geometry.to_wkb(), *exact, strict=True))


@pytest.mark.slow
@given(
    st.integers(0, 10**6),
    st.sampled_from(sorted(REQUESTS)),
    st.sampled_from([64, 128, 192]),
    st.sampled_from([64, 128, None]),
)
@settings(max_examples=20, deadline=None)
def test_all_files_together_are_the_regions_of_one_process(
    written: Written, seed: int, name: str, side: int, tile: int | None
) -> None:
    raster = written(scene(seed, "uint16" if seed % 2 else "uint8"))
    one = extract(raster, REQUESTS[name])
    with TemporaryDirectory() as folder:
        path = Path(folder, "regions.parquet")
        found, written_files = extract_partitions(raster, REQUESTS[name], path, Work(tile), side=side)
        frame = geopandas.read_parquet(path)
    assert rows_of(frame) == rows_of(one.regions.frame())
    assert written_files.regions == len(one.regions)
    assert found.warnings == one.warnings
    assert found.below_minimum == one.below_minimum
    assert found.regions.metadata == one.regions.metadata


@pytest.mark.slow
@given(st.integers(0, 10**6))
@settings(max_examples=10, deadline=None)
def test_ids_are_first_pixels_counted_row_by_row(written: Written, seed: int) -> None:
    image = scene(seed)
    with TemporaryDirectory() as folder:
        path = Path(folder, "regions.parquet")
        extract_partitions(written(image), REQUESTS["pixels"], path, side=64)
        frame = geopandas.read_parquet(path)
    assert frame["id"].is_unique
    inside = (image >= np.ceil(0.5 * 255)) & (image <= np.floor(0.8 * 255))
    row, col = np.divmod(frame["id"].to_numpy() - 1, image.shape[1])
    assert inside[row, col].all()
    assert not inside[row - 1, col][row > 0].any(), "a first pixel has no pixel of its region above it"


@pytest.mark.slow
@pytest.mark.parametrize("name", ["tv", "paper"])
def test_a_stopped_run_goes_on(written: Written, tmp_path: Path, name: str) -> None:
    raster, request = written(scene(4)), REQUESTS[name]
    extract_partitions(raster, request, tmp_path / "whole.parquet", side=64)
    outlined: list[Any] = []

    def stopping(function: Any, items: Sequence[Any], progress: Progress | None = None) -> Iterator[Any]:
        for item in items:
            if stage_name(function) == "outline_partition":
                outlined.append(item)
            if len(outlined) == 4:
                raise KeyboardInterrupt
            yield function(item)

    kept = tmp_path / "kept"
    with pytest.raises(KeyboardInterrupt):
        extract_partitions(
            raster, request, tmp_path / "a.parquet", Work(64, stopping, checkpoint=kept), side=64
        )
    assert sorted(file.name for file in tmp_path.iterdir()) == ["kept", "whole.parquet"]
    again: list[tuple[str, int, int]] = []
    work = Work(64, checkpoint=kept, resumed=lambda *stage: again.append(stage))
    extract_partitions(
        raster, replace(request, interval=IntensityRange(0.2, 0.4)), tmp_path / "b.parquet", work
    )
    again.clear()
    extract_partitions(raster, request, tmp_path / "a.parquet", work, side=64)
    [(_, done, total)] = [stage for stage in again if stage[0] == "outline_partition"]
    assert (done, total > 4) == (3, True)
    assert contents(tmp_path / "a.parquet") == contents(tmp_path / "whole.parquet")


@pytest.mark.slow
def test_damaged_components_are_named(written: Written, tmp_path: Path) -> None:
    raster, work = written(scene(4)), Work(checkpoint=tmp_path / "kept")
    extract_partitions(raster, BRIGHT, tmp_path / "a.parquet", work, side=64)
    damaged = max((tmp_path / "kept").rglob("*.within.npz"), key=lambda path: path.stat().st_size)
    damaged.write_bytes(damaged.read_bytes()[:-20])
    with pytest.raises(OutputError, match=f"{damaged.name} is damaged: .*; delete its folder"):
        extract_partitions(raster, BRIGHT, tmp_path / "b.parquet", work, side=64)
    assert not (tmp_path / "b.parquet").exists()


def contents(folder: Path) -> dict[str, bytes]:
    return {file.name: file.read_bytes() for file in folder.iterdir()}


@pytest.mark.slow
def test_bytes_depend_on_neither_tiles_nor_threads(written: Written, tmp_path: Path) -> None:
    raster = written(scene(4))
    for number, work in enumerate((SERIAL, Work(64), Work(128, threads(3), threads(3)))):
        extract_partitions(raster, BRIGHT, tmp_path / f"{number}.parquet", work, side=128)
    first, *others = (contents(tmp_path / f"{number}.parquet") for number in range(3))
    assert len(first) > 2
    assert all(other == first for other in others)


@pytest.mark.slow
def test_a_folder_is_one_data_set(written: Written, tmp_path: Path) -> None:
    path = tmp_path / "regions.parquet"
    extract_partitions(written(scene(4)), BRIGHT, path, side=64)
    table = arrow_dataset.dataset(path)
    assert json.loads(table.schema.metadata[b"uavseg"])["job"] == "extract"
    large = table.to_table(filter=arrow_dataset.field("pixels") > 100, columns=["id"])["id"].to_pylist()
    assert sorted(large) == sorted(geopandas.read_parquet(path).query("pixels > 100")["id"])


def test_no_region_is_an_empty_file_and_a_reason(written: Written, tmp_path: Path) -> None:
    path = tmp_path / "regions.parquet"
    dark = written(np.full((70, 70), 10, np.uint8))
    found, _ = extract_partitions(dark, BRIGHT, path)
    assert found.nothing == extract(dark, BRIGHT).nothing
    assert found.warnings[-1] == found.nothing
    assert len(geopandas.read_parquet(path)) == 0


@pytest.mark.parametrize(
    ("given", "what"),
    [
        ({"fill_holes": Area(5)}, "filled holes"),
        ({"diagonally": True}, "connectivity 8"),
        ({"drawing": Drawing(smooth_m=1)}, "smooth outlines"),
        ({"drawing": Drawing(regularize_m=1)}, "regularized outlines"),
        ({"drawing": Drawing(simplify_m=1)}, "simplified outlines"),
        ({"segment": SegmentParams(refine="none")}, "the refinement none"),
    ],
)
def test_what_needs_all_regions_is_refused(
    written: Written, tmp_path: Path, given: dict[str, Any], what: str
) -> None:
    with pytest.raises(ParameterError, match=f"without {what}; leave it out, or write one file"):
        extract_partitions(written(scene(1)), replace(BRIGHT, **given), tmp_path / "a.parquet")
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_a_folder_is_replaced_when_that_is_asked_for(written: Written, tmp_path: Path) -> None:
    path = tmp_path / "regions.parquet"
    raster, dark = written(scene(4)), written(np.full((70, 70), 10, np.uint8))
    extract_partitions(raster, BRIGHT, path, side=64)
    before = contents(path)
    with pytest.raises(OutputExistsError, match="exists; give --overwrite"):
        extract_partitions(dark, BRIGHT, path)
    assert contents(path) == before
    extract_partitions(dark, BRIGHT, path, overwrite=True)
    assert sorted(contents(path)) == ["part-000000.parquet"]
    assert [file.name for file in tmp_path.iterdir()] == ["regions.parquet"]


def test_a_folder_with_other_files_is_left_alone(written: Written, tmp_path: Path) -> None:
    path = tmp_path / "regions.parquet"
    path.mkdir()
    (path / "notes.txt").write_text("mine")
    with pytest.raises(OutputError, match="contains something else than regions"):
        extract_partitions(written(scene(1)), BRIGHT, path, overwrite=True)
    assert contents(path) == {"notes.txt": b"mine"}


def test_after_an_error_the_folder_is_as_it_was(
    written: Written, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, raster = tmp_path / "regions.parquet", written(scene(4))
    extract_partitions(raster, BRIGHT, path)
    before = contents(path)

    def fail(*_: Any) -> None:
        raise OutputError("the disk is full")

    monkeypatch.setattr("uavseg.jobs.extract.recover", fail)
    with pytest.raises(OutputError, match="the disk is full"):
        extract_partitions(raster, BRIGHT, path, overwrite=True)
    assert contents(path) == before
    assert [file.name for file in tmp_path.iterdir()] == ["regions.parquet"]
