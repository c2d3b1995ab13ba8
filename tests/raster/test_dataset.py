import os
import pickle
import subprocess
import sys
import threading
import warnings
import zipfile
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
import rasterio
from affine import Affine
from hypothesis import given, settings, strategies as st

from uavseg.errors import ParameterError, RasterError, RasterReadError, UavsegError
from uavseg.raster.access.opening import MAX_OPEN, absolute_path
from uavseg.raster.formats.png import write_png
from uavseg.raster.grid.tiling import Window, tiles
from uavseg.raster.read.dataset import Dataset

RAMP = np.arange(150 * 170, dtype=np.uint16).reshape(150, 170)
COLORS = np.stack([RAMP % 251, RAMP % 127, RAMP % 63]).astype(np.uint8)


def whole(dataset: Dataset) -> Window:
    return Window(0, 0, *dataset.geobox.shape)


def windows():
    return st.tuples(st.integers(0, 140), st.integers(0, 160), st.integers(1, 150), st.integers(1, 170)).map(
        lambda numbers: Window(*numbers).clipped(RAMP.shape)
    )


@pytest.fixture(scope="module")
def holed(write_raster):
    """Three bands, alpha with holes, stored in small blocks."""
    alpha = np.where(RAMP % 7 == 0, 0, 255).astype(np.uint8)[None]
    planes = np.concatenate([COLORS, alpha])
    how = {"tiled": True, "blockxsize": 64, "blockysize": 64, "photometric": "RGB", "alpha": "yes"}
    return Dataset.open(write_raster(planes, **how))


@settings(max_examples=60)
@given(windows())
def test_a_window_is_a_part_of_the_whole(holed, window):
    all_values, all_valid = holed.read(whole(holed))
    values, valid = holed.read(window)
    assert np.array_equal(values, all_values[:, *window.slices])
    expected = all_valid[window.slices]
    assert valid is None if expected.all() else np.array_equal(valid, expected)


def test_values_are_those_written(holed):
    values, valid = holed.read(whole(holed))
    assert np.array_equal(values, COLORS)
    assert np.array_equal(valid, RAMP % 7 != 0)
    assert (holed.dtype, holed.bits, holed.bands) == (np.uint8, 8, (1, 2, 3))
    assert holed.file_block == (64, 64)
    assert holed.geobox.crs.to_epsg() == 32618
    assert holed.warnings == ()


def test_a_dataset_works_in_other_threads_and_processes(holed):
    copy = pickle.loads(pickle.dumps(holed))
    assert copy.geobox == holed.geobox
    pieces = tiles(RAMP.shape, 64)
    with ThreadPoolExecutor(3) as pool:
        for window, (values, _) in zip(pieces, pool.map(copy.read, pieces), strict=True):
            assert np.array_equal(values, COLORS[:, *window.slices])


def test_a_pickled_dataset_is_small(holed):
    assert len(pickle.dumps(holed)) < 4000


@pytest.mark.slow
def test_few_files_stay_open(write_raster):
    files = [
        write_raster(np.full((4, 4), k, np.uint8), transform=Affine(1, 0, 4 * k, 0, -1, 9)) for k in range(80)
    ]
    dataset = Dataset.open(files)
    values, _ = dataset.read(whole(dataset))
    assert values[0, 0, ::4].tolist() == list(range(80))
    assert len(dataset._handles._local.files) == MAX_OPEN


def test_sixteen_bit_alpha_of_small_value_is_opaque(write_raster):
    planes = np.stack([RAMP, RAMP, RAMP, RAMP % 3]).astype(np.uint16)
    dataset = Dataset.open(write_raster(planes, colors="red green blue alpha"))
    assert np.array_equal(dataset.read(whole(dataset))[1], RAMP % 3 != 0)


def test_mask_bands_are_used(write_raster):
    mask = np.where(RAMP % 5 == 0, 0, 255).astype(np.uint8)
    dataset = Dataset.open(write_raster(COLORS, mask=mask))
    assert np.array_equal(dataset.read(whole(dataset))[1], RAMP % 5 != 0)


def test_nan_is_invalid_whatever_nodata_is(write_raster):
    pixels = np.array([[1, np.nan], [np.inf, -3]], np.float32)
    for nodata in (None, float("nan"), 55.0):
        dataset = Dataset.open(write_raster(pixels), nodata=nodata)
        assert dataset.read(whole(dataset))[1].tolist() == [[True, False], [False, True]]


def test_a_palette_is_read_as_its_colours(write_raster, tmp_path):
    palette = {0: (0, 0, 0, 0), 1: (10, 20, 30, 255), 2: (200, 100, 50, 255)}
    pixels = np.array([[0, 1, 2]], np.uint8)
    path = write_raster(pixels, tmp_path / "palette.png", palette=palette, driver="PNG")
    dataset = Dataset.open(path)
    values, valid = dataset.read(whole(dataset))
    assert valid.tolist() == [[False, True, True]]
    assert values[:, 0, 1:].T.tolist() == [[10, 20, 30], [200, 100, 50]]
    assert dataset.dtype == np.uint8
    assert "palette" in dataset.warnings[0]
    plain = Dataset.open(path, band=1)
    assert plain.read(whole(plain))[0].tolist() == [[[0, 1, 2]]]
    assert plain.warnings == ()


@pytest.mark.parametrize(("dtype", "bits"), [("uint8", 1), ("uint8", 8), ("uint16", 12), ("uint16", 16)])
def test_white_is_bright_even_if_stored_as_0(write_raster, dtype, bits):
    stored = np.array([[0, 1]], dtype)
    path = write_raster(stored, photometric="MINISWHITE", nbits=bits)
    dataset = Dataset.open(path)
    assert dataset.bits == bits
    assert dataset.read(whole(dataset))[0].tolist() == [[[2**bits - 1, 2**bits - 2]]]


def test_the_bit_depth_is_read(write_raster):
    dataset = Dataset.open(write_raster(RAMP % 2048, nbits=11))
    assert dataset.bits == 11


def test_files_without_georeferencing_give_one_warning(write_raster):
    files = write_raster(RAMP, transform=None, crs=None), write_raster(RAMP, crs=None)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        lost, local = map(Dataset.open, files)
        lost.read(whole(lost))
    assert len(lost.warnings) == len(local.warnings) == 1
    assert "no place on the map" in lost.warnings[0]
    assert "no coordinate reference system" in local.warnings[0]
    assert lost.geobox.transform == Affine.identity()
    assert lost.geobox.crs is None


@pytest.mark.parametrize("transform", [Affine(2, 0.5, 9, 0.5, -2, 9), Affine(2, 0, 9, 0, 2, 9)])
def test_rotated_and_south_up_rasters_stay_as_they_are(write_raster, transform):
    dataset = Dataset.open(write_raster(RAMP, transform=transform))
    assert dataset.geobox.transform == transform
    assert np.array_equal(dataset.read(whole(dataset))[0][0], RAMP)


def test_control_points_without_a_transform_are_refused_with_a_gdalwarp_command(write_raster):
    from rasterio.control import GroundControlPoint
    from rasterio.rpc import RPC

    points = [GroundControlPoint(r, c, 10 + c / 99, 20 - r / 99) for r in (0, 9) for c in (0, 9)]
    path = write_raster(RAMP, transform=None, crs="EPSG:4326", gcps=points)
    with pytest.raises(RasterError, match="gdalwarp -tps -r near"):
        Dataset.open(path)
    ones = [1.0] + [0.0] * 19
    rpcs = RPC(0, 1, 20, 1, ones, ones, 75, 1, 10, 1, ones, ones, 85, 1)
    with pytest.raises(RasterError, match="gdalwarp -rpc"):
        Dataset.open(write_raster(RAMP, transform=None, crs=None, rpcs=rpcs))


def test_complex_numbers_are_refused(write_raster):
    with pytest.raises(RasterError, match="complex"):
        Dataset.open(write_raster(RAMP.astype(np.complex64)))


def test_a_path_that_is_not_a_raster_is_named(tmp_path):
    text = tmp_path / "notes.txt"
    text.write_text("not a raster")
    with pytest.raises(RasterReadError, match=r"no file .*gone\.tif"):
        Dataset.open(tmp_path / "gone.tif")
    with pytest.raises(RasterReadError, match=r"notes\.txt cannot be opened as a raster"):
        Dataset.open(text)
    with pytest.raises(RasterReadError, match="is a folder"):
        Dataset.open(tmp_path)
    with pytest.raises(ParameterError, match="at least one"):
        Dataset.open([])


def test_a_truncated_file_is_an_error_that_names_the_first_rows_that_are_missing(write_raster):
    path = write_raster(np.random.default_rng(0).integers(0, 255, (300, 300), np.uint8), compress="deflate")
    path.write_bytes(path.read_bytes()[:20000])
    dataset = Dataset.open(path)
    dataset.read(Window(0, 0, 10, 300))
    with pytest.raises(RasterReadError, match="rows 54 to 81, columns 0 to 300"):
        dataset.read(Window(280, 0, 10, 300))


def test_missing_blocks_of_a_sparse_file_are_known_to_be_empty(write_raster):
    pixels = np.zeros((256, 256), np.int32)
    pixels[64:128] = 5
    how = {"tiled": True, "blockxsize": 64, "blockysize": 64, "nodata": 0, "sparse_ok": True}
    dataset = Dataset.open(write_raster(pixels, **how))
    assert [dataset.is_empty(Window(row, 0, 64, 256)) for row in (0, 64, 128)] == [True, False, True]
    assert not dataset.is_empty(Window(0, 0, 65, 256))
    assert dataset.read(Window(128, 0, 128, 256))[1].sum() == 0
    assert np.array_equal(dataset.read(whole(dataset))[1], pixels != 0)
    dense = Dataset.open(dataset.paths[0], nodata="only:5")  # then zeros are valid, stored or not
    assert not dense.is_empty(Window(0, 0, 64, 64))
    assert np.array_equal(dense.read(whole(dense))[1], pixels != 5)


@settings(max_examples=20)
@given(st.integers(1, 200))
def test_a_downsampled_read_has_the_same_extent(holed, side):
    values, _, box = holed.read_coarse(side)
    assert values.shape[1:] == box.shape
    assert max(box.shape) <= side
    for corner in ((0, 0), (1, 1)):
        ends = (corner[0] * box.shape[0], corner[1] * box.shape[1])
        full = (corner[0] * RAMP.shape[0], corner[1] * RAMP.shape[1])
        assert np.allclose(box.xy_from_pixel(*ends), holed.geobox.xy_from_pixel(*full), rtol=1e-12)


def test_a_downsampled_read_is_like_the_raster(write_raster):
    image = np.add.outer(np.arange(256), np.arange(256)) / 2
    image[:64, :64] = 0
    dataset = Dataset.open(write_raster(image.astype(np.uint8), nodata=0))
    values, valid, _ = dataset.read_coarse(64)
    assert np.abs(values[0] - image[2::4, 2::4])[valid].max() <= 4
    assert np.array_equal(valid[1:, 1:], (image[2::4, 2::4] != 0)[1:, 1:])


def test_the_block_cache_of_the_process_keeps_its_size(holed, monkeypatch):
    from rasterio.env import get_gdal_config

    monkeypatch.delenv("GDAL_CACHEMAX", raising=False)
    before = get_gdal_config("GDAL_CACHEMAX")
    readers = [threading.Thread(target=holed.read, args=(whole(holed),)) for _ in range(4)]
    for reader in readers:
        reader.start()
    for reader in readers:
        reader.join()
    assert get_gdal_config("GDAL_CACHEMAX") == before


def test_a_foreign_proj_database_is_named(write_raster, tmp_path):
    code = "import sys; from uavseg.raster.read.dataset import Dataset; Dataset.open(sys.argv[1])"
    answer = subprocess.run(
        [sys.executable, "-c", code, str(write_raster(RAMP))],
        env=os.environ | {"PROJ_DATA": str(tmp_path), "PYTHONPATH": os.pathsep.join(sys.path)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert "unset the environment variables PROJ_LIB and PROJ_DATA" in answer.stderr


def test_rasters_in_archives_are_rasters(write_raster, tmp_path):
    path = write_raster(RAMP)
    with zipfile.ZipFile(tmp_path / "a.zip", "w") as archive:
        archive.write(path, "inner.tif")
    dataset = Dataset.open(f"/vsizip/{tmp_path}/a.zip/inner.tif")
    assert np.array_equal(dataset.read(whole(dataset))[0][0], RAMP)
    assert dataset.source == "inner.tif"


REAL = [
    "dem/ny_dsm_2m.tif",
    "dem/olinda_dem_southern.tif",
    "imagery/landsat8_greenland_B5.tif",
    "imagery/landsat_bahamas_RGB.byte.tif",
    "imagery/naip_forest_gap_1m.tif",
    "imagery/naip_potholes_2015.tif",
    "imagery/uav_forest_snow_clearing_mask.tif",
    "imagery/uav_pix4d_fields_alpha.tif",
    "odd/imagetiff_int8.tif",
    "odd/imagetiff_miniswhite-1c-1b.tiff",
    "odd/imagetiff_random-fp16-pred3.tiff",
    "odd/nodegdal_huge-sparse.tiff",
    "odd/nodegdal_sample_bigtiff.tif",
    "odd/nodegdal_unsupported-srs.tif",
    "odd/rasterio_RGBA.uint16.tif",
    "odd/rasterio_all-nodata.tif",
    "odd/rasterio_float_nan.tif",
    "odd/rasterio_rotated.tif",
    "odd/riocogeo_image_colormap.tif",
    "odd/riotiler_cog_nonearth.tif",
    "odd/riotiler_inverted_lat.tif",
    "maps/depot.pgm",
    "maps/willow-full.pgm",
]


@pytest.mark.parametrize("name", REAL)
def test_real_rasters_are_valid_where_gdal_masks_them_so(shared_data, name):
    import rasterio

    with warnings.catch_warnings():
        warnings.simplefilter("error")
        dataset = Dataset.open(shared_data / name)
        window = Window(0, 0, 700, 1100).clipped(dataset.geobox.shape)
        values, valid = dataset.read(window)
    assert values.dtype == dataset.dtype
    with warnings.catch_warnings(action="ignore"), rasterio.open(shared_data / name) as file:
        part = ((0, window.rows), (0, window.cols))
        mask = np.ones((window.rows, window.cols), bool)
        if "sparse" not in name:
            mask = file.dataset_mask(window=part) != 0
    if "sparse" in name:
        assert not valid.any()
    elif "RGBA.uint16" in name:  # GDAL rounds 16-bit alpha down to 8 bits
        assert valid[mask].all()
    elif "nonearth" in name or "all-nodata" in name:
        assert np.array_equal(valid, mask)
    else:
        finite = np.isfinite(values.astype(np.float64)).all(axis=0)
        assert np.array_equal(np.ones_like(mask) if valid is None else valid, mask & finite)


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("odd/nodegdal_truncated.tiff", "its tag GeoPixelScale cannot be read"),
        ("odd/rasterio_corrupt.tif", "cannot be read in rows 512 to 1024, columns 512 to 1024 "),
        ("odd/riotiler_cog_gcps.tif", "gdalwarp -tps"),
        ("maps/depot.yaml", "cannot be opened as a raster"),
    ],
)
def test_broken_rasters_are_refused_in_one_line(shared_data, name, words):
    with pytest.raises(UavsegError, match=words) as caught:
        dataset = Dataset.open(shared_data / name)
        dataset.read(whole(dataset))
    assert "\n" not in str(caught.value)


def test_a_pickled_dataset_is_read_from_another_folder(tmp_path, monkeypatch):
    with rasterio.open(tmp_path / "a.tif", "w", "GTiff", 5, 4, 1, dtype="uint8", crs="EPSG:32618",
                       transform=Affine(2, 0, 4e5, 0, -2, 5e6)) as file:  # fmt: skip
        file.write(np.arange(20, dtype=np.uint8).reshape(1, 4, 5))
    monkeypatch.chdir(tmp_path)
    dataset = Dataset.open("a.tif")
    content = pickle.dumps(dataset)
    (tmp_path / "deep").mkdir()
    monkeypatch.chdir(tmp_path / "deep")
    arrived = pickle.loads(content)
    assert np.array_equal(arrived.read(Window(0, 0, 4, 5))[0][0].reshape(-1), np.arange(20))
    assert arrived.source == "a.tif" and dataset.paths == ("a.tif",)


@pytest.mark.parametrize("path", ["https://a.org/b.tif", "/vsis3/bucket/b.tif", "s3://b/c.tif", "gone.tif"])
def test_remote_paths_stay_as_they_are(path):
    assert absolute_path(path) == path


def test_paths_of_archives_become_absolute(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert absolute_path("/vsizip/a.zip/b.tif") == f"/vsizip/{tmp_path}/a.zip/b.tif"
    assert absolute_path("/vsizip//a.zip/b.tif") == "/vsizip//a.zip/b.tif"
    assert absolute_path("/vsizip/vsicurl/http://a.org/a.zip/b.tif").startswith("/vsizip/vsicurl/")


def test_a_truncated_png_is_refused_rather_than_read_as_black(tmp_path):
    path = tmp_path / "noise.png"
    write_png(path, np.random.default_rng(0).integers(1, 255, (90, 90), np.uint8))
    path.write_bytes(path.read_bytes()[:3000])
    dataset = Dataset.open(path)
    with pytest.raises(RasterReadError, match="the file is damaged or incomplete"):
        dataset.read(whole(dataset))


@pytest.mark.parametrize("sources", [[1.5], [float("nan"), 2.0], [None], {1, 2}, 3, b"a.tif"])
def test_sources_that_are_no_paths_are_refused(sources):
    with pytest.raises(ParameterError, match="a path"):
        Dataset.open(sources)


@pytest.mark.parametrize("side", [0, -3])
def test_a_coarse_read_has_at_least_one_pixel(write_raster, side):
    with pytest.raises(ParameterError, match="max_side is at least 1"):
        Dataset.open(write_raster(np.zeros((4, 5), np.uint8))).read_coarse(side)


def test_numbers_of_colours_have_no_sign(write_raster):
    palette = {0: (0, 0, 0, 255), 200: (10, 20, 30, 255)}
    path = write_raster(np.array([[0, 200]], np.uint8), palette=palette)
    dataset = Dataset.open(path)
    expected = dataset.read(whole(dataset))[0]
    data = path.read_bytes()
    with rasterio.open(path) as file:
        tag = b"\x53\x01\x03\x00"  # SampleFormat, a short
        assert file.dtypes == ("uint8",)
    if tag in data:
        at = data.index(tag)
        path.write_bytes(data[: at + 8] + b"\x02\x00" + data[at + 10 :])
        with rasterio.open(path) as file:
            assert file.dtypes == ("int8",)
        again = Dataset.open(path)
        assert np.array_equal(again.read(whole(again))[0], expected)
    else:
        pytest.fail("the file has no SampleFormat")
