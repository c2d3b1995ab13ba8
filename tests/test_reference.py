"""The reference implementation agrees with pictures small enough to compute by hand."""

import math
from fractions import Fraction
from types import ModuleType

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from numpy.typing import NDArray
from scipy.stats import chi2_contingency

greys = st.lists(st.one_of(st.integers(0, 65535), st.integers(7, 9)), min_size=9, max_size=9)
counts = st.lists(st.tuples(st.integers(0, 60), st.integers(0, 60)), min_size=2, max_size=40)


def picture(text: str) -> NDArray[np.str_]:
    """The characters of a drawing, a row for each line."""
    return np.array([list(line.strip()) for line in text.split()])


def everywhere(image: NDArray) -> NDArray[np.bool_]:
    return np.ones(image.shape, bool)


def noise(seed: int, shape: tuple[int, int], low: int = 0, high: int = 65536) -> NDArray[np.uint16]:
    return np.random.default_rng(seed).integers(low, high, shape).astype(np.uint16)


# Grey levels


def test_greys_run_from_low_to_high_and_are_clipped(reference: ModuleType) -> None:
    values = np.array([[-5.0, 0.0, 1.0, 2.0, 2.5]])
    assert reference.grey(values, everywhere(values), 0, 2).tolist() == [[0, 0, 32768, 65535, 65535]]


def test_eight_bits_become_multiples_of_257(reference: ModuleType) -> None:
    values = np.arange(256, dtype=np.uint8).reshape(16, 16)
    assert np.array_equal(reference.grey(values, everywhere(values), 0, 255), 257 * values.astype(int))


def test_an_invalid_pixel_is_black_whatever_its_value(reference: ModuleType) -> None:
    values = np.array([[np.nan, np.inf, 1.0]])
    assert reference.grey(values, np.array([[False, False, True]]), 0, 1).tolist() == [[0, 0, 65535]]


def test_luminance_weights_green_most(reference: ModuleType) -> None:
    pure = np.eye(3).reshape(3, 1, 3)
    assert reference.intensity(pure).tolist() == [[0.2126, 0.7152, 0.0722]]


# Texture


def test_the_code_and_contrast_of_a_neighbourhood_computed_by_hand(reference: ModuleType) -> None:
    image = np.array([[9, 1, 9], [5, 5, 4], [2, 2, 7]], np.uint16)  # >= 5: 9, 9, 5, 7
    codes, contrast, counted = reference.texture(image, everywhere(image))
    assert codes[1, 1].item().bit_count() == 4
    assert contrast[1, 1] == 5  # 30/4 - 9/4 = 5.25
    assert counted.sum() == 1 and counted[1, 1]


def test_each_neighbour_has_a_bit_of_its_own(reference: ModuleType) -> None:
    seen = set()
    for neighbour in (0, 1, 2, 3, 5, 6, 7, 8):
        image = np.full(9, 3, np.uint16)
        image[[4, neighbour]] = 4
        codes, _, _ = reference.texture(image.reshape(3, 3), np.ones((3, 3), bool))
        seen.add(int(codes[1, 1]))
    assert seen == {1, 2, 4, 8, 16, 32, 64, 128}


@given(values=greys)
@settings(max_examples=100)
def test_contrast_is_the_floor_of_a_rational(reference: ModuleType, values: list[int]) -> None:
    centre, around = values[4], values[:4] + values[5:]
    above, below = [q for q in around if q >= centre], [q for q in around if q < centre]
    expected = 0
    if above and below:
        expected = math.floor(Fraction(sum(above), len(above)) - Fraction(sum(below), len(below)))
    image = np.array(values, np.uint16).reshape(3, 3)
    assert reference.texture(image, everywhere(image))[1][1, 1] == expected


def test_a_pixel_beside_nodata_or_the_edge_is_not_counted(reference: ModuleType) -> None:
    image = noise(0, (6, 7))
    valid = everywhere(image)
    valid[2, 2] = False
    expected = picture("....... ....##. ....##. ....##. .#####. .......") == "#"
    assert np.array_equal(reference.texture(image, valid)[2], expected)


@pytest.mark.parametrize("shape", [(1, 1), (2, 9), (9, 2)])
def test_no_pixel_is_counted_in_an_image_smaller_than_a_neighbourhood(
    reference: ModuleType, shape: tuple[int, int]
) -> None:
    assert not reference.texture(np.zeros(shape, np.uint16), np.ones(shape, bool))[2].any()


# Bin edges


def bin_edges_of(reference: ModuleType, contrasts: list[int]) -> list[int]:
    contrast = np.array([[*contrasts, 999]])
    counted = np.array([[True] * len(contrasts) + [False]])
    return reference.contrast_bin_edges(contrast, counted).tolist()


def test_bin_edges_of_histograms_computed_by_hand(reference: ModuleType) -> None:
    assert bin_edges_of(reference, [8, 7, 6, 5, 4, 3, 2, 1]) == [1, 2, 3, 4, 5, 6, 7]
    assert bin_edges_of(reference, list(range(1, 11))) == [2, 3, 4, 5, 7, 8, 9]  # ranks ceil(10 k / 8)
    assert bin_edges_of(reference, [4]) == [4] * 7
    assert bin_edges_of(reference, [0] * 6 + [3, 9]) == [0, 0, 0, 0, 0, 0, 3]
    assert bin_edges_of(reference, []) == [0] * 7


@given(contrasts=st.lists(st.integers(0, 12), min_size=1, max_size=40))
@settings(max_examples=50)
def test_a_bin_edge_is_the_smallest_value_with_enough_pixels_at_or_below_it(
    reference: ModuleType, contrasts: list[int]
) -> None:
    for k, cut in enumerate(bin_edges_of(reference, contrasts), 1):
        wanted = math.ceil(Fraction(k * len(contrasts), 8))
        assert cut == next(t for t in range(13) if sum(c <= t for c in contrasts) >= wanted)


def test_a_contrast_on_an_edge_is_below_it_and_equal_edges_leave_bins_empty(reference: ModuleType) -> None:
    edges = np.array([0, 0, 0, 0, 2, 5, 5])
    assert reference.bins(np.array([[0, 1, 2, 3, 5, 6]]), edges).tolist() == [[0, 4, 4, 5, 5, 7]]


# G


@pytest.mark.slow
@given(table=counts)
@settings(max_examples=100)
def test_G_is_the_log_likelihood_ratio_of_two_histograms(
    reference: ModuleType, table: list[tuple[int, int]]
) -> None:
    one, other = np.array([*table, (1, 1)]).T
    some = (one + other) > 0
    expected = chi2_contingency([one[some], other[some]], correction=False, lambda_="log-likelihood")[0]
    assert reference.g_statistic(one, other) == pytest.approx(expected, abs=1e-8)


def test_G_of_disjoint_histograms(reference: ModuleType) -> None:
    assert reference.g_statistic(np.array([8, 0]), np.array([0, 8])) == pytest.approx(2 * 16 * math.log(2))


def test_G_of_proportional_histograms_is_exactly_0(reference: ModuleType) -> None:
    histogram = np.array([3, 7, 11, 0, 200])
    assert {reference.g_statistic(histogram, k * histogram) for k in range(1, 50)} == {0.0}


# Division


def leaves_of(reference: ModuleType, image: NDArray[np.uint16], **how: float) -> list[tuple[int, int, int]]:
    return [leaf[:3] for leaf in reference.divide(image, everywhere(image), **how)]


def test_a_plain_block_is_one_leaf_with_its_sum_and_number(reference: ModuleType) -> None:
    image = np.full((64, 64), 100, np.uint16)
    assert reference.divide(image, everywhere(image)) == [(0, 0, 64, 409600, 4096)]


@pytest.mark.parametrize("bright", [2, 60000])
def test_two_halves_are_divided_along_their_border(reference: ModuleType, bright: int) -> None:
    image = np.zeros((64, 64), np.uint16)
    image[:, 32:] = bright
    # Only the first bright column has texture (no neighbour is below a dark pixel) and separates blocks.
    left = [(row, 0, 32) for row in (0, 32)]
    right = [(row, 48, 16) for row in (0, 16, 32, 48)]
    border = [(row, col, 8) for row in range(0, 64, 8) for col in (32, 40)]
    assert leaves_of(reference, image) == sorted(left + right + border)


def test_a_half_of_noise_is_divided_from_a_plain_half(reference: ModuleType) -> None:
    image = np.full((64, 64), 30000, np.uint16)
    image[:, 32:] = noise(1, (64, 32))
    blocks = reference.ratios(image, everywhere(image))
    assert blocks[0, 0, 64] > 10
    assert blocks[0, 0, 16] == 0
    assert (0, 0, 64) not in leaves_of(reference, image)
    assert leaves_of(reference, image, X=math.inf) == [(0, 0, 64)]


def test_R_is_infinite_where_some_children_have_equal_histograms(reference: ModuleType) -> None:
    image = np.zeros((64, 64), np.uint16)
    image[40:60, 40:60] = noise(2, (20, 20))
    assert reference.ratios(image, everywhere(image))[0, 0, 64] == math.inf


def test_R_of_two_children_is_1_and_of_one_child_0(reference: ModuleType) -> None:
    image = noise(3, (64, 20))
    blocks = reference.ratios(image, everywhere(image))
    assert blocks[0, 0, 64] == 1  # the quarters on the left
    assert blocks[0, 16, 16] == 1  # three columns of counted pixels, in the two cells on the left
    assert reference.ratios(image[:20], everywhere(image[:20]))[0, 0, 64] == 0


def test_every_block_of_the_grid_has_a_ratio(reference: ModuleType) -> None:
    image = noise(4, (65, 10))
    blocks = reference.ratios(image, everywhere(image))
    assert len(blocks) == 2 * (1 + 4 + 16)
    assert blocks[64, 0, 64] == 0


def test_the_intensity_test_divides_where_texture_does_not(reference: ModuleType) -> None:
    # Noise, brighter by 0.1 on the right; no pixel beside the step is counted.
    image = noise(9, (64, 64), 10000, 14000)
    image[:, 32:] += 6554
    valid = everywhere(image)
    valid[:, 31:33] = False
    assert reference.ratios(image, valid)[0, 0, 64] <= 1.2
    assert [leaf[:3] for leaf in reference.divide(image, valid)] == [(0, 0, 64)]
    quarters = [(0, 0, 32), (0, 32, 32), (32, 0, 32), (32, 32, 32)]
    assert [leaf[:3] for leaf in reference.divide(image, valid, tau=0.09)] == quarters
    assert [leaf[:3] for leaf in reference.divide(image, valid, tau=0.11)] == [(0, 0, 64)]


def test_the_intensity_test_uses_valid_pixels_counted_or_not(reference: ModuleType) -> None:
    image = np.array([[0] * 32 + [60000] * 32], np.uint16)
    assert reference.divide(image, everywhere(image)) == [(0, 0, 64, 32 * 60000, 64)]
    divided = reference.divide(image, everywhere(image), tau=0.05)
    assert divided == [(0, 0, 32, 0, 32), (0, 32, 32, 32 * 60000, 32), (32, 0, 32, 0, 0), (32, 32, 32, 0, 0)]


def test_leaves_cover_the_grid_once_and_every_valid_pixel(reference: ModuleType) -> None:
    for seed in range(12):
        values, valid, low, high = reference.random_raster(seed)
        g = reference.grey(values, valid, low, high)
        leaves = reference.divide(g, valid, 1.2, 0.05)
        rows, cols = (-(-size // 64) * 64 for size in g.shape)
        assert {leaf.side for leaf in leaves} <= {64, 32, 16, 8}
        assert all(leaf.row % leaf.side == leaf.col % leaf.side == 0 for leaf in leaves)
        assert sum(leaf.side**2 for leaf in leaves) == rows * cols
        assert sum(leaf.count for leaf in leaves) == valid.sum()
        assert sum(leaf.sum for leaf in leaves) == g[valid].sum(dtype=np.int64)


def test_values_of_invalid_pixels_change_nothing(reference: ModuleType) -> None:
    g, other = noise(5, (70, 70)), noise(6, (70, 70))
    valid = noise(7, (70, 70)) > 4000
    g[:, 35:] //= 3
    other[valid] = g[valid]
    assert reference.divide(g, valid, 1.1, 0.05) == reference.divide(other, valid, 1.1, 0.05)
    assert reference.ratios(g, valid) == reference.ratios(other, valid)
    mask = valid & (noise(8, (70, 70)) > 30000)
    refined = [reference.refine_scan(mask, image, valid, 0.2, 0.7) for image in (g, other)]
    assert np.array_equal(*refined)


# Segments


def test_a_range_is_closed_at_both_ends(reference: ModuleType) -> None:
    leaves = [reference.Leaf(0, 8 * k, 8, 64 * g, 64) for k, g in enumerate([13106, 13107, 26214, 26215])]
    mask = reference.in_range(leaves, (8, 32), np.ones((8, 32), bool), 0.2, 0.4)
    assert mask.any(axis=0).tolist() == [False] * 8 + [True] * 16 + [False] * 8


def test_a_leaf_without_valid_pixels_is_not_black(reference: ModuleType) -> None:
    leaves = [reference.Leaf(0, 0, 8, 0, 0)]
    assert not reference.in_range(leaves, (8, 8), np.zeros((8, 8), bool), 0, 1).any()


def test_corners_do_not_connect_and_labels_are_by_size_then_raster_order(reference: ModuleType) -> None:
    mask = picture("#..## ..#.. ###.. #...#") == "#"
    expected = [[3, 0, 0, 2, 2], [0, 0, 1, 0, 0], [1, 1, 1, 0, 0], [1, 0, 0, 0, 4]]
    labels = reference.components(mask)
    assert labels.tolist() == expected
    assert labels.dtype == np.uint32


def test_a_letter_j_is_one_region(reference: ModuleType) -> None:
    assert reference.components(picture("..# ..# #.# ###") == "#").max() == 1


def test_leaves_connect_across_the_nodata_between_their_pixels(reference: ModuleType) -> None:
    values = np.ones((8, 16))
    valid = everywhere(values)
    valid[:, 7] = False
    of_leaves, of_pixels = (
        reference.extract(values, valid, 0, 1, 0.5, 1, refine="none", connect=how)
        for how in ("leaves", "pixels")
    )
    assert of_leaves.max() == 1 and of_pixels.max() == 2
    assert (of_leaves > 0).tolist() == valid.tolist()
    assert of_pixels[0].tolist() == [2] * 7 + [0] + [1] * 8


def test_extraction_finds_a_bright_square_to_the_pixel(reference: ModuleType) -> None:
    values = np.zeros((100, 90), np.uint8)
    values[21:75, 13:66] = 200
    labels = reference.extract(values, everywhere(values), 0, 255, 0.5, 1, tau=0.05)
    assert np.array_equal(labels, values // 200)


# Refinement of ranges


IN, OUT = 40000, 100  # with [0.5, 1] as the range


def refined(reference: ModuleType, drawing: str) -> list[str]:
    """A drawing after refinement: capitals are inside, I and i in range, O and o not; '.' is invalid."""
    drawn = picture(drawing)
    grey = np.where(np.char.lower(drawn) == "i", IN, OUT).astype(np.uint16)
    mask = np.char.isupper(drawn)
    masks = [
        scan(mask.copy(), grey, drawn != ".", 0.5, 1)
        for scan in (reference.refine_scan, reference.refine_scan_by_lines)
    ]
    assert np.array_equal(*masks)
    lines = np.where(masks[0], np.char.upper(drawn), np.char.lower(drawn))
    return ["".join(line) for line in lines.tolist()]


def test_a_run_stops_after_eight_pixels(reference: ModuleType) -> None:
    assert refined(reference, "oOOOOOOOOOOOI") == ["oooooooooOOOI"]
    assert refined(reference, "IOOOOOOOOOOOo") == ["IOOOooooooooo"]
    assert refined(reference, "Iiiiiiiiiiiio") == ["IIIIIIIIIiiio"]
    assert refined(reference, "oiiiiiiiiiiiI") == ["oiiiIIIIIIIII"]


def test_a_run_restarts_after_a_pixel_that_does_not_change(reference: ModuleType) -> None:
    assert refined(reference, "oOOOoOOOOOOOOOO") == ["oooooooooooooOO"]
    assert refined(reference, "IiiiIiiiiiiiiii") == ["IIIIIIIIIIIIIii"]


def test_a_pixel_in_range_ends_a_shrinking_run_and_one_out_of_range_a_growing_run(
    reference: ModuleType,
) -> None:
    assert refined(reference, "oOOIOO") == ["oooIOO"]
    assert refined(reference, "IiioiI") == ["IIIoII"]


def test_nodata_is_not_outside_and_joins_no_region(reference: ModuleType) -> None:
    assert refined(reference, ".OOO.I.i.OOO") == [".OOO.I.i.OOO"]


def test_horizontal_scans_come_before_vertical_ones(reference: ModuleType) -> None:
    # A change goes left and then down within one round of scans, and not down and then left.
    assert refined(reference, "IOo IOI III") == ["Ioo", "IoI", "III"]
    assert refined(reference, "IIo OOO III") == ["IIo", "OOo", "III"]
    assert refined(reference, "oiI oio ooo") == ["oII", "oIo", "ooo"]
    assert refined(reference, "ooI iii ooo") == ["ooI", "iiI", "ooo"]


def test_all_four_scans_shrink_before_any_grows(reference: ModuleType) -> None:
    assert refined(reference, "oOi") == ["ooi"]  # if growing came first, i would join
    assert refined(reference, "o O i") == ["o", "o", "i"]


def test_both_implementations_of_the_scans_agree_on_noise(reference: ModuleType) -> None:
    for seed in range(40):
        shape = tuple(noise(seed, (2,), 1, 40).tolist())
        mask, g, valid = noise(seed, shape) > 30000, noise(seed + 1, shape), noise(seed + 2, shape) > 3000
        lo, hi = (0.1, 0.3) if seed % 2 else (0.05, 0.9)
        ways = [
            scan(mask & valid, g, valid, lo, hi)
            for scan in (reference.refine_scan, reference.refine_scan_by_lines)
        ]
        assert np.array_equal(*ways)
        assert not (ways[0] & ~valid).any()


# States and levels


STATES = {".": 0, "f": 1, "u": 2, "o": 3}
OWN = {"0": 0, "5": 128 * 257, "9": 65535}


def resolved(reference: ModuleType, states: str, own: str) -> list[str]:
    state = np.vectorize(STATES.get)(picture(states))
    g = np.vectorize(OWN.get)(picture(own)).astype(np.uint16)
    letters = np.array(list(STATES))
    return ["".join(letters[line]) for line in reference.refine_states(state, g)]


def test_states_change_at_498_and_502_thousandths(reference: ModuleType) -> None:
    assert [reference.state_of(k / 255) for k in (0, 126, 127, 128, 129, 255)] == [1, 1, 2, 2, 3, 3]
    assert [reference.state_of(v) for v in (0.498, 0.502)] == [1, 2]


def test_a_run_of_half_pixels_beside_unknown_becomes_unknown_without_bound(reference: ModuleType) -> None:
    assert resolved(reference, "uffffffffffffof", "55555555555555" + "0") == ["u" * 14 + "f"]
    assert resolved(reference, "uf.f", "5555") == ["uu.f"]


def test_free_against_occupied_reads_three_pixels(reference: ModuleType) -> None:
    assert resolved(reference, "foooo", "05509") == ["ffffo"]
    assert resolved(reference, "foooo", "05550") == ["foooo"]  # the deciding pixel is the fourth, too far
    assert resolved(reference, "foooo", "05909") == ["foooo"]  # the first that is not half decides
    assert resolved(reference, "foofo", "05500") == ["fooff"]  # the third is not occupied
    assert resolved(reference, "fooooo", "005005") == ["fffffo"]  # repeated after each decision


def test_right_to_left_comes_first_and_bottom_to_top_before_top_to_bottom(reference: ModuleType) -> None:
    assert resolved(reference, "fo", "90") == ["oo"]
    assert resolved(reference, "f o", "9 0") == ["o", "o"]


def test_free_is_one_segment_and_each_occupied_component_is_one(reference: ModuleType) -> None:
    values = np.zeros((64, 192))
    values[:, 64:128] = 1
    state, labels = reference.states(values, everywhere(values), X=math.inf)
    assert np.unique(labels[:, ::64]).tolist() == [1, 2]
    assert (state[0, 0], state[0, 100], state[0, 190]) == (1, 3, 1)
    _, opposite = reference.states(1 - values, everywhere(values), X=math.inf)
    assert opposite[0, ::64].tolist() == [1, 2, 3]


def test_a_value_on_an_edge_belongs_to_the_lower_level(reference: ModuleType) -> None:
    assert reference.level_edges(0.3) == [0, 0.3, 0.6, 0.9, 1.2]
    assert len(reference.level_edges(0.1)) == 11
    edges = reference.level_edges(0.2)
    assert [reference.level_of(v, edges) for v in (0, 0.1, 0.2, 0.20001, 0.6, 1)] == [0, 0, 0, 1, 2, 4]


def test_leaves_of_one_level_are_one_segment(reference: ModuleType) -> None:
    values = np.repeat([[0.05, 0.15, 0.95, 0.85]], 64, axis=1) * np.ones((64, 1))
    level, labels = reference.levels(values, everywhere(values), 0, 1, 0.2, X=math.inf)
    assert level[0, ::64].tolist() == [0, 0, 4, 4]
    assert labels[0, ::64].tolist() == [1, 1, 2, 2]


# Random rasters


def test_random_rasters_are_reproducible_and_of_many_kinds(reference: ModuleType) -> None:
    rasters = [reference.random_raster(seed) for seed in range(60)]
    for seed, (values, valid, low, high) in enumerate(rasters[:10]):
        again = reference.random_raster(seed)
        assert np.array_equal(values, again[0], equal_nan=values.dtype.kind == "f")
        assert np.array_equal(valid, again[1]) and again[2:] == (low, high)
    assert len({values.dtype for values, *_ in rasters}) == 5
    assert all(low < high for *_, low, high in rasters)
    assert all(np.isfinite(values[valid]).all() for values, valid, *_ in rasters)
    assert 10 < sum(valid.all() for _, valid, *_ in rasters) < 50
