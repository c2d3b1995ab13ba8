"""`uavseg preview`: a picture beside the other outputs, and nothing on stdout."""

from pathlib import Path

import numpy as np
import pytest
import rasterio
from affine import Affine
from click.testing import CliRunner, Result
from PIL import Image

from tests.plot.pictures import a_mission
from uavseg.cli import main
from uavseg.cli.preview import command
from uavseg.errors import OutputExistsError, ParameterError, RegionError, UavsegError
from uavseg.flight.formats.files import write_mission


@pytest.fixture
def raster(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    place = {"crs": "EPSG:32618", "transform": Affine(1, 0, 380_000, 0, -1, 4_897_000)}
    with rasterio.open(
        "a.tif", "w", driver="GTiff", dtype="uint8", count=2, height=40, width=50, **place
    ) as file:
        file.write(np.stack([np.full((40, 50), 10), np.full((40, 50), 240)]).astype(np.uint8))
    return Path("a.tif")


def run(*arguments: object) -> Result:
    return CliRunner().invoke(command, [str(a) for a in arguments])


def test_the_picture_is_named_after_the_raster_unless_said_otherwise(raster: Path) -> None:
    assert run(raster, "--width", 300).exit_code == 0
    assert run(raster, "-o", "other.png", "--width", 400).exit_code == 0
    for name, width in (("a.preview.png", 300), ("other.png", 400)):
        with Image.open(name) as picture:
            assert picture.size[0] == width


@pytest.mark.slow
def test_only_stderr_speaks_and_quiet_says_nothing(raster: Path) -> None:
    loud, quiet = run(raster), run(raster, "-q", "--overwrite")
    assert (loud.stdout, loud.stderr.splitlines()[-1]) == ("", "wrote a.preview.png")
    assert (quiet.stdout, quiet.stderr, quiet.exit_code) == ("", "", 0)


def test_the_band_is_the_one_named(raster: Path) -> None:
    middles = []
    for band in (1, 2):
        run(raster, "--band", band, "-o", f"{band}.png", "--width", 300)
        picture = np.asarray(Image.open(f"{band}.png").convert("L"))
        middles.append(int(picture[picture.shape[0] // 2, picture.shape[1] // 2]))
    assert middles == [10, 240]


def test_an_answer_that_is_there_is_kept_unless_said_otherwise(raster: Path) -> None:
    Path("b.png").write_text("mine")
    assert isinstance(run(raster, "-o", "b.png").exception, OutputExistsError)
    assert Path("b.png").read_text() == "mine"
    assert run(raster, "-o", "b.png", "--overwrite").exit_code == 0


def test_what_is_wrong_is_raised_for_the_group_to_say(raster: Path) -> None:
    assert isinstance(run(raster, "--regions", "missing.gpkg").exception, RegionError)
    assert isinstance(run(raster, "--stretch", "9,1").exception, ParameterError)
    assert run(raster, "--rgb", "1,2").exit_code == 2
    assert not Path("a.preview.png").exists()


@pytest.mark.slow
def test_a_simulated_map_with_everything_that_is_made_of_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for line in (
        "simulate lens -o lens.tif --truth truth.tif",
        "divide lens.tif --stretch none --method paper -o blocks.tif",
        "path lens.tif --range 0,0.45 --start 1.6,2.8 --goal 2.1,0.6 -o path.geojson",
        "original lens.tif --stretch none -o labels.tif",
        "preview lens.tif --leaves blocks.tif --path path.geojson --states truth.tif -o all.png --width 500",
        "preview lens.tif --stretch none --labels labels.tif -o segments.png --width 500",
        "preview lens.tif --stretch none -o bare.png --width 500",
    ):
        done = CliRunner().invoke(main, line.split())
        assert done.exit_code == 0, done.stderr
    bare, drawn = (
        np.asarray(Image.open(name).convert("RGB")).astype(int) for name in ("bare.png", "all.png")
    )
    assert bare.shape == drawn.shape
    assert np.ptp(bare, axis=2).max() < 10 and (np.ptp(drawn, axis=2) > 40).mean() > 0.2
    segments = np.asarray(Image.open("segments.png").convert("RGB")).astype(int)
    outlined = (np.abs(segments - bare) > 60).any(axis=2)
    assert 0.02 < outlined.mean() < 0.5 and np.ptp(segments, axis=2).max() < 10


def test_layers_that_are_not_what_they_should_be_are_reported_in_one_line(raster: Path) -> None:
    Path("no.geojson").write_text("{}")
    for option, told in (
        (("--states", "a.tif"), "uavseg classify"),
        (("--states", "missing.tif"), "missing.tif"),
        (("--leaves", "a.tif"), "uavseg divide"),
        (("--labels", "missing.tif"), "missing.tif"),
        (("--levels", "missing.gpkg"), "missing.gpkg"),
        (("--path", "no.geojson"), "uavseg path"),
        (("--path", "missing.waypoints"), "missing.waypoints"),
    ):
        done = CliRunner().invoke(main, ["preview", str(raster), *option])
        assert done.exit_code == 1 and told in done.stderr and done.stderr.count("\n") == 1
        assert not Path("a.preview.png").exists()


@pytest.mark.slow
def test_missions_are_drawn_without_a_raster(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    flight = a_mission([(-76.5, 44.2), (-76.499, 44.2), (-76.499, 44.201)])
    for name in ("fly-1.plan", "fly-2.waypoints"):
        write_mission(flight, name)
    alone = run("fly-1.plan", "--width", 300)
    assert (alone.exit_code, alone.stderr.splitlines()) == (0, ["wrote fly-1.preview.png"])
    assert run("--mission", "fly-1.plan", "-o", "named.png", "--width", 300, "-q").stderr == ""
    assert Path("named.png").read_bytes() == Path("fly-1.preview.png").read_bytes()
    assert run("fly-1.plan", "fly-2.waypoints", "-o", "two.png", "--width", 300).exit_code == 0
    assert Path("two.png").read_bytes() != Path("named.png").read_bytes()


def test_what_does_not_go_with_missions_alone_is_refused(raster: Path) -> None:
    write_mission(a_mission([(-76.5, 44.2), (-76.499, 44.2)]), "fly.plan")
    for words, expected in (
        (("fly.plan", raster), "give --mission fly.plan"),
        (("fly.plan", "--regions", "r.geojson"), "--regions needs a raster"),
        (("--mission", "fly.plan", "--stretch", "dtype"), "--stretch needs a raster"),
        (("fly.plan", "--skip-bad-tiles"), "--skip-bad-tiles needs a raster"),
        ((raster, "--dem", raster), "leave RASTER or --dem out"),
        (("missing.plan",), "missing.plan"),
    ):
        done = run(*words, "-o", "no.png")
        assert isinstance(done.exception, UavsegError) and expected in str(done.exception)
        assert not Path("no.png").exists()
    nothing = run("-o", "no.png")
    assert nothing.exit_code == 2 and "RASTER" in nothing.stderr


def test_several_missions_are_drawn_over_a_raster(raster: Path) -> None:
    flight = a_mission([(-76.5, 44.2), (-76.499, 44.2)])
    for name in ("a.plan", "b.plan"):
        write_mission(flight, name)
    one = run(raster, "--mission", "a.plan", "-o", "one.png", "--width", 300)
    two = run(raster, "--mission", "a.plan", "--mission", "b.plan", "-o", "two.png", "--width", 300)
    assert one.exit_code == 0 and two.exit_code == 0
    assert Path("one.png").read_bytes() != Path("two.png").read_bytes()
