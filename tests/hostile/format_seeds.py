"""Seeds of rasters in formats beside TIFF, and of TIFFs with files beside them, in folders named by kind."""

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import rasterio
from affine import Affine
from rasterio.shutil import copy

from tests.hostile.seeds import UTM, Files, image, once, write_tif

WORLD = "1.0\n0.0\n0.0\n-1.0\n500000.5\n4499999.5\n"
ASSIGNED = """<PAMDataset><SRS dataAxisToSRSAxisMapping="1,2">EPSG:32633</SRS>
<GeoTransform>500000, 1, 0, 4500000, 0, -1</GeoTransform><PAMRasterBand band="1"><NoDataValue>0</NoDataValue>
<Metadata><MDI key="STATISTICS_MINIMUM">1</MDI></Metadata></PAMRasterBand></PAMDataset>"""
MOSAIC = """<VRTDataset rasterXSize="140" rasterYSize="128"><SRS>EPSG:32633</SRS>
<GeoTransform>500000, 1, 0, 4500000, 0, -1</GeoTransform><VRTRasterBand dataType="Byte" band="1">
<NoDataValue>0</NoDataValue><ComplexSource><SourceFilename relativeToVRT="1">a.tif</SourceFilename>
<SourceBand>1</SourceBand><SrcRect xOff="0" yOff="0" xSize="70" ySize="128" /><NODATA>0</NODATA>
<DstRect xOff="0" yOff="0" xSize="70" ySize="128" /><ScaleRatio>1</ScaleRatio></ComplexSource>
<SimpleSource><SourceFilename relativeToVRT="1">a.tif</SourceFilename><SourceBand>1</SourceBand>
<SrcRect xOff="70" yOff="0" xSize="70" ySize="128" /><DstRect xOff="70" yOff="0" xSize="70" ySize="128" />
</SimpleSource></VRTRasterBand></VRTDataset>"""


@once
def formats() -> Files:
    """Content by `folder/name`; the raster of each folder is `x.*`, the others belong to it."""
    grey = image(128, 140)
    colours = np.stack([grey, np.roll(grey, 9, 0), 255 - grey])
    with TemporaryDirectory() as made:
        root = Path(made)

        def draw(name: str, values: np.ndarray, **how: object) -> Path:
            folder = root / name.partition("/")[0]
            folder.mkdir(exist_ok=True)
            write_tif(root, name, values, **how)
            return folder

        (draw("png/x.png", grey.astype(np.uint16) * 200, driver="PNG") / "x.pgw").write_text(WORLD)
        folder = draw("jpg/x.jpg", colours, driver="JPEG", quality=90)
        (folder / "x.jgw").write_text(WORLD)
        (folder / "x.jpg.aux.xml").write_text(ASSIGNED)
        draw("jp2/x.jp2", grey, driver="JP2OpenJPEG", blockxsize=64, blockysize=64, **UTM)
        draw("hfa/x.img", grey, driver="HFA", compressed="YES", **UTM)
        (draw("bmp/x.bmp", grey, driver="BMP") / "x.bpw").write_text(WORLD)
        (draw("gif/x.gif", grey, driver="GIF") / "x.gfw").write_text(WORLD)
        (draw("webp/x.webp", colours, driver="WEBP", lossless=True) / "x.wld").write_text(WORLD)
        draw("nitf/x.ntf", grey, driver="NITF")
        draw("asc/x.asc", grey[:50, :60].astype(np.int32), driver="AAIGrid", **UTM)
        draw("envi/x.bin", grey.astype(np.int16), driver="ENVI", **UTM)
        draw("ehdr/x.bil", grey, driver="EHdr", **UTM)
        draw("gpkg/x.gpkg", grey, driver="GPKG", blocksize=64, **UTM)
        side = 156543.033928041 / 2**17  # of a pixel at zoom level 17
        mercator = {"crs": "EPSG:3857", "transform": Affine(side, 0, 1669792, 0, -side, 4962000)}
        folder = draw("mbtiles/a.tif", colours, **mercator)
        copy(folder / "a.tif", folder / "x.mbtiles", driver="MBTiles")
        (folder / "a.tif").unlink()
        folder = draw("world/x.tif", grey, compress="deflate")
        (folder / "x.tfw").write_text(WORLD)
        (draw("assigned/x.tif", grey, compress="lzw") / "x.tif.aux.xml").write_text(ASSIGNED)
        (draw("vrt/a.tif", grey, compress="deflate", **UTM) / "x.vrt").write_text(MOSAIC)
        (root / "netcdf").mkdir()
        copy(root / "vrt" / "a.tif", root / "netcdf" / "x.nc", driver="netCDF")
        folder = draw("grid_vrt/a.asc", grey[:, :60].astype(np.int32), driver="AAIGrid", **UTM)
        (folder / "x.vrt").write_text(
            MOSAIC.replace("a.tif", "a.asc").replace("70", "30").replace("140", "60")
        )
        (folder / "a.prj").unlink()
        folder = draw("list/a.tif", grey, compress="deflate", **UTM)
        (folder / "x.txt").write_text("# tiles\na.tif\n\n./a.tif\n")
        folder = draw("beside/x.tif", grey, compress="deflate", **UTM)
        options = {"TIFF_USE_OVR": True, "GDAL_TIFF_INTERNAL_MASK": False}
        with rasterio.Env(**options), rasterio.open(folder / "x.tif", "r+") as file:
            file.write_mask(np.where(grey > 9, 255, 0).astype(np.uint8))
            file.build_overviews([2, 4])
        return {
            str(path.relative_to(root)): path.read_bytes()
            for path in sorted(root.rglob("*"))
            if path.is_file()
        }
