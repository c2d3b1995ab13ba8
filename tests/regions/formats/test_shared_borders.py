"""Neighbouring segments share their borders in every format: they are a valid coverage (GEOS)."""

from pathlib import Path
from typing import Any

import geopandas
import numpy as np
import pytest
import shapely
from affine import Affine
from numpy.typing import NDArray
from rasterio.crs import CRS
from skimage.measure import label

from uavseg.jobs.result.result import Drawing
from uavseg.raster.grid.geobox import GeoBox
from uavseg.regions.formats.export import write_regions
from uavseg.regions.outline.trace import trace
from uavseg.regions.table import Regions, make_regions
from uavseg.regions.wgs84 import to_wgs84
from uavseg.segmentation.components import Sums

FORMATS = ["geojson", "gpkg", "fgb", "parquet", "shp", "kml"]
UTM = 32633, Affine(30, 0, 300_000, 0, -30, 6_700_000)
PLACES = {
    "UTM": UTM,
    "fine pixels": (32633, Affine(0.003, 0, 300_000, 0, -0.003, 6_700_000)),
    "the antimeridian in UTM": (32701, Affine(300, 0, 180_000, 0, -300, 8e6)),
    "the antimeridian in Mercator": (3832, Affine(3000, 0, 3_279_584 - 90_000, 0, -3000, 2e6)),
    "degrees past 180": (4326, Affine(0.1, 0, 174, 0, -0.1, 12)),
    "the south pole": (3031, Affine(5000, 0, -300_000, 0, -5000, 300_000)),
    "a turned raster": (32633, Affine(20, 7, 300_000, 7, -20, 6_700_000)),
}


def stripes_below_a_field() -> NDArray[np.uint32]:
    """Long straight borders at which others end, with pixels of nodata."""
    labels = np.ones((512, 512), np.uint32)
    labels[256:] = 2 + np.arange(512) // 64
    labels[100:110, 250:300] = labels[250:260, 90:110] = labels[400, 400:] = 0
    return labels


def patches(seed: int) -> NDArray[np.uint32]:
    """Segments of any shape, as classes and levels have them."""
    rng = np.random.default_rng(seed)
    classes = np.kron(rng.integers(0, 4, (30, 30)), np.ones((4, 4), int))
    classes[rng.random(classes.shape) < 0.1] = 2
    return segments(classes.astype(np.uint32))


def segments(classes: NDArray[np.uint32]) -> NDArray[np.uint32]:
    from uavseg.segmentation.components import label_equal_values

    return label_equal_values(np.ascontiguousarray(classes))[0]


def regions_of(labels: NDArray[np.uint32], crs: Any, transform: Affine, drawing: Drawing) -> Regions:
    box = GeoBox(labels.shape, transform, CRS.from_user_input(crs))
    rings, counts = trace(labels), np.bincount(labels.reshape(-1))[1:]
    sums = Sums(counts, counts, counts, np.empty((0, 2), np.int64))
    return drawing.drawn(make_regions(rings, sums, box, (0, 1), "picture.tif"), rings, box)[0]


@pytest.mark.parametrize("extension", FORMATS)
@pytest.mark.parametrize("drawing", [Drawing(), Drawing(smooth_m=15), Drawing(simplify_m=20)], ids=str)
def test_files_hold_a_valid_coverage(tmp_path: Path, extension: str, drawing: Drawing) -> None:
    for k, labels in enumerate((stripes_below_a_field(), patches(1))):
        path = tmp_path / f"{k}.{extension}"
        regions = regions_of(labels, *UTM, drawing)
        write_regions(regions, path)
        found = geopandas.read_file(path) if extension != "parquet" else geopandas.read_parquet(path)
        assert len(found) == labels.max()
        assert shapely.coverage_is_valid(found.geometry.to_numpy())


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("drawing", [Drawing(), Drawing(smooth_m=1e6)], ids=["pixel edges", "smooth"])
def test_outlines_in_wgs84_are_a_valid_coverage(place: str, drawing: Drawing) -> None:
    for labels in (stripes_below_a_field()[::4, ::4].copy(), patches(2), patches(3)):
        drawn = to_wgs84.wgs84_geometries(regions_of(labels, *PLACES[place], drawing))
        assert shapely.is_valid(drawn).all()
        assert shapely.coverage_is_valid(drawn)


@pytest.mark.parametrize("place", PLACES)
def test_regions_that_touch_themselves_at_points_are_valid_in_wgs84(place: str) -> None:
    """Components of eight neighbours: MultiPolygons, of single pixels and of blocks."""
    for grain in (1, 4):
        noise = np.random.default_rng(grain).integers(0, 3, (30, 30)).repeat(grain, 0).repeat(grain, 1)
        labels = label(noise, background=0, connectivity=2).astype(np.uint32)
        drawn = to_wgs84.wgs84_geometries(regions_of(labels, *PLACES[place], Drawing()))
        assert (shapely.get_num_geometries(drawn) > 1).any()
        assert shapely.is_valid(drawn).all() and shapely.coverage_is_valid(drawn)


def test_batches_share_the_borders_between_them() -> None:
    regions = regions_of(stripes_below_a_field(), *UTM, Drawing())
    parts = [batch.geometries() for batch in to_wgs84.wgs84_batches(regions, vertices=1)]
    assert len(parts) == len(regions) and shapely.coverage_is_valid(np.concatenate(parts))
