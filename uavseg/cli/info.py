"""`uavseg info`: what a raster is, and what to try with it."""

import sys
from typing import Any

import click

from uavseg.cli._say import show
from uavseg.cli.options.raster import read_options, reading_options


@click.command("info", short_help="Tell what a raster is and what its intensity looks like.")
@reading_options
@click.option("--json", "as_json", is_flag=True, help="Write JSON, for programs.")
@click.option("--threads", type=click.IntRange(min=1), help="Threads to count with.  [default: all cores]")
def command(**options: Any) -> None:
    """Tell the size, place, bands, nodata and intensity of RASTER (many are one mosaic), how that intensity
    is stretched, and a command to try next: the rarer of dark and bright pixels. `uavseg suggest` takes
    longer and proposes ranges from the means of leaves, with what each would give.

    Every pixel is counted up to 100 megapixels; a larger raster is looked at from afar, and it is said so.
    """
    from uavseg.execution.executors import threads
    from uavseg.jobs.info import info
    from uavseg.jobs.open_source import open_pixels
    from uavseg.jobs.work import Work

    source = open_pixels(options["rasters"], read_options(options))
    summary = info(source, Work(executor=threads(options["threads"])), options["rasters"])
    if options["as_json"]:
        import json

        show(json.dumps(summary.as_dict(), indent=2, allow_nan=False))
        return
    from uavseg.plot.summary_text import summary_text

    show(_printable(summary_text(summary)))


def _printable(text: str) -> str:
    """The text with # for bars where the terminal's encoding has none."""
    encoding = getattr(sys.stdout, "encoding", None) or "utf-8"
    try:
        text.encode(encoding)
    except UnicodeEncodeError:
        return "".join(
            "#" if "▁" <= letter <= "█" else "" if "█" < letter <= "▏" else letter for letter in text
        )
    return text
