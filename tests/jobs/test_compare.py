"""Changes between two rasters: what is gained minus what is lost is the difference, to the pixel."""

from typing import Any

import numpy as np
import pytest
import rasterio.features
from affine import Affine
from hypothesis import given, settings, strategies as st
from rasterio.crs import CRS
from rasterio.warp import Resampling, reproject

import uavseg
from uavseg.errors import ParameterError, RasterError
from uavseg.jobs.maps.compare import Comparison
from uavseg.raster.geodesy.globe import transform_between
from uavseg.raster.grid.geobox import GeoBox
from uavseg.raster.read.dataset import Dataset

UTM = CRS.from_epsg(32618)
PLACE = Affine(2, 0, 4e5, 0, -2, 5e6)
RANGE = {"range": (0.5, 1), "stretch": "0,255", "refine": "pixels"}


def blobs(seed: int, shape: tuple[int, int] = (100, 130), holes: float = 0.05) -> np.ndarray:
    """Draw patches of 7 pixels, some of them without data (NaN)."""
    rng = np.random.default_rng(seed)
    coarse = rng.integers(0, 256, (-(-shape[0] // 7), -(-shape[1] // 7))).astype(np.float32)
    coarse[rng.random(coarse.shape) < holes] = np.nan
    return np.kron(coarse, np.ones((7, 7), np.float32))[: shape[0], : shape[1]]


def placed(values: np.ndarray, transform: Affine = PLACE, crs: CRS | None = UTM) -> Dataset:
    return Dataset.of_values(values, GeoBox(values.shape, transform, crs), "drawn")


def compare(before: Any, after: Any, **words: Any) -> Comparison:
    return uavseg.compare(before, after, **(RANGE | words))


def painted(found: Comparison, geobox: GeoBox, kind: str) -> np.ndarray:
    """Pixels of a kind of change, painted from its polygons by rasterio."""
    frame = found.frame()
    shapes = list(frame.geometry[frame["class"] == kind])
    if not shapes:
        return np.zeros(geobox.shape, bool)
    return rasterio.features.geometry_mask(shapes, geobox.shape, geobox.transform, invert=True)


@pytest.mark.slow
@given(st.integers(0, 9999), st.integers(0, 9999))
@settings(max_examples=12, deadline=None)
def test_gained_minus_lost_is_the_difference_on_common_ground(one: int, other: int) -> None:
    before, after = blobs(one), blobs(other)
    found = compare(placed(before), placed(after))
    valid = ~(np.isnan(before) | np.isnan(after))
    inside = [valid & (image >= 127.5) for image in (before, after)]
    assert found.common == valid.sum() and found.grid == "both"
    assert [found.before["in range"], found.after["in range"]] == [mask.sum() for mask in inside]
    (gained, gained_m2), (lost, lost_m2) = found.changes["gained"], found.changes["lost"]
    assert gained - lost == inside[1].sum() - inside[0].sum()
    assert (gained, lost) == ((inside[1] & ~inside[0]).sum(), (inside[0] & ~inside[1]).sum())
    assert gained_m2 - lost_m2 == pytest.approx(4 * (gained - lost), rel=2e-3)  # m2 on the ground
    box = GeoBox(before.shape, PLACE, UTM)
    assert (painted(found, box, "gained") == (inside[1] & ~inside[0])).all()
    assert (painted(found, box, "lost") == (inside[0] & ~inside[1])).all()


def test_a_raster_has_not_changed_from_itself() -> None:
    found = compare(placed(blobs(1)), placed(blobs(1)))
    assert not len(found.regions) and found.changes == {"gained": (0, 0.0), "lost": (0, 0.0)}


ZONE = transform_between("EPSG:32618", "EPSG:32619")(4e5, 5e6)
GRIDS = {
    "the same": (PLACE, UTM),
    "shifted": (Affine(2, 0, 4e5 + 3.3, 0, -2, 5e6 - 7.9), UTM),
    "coarser": (Affine(5, 0, 4e5 - 11.3, 0, -5, 5e6 + 6.3), UTM),
    "turned": (PLACE @ Affine.rotation(20), UTM),
    "another zone": (Affine(3, 0, ZONE[0] - 20, 0, -3, ZONE[1] + 20), CRS.from_epsg(32619)),
    "degrees": (Affine(3e-5, 0, -76.2755, 0, -3e-5, 45.1485), CRS.from_epsg(4326)),
}


@pytest.mark.parametrize("name", GRIDS)
@pytest.mark.filterwarnings("ignore:pixels are:UserWarning")
def test_the_other_way_round_gained_and_lost_are_exchanged(name: str) -> None:
    transform, crs = GRIDS[name]
    first, second = placed(blobs(3)), placed(blobs(4), transform, crs)
    there, back = compare(first, second), compare(second, first)
    assert there.changes["gained"] == back.changes["lost"] and there.changes["lost"] == back.changes["gained"]
    assert (there.before, there.after) == (back.after, back.before)
    assert there.common == back.common > 100 and sum(pixels for pixels, _ in there.changes.values())
    swapped = back.frame()["class"].map({"gained": "lost", "lost": "gained"})
    assert (there.frame()["class"] == swapped).all()
    assert (there.frame().geometry == back.frame().geometry).all()


@pytest.mark.parametrize("name", [name for name in GRIDS if name != "the same"])
@pytest.mark.filterwarnings("ignore:pixels are:UserWarning")
def test_other_grids_and_coordinate_systems_are_those_of_gdals_nearest_neighbour(name: str) -> None:
    transform, crs = GRIDS[name]
    before, after = blobs(5), blobs(6)
    found = compare(placed(before), placed(after, transform, crs))
    on_before = found.grid == "before"
    target = (PLACE, UTM) if on_before else (transform, crs)
    moving, place = (after, (transform, crs)) if on_before else (before, (PLACE, UTM))
    warped = np.full(before.shape, np.nan, np.float32)
    how = {"resampling": Resampling.nearest, "src_nodata": np.nan, "dst_nodata": np.nan, "tolerance": 0.0}
    reproject(
        moving,
        warped,
        src_transform=place[0],
        src_crs=place[1],
        dst_transform=target[0],
        dst_crs=target[1],
        **how,
    )
    pair = (before, warped) if on_before else (warped, after)
    valid = ~(np.isnan(pair[0]) | np.isnan(pair[1]))
    inside = [valid & (image >= 127.5) for image in pair]
    box = GeoBox(before.shape, *target)
    differing = (painted(found, box, "gained") != (inside[1] & ~inside[0])).sum()
    assert differing <= 3  # centres that lie on an edge of the other grid, but for rounding
    assert abs(found.common - valid.sum()) <= 3


@pytest.mark.slow
def test_tiles_and_threads_change_nothing() -> None:
    transform, crs = GRIDS["turned"]
    first, second = placed(blobs(7, (200, 260))), placed(blobs(8, (200, 260)), transform, crs)
    whole = compare(first, second, threads=1)
    tiled = compare(first, second, tile=64, threads=3)
    assert tiled.changes == whole.changes and tiled.frame().equals(whole.frame())
    assert (tiled.before, tiled.after, tiled.common) == (whole.before, whole.after, whole.common)


def test_classes_change_into_each_other_and_pixels_add_up() -> None:
    classes = {"water": (0, 0.3), "field": (0.3, 0.6), "rock": (0.7, 1)}
    before, after = blobs(9), blobs(10)
    found = uavseg.compare(placed(before), placed(after), classes=classes, stretch="0,255", refine="pixels")
    for name in classes:
        into = sum(
            n
            for kind, (n, _) in found.changes.items()
            if kind in (f"gained {name}",) or kind.endswith(f" to {name}")
        )
        out = sum(
            n
            for kind, (n, _) in found.changes.items()
            if kind in (f"lost {name}",) or kind.startswith(f"{name} to ")
        )
        assert found.after[name] - found.before[name] == into - out
    assert "water to field" in found.changes and "water to water" not in found.changes
    assert set(found.frame()["class"]) <= set(found.changes)


def test_small_changes_are_counted_and_not_outlined() -> None:
    first, second = placed(blobs(11)), placed(blobs(12))
    whole = compare(first, second)
    with pytest.warns(UserWarning, match="smaller than --min-area are left out"):
        found = compare(first, second, min_area="60px")
    assert found.changes == whole.changes
    assert found.frame()["pixels"].min() >= 60 and len(found.regions) < len(whole.regions)
    assert found.frame()["id"].tolist() == list(range(1, len(found.regions) + 1))


def test_another_stretch_or_resolution_is_a_warning() -> None:
    first, second = placed(blobs(13)), placed(blobs(14) / 2 + 10, PLACE @ Affine.scale(2))
    with pytest.warns(UserWarning) as caught:
        uavseg.compare(first, second, range=(0.5, 1), refine="pixels")
    texts = " ".join(str(one.message) for one in caught)
    assert "the stretches differ" in texts and "borders are uncertain" in texts


def test_what_cannot_be_compared_is_refused() -> None:
    here, there = placed(blobs(15)), placed(blobs(15), PLACE @ Affine.translation(1000, 0))
    with pytest.raises(RasterError, match="no valid ground in common"):
        compare(here, there)
    with pytest.raises(RasterError, match="has no CRS"):
        compare(here, placed(blobs(15), PLACE, None))
    with pytest.raises(ParameterError, match="several ranges are classes"):
        uavseg.compare(here, here, range=["0,0.2", "0.5,1"], values=(1, 2))
    with pytest.raises(ParameterError, match="none is given"):
        uavseg.compare(here, here, refine="pixels")
    many = {f"c{k}": (k / 20, (k + 1) / 20) for k in range(16)}
    with pytest.raises(ParameterError, match="at most 15 classes"):
        uavseg.compare(here, here, classes=many, stretch="0,255", refine="pixels")
