"""`uavseg info`: what a raster is and what to try with it, or what a file of regions holds."""

import sys
from typing import Any

from uavseg.cli.command import job_command
from uavseg.cli.terminal.say import saying_decisions, show
from uavseg.options.regions import InfoOptions


@job_command("info", InfoOptions)
def command(options: InfoOptions) -> None:
    """Tell the size, place, bands, nodata and intensity of RASTER (many are one mosaic), how that intensity
    is stretched, and a command to try next: the rarer of dark and bright pixels. `uavseg suggest` takes
    longer and proposes ranges from the means of leaves, with what each would give.

    Every pixel is counted up to 100 megapixels; a larger raster is looked at from afar, and it is said so.

    RASTER may also be a file of regions (.geojson, .gpkg, .fgb, .parquet, .shp, .kml): then its format, CRS,
    extent and columns are told, and from what and how the regions were made, where the file says so.
    """
    from uavseg.jobs.info import names_regions

    if options.verbose:
        saying_decisions()
    regions = names_regions(options.source.rasters)
    text, values = _regions(options) if regions else _raster(options)
    if options.as_json:
        import json

        show(json.dumps(values, indent=2, allow_nan=False))
    else:
        show(_printable(text))


def _raster(options: InfoOptions) -> tuple[str, dict[str, Any]]:
    from uavseg.execution.executors import threads
    from uavseg.jobs.info import info, open_to_describe
    from uavseg.jobs.source.work import Work
    from uavseg.plot.summary_text import summary_text

    source = open_to_describe(options.source.rasters, options.read)
    summary = info(source, Work(executor=threads(options.threads)), options.source.rasters)
    return summary_text(summary), summary.as_dict()


def _regions(options: InfoOptions) -> tuple[str, dict[str, Any]]:
    from uavseg.jobs.info import info_regions
    from uavseg.plot.summary_text import region_file_text

    found = info_regions(options.source.rasters, options.read)
    return region_file_text(found), found.as_dict()


def _printable(text: str) -> str:
    """Return the text with # for bars where the terminal's encoding has none."""
    encoding = getattr(sys.stdout, "encoding", None) or "utf-8"
    try:
        text.encode(encoding)
    except UnicodeEncodeError:
        return "".join(
            "#" if "▁" <= letter <= "█" else "" if "█" < letter <= "▏" else letter for letter in text
        )
    return text
