"""The page of `uavseg map` as a file: what is inlined, what it allows, and what is refused."""

import base64
import hashlib
import html
import json
import re
import zlib
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import geopandas
import numpy as np
import pytest
import rasterio
import shapely
from affine import Affine
from click.testing import CliRunner
from hypothesis import given, strategies as st
from pyproj import Geod
from rasterio.crs import CRS

import uavseg
from uavseg.cli import main
from uavseg.errors import OutputError, ParameterError, RasterError
from uavseg.jobs.result.result import SourceInfo
from uavseg.plot.web.field_map import DEFAULT_RANGE, first_range, read_collection, render_page
from uavseg.raster.grid.geobox import GeoBox
from uavseg.raster.grid.ground import ground_grid
from uavseg.raster.intensity.stretch import Stretch

SAMPLE = Path(uavseg.__file__).parents[1] / "samples" / "quarry.tif"
LEAFLET = Path(uavseg.__file__).parent / "plot" / "web" / "assets" / "leaflet"
RELEASED = {  # SHA-256 of the files of leaflet-1.9.4.tgz of the npm registry
    "leaflet.js": "db49d009c841f5ca34a888c96511ae936fd9f5533e90d8b2c4d57596f4e5641a",
    "leaflet.css": "a7837102824184820dfa198d1ebcd109ff6d0ff9a2672a074b9a1b4d147d04c6",
    "layers.png": "1dbbe9d028e292f36fcba8f8b3a28d5e8932754fc2215b9ac69e4cdecf5107c6",
    "layers-2x.png": "066daca850d8ffbef007af00b06eac0015728dee279c51f3cb6c716df7c42edf",
    "LICENSE": "53e8dc25862014e4324741ca18fbe3611e11d42ef69f59f86ea8c5389647d4cb",
}


class Elements(HTMLParser):
    """The elements of a page with their attributes, and the text of each script and style."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.found: list[tuple[str, dict[str, str | None]]] = []
        self.texts: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.found.append((tag, dict(attrs)))
        self.texts.append("")

    def handle_endtag(self, tag: str) -> None:
        self.handle_starttag(f"/{tag}", [])  # text that follows is not the element's

    def handle_data(self, data: str) -> None:
        if self.texts:
            self.texts[-1] += data

    def text(self, tag: str, **attributes: str) -> str:
        [text] = [
            text
            for (name, own), text in zip(self.found, self.texts, strict=True)
            if name == tag and own == attributes
        ]
        return text


def write_raster(path: Path, crs: str | None, transform: Affine) -> Path:
    how = {"driver": "GTiff", "height": 64, "width": 128, "count": 1, "dtype": "uint8"}
    with rasterio.open(path, "w", **how, crs=crs, transform=transform) as file:
        file.write(np.arange(64 * 128, dtype=np.uint8).reshape(1, 64, 128))
    return path


def data_of_page(path: Path) -> Any:
    [data] = re.findall(r'id="data">(.*?)</script>', path.read_text(encoding="utf-8"), re.DOTALL)
    return json.loads(data)


def squares(rows: int, cols: int) -> geopandas.GeoDataFrame:
    """Many small regions, over the sample."""
    boxes = [shapely.box(x, y, x + 2, y + 2) for y in range(rows) for x in range(0, 5 * cols, 5)]
    places = [shapely.affinity.translate(one, 512345, 5478345) for one in boxes]
    return geopandas.GeoDataFrame({"id": range(1, len(places) + 1)}, geometry=places, crs=32610)


@pytest.mark.slow
def test_large_regions_are_packed_and_small_ones_are_not(tmp_path: Path) -> None:
    for count, is_packed in ((10, False), (100, True)):
        regions, path = squares(count, count), tmp_path / f"{count}.html"
        uavseg.map_page(SAMPLE, path, regions=regions)
        found = data_of_page(path)["regions"]
        assert (list(found) == ["packed"]) == is_packed
        if is_packed:
            text = zlib.decompress(base64.b64decode(found["packed"]))
            assert len(found["packed"]) < len(text) / 4
            found = json.loads(text)
        assert [one["properties"]["id"] for one in found["features"]] == regions.id.tolist()
        read = geopandas.GeoDataFrame.from_features(found, crs=4326).to_crs(32610)
        assert read.symmetric_difference(regions, align=False).area.max() < 0.01


def test_leaflet_is_the_released_one_with_its_licence() -> None:
    found = {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in LEAFLET.iterdir()}
    assert found == RELEASED


@given(st.text(), st.text())
def test_no_text_becomes_markup(title: str, value: str) -> None:
    title, value = (f"</script><!--<script>{text}</title><img src=x>" for text in (title, value))
    plain, page = (
        render_page("t", {}).decode(),
        render_page(title.replace("\r", ""), {value: [value]}).decode(),
    )
    assert [tag for tag, _ in Elements(page).found] == [tag for tag, _ in Elements(plain).found]
    [data] = re.findall(r'<script type="application/json" id="data">(.*?)</script>', page, re.DOTALL)
    assert json.loads(data) == {value: [value]}
    assert "<" not in data


def test_only_the_pages_own_script_may_run_and_nothing_is_loaded() -> None:
    page = Elements(render_page("t", {}).decode())
    [policy] = [own["content"] for _, own in page.found if own.get("http-equiv") == "Content-Security-Policy"]
    assert policy is not None
    rules = dict(rule.strip().split(" ", 1) for rule in html.unescape(policy).split(";"))
    for name, text in (("script-src", page.text("script")), ("style-src", page.text("style"))):
        own = base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
        assert rules.pop(name) == f"'sha256-{own}'"
    assert rules == {
        "default-src": "'none'",
        "worker-src": "blob:",  # which only the page's own script can make
        "img-src": "data:",
        "base-uri": "'none'",
        "form-action": "'none'",
    }
    assert not any({"src", "href"} & set(own) for _, own in page.found)
    assert "url(images" not in page.text("style")
    assert "sourceMappingURL" not in page.text("script")


def test_the_licence_is_in_the_page() -> None:
    assert "Redistributions in binary form must reproduce" in render_page("t", {}).decode()


@pytest.mark.slow
def test_the_same_input_gives_the_same_bytes_from_both_faces(tmp_path: Path) -> None:
    regions, mission = tmp_path / "r.gpkg", tmp_path / "m.plan"
    run = CliRunner()
    extract = ["extract", str(SAMPLE), "--range", "0.55,1", "--min-area", "200", "-o", str(regions), "-q"]
    assert run.invoke(main, extract).exit_code == 0
    plan = ["plan", str(regions), "--home", "auto", "--altitude", "60", "-o", str(mission), "-q"]
    assert run.invoke(main, plan).exit_code == 0
    words = ["map", str(SAMPLE), "--regions", str(regions), "--mission", str(mission), "--size", "300", "-q"]
    for name in ("a.html", "b.html"):
        assert run.invoke(main, [*words, "-o", str(tmp_path / name)]).exit_code == 0
    uavseg.map_page(SAMPLE, tmp_path / "c.html", regions=regions, mission=mission, size=300)
    first, second, third = ((tmp_path / f"{name}.html").read_bytes() for name in "abc")
    assert first == second == third
    assert len(first) < 1_000_000


def test_regions_keep_their_shape_and_attributes() -> None:
    regions = uavseg.extract(SAMPLE, (0.55, 1), min_area=200)
    found = geopandas.GeoDataFrame.from_features(read_collection(regions), crs=4326).to_crs(regions.crs)
    assert (found.symmetric_difference(regions).area < 0.02 * regions.length).all()
    assert list(found["pixels"]) == list(regions["pixels"])
    np.testing.assert_allclose(found["mean"].astype(float), regions["mean"].astype(float), 1e-11)


@pytest.mark.parametrize("angle", [0, 30])
def test_the_picture_lies_where_the_raster_lies(angle: float, tmp_path: Path) -> None:
    transform = Affine.translation(5e5, 5e6) * Affine.rotation(angle) * Affine.scale(2, -2)
    raster = write_raster(tmp_path / "x.tif", "EPSG:32633", transform)
    uavseg.map_page(raster, tmp_path / "x.html")
    found = data_of_page(tmp_path / "x.html")["image"]["bounds"]
    corners = [transform * place for place in ((0, 0), (128, 0), (0, 64), (128, 64))]
    outline = geopandas.GeoSeries([shapely.MultiPoint(corners)], crs=32633).to_crs(4326)
    np.testing.assert_allclose(found, outline.total_bounds, rtol=0, atol=1e-6)


def collection(*ranges: tuple[Any, Any]) -> dict[str, Any]:
    return {"features": [{"properties": {"range_low": low, "range_high": high}} for low, high in ranges]}


SHOWN = SourceInfo(
    "x.tif", GeoBox((64, 64), Affine.identity(), None), Stretch(0, 255, "dtype"), "band 1", (), False
)


@pytest.mark.parametrize(
    ("regions", "steps"),
    [
        (collection((0.4, 0.7), (0.4, 0.7)), (400, 700)),
        (collection((0.12345, 0.1239)), (123, 124)),
        (collection((1.0, 1.0)), (999, 1000)),
        (collection((0.4, 0.7), (0.7, 0.9)), DEFAULT_RANGE),
        (collection((None, None)), DEFAULT_RANGE),
        (collection(("0.4", True)), DEFAULT_RANGE),
        (collection((-3, 0.5)), DEFAULT_RANGE),
        (collection(), DEFAULT_RANGE),
        (None, DEFAULT_RANGE),
    ],
)
def test_the_slider_begins_with_the_range_that_all_regions_have(
    regions: dict[str, Any] | None, steps: tuple[int, int]
) -> None:
    assert first_range(regions, SHOWN) == steps


FOUR = {
    "red": (40, 60),
    "green": (200, 40),
    "blue": (50, 50),
    "nir": (20, 60),
}  # inside, around


def write_bands(path: Path) -> Path:
    planes = np.empty((4, 128, 192), np.uint8)
    for plane, (inside, around) in zip(planes, FOUR.values(), strict=True):
        plane[:] = around + np.arange(128)[:, None] % 7
        plane[32:96, 64:128] = inside
    how = {"driver": "GTiff", "height": 128, "width": 192, "count": 4, "dtype": "uint8"}
    with rasterio.open(path, "w", **how, crs="EPSG:32633", transform=Affine(2, 0, 5e5, 0, -2, 5e6)) as file:
        file.write(planes)
        file.descriptions = tuple(FOUR)
    return path


READINGS: dict[str, dict[str, Any]] = {
    "an index": {"index": "ndwi"},
    "an expression": {"expr": "green / (red + 1)"},
    "names of bands": {"expr": "g - n", "band_names": "r,g,b,n"},
    "a band": {"band": 2},
    "three bands": {"rgb": (2, 2, 4)},
    "a stretch": {"stretch": "percentile:5,90"},
    "an index and a stretch": {"index": "ndwi", "stretch": "-0.5,1"},
    "nodata": {"band": 2, "nodata": 41},
}


def _text(value: Any) -> str:
    return ",".join(map(str, value)) if isinstance(value, tuple) else str(value)


@pytest.mark.parametrize("kind", ["frame", pytest.param("geojson", marks=pytest.mark.slow), "gpkg"])
@pytest.mark.parametrize("name", READINGS)
def test_the_slider_shows_the_intensity_of_the_regions(name: str, kind: str, tmp_path: Path) -> None:
    reading, raster = READINGS[name], write_bands(tmp_path / "x.tif")
    if kind == "frame":
        regions: Any = uavseg.extract(raster, (0.65, 1), **reading)
    else:
        regions = tmp_path / f"r.{kind}"
        words = [f"--{word.replace('_', '-')}={_text(value)}" for word, value in reading.items()]
        line = ["extract", str(raster), "--range", "0.65,1", "-o", str(regions), *words]
        assert CliRunner().invoke(main, line).exit_code == 0
    uavseg.map_page(raster, tmp_path / "a.html", regions=regions, **reading)
    uavseg.map_page(raster, tmp_path / "b.html", regions=regions)
    chosen, found = (data_of_page(tmp_path / f"{page}.html") for page in "ab")
    assert found["cells"] == chosen["cells"]
    assert found["range"] == [650, 1000]


def test_another_intensity_than_that_of_the_regions_is_said(tmp_path: Path) -> None:
    raster, other = write_bands(tmp_path / "x.tif"), write_bands(tmp_path / "y.tif")
    regions = uavseg.extract(raster, (0.7, 1), index="ndwi")
    for source, chosen in ((raster, {"band": 1}), (raster, {"stretch": "0,100"}), (other, {})):
        with pytest.warns(UserWarning, match="made from ndwi .*; the slider shows .* means something else"):
            uavseg.map_page(source, tmp_path / "x.html", regions=regions, overwrite=True, **chosen)
        assert data_of_page(tmp_path / "x.html")["range"] == list(DEFAULT_RANGE)


REFUSED = {
    "no CRS": (None, Affine(2, 0, 0, 0, -2, 0), "no coordinate system"),
    "pole": ("EPSG:3413", Affine(10, 0, -640, 0, -10, 320), "degrees of latitude"),
    "antimeridian": ("EPSG:32601", Affine(1000, 0, 250000, 0, -1000, 6e6), "antimeridian"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_no_web_map_can_show_is_refused(name: str, tmp_path: Path) -> None:
    crs, transform, words = REFUSED[name]
    raster = write_raster(tmp_path / "x.tif", crs, transform)
    with pytest.raises(RasterError, match=words):
        uavseg.map_page(raster, tmp_path / "x.html")
    assert not (tmp_path / "x.html").exists()


def test_names_and_sizes_are_checked_before_the_work(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match=r"ends in \.html"):
        uavseg.map_page(SAMPLE, tmp_path / "x.png")
    with pytest.raises(ParameterError, match="64 to 8192"):
        uavseg.map_page(SAMPLE, tmp_path / "x.html", size=10)
    (tmp_path / "x.html").write_text("mine")
    with pytest.raises(OutputError):
        uavseg.map_page(SAMPLE, tmp_path / "x.html")
    assert (tmp_path / "x.html").read_text() == "mine"


def test_the_table_of_places_is_exact_between_its_places_and_its_areas_add_up() -> None:
    box = GeoBox((4000, 6000), Affine(5e-4, 0, 10, 0, -5e-4, 60), CRS.from_epsg(4326))
    table = ground_grid(box)
    rows, cols = np.meshgrid(*(np.linspace(0, length, 5) for length in box.shape), indexing="ij")
    lon, lat = box.lonlat_from_xy(*box.xy_from_pixel(rows, cols))
    step = (len(table.lon) - 1) // 4
    np.testing.assert_allclose(table.lon[::step, ::step], lon, rtol=0, atol=1e-9)
    np.testing.assert_allclose(table.lat[::step, ::step], lat, rtol=0, atol=1e-9)
    ends = Geod(ellps="WGS84").geometry_area_perimeter(shapely.segmentize(shapely.box(10, 58, 13, 60), 0.01))
    pixels = box.shape[0] * box.shape[1]
    assert table.pixel_m2.mean() * pixels == pytest.approx(abs(ends[0]), rel=1e-4)
    assert np.abs(np.diff(table.pixel_m2, axis=0)).max() <= 1e-3 * table.pixel_m2.min()
