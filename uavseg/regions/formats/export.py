"""Regions as files: the format follows from the name, and a file appears whole or not at all."""

import io
import json
import os
import textwrap
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

import shapely
from numpy.typing import NDArray

from uavseg.atomic import check_target, whole_file
from uavseg.errors import OutputError
from uavseg.regions import shapes
from uavseg.regions.formats import geojson, kml
from uavseg.regions.formats.check_written import is_whole
from uavseg.regions.shapes import has_multipolygons
from uavseg.regions.table import Regions
from uavseg.regions.wgs84 import to_wgs84

LAYER = "regions"
_GEOMETRY = "geometry"
_KINDS = {"i": "int64", "f": "float64", "O": "string"}  # numpy's kinds as Arrow's types
_DAY = "2000-01-01T00:00:00Z"  # same regions, same bytes: files do not say when they were written
_SHORT_NAMES = {
    "perimeter_m": "perim_m",
    "range_low": "range_lo",
    "range_high": "range_hi",
}  # ten letters at most


def write(regions: Regions, path: str | os.PathLike[str] | IO[Any], overwrite: bool = False) -> None:
    """Write regions to a file whose extension says the format, or as GeoJSON to an open stream.

    Parameters
    ----------
    regions : Regions
    path : path or file
        .geojson, .json, .gpkg, .fgb, .parquet, .shp or .kml. GeoJSON and KML are WGS 84; the others keep the
        regions' CRS. A stream, binary or text, gets GeoJSON.
    overwrite : bool
        Whether a file that is there may be replaced.

    Raises
    ------
    OutputExistsError
        If the file is there and `overwrite` is false.
    OutputError
        If the extension is not known, the place cannot be written to, or the format cannot hold the regions.
    """
    if not isinstance(path, str | os.PathLike):
        _stream(regions, path)
        return
    target = check(path, overwrite)
    with whole_file(target, overwrite) as part:
        _WRITERS[target.suffix.lower()](regions, part)


def check(path: str | os.PathLike[str], overwrite: bool = False) -> Path:
    """The path, if regions may be written there; call it before the work that makes them.

    Raises
    ------
    OutputExistsError, OutputError
        As `write`.

    Examples
    --------
    >>> check("regions.tif")
    Traceback (most recent call last):
    ...
    uavseg.errors.OutputError: regions.tif: regions are written to .geojson, .json, .gpkg, .fgb, ...
    """
    if Path(path).suffix.lower() not in _WRITERS:
        *known, last = _WRITERS
        raise OutputError(f"{path}: regions are written to {', '.join(known)} or {last}")
    return check_target(path, overwrite)


def check_crs(path: str | os.PathLike[str], wkt: str | None) -> None:
    """Whether regions of a CRS may be written to a file of this name, or to a stream, which is "-".

    Raises
    ------
    OutputError
        If they have no place on the Earth, which KML needs, and GeoJSON where there is a CRS.
    """
    suffix = Path(path).suffix.lower()
    if suffix == ".kml" or (wkt is not None and (suffix in (".geojson", ".json") or path == "-")):
        to_wgs84.check_crs(wkt)


def _stream(regions: Regions, stream: IO[Any]) -> None:
    try:
        if hasattr(stream, "encoding"):
            text = io.BytesIO()
            geojson.dump(regions, text)
            stream.write(text.getvalue().decode())
        else:
            geojson.dump(regions, stream)
        stream.flush()
    except BrokenPipeError:
        raise  # whoever reads has enough
    except OSError as error:
        raise OutputError(
            f"the regions cannot be written to the stream: {error.strerror or error}"
        ) from error


def _write_geojson(regions: Regions, path: Path) -> None:
    with path.open("wb") as stream:
        geojson.dump(regions, stream)


def _write_geopackage(regions: Regions, path: Path) -> None:
    _write_layer(regions, path, "GPKG")


def _write_flatgeobuf(regions: Regions, path: Path) -> None:
    _write_layer(regions, path, "FlatGeobuf")


def _write_shapefile(regions: Regions, path: Path) -> None:
    columns = {_SHORT_NAMES.get(name, name): column for name, column in regions.columns.items()}
    named = Regions(columns, regions.polygons, regions.wkt)
    _write_layer(named, path, "ESRI Shapefile", DBF_DATE_LAST_UPDATE=_DAY[:10])


def _write_kml(regions: Regions, path: Path) -> None:
    with path.open("wb") as stream:
        kml.dump(regions, stream)


def _write_layer(regions: Regions, path: Path, driver: str, **options: str) -> None:
    """Write with GDAL, which is not to say a word about it; batch by batch, so that no file is held whole."""
    import pyogrio.raw
    from pyogrio.errors import DataLayerError, DataSourceError

    several = has_multipolygons(regions.polygons)
    with _gdal_on(_DAY), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            pyogrio.raw.write_arrow(
                _batches(regions, promoted=several),
                path,
                layer=LAYER,
                driver=driver,
                geometry_name=_GEOMETRY,
                geometry_type="MultiPolygon" if several else "Polygon",
                crs=regions.wkt,
                layer_options=options,
            )
        except (DataSourceError, DataLayerError) as error:
            reason = textwrap.shorten(str(error).rpartition("failed: ")[2], 200)  # GDAL quotes long SQL
            raise OutputError(f"GDAL cannot write the regions as {driver}: {reason}") from error
    if not is_whole(path, len(regions)):
        raise OutputError(f"{path.name} cannot be written whole; is the disk full?")


def _batches(regions: Regions, promoted: bool = False) -> Any:
    """The regions as a stream of Arrow batches; with `promoted`, every geometry is a MultiPolygon."""
    import pyarrow

    kinds = {name: _KINDS[column.dtype.kind] for name, column in regions.columns.items()}
    schema = pyarrow.schema([*((name, pyarrow.type_for_alias(kind)) for name, kind in kinds.items())])
    schema = schema.append(pyarrow.field(_GEOMETRY, pyarrow.binary()))

    def made() -> Iterator[Any]:
        for part in shapes.batch_slices(regions.polygons):
            polygons = regions.polygons[part]
            if promoted:
                polygons = _multi(polygons)
            columns = [_null_for_nan(column[part]) for column in regions.columns.values()]
            yield pyarrow.record_batch([*columns, pyarrow.array(shapely.to_wkb(polygons))], schema=schema)

    return pyarrow.RecordBatchReader.from_batches(schema, made())


def _multi(polygons: NDArray[Any]) -> NDArray[Any]:
    """Every geometry as a MultiPolygon."""
    parts, owners = shapely.get_parts(polygons, return_index=True)
    whole: NDArray[Any] = shapely.multipolygons(parts, indices=owners)
    return whole


@contextmanager
def _gdal_on(day: str) -> Iterator[None]:
    """GDAL that takes this for the current day."""
    import pyogrio

    before = pyogrio.get_gdal_config_option("OGR_CURRENT_DATE")
    pyogrio.set_gdal_config_options({"OGR_CURRENT_DATE": day})
    try:
        yield
    finally:
        pyogrio.set_gdal_config_options({"OGR_CURRENT_DATE": before})


def _write_parquet(regions: Regions, path: Path) -> None:
    """GeoParquet 1.0."""
    from pyarrow import parquet

    batches = _batches(regions)
    schema = batches.schema.with_metadata({"geo": json.dumps(_geo(regions))})
    with parquet.ParquetWriter(path, schema, compression="zstd") as file:
        for batch in batches:
            file.write_batch(batch.replace_schema_metadata(schema.metadata))


def _null_for_nan(column: NDArray[Any]) -> Any:
    import pyarrow

    kind = pyarrow.string() if column.dtype == object else None
    return pyarrow.array(column, kind, from_pandas=True)


def _geo(regions: Regions) -> dict[str, Any]:
    """What GeoParquet says of its geometry column."""
    import pyproj

    column: dict[str, Any] = {
        "encoding": "WKB",
        "geometry_types": sorted({polygon.geom_type for polygon in regions.polygons}),
        "crs": None if regions.wkt is None else pyproj.CRS.from_wkt(regions.wkt).to_json_dict(),
    }
    if len(regions):
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
