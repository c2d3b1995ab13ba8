"""The drawn scenes of color with texture, and samples for and against: what a benchmark asks is so."""

from pathlib import Path

import numpy as np
import pytest
import rasterio

from benchmarks import likeness, next_sample, samples
from benchmarks.match import overlap

pytestmark = pytest.mark.slow


def test_drawn_scenes_have_a_disc_within_and_the_default_finds_what_each_alone_does_not(
    tmp_path: Path,
) -> None:
    query = next(likeness.drawn(tmp_path))
    assert (query.truth & query.inside).sum() == query.inside.sum() > 0
    both, color = (overlap(find(query), query.truth) for find in list(likeness.METHODS.values())[:2])
    assert both > 0.9 > 0.7 > color


def test_discs_lie_for_and_against(tmp_path: Path) -> None:
    truth = np.zeros((90, 120), np.uint8)
    truth[:, :60] = 1
    image = np.where(truth, 60, 180).astype(np.uint8) + np.random.default_rng(0).integers(0, 9, truth.shape)
    for name, values in (("a.tif", image), ("a_truth.tif", truth)):
        size = {"driver": "GTiff", "count": 1, "height": 90, "width": 120, "dtype": "uint8"}
        place = {"crs": "EPSG:32633", "transform": rasterio.Affine(1, 0, 0, 0, -1, 90)}
        with rasterio.open(tmp_path / name, "w", **size, **place) as file:
            file.write(values.astype(np.uint8), 1)
    requested = list(samples.samples(tmp_path))
    assert len(requested) == len(samples.RADII) * samples.DRAWS
    for one in requested:
        assert all(one.truth[int(row), int(col)] for row, col, _ in one.like)
        assert not any(one.truth[int(row), int(col)] for row, col, _ in one.unlike)
    for find in samples.METHODS.values():
        assert overlap(find(requested[0]), requested[0].truth) > 0.9


def test_a_proposed_disc_is_compared_with_random_ones_of_its_size(tmp_path: Path) -> None:
    query = next(query for query in next_sample.drawn(tmp_path) if next_sample.matched(query, [])[1])
    assert (query.truth & query.inside).sum() == query.inside.sum() > 0
    for of_one_kind in (False, True):
        places = next_sample._random_places(query, np.random.default_rng(0), 8, of_one_kind)
        assert len(places) == next_sample.RANDOM
        for place in places:
            inside = next_sample._inside(query, place)
            assert not (inside & query.inside).any() and inside.sum() > 190
            assert not of_one_kind or query.truth[inside].mean() in (0, 1)
    values = next_sample.compared(query)
    assert values is not None and len(values) == 4 and all(0 <= value <= 1 for value in values)
