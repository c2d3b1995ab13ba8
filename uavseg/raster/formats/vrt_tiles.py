"""Labels as many GeoTIFFs under one VRT: whoever paints a tile writes it, so pixels travel nowhere."""

import os
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Protocol
from xml.etree import ElementTree

from affine import Affine

from uavseg.atomic import check_target, whole_file
from uavseg.errors import OutputError, OutputExistsError
from uavseg.execution.executors import Map, serial
from uavseg.raster.formats.geotiff import STRIPE, Labels, write_labels
from uavseg.raster.geobox import GeoBox
from uavseg.raster.tiling import Window, tiles

SIDE = 2048  # pixels of a tile of labels, whatever tiles the work was cut into: the files do not tell

Path_ = str | os.PathLike[str]


class LabelTile(Protocol):
    """What a worker needs to paint one window."""

    @property
    def window(self) -> Window: ...

    def rasterise(self) -> Labels:
        """The labels, (rows, cols) uint32."""


def label_windows(shape: tuple[int, int]) -> list[Window]:
    """The windows of the tiles of labels, row by row."""
    return tiles(shape, SIDE)


def tiles_folder(path: Path_) -> Path:
    """The folder of tiles beside a VRT: labels.tiles for labels.vrt."""
    return Path(path).with_suffix(".tiles")


def check_label_tiles(path: Path_, overwrite: bool = False) -> None:
    """See that a VRT and its folder of tiles may be written; call it before the work.

    Raises
    ------
    OutputExistsError
        If one of them is there already and `overwrite` is false.
    OutputError
        If they have no place, or the folder is there and holds something else.
    """
    check_target(path, overwrite)
    folder = tiles_folder(path)
    if not folder.exists():
        return
    if not overwrite:
        raise OutputExistsError(f"{folder} exists; give --overwrite (overwrite=True) to replace it")
    if not folder.is_dir() or any(not _is_tile(file) for file in folder.iterdir()):
        raise OutputError(f"{folder} holds something else than tiles of labels; move it away")


def write_label_tiles(
    path: Path_,
    parts: Sequence[LabelTile],
    geobox: GeoBox,
    overwrite: bool = False,
    map: Map = serial,
) -> None:
    """Write labels as GeoTIFFs in a folder beside a VRT that shows them as one uint32 raster, 0 nodata.

    Tiles without labels have no file. The workers of `map` write into the folder, so they must see it.

    Parameters
    ----------
    path : path
        Of the VRT; its tiles lie in a folder of the same name that ends in .tiles.
    parts : sequence of Paintable
        One for each of `label_windows`.
    geobox : GeoBox
        Of the raster whose pixels were labelled.
    overwrite : bool
        Whether what is there may be replaced.
    map : Map
        Who paints and writes.

    Raises
    ------
    OutputExistsError, OutputError
        If they may not or cannot be written.
    """
    check_label_tiles(path, overwrite)
    with whole_file(path, overwrite) as target:
        folder = tiles_folder(target)
        folder.mkdir()
        write = partial(_write_tile, str(folder.absolute()), geobox)
        written = [part for part in map(write, parts) if part is not None]
        missing = [name for window in written if not (folder / (name := _name(window))).is_file()]
        if missing:
            raise OutputError(
                f"the tile {missing[0]} of {path} was written by a worker and is not here; "
                "workers must share the folder that labels go to"
            )
        target.write_bytes(_vrt(geobox, written, folder.name))


def _write_tile(folder: str, geobox: GeoBox, part: LabelTile) -> Window | None:
    """Paint and write one tile; its window, or None where there is no label."""
    labels, window = part.rasterise(), part.window
    if not labels.any():
        return None
    place = Window(0, 0, window.rows, window.cols)
    write_labels(Path(folder) / _name(window), [(place, labels)], geobox.window(window))
    return window


def _name(window: Window) -> str:
    return f"{window.row // SIDE:04d}-{window.col // SIDE:04d}.tif"


def _is_tile(file: Path) -> bool:
    row, _, col = file.stem.partition("-")
    return file.suffix == ".tif" and row.isdecimal() and col.isdecimal()


def _vrt(geobox: GeoBox, windows: Sequence[Window], folder: str) -> bytes:
    """A GDAL virtual raster of the tiles; paths in it start from its own folder."""
    rows, cols = geobox.shape
    root = ElementTree.Element("VRTDataset", rasterXSize=str(cols), rasterYSize=str(rows))
    if geobox.wkt is not None:
        _add(root, "SRS", geobox.wkt)
    if geobox.transform != Affine.identity():
        _add(root, "GeoTransform", ", ".join(repr(float(value)) for value in geobox.transform.to_gdal()))
    band = _add(root, "VRTRasterBand", dataType="UInt32", band="1")
    _add(band, "NoDataValue", "0")
    for window in windows:
        band.append(_source(window, f"{folder}/{_name(window)}"))
    ElementTree.indent(root)
    return ElementTree.tostring(root, "unicode").encode() + b"\n"


def _source(window: Window, path: str) -> ElementTree.Element:
    source = ElementTree.Element("SimpleSource")
    _add(source, "SourceFilename", path, relativeToVRT="1")
    _add(source, "SourceBand", "1")
    size = {"xSize": str(window.cols), "ySize": str(window.rows)}
    _add(
        source,
        "SourceProperties",
        RasterXSize=size["xSize"],
        RasterYSize=size["ySize"],
        DataType="UInt32",
        BlockXSize=str(STRIPE),
        BlockYSize=str(STRIPE),
    )
    _add(source, "SrcRect", xOff="0", yOff="0", **size)
    _add(source, "DstRect", xOff=str(window.col), yOff=str(window.row), **size)
    return source


def _add(parent: ElementTree.Element, tag: str, text: str | None = None, **how: str) -> ElementTree.Element:
    child = ElementTree.SubElement(parent, tag, how)
    child.text = text
    return child
