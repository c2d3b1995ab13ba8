"""Several samples of what is wanted, and samples of what is not."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

import uavseg
from tests.jobs.test_match_by_color import SHAPE, overlap, painted, picture, truth, write
from uavseg.errors import ParameterError, SampleError
from uavseg.execution.executors import threads
from uavseg.jobs.match.match import Match, match
from uavseg.jobs.match.request import MatchRequest
from uavseg.jobs.source.open_source import open_raster
from uavseg.jobs.source.work import SERIAL, Work
from uavseg.regions.sample.place import Disc
from uavseg.segmentation.sample.mixture import SampleVote, fit_mixtures

ROOF, MEADOW, WATER = Disc(1070, 940, 8), Disc(1020, 960, 8), Disc(1240, 900, 8)


@pytest.fixture
def tile(tmp_path: Path) -> Path:
    return write(tmp_path / "tile.tif", picture())


def found(tile: Path, *like: Disc, unlike: tuple[Disc, ...] = (), work: Work = SERIAL) -> Match:
    return match(open_raster(str(tile)), MatchRequest(like, unlike=unlike), work)


@pytest.mark.slow
def test_samples_of_two_kinds_find_both(tile: Path) -> None:
    made = found(tile, ROOF, WATER)
    assert overlap(painted(made), truth() != 0) > 0.9 and made.compared == "color"


@pytest.mark.slow
def test_what_is_unlike_is_left_out(tile: Path) -> None:
    made = found(tile, ROOF, unlike=(MEADOW, WATER))
    assert overlap(painted(made), truth() == 1) > 0.95
    assert made.color is not None and made.color.other_mean is not None
    assert made.color.sample_mean > 0.8 > 0.2 > made.color.other_mean


@pytest.mark.slow
def test_like_and_unlike_part_the_raster(tile: Path) -> None:
    """What is like these and not those, and the reverse: together all, but for noise at borders."""
    one, other = found(tile, ROOF, unlike=(MEADOW, WATER)), found(tile, MEADOW, WATER, unlike=(ROOF,))
    assert (painted(one) ^ painted(other)).mean() > 0.98


@pytest.mark.slow
def test_kinds_that_differ_little_are_parted_by_a_sample_of_each(tmp_path: Path) -> None:
    """Two thirds of the raster are like the sample but for a shade; a sample of these tells them apart."""
    rng = np.random.default_rng(2)
    left = np.indices(SHAPE)[1] < 88
    planes = np.where(left, 100, 112) + rng.normal(0, 6, (3, *SHAPE))
    path = write(tmp_path / "shades.tif", np.rint(planes).astype(np.uint8))
    made = found(path, Disc(1044, 900, 10), unlike=(Disc(1180, 900, 10),))
    assert overlap(painted(made), left) > 0.9


@pytest.mark.slow
def test_the_order_of_samples_changes_nothing(tile: Path) -> None:
    one, other = found(tile, ROOF, WATER, unlike=(MEADOW,)), found(tile, WATER, ROOF, unlike=(MEADOW,))
    assert (painted(one) == painted(other)).mean() > 0.9999  # sums are rounded in another order


@pytest.mark.slow
def test_tiles_and_threads_change_nothing(tile: Path) -> None:
    one = found(tile, ROOF, WATER, unlike=(MEADOW,))
    other = found(tile, ROOF, WATER, unlike=(MEADOW,), work=Work(64, threads(2)))
    assert (painted(one) == painted(other)).all()
    for name, column in one.found.regions.columns.items():
        assert repr(column.tolist()) == repr(other.found.regions.columns[name].tolist())


@pytest.mark.slow
def test_samples_that_overlap_are_refused(tile: Path) -> None:
    with pytest.raises(SampleError, match="pixels in common; draw them apart"):
        found(tile, ROOF, unlike=(WATER, Disc(1072, 941, 5)))
    touching = Disc(1070 + 17, 940, 8)
    assert found(tile, ROOF, unlike=(touching,)) is not None


@pytest.mark.slow
def test_samples_of_one_kind_for_and_against_are_reported(tile: Path) -> None:
    made = found(tile, MEADOW, unlike=(Disc(1020, 880, 8),))
    assert any("hardly parts the samples" in warning for warning in made.warnings)


@pytest.mark.parametrize("words", [{"by": "texture"}, {"window": 16}, {"similarity": 0.5}])
def test_texture_is_compared_with_one_sample(tile: Path, words: dict[str, object]) -> None:
    with pytest.raises(ParameterError, match="texture is compared with one sample"):
        uavseg.match(tile, [(1070, 940, 8), (1240, 900, 8)], **words)
    with pytest.raises(ParameterError, match="texture is compared with one sample"):
        uavseg.match(tile, (1070, 940, 8), unlike=[(1240, 900, 8)], **words)


@pytest.mark.parametrize("wrong", [[], [()], [(1, 2)], [[1, 2, 3], "a", 7]])
def test_what_is_no_sample_is_refused(tile: Path, wrong: object) -> None:
    with pytest.raises(ParameterError):
        uavseg.match(tile, wrong)  # type: ignore[arg-type]


@pytest.mark.slow
def test_one_in_a_list_is_one(tile: Path) -> None:
    one, other = uavseg.match(tile, (1070, 940, 8)), uavseg.match(tile, [(1070, 940, 8)])
    assert one.equals(other)


@pytest.mark.slow
@given(st.integers(0, 2**32 - 1))
@settings(max_examples=20)
def test_no_point_is_like_two_kinds_and_what_neither_sample_has_is_like_none(seed: int) -> None:
    rng = np.random.default_rng(seed)
    classes = np.repeat([[-2.0, 0.0], [2.0, 0.0], [0.0, 2.5]], 100, 0)
    points = rng.normal(classes, 0.3)
    mixtures = fit_mixtures(points)
    one, other = points[:30], points[100:130]
    like, unlike = (
        SampleVote.of(mixtures, *pair).similarity(points) for pair in ((one, other), (other, one))
    )
    assert (like + unlike).max() < 1.01
    assert like[:100].mean() > 0.8 > 0.2 > max(like[100:200].mean(), like[200:].mean())
