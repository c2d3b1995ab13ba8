"""Photographs drawn on the ground agree with the raster that they were drawn from."""

import math
import warnings
from copy import copy
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
from affine import Affine
from hypothesis import given, settings, strategies as st
from pyproj import Transformer
from rasterio.warp import Resampling, reproject
from scipy.interpolate import RectBivariateSpline
from scipy.ndimage import binary_erosion, gaussian_filter, map_coordinates
from skimage.registration import phase_cross_correlation

from tests.photographs.make import ground_lonlat
from uavseg.errors import PhotographError
from uavseg.execution.executors import threads
from uavseg.photographs.ground import Ground
from uavseg.photographs.orthophoto import TILE, Mosaic, View, _between, likely_error_m
from uavseg.photographs.read import Photograph
from uavseg.raster.elevation.dem import Dem
from uavseg.raster.geodesy.globe import WGS84, transform_between, utm_crs
from uavseg.raster.grid.tiling import Window

PLACE = 47.05, 8.31  # latitude and longitude of the middle of the scene
SIDE = 1500  # pixels of the scene
PIXEL_M = 0.2
IMAGE, FOCAL = (480, 360), 400.0
Array = np.ndarray[Any, Any]


def write(
    path: Path, bands: Array, place: tuple[float, float], pixel_m: float, epsg: int | None = None
) -> Path:
    """Write a raster around a place, in its UTM zone."""
    lat, lon = place
    epsg = epsg or (32600 if lat >= 0 else 32700) + int((lon + 180) // 6) + 1
    x, y = Transformer.from_crs(4326, epsg, always_xy=True).transform(lon, lat)
    count, rows, cols = bands.shape
    transform = Affine(pixel_m, 0, x - cols * pixel_m / 2, 0, -pixel_m, y + rows * pixel_m / 2)
    profile = {"count": count, "height": rows, "width": cols, "dtype": bands.dtype.name}
    with rasterio.open(path, "w", "GTiff", crs=f"EPSG:{epsg}", transform=transform, **profile) as file:
        file.write(bands)
    return path


def texture(bands: int = 1, seed: int = 1, side: int = SIDE) -> Array:
    """Smooth noise that a photograph can show: structures of some pixels of the photograph."""
    noise = np.random.default_rng(seed).normal(size=(bands, side, side))
    smooth = np.stack([gaussian_filter(band, 5) for band in noise])
    return np.clip(128 + 45 * smooth / smooth.std(), 0, 255).astype(np.uint8)


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write(tmp_path_factory.mktemp("scene") / "scene.tif", texture(), PLACE, PIXEL_M)


@pytest.fixture(scope="module")
def slope(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A hillside that rises by a fifth to the east, with waves."""
    row, col = np.mgrid[:400, :400] * 2.0
    heights = 500 + 0.2 * (col - 400) + 4 * np.sin(row / 60)
    return write(tmp_path_factory.mktemp("slope") / "dem.tif", heights[None].astype("f4"), PLACE, 2.0)


def photograph(path: Path, **pose: Any) -> Photograph:
    given = {"lat": PLACE[0], "lon": PLACE[1], "relative_m": 60.0, "yaw_deg": 30.0} | pose
    return Photograph(path=str(path), **{"image_px": IMAGE, "focal_px": FOCAL} | given)


def draw(one: Photograph, scene: Path, dtype: Any = None, dem: Path | None = None) -> None:
    """Draw a photograph from a raster; marched to the ground at every twentieth pixel."""
    cols, rows = one.image_px
    across, down = np.linspace(0, cols, cols // 20 + 1), np.linspace(0, rows, rows // 20 + 1)
    nodes = np.stack(np.meshgrid(across, down), axis=-1).reshape(-1, 2)
    lon, lat = ground_lonlat(one, nodes, dem, 200)
    lon = one.lon + (lon - one.lon + 180) % 360 - 180
    at = np.arange(rows) + 0.5, np.arange(cols) + 0.5
    places = [
        RectBivariateSpline(down, across, values.reshape(len(down), -1))(*at).ravel() for values in (lon, lat)
    ]
    with rasterio.open(scene) as source:
        to_xy = Transformer.from_crs("EPSG:4326", source.crs, always_xy=True)
        col, row = ~source.transform * to_xy.transform(*places)
        bands = source.read()
    values = [map_coordinates(band.astype(float), [row - 0.5, col - 0.5], order=1) for band in bands]
    pixels = np.rint(values).astype(dtype or bands.dtype).reshape(-1, rows, cols)
    profile = {"count": len(pixels), "height": rows, "width": cols, "dtype": pixels.dtype.name}
    with warnings.catch_warnings(action="ignore"), rasterio.open(one.path, "w", "GTiff", **profile) as file:
        file.write(pixels)


def drawn(mosaic: Mosaic, **how: Any) -> Array:
    return np.concatenate([strip for _, strip in mosaic.strips(**how)], axis=1)


def expected(scene: Path, mosaic: Mosaic) -> Array:
    """The scene on the grid of a mosaic, by GDAL."""
    with rasterio.open(scene) as source:
        result = np.zeros((source.count, *mosaic.geobox.shape), np.float32)
        reproject(
            rasterio.band(source, list(source.indexes)),
            result,
            dst_transform=mosaic.geobox.transform,
            dst_crs=mosaic.geobox.crs,
            resampling=Resampling.bilinear,
        )
    return result


def shifts_px(ours: Array, theirs: Array, valid: Array, side: int = 48) -> Array:
    """Distances by which patches that are drawn as a whole are apart."""
    found = []
    for row in range(0, valid.shape[0] - side, side):
        for col in range(0, valid.shape[1] - side, side):
            patch = slice(row, row + side), slice(col, col + side)
            if valid[patch].all() and len(found) < 40:
                shift, *_ = phase_cross_correlation(theirs[patch], ours[patch], upsample_factor=10)
                found.append(math.hypot(*shift))
    return np.array(found)


def assert_agrees(mosaic: Mosaic, scene: Path, patches: int = 12, median_px: float = 0.5) -> Array:
    pixels = drawn(mosaic)
    theirs, valid = expected(scene, mosaic), pixels[-1] > 0
    shifts = shifts_px(pixels[0].astype(float), theirs[0], valid)
    assert len(shifts) >= patches, len(shifts)
    assert np.median(shifts) < median_px, np.median(shifts)
    assert np.quantile(shifts, 0.9) < 2 * median_px
    assert np.corrcoef(pixels[0][valid], theirs[0][valid])[0, 1] > 0.9
    return pixels


POSES: list[dict[str, Any]] = [
    {},
    {"yaw_deg": -140.0, "pitch_deg": -90.0},
    {"pitch_deg": -60.0},
    {"pitch_deg": -70.0, "roll_deg": 12.0, "yaw_deg": 200.0},
    {"pitch_deg": -50.0, "yaw_deg": 300.0},
]


@pytest.mark.parametrize("pose", POSES)
def test_on_flat_ground(pose: dict[str, Any], scene: Path, tmp_path: Path) -> None:
    one = photograph(tmp_path / "a.tif", **pose)
    draw(one, scene)
    assert_agrees(Mosaic([one], Ground()), scene)


@pytest.mark.slow
@pytest.mark.parametrize("pose", POSES[1:4])
def test_over_a_slope(pose: dict[str, Any], scene: Path, slope: Path, tmp_path: Path) -> None:
    one = photograph(tmp_path / "a.tif", **pose | {"relative_m": None, "altitude_m": 560.0})
    draw(one, scene, dem=slope)
    assert_agrees(Mosaic([one], Ground(Dem.open(slope))), scene)


def test_a_pixel_is_where_the_ground_is_exactly(tmp_path: Path) -> None:
    # Within a tile places are interpolated from its corners: compared with the projection of each pixel.
    one = photograph(
        tmp_path / "a.tif", pitch_deg=-55.0, roll_deg=8.0, image_px=(5472, 3648), focal_px=3666.0
    )
    view = View(one, Ground(), transform_between(WGS84, utm_crs(*PLACE).to_wkt()))
    side = view.gsd_m
    x = (view.bounds[0] + view.bounds[2]) / 2 + side * (np.arange(TILE) + 0.5)
    y = (view.bounds[1] + view.bounds[3]) / 2 - side * (np.arange(TILE) + 0.5)
    lon, lat = transform_between(utm_crs(*PLACE).to_wkt(), WGS84)(*map(np.ravel, np.meshgrid(x, y)))
    east, north = view.plane.xy_from_lonlat(lon, lat)
    exact = one.pixels(np.stack([east, north, np.full(len(east), -view.height_m)]))
    left, right = x[0] - side / 2, x[-1] + side / 2
    top, bottom = y[0] + side / 2, y[-1] - side / 2
    corners = transform_between(utm_crs(*PLACE).to_wkt(), WGS84)(
        np.array([left, right, left, right]), np.array([top, top, bottom, bottom])
    )
    interpolated = [_between(found, (TILE, TILE)) for found in view.plane.xy_from_lonlat(*corners)]
    places, drawn = view.places(np.stack([*interpolated, np.full(TILE * TILE, -view.height_m)]), None)
    assert drawn.all()
    assert np.abs(places - exact).max() < 0.01


@pytest.mark.parametrize(
    "place", [(-33.9, 18.4), (-16.8, 179.9999), (-16.8, -179.9999), (65.0, -23.0)], ids=str
)
def test_in_other_places(place: tuple[float, float], tmp_path: Path) -> None:
    scene = write(tmp_path / "scene.tif", texture(side=700), place, PIXEL_M)
    one = photograph(tmp_path / "a.tif", lat=place[0], lon=place[1], pitch_deg=-75.0)
    draw(one, scene)
    mosaic = Mosaic([one], Ground())
    assert str(mosaic.geobox.crs) == str(rasterio.open(scene).crs)
    assert_agrees(mosaic, scene)


@pytest.mark.parametrize(("dtype", "bands"), [("uint16", 1), ("uint16", 4), ("uint8", 1), ("uint8", 3)])
def test_bands_and_types_are_those_of_the_photographs(dtype: str, bands: int, tmp_path: Path) -> None:
    scale = 200 if dtype == "uint16" else 1
    scene = write(tmp_path / "scene.tif", texture(bands, side=700).astype(dtype) * scale, PLACE, PIXEL_M)
    one = photograph(tmp_path / "a.tif", pitch_deg=-70.0)
    draw(one, scene)
    mosaic = Mosaic([one], Ground())
    pixels = drawn(mosaic)
    assert pixels.dtype == dtype and len(pixels) == bands + 1
    assert set(np.unique(pixels[-1])) == {0, np.iinfo(dtype).max}
    valid, theirs = pixels[-1] > 0, expected(scene, mosaic)
    for ours, band in zip(pixels[:-1], theirs, strict=True):
        assert np.abs(ours[valid] - band[valid]).mean() < 4 * scale
        assert not ours[~valid].any()


def survey(folder: Path, scene: Path) -> list[Photograph]:
    """Photographs of two lines, in both directions, with overlap."""
    found = []
    for k, (east, north) in enumerate([(0, 0), (25, 0), (50, 0), (50, 20), (25, 20), (0, 20)]):
        lat, lon = PLACE[0] + (north - 10) / 111_200, PLACE[1] + (east - 25) / 75_950
        one = photograph(folder / f"{k}.tif", lat=lat, lon=lon, yaw_deg=90.0 if k < 3 else 270.0)
        draw(one, scene)
        found.append(one)
    return found


@pytest.mark.slow
def test_a_survey_is_one_map_without_seams(scene: Path, tmp_path: Path) -> None:
    photographs = survey(tmp_path, scene)
    mosaic = Mosaic(photographs, Ground())
    pixels = assert_agrees(mosaic, scene, patches=30)
    # Each pixel is of the nearest camera that sees it: of those alone, one has the pixel.
    row, col = np.argwhere(pixels[-1] > 0)[::12000].T
    x, y = mosaic.geobox.xy_from_pixel(row + 0.5, col + 0.5)
    for r, c, place in zip(row, col, np.column_stack([x, y]), strict=True):
        seen = []
        for k, view in enumerate(mosaic.views):
            to_xy = transform_between(WGS84, mosaic.geobox.crs.to_wkt())
            camera = np.array(to_xy(np.array([view.photograph.lon]), np.array([view.photograph.lat]))).ravel()
            alone = mosaic_tile(mosaic, k, int(r), int(c))
            if alone[-1]:
                seen.append((np.hypot(*(place - camera)), k, alone))
        assert (min(seen, key=lambda one: one[:2])[2] == pixels[:, r, c]).all()


def mosaic_tile(mosaic: Mosaic, k: int, row: int, col: int) -> Array:
    """A pixel as one of the photographs shows it."""
    tile = Window(row // TILE * TILE, col // TILE * TILE, TILE, TILE).clipped(mosaic.geobox.shape)
    alone = copy(mosaic)
    alone.views, alone._images = mosaic.views[k : k + 1], {}
    return alone.tile(tile)[:, row - tile.row, col - tile.col]


@pytest.mark.slow
def test_over_hills_each_pixel_is_of_the_nearest_camera(slope: Path, tmp_path: Path) -> None:
    photographs = []
    for k, (north, height) in enumerate([(0, 560), (15, 600), (40, 545), (-30, 570), (5, 590)]):
        one = photograph(
            tmp_path / f"{k}.tif",
            lat=PLACE[0] + north / 111_200,
            relative_m=None,
            altitude_m=float(height),
            pitch_deg=-90.0 + 8 * k,
        )
        profile = {"count": 1, "height": IMAGE[1], "width": IMAGE[0], "dtype": "uint8"}
        with warnings.catch_warnings(action="ignore"), rasterio.open(one.path, "w", **profile) as file:
            file.write(np.full((1, *IMAGE[::-1]), 10 + k, np.uint8))
        photographs.append(one)
    ground = Ground(Dem.open(slope))
    mosaic = Mosaic(photographs, ground, 0.25)
    pixels = drawn(mosaic)
    rng = np.random.default_rng(8)
    row, col = (rng.integers(0, length, 4000) for length in mosaic.geobox.shape)
    lon, lat = mosaic.geobox.lonlat_from_xy(*mosaic.geobox.xy_from_pixel(row + 0.5, col + 0.5))
    heights = ground.heights_m(lon, lat)
    distances = np.full((len(photographs), len(row)), np.inf)
    for distance, view in zip(distances, mosaic.views, strict=True):
        offsets = np.stack([*view.plane.xy_from_lonlat(lon, lat), heights - view.height_m])
        seen = view.places(offsets, view.horizon(ground))[1]
        distance[seen] = np.linalg.norm(offsets, axis=0)[seen]
    nearest = np.where(np.isfinite(distances.min(axis=0)), 10 + distances.argmin(axis=0), 0)
    assert len(np.unique(nearest)) == 6
    assert (nearest == pixels[0, row, col]).mean() > 0.998


@pytest.mark.slow
def test_order_and_threads_and_strips_change_nothing(
    scene: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    photographs = survey(tmp_path, scene)
    first = drawn(Mosaic(photographs, Ground()))
    assert (drawn(Mosaic(photographs, Ground()), map=threads(3)) == first).all()
    assert (drawn(Mosaic(photographs[::-1], Ground())) == first).all()
    monkeypatch.setattr("uavseg.photographs.orthophoto.STRIP_BYTES", 1)
    monkeypatch.setattr("uavseg.photographs.orthophoto.CACHE_BYTES", 1)
    assert (drawn(Mosaic(photographs, Ground())) == first).all()


@pytest.mark.slow
def test_two_cameras_make_one_map(scene: Path, tmp_path: Path) -> None:
    one = photograph(tmp_path / "a.tif", lon=PLACE[1] - 0.0003)
    other = photograph(tmp_path / "b.tif", lon=PLACE[1] + 0.0003, focal_px=700.0, image_px=(640, 480))
    for each in (one, other):
        draw(each, scene)
    mosaic = Mosaic([one, other], Ground())
    assert_agrees(mosaic, scene)
    assert mosaic.geobox.transform.a == pytest.approx((60 / 400 + 60 / 700) / 2, rel=5e-3)


def test_a_coarse_map_is_of_means(scene: Path, tmp_path: Path) -> None:
    one = photograph(tmp_path / "a.tif")
    draw(one, scene)
    fine, coarse = Mosaic([one], Ground(), 0.15), Mosaic([one], Ground(), 0.9)
    assert coarse.geobox.transform.a == 0.9
    for edge in (coarse.geobox.transform.c, coarse.geobox.transform.f):
        assert edge / 0.9 == pytest.approx(round(edge / 0.9), abs=1e-6)
    pixels = drawn(coarse)
    theirs = np.zeros(coarse.geobox.shape, np.float32)
    source = drawn(fine)
    reproject(
        np.where(source[-1] > 0, source[0], np.nan).astype("f4"),
        theirs,
        src_transform=fine.geobox.transform,
        src_crs=fine.geobox.crs,
        src_nodata=np.nan,
        dst_transform=coarse.geobox.transform,
        dst_crs=coarse.geobox.crs,
        dst_nodata=np.nan,
        resampling=Resampling.average,
    )
    inner = binary_erosion(pixels[-1] > 0, iterations=3)
    assert inner.sum() > 500
    assert np.abs(pixels[0][inner] - theirs[inner]).mean() < 6


@pytest.mark.slow
def test_pixels_may_be_larger_than_a_photograph(scene: Path, tmp_path: Path) -> None:
    one = photograph(tmp_path / "a.tif")
    draw(one, scene)
    with warnings.catch_warnings(action="ignore"), rasterio.open(one.path) as file:
        mean = file.read(1).mean()
    shown = 0
    for pixel_m in range(55, 100, 5):
        value, alpha = drawn(Mosaic([one], Ground(), float(pixel_m)))
        shown += np.count_nonzero(alpha)
        assert (np.abs(value[alpha > 0] - mean) < 10).all()
    assert shown > 3


@pytest.mark.slow
def test_hidden_ground_is_not_drawn(tmp_path: Path) -> None:
    # A wall of 20 m, 30 m east of the camera; what lies behind it is compared by marching from each place.
    heights = np.full((1, 400, 400), 100.0, np.float32)
    heights[:, :, 230:236] = 120.0
    dem = write(tmp_path / "dem.tif", heights, PLACE, 1.0)
    scene = write(tmp_path / "scene.tif", texture(), PLACE, PIXEL_M)
    one = photograph(
        tmp_path / "a.tif", relative_m=None, altitude_m=140.0, yaw_deg=90.0, pitch_deg=-45.0, focal_px=300.0
    )
    draw(replace(one, relative_m=40.0), scene)
    ground = Ground(Dem.open(dem))
    mosaic = Mosaic([one], ground)
    alpha = drawn(mosaic)[-1] > 0
    view = mosaic.views[0]
    rng = np.random.default_rng(3)
    row, col = (rng.integers(0, length, 1500) for length in mosaic.geobox.shape)
    lon, lat = mosaic.geobox.lonlat_from_xy(*mosaic.geobox.xy_from_pixel(row + 0.5, col + 0.5))
    east, north = view.plane.xy_from_lonlat(lon, lat)
    up = ground.heights_m(lon, lat) - 140.0
    inside = view.places(np.stack([east, north, up]), None)[1]  # of the image, and not too coarse
    depth = np.full(len(east), np.inf)  # of the ground along the line of sight below it
    for share in np.linspace(0.02, 0.98, 300):
        place = view.plane.lonlat_from_xy(share * east, share * north)
        depth = np.minimum(depth, share * up + 140.0 - ground.heights_m(*place))
    hidden, seen = inside & (depth < -1.5), inside & (depth > 0.5)
    assert hidden.sum() > 100 and seen.sum() > 100
    assert not alpha[row, col][hidden].any()
    assert alpha[row, col][seen].mean() > 0.99


@pytest.mark.slow
@pytest.mark.parametrize("pitch", [-90.0, -60.0])
def test_ground_beyond_a_limit_is_left_out_and_said(pitch: float, scene: Path, tmp_path: Path) -> None:
    one = photograph(tmp_path / "a.tif", pitch_deg=pitch + 40, focal_px=200.0)
    draw(one, scene)
    mosaic = Mosaic([one], Ground())
    view = mosaic.views[0]
    pixels = drawn(mosaic)
    row, col = np.argwhere(pixels[-1] > 0).T
    lon, lat = mosaic.geobox.lonlat_from_xy(*mosaic.geobox.xy_from_pixel(row + 0.5, col + 0.5))
    east, north = view.plane.xy_from_lonlat(lon, lat)
    sides = []
    for step in ((0, 0), (0.01, 0), (0, 0.01)):  # of ground, in the image: the area of a pixel
        sides.append(one.pixels(np.stack([east + step[0], north + step[1], np.full(len(east), -60.0)])))
    (a, b), (c, d) = ((sides[k] - sides[0]) / 0.01 for k in (1, 2))
    area = 1 / np.abs(a * d - b * c)
    middle = one.rays(np.array([IMAGE]) / 2)[0]
    assert np.sqrt(area).max() < 1.001 * view.coarsest_m
    assert (view.drawn < 1) == any("not drawn" in text for text in mosaic.warnings)
    if pitch == -60.0:
        assert view.drawn < 1 and np.sqrt(area).max() > 0.9 * view.coarsest_m
    assert middle[2] < 0


@pytest.mark.slow
@given(
    yaw=st.floats(-180, 180), pitch=st.floats(-90, -40), roll=st.floats(-10, 10), height=st.floats(20, 200)
)
@settings(max_examples=10)
def test_likely_error_is_the_spread_of_perturbed_poses(
    yaw: float, pitch: float, roll: float, height: float
) -> None:
    one = photograph(Path("a.jpg"), yaw_deg=yaw, pitch_deg=pitch, roll_deg=roll, relative_m=height)
    pixels = np.array([[240.0, 180.0], [100.0, 300.0], [400.0, 350.0]])
    rng = np.random.default_rng(1)
    rays = one.rays(pixels)
    true = rays[:, :2] * (height / -rays[:, 2:])
    errors = likely_error_m(one, np.linalg.norm(true, axis=1), np.full(3, height))
    off = []
    for _ in range(3000):
        east, north, up = np.radians(rng.normal(0, 1, 3) * (0.5, 0.5, 1.5))
        turned = rays + np.cross([east, north, up], rays)
        down = height + rng.normal(0, max(2.0, 0.02 * height))
        moved = turned[:, :2] * (down / -turned[:, 2:]) + rng.normal(0, 3 / math.sqrt(2), 2)
        off.append(((moved - true) ** 2).sum(axis=1))
    assert errors == pytest.approx(np.sqrt(np.mean(off, axis=0)), rel=0.08)


def test_likely_error_follows_the_file_and_grows_outwards() -> None:
    one = photograph(Path("a.jpg"))
    away, below = np.array([0.0, 60 * math.hypot(240, 180) / FOCAL]), np.array([60.0, 60.0])
    middle, corner = likely_error_m(one, away, below)
    assert middle == pytest.approx(math.sqrt(9 + 2 * (60 * math.radians(0.5)) ** 2), rel=1e-3)
    assert corner > middle
    exact = likely_error_m(replace(one, position_error_m=0.02), away, below)
    assert exact[0] == pytest.approx(math.hypot(0.02, math.sqrt(2) * 60 * math.radians(0.5)), rel=1e-3)
    assert (exact < [middle, corner]).all()


def test_what_does_not_fit_is_refused(scene: Path, tmp_path: Path) -> None:
    one = photograph(tmp_path / "a.tif")
    draw(one, scene)
    deep = photograph(tmp_path / "b.tif")
    draw(deep, scene, np.dtype("uint16"))
    far = replace(one, lat=-PLACE[0])
    sky = replace(one, pitch_deg=0.0)
    wrong = replace(one, image_px=(4000, 3000))
    with pytest.raises(PhotographError, match="of one kind"):
        Mosaic([one, deep], Ground())
    with pytest.raises(PhotographError, match="do all show one place"):
        Mosaic([one, far], Ground())
    with pytest.raises(PhotographError, match="do all show one place"):
        Mosaic([one], Ground(), 1e-5)
    with pytest.raises(PhotographError, match="looks to the horizon"):
        Mosaic([sky], Ground())
    with pytest.raises(PhotographError, match="holds 480 x 360 pixels"):
        Mosaic([wrong], Ground())
    mosaic = Mosaic([sky, one], Ground())
    assert len(mosaic.views) == 1 and mosaic.warnings[0].startswith("a.tif: left out, as its middle")
