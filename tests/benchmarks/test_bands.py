"""The scenes of many bands, and the classifiers that learn from the same discs."""

from pathlib import Path

import numpy as np
import pytest

from benchmarks.bands import FAMILIES, METHODS, scene
from benchmarks.match import disc_of, overlap
from benchmarks.samples import EACH

SIDE = 128


@pytest.mark.parametrize("family", FAMILIES)
def test_scenes_are_reproducible_and_discs_lie_where_they_should(family: str, tmp_path: Path) -> None:
    one, again, other = (scene(family, 16, seed, EACH, tmp_path, SIDE) for seed in (0, 0, 1))
    assert np.array_equal(one.image, again.image) and one.like == again.like and one.unlike == again.unlike
    assert one.image.shape == (16, SIDE, SIDE) and not np.array_equal(one.image, other.image)
    assert np.isfinite(one.image).all() and (one.image.std((1, 2)) > 0).all()
    for discs, mask in ((one.like, one.truth), (one.unlike, ~one.truth)):
        assert all(mask[disc_of(mask.shape, disc)].all() for disc in discs)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["match", "match --unlike*", "forest*"])
def test_methods_find_what_is_plain(name: str, tmp_path: Path) -> None:
    asked = scene("embedding, int8", 16, 0, EACH, tmp_path, SIDE)
    assert overlap(METHODS[name](asked), asked.truth) > 0.7
