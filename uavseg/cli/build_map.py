"""`uavseg build-map`: a recorded bag of ROS 1 or ROS 2 becomes a map."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from uavseg.cli._write import keep_inputs, transaction
from uavseg.cli.options.creation import creation_of, creation_option, map_mode_option
from uavseg.cli.options.verbosity import heed_verbose, verbosity_options
from uavseg.cli.terminal.say import say
from uavseg.errors import ParameterError

if TYPE_CHECKING:
    from uavseg.jobs.maps.build_map import BuiltMap


@click.command("build-map", short_help="Merge the scans of a recorded bag into a map.")
@click.argument("bag", metavar="BAG")
@click.option("-o", "--output", required=True, metavar="PATH.yaml|PATH.tif", help="The map.")
@map_mode_option
@creation_option
@click.option(
    "--scan",
    default="/scan",
    show_default=True,
    metavar="TOPIC",
    help="Of sensor_msgs/LaserScan, MultiEchoLaserScan or PointCloud2.",
)
@click.option(
    "--odom", metavar="TOPIC", help="Poses from nav_msgs/Odometry.  [default: /odom, unless --tf is given]"
)
@click.option("--tf", is_flag=True, help="Poses from the tree of /tf and /tf_static.")
@click.option(
    "--resolution", type=float, default=0.05, show_default=True, metavar="M", help="Side of a cell."
)
@click.option(
    "--sigma", type=float, default=0.03, show_default=True, metavar="M", help="Standard deviation of ranges."
)
@click.option(
    "--max-range",
    type=float,
    metavar="M",
    help="Use beams up to here.  [default: the range_max of each scan]",
)
@click.option(
    "--heights",
    metavar="LO,HI",
    help="Of point clouds: what lies between these metres above the map's frame is an obstacle.",
)
@click.option(
    "--no-return",
    type=click.Choice(["inf", "range_max"]),
    default="inf",
    show_default=True,
    help="What a range is where nothing returned: inf alone, or range_max too.",
)
@click.option(
    "--beam-order",
    type=click.Choice(["angles", "increment"]),
    help="What counts where the sign of angle_increment contradicts the angles.  [default: neither]",
)
@click.option("--overwrite", is_flag=True, help="Replace files that are there.")
@verbosity_options
def command(**options: Any) -> None:
    """Merge the scans of a recorded BAG into a map, each beam at the pose of the sensor at its time.

    BAG is a .bag of ROS 1, or a folder, a .mcap or a .db3 of ROS 2; ROS itself is not needed
    (pip install "uavseg[ros]"). Poses are interpolated between messages of odometry, or over the tree of /tf;
    where /tf_static places the sensor on the robot, that counts. Scans without a pose are left out, and
    counted. The beams of a scan that says no time_increment are all at the time of its header.

    PATH.yaml is a ROS map with its PATH.pgm, which Nav2's map server and uavseg classify read: free up to a
    probability of 0.25, occupied from 0.65 on, unless --mode keeps all levels. PATH.tif holds the
    probabilities.
    """
    from uavseg.jobs.maps.build_map import build_map, topics_of
    from uavseg.occupancy.bags.merge_bag import MergeParams
    from uavseg.occupancy.map_file import check_map_path

    heed_verbose(options["quiet"], options["verbose"])
    target, overwrite = options["output"], options["overwrite"]
    files = check_map_path(target, overwrite, options["mode"])
    keep_inputs(files, options["bag"], *_files_in(options["bag"]))
    creation_of(options, {target: "float32"})
    topics = topics_of(options["scan"], options["odom"], options["tf"])
    params = MergeParams(
        options["resolution"],
        options["sigma"],
        options["max_range"],
        _heights(options["heights"]),
        options["no_return"],
        options["beam_order"],
    )
    found = build_map(options["bag"], topics, params)
    if not options["quiet"]:
        for warning in found.warnings:
            say(f"uavseg: warning: {warning}")
    with transaction():
        found.write(target, overwrite, options["creation_options"], options["mode"])
    if not options["quiet"]:
        _report(found, files)


def _heights(text: str | None) -> tuple[float, float] | None:
    if text is None:
        return None
    try:
        low, high = (float(part) for part in text.split(","))
    except ValueError:
        raise ParameterError(f"--heights is LO,HI in metres, such as 0.1,1.8, not {text!r}") from None
    return low, high


def _files_in(bag: str) -> list[Path]:
    """The files of a bag of ROS 2 that is a folder, which no output may replace."""
    folder = Path(bag)
    return sorted(folder.iterdir()) if folder.is_dir() else []


def _report(found: BuiltMap, files: list[str]) -> None:
    from uavseg.occupancy.map_file import shares_of

    geobox = found.grid.geobox
    rows, cols = geobox.shape
    say(f"  map         {rows:,} x {cols:,} cells of {geobox.transform.a:g} m in the frame {found.frame}")
    say(f"  scans       {found.scans.merged:,} of {found.scans.total:,} merged")
    say(f"  cells       {shares_of(found.grid.probabilities)}")
    say(f"  written     {', '.join(files)}")
