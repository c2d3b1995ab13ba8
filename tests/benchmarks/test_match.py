"""The scenes of the benchmark of `match` are what they say: grey tells nothing there, and texture does."""

import numpy as np
import pytest

from benchmarks.match import Score, by_best_range, by_match, overlap, table_of
from benchmarks.textures import DEVIATION, FAMILIES, MEAN, TEXTURES, scene, texture

SIDE = 256


@pytest.mark.parametrize("name", TEXTURES)
def test_every_texture_has_the_same_mean_and_deviation(name: str) -> None:
    made = texture(np.random.default_rng(1), name, SIDE)
    assert (made.mean(), made.std()) == pytest.approx((MEAN, DEVIATION))


@pytest.mark.parametrize("family", FAMILIES)
def test_a_scene_is_the_same_every_time_and_shows_what_it_asks_for(family: str) -> None:
    one, again = scene(family, 3, SIDE), scene(family, 3, SIDE)
    assert np.array_equal(one.image, again.image) and one.sample == again.sample
    assert not np.array_equal(one.image, scene(family, 4, SIDE).image)
    assert 0.35 < one.truth.mean() < 0.45
    rows, cols = np.mgrid[:SIDE, :SIDE] + 0.5
    for disc, wanted in ((one.sample, True), (one.other, False)):
        inside = (rows - disc[0]) ** 2 + (cols - disc[1]) ** 2 <= disc[2] ** 2
        assert (one.truth[inside] == wanted).all()


def test_texture_finds_what_grey_cannot() -> None:
    one = scene("rows in sand", 5)
    assert overlap(by_match()(one), one.truth) > 0.9 > 0.65 > overlap(by_best_range(one), one.truth)


def test_the_table_has_a_row_for_each_family_and_their_means() -> None:
    lines = table_of(
        [Score(who, family, overlap, 2.0) for who, family, overlap in
         [("us", "a", 0.5), ("them", "a", 0.25), ("us", "b", 1.0), ("them", "b", 0.75)]]
    ).splitlines()  # fmt: skip
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines if line.startswith("|")]
    assert rows[0] == ["", "us", "them"]
    assert rows[2:] == [
        ["a", "0.500", "0.250"],
        ["b", "1.000", "0.750"],
        ["mean", "0.750", "0.500"],
        ["seconds a scene", "2.000", "2.000"],
    ]
