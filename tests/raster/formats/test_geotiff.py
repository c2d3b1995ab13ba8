import warnings

import numpy as np
import pytest
import rasterio
from affine import Affine
from hypothesis import given, settings, strategies as st
from rasterio.crs import CRS

from uavseg.errors import OutputError, OutputExistsError, RasterReadError
from uavseg.raster.formats.creation import CreationOptions
from uavseg.raster.formats.geotiff import read_geotiff, write_geotiff, write_label_geotiff
from uavseg.raster.grid.geobox import GeoBox
from uavseg.raster.grid.tiling import tiles

GRID = Affine(0.5, 0, 300000, 0, -0.5, 4000000)


def box(shape, transform=GRID, crs="EPSG:32618"):
    return GeoBox(shape, transform, CRS.from_string(crs) if crs else None)


def labels(shape, seed=0):
    coarse = np.random.default_rng(seed).integers(0, 1 << 20, [side // 9 + 1 for side in shape])
    return np.kron(coarse, np.ones((9, 9), int))[: shape[0], : shape[1]].astype(np.uint32)


def cut(image, side):
    return ((window, image[window.slices]) for window in tiles(image.shape, side))


@pytest.mark.slow
@settings(max_examples=25)
@given(
    st.tuples(st.integers(1, 700), st.integers(1, 400)),
    st.tuples(st.sampled_from([64, 128, 192, 320, 576]), st.sampled_from([64, 128, 448])),
    st.integers(1, 2),
)
def test_the_bytes_of_a_file_do_not_depend_on_tiles(tmp_path_factory, shape, side, threads):
    folder = tmp_path_factory.mktemp("labels")
    image = labels(shape)
    write_label_geotiff(folder / "a.tif", cut(image, 256), box(shape))
    how = CreationOptions(threads=threads)
    write_label_geotiff(folder / "b.tif", cut(image, side), box(shape), creation=how)
    assert (folder / "a.tif").read_bytes() == (folder / "b.tif").read_bytes()
    with rasterio.open(folder / "b.tif") as file:
        assert np.array_equal(file.read(1), image)
        assert (file.nodata, file.dtypes, file.crs.to_epsg()) == (0, ("uint32",), 32618)
        assert file.transform == GRID
        assert file.block_shapes == [(256, 256)]


def test_labels_can_carry_metadata(tmp_path):
    image = labels((10, 10))
    write_label_geotiff(tmp_path / "a.tif", cut(image, 64), box((10, 10)), tags={"range": "0.5,1"})
    with rasterio.open(tmp_path / "a.tif") as file:
        assert file.tags()["range"] == "0.5,1"


@pytest.mark.parametrize(
    "geobox",
    [
        box((30, 40)),
        box((30, 40), Affine(2, 0.5, 9, 0.5, -2, 9)),
        box((30, 40), Affine(2, 0, 9, 0, 2, 9)),
        box((30, 40), Affine.identity(), None),
        box((30, 40), GRID, None),
    ],
)
def test_reading_returns_what_was_written(tmp_path, geobox):
    bands = [np.random.default_rng(k).normal(size=(30, 40)).astype(np.float32) for k in range(3)]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        write_geotiff(tmp_path / "a.tif", bands, geobox, ["mean", "side", "r"], {"stretch": "dtype"})
        back, place, names, tags = read_geotiff(tmp_path / "a.tif")
    assert np.array_equal(back, bands)
    assert place == geobox
    assert names == ["mean", "side", "r"]
    assert tags["stretch"] == "dtype"


def test_an_existing_file_is_replaced_only_if_allowed(tmp_path):
    path = tmp_path / "a.tif"
    path.write_text("precious")
    with pytest.raises(OutputExistsError):
        write_label_geotiff(path, cut(labels((8, 8)), 64), box((8, 8)))
    assert path.read_text() == "precious"
    write_label_geotiff(path, cut(labels((8, 8)), 64), box((8, 8)), overwrite=True)
    assert np.array_equal(read_geotiff(path)[0][0], labels((8, 8)))


def test_an_unfinished_file_never_appears(tmp_path):
    def broken():
        yield next(cut(labels((100, 100)), 64))
        raise RuntimeError("power cut")

    with pytest.raises(RuntimeError):
        write_label_geotiff(tmp_path / "a.tif", broken(), box((100, 100)))
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("side", [30, 300])  # written when the file is closed, or before
def test_a_full_disk_is_an_error_and_leaves_nothing(tmp_path, side):
    resource = pytest.importorskip("resource", reason="only Unix limits the size of files")
    noise = np.random.default_rng(0).integers(0, 1 << 32, (side, side), dtype=np.uint32)
    usual = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (2000, usual[1]))
    try:
        with pytest.raises(OutputError, match=r"a\.tif cannot be written"):
            write_geotiff(tmp_path / "a.tif", [noise], box((side, side)))
        with pytest.raises(OutputError, match=r"b\.tif cannot be written"):
            write_label_geotiff(tmp_path / "b.tif", cut(noise, 64), box((side, side)))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, usual)
    assert list(tmp_path.iterdir()) == []


def test_a_file_that_is_not_a_raster_is_an_error(tmp_path):
    with pytest.raises(RasterReadError):
        read_geotiff(tmp_path / "gone.tif")
