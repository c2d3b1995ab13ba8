"""Creation options of GeoTIFF: the same pixels whatever is chosen, and nothing that is not listed."""

import numpy as np
import pytest
import rasterio
from affine import Affine
from hypothesis import given, strategies as st

from uavseg.errors import ParameterError
from uavseg.raster.formats.creation import CreationOptions, creation_for
from uavseg.raster.formats.geotiff import (
    LabelBand,
    Page,
    read_geotiff,
    write_geotiff_pages,
    write_label_geotiff,
)
from uavseg.raster.grid.geobox import GeoBox
from uavseg.raster.grid.tiling import Window

SHAPE = (70, 300)
BOX = GeoBox(SHAPE, Affine(0.5, 0, 4e5, 0, -0.5, 5e6), None)
LEVELS = {"DEFLATE": ("ZLEVEL", 9), "ZSTD": ("ZSTD_LEVEL", 22)}


@st.composite
def allowed(draw, floats):
    """Words of allowed options."""
    compress = draw(st.sampled_from(["NONE", "DEFLATE", "LZW", "ZSTD", "LZMA", "PACKBITS"]))
    words = {"COMPRESS": compress}
    if compress in LEVELS and draw(st.booleans()):
        name, most = LEVELS[compress]
        words[name] = draw(st.integers(1, min(most, 12)))
    if compress in ("DEFLATE", "LZW", "ZSTD"):
        words["PREDICTOR"] = draw(st.integers(1, 3 if floats else 2))
    words["BIGTIFF"] = draw(st.sampled_from(["YES", "NO", "IF_NEEDED", "IF_SAFER"]))
    return words


def bytes_of(path):
    return path.read_bytes()[2:4]  # 42, and 43 for a BigTIFF, in little endian


@pytest.mark.slow
@given(allowed(floats=False), st.sampled_from(["uint8", "uint32"]), st.integers(0, 9))
def test_labels_are_the_same_whatever_is_chosen(tmp_path_factory, words, dtype, seed):
    path = tmp_path_factory.mktemp("labels") / "a.tif"
    image = np.random.default_rng(seed).integers(0, 200, SHAPE).astype(dtype)
    creation = CreationOptions.of(words)
    write_label_geotiff(path, [(Window(0, 0, *SHAPE), image)], BOX, band=LabelBand(dtype), creation=creation)
    with rasterio.open(path) as file:
        assert np.array_equal(file.read(1), image) and file.nodata == 0
        names = {"NONE": None, "DEFLATE": "DEFLATE", "LZW": "LZW"} | {
            name: name for name in ("ZSTD", "LZMA", "PACKBITS")
        }
        structure = file.tags(ns="IMAGE_STRUCTURE")
        assert structure.get("COMPRESSION") == names[words["COMPRESS"]]
        assert structure.get("PREDICTOR", "1") == str(words.get("PREDICTOR", 1))
    assert bytes_of(path) == (b"\x2b\x00" if words["BIGTIFF"] == "YES" else b"\x2a\x00")


@pytest.mark.slow
@given(allowed(floats=True), st.integers(0, 9))
def test_pages_of_floats_are_the_same_to_the_bit(tmp_path_factory, words, seed):
    path = tmp_path_factory.mktemp("pages") / "a.tif"
    values = np.random.default_rng(seed).normal(0, 1e9, SHAPE).astype(np.float32)
    values[3, 5:9] = np.nan, np.inf, -0.0, 1e-42
    pages = [Page([values], BOX, ["a"], float("nan")), Page([values.astype(float), values], BOX, ["b", "c"])]
    write_geotiff_pages(path, pages, {"tag": "x"}, creation=CreationOptions.of(words))
    first, _, names, tags = read_geotiff(path)
    second = read_geotiff(path, 2)[0]
    assert first.tobytes() == values.tobytes() and (names, tags["tag"]) == (["a"], "x")
    assert second.tobytes() == np.stack([values.astype(float)] * 2).tobytes()


@pytest.mark.slow
def test_levels_reach_gdal(tmp_path):
    image = np.random.default_rng(1).integers(0, 9, (256, 256)).astype(np.uint32)
    sizes = {}
    for name, words in {
        "none": ["COMPRESS=NONE"],
        "fast": ["ZLEVEL=1"],
        "small": ["ZLEVEL=9"],
        "zstd fast": ["COMPRESS=ZSTD", "ZSTD_LEVEL=1"],
        "zstd small": ["COMPRESS=ZSTD", "ZSTD_LEVEL=19"],
    }.items():
        path = tmp_path / f"{name}.tif"
        box = GeoBox((256, 256), BOX.transform, None)
        tiles = [(Window(0, 0, 256, 256), image)]
        write_label_geotiff(path, tiles, box, creation=CreationOptions.of(words))
        sizes[name] = path.stat().st_size
    assert sizes["none"] > sizes["fast"] > sizes["small"]
    assert sizes["zstd fast"] > sizes["zstd small"]


def test_no_words_are_the_defaults():
    assert CreationOptions.of(None) == CreationOptions.of([]) == CreationOptions()
    assert CreationOptions.of(["compress=deflate", " Predictor = 1 "]) == CreationOptions()


def test_words_are_texts_or_a_mapping_in_any_case():
    requested = CreationOptions.of({"compress": "zstd", "ZSTD_LEVEL": 3, "Predictor": 2, "bigtiff": "yes"})
    assert requested == CreationOptions.of(["COMPRESS=ZSTD", "zstd_level=3", "PREDICTOR=2", "BIGTIFF=YES"])
    assert requested == CreationOptions("ZSTD", 3, 2, "YES")


ALLOWED = "ZLEVEL=1..9, ZSTD_LEVEL=1..22, PREDICTOR=1|2|3 and BIGTIFF=YES|NO|IF_NEEDED|IF_SAFER"
LOSSLESS = "NONE, DEFLATE, LZW, PACKBITS, ZSTD and LZMA"


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (["JPEG_QUALITY=50"], ALLOWED),
        (["TILED=NO"], ALLOWED),
        (["DISCARD_LSB=3"], ALLOWED),
        (["NUM_THREADS=4"], ALLOWED),
        ([""], ALLOWED),
        (["=ZSTD"], ALLOWED),
        ("COMPRESS=ZSTD", ALLOWED),
        (["COMPRESS=JPEG"], LOSSLESS),
        (["COMPRESS=LERC_ZSTD"], LOSSLESS),
        (["COMPRESS=WEBP"], LOSSLESS),
        (["COMPRESS"], LOSSLESS),
        (["COMPRESS="], LOSSLESS),
        ({"COMPRESS": None}, "the value of COMPRESS is a text or an integer, not None"),
        (["COMPRESS=LZW", "compress=LZW"], "COMPRESS is given twice"),
        (["ZLEVEL=0"], "expected ZLEVEL=1..9, got '0'"),
        (["ZLEVEL=10"], "expected ZLEVEL=1..9"),
        (["ZLEVEL=-1"], "expected ZLEVEL=1..9"),
        (["ZLEVEL=²"], "expected ZLEVEL=1..9"),
        ({"ZLEVEL": 6.0}, "the value of ZLEVEL is a text or an integer, not 6.0"),
        ({"PREDICTOR": True}, "not True"),
        (["COMPRESS=ZSTD", "ZSTD_LEVEL=23"], "expected ZSTD_LEVEL=1..22"),
        (["ZSTD_LEVEL=3"], "ZSTD_LEVEL is for COMPRESS=ZSTD, not for DEFLATE"),
        (["COMPRESS=LZW", "ZLEVEL=3"], "ZLEVEL is for COMPRESS=DEFLATE, not for LZW"),
        (["COMPRESS=NONE", "PREDICTOR=2"], "it is for DEFLATE, LZW and ZSTD"),
        (["PREDICTOR=4"], "PREDICTOR=4 is not one of the values 1, 2 and 3"),
        (["BIGTIFF=MAYBE"], "values YES, NO, IF_NEEDED and IF_SAFER"),
    ],
)
def test_what_is_not_allowed_is_refused_in_one_line(words, text):
    with pytest.raises(ParameterError) as caught:
        CreationOptions.of(words)
    assert text in str(caught.value) and "\n" not in str(caught.value)


def test_control_characters_do_not_reach_a_message():
    for words in (["a\x1b[31m\nb=1"], ["COMPRESS=a\x1b\n"], ["ZLEVEL=\x1b"]):
        with pytest.raises(ParameterError) as caught:
            CreationOptions.of(words)
        assert "\x1b" not in str(caught.value) and "\n" not in str(caught.value)


def test_a_compression_that_gdal_lacks_is_refused(monkeypatch):
    def failing(path, mode, **how):
        assert how["compress"] == "ZSTD"
        raise rasterio.errors.RasterioIOError("Cannot create TIFF file due to missing codec for ZSTD.")

    monkeypatch.setattr("uavseg.raster.access.opening.rasterio.open", failing)
    with pytest.raises(ParameterError, match=r"without COMPRESS=ZSTD here; NONE, DEFLATE, LZW and PACKBITS"):
        CreationOptions.of(["COMPRESS=ZSTD"])


@pytest.mark.parametrize("targets", [{None: "uint32"}, {"a.yaml": "float32"}, {}])
def test_options_without_a_geotiff_are_refused(targets):
    assert creation_for([], targets) == CreationOptions()
    with pytest.raises(ParameterError, match=r"no output is one; name a .tif"):
        creation_for(["COMPRESS=LZW"], targets)


@pytest.mark.parametrize("name", ["a.tif", "a.TIFF", "a.vrt"])
def test_the_predictor_of_floats_needs_floats(name):
    assert creation_for(["PREDICTOR=3"], {name: "float32", None: "uint32"}).predictor == 3
    with pytest.raises(ParameterError, match="uint32 is stored with PREDICTOR=2"):
        creation_for(["PREDICTOR=3"], {name: "uint32"})
    with pytest.raises(ParameterError, match="uint8 is stored"):
        creation_for(["PREDICTOR=3"], {"map.tif": "float32", name: "uint8"})


def test_nothing_is_written_where_the_type_does_not_fit(tmp_path):
    with pytest.raises(ParameterError, match="uint8"):
        pages = [Page([np.ones(SHAPE, np.float32)], BOX, ["a"]), Page([np.ones(SHAPE, np.uint8)], BOX, ["b"])]
        write_geotiff_pages(tmp_path / "a.tif", pages, creation=CreationOptions.of(["PREDICTOR=3"]))
    assert not list(tmp_path.iterdir())
