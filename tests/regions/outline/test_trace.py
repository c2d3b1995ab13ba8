"""Traced outlines: those of rasterio, along pixel edges, ordered by label and raster position."""

import numpy as np
import pytest
import rasterio.features
import shapely
from hypothesis import given, settings, strategies as st
from numpy.typing import NDArray
from shapely.geometry import shape

from uavseg.raster.grid.tiling import Window
from uavseg.regions.outline.rings import Rings, rasterise
from uavseg.regions.outline.trace import trace

Labels = NDArray[np.uint32]
ONE = "#"  # in a drawing, # is label 1, digits are themselves and . is nothing


def picture(text: str) -> Labels:
    """Labels from a drawing, a row for each word."""
    return np.array(
        [[int(c) if c.isdigit() else int(c == ONE) for c in row] for row in text.split()], np.uint32
    )


def random_labels(seed: int) -> Labels:
    """Two to four labels, sparse or dense, large or a single row or column."""
    rng = np.random.default_rng(seed)
    rows, cols = rng.integers(1, 30, 2)
    rows, cols = [(rows, cols), (rows, cols), (rows, cols), (1, cols), (rows, 1)][seed % 5]
    names = rng.integers(1, rng.integers(2, 6), (rows, cols))
    return np.where(rng.random((rows, cols)) < rng.choice([0.1, 0.4, 0.6, 0.95]), names, 0).astype(np.uint32)


@st.composite
def label_images(draw: st.DrawFn) -> Labels:
    rows, cols = draw(st.integers(1, 9)), draw(st.integers(1, 9))
    line = st.lists(st.integers(0, draw(st.integers(1, 3))), min_size=cols, max_size=cols)
    return np.array(draw(st.lists(line, min_size=rows, max_size=rows)), np.uint32)


def polygons(rings: Rings) -> list[tuple[int, shapely.Polygon]]:
    """Label and polygon, in (col, row), of each part."""
    found = []
    for part in range(int(rings.parts.max(initial=-1)) + 1):
        ks = np.flatnonzero(rings.parts == part)
        exterior, *holes = [rings.vertices[rings.starts[k] : rings.starts[k + 1], ::-1] for k in ks]
        found.append((int(rings.labels[ks[0]]), shapely.Polygon(exterior, holes)))
    return found


def as_text(pairs: list[tuple[int, shapely.Geometry]]) -> list[tuple[int, str]]:
    """Without the vertices at which outlines do not turn."""
    turns = [(label, shapely.normalize(shapely.simplify(geometry, 0))) for label, geometry in pairs]
    return sorted((label, shapely.to_wkt(geometry, 3)) for label, geometry in turns)


def of_rasterio(labels: Labels) -> list[tuple[int, shapely.Geometry]]:
    found = rasterio.features.shapes(labels.astype(np.int32), mask=labels > 0, connectivity=4)
    return [(int(value), shape(geometry)) for geometry, value in found]


def corners(text: str) -> list[list[list[int]]]:
    """The rings of a drawing, each as its (row, col) corners."""
    rings = trace(picture(text))
    return [r.tolist() for r in np.split(rings.vertices, rings.starts[1:-1])]


# Pictures


def test_a_pixel_is_a_square_that_runs_clockwise_from_its_upper_left_corner() -> None:
    assert corners("#") == [[[0, 0], [0, 1], [1, 1], [1, 0]]]


def test_an_l_has_six_corners() -> None:
    assert corners("#.  ##") == [[[0, 0], [0, 1], [1, 1], [1, 2], [2, 2], [2, 0]]]


def test_a_ring_has_a_hole_that_runs_the_other_way() -> None:
    assert corners("### #.# ###") == [
        [[0, 0], [0, 3], [3, 3], [3, 0]],
        [[1, 1], [2, 1], [2, 2], [1, 2]],
    ]


def test_a_hole_may_touch_the_outside_at_a_corner() -> None:
    rings = trace(picture("##. #.# ###"))
    [(_, polygon)] = polygons(rings)
    assert polygon.is_valid and polygon.area == 7
    assert rings.exteriors.tolist() == [True, False]
    assert [1, 2] in rings.vertices[: rings.starts[1]].tolist()
    assert [1, 2] in rings.vertices[rings.starts[1] :].tolist()


def test_two_holes_may_touch_at_a_corner() -> None:
    rings = trace(picture("#### #.## ##.# ####"))
    assert rings.pixel_areas().tolist() == [16, -1, -1]


@pytest.mark.parametrize(("drawing", "labels"), [("1. .1", [1, 1]), ("1. .2", [1, 2]), (".1 1.", [1, 1])])
def test_a_corner_does_not_connect(drawing: str, labels: list[int]) -> None:
    rings = trace(picture(drawing))
    assert rings.labels.tolist() == labels
    assert rings.parts.tolist() == [0, 1]
    assert rings.exteriors.all() and rings.pixel_areas().tolist() == [1, 1]


def test_a_checkerboard_is_as_many_squares_as_it_has_black_fields() -> None:
    board = (np.indices((6, 7)).sum(0) % 2).astype(np.uint32)
    rings = trace(board)
    assert np.diff(rings.starts).tolist() == [4] * int(board.sum())
    assert rings.parts.tolist() == list(range(int(board.sum())))


def test_nested_rings_alternate_between_exteriors_and_holes() -> None:
    rings = trace(picture("1111111 1.....1 1.222.1 1.2.2.1 1.222.1 1.....1 1111111"))
    assert rings.labels.tolist() == [1, 1, 2, 2]
    assert rings.pixel_areas().tolist() == [49, -25, 9, -1]
    assert rings.exteriors.tolist() == [True, False, True, False]


def test_an_island_of_the_same_label_in_a_hole_is_a_part_of_its_own() -> None:
    rings = trace(picture("##### #...# #.#.# #...# #####"))
    assert rings.parts.tolist() == [0, 0, 1] and set(rings.labels.tolist()) == {1}


def test_outlines_have_a_vertex_where_the_border_of_others_ends() -> None:
    assert corners("11 23") == [
        [[0, 0], [0, 2], [1, 2], [1, 1], [1, 0]],
        [[1, 0], [1, 1], [2, 1], [2, 0]],
        [[1, 1], [1, 2], [2, 2], [2, 1]],
    ]
    assert corners("11 2.")[0] == [[0, 0], [0, 2], [1, 2], [1, 1], [1, 0]]
    assert corners("11 ..") == [[[0, 0], [0, 2], [1, 2], [1, 0]]]


def test_parts_of_a_label_are_in_raster_order_of_their_first_pixels() -> None:
    rings = trace(picture("..1 ... 1.2 ..2 .1."))
    assert rings.labels.tolist() == [1, 1, 1, 2]
    assert rings.vertices[rings.starts[:-1]].tolist() == [[0, 2], [2, 0], [4, 1], [2, 2]]


@pytest.mark.parametrize("empty", [(3, 4), (1, 1)])
def test_an_empty_image_has_no_outline(empty: tuple[int, int]) -> None:
    rings = trace(np.zeros(empty, np.uint32))
    assert len(rings.labels) == 0 and rings.starts.tolist() == [0] and len(rings.pixel_areas()) == 0
    assert not rasterise(rings, Window(0, 0, *empty)).any()


# Laws


@pytest.mark.slow
@pytest.mark.parametrize("first", range(0, 240, 40))
def test_outlines_are_those_of_rasterio(first: int) -> None:
    for seed in range(first, first + 40):
        labels = random_labels(seed)
        assert as_text(polygons(trace(labels))) == as_text(of_rasterio(labels)), seed


@pytest.mark.slow
@settings(max_examples=60)
@given(label_images())
def test_outlines_of_small_images_are_those_of_rasterio(labels: Labels) -> None:
    found = polygons(trace(labels))
    assert all(polygon.is_valid for _, polygon in found)
    assert as_text(found) == as_text(of_rasterio(labels))


@pytest.mark.slow
@settings(max_examples=100)
@given(label_images())
def test_regions_are_a_valid_coverage(labels: Labels) -> None:
    found = polygons(trace(labels))
    parts = {name: [polygon for label, polygon in found if label == name] for name, _ in found}
    assert shapely.coverage_is_valid([shapely.MultiPolygon(polygons) for polygons in parts.values()])


@pytest.mark.slow
@settings(max_examples=60)
@given(label_images())
def test_every_ring_is_simple_and_begins_where_it_should(labels: Labels) -> None:
    rings = trace(labels)
    for k, exterior in enumerate(rings.exteriors):
        ring = rings.vertices[rings.starts[k] : rings.starts[k + 1]]
        assert ring[0].tolist() == min(ring.tolist())
        assert len(np.unique(ring, axis=0)) == len(ring)
        around = np.vstack([ring[-1:], ring, ring[:1]])
        upright = np.diff(around[:, 1]) == 0
        turns = upright[1:] != upright[:-1]
        near = np.pad(labels, 1)
        for (row, col), turning in zip(ring.tolist(), turns.tolist(), strict=True):
            corner = near[row : row + 2, col : col + 2]
            assert turning or len(np.unique(corner)) == 3  # a node, at which another border ends
        seen = shapely.LinearRing(np.stack([ring[:, 1], -ring[:, 0]], 1))
        assert shapely.is_ccw(seen) != exterior


@pytest.mark.slow
@settings(max_examples=40)
@given(label_images())
def test_a_turned_or_mirrored_image_gives_turned_or_mirrored_outlines(labels: Labels) -> None:
    rows, cols = labels.shape
    turns = {
        "a quarter": (np.rot90(labels), lambda xy: np.stack([xy[:, 1], cols - xy[:, 0]], 1)),
        "mirrored": (labels[:, ::-1], lambda xy: np.stack([cols - xy[:, 0], xy[:, 1]], 1)),
        "upside down": (labels[::-1], lambda xy: np.stack([xy[:, 0], rows - xy[:, 1]], 1)),
        "transposed": (labels.T, lambda xy: xy[:, ::-1]),
    }
    upright = polygons(trace(labels))
    for image, turn in turns.values():
        turned = [(label, shapely.transform(polygon, turn)) for label, polygon in upright]
        assert as_text(polygons(trace(image))) == as_text(turned)
