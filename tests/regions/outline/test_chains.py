"""Chains of tiles: closed within a tile, open at its borders, each with its continuation in another tile."""

import numpy as np
from hypothesis import given, settings, strategies as st
from numpy.typing import NDArray

from uavseg.raster.grid.tiling import Window
from uavseg.regions.outline.chains import FIRST, HEAD, LAST, OWNER, START, TAIL, Chains, trace_tile
from uavseg.segmentation.components import label_equal_values

Labels = NDArray[np.uint32]


@st.composite
def label_images(draw: st.DrawFn) -> Labels:
    rows, cols = draw(st.integers(1, 9)), draw(st.integers(1, 9))
    line = st.lists(st.integers(0, draw(st.integers(1, 3))), min_size=cols, max_size=cols)
    return np.array(draw(st.lists(line, min_size=rows, max_size=rows)), np.uint32)


def chains_of(labels: Labels, side: int, margin: int = 1, dtype: type = np.uint32) -> list[Chains]:
    """Chains of all tiles of a square side; their owners are components of the whole image."""
    components, _ = label_equal_values(labels)
    framed = np.pad(labels, margin).astype(dtype)
    found = []
    for row in range(0, labels.shape[0], side):
        for col in range(0, labels.shape[1], side):
            w = Window(row, col, side, side).clipped(labels.shape)
            part = framed[row : row + w.rows + 2 * margin, col : col + w.cols + 2 * margin]
            own = np.ascontiguousarray(components[w.slices])
            found.append(trace_tile(np.ascontiguousarray(part), own, margin, (row, col), labels.shape[1]))
    return found


def pixel_edges(labels: Labels) -> int:
    """Edges of pixels, each counted once for each label beside it."""
    framed = np.pad(labels, 1)
    across, down = framed[:, 1:] != framed[:, :-1], framed[1:] != framed[:-1]
    sides = [(across, framed[:, 1:]), (across, framed[:, :-1]), (down, framed[1:]), (down, framed[:-1])]
    return sum(int((different & (pixel > 0)).sum()) for different, pixel in sides)


def length(chains: Chains) -> int:
    """Edges of closed chains."""
    total = 0
    for part in np.split(chains.vertices.astype(int), chains.table[1:, START]):
        total += int(np.abs(part - np.roll(part, -1, axis=0)).sum())
    return total


def test_a_pixel_is_one_closed_chain_of_four_corners() -> None:
    [chains] = chains_of(np.ones((1, 1), np.uint32), 1)
    assert chains.vertices.tolist() == [[0, 0], [0, 1], [1, 1], [1, 0]]
    assert chains.table[0, [OWNER, START, HEAD, TAIL]].tolist() == [1, 0, -1, -1]
    assert chains.table[0, [FIRST, LAST]].tolist() == [0, 3]


def test_a_boundary_that_leaves_a_tile_is_open() -> None:
    left, right = chains_of(np.ones((1, 2), np.uint32), 1)
    assert left.table[0, HEAD] == right.table[0, TAIL] >= 0
    assert left.table[0, TAIL] == right.table[0, HEAD] >= 0


@given(label_images())
@settings(max_examples=60)
def test_chains_of_a_whole_image_are_closed_and_as_long_as_its_edges(labels: Labels) -> None:
    [chains] = chains_of(labels, 9)
    assert (chains.table[:, [HEAD, TAIL]] == -1).all()
    if len(chains.table):
        assert length(chains) == pixel_edges(labels)


@given(label_images(), st.integers(1, 5))
@settings(max_examples=60)
def test_every_open_chain_continues_in_one_other_of_the_same_component(labels: Labels, side: int) -> None:
    table = np.concatenate([chains.table for chains in chains_of(labels, side)])
    heads = {int(row[HEAD]): int(row[OWNER]) for row in table if row[HEAD] >= 0}
    tails = {int(row[TAIL]): int(row[OWNER]) for row in table if row[TAIL] >= 0}
    assert heads == tails
    assert len(heads) == (table[:, HEAD] >= 0).sum() == (table[:, TAIL] >= 0).sum()


@given(label_images(), st.integers(1, 5))
@settings(max_examples=40)
def test_type_and_margin_of_the_image_change_nothing(labels: Labels, side: int) -> None:
    wide = chains_of(labels, side, margin=8, dtype=np.uint8)
    for one, other in zip(chains_of(labels, side), wide, strict=True):
        for name in ("vertices", "pinched", "table"):
            assert np.array_equal(getattr(one, name), getattr(other, name))
