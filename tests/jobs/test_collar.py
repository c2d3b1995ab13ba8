"""Jobs leave a collar out as they leave out nodata, and keep it where the user says so."""

import warnings
from pathlib import Path

import numpy as np
import pytest

import uavseg
from tests.raster.collar.draw_collar import texture, write
from uavseg.errors import ParameterError
from uavseg.jobs.divide import divide
from uavseg.jobs.extract import ExtractRequest, extract
from uavseg.jobs.flights.under_raster import valid_ground
from uavseg.jobs.info import info
from uavseg.jobs.match.match import match
from uavseg.jobs.match.request import MatchRequest
from uavseg.jobs.result.result import Extraction
from uavseg.jobs.segment_classes import LevelsRequest, levels
from uavseg.jobs.source.open_source import open_probability_map, open_source
from uavseg.jobs.source.work import Work
from uavseg.jobs.suggest import suggest
from uavseg.options.reading import ReadOptions
from uavseg.regions.sample.place import Disc
from uavseg.segmentation.blocks.block_file import write_block_map
from uavseg.segmentation.params.segment import IntensityRange, Levels, SegmentParams

SHAPE = (300, 340)
DARK = ExtractRequest(IntensityRange(0, 0.45))
KEEP = ReadOptions(collar="keep")
NOTE = "a black collar of "


def framed_image() -> np.ndarray:
    """A picture in a frame of zeros; the opening of the frame is the frame."""
    image = np.zeros(SHAPE, np.uint8)
    image[30:-50, 40:-20] = texture((SHAPE[0] - 80, SHAPE[1] - 60))
    return image


@pytest.fixture
def path(tmp_path: Path) -> str:
    return str(write(tmp_path / "a.tif", framed_image()))


@pytest.fixture
def tagged(tmp_path: Path) -> str:
    (tmp_path / "tagged").mkdir()
    return str(write(tmp_path / "tagged" / "a.tif", framed_image(), nodata=0))


def same(one: Extraction, other: Extraction) -> bool:
    return all(
        np.array_equal(one.regions.columns[name], other.regions.columns[name]) for name in one.regions.columns
    )


def test_a_collar_is_nodata(path: str, tagged: str) -> None:
    found, expected = extract(open_source(path), DARK), extract(open_source(tagged), DARK)
    assert same(found, expected) and len(found.regions)
    assert [NOTE in note for note in found.warnings] == [True]
    assert not expected.warnings


def test_a_collar_is_kept_if_the_user_says_so(path: str) -> None:
    found = extract(open_source(path, KEEP), DARK)
    assert found.regions.columns["pixels"][0] >= (framed_image() == 0).sum()
    assert not found.warnings


@pytest.mark.slow
def test_all_jobs_leave_it_out(path: str, tagged: str) -> None:
    def answers(source: str) -> list[tuple[object, tuple[str, ...]]]:
        opened = [open_source(source) for _ in range(5)]
        summary, ranges = info(opened[0]), suggest(opened[1])  # type: ignore[arg-type]
        segments = levels(opened[2], LevelsRequest(Levels(0.25)))
        blocks = divide(opened[3])
        like = match(opened[4], MatchRequest(Disc(4e5 + 350, 5e6 - 250, 80)))
        return [
            ((summary.valid, summary.histogram), summary.warnings),
            (ranges.ranges, ranges.warnings),
            (segments.regions.columns["pixels"].tolist(), segments.warnings),
            (blocks.saved.blocks.counts.tolist(), blocks.warnings),
            (like.found.regions.columns["pixels"].tolist(), like.warnings),
        ]

    for (found, notes), (expected, _) in zip(answers(path), answers(tagged), strict=True):
        assert found == expected
        assert any(NOTE in note for note in notes)


@pytest.mark.slow
@pytest.mark.parametrize("options", [ReadOptions(), KEEP])
def test_a_block_map_remembers_how_its_raster_was_read(
    path: str, tmp_path: Path, options: ReadOptions
) -> None:
    saved = divide(open_source(path, options)).saved
    write_block_map(tmp_path / "blocks.tif", saved, SegmentParams().division)
    of_map = extract(open_source(str(tmp_path / "blocks.tif")), DARK)
    assert same(of_map, extract(open_source(path, options), DARK))


@pytest.mark.slow
def test_a_checkpoint_of_the_other_word_is_not_taken(path: str, tmp_path: Path) -> None:
    kept = Work(checkpoint=tmp_path / "kept")
    for options in (ReadOptions(), KEEP, ReadOptions()):
        assert same(
            extract(open_source(path, options), DARK, kept), extract(open_source(path, options), DARK)
        )


@pytest.mark.parametrize("tile", [64, 128, 320])
def test_tiles_change_nothing(path: str, tile: int) -> None:
    assert same(extract(open_source(path), DARK, Work(tile)), extract(open_source(path), DARK))


def test_a_place_on_the_collar_is_no_ground(path: str) -> None:
    def is_ground(options: ReadOptions, row: int, col: int) -> bool:
        source = open_source(path, options)
        check = valid_ground(source)
        assert check is not None
        lon, lat = source.geobox.lonlat_from_xy(*source.geobox.xy_from_pixel(row, col))
        return check(float(lat), float(lon))

    assert is_ground(ReadOptions(), 150, 150) and not is_ground(ReadOptions(), 10, 10)
    assert is_ground(KEEP, 10, 10)


def test_a_map_of_probabilities_has_none(path: str) -> None:
    source = open_probability_map(path)
    assert levels(source, LevelsRequest(Levels(0.5))).regions.columns["pixels"].sum() == SHAPE[0] * SHAPE[1]


def test_an_array_has_none() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        regions = uavseg.extract(framed_image(), range=(0, 0.1))
    assert regions["pixels"].sum() >= (framed_image() == 0).sum()


def test_another_word_is_refused(path: str) -> None:
    with pytest.raises(ParameterError, match="a collar is treated as auto or keep, not 'drop'"):
        uavseg.extract(path, range=(0, 1), collar="drop")


def test_python_warns(path: str) -> None:
    with pytest.warns(UserWarning, match=NOTE):
        uavseg.extract(path, range=(0, 0.4))


def test_a_range_of_values_leaves_it_out_too(path: str, tagged: str) -> None:
    with pytest.warns(UserWarning, match=NOTE):
        found = uavseg.extract(path, values=(None, 110))
    expected = uavseg.extract(tagged, values=(None, 110))
    assert found.drop(columns="geometry").equals(expected.drop(columns="geometry"))
