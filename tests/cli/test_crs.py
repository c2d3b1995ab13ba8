"""`--crs`: regions in another CRS than their raster's, as geopandas transforms them."""

from pathlib import Path

import geopandas
import numpy as np
import pytest
from click.testing import CliRunner, Result

from uavseg.cli import main
from uavseg.cli.write import named_crs
from uavseg.errors import RasterError
from uavseg.jobs.extract import ExtractRequest, extract
from uavseg.jobs.source.open_source import open_source
from uavseg.options.running import RegionOutputs
from uavseg.regions.table import in_crs
from uavseg.segmentation.params.segment import IntensityRange

SAMPLES = Path(__file__).parents[2] / "samples"
QUARRY = SAMPLES / "quarry.tif"


def run(*words: object) -> Result:
    return CliRunner().invoke(main, list(map(str, words)))


def extracted(*words: object) -> None:
    done = run("extract", QUARRY, "--range", "0.55,1", "-q", *words)
    assert done.exit_code == 0, done.output


@pytest.mark.slow
@pytest.mark.parametrize(
    ("ending", "crs"),
    [
        *(("gpkg", "EPSG:4326"), ("gpkg", "EPSG:3857"), ("gpkg", "+proj=laea +lat_0=49 +lon_0=-122")),
        *(("gpkg", "EPSG:3005"), ("fgb", "EPSG:3005"), ("parquet", "EPSG:3005"), ("shp", "EPSG:3005")),
    ],
)
def test_regions_are_where_geopandas_puts_them(crs: str, ending: str, tmp_path: Path) -> None:
    target, own = tmp_path / f"moved.{ending}", tmp_path / "own.gpkg"
    extracted("-o", target, "--crs", crs)
    extracted("-o", own)
    read = geopandas.read_parquet if ending == "parquet" else geopandas.read_file
    found, expected = read(target), geopandas.read_file(own).to_crs(crs)
    assert (
        found.crs.equals(expected.crs, ignore_axis_order=True)
        or found.crs.to_epsg() == expected.crs.to_epsg()
    )
    assert len(found) == len(expected) > 1
    found = found.sort_values("id", ignore_index=True)  # FlatGeobuf has an order of its own
    assert found.geometry.normalize().geom_equals_exact(expected.geometry.normalize(), 1e-6).all()
    if ending != "shp":
        np.testing.assert_array_equal(found["area_m2"], expected["area_m2"])  # on the ground


@pytest.mark.slow
def test_a_mission_and_labels_do_not_change(tmp_path: Path) -> None:
    for name, words in (("own", ()), ("moved", ("--crs", "EPSG:3005"))):
        files = ("-o", tmp_path / f"{name}.gpkg", "--labels", tmp_path / f"{name}.tif")
        flight = (
            "--mission",
            tmp_path / f"{name}.plan",
            "--altitude",
            60,
            "--home",
            "auto",
            "--spacing",
            30,
            "--angle",
            0,
        )
        extracted(*files, *flight, *words)
    for ending in ("plan", "tif"):
        assert (tmp_path / f"own.{ending}").read_bytes() == (tmp_path / f"moved.{ending}").read_bytes()


@pytest.mark.slow
def test_streams_and_each_raster_have_it_too(tmp_path: Path) -> None:
    done = run("levels", QUARRY, "--width", 0.3, "-q", "-o", "-", "--projected", "--crs", "EPSG:3005")
    assert done.exit_code == 0 and "EPSG::3005" in done.stdout
    done = run(
        "extract", QUARRY, "--range", "0.55,1", "-o", "-", "--projected", "--sequence", "--crs", "EPSG:3005"
    )
    assert "these coordinates are in EPSG:3005" in done.stderr
    words = ("--range", "0.55,1", "--crs", "EPSG:3005", "-q")
    assert run("extract", QUARRY, "--each", *words, "-o", tmp_path / "{stem}.fgb").exit_code == 0
    extracted("-o", tmp_path / "one.fgb", "--crs", "EPSG:3005")
    assert (tmp_path / "quarry.fgb").read_bytes() == (tmp_path / "one.fgb").read_bytes()


@pytest.mark.parametrize(
    ("words", "code", "said"),
    [
        (
            ("-o", "a.geojson", "--crs", "EPSG:3005"),
            2,
            "GeoJSON and KML are in longitude and latitude; give --crs",
        ),
        (("-o", "a.kml", "--crs", "EPSG:3005"), 2, "GeoJSON and KML"),
        (("-o", "-", "--crs", "EPSG:3005"), 2, "GeoJSON and KML"),
        (("--crs", "EPSG:3005"), 2, "GeoJSON and KML"),
        (("-o", "{stem}.geojson", "--each", "--crs", "EPSG:3005"), 2, "GeoJSON and KML"),
        (("-o", "a.parquet/", "--crs", "EPSG:3005"), 2, "--crs does not go with a folder of regions"),
        (("-o", "a.gpkg", "--crs", "EPSG:99999"), 1, "--crs is a CRS such as EPSG:2056, not 'EPSG:99999'"),
        (("-o", "a.gpkg", "--crs", "nonsense"), 1, "--crs is a CRS such as EPSG:2056"),
        (("-o", "a.gpkg", "--crs", "EPSG:5703"), 1, "neither geographic nor projected"),
        (("-o", "a.gpkg", "--crs", "+proj=geos +h=35785831 +lon_0=60"), 1, "have no coordinates in"),
    ],
)
def test_what_cannot_be_in_a_crs_is_refused(
    words: tuple[str, ...], code: int, said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    done = run("extract", QUARRY, "--range", "0.55,1", *words)
    assert done.exit_code == code, done.output
    assert said in " ".join(done.output.split())
    assert not list(tmp_path.iterdir())


def test_a_raster_without_crs_has_none_to_start_from() -> None:
    pixels = np.kron(np.eye(4), np.ones((40, 40))).astype(np.float32)
    regions = extract(open_source(pixels), ExtractRequest(IntensityRange(0.5, 1))).regions
    with pytest.raises(RasterError, match="the raster has no CRS"):
        in_crs(regions, named_crs(RegionOutputs(crs="EPSG:3005"), "a.gpkg"))
