"""Formulas: indices agree with their definition, limits hold, and invalid pixels stay invalid."""

import pickle
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from affine import Affine
from hypothesis import given, settings, strategies as st
from hypothesis.extra.numpy import arrays

from uavseg.errors import BandError, MosaicError, ParameterError, RasterError, UnchosenBandsError
from uavseg.execution.checkpoint import fingerprint
from uavseg.raster.grid.tiling import TilePass, Window, tiles
from uavseg.raster.intensity.stretch import fit_stretch
from uavseg.raster.read.dataset import Dataset
from uavseg.raster.spectral.bands import BandLayout
from uavseg.raster.spectral.formula import INDICES, BandWords, bind_formula, find_index

NAMES = ("blue", "green", "red", "rededge", "nir", "swir1", "swir2")
LAYOUT = BandLayout(("float64",) * 7, ("undefined",) * 7, (64,) * 7, NAMES)
NDVI = BandWords(index="ndvi", names="red,green,blue,nir")
DICE = np.random.default_rng(11)
FOUR = DICE.integers(1, 256, (4, 150, 170)).astype(np.uint8)


def read(dataset: Dataset, window: Window | None = None) -> tuple[np.ndarray, np.ndarray]:
    values, valid = dataset.read(window or Window(0, 0, *dataset.geobox.shape))
    return values[0], np.ones(values.shape[1:], bool) if valid is None else valid


def ndvi(planes: np.ndarray) -> np.ndarray:
    red, nir = planes[0].astype(float), planes[3].astype(float)
    with np.errstate(all="ignore"):
        return ((nir - red) / (nir + red)).astype(np.float32)


@pytest.mark.slow
@settings(max_examples=30)
@given(arrays(np.float64, (7, 1, 20), elements=st.integers(0, 10_000).map(float)))
def test_an_index_with_limits_never_leaves_them(planes: np.ndarray) -> None:
    for name, index in INDICES.items():
        if index.limits is None:
            continue
        formula = bind_formula(BandWords(index=name), LAYOUT)
        assert formula is not None
        values, valid = formula.apply(planes[[band - 1 for band in formula.expression.bands]], None)
        kept = values[0] if valid is None else values[0][valid]
        assert (kept >= index.limits[0]).all() and (kept <= index.limits[1]).all(), name


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("ndvi", (0.4 - 0.1) / (0.4 + 0.1)),
        ("NDWI", (0.2 - 0.4) / (0.2 + 0.4)),
        ("ndbi", (0.5 - 0.4) / (0.5 + 0.4)),
        ("ndre", (0.4 - 0.3) / (0.4 + 0.3)),
        ("nbr", (0.4 - 0.6) / (0.4 + 0.6)),
        ("ExG", 2 * 0.2 - 0.1 - 0.05),
        ("vari", (0.2 - 0.1) / (0.2 + 0.1 - 0.05)),
        ("evi", 2.5 * (0.4 - 0.1) / (0.4 + 6 * 0.1 - 7.5 * 0.05 + 1)),
        ("savi", 1.5 * (0.4 - 0.1) / (0.4 + 0.1 + 0.5)),
        ("msavi", (2 * 0.4 + 1 - ((2 * 0.4 + 1) ** 2 - 8 * (0.4 - 0.1)) ** 0.5) / 2),
        ("tgi", -0.5 * (190 * (0.1 - 0.2) - 120 * (0.1 - 0.05))),
    ],
)
def test_an_index_has_the_value_of_its_definition(name: str, expected: float) -> None:
    reflectance = np.array([0.05, 0.2, 0.1, 0.3, 0.4, 0.5, 0.6])[:, None, None]
    formula = bind_formula(BandWords(index=name), LAYOUT)
    assert formula is not None
    values, _ = formula.apply(reflectance[[band - 1 for band in formula.expression.bands]], None)
    assert values[0, 0, 0] == pytest.approx(expected, rel=1e-6)


def test_every_index_can_be_bound_and_says_where_it_is_from() -> None:
    for name, index in INDICES.items():
        assert bind_formula(BandWords(index=name), LAYOUT) is not None
        assert find_index(name.upper()) == (name, index) and index.reference.startswith("http")


def test_a_raster_gives_the_index_of_its_pixels_in_any_window(write_raster: Callable[..., Path]) -> None:
    dataset = Dataset.open(write_raster(FOUR), words=NDVI)
    whole, valid = read(dataset)
    assert valid.all() and whole.dtype == dataset.dtype == np.float32
    assert np.array_equal(whole, ndvi(FOUR))
    for window in tiles(dataset.geobox.shape, 64):
        assert read(dataset, window)[0].tobytes() == whole[window.slices].tobytes()
    copy = pickle.loads(pickle.dumps(dataset))
    assert read(copy)[0].tobytes() == whole.tobytes()


def test_nodata_in_any_band_that_is_used_and_results_that_are_not_finite_are_invalid(
    write_raster: Callable[..., Path],
) -> None:
    planes = FOUR[:, :4, :4].copy()
    planes[0, 0, 0] = planes[3, 1, 1] = planes[1, 2, 2] = 7  # nodata in red, in nir, and in green
    expected = np.ones((4, 4), bool)
    expected[0, 0] = expected[1, 1] = False
    others = np.where((planes == 7) & (FOUR[:, :4, :4] != 7), 7, np.where(FOUR[:, :4, :4] == 7, 8, planes))
    dataset = Dataset.open(write_raster(others.astype(np.uint8), nodata=7), words=NDVI)
    assert np.array_equal(read(dataset)[1], expected)
    dark = FOUR[:, :4, :4].copy()
    dark[:, 3, 3] = 0  # 0 / 0
    dataset = Dataset.open(write_raster(dark), words=NDVI)
    assert np.array_equal(read(dataset)[1], dark[0] > 0)


def test_alpha_and_masks_stay_invalid(write_raster: Callable[..., Path]) -> None:
    mask = FOUR[0] > 50
    how = {"photometric": "RGB", "alpha": "yes"}
    planes = np.concatenate([FOUR[:3], np.where(mask, 255, 0).astype(np.uint8)[None]])
    words = BandWords(index="ngrdi")
    assert np.array_equal(read(Dataset.open(write_raster(planes, **how), words=words))[1], mask)
    by_mask = Dataset.open(write_raster(FOUR[:3], mask=mask, photometric="RGB"), words=words)
    assert np.array_equal(read(by_mask)[1], mask)


def test_a_mosaic_takes_the_next_file_where_a_result_is_not_finite(write_raster: Callable[..., Path]) -> None:
    dark = FOUR.copy()
    dark[:, 20:40, 30:60] = 0
    dataset = Dataset.open([str(write_raster(dark)), str(write_raster(FOUR))], words=NDVI)
    values, valid = read(dataset)
    assert valid.all() and np.array_equal(values, ndvi(FOUR))


def test_scales_and_offsets_of_each_file_are_used(write_raster: Callable[..., Path]) -> None:
    import rasterio

    path = write_raster(FOUR)
    with rasterio.open(path, "r+") as file:
        file.scales, file.offsets = (0.01,) * 4, (-0.2,) * 4
    values, _ = read(Dataset.open(path, words=NDVI))
    assert np.allclose(values, ndvi(FOUR * 0.01 - 0.2), rtol=1e-4, atol=1e-5)
    assert not np.allclose(values, ndvi(FOUR), atol=0.01)


def test_the_stretch_of_an_index_is_its_limits_and_of_an_expression_by_rank(
    write_raster: Callable[..., Path],
) -> None:
    path = write_raster(FOUR)
    dataset = Dataset.open(path, words=NDVI)
    tile_pass = TilePass(tiles(dataset.geobox.shape, 64))
    stretch = fit_stretch(dataset, "auto", tile_pass)
    assert (stretch.low, stretch.high) == (-1, 1)
    assert fit_stretch(dataset, "percentile:2,98", tile_pass).high < 1
    free = Dataset.open(path, words=BandWords(expr="(b4 - b1) / (b4 + b1)"))
    assert fit_stretch(free, "auto", tile_pass) == fit_stretch(dataset, "percentile:2,98", tile_pass)


def test_words_change_the_fingerprint(write_raster: Callable[..., Path]) -> None:
    path = write_raster(FOUR)
    words = [
        BandWords(),
        NDVI,
        BandWords(expr="b4 - b1"),
        BandWords(expr="b4 - b2"),
        BandWords(names=",,,alpha"),
    ]
    prints = {fingerprint(Dataset.open(path, words=one).fingerprint()) for one in words}
    assert len(prints) == len(words)


def test_a_raster_of_many_bands_needs_a_choice(write_raster: Callable[..., Path]) -> None:
    five = write_raster(np.concatenate([FOUR, FOUR[:1]]))
    with pytest.raises(UnchosenBandsError, match="5 bands; choose with --band"):
        Dataset.open(five)
    assert Dataset.open(five, band=5).bands == (5,)
    assert Dataset.open(five, rgb=(5, 4, 3)).bands == (5, 4, 3)
    assert Dataset.open(write_raster(FOUR)).bands == (1, 2, 3)
    how = {"colors": "red green blue nir alpha"}
    assert Dataset.open(write_raster(np.concatenate([FOUR, FOUR[:1]]), **how)).bands == (1, 2, 3)


@pytest.mark.parametrize(
    ("how", "kind", "words"),
    [
        ({"words": BandWords(index="ndvi")}, ParameterError, r"ndvi = .*no band is named 'nir'"),
        ({"words": BandWords(index="nvdi")}, ParameterError, "known are ndvi"),
        ({"words": BandWords(expr="b5")}, BandError, "column 1"),
        ({"words": NDVI, "band": 1}, ParameterError, "one of them"),
        ({"words": NDVI, "rgb": (1, 2, 3)}, ParameterError, "one of them"),
        ({"words": BandWords(index="savi", names="red,green,blue,nir")}, ParameterError, "reflectance"),
        ({"band": "nir"}, BandError, "no band is named 'nir'"),
        ({"band": "9"}, ParameterError, "no band 9"),
        ({"rgb": ("red", "green", "nir")}, BandError, "no band is named"),
    ],
)
def test_what_does_not_fit_the_bands_is_refused(
    write_raster: Callable[..., Path], how: dict[str, object], kind: type[Exception], words: str
) -> None:
    with pytest.raises(kind, match=words):
        Dataset.open(write_raster(FOUR), **how)  # type: ignore[arg-type]


def test_an_index_and_an_expression_together_are_refused() -> None:
    with pytest.raises(ParameterError, match="not both"):
        BandWords(index="ndvi", expr="b1")


def test_a_number_that_is_the_name_of_another_band_is_refused() -> None:
    layout = BandLayout(("uint8",) * 4, ("undefined",) * 4, (8,) * 4, ("B2", "B3", "B4", "B8"))
    with pytest.raises(BandError, match="band 2 by its number and band 1 by its name"):
        bind_formula(BandWords(expr="b2 + b8"), layout)
    formula = bind_formula(BandWords(expr="b8 / b1"), layout)
    assert formula is not None and formula.expression.bands == (4, 1)


def test_files_of_a_mosaic_name_the_bands_alike(write_raster: Callable[..., Path]) -> None:
    import rasterio

    paths = [str(write_raster(FOUR)) for _ in range(3)]
    for path, names in zip(paths, (["B2", "B3", "B4", "B8"], ["B8", "B4", "B3", "B2"]), strict=False):
        with rasterio.open(path, "r+") as file:
            file.descriptions = tuple(names)
    with pytest.raises(MosaicError, match="another name of bands"):
        Dataset.open(paths[:2], band="B8")
    assert Dataset.open([paths[0], paths[2]], band="B8").bands == (4,)  # one without names


def test_bands_of_different_types_are_refused() -> None:
    layout = BandLayout(("uint8", "uint16"), ("undefined",) * 2, (8, 16))
    from uavseg.raster.read.raster_file import choose

    with pytest.raises(RasterError, match="different types"):
        choose(layout, None, None, BandWords(expr="b1 + b2"))


def test_an_array_names_its_bands(write_raster: Callable[..., Path]) -> None:
    xarray = pytest.importorskip("xarray")
    pytest.importorskip("rioxarray")
    array = xarray.DataArray(
        FOUR, dims=("band", "y", "x"), attrs={"long_name": ("red", "green", "blue", "nir")}
    )
    array = array.rio.write_transform(Affine(1, 0, 0, 0, -1, 0)).rio.write_crs("EPSG:32618")
    values, _ = read(Dataset.open(array, words=BandWords(index="ndvi")))
    assert np.array_equal(values, ndvi(FOUR))
    other = array.assign_coords(band=["red", "green", "blue", "nir"]).drop_attrs()
    other = other.rio.write_transform(Affine(1, 0, 0, 0, -1, 0)).rio.write_crs("EPSG:32618")
    assert Dataset.open(other, band="nir").bands == (4,)
