"""Likeness by colour: the blur is a mean of what is valid, and the table is the vote of the mixtures."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from hypothesis.extra import numpy as hnp
from numpy.typing import NDArray

from uavseg.segmentation.sample.similarity_table import SimilarityTable, blurred

BINOMIAL = np.outer([1, 4, 6, 4, 1], [1, 4, 6, 4, 1])


@given(
    hnp.arrays(np.uint16, (9, 11), elements=st.integers(0, 65535)),
    st.one_of(st.just(np.ones((9, 11), np.uint8)), hnp.arrays(np.uint8, (9, 11), elements=st.integers(0, 1))),
)
@settings(max_examples=50)
def test_the_blur_is_the_weighted_mean_of_valid_pixels(
    grey: NDArray[np.uint16], valid: NDArray[np.uint8]
) -> None:
    found = blurred(grey, valid)
    for r, c in np.ndindex(5, 7):
        weights = BINOMIAL * valid[r : r + 5, c : c + 5]
        total = int((weights * grey[r : r + 5, c : c + 5].astype(np.int64)).sum())
        assert found[r, c] == (total // weights.sum() if weights.any() else 0)


def colors(seed: int, bands: int) -> tuple[NDArray[np.uint16], NDArray[np.uint16]]:
    """Three kinds of ground, and a sample of the second."""
    rng = np.random.default_rng(seed)
    centres = rng.permutation(np.linspace(10000, 55000, 3 * bands)).reshape(3, bands)
    classes = [rng.normal(centre, 1200, (500, bands)) for centre in centres]
    return tuple(  # type: ignore[return-value]
        np.clip(values, 0, 65535).astype(np.uint16) for values in (np.concatenate(classes), classes[1][:80])
    )


@pytest.mark.slow
@pytest.mark.parametrize("bands", [1, 2, 3, 5, 8])
def test_a_kind_of_three_is_likely_and_the_others_are_not(bands: int) -> None:
    raster, sample = colors(bands, bands)
    table = SimilarityTable.fit(raster, sample)
    found = table.apply([plane.reshape(3, -1) for plane in np.ascontiguousarray(raster.T)])
    assert (found[1] >= 32768).mean() > 0.98
    assert (found[[0, 2]] >= 32768).mean() < 0.02
    assert table.sample_mean > 0.8 and table.raster_mean == pytest.approx(found.mean() / 65535)


@pytest.mark.slow
@given(st.integers(0, 1000), st.sampled_from([1, 2, 3]))
@settings(max_examples=20)
def test_bands_are_looked_up_by_the_bin_that_each_lies_in(seed: int, bands: int) -> None:
    raster, sample = colors(seed, bands)
    table, bins = SimilarityTable.fit(raster, sample), {1: 4096, 2: 512, 3: 64}[bands]
    planes = np.random.default_rng(seed).integers(0, 65536, (bands, 3, 5)).astype(np.uint16)
    found = table.apply(list(planes))
    for r, c in np.ndindex(3, 5):
        places = (planes[:, r, c] - table.lows) * table.scales
        cube = table.similarity.reshape((bins,) * bands)
        assert found[r, c] == cube[tuple(np.clip(places, 0, bins - 1).astype(int))]


@pytest.mark.slow
def test_bands_that_are_scaled_or_moved_change_little() -> None:
    raster, sample = colors(3, 3)
    plain = SimilarityTable.fit(raster, sample).apply(list(np.ascontiguousarray(raster.T)[:, None]))
    half = SimilarityTable.fit(raster // 2, sample // 2).apply(
        list(np.ascontiguousarray(raster.T // 2)[:, None])
    )
    assert ((plain >= 32768) == (half >= 32768)).mean() > 0.99


def test_a_raster_of_one_value_is_fitted_too() -> None:
    table = SimilarityTable.fit(np.full((100, 1), 7, np.uint16), np.full((70, 1), 7, np.uint16))
    assert table.sample_mean - table.raster_mean == 0
