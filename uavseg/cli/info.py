"""uavseg info: what a raster is, and what to try with it."""

import sys
from dataclasses import replace

import click

from uavseg.cli._reading import reading_options


@click.command("info", short_help="Tell what a raster is and what its intensity looks like.")
@reading_options
@click.option("--json", "as_json", is_flag=True, help="Write JSON, for programs.")
@click.option("--threads", type=click.IntRange(min=1), help="Threads to count with.  [default: all cores]")
def command(
    rasters: tuple[str, ...],
    band: int | None,
    rgb: tuple[int, int, int] | None,
    nodata: float | None,
    stretch: str,
    skip_bad_tiles: bool,
    as_json: bool,
    threads: int | None,
) -> None:
    """Tell the size, place, bands, nodata and intensity of RASTER (many are one mosaic), how that intensity
    is stretched, and a command to try next: the rarer of dark and bright pixels. `uavseg suggest` takes
    longer and proposes ranges from the means of leaves, with what each would give.

    Every pixel is counted up to 100 megapixels; a larger raster is looked at from afar, and it is said so.
    """
    from uavseg.execution.executors import threads as workers
    from uavseg.raster.bad_blocks import BadBlock, recording_bad_blocks, with_bad_blocks
    from uavseg.raster.dataset import Dataset
    from uavseg.raster.summary import summarize

    dataset = Dataset.open(rasters, band=band, rgb=rgb, nodata=nodata, skip_bad_tiles=skip_bad_tiles)
    bad: set[BadBlock] = set()
    with recording_bad_blocks(bad):
        summary = summarize(dataset, stretch, with_bad_blocks(workers(threads), bad))
    summary = replace(summary, warnings=(*summary.warnings, *map(str, sorted(bad))))
    if as_json:
        import json

        click.echo(json.dumps(summary.as_dict(), indent=2, allow_nan=False))
        return
    from uavseg.plot.summary_text import summary_text

    click.echo(_printable(summary_text(summary)))


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
