"""Small holes are filled, small regions dropped, and the rest renumbered."""

import numpy as np
import pytest
from affine import Affine
from hypothesis import given, settings, strategies as st
from numpy.typing import NDArray
from rasterio.crs import CRS
from scipy.ndimage import label as connected

from uavseg.errors import ParameterError
from uavseg.raster.grid.geobox import GeoBox
from uavseg.raster.grid.tiling import Window
from uavseg.regions.edit.small import Area, as_area, drop_small_regions, fill_small_holes
from uavseg.regions.outline.rings import RegionOutlines, rasterise
from uavseg.regions.outline.trace import trace
from uavseg.segmentation.components import Sums

Labels = NDArray[np.uint32]


def picture(text: str) -> Labels:
    return np.array([[0 if c == "." else int(c) for c in row] for row in text.split()], np.uint32)


def drawn(labels: Labels) -> list[str]:
    return ["".join(".123456789"[label] for label in row) for row in labels]


def outlined(labels: Labels) -> RegionOutlines:
    """What tiles would have found; the grey of a pixel is 10."""
    flat = labels.reshape(-1)
    names, firsts = np.unique(flat, return_index=True)
    places = np.stack(np.unravel_index(firsts[names > 0], labels.shape), 1)
    counts = np.bincount(flat)[1:]
    return RegionOutlines(
        trace(labels), Sums(counts, (10 * counts).astype(np.uint64), (100 * counts).astype(np.uint64), places)
    )


def box(labels: Labels, pixel_m: float = 2.0, crs: str | None = "EPSG:32618") -> GeoBox:
    place = Affine(pixel_m, 0, 5e5, 0, -pixel_m, 4e6)
    return GeoBox(labels.shape, place, None if crs is None else CRS.from_string(crs))


def painted(found: RegionOutlines, labels: Labels) -> Labels:
    return rasterise(found.rings, Window(0, 0, *labels.shape))


def filled(text: str, pixels: float) -> list[str]:
    labels = picture(text)
    return drawn(painted(fill_small_holes(outlined(labels), box(labels), Area(pixels, True)), labels))


def dropped(text: str, pixels: float) -> list[str]:
    labels = picture(text)
    return drawn(painted(drop_small_regions(outlined(labels), box(labels), Area(pixels, True)), labels))


# Areas as people write them


@pytest.mark.parametrize(
    ("text", "area"),
    [
        ("64px", Area(64, True)),
        ("500", Area(500)),
        (" 0.5 ", Area(0.5)),
        ("12 PX", Area(12, True)),
        ("0", Area(0)),
        ("1e4", Area(10_000)),
        ("4 m2", Area(4)),
        ("1ha", Area(10_000)),
        ("0.5 HA", Area(5_000)),
        ("2km2", Area(2_000_000)),
    ],
)
def test_areas_are_square_metres_or_pixels(text: str, area: Area) -> None:
    assert as_area(text) == area


@pytest.mark.parametrize(
    "text", ["", "px", "-1", "-1px", "nan", "inf", "4 m", "4 m3", "ha", "-1ha", "1,5", "1hapx"]
)
def test_a_text_that_is_not_an_area_is_refused(text: str) -> None:
    with pytest.raises(ParameterError, match="an area is"):
        as_area(text)


# Holes


def test_a_hole_below_the_minimum_is_filled() -> None:
    assert filled("1111 1..1 1111", 3) == ["1111", "1111", "1111"]


def test_a_hole_of_exactly_the_minimum_stays() -> None:
    assert filled("1111 1..1 1111", 2) == ["1111", "1..1", "1111"]


def test_each_hole_is_compared_separately() -> None:
    assert filled("11111 1.1.1 1.111 11111", 2) == ["11111", "1.111", "1.111", "11111"]


def test_a_bay_is_not_a_hole() -> None:
    assert filled("111 1.1 1.1", 9) == ["111", "1.1", "1.1"]


def test_a_bay_whose_mouth_is_only_a_corner_is_a_hole() -> None:
    assert filled("11. 1.1 111", 2) == ["11.", "111", "111"]


def test_an_island_in_a_filled_hole_becomes_part_of_what_surrounds_it() -> None:
    assert filled("11111 1...1 1.2.1 1...1 11111", 10) == ["11111"] * 5


def test_an_island_that_fills_its_hole_becomes_part_too() -> None:
    assert filled("1111 1221 1111", 3) == ["1111"] * 3


def test_an_island_with_a_lake_with_an_island_goes_with_the_largest_hole() -> None:
    lake = "1111111 1.....1 1.222.1 1.2.2.1 1.222.1 1.....1 1111111"
    assert filled(lake, 26) == ["1111111"] * 7
    assert filled(lake, 25)[3] == "1.222.1"


def test_filling_may_change_which_region_is_largest() -> None:
    before = "11111.222 11111.2.2 1.....2.2 ......222"
    assert filled(before, 3) == ["22222.111", "22222.111", "2.....111", "......111"]


def test_a_part_of_a_region_within_its_own_hole_stays() -> None:
    parted = "1111111 1.....1 1.111.1 1.....1 1111111 ....... 2......"
    assert filled(parted, 16) == ["1111111"] * 5 + [".......", "2......"]


def test_without_holes_the_same_outlines_are_returned() -> None:
    labels = picture("11.2 11..")
    found = outlined(labels)
    assert fill_small_holes(found, box(labels), Area(9, True)) is found


def test_filling_keeps_the_sums_of_the_original_pixels() -> None:
    labels = picture("111 121 111")
    found = fill_small_holes(outlined(labels), box(labels), Area(2, True))
    assert found.rings.pixel_areas().tolist() == [9]
    assert found.sums.counts.tolist() == [8] and found.sums.greys.tolist() == [80]


# Regions


def test_regions_below_the_minimum_are_dropped_and_the_rest_keep_their_order() -> None:
    assert dropped("111.2 111.2 ....2 4..33", 2) == ["111.2", "111.2", "....2", "...33"]
    assert dropped("111.2 111.2 ....2 4..33", 3) == ["111.2", "111.2", "....2", "....."]


def test_a_hole_is_not_part_of_the_area() -> None:
    assert dropped("111 1.1 111", 9) == ["...", "...", "..."]


def test_parts_of_a_region_count_together() -> None:
    assert dropped("11.1 .... 2...", 3) == ["11.1", "....", "...."]


# Units


def test_square_metres_are_measured_on_the_ground() -> None:
    labels = picture("11.2 11..")
    ground = drop_small_regions(outlined(labels), box(labels, 2), Area(5))
    assert drawn(painted(ground, labels)) == ["11..", "11.."]
    assert len(drop_small_regions(outlined(labels), box(labels, 2), Area(3.9)).sums.counts) == 2
    # At 60 degrees north a metre of Web Mercator is half a metre.
    mercator = GeoBox(labels.shape, Affine(2, 0, 0, 0, -2, 8_399_738), CRS.from_epsg(3857))
    kept = drop_small_regions(outlined(labels), mercator, Area(3.9))
    assert drawn(painted(kept, labels)) == ["11..", "11.."]


def test_holes_in_square_metres() -> None:
    labels = picture("111 1.1 111")
    for area, holes in ((3.9, 1), (4.1, 0)):
        found = fill_small_holes(outlined(labels), box(labels, 2), Area(area))
        assert int((~found.rings.exteriors).sum()) == holes


@pytest.mark.parametrize("clean", [fill_small_holes, drop_small_regions])
def test_square_metres_need_a_crs(clean: object) -> None:
    labels = picture("111 1.1 111")
    with pytest.raises(ParameterError, match=r"no CRS.*give the area in pixels, such as 4px"):
        clean(outlined(labels), box(labels, 2, None), Area(4))  # type: ignore[operator]


# Laws


def random_regions(seed: int) -> Labels:
    """Regions by size, each connected."""
    rng = np.random.default_rng(seed)
    classes = rng.integers(0, 4, rng.integers(1, 25, 2)) * (rng.random() < 0.5)
    classes = np.maximum(classes, rng.random(classes.shape) < rng.choice([0.5, 0.7, 0.9]))
    apart = np.zeros(classes.shape, np.int64)
    for kind in (1, 2, 3):
        pieces, _ = connected(classes == kind)
        apart[pieces > 0] = pieces[pieces > 0] + apart.max()
    return by_size(apart)


def by_size(apart: NDArray[np.int64]) -> Labels:
    names, firsts, sizes = np.unique(apart, return_index=True, return_counts=True)
    order = [name for _, _, name in sorted(zip(-sizes, firsts, names, strict=True)) if name]
    labels = np.zeros(apart.shape, np.uint32)
    for number, name in enumerate(order, 1):
        labels[apart == name] = number
    return labels


def filled_by_force(labels: Labels, limit: float) -> Labels:
    """Every hole, seen as a piece of what a region is not that the border does not reach."""
    holes = []
    for name in range(1, int(labels.max()) + 1):
        pieces, many = connected(np.pad(labels != name, 1, constant_values=True))
        holes += [
            (inside.sum(), name, inside) for k in range(1, many + 1) if not (inside := pieces == k)[0, 0]
        ]
    result = labels.astype(np.int64)
    for size, name, inside in sorted(holes, key=lambda hole: int(hole[0])):  # the outermost is painted last
        if size < limit:
            result[inside[1:-1, 1:-1]] = name
    return by_size(result)


@pytest.mark.slow
@settings(max_examples=60)
@given(st.integers(0, 10**6), st.integers(0, 30))
def test_filled_holes_are_those_of_brute_force(seed: int, limit: int) -> None:
    labels = random_regions(seed)
    found = fill_small_holes(outlined(labels), box(labels), Area(limit, True))
    wanted = filled_by_force(labels, limit)
    assert np.array_equal(painted(found, labels), wanted)
    assert len(found.sums.counts) == wanted.max()
    again = trace(wanted)
    assert np.array_equal(found.rings.vertices, again.vertices)
    assert np.array_equal(found.rings.labels, again.labels) and np.array_equal(found.rings.parts, again.parts)


@settings(max_examples=40)
@given(st.integers(0, 10**6), st.integers(0, 12))
def test_dropped_regions_are_those_of_brute_force(seed: int, limit: int) -> None:
    labels = random_regions(seed)
    sizes = np.bincount(labels.reshape(-1))
    wanted = np.where(
        (sizes[labels] >= limit) & (labels > 0), labels, 0
    )  # ids are by size: what is left is 1..k
    found = drop_small_regions(outlined(labels), box(labels), Area(limit, True))
    assert np.array_equal(painted(found, labels), wanted)
    assert found.sums.greys.tolist() == (10 * np.bincount(wanted.reshape(-1))[1:]).tolist()
