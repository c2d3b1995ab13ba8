"""Scenes of the texture benchmark: grey does not separate the classes, texture does."""

import numpy as np
import pytest

from benchmarks.match import Score, by_best_range, by_match, overlap, table_by_family
from benchmarks.textures import DEVIATION, FAMILIES, MEAN, TEXTURES, scene, texture

SIDE = 256


@pytest.mark.parametrize("name", TEXTURES)
def test_every_texture_has_the_same_mean_and_standard_deviation(name: str) -> None:
    made = texture(np.random.default_rng(1), name, SIDE)
    assert (made.mean(), made.std()) == pytest.approx((MEAN, DEVIATION))


@pytest.mark.parametrize("family", FAMILIES)
def test_scenes_are_reproducible_and_samples_lie_in_their_class(family: str) -> None:
    one, again = scene(family, 3, SIDE), scene(family, 3, SIDE)
    assert np.array_equal(one.image, again.image) and one.sample == again.sample
    assert not np.array_equal(one.image, scene(family, 4, SIDE).image)
    assert 0.35 < one.truth.mean() < 0.45
    rows, cols = np.mgrid[:SIDE, :SIDE] + 0.5
    for disc, wanted in ((one.sample, True), (one.other, False)):
        inside = (rows - disc[0]) ** 2 + (cols - disc[1]) ** 2 <= disc[2] ** 2
        assert (one.truth[inside] == wanted).all()


@pytest.mark.slow
def test_texture_separates_what_grey_cannot() -> None:
    one = scene("rows in sand", 5)
    assert overlap(by_match()(one), one.truth) > 0.9 > 0.65 > overlap(by_best_range(one), one.truth)


def test_the_table_has_a_row_for_each_family_and_for_the_means() -> None:
    lines = table_by_family(
        [Score(who, family, overlap, 2.0) for who, family, overlap in
         [("a method", "a", 0.5), ("a peer", "a", 0.25), ("a method", "b", 1.0), ("a peer", "b", 0.75)]]
    ).splitlines()  # fmt: skip
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines if line.startswith("|")]
    assert rows[0] == ["", "a method", "a peer"]
    assert rows[2:] == [
        ["a", "0.500", "0.250"],
        ["b", "1.000", "0.750"],
        ["mean", "0.750", "0.500"],
        ["seconds per scene", "2.000", "2.000"],
    ]
