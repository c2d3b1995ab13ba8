import numpy as np
import pytest
from affine import Affine

from uavseg.errors import MosaicError, RasterError
from uavseg.raster.grid.geobox import GeoBox
from uavseg.raster.grid.tiling import Window
from uavseg.raster.read.dataset import Dataset

xarray = pytest.importorskip("xarray", reason="xarray and rioxarray are optional")
pytest.importorskip("rioxarray", reason="xarray and rioxarray are optional")

RAMP = np.arange(40 * 50, dtype=np.uint16).reshape(40, 50)
GRID = Affine(0.5, 0, 300000, 0, -0.5, 4000000)


def data_array(pixels, crs="EPSG:32618", nodata=None):
    dims = ("y", "x") if pixels.ndim == 2 else ("band", "y", "x")
    array = xarray.DataArray(pixels, dims=dims, name="ortho").rio.write_transform(GRID)
    array = array.rio.write_crs(crs) if crs else array
    return array if nodata is None else array.rio.write_nodata(nodata)


def whole(dataset):
    return dataset.read(Window(0, 0, *dataset.geobox.shape))


def test_an_array_reads_like_its_file(write_raster):
    file = Dataset.open(write_raster(RAMP, nodata=7))
    array = Dataset.open(data_array(RAMP, nodata=7))
    assert array.geobox == file.geobox
    assert (array.dtype, array.bits, array.bands, array.source) == (np.uint16, 16, (1,), "ortho")
    part = Window(0, 3, 9, 11)
    for ours, theirs in zip(array.read(part), file.read(part), strict=True):
        assert np.array_equal(ours, theirs)


def test_a_raster_opened_by_rioxarray_is_the_same(write_raster):
    import rioxarray

    path = write_raster(RAMP.astype(np.float32), nodata=-1)
    opened = rioxarray.open_rasterio(path, masked=True)
    assert Dataset.open(opened).geobox == Dataset.open(path).geobox
    assert np.array_equal(whole(Dataset.open(opened))[0], whole(Dataset.open(path))[0])


def test_bands_come_first_and_make_luminance():
    colors = np.stack([RAMP, RAMP + 1, RAMP + 2, RAMP + 3])
    dataset = Dataset.open(data_array(colors))
    assert np.array_equal(whole(dataset)[0], colors[:3])
    assert np.array_equal(whole(Dataset.open(data_array(colors), band=4))[0], colors[3:])


def test_only_the_window_is_read_from_the_array():
    requested = []

    class Lazy:
        dims, name, ndim, shape, dtype = ("y", "x"), None, 2, (40, 50), np.dtype("float32")
        rio = data_array(RAMP).rio

        def __getitem__(self, place):
            requested.append(place)
            return data_array(RAMP[place].astype(np.float32))

    values, _ = Dataset.open(Lazy()).read(Window(5, 6, 7, 8))
    assert requested == [(slice(5, 12), slice(6, 14))]
    assert np.array_equal(values[0], RAMP[5:12, 6:14])


def test_masks_and_nan_are_invalid():
    bits = whole(Dataset.open(data_array(RAMP > 9)))[0]
    assert bits.dtype == np.uint8
    assert np.array_equal(bits[0], RAMP > 9)
    holes = np.where(RAMP % 3 == 0, np.nan, 1.0)
    assert np.array_equal(whole(Dataset.open(data_array(holes)))[1], RAMP % 3 != 0)


def test_an_array_without_crs_gives_a_warning():
    dataset = Dataset.open(data_array(RAMP, crs=None))
    assert dataset.geobox.crs is None
    assert "no coordinate reference system" in dataset.warnings[0]


def test_an_array_is_downsampled_by_nearest_neighbour():
    values, _, box = Dataset.open(data_array(RAMP)).read_coarse(10)
    assert box.shape == (8, 10)
    assert np.array_equal(values[0], RAMP[2::5, 2::5])


def test_arrays_make_a_mosaic_with_files(write_raster):
    right = write_raster(RAMP, transform=Affine(0.5, 0, 300025, 0, -0.5, 4000000))
    dataset = Dataset.open([data_array(RAMP), right])
    assert np.array_equal(whole(dataset)[0][0], np.hstack([RAMP, RAMP]))
    with pytest.raises(MosaicError, match="ortho"):
        Dataset.open([right, data_array(RAMP.astype(np.uint8))])


@pytest.mark.parametrize("shape", [(4,), (2, 2, 3, 4), (0, 5)])
def test_other_shapes_are_refused(shape):
    class Odd:
        dims, rio, ndim, dtype = tuple("tbyx"[-len(shape) :]), None, len(shape), np.dtype("uint8")

    Odd.shape = shape
    with pytest.raises(RasterError, match="must have dimensions"):
        Dataset.open(Odd())


def test_a_plain_array_is_read_coarsely_by_its_nearest_pixels() -> None:
    values = np.arange(60 * 90).reshape(60, 90)
    dataset = Dataset.of_values(values, GeoBox(values.shape, Affine.identity(), None), "a")
    coarse, _, geobox = dataset.read_coarse(30)
    assert coarse.shape == (1, *geobox.shape)
    assert np.isin(coarse, values).all() and len(np.unique(coarse)) == coarse.size
