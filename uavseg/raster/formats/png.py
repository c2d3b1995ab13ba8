"""Images without georeferencing: 8-bit grey as image programs compute it, and a PNG writer."""

import os

import numpy as np
from numpy.typing import NDArray
from rasterio.io import DatasetReader

from uavseg.arrays import Bools, Integers, Path_, Uint8s
from uavseg.errors import OutputError, RasterReadError, caused_errors
from uavseg.output.atomic import atomic_file
from uavseg.raster.access.open_checked import check_readable_whole, open_checked
from uavseg.raster.access.opening import GDAL_ERRORS, gdal_env, quiet_open

REC601_WEIGHTS = (306, 601, 117)  # of red, green and blue in 1024ths


def read_grey(path: Path_) -> tuple[Uint8s, Uint8s | None]:
    """Read an image as 8-bit grey, (rows, cols), and its alpha, 255 where it is opaque, or None.

    Samples are scaled to 16 bits, colours become Rec. 601 luminance in integer arithmetic, and the result is
    divided by 257 and rounded down, as in GraphicsMagick. A RasterReadError says that it is not an image, or
    damaged.
    """
    form = "{} ({}); it is of another kind, damaged or incomplete"
    unread = f"{os.fspath(path)} cannot be read as a picture"
    failing = caused_errors(unread, RasterReadError, *GDAL_ERRORS, form=form)
    with failing, open_checked(os.fspath(path)) as file:
        check_readable_whole(os.fspath(path), file)
        if any(name not in ("uint8", "uint16") for name in file.dtypes):
            raise RasterReadError(f"{os.fspath(path)} holds {file.dtypes[0]}; a picture has 8 or 16 bits")
        return _grey(file)


def write_png(path: Path_, grey: Uint8s, overwrite: bool = False, opaque: Bools | None = None) -> None:
    """Write a (rows, cols) uint8 array as a grey PNG.

    Pixels that are not `opaque`, (rows, cols) as well, are transparent. An OutputExistsError or OutputError
    says that the file exists or cannot be written.
    """
    rows, cols = grey.shape
    bands = [grey] if opaque is None else [grey, opaque * np.uint8(255)]
    how = {"driver": "PNG", "height": rows, "width": cols, "count": len(bands), "dtype": "uint8"}
    failing = caused_errors(f"{os.fspath(path)} cannot be written", OutputError, *GDAL_ERRORS)
    with failing, atomic_file(path, overwrite) as target, gdal_env(), quiet_open(target, "w", **how) as file:
        file.write(np.stack(bands))


def to_8_bits(samples: NDArray[np.generic], maximum: int) -> Uint8s:
    """Convert samples of 0..maximum to 8 bits, scaled to 16 bits first."""
    table = (_to_16_bits(np.arange(maximum + 1), maximum) // 257).astype(np.uint8)
    return np.asarray(table[np.minimum(samples, maximum)])


def _to_16_bits(samples: NDArray[np.generic], maximum: int) -> Integers:
    return (np.minimum(samples.astype(np.int64), maximum) * 131070 + maximum) // (2 * maximum)


def _grey(file: DatasetReader) -> tuple[Uint8s, Uint8s | None]:
    roles = [role.name for role in file.colorinterp]
    planes = file.read()
    bits = file.tags(1, ns="IMAGE_STRUCTURE").get("NBITS", 8 * np.dtype(file.dtypes[0]).itemsize)
    maximum = (1 << int(bits)) - 1
    if roles[0] == "palette":
        colormap = file.colormap(1)
        table = np.array([colormap.get(index, (0, 0, 0, 0)) for index in range(256)], np.int64)
        shades = (_luminance([table[:, band] * 257 for band in range(3)]) // 257).astype(np.uint8)
        alpha = table[:, 3].astype(np.uint8)[planes[0]]
        return shades[planes[0]], None if (alpha == 255).all() else alpha
    alpha = planes[roles.index("alpha")] if "alpha" in roles else None
    colors = [plane for plane, role in zip(planes, roles, strict=True) if role != "alpha"]
    quanta = [_to_16_bits(plane, maximum) for plane in colors]
    grey = quanta[0] if len(quanta) < 3 else _luminance(quanta)
    opaque = None if alpha is None else to_8_bits(alpha, maximum)
    if alpha is None and file.nodatavals[0] is not None:  # the colour that the file declares transparent
        opaque = np.where(file.dataset_mask(), np.uint8(255), np.uint8(0))
    return (grey // 257).astype(np.uint8), opaque


def _luminance(quanta: list[Integers]) -> Integers:
    red, green, blue = quanta[:3]
    return (REC601_WEIGHTS[0] * red + REC601_WEIGHTS[1] * green + REC601_WEIGHTS[2] * blue) >> 10
