"""LBP/C against a plain, slow version of it, written from its description."""

from collections import Counter
from math import log
from types import ModuleType

import numpy as np
import pytest

from uavseg.errors import ParameterError, RasterError
from uavseg.segmentation.lbpc import LbpcParams, segment_lbpc

Histogram = Counter[int]


def g_of(one: Histogram, other: Histogram) -> float:
    """The log-likelihood ratio of two histograms."""

    def x(values: object) -> float:
        return sum(n * log(n) for n in values if n)  # type: ignore[attr-defined]

    n, m = one.total(), other.total()
    G = 2 * (x(one.values()) + x(other.values()) - x([n, m]) - x((one + other).values()) + x([n + m]))
    return 0.0 if 1e-9 * (n + m) > G else G


def plain(reference: ModuleType, grey: np.ndarray, valid: np.ndarray, params: LbpcParams) -> np.ndarray:
    """The whole algorithm with dictionaries and loops."""
    picture = reference.PaddedImage(grey, valid)
    rows, cols = grey.shape
    symbols = {
        (r, c): int(picture.symbols[r, c]) for r in range(rows) for c in range(cols) if picture.counted[r, c]
    }
    label = {cell: k for k, cells in leaf_cells(reference, picture, valid, params) for cell in cells}
    models = merge(label, symbols, params)
    cache: dict[tuple[tuple[int, int], int], float] = {}
    for _ in range(params.sweeps):
        chosen = {cell: choice(cell, label, symbols, models, params, cache) for cell in label}
        changes = {cell: new for cell, new in chosen.items() if new is not None}
        label |= changes
        if not changes:
            break
    image = np.zeros(grey.shape, np.int64)
    for cell, number in label.items():
        image[cell] = number
    return reference.by_size(image)


def leaf_cells(reference: ModuleType, picture, valid: np.ndarray, params: LbpcParams):  # type: ignore[no-untyped-def]
    """The valid pixels of each leaf of at least 16 pixels, numbered in raster order of the leaves."""
    waiting = [(row, col, 64) for row, col in picture.corners(64)]
    leaves = []
    while waiting:
        block = waiting.pop()
        if block[2] > 16 and picture.ratio(*block) > params.threshold:
            waiting.extend(reference.children(*block))
        else:
            leaves.append(block)
    for number, (row, col, side) in enumerate(sorted(leaves), 1):
        here = np.argwhere(valid[row : row + side, col : col + side]).tolist()
        yield number, [(row + r, col + c) for r, c in here]


def around(cell: tuple[int, int]) -> list[tuple[int, int]]:
    r, c = cell
    return [(r - 1, c), (r + 1, c), (r, c - 1), (r, c + 1)]


def merge(label: dict, symbols: dict, params: LbpcParams) -> dict[int, Histogram]:
    """Merge regions, in place; the models of the remaining regions."""
    models: dict[int, Histogram] = {k: Counter() for k in set(label.values())}
    for cell, symbol in symbols.items():
        models[label[cell]][symbol] += 1
    pairs = {
        (min(label[cell], label[near]), max(label[cell], label[near]))
        for cell in label
        for near in around(cell)
        if near in label and label[near] != label[cell]
    }
    possible = len(models) - pieces(set(models), pairs)
    done, largest = 0, 0.0
    cache: dict[tuple[int, int], float] = {}
    while pairs:
        for a, b in pairs - cache.keys():
            cache[a, b] = min(models[a].total(), models[b].total()) * g_of(models[a], models[b])
        mi, a, b = min((cache[pair], *pair) for pair in pairs)
        if done >= params.untested * possible and mi > params.stop * largest:
            break
        done, largest = done + 1, max(largest, mi)
        models[a] += models.pop(b)
        for cell in label:
            if label[cell] == b:
                label[cell] = a
        renamed = {tuple(sorted({a if k == b else k for k in pair})) for pair in pairs}
        pairs = {pair for pair in renamed if len(pair) == 2}  # type: ignore[misc]
        cache = {pair: value for pair, value in cache.items() if not {a, b} & set(pair)}
    return models


def pieces(items: set[int], pairs: set[tuple[int, int]]) -> int:
    """Number of connected components."""
    group = {k: k for k in items}
    for a, b in pairs:
        old, new = group[a], group[b]
        group = {k: new if g == old else g for k, g in group.items()}
    return len(set(group.values()))


def choice(cell, label, symbols, models, params, cache) -> int | None:  # type: ignore[no-untyped-def]
    """A neighbouring label that fits a pixel better than its own."""
    others = sorted({label[near] for near in around(cell) if near in label} - {label[cell]})
    if not others:
        return None
    (row, col), radius = cell, params.radius
    disc = Counter(
        symbols[r, c]
        for r in range(row - radius, row + radius + 1)
        for c in range(col - radius, col + radius + 1)
        if (r - row) ** 2 + (c - col) ** 2 <= radius * radius and (r, c) in symbols
    )
    if not disc:
        return None
    for k in (label[cell], *others):
        if (cell, k) not in cache:  # neither a disc nor a model ever changes
            cache[cell, k] = g_of(disc, models[k])
    best = min([label[cell], *others], key=lambda k: cache[cell, k])
    return None if best == label[cell] else best


def scene(seed: int, shape: tuple[int, int]) -> np.ndarray:
    """Noise of a few kinds on a patchwork."""
    rng = np.random.default_rng(seed)
    rows, cols = np.indices(shape)
    step = int(rng.integers(12, 40))
    kind = (rows // step + 2 * (cols // step) + (rows > cols)) % int(rng.integers(2, 5))
    fine, stripes = rng.integers(0, 30000, shape), rng.integers(0, 3000, shape) + rows % 4 * 9000
    smooth = rows * 200 + rng.integers(0, 40, shape)
    flat = np.full(shape, 12000)
    return np.choose(kind, [fine, stripes, smooth, flat]).astype(np.uint16)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(16))
def test_it_agrees_with_the_plain_version(seed: int, reference: ModuleType) -> None:
    rng = np.random.default_rng(1000 + seed)
    shape = tuple(rng.integers(16, 75, 2).tolist())
    valid = np.ones(shape, bool)
    if seed % 3 == 0:
        valid[rng.integers(0, shape[0], 30), rng.integers(0, shape[1], 30)] = False
        valid[: shape[0] // 4, : shape[1] // 3] = False
    params = LbpcParams(
        threshold=float(rng.choice([1.0, 1.2, 1.5])),
        stop=float(rng.choice([1.3, 2.0, 4.0])),
        radius=int(rng.choice([3, 6])),
        sweeps=int(rng.choice([0, 2, 2, 32])),
    )
    grey = scene(seed, shape)
    assert np.array_equal(segment_lbpc(grey, valid, params), plain(reference, grey, valid, params))


def test_the_usual_parameters_agree_too(reference: ModuleType) -> None:
    grey, params = scene(7, (33, 40)), LbpcParams()
    assert (params.stop, params.untested, params.radius, params.sweeps) == (2.0, 0.1, 11, 32)
    assert np.array_equal(segment_lbpc(grey), plain(reference, grey, np.ones(grey.shape, bool), params))


def test_two_textures_are_two_segments_and_the_boundary_is_found() -> None:
    rng = np.random.default_rng(1)
    grey = rng.integers(0, 9000, (192, 192)).astype(np.uint16)
    slanted = np.add.outer(np.arange(192), 2 * np.arange(192)) > 290
    grey[slanted] += (np.arange(192)[:, None] % 4 * 8000 * np.ones((1, 192))).astype(np.uint16)[slanted]
    labels, blocks = segment_lbpc(grey), segment_lbpc(grey, params=LbpcParams(sweeps=0))
    assert labels.max() == 2
    wrong, wrong_blocks = (
        min((x == 1 + slanted).mean(), (x == 2 - slanted).mean()) for x in (labels, blocks)
    )
    assert wrong < wrong_blocks and wrong < 0.03


@pytest.mark.parametrize("value", [0, 30000, 65535])
def test_a_flat_image_is_one_segment(value: int) -> None:
    assert (segment_lbpc(np.full((130, 100), value, np.uint16)) == 1).all()


def test_labels_are_ordered_by_size_and_invalid_pixels_have_none() -> None:
    valid = np.ones((128, 160), bool)
    valid[:, 70:80] = False
    labels = segment_lbpc(scene(3, (128, 160)), valid)
    assert np.array_equal(labels > 0, valid)
    sizes = np.bincount(labels.ravel())[1:]
    assert (sizes > 0).all() and (np.diff(sizes) <= 0).all()
    assert not segment_lbpc(scene(3, (40, 40)), np.zeros((40, 40), bool)).any()


@pytest.mark.parametrize(
    "wrong",
    [{"threshold": -1}, {"stop": 0.5}, {"untested": 2}, {"radius": 0}, {"radius": 999}, {"sweeps": -1}],
)
def test_parameters_are_checked(wrong: dict[str, float]) -> None:
    with pytest.raises(ParameterError):
        LbpcParams(**wrong)  # type: ignore[arg-type]


def test_an_image_that_is_too_large_is_refused_with_what_to_do() -> None:
    huge = np.broadcast_to(np.uint16(0), (4097, 4096))
    with pytest.raises(RasterError, match="gdal_translate"):
        segment_lbpc(huge)
