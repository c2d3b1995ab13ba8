"""Real and unusual rasters: each gives a correct result or a one-line error.

The expected numbers of regions, warnings and errors were inspected by hand. Pixels, sums and labels are
checked against independent computations: rasterio, numpy and the slow reference implementation.
"""

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

import geopandas
import numpy as np
import pytest
import rasterio
import shapely
from click.testing import CliRunner, Result
from numpy.typing import NDArray

from uavseg.cli import main

Read = Callable[[Any], tuple[NDArray[Any], NDArray[np.bool_]]]
RANGE = (0.55, 1.0)
DAMAGED = "the file is damaged or incomplete"
LOCAL = "it has no coordinate reference system: coordinates are local"
PIXELS = "it has no place on the map (no geotransform): coordinates are pixels"
NOTHING = "no region has a mean v in 0.55..1"


@dataclass(frozen=True)
class Case:
    """Expected result: an error, or the number of regions (default, with scans, by the paper's method)."""

    regions: tuple[int, int, int] = (0, 0, 0)
    warnings: tuple[str, ...] = ()
    error: str = ""
    geojson_error: str = ""
    read: str = "one"
    stretch: str = "dtype"


CASES: dict[str, Case] = {
    "imagery/landsat8_greenland_B5.tif": Case((418, 288, 221), stretch="percentile"),
    "imagery/landsat_bahamas_RGB.byte.tif": Case((234, 160, 32), read="rgb"),
    "imagery/naip_forest_gap_1m.tif": Case((12, 7, 2), read="rgb"),
    "imagery/naip_potholes_2015.tif": Case((164, 159, 71), read="rgb"),
    "imagery/uav_forest_snow_clearing_mask.tif": Case((136, 183, 46), read="rgb"),
    "imagery/uav_pix4d_fields_alpha.tif": Case((69, 71, 8), read="rgb"),
    "dem/ny_dsm_2m.tif": Case((38, 19, 13), stretch="percentile"),
    "dem/olinda_dem_southern.tif": Case((4, 3, 2), stretch="percentile"),
    "odd/imagetiff_int8.tif": Case(warnings=(PIXELS, NOTHING)),
    "odd/imagetiff_miniswhite-1c-1b.tiff": Case((913, 42, 8), (PIXELS,), read="white is 0"),
    "odd/imagetiff_random-fp16-pred3.tiff": Case((1, 1, 1), (PIXELS,), stretch="percentile"),
    "odd/nodegdal_huge-sparse.tiff": Case(warnings=(PIXELS, "no pixel is valid", NOTHING), read="nothing"),
    "odd/nodegdal_sample_bigtiff.tif": Case(warnings=(PIXELS, NOTHING)),
    "odd/nodegdal_truncated.tiff": Case(error=DAMAGED),
    "odd/nodegdal_unsupported-srs.tif": Case((3, 1, 0), ("its coordinate reference system cannot be read",)),
    "odd/rasterio_RGBA.uint16.tif": Case(
        warnings=("finds one intensity, 10000", NOTHING), read="rgb", stretch="one"
    ),
    "odd/rasterio_all-nodata.tif": Case(warnings=("no pixel is valid", NOTHING), read="nothing"),
    "odd/rasterio_corrupt.tif": Case(error=DAMAGED),
    "odd/rasterio_float_nan.tif": Case((1, 1, 1), (LOCAL,), stretch="percentile"),
    "odd/rasterio_rotated.tif": Case((1, 0, 0), (LOCAL,)),
    "odd/riocogeo_image_colormap.tif": Case((150, 538, 47), ("the palette is expanded",), read="palette"),
    "odd/riotiler_cog_gcps.tif": Case(
        error="has ground control points and no geotransform; warp it first: gdalwarp"
    ),
    "odd/riotiler_cog_nonearth.tif": Case(
        (13, 18, 2), geojson_error="write a .gpkg instead", stretch="percentile"
    ),
    "odd/riotiler_inverted_lat.tif": Case(warnings=("no pixel is valid", NOTHING), read="nothing"),
    "labelled/cloud.tif": Case((31, 33, 17), read="rgb"),
    "labelled/pond0.tif": Case((127, 75, 21)),
    "labelled/pond1.tif": Case((32, 26, 9)),
    "labelled/pond2.tif": Case((57, 46, 13)),
    "labelled/pond3.tif": Case((78, 71, 13)),
    **{f"labelled/{name}_truth.tif": Case() for name in ("cloud", "pond0", "pond1", "pond2", "pond3")},
}
SETS = tuple(f"labelled/{kind}" for kind in ("crack", "crop", "flood", "mine", "town"))  # for benchmarks
SETS += ("maps/",)
SETTINGS = {
    "default": [],
    "scan": ["--refine", "scan"],
    "paper": ["--refine", "none", "--method", "paper"],
}

pytestmark = [
    pytest.mark.slow,
    pytest.mark.filterwarnings("ignore::rasterio.errors.NotGeoreferencedWarning"),
]


def raster_of(shared_data: Path, name: str) -> Path:
    path = shared_data / name
    if not path.exists():
        pytest.skip(f"{name} is not in the folder of real rasters")
    return path


def run(*arguments: object) -> Result:
    return CliRunner().invoke(main, ["extract", *map(str, arguments)])


def warnings_of(result: Result) -> list[str]:
    prefix = "uavseg: warning: "
    return [line.removeprefix(prefix) for line in result.stderr.splitlines() if line.startswith(prefix)]


# Independent reading of the pixels


def luminance(red: NDArray[Any], green: NDArray[Any], blue: NDArray[Any]) -> NDArray[Any]:
    return 0.2126 * red.astype(float) + 0.7152 * green.astype(float) + 0.0722 * blue.astype(float)


def read_one(file: Any) -> tuple[NDArray[Any], NDArray[np.bool_]]:
    values = file.read(1).astype(float)
    return values, (file.read_masks(1) > 0) & np.isfinite(values)


def read_rgb(file: Any) -> tuple[NDArray[Any], NDArray[np.bool_]]:
    colors = [color.name for color in file.colorinterp]
    named = {"red", "green", "blue"} <= set(colors)
    bands = [colors.index(color) + 1 for color in ("red", "green", "blue")] if named else [1, 2, 3]
    planes = [file.read(band) for band in bands]
    return luminance(*planes), file.dataset_mask() > 0


def read_palette(file: Any) -> tuple[NDArray[Any], NDArray[np.bool_]]:
    colors = file.colormap(1)
    table = np.array([colors.get(k, (0, 0, 0, 0)) for k in range(256)])[file.read(1)]
    return luminance(*np.moveaxis(table[..., :3], 2, 0)), table[..., 3] > 0


def read_white_is_0(file: Any) -> tuple[NDArray[Any], NDArray[np.bool_]]:
    values = file.read(1).astype(float)
    return 255 * (1 - values), np.ones(values.shape, bool)


READERS: dict[str, Read] = {
    "one": read_one,
    "rgb": read_rgb,
    "palette": read_palette,
    "white is 0": read_white_is_0,
}


def limits(values: NDArray[Any], valid: NDArray[np.bool_], file: Any, stretch: str) -> tuple[float, float]:
    """Limits of the stretch: the range of the type, or nearest ranks at 2 and 98 percent."""
    if stretch == "dtype":
        return 0, 127 if file.dtypes[0] == "int8" else 255
    ordered = np.sort(values[valid])
    return tuple(float(ordered[-(-percent * len(ordered) // 100) - 1]) for percent in (2, 98))  # type: ignore[return-value]


def grey(path: Path, case: Case) -> tuple[NDArray[np.uint16], NDArray[np.bool_]]:
    with warnings.catch_warnings(action="ignore"), rasterio.open(path) as file:
        values, valid = READERS[case.read](file)
        if case.stretch == "one":
            return np.full(values.shape, 32768, np.uint16), valid
        low, high = limits(values, valid, file, case.stretch)
    v = np.clip((np.where(valid, values, low) - low) / (high - low), 0, 1)
    g = np.floor(65535 * v + 0.5)
    first = np.ceil(65535 * RANGE[0])  # values decide at the end of the range, not their rounded greys
    above = np.float32(values) >= np.float32(low + RANGE[0] * (high - low))
    g = np.where((g == first) & ~above, first - 1, np.where((g == first - 1) & above, first, g))
    return np.where(valid, g, 0).astype(np.uint16), valid


def labels_of_reference(
    reference: ModuleType, plain: ModuleType, g: NDArray[np.uint16], valid: NDArray[np.bool_], setting: str
) -> NDArray[np.uint32]:
    if setting == "default":
        return np.asarray(reference.components(plain.refine(valid.astype(np.uint8), g, *RANGE) > 0))
    leaves = reference.divide(g, valid, 1.2, None if setting == "paper" else 0.05)
    cells = reference.classify_cells(leaves, g.shape, lambda op: int(RANGE[0] <= op <= RANGE[1]))
    if setting == "paper":
        labels = reference.by_size(reference.pixels(reference.connected(cells), valid))
    else:
        mask = reference.in_range(leaves, g.shape, valid, *RANGE)
        labels = reference.components(reference.refine_scan_by_lines(mask, g, valid, *RANGE))
    return np.asarray(labels)


# Every raster


def test_every_raster_has_an_expected_result(shared_data: Path) -> None:
    found = {
        f"{p.parent.name}/{p.name}" for p in shared_data.rglob("*.tif*") if p.suffix in (".tif", ".tiff")
    }
    found = {name for name in found if not name.startswith(SETS)}
    assert found <= set(CASES), "rasters without an expected result: inspect them and add one"


@pytest.mark.parametrize(
    ("name", "setting"),
    [  # of the other settings, each is checked on a third of the rasters
        pytest.param(name, setting, marks=pytest.mark.thorough if k and (n + k) % 3 else [])
        for n, name in enumerate(CASES)
        for k, setting in enumerate(SETTINGS)
    ],
)
def test_a_raster_gives_a_correct_result_or_a_one_line_error(
    shared_data: Path,
    reference: ModuleType,
    plain_variation: ModuleType,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    name: str,
    setting: str,
) -> None:
    path, case = raster_of(shared_data, name), CASES[name]
    monkeypatch.chdir(tmp_path)
    output = "out.geojson" if setting == "default" and not case.geojson_error else "out.gpkg"
    labelled = [] if case.read == "nothing" else ["--labels", "labels.tif"]
    result = run(path, "--range", "0.55,1", *SETTINGS[setting], "-o", output, *labelled)
    if case.error:
        assert_refused(result, case.error)
        return
    assert result.exit_code == 0, result.output
    count = case.regions[list(SETTINGS).index(setting)]
    expected = [*case.warnings, *([NOTHING] if count == 0 and NOTHING not in case.warnings else [])]
    assert len(warnings_of(result)) == len(expected)
    assert all(part in line for part, line in zip(expected, warnings_of(result), strict=True))
    frame = geopandas.read_file(output)
    assert len(frame) == count
    if case.read == "nothing":
        return
    with rasterio.open("labels.tif") as file:
        labels = file.read(1)
    assert labels.max() == count
    g, valid = grey(path, case)
    if count:
        assert_regions(frame, labels)
        assert_means(frame, labels, g, valid)
    assert np.array_equal(labels, labels_of_reference(reference, plain_variation, g, valid, setting))


def assert_refused(result: Result, message: str) -> None:
    assert result.exit_code == 1 and result.stdout == "", result.output
    assert result.stderr.startswith("uavseg: error: ") and len(result.stderr.splitlines()) == 1
    assert message in result.stderr
    assert list(Path().iterdir()) == []


def assert_regions(frame: geopandas.GeoDataFrame, labels: NDArray[np.uint32]) -> None:
    """Outlines are valid and match the labels; all attributes are finite."""
    assert list(frame["id"]) == list(range(1, len(frame) + 1))
    assert list(frame["pixels"]) == np.bincount(labels.reshape(-1))[1:].tolist()
    assert frame.is_valid.all() and (shapely.area(frame.geometry.to_numpy()) > 0).all()
    for column in ("area_m2", "perimeter_m", "mean", "std"):
        assert np.isfinite(frame[column]).all()
    assert (frame["area_m2"] > 0).all()


def assert_means(
    frame: geopandas.GeoDataFrame, labels: NDArray[np.uint32], g: NDArray[np.uint16], valid: NDArray[np.bool_]
) -> None:
    assert not labels[~valid].any()
    counts = np.bincount(labels.reshape(-1), minlength=len(frame) + 1)[1:]
    v = (g / 65535).reshape(-1)
    mean = np.bincount(labels.reshape(-1), v, len(frame) + 1)[1:] / counts
    squares = np.bincount(labels.reshape(-1), v * v, len(frame) + 1)[1:] / counts
    deviation = np.sqrt(np.maximum(squares - mean**2, 0))
    assert frame["mean"].to_numpy() == pytest.approx(mean, abs=2e-6)
    assert frame["std"].to_numpy() == pytest.approx(deviation, abs=2e-5)


# Special cases


@pytest.mark.parametrize("name", [name for name, case in CASES.items() if case.geojson_error])
def test_a_raster_outside_the_earth_cannot_be_written_as_geojson(
    shared_data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    monkeypatch.chdir(tmp_path)
    assert_refused(run(raster_of(shared_data, name), "--range", "0.55,1"), CASES[name].geojson_error)


@pytest.mark.parametrize("name", [name for name in CASES if name.startswith("imagery/")])
def test_regions_of_imagery_have_correct_coordinates_and_areas(
    shared_data: Path, tmp_path: Path, name: str
) -> None:
    path, output = raster_of(shared_data, name), tmp_path / "out.gpkg"
    assert run(path, "--range", "0.55,1", "-o", output, "-q").exit_code == 0
    frame = geopandas.read_file(output)
    with rasterio.open(path) as file:
        assert frame.crs == file.crs
        assert shapely.box(*file.bounds).buffer(1e-6 * file.width).contains(shapely.box(*frame.total_bounds))
        pixel = abs(file.transform.determinant)
    assert frame.area.to_numpy() == pytest.approx(pixel * frame["pixels"].to_numpy())
    points = geopandas.points_from_xy(frame["lon"], frame["lat"], crs=4326).to_crs(frame.crs)
    assert frame.contains(geopandas.GeoSeries(points)).all()
    geodesic = frame.to_crs(4326).geometry.map(geodesic_area).abs()
    assert frame["area_m2"].to_numpy() == pytest.approx(geodesic.to_numpy(), rel=1e-4)


def geodesic_area(polygon: Any) -> float:
    """Geodesic area on the ellipsoid, in m²."""
    import pyproj

    area: float = pyproj.Geod(ellps="WGS84").geometry_area_perimeter(polygon)[0]
    return area


def test_bright_snow_is_extracted_and_dark_forest_is_not(shared_data: Path, tmp_path: Path) -> None:
    """The snow clearing is one region of about a third of the image; the rest is mostly dark."""
    path = raster_of(shared_data, "imagery/uav_forest_snow_clearing_mask.tif")
    assert (
        run(path, "--range", "0.55,1", "-o", tmp_path / "a.gpkg", "--labels", tmp_path / "a.tif").exit_code
        == 0
    )
    with rasterio.open(tmp_path / "a.tif") as file:
        labels = file.read(1)
    g, valid = grey(path, CASES["imagery/uav_forest_snow_clearing_mask.tif"])
    assert 0.25 < (labels == 1).mean() < 0.35
    bright = g / 65535 >= 0.55
    assert bright[labels > 0].mean() > 0.85 and bright[(labels == 0) & valid].mean() < 0.06
