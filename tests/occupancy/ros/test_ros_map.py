"""ROS maps: against a plain transcription of Nav2's rules, there and back, and real ones."""

import math
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from affine import Affine
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from PIL import Image
from rasterio.crs import CRS

from uavseg.errors import MapError, OutputExistsError, RasterReadError
from uavseg.occupancy.ros.pgm import pgm_bytes, read_pgm
from uavseg.occupancy.ros.ros_map import RosMap, read_ros_map, write_ros_map
from uavseg.raster.formats.png import read_grey, to_8_bits
from uavseg.raster.geobox import GeoBox, local_geobox

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


def yaml_text(**keys: Any) -> str:
    usual = {
        "image": "map.pgm",
        "resolution": 0.05,
        "origin": "[-1.0, 2.0, 0.0]",
        "negate": 0,
        "occupied_thresh": 0.65,
        "free_thresh": 0.196,
    }
    return "".join(f"{key}: {value}\n" for key, value in (usual | keys).items() if value is not None)


def put(folder: Path, grey: np.ndarray, **keys: Any) -> Path:
    (folder / "map.pgm").write_bytes(pgm_bytes(grey))
    (folder / "map.yaml").write_text(yaml_text(**keys))
    return folder / "map.yaml"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("maps")


THRESHOLDS = st.one_of(
    st.tuples(st.floats(0, 0.5), st.floats(0.5, 1)).filter(lambda pair: pair[0] < pair[1]),
    st.tuples(st.integers(0, 100), st.integers(120, 255)).map(lambda pair: (pair[0] / 255, pair[1] / 255)),
    st.sampled_from([(0.196, 0.65), (0.25, 0.65), (0.2, 0.6), (0.0, 1.0), (-0.5, 1.5), (0.4, 0.8)]),
)


@given(BYTES, st.sampled_from(["trinary", "scale", "raw", "Scale"]), st.integers(0, 1), THRESHOLDS)
@settings(max_examples=120, deadline=None)
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


@given(st.data(), st.sampled_from(["trinary", "scale", "raw"]), st.integers(0, 1))
@settings(max_examples=40, deadline=None)
def test_what_is_not_opaque_is_unknown_except_in_raw(
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


ALL = np.arange(256, dtype=np.uint8).reshape(16, 16)


def plain(samples: np.ndarray, maximum: int) -> bytes:
    rows, cols = samples.shape
    text = "\n".join(" ".join(map(str, row)) for row in samples.tolist())
    return f"P2 # plain\n# by hand\n{cols} {rows}\n{maximum}\n{text}\n".encode()


def raw(samples: np.ndarray, maximum: int) -> bytes:
    rows, cols = samples.shape
    return (
        b"P5\n# raw\n%d\t%d\n%d\n" % (cols, rows, maximum)
        + samples.astype(">u2" if maximum > 255 else "u1").tobytes()
    )


@pytest.mark.parametrize("form", [plain, raw])
@pytest.mark.parametrize(
    ("samples", "maximum", "grey"),
    [
        (ALL, 255, ALL),
        (ALL.astype(int) * 257, 65535, ALL),
        (ALL.astype(int) * 257 + 256 * (ALL < 255), 65535, ALL),  # rounded down
        (np.arange(16).reshape(4, 4), 15, np.arange(16).reshape(4, 4) * 17),
        (np.array([[0, 1], [1, 0]]), 1, np.array([[0, 255], [255, 0]])),
        (np.array([[0, 500, 1000]]), 1000, np.array([[0, 127, 255]])),
        (np.array([[7, 200]]), 100, np.array([[17, 255]])),  # beyond the maximum is white
    ],
)
def test_pgms_of_every_depth_are_read(
    tmp_path: Path, form: Any, samples: np.ndarray, maximum: int, grey: np.ndarray
) -> None:
    path = put(tmp_path, ALL, mode="raw")
    (tmp_path / "map.pgm").write_bytes(form(samples, maximum))
    assert (to_8_bits(*read_pgm(tmp_path / "map.pgm")) == grey).all()
    assert (read_ros_map(path).cells == np.where(grey <= 100, grey.astype(int), -1)).all()


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
@settings(max_examples=40, deadline=None)
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


@given(
    STATES,
    st.floats(-3.1, 3.1),
    st.floats(-50, 50),
    st.floats(0.01, 2),
    st.booleans(),
    st.sampled_from(["trinary", "scale", "raw"]),
)
@settings(max_examples=60, deadline=None)
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


def test_what_is_written_is_what_nav2_writes(tmp_path: Path) -> None:
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


def test_what_is_unknown_in_scale_is_transparent_and_in_raw_255(tmp_path: Path) -> None:
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
def test_nothing_is_overwritten_unasked(tmp_path: Path, there: str) -> None:
    (tmp_path / there).write_text("mine")
    with pytest.raises(OutputExistsError):
        write_ros_map(tmp_path / "out.yaml", np.ones((2, 2), int), local_geobox((2, 2), 1, (0, 0)))
    assert [path.name for path in tmp_path.iterdir()] == [there]


@pytest.mark.parametrize(
    ("transform", "crs", "told"),
    [
        (Affine.scale(1, -2), None, "square cells"),
        (Affine(1, 0.5, 0, 0, -1, 0), None, "square cells"),
        (Affine.scale(1, -1), 4326, "in metres and this one in degrees"),
        (Affine.scale(1, -1), 2263, "in metres and this one in US survey foot"),
    ],
)
def test_a_place_that_ros_cannot_express_is_refused(
    tmp_path: Path, transform: Affine, crs: int | None, told: str
) -> None:
    geobox = GeoBox((2, 2), transform, crs and CRS.from_epsg(crs))
    with pytest.raises(MapError, match=told):
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


def test_a_real_map_whose_picture_has_another_name_is_told(shared_data: Path, tmp_path: Path) -> None:
    shutil.copy(shared_data / "maps" / "turtlebot3_map.yaml", tmp_path)
    with pytest.raises(RasterReadError, match=r"names the picture .*map\.pgm, and there is no such file"):
        read_ros_map(tmp_path / "turtlebot3_map.yaml")
    shutil.copy(shared_data / "maps" / "turtlebot3_map.pgm", tmp_path / "map.pgm")
    found = read_ros_map(tmp_path / "turtlebot3_map.yaml")
    assert sum(counts(found).values()) == 384 * 384 and all(counts(found).values())


@pytest.mark.parametrize("mode", ["scale", "raw"])
def test_a_real_map_of_all_greys(shared_data: Path, tmp_path: Path, mode: str) -> None:
    (tmp_path / "map.yaml").write_text(yaml_text(image=shared_data / "maps" / "willow-full.pgm", mode=mode))
    found = read_ros_map(tmp_path / "map.yaml")
    grey = np.asarray(Image.open(shared_data / "maps" / "willow-full.pgm"))
    table = [nav2_cell(x, 255, mode, 0, 0.65, 0.196) for x in range(256)]
    assert (found.cells == np.array(table)[grey]).all()


@pytest.mark.parametrize(
    ("keys", "told"),
    [
        ({"free_thresh": 0.7}, "free_thresh (0.7) lies below occupied_thresh (0.65)"),
        ({"free_thresh": 0.65}, "free_thresh (0.65) lies below"),
        ({"free_thresh": ".nan"}, "thresholds are finite"),
        ({"resolution": -0.05}, "a number above 0, not -0.05"),
        ({"resolution": 0}, "a number above 0, not 0"),
        ({"resolution": ".nan"}, "a number above 0, not nan"),
        ({"resolution": ".inf"}, "a number above 0, not inf"),
        ({"resolution": "fine"}, "resolution is a number, not 'fine'"),
        ({"resolution": "true"}, "resolution is a number, not True"),
        ({"origin": "[0, 0]"}, "origin is a list of three numbers"),
        ({"origin": "[0, 0, .nan]"}, "origin wants finite x, y and yaw"),
        ({"origin": 0}, "origin is a list of three numbers"),
        ({"mode": "ternary"}, "mode is trinary, scale or raw, not 'ternary'"),
        ({"negate": "maybe"}, "negate is 0 or 1, not 'maybe'"),
        ({"image": "[]"}, "image is the name of a picture"),
        ({"image": "none.pgm"}, "there is no such file"),
        ({"image": None}, "missing here: image"),
        ({"resolution": None, "negate": None}, "missing here: resolution, negate"),
        ({"origin": "[0, 0"}, "is no YAML"),
        ({"image": "map.yaml"}, "cannot be read as a picture"),
    ],
)
def test_a_yaml_that_is_no_map_is_refused_in_one_line(
    tmp_path: Path, keys: dict[str, Any], told: str
) -> None:
    path = put(tmp_path, ALL, **keys)
    with pytest.raises((MapError, RasterReadError)) as caught:
        read_ros_map(path)
    assert told in str(caught.value) and "map.yaml" in str(caught.value) and "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("content", "told"),
    [
        (b"P5\n4 4\n255\n" + bytes(15), "says 4 x 4 pixels and holds 15; it is truncated"),
        (b"P5\n4 4\n65535\n" + bytes(31), "says 4 x 4 pixels and holds 15; it is truncated"),
        (b"P5\n100000000 100000000\n255\n" + bytes(99), "holds 99; it is truncated"),
        (b"P5\n99999999999999999999 9\n255\n" + bytes(99), "holds 99; it is truncated"),
        (b"P2\n99999999999999999999 9\n255\n1 2 3", "holds 3; it is truncated"),
        (b"P5\n0 4\n255\n", "is 0 x 4 pixels of up to 255"),
        (b"P5\n4 4\n0\n" + bytes(16), "a maximum of 1 to 65535"),
        (b"P5\n4 4\n65536\n" + bytes(32), "a maximum of 1 to 65535"),
        (b"P5\n4 -4\n255\n" + bytes(16), "is no PGM"),
        (b"P5", "is no PGM"),
        (b"P2\n2 2\n255\n1 2 x 4", "something else than numbers"),
        (b"P2\n2 2\n255\n1 -2 3 4", "something else than numbers"),
        (b"", "cannot be read as a picture"),
        (b"\x89PNG\r\n\x1a\n", "cannot be read as a picture"),
    ],
)
def test_a_picture_that_is_none_is_refused_in_one_line(tmp_path: Path, content: bytes, told: str) -> None:
    path = put(tmp_path, ALL)
    (tmp_path / "map.pgm").write_bytes(content)
    with pytest.raises(RasterReadError) as caught:
        read_ros_map(path)
    assert told in str(caught.value) and "map.pgm" in str(caught.value) and "\n" not in str(caught.value)


def test_a_truncated_png_is_refused(tmp_path: Path) -> None:
    noise = np.random.default_rng(0).integers(0, 255, (90, 90), np.uint8)
    Image.fromarray(noise).save(tmp_path / "map.png")
    (tmp_path / "map.png").write_bytes((tmp_path / "map.png").read_bytes()[:3000])
    with pytest.raises(RasterReadError, match="cannot be read as a picture"):
        read_ros_map(put(tmp_path, ALL, image="map.png"))


@pytest.mark.parametrize("number", ["5e-2", '"0.05"', "0.05"])
def test_numbers_are_read_as_yaml_cpp_reads_them(tmp_path: Path, number: str) -> None:
    assert read_ros_map(put(tmp_path, ALL, resolution=number)).geobox.transform.a == 0.05


@pytest.mark.parametrize(("negate", "first"), [("0", 100), ("1", 0), ("true", 0), ("no", 100), ("2", 0)])
def test_negate_is_a_number_or_a_flag(tmp_path: Path, negate: str, first: int) -> None:
    assert read_ros_map(put(tmp_path, ALL, negate=negate)).cells[0, 0] == first


def test_a_missing_yaml_is_told(tmp_path: Path) -> None:
    with pytest.raises(RasterReadError, match=r"there is no file .*none\.yaml"):
        read_ros_map(tmp_path / "none.yaml")
