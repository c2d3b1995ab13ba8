"""Scans and local means agree with plain versions, and depend on a bounded neighbourhood."""

from math import comb

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from numpy.typing import NDArray

from uavseg.segmentation.params.segment import IntensityRange
from uavseg.segmentation.refine.range_scans import REFINE_HALO, refine_by_local_mean, refine_by_scans

Image = NDArray[np.uint8]
seeds = st.integers(0, 100_000)


def picture(text: str) -> Image:
    """1 at each #."""
    return np.array([[char == "#" for char in line] for line in text.split()]).astype(np.uint8)


def random_case(seed: int, shape: tuple[int, int]) -> tuple[Image, Image, NDArray[np.uint16]]:
    """Blocky regions inside, holes in the valid pixels, and grey that is of one kind over long stretches."""
    rng = np.random.default_rng(seed)
    side, length = int(rng.choice([8, 16, 32])), int(rng.choice([1, 3, 9, 40]))

    def coarse(side: int, values: list[float]) -> NDArray[np.float64]:
        some = rng.choice(values, (shape[0] // side + 1, shape[1] // side + 1))
        return some.repeat(side, 0).repeat(side, 1)[: shape[0], : shape[1]]

    valid = (rng.random(shape) > rng.choice([0, 0.02, 0.3])).astype(np.uint8)
    v = coarse(length, [0.2, 0.4, 0.5, 0.6, 0.9]) + rng.normal(0, rng.choice([0.001, 0.1]), shape)
    grey = (np.clip(v, 0, 1) * 65535).astype(np.uint16) * valid
    return coarse(side, [0, 1]).astype(np.uint8) & valid, valid, grey


def in_range_of(grey: NDArray[np.uint16], valid: Image, interval: IntensityRange) -> Image:
    low, high = interval.greys
    return ((grey >= low) & (grey <= high)).astype(np.uint8) & valid


MIDDLE = IntensityRange(0.35, 0.65)


def one_line(inside: list[int], valid: list[int], in_range: list[int], grow: bool) -> list[int]:
    """One scan along one line, a pixel after the other."""
    line, run = list(inside), 0
    for k in range(1, len(line)):
        if grow:
            changes = line[k - 1] and not line[k] and valid[k] and in_range[k]
        else:
            changes = valid[k - 1] and not line[k - 1] and valid[k] and line[k] and not in_range[k]
        run = run + 1 if changes and run < 8 else 0
        if run:
            line[k] = int(grow)
    return line


def plain_scan(inside: Image, valid: Image, in_range: Image) -> Image:
    result = inside.copy()
    for grow in (False, True):
        for turn in (np.fliplr, lambda a: a, lambda a: a.T[:, ::-1], np.transpose):
            view, ok, fit = turn(result), turn(valid), turn(in_range)  # type: ignore[no-untyped-call]
            for k in range(len(view)):
                view[k] = one_line(view[k].tolist(), ok[k].tolist(), fit[k].tolist(), grow)
    return result


def plain_smooth(inside: Image, valid: Image, grey: NDArray[np.uint16], low: float, high: float) -> Image:
    weights = np.array([comb(16, k) for k in range(17)])
    result = inside.copy()
    for r, c in np.argwhere(valid):
        here = np.s_[max(r - 8, 0) : r + 9, max(c - 8, 0) : c + 9]
        if not (inside[here].any() and (valid[here] & ~inside[here] & 1).any()):
            continue
        rows = weights[max(8 - r, 0) : 8 - r + len(inside)]
        cols = weights[max(8 - c, 0) : 8 - c + inside.shape[1]]
        w = rows[:17, None] * cols[None, :17] * valid[here].astype(np.int64)
        result[r, c] = low <= int((w * grey[here]).sum()) / (65535 * int(w.sum())) <= high
    return result


@pytest.mark.slow
@settings(max_examples=60)
@given(seeds, st.tuples(st.integers(1, 50), st.integers(1, 50)))
def test_the_scans_are_those_of_a_plain_version(seed: int, shape: tuple[int, int]) -> None:
    inside, valid, grey = random_case(seed, shape)
    in_range = in_range_of(grey, valid, MIDDLE)
    expected = plain_scan(inside, valid, in_range)
    assert np.array_equal(refine_by_scans(inside, valid, in_range), expected)


@settings(max_examples=60)
@given(seeds)
def test_the_scans_of_salt_and_pepper_are_those_of_a_plain_version(seed: int) -> None:
    rng = np.random.default_rng(seed)
    valid, in_range, inside = (
        rng.random((3, *rng.integers(1, 45, 2))) < rng.random((3, 1, 1)) ** 0.3
    ).astype(np.uint8)
    inside &= valid
    in_range &= valid
    expected = plain_scan(inside, valid, in_range)
    assert np.array_equal(refine_by_scans(inside, valid, in_range), expected)


@pytest.mark.parametrize(
    "before, in_range, after",
    [
        ("####....", "##......", "##......"),  # what does not fit leaves
        ("####....", "######..", "######.."),  # what in_range joins
        ("####....", "####.###", "####...."),  # but not over what does not
        (12 * "#" + "....", 16 * ".", 4 * "#" + 12 * "."),  # a run ends after eight
        ("####" + 12 * ".", 16 * "#", 12 * "#" + "...."),
        ("########", "...##...", "########"),  # nobody outside asks
        ("........", "########", "........"),  # nobody inside asks
    ],
)
def test_a_line_is_refined_as_drawn(before: str, in_range: str, after: str) -> None:
    for turn in (lambda a: a, np.fliplr, np.transpose, lambda a: a.T[::-1]):
        inside, fit = (np.ascontiguousarray(turn(picture(text))) for text in (before, in_range))  # type: ignore[no-untyped-call]
        assert np.array_equal(refine_by_scans(inside, np.ones_like(inside), fit), turn(picture(after)))  # type: ignore[no-untyped-call]


def test_invalid_pixels_do_not_shrink_a_region() -> None:
    inside, valid = picture("####...."), picture("####.###")
    assert np.array_equal(refine_by_scans(inside.copy(), valid, np.zeros_like(inside)), inside)


def test_scan_works_in_place() -> None:
    inside = picture("####....")
    assert refine_by_scans(inside, np.ones_like(inside), picture("##......")) is inside


@pytest.mark.slow
@settings(max_examples=40)
@given(seeds, st.tuples(st.integers(1, 60), st.integers(1, 60)))
def test_smoothing_is_a_local_mean(seed: int, shape: tuple[int, int]) -> None:
    inside, valid, grey = random_case(seed, shape)
    expected = plain_smooth(inside, valid, grey, 0.35, 0.65)
    assert np.array_equal(refine_by_local_mean(inside, valid, grey, 0.35, 0.65), expected)


def test_smoothing_keeps_its_input_and_pixels_far_from_a_boundary() -> None:
    inside = np.zeros((40, 40), np.uint8)
    inside[:, 20:] = 1
    given_, valid = inside.copy(), np.ones_like(inside)
    found = refine_by_local_mean(
        inside, valid, np.full(inside.shape, 65535, np.uint16), 0.0, 0.5
    )  # all white, none in range
    assert np.array_equal(inside, given_)
    assert found[:, 28:].all() and not found[:, :28].any()


def test_the_ends_of_a_range_are_in_it_when_smoothed() -> None:
    inside = np.zeros((20, 20), np.uint8)
    inside[:, 10:] = 1
    grey = np.full(inside.shape, 13107, np.uint16)
    assert refine_by_local_mean(inside, np.ones_like(inside), grey, 0.2, 1.0)[:, 2:].all()
    assert refine_by_local_mean(inside, np.ones_like(inside), grey, 0.0, 0.2)[:, 2:].all()


def refine(how: str, inside: Image, valid: Image, grey: NDArray[np.uint16]) -> Image:
    inside, valid, grey = (np.ascontiguousarray(image).copy() for image in (inside, valid, grey))
    if how == "scan":
        return refine_by_scans(inside, valid, in_range_of(grey, valid, MIDDLE))
    return refine_by_local_mean(inside, valid, grey, MIDDLE.low, MIDDLE.high)


def crop_agrees(how: str, seed: int, margin: int) -> bool:
    """Whether a window and a pixel around it, refined with `margin` more, are as in the whole refined."""
    case = random_case(seed, (200, 220))
    row, col = 88, 96
    around = np.s_[row - margin : row + 24 + margin, col - margin : col + 40 + margin]
    core = np.s_[margin - 1 : margin + 25, margin - 1 : margin + 41]
    whole = refine(how, *case)[row - 1 : row + 25, col - 1 : col + 41]
    return np.array_equal(refine(how, *(image[around] for image in case))[core], whole)


@pytest.mark.slow
@pytest.mark.parametrize("how", ["scan", "smooth"])
@settings(max_examples=60)
@given(seeds)
def test_a_crop_with_a_halo_is_refined_as_the_whole(how: str, seed: int) -> None:
    assert crop_agrees(how, seed, REFINE_HALO)


@pytest.mark.parametrize("how", ["scan", "smooth"])
def test_a_crop_with_a_smaller_halo_may_differ(how: str) -> None:
    assert not all(crop_agrees(how, seed, 8) for seed in range(200))


@pytest.mark.parametrize("axis", [0, 1])
def test_a_change_stays_within_the_halo(axis: int) -> None:
    shape = (60, 300) if axis else (300, 60)
    for seed in range(20):
        inside, valid, grey = random_case(seed, shape)
        far = np.s_[:, 150 + REFINE_HALO :] if axis else np.s_[150 + REFINE_HALO :]
        near = np.s_[:, :150] if axis else np.s_[:150]
        first = refine("scan", inside, valid, grey)[near]
        grey[far], inside[far] = 65535 - grey[far], 1 - inside[far]
        inside &= valid
        assert np.array_equal(refine("scan", inside, valid, grey)[near], first)


@settings(max_examples=30)
@given(seeds)
def test_regions_that_are_in_range_already_do_not_change(seed: int) -> None:
    _, valid, grey = random_case(seed, (50, 60))
    in_range = in_range_of(grey, valid, MIDDLE)
    assert np.array_equal(refine_by_scans(in_range.copy(), valid, in_range), in_range)


@settings(max_examples=30)
@given(seeds)
def test_where_all_is_in_range_no_pixel_leaves_and_refining_again_only_grows(seed: int) -> None:
    inside, valid, _ = random_case(seed, (50, 60))
    refined = refine_by_scans(inside.copy(), valid, valid)
    assert (refined >= inside).all()
    assert (refine_by_scans(refined.copy(), valid, valid) >= refined).all()


@pytest.mark.parametrize("how", ["scan", "smooth"])
@settings(max_examples=30)
@given(seeds)
def test_invalid_pixels_are_never_inside(how: str, seed: int) -> None:
    inside, valid, grey = random_case(seed, (50, 60))
    assert not (refine(how, inside, valid, grey) & (1 - valid)).any()


@pytest.mark.parametrize("how", ["scan", "smooth"])
@pytest.mark.parametrize("fill", [0, 1])
def test_an_image_without_a_boundary_does_not_change(how: str, fill: int) -> None:
    _, valid, grey = random_case(5, (50, 60))
    inside = valid * np.uint8(fill)
    assert np.array_equal(refine(how, inside, valid, grey), inside)
