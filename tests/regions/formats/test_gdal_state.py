"""Messages of GDAL are heard in every thread, and none is printed."""

import subprocess
import sys
from pathlib import Path

import pyogrio
import pytest

from uavseg.regions.formats.vector_files import gdal_options

# A CRS that says EPSG:32633 and is not: of such a one GDAL warns when it is written.
START = """
import threading
import pyogrio  # handles messages of this thread only
import numpy, shapely
from uavseg.errors import RegionError
from uavseg.regions.formats.export import write_regions
from uavseg.regions.formats.read import read_regions
from uavseg.regions.table import Regions

wkt = '''PROJCS["UTM zone 33N",GEOGCS["WGS 84",DATUM["unnamed",SPHEROID["WGS 84",6378137,298.257223562997],
TOWGS84[0,0,0,0,0,0,0]],PRIMEM["Greenwich",0],UNIT["degree",0.0174532925199433],AUTHORITY["EPSG","4326"]],
PROJECTION["Transverse_Mercator"],PARAMETER["latitude_of_origin",0],PARAMETER["central_meridian",15],
PARAMETER["scale_factor",0.9996],PARAMETER["false_easting",500000],PARAMETER["false_northing",0],
UNIT["metre",1],AUTHORITY["EPSG","32633"]]'''
place = shapely.box(500000, 4500000, 500100, 4500100)
columns = {"id": numpy.array([1]), "area_m2": numpy.array([1e4]), "lon": numpy.array([15.0005])}
regions = Regions(columns | {"lat": numpy.array([40.65])}, numpy.array([place], dtype=object), wkt)

def job():
"""
END = """
thread = threading.Thread(target=job)
thread.start()
thread.join()
"""
LOST_RING = """<kml xmlns="http://www.opengis.net/kml/2.2"><Document><Placemark><Polygon>
<outerBoundaryIs><LinearRing><coordinates>15,40 15.1,40 15.1,40.1 15,40</coordinates></LinearRing>
</outerBoundaryIs>
<innerBoundaryIs><LinearRing><coordinates>15.08,40.01 15.09,40.01 15.09,40.02</coordinates></LinearRing>
</innerBoundaryIs></Polygon></Placemark></Document></kml>"""


def in_a_thread(folder: Path, *lines: str) -> tuple[str, str]:
    script = START + "".join(f"    {line}\n" for line in lines) + END
    done = subprocess.run([sys.executable, "-c", script], cwd=folder, capture_output=True, text=True)
    return done.stdout, done.stderr


@pytest.mark.slow
@pytest.mark.slow
@pytest.mark.parametrize(
    "suffix", [".gpkg", *(pytest.param(suffix, marks=pytest.mark.slow) for suffix in (".shp", ".fgb"))]
)
def test_writing_says_nothing(tmp_path: Path, suffix: str) -> None:
    assert in_a_thread(tmp_path, f"write_regions(regions, 'out{suffix}')", "print('written')") == (
        "written\n",
        "",
    )


@pytest.mark.slow
def test_a_ring_that_is_not_closed_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a.kml").write_text(LOST_RING)
    lines = ("try:", "    read_regions('a.kml')", "except RegionError as error:", "    print(error)")
    out, errors = in_a_thread(tmp_path, *lines)
    assert "a.kml" in out
    assert "ring is not closed" in out
    assert errors == ""


def test_options_have_their_old_values_afterwards() -> None:
    def values() -> list[str | None]:
        return [pyogrio.get_gdal_config_option(name) for name in ("UAVSEG_A", "UAVSEG_B")]

    pyogrio.set_gdal_config_options({"UAVSEG_B": "before"})
    try:
        with pytest.raises(ValueError, match="inside"), gdal_options({"UAVSEG_A": "a", "UAVSEG_B": "b"}):
            assert values() == ["a", "b"]
            raise ValueError("inside")
        assert values() == [None, "before"]
    finally:
        pyogrio.set_gdal_config_options({"UAVSEG_B": None})
