"""Sample areas: discs and files of polygons, and the pixels that they cover."""

from pathlib import Path

import numpy as np
import pytest
import shapely
from affine import Affine
from rasterio.crs import CRS

from uavseg.errors import ParameterError, RegionError, SampleError
from uavseg.raster.grid.geobox import GeoBox
from uavseg.regions.formats.export import write_regions
from uavseg.regions.sample.place import Disc, parse_like, sample_mask
from uavseg.regions.table import Regions


def box(crs: str | None = None, shape: tuple[int, int] = (200, 100)) -> GeoBox:
    return GeoBox(shape, Affine(2, 0, 1000, 0, -2, 5000), crs and CRS.from_string(crs))


def test_a_disc_is_the_pixels_whose_centres_lie_in_it() -> None:
    place = sample_mask(Disc(1100, 4900, 30), box())
    row, col = np.mgrid[: place.window.rows, : place.window.cols] + 0.5
    row, col = row + place.window.row, col + place.window.col
    wanted = (row - 50) ** 2 + (col - 50) ** 2 <= 15**2
    assert (place.mask != wanted).sum() <= 4  # the disc is a polygon of 256 corners
    assert place.window.row % 8 == place.window.col % 8 == 0


def test_a_radius_is_in_metres_on_maps_in_degrees() -> None:
    step = 1 / 111_320
    degrees = GeoBox((400, 400), Affine(step, 0, 10, 0, -step, 60), CRS.from_epsg(4326))
    place = sample_mask(Disc(10 + 200 * step, 60 - 200 * step, 50), degrees)
    rows, cols = (int(place.mask.any(axis=axis).sum()) for axis in (1, 0))
    assert rows == pytest.approx(100, abs=2)
    assert cols == pytest.approx(200, abs=4)  # a degree of longitude is half as long there


@pytest.mark.parametrize(
    ("text", "wanted"),
    [("1,2,3", Disc(1, 2, 3)), (" 1, 2e3,.5", Disc(1, 2000, 0.5)), ("1,2,c", "1,2,c"), ("a.gpkg", "a.gpkg")],
)
def test_three_numbers_are_a_disc_and_the_rest_a_file(text: str, wanted: object) -> None:
    assert parse_like(text) == wanted


@pytest.mark.parametrize("text", ["1,2", "5", "1,2,3,4", "1,2,0", "1,2,-3", "nan,2,3", "1,2,inf"])
def test_numbers_that_are_not_a_disc_are_refused(text: str) -> None:
    with pytest.raises(ParameterError, match="X,Y,RADIUS"):
        parse_like(text)


@pytest.mark.parametrize("at", [(900, 4900), (1250, 4900), (1100, 5100), (1100, 4500)])
def test_a_sample_outside_of_the_raster_is_refused(at: tuple[float, float]) -> None:
    with pytest.raises(SampleError, match="outside of the raster, which is x 1000 to 1200 by y 4600 to 5000"):
        sample_mask(Disc(*at, 40), box())


def test_a_sample_that_is_too_large_is_refused() -> None:
    with pytest.raises(SampleError, match=r"16,777,216 are read"):
        sample_mask(Disc(0, 0, 1e6), GeoBox((20000, 20000), Affine.identity(), None))


def test_a_file_of_polygons_covers_the_pixels_whose_centres_it_holds(tmp_path: Path) -> None:
    utm = GeoBox((60, 80), Affine(2, 0, 4e5, 0, -2, 5e6), CRS.from_epsg(32618))
    square = np.array([shapely.box(4e5 + 20, 5e6 - 60, 4e5 + 50, 5e6 - 30)], object)
    wkt = CRS.from_epsg(32618).to_wkt()
    write_regions(Regions({"id": np.array([1])}, square, wkt), tmp_path / "sample.gpkg")
    covered = sample_mask(str(tmp_path / "sample.gpkg"), utm)
    rows, cols = np.nonzero(covered.mask)
    assert (rows + covered.window.row).tolist() == np.repeat(np.arange(15, 30), 15).tolist()
    assert set((cols + covered.window.col).tolist()) == set(range(10, 25))


def test_a_file_needs_a_raster_with_a_crs_and_must_hold_polygons(tmp_path: Path) -> None:
    with pytest.raises(SampleError, match="give the sample as X,Y,RADIUS"):
        sample_mask("field.geojson", box())
    with pytest.raises(RegionError, match="does not exist"):
        sample_mask(str(tmp_path / "none.geojson"), box("EPSG:32618"))
