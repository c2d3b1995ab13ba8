"""Arrays of every form: answered like the same pixels in a GeoTIFF, or refused in a sentence."""

import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
from affine import Affine
from geopandas import GeoDataFrame
from rasterio.io import MemoryFile
from rasterio.vrt import WarpedVRT

import uavseg
from uavseg.errors import ParameterError, RasterError, UavsegError

xarray = pytest.importorskip("xarray")
rioxarray = pytest.importorskip("rioxarray")

PLACE = Affine(0.5, 0, 500000, 0, -0.5, 4500000)
NEAR = Affine(0.7, 0, 5000, 0, -0.7, 9000)
LOCAL = Affine(1, 0, -10.5, 0, 1, -20.5)
CRS = "EPSG:32633"
RANGE = (0.55, 1)
ROWS, COLS = 96, 112


def scene() -> np.ndarray:
    """Two bright rectangles, neither of them in the middle of any axis, on a ramp."""
    image = (np.add.outer(2 * np.arange(ROWS), np.arange(COLS)) % 97).astype(np.uint8)
    image[8:40, 16:56] = 230
    image[50:66, 72:104] = 200
    return image


BASE = scene()
HIDDEN = np.broadcast_to(np.arange(COLS) < 32, (ROWS, COLS))
COLORS = np.stack([BASE, BASE[::-1], BASE // 2])


def coordinates(place: Affine = PLACE, rows: int = ROWS, cols: int = COLS) -> dict[str, np.ndarray]:
    return {
        "y": place.f + place.e * (np.arange(rows) + 0.5),
        "x": place.c + place.a * (np.arange(cols) + 0.5),
    }


def data_array(pixels: np.ndarray = BASE, kept: bool = True) -> Any:
    """A DataArray as rioxarray opens a file; without `kept`, as one makes it by hand."""
    dims = ("y", "x") if pixels.ndim == 2 else ("band", "y", "x")
    array = xarray.DataArray(pixels, coordinates(), dims).rio.write_crs(CRS)
    return array.rio.write_transform(PLACE) if kept else array


def answer(source: Any, **options: Any) -> GeoDataFrame:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        return uavseg.extract(source, RANGE, threads=1, **options)


@pytest.fixture
def expected(tmp_path: Path) -> Callable[..., GeoDataFrame]:
    """The answer of a GeoTIFF that rasterio writes."""

    def of(
        pixels: np.ndarray = BASE,
        place: Affine = PLACE,
        mask: np.ndarray | None = None,
        options: dict[str, Any] | None = None,
        **how: Any,
    ) -> GeoDataFrame:
        planes = pixels[None] if pixels.ndim == 2 else pixels
        count, rows, cols = planes.shape
        how = {"crs": CRS, "dtype": planes.dtype.name, "transform": place} | how
        path = tmp_path / "same.tif"
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", rasterio.errors.NotGeoreferencedWarning)
            with rasterio.open(path, "w", "GTiff", cols, rows, count, **how) as file:
                file.write(planes)
                if mask is not None:
                    file.write_mask(mask)
        return answer(path, **(options or {}))

    return of


def same(found: GeoDataFrame, wanted: GeoDataFrame, rounding: float = 1e-9) -> None:
    assert len(found) == len(wanted) > 0 and found.crs == wanted.crs
    assert found.geometry.geom_equals_exact(wanted.geometry, 1000 * rounding).all()
    for column in (
        "pixels",
        "area_m2",
        "perimeter_m",
        "mean",
        "std",
        "mean_value",
        "confidence",
        "lon",
        "lat",
    ):
        if wanted[column].notna().any():
            assert found[column].tolist() == pytest.approx(wanted[column].tolist(), rel=rounding), column


def lazily() -> Any:
    return data_array().chunk({"y": 40, "x": 50})


# What xarray and rioxarray make of an array: (the array, its pixels, where the first of them lies).
OPERATIONS: dict[str, Callable[[], tuple[Any, np.ndarray, Affine]]] = {
    "as it is": lambda: (data_array(), BASE, PLACE),
    "by hand": lambda: (data_array(kept=False), BASE, PLACE),
    "transposed": lambda: (data_array().transpose("x", "y"), BASE, PLACE),
    "rows ascending": lambda: (data_array().sortby("y"), BASE[::-1], Affine(0.5, 0, 500000, 0, 0.5, 4499952)),
    "columns descending": lambda: (
        data_array().sortby("x", ascending=False),
        BASE[:, ::-1],
        Affine(-0.5, 0, 500056, 0, -0.5, 4500000),
    ),
    "every second": lambda: (
        data_array()[::2, ::2],
        BASE[::2, ::2],
        Affine(1, 0, 499999.75, 0, -1, 4500000.25),
    ),
    "every third column": lambda: (
        data_array()[:, ::3],
        BASE[:, ::3],
        Affine(1.5, 0, 499999.5, 0, -0.5, 4500000),
    ),
    "a part": lambda: (
        data_array().isel(y=slice(5, 90), x=slice(3, 100)),
        BASE[5:90, 3:100],
        Affine(0.5, 0, 500001.5, 0, -0.5, 4499997.5),
    ),
    "coarsened": lambda: (
        data_array().astype(np.float32).coarsen(y=2, x=2).max(),
        BASE.reshape(48, 2, 56, 2).max(axis=(1, 3)).astype(np.float32),
        Affine(1, 0, 500000, 0, -1, 4500000),
    ),
    "clipped": lambda: (
        data_array().rio.clip_box(500004, 4499960, 500050, 4499996),
        BASE[8:80, 8:100],
        Affine(0.5, 0, 500004, 0, -0.5, 4499996),
    ),
    "side by side": lambda: (
        xarray.concat([data_array()[:, :50], data_array()[:, 50:]], "x"),
        BASE,
        PLACE,
    ),
    "chunked": lambda: (lazily(), BASE, PLACE),
    "chunked, transposed, thinned": lambda: (
        lazily().transpose("x", "y")[::2, ::2],
        BASE[::2, ::2],
        Affine(1, 0, 499999.75, 0, -1, 4500000.25),
    ),
    "one time": lambda: (data_array().expand_dims("time"), BASE, PLACE),
    "one band, last": lambda: (data_array().expand_dims("band", 2), BASE, PLACE),
    "one time, one band": lambda: (data_array().expand_dims(["time", "band"]), BASE, PLACE),
    "a Dataset": lambda: (data_array().to_dataset(name="ortho"), BASE, PLACE),
    "a Dataset whose CRS is a variable": lambda: (
        data_array().to_dataset(name="ortho").reset_coords("spatial_ref"),
        BASE,
        PLACE,
    ),
    "dims lat, lon": lambda: (data_array().rename(y="lat", x="lon"), BASE, PLACE),
    "dims lon, latitude": lambda: (data_array().rename(y="latitude", x="longitude").T, BASE, PLACE),
    "dims of one's own": lambda: (
        data_array().rename(y="v", x="u").rio.set_spatial_dims("u", "v"),
        BASE,
        PLACE,
    ),
    "coordinates of float32": lambda: (
        xarray.DataArray(
            BASE, {k: v.astype("f4") for k, v in coordinates(NEAR).items()}, ("y", "x")
        ).rio.write_crs(CRS),
        BASE,
        NEAR,
    ),
    "a local part": lambda: (
        data_array().assign_coords(coordinates(LOCAL)).rio.write_transform(LOCAL)[20:, 10:],
        BASE[20:, 10:],
        Affine(1, 0, -0.5, 0, 1, -0.5),
    ),
    "one row of three": lambda: (data_array()[20:22], BASE[20:22], Affine(0.5, 0, 500000, 0, -0.5, 4499990)),
    "bool": lambda: (data_array(BASE > 150), (BASE > 150).astype(np.uint8), PLACE),
    "big-endian": lambda: (data_array(BASE.astype(">u2")), BASE.astype(np.uint16), PLACE),
    "bands in the middle": lambda: (data_array(COLORS).transpose("y", "band", "x"), COLORS, PLACE),
    "bands last": lambda: (data_array(COLORS).transpose("x", "y", "band"), COLORS, PLACE),
    "padded": lambda: (
        data_array().rio.write_nodata(255).rio.pad_box(499996, 4499950, 500060, 4500004),
        np.pad(BASE, ((8, 4), (8, 8)), constant_values=255),
        Affine(0.5, 0, 499996, 0, -0.5, 4500004),
    ),
    "reprojected": lambda: _reprojected(),
}


def _reprojected() -> tuple[Any, np.ndarray, Affine]:
    found = data_array().rio.write_nodata(255).rio.reproject(CRS, resolution=0.75)
    return found, found.values, found.rio.transform(recalc=True)


@pytest.mark.filterwarnings("ignore:The codes, labels")
@pytest.mark.parametrize("name", OPERATIONS)
def test_what_xarray_makes_of_an_array_is_answered_like_its_file(name: str, expected: Any) -> None:
    array, pixels, place = OPERATIONS[name]()
    how: dict[str, Any] = {"nbits": 1} if name == "bool" else {}
    how |= {"nodata": 255} if name in ("padded", "reprojected") else {}
    same(answer(array), expected(pixels, place, **how), 1e-5 if name == "coordinates of float32" else 1e-9)


def test_what_is_masked_is_left_out_as_in_a_file_with_a_mask(expected: Any) -> None:
    wanted = expected(mask=~HIDDEN)
    masked = np.ma.masked_array(BASE, HIDDEN)
    soft = masked.copy()
    soft.soften_mask()
    soft.set_fill_value(230)
    for form in (masked, soft, np.ma.masked_array(BASE, HIDDEN, hard_mask=True)):
        found = answer(form)
        assert (
            found["pixels"].tolist() == wanted["pixels"].tolist() and found["pixels"].sum() == 24 * 32 + 512
        )
    assert answer(np.ma.masked_array(BASE)).equals(answer(BASE))


def test_masks_of_bands_are_those_of_a_pixel_together(expected: Any) -> None:
    masks = np.zeros(COLORS.shape, bool)
    masks[0, :, :20], masks[2, :24] = True, True
    whole = masks.any(axis=0)
    wanted = expected(COLORS, mask=~whole)
    for form in (np.ma.masked_array(COLORS, masks), np.ma.masked_array(COLORS, masks).transpose(1, 2, 0)):
        assert answer(form)["pixels"].tolist() == wanted["pixels"].tolist()
    alone = answer(np.ma.masked_array(COLORS, masks), band=1)
    assert alone["pixels"].tolist() == answer(np.ma.masked_array(BASE, masks[0]))["pixels"].tolist()


def test_rasterio_reads_masked_arrays_that_are_answered_like_their_file(tmp_path: Path) -> None:
    path = tmp_path / "holes.tif"
    with rasterio.open(path, "w", "GTiff", COLS, ROWS, 1, dtype="uint8", nodata=230, transform=PLACE) as file:
        file.write(BASE, 1)
    with rasterio.open(path) as file:
        for form in (file.read(masked=True), file.read(1, masked=True)):
            assert answer(form)["pixels"].tolist() == answer(path)["pixels"].tolist() == [512]


@pytest.mark.parametrize(
    "form",
    [
        lambda: BASE.copy(order="F"),
        lambda: np.repeat(BASE, 2, axis=1)[:, ::2],
        lambda: BASE.astype(">u2").astype("u1"),
        lambda: np.lib.stride_tricks.as_strided(BASE, writeable=False),
        lambda: BASE[None],
        lambda: BASE[:, :, None],
        lambda: __import__("pandas").DataFrame(BASE),
        lambda: __import__("dask.array").array.from_array(BASE, chunks=33),
        lambda: xarray.DataArray(BASE),
        lambda: xarray.Variable(("x", "y"), BASE.T),
    ],
    ids=[
        *("columns first", "strides", "cast", "read-only", "1 first", "1 last", "frame", "dask", "bare"),
        "Variable",
    ],
)
def test_an_array_is_the_same_however_it_is_held(form: Callable[[], Any]) -> None:
    found, wanted = answer(form()), answer(BASE)
    assert found.drop(columns="source").equals(wanted.drop(columns="source")) and len(found) == 2


@pytest.mark.parametrize("dtype", ["bool", "int8", ">u2", ">i4", "uint32", "float16", ">f4", "float64"])
def test_every_type_of_numbers_is_answered_like_its_file(dtype: str, expected: Any) -> None:
    pixels = (BASE // 2).astype(np.int16).astype(dtype) if dtype != "bool" else BASE > 150
    stored = pixels.astype(
        "f4" if dtype == "float16" else "u1" if dtype == "bool" else pixels.dtype.newbyteorder("=")
    )
    options = {"stretch": "minmax"}
    wanted = expected(stored, options=options, **({"nbits": 1} if dtype == "bool" else {}))
    found = answer(pixels, **options)
    assert found["pixels"].tolist() == wanted["pixels"].tolist() and len(found) > 0
    assert found["mean"].tolist() == pytest.approx(wanted["mean"].tolist(), rel=1e-12)
    same(answer(data_array(pixels), **options), wanted)


def test_bands_may_come_first_or_last(expected: Any) -> None:
    wanted = expected(COLORS)
    for form in (COLORS, np.moveaxis(COLORS, 0, -1), np.ascontiguousarray(np.moveaxis(COLORS, 0, -1))):
        found = answer(form)
        assert found["pixels"].tolist() == wanted["pixels"].tolist()
        assert answer(form, band=2)["pixels"].tolist() == answer(COLORS[1])["pixels"].tolist()


@pytest.mark.parametrize("shape", [(3, 90, 4), (16, 80, 16), (17, 80, 17), (90, 80, 20), (2, 3, 90, 80)])
def test_an_array_whose_bands_could_be_either_axis_is_refused(shape: tuple[int, ...]) -> None:
    with pytest.raises(ParameterError, match=r"bands"):
        uavseg.extract(np.zeros(shape, np.uint8), RANGE)


def test_a_picture_with_alpha_is_answered_like_its_file_and_says_so(expected: Any) -> None:
    alpha = np.where(HIDDEN, 0, 255).astype(np.uint8)
    picture = np.dstack([*COLORS, alpha])
    with pytest.warns(UserWarning, match="band 4 is taken for alpha"):
        found = uavseg.extract(picture, RANGE)
    wanted = expected(np.moveaxis(picture, -1, 0))
    assert found["pixels"].tolist() == wanted["pixels"].tolist()
    for form in (np.moveaxis(picture, -1, 0), data_array(np.moveaxis(picture, -1, 0))):
        with pytest.warns(UserWarning, match="does not say whether band 4 is alpha"):
            uavseg.extract(form, RANGE)


@pytest.mark.slow
def test_nodata_of_attributes_and_of_encodings_is_that_of_a_file(expected: Any) -> None:
    wanted = expected(nodata=200)
    same(answer(data_array().rio.write_nodata(200)), wanted)
    same(answer(data_array().assign_attrs(missing_value=200)), wanted)
    same(answer(data_array().rio.write_nodata(200, encoded=True)), wanted)
    same(answer(data_array(), nodata=200), wanted)
    assert len(answer(BASE, nodata=200)) == len(wanted) == 1
    floats = BASE.astype(np.float32)
    holes = np.where(BASE == 200, -9999, floats)
    wanted = expected(holes.astype(np.float32), nodata=-9999)
    with_holes = data_array(np.where(BASE == 200, np.nan, floats))
    same(answer(with_holes), wanted)
    with_holes.encoding["_FillValue"] = -9999.0
    same(answer(with_holes), wanted)
    filled = data_array(holes.astype(np.float32))
    filled.encoding["_FillValue"] = -9999.0
    same(answer(filled), wanted)
    same(answer(data_array(floats).where(data_array() != 200)), wanted)
    scaled = data_array(floats)  # 230 is a number of the file here, not one of the array
    scaled.encoding |= {"_FillValue": 230, "scale_factor": 0.5}
    same(answer(scaled), expected(floats))


def test_scales_may_be_those_of_each_band() -> None:
    listed = data_array(COLORS).assign_attrs(
        scales=(0.5, 2.0, 2.0), offsets=(0.0, 1.0, 1.0), units=("m", "K", "K")
    )
    for band, scale, offset, unit in ((1, 0.5, 0.0, "m"), (2, 2.0, 1.0, "K")):
        alone = data_array(COLORS[band - 1]).assign_attrs(scale_factor=scale, add_offset=offset, units=unit)
        found, wanted = answer(listed, band=band), answer(alone)
        assert len(found) == len(wanted) > 0 and found["unit"].tolist() == wanted["unit"].tolist() == [
            unit
        ] * len(found)
        assert found["mean_value"].tolist() == wanted["mean_value"].tolist()
    with pytest.warns(UserWarning, match="both are ignored"):
        uavseg.extract(data_array().assign_attrs(scale_factor="x"), RANGE)


REFUSED: dict[str, tuple[Callable[[], Any], str]] = {
    "uneven": (lambda: data_array().assign_coords(x=np.arange(COLS) ** 1.5), "x are not evenly spaced"),
    "a jump": (lambda: data_array()[np.r_[0:40, 60:96]], "y are not evenly spaced: steps are 0.5 to 10.5"),
    "one column off": (
        lambda: data_array().assign_coords(x=coordinates()["x"] + np.where(np.arange(COLS) == 111, 0.2, 0)),
        "not evenly spaced",
    ),
    "equal": (lambda: data_array().assign_coords(x=np.full(COLS, 5.0)), "neither rise nor fall"),
    "there and back": (lambda: data_array()[np.r_[0:96, 95]], "neither rise nor fall"),
    "NaN": (
        lambda: data_array().assign_coords(x=np.where(np.arange(COLS) == 3, np.nan, np.arange(COLS))),
        "1 of its 112 coordinates x are not finite",
    ),
    "infinite": (lambda: data_array().assign_coords(y=np.full(ROWS, np.inf)), "not finite"),
    "dates": (
        lambda: data_array().assign_coords(x=np.arange(COLS).astype("M8[D]").astype("M8[ns]")),
        "coordinates x are no numbers but datetime64",
    ),
    "texts": (lambda: data_array().assign_coords(x=list(map(str, range(COLS)))), "x are no numbers"),
    "padded by xarray": (lambda: data_array().pad(x=2), "4 of its 116 coordinates x are not finite"),
    "one of two coordinates": (lambda: data_array(kept=False).drop_vars("y"), "coordinates x and none y"),
    "pixels counted": (
        lambda: data_array().assign_coords(y=np.arange(ROWS), x=np.arange(COLS)),
        "its coordinates count pixels",
    ),
    "one row, no transform": (lambda: data_array(kept=False)[:1], "one coordinate y and no transform"),
    "one row of every second": (lambda: data_array()[:1, ::2], "its coordinates are others"),
    "a rotated transform": (
        lambda: data_array().rio.write_transform(PLACE @ Affine.rotation(30)),
        "its transform is rotated",
    ),
    "_FillValue of text": (
        lambda: data_array().assign_attrs(_FillValue="x"),
        "the nodata value that its attribute _FillValue says is not a number: 'x'",
    ),
    "two _FillValues": (lambda: data_array().assign_attrs(_FillValue=[1, 2]), "is not a number"),
    "times": (lambda: xarray.concat([data_array(), data_array()], "time"), "2 times along time"),
    "dates of bands": (
        lambda: xarray.concat([data_array(), data_array()], "day").assign_coords(
            day=np.array(["2026-01-01", "2026-02-01"], "M8[ns]")
        ),
        "2 times along day",
    ),
    "four dimensions": (
        lambda: data_array(COLORS).expand_dims({"time": 2}),
        r"must have dimensions \(rows, cols\) or .* not \(time: 2, band: 3, y: 96, x: 112\)",
    ),
    "two variables": (
        lambda: xarray.Dataset({"red": data_array(), "nir": data_array()}),
        r"must have one variable with rows and columns, not 2 \(red, nir\)",
    ),
    "no variable": (lambda: xarray.Dataset(), "not 0"),
    "unknown dimensions": (lambda: data_array().rename(y="v", x="u"), "not known which are rows and columns"),
    "a broken CRS": (
        lambda: data_array().assign_coords(spatial_ref=xarray.Variable((), 0, {"crs_wkt": "PROJCS[broken"})),
        "coordinate reference system cannot be read",
    ),
    "a broken transform": (
        lambda: data_array().assign_coords(spatial_ref=xarray.Variable((), 0, {"GeoTransform": "1 2 x"})),
        "its transform cannot be used",
    ),
    "complex": (lambda: data_array(BASE * 1j), "complex numbers"),
    "objects": (lambda: BASE.astype(object), "no numbers of a raster"),
    "texts as pixels": (lambda: BASE.astype(str), "no numbers of a raster"),
    "dates as pixels": (lambda: BASE.astype("M8[D]"), "no numbers of a raster"),
    "128 bits": (lambda: BASE.astype(np.longdouble), "at most 64 bits, got float128"),
    "records": (lambda: np.zeros((90, 90), [("a", "u1")]), "no numbers of a raster"),
    "no rows": (lambda: np.zeros((0, 90)), "no pixels"),
    "no dimension": (lambda: np.array(7), r"expected an array of \(rows, cols\)"),
    "a row": (lambda: BASE[0], r"expected an array of \(rows, cols\)"),
    "masked": (lambda: np.ma.masked, r"expected an array of \(rows, cols\)"),
    "numbers in lists": (lambda: BASE.tolist(), "source is a path, a list of paths, an array"),
    "arrays in a list": (lambda: [BASE, BASE], "no part of a mosaic"),
    "bare DataArrays in a list": (lambda: [xarray.DataArray(BASE)] * 2, "no part of a mosaic"),
    "more than memory": (lambda: np.broadcast_to(np.float32(7), (10**7, 10**7)), r"block map of [\d,]+ GB"),
    "lazy and broken": (
        lambda: data_array().chunk().map_blocks(lambda block: 1 / 0, template=data_array().chunk()),
        "cannot be read",
    ),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_cannot_be_answered_is_refused_in_a_sentence(name: str) -> None:
    source, refusal = REFUSED[name]
    with pytest.raises(UavsegError, match=refusal):
        answer(source())


@pytest.mark.parametrize("name", ["uneven", "complex", "a row", "two variables"])
@pytest.mark.parametrize(
    "call",
    [
        lambda source: uavseg.levels(source, 0.5),
        lambda source: uavseg.match(source, like=(5, 5, 3)),
        uavseg.suggest,
        uavseg.info,
        uavseg.divide,
        lambda source: uavseg.preview(source, "unused.png"),
        lambda source: uavseg.map_page(source, "unused.html"),
        uavseg.classify,
        lambda source: uavseg.path(source, (0, 1), start=(1, 1), goal=(5, 5)),
        uavseg.serve,
        lambda source: uavseg.plan(answer(data_array()), raster=source, altitude=50, home="auto"),
    ],
    ids=[
        "levels",
        "match",
        "suggest",
        "info",
        "divide",
        "preview",
        "map",
        "classify",
        "path",
        "serve",
        "plan",
    ],
)
def test_every_function_refuses_it_alike(
    call: Callable[[Any], Any], name: str, tmp_path: Path, monkeypatch: Any
) -> None:
    monkeypatch.chdir(tmp_path)
    source, refusal = REFUSED[name]
    with pytest.raises(UavsegError, match=refusal):
        call(source())
    assert not list(tmp_path.iterdir())


def test_a_nodata_value_that_no_pixel_can_have_is_ignored_as_in_a_file() -> None:
    with pytest.warns(UserWarning, match="nodata nan does not fit uint8 pixels"):
        found = uavseg.extract(data_array().assign_attrs(_FillValue=np.nan), RANGE)
    same(found, answer(data_array()))


def test_coordinates_count_where_the_transform_is_another_and_that_is_said() -> None:
    moved = data_array().assign_coords(x=coordinates()["x"] + 0.13)
    with pytest.warns(UserWarning, match="the coordinates are used"):
        found = uavseg.extract(moved, RANGE)
    assert found.total_bounds[0] == pytest.approx(answer(data_array()).total_bounds[0] + 0.13)


def test_coordinates_that_their_type_rounds_are_said_to() -> None:
    rounded = (4500000.5 - np.arange(ROWS)).astype(np.float32)
    with pytest.warns(UserWarning, match="rounds coordinates y by up to 0.25, "):
        uavseg.extract(data_array(kept=False).assign_coords(y=rounded), RANGE)


def test_a_rotated_array_lies_where_its_file_does(expected: Any, tmp_path: Path) -> None:
    place = PLACE @ Affine.rotation(30)
    wanted = expected(place=place)
    with rioxarray.open_rasterio(tmp_path / "same.tif") as array:
        assert "xc" in array.coords
        same(answer(array), wanted)
        with pytest.raises(RasterError, match="xc and yc are others"):
            answer(array.isel(x=slice(10, None)))


def test_what_rasterio_has_open_is_answered_like_its_file(expected: Any, tmp_path: Path) -> None:
    wanted = expected(mask=~HIDDEN, nodata=200)
    path = tmp_path / "same.tif"
    with rasterio.open(path) as file:
        same(answer(file), wanted)
        with WarpedVRT(file, crs="EPSG:3857", resolution=0.7) as warped:
            kept = {"transform": warped.transform, "crs": warped.crs}
            pixels, mask = warped.read(1), warped.read_masks(1)
            moved = answer(warped)
        with rasterio.open(tmp_path / "same.tif") as again, pytest.raises(ParameterError, match="to resume"):
            uavseg.extract(WarpedVRT(again), RANGE, resume=tmp_path / "kept")
    with MemoryFile(path.read_bytes()) as memory, memory.open() as file:
        same(answer(file), wanted)
    other = tmp_path / "other.tif"
    with rasterio.open(other, "w", "GTiff", *pixels.shape[::-1], 1, dtype="uint8", **kept) as file:
        file.write(pixels, 1)
        file.write_mask(mask)
    same(moved, answer(other))
    wanted = expected(nodata=200)
    with rasterio.open(path) as file, WarpedVRT(file) as warped:
        same(answer(warped), wanted)


def test_an_overview_that_is_open_is_that_overview(tmp_path: Path) -> None:
    path = tmp_path / "pyramid.tif"
    with rasterio.open(path, "w", "GTiff", COLS, ROWS, 1, dtype="uint8", crs=CRS, transform=PLACE) as file:
        file.write(BASE, 1)
        file.build_overviews([2], rasterio.enums.Resampling.nearest)
    with rasterio.open(path, OVERVIEW_LEVEL=0) as file:
        assert uavseg.info(file).rows == ROWS // 2


@pytest.mark.slow
def test_an_open_raster_is_read_by_threads_and_keeps_open(tmp_path: Path) -> None:
    path = tmp_path / "wide.tif"
    wide = np.tile(BASE, (4, 4))
    with rasterio.open(
        path, "w", "GTiff", 4 * COLS, 4 * ROWS, 1, dtype="uint8", crs=CRS, transform=PLACE
    ) as file:
        file.write(wide, 1)
    with rasterio.open(path) as file, WarpedVRT(file) as warped:
        same(uavseg.extract(warped, RANGE, threads=3, tile=64), uavseg.extract(path, RANGE))
        assert not warped.closed


def test_what_is_closed_or_written_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "tile.tif"
    with rasterio.open(path, "w", "GTiff", COLS, ROWS, 1, dtype="uint8", crs=CRS, transform=PLACE) as file:
        file.write(BASE, 1)
        with pytest.raises(ParameterError, match="open for writing"):
            uavseg.extract(file, RANGE)
    with pytest.raises(ParameterError, match="closed"):
        uavseg.extract(file, RANGE)
    with MemoryFile(path.read_bytes()) as memory, pytest.raises(ParameterError, match="open it"):
        uavseg.extract(memory, RANGE)


def test_a_mosaic_of_forms_is_that_of_files(expected: Any, tmp_path: Path) -> None:
    wanted = expected()
    with rasterio.open(tmp_path / "same.tif") as file, WarpedVRT(file) as warped:
        same(answer([data_array()[:, :48], warped]), wanted)


def shown_in(frame: Any) -> Any:
    """What a frame holds, without what differs between an array and a file."""
    return frame.drop(columns="source").to_json()


@pytest.mark.slow
@pytest.mark.parametrize(
    "call",
    [
        lambda source: shown_in(uavseg.levels(source, 0.5)),
        lambda source: shown_in(uavseg.match(source, like=(500028.0, 4499968.0, 8))),
        lambda source: [(one.low, one.high, one.pixels) for one in uavseg.suggest(source)],
        lambda source: uavseg.info(source).histogram,
        lambda source: uavseg.divide(source).sums.tolist(),
        lambda source: uavseg.preview(source, "found.png", overwrite=True).read_bytes(),
        lambda source: uavseg.map_page(source, "found.html", overwrite=True).read_bytes(),
        lambda source: uavseg.classify(source).states.tolist(),
        lambda source: uavseg.path(
            source, (0, 0.5), start=(500001, 4499999), goal=(500050, 4499996)
        ).xy.tolist(),
        lambda source: uavseg.plan(answer(data_array()), raster=source, altitude=50, home="auto").missions,
    ],
    ids=["levels", "match", "suggest", "info", "divide", "preview", "map", "classify", "path", "plan"],
)
@pytest.mark.filterwarnings("ignore::UserWarning")
def test_every_function_answers_it_like_its_file(
    call: Callable[[Any], Any], tmp_path: Path, monkeypatch: Any
) -> None:
    monkeypatch.chdir(tmp_path)
    how = {"dtype": "uint8", "crs": CRS, "transform": PLACE, "nodata": 200}
    with rasterio.open("same.tif", "w", "GTiff", COLS, ROWS, 1, **how) as file:
        file.write(BASE, 1)
    wanted = call("same.tif")
    array = data_array().rio.write_nodata(200).rename("same.tif").sortby("y").sortby("y", ascending=False)
    assert call(array.transpose("x", "y")) == wanted
    with rasterio.open("same.tif") as file, WarpedVRT(file) as warped:
        assert call(file) == wanted
        assert type(call(warped)) is type(wanted)
