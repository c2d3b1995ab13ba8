"""Write regions to vector files; the extension determines the format, and writing is atomic."""

import io
import json
import os
import textwrap
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

import shapely

from uavseg.errors import OutputError
from uavseg.output.atomic import atomic_file, check_target
from uavseg.raster.geodesy.globe import parse_crs
from uavseg.regions.formats import geojson
from uavseg.regions.formats.geojson import COLLECTION, GeoJsonForm
from uavseg.regions.formats.metadata import metadata_items
from uavseg.regions.formats.parquet import import_pyarrow
from uavseg.regions.shapes import has_multipolygons
from uavseg.regions.table import Regions
from uavseg.regions.wgs84 import to_wgs84
from uavseg.warning_filters import changing_filters

if TYPE_CHECKING:
    from uavseg.regions.formats.arrow_stream import RegionStream

LAYER = "regions"
_ARROW_TYPES = {"i": "int64", "f": "float64", "O": "string"}  # by the kind of a numpy dtype
_DATE = "2000-01-01T00:00:00Z"  # reproducible files: the same regions give the same bytes on any day
_SHORT_NAMES = {
    "perimeter_m": "perim_m",
    "range_low": "range_lo",
    "range_high": "range_hi",
}  # a shapefile's names have at most ten characters


def write_regions(
    regions: Regions,
    path: str | os.PathLike[str] | IO[Any],
    overwrite: bool = False,
    form: GeoJsonForm = COLLECTION,
) -> None:
    """Write regions to a file in the format of its extension, or as GeoJSON to an open stream.

    Parameters
    ----------
    regions : Regions
    path : path or file
        .geojson, .json, .gpkg, .fgb, .parquet, .shp or .kml. GeoJSON and KML are in WGS 84; the others keep
        the CRS of the regions. A stream may be binary or text.
    overwrite : bool
        Whether an existing file may be replaced.
    form : GeoJsonForm
        Of the GeoJSON on a stream.

    Raises
    ------
    OutputExistsError
        If the file exists and `overwrite` is false.
    OutputError
        If the extension is unknown, the file cannot be written, or the format cannot hold the regions.
    """
    if not isinstance(path, str | os.PathLike):
        _write_stream(regions, path, form)
        return
    target = check_region_path(path, overwrite)
    with atomic_file(target, overwrite) as part:
        _WRITERS[target.suffix.lower()](regions, part)


def check_region_path(path: str | os.PathLike[str], overwrite: bool = False) -> Path:
    """The path, if regions can be written there; call it before the work that makes them.

    Raises
    ------
    OutputExistsError, OutputError
        As `write_regions`.

    Examples
    --------
    >>> check_region_path("regions.tif")
    Traceback (most recent call last):
    ...
    uavseg.errors.OutputError: regions.tif: regions are written to .geojson, .json, .gpkg, .fgb, ...
    """
    suffix = Path(path).suffix.lower()
    if suffix == ".parquet":
        import_pyarrow()
    if suffix not in _WRITERS:
        *known, last = _WRITERS
        raise OutputError(f"{path}: regions are written to {', '.join(known)} or {last}")
    return check_target(path, overwrite)


def format_notes(regions: Regions, path: str | os.PathLike[str]) -> list[str]:
    """What a reader of the format of a file cannot show of regions that are written to it, for warnings."""
    if Path(path).suffix.lower() != ".kml":
        return []
    from uavseg.regions.formats.kml import kml_notes

    return kml_notes(regions)


def suffix_for(wkt: str | None) -> str:
    """The extension of a file of regions in a CRS: that of GeoJSON, unless it cannot hold them."""
    try:
        check_region_crs("regions.geojson", wkt)
    except OutputError:
        return ".gpkg"
    return ".geojson"


def check_region_crs(path: str | os.PathLike[str], wkt: str | None, form: GeoJsonForm = COLLECTION) -> None:
    """Check that regions in a CRS can be written to a file of this name, or to a stream ("-").

    Raises
    ------
    OutputError
        If the CRS is not one of the Earth: KML needs one, and so does GeoJSON in longitude and latitude,
        unless there is no CRS.
    """
    suffix = Path(path).suffix.lower()
    if path == "-" and form.projected:
        return
    if suffix == ".kml" or (wkt is not None and (suffix in (".geojson", ".json") or path == "-")):
        to_wgs84.check_on_earth(wkt)


def _write_stream(regions: Regions, stream: IO[Any], form: GeoJsonForm) -> None:
    try:
        if hasattr(stream, "encoding"):
            text = io.BytesIO()
            geojson.write_geojson(regions, text, form)
            stream.write(text.getvalue().decode())
        else:
            geojson.write_geojson(regions, stream, form)
        stream.flush()
    except BrokenPipeError:
        raise  # the reader has closed the pipe
    except OSError as error:
        raise OutputError(
            f"the regions cannot be written to the stream: {error.strerror or error}"
        ) from error


def _write_geojson(regions: Regions, path: Path) -> None:
    with path.open("wb") as stream:
        geojson.write_geojson(regions, stream)


def _write_geopackage(regions: Regions, path: Path) -> None:
    from uavseg.regions.formats.style_files import add_style

    _write_layer(regions, path, "GPKG")
    add_style(path, regions, LAYER, _DATE)


def _write_flatgeobuf(regions: Regions, path: Path) -> None:
    _write_layer(regions, path, "FlatGeobuf")


def _write_shapefile(regions: Regions, path: Path) -> None:
    columns = {_SHORT_NAMES.get(name, name): column for name, column in regions.columns.items()}
    renamed = Regions(columns, regions.polygons, regions.wkt)  # without metadata: a Shapefile has none
    _write_layer(renamed, path, "ESRI Shapefile", DBF_DATE_LAST_UPDATE=_DATE[:10])


def _write_kml(regions: Regions, path: Path) -> None:
    from uavseg.regions.formats.kml import write_kml

    with path.open("wb") as stream:
        write_kml(regions, stream)


def _write_layer(regions: Regions, path: Path, driver: str, **options: str) -> None:
    """Write one layer with GDAL in batches, so that the file is never held in memory; warnings are muted."""
    import pyogrio.raw
    from pyogrio.errors import DataLayerError, DataSourceError

    from uavseg.regions.formats.arrow_stream import GEOMETRY, RegionStream
    from uavseg.regions.formats.check_written import is_complete
    from uavseg.regions.formats.gdal_state import gdal_options

    promote = has_multipolygons(regions.polygons)
    stream = RegionStream(regions, promote)
    today = {"OGR_CURRENT_DATE": _DATE}
    with changing_filters(), gdal_options(today), _raising(stream):  # one thread at a time
        warnings.simplefilter("ignore")
        try:
            pyogrio.raw.write_arrow(
                stream,
                path,
                layer=LAYER,
                driver=driver,
                geometry_name=GEOMETRY,
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


@contextmanager
def _raising(stream: "RegionStream") -> Iterator[None]:
    """Context that raises what ended a stream too early, such as Ctrl-C, whatever its reader makes of it."""
    try:
        yield
    finally:
        if stream.stopped:
            raise stream.stopped[0] from None


def _write_parquet(regions: Regions, path: Path) -> None:
    """GeoParquet 1.0."""
    from uavseg.regions.formats.arrow_stream import GEOMETRY, batches

    pyarrow = import_pyarrow()
    types = {name: _ARROW_TYPES[column.dtype.kind] for name, column in regions.columns.items()}
    fields = [*((name, pyarrow.type_for_alias(kind)) for name, kind in types.items())]
    schema = pyarrow.schema([*fields, (GEOMETRY, pyarrow.binary())])
    geo = {"geo": json.dumps(_geo_metadata(regions))}
    schema = schema.with_metadata(geo | metadata_items(regions.metadata))
    with pyarrow.parquet.ParquetWriter(path, schema, compression="zstd") as file:
        for length, columns in batches(regions):
            arrays = [
                pyarrow.Array.from_buffers(
                    kind, length, [None if part is None else pyarrow.py_buffer(part) for part in parts]
                )
                for kind, parts in zip(schema.types, columns, strict=True)
            ]
            file.write_batch(pyarrow.record_batch(arrays, schema=schema))


def _geo_metadata(regions: Regions) -> dict[str, Any]:
    """GeoParquet metadata of the geometry column."""
    column: dict[str, Any] = {
        "encoding": "WKB",
        "geometry_types": sorted({polygon.geom_type for polygon in regions.polygons}),
        "crs": None if regions.wkt is None else parse_crs(regions.wkt).to_json_dict(),
    }
    if len(regions):
        with changing_filters():  # shapely changes them itself
            column["bbox"] = [float(bound) for bound in shapely.total_bounds(regions.polygons)]
    return {"version": "1.0.0", "primary_column": "geometry", "columns": {"geometry": column}}


_WRITERS: dict[str, Callable[[Regions, Path], None]] = {
    ".geojson": _write_geojson,
    ".json": _write_geojson,
    ".gpkg": _write_geopackage,
    ".fgb": _write_flatgeobuf,
    ".parquet": _write_parquet,
    ".shp": _write_shapefile,
    ".kml": _write_kml,
}
