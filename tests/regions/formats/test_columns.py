"""Columns of GeoParquet and FlatGeobuf: what their readers read is what the regions hold."""

import math

import numpy as np
import pyarrow.parquet
import pyogrio
import pytest
import shapely
from hypothesis import given, strategies as st
from pyproj import CRS

from uavseg.regions.formats import export
from uavseg.regions.formats.export import write_regions
from uavseg.regions.table import Regions

TEXTS = st.none() | st.text(st.characters(codec="utf-8", exclude_characters="\0"), max_size=8)
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


@pytest.mark.slow
@given(rows=ROWS, size=st.integers(1, 50))
def test_pyarrow_reads_what_the_regions_hold(
    tmp_path_factory: pytest.TempPathFactory, rows: list[tuple[int, float, str | None]], size: int
) -> None:
    path, regions = tmp_path_factory.mktemp("a") / "a.parquet", regions_of(rows)
    with pytest.MonkeyPatch.context() as patch:
        parts = [slice(k, k + size) for k in range(0, len(rows), size)]
        patch.setattr(export, "batch_slices", lambda polygons: iter(parts))
        write_regions(regions, path)
    table = pyarrow.parquet.read_table(path)
    assert table.schema.types == [pyarrow.int64(), pyarrow.float64(), pyarrow.string(), pyarrow.binary()]
    assert table.column_names == ["id", "v_mean", "class", "geometry"]
    table.validate(full=True)
    assert table["id"].to_pylist() == [number for number, _, _ in rows]
    assert table["v_mean"].to_pylist() == [None if math.isnan(value) else value for _, value, _ in rows]
    assert table["class"].to_pylist() == [text for _, _, text in rows]
    assert shapely.equals(shapely.from_wkb(table["geometry"].to_pylist()), regions.polygons).all()


@pytest.mark.slow
@given(rows=ROWS)
def test_pyogrio_reads_what_the_regions_hold(
    tmp_path_factory: pytest.TempPathFactory, rows: list[tuple[int, float, str | None]]
) -> None:
    path, regions = tmp_path_factory.mktemp("a") / "a.fgb", regions_of(rows)
    write_regions(regions, path)
    _, _, geometry, columns = pyogrio.raw.read(path)
    read = zip(*(column.tolist() for column in columns), geometry, strict=True)
    written = [(*row, shape) for row, shape in zip(rows, shapely.to_wkb(regions.polygons), strict=True)]
    assert sorted(map(repr, read)) == sorted(map(repr, written))
