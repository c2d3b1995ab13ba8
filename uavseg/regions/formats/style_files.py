"""Styles where GIS programs find them: in a GeoPackage (layer_styles of QGIS), or beside other files."""

import os
import sqlite3
from collections.abc import Sequence
from contextlib import closing
from pathlib import Path

from uavseg.errors import OutputError
from uavseg.output.atomic import atomic_file, check_target
from uavseg.regions.formats.styles import Class, qml, sld
from uavseg.regions.table import Regions

STYLE_TABLE = "layer_styles"
_CREATE = f"""CREATE TABLE {STYLE_TABLE} (
    id INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL, f_table_catalog TEXT(256), f_table_schema TEXT(256),
    f_table_name TEXT(256), f_geometry_column TEXT(256), styleName TEXT(30), styleQML TEXT, styleSLD TEXT,
    useAsDefault BOOLEAN, description TEXT, owner TEXT(30), ui TEXT(30), update_time DATETIME)"""


def style_path(target: str | os.PathLike[str], kind: str) -> Path:
    """The style file of a file of regions: the same stem, .qml or .sld.

    Raises
    ------
    OutputError
        If the kind is another.
    """
    if kind not in ("qml", "sld"):
        raise OutputError(f"a style is qml (of QGIS) or sld, not {kind!r}")
    return Path(target).with_suffix(f".{kind}")


def check_style(target: str | os.PathLike[str], kind: str, overwrite: bool = False) -> Path:
    """The style file of a file of regions, if it may be made.

    Raises
    ------
    OutputError
        As of `style_path` and `check_target`.
    """
    return check_target(style_path(target, kind), overwrite)


def write_style(
    regions: Regions,
    target: str | os.PathLike[str],
    kind: str,
    overwrite: bool = False,
    colors: Sequence[Class] = (),
) -> Path:
    """Write the style of regions beside their file.

    Parameters
    ----------
    regions : Regions
    target : path
        The file of the regions.
    kind : {"qml", "sld"}
    overwrite : bool
    colors : sequence of (name, colour)
        Of classes, see `classes_of`.

    Returns
    -------
    path : Path

    Raises
    ------
    OutputError
        As of `check_style`, and if it cannot be written.
    """
    path = check_style(target, kind, overwrite)
    text = qml(regions, colors) if kind == "qml" else sld(regions, Path(target).stem, colors)
    with atomic_file(path, overwrite) as part:
        part.write_text(text, encoding="utf-8")
    return path


def add_style(path: Path, regions: Regions, layer: str, date: str) -> None:
    """Add the style of a layer to a GeoPackage, as its default.

    Parameters
    ----------
    path : Path
        A GeoPackage that is complete.
    regions : Regions
    layer : str
    date : str
        Of the change, such as "2000-01-01T00:00:00Z".

    Raises
    ------
    OutputError
        If it cannot be written.
    """
    changed = date.replace("Z", ".000Z")
    styles = qml(regions), sld(regions, layer)
    try:
        with closing(sqlite3.connect(path)) as base, base:
            [(geometry,)] = base.execute(
                "SELECT column_name FROM gpkg_geometry_columns WHERE table_name = ?", [layer]
            )
            row = ("", "", layer, geometry, layer, *styles, True, "", "", None, changed)
            base.execute(_CREATE)
            base.execute(f"INSERT INTO {STYLE_TABLE} VALUES (1, {', '.join('?' * 12)})", row)
            base.execute(
                "INSERT INTO gpkg_contents (table_name, data_type, identifier, description, last_change, "
                "srs_id) VALUES (?, 'attributes', ?, '', ?, 0)",
                (STYLE_TABLE, STYLE_TABLE, date),
            )
            base.execute("INSERT INTO gpkg_ogr_contents VALUES (?, 1)", [STYLE_TABLE])
    except sqlite3.Error as error:
        raise OutputError(f"{path.name} cannot be given a style ({error}); is the disk full?") from error
