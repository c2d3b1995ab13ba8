"""A whole map from samples of several classes: no pixel in two, and what is like none is left out."""

from pathlib import Path

import geopandas
import numpy as np
import pytest
import shapely
from click.testing import CliRunner
from numpy.typing import NDArray

import uavseg
from tests.jobs.test_match_by_color import KINDS, SHAPE, picture, truth, write
from uavseg.cli import main
from uavseg.errors import ParameterError, SampleError
from uavseg.execution.executors import threads
from uavseg.jobs.match.by_classes import (
    MatchClassesRequest,
    learn_classes,
    match_classes,
    outlines_by_classes,
)
from uavseg.jobs.match.ranges_of_sample import color_sources
from uavseg.jobs.result.result import Extraction
from uavseg.jobs.source.open_source import open_raster
from uavseg.jobs.source.work import SERIAL, Work
from uavseg.raster.grid.tiling import Window
from uavseg.regions.outline.rings import rasterise
from uavseg.regions.sample.place import class_masks
from uavseg.regions.sample.similarity import BlurredBands
from uavseg.segmentation.params.segment import SegmentParams
from uavseg.segmentation.source import with_statistics

NAMES = ("meadow", "roof", "water")
PLACES = {"meadow": [(1020, 960), (1030, 830)], "roof": [(1070, 940)], "water": [(1240, 900), (1230, 990)]}


@pytest.fixture
def tile(tmp_path: Path) -> Path:
    return write(tmp_path / "tile.tif", picture())


def samples(path: Path, *names: str, crs: str = "EPSG:32618", **more: object) -> Path:
    rows = [(name, shapely.Point(x, y).buffer(7)) for name in names for x, y in PLACES[name]]
    frame = geopandas.GeoDataFrame({"class": [name for name, _ in rows]}, geometry=[one for _, one in rows])
    frame.set_crs("EPSG:32618").to_crs(crs).to_file(path)
    return path


def painted(found: Extraction) -> NDArray[np.intp]:
    """The number of the class of each pixel, from 1; 0 for none."""
    labels = rasterise(found.rings, Window(0, 0, *SHAPE))
    classes = [NAMES.index(name) + 1 for name in found.regions.columns["class"]]
    return np.array([0, *classes])[labels]


def found(tile: Path, file: Path, refine: str = "pixel", work: Work = SERIAL) -> Extraction:
    return match_classes(open_raster(str(tile)), MatchClassesRequest(str(file), refine), work)


@pytest.mark.slow
@pytest.mark.parametrize("crs", ["EPSG:32618", pytest.param("EPSG:4326", marks=pytest.mark.slow)])
def test_every_pixel_gets_its_class(tile: Path, tmp_path: Path, crs: str) -> None:
    made = found(tile, samples(tmp_path / "s.gpkg", *NAMES, crs=crs))
    assert (painted(made) == truth() + 1).mean() > 0.98
    assert made.warnings == ()


@pytest.mark.slow
def test_what_is_like_no_sample_is_left_out(tile: Path, tmp_path: Path) -> None:
    made = painted(found(tile, samples(tmp_path / "s.gpkg", "roof", "water")))
    assert (made[truth() == 0] == 0).mean() > 0.95
    assert (made == np.where(truth() == 0, 0, truth() + 1)).mean() > 0.95


@pytest.mark.slow
def test_the_order_of_samples_changes_nothing_but_rounding(tile: Path, tmp_path: Path) -> None:
    one = painted(found(tile, samples(tmp_path / "a.gpkg", *NAMES)))
    other = painted(found(tile, samples(tmp_path / "b.gpkg", *NAMES[::-1])))
    assert (one == other).mean() > 0.999


@pytest.mark.slow
@pytest.mark.parametrize("refine", ["pixel", "none"])
def test_tiles_and_threads_change_nothing(tile: Path, tmp_path: Path, refine: str) -> None:
    file = samples(tmp_path / "s.gpkg", *NAMES)
    one, other = found(tile, file, refine), found(tile, file, refine, Work(64, threads(2)))
    assert (painted(one) == painted(other)).all()
    for name, column in one.regions.columns.items():
        assert repr(column.tolist()) == repr(other.regions.columns[name].tolist())


@pytest.mark.slow
def test_regions_do_not_overlap_and_share_borders(tile: Path, tmp_path: Path) -> None:
    regions = uavseg.match(tile, classes=samples(tmp_path / "s.gpkg", *NAMES))
    assert set(regions["class"]) == set(NAMES)
    assert regions.geometry.area.sum() == pytest.approx(shapely.union_all(regions.geometry).area)


@pytest.mark.slow
def test_the_command_says_how_many_regions_each_class_has(tile: Path, tmp_path: Path) -> None:
    file, target = samples(tmp_path / "s.gpkg", *NAMES), tmp_path / "out.gpkg"
    ran = CliRunner().invoke(main, ["match", str(tile), "--classes", str(file), "-o", str(target)])
    assert ran.exit_code == 0 and "meadow 1, roof 3, water 1" in ran.output
    assert set(geopandas.read_file(target)["class"]) == set(NAMES)


@pytest.mark.slow
def test_the_confidence_is_of_the_likeness_of_each_region_to_its_class(tile: Path, tmp_path: Path) -> None:
    """Sums over pixels, and over the edges of regions, beside those of a plain loop."""
    source = open_raster(str(tile))
    passes = SERIAL.begun().over(source).stages(3)
    grey = with_statistics(source.grey(passes[0]), passes[0])
    whole = grey.read(Window(0, 0, *SHAPE), 0).grey[: SHAPE[0], : SHAPE[1]].astype(int)
    bands = BlurredBands(color_sources(source, grey, (), passes[0].silent))
    places = class_masks(str(samples(tmp_path / "s.gpkg", *NAMES)), source.geobox)
    likenesses = learn_classes(bands, places, passes[0])
    outlined, classes = outlines_by_classes(grey, likenesses, SegmentParams(), passes[1:])
    labels = rasterise(outlined.rings, Window(0, 0, *SHAPE)).astype(int)
    alike = [similarity.read(Window(0, 0, *SHAPE), 0).grey.astype(int) for similarity in likenesses]
    for region, kind in enumerate(classes.at(outlined.sums.firsts) - 1, 1):
        own, here = alike[kind][: SHAPE[0], : SHAPE[1]], labels == region
        of_region = own[here]
        assert outlined.sums.similarity is not None and outlined.sums.steps is not None
        plain = [len(of_region), of_region.sum(), (of_region**2).sum()]
        down, right = here[1:] != here[:-1], here[:, 1:] != here[:, :-1]
        steps, of_grey = (
            np.concatenate([abs(np.diff(plane, axis=0))[down], abs(np.diff(plane, axis=1))[right]])
            for plane in (own, whole)
        )
        assert outlined.sums.similarity[region - 1].tolist() == [*plain, steps.sum(), len(steps)]
        large = np.count_nonzero(of_grey > grey.large_step)
        assert outlined.sums.steps[region - 1].tolist() == [of_grey.sum(), len(of_grey), large]


@pytest.mark.slow
def test_regions_of_a_class_are_sure_and_specks_are_not(tile: Path, tmp_path: Path) -> None:
    file = samples(tmp_path / "s.gpkg", *NAMES)
    regions = uavseg.match(tile, classes=file)
    big = regions["pixels"] > 500
    assert regions.loc[big, "confidence"].min() > 0.8
    kept = uavseg.match(tile, classes=file, min_confidence=0.8)
    assert kept["pixels"].tolist() == regions.loc[regions["confidence"] >= 0.8, "pixels"].tolist()
    with pytest.raises(ParameterError, match="block edges have no confidence"):
        uavseg.match(tile, classes=file, min_confidence=0.5, refine="none")


@pytest.mark.slow
def test_filled_holes_leave_the_confidence_known(tile: Path, tmp_path: Path) -> None:
    regions = uavseg.match(tile, classes=samples(tmp_path / "s.gpkg", *NAMES), fill_holes="40px")
    assert regions["confidence"].between(0, 1).all()


@pytest.mark.slow
def test_files_that_are_no_samples_of_classes_are_refused(tile: Path, tmp_path: Path) -> None:
    frame = geopandas.read_file(samples(tmp_path / "s.gpkg", *NAMES))
    frame.drop(columns="class").to_file(tmp_path / "none.gpkg")
    frame[:2].to_file(tmp_path / "one.gpkg")
    frame.assign(**{"class": ["a", None, "b", "c", "d"]}).to_file(tmp_path / "gap.gpkg")
    far = frame.assign(geometry=frame.geometry.translate(0, 9000))
    far.to_file(tmp_path / "far.gpkg")
    small = frame.assign(geometry=frame.geometry.centroid.buffer(1.5))
    small.to_file(tmp_path / "small.gpkg")
    twice = frame.assign(geometry=frame.geometry[0])
    twice.to_file(tmp_path / "twice.gpkg")
    for name, said in {
        "none": "has no column 'class'",
        "one": "samples of one class",
        "gap": "sample 2 of .* has no class",
        "far": "lies outside of the raster",
        "small": "the sample of .* has .* valid pixels",
        "twice": "pixels in common",
    }.items():
        with pytest.raises(SampleError, match=said):
            found(tile, tmp_path / f"{name}.gpkg")


@pytest.mark.slow
def test_classes_are_numbers_or_text(tile: Path, tmp_path: Path) -> None:
    frame = geopandas.read_file(samples(tmp_path / "s.gpkg", *NAMES))
    frame.assign(**{"class": [1, 1, 2, 3, 3]}).to_file(tmp_path / "numbers.gpkg")
    regions = uavseg.match(tile, classes=tmp_path / "numbers.gpkg")
    assert set(regions["class"]) == {"1", "2", "3"}


@pytest.mark.slow
def test_a_class_that_color_does_not_part_is_reported(tmp_path: Path) -> None:
    planes = np.rint(KINDS[0][:, None, None] + np.random.default_rng(0).normal(0, 12, (3, *SHAPE)))
    tile = write(tmp_path / "even.tif", planes.astype(np.uint8))
    made = found(tile, samples(tmp_path / "s.gpkg", *NAMES))
    assert any("hardly parts the samples of" in warning for warning in made.warnings)


@pytest.mark.parametrize(
    "words", [{"like": (1, 2, 3)}, {"unlike": [(1, 2, 3)]}, {"by": "color"}, {"window": 32}]
)
def test_it_stands_alone(tile: Path, words: dict[str, object]) -> None:
    with pytest.raises(ParameterError, match="leave out"):
        uavseg.match(tile, classes="s.gpkg", **words)


def test_the_command_line_asks_for_samples(tile: Path) -> None:
    for words in ([], ["--classes", "s.gpkg", "--like", "1,2,3"], ["--classes", "s.gpkg", "--by", "texture"]):
        assert CliRunner().invoke(main, ["match", str(tile), *words]).exit_code == 2
