"""What a raster file names: sources of VRTs at any depth, overviews and masks; checked before opening.

GDAL opens the files that a VRT names, and those beside a raster (.ovr, .msk), by any driver that recognises
them. So each of them has to lie where the access policy allows it, to be a regular file, and to be what its
extension promises.
"""

import os
from pathlib import Path

from uavseg.access import current_policy
from uavseg.errors import AccessError, RasterError
from uavseg.inputs import read_bytes, read_start, regular_file
from uavseg.raster.access.drivers import drivers_of, names_no_file
from uavseg.raster.access.vrt_sources import is_vrt, sources_of

MAX_NESTING = 4  # VRTs in each other
MAX_READS = 1_000_000  # reads of sources that one VRT may cost
MAX_NESTED_READS = 100_000  # the same for VRTs of VRTs, in which a small file can name many

_TIFF = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")
_HDF5 = b"\x89HDF\r\n\x1a\n"
_IMAGES_BESIDE = (".ovr", ".OVR", ".msk", ".MSK")
_TEXTS_BESIDE = (".aux.xml", ".aux", ".hdr", ".HDR")
_TEXTS_OF_STEM = (
    ".aux",
    ".hdr",
    ".tfw",
    ".tifw",
    ".jgw",
    ".pgw",
    ".wld",
    ".prj",
    ".imd",
    ".rpb",
    ".ige",
    ".rrd",
)


class NamedFiles:
    """The files that one raster consists of, as they are found.

    Parameters
    ----------
    owner : str
        The raster, as the user named it.
    """

    def __init__(self, owner: str) -> None:
        self.owner = owner
        self.rasters: dict[str, None] = {}  # sources that are no VRT, in the order in which they are named
        self._reads: dict[Path, int] = {}

    def check(self) -> None:
        """Check the raster and all that it names, unless its name is that of no local file.

        Raises
        ------
        RasterReadError
            If it is not a regular file.
        AccessError
            If it names what may not be opened, or is something else than its extension promises.
        RasterError
            If VRTs lie too deep in each other, or read too many sources.
        """
        path = regular_file(self.owner)
        self._check_beside(path)
        if path.suffix.lower() == ".vrt":
            self._check_vrt(path, 1)
        else:
            self._check_content(path, self.owner)

    def _check_vrt(self, path: Path, depth: int) -> int:
        """Check the sources of a VRT; returns how many are read where it is read once."""
        if depth > MAX_NESTING:
            raise RasterError(f"{self.owner} has VRTs that lie more than {MAX_NESTING} deep in each other")
        if path in self._reads:
            return self._reads[path]
        reads, nested = 0, depth > 1
        for source in sources_of(str(path), read_bytes(path)):
            target = current_policy().check_name(self.owner, source.name, source.folder)
            if target is None or source.is_raw:
                reads += 1
            elif target.suffix.lower() == ".vrt":
                nested = True
                reads += self._check_vrt(target, depth + 1)
            else:
                self._check_source(target)
                reads += 1
            limit = MAX_NESTED_READS if nested else MAX_READS
            if reads > limit:
                raise RasterError(
                    f"{self.owner} reads more than {limit:,} sources; build one VRT of fewer files "
                    "(gdalbuildvrt), or copy it to a GeoTIFF"
                )
        self._reads[path] = reads
        return reads

    def _check_source(self, path: Path) -> None:
        if str(path) not in self.rasters:
            self._check_beside(path)
            self._check_content(path, f"{self.owner} names {path}, which")
            self.rasters[str(path)] = None

    def _check_content(self, path: Path, subject: str) -> None:
        """Refuse a description of other files under a name that promises an image."""
        if drivers_of(str(path)) == ("GTiff",) and read_start(path, 4) in _TIFF:
            return
        from uavseg.raster.access import geojp2, netcdf_header

        start = read_start(path)
        if is_vrt(start):
            raise AccessError(f"{subject} holds a VRT, which names other files; call it .vrt if you trust it")
        if start.startswith(_HDF5):
            raise AccessError(
                f"{subject} is HDF5, which may name other files unseen; convert it to "
                'GeoTIFF (gdal_translate), or name its subdataset (NETCDF:"a.nc":band) if you trust it'
            )
        if start.startswith(netcdf_header.SIGNATURES):
            netcdf_header.check_netcdf_header(path)
            return
        if start.startswith(geojp2.SIGNATURE):
            geojp2.check_geojp2(path)
            return
        if path.suffix.lower() != ".xml" and start.lstrip(b"\xef\xbb\xbf \t\r\n")[:1] in (b"<", b"{", b"["):
            raise AccessError(f"{subject} holds a description in text, not an image")
        if path.suffix.lower() == ".xml":
            current_policy().check_address(subject, "of a web service")

    def _check_beside(self, path: Path) -> None:
        """Check the files that GDAL opens because they lie beside a raster."""
        name, stem = str(path), str(path.with_suffix(""))
        for beside in (name + end for end in _IMAGES_BESIDE):
            if os.path.lexists(beside):
                current_policy().check_file(self.owner, beside)
                if read_start(beside, 4) not in _TIFF:
                    raise AccessError(f"{beside} is not a TIFF file, as overviews and masks are")
        for beside in (*(name + end for end in _TEXTS_BESIDE), *(stem + end for end in _TEXTS_OF_STEM)):
            if os.path.lexists(beside):
                current_policy().check_file(self.owner, beside)
                if is_vrt(read_start(beside)):  # GDAL ignores what it cannot read: a raster without its place
                    raise AccessError(f"{beside} holds a VRT, which is not what lies beside a raster")


def check_named_file(owner: str, name: str) -> None:
    """Check one more file that GDAL says a raster consists of, or that its metadata names.

    Raises
    ------
    AccessError
        If it may not be opened.
    """
    if names_no_file(name):
        raise AccessError(f"{owner} names {name[:60]!r}, which is not a file")
    target = current_policy().check_name(owner, name, Path())
    if target is not None and is_vrt(read_start(target)):
        raise AccessError(f"{owner} names {name}, which holds a VRT; name the sources in one VRT")
