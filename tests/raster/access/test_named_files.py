"""A raster opens as what its extension promises, and what it names is checked at any depth."""

import os
import sqlite3
import warnings
from pathlib import Path

import numpy as np
import pytest
import rasterio
from rasterio.shutil import copy as rasterio_copy

from uavseg.access import allowing
from uavseg.errors import AccessError, RasterError, RasterReadError
from uavseg.raster.access.opening import drivers_of
from uavseg.raster.grid.tiling import Window
from uavseg.raster.read.dataset import Dataset

SECRET = b"root:x:0:0:root:/root:/bin/bash\n" * 8
SOURCE = (
    "<SimpleSource><SourceFilename relativeToVRT='1'>{}</SourceFilename>"
    "<SourceBand>1</SourceBand></SimpleSource>"
)
RAW = (
    "<VRTDataset rasterXSize='16' rasterYSize='16'><VRTRasterBand dataType='Byte' band='1' "
    "subClass='VRTRawRasterBand'><SourceFilename relativeToVRT='0'>{}</SourceFilename>"
    "<PixelOffset>1</PixelOffset><LineOffset>16</LineOffset></VRTRasterBand></VRTDataset>"
)


def vrt_of(*sources: str, side: int = 16) -> str:
    inner = "".join(source if source.startswith("<") else SOURCE.format(source) for source in sources)
    return (
        f"<VRTDataset rasterXSize='{side}' rasterYSize='{side}'><VRTRasterBand dataType='Byte' band='1'>"
        f"{inner}</VRTRasterBand></VRTDataset>"
    )


def write_tif(path: Path, side: int = 16, driver: str = "GTiff", **tags: str) -> Path:
    how = {"width": side, "height": side, "count": 1, "dtype": "uint8", "driver": driver}
    with warnings.catch_warnings(action="ignore"), rasterio.open(path, "w", **how) as file:
        file.write(np.full((1, side, side), 7, np.uint8))
        if tags:
            file.update_tags(ns="OVERVIEWS", **tags)
    return path


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder of a stranger, with a raster in it, and a secret beside the folder."""
    (tmp_path / "secret").write_bytes(SECRET)
    (tmp_path / "in").mkdir()
    write_tif(tmp_path / "in" / "a.tif")
    return tmp_path / "in"


def read(path: Path) -> np.ndarray:
    dataset = Dataset.open(path)
    return dataset.read(Window(0, 0, *dataset.geobox.shape))[0]


def test_a_vrt_of_files_beside_it_is_read(folder: Path) -> None:
    (folder / "deep").mkdir()
    write_tif(folder / "deep" / "b.tif")
    (folder / "inner.vrt").write_text(vrt_of("deep/b.tif"))
    (folder / "outer.vrt").write_text(vrt_of("a.tif", "inner.vrt"))
    assert (read(folder / "outer.vrt") == 7).all()


@pytest.mark.parametrize("name", ["a.tif", "a.png", "a.img", "a", "a.dat", "a.jp2"])
def test_a_vrt_under_another_name_is_refused(folder: Path, name: str) -> None:
    (folder / name).write_text(RAW.format(folder / "a.tif"))
    with pytest.raises(AccessError, match=r"holds a VRT, which names other files; call it \.vrt"):
        Dataset.open(folder / name)


def test_pixels_of_a_file_elsewhere_are_read_only_if_its_folder_is_allowed(folder: Path) -> None:
    (folder / "raw.vrt").write_text(RAW.format(folder.parent / "secret"))
    with pytest.raises(AccessError, match=r"raw\.vrt names .*secret, which lies outside .*--allow-path"):
        Dataset.open(folder / "raw.vrt")
    with allowing(folder.parent):
        assert read(folder / "raw.vrt").tobytes() == SECRET[:256]


@pytest.mark.parametrize(
    "inner",
    [
        "<sourcefilename>{}</sourcefilename>",
        "<SimpleSource SourceFilename='{}'/>",
        "<SourceFilename><![CDATA[{}]]></SourceFilename>",
        "<SourceFilename xmlns='urn:x'>&#47;{}</SourceFilename>",
        "<ComplexSource><SourceFilename>{}</SourceFilename></ComplexSource>",
        "<MaskBand><VRTRasterBand><SimpleSource><SourceFilename>{}</SourceFilename></SimpleSource></VRTRasterBand></MaskBand>",
        "<Overview><SourceFilename>{}</SourceFilename></Overview>",
        "<GDALWarpOptions><SourceDataset>{}</SourceDataset></GDALWarpOptions>",
        "<GeoLocTransformer><Metadata><MDI key='X_DATASET'>{}</MDI></Metadata></GeoLocTransformer>",
        "<RPCTransformer><DEMPath>{}</DEMPath></RPCTransformer>",
        "<ProcessingSteps><Argument name='gain_dataset_filename_1'>{}</Argument></ProcessingSteps>",
        "<Metadata domain='OVERVIEWS'><MDI key='OVERVIEW_FILE'>{}</MDI></Metadata>",
    ],
)
def test_every_form_of_naming_a_file_is_seen(folder: Path, inner: str) -> None:
    secret = str(folder.parent / "secret").lstrip("/") if "&#47;" in inner else str(folder.parent / "secret")
    (folder / "m.vrt").write_text(vrt_of(inner.format(secret)))
    with pytest.raises(AccessError, match="secret"):
        Dataset.open(folder / "m.vrt")


@pytest.mark.parametrize(
    "inner",
    [
        "<PixelFunctionLanguage>Python</PixelFunctionLanguage>",
        "<SRS>http://127.0.0.1:1/crs</SRS>",
        "<SourceSRS>/etc/passwd</SourceSRS>",
        "<SourceFilename>/vsizip/a.zip/b.tif</SourceFilename>",
        "<SourceFilename>&lt;VRTDataset/&gt;</SourceFilename>",
    ],
)
def test_what_cannot_be_checked_is_refused(folder: Path, inner: str) -> None:
    (folder / "m.vrt").write_text(vrt_of(inner))
    with pytest.raises(AccessError):
        Dataset.open(folder / "m.vrt")


def test_entities_and_broken_xml_are_refused(folder: Path) -> None:
    (folder / "e.vrt").write_text("<!DOCTYPE a [<!ENTITY b 'c'>]>" + vrt_of("a.tif"))
    with pytest.raises(AccessError, match="entities"):
        Dataset.open(folder / "e.vrt")
    (folder / "x.vrt").write_text("<VRTDataset")
    with pytest.raises(RasterReadError, match="not a valid VRT"):
        Dataset.open(folder / "x.vrt")


def test_a_source_that_is_a_vrt_itself_is_seen_through(folder: Path) -> None:
    (folder / "inner.vrt").write_text(RAW.format(folder.parent / "secret"))
    (folder / "outer.vrt").write_text(vrt_of("inner.vrt"))
    (folder / "hidden.tif").write_text(RAW.format(folder.parent / "secret"))
    (folder / "other.vrt").write_text(vrt_of("hidden.tif"))
    for name, reason in (("outer.vrt", "outside"), ("other.vrt", "holds a VRT")):
        with pytest.raises(AccessError, match=reason):
            Dataset.open(folder / name)


def test_overviews_and_masks_beside_a_raster_are_tiff_files(folder: Path) -> None:
    for end in (".ovr", ".msk", ".OVR"):
        beside = folder / f"a.tif{end}"
        beside.write_text(RAW.format(folder.parent / "secret"))
        with pytest.raises(AccessError, match="is not a TIFF file"):
            Dataset.open(folder / "a.tif")
        beside.unlink()
        beside.symlink_to("../secret")
        with pytest.raises(AccessError, match="outside of its folder"):
            Dataset.open(folder / "a.tif")
        beside.unlink()
    assert (read(folder / "a.tif") == 7).all()


@pytest.mark.parametrize("how", ["tags", "aux", "source"])
def test_overviews_that_metadata_name_are_checked(folder: Path, how: str) -> None:
    (folder / "evil.vrt").write_text(RAW.format(folder.parent / "secret"))
    for named, reason in ((folder.parent / "secret", "outside"), (folder / "evil.vrt", "VRT")):
        path = write_tif(folder / "o.tif", 512, **({} if how == "aux" else {"OVERVIEW_FILE": str(named)}))
        if how == "aux":
            Path(f"{path}.aux.xml").write_text(
                "<PAMDataset><Metadata domain='OVERVIEWS'>"
                f"<MDI key='OVERVIEW_FILE'>{named}</MDI></Metadata></PAMDataset>"
            )
        if how == "source":
            path = folder / "m.vrt"
            path.write_text(vrt_of("o.tif", side=512))
        with pytest.raises(AccessError, match=reason):
            Dataset.open(path)


def test_web_services_are_described_in_xml_files_that_need_the_network(folder: Path) -> None:
    text = "<GDAL_WMS><Service name='TMS'><ServerUrl>http://127.0.0.1:1/${z}</ServerUrl></Service></GDAL_WMS>"
    for name, reason in (
        ("w.xml", "--allow-network"),
        ("w.tif", "a description in text"),
        ("w", "a description"),
    ):
        (folder / name).write_text(text)
        with pytest.raises(AccessError, match=reason):
            Dataset.open(folder / name)


def test_hdf5_is_refused_because_it_may_name_files(folder: Path) -> None:
    (folder / "a.nc").write_bytes(b"\x89HDF\r\n\x1a\n" + bytes(100))
    with pytest.raises(AccessError, match="HDF5"):
        Dataset.open(folder / "a.nc")


def test_a_vrt_in_an_archive_and_one_at_an_address_cannot_be_checked(folder: Path) -> None:
    with pytest.raises(AccessError, match="unpack"):
        Dataset.open(f"/vsizip/{folder}/a.zip/m.vrt")
    with pytest.raises(AccessError, match="--allow-network"):
        Dataset.open("/vsicurl/http://127.0.0.1:1/m.vrt")


def test_vrts_that_fan_out_are_refused_before_anything_is_read(folder: Path) -> None:
    for n in range(8):
        (folder / f"{n}.vrt").write_text(vrt_of(*15 * [f"{n + 1}.vrt"]))
    (folder / "8.vrt").write_text(vrt_of("a.tif"))
    with pytest.raises(RasterError, match="more than 4 deep"):
        Dataset.open(folder / "0.vrt")
    (folder / "wide.vrt").write_text(vrt_of(*400 * ["mid.vrt"]))
    (folder / "mid.vrt").write_text(vrt_of(*400 * ["a.tif"]))
    with pytest.raises(RasterError, match="more than 100,000 sources"):
        Dataset.open(folder / "wide.vrt")
    (folder / "self.vrt").write_text(vrt_of("self.vrt"))
    with pytest.raises(RasterError, match="deep"):
        Dataset.open(folder / "self.vrt")


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes on this system")
def test_a_named_pipe_is_not_opened_wherever_it_is_named(folder: Path) -> None:
    os.mkfifo(folder / "pipe.tif")
    (folder / "m.vrt").write_text(vrt_of("pipe.tif"))
    for name in ("pipe.tif", "m.vrt"):
        with pytest.raises(RasterReadError, match="named pipe"):
            Dataset.open(folder / name)
    with pytest.raises(RasterReadError, match="named pipe"):
        Dataset.open(f"GTIFF_DIR:1:{folder / 'pipe.tif'}")
    for end in (".aux.xml", ".ovr", ".msk"):
        os.mkfifo(folder / f"a.tif{end}")
        with pytest.raises(RasterReadError, match="named pipe"):
            Dataset.open(folder / "a.tif")
        (folder / f"a.tif{end}").unlink()


@pytest.mark.parametrize("name", ["a.png", "a.jpg", "a.bmp", "a.img", "a.gif", "a.dat"])
def test_images_of_other_formats_are_read(folder: Path, name: str) -> None:
    driver = {".jpg": "JPEG", ".img": "HFA", ".dat": "ENVI"}.get(name[-4:], name[-3:].upper())
    with warnings.catch_warnings(action="ignore"):
        rasterio_copy(folder / "a.tif", folder / name, driver=driver)
    assert np.abs(read(folder / name).astype(int) - 7).max() <= 1


def test_a_file_whose_name_looks_like_a_subdataset_is_a_file(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(folder)
    (folder / "evil.dat").write_text(RAW.format(folder.parent / "secret"))
    for name in ("DERIVED_SUBDATASET:LOGAMPLITUDE:evil.dat", "GTIFF_DIR:1:evil.tif"):
        (folder / name).write_bytes((folder / "a.tif").read_bytes())
        assert (read(Path(name)) == 7).all()


def test_each_extension_has_its_drivers() -> None:
    assert drivers_of("a.vrt") == ("VRT",)
    assert drivers_of("/vsizip/a.zip/b.TIFF") == ("GTiff",)
    assert "VRT" not in drivers_of("a") and "WMS" not in drivers_of("a.txt")
    for subdataset in ('NETCDF:"a.nc":b', "GTIFF_DIR:2:a.tif", "<VRTDataset/>"):
        assert drivers_of(subdataset) == ()


ENDLESS = "WITH RECURSIVE n(x) AS (SELECT 1 UNION ALL SELECT x + 1 FROM n)"


def test_a_database_of_tiles_with_a_view_that_never_ends_is_not_opened(tmp_path: Path) -> None:
    how = {"crs": "EPSG:3857", "transform": rasterio.Affine(1, 0, 0, 0, -1, 16)}
    with rasterio.open(tmp_path / "a.gpkg", "w", "GPKG", 16, 16, 3, dtype="uint8", **how) as file:
        file.write(np.full((3, 16, 16), 7, np.uint8))
    with sqlite3.connect(tmp_path / "a.gpkg") as database:
        database.execute("CREATE VIEW chosen AS SELECT * FROM gpkg_contents WHERE min_x < 0")
    database.close()
    (tmp_path / "g.vrt").write_text(vrt_of("a.gpkg"))
    (tmp_path / "m.vrt").write_text(vrt_of("a.mbtiles"))
    assert Dataset.open(tmp_path / "a.gpkg").geobox.shape == (16, 16)
    for name, table in (("a.gpkg", "gpkg_contents"), ("a.mbtiles", "metadata")):
        with sqlite3.connect(tmp_path / name) as database:
            if name == "a.mbtiles":
                database.execute("CREATE TABLE metadata (name, value)")
            database.execute(f"ALTER TABLE {table} RENAME TO held")
            database.execute(f"CREATE VIEW {table} AS {ENDLESS} SELECT held.* FROM held, n")
        database.close()
    for name in ("a.gpkg", "g.vrt", "a.mbtiles", "m.vrt"):
        with pytest.raises(AccessError, match="view"):
            Dataset.open(tmp_path / name)
