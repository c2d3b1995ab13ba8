"""The families of scenes with one disc, and the methods that learn from it."""

from pathlib import Path

import numpy as np
import pytest

from benchmarks.discs import __main__ as discs, methods
from benchmarks.discs.scenes import FAMILIES, GROUND_DISCS, SEEDS, scene
from benchmarks.match import cooccurrence, disc_of, overlap
from benchmarks.samples import Samples

SIDE = 160


@pytest.mark.parametrize("family", FAMILIES)
def test_scenes_are_reproducible_and_discs_lie_where_they_should(family: str, tmp_path: Path) -> None:
    one, again, other = (scene(family, seed, tmp_path, SIDE) for seed in (3, 3, 4))
    assert np.array_equal(one.image, again.image) and one.like == again.like and one.unlike == again.unlike
    assert not np.array_equal(one.image, other.image)
    (disc,) = one.like
    assert one.truth[disc_of(one.truth.shape, disc)].all()
    assert len(one.unlike) == GROUND_DISCS
    for place in one.unlike:
        assert place[2] == disc[2] and not one.truth[disc_of(one.truth.shape, place)].any()


def test_shares_and_radii_are_those_of_the_names(tmp_path: Path) -> None:
    requested = [scene("rare, 1 to 3 %", seed, tmp_path, SIDE) for seed in (0, SEEDS - 1)]
    assert [round(one.truth.mean(), 3) for one in requested] == [0.01, 0.03]
    assert scene("frequent, half", 0, tmp_path, SIDE).truth.mean() == pytest.approx(0.5, abs=0.01)
    radii = [scene("small sample, radius 4 to 8", seed, tmp_path, SIDE).like[0][2] for seed in range(5)]
    assert radii == [4, 5, 6, 7, 8]


@pytest.fixture
def easy(tmp_path: Path) -> Samples:
    """The half of a picture that is dark, blue and smooth, beside one that is bright, yellow and rough."""
    from benchmarks.likeness import query

    rng = np.random.default_rng(0)
    truth = np.zeros((SIDE, SIDE), bool)
    truth[:, : SIDE // 2] = True
    colors = np.where(
        truth, np.array([0.2, 0.2, 0.4])[:, None, None], np.array([0.8, 0.8, 0.5])[:, None, None]
    )
    planes = colors + rng.normal(0, np.where(truth, 0.02, 0.08), (3, SIDE, SIDE))
    requested = query(tmp_path / "easy.tif", planes, truth, 12)
    against = [(40.5, 130.5, 12), (80.5, 120.5, 12), (120.5, 130.5, 12)]
    return Samples(requested.path, requested.image, truth, [requested.disc], against)


@pytest.mark.slow
@pytest.mark.parametrize("name", methods.METHODS)
def test_every_method_finds_what_is_plain(name: str, easy: Samples) -> None:
    if name in methods.skipped():
        pytest.skip(methods.skipped()[name])
    assert overlap(methods.METHODS[name](easy), easy.truth) > 0.8


@pytest.mark.slow
def test_a_disc_that_is_too_small_finds_nothing(easy: Samples) -> None:
    row, col, _ = easy.like[0]
    small = Samples(easy.path, easy.image, easy.truth, [(row, col, 4)], easy.unlike)
    for name in ("match", "match --unlike*"):
        assert not methods.METHODS[name](small).any()


def test_cooccurrence_features_are_the_same_within_a_step() -> None:
    image = np.random.default_rng(0).integers(0, 256, (24, 32)).astype(np.uint8)
    features = cooccurrence(image, 4)
    assert features.shape == (24, 32, 48)
    assert np.array_equal(features[::8, ::8].repeat(8, 0).repeat(8, 1), features)


def test_a_method_whose_library_is_absent_is_left_out_with_a_reason(monkeypatch: pytest.MonkeyPatch) -> None:
    find = methods.importlib.util.find_spec
    monkeypatch.setattr(
        methods.importlib.util, "find_spec", lambda name: None if name == "cv2" else find(name)
    )
    assert methods.skipped() == {"GrabCut": "Python has no cv2"}


@pytest.mark.slow
def test_the_table_has_rows_for_families_failures_and_time() -> None:
    lines = discs.report(1, SIDE, ["slow light"]).splitlines()
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines if line.startswith("|")]
    assert [row[0] for row in rows] == ["", rows[1][0], "slow light", "all", "below 0.5", "CPU s"]
    assert rows[0][1:] == ["scenes", *(name for name in methods.METHODS if name not in methods.skipped())]
    assert len({len(row) for row in rows}) == 1
