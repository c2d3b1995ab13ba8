"""`uavseg preview`, `map`, `serve` and `info`: a raster, what was found in it, and missions."""

import json
import sys
from dataclasses import fields, replace
from functools import partial
from pathlib import Path

import click

from uavseg.cli.command import job_command
from uavseg.cli.terminal.say import Reporter, saying_decisions, show, work_of
from uavseg.cli.write import warnings_of
from uavseg.errors import ParameterError
from uavseg.options.pages import MapOptions, PreviewOptions, ServeOptions
from uavseg.options.reading import ReadOptions
from uavseg.options.regions import InfoOptions

_LAYERS = ("levels", "states", "leaves", "labels", "regions", "path", "mission")


@job_command("preview", PreviewOptions)
def command(options: PreviewOptions, reporter: Reporter) -> None:
    """Draw RASTER (many are one mosaic, a YAML file is a ROS map) as a PNG picture, three bands in their
    colours and one in grey, with a scale bar and what is named: the outlines and ids of regions, the legs of
    missions in their order with their fence, the states or the levels of segments, the contours of labels,
    the leaves of the quadtree, a path. The surer a region is, the stronger it is filled; lines are dashed
    below a confidence of 0.8 and dotted below 0.5.

    Without RASTER, missions are drawn on a blank map, with a profile of their heights below; then FILE.plan
    may be given in place of --mission FILE.plan.

    However large the raster is, no more of it is read than the picture can show. A map of probabilities is
    drawn with free cells black and occupied ones white (--stretch none, where it holds floats and neither
    --states nor --path are given).
    """
    missions = _missions_alone(options)
    if missions:
        _draw_missions(missions, options, reporter)
    else:
        _draw_raster(options, reporter)


def _missions_alone(options: PreviewOptions) -> list[str]:
    """Return the missions that are drawn without a raster; empty where there is one."""
    from uavseg.flight.formats.files import FORMATS

    rasters, missions = options.rasters, options.mission or ()
    if not rasters and not missions:
        raise click.UsageError("Missing argument 'RASTER...': give a raster, or a mission with --mission.")
    flights = [name for name in rasters if Path(name).suffix.lower() in FORMATS]
    if len(flights) == len(rasters):
        return [*flights, *missions]
    if flights:
        both = f"{flights[0]} is a mission and {next(name for name in rasters if name not in flights)} is a"
        raise ParameterError(f"{both} raster; to draw it over the raster, give --mission {flights[0]}")
    if options.dem:
        why = "--dem is for the profile of a mission without a raster"
        raise ParameterError(f"{why}; leave RASTER or --dem out")
    return []


def _draw_missions(missions: list[str], options: PreviewOptions, reporter: Reporter) -> None:
    from uavseg.plot.preview_missions import preview_missions

    given = [name for name in _LAYERS[:-1] if getattr(options, name) is not None]
    usual = ReadOptions(stretch="auto")
    names = [field.name for field in fields(usual)]
    given += [name for name in names if getattr(options.read, name) != getattr(usual, name)]
    if given:
        raise ParameterError(f"--{given[0].replace('_', '-')} needs a raster to draw on: give RASTER as well")
    out = options.output or f"{Path(missions[0]).stem}.preview.png"
    dem, width, overwrite = options.dem, options.width, options.files.overwrite
    how = partial(preview_missions, dem=dem, width_px=width, overwrite=overwrite)
    _, notes = warnings_of(lambda: how(missions, out))
    for note in notes:
        reporter.say(f"note: {note}")
    reporter.say(f"wrote {out}")


def _draw_raster(options: PreviewOptions, reporter: Reporter) -> None:
    from uavseg.jobs.source.open_source import open_pixels
    from uavseg.jobs.source.source import ProbabilityMap
    from uavseg.jobs.source.work import Work
    from uavseg.plot.preview import preview
    from uavseg.raster.intensity.stretch import StretchSpec

    source = open_pixels(options.rasters, replace(options.read, stretch=None))
    is_map, stretch = isinstance(source, ProbabilityMap), options.read.spec
    if is_map and stretch == StretchSpec("auto"):  # a ROS map has one of its own
        stretch = source.stretch
    assert stretch is not None  # "auto" by default
    out = options.output or f"{Path(source.name).stem}.preview.png"
    drawn = {name: getattr(options, name) for name in _LAYERS}
    drawn |= {"width_px": options.width, "overwrite": options.files.overwrite}
    collar, work = "keep" if is_map else options.read.collar, Work()
    with work.reading_here():
        _, notes = warnings_of(lambda: preview(source.dataset, out, **drawn, stretch=stretch, collar=collar))
    reporter.finish((*source.warnings, *work.bad_block_warnings, *notes))
    reporter.say(f"wrote {out}")


@job_command("map", MapOptions)
def map(options: MapOptions, reporter: Reporter) -> None:  # noqa: A001 - the name of the command
    """Make one HTML file of RASTER... (many are one mosaic) that a browser shows without network: the raster,
    regions, missions, and a slider that extracts regions of a range at the scale of blocks.

    Its regions are those of `uavseg extract` from the block map that divide writes, with --refine none, for
    ranges in thousandths of v, of the intensity that --regions were made from where they say it and no other
    is chosen. Regions are chosen by tick boxes and downloaded as GeoJSON.
    """
    from uavseg.jobs.web_map.content import FieldMapRequest, field_map
    from uavseg.plot.web.field_map import PageFile
    from uavseg.raster.read.source_list import stem_of

    request = FieldMapRequest(options.division.segment_params(), options.size.size)
    rasters, overwrite = options.source.rasters, options.files.overwrite
    output = options.output or f"{stem_of(rasters[0])}.map.html"
    page = PageFile.prepared(
        output, overwrite, rasters, options.regions, options.mission, options.camera, options.installable
    )
    source = page.open_source(rasters, options.read)
    found = field_map(source, request, work_of(options.run, reporter))
    size, notes = page.write(found)
    reporter.finish(notes)
    rows, cols = found.image.shape
    reporter.timed_table(
        page=f"{size / 1e6:.2f} MB -> {output}",
        picture=f"{cols} x {rows} pixels",
        intensity=f"{found.info.band_names}, stretch {found.info.stretch.name}",
        regions="-" if page.regions is None else f"{len(page.regions['features']):,}",
        missions=f"{len(page.flights)}",
    )


@job_command("serve", ServeOptions)
def serve(options: ServeOptions, reporter: Reporter) -> None:
    """Serve the page of RASTER... (many are one mosaic) to a browser on this computer, until Ctrl-C.

    The page is that of `uavseg map`, with tiles in full resolution, exact regions of a range or like a
    sample, keep-out zones and home drawn on the map, and missions; with --photos, the footprints of
    photographs and what they missed. Its files are those that the commands write. They are in a folder of its
    own, which is deleted at the end; no other is written. Only programs of this computer that know the
    printed address are answered.
    """
    from uavseg.api.pages import MapServer
    from uavseg.jobs.source.open_source import open_source
    from uavseg.jobs.web_map.content import FieldMapRequest
    from uavseg.output.disk import written_here

    request = FieldMapRequest(options.division.segment_params(), options.size.size)
    source = open_source(options.source.rasters, options.read)
    work, photos, mission = work_of(options.run, reporter), options.photos, options.mission
    with MapServer(source, request, work, options.port, photos=photos, mission=mission) as server:
        written_here().ended = "the server is closed, and the files of its jobs are deleted"
        reporter.finish(server.warnings)
        show(f"{server.url}")
        server.wait()


@job_command("info", InfoOptions)
def info(options: InfoOptions) -> None:
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
