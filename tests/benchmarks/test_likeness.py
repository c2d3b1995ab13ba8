"""The drawn scenes of color with texture, and samples for and against: what a benchmark asks is so."""

from pathlib import Path

import numpy as np
import pytest
import rasterio

from benchmarks import likeness, samples
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
    asked = list(samples.samples(tmp_path))
    assert len(asked) == len(samples.RADII) * samples.DRAWS
    for one in asked:
        assert all(one.truth[int(row), int(col)] for row, col, _ in one.like)
        assert not any(one.truth[int(row), int(col)] for row, col, _ in one.unlike)
    for find in samples.METHODS.values():
        assert overlap(find(asked[0]), asked[0].truth) > 0.9
