"""States, levels, leaves and a path lie in a preview where they are, and what is none of them is refused."""

import json
from pathlib import Path
from typing import Any

import geopandas
import numpy as np
import pytest
import rasterio
import shapely
from affine import Affine
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

import uavseg
from uavseg.errors import MapError, MissionError, ParameterError, PathError, RasterError, RegionError
from uavseg.flight import files
from uavseg.flight.along import fly_along
from uavseg.flight.params import PlanParams
from uavseg.occupancy.ros.ros_map import write_ros_map
from uavseg.plot.frame import Frame
from uavseg.plot.layers import leaves_layer, levels_layer, path_layer, states_layer
from uavseg.plot.preview import preview
from uavseg.raster.dataset import Dataset
from uavseg.raster.formats.geotiff import write_geotiff
from uavseg.raster.geobox import GeoBox
from uavseg.raster.intensity.stretch import fit_stretch
from uavseg.raster.tile_pass import TilePass
from uavseg.segmentation import in_memory
from uavseg.segmentation.blocks.block_file import Origin, SavedBlocks, write_block_map
from uavseg.segmentation.blocks.block_map import find_leaves
from uavseg.segmentation.params import DivisionParams

UTM = rasterio.crs.CRS.from_epsg(32618)
BOX = GeoBox((128, 192), Affine(0.5, 0, 4e5, 0, -0.5, 5e6), UTM)
LOCAL = GeoBox((128, 192), Affine(0.5, 0, 0, 0, -0.5, 64), None)
MOST = 1000


def write(path: Path, values: np.ndarray, box: GeoBox = BOX, **how: Any) -> Path:
    write_geotiff(path, [values], box, overwrite=True, **how)
    return path


def states() -> np.ndarray:
    """Free left, unknown in the middle, occupied right, nothing below."""
    found = np.zeros((128, 192), np.uint8)
    found[:96] = np.repeat([1, 2, 3], 64)
    return found


def beliefs() -> np.ndarray:
    return np.array([0.5, 0.1, 0.5, 0.9], np.float32)[states()]


def rgb(path: Path) -> np.ndarray:
    return np.asarray(Image.open(path).convert("RGB")).astype(int)


def of_raster(path: Path, row: float, col: float) -> np.ndarray:
    """The colour of a picture of a 128 x 192 raster at a share of its rows and columns."""
    picture = rgb(path)
    page, height = picture.shape[1] / 9.0, picture.shape[0]  # pixels per inch
    width = page * (9.0 - 0.3)
    side = width / 1.04  # the raster is framed by 2 % of its longer side
    left, top = page * 0.15 + 0.02 * side, height - page * 0.34 - (128 / 192 + 0.02) * side
    return picture[round(top + row * side * 128 / 192), round(left + col * side)]


# ---- states


def test_states_have_their_colours_and_nothing_stays_grey(tmp_path: Path) -> None:
    grey = write(tmp_path / "map.tif", np.full((128, 192), 0.5, np.float32))
    out = preview(
        grey, tmp_path / "a.png", states=write(tmp_path / "s.tif", states(), nodata=0), width_px=600
    )
    free, unknown, occupied, nothing = (
        of_raster(out, *place) for place in ((0.3, 0.15), (0.3, 0.5), (0.3, 0.85), (0.85, 0.5))
    )
    assert free.argmax() == 1 and np.ptp(free) > 30
    assert occupied.argmax() == 0 and np.ptp(occupied) > 60
    assert np.ptp(unknown) < 12 and np.ptp(nothing) == 0
    assert (np.abs(nothing - 127) <= 1).all()  # 0.5 is never stretched
    line = rgb(out)[:, : rgb(out).shape[1] // 2]
    assert ((line == 255).all(axis=2).sum(axis=0) > 0.4 * len(line)).any()  # contours are white


def test_a_ros_map_of_states_is_drawn_like_the_raster(tmp_path: Path) -> None:
    whole = np.where(states() == 0, 2, states())
    raster = write(tmp_path / "map.tif", beliefs(), LOCAL)
    write_ros_map(tmp_path / "s.yaml", whole, LOCAL)
    write(tmp_path / "s.tif", whole, LOCAL)
    drawn = [preview(raster, tmp_path / f"{s[2:]}.png", states=tmp_path / s) for s in ("s.tif", "s.yaml")]
    assert np.array_equal(rgb(drawn[0]), rgb(drawn[1]))
    preview(tmp_path / "s.yaml", tmp_path / "ros.png")  # and is a raster itself
    assert of_raster(tmp_path / "ros.png", 0.3, 0.85).min() > 240


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32))
def test_contours_are_as_long_as_the_edges_of_segments(seed: int) -> None:
    field = np.random.default_rng(seed).integers(0, 4, (9, 14)).astype(np.uint8)
    box = GeoBox(field.shape, Affine(2, 0, 30, 0, -2, 70), None)
    layer = states_layer.StatesLayer.of(Dataset.of_values(field, box, "states"), Frame(box), MOST)
    framed = np.pad(field, 1)
    edges = sum(
        int(((one != other) * ((one > 0).astype(int) + (other > 0))).sum())
        for one, other in ((framed[1:], framed[:-1]), (framed[:, 1:], framed[:, :-1]))
    )
    assert sum(np.hypot(*np.diff(line, axis=0).T).sum() for line in layer.contours) == pytest.approx(
        2 * edges
    )
    assert np.array_equal(layer.states, field)


# ---- leaves


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32), st.integers(1, 150), st.integers(1, 150))
def test_leaves_tile_the_raster(seed: int, rows: int, cols: int) -> None:
    rng = np.random.default_rng(seed)
    blocks = in_memory.block_map_of_array(rng.choice([100, 60000], (rows, cols)).astype(np.uint16))
    blocks.ratios[:] = rng.choice([0.0, 2.0], blocks.ratios.shape)
    side, _ = find_leaves(blocks, DivisionParams(1.2, np.inf))
    cells = -(-rows // 8), -(-cols // 8)
    corners, sides = leaves_layer.squares_of(side[: cells[0], : cells[1]].astype(np.int64), (rows, cols))
    painted = np.zeros((rows, cols), int)
    for corner, own in zip(corners, sides, strict=True):
        (top, left), (bottom, right) = corner[0], corner[2]
        painted[top:bottom, left:right] += own
    assert np.array_equal(painted, side.repeat(8, 0).repeat(8, 1)[:rows, :cols])


def saved_blocks(path: Path, values: np.ndarray, box: GeoBox = BOX) -> Path:
    blocks = in_memory.block_map_of_array((values * 65535).astype(np.uint16))
    stretch = fit_stretch(Dataset.of_values(values, box, "map"), "none", TilePass([]))
    write_block_map(
        path,
        SavedBlocks(blocks, box, stretch, "band 1", Origin(("map.tif",), ".")),
        DivisionParams(1.2, np.inf),
        True,
    )
    return path


def test_leaves_are_outlined_where_they_lie(tmp_path: Path) -> None:
    values = np.full((128, 192), 0.5, np.float32)
    values[:20, :20] = 0.9
    raster, blocks = write(tmp_path / "a.tif", values), saved_blocks(tmp_path / "b.tif", values)
    layer = leaves_layer.LeavesLayer.of(blocks, Frame(BOX), MOST)
    assert (layer.sides < 64).sum() > 3 and (layer.sides == 64).sum() == 5
    small = layer.corners[layer.sides < 64]
    assert small[..., 0].max() == pytest.approx(-48 + 32) and small[..., 1].min() == pytest.approx(32 - 32)
    plain, lined = (preview(raster, tmp_path / f"{n}.png", leaves=b) for n, b in enumerate((None, blocks)))
    changed = (rgb(plain) != rgb(lined)).any(axis=2)
    assert changed.any()


def test_leaves_of_another_raster_or_of_none_are_refused(tmp_path: Path) -> None:
    values = np.full((128, 192), 0.5, np.float32)
    raster = write(tmp_path / "a.tif", values)
    shifted = GeoBox(BOX.shape, Affine(0.5, 0, 4e5 + 8, 0, -0.5, 5e6), UTM)
    half = GeoBox((64, 192), BOX.transform, UTM)
    two = tmp_path / "two.tif"
    write_geotiff(two, [values[:16, :24], values[:16, :24]], BOX.coarsen(8))
    for wrong, error, told in (
        (saved_blocks(tmp_path / "b.tif", values, shifted), RasterError, "of this raster"),
        (saved_blocks(tmp_path / "c.tif", values, LOCAL), RasterError, "coordinate system"),
        (saved_blocks(tmp_path / "d.tif", values[:64], half), RasterError, "of this raster"),
        (two, RasterError, "not a block map"),
        (raster, ParameterError, "band 2"),
    ):
        with pytest.raises(error, match=told):
            preview(raster, tmp_path / "out.png", leaves=wrong)
        assert not (tmp_path / "out.png").exists()
    with pytest.raises(ParameterError, match="too small to be seen"):
        leaves_layer.LeavesLayer.of(tmp_path / "b.tif", Frame(BOX), 20)


# ---- levels


def segments(crs: Any = UTM, **columns: Any) -> geopandas.GeoDataFrame:
    left = shapely.box(4e5, 5e6 - 64, 4e5 + 48, 5e6)
    right = shapely.box(4e5 + 48, 5e6 - 64, 4e5 + 96, 5e6)
    return geopandas.GeoDataFrame(columns, geometry=[left, right], crs=crs)


def test_levels_are_as_grey_as_their_interval(tmp_path: Path) -> None:
    raster = write(tmp_path / "a.tif", np.full((128, 192), 7, np.uint8))
    table = segments(level=[1, 3], range_low=[0.0, 0.6], range_high=[0.3, 0.9])
    table.to_file(tmp_path / "levels.gpkg")
    table.to_parquet(tmp_path / "levels.parquet")
    for given_ in (table, tmp_path / "levels.gpkg", tmp_path / "levels.parquet"):
        out = preview(raster, tmp_path / "a.png", levels=given_, overwrite=True)
        dark, light = of_raster(out, 0.3, 0.25), of_raster(out, 0.3, 0.75)
        assert (np.abs(dark - 0.15 * 255) < 2).all() and (np.abs(light - 0.75 * 255) < 2).all()


def test_levels_without_intervals_are_spread_evenly() -> None:
    assert levels_layer.LevelsLayer.of(segments(level=[1, 2]), Frame(BOX)).greys.tolist() == [0, 1]
    assert levels_layer.LevelsLayer.of(segments(level=[0, 0]), Frame(BOX)).greys.tolist() == [0, 0]
    with pytest.raises(RegionError, match="no column level"):
        levels_layer.LevelsLayer.of(segments(id=[1, 2]), Frame(BOX))


# ---- paths


def a_way(box: GeoBox) -> Any:
    (x, x2), (y, y2) = box.xy_from_pixel(np.array([20.5, 90.5]), np.array([10.5, 60.5]))
    dataset = Dataset.of_values(np.where(states() == 0, 0.1, beliefs()).astype(np.float32), box, "map")
    return uavseg.path(dataset, (0, 0.45), (x, y), (x2, y2))


@pytest.mark.parametrize("box", [BOX, LOCAL], ids=["on the globe", "local"])
def test_a_path_of_a_file_lies_where_the_way_lies(box: GeoBox, tmp_path: Path) -> None:
    from uavseg.occupancy.paths.path_geojson import geojson

    way, frame = a_way(box), Frame(box)
    (tmp_path / "path.geojson").write_text(geojson(way))
    [here] = path_layer.PathLayer.of(way, frame).lines
    layer = path_layer.PathLayer.of(tmp_path / "path.geojson", frame)
    assert np.allclose(layer.lines[0], here, atol=0.01) and layer.length_m == pytest.approx(way.length_m)
    assert np.allclose(here[0], frame.sheet_from_xy([box.xy_from_pixel(20.5, 10.5)])[0])


@pytest.mark.parametrize("suffix", [".plan", ".waypoints"])
def test_a_path_may_be_a_mission(suffix: str, tmp_path: Path) -> None:
    from uavseg.occupancy.paths.path_geojson import lonlat

    way, frame = a_way(BOX), Frame(BOX)
    lon, lat = lonlat(way)
    mission = fly_along(lon, lat, PlanParams(10.0, speed_m_s=3.0), (float(lat[0]), float(lon[0]), 0.0))
    files.write(mission, tmp_path / f"path{suffix}")
    [line] = path_layer.PathLayer.of(tmp_path / f"path{suffix}", frame).lines
    assert np.allclose(line, path_layer.PathLayer.of(way, frame).lines[0], atol=0.05)


def test_a_path_is_white_on_free_ground_with_its_ends_in_colour(tmp_path: Path) -> None:
    raster = write(tmp_path / "a.tif", beliefs())
    plain, drawn = (preview(raster, tmp_path / f"{n}.png", path=p) for n, p in enumerate((None, a_way(BOX))))
    picture = rgb(drawn)[: int(0.85 * len(rgb(drawn)))]
    assert (np.ptp(picture, axis=2) > 60).sum() > 50
    assert rgb(plain).shape == rgb(drawn).shape


def test_what_is_no_path_is_refused(tmp_path: Path) -> None:
    frame = Frame(BOX)
    point = {"type": "Feature", "properties": {}, "geometry": {"type": "Point", "coordinates": [1, 2]}}
    line = {"type": "LineString", "coordinates": [[4e5, 5e6], [4e5, 5e6 - 9]]}
    for text in ("", "{}", "[]", json.dumps({"features": []}), json.dumps({"features": [point]})):
        (tmp_path / "no.geojson").write_text(text)
        with pytest.raises(PathError, match="no line of a path"):
            path_layer.PathLayer.of(tmp_path / "no.geojson", frame)
    (tmp_path / "local.geojson").write_text(json.dumps({"features": [{"properties": {}, "geometry": line}]}))
    with pytest.raises(PathError, match="local coordinates"):
        path_layer.PathLayer.of(tmp_path / "local.geojson", frame)
    with pytest.raises(PathError, match="cannot be read"):
        path_layer.PathLayer.of(tmp_path / "missing.geojson", frame)
    with pytest.raises(MissionError):
        path_layer.PathLayer.of(tmp_path / "missing.plan", frame)


def test_what_holds_no_states_is_refused(tmp_path: Path) -> None:
    raster = write(tmp_path / "a.tif", beliefs())
    for wrong, error in (
        (write(tmp_path / "b.tif", np.full((128, 192), 4, np.uint8)), MapError),
        (raster, MapError),
        (write(tmp_path / "c.tif", states(), LOCAL), RasterError),
    ):
        with pytest.raises(error):
            preview(raster, tmp_path / "out.png", states=wrong)
        assert not (tmp_path / "out.png").exists()


def test_layers_of_a_large_raster_are_never_read_whole(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    large = GeoBox((3000, 2000), BOX.transform, UTM)
    raster = write(tmp_path / "a.tif", np.zeros(large.shape, np.uint8), large)
    many = write(tmp_path / "s.tif", np.ones(large.shape, np.uint8), large, nodata=0)
    asked = []
    whole = Dataset.read_coarse

    def spy(self: Dataset, max_side: int) -> Any:
        asked.append(max_side)
        return whole(self, max_side)

    def refuse(*_: Any) -> Any:
        raise AssertionError("a full window was read")

    monkeypatch.setattr(Dataset, "read_coarse", spy)
    monkeypatch.setattr(Dataset, "read", refuse)
    preview(raster, tmp_path / "a.png", states=many, width_px=300)
    assert len(asked) == 2 and max(asked) < 1000
