"""Description and recognition: maps with hidden sides, libraries, both faces, bad input."""

import math
import warnings
from pathlib import Path

import geopandas
import numpy as np
import pandas
import pytest
import shapely
from affine import Affine
from click.testing import CliRunner
from rasterio.crs import CRS

import uavseg
from uavseg.cli import main
from uavseg.errors import ParameterError, RegionError
from uavseg.jobs.maps.recognition import CANNOT_TELL
from uavseg.raster.formats.geotiff import write_geotiff
from uavseg.raster.grid.geobox import GeoBox

SIDE = 96
X, Y = np.meshgrid(np.arange(SIDE) + 0.5, np.arange(SIDE) + 0.5)
DISC = shapely.Point(48, 48).buffer(20)
BAR = shapely.box(20, 40, 76, 56)
ELL = shapely.Polygon([(25, 25), (70, 25), (70, 40), (40, 40), (40, 70), (25, 70)])


def seen_from(shape: shapely.Polygon, sides: int) -> np.ndarray:
    """Probabilities of cells as beams from 1 to 4 sides show them: a band of surface, hidden inside."""
    solid = shapely.contains_xy(shape, X, Y)
    found = np.full(solid.shape, 0.5)
    for k in range(sides):
        turned, view = np.rot90(solid, k), np.rot90(found, k)
        for row in range(SIDE):
            first = int(np.argmax(turned[row])) if turned[row].any() else SIDE
            view[row, :first] = np.where(view[row, :first] > 0.6, 0.9, 0.05)
            view[row, first : first + 3] = 0.9
    return found


@pytest.fixture
def library(tmp_path: Path) -> Path:
    path = tmp_path / "library.gpkg"
    for name, shape in (("disc", DISC), ("bar", BAR), ("ell", ELL)):
        uavseg.recognise(seen_from(shape, 4), path, learn=name, ids=[1])
    return path


def test_a_library_grows_and_keeps_what_it_held(library: Path) -> None:
    frame = geopandas.read_file(library)
    assert frame["name"].tolist() == ["disc", "bar", "ell"] and frame["id"].tolist() == [1, 2, 3]
    assert frame.crs is None and np.allclose(shapely.get_coordinates(frame.centroid), 0, atol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "shape"), [("disc", DISC), ("bar", BAR), ("ell", ELL)])
@pytest.mark.parametrize("sides", [2, 4])
def test_shapes_are_named_from_some_of_their_sides(
    library: Path, name: str, shape: shapely.Polygon, sides: int
) -> None:
    turned = shapely.affinity.scale(shapely.affinity.rotate(shape, 25, "center"), 0.9, 0.9)
    found = uavseg.recognise(seen_from(turned, sides), library, gap=30.0).frame()
    assert found["nearest"][0] == name
    assert found["probability"].between(0, 1).all()


def test_solid_outlines_and_what_was_seen_of_them() -> None:
    whole = uavseg.describe(seen_from(BAR, 4))
    assert whole.regions.columns["seen_outline"].tolist() == [1.0]
    assert whole.outlines[0].area == pytest.approx(BAR.area, rel=0.06)
    assert whole.regions.columns["euler_number"].tolist() == [1.0]
    half = uavseg.describe(seen_from(BAR, 1))
    assert 0.2 < half.regions.columns["seen_outline"][0] < 0.8


def test_an_object_without_evidence_cannot_be_told(library: Path) -> None:
    cells = np.full((64, 64), 0.1)
    cells[10:13, 10:12] = 0.9
    with pytest.warns(UserWarning, match="too faint"):
        found = uavseg.recognise(cells, library).frame()
    assert found["name"].tolist() == [CANNOT_TELL] and found["probability"].tolist() == [0.0]


def test_a_gap_joins_objects_and_their_areas() -> None:
    cells = np.full((64, 64), 0.05)
    cells[10:20, 10:20] = cells[10:20, 24:34] = cells[40:50, 10:20] = 0.95
    apart, near = uavseg.describe(cells), uavseg.describe(cells, gap=5)
    assert len(apart.regions) == 3 and len(near.regions) == 2
    assert apart.frame()["area_m2"].sum() == near.frame()["area_m2"].sum()
    assert near.frame().iloc[0][["x_min", "x_max"]].tolist() == [10, 34]


def test_pieces_that_are_joined_have_the_outline_of_all(tmp_path: Path) -> None:
    """A frame of four walls apart at its corners, free inside as in maps that call the unknown free."""
    walls = [shapely.box(24, 20, 56, 22), shapely.box(24, 58, 56, 60)]
    walls += [shapely.box(20, 24, 22, 56), shapely.box(58, 24, 60, 56)]
    frame = shapely.union_all(walls)
    cells = np.where(shapely.contains_xy(frame, X, Y), 0.95, 0.05)
    found = uavseg.describe(cells, gap=8)
    assert found.frame()[["length_m", "width_m"]].iloc[0].tolist() == pytest.approx([40, 40], abs=1)
    turned = shapely.affinity.rotate(frame, 30, "center")
    uavseg.recognise(cells, tmp_path / "library.gpkg", learn="box", ids=[1], gap=8)
    again = np.where(shapely.contains_xy(turned, X, Y), 0.95, 0.05)
    assert uavseg.recognise(again, tmp_path / "library.gpkg", gap=8).frame()["name"].tolist() == ["box"]


@pytest.mark.parametrize("gap", [1e-6, 0.5, 30.0, 1000.0])
def test_gaps_of_any_width_keep_what_there_is(gap: float) -> None:
    cells = np.full((64, 64), 0.05)
    cells[10:12, 10:30] = cells[20:40, 30:32] = cells[50:52, 50:52] = 0.95
    found = uavseg.describe(cells, gap=gap)
    assert sum(found.regions.columns["area_m2"]) == 84
    outlines = shapely.union_all(found.outlines)
    assert outlines.buffer(1).covers(shapely.union_all([*uavseg.describe(cells).outlines]))


@pytest.mark.slow
def test_threads_and_tiles_change_nothing(library: Path) -> None:
    picture = seen_from(ELL, 2)
    first, second = (
        uavseg.recognise(picture, library, threads=threads, tile=tile).frame()
        for threads, tile in ((1, None), (3, 64))
    )
    assert first.equals(second)


REGIONS = geopandas.GeoDataFrame(
    {"id": [3, 5, 8], "kind": ["a", "b", "c"]},
    geometry=[
        shapely.affinity.translate(shape, 400000 + 100 * k, 5000000)
        for k, shape in enumerate((DISC, BAR, ELL))
    ],
    crs="EPSG:32618",
)


def test_regions_are_named_by_themselves(tmp_path: Path) -> None:
    path = tmp_path / "library.gpkg"
    for name, one in (("round", 3), ("long", 5), ("bent", 8)):
        uavseg.recognise(REGIONS, path, learn=name, ids=[one])
    turned = REGIONS.set_geometry(REGIONS.rotate(70).scale(2, 2))
    found = uavseg.recognise(turned, path).frame()
    assert found["name"].tolist() == ["round", "long", "bent"]
    assert found["kind"].tolist() == ["a", "b", "c"] and (found["probability"] > 0.9).all()


@pytest.mark.slow
def test_texture_parts_equal_shapes(tmp_path: Path) -> None:
    random = np.random.default_rng(0)
    picture = np.full((128, 256), 100, np.uint8)
    picture[:, 128:] += random.integers(0, 100, (128, 128), np.uint8)
    box = GeoBox(picture.shape, Affine(1, 0, 400000, 0, -1, 5000128), CRS.from_epsg(32618))
    raster = tmp_path / "picture.tif"
    write_geotiff(raster, [picture], box, ["grey"])
    centres = [(400030, 5000030), (400030, 5000090), (400190, 5000030), (400190, 5000090)]
    discs = [shapely.Point(xy).buffer(25) for xy in centres]
    frame = geopandas.GeoDataFrame({"id": [1, 2, 3, 4]}, geometry=discs, crs="EPSG:32618")
    path = tmp_path / "library.gpkg"
    uavseg.recognise(frame, path, learn="smooth", ids=[1], raster=raster)
    uavseg.recognise(frame, path, learn="rough", ids=[3], raster=raster)
    found = uavseg.recognise(frame, path, raster=raster).frame()
    assert found["name"].tolist() == ["smooth", "smooth", "rough", "rough"]
    assert found["b1_mean"].round().tolist()[:2] == [100, 100] and found["contrast"][0] < found["contrast"][2]
    described = uavseg.describe(frame, raster=raster).frame()
    assert described.equals(uavseg.describe(frame, raster=raster, threads=3, tile=64).frame())
    assert described["area_m2"].tolist() == pytest.approx([math.pi * 625] * 4, rel=0.01)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "message"),
    [
        ({"learn": "disc", "ids": [9]}, "no such one: 9"),
        ({"learn": "disc"}, "none was named"),
        ({"learn": " ", "ids": [1]}, "printable name"),
        ({"learn": CANNOT_TELL, "ids": [1]}, "printable name"),
        ({"ids": [1]}, "--learn"),
        ({"min_probability": 1.5}, "0..1"),
        ({"gap": -1.0}, "0 m or more"),
        ({"gap": math.nan}, "0 m or more"),
        ({"gap": 1e9}, "1000 m at most"),
        ({"raster": "x.tif"}, "by its own cells"),
        ({"layer": "x"}, "by its own cells"),
    ],
)
def test_wrong_requests_are_refused(library: Path, words: dict[str, object], message: str) -> None:
    before = library.read_bytes()
    with pytest.raises(ParameterError, match=message):
        uavseg.recognise(seen_from(DISC, 4), library, **words)
    assert library.read_bytes() == before


def test_wrong_libraries_are_refused(tmp_path: Path) -> None:
    REGIONS.to_file(tmp_path / "nameless.gpkg")
    with pytest.raises(RegionError, match="column 'name'"):
        uavseg.recognise(seen_from(DISC, 4), tmp_path / "nameless.gpkg")
    with pytest.raises(RegionError, match="does not exist"):
        uavseg.recognise(seen_from(DISC, 4), tmp_path / "none.gpkg")


@pytest.mark.slow
def test_a_library_with_a_crs_learns_in_metres_around_centroids(library: Path, tmp_path: Path) -> None:
    on_ground, local = tmp_path / "ground.gpkg", geopandas.read_file(library)
    named = REGIONS.assign(name=["disc", "bar", "ell"], since=pandas.Timestamp("2020-02-02"))
    named.to_crs("EPSG:3857").to_file(on_ground)
    with pytest.warns(UserWarning, match="had a CRS"):
        uavseg.recognise(seen_from(BAR, 4), on_ground, learn="bar", ids=[1])
    frame = geopandas.read_file(on_ground)
    assert frame.crs is None and frame["name"].tolist() == ["disc", "bar", "ell", "bar"]
    assert frame["kind"].tolist()[:3] == ["a", "b", "c"] and frame["since"].str.startswith("2020").sum() == 3
    assert frame.area.tolist()[:3] == pytest.approx([DISC.area, BAR.area, ELL.area], rel=2e-3)  # scale of UTM
    assert np.allclose(shapely.get_coordinates(frame.centroid), 0, atol=1e-6)
    assert local.columns.isin(frame.columns).all()
    for shape, name in ((DISC, "disc"), (ELL, "ell")):
        assert uavseg.recognise(seen_from(shape, 4), on_ground).frame()["name"].tolist() == [name]


def test_an_example_that_was_seen_in_part_is_learned_with_a_warning(tmp_path: Path) -> None:
    with pytest.warns(UserWarning, match="was not seen"):
        uavseg.recognise(seen_from(DISC, 1), tmp_path / "library.gpkg", learn="disc", ids=[1])


@pytest.mark.slow
def test_a_damaged_texture_is_none(library: Path, tmp_path: Path) -> None:
    frame = geopandas.read_file(library)
    frame["texture"] = ["1 2 3", "x " * 80, "-1 " * 80]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        frame.to_file(tmp_path / "other.gpkg")
    found = uavseg.recognise(seen_from(DISC, 4), tmp_path / "other.gpkg").frame()
    assert found["nearest"].tolist() == ["disc"]


@pytest.mark.slow
def test_the_command_names_what_it_learned(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    box = GeoBox((SIDE, SIDE), Affine.identity(), None)
    write_geotiff("map.tif", [seen_from(DISC, 4).astype(np.float32)], box, ["occupancy"])

    def run(line: str) -> tuple[int, str]:
        result = CliRunner().invoke(main, line.split())
        return result.exit_code, result.output

    assert run("describe map.tif -o things.gpkg")[0] == 0
    assert "regions     1 -> l.gpkg" in run("recognise map.tif --library l.gpkg --learn disc --ids 1")[1]
    code, output = run("recognise map.tif --library l.gpkg -o named.gpkg")
    assert code == 0 and "disc        1" in output
    assert "exists" in run("recognise map.tif --library l.gpkg -o named.gpkg")[1]
    assert run("recognise map.tif --library l.gpkg -o l.gpkg --overwrite")[0] == 1
    assert run("recognise map.tif --library l.gpkg")[0] == 2
    assert run("recognise map.tif --library l.gpkg --learn disc")[0] == 2
    assert run("recognise map.tif --library l.gpkg --learn disc --ids 1 -o x.gpkg")[0] == 2
    assert run("describe map.tif -o described.txt")[0] == 1
    names = {"l.gpkg", "map.tif", "named.gpkg", "things.gpkg"}
    assert {path.name for path in tmp_path.iterdir()} == names
