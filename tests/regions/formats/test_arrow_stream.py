"""Regions as an Arrow stream: what pyarrow reads of it is what the regions hold, and all is released."""

import gc
import math
from pathlib import Path

import numpy as np
import pyarrow
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from pyproj import CRS

from uavseg.regions import shapes
from uavseg.regions.formats import arrow_stream
from uavseg.regions.formats.arrow_stream import RegionStream
from uavseg.regions.formats.export import write_regions
from uavseg.regions.table import Regions

TEXTS = st.none() | st.text(st.characters(codec="utf-8"), max_size=8)
ROWS = st.lists(
    st.tuples(st.integers(-(2**63), 2**63 - 1), st.floats(allow_infinity=True), TEXTS), max_size=40
)


def regions_of(rows: list[tuple[int, float, str | None]]) -> Regions:
    texts = np.empty(len(rows), object)
    texts[:] = [text for _, _, text in rows]
    columns = {
        "id": np.array([number for number, _, _ in rows], np.int64),
        "v_mean": np.array([value for _, value, _ in rows], np.float64),
        "class": texts,
    }
    polygons = np.array([shapely.box(k, 0, k + 1, 1 + k) for k in range(len(rows))], object)
    return Regions(columns, polygons, CRS(32632).to_wkt())


@given(rows=ROWS, promote=st.booleans(), size=st.integers(1, 50))
def test_pyarrow_reads_what_the_regions_hold(
    rows: list[tuple[int, float, str | None]], promote: bool, size: int
) -> None:
    regions = regions_of(rows)
    with pytest.MonkeyPatch.context() as patch:
        parts = [slice(k, k + size) for k in range(0, len(rows), size)]
        patch.setattr(shapes, "batch_slices", lambda polygons: iter(parts))
        stream = RegionStream(regions, promote)
        table = pyarrow.RecordBatchReader.from_stream(stream).read_all()
    assert table.schema.types == [pyarrow.int64(), pyarrow.float64(), pyarrow.string(), pyarrow.binary()]
    assert table.column_names == ["id", "v_mean", "class", "geometry"]
    table.validate(full=True)
    assert table["id"].to_pylist() == [number for number, _, _ in rows]
    assert table["v_mean"].to_pylist() == [None if math.isnan(value) else value for _, value, _ in rows]
    assert table["class"].to_pylist() == [text for _, _, text in rows]
    read = shapely.from_wkb(table["geometry"].to_pylist())
    assert shapely.equals(read, regions.polygons).all()
    assert {shape.geom_type for shape in read} <= {"MultiPolygon" if promote else "Polygon"}


def test_everything_is_released_when_the_reader_is_done() -> None:
    before = len(arrow_stream._kept)
    stream = RegionStream(regions_of([(1, 2.0, "a"), (2, math.nan, None)]))
    table = pyarrow.RecordBatchReader.from_stream(stream).read_all()
    assert len(arrow_stream._kept) > before
    assert table.num_rows == 2
    del table
    gc.collect()
    assert len(arrow_stream._kept) == before


@pytest.mark.parametrize("error", [KeyboardInterrupt(), MemoryError(), ValueError("broken")])
def test_what_stops_the_stream_is_kept_for_whoever_made_it(
    error: BaseException, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def stopping(polygons: object) -> slice:
        raise error

    monkeypatch.setattr(shapes, "batch_slices", stopping)
    stream = RegionStream(regions_of([(1, 2.0, "a")]))
    assert pyarrow.RecordBatchReader.from_stream(stream).read_all().num_rows == 0
    assert stream.stopped == [error]
    with pytest.raises(type(error)):
        write_regions(regions_of([(1, 2.0, "a")]), tmp_path / "out.gpkg")
    assert list(tmp_path.iterdir()) == []
