"""Label tiles: many GeoTIFFs under one VRT, each written by the worker that rasterises it."""

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Protocol
from xml.etree import ElementTree

from affine import Affine

from uavseg.arrays import Path_
from uavseg.errors import OutputError
from uavseg.execution.executors import Map, serial
from uavseg.output.atomic import atomic_file, check_target
from uavseg.output.renames import recover
from uavseg.raster.formats.creation import DEFAULT, CreationOptions
from uavseg.raster.formats.geotiff import STRIPE, Labels, write_label_geotiff
from uavseg.raster.grid.geobox import GeoBox
from uavseg.raster.grid.tiling import Window, tiles

LABEL_TILE_SIDE = 2048  # pixels; independent of the tiles of the processing


class LabelTile(Protocol):
    """What a worker needs to paint one window."""

    @property
    def window(self) -> Window: ...

    def rasterise(self) -> Labels:
        """Return the labels, (rows, cols) uint32."""


def label_windows(shape: tuple[int, int]) -> list[Window]:
    """Return the windows of the label tiles, row by row."""
    return tiles(shape, LABEL_TILE_SIDE)


def tiles_folder(path: Path_) -> Path:
    """Return the folder of tiles beside a VRT: labels.tiles for labels.vrt."""
    return Path(path).with_suffix(".tiles")


def check_label_tiles(path: Path_, overwrite: bool = False) -> None:
    """Check that a VRT and its folder of tiles may be written, before the work whose result they hold.

    An OutputExistsError says that one of them exists and `overwrite` is false, an OutputError that their
    folder does not exist, or that the folder of tiles contains anything else.
    """
    check_target(path, overwrite)
    folder = tiles_folder(path)
    if folder.exists() and any(not _is_tile(file) for file in folder.iterdir()):
        raise OutputError(f"{folder} contains something else than label tiles; move it away")


def write_label_tiles(
    path: Path_,
    parts: Sequence[LabelTile],
    geobox: GeoBox,
    overwrite: bool = False,
    map: Map = serial,
    creation: CreationOptions = DEFAULT,
) -> None:
    """Write labels as GeoTIFFs in a folder beside a VRT that combines them to one uint32 raster, 0 nodata.

    Tiles without labels have no file. The workers of `map` write into the folder, so they must share it.

    There is one part for each of `label_windows`, and the tiles are in a folder of the name of the VRT with
    the suffix .tiles. An OutputExistsError or OutputError says that the files exist or cannot be written.
    """
    check_label_tiles(path, overwrite)
    with atomic_file(path, overwrite) as target:
        folder = tiles_folder(target)
        folder.mkdir()
        write = partial(_write_tile, str(folder.absolute()), geobox, creation)
        written = [part for part in map(write, parts) if part is not None]
        recover(folder)  # what workers left that were killed
        missing = [name for window in written if not (folder / (name := _tile_name(window))).is_file()]
        if missing:
            raise OutputError(
                f"the tile {missing[0]} of {path} was written by a worker and is not here; "
                "workers must share the folder of the labels"
            )
        target.write_bytes(_vrt_xml(geobox, written, folder.name))


def _write_tile(folder: str, geobox: GeoBox, creation: CreationOptions, part: LabelTile) -> Window | None:
    """Paint and write one tile; its window, or None where there is no label."""
    labels, window = part.rasterise(), part.window
    if not labels.any():
        return None
    place = Window(0, 0, window.rows, window.cols)
    path = Path(folder) / _tile_name(window)
    again = True  # a tile that was sent twice
    write_label_geotiff(path, [(place, labels)], geobox.window(window), again, creation=creation)
    return window


def _tile_name(window: Window) -> str:
    return f"{window.row // LABEL_TILE_SIDE:04d}-{window.col // LABEL_TILE_SIDE:04d}.tif"


def _is_tile(file: Path) -> bool:
    row, _, col = file.stem.partition("-")
    return file.suffix == ".tif" and row.isdecimal() and col.isdecimal()


def _vrt_xml(geobox: GeoBox, windows: Sequence[Window], folder: str) -> bytes:
    """Return a GDAL virtual raster of the tiles, with relative paths."""
    rows, cols = geobox.shape
    root = ElementTree.Element("VRTDataset", rasterXSize=str(cols), rasterYSize=str(rows))
    if geobox.wkt is not None:
        _add_element(root, "SRS", geobox.wkt)
    if geobox.transform != Affine.identity():
        _add_element(
            root, "GeoTransform", ", ".join(repr(float(value)) for value in geobox.transform.to_gdal())
        )
    band = _add_element(root, "VRTRasterBand", dataType="UInt32", band="1")
    _add_element(band, "NoDataValue", "0")
    for window in windows:
        band.append(_source(window, f"{folder}/{_tile_name(window)}"))
    ElementTree.indent(root)
    return ElementTree.tostring(root, "unicode").encode() + b"\n"


def _source(window: Window, path: str) -> ElementTree.Element:
    source = ElementTree.Element("SimpleSource")
    _add_element(source, "SourceFilename", path, relativeToVRT="1")
    _add_element(source, "SourceBand", "1")
    size = {"xSize": str(window.cols), "ySize": str(window.rows)}
    _add_element(
        source,
        "SourceProperties",
        RasterXSize=size["xSize"],
        RasterYSize=size["ySize"],
        DataType="UInt32",
        BlockXSize=str(STRIPE),
        BlockYSize=str(STRIPE),
    )
    _add_element(source, "SrcRect", xOff="0", yOff="0", **size)
    _add_element(source, "DstRect", xOff=str(window.col), yOff=str(window.row), **size)
    return source


def _add_element(
    parent: ElementTree.Element, tag: str, text: str | None = None, **how: str
) -> ElementTree.Element:
    child = ElementTree.SubElement(parent, tag, how)
    child.text = text
    return child
