"""Maps of photographs by the command: files, warnings, what reads them, what is refused."""

import warnings
from collections.abc import Iterator
from contextlib import chdir
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
from affine import Affine
from click.testing import CliRunner, Result
from pyproj import Transformer
from rasterio.features import geometry_mask
from scipy.ndimage import binary_dilation, binary_erosion, gaussian_filter

import uavseg
from tests.photographs.make import draw_photograph
from uavseg.cli import main
from uavseg.photographs.read import Photograph

PLACE = (47.05, 8.31)
PHOTO = Photograph(
    path="",
    lat=PLACE[0],
    lon=PLACE[1],
    relative_m=60.0,
    altitude_m=560.0,
    yaw_deg=30.0,
    image_px=(320, 240),
    focal_px=260.0,
    taken_s=1.7e9,
)
NAMES = ("a.jpg", "b.jpg", "c.jpg")


@pytest.fixture(scope="module", autouse=True)
def folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Fields, bright and dark, three photographs of them, and an elevation model that is level."""
    made = tmp_path_factory.mktemp("photographs")
    x, y = Transformer.from_crs(4326, 32632, always_xy=True).transform(PLACE[1], PLACE[0])
    fields = np.random.default_rng(4).integers(0, 2, (12, 12)).repeat(50, 0).repeat(50, 1) * 110.0 + 70
    noise = gaussian_filter(np.random.default_rng(5).normal(size=(600, 600)), 1.5)
    image = np.clip(fields + 20 * noise / noise.std() * 0.5, 1, 254).astype(np.uint8)
    profile = {"height": 600, "width": 600, "count": 1, "crs": "EPSG:32632"}
    at = Affine(0.3, 0, x - 90, 0, -0.3, y + 90)
    with chdir(made):
        with rasterio.open("scene.tif", "w", "GTiff", dtype="uint8", transform=at, **profile) as file:
            file.write(image, 1)
        with rasterio.open("dem.tif", "w", "GTiff", dtype="float32", transform=at, **profile) as file:
            file.write(np.full((600, 600), 500, np.float32), 1)
        Path("photos").mkdir()
        for number, name in enumerate(NAMES):
            one = replace(PHOTO, lon=PLACE[1] + 2e-4 * (number - 1), taken_s=1.7e9 + number)
            draw_photograph(f"photos/{name}", one, Path("scene.tif"))
        yield made


def run(*words: Any) -> Result:
    return CliRunner().invoke(main, ["georeference", *map(str, words)])


@pytest.mark.slow
def test_a_map_says_where_and_how_well_it_lies() -> None:
    result = run("photos", "-o", "map.tif", "--overwrite")
    assert result.exit_code == 0, result.stderr
    with rasterio.open("map.tif") as file:
        tags, bands = file.tags(), file.read()
        assert file.crs == "EPSG:32632" and file.profile["tiled"] and file.compression.name == "deflate"
        assert file.count == 2 and file.colorinterp[1].name == "alpha"
        assert file.transform.a == -file.transform.e == pytest.approx(60 / 260, rel=5e-3)
        for edge in (file.transform.c, file.transform.f):
            assert edge / file.transform.a == pytest.approx(round(edge / file.transform.a), abs=1e-4)
    assert tags["photographs"] == "3" and tags["ground"] == "flat"
    middle, edges = float(tags["likely_error_m"]), float(tags["likely_error_at_edges_m"])
    assert 3 < middle < edges < 10
    assert f"off by {middle:.1f} m" in result.stderr and f"up to {edges:.1f} m" in result.stderr
    assert "without distortion" in result.stderr and "--dem" in result.stderr
    assert set(np.unique(bands[1])) == {0, 255} and (bands[1] > 0).mean() > 0.5
    assert not bands[0][bands[1] == 0].any()


@pytest.mark.slow
def test_a_level_elevation_model_is_flat_ground() -> None:
    assert run("photos", "-o", "flat.tif", "--overwrite").exit_code == 0
    result = run("photos", "-o", "level.tif", "--dem", "dem.tif", "--overwrite")
    assert result.exit_code == 0, result.stderr
    assert "as high as the place of takeoff" not in result.stderr
    with rasterio.open("flat.tif") as flat, rasterio.open("level.tif") as level:
        assert level.tags()["ground"] == "dem.tif"
        left, bottom, right, top = flat.bounds
        window = level.window(left, bottom, right, top)  # the model's map has a margin
        theirs = level.read(window=window.round_lengths().round_offsets())
        ours = flat.read()
    assert (ours[1] != theirs[1]).mean() < 1e-3
    both = (ours[1] > 0) & (theirs[1] > 0)
    assert np.abs(ours[0][both].astype(int) - theirs[0][both]).max() <= 1


@pytest.mark.slow
def test_the_order_of_files_changes_nothing() -> None:
    for name, files in (("one.tif", NAMES), ("other.tif", NAMES[::-1])):
        assert run(*(f"photos/{file}" for file in files), "-o", name, "--overwrite").exit_code == 0
    assert Path("one.tif").read_bytes() == Path("other.tif").read_bytes()


def mapped(output: str) -> Any:
    with warnings.catch_warnings(action="ignore"):  # that say how far off it may be
        return uavseg.georeference("photos", output, overwrite=True)


@pytest.mark.slow
def test_regions_of_the_map_are_those_of_the_scene() -> None:
    found = mapped("regions.tif")
    assert found.error_m < found.edge_error_m and found.photographs == NAMES
    ours, theirs = (
        uavseg.extract(name, values=(125, 255), min_area=50).union_all()
        for name in ("regions.tif", "scene.tif")
    )
    with rasterio.open("regions.tif") as file:
        valid = binary_erosion(file.read(2) > 0, iterations=3)
        one, other = (
            geometry_mask([shape], valid.shape, file.transform, invert=True) & valid
            for shape in (ours, theirs)
        )
    assert 0.2 < other[valid].mean() < 0.8
    assert (one & other).sum() / (one | other).sum() > 0.9
    # Where they differ, an outline is within the likely error.
    pixels = int(found.error_m / found.geobox.transform.a)
    beside = binary_dilation(other, iterations=pixels) & ~binary_erosion(other, iterations=pixels)
    assert not ((one ^ other) & ~beside).any()


@pytest.mark.slow
def test_match_takes_the_map() -> None:
    mapped("sample.tif")
    x, y = Transformer.from_crs(4326, 32632, always_xy=True).transform(PLACE[1], PLACE[0])
    words = ["match", "sample.tif", "--like", f"{x:.2f},{y:.2f},6", "-o", "similar.geojson", "-q"]
    result = CliRunner().invoke(main, words)
    assert result.exit_code == 0, result.stderr
    assert Path("similar.geojson").exists()


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (("photos", "-o", "map.jpg"), "name a .tif"),
        (("photos", "-o", "there.tif"), "there.tif exists"),
        (("photos", "-o", "x.tif", "--resolution", "0"), "centimetres per pixel"),
        (("photos", "-o", "x.tif", "--resolution", "nan"), "centimetres per pixel"),
        (("photos", "-o", "x.tif", "--resolution", "0.0001"), "a larger --resolution"),
        (("scene.tif", "-o", "x.tif"), "no photograph can be placed"),
        (("scene.tif", "photos", "-o", "scene.tif", "--overwrite"), "scene.tif"),
        (("cut", "-o", "x.tif"), "cut.jpg"),
        (("up", "-o", "x.tif"), "horizon"),
        (("photos", "far", "-o", "x.tif"), "do all show one place"),
        (("photos", "-o", "x.tif", "--dem", "scene.tif"), "looks like a picture"),
        (("photos", "-o", "nowhere/x.tif"), "nowhere"),
    ],
)
def test_what_is_wrong_is_said_in_a_line(words: tuple[str, ...], reason: str) -> None:
    for name in ("cut", "up", "far"):
        Path(name).mkdir(exist_ok=True)
    Path("there.tif").write_bytes(b"mine")
    whole = Path("photos/a.jpg").read_bytes()
    Path("cut/cut.jpg").write_bytes(whole[: len(whole) * 2 // 3])
    draw_photograph("up/up.jpg", replace(PHOTO, pitch_deg=5.0))
    draw_photograph("far/far.jpg", replace(PHOTO, lon=-60.0))
    before = sorted(Path().iterdir()), Path("scene.tif").read_bytes()
    result = run(*words)
    assert result.exit_code == 1
    [line] = [line for line in result.stderr.splitlines() if "error" in line]
    assert line.startswith("uavseg: error: ") and reason in line
    assert "Traceback" not in result.output
    assert before == (sorted(Path().iterdir()), Path("scene.tif").read_bytes())
    assert Path("there.tif").read_bytes() == b"mine"


def test_progress_is_shown() -> None:
    result = run("photos", "-o", "p.tif", "--overwrite", "--progress", "plain")
    percent = [int(line.split()[1]) for line in result.stderr.splitlines() if line.startswith("progress")]
    assert percent == sorted(percent) and percent[-1] == 100 and len(percent) > 3
