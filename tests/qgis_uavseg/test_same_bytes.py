"""Each algorithm, run by `qgis_process`, writes the bytes that the command line writes."""

import json
from pathlib import Path
from typing import Any

import geopandas
import pytest
from shapely.geometry import Point

SAMPLES = Path(__file__).resolve().parents[2] / "samples"
QUARRY, SHORE, FIELDS = SAMPLES / "quarry.tif", SAMPLES / "shore.tif", SAMPLES / "fields_rgb.tif"
WETLANDS = SAMPLES / "wetlands.tif"
NAMES = "red,green,blue,nir"

# algorithm, parameters, names of outputs, words on the command line before its outputs
CASES: dict[str, tuple[str, dict[str, Any], dict[str, str], list[object]]] = {
    "range": ("extract", {"INPUT": QUARRY}, {"OUTPUT": "o.gpkg"}, ["extract", QUARRY, "--range", "0.55,1"]),
    "options": (
        "extract",
        {
            "INPUT": SHORE,
            "RANGE": "0.5,1",
            "MIN_AREA": "50",
            "FILL_HOLES": "10px",
            "SMOOTH_OUTLINE": 1,
            "REFINE": "scan",
        },
        {"OUTPUT": "land.geojson", "LABELS": "land.tif"},
        [
            "extract",
            SHORE,
            *[
                "--range",
                "0.5,1",
                "--min-area",
                "50",
                "--fill-holes",
                "10px",
                "--smooth-outline",
                "1",
                "--refine",
                "scan",
            ],
        ],
    ),
    "what is looked at": (
        "extract",
        {
            "INPUT": SHORE,
            "RANGE": "0.5,1",
            "THIN_LINES": True,
            "FLATTEN": "200px",
            "MIN_CONFIDENCE": 0.4,
        },
        {"OUTPUT": "o.gpkg"},
        [
            "extract",
            SHORE,
            "--range",
            "0.5,1",
            *("--thin-lines", "--flatten", "200px", "--min-confidence", "0.4"),
        ],
    ),
    "open values": (
        "extract",
        {"INPUT": QUARRY, "RANGE": "140,nan", "RANGE_IN": 1},
        {"OUTPUT": "o.fgb"},
        ["extract", QUARRY, "--values", "140,"],
    ),
    "percentiles": (
        "extract",
        {"INPUT": QUARRY, "RANGE": "90,100", "RANGE_IN": 2, "BAND": 1},
        {"OUTPUT": "o.shp"},
        ["extract", QUARRY, "--percentile", "90,100", "--band", "1"],
    ),
    "index": (
        "extract",
        {"INPUT": WETLANDS, "RANGE": "0.5,1", "INDEX": "ndwi", "BAND_NAMES": NAMES, "MIN_AREA": "4000"},
        {"OUTPUT": "water.gpkg"},
        [
            "extract",
            WETLANDS,
            "--range",
            "0.5,1",
            "--index",
            "ndwi",
            "--band-names",
            NAMES,
            "--min-area",
            "4000",
        ],
    ),
    "expression": (
        "extract",
        {
            "INPUT": WETLANDS,
            "RANGE": "0.5,1",
            "EXPRESSION": "(green - nir) / (green + nir)",
            "BAND_NAMES": NAMES,
        },
        {"OUTPUT": "water.fgb"},
        [
            "extract",
            WETLANDS,
            "--range",
            "0.5,1",
            "--expr",
            "(green - nir) / (green + nir)",
            "--band-names",
            NAMES,
        ],
    ),
    "classes": (
        "extract",
        {"INPUT": QUARRY, "CLASSES": "dark,0,0.3,light,0.3,1"},
        {"OUTPUT": "classes.gpkg"},
        ["extract", QUARRY, "--class", "dark=0,0.3", "--class", "light=0.3,1"],
    ),
    "width": (
        "levels",
        {"INPUT": QUARRY, "WIDTH": 0.2, "MIN_AREA": "50", "DETAIL": "3"},
        {"OUTPUT": "levels.gpkg", "LABELS": "levels.tif"},
        ["levels", QUARRY, "--width", "0.2", "--min-area", "50", "--detail", "3"],
    ),
    "breaks": (
        "levels",
        {"INPUT": QUARRY, "BREAKS": "otsu:3", "REFINE": "none"},
        {"OUTPUT": "levels.geojson"},
        ["levels", QUARRY, "--breaks", "otsu:3", "--refine", "none"],
    ),
    "disc": (
        "match",
        {"INPUT": FIELDS, "PLACE": "548225,6471890", "RADIUS": 4, "SIMILARITY": 0.85},
        {"OUTPUT": "like.gpkg"},
        ["match", FIELDS, "--like", "548225,6471890,4", "--similarity", "0.85"],
    ),
}


def _files(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in sorted(folder.iterdir())}


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_the_bytes_are_those_of_the_command_line(case: str, qgis: Any, tmp_path: Path) -> None:
    algorithm, parameters, outputs, words = CASES[case]
    ours, theirs = tmp_path / "qgis", tmp_path / "typed"
    ours.mkdir()
    theirs.mkdir()
    flags = {"OUTPUT": "--output", "LABELS": "--labels"}
    answer = qgis.run(algorithm, **parameters, **{name: ours / file for name, file in outputs.items()})
    assert answer.code == 0, answer.log
    qgis.typed(*words, *(word for name, file in outputs.items() for word in (flags[name], theirs / file)))
    assert _files(ours) == _files(theirs)
    assert set(outputs.values()) <= set(_files(ours))
    assert answer.results["COUNT"] > 0


@pytest.fixture(scope="module")
def occupancy_map(qgis: Any, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path: Path = tmp_path_factory.mktemp("map") / "map.tif"
    qgis.typed("simulate", "circles", "-o", path)
    return path


@pytest.mark.slow
def test_states_and_objects_are_those_of_the_command_line(
    qgis: Any, occupancy_map: Path, tmp_path: Path
) -> None:
    ours, theirs = tmp_path / "qgis", tmp_path / "typed"
    ours.mkdir()
    theirs.mkdir()
    answer = qgis.run(
        "classify", INPUT=occupancy_map, STRETCH="none", OUTPUT=ours / "s.tif", OBJECTS=ours / "o.gpkg"
    )
    assert answer.code == 0, answer.log
    qgis.typed(
        "classify", occupancy_map, "--stretch", "none", "-o", theirs / "s.tif", "--objects", theirs / "o.gpkg"
    )
    assert _files(ours) == _files(theirs)


@pytest.mark.slow
def test_a_path_is_that_of_the_command_line(qgis: Any, occupancy_map: Path, tmp_path: Path) -> None:
    places = {"START": "0.715,1.595", "GOAL": "2.135,0.305"}
    answer = qgis.run("path", INPUT=occupancy_map, **places, SMOOTH=True, OUTPUT=tmp_path / "a.geojson")
    assert answer.code == 0, answer.log
    words = [word for name, place in places.items() for word in (f"--{name.lower()}", place)]
    qgis.typed("path", occupancy_map, "--range", "0,0.45", *words, "--smooth", "-o", tmp_path / "b.geojson")
    assert (tmp_path / "a.geojson").read_bytes() == (tmp_path / "b.geojson").read_bytes()
    length = json.loads((tmp_path / "b.geojson").read_text())["features"][0]["properties"]["length_m"]
    assert answer.results["LENGTH"] == length


@pytest.mark.slow
def test_ranges_are_those_of_the_command_line(qgis: Any, tmp_path: Path) -> None:
    files = {"JSON": tmp_path / "r.json", "PICTURE": tmp_path / "r.png", "REPORT": tmp_path / "r.html"}
    answer = qgis.run("suggest", INPUT=QUARRY, CLASSES="3", **files)
    assert answer.code == 0, answer.log
    printed = qgis.typed("suggest", QUARRY, "--classes", "3", "--json", "-o", tmp_path / "typed.png")
    assert files["JSON"].read_text(encoding="utf-8") == printed
    assert files["PICTURE"].read_bytes() == (tmp_path / "typed.png").read_bytes()
    ranges = json.loads(printed)["ranges"]
    assert answer.results["RANGES"] == ";".join(f"{part['low']:g},{part['high']:g}" for part in ranges)
    assert files["REPORT"].read_text(encoding="utf-8").count("<tr>") == 1 + len(ranges) == 4


@pytest.mark.slow
def test_the_range_of_a_sample_is_that_of_the_command_line(qgis: Any, tmp_path: Path) -> None:
    files = {"JSON": tmp_path / "r.json", "REPORT": tmp_path / "r.html"}
    disc = {"PLACE": "488200,5207300", "RADIUS": 60}
    answer = qgis.run("suggestlike", INPUT=WETLANDS, **disc, BANDS="1,2,3,4", **files)
    assert answer.code == 0, answer.log
    words = ["suggest", WETLANDS, "--like", "488200,5207300,60", "--bands", "1,2,3,4", "--json"]
    printed = qgis.typed(*words)
    assert files["JSON"].read_text(encoding="utf-8") == printed
    ranges = json.loads(printed)["ranges"]
    first, found = ranges[0], answer.results
    assert files["REPORT"].read_text(encoding="utf-8").count("<tr>") == 1 + len(ranges) == 1 + found["COUNT"]
    low, high = ("" if end is None else f"{end:.10g}" for end in (first["value_low"], first["value_high"]))
    assert found["RANGE"] == f"{low},{high}"
    named = {"BAND": "band", "INDEX": "index", "EXPRESSION": "expr"}
    assert {word: found[name] for name, word in named.items() if found[name]} == {
        word: str(value) for word, value in first["words"].items()
    }


@pytest.fixture(scope="module")
def regions(qgis: Any, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path: Path = tmp_path_factory.mktemp("regions") / "pits.gpkg"
    qgis.typed("extract", QUARRY, "--range", "0.55,1", "-o", path)
    return path


@pytest.fixture
def folders(tmp_path: Path) -> tuple[Path, Path]:
    """Folders of what QGIS and the command line write."""
    ours, theirs = tmp_path / "qgis", tmp_path / "typed"
    ours.mkdir()
    theirs.mkdir()
    return ours, theirs


@pytest.mark.slow
def test_regions_like_polygons_are_those_of_the_command_line(
    qgis: Any, regions: Path, folders: tuple[Path, Path]
) -> None:
    ours, theirs = folders
    answer = qgis.run(
        "match", INPUT=QUARRY, SAMPLE=regions, ANSWER=1, OUTPUT=ours / "o.gpkg", LABELS=ours / "o.tif"
    )
    assert answer.code == 0, answer.log
    words = ("--like", regions, "--answer", "1", "-o", theirs / "o.gpkg", "--labels", theirs / "o.tif")
    qgis.typed("match", QUARRY, *words)
    assert _files(ours) == _files(theirs)
    assert answer.results["COUNT"] > 0


def _discs(path: Path, crs: str, *discs: tuple[float, float, float]) -> Path:
    geometry = [Point(x, y).buffer(radius) for x, y, radius in discs]
    geopandas.GeoDataFrame(geometry=geometry, crs=crs).to_file(path)
    return path


@pytest.mark.slow
def test_levels_of_a_real_picture_are_those_of_the_command_line(
    qgis: Any, shared_data: Path, folders: tuple[Path, Path]
) -> None:
    """Sea ice: ice, melt ponds and water."""
    source, (ours, theirs) = shared_data / "labelled" / "pond0.tif", folders
    options = {"BREAKS": "otsu:3", "MIN_AREA": "64px", "SMALL": "drop"}
    answer = qgis.run("levels", INPUT=source, **options, OUTPUT=ours / "o.fgb", LABELS=ours / "o.tif")
    assert answer.code == 0, answer.log
    words = [
        word for name, value in options.items() for word in (f"--{name.lower().replace('_', '-')}", value)
    ]
    qgis.typed("levels", source, *words, "-o", theirs / "o.fgb", "--labels", theirs / "o.tif")
    assert _files(ours) == _files(theirs)
    assert answer.results["COUNT"] > 3


@pytest.mark.slow
def test_regions_and_ranges_of_a_real_sample_are_those_of_the_command_line(
    qgis: Any, shared_data: Path, tmp_path: Path, folders: tuple[Path, Path]
) -> None:
    """A clearing in a forest, drawn as polygons; what is not sought is drawn too."""
    source, (ours, theirs) = shared_data / "imagery" / "naip_forest_gap_1m.tif", folders
    clearing = _discs(tmp_path / "clearing.gpkg", "EPSG:26917", (768369, 4057062, 20), (768349, 4057042, 9))
    forest = _discs(tmp_path / "forest.gpkg", "EPSG:26917", (768384, 4057205, 12))
    answer = qgis.run("match", INPUT=source, SAMPLE=clearing, BY="texture", OUTPUT=ours / "o.gpkg")
    assert answer.code == 0, answer.log
    qgis.typed("match", source, "--like", clearing, "--by", "texture", "-o", theirs / "o.gpkg")
    answer = qgis.run("suggestlike", INPUT=source, SAMPLE=clearing, UNLIKE=forest, JSON=ours / "r.json")
    assert answer.code == 0, answer.log
    printed = qgis.typed("suggest", source, "--like", clearing, "--unlike", forest, "--json")
    (theirs / "r.json").write_text(printed, encoding="utf-8")
    assert _files(ours) == _files(theirs)
    assert answer.results["COUNT"] == len(json.loads(printed)["ranges"]) > 0


@pytest.mark.slow
def test_states_and_a_path_of_a_real_map_are_those_of_the_command_line(
    qgis: Any, shared_data: Path, folders: tuple[Path, Path]
) -> None:
    """A ROS map by its YAML file; a path that is no GeoJSON has the same place and properties."""
    source, (ours, theirs) = shared_data / "maps" / "tb3_sandbox.yaml", folders
    answer = qgis.run("classify", YAML=source, OUTPUT=ours / "s.tif", OBJECTS=ours / "o.gpkg")
    assert answer.code == 0, answer.log
    qgis.typed("classify", source, "-o", theirs / "s.tif", "--objects", theirs / "o.gpkg")
    assert _files(ours) == _files(theirs)
    assert answer.results["COUNT"] > 3
    ends = {"START": "-0.55,-0.55", "GOAL": "0.55,0.55"}
    answer = qgis.run("path", YAML=source, **ends, CLEARANCE=0.1, OUTPUT=ours / "p.gpkg")
    assert answer.code == 0, answer.log
    words = [f"--{name.lower()}={place}" for name, place in ends.items()]
    typed = theirs / "p.geojson"
    qgis.typed("path", source, "--range", "0,0.45", *words, "--clearance", "0.1", "-o", typed)
    found, expected = geopandas.read_file(ours / "p.gpkg"), json.loads(typed.read_text())["features"]
    assert [list(map(list, line.coords)) for line in found.geometry] == [
        feature["geometry"]["coordinates"] for feature in expected
    ]
    assert found["length_m"].tolist() == [feature["properties"]["length_m"] for feature in expected]
    assert answer.results["LENGTH"] == expected[0]["properties"]["length_m"] > 1.8


@pytest.mark.slow
@pytest.mark.parametrize(
    "suffix",
    [
        "plan",
        *(pytest.param(suffix, marks=pytest.mark.thorough) for suffix in ("waypoints", "kml", "geojson")),
    ],
)
def test_a_mission_is_that_of_the_command_line(suffix: str, qgis: Any, regions: Path, tmp_path: Path) -> None:
    ours, theirs = tmp_path / "qgis", tmp_path / "typed"
    ours.mkdir()
    theirs.mkdir()
    name = f"m.{suffix}"
    answer = qgis.run(
        "plan",
        REGIONS=regions,
        ALTITUDE=60,
        HOME="-122.8272,49.4583 [EPSG:4326]",
        HOME_ALTITUDE=212,
        PATTERN="survey",
        SPACING=40,
        ANGLE=0,
        OUTPUT=ours / name,
    )
    assert answer.code == 0, answer.log
    words = [
        "--altitude",
        "60",
        "--home",
        "49.4583,-122.8272,212",
        "--pattern",
        "survey",
        "--spacing",
        "40",
        "--angle",
        "0",
        "--json",
    ]
    printed = json.loads(qgis.typed("plan", regions, *words, "-o", theirs / name))
    assert _files(ours) == _files(theirs)
    assert answer.results["DISTANCE_M"] == printed["flights"][0]["distance_m"]


@pytest.mark.slow
def test_a_report_is_that_of_the_command_line(qgis: Any, regions: Path, tmp_path: Path) -> None:
    mission = tmp_path / "m.plan"
    qgis.typed("plan", regions, "-o", mission, "--altitude", "60", "--home", "auto")
    answer = qgis.run("check", INPUT=mission, AUTOPILOT="px4", REPORT=tmp_path / "r.json")
    assert answer.code == 0, answer.log
    assert (tmp_path / "r.json").read_text() == qgis.typed("check", mission, "--autopilot", "px4", "--json")
    assert answer.results["OK"] is True


@pytest.mark.slow
def test_gaps_footprints_and_a_map_of_photographs_are_those_of_the_command_line(
    qgis: Any, regions: Path, tmp_path: Path
) -> None:
    from tests.photographs.flown import fly

    mission, photographs = tmp_path / "m.plan", tmp_path / "photographs"
    words = ["--altitude", "60", "--home", "auto", "--camera", "DJI Mavic 3 Enterprise", "--angle", "0"]
    qgis.typed("plan", regions, "-o", mission, *words)
    fly(mission, photographs, without=tuple(range(20, 28)))
    answer = qgis.run(
        "gaps",
        INPUT=mission,
        PHOTOGRAPHS=photographs,
        OUTPUT=tmp_path / "g.geojson",
        FOOTPRINTS=tmp_path / "f.geojson",
    )
    assert answer.code == 0, answer.log
    typed = ("check", mission, "--photos", photographs, "--gaps", tmp_path / "gaps.geojson", "--json")
    coverage = json.loads(qgis.typed(*typed, code=1))["coverage"]
    assert (tmp_path / "g.geojson").read_bytes() == (tmp_path / "gaps.geojson").read_bytes()
    assert answer.results["GAPS"] == coverage["gaps"] > 0 and answer.results["MISSING"] == 8
    qgis.typed("footprints", photographs, "-o", tmp_path / "footprints.geojson")
    assert (tmp_path / "f.geojson").read_bytes() == (tmp_path / "footprints.geojson").read_bytes()
    answer = qgis.run("georeference", PHOTOGRAPHS=photographs, RESOLUTION=200, OUTPUT=tmp_path / "map.tif")
    assert answer.code == 0, answer.log
    qgis.typed("georeference", photographs, "--resolution", "200", "-o", tmp_path / "typed.tif")
    assert (tmp_path / "map.tif").read_bytes() == (tmp_path / "typed.tif").read_bytes()
