"""Options of GeoJSON on standard output, as rasterio's and fiona's commands have them."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, TypeVar

import click

if TYPE_CHECKING:
    from uavseg.regions.formats.geojson import GeoJsonForm

F = TypeVar("F", bound=Callable[..., Any])


def stream_options(command: F) -> F:
    """Give a command --collection, --sequence, --rs and --projected; see `geojson_form`."""
    for option in reversed(
        (
            click.option(
                "--sequence/--collection",
                default=None,
                help="With -o -: one feature a line, or one collection.  [default: collection]",
            ),
            click.option(
                "--rs", is_flag=True, help="With -o -: a sequence with the character RS before each feature."
            ),
            click.option(
                "--geographic/--projected",
                default=None,
                help="With -o -: longitude and latitude, or the CRS of the raster.  [default: geographic]",
            ),
        )
    ):
        command = option(command)
    return command


def geojson_form(options: dict[str, Any], output: str) -> GeoJsonForm:
    """The form of GeoJSON on standard output.

    Raises
    ------
    UsageError
        If one is given and the output is a file, or a collection is to have RS.
    """
    from uavseg.regions.formats.geojson import GeoJsonForm

    sequence, rs, geographic = options["sequence"], options["rs"], options["geographic"]
    if output != "-" and (rs or sequence is not None or geographic is not None):
        raise click.UsageError(
            "--sequence, --collection, --rs, --geographic and --projected are for standard output; give them "
            "with -o -"
        )
    if rs and sequence is False:
        raise click.UsageError("--rs is for sequences, and --collection is none; give one of the two")
    return GeoJsonForm(geographic is False, bool(sequence or rs), rs)


def stream_warnings(form: GeoJsonForm, wkt: str | None) -> list[str]:
    """What a reader of the stream cannot know: the CRS of a sequence."""
    if not (form.sequence and form.projected) or wkt is None:
        return []
    from uavseg.regions.formats.geojson import crs_name

    name = crs_name(wkt)
    known = name.removeprefix("urn:ogc:def:crs:").replace("::", ":") if name else "the CRS of the raster"
    return [
        f"a sequence does not name its CRS; these coordinates are in {known}: say so to its reader (ogr2ogr "
        "-a_srs, fio load --src-crs), or give --collection"
    ]
