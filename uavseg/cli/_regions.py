"""What commands that make regions have in common: a raster or its block map, regions written, a table."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, TypeVar

import click

from uavseg.cli._running import Reporter, Running
from uavseg.errors import ParameterError

if TYPE_CHECKING:
    from uavseg.execution.executors import Map
    from uavseg.jobs.result import Extraction
    from uavseg.regions.edit.small import Area
    from uavseg.segmentation.blocks.block_file import SavedBlocks

Command = TypeVar("Command", bound=Callable[..., Any])


def drawing_options(command: Command) -> Command:
    """Give a command --smooth-outline and --simplify, in the order in which they work."""
    for option in reversed(
        (
            click.option(
                "--smooth-outline",
                type=float,
                metavar="METRES",
                help="Draw outlines without stairs, within this many metres of the pixel edges, and never "
                "further than half a pixel; shared borders stay shared, attributes those of the pixels.",
            ),
            click.option(
                "--simplify",
                type=float,
                metavar="METRES",
                help="Simplify outlines, after they are smoothed; shared borders stay shared.",
            ),
        )
    ):
        command = option(command)
    return command


def area(text: str | None) -> Area | None:
    """The area that an option names, if it was given."""
    from uavseg.regions.edit.small import parse_area

    return None if text is None else parse_area(text)


def check_targets(output: str | None, labels: str | None, overwrite: bool) -> None:
    """Nothing that is there is touched, and nothing is computed that could not be written."""
    if output is not None and output != "-":
        from uavseg.regions.formats.export import check_region_path

        check_region_path(output, overwrite)
    if labels is not None:
        from uavseg.regions.formats.label_raster import check_labels

        check_labels(labels, overwrite)


def opened(
    rasters: tuple[str, ...], options: dict[str, Any], refine: str, reporter: Reporter
) -> tuple[SavedBlocks | None, Any]:
    """A block map and its raster if that is at hand, or a raster alone; no pixel is read."""
    from uavseg.raster.dataset import Dataset
    from uavseg.segmentation.blocks.block_file import is_block_map, read_block_map

    if len(rasters) > 1 or not is_block_map(rasters[0]):
        how = (options["band"], options["rgb"], options["nodata"], options["skip_bad_tiles"])
        return None, Dataset.open(rasters, *how)
    if options["band"] or options["rgb"] or options["nodata"] is not None or options["stretch"] != "auto":
        raise ParameterError("a block map has its bands, nodata and stretch already; leave these options out")
    saved = read_block_map(rasters[0])
    if refine == "none":
        return saved, None
    origin = saved.origin
    paths = origin.find_rasters(rasters[0])
    if paths is None:
        reporter.warn(f"{origin.rasters[0]} is not where it was, so regions end at block edges")
        return saved, None
    return saved, Dataset.open(paths, origin.band, origin.rgb, origin.nodata, options["skip_bad_tiles"])


def opened_ros_map(paths: tuple[str, ...], options: dict[str, Any], resume: str | None) -> Any:
    """The dataset of a ROS map, to which options of rasters mean nothing."""
    from uavseg.occupancy.probability_map import open_map

    if len(paths) > 1:
        raise ParameterError("a ROS map is no part of a mosaic; name it alone")
    if any(options.get(name) for name in ("band", "rgb")) or options["nodata"] is not None:
        raise ParameterError("a ROS map has neither bands nor nodata; leave --band, --rgb and --nodata out")
    if options.get("stretch") not in (None, "auto", "none"):
        raise ParameterError("a ROS map holds probabilities, which are not stretched; leave --stretch out")
    if resume is not None:
        raise ParameterError("a ROS map is read whole, so there is nothing to resume; leave --resume out")
    return open_map(paths[0])[0]


def write_regions(found: Extraction, target: str, overwrite: bool) -> None:
    """Write regions to a file, or to stdout where it is called -."""
    from uavseg.regions.formats import export

    export.write_regions(found.regions, sys.stdout.buffer if target == "-" else target, overwrite)


def write_labels(found: Extraction, path: str, run: Map, running: Running) -> None:
    """Write the labels of regions; whoever runs the work writes where they are many tiles."""
    from uavseg.regions.formats import label_raster

    here = (
        run if label_raster.is_vrt(path) else running.local_workers()
    )  # a single file is painted where it is
    label_raster.write_label_raster(path, found.rings, found.geobox, here, running.overwrite)


def shown(target: str) -> str:
    """A target by its name for people."""
    return "stdout" if target == "-" else target


def largest(found: Extraction, unit: str) -> str:
    """The region with most pixels, for people."""
    columns = found.regions.columns
    if not len(found.regions):
        return "-"
    return f"{columns['area_m2'][0]:,.1f} {unit} ({columns['pixels'][0]:,} pixels)"


def tell(rows: dict[str, str], reporter: Reporter) -> None:
    """The short table at the end."""
    for name, value in rows.items():
        reporter.say(f"  {name:<12}{value}")
