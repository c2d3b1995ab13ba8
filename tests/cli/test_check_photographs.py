"""`uavseg check --photos`: what photographs of a flight show, and its gaps as regions for the next flight."""

import json
import math
import warnings
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import geopandas
import numpy as np
import pytest
import rasterio
import shapely
from affine import Affine
from click.testing import CliRunner, Result

import uavseg
from tests.flight.flight_logs import dataflash, ulog
from tests.flight.small_regions import HOME, box
from tests.photographs.make import draw_photograph
from tests.photographs.test_coverage import ACROSS, FIELD, SOUTH, survey
from uavseg.cli import main
from uavseg.errors import ParameterError
from uavseg.flight.camera.camera import camera_named
from uavseg.flight.formats.files import read_mission, write_mission
from uavseg.flight.mission.mission import Mission
from uavseg.photographs.coverage import planned_photographs
from uavseg.photographs.read import Photograph
from uavseg.regions.formats.read import read_regions

LENS = ((120, 80), 80.0)  # the angles of a DJI Phantom 4 Pro
CAMERA = "phantom 4 pro"
SUFFIXES = (".geojson", ".gpkg", ".fgb", ".parquet", ".shp", ".kml")


def check(*arguments: object) -> Result:
    return CliRunner().invoke(main, ["check", *map(str, arguments)])


def write(mission: Mission, path: Path) -> Path:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        write_mission(mission, path)
    return path


def photograph(path: Path, folder: Path, keep: Any = lambda k: True, **changes: Any) -> list[Path]:
    """Draw photographs for the triggers of a mission file, those that are kept."""
    folder.mkdir(exist_ok=True)
    mission = read_mission(path)
    drawn = []
    for k, one in enumerate(planned_photographs(mission, LENS).photographs):
        if keep(k):
            pose = {"altitude_m": mission.home.altitude_m + one.relative_m, "taken_s": 1.6e9 + 3 * k}
            shot = replace(one, exposure_s=1 / 1000, **pose | changes)
            drawn.append(draw_photograph(folder / f"{path.stem}_{k:04d}.jpg", shot))
    return drawn


def plan(regions: object, output: Path, home: tuple[float, ...] = HOME) -> Path:
    """Fly over regions as before."""
    flight = ["--camera", CAMERA, "--altitude", "60", "--home", ",".join(map(str, home)), "--angle", "0"]
    words = ["plan", str(regions), *flight, "-o", str(output)]
    result = CliRunner().invoke(main, words)
    assert result.exit_code == 0, result.output
    return output


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A survey, with photographs of all of its triggers in one folder and of some of them in another."""
    folder = tmp_path_factory.mktemp("flown")
    path = write(survey(), folder / "survey.plan")
    photograph(path, folder / "all")
    photograph(path, folder / "some", lambda k: k % 9 and k < 100)
    geopandas.GeoDataFrame({"id": [1]}, geometry=[FIELD], crs=4326).to_file(folder / "field.geojson")
    return folder


@pytest.mark.slow
def test_all_photographs_are_exit_code_0(flown: Path, tmp_path: Path) -> None:
    gaps = tmp_path / "gaps.geojson"
    result = check(flown / "survey.plan", "--photos", flown / "all", "--gaps", gaps)
    assert result.exit_code == 0, result.output
    rows = dict(line.split("  ", 1) for line in result.stdout.splitlines())
    assert rows["taken"].strip() == "176, for 176 of 176 that are planned"
    assert rows["covered"].strip().startswith("100.00 % of")
    assert rows["gaps"].strip() == "0, 0.0 m2" and rows["blurred"].strip() == "0; 0 not known"
    assert json.loads(gaps.read_text())["features"] == []


@pytest.mark.slow
@pytest.mark.slow
@pytest.mark.parametrize(
    "suffix",
    [".geojson", *(pytest.param(one, marks=pytest.mark.slow) for one in SUFFIXES[1:])],
)
def test_gaps_are_regions_that_plan_takes(flown: Path, tmp_path: Path, suffix: str) -> None:
    gaps = tmp_path / f"gaps{suffix}"
    words = [flown / "survey.plan", "--photos", flown / "some", "--regions", flown / "field.geojson"]
    result = check(*words, "--gaps", gaps, "--json")
    assert result.exit_code == 1
    about = json.loads(result.stdout)["coverage"]
    assert "uavseg plan gaps.geojson" in result.stderr.splitlines()[-1]
    assert "88 of 176 photographs are missing: 2 on the leg to item 6, 1 on" in result.stderr
    found = read_regions(gaps)
    assert found.columns["area_m2"].sum() == pytest.approx(about["gaps_m2"], rel=1e-3)
    assert about["gaps"] == len(found) and 0 < about["covered"] < 0.7
    assert len(about["missing"]) == 88
    again = check(*words, "--gaps", gaps)
    assert again.exit_code == 1 and "exists" in again.stderr.splitlines()[-1]
    before = gaps.read_bytes()
    assert check(*words, "--gaps", gaps, "--overwrite").exit_code == 1
    assert gaps.read_bytes() == before
    plan(gaps, tmp_path / "next.plan")


PLACES: list[tuple[tuple[float, ...], Any]] = [
    (HOME, [FIELD]),
    (HOME, [box(40, 60, 150, 120), box(260, 40, 80, 170)]),
    ((-16.8, 179.9995, 3.0), [ACROSS]),
]


@pytest.mark.slow
@pytest.mark.parametrize(("home", "regions"), PLACES)
def test_the_next_flight_completes_the_first(home: Any, regions: Any, tmp_path: Path) -> None:
    field, gaps, photos = tmp_path / "field.geojson", tmp_path / "gaps.geojson", tmp_path / "photos"
    geopandas.GeoDataFrame({"id": range(len(regions))}, geometry=regions, crs=4326).to_file(field)
    first = plan(field, tmp_path / "first.plan", home)
    count = len(planned_photographs(read_mission(first), LENS).photographs)
    photograph(first, photos, lambda k: k % 7 and k < 0.6 * count)
    words = [first, "--photos", photos, "--regions", field, "-q"]
    assert check(*words, "--gaps", gaps).exit_code == 1
    photograph(plan(gaps, tmp_path / "second.plan", home), photos)
    result = check(*words, "--json")
    assert json.loads(result.stdout)["coverage"]["covered"] >= 0.999, result.output
    assert result.exit_code == 0


@pytest.mark.slow
def test_the_ground_of_an_elevation_model_is_covered(tmp_path: Path) -> None:
    """A hillside that rises with the flight: less is seen of it than of flat ground."""
    dem, photos, field = tmp_path / "dem.tif", tmp_path / "photos", tmp_path / "field.geojson"
    geopandas.GeoDataFrame({"id": [1]}, geometry=[FIELD], crs=4326).to_file(field)
    rise = np.linspace(0, 40, 400)[None].repeat(400, axis=0).astype(np.float32) + 430
    place = Affine(1e-4, 0, 7.98, 0, -1e-4, 47.02)
    how = {"height": 400, "width": 400, "count": 1, "dtype": "float32", "crs": "EPSG:4326"}
    with rasterio.open(dem, "w", "GTiff", transform=place, **how) as file:
        file.write(rise, 1)
    path = write(survey(overlap=(60, 20)), tmp_path / "survey.plan")
    photograph(path, photos, altitude_m=None)
    flat = uavseg.check(path, photos=photos, regions=field).coverage
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        hill = uavseg.check(path, photos=photos, regions=field, dem=dem).coverage
        whole = uavseg.check(path, photos=photos, dem=dem).coverage
    assert flat is not None and hill is not None and whole is not None
    assert not flat.missing and not hill.missing and whole.is_whole
    assert hill.seen_twice < flat.seen_twice
    assert hill.overlap["beside"] is not None and flat.overlap["beside"] is not None
    assert hill.overlap["beside"]["median"] < flat.overlap["beside"]["median"]


@pytest.mark.slow
def test_python_gives_the_same(flown: Path, tmp_path: Path) -> None:
    gaps = tmp_path / "gaps.geojson"
    result = check(flown / "survey.plan", "--photos", flown / "some", "--gaps", gaps, "--json")
    with pytest.warns(UserWarning, match="88 of 176 photographs are missing"):
        found = uavseg.check(flown / "survey.plan", photos=flown / "some")
    assert found.as_dict() == json.loads(result.stdout)
    written = geopandas.read_file(gaps)
    assert shapely.equals_exact(written.union_all(), found.gaps.union_all(), 1e-9)
    assert written["area_m2"].to_numpy() == pytest.approx(found.gaps["area_m2"].to_numpy(), abs=1e-3)
    assert found.problems and found.coverage is not None
    with pytest.warns(UserWarning, match="over flat ground"):
        again = uavseg.plan(found.gaps, camera=CAMERA, altitude=60, home=HOME, angle=0)
    assert again.regions == len(found.gaps)
    assert len(uavseg.check(flown / "survey.plan").gaps) == 0


@pytest.mark.slow
def test_a_camera_and_a_home_may_be_named(flown: Path, tmp_path: Path) -> None:
    words = [flown / "survey.plan", "--photos", flown / "all"]
    near = check(*words, "--camera", CAMERA, "--home", "47,8,430", "--json")
    assert near.exit_code == 0 and json.loads(near.stdout)["coverage"]["covered"] == 1
    longer = replace(camera_named(CAMERA), focal_mm=2 * camera_named(CAMERA).focal_mm, name="longer")
    (tmp_path / "longer.json").write_text(json.dumps(longer.as_dict()))
    small = check(
        *words, "--camera", tmp_path / "longer.json", "--regions", flown / "field.geojson", "--json"
    )
    before, after = (
        json.loads(one.stdout)["coverage"]["overlap"]["along"]["median"] for one in (near, small)
    )
    assert 1 - after == pytest.approx(2 * (1 - before), abs=1e-3)  # footprints are half as long


@pytest.mark.parametrize("option", ["--gaps", "--regions", "--camera", "--home"])
def test_options_for_photographs_need_them(flown: Path, option: str) -> None:
    value = {"--gaps": "a.geojson", "--home": "47,8"}.get(option, "a.geojson")
    result = check(flown / "survey.plan", option, value)
    assert result.exit_code == 1 and len(result.stderr.splitlines()) == 1
    assert f"{option} is for photographs of the flight; give them with --photos" in result.stderr
    if option != "--gaps":
        with pytest.raises(ParameterError, match="--photos"):
            uavseg.check(flown / "survey.plan", **{option[2:]: "a" if option != "--home" else (47, 8)})


@pytest.mark.slow
def test_bad_input_is_one_line_and_writes_nothing(flown: Path, tmp_path: Path) -> None:
    survey_plan, gaps = flown / "survey.plan", tmp_path / "gaps.geojson"
    empty, other = tmp_path / "empty", tmp_path / "a.bin"
    empty.mkdir()
    other.write_bytes(b"not a log")
    away = write(survey(home=(-33.9, 151.2, 12.0), regions=[SOUTH]), tmp_path / "away.plan")
    for words, said in (
        ([survey_plan, "--photos", tmp_path / "none"], "none"),
        ([survey_plan, "--photos", empty], "has no photographs"),
        ([survey_plan, "--photos", flown / "field.geojson"], "no photograph can be placed"),
        ([survey_plan, "--photos", flown / "all", "--regions", tmp_path / "none.gpkg"], "none.gpkg"),
        ([survey_plan, "--photos", flown / "all", "--camera", "nothing"], "there is no camera"),
        ([survey_plan, "--photos", flown / "all", "--home", "147,8"], "147"),
        ([away, "--photos", flown / "all"], "another flight"),
        ([survey_plan, "--photos", flown / "all", "--photos", tmp_path / "a.BIN"], "give --camera"),
        ([survey_plan, "--photos", tmp_path / "a.ulg", "--camera", "Altum"], "a.ulg"),
        ([survey_plan, "--photos", other, "--camera", "Altum"], "is not a flight log"),
    ):
        result = check(*words, "--gaps", gaps, "-q")
        assert result.exit_code == 1, result.output
        assert len(result.stderr.splitlines()) == 1 and said in result.stderr
        assert not gaps.exists()
    result = check(survey_plan, "--photos", flown / "all", "--gaps", tmp_path / "gaps.txt")
    assert result.exit_code == 1 and "regions are written to" in result.stderr
    result = check(survey_plan, "--photos", flown / "all", "--gaps", survey_plan, "--overwrite")
    assert result.exit_code == 1 and survey_plan.stat().st_size > 1000


@pytest.mark.slow
@pytest.mark.parametrize("suffix", [".bin", ".ulg"])
def test_the_log_of_a_flight_tells_what_its_photographs_tell(
    flown: Path, tmp_path: Path, suffix: str
) -> None:
    mission = read_mission(flown / "survey.plan")
    shots = planned_photographs(mission, LENS).photographs
    log = tmp_path / f"flight{suffix}"
    log.write_bytes(logged(suffix, shots[: len(shots) // 2]))
    gaps, expected = tmp_path / "gaps.geojson", tmp_path / "expected.geojson"
    result = check(flown / "survey.plan", "--photos", log, "--camera", CAMERA, "--gaps", gaps, "--json")
    assert result.exit_code == 1, result.output
    coverage = json.loads(result.stdout)["coverage"]
    assert coverage["taken"] == len(shots) // 2 and len(coverage["missing"]) == len(shots) - len(shots) // 2
    folder = tmp_path / "photographs"
    photograph(flown / "survey.plan", folder, lambda k: k < len(shots) // 2)
    check(flown / "survey.plan", "--photos", folder, "--gaps", expected)
    (ours,), (theirs,) = (geopandas.read_file(path).dissolve().geometry for path in (gaps, expected))
    assert ours.symmetric_difference(theirs).area < 0.02 * theirs.area


def logged(suffix: str, shots: Sequence[Photograph]) -> bytes:
    """A log of photographs, as ArduPilot or PX4 write it."""
    if suffix == ".bin":
        fields = (
            {"Lat": one.lat, "Lng": one.lon, "Alt": 212.0, "RelAlt": one.relative_m, "Y": one.yaw_deg % 360}
            for one in shots
        )
        return dataflash([("CAM", one) for one in fields])
    messages: list[tuple[str, tuple[Any, ...]]] = [("home_position", (1, 212.0))]
    for number, one in enumerate(shots, 2):
        half = math.radians(one.yaw_deg) / 2
        turn = (math.cos(half), 0.0, 0.0, math.sin(half))
        messages.append(
            ("camera_capture", (number * 10**6, one.lat, one.lon, 212 + (one.relative_m or 0.0), *turn))
        )
    return ulog(messages)


@pytest.mark.slow
def test_a_picture_shows_footprints_and_gaps(flown: Path, tmp_path: Path) -> None:
    gaps, prints = tmp_path / "gaps.gpkg", tmp_path / "footprints.gpkg"
    check(flown / "survey.plan", "--photos", flown / "some", "--gaps", gaps)
    uavseg.footprints(flown / "some").to_file(prints)
    raster = tmp_path / "ground.tif"
    how = {"height": 60, "width": 60, "count": 1, "dtype": "uint8", "crs": "EPSG:4326"}
    with rasterio.open(raster, "w", "GTiff", transform=Affine(1e-4, 0, 8, 0, -1e-4, 47.004), **how) as file:
        file.write(np.arange(3600, dtype=np.uint8).reshape(60, 60), 1)
    sizes = set()
    for regions in (gaps, prints):
        words = ["preview", str(raster), "--regions", str(regions), "--width", "300", "--overwrite"]
        out = tmp_path / "shown.png"
        result = CliRunner().invoke(main, [*words, "--mission", str(flown / "survey.plan"), "-o", str(out)])
        assert result.exit_code == 0, result.output
        sizes.add(out.read_bytes())
    assert len(sizes) == 2
