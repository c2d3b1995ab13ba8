"""Elimination: small segments are merged into neighbours, in order of size, and their sums are added."""

import tracemalloc
from collections import Counter
from fractions import Fraction

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
from uavseg.regions.edit.eliminate import border_lengths, eliminate, is_nearer
from uavseg.regions.edit.small import Area
from uavseg.regions.outline.rings import RegionOutlines, rasterise
from uavseg.regions.outline.trace import trace
from uavseg.segmentation.components import component_sums, label_equal_values

Image = NDArray[np.integer]


def picture(text: str) -> Image:
    return np.array([[0 if c == "." else int(c) for c in row] for row in text.split()])


def segmented(classes: Image) -> NDArray[np.uint32]:
    """Connected pixels of one kind, numbered by size, ties in raster order; 0 is nothing."""
    apart = np.zeros(classes.shape, np.int64)
    for kind in np.unique(classes[classes > 0]):
        pieces, _ = connected(classes == kind)
        apart[pieces > 0] = pieces[pieces > 0] + apart.max()
    return by_size(apart)


def by_size(apart: Image) -> NDArray[np.uint32]:
    names, firsts, sizes = np.unique(apart, return_index=True, return_counts=True)
    order = [name for _, _, name in sorted(zip(-sizes, firsts, names, strict=True)) if name]
    labels = np.zeros(apart.shape, np.uint32)
    for number, name in enumerate(order, 1):
        labels[apart == name] = number
    return labels


def box(shape: tuple[int, int], crs: str | None = None) -> GeoBox:
    place = Affine(2, 0, 5e5, 0, -2, 4e6)
    return GeoBox(shape, place, None if crs is None else CRS.from_string(crs))


def outlined(labels: NDArray[np.uint32], grey: Image) -> RegionOutlines:
    return RegionOutlines(trace(labels), component_sums(labels, int(labels.max()), grey.astype(np.uint16)))


def kinds_of(labels: Image, classes: Image) -> NDArray[np.int64]:
    """The kind of each label."""
    return np.array([classes[labels == k][0] for k in range(1, int(labels.max(initial=0)) + 1)], np.int64)


def merged(text: str, limit: float, grey: str | None = None) -> list[str]:
    """The kinds that a drawing shows afterwards; grey is that of the kinds, unless it is drawn."""
    classes = picture(text)
    labels = segmented(classes)
    found = outlined(labels, 100 * (classes if grey is None else picture(grey)))
    there, kept = eliminate(found, kinds_of(labels, classes), box(classes.shape), Area(limit, True))
    painted = np.append(0, kept)[rasterise(there.rings, Window(0, 0, *classes.shape))]
    return ["".join(".123456789"[kind] for kind in row) for row in painted]


# Pictures


def test_a_small_segment_becomes_part_of_what_surrounds_it() -> None:
    assert merged("1111 1231 1111", 2) == ["1111", "1111", "1111"]


def test_a_segment_of_exactly_the_minimum_stays() -> None:
    assert merged("1111 1221 1111", 2) == ["1111", "1221", "1111"]


def test_the_longest_shared_border_decides_not_size_or_mean() -> None:
    assert merged("11111 11111 11333 11323", 2) == ["11111", "11111", "11333", "11333"]
    assert merged("1113 1123 1113 1133", 2, "1119 1199 1119 1199") == ["1113", "1113", "1113", "1133"]


def test_of_equal_borders_the_nearest_mean_decides_then_the_smaller_label() -> None:
    assert merged("111 423 4.3", 2, "111 453 4.3") == ["111", "443", "4.3"]
    assert merged("11.22 11322 11.22", 2, "11.33 11233 11.33") == ["11.22", "11122", "11.22"]


def test_the_smallest_is_merged_first_and_a_grown_segment_stays() -> None:
    assert merged("1111 1221 1321 1111", 4) == ["1111", "1221", "1221", "1111"]
    assert merged("1111 1221 1321 1111", 5) == ["1111"] * 4


def test_of_equal_areas_the_first_in_raster_order_is_merged_first() -> None:
    assert merged("111 234 111", 2)[1] == "111"
    assert merged("..2.. ..3.. 11111", 2) == ["..3..", "..3..", "11111"]


def test_a_merged_segment_joins_neighbours_of_its_kind() -> None:
    classes = picture("11211 44444")
    labels = segmented(classes)
    found, kept = eliminate(
        outlined(labels, 100 * classes), kinds_of(labels, classes), box((2, 5)), Area(2, True)
    )
    assert kept.tolist() == [1, 4] and found.rings.pixel_areas().tolist() == [5, 5]


def test_a_segment_without_neighbours_stays() -> None:
    assert merged("11.2 11.. 11.3", 3) == ["11.2", "11..", "11.3"]


def test_corners_are_not_borders() -> None:
    assert merged("11. 11. ..2", 2) == ["11.", "11.", "..2"]


def test_sums_are_added() -> None:
    classes = picture("111 121 113")
    labels = segmented(classes)
    grey = 10 * classes
    found, _ = eliminate(outlined(labels, grey), kinds_of(labels, classes), box((3, 3)), Area(2, True))
    assert found.sums.counts.tolist() == [9] and found.sums.greys.tolist() == [grey.sum()]
    assert found.sums.squares.tolist() == [(grey**2).sum()] and found.sums.firsts.tolist() == [[0, 0]]


def test_square_metres_are_measured_on_the_ground_and_need_a_crs() -> None:
    classes = picture("1111 1221 1111")
    labels = segmented(classes)
    found = outlined(labels, classes)
    for area, left in ((7.9, 2), (8.1, 1)):
        there, kept = eliminate(
            found, kinds_of(labels, classes), box(classes.shape, "EPSG:32618"), Area(area)
        )
        assert len(kept) == len(there.sums.counts) == left
    with pytest.raises(ParameterError, match=r"no CRS.*give the area in pixels, such as 4px"):
        eliminate(found, kinds_of(labels, classes), box(classes.shape), Area(4))


# Laws


def scene(seed: int) -> tuple[Image, Image]:
    """Kinds and grey, with nothing here and there."""
    rng = np.random.default_rng(seed)
    grain = rng.integers(1, 4)
    classes = np.kron(rng.integers(1, 5, (12, 12)), np.ones((grain, grain), int))[: rng.integers(1, 20)]
    classes = np.where(rng.random(classes.shape) < rng.choice([0, 0.1]), 0, classes)
    return classes, (rng.integers(0, 3, classes.shape) + 7 * classes) * 900


def borders_by_force(labels: Image) -> dict[tuple[int, int], int]:
    """How often two labels lie side by side or one above the other."""
    sides = [(labels[:, :-1], labels[:, 1:]), (labels[:-1], labels[1:])]
    pairs = np.concatenate([np.stack([a.ravel(), b.ravel()], 1) for a, b in sides]).astype(int)
    ordered = [tuple(sorted(pair)) for pair in pairs.tolist()]
    return Counter((a, b) for a, b in ordered if a != b and a > 0)


def eliminated_by_force(labels: Image, classes: Image, grey: Image, limit: float) -> tuple[Image, Image]:
    """Labels and kinds after one segment after the other was painted over."""
    labels, classes = labels.astype(np.int64), classes.copy()

    def mean(label: int) -> Fraction:
        return Fraction(int(grey[labels == label].sum()), int((labels == label).sum()))

    while True:
        names, firsts, sizes = np.unique(labels, return_index=True, return_counts=True)
        borders = borders_by_force(labels)
        neighbours = {
            int(k): {a + b - k: n for (a, b), n in borders.items() if k in (a, b)} for k in names if k
        }
        order = sorted(zip(sizes.tolist(), firsts.tolist(), names.tolist(), strict=True))
        small = [k for size, _, k in order if k and size < limit and neighbours[k]]
        if not small:
            return labels, classes
        one = small[0]
        best = min(neighbours[one].items(), key=lambda item: (-item[1], abs(mean(item[0]) - mean(one)), item))
        into = int(best[0])
        kind = classes[labels == into][0]
        classes[labels == one] = kind
        labels[labels == one] = into
        touching = {a + b - into for a, b in borders_by_force(labels) if into in (a, b)}
        alike = [into, *(k for k in touching if classes[labels == k][0] == kind)]
        labels[np.isin(labels, alike)] = min(alike)


@pytest.mark.slow
@given(st.integers(0, 10**6), st.integers(1, 30))
@settings(max_examples=60)
def test_merged_segments_are_those_of_brute_force(seed: int, limit: int) -> None:
    classes, grey = scene(seed)
    labels = segmented(classes)
    found, kept = eliminate(
        outlined(labels, grey), kinds_of(labels, classes), box(classes.shape), Area(limit, True)
    )
    wanted, shown = eliminated_by_force(labels, classes, grey, limit)
    painted = rasterise(found.rings, Window(0, 0, *classes.shape))
    assert np.array_equal(painted, by_size(wanted))
    assert kept.tolist() == kinds_of(painted, shown).tolist()
    sums = component_sums(painted, len(kept), grey.astype(np.uint16))
    for name in ("counts", "greys", "squares", "firsts"):
        assert np.array_equal(getattr(found.sums, name), getattr(sums, name))
    again = trace(painted)
    assert np.array_equal(found.rings.vertices, again.vertices)
    assert np.array_equal(found.rings.labels, again.labels)


@pytest.mark.slow
@given(st.integers(0, 10**6), st.integers(1, 60))
@settings(max_examples=60)
def test_no_pixel_is_lost_and_small_segments_have_no_neighbour(seed: int, limit: int) -> None:
    classes, grey = scene(seed)
    labels = segmented(classes)
    found, kept = eliminate(
        outlined(labels, grey), kinds_of(labels, classes), box(classes.shape), Area(limit, True)
    )
    painted = rasterise(found.rings, Window(0, 0, *classes.shape))
    assert np.array_equal(painted > 0, classes > 0)
    pairs, _ = border_lengths(painted)
    assert (kept[pairs[:, 0] - 1] != kept[pairs[:, 1] - 1]).all()
    sizes = np.bincount(painted.reshape(-1), minlength=1)[1:]
    assert (sizes[np.unique(pairs) - 1] >= limit).all()


@pytest.mark.slow
@given(st.lists(st.tuples(st.integers(1, 10**9), st.fractions(0, 65535)), min_size=3, max_size=3))
@settings(max_examples=300)
def test_means_are_compared_exactly(segments: list[tuple[int, Fraction]]) -> None:
    counts = [count for count, _ in segments]
    greys = [round(count * mean) for count, mean in segments]
    apart = [abs(Fraction(greys[k], counts[k]) - Fraction(greys[0], counts[0])) for k in (1, 2)]
    assert is_nearer(greys, counts, 0, 1, 2) == (apart[0] <= apart[1])
    assert is_nearer(greys, counts, 0, 2, 1) == (apart[1] < apart[0])


@pytest.mark.parametrize("cells", [96, 192])
def test_memory_follows_the_vertices_of_the_outlines(cells: int) -> None:
    classes = np.kron(np.random.default_rng(1).integers(1, 6, (cells, cells)), np.ones((3, 3), np.uint8))
    labels, count = label_equal_values(classes.astype(np.uint8))
    of_label = np.zeros(count, np.int64)
    of_label[labels.ravel() - 1] = classes.ravel()
    found, grid, limit = outlined(labels, 100 * classes), box(classes.shape), Area(20, True)
    eliminate(found, of_label, grid, limit)  # kernels are loaded
    tracemalloc.start()
    eliminate(found, of_label, grid, limit)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 80 * len(found.rings.vertices)
