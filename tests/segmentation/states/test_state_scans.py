"""Scans of states agree with the reference, and strips change nothing."""

from itertools import pairwise
from types import ModuleType

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from numpy.typing import NDArray

from tests.segmentation.states.whole_states import refine_states
from uavseg.segmentation.states.state_scans import (
    LOOKAHEAD,
    compact_columns,
    compact_rows,
    count_codes,
    decode_states,
    encode_states,
    resolve_columns,
    resolve_rows,
)

GREYS = np.array([0, 1000, 32768, 60000], np.uint16)  # of an own state
Bytes = NDArray[np.uint8]


def picture(text: str) -> Bytes:
    """f free, u unknown, o occupied, - invalid; rows between blanks."""
    return np.array([["-fuo".index(letter) for letter in row] for row in text.split()], np.uint8)


def text_of(states: Bytes) -> str:
    return " ".join("".join("-fuo"[state] for state in row) for row in states)


def refined(states: str, own: str) -> str:
    return text_of(refine_states(encode_states(picture(states), picture(own))))


def random_states(seed: int) -> tuple[Bytes, Bytes]:
    """Patches or single pixels of states, and the own states of the pixels, often half."""
    rng = np.random.default_rng(seed)
    shape = tuple(rng.integers(1, 40, 2))
    grain = int(rng.choice([1, 3, 8]))
    coarse = rng.choice(4, size=(shape[0] // grain + 1, shape[1] // grain + 1), p=[0.05, 0.4, 0.15, 0.4])
    states = coarse.repeat(grain, 0).repeat(grain, 1)[: shape[0], : shape[1]]
    half = rng.choice([0.2, 0.5, 0.8])
    own = rng.choice([1, 2, 3], size=shape, p=[(1 - half) / 2, half, (1 - half) / 2])
    return states.astype(np.uint8), own.astype(np.uint8)


@pytest.mark.parametrize("first", range(0, 400, 100))
def test_states_are_those_of_the_reference(reference: ModuleType, first: int) -> None:
    different = []
    for seed in range(first, first + 100):
        states, own = random_states(seed)
        wanted = reference.refine_states(states.astype(np.int64), GREYS[own])
        if not np.array_equal(refine_states(encode_states(states, own)), wanted):
            different.append(seed)
    assert not different


def in_strips(codes: Bytes, splits: list[int]) -> Bytes:
    """The eight scans, strip by strip, each of which knows two rows more at most."""
    edges = [0, *sorted(splits), len(codes)]
    strips = [slice(a, b) for a, b in pairwise(edges) if b > a]
    codes, cols = codes.copy(), codes.shape[1]
    compact_rows(codes)
    for upwards in (True, False):
        before = np.zeros(cols, np.uint8)
        for strip in strips[::-1] if upwards else strips:
            compact_columns(codes[strip], before, upwards)
    resolve_rows(codes)
    for upwards in (True, False):
        before = np.zeros(cols, np.uint8)
        for strip in strips[::-1] if upwards else strips:
            around = np.zeros((strip.stop - strip.start + LOOKAHEAD, cols), np.uint8)
            rows = (
                range(strip.start - LOOKAHEAD, strip.stop)
                if upwards
                else range(strip.start, strip.stop + LOOKAHEAD)
            )
            for k, row in enumerate(rows):
                around[k] = codes[row] if 0 <= row < len(codes) else 0
            resolve_columns(around, before, upwards)
            codes[strip] = around[LOOKAHEAD:] if upwards else around[:-LOOKAHEAD]
    return decode_states(codes)


@settings(max_examples=60)
@given(st.integers(0, 10**6), st.data())
def test_strips_change_nothing(seed: int, data: st.DataObject) -> None:
    codes = encode_states(*random_states(seed))
    splits = data.draw(st.lists(st.integers(0, len(codes)), max_size=6))
    assert np.array_equal(in_strips(codes, splits), refine_states(codes))


def test_a_run_of_half_pixels_beside_an_unknown_one_becomes_unknown() -> None:
    assert refined("u" + 30 * "f", 30 * "u" + "f") == 30 * "u" + "f"
    assert refined("u" + 30 * "o", 31 * "u") == 31 * "u"


def test_a_pixel_that_is_not_half_stops_compaction() -> None:
    assert refined("ufff", "uufu") == "uuff"


def test_the_first_of_three_that_is_not_half_decides() -> None:
    assert refined("foooo", "ffooo") == "ffooo"  # its own v is that of a free one
    assert refined("foooo", "fufoo") == "fffoo"  # the second decides, and the first goes with it
    assert refined("foooo", "fuufo") == "ffffo"
    assert refined("fooooo", "fuuufo") == "fooooo"  # nobody looks at a fourth
    assert refined("foooo", "fuuoo") == "foooo"
    assert refined("fooff", "fuuff") == "fooff"  # a free one ends what is looked at


def test_rows_from_the_right_come_first() -> None:
    assert refined("ooof", "oouf") == "ooof"
    assert refined("oof", "ouf") == "oof"
    states, own = "fof", "fff"
    assert refined(states, own) == "fff"


def test_the_scans_have_an_order_so_turning_the_map_may_change_its_states() -> None:
    """A law that does not hold: rows are scanned before columns."""
    turned = 0
    for seed in range(60):
        states, own = random_states(seed)
        there = refine_states(encode_states(states.T.copy(), own.T.copy())).T
        turned += not np.array_equal(there, refine_states(encode_states(states, own)))
    assert turned > 0


@given(st.integers(0, 10**6))
@settings(max_examples=60)
def test_exactly_the_invalid_pixels_stay_invalid(seed: int) -> None:
    states, own = random_states(seed)
    found = refine_states(encode_states(states, own))
    assert np.array_equal(found == 0, states == 0)
    assert (found[states == 2] == 2).all()  # unknown stays unknown
    assert (own[(found == 2) & (states != 2)] == 2).all()  # and only half pixels become it


def test_a_state_that_every_pixel_votes_for_stays() -> None:
    for state in (1, 2, 3):
        states = np.full((9, 11), state, np.uint8)
        assert (refine_states(encode_states(states, states)) == state).all()


def test_codes_are_counted() -> None:
    codes = encode_states(*random_states(5))
    assert np.array_equal(count_codes(codes), np.bincount(codes.ravel(), minlength=16))
