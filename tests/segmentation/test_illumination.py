"""A flat field: linear light is taken away exactly, for any tiles, and nodata darkens nothing near it."""

import numpy as np
import pytest
from hypothesis import given, strategies as st
from numpy.typing import NDArray

from tests.segmentation.in_memory_dataset import InMemory, field_of, source_of
from uavseg.execution.executors import threads
from uavseg.raster.grid.tiling import TilePass, Window, tiles
from uavseg.segmentation.params.illumination import Illumination, fit_illumination, square_side
from uavseg.segmentation.source import GreySource, measure_illumination

SEEDS = st.integers(0, 100_000)
WIDTHS = st.sampled_from([(32, 32), (64, 64), (40, 90), (150, 131), (260, 400)])


def whole(source: GreySource, width: tuple[int, int]) -> Illumination:
    return measure_illumination(source, width, TilePass(tiles(source.shape, 512)))


def flattened(source: GreySource, width: tuple[int, int]) -> NDArray[np.int64]:
    """Grey of a whole source after its light is taken away."""
    flat = GreySource(source.dataset, source.stretch, illumination=whole(source, width))
    rows, cols = source.shape
    return flat.read(Window(0, 0, rows, cols), 0).grey[:rows, :cols].astype(np.int64)


def plain(values: NDArray[np.uint8], valid: NDArray[np.bool_], width: tuple[int, int]) -> NDArray[np.float64]:
    """Grey after the light is taken away, by least squares at each square and `np.interp`; slow."""
    grey, step = np.where(valid, values * 257.0, 0), square_side(width)
    shape = tuple(-(-length // step) for length in grey.shape)
    padded = [np.zeros((shape[0] * step, shape[1] * step)) for _ in range(2)]
    for array, into in zip((grey, valid), padded, strict=True):
        into[: grey.shape[0], : grey.shape[1]] = array
    sums, counts = (array.reshape(shape[0], step, shape[1], step).sum(axis=(1, 3)) for array in padded)
    mean = np.floor(grey.sum() / max(valid.sum(), 1) + 0.5)
    rows, cols = np.indices(shape)
    reach = [min(max(-(-length // step), 2), side) for length, side in zip(width, shape, strict=True)]
    light = np.full(shape, mean)
    for row, col in np.ndindex(*shape):
        weight = (
            np.maximum(reach[0] - abs(rows - row), 0) * np.maximum(reach[1] - abs(cols - col), 0) * counts
        )
        if weight.sum() > 0:
            used = weight > 0
            light[row, col] = _at(
                row, col, rows[used], cols[used], weight[used], (sums / np.maximum(counts, 1))[used]
            )
    light = np.clip(np.floor(light + 0.5), 0, 65535)
    found = light
    for axis, length in enumerate(grey.shape):
        found = _between(found, (np.arange(length) + 0.5) / step - 0.5, axis)
    return np.where(valid, np.clip(grey - np.floor(found + 0.5) + mean, 0, 65535), 0)


def _between(nodes: NDArray[np.float64], at: NDArray[np.float64], axis: int) -> NDArray[np.float64]:
    """Linear interpolation along an axis, and extrapolation outside."""
    if nodes.shape[axis] == 1:
        return nodes.repeat(len(at), axis)
    first = np.clip(np.floor(at), 0, nodes.shape[axis] - 2).astype(int)
    share = (at - first)[:, None] if axis == 0 else (at - first)[None]
    found: NDArray[np.float64] = nodes.take(first, axis) * (1 - share) + nodes.take(first + 1, axis) * share
    return found


def _at(
    row: int,
    col: int,
    rows: NDArray[np.int64],
    cols: NDArray[np.int64],
    weight: NDArray[np.float64],
    means: NDArray[np.float64],
) -> float:
    """The value at a square of the weighted plane, nearer to the mean where it is badly determined."""
    design = np.stack([np.ones(len(rows)), rows - row, cols - col], axis=1)
    normal = design.T @ (weight[:, None] * design)
    average = float((weight * means).sum() / weight.sum())
    inverse = np.linalg.inv(normal + np.diag([0, 1, 1]) * 1e-9 * weight.sum())
    trust = np.clip((12 - inverse[0, 0] * weight.sum()) / 6, 0, 1)
    plane = float((inverse @ (design.T @ (weight * means)))[0])
    return average + float(trust) * (plane - average)


@pytest.mark.slow
@given(SEEDS, WIDTHS, st.integers(9, 170), st.integers(9, 170))
def test_it_is_what_least_squares_give(seed: int, width: tuple[int, int], rows: int, cols: int) -> None:
    dataset = field_of(seed, (rows, cols))
    found = flattened(source_of(dataset), width)
    assert abs(found - plain(dataset.values, dataset.valid, width)).max() <= 2  # roundings of nodes


@pytest.mark.slow
@given(SEEDS, st.integers(33, 300), st.integers(33, 300), WIDTHS, st.sampled_from([64, 128, (64, 192)]))
def test_tiles_and_threads_change_no_grey(
    seed: int, rows: int, cols: int, width: tuple[int, int], side: int | tuple[int, int]
) -> None:
    source = source_of(field_of(seed, (rows, cols)))
    one, other = (
        whole(source, width),
        measure_illumination(source, width, TilePass(tiles(source.shape, side), threads(2))),
    )
    assert (one.step, one.target) == (other.step, other.target)
    assert np.array_equal(one.nodes, other.nodes)
    flat = GreySource(source.dataset, source.stretch, illumination=one)
    image = flat.read(Window(0, 0, rows, cols), 0).grey
    for window in tiles(source.shape, side):
        part = flat.read(window, 0)
        assert np.array_equal(part.grey[: window.rows, : window.cols], image[window.slices])


@given(SEEDS, WIDTHS, st.integers(-60, 60), st.integers(-60, 60), st.integers(-1000, 1000))
def test_linear_light_changes_nothing(
    seed: int, width: tuple[int, int], down: int, across: int, more: int
) -> None:
    rows, cols = np.indices((192, 256))
    texture = np.random.default_rng(seed).integers(26_000, 36_000, rows.shape)
    light = more + down * (2 * rows - 191) // 2 + across * (2 * cols - 255) // 2

    def of(grey: NDArray[np.int64]) -> NDArray[np.int64]:
        step, found = square_side(width), grey.astype(np.uint16)
        shape = -(-192 // step), -(-256 // step)
        ends = [np.arange(0, length, step) for length in grey.shape]
        sums, counts = (
            np.add.reduceat(np.add.reduceat(array, ends[0], axis=0), ends[1], axis=1)
            for array in (grey, np.ones_like(grey))
        )
        assert sums.shape == shape
        fit_illumination(sums, counts, step, width).subtract_from(found, None, (0, 0))
        return found.astype(np.int64)

    assert abs(of(texture + light) - more - of(texture)).max() <= 3


def test_a_plane_becomes_its_mean_everywhere() -> None:
    rows, cols = np.indices((256, 256))
    image = (rows // 2 + cols // 4).astype(np.uint8)
    found = flattened(source_of(InMemory(image, np.ones(image.shape, bool))), (64, 64))
    assert abs(found - found.mean()).max() < 257  # steps of one grey of 256, at the corners too


@given(SEEDS, WIDTHS)
def test_nodata_does_not_darken_what_is_near(seed: int, width: tuple[int, int]) -> None:
    rng = np.random.default_rng(seed)
    valid = np.ones((200, 180), bool)
    for _ in range(4):
        row, col = rng.integers(0, 180, 2)
        valid[row : row + 60, col : col + 50] = False
    image = np.full(valid.shape, 90, np.uint8)
    assert (flattened(source_of(InMemory(image, valid)), width)[valid] == 90 * 257).all()


@pytest.mark.slow
@given(SEEDS, WIDTHS)
def test_taken_away_twice_little_changes(seed: int, width: tuple[int, int]) -> None:
    rng = np.random.default_rng(seed)
    rows, cols = np.indices((320, 320)) / 320
    light = 40 * np.sin(rng.uniform(1, 2) * rows + cols) + 60 * rows * cols
    image = np.floor(100 + light + rng.normal(0, 6, rows.shape)).astype(np.uint8)
    valid = np.ones(image.shape, bool)
    once = flattened(source_of(InMemory(image, valid)), width)
    twice = flattened(source_of(InMemory((once / 257).round().astype(np.uint8), valid)), width)
    first, second = abs(once - image * 257.0).mean(), abs(twice - once).mean()
    assert second < 0.2 * first


def test_light_that_is_not_linear_goes_too() -> None:
    rng = np.random.default_rng(3)
    rows, cols = np.indices((512, 512)) / 512 - 0.5
    light = 120 - 200 * (rows**2 + cols**2)  # vignetting
    image = np.floor(light + 60 + rng.normal(0, 5, rows.shape)).clip(0, 255).astype(np.uint8)
    found = flattened(source_of(InMemory(image, np.ones(image.shape, bool))), (128, 128)) / 257
    assert image.std() > 18 and found.std() < 5.7


@pytest.mark.parametrize(
    "width, side", [((32, 32), 8), ((127, 500), 8), ((128, 128), 16), ((256, 300), 32), ((9999, 9999), 1024)]
)
def test_squares_are_an_eighth_of_the_width_at_most(width: tuple[int, int], side: int) -> None:
    assert square_side(width) == side


def test_without_valid_pixels_nothing_happens() -> None:
    nothing = np.zeros((3, 4), np.int64)
    found = fit_illumination(nothing, nothing, 8, (32, 32))
    assert found.target == 0 and not found.nodes.any()


def test_a_single_row_of_squares_has_a_slope_along_it() -> None:
    counts = np.full((1, 40), 64, np.int64)
    sums = counts * (1000 + 50 * np.arange(40))[None]
    found = fit_illumination(sums, counts, 8, (64, 64))
    assert np.array_equal(found.nodes[0], 1000 + 50 * np.arange(40))
