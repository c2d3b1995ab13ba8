"""NaN and infinity from outside: every option, argument, value and file refuses them, by name."""

import dataclasses
import inspect
import io
import json
import math
import re
import shutil
import warnings
import zipfile
from collections.abc import Callable, Iterator
from contextlib import chdir
from dataclasses import replace
from pathlib import Path
from typing import Any

import click
import geopandas
import numpy as np
import pytest
import rasterio
import shapely
from click.testing import CliRunner
from rasterio.transform import from_origin

import uavseg
from tests.flight.link.link_missions import FENCE, RALLY, survey
from tests.photographs.make import draw_photograph
from tests.photographs.test_read import PHOTO
from uavseg.cli import main
from uavseg.errors import MissionError, UavsegError
from uavseg.flight.camera.camera import Camera, Overlap, Photos
from uavseg.flight.formats.files import FORMATS, read_mission
from uavseg.flight.formats.options import FileOptions
from uavseg.flight.link.messages import (
    LinkItem,
    fence_of_items,
    home_of_row,
    items_of_fence,
    items_of_mission,
    items_of_rally,
    mission_items,
    rally_of_items,
)
from uavseg.flight.mission.items import (
    FRAME_MISSION,
    MOUNT_CONTROL,
    FenceCircle,
    FencePolygon,
    HomePosition,
    MissionItem,
    RallyPoint,
)
from uavseg.flight.mission.mission import Mission
from uavseg.flight.mission.vehicle import ARDUCOPTER
from uavseg.flight.params.plan import (
    CorridorParams,
    LimitParams,
    OrbitParams,
    PerimeterParams,
    PlanParams,
    SafetyParams,
    SurveyParams,
    TerrainParams,
    VisitParams,
)

VALUES = ("nan", "inf", "-inf")
OUTLINE = [(8.001, 47.001), (8.003, 47.001), (8.003, 47.002), (8.001, 47.002)]
SPACING = "--altitude 60 --spacing 25"
CAMERA = "--sensor 13.2x8.8 --image 5472x3648 --focal 8.8"
TAKEN = f"--altitude 60 {CAMERA}"
OPTIONS = {  # of a command: lines in which # is the number
    "plan": [
        "--altitude #",
        *(f"--altitude 60 --home {place}" for place in ("#,8", "47,#", "47,8,#")),
        *(f"--altitude 60 {one} #" for one in ("--speed", "--tolerance", "--avoid-margin", "--endurance")),
        *(f"--altitude 60 {one} #" for one in ("--reserve", "--max-altitude", "--max-distance", "--fence")),
        *(f"--altitude 60 --rally {place}" for place in ("#,8,30", "47,#,30", "47,8,#")),
        *(f"--altitude 60 {one} #" for one in ("--spacing", "--climb", "--descent", "--terrain-tolerance")),
        *(f"--altitude 60 --dem dem.tif {one} #" for one in ("--climb", "--descent", "--terrain-tolerance")),
        *("--altitude 60 --wind #", "--altitude 60 --wind 5,#"),
        *(f"{SPACING} {one} #" for one in ("--angle", "--margin", "--turnaround")),
        *(f"{SPACING} --pattern corridor {one} #" for one in ("--margin", "--width")),
        *(f"--altitude 60 --avoid regions.geojson {one} #" for one in ("--zone-width", "--zone-height")),
        "--altitude 60 --pattern orbit --margin #",
        "--altitude 60 --pattern perimeter --offset #",
        "--altitude 60 --pattern perimeter --min-leg #",
        "--altitude 60 --pattern visit --hold #",
        f"{CAMERA} --gsd #",
        *(f"{TAKEN} --overlap {both}" for both in ("#,70", "75,#")),
        *(f"{TAKEN} {one} #" for one in ("--gimbal-pitch", "--min-interval", "--shutter")),
        f"{TAKEN} --shutter 1/#",
        *(
            "--altitude 60 --gimbal-pitch #",
            "--altitude 60 --gimbal-pitch -90,#",
            "--altitude 60 --overlap #,70",
            "--altitude 60 --shutter #",
        ),
        *(f"--altitude 60 {CAMERA.replace(old, '#', 1)}" for old in ("13.2", "5472", "3648")),
        f"--altitude 60 {CAMERA.replace('x8.8', 'x#')}",
        "--altitude 60 --sensor 13.2x8.8 --image 5472x3648 --focal #",
        *(f"--altitude 60 --raster dem.tif --avoid {both}" for both in ("#,1", "0.5,#")),
        "--altitude 60 --where area_m2>#",
    ],
    "check": [
        *("--avoid #,1", "--avoid-margin #", "--max-altitude #", "--max-distance #", "--wind #"),
        *(f"--avoid regions.geojson {one} #" for one in ("--zone-width", "--zone-height")),
        *(f"--photos a.jpg --home {place}" for place in ("#,8", "47,#", "47,8,#")),
    ],
    "footprints": [f"--home {place}" for place in ("#,8", "47,#", "47,8,#")],
    "resume": ["--from #", "--from 47,#", "--from #,8"],
    "georeference": ["--resolution #", *(f"--home {place}" for place in ("#,8", "47,#", "47,8,#"))],
    "upload": ["--connect udpout:127.0.0.1:9 --timeout #"],
    "download": ["--connect udpout:127.0.0.1:9 --timeout #"],
}
NO_NUMBERS = {  # options that are texts without numbers in them
    *("output", "camera", "vehicle", "dem", "dji_model", "lens", "ids", "classes", "avoid_classes"),
    *("raster", "layer", "connect", "mission_classes", "allow_path", "photos", "gaps", "regions"),
}
FIXED = {
    "plan": "--overwrite -o out.plan regions.geojson",
    "check": "small.plan",
    "footprints": "-o out.plan.geojson a.jpg",
    "resume": "small.plan -o out.plan",
    "georeference": "-o out.plan.tif a.jpg",
    "upload": "small.plan",
    "download": "-o out.plan",
}


@pytest.fixture(scope="module")
def drawn(tmp_path_factory: pytest.TempPathFactory) -> Path:
    with chdir(tmp_path_factory.mktemp("drawn")):
        Path("regions.geojson").write_text(json.dumps(regions()))
        Path("small.plan").write_bytes(FORMATS[".plan"].write(small("px4"), FileOptions()))
        draw_photograph("a.jpg", PHOTO)
        write_dem(np.full((200, 200), 400.0))
        return Path.cwd()


@pytest.fixture(autouse=True)
def folder(drawn: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    shutil.copytree(drawn, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def regions() -> dict[str, Any]:
    geometry = {"type": "Polygon", "coordinates": [[*OUTLINE, OUTLINE[0]]]}
    feature = {"type": "Feature", "properties": {"mean": 0.5}, "geometry": geometry}
    return {"type": "FeatureCollection", "features": [feature]}


def small(autopilot: str) -> Mission:
    """Two waypoints with everything that a format can hold of them."""
    items = list(survey(6, autopilot).items)
    tilted = MissionItem(MOUNT_CONTROL, FRAME_MISSION, (-80.0, 0.0, 0.0, 0.0), altitude_m=2.0)
    items[2] = replace(items[2], params=(2.5, 0.0, 0.0, 91.5))
    trigger = MissionItem(206, FRAME_MISSION, (12.5, 0.0, 1.0, 0.0))
    return replace(survey(6, autopilot), items=(*items[:2], tilted, items[2], trigger, *items[4:]))


def write_dem(heights: np.ndarray[Any, Any], **how: Any) -> None:
    place = from_origin(7.99, 47.01, 1e-4, 1e-4)
    shape = {"width": 200, "height": 200, "count": 1, "dtype": "float32"}
    with rasterio.open("dem.tif", "w", driver="GTiff", crs="EPSG:4326", transform=place, **shape) as file:
        file.write(heights.astype(np.float32), 1)
        for name, value in how.items():
            setattr(file, name, (value,))


def refused(act: Callable[[], Any]) -> str:
    """The sentence with which something is refused."""
    with pytest.raises(UavsegError) as error:
        act()
    return str(error.value)


# Options and arguments


@pytest.mark.parametrize(
    ("command", "line"), [(command, line) for command, lines in OPTIONS.items() for line in lines]
)
def test_an_option_refuses_them_by_name(command: str, line: str) -> None:
    option = line.partition("#")[0].split("--")[-1].split()[0]
    for value in VALUES:
        home = [] if "--home" in line or command != "plan" else ["--home", "47,8"]
        words = [*FIXED[command].split(), *home, *(part.replace("#", value) for part in line.split())]
        found = CliRunner().invoke(main, [command, *words])
        last = found.stderr.strip().splitlines()[-1]
        assert found.exit_code in (1, 2), (words, found.output)
        assert value.lstrip("-") in last or f"--{option}" in last or "--dem" in last, last
    assert not Path("out.plan").exists()


@pytest.mark.parametrize("command", OPTIONS)
def test_every_option_that_may_hold_a_number_is_in_the_table(command: str) -> None:
    known = {word for line in OPTIONS[command] for word in line.split() if word.startswith("--")}
    for option in main.get_command(click.Context(main), command).params:
        classes = click.types.FloatParamType | click.types.StringParamType
        if isinstance(option.type, classes) and option.name not in NO_NUMBERS:
            assert not isinstance(option, click.Option) or set(option.opts) & known, option.opts


@pytest.mark.parametrize(
    ("call", "arguments"),
    [
        (uavseg.plan, {"regions": "regions.geojson", "home": (47, 8, 400), "altitude": 60}),
        (uavseg.check, {"mission": "small.plan"}),
        (uavseg.check, {"mission": "small.plan", "photos": "a.jpg", "home": (47, 8, 400)}),
        (uavseg.footprints, {"photographs": "a.jpg", "home": (47, 8, 400)}),
        (uavseg.resume, {"mission": "small.plan"}),
        (
            uavseg.georeference,
            {"photographs": "a.jpg", "output": "out.plan.tif", "resolution": 20.0, "home": (47, 8, 400)},
        ),
        (uavseg.upload, {"mission": "small.plan", "connect": "udpout:127.0.0.1:9"}),
        (uavseg.download, {"connect": "udpout:127.0.0.1:9"}),
    ],
)
def test_an_argument_refuses_them(call: Callable[..., Any], arguments: dict[str, Any]) -> None:
    numbers = [name for name, one in inspect.signature(call).parameters.items() if "float" in one.annotation]
    assert numbers
    for name in numbers:
        for value in map(float, VALUES):
            for given in (value, [value, 1.0], [1.0, value], [[1.0, 2.0, value]]):
                refused(lambda given=given, name=name: call(**{**arguments, name: given}))  # type: ignore[misc]


# Values

CAMERA_OF = Camera("mine", (13.2, 8.8), (5472, 3648), 8.8, 2.0)
CHECKED = [
    HomePosition(47.0, 8.0, 400.0),
    MissionItem(16, 3, (1.0, 2.0, 3.0, 4.0), 47.0, 8.0, 50.0),
    FenceCircle(47.0, 8.0, 50.0),
    FencePolygon(((47.0, 8.0), (47.1, 8.0), (47.1, 8.1))),
    RallyPoint(47.0, 8.0, 30.0),
    replace(survey(), endurance_s=600.0),
    CAMERA_OF,
    Overlap(75.0, 70.0),
    Photos(CAMERA_OF),
    replace(ARDUCOPTER, hover_w=100.0, cruise_w=90.0, battery_wh=80.0),
    VisitParams(),
    PerimeterParams(1.0, 2.0),
    SurveyParams(1.0, False, 1.0),
    CorridorParams(1.0, 2.0),
    OrbitParams(1.0),
    LimitParams(20.0, 20.0),
    SafetyParams(max_distance_m=1000.0, zone_height_m=20.0),
    PlanParams(50.0, "survey", spacing_m=25.0, angle_deg=10.0, tolerance_m=1.0),
    TerrainParams(None, "frame", None, 2.0, 2.0),
]


def with_one(value: Any, number: float) -> Iterator[Any]:
    """A number, or a nested tuple of numbers, with one of them replaced."""
    if isinstance(value, float):
        yield number
    elif isinstance(value, tuple):
        for k, part in enumerate(value):
            yield from ((*value[:k], other, *value[k + 1 :]) for other in with_one(part, number))


@pytest.mark.parametrize("value", CHECKED, ids=lambda value: type(value).__name__)
def test_a_value_cannot_be_made_of_them(value: Any) -> None:
    tried = 0
    for field in dataclasses.fields(value):
        for number in map(float, VALUES):
            for other in with_one(getattr(value, field.name), number):
                said = refused(lambda field=field, other=other: replace(value, **{field.name: other}))  # type: ignore[misc]
                assert "nan" in said or "inf" in said, said
                tried += 1
    assert tried


def test_a_tolerance_above_the_ground_refuses_them() -> None:
    for number in map(float, VALUES):
        terrain = TerrainParams(None, "frame", number)
        assert f"not {number:g}" in refused(lambda terrain=terrain: PlanParams(50.0, terrain=terrain))  # type: ignore[misc]


# Files

NUMBER = re.compile(r"(?<![\w.#-])-?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?(?![\w.])")
IN_JSON = {"nan": "NaN", "inf": "Infinity", "-inf": "-Infinity"}


def content_of(suffix: str) -> bytes:
    mission = small("px4" if suffix != ".waypoints" else "ardupilot")
    if suffix in (".plan", ".kml", ".geojson"):
        mission = replace(mission, fence=FENCE, rally=RALLY[:1])
    return FORMATS[suffix].write(mission, FileOptions())


def changed(content: bytes, values: list[str]) -> Iterator[tuple[str, list[bytes]]]:
    """Contents with one number replaced by each of some values, and where it is; of a zip, its files."""
    if content[:2] == b"PK":
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            files = {name: archive.read(name) for name in archive.namelist()}
        for name in files:
            for where, texts in changed(files[name], values):
                yield f"{name}: {where}", [zipped({**files, name: text}) for text in texts]
        return
    text = content.decode()
    for found in NUMBER.finditer(text):
        start, end = text[: found.start()], text[found.end() :]
        yield start[-60:] + found[0], [f"{start}{value}{end}".encode() for value in values]


def zipped(files: dict[str, bytes]) -> bytes:
    whole = io.BytesIO()
    with zipfile.ZipFile(whole, "w") as archive:
        for name, data in files.items():
            archive.writestr(name, data)
    return whole.getvalue()


def read(content: bytes, suffix: str) -> Mission | None:
    path = Path(f"changed{suffix}")
    path.write_bytes(content)
    try:
        return read_mission(path)
    except MissionError:
        return None


@pytest.mark.slow
@pytest.mark.parametrize("suffix", FORMATS)
def test_a_number_of_a_mission_file_that_counts_is_finite(suffix: str) -> None:
    """A number does not count where another one makes no other mission either, as in a drawing.

    A flag of a .kmz is 1 or not: NaN is then read as 77 is.
    """
    is_json = suffix in (".plan", ".geojson")
    values = [IN_JSON[value] if is_json else value for value in VALUES]
    content, tried = content_of(suffix), 0
    whole = read(content, suffix)
    assert whole is not None
    for where, texts in changed(content, ["77", *values, *(["1e999"] if is_json else [])]):
        finite = read(texts[0], suffix)
        if finite != whole or finite.notes != whole.notes:
            others = [read(text, suffix) for text in texts[1:]]
            assert all(one is None or (suffix == ".kmz" and one == finite) for one in others), where
            tried += 1
    assert tried > 15


OBJECTS = {
    "camera": {
        "sensor_width_mm": 13.2,
        "sensor_height_mm": 8.8,
        "image_width_px": 5472,
        "image_height_px": 3648,
        "focal_mm": 8.8,
        "min_interval_s": 2.0,
    },
    "vehicle": {"acceleration_m_s2": 2.5, "hover_w": 100.0, "cruise_w": 90.0, "battery_wh": 80.0},
}


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "key"), [(kind, key) for kind, one in OBJECTS.items() for key in one])
def test_a_camera_and_a_vehicle_of_a_file_refuse_them(kind: str, key: str) -> None:
    plan: dict[str, Any] = {"home": (47, 8, 400), "altitude": 60, kind: "it.json"}
    for value in (*IN_JSON.values(), "1e999"):
        text = json.dumps({**OBJECTS[kind], key: "#"}).replace('"#"', value)
        Path("it.json").write_text(text)
        assert re.search("nan|inf|large", refused(lambda: uavseg.plan("regions.geojson", **plan)))
    Path("it.json").write_text(json.dumps(OBJECTS[kind]))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        uavseg.plan("regions.geojson", **plan)


@pytest.mark.parametrize("value", [*IN_JSON.values(), "1e999"])
@pytest.mark.parametrize("corner", ["8.003", "47.002"])
def test_an_outline_in_a_file_refuses_them(corner: str, value: str) -> None:
    Path("odd.geojson").write_text(json.dumps(regions()).replace(corner, value))
    here: dict[str, Any] = {"home": (47, 8, 400), "altitude": 60}
    for act in (
        lambda: uavseg.plan("odd.geojson", **here),
        lambda: uavseg.plan(Path("odd.geojson").read_bytes(), **here),
        lambda: uavseg.plan("regions.geojson", avoid="odd.geojson", **here),
        lambda: uavseg.check("small.plan", avoid="odd.geojson"),
    ):
        assert "\n" not in refused(act)


@pytest.mark.parametrize("value", list(map(float, VALUES)))
def test_an_outline_in_memory_refuses_them(value: float) -> None:
    corners = [*OUTLINE[:2], (8.003, value), OUTLINE[3]]
    with np.errstate(invalid="ignore"):
        frame = geopandas.GeoDataFrame(geometry=[shapely.Polygon(corners)], crs=4326)
    here: dict[str, Any] = {"home": (47, 8, 400), "altitude": 60}
    assert re.search("nan|inf|finite", refused(lambda: uavseg.plan(frame, **here)))
    assert re.search("nan|inf|finite", refused(lambda: uavseg.plan("regions.geojson", avoid=frame, **here)))


@pytest.mark.parametrize("value", list(map(float, VALUES)))
@pytest.mark.parametrize("name", ["area_m2", "lon", "lat"])
def test_attributes_of_regions_that_are_not_finite_are_computed(name: str, value: float) -> None:
    frame = geopandas.GeoDataFrame.from_features(regions(), crs=4326)
    plain = uavseg.plan(frame, home=(47, 8, 400), altitude=60)
    odd = uavseg.plan(frame.assign(**{name: value}), home=(47, 8, 400), altitude=60, where="area_m2 > 1")
    assert odd.missions == plain.missions


@pytest.mark.parametrize("value", list(map(float, VALUES)))
def test_ground_that_is_not_a_finite_height_is_a_hole(value: float) -> None:
    heights = np.full((200, 200), 400.0)
    heights[75:95, 105:145] = value
    write_dem(heights)
    assert "with a hole there" in refused(
        lambda: uavseg.plan("regions.geojson", home=(47, 8, 400), altitude=60, dem="dem.tif")
    )
    heights[:] = value
    write_dem(heights)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        assert "with a hole there" in str(uavseg.check("small.plan", dem="dem.tif").problems)


@pytest.mark.parametrize("value", list(map(float, VALUES)))
@pytest.mark.parametrize("name", ["scales", "offsets"])
def test_a_scale_of_an_elevation_model_is_finite(name: str, value: float) -> None:
    write_dem(np.full((200, 200), 400.0), **{name: value})
    said = refused(lambda: uavseg.plan("regions.geojson", home=(47, 8, 400), altitude=60, dem="dem.tif"))
    assert f"{value:g}" in said


# A vehicle


@pytest.mark.parametrize("value", [math.inf, -math.inf])
@pytest.mark.parametrize("has_home_row", [True, False])
def test_a_mission_of_a_vehicle_refuses_infinity(value: float, has_home_row: bool) -> None:
    rows = items_of_mission(survey(), has_home_row)[has_home_row:]
    for number, row in enumerate(rows):
        for change in (
            {"z": value},
            *({"params": (*row.params[:n], value, *row.params[n + 1 :])} for n in range(4)),
        ):
            held = [*rows[:number], replace(row, **change), *rows[number + 1 :]]  # type: ignore[arg-type]
            assert "inf" in refused(lambda held=held: mission_items(held, has_home_row))  # type: ignore[misc]


@pytest.mark.parametrize("value", list(map(float, VALUES)))
def test_heights_and_sizes_of_a_vehicle_refuse_them(value: float) -> None:
    first = items_of_mission(survey(), True)[0]
    assert f"{value:g}" in refused(lambda: home_of_row(replace(first, z=value)))
    assert f"{value:g}" in refused(lambda: rally_of_items([replace(items_of_rally(RALLY)[0], z=value)]))
    for shape in FENCE:
        held = items_of_fence([shape])
        size = None if math.isnan(value) else value  # NaN on the link
        sized = [LinkItem(one.command, one.frame, (size, 0.0, 0.0, 0.0), one.x, one.y) for one in held]
        refused(lambda sized=sized: fence_of_items(sized))  # type: ignore[misc]
