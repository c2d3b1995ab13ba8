"""Write regions to vector files atomically, by extension, and verify them; write them as label rasters."""

import io
import json
import os
import struct
import textwrap
import warnings
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import IO, Any

import numpy as np
import shapely
from numpy.typing import NDArray

from uavseg.arrays import Path_, Uint32s
from uavseg.errors import OutputError, ParameterError
from uavseg.execution.executors import Map, serial
from uavseg.inputs import read_start
from uavseg.output.atomic import atomic_file, check_target
from uavseg.raster.formats import geotiff
from uavseg.raster.formats.creation import DEFAULT, CreationOptions
from uavseg.raster.formats.geotiff import check_label_tiles, label_windows, write_label_tiles
from uavseg.raster.geodesy.globe import parse_crs
from uavseg.raster.grid.geobox import GeoBox
from uavseg.raster.grid.tiling import Window, tiles
from uavseg.regions.formats import text_writers
from uavseg.regions.formats.metadata import metadata_items
from uavseg.regions.formats.text_writers import COLLECTION, GeoJsonForm
from uavseg.regions.formats.vector_files import gdal_options, import_pyarrow
from uavseg.regions.outline.rings import EdgeTable, Rings, edge_tables
from uavseg.regions.shapes import as_multipolygons, batch_slices, has_multipolygons
from uavseg.regions.table import Regions
from uavseg.regions.wgs84 import to_wgs84
from uavseg.units import BLOCK
from uavseg.warning_filters import changing_filters

LAYER = "regions"
_ARROW_TYPES = {"i": "int64", "f": "float64", "O": "string"}  # by `dtype.kind` of numpy
_DATE = "2000-01-01T00:00:00Z"  # reproducible files: the same regions give the same bytes on any day
# Names in a Shapefile have at most ten characters.
_SHORT_NAMES = {"perimeter_m": "perim_m", "range_low": "range_lo", "range_high": "range_hi"}
_NODE_BYTES = 40  # of one node of FlatGeobuf's index
_BRANCHES = 16  # of one node


def write_regions(
    regions: Regions, path: Path_ | IO[Any], overwrite: bool = False, form: GeoJsonForm = COLLECTION
) -> None:
    """Write regions to a file in the format of its extension, or as GeoJSON to an open stream.

    GeoJSON and KML are in WGS 84; .gpkg, .fgb, .parquet and .shp keep the CRS of the regions. A stream, whose
    GeoJSON has the `form`, may be binary or text. An OutputExistsError says that the file exists and
    `overwrite` is false, an OutputError that the extension is unknown, the file cannot be written, or the
    format cannot hold the regions.
    """
    if not isinstance(path, str | os.PathLike):
        try:
            if hasattr(path, "encoding"):
                text = io.BytesIO()
                text_writers.write_geojson(regions, text, form)
                path.write(text.getvalue().decode())
            else:
                text_writers.write_geojson(regions, path, form)
            path.flush()
        except BrokenPipeError:
            raise  # the reader has closed the pipe
        except OSError as error:
            raise OutputError(
                f"the regions cannot be written to the stream: {error.strerror or error}"
            ) from error
        return
    target = check_region_path(path, overwrite)
    with atomic_file(target, overwrite) as part:
        _WRITERS[target.suffix.lower()](regions, part)


def check_region_path(path: Path_, overwrite: bool = False) -> Path:
    """Return the path, if regions can be written there; call it before computing them.

    Errors are those of `write_regions`.

    Examples
    --------
    >>> check_region_path("regions.tif")
    Traceback (most recent call last):
    ...
    uavseg.errors.OutputError: regions.tif: regions are written to .geojson, .json, .gpkg, .fgb, ...
    """
    suffix = Path(path).suffix.lower()
    if is_region_folder(path):
        raise OutputError(
            f"{path}: a folder is written by uavseg extract of one range; name a file, without / at its end"
        )
    if suffix == ".parquet":
        import_pyarrow()
        if Path(path).is_dir():
            raise OutputError(f"{path} is a folder; name a file in it, or add / to replace it")
    if suffix not in _WRITERS:
        *known, last = _WRITERS
        raise OutputError(f"{path}: regions are written to {', '.join(known)} or {last}")
    return check_target(path, overwrite)


def is_region_folder(path: Path_) -> bool:
    """Check whether a name asks for a folder of GeoParquet files: it ends in .parquet/."""
    return os.fspath(path).endswith(("/", os.sep)) and Path(path).suffix.lower() == ".parquet"


def check_region_folder(path: Path_, overwrite: bool = False) -> None:
    """Refuse a folder of GeoParquet files that may not be written, before the work whose result it holds."""
    import_pyarrow()
    folder = Path(path)
    if folder.is_dir() and any(file.suffix.lower() != ".parquet" for file in folder.iterdir()):
        raise OutputError(f"{folder} contains something else than regions; move it away")
    check_target(folder, overwrite)


def format_notes(regions: Regions, path: Path_) -> list[str]:
    """Return warnings about what readers of the format of a file, at this path, cannot show."""
    return text_writers.kml_notes(regions) if Path(path).suffix.lower() == ".kml" else []


def suffix_for(wkt: str | None) -> str:
    """Return the extension of a file of regions in a CRS: that of GeoJSON, unless it cannot hold them."""
    try:
        check_region_crs("regions.geojson", wkt)
    except OutputError:
        return ".gpkg"
    return ".geojson"


def check_region_crs(path: Path_, wkt: str | None, form: GeoJsonForm = COLLECTION) -> None:
    """Refuse a CRS that is not of the Earth where the format needs one, with an OutputError.

    KML needs one, and so does GeoJSON in longitude and latitude, unless there is no CRS. The path of a
    stream, which has the `form`, is "-".
    """
    suffix = Path(path).suffix.lower()
    if path == "-" and form.projected:
        return
    if suffix == ".kml" or (wkt is not None and (suffix in (".geojson", ".json") or path == "-")):
        to_wgs84.check_on_earth(wkt)


def _write_text(regions: Regions, path: Path) -> None:
    is_kml = path.suffix.lower() == ".kml"
    write = text_writers.write_kml if is_kml else text_writers.write_geojson
    with path.open("wb") as stream:
        write(regions, stream)


def _write_geopackage(regions: Regions, path: Path) -> None:
    from uavseg.regions.formats.geopackage import write_geopackage

    write_geopackage(regions, path, LAYER, _DATE)


def _write_shapefile(regions: Regions, path: Path) -> None:
    columns = {_SHORT_NAMES.get(name, name): column for name, column in regions.columns.items()}
    if len({name[:10].lower() for name in columns}) < len(columns):
        raise OutputError("a Shapefile cuts names to ten characters: two columns share one; write .gpkg")
    renamed = Regions(columns, regions.polygons, regions.wkt)  # without metadata: a Shapefile has none
    _write_layer(renamed, path, "ESRI Shapefile", DBF_DATE_LAST_UPDATE=_DATE[:10])


def _write_layer(regions: Regions, path: Path, driver: str, **options: str) -> None:
    """Write one layer with GDAL; warnings are muted."""
    import pyogrio.raw
    from pyogrio.errors import DataLayerError, DataSourceError

    promote = has_multipolygons(regions.polygons)
    polygons = np.asarray(regions.polygons)
    with changing_filters(), gdal_options({"OGR_CURRENT_DATE": _DATE}):  # one thread at a time
        warnings.simplefilter("ignore")
        try:
            pyogrio.raw.write(
                path,
                shapely.to_wkb(as_multipolygons(polygons) if promote else polygons),
                field_data=list(regions.columns.values()),
                fields=list(regions.columns),
                layer=LAYER,
                driver=driver,
                geometry_type="MultiPolygon" if promote else "Polygon",
                crs=regions.wkt,
                layer_options=options,
                layer_metadata=metadata_items(regions.metadata) or None,
            )
        except (DataSourceError, DataLayerError) as error:
            reason = textwrap.shorten(str(error).rpartition("failed: ")[2], 200)  # GDAL quotes long SQL
            raise OutputError(f"GDAL cannot write the regions as {driver}: {reason}") from error
    if not is_complete(path, len(regions)):
        raise OutputError(f"{path.name} cannot be written whole; is the disk full?")


def _write_parquet(regions: Regions, path: Path) -> None:
    pyarrow = import_pyarrow()
    aliases = {name: _ARROW_TYPES[column.dtype.kind] for name, column in regions.columns.items()}
    fields = [(name, pyarrow.type_for_alias(alias)) for name, alias in aliases.items()]
    schema = pyarrow.schema([*fields, ("geometry", pyarrow.binary())])
    column: dict[str, Any] = {
        "encoding": "WKB",
        "geometry_types": sorted({polygon.geom_type for polygon in regions.polygons}),
        "crs": None if regions.wkt is None else parse_crs(regions.wkt).to_json_dict(),
    }
    if len(regions):
        with changing_filters():  # shapely changes them itself
            column["bbox"] = [float(bound) for bound in shapely.total_bounds(regions.polygons)]
    about = {"version": "1.0.0", "primary_column": "geometry", "columns": {"geometry": column}}
    geo = {"geo": json.dumps(about)}
    schema = schema.with_metadata(geo | metadata_items(regions.metadata))
    with pyarrow.parquet.ParquetWriter(path, schema, compression="zstd") as file:
        for part in batch_slices(regions.polygons):
            columns = [column[part] for column in regions.columns.values()]
            columns.append(shapely.to_wkb(regions.polygons[part]))
            arrays = [_arrow_array(values, kind) for values, kind in zip(columns, schema.types, strict=True)]
            file.write_batch(pyarrow.record_batch(arrays, schema=schema))


def _arrow_array(column: NDArray[Any], kind: Any) -> Any:
    """Return a column as an array of pyarrow; NaN and None are null."""
    # Not `pyarrow.array`, which imports pandas to see that a column is none of its arrays: 0.16 s. An
    # OutputError says that its texts or bytes have more than 2 GB.
    pyarrow = import_pyarrow()
    buffers: tuple[NDArray[Any] | bytes, ...]
    if column.dtype != object:
        there, buffers = column == column, (np.ascontiguousarray(column),)
    else:
        values = [text.encode() if isinstance(text, str) else text for text in column]
        there = np.array([isinstance(value, bytes) for value in values], bool)
        parts = [value if is_there else b"" for value, is_there in zip(values, there, strict=True)]
        ends = np.cumsum([0, *map(len, parts)])
        if ends[-1] > np.iinfo(np.int32).max:
            raise OutputError("one batch of regions holds more than 2 GB of text or corners; simplify them")
        buffers = (ends.astype(np.int32), b"".join(parts))
    mask = None if there.all() else pyarrow.py_buffer(np.packbits(there, bitorder="little"))
    return pyarrow.Array.from_buffers(kind, len(column), [mask, *map(pyarrow.py_buffer, buffers)])


_WRITERS: dict[str, Callable[[Regions, Path], None]] = {
    ".geojson": _write_text,
    ".json": _write_text,
    ".gpkg": _write_geopackage,
    ".fgb": partial(_write_layer, driver="FlatGeobuf"),
    ".parquet": _write_parquet,
    ".shp": _write_shapefile,
    ".kml": _write_text,
}


def is_complete(path: Path, count: int) -> bool:
    """Check whether a .fgb or .shp that GDAL wrote is complete: it does not report a full disk.

    By the layout of FlatGeobuf 3 (magic, header, packed Hilbert R-tree, features, each preceded by its size);
    and the file lengths stated in the headers of shapefiles (ESRI Shapefile Technical Description, 1998) and
    dBASE III tables. `count` regions were written.
    """
    check = {".fgb": _flatgeobuf, ".shp": _shapefile}[path.suffix.lower()]
    try:
        return check(path, count)
    except (OSError, struct.error, ValueError):
        return False


def _flatgeobuf(path: Path, count: int) -> bool:
    import mmap

    with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
        nodes, level = count, count
        while level > 1:
            level = -(-level // _BRANCHES)
            nodes += level
        nodes += count == 1  # a single feature has a root above it
        position = 12 + struct.unpack_from("<I", data, 8)[0] + nodes * _NODE_BYTES
        for _ in range(count):
            position += 4 + struct.unpack_from("<I", data, position)[0]
        return bool(position == len(data))


def _shapefile(path: Path, count: int) -> bool:
    table, index, crs = (path.with_suffix(end) for end in (".dbf", ".shx", ".prj"))
    for part in (path, index):
        if 2 * struct.unpack_from(">i", read_start(part), 24)[0] != part.stat().st_size:
            return False
    records, header, width = struct.unpack_from("<IHH", read_start(table), 4)
    table_bytes = header + records * width + 1  # an end mark follows the records
    table_complete = table.stat().st_size == table_bytes and records == count
    index_complete = index.stat().st_size == 100 + 8 * count
    wkt = crs.read_text() if crs.exists() else "[]"
    return table_complete and index_complete and wkt.count("[") == wkt.count("]") > 0


def check_labels(path: Path_, overwrite: bool = False) -> None:
    """Refuse a path where labels cannot be written; call it before computing them.

    A ParameterError says that the name ends neither in .tif nor in .vrt, an OutputExistsError or OutputError
    that a file exists that may not be replaced, or that the folder cannot be written to.
    """
    if is_vrt(path):
        check_label_tiles(path, overwrite)
        return
    check_target(path, overwrite)
    if Path(path).suffix.lower() not in (".tif", ".tiff"):
        raise ParameterError(
            f"labels are written as GeoTIFF; name a .tif, or a .vrt for many tiles, not {path}"
        )


def is_vrt(path: Path_) -> bool:
    """Check whether labels of that name are written as tiles under a VRT."""
    return Path(path).suffix.lower() == ".vrt"


def write_label_raster(
    path: Path_,
    rings: Rings,
    geobox: GeoBox,
    map: Map = serial,
    overwrite: bool = False,
    creation: CreationOptions = DEFAULT,
) -> None:
    """Write the labels of regions: one GeoTIFF, or for a .vrt tiles that the executor's workers write.

    The pixels of both are the same, and depend on neither tiles nor workers. For the path see `check_labels`.
    """
    if is_vrt(path):
        parts = edge_tables(rings, label_windows(geobox.shape))
        write_label_tiles(path, parts, geobox, overwrite, map, creation)
    else:
        strips = label_strips(rings, geobox.shape, map)
        geotiff.write_label_geotiff(path, strips, geobox, overwrite, creation=creation)


def label_strips(rings: Rings, shape: tuple[int, int], map: Map = serial) -> Iterator[tuple[Window, Uint32s]]:
    """Rasterise labels in windows of full width, from top to bottom; `shape` is rows and columns."""
    rows, cols = shape
    strip = max((1 << 24) // cols // BLOCK, 1) * BLOCK
    windows = tiles((rows, cols), (strip, -(-cols // BLOCK) * BLOCK))
    return zip(windows, map(EdgeTable.rasterise, edge_tables(rings, windows)), strict=True)
