"""ROS maps: compared with a transcription of Nav2's rules, round trips, real maps."""

import math
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from affine import Affine
from hypothesis import given, settings, strategies as st
from hypothesis.extra import numpy as hnp
from PIL import Image
from rasterio.crs import CRS

from tests.occupancy.ros.map_files import ALL, put, yaml_text
from uavseg.access import allowing
from uavseg.errors import MapError, OutputExistsError, RasterReadError
from uavseg.occupancy.ros.ros_map import RosMap, read_ros_map, write_ros_map
from uavseg.raster.formats.png import read_grey
from uavseg.raster.grid.geobox import GeoBox, local_geobox

BYTES = hnp.arrays(np.uint8, hnp.array_shapes(min_dims=2, max_dims=2, max_side=9))


f4 = np.float32


def nav2_cell(grey: int, alpha: int, mode: str, negate: int, occupied: float, free: float) -> int:
    """One cell by the rules of map_io.cpp, in single precision as there."""
    if mode == "raw":
        return grey if grey <= 100 else -1
    if alpha < 255:
        return -1
    occupancy = f4(grey) / f4(255)
    if not negate:
        occupancy = f4(1) - occupancy
    if occupancy <= f4(free):
        return 0
    if occupancy >= f4(occupied):
        return 100
    if mode == "trinary":
        return -1
    percent = (occupancy - f4(free)) / f4(occupied - free) * f4(100)
    return math.floor(float(percent) + 0.5)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("maps")


THRESHOLDS = st.one_of(
    st.tuples(st.floats(0, 0.5), st.floats(0.5, 1)).filter(lambda pair: pair[0] < pair[1]),
    st.tuples(st.integers(0, 100), st.integers(120, 255)).map(lambda pair: (pair[0] / 255, pair[1] / 255)),
    st.sampled_from([(0.196, 0.65), (0.25, 0.65), (0.2, 0.6), (0.0, 1.0), (-0.5, 0.9), (0.4, 0.8)]),
)


@pytest.mark.slow
@given(BYTES, st.sampled_from(["trinary", "scale", "raw", "Scale"]), st.integers(0, 1), THRESHOLDS)
@settings(max_examples=120)
def test_cells_are_those_of_nav2(
    folder: Path, grey: np.ndarray, mode: str, negate: int, thresholds: tuple[float, float]
) -> None:
    free, occupied = thresholds
    path = put(folder, grey, mode=mode, negate=negate, occupied_thresh=repr(occupied), free_thresh=repr(free))
    found = read_ros_map(path)
    expected = [[nav2_cell(int(x), 255, mode.lower(), negate, occupied, free) for x in row] for row in grey]
    assert found.cells.tolist() == expected
    odds = np.array(expected, float) / 100
    odds[np.array(expected) == -1] = 0.5
    assert (found.probabilities == odds.astype(np.float32)).all()


@pytest.mark.slow
@given(st.data(), st.sampled_from(["trinary", "scale", "raw"]), st.integers(0, 1))
@settings(max_examples=40)
def test_pixels_that_are_not_opaque_are_unknown_except_in_raw(
    folder: Path, data: st.DataObject, mode: str, negate: int
) -> None:
    grey = data.draw(BYTES)
    alpha = data.draw(hnp.arrays(np.uint8, grey.shape, elements=st.sampled_from([0, 100, 254, 255])))
    kind = data.draw(st.sampled_from(["LA", "RGBA"]))
    bands = [grey, alpha] if kind == "LA" else [grey, grey, grey, alpha]
    Image.merge(kind, [Image.fromarray(band) for band in bands]).save(folder / "alpha.png")
    path = put(folder, grey, image="alpha.png", mode=mode, negate=negate)
    expected = np.vectorize(lambda x, a: nav2_cell(int(x), int(a), mode, negate, 0.65, 0.196))(grey, alpha)
    assert (read_ros_map(path).cells == expected).all()


def old_nav2_cell(grey: int, alpha: int) -> int:
    """One cell of a trinary map with alpha, as in map_io.cpp until 2025."""
    occupancy = 1 - (3 * grey + alpha) / 4 / 255
    return 100 if occupancy > 0.65 else 0 if occupancy < 0.196 else -1


@pytest.mark.parametrize("alpha", [255, 200, 0])
def test_alpha_that_releases_of_nav2_read_differently_is_said(tmp_path: Path, alpha: int) -> None:
    grey = np.array([[0, 100, 205, 254]], np.uint8)
    bands = [Image.fromarray(band) for band in (grey, grey, grey, np.full_like(grey, alpha))]
    Image.merge("RGBA", bands).save(tmp_path / "alpha.png")
    found = read_ros_map(put(tmp_path, grey, image="alpha.png"))
    expected = [nav2_cell(x, alpha, "trinary", 0, 0.65, 0.196) for x in grey[0].tolist()]
    assert found.cells[0].tolist() == expected
    other = sum(old_nav2_cell(x, alpha) != cell for x, cell in zip(grey[0].tolist(), expected, strict=True))
    assert other and len(found.warnings) == 1
    assert f"it reads {other} cell" in found.warnings[0]
    assert not read_ros_map(put(tmp_path, grey, image="alpha.png", mode="scale")).warnings
    assert not read_ros_map(put(tmp_path, grey)).warnings


@pytest.mark.parametrize(
    ("free", "mode", "said"),
    [(0.25, "trinary", True), (0.25, "scale", True), (0.196, "trinary", False), (0.25, "raw", False)],
)
def test_unknown_grey_that_counts_as_free_is_said(tmp_path: Path, free: float, mode: str, said: bool) -> None:
    grey = np.array([[0, 205, 205, 254]], np.uint8)
    found = read_ros_map(put(tmp_path, grey, free_thresh=free, mode=mode))
    assert [found.cells[0, 1] == 0, bool(found.warnings)] == [said, said]
    assert not said or "2 cells of grey 205" in found.warnings[0]


@pytest.mark.parametrize("kind", ["L", "RGB", "P", "1", "16"])
def test_pngs_of_every_kind_are_read(tmp_path: Path, kind: str) -> None:
    grey = (ALL > 127).astype(np.uint8) * 255 if kind == "1" else ALL
    image = Image.fromarray(grey)
    if kind == "16":
        image = Image.fromarray(grey.astype(np.uint16) * 257)
    elif kind == "P":
        image = image.convert("P", palette=Image.Palette.ADAPTIVE, colors=256)
    else:
        image = image.convert(kind)
    image.save(tmp_path / "map.png")
    cells = read_ros_map(put(tmp_path, ALL, image="map.png", mode="raw")).cells
    assert (read_grey(tmp_path / "map.png")[0] == grey).all()
    assert (cells == np.where(grey <= 100, grey.astype(int), -1)).all()


def test_colours_become_luminance(tmp_path: Path) -> None:
    colors = np.array([[[255, 0, 0], [0, 255, 0], [0, 0, 255], [100, 50, 200]]], np.uint8)
    Image.fromarray(colors).save(tmp_path / "map.png")
    cells = read_ros_map(put(tmp_path, ALL, image="map.png", mode="raw")).cells
    assert cells.tolist() == [[76, -1, 29, 82]]


def test_a_colour_declared_transparent_is_unknown(tmp_path: Path) -> None:
    Image.fromarray(np.array([[0, 254, 7]], np.uint8)).save(tmp_path / "map.png", transparency=0)
    cells = read_ros_map(put(tmp_path, ALL, image="map.png")).cells
    assert cells.tolist() == [[-1, 0, 100]]


@given(st.floats(-7, 7), st.floats(-100, 100), st.floats(-100, 100), st.floats(0.001, 10))
@settings(max_examples=40)
def test_cells_lie_where_ros_says(folder: Path, yaw: float, x: float, y: float, resolution: float) -> None:
    path = put(folder, np.zeros((3, 5), np.uint8), origin=[x, y, yaw], resolution=resolution)
    geobox = read_ros_map(path).geobox
    rows, cols = np.array([3, 3, 0, 1.5]), np.array([0, 5, 0, 2.5])  # from the bottom left corner
    across, up = cols * resolution, (3 - rows) * resolution
    expected = (
        x + across * math.cos(yaw) - up * math.sin(yaw),
        y + across * math.sin(yaw) + up * math.cos(yaw),
    )
    np.testing.assert_allclose(geobox.xy_from_pixel(rows, cols), expected, atol=1e-9)


STATES = hnp.arrays(
    np.uint8, hnp.array_shapes(min_dims=2, max_dims=2, max_side=9), elements=st.integers(0, 3)
)


@pytest.mark.slow
@given(
    STATES,
    st.floats(-3.1, 3.1),
    st.floats(-50, 50),
    st.floats(0.01, 2),
    st.booleans(),
    st.sampled_from(["trinary", "scale", "raw"]),
)
@settings(max_examples=60)
def test_states_written_are_states_read(
    folder: Path, states: np.ndarray, yaw: float, x: float, resolution: float, mirrored: bool, mode: str
) -> None:
    turned = Affine.translation(x, 3.0) @ Affine.rotation(math.degrees(yaw))
    transform = turned @ Affine.scale(resolution, resolution if mirrored else -resolution)
    geobox = GeoBox(states.shape, transform, None)
    write_ros_map(folder / "out.yaml", states, geobox, overwrite=True, mode=mode)
    found = read_ros_map(folder / "out.yaml")
    cells = found.cells[::-1] if mirrored else found.cells
    assert (cells == np.array([-1, 0, -1, 100])[states]).all()
    rows = states.shape[0] - 1 - np.arange(states.shape[0]) if mirrored else np.arange(states.shape[0])
    np.testing.assert_allclose(
        found.geobox.xy_from_pixel(rows + 0.5, np.full(len(rows), 0.5)),
        geobox.xy_from_pixel(np.arange(len(rows)) + 0.5, np.full(len(rows), 0.5)),
        atol=1e-9,
    )


def test_files_are_those_that_nav2_writes(tmp_path: Path) -> None:
    write_ros_map(tmp_path / "a b.yaml", np.array([[1, 2, 3]]), local_geobox((1, 3), 0.05, (-10, -10)))
    assert (tmp_path / "a b.pgm").read_bytes() == b"P5\n3 1\n255\n\xfe\xcd\x00"
    assert (tmp_path / "a b.yaml").read_text().splitlines() == [
        "image: a b.pgm",
        "mode: trinary",
        "resolution: 0.05",
        "origin: [-10.0, -10.0, 0.0]",
        "negate: 0",
        "occupied_thresh: 0.65",
        "free_thresh: 0.196",
    ]


def test_unknown_cells_are_transparent_in_scale_and_255_in_raw(tmp_path: Path) -> None:
    states, geobox = np.array([[0, 1, 2, 3]]), local_geobox((1, 4), 0.05, (0, 0))
    write_ros_map(tmp_path / "scale.yaml", states, geobox, mode="scale")
    with Image.open(tmp_path / "scale.png") as picture:
        assert picture.mode == "LA"
        assert np.asarray(picture).tolist() == [[[205, 0], [255, 255], [205, 0], [0, 255]]]
    write_ros_map(tmp_path / "raw.yaml", states, geobox, mode="raw")
    assert (tmp_path / "raw.pgm").read_bytes() == b"P5\n4 1\n255\n\xff\x00\xff\x64"
    with pytest.raises(MapError, match="mode is trinary, scale or raw, not 'grey'"):
        write_ros_map(tmp_path / "grey.yaml", states, geobox, mode="grey")


@pytest.mark.parametrize("there", ["out.yaml", "out.pgm"])
def test_nothing_is_replaced_without_overwrite(tmp_path: Path, there: str) -> None:
    (tmp_path / there).write_text("mine")
    with pytest.raises(OutputExistsError):
        write_ros_map(tmp_path / "out.yaml", np.ones((2, 2), int), local_geobox((2, 2), 1, (0, 0)))
    assert [path.name for path in tmp_path.iterdir()] == [there]


@pytest.mark.parametrize(
    ("transform", "crs", "message"),
    [
        (Affine.scale(1, -2), None, "square cells"),
        (Affine(1, 0.5, 0, 0, -1, 0), None, "square cells"),
        (Affine.scale(1, -1), 4326, "in metres and this one in degrees"),
        (Affine.scale(1, -1), 2263, "in metres and this one in US survey foot"),
    ],
)
def test_a_geobox_that_ros_cannot_express_is_refused(
    tmp_path: Path, transform: Affine, crs: int | None, message: str
) -> None:
    geobox = GeoBox((2, 2), transform, crs and CRS.from_epsg(crs))
    with pytest.raises(MapError, match=message):
        write_ros_map(tmp_path / "out.yaml", np.ones((2, 2), int), geobox)
    assert not list(tmp_path.iterdir())


def counts(found: RosMap) -> dict[str, int]:
    return {
        name: int((found.cells == cell).sum())
        for name, cell in (("free", 0), ("unknown", -1), ("occupied", 100))
    }


@pytest.mark.parametrize("name", ["depot", "tb3_sandbox"])
def test_real_maps_are_read_as_nav2_reads_them(shared_data: Path, name: str) -> None:
    found = read_ros_map(shared_data / "maps" / f"{name}.yaml")
    grey = np.asarray(Image.open(shared_data / "maps" / f"{name}.pgm"))
    free = 0.25 if name == "depot" else 0.196
    table = [nav2_cell(x, 255, "trinary", 0, 0.65, free) for x in range(256)]
    assert (found.cells == np.array(table)[grey]).all()
    assert counts(found)["free"] and counts(found)["occupied"]
    assert bool(counts(found)["unknown"]) == (name != "depot")  # there 205 lies below the threshold
    assert found.geobox.transform.a == 0.05


def test_a_real_map_whose_image_has_another_name_is_refused(shared_data: Path, tmp_path: Path) -> None:
    shutil.copy(shared_data / "maps" / "turtlebot3_map.yaml", tmp_path)
    with pytest.raises(
        RasterReadError, match=r"names a file that cannot be read: there is no file .*map\.pgm"
    ):
        read_ros_map(tmp_path / "turtlebot3_map.yaml")
    shutil.copy(shared_data / "maps" / "turtlebot3_map.pgm", tmp_path / "map.pgm")
    found = read_ros_map(tmp_path / "turtlebot3_map.yaml")
    assert sum(counts(found).values()) == 384 * 384 and all(counts(found).values())


@pytest.mark.parametrize("mode", ["scale", "raw"])
def test_a_real_map_of_all_greys(shared_data: Path, tmp_path: Path, mode: str) -> None:
    (tmp_path / "map.yaml").write_text(yaml_text(image=shared_data / "maps" / "willow-full.pgm", mode=mode))
    with allowing(shared_data):
        found = read_ros_map(tmp_path / "map.yaml")
    grey = np.asarray(Image.open(shared_data / "maps" / "willow-full.pgm"))
    table = [nav2_cell(x, 255, mode, 0, 0.65, 0.196) for x in range(256)]
    assert (found.cells == np.array(table)[grey]).all()


def test_a_truncated_png_is_refused(tmp_path: Path) -> None:
    noise = np.random.default_rng(0).integers(0, 255, (90, 90), np.uint8)
    Image.fromarray(noise).save(tmp_path / "map.png")
    (tmp_path / "map.png").write_bytes((tmp_path / "map.png").read_bytes()[:3000])
    with pytest.raises(RasterReadError, match="cannot be read as a picture"):
        read_ros_map(put(tmp_path, ALL, image="map.png"))


@pytest.mark.slow
@pytest.mark.parametrize("module", ["uavseg.occupancy.ros", "uavseg.occupancy.ros.ros_map"])
def test_reading_ros_maps_loads_no_beams_and_no_kernels(module: str) -> None:
    code = f"import sys, {module}; print(*sys.modules)"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    loaded = found.stdout.split()
    assert module in loaded
    assert not [name for name in loaded if name.startswith("uavseg.occupancy.mapping") or name == "numba"]
