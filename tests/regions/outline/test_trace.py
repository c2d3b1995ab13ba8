"""Outlines: the same as rasterio's, along pixel edges, and painted back to the labels they came from."""

import pickle

import numpy as np
import pytest
import rasterio.features
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from shapely.geometry import shape

from uavseg.raster.tiling import Window
from uavseg.regions.outline.chains import trace_tile
from uavseg.regions.outline.rasterise import Rasteriser, rasterise
from uavseg.regions.outline.rings import Rings
from uavseg.regions.outline.trace import link_rings, trace

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
    return sorted((label, shapely.to_wkt(shapely.normalize(geometry), 3)) for label, geometry in pairs)


def of_rasterio(labels: Labels) -> list[tuple[int, shapely.Geometry]]:
    found = rasterio.features.shapes(labels.astype(np.int32), mask=labels > 0, connectivity=4)
    return [(int(value), shape(geometry)) for geometry, value in found]


def corners(text: str) -> list[list[list[int]]]:
    """The rings of a drawing, each as its (row, col) corners."""
    rings = trace(picture(text))
    return [r.tolist() for r in np.split(rings.vertices, rings.starts[1:-1])]


def equal(one: Rings, other: Rings) -> bool:
    return all(
        np.array_equal(getattr(one, name), getattr(other, name))
        for name in ("vertices", "starts", "labels", "parts")
    )


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


def test_rings_in_rings_are_exteriors_with_holes_by_turns() -> None:
    rings = trace(picture("1111111 1.....1 1.222.1 1.2.2.1 1.222.1 1.....1 1111111"))
    assert rings.labels.tolist() == [1, 1, 2, 2]
    assert rings.pixel_areas().tolist() == [49, -25, 9, -1]
    assert rings.exteriors.tolist() == [True, False, True, False]


def test_an_island_of_the_same_label_in_a_hole_is_a_part_of_its_own() -> None:
    rings = trace(picture("##### #...# #.#.# #...# #####"))
    assert rings.parts.tolist() == [0, 0, 1] and set(rings.labels.tolist()) == {1}


def test_parts_of_a_label_are_in_raster_order_of_their_first_pixels() -> None:
    rings = trace(picture("..1 ... 1.2 ..2 .1."))
    assert rings.labels.tolist() == [1, 1, 1, 2]
    assert rings.vertices[rings.starts[:-1]].tolist() == [[0, 2], [2, 0], [4, 1], [2, 2]]


@pytest.mark.parametrize("empty", [(3, 4), (1, 1)])
def test_nothing_has_no_outline(empty: tuple[int, int]) -> None:
    rings = trace(np.zeros(empty, np.uint32))
    assert len(rings.labels) == 0 and rings.starts.tolist() == [0] and len(rings.pixel_areas()) == 0
    assert not rasterise(rings, Window(0, 0, *empty)).any()


def test_the_largest_label_that_fits_is_painted_back() -> None:
    labels = np.array([[0, 2**32 - 1, 7], [3, 2**32 - 1, 2**31]], np.uint32)
    assert np.array_equal(rasterise(trace(labels), Window(0, 0, 2, 3)), labels)


# Laws


@pytest.mark.parametrize("first", range(0, 240, 40))
def test_outlines_are_those_of_rasterio(first: int) -> None:
    for seed in range(first, first + 40):
        labels = random_labels(seed)
        assert as_text(polygons(trace(labels))) == as_text(of_rasterio(labels)), seed


@settings(max_examples=60, deadline=None)
@given(label_images())
def test_outlines_of_small_images_are_those_of_rasterio(labels: Labels) -> None:
    found = polygons(trace(labels))
    assert all(polygon.is_valid for _, polygon in found)
    assert as_text(found) == as_text(of_rasterio(labels))


@pytest.mark.parametrize("seed", range(20))
def test_areas_sum_to_the_pixels_of_each_label(seed: int) -> None:
    labels = random_labels(seed)
    rings = trace(labels)
    sums = np.bincount(rings.labels, rings.pixel_areas(), 6)
    assert sums[1:].tolist() == np.bincount(labels.reshape(-1), minlength=6)[1:].tolist()


@settings(max_examples=60, deadline=None)
@given(label_images(), st.data())
def test_painting_undoes_tracing(labels: Labels, data: st.DataObject) -> None:
    paint = Rasteriser(trace(labels))
    rows, cols = labels.shape
    assert np.array_equal(paint(Window(0, 0, rows, cols)), labels)
    row, col = data.draw(st.integers(0, rows - 1)), data.draw(st.integers(0, cols - 1))
    part = Window(row, col, data.draw(st.integers(1, rows - row)), data.draw(st.integers(1, cols - col)))
    assert np.array_equal(paint(part), labels[part.slices])


@pytest.mark.parametrize("seed", range(20))
def test_large_images_are_painted_back_too(seed: int) -> None:
    labels = random_labels(seed)
    assert np.array_equal(rasterise(trace(labels), Window(0, 0, *labels.shape)), labels)


@settings(max_examples=60, deadline=None)
@given(label_images())
def test_every_ring_is_simple_and_begins_where_it_should(labels: Labels) -> None:
    rings = trace(labels)
    for k, exterior in enumerate(rings.exteriors):
        ring = rings.vertices[rings.starts[k] : rings.starts[k + 1]]
        assert ring[0].tolist() == min(ring.tolist())
        assert len(np.unique(ring, axis=0)) == len(ring)
        upright = np.diff(np.vstack([ring, ring[:1]])[:, 1]) == 0
        assert (upright[1:] != upright[:-1]).all()  # it turns at every corner
        seen = shapely.LinearRing(np.stack([ring[:, 1], -ring[:, 0]], 1))
        assert shapely.is_ccw(seen) != exterior


@settings(max_examples=40, deadline=None)
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


@settings(max_examples=60, deadline=None)
@given(label_images(), st.integers(1, 5), st.integers(1, 5), st.randoms())
def test_tiles_of_any_size_in_any_order_link_to_the_same_rings(
    labels: Labels, tile_rows: int, tile_cols: int, random: object
) -> None:
    pieces, names = pieces_of(labels)
    image = np.pad(labels, 1)
    windows = [
        Window(row, col, tile_rows, tile_cols).clipped(labels.shape)
        for row in range(0, labels.shape[0], tile_rows)
        for col in range(0, labels.shape[1], tile_cols)
    ]
    random.shuffle(windows)  # type: ignore[attr-defined]
    chains = [
        trace_tile(
            np.ascontiguousarray(image[w.row : w.row + w.rows + 2, w.col : w.col + w.cols + 2]),
            np.ascontiguousarray(pieces[w.slices]),
            1,
            (w.row, w.col),
            labels.shape[1],
        )
        for w in windows
    ]
    assert equal(link_rings(chains, names, np.arange(len(names))), trace(labels))


def pieces_of(labels: Labels) -> tuple[Labels, NDArray[np.int64]]:
    """4-connected pieces of one label, 1..n in raster order, and the label of each (0 for piece 0)."""
    pieces, names = np.zeros(labels.shape, np.uint32), [0]
    for start in map(tuple, np.argwhere(labels > 0)):
        if pieces[start]:
            continue
        waiting, label = [start], labels[start]
        pieces[start] = len(names)
        while waiting:
            r, c = waiting.pop()
            for near in ((r - 1, c), (r + 1, c), (r, c - 1), (r, c + 1)):
                within = 0 <= near[0] < labels.shape[0] and 0 <= near[1] < labels.shape[1]
                if within and labels[near] == label and not pieces[near]:
                    pieces[near] = len(names)
                    waiting.append(near)
        names.append(int(label))
    return pieces, np.array(names, np.int64)


@settings(max_examples=40, deadline=None)
@given(label_images(), st.permutations([1, 2, 3]))
def test_chosen_rings_are_those_of_an_image_with_the_chosen_labels(labels: Labels, names: list[int]) -> None:
    rings = trace(labels)
    kept = rings.labels > 1
    new = np.array([0, *names])
    chosen = rings.select(kept, new[rings.labels[kept]])
    wanted = np.where(labels > 1, new[labels], 0).astype(np.uint32)
    assert equal(chosen, trace(wanted))


@given(st.integers(0, 10**6), st.data())
@settings(max_examples=15, deadline=None)
def test_a_sketch_holds_all_that_its_window_needs(seed: int, data: st.DataObject) -> None:
    rng = np.random.default_rng(seed)
    labels = np.kron(rng.integers(0, 4, (9, 8)), np.ones((97, 23), np.int64)).astype(np.uint32)  # long edges
    row, col = data.draw(st.integers(0, 800)), data.draw(st.integers(0, 180))
    window = Window(row, col, data.draw(st.integers(1, 873 - row)), data.draw(st.integers(1, 184 - col)))
    sketch = pickle.loads(pickle.dumps(Rasteriser(trace(labels)).edge_table(window)))
    assert np.array_equal(sketch.rasterise(), labels[window.slices])
    inside = (sketch.edges[:, 2] > 0) & (sketch.edges[:, 2] < window.cols)
    assert inside.all() and (sketch.edges[:, 0] < sketch.edges[:, 1]).all()
