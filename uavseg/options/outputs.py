"""Options that say what is written: files of regions, labels, streams, and one output for each raster."""

from __future__ import annotations

from uavseg.options.option import Options, option


class CreationOptions(Options):
    """Storage."""

    creation_options: tuple[str, ...] = option(
        "How a GeoTIFF is stored: COMPRESS=DEFLATE, LZW, ZSTD, LZMA, PACKBITS or NONE, ZLEVEL, ZSTD_LEVEL, "
        "PREDICTOR, BIGTIFF; several times for several. Its pixels stay the same.",
        "--co",
        default=(),
        type=str,
        multiple=True,
        metavar="NAME=VALUE",
        python=False,
    )


class RegionOutputs(Options):
    """Output."""

    output: str | None = option(
        "The regions: .geojson, .gpkg, .fgb, .parquet, .shp or .kml; - is GeoJSON on stdout.  "
        "[default: STEM.regions.geojson here]",
        *("-o", "--output"),
        metavar="PATH",
        python=False,
        basic=True,
    )
    labels: str | None = option(
        "Also write the labels of the regions as a raster: one .tif, or a .vrt over a folder of tiles.",
        metavar="PATH",
        python=False,
    )
    style: str | None = option(
        "Also write a style for GIS programs beside the regions: STEM.qml for QGIS, or STEM.sld. "
        "A .gpkg carries its style in any case.",
        choices=("qml", "sld"),
        python=False,
    )
    sequence: bool | None = option(
        "With -o -: one feature a line, or one collection.  [default: collection]",
        "--sequence/--collection",
        type=bool,
        python=False,
    )
    rs: bool = option(
        "With -o -: a sequence with the character RS before each feature.", default=False, python=False
    )
    geographic: bool | None = option(
        "With -o -: longitude and latitude, or the CRS of the raster.  [default: geographic]",
        "--geographic/--projected",
        type=bool,
        python=False,
    )


class EachOptions(Options):
    """Each of many rasters."""

    each: bool = option(
        "Each raster by itself, to an output of its own: -o 'out/{stem}.gpkg'. {stem} is its name without "
        "folder and extension, {name} with its extension, {suffix} the extension, {parent} the name of its "
        "folder, {number} its place. What fails does not stop the others.",
        default=False,
        python=False,
    )
    report: str | None = option(
        "With --each: also a table of what came out of each.", metavar="PATH.csv", python=False
    )
    skip_existing: bool = option(
        "With --each: leave out rasters whose output is there, so that a run goes on.",
        default=False,
        python=False,
    )
