import numpy as np
import pytest
from affine import Affine
from hypothesis import given, settings, strategies as st
from rasterio.crs import CRS

from uavseg.errors import MosaicError
from uavseg.raster.grid.tiling import Window
from uavseg.raster.read.dataset import Dataset

SHAPE = (60, 80)
IMAGE = np.arange(60 * 80, dtype=np.uint16).reshape(SHAPE) + 1  # 0 is nodata
GRIDS = [
    Affine(0.1, 0, 300000.3, 0, -0.1, 4000000.7),
    Affine(1 / 3, 0, -179.9, 0, 1 / 3, -89.9),  # south-up
    Affine(0.3, 0.1, 17.0, 0.1, -0.3, 29.0),  # turned
]


def cut(write_raster, image, grid, window, **how):
    return write_raster(
        image[window.slices], transform=grid * Affine.translation(window.col, window.row), **how
    )


@st.composite
def pieces(draw):
    """Windows that together cover the image's corners, with gaps, overlaps and holes, in any order."""
    windows = [Window(0, 0, 25, 30), Window(35, 50, 25, 30)]
    for _ in range(draw(st.integers(0, 5))):
        numbers = (
            draw(st.integers(0, 50)),
            draw(st.integers(0, 70)),
            draw(st.integers(1, 40)),
            draw(st.integers(1, 50)),
        )
        windows.append(Window(*numbers).clipped(SHAPE))
    return draw(st.permutations(windows))


@pytest.mark.slow
@settings(max_examples=40)
@given(pieces(), st.sampled_from(GRIDS), st.randoms(use_true_random=False))
@pytest.mark.filterwarnings("ignore::PendingDeprecationWarning")
def test_parts_of_an_image_make_the_image(write_raster, windows, grid, random):
    covered = np.zeros(SHAPE, bool)
    files = []
    for window in windows:
        image = IMAGE.copy()
        holes = np.random.default_rng(random.randrange(2**32)).random(SHAPE) < 0.3
        image[holes] = 0
        covered[window.slices] |= ~holes[window.slices]
        files.append(cut(write_raster, image, grid, window, nodata=0))
    dataset = Dataset.open(files)
    assert dataset.geobox.shape == SHAPE
    assert np.allclose(tuple(dataset.geobox.transform), tuple(grid), rtol=1e-12)
    values, valid = dataset.read(Window(0, 0, *SHAPE))
    assert np.array_equal(valid, covered)
    assert np.array_equal(values[0][covered], IMAGE[covered])
    part = Window(20, 10, 30, 45)
    assert np.array_equal(dataset.read(part)[0], values[:, *part.slices])


def test_the_first_valid_pixel_wins(write_raster):
    first = write_raster(np.array([[1, 0, 1, 0]], np.uint8), nodata=0)
    second = write_raster(np.array([[2, 2, 0, 0]], np.uint8), nodata=0)
    for files, expected in (((first, second), [1, 2, 1]), ((second, first), [2, 2, 1])):
        values, valid = Dataset.open(files).read(Window(0, 0, 1, 4))
        assert valid.tolist() == [[True, True, True, False]]
        assert values[0, 0, :3].tolist() == expected


@pytest.mark.filterwarnings("ignore::PendingDeprecationWarning")
def test_the_order_of_files_does_not_move_the_grid(write_raster):
    grid = Affine(0.1, 0, 300000.3, 0, -0.1, 4000000.7)
    windows = [Window(0, 40, 60, 40), Window(30, 0, 30, 40), Window(7, 3, 5, 9)]
    files = [cut(write_raster, IMAGE, grid, window) for window in windows]
    boxes = {Dataset.open(order).geobox for order in (files, files[::-1], files[1:] + files[:1])}
    assert len(boxes) == 1


def test_each_file_has_its_own_nodata(write_raster):
    left = write_raster(np.array([[5, 6]], np.uint8), nodata=5)
    right = write_raster(
        np.array([[5, 6]], np.uint8), nodata=6, transform=Affine(0.5, 0, 300001, 0, -0.5, 4e6)
    )
    assert Dataset.open([left, right]).read(Window(0, 0, 1, 4))[1].tolist() == [[False, True, True, False]]


def test_a_mosaic_can_be_downsampled(write_raster):
    files = [
        cut_plain(write_raster, np.full((64, 64), 10 * row + col, np.uint8), row, col)
        for row in range(3)
        for col in range(4)
        if (row, col) != (1, 1)
    ]
    values, valid, box = Dataset.open(files).read_coarse(32)
    assert box.shape == (24, 32)
    middle = values[0, 4::8, 4::8]
    assert middle[valid[4::8, 4::8]].tolist() == [0, 1, 2, 3, 10, 12, 13, 20, 21, 22, 23]
    assert valid.sum() == 11 * 64


def cut_plain(write_raster, pixels, row, col):
    return write_raster(pixels, transform=Affine(1, 0, 64 * col, 0, -1, 9 - 64 * row))


@pytest.mark.parametrize(
    ("how", "words"),
    [
        ({"crs": "EPSG:32619"}, "CRS"),
        ({"transform": Affine(0.6, 0, 300000, 0, -0.5, 4000000)}, "pixels of 0.6 x 0.5"),
        ({"transform": Affine(0.5, 0, 300000.2, 0, -0.5, 4000000)}, "0.400 pixels off"),
        ({"transform": Affine(0.5, 0, 300000, 0, 0.5, 4000000)}, "pixels of"),
        ({"dtype": "uint16"}, "type of bands"),
        ({"bands": 2}, "number of bands"),
        ({"colors": "alpha"}, "colours of bands"),
        ({"nbits": 4}, "bits of bands"),
        ({"transform": None, "crs": None}, "CRS"),
    ],
)
def test_a_file_that_does_not_fit_is_named(write_raster, how, words):
    pixels = np.ones((how.pop("bands", 1), 8, 8), how.pop("dtype", "uint8"))
    good, bad = write_raster(np.ones((8, 8), np.uint8)), write_raster(pixels, **how)
    with pytest.raises(MosaicError, match=words) as caught:
        Dataset.open([good, good, bad])
    assert str(bad) in str(caught.value)


def test_rounded_coordinates_are_accepted(write_raster):
    left = write_raster(np.ones((8, 8), np.uint8))
    right = write_raster(np.ones((8, 8), np.uint8), transform=Affine(0.5, 0, 300004.0003, 0, -0.5, 4000000))
    assert Dataset.open([left, right]).geobox.shape == (8, 16)


def test_two_spellings_of_one_crs_are_equal(write_raster):
    spelled = CRS.from_wkt(CRS.from_epsg(32618).to_wkt().replace("WGS 84 / UTM zone 18N", "UTM 18 north"))
    files = [write_raster(np.ones((8, 8), np.uint8), crs=crs) for crs in (spelled, "EPSG:32618")]
    assert Dataset.open(files).geobox.shape == (8, 8)
