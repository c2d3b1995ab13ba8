"""Likeness over many bands: what the order, the units and the number of bands do not change."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import geopandas
import numpy as np
import pytest
import rasterio
from affine import Affine
from click.testing import CliRunner
from numpy.typing import NDArray
from rasterio.enums import ColorInterp

import uavseg
from uavseg.cli import main
from uavseg.errors import ParameterError, SampleError, UnchosenBandsError
from uavseg.execution.executors import threads
from uavseg.jobs.match.match import Match, learn, match
from uavseg.jobs.match.ranges_of_sample import SuggestLikeRequest, color_sources, ranges_of_sample
from uavseg.jobs.match.request import MatchRequest
from uavseg.jobs.source.open_source import open_all_bands, raster_of
from uavseg.jobs.source.work import SERIAL, Work
from uavseg.options.reading import ReadOptions
from uavseg.raster.grid.tiling import Window
from uavseg.regions.outline.rings import rasterise
from uavseg.regions.sample.place import Disc, sample_mask

SHAPE = (192, 208)
PLACE = Affine(2, 0, 4e5, 0, -2, 5e6)
LIKE = Disc(4e5 + 2 * 50, 5e6 - 2 * 90, 20)
REQUEST = MatchRequest(LIKE)
Planes = NDArray[Any]


def kinds() -> NDArray[np.int64]:
    """The wanted kind, 0, beside three others."""
    row, col = np.indices(SHAPE)
    found = 1 + (row // 50 + col // 60) % 3
    found[(row - 90) ** 2 + (col - 50) ** 2 < 40**2] = 0
    found[(row > 30) & (row < 90) & (col > 140) & (col < 190)] = 0
    return found


def features(bands: int = 24, noise: float = 0.2) -> NDArray[np.float32]:
    """Embeddings from -1 to 1: means in five dimensions, noise in all."""
    rng = np.random.default_rng(0)
    means = rng.normal(size=(4, 5)) @ rng.normal(size=(5, bands)) / 5
    planes = np.moveaxis(means[kinds()], -1, 0) + rng.normal(0, noise, (bands, *SHAPE))
    return np.asarray(np.clip(planes, -1, 1).astype(np.float32))


def write(path: Path, planes: Planes, **how: Any) -> str:
    size = dict(zip(("count", "height", "width"), planes.shape, strict=True)) | {"dtype": planes.dtype.name}
    how = {"crs": "EPSG:32618", "transform": PLACE, "photometric": "MINISBLACK"} | how
    with rasterio.open(path, "w", "GTiff", **size, **how) as file:
        file.write(planes)
    return str(path)


def found(path: Any, request: MatchRequest = REQUEST, work: Work = SERIAL, **options: Any) -> Match:
    return match(open_all_bands(path, ReadOptions(**options)), request, work)


def painted(made: Match) -> NDArray[np.bool_]:
    return rasterise(made.found.rings, Window(0, 0, *SHAPE)) > 0


def agreement(one: NDArray[np.bool_], other: NDArray[np.bool_]) -> float:
    return float((one & other).sum() / (one | other).sum())


@pytest.fixture(scope="module")
def known(tmp_path_factory: pytest.TempPathFactory) -> NDArray[np.bool_]:
    return painted(found(write(tmp_path_factory.mktemp("known") / "a.tif", features())))


@pytest.mark.slow
def test_all_bands_are_compared_where_none_is_chosen(known: NDArray[np.bool_]) -> None:
    assert agreement(known, kinds() == 0) > 0.93


ORDER = np.random.default_rng(3).permutation(24)
SCALES = 10.0 ** np.random.default_rng(4).uniform(-3, 3, (24, 1, 1))
CONSTANT, NOISE = np.full((1, *SHAPE), 0.3), np.random.default_rng(5).normal(0, 0.3, (2, *SHAPE))
CHANGES: dict[str, Callable[[Planes], Planes]] = {
    "bands in another order": lambda planes: planes[ORDER],
    "bands of other units": lambda planes: planes * SCALES + 7 * SCALES[::-1],
    "a band twice": lambda planes: np.concatenate([planes, planes[:1]]),
    "a constant band": lambda planes: np.concatenate([planes[:9], CONSTANT, planes[9:]]),
    "bands of noise": lambda planes: np.concatenate([NOISE, planes]),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", CHANGES)
def test_what_bands_say_counts_and_not_how_they_are_stored(
    name: str, known: NDArray[np.bool_], tmp_path: Path
) -> None:
    path = write(tmp_path / "a.tif", CHANGES[name](features().astype(np.float64)).astype(np.float32))
    assert agreement(painted(found(path)), known) > 0.98


STORED: dict[str, Callable[[Planes], Planes]] = {
    "int8": lambda planes: np.rint(127 * planes).astype(np.int8),
    "uint8": lambda planes: np.rint(127 * planes + 128).astype(np.uint8),
    "int16": lambda planes: np.rint(30000 * planes).astype(np.int16),
    "uint16": lambda planes: np.rint(20000 * planes + 30000).astype(np.uint16),
    "float64": lambda planes: planes.astype(np.float64),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", STORED)
def test_numbers_of_other_types_give_nearly_the_same(
    name: str, known: NDArray[np.bool_], tmp_path: Path
) -> None:
    assert agreement(painted(found(write(tmp_path / "a.tif", STORED[name](features())))), known) > 0.97


def columns(made: Match) -> list[NDArray[Any]]:
    named = {name: values for name, values in made.found.regions.columns.items() if name != "source"}
    return [*named.values(), made.found.rings.vertices]


@pytest.mark.slow
@pytest.mark.parametrize(
    "how", [{"tiled": True, "blockxsize": 64, "blockysize": 64}, pytest.param({}, marks=pytest.mark.thorough)]
)
def test_interleaving_tiles_and_threads_change_nothing(how: dict[str, Any], tmp_path: Path) -> None:
    planes = features(40)
    planes[3, 60:80, 40:60] = np.nan
    first = columns(found(write(tmp_path / "a.tif", planes, interleave="band", **how)))
    other = write(tmp_path / "b.tif", planes, interleave="pixel", **how)
    for work in (SERIAL, Work(64, threads(2)), Work(128)):
        for one, two in zip(first, columns(found(other, work=work)), strict=True):
            assert np.array_equal(one, two, equal_nan=one.dtype.kind == "f")


@pytest.mark.slow
def test_a_pixel_is_valid_where_all_bands_are(tmp_path: Path) -> None:
    planes = features()
    planes[2, 40:60, 150:180], planes[20, 65:85, 150:180] = np.nan, np.inf
    result = painted(found(write(tmp_path / "a.tif", planes)))
    assert not result[40:60, 150:180].any() and not result[65:85, 150:180].any()
    assert result[61:64, 155:175].all() and agreement(result, kinds() == 0) > 0.75
    for nodata in ({"nodata": -9}, {}):
        filled = np.where(np.isfinite(planes), np.rint(100 * np.nan_to_num(planes, posinf=0)), -9).astype(
            np.int8
        )
        path = write(tmp_path / f"{len(nodata)}.tif", filled, **nodata)
        counted = painted(found(path, nodata=None if nodata else -9))
        assert not counted[40:60, 150:180].any() and not counted[65:85, 150:180].any()


@pytest.mark.slow
def test_alpha_is_no_feature(known: NDArray[np.bool_], tmp_path: Path) -> None:
    alpha = np.full((1, *SHAPE), 255, np.uint8)
    alpha[0, 150:] = 0
    planes = np.concatenate([STORED["uint8"](features()), alpha])
    path = write(tmp_path / "a.tif", planes)
    with rasterio.open(path, "r+") as file:
        file.colorinterp = [*file.colorinterp[:-1], ColorInterp.alpha]
    result = painted(found(path))
    assert not result[151:].any() and agreement(result[:150], known[:150]) > 0.97


@pytest.mark.slow
def test_bands_are_chosen_by_number_or_name(tmp_path: Path) -> None:
    path = write(tmp_path / "a.tif", features())
    with rasterio.open(path, "r+") as file:
        file.descriptions = [f"A{k:02d}" for k in range(24)]
    numbers, names = tuple(range(1, 24, 3)), tuple(f"a{k:02d}" for k in range(0, 24, 3))
    one, two = (found(path, MatchRequest(LIKE, bands=bands)) for bands in (numbers, names))
    assert np.array_equal(one.found.rings.vertices, two.found.rings.vertices)
    assert agreement(painted(one), kinds() == 0) > 0.9
    assert one.found.regions.metadata["bands"] == list(numbers)


@pytest.mark.slow
def test_files_side_by_side_are_one_raster(known: NDArray[np.bool_], tmp_path: Path) -> None:
    planes = features()
    left = write(tmp_path / "left.tif", planes[:, :, :96])
    right = write(tmp_path / "right.tif", planes[:, :, 96:], transform=PLACE @ Affine.translation(96, 0))
    assert agreement(painted(found([left, right])), known) > 0.99


@pytest.mark.slow
def test_likeness_is_that_of_blurred_bands_in_double_precision(tmp_path: Path) -> None:
    """Each band is blurred and stretched by itself, then summed; the sums are looked up."""
    from scipy.ndimage import correlate1d

    planes = features(64)
    source = raster_of(open_all_bands(write(tmp_path / "a.tif", planes)))
    tiles = SERIAL.over(source)
    bands = color_sources(source, source.grey(tiles), (), tiles)
    similarity = learn(bands, [sample_mask(LIKE, source.geobox)], [], tiles)
    inner = np.s_[2:-2, 2:-2]
    tile = similarity.read(Window(0, 0, *SHAPE), 0).grey[: SHAPE[0], : SHAPE[1]][inner] / 65535
    axes, table = similarity.bands.axes, similarity.table
    assert axes is not None and len(bands) == 64
    total = axes.offsets[:, None, None] + np.zeros((3, *SHAPE))
    for weights, band, plane in zip(axes.weights.T, bands, planes.astype(float), strict=True):
        v = (plane - band.stretch.low) / (band.stretch.high - band.stretch.low)
        grey = 65535 * np.clip(v, 0, 1)
        for axis in (0, 1):
            grey = correlate1d(grey, np.array([1, 4, 6, 4, 1]) / 16, axis)
        total += weights[:, None, None] * grey
    places = np.clip((total - table.lows[:, None, None]) * table.scales[:, None, None], 0, 63).astype(int)
    expected = table.similarity.reshape(64, 64, 64)[tuple(places)][inner] / 65535
    assert np.abs(tile - expected).mean() < 0.002
    assert ((tile >= 0.5) == (expected >= 0.5)).mean() > 0.999


@pytest.mark.slow
@pytest.mark.parametrize("shape", [(13, 30), (65, 66), (70, 20)])
def test_small_rasters_are_sampled_within_their_ends(shape: tuple[int, int]) -> None:
    planes = np.random.default_rng(0).normal(size=(9, *shape)).astype(np.float32)
    planes[:, :, :15] += 3
    made = match(raster_of(open_all_bands(planes)), MatchRequest(Disc(6, 6, 5)))
    area = rasterise(made.found.rings, Window(0, 0, *shape)) > 0
    assert area[:, :13].mean() > 0.9 and area[:, 17:].mean() < 0.1


@pytest.mark.slow
def test_classes_are_told_apart_in_many_bands(tmp_path: Path) -> None:
    path, target = write(tmp_path / "a.tif", features()), tmp_path / "classes.gpkg"
    row, col = (np.array(places) for places in ([90, 22, 22, 22], [50, 30, 90, 150]))
    x, y = PLACE @ np.array([col, row])
    classes = [f"kind {kinds()[place]}" for place in zip(row, col, strict=True)]
    assert len(set(classes)) == 4
    shapes = geopandas.points_from_xy(x, y).buffer(20)
    geopandas.GeoDataFrame({"class": classes}, geometry=shapes, crs="EPSG:32618").to_file(target)
    frame = uavseg.match(path, classes=target)
    assert frame.attrs["uavseg"]["bands"] == "all"
    for name, part in frame.groupby("class"):
        expected = kinds() == int(name[-1])
        assert part.area.sum() == pytest.approx(4 * expected.sum(), rel=0.1)


@pytest.mark.slow
def test_texture_needs_a_chosen_band(tmp_path: Path) -> None:
    path = write(tmp_path / "a.tif", features(6))
    with pytest.raises(UnchosenBandsError, match="choose with --band"):
        found(path, MatchRequest(Disc(LIKE.x, LIKE.y, 60), by="texture"))
    made = found(path, MatchRequest(LIKE), band=2)
    assert made.color is not None and made.color.weights.shape == (1, 1)


@pytest.mark.slow
def test_what_cannot_be_compared_is_refused(tmp_path: Path) -> None:
    planes = features()
    planes[7] = np.nan
    with pytest.raises(SampleError, match="no valid pixel; it probably lies on nodata"):
        found(write(tmp_path / "a.tif", planes))
    with pytest.raises(ParameterError, match="there is no band 25"):
        found(write(tmp_path / "b.tif", features()), MatchRequest(LIKE, bands=(*range(1, 24), 25)))


@pytest.mark.slow
def test_the_command_and_the_function_find_the_same_in_64_bands(tmp_path: Path) -> None:
    path, target = write(tmp_path / "a.tif", features(64)), tmp_path / "found.geojson"
    place = f"{LIKE.x:.0f},{LIKE.y:.0f},20"
    result = CliRunner().invoke(
        main, ["match", path, "--like", place, "--min-area", "400", "-o", str(target)]
    )
    assert result.exit_code == 0, result.output
    frame = uavseg.match(path, like=(LIKE.x, LIKE.y, 20), min_area=400)
    assert len(frame) == 2 and target.read_text().count('"Polygon"') == 2
    assert frame.attrs["uavseg"]["bands"] == "all"
    assert frame.area.sum() == pytest.approx(4 * (kinds() == 0).sum(), rel=0.05)


@pytest.mark.slow
def test_a_sum_of_few_of_64_bands_is_proposed_which_extract_reads(tmp_path: Path) -> None:
    path = write(tmp_path / "a.tif", features(64, noise=0.1))
    ranges = ranges_of_sample(raster_of(open_all_bands(path)), SuggestLikeRequest((LIKE,))).ranges
    [total] = [one for one in ranges if " * " in one.words.get("expr", "")]
    assert 2 <= total.words["expr"].count(" * ") <= 8
    assert len(uavseg.extract(path, values=total.values, **total.words)) > 0
