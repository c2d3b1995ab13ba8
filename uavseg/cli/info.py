"""`uavseg info`: what a raster is and what to try with it, or what a file of regions holds."""

import json
import sys

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
    from uavseg.jobs.info import info, info_regions, names_regions, open_to_describe
    from uavseg.plot.summary_text import region_file_text, summary_text

    if options.verbose:
        saying_decisions()
    rasters = options.source.rasters
    if names_regions(rasters):
        file = info_regions(rasters, options.read)
        text, values = region_file_text(file), file.as_dict()
    else:
        from uavseg.execution.executors import threads
        from uavseg.jobs.source.work import Work

        work = Work(executor=threads(options.threads))
        summary = info(open_to_describe(rasters, options.read), work, rasters)
        text, values = summary_text(summary), summary.as_dict()
    if options.as_json:
        show(json.dumps(values, indent=2, allow_nan=False))
    else:
        encoding = getattr(sys.stdout, "encoding", None) or "utf-8"
        try:
            text.encode(encoding)
        except UnicodeEncodeError:  # no bars: # in their place
            text = "".join(
                "#" if "▁" <= letter <= "█" else "" if "█" < letter <= "▏" else letter for letter in text
            )
        show(text)
