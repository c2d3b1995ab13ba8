"""Files of another grid, resolution or CRS in a mosaic: every pixel is the nearest one of its file."""

import math
import pickle

import numpy as np
import pyproj
import pytest
import rasterio
from affine import Affine
from hypothesis import given, settings, strategies as st
from rasterio.crs import CRS
from rasterio.vrt import WarpedVRT

from tests.raster.test_bad_blocks import spoil
from uavseg.errors import MosaicError, UavsegError
from uavseg.raster.elevation.dem import Dem
from uavseg.raster.grid.geobox import GeoBox
from uavseg.raster.grid.tiling import Window
from uavseg.raster.read.bad_blocks import recording_bad_blocks
from uavseg.raster.read.dataset import Dataset
from uavseg.raster.read.raster_file import RasterFile
from uavseg.raster.read.warp import bends, place_in, place_on
from uavseg.raster.spectral.formula import BandWords

FIRST = GeoBox((6, 8), Affine(0.5, 0, 640000.2, 0, -0.5, 5400000.3), CRS.from_epsg(32632))
SHAPE = (40, 50)
IMAGE = np.arange(1, 2001, dtype=np.uint16).reshape(SHAPE)  # every pixel has a value of its own
TIE = 2e-3  # pixels of the file: a centre that is nearer to an edge may lie on either side of it
CASES = {
    "shifted": (32632, Affine(0.5, 0, 640005.33, 0, -0.5, 5399999.01)),
    "finer": (32632, Affine(0.1713, 0, 640003.1, 0, -0.1713, 5399999.2)),
    "coarser": (32632, Affine(1.13, 0, 639990.1, 0, -1.13, 5400009.2)),
    "oblong": (32632, Affine(0.31, 0, 640003.1, 0, -0.9, 5399999.2)),
    "south up": (32632, Affine(0.5, 0, 640003.1, 0, 0.5, 5399980.7)),
    "east to west": (32632, Affine(-0.4, 0, 640023.1, 0, -0.4, 5399999.7)),
    "turned": (32632, Affine(0.4, 0.3, 640003.1, 0.3, -0.4, 5399990.7)),
    "next zone": (32633, Affine(0.5, 0, 198880.3, 0, -0.5, 5406340.7)),
    "degrees": (4326, Affine(6e-6, 0, 10.9041, 0, -5e-6, 48.7373)),
    "Web Mercator": (3857, Affine(0.9, 0, 1213850.2, 0, -0.9, 6230394.1)),
}


def plain(box, file, crs):
    """Nearest pixel of a file for the centre of each pixel of a box, -1 beside it; and which are ties."""
    to_file = pyproj.Transformer.from_crs(box.crs.to_wkt(), CRS.from_epsg(crs).to_wkt(), always_xy=True)
    found = np.full((2, *box.shape), -1)
    ties = np.zeros(box.shape, bool)
    for row, col in np.ndindex(box.shape):
        x, y = box.transform * (col + 0.5, row + 0.5)
        x, y = (x, y) if box.crs.to_epsg() == crs else to_file.transform(x, y)
        col_in, row_in = ~file.transform * (x, y)
        ties[row, col] = any(abs(one - round(one)) < TIE for one in (col_in, row_in))
        if 0 <= row_in < file.shape[0] and 0 <= col_in < file.shape[1]:
            found[:, row, col] = math.floor(row_in), math.floor(col_in)
    return found, ties


def opened(write_raster, crs, transform, image=IMAGE, first=FIRST, **how):
    """A mosaic of a first file without valid pixels, and an image on another grid."""
    bands = 1 if image.ndim == 2 else len(image)
    empty = np.zeros((bands, *first.shape), image.dtype)
    same = {"colors": how["colors"]} if "colors" in how else {}
    name = write_raster(empty, transform=first.transform, crs=first.crs, nodata=0, **same)
    other = write_raster(image, transform=transform, crs=f"EPSG:{crs}", **({"nodata": 0} | how))
    return Dataset.open([name, other], band=1, warp=True)


def read(dataset):
    """All values, and which pixels are valid."""
    values, valid = dataset.read(Window(0, 0, *dataset.geobox.shape))
    return values, np.ones(dataset.geobox.shape, bool) if valid is None else valid


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_each_pixel_is_the_nearest_of_its_file(write_raster, case):
    crs, transform = CASES[case]
    dataset = opened(write_raster, crs, transform)
    box, warp = dataset.geobox, dataset.mosaic.warps[1]
    whole = Window(0, 0, *box.shape)
    values, valid = read(dataset)
    row, col, end_row, end_col = dataset.mosaic.boxes[1].tolist()
    part = box.window(Window(row, col, end_row - row, end_col - col).common(whole))
    assert part.shape == warp.grid.shape  # the box of the file is within the union
    (rows, cols), ties = plain(part, warp.file, crs)
    here = values[0, row:end_row, col:end_col], valid[row:end_row, col:end_col]
    expected = np.where(rows >= 0, IMAGE[np.maximum(rows, 0), np.maximum(cols, 0)], 0)
    assert np.array_equal(here[1][~ties], (rows >= 0)[~ties])
    assert np.array_equal(np.where(here[1], here[0], 0)[~ties], expected[~ties])
    assert valid.sum() == here[1].sum() > 100  # and none lies beside the box
    assert ties.mean() < 0.1
    rim = [here[1][0], here[1][-1], here[1][:, 0], here[1][:, -1]]
    assert case == "turned" or all(line.any() for line in rim)  # and the box is not too large


@pytest.mark.parametrize("sides", [(0.5, -0.5), (-0.5, -0.5), (0.5, 0.5)], ids=str)
def test_grids_half_a_pixel_apart_keep_every_row_and_column(write_raster, sides):
    dataset = opened(write_raster, 32632, Affine(sides[0], 0, 640005.45, 0, sides[1], 5399998.05))
    values, valid = read(dataset)
    assert np.array_equal(np.sort(values[0][valid]), np.sort(IMAGE.ravel()))


@pytest.mark.parametrize("case", CASES)
def test_gdal_without_its_approximation_finds_the_same(write_raster, case):
    crs, transform = CASES[case]
    dataset = opened(write_raster, crs, transform)
    box = dataset.geobox
    size = {"height": box.shape[0], "width": box.shape[1]}
    how = {
        "crs": box.crs,
        "transform": box.transform,
        "tolerance": 1e-9,
        "src_nodata": 0,
        "nodata": 0,
        **size,
    }
    with rasterio.open(dataset.paths[1]) as file, WarpedVRT(file, **how) as warped:
        expected = warped.read(1)
    values, valid = read(dataset)
    found = np.where(valid, values[0], 0)
    rows, cols = place_in(
        dataset.mosaic.warps[1].file,
        box,
        np.arange(box.shape[0])[:, None] + 0.5,
        np.arange(box.shape[1]) + 0.5,
    )
    sure = np.minimum(abs(rows - np.rint(rows)), abs(cols - np.rint(cols))) > TIE
    assert np.array_equal(found[sure], expected[sure])
    assert sure.mean() > 0.9


LARGE = GeoBox((900, 1100), Affine(0.5, 0, 640000.2, 0, -0.5, 5400000.3), CRS.from_epsg(32632))
FILES = {
    "next zone": GeoBox((700, 900), Affine(0.5, 0.01, 198800.3, 0.02, -0.5, 5406480.7), CRS.from_epsg(32633)),
    "degrees": GeoBox((700, 900), Affine(6e-6, 0, 10.9041, 0, -5e-6, 48.7373), CRS.from_epsg(4326)),
    "kilometres": GeoBox((300, 400), Affine(1100, 0, 1.19e6, 0, -900, 7.24e6), CRS.from_epsg(3857)),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", FILES)
def test_interpolated_positions_have_the_floor_of_exact_ones(name):
    grid = LARGE if name != "kilometres" else GeoBox((9, 9), Affine(500, 0, 6e5, 0, -500, 5.4e6), LARGE.crs)
    warp, _ = place_on(grid, FILES[name], ("a.tif", "b.tif"))
    rows, cols = (np.arange(length) for length in warp.grid.shape)
    row, col, inside = warp.pixels(rows, cols)
    exact = np.floor(place_in(warp.file, warp.grid, rows[:, None] + 0.5, cols + 0.5) + 1e-3)
    expected = ((exact >= 0) & (exact < np.array(warp.file.shape)[:, None, None])).all(axis=0)
    assert np.array_equal(inside, expected) and inside.mean() > 0.3
    assert np.array_equal(np.stack([row, col])[:, inside], exact[:, inside])
    nodes = [32 * np.arange(2 * (length // 64) + 3) for length in warp.grid.shape]
    bent = max(bends(each).max() for each in place_in(warp.file, warp.grid, nodes[0][:, None], nodes[1]))
    assert (bent > 1 / 128) == (name == "kilometres")  # where all of a square are computed


@pytest.fixture(scope="module")
def of_three(write_raster):
    """Three files that overlap, on three grids in two systems; with holes."""
    rng = np.random.default_rng(5)
    image = rng.integers(0, 3000, (170, 210)).astype(np.uint16)  # 0 is nodata
    grids = [(FIRST.crs, FIRST.transform), *(CASES[name] for name in ("next zone", "turned"))]
    crs = [FIRST.crs, "EPSG:32633", "EPSG:32632"]
    files = [
        write_raster(
            image[k:], transform=transform, crs=crs[k], nodata=0, tiled=True, blockxsize=64, blockysize=64
        )
        for k, (_, transform) in enumerate(grids)
    ]
    return files, Dataset.open(files, warp=True)


@pytest.mark.slow
@settings(max_examples=40)
@given(data=st.data())
def test_windows_change_no_pixel(of_three, data):
    _, dataset = of_three
    whole = dataset.read(Window(0, 0, *dataset.geobox.shape))
    corner = [data.draw(st.integers(0, length - 1)) for length in dataset.geobox.shape]
    size = [data.draw(st.integers(1, 150)) for _ in corner]
    window = Window(*corner, *size).clipped(dataset.geobox.shape)
    values, valid = dataset.read(window)
    valid = np.ones(valid.shape if valid is not None else values.shape[1:], bool) if valid is None else valid
    assert np.array_equal(valid, whole[1][window.slices])
    assert np.array_equal(values[:, valid], whole[0][:, *window.slices][:, valid])
    part = dataset.mosaic.cut(window)
    assert np.array_equal(part.boxes + [window.row, window.col] * 2, dataset.mosaic.boxes)


def test_the_first_valid_pixel_wins(of_three):
    files, dataset = of_three
    values, valid = read(dataset)
    expected = np.zeros(dataset.geobox.shape, np.uint16)
    for (row, col, end_row, end_col), warp, path in zip(
        dataset.mosaic.boxes.tolist(), dataset.mosaic.warps, files, strict=True
    ):
        pixels = rasterio.open(path).read(1)
        if warp is not None:
            rows, cols, inside = warp.pixels(*(np.arange(length) for length in warp.grid.shape))
            pixels = np.where(inside, pixels[rows, cols], 0)
        here = expected[row:end_row, col:end_col]
        here[here == 0] = pixels[here == 0]
    assert np.array_equal(np.where(valid, values[0], 0), expected)
    assert np.array_equal(valid, expected > 0)


def test_another_process_reads_the_same(of_three):
    _, dataset = of_three
    again = pickle.loads(pickle.dumps(dataset))
    window = Window(20, 30, 150, 160)
    assert np.array_equal(again.read(window)[0], dataset.read(window)[0])
    assert np.array_equal(again.read(window)[1], dataset.read(window)[1])


def test_large_windows_of_a_fine_file_are_read_in_parts(write_raster, monkeypatch):
    dataset = opened(write_raster, *CASES["finer"])
    whole = dataset.read(Window(0, 0, *dataset.geobox.shape))
    sides, read_file = [], RasterFile.read

    def look(self, handles, choice, window, shape=None):
        sides.append(max(window.rows, window.cols))
        return read_file(self, handles, choice, window, shape)

    monkeypatch.setattr(RasterFile, "read", look)
    monkeypatch.setattr("uavseg.raster.read.warp._MOST_READ", 12)
    values, valid = read(dataset)
    assert np.array_equal(values, whole[0]) and np.array_equal(valid, whole[1])
    assert max(sides[1:]) <= 12 < max(IMAGE.shape) and len(sides) > 9


def test_parts_of_one_raster_are_not_warped(write_raster):
    windows = [Window(0, 0, 25, 30), Window(15, 20, 25, 30)]
    grid = Affine(1 / 3, 0, 640000.2, 0, -1 / 3, 5400000.3)
    files = [
        write_raster(IMAGE[window.slices], transform=grid * Affine.translation(window.col, window.row))
        for window in windows
    ]
    plain_one, warped = (Dataset.open(files, warp=warp) for warp in (False, True))
    assert warped.mosaic.warps == (None, None) and warped.warnings == plain_one.warnings == ()
    assert warped.geobox == plain_one.geobox
    for one, other in zip(*(found.read(Window(0, 0, 40, 50)) for found in (plain_one, warped)), strict=True):
        assert np.array_equal(one, other)


def test_grids_without_a_system_are_warped(write_raster):
    a = write_raster(np.zeros((4, 4), np.uint8), crs=None, transform=Affine(1, 0, 5, 0, -1, 9), nodata=0)
    b = write_raster(
        np.array([[1, 2], [3, 4]], np.uint8), crs=None, transform=Affine(2, 0, 5, 0, -2, 9), nodata=0
    )
    values, _ = Dataset.open([a, b], warp=True).read(Window(0, 0, 4, 4))
    assert np.array_equal(values[0], np.kron([[1, 2], [3, 4]], np.ones((2, 2), int)))


@pytest.mark.parametrize("kind", ["nodata", "mask", "alpha"])
def test_pixels_are_valid_where_those_of_the_file_are(write_raster, kind):
    holes = np.random.default_rng(2).random(SHAPE) < 0.4
    crs, transform = CASES["next zone"]
    how = {}
    if kind == "nodata":
        image = np.where(holes, 7777, IMAGE).astype(np.uint16)
        how = {"nodata": 7777}
    elif kind == "mask":
        image, how = IMAGE, {"mask": ~holes, "nodata": None}
    else:
        image = np.stack([IMAGE, np.where(holes, 0, 65535).astype(np.uint16)])
        how = {"colors": "gray alpha", "nodata": None}
    dataset = opened(write_raster, crs, transform, image, **how)
    values, valid = read(dataset)
    reference = opened(write_raster, crs, transform)
    all_values, all_valid = reference.read(Window(0, 0, *reference.geobox.shape))
    expected = all_valid & ~holes.ravel()[np.where(all_valid, all_values[0].astype(int) - 1, 0)]
    assert np.array_equal(valid, expected)
    assert np.array_equal(values[0][valid], all_values[0][valid])


@pytest.mark.parametrize(
    "how", [{"words": BandWords(expr="(b1 - b2) / (b1 + b2)")}, {"rgb": (1, 2, 3)}, {"band": 2}], ids=str
)
def test_bands_are_combined_as_in_the_file_itself(write_raster, how):
    bands = np.random.default_rng(8).integers(1, 255, (3, *SHAPE)).astype(np.uint8)
    crs, transform = CASES["next zone"]
    empty = np.zeros((3, *FIRST.shape), np.uint8)
    first = write_raster(empty, transform=FIRST.transform, crs=FIRST.crs, nodata=0)
    other = write_raster(bands, transform=transform, crs=f"EPSG:{crs}", nodata=0)
    dataset, alone = Dataset.open([first, other], warp=True, **how), Dataset.open(other, **how)
    values, valid = read(dataset)
    row, col, end_row, end_col = dataset.mosaic.boxes[1].tolist()
    warp = dataset.mosaic.warps[1]
    rows, cols, inside = warp.pixels(*(np.arange(length) for length in warp.grid.shape))
    pixels, known = read(alone)
    assert values.dtype == pixels.dtype and len(values) == len(pixels)
    assert np.array_equal(valid[row:end_row, col:end_col], inside & known[rows, cols])
    found = values[:, row:end_row, col:end_col][:, inside]
    assert np.array_equal(found, pixels[:, rows, cols][:, inside], equal_nan=True)


def test_an_array_with_coordinates_is_warped(write_raster):
    xarray = pytest.importorskip("xarray")
    pytest.importorskip("rioxarray")
    crs, transform = CASES["shifted"]
    names = [
        write_raster(np.zeros(FIRST.shape, np.uint16), transform=FIRST.transform, crs=FIRST.crs, nodata=0),
        write_raster(IMAGE, transform=transform, crs=f"EPSG:{crs}", nodata=0),
    ]
    y, x = (
        transform.f + transform.e * (np.arange(40) + 0.5),
        transform.c + transform.a * (np.arange(50) + 0.5),
    )
    array = xarray.DataArray(IMAGE, dims=("y", "x"), coords={"y": y, "x": x}).rio.write_crs(crs)
    found, expected = (Dataset.open([names[0], one], warp=True) for one in (array, names[1]))
    assert found.geobox.shape == expected.geobox.shape
    assert np.array_equal(read(found)[0][0][read(found)[1]], read(expected)[0][0][read(expected)[1]])


def test_a_downsampled_read_has_pixels_near_its_own(write_raster):
    places = np.add.outer(np.arange(300) * 200, np.arange(200)).astype(np.uint16)  # row and column
    dataset = opened(write_raster, 32633, CASES["next zone"][1], places, nodata=None)
    values, valid, box = dataset.read_coarse(60)
    centres = np.arange(box.shape[0])[:, None] + 0.5, np.arange(box.shape[1]) + 0.5
    exact = place_in(dataset.mosaic.warps[1].file, box, *centres)[:, valid]
    found = np.stack(np.divmod(values[0][valid].astype(int), 200)) + 0.5
    step = dataset.geobox.shape[0] / box.shape[0]
    assert valid.mean() > 0.5 and step > 4
    assert np.abs(found - exact).max() < 1.5 * step


def test_blocks_that_cannot_be_read_are_named_where_pixels_are_missing(write_raster):
    image = np.random.default_rng(3).integers(1, 9999, (256, 256)).astype(np.uint16)
    how = {"tiled": True, "blockxsize": 64, "blockysize": 64, "compress": "deflate", "nodata": 0}
    crs, transform = CASES["next zone"]
    path = write_raster(image, crs=f"EPSG:{crs}", transform=transform, **how)
    first = write_raster(np.zeros(FIRST.shape, np.uint16), transform=FIRST.transform, crs=FIRST.crs, nodata=0)
    sound = Dataset.open([first, path], warp=True).read
    whole = Window(0, 0, *Dataset.open([first, path], warp=True).geobox.shape)
    _, all_valid = sound(whole)
    spoil(path, [(2, 1)])
    dataset, found = Dataset.open([first, path], warp=True, skip_bad_tiles=True), set()
    with recording_bad_blocks(found):
        _, valid = dataset.read(whole)
    assert {(block.row, block.col) for block in found} == {(128, 64)}
    warp = dataset.mosaic.warps[1]
    rows, cols, inside = warp.pixels(*(np.arange(length) for length in warp.grid.shape))
    lost = np.zeros(dataset.geobox.shape, bool)
    row, col, end_row, end_col = dataset.mosaic.boxes[1].tolist()
    lost[row:end_row, col:end_col] = inside & (rows // 64 == 2) & (cols // 64 == 1)
    assert np.array_equal(valid, all_valid & ~lost) and lost.sum() > 3000
    with pytest.raises(UavsegError, match="rows 128 to 192, columns 64 to 128"):
        Dataset.open([first, path], warp=True).read(whole)
    beside, found = Window(0, 0, 8, 8), set()
    with recording_bad_blocks(found):
        dataset.read(beside)
    assert not found


def test_the_note_says_which_files_and_what_is_lost(write_raster):
    first = write_raster(np.ones((64, 64), np.uint8), crs="EPSG:32632", transform=FIRST.transform)
    finer = write_raster(
        np.ones((64, 64), np.uint8), crs="EPSG:32632", transform=Affine(0.1, 0, 640000, 0, -0.1, 5400000)
    )
    etrs = write_raster(np.ones((64, 64), np.uint8), crs="EPSG:25832", transform=FIRST.transform)
    [note] = Dataset.open([first, finer, etrs, first], warp=True).warnings
    assert note == (
        f"read by nearest neighbour on the pixel grid of {first.name} (pixels of 0.5 x 0.5, CRS EPSG:32632): "
        f"{finer.name} (pixels of 0.1 x 0.1, CRS EPSG:32632, 1 of 25 pixels), "
        f"{etrs.name} (pixels of 0.5 x 0.5, CRS EPSG:25832, known to 1 m)"
    )
    [many] = Dataset.open([first, *[finer] * 11], warp=True).warnings
    assert many.endswith(" and 3 more") and many.count(finer.name) == 8


BALLPARK = "+proj=utm +zone=32 +ellps=intl +units=m"
MARS = CRS.from_wkt(
    'GEOGCRS["Mars",DATUM["Mars",ELLIPSOID["Mars",3396190,169.89]],CS[ellipsoidal,2],AXIS["lon",east],'
    'AXIS["lat",north],UNIT["degree",0.0174532925199433]]'
)


@pytest.mark.parametrize(
    ("how", "words"),
    [
        ({"crs": BALLPARK}, "none whose error is known"),
        ({"crs": MARS, "transform": Affine(0.1, 0, 0, 0, -0.1, 9)}, "there is no transformation"),
        ({"crs": "EPSG:4326", "transform": Affine(10, 0, -180, 0, -10, 90)}, "no certain place"),
        ({"crs": None}, "another CRS"),
        ({"crs": None, "transform": None}, "another CRS"),
        ({"dtype": "uint16"}, "type of bands"),
        ({"bands": 2}, "number of bands"),
    ],
)
@pytest.mark.filterwarnings("ignore::rasterio.errors.NotGeoreferencedWarning")
def test_what_cannot_be_warped_is_named(write_raster, how, words):
    how = dict(how)
    pixels = np.ones((how.pop("bands", 1), 8, 8), how.pop("dtype", "uint8"))
    good = write_raster(np.ones((8, 8), np.uint8), crs="EPSG:32632", transform=FIRST.transform)
    bad = write_raster(pixels, **({"crs": "EPSG:32633", "transform": CASES["next zone"][1]} | how))
    with pytest.raises(MosaicError, match=words) as caught:
        Dataset.open([good, bad], warp=True)
    text = str(caught.value)
    assert str(bad) in text and str(good) in text and "--warp" not in text and "\n" not in text


@pytest.mark.parametrize(
    ("crs", "transform"),
    [
        ("EPSG:32660", Affine(90, 0, 830000, 0, -90, 5e4)),  # across the antimeridian
        ("EPSG:3031", Affine(9e4, 0, -4e6, 0, -9e4, 4e6)),  # the pole
    ],
)
def test_a_file_across_the_antimeridian_or_a_pole_is_refused_in_degrees(write_raster, crs, transform):
    pixels, grid = np.ones((80, 80), np.uint8), Affine(0.001, 0, 179, 0, -0.001, 0.5)
    first, across = (
        write_raster(pixels, crs="EPSG:4326", transform=grid),
        write_raster(pixels, crs=crs, transform=transform),
    )
    with pytest.raises(MosaicError, match="at a pole or across the antimeridian"):
        Dataset.open([first, across], warp=True)


GOOD = {"crs": "EPSG:32618", "transform": Affine(0.5, 0, 300000, 0, -0.5, 4000000)}


@pytest.mark.parametrize(
    ("how", "solved"),
    [
        ({"crs": "EPSG:32619"}, True),
        ({"transform": Affine(0.6, 0, 300000, 0, -0.5, 4000000)}, True),
        ({"transform": Affine(0.5, 0, 300000.2, 0, -0.5, 4000000)}, True),
        ({"transform": Affine(0.5, 0, 300000, 0, 0.5, 4000000)}, True),
        ({"dtype": "uint16"}, False),
        ({"crs": None}, False),
    ],
)
def test_the_refusal_names_warp_where_it_helps(write_raster, how, solved):
    files = [
        write_raster(np.ones((8, 8), one.pop("dtype", "float32")), **one)
        for one in ({**GOOD}, {**GOOD, **how})
    ]
    with pytest.raises(MosaicError) as caught:
        Dataset.open(files)
    assert ("--warp (warp=True)" in str(caught.value)) == solved
    if solved:
        assert Dataset.open(files, warp=True).mosaic.warps[1] is not None
    with pytest.raises(MosaicError) as caught:
        Dem.open(files)
    assert "--warp" not in str(caught.value)  # which is not an option of elevation models


@pytest.mark.slow
@given(st.sampled_from(sorted(CASES)), st.permutations(range(3)))
@settings(max_examples=12)
def test_later_files_change_neither_the_grid_nor_each_other(write_raster, case, order):
    crs, transform = CASES[case]
    first = write_raster(np.zeros(FIRST.shape, np.uint16), transform=FIRST.transform, crs=FIRST.crs, nodata=0)
    moved = [transform * Affine.translation(60 * k, 0) for k in range(3)]
    files = [write_raster(IMAGE, transform=one, crs=f"EPSG:{crs}", nodata=0) for one in moved]
    found = Dataset.open([first, *(files[k] for k in order)], warp=True)
    alone = [Dataset.open([first, file], warp=True) for file in files]
    for place, k in enumerate(order, start=1):
        assert found.mosaic.warps[place] == alone[k].mosaic.warps[1]
    lattice = ~FIRST.transform * (found.geobox.transform.c, found.geobox.transform.f)
    assert all(abs(one - round(one)) < 1e-6 for one in lattice)
