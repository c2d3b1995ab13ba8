"""Layer of regions: drawn in their position, neighbours in different colours."""

from pathlib import Path

import numpy as np
import pytest
import shapely
from hypothesis import given, settings, strategies as st

from tests.plot.pictures import NORTH_UP, UTM, box_of, colored, middle_of, table, write
from uavseg.errors import UavsegError
from uavseg.plot.layers import region_layer
from uavseg.plot.preview import preview


@settings(max_examples=25)
@given(st.lists(st.tuples(st.integers(0, 9), st.integers(0, 9)), min_size=1, max_size=40, unique=True))
def test_squares_of_a_board_differ_from_those_beside_them(places: list[tuple[int, int]]) -> None:
    squares = np.array([shapely.box(x, y, x + 1, y + 1) for x, y in places])
    colors = region_layer.assign_colors(squares, 0.1, 8)
    own = dict(zip(places, colors, strict=True))
    for (x, y), color in own.items():
        beside = [own.get((x + dx, y + dy)) for dx in (-1, 0, 1) for dy in (-1, 0, 1) if dx or dy]
        assert color not in beside


def test_a_region_is_coloured_where_it_lies(tmp_path: Path) -> None:
    raster = write(tmp_path / "a.tif", np.full((200, 300), 128, np.uint8))
    for name, place in {"upper left": (20, 30, 60, 90), "lower right": (140, 210, 180, 270)}.items():
        out = preview(raster, tmp_path / f"{name}.png", table([box_of(NORTH_UP, *place)]), width_px=500)
        row, col = middle_of(colored(out))
        assert (row < 0.45, col < 0.45) == (name == "upper left",) * 2


def test_a_hole_stays_grey(tmp_path: Path) -> None:
    raster = write(tmp_path / "a.tif", np.full((200, 200), 128, np.uint8))
    ring = box_of(NORTH_UP, 20, 20, 180, 180) - box_of(NORTH_UP, 80, 80, 160, 160)
    mask = colored(preview(raster, tmp_path / "a.png", table([ring]), width_px=500))
    rows, cols = np.nonzero(mask)
    row, col = (rows.min() + rows.max()) // 2 + 15, (cols.min() + cols.max()) // 2 + 15
    assert not mask[row - 40 : row + 40, col - 40 : col + 40].any()


@pytest.mark.parametrize("suffix", [".geojson", ".gpkg", ".parquet"])
def test_regions_of_a_file_look_like_regions_in_memory(suffix: str, tmp_path: Path) -> None:
    raster = write(tmp_path / "a.tif", np.full((100, 100), 90, np.uint8))
    regions = table([box_of(NORTH_UP, 10, 10, 50, 60), box_of(NORTH_UP, 70, 20, 90, 90)])
    path = tmp_path / f"r{suffix}"
    if suffix == ".parquet":
        regions.to_parquet(path)
    else:
        regions.to_crs(4326 if suffix == ".geojson" else UTM).to_file(path)
    drawn = [preview(raster, tmp_path / f"{n}.png", r, width_px=400) for n, r in enumerate((regions, path))]
    assert (colored(drawn[0]) != colored(drawn[1])).mean() < 0.002


def test_without_regions_the_picture_has_no_colour(tmp_path: Path) -> None:
    raster = write(tmp_path / "a.tif", np.full((40, 60), 128, np.uint8))
    empty = preview(raster, tmp_path / "a.png", table([]), width_px=300)
    point = preview(raster, tmp_path / "b.png", table([shapely.Point(NORTH_UP * (9, 9))]), width_px=300)
    assert not colored(empty).any() and not colored(point).any()


def test_a_collapsed_hole_and_a_collection_are_drawn(tmp_path: Path) -> None:
    outer, hole = box_of(NORTH_UP, 20, 20, 90, 90), [NORTH_UP * at for at in ((30, 30), (60, 60), (30, 30))]
    spike = shapely.Polygon(outer.exterior.coords, [[*hole[:2], *hole[:1], *hole[:1]]])
    assert not shapely.is_valid(spike)
    inner = shapely.GeometryCollection([box_of(NORTH_UP, 100, 100, 180, 180)])
    nested = shapely.GeometryCollection([inner, shapely.Point(NORTH_UP * (5, 5))])
    raster = write(tmp_path / "a.tif", np.full((200, 200), 128, np.uint8))
    for name, shape in {"spike": spike, "nested": nested}.items():
        assert colored(preview(raster, tmp_path / f"{name}.png", table([shape]), width_px=400)).any()


def test_control_characters_in_an_id_are_drawn_escaped(
    tmp_path: Path, recwarn: pytest.WarningsRecorder
) -> None:
    raster = write(tmp_path / "a.tif", np.full((200, 200), 128, np.uint8))
    regions = table([box_of(NORTH_UP, 20, 20, 180, 180)])
    regions["id"] = ["\x01a\x1b[31m"]
    preview(raster, tmp_path / "a.png", regions, width_px=400)
    assert not [str(one.message) for one in recwarn if "Glyph" in str(one.message)]


@pytest.mark.parametrize("layer", ["regions", "levels", "path", "mission", "states"])
@pytest.mark.parametrize("value", [3, np.zeros(3)], ids=["number", "array"])
def test_a_layer_of_another_type_is_refused(tmp_path: Path, layer: str, value: object) -> None:
    raster = write(tmp_path / "a.tif", np.full((40, 60), 128, np.uint8))
    with pytest.raises(UavsegError, match=r"to draw (is|are) a file"):
        preview(raster, tmp_path / "a.png", **{layer: value}, width_px=300)


def test_regions_whose_ids_are_lists_or_missing_are_numbered(tmp_path: Path) -> None:
    raster = write(tmp_path / "a.tif", np.full((200, 200), 128, np.uint8))
    regions = [box_of(NORTH_UP, 20, 20, 60, 60), box_of(NORTH_UP, 100, 100, 180, 180)]
    plain = preview(raster, tmp_path / "plain.png", table(regions), width_px=500).read_bytes()
    for name, ids in {"lists": [np.array([7, 8]), np.array([9])], "missing": [7, None]}.items():
        odd = table(regions)
        odd["id"] = np.array([*ids, None], object)[:2]
        assert preview(raster, tmp_path / f"{name}.png", odd, width_px=500).read_bytes() == plain
