"""`uavseg merge-maps`: maps of robots become one, cropped and turned as it is asked for."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from uavseg.cli._write import keep_inputs, transaction
from uavseg.cli.options.access import access_options
from uavseg.cli.options.creation import creation_of, creation_option, map_mode_option
from uavseg.cli.options.verbosity import heed_verbose, showing_phases, verbosity_options
from uavseg.cli.terminal.say import say

if TYPE_CHECKING:
    from uavseg.jobs.maps.merge_maps import MergedMap


@click.command("merge-maps", short_help="Merge, crop and turn maps of robots.")
@click.argument("maps", metavar="MAP...", nargs=-1, required=True)
@click.option("-o", "--output", required=True, metavar="PATH.yaml|PATH.tif", help="The map.")
@click.option("--crop", is_flag=True, help="End the map where nothing beyond is known.")
@click.option("--unrotate", is_flag=True, help="Let rows run along the x axis: a yaw of 0.")
@click.option(
    "--resolution", type=float, metavar="M", help="Side of a cell.  [default: that of the first map]"
)
@map_mode_option
@creation_option
@click.option("--overwrite", is_flag=True, help="Replace files that are there.")
@verbosity_options
@access_options
def command(**options: Any) -> None:
    """Merge MAPs that lie in one frame into one; a single MAP may be cropped and turned.

    A MAP is the YAML file of a ROS map, or a raster of probabilities in metres. The cells are those of the
    first MAP, as far as all of them reach. Where maps differ, the value farthest from 0.5 counts; what is
    occupied in one of them is occupied. Turning and other resolutions lose no obstacle.
    """
    from uavseg.jobs.maps.merge_maps import MergeRequest, merge_maps
    from uavseg.occupancy.map_file import check_map_path

    quiet = options["quiet"]
    heed_verbose(quiet, options["verbose"])
    target, overwrite = options["output"], options["overwrite"]
    files = check_map_path(target, overwrite, options["mode"])
    keep_inputs(files, *options["maps"])
    creation_of(options, {target: "float32"})
    request = MergeRequest(options["crop"], options["unrotate"], options["resolution"])
    with showing_phases(quiet):
        found = merge_maps(options["maps"], request)
    if not quiet:
        for warning in found.warnings:
            say(f"uavseg: warning: {warning}")
    with transaction():
        found.write(target, overwrite, options["creation_options"], options["mode"])
    if not quiet:
        _report(found, len(options["maps"]), files)


def _report(found: MergedMap, maps: int, files: list[str]) -> None:
    from uavseg.occupancy.map_file import shares_of
    from uavseg.occupancy.ros.ros_map import placement

    rows, cols = found.geobox.shape
    side, (x, y, yaw), _ = placement(found.geobox)
    say(f"  maps        {maps:,}")
    say(f"  map         {rows:,} x {cols:,} cells of {side:g} m from {x:g}, {y:g}, yaw {yaw:g}")
    say(f"  cells       {shares_of(found.probabilities)}")
    say(f"  written     {', '.join(files)}")
