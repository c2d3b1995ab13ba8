"""Raster drivers by extension: a file is opened as what its name promises, and as nothing else.

GDAL recognises formats by content, and some formats (VRT, descriptions of web services, tile indexes) name
other files or addresses. So a file is opened by the drivers of its extension; a file without a known one, by
drivers that read that file alone.
"""

import re
from pathlib import Path, PurePosixPath

from uavseg.access import is_address

_JPEG2000 = ("JP2OpenJPEG", "JP2KAK", "JP2ECW", "JP2MrSID")
_RAW = ("ENVI", "EHdr")  # raw pixels with a header beside them
_WEB_SERVICES = ("WMS", "WMTS", "WCS")
_DRIVERS = {
    "GTiff": "tif tiff gtiff gtif btf tf8 cog",
    "VRT": "vrt",
    "PNG": "png",
    "JPEG": "jpg jpeg",
    "HFA": "img",
    "BMP": "bmp",
    "GIF": "gif",
    "PNM": "pgm ppm pnm",
    "WEBP": "webp",
    "AAIGrid": "asc",
    "SRTMHGT": "hgt",
    "DTED": "dt0 dt1 dt2",
    "NITF": "ntf nitf",
    "GRIB": "grb grb2 grib grib2",
    "GPKG": "gpkg",
    "MBTiles": "mbtiles",
    "netCDF": "nc",
}
_BY_EXTENSION: dict[str, tuple[str, ...]] = {
    **{f".{end}": (driver,) for driver, ends in _DRIVERS.items() for end in ends.split()},
    **dict.fromkeys((".jp2", ".j2k", ".jpx"), _JPEG2000),
    **dict.fromkeys((".bil", ".bip", ".bsq", ".bin", ".flt"), _RAW),
    ".img": ("HFA", *_RAW),
    ".asc": ("AAIGrid", "GRASSASCIIGrid"),
    ".dem": ("USGSDEM", *_RAW),
    ".xml": _WEB_SERVICES,
}
_PLAIN = ("GTiff", "PNG", "JPEG", *_JPEG2000, "HFA", "BMP", "GIF", "PNM", "WEBP", "NITF", *_RAW, "AAIGrid")

_NOT_ONLY_IMAGES = {".vrt", ".gpkg", ".xml", ".bin", ".nc", ".mbtiles"}  # nor VRT, which is made of others

_SUBDATASET = re.compile(r"[A-Za-z0-9_]{2,}:(?!//)")  # GTIFF_DIR:2:a.tif, NETCDF:"a.nc":band, ...


def drivers_of(path: str) -> tuple[str, ...]:
    """The drivers by which a raster may be opened, in the order in which they are tried; empty for any.

    Any driver is for names that are not those of files: subdatasets, and descriptions as the name itself.

    Examples
    --------
    >>> drivers_of("a.TIF"), drivers_of("https://example.org/a.png?key=1"), drivers_of("WMTS:https://a.org")
    (('GTiff',), ('PNG',), ())
    """
    if names_no_file(path):
        return ()
    name = path.split("?", 1)[0] if is_address(path) else path
    return _BY_EXTENSION.get(PurePosixPath(name).suffix.lower(), _PLAIN)


def image_extensions() -> frozenset[str]:
    """Extensions of files that are images by their name alone, in lower case."""
    return frozenset(_BY_EXTENSION) - _NOT_ONLY_IMAGES


def names_no_file(path: str) -> bool:
    """Whether a name is a subdataset or a description, which GDAL's drivers read as they like."""
    if path.startswith(("<", "{")) or path.lower().startswith("vrt://"):
        return True
    return _SUBDATASET.match(path) is not None


def as_file_name(path: str) -> str:
    """The name of an existing file so that GDAL takes it for nothing else, whatever characters it has."""
    return f"./{path}" if names_no_file(path) and Path(path).exists() else path
