"""A preview shows raster, regions and mission where they are, and never reads the whole raster."""

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
from pyproj import Geod

from uavseg.errors import (
    MissionError,
    OutputError,
    OutputExistsError,
    ParameterError,
    RasterError,
    RegionError,
)
from uavseg.flight import files
from uavseg.flight.mission import Home, Item, Mission
from uavseg.plot import map_furniture
from uavseg.plot.frame import Frame
from uavseg.plot.layers import mission_layer, region_layer
from uavseg.plot.preview import preview
from uavseg.raster.dataset import Dataset
from uavseg.raster.geobox import GeoBox

UTM = rasterio.crs.CRS.from_epsg(32618)
NORTH_UP = Affine(1, 0, 380_000, 0, -1, 4_897_000)


def write(path: Path, pixels: np.ndarray, transform: Affine = NORTH_UP, crs: Any = UTM, **more: Any) -> Path:
    pixels = pixels if pixels.ndim == 3 else pixels[None]
    shape = {"count": pixels.shape[0], "height": pixels.shape[1], "width": pixels.shape[2]}
    with rasterio.open(
        path, "w", driver="GTiff", dtype=pixels.dtype, transform=transform, crs=crs, **shape, **more
    ) as file:
        file.write(pixels)
    return path


def box_of(transform: Affine, top: float, left: float, bottom: float, right: float) -> shapely.Polygon:
    corners = [(left, top), (right, top), (right, bottom), (left, bottom)]
    return shapely.Polygon([transform * corner for corner in corners])


def table(shapes: list[Any], crs: Any = UTM) -> geopandas.GeoDataFrame:
    return geopandas.GeoDataFrame({"id": range(1, len(shapes) + 1)}, geometry=shapes, crs=crs)


def colored(path: Path) -> np.ndarray:
    """Where a picture is not grey."""
    rgb = np.asarray(Image.open(path).convert("RGB")).astype(int)
    return np.ptp(rgb, axis=2) > 40


def middle_of(mask: np.ndarray) -> tuple[float, float]:
    """Mean row and column as shares of the picture."""
    rows, cols = np.nonzero(mask)
    return rows.mean() / mask.shape[0], cols.mean() / mask.shape[1]


def a_mission(lonlats: list[tuple[float, float]]) -> Mission:
    places = tuple(Item(16, 3, (0.0, 0.0, 0.0, None), lat, lon, 50.0) for lon, lat in lonlats)
    home = Home(places[0].lat, places[0].lon)
    return Mission(home, (Item(22, 3, (0.0, 0.0, 0.0, None), 0.0, 0.0, 50.0), *places, Item(20, 2)))


# ---- lengths


@given(st.floats(1e-3, 1e8))
def test_the_scale_bar_is_round_and_takes_a_tenth_to_a_quarter(span: float) -> None:
    length = map_furniture.bar_length(span)
    assert span / 10 * (1 - 1e-9) <= length <= span / 4 * (1 + 1e-9)
    assert f"{length:.6e}"[0] in "125" and set(f"{length:.6e}"[1:8]) <= {".", "0"}


@pytest.mark.parametrize(
    "epsg, x, y, pixel", [(32618, 4e5, 4.9e6, 10), (4326, 12, 60, 1e-4), (3857, 1e6, 8.4e6, 10)]
)
def test_a_unit_across_is_as_long_as_on_the_ellipsoid(epsg: int, x: float, y: float, pixel: float) -> None:
    box = GeoBox((300, 200), Affine(pixel, 0, x, 0, -pixel, y), rasterio.crs.CRS.from_epsg(epsg))
    frame = Frame(box)
    lon, lat = box.lonlat_from_xy(*box.xy_from_pixel(np.array([150, 150]), np.array([100, 101])))
    metres = Geod(ellps="WGS84").inv(lon[0], lat[0], lon[1], lat[1])[2]
    unit = float(np.hypot(*(np.array(frame.pixels * (101, 150)) - frame.pixels * (100, 150))))
    assert frame.metres == pytest.approx(metres / unit, rel=1e-3)


# ---- the sheet


@settings(max_examples=30, deadline=None)
@given(st.floats(-180, 180), st.sampled_from([1, -1]), st.floats(0.01, 100))
def test_there_and_back_degrees_lead_to_the_same_place(angle: float, flip: int, pixel: float) -> None:
    turned = Affine.translation(4e5, 4.9e6) * Affine.rotation(angle) * Affine.scale(pixel, flip * pixel)
    box = GeoBox((50, 80), turned, UTM)
    frame = Frame(box)
    row, col = np.array([0.0, 50, 12, 25]), np.array([0.0, 80, 30, 40])
    lon, lat = box.lonlat_from_xy(*box.xy_from_pixel(row, col))
    expected = [frame.pixels * place for place in zip(col, row, strict=True)]
    assert np.allclose(frame.sheet_from_lonlat(lon, lat), expected, atol=1e-3 * pixel + 1e-5)
    assert np.allclose(frame.pixels * (40, 25), 0, atol=1e-6 * pixel)


def test_units_are_as_long_up_as_across_in_degrees() -> None:
    box = GeoBox((100, 100), Affine(1e-4, 0, 10, 0, -1e-4, 60), rasterio.crs.CRS.from_epsg(4326))
    frame = Frame(box)
    lon, lat = box.lonlat_from_xy(*box.xy_from_pixel(np.array([50, 50, 40]), np.array([50, 60, 50])))
    geod = Geod(ellps="WGS84")
    metres = [geod.inv(lon[0], lat[0], lon[n], lat[n])[2] for n in (1, 2)]
    units = [
        float(np.hypot(*(np.array(frame.pixels * p) - frame.pixels * (50, 50)))) for p in ((60, 50), (50, 40))
    ]
    assert metres[0] / units[0] == pytest.approx(metres[1] / units[1], rel=0.01)


def test_north_is_up_on_a_map_and_down_on_one_of_the_south_pole() -> None:
    assert Frame(GeoBox((9, 9), NORTH_UP, UTM)).north == pytest.approx((0, 1), abs=0.05)
    polar = GeoBox((9, 9), Affine(10, 0, 0, 0, -10, -1e6), rasterio.crs.CRS.from_epsg(3031))
    assert Frame(polar).north == pytest.approx((0, -1), abs=0.01)
    assert Frame(GeoBox((9, 9), Affine.identity(), None)).north is None


# ---- layers


@settings(max_examples=25, deadline=None)
@given(st.lists(st.tuples(st.integers(0, 9), st.integers(0, 9)), min_size=1, max_size=40, unique=True))
def test_squares_of_a_board_differ_from_those_beside_them(places: list[tuple[int, int]]) -> None:
    squares = np.array([shapely.box(x, y, x + 1, y + 1) for x, y in places])
    colors = region_layer.distinct(squares, 0.1, 8)
    own = dict(zip(places, colors, strict=True))
    for (x, y), color in own.items():
        beside = [own.get((x + dx, y + dy)) for dx in (-1, 0, 1) for dy in (-1, 0, 1) if dx or dy]
        assert color not in beside


def test_arrows_point_along_long_legs_only() -> None:
    heads = mission_layer.arrow_heads(np.array([[0.0, 0], [100, 0], [100, 5], [100, 90]]), 20, 4)
    tips, tails = heads[:, 0], heads[:, 1:].mean(axis=1)
    assert np.allclose((tips - tails) / 4, [[1, 0], [0, 1]])
    assert np.allclose(heads[:, 0] * 0.4 + tails * 0.6, [[50, 0], [100, 47.5]])


def test_numbers_keep_apart_and_name_the_first() -> None:
    path = np.column_stack([np.arange(200.0), np.zeros(200)])
    chosen = mission_layer.numbered(path, np.arange(200), 15)
    assert chosen[0] == 1 and np.diff(path[chosen, 0]).min() >= 15


# ---- the picture


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


def test_a_south_up_raster_looks_like_the_same_ground_north_up(tmp_path: Path) -> None:
    pixels = np.zeros((80, 120), np.uint8)
    pixels[:30, :50] = 250
    flipped = Affine(1, 0, 380_000, 0, 1, 4_897_000 - 80)
    north = preview(write(tmp_path / "a.tif", pixels), tmp_path / "a.png", width_px=400)
    south = preview(write(tmp_path / "b.tif", pixels[::-1], flipped), tmp_path / "b.png", width_px=400)
    body = [np.asarray(Image.open(p).convert("L")).astype(int)[70:-30] for p in (north, south)]
    assert np.abs(body[0] - body[1]).mean() < 1


def test_invalid_pixels_are_hatched_paper_and_the_rest_is_grey(tmp_path: Path) -> None:
    pixels = np.full((100, 100), 60, np.uint8)
    pixels[:, :50] = 0
    raster = write(tmp_path / "a.tif", pixels, nodata=0)
    grey = np.asarray(Image.open(preview(raster, tmp_path / "a.png", width_px=400)).convert("L"))
    middle = grey[len(grey) // 2]
    assert (middle[60:180] > 190).all() and (np.abs(middle[230:350].astype(int) - 60) <= 2).all()


@pytest.mark.parametrize("suffix", [".plan", ".waypoints"])
def test_a_mission_is_drawn_where_it_flies(suffix: str, tmp_path: Path) -> None:
    raster = write(tmp_path / "a.tif", np.full((200, 200), 128, np.uint8))
    box = GeoBox((200, 200), NORTH_UP, UTM)
    lon, lat = box.lonlat_from_xy(*box.xy_from_pixel(np.array([20, 30, 60]), np.array([20, 70, 40])))
    flight = tmp_path / f"m{suffix}"
    files.write(a_mission(list(zip(lon.tolist(), lat.tolist(), strict=True))), flight)
    mask = colored(preview(raster, tmp_path / "a.png", mission=flight, width_px=500))
    body = mask[: int(0.8 * len(mask))]  # without the legend
    row, col = middle_of(body)
    assert 0.1 < row < 0.45 and 0.1 < col < 0.4


@pytest.mark.parametrize(
    "transform, crs",
    [
        (Affine.identity(), None),
        (Affine(0.5, 0, 10, 0, -0.5, 90), None),
        (Affine(1e-5, 0, 10, 0, -1e-5, 60), "EPSG:4326"),
        (Affine.translation(4e5, 4.9e6) * Affine.rotation(33) * Affine.scale(0.1, -0.1), "EPSG:32618"),
        (Affine(1e-5, 0, 10, 0, -1e-5, 89.9999), "EPSG:4326"),
    ],
)
@pytest.mark.filterwarnings("ignore::rasterio.errors.NotGeoreferencedWarning")
def test_any_place_gives_a_picture_with_its_region(transform: Affine, crs: Any, tmp_path: Path) -> None:
    raster = write(tmp_path / "a.tif", np.full((60, 90), 128, np.uint8), transform, crs)
    out = preview(raster, tmp_path / "a.png", table([box_of(transform, 5, 5, 55, 85)], crs), width_px=300)
    with Image.open(out) as picture:
        assert picture.size[0] == 300
    assert 0.02 < colored(out).mean() < 0.9


@pytest.mark.parametrize("shape", [(1, 1), (3, 400), (400, 3)])
def test_any_shape_gives_a_picture_one_can_look_at(shape: tuple[int, int], tmp_path: Path) -> None:
    with Image.open(
        preview(write(tmp_path / "a.tif", np.ones(shape, np.uint8)), tmp_path / "a.png")
    ) as drawn:
        size = drawn.size
    assert size[0] == 1400 and 400 < size[1] < 2400


def test_a_large_raster_is_never_read_whole(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    raster = write(tmp_path / "a.tif", np.zeros((3000, 2000), np.uint8), tiled=True, compress="deflate")
    asked = []
    whole = Dataset.read_coarse

    def spy(self: Dataset, max_side: int) -> Any:
        asked.append(max_side)
        return whole(self, max_side)

    def refuse(*_: Any) -> Any:
        raise AssertionError("a full window was read")

    monkeypatch.setattr(Dataset, "read_coarse", spy)
    monkeypatch.setattr(Dataset, "read", refuse)
    preview(raster, tmp_path / "a.png", width_px=300)
    assert len(asked) == 1 and asked[0] < 1000


# ---- what is refused


def test_what_is_wrong_is_said_before_anything_is_written(tmp_path: Path) -> None:
    raster = write(tmp_path / "a.tif", np.ones((20, 20), np.uint8))
    local = write(tmp_path / "local.tif", np.ones((20, 20), np.uint8), Affine(2, 0, 0, 0, -2, 0), None)
    (tmp_path / "there.png").write_text("mine")
    (tmp_path / "no.gpkg").write_text("mine")
    flight = a_mission([(-76.5, 44.2), (-76.5, 44.201)])
    out = tmp_path / "out.png"
    for wrong, arguments in [
        (OutputExistsError, (raster, tmp_path / "there.png")),
        (OutputError, (raster, tmp_path / "out.jpg")),
        (ParameterError, (raster, out, None, None, 20)),
        (RegionError, (raster, out, tmp_path / "missing.geojson")),
        (RegionError, (raster, out, tmp_path / "no.gpkg")),
        (MissionError, (raster, out, None, tmp_path / "missing.plan")),
        (RasterError, (local, out, None, flight)),
    ]:
        with pytest.raises(wrong) as caught:
            preview(*arguments[:4], **({"width_px": arguments[4]} if len(arguments) > 4 else {}))
        assert "\n" not in str(caught.value) and len(str(caught.value)) > 20
        assert not out.exists() and (tmp_path / "there.png").read_text() == "mine"


def test_no_regions_is_a_picture_of_none(tmp_path: Path) -> None:
    raster = write(tmp_path / "a.tif", np.full((40, 60), 128, np.uint8))
    empty = preview(raster, tmp_path / "a.png", table([]), width_px=300)
    point = preview(raster, tmp_path / "b.png", table([shapely.Point(NORTH_UP * (9, 9))]), width_px=300)
    assert not colored(empty).any() and not colored(point).any()
