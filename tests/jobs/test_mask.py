"""`uavseg mask`: cells that regions touch, and what Nav2's costmap filters make of them."""

import math
import warnings
from pathlib import Path
from typing import Any

import geopandas
import numpy as np
import pytest
import shapely
import yaml
from click.testing import CliRunner, Result
from hypothesis import given, settings, strategies as st
from PIL import Image

import uavseg
from uavseg.cli import main
from uavseg.errors import UavsegError

SIDE = 0.5


def write_map(folder: Path, yaw: float = 0.0, shape: tuple[int, int] = (30, 40)) -> str:
    """A ROS map of free cells; its lower left corner is at (2, -1)."""
    Image.fromarray(np.full(shape, 254, np.uint8)).save(folder / "m.pgm")
    content = {"image": "m.pgm", "resolution": SIDE, "origin": [2.0, -1.0, yaw], "negate": 0}
    (folder / "m.yaml").write_text(yaml.safe_dump(content | {"occupied_thresh": 0.65, "free_thresh": 0.25}))
    return str(folder / "m.yaml")


def frame(*polygons: Any, crs: str | None = None) -> geopandas.GeoDataFrame:
    return geopandas.GeoDataFrame(geometry=list(polygons), crs=crs)


def write_regions(path: Path, *polygons: Any, crs: str | None = None) -> str:
    with warnings.catch_warnings(action="ignore"):
        frame(*polygons, crs=crs).to_file(path)
    return str(path)


def cell(row: int, col: int, yaw: float = 0.0, shape: tuple[int, int] = (30, 40)) -> Any:
    """The square of a cell in the map's frame; row 0 is the highest."""
    up = shape[0] - row - 1
    square = shapely.box(col * SIDE, up * SIDE, (col + 1) * SIDE, (up + 1) * SIDE)
    turned = shapely.affinity.rotate(square, yaw, origin=(0, 0), use_radians=True)
    return shapely.affinity.translate(turned, 2, -1)


def as_nav2_reads(path: Path) -> tuple[np.ndarray, dict[str, Any]]:
    """Values of the mask as Nav2's map server publishes them in the mode raw, and the parameters."""
    about = yaml.safe_load(path.read_text())
    assert about["mode"] == "raw" and about["negate"] == 0
    values = np.asarray(Image.open(path.with_name(about["image"]))).astype(int)
    return np.where(values <= 100, values, -1), yaml.safe_load(path.with_suffix(".params.yaml").read_text())


def run(*words: object) -> Result:
    return CliRunner().invoke(main, ["mask", *map(str, words)])


triangles = st.lists(st.tuples(st.floats(3, 20), st.floats(0, 13)), min_size=3, max_size=3)


@pytest.mark.slow
@pytest.mark.parametrize("yaw", [0.0, 0.4])
@given(corners=triangles)
@settings(max_examples=15)
def test_every_cell_that_a_region_touches_is_in_it(
    tmp_path_factory: pytest.TempPathFactory, yaw: float, corners: list[tuple[float, float]]
) -> None:
    polygon = shapely.affinity.rotate(shapely.Polygon(corners), yaw, origin=(2, -1), use_radians=True)
    if polygon.area < 0.01:
        return
    path = write_map(tmp_path_factory.mktemp("map"), yaw)
    with warnings.catch_warnings(action="ignore"):
        found = uavseg.mask(frame(polygon), path).values == 100
    cells = [[cell(row, col, yaw) for col in range(40)] for row in range(30)]
    shared = shapely.area(shapely.intersection(cells, polygon))
    near = shapely.distance(cells, polygon)
    assert found[shared > 1e-6].all()
    assert not found[near > 1e-6].any()


def test_a_robot_keeps_out(tmp_path: Path) -> None:
    regions = write_regions(tmp_path / "r.gpkg", cell(4, 7).buffer(-0.01), cell(20, 30).buffer(0.1))
    out = tmp_path / "keepout.yaml"
    done = run(regions, "--map", write_map(tmp_path), "-o", out)
    assert done.exit_code == 0, done.output
    values, params = as_nav2_reads(out)
    expected = np.zeros((30, 40), int)
    expected[4, 7] = 100
    expected[19:22, 29:32] = 100
    np.testing.assert_array_equal(values, expected)
    info = params["keepout_costmap_filter_info_server"]["ros__parameters"]
    assert (info["type"], info["base"], info["multiplier"]) == (0, 0.0, 1.0)
    own = yaml.safe_load(out.read_text())
    assert own["origin"] == pytest.approx([2, -1, 0]) and own["resolution"] == SIDE


@pytest.mark.parametrize("speed", [1, 40, 50, 99])
def test_it_is_slower_by_what_nav2_computes(speed: int, tmp_path: Path) -> None:
    out = tmp_path / "speed.yaml"
    regions = write_regions(tmp_path / "r.gpkg", cell(4, 7))
    assert run(regions, "--map", write_map(tmp_path), "-o", out, "--speed", speed, "-q").exit_code == 0
    values, params = as_nav2_reads(out)
    info = params["speed_costmap_filter_info_server"]["ros__parameters"]
    limits = info["base"] + info["multiplier"] * values
    assert info["type"] == 1  # per cent
    assert limits[4, 7] == speed and values[10, 10] == 0  # 0 is no limit


def test_names_in_the_parameters_agree(tmp_path: Path) -> None:
    for speed, kind in ((None, "keepout"), (30, "speed")):
        found = uavseg.mask(frame(cell(4, 7)), write_map(tmp_path), speed=speed)
        found.write(tmp_path / f"{kind}.yaml")
        _, params = as_nav2_reads(tmp_path / f"{kind}.yaml")
        server = params[f"{kind}_filter_mask_server"]["ros__parameters"]
        info = params[f"{kind}_costmap_filter_info_server"]["ros__parameters"]
        costmap = params["global_costmap"]["global_costmap"]["ros__parameters"]
        [name] = costmap["filters"]
        assert server["yaml_filename"] == f"{kind}.yaml" and server["topic_name"] == info["mask_topic"]
        assert costmap[name]["filter_info_topic"] == info["filter_info_topic"]
        assert costmap[name]["plugin"].lower() == f"nav2_costmap_2d::{kind}filter"


def test_both_faces_write_the_same(tmp_path: Path) -> None:
    regions, path = write_regions(tmp_path / "r.gpkg", cell(1, 1, 0.3).buffer(3)), write_map(tmp_path, 0.3)
    (tmp_path / "python").mkdir()
    with pytest.warns(
        UserWarning, match="1 of 1 regions reach beyond m.pgm|1 of 1 regions reach beyond m.yaml"
    ):
        uavseg.mask(regions, path, speed=25).write(tmp_path / "python" / "s.yaml")
    done = run(regions, "--map", path, "-o", tmp_path / "s.yaml", "--speed", 25)
    assert done.exit_code == 0 and "1 of 1 regions reach beyond" in done.stderr
    for name in ("s.yaml", "s.pgm", "s.params.yaml"):
        assert (tmp_path / name).read_bytes() == (tmp_path / "python" / name).read_bytes()
    assert run(regions, "--map", path, "-o", tmp_path / "s.yaml").exit_code == 1  # it is there


@pytest.mark.parametrize(
    ("how", "said"),
    [
        ({"speed": 0}, "speed is a whole number of per cent from 1 to 99, not 0"),
        ({"speed": 100}, "speed is a whole number of per cent"),
        ({"regions": "far.gpkg"}, "no region touches m"),
        ({"regions": "utm.gpkg"}, "utm.gpkg has a CRS and the raster has none"),
        ({"regions": "gone.gpkg"}, "gone.gpkg does not exist"),
        ({"map": "gone.yaml"}, "gone.yaml"),
        ({"map": "m.pgm"}, "m.pgm is a picture"),
    ],
)
def test_what_makes_no_mask_is_refused(
    how: dict[str, Any], said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    write_map(tmp_path)
    write_regions(tmp_path / "r.gpkg", cell(4, 7))
    write_regions(tmp_path / "far.gpkg", shapely.box(900, 900, 901, 901))
    write_regions(tmp_path / "utm.gpkg", shapely.box(5e5, 5e6, 5e5 + 1, 5e6 + 1), crs="EPSG:32633")
    given = {"regions": "r.gpkg", "map": "m.yaml"} | how
    with pytest.raises(UavsegError, match=said):
        uavseg.mask(**given)
    words = [given["regions"], "--map", given["map"], "-o", "out.yaml"]
    done = run(*words, *(["--speed", given["speed"]] if "speed" in given else []))
    assert done.exit_code == 1 and not (tmp_path / "out.yaml").exists()
    assert run("r.gpkg", "--map", "m.yaml", "-o", "out.tif").exit_code == 1


def test_geojson_is_taken_for_coordinates_of_the_map_and_this_is_said(tmp_path: Path) -> None:
    regions, path = write_regions(tmp_path / "r.geojson", cell(4, 7).buffer(-0.01)), write_map(tmp_path)
    with pytest.warns(UserWarning, match="coordinates of GeoJSON, which are degrees elsewhere, are taken"):
        found = uavseg.mask(regions, path)
    assert np.argwhere(found.values).tolist() == [[4, 7]]


def test_a_whole_turn_is_no_turn(tmp_path: Path) -> None:
    one = uavseg.mask(frame(cell(4, 7)), write_map(tmp_path)).values
    np.testing.assert_array_equal(one, uavseg.mask(frame(cell(4, 7)), write_map(tmp_path, math.tau)).values)
