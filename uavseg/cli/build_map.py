"""`uavseg build-map`: a recorded bag of ROS 1 or ROS 2 becomes a map."""

from pathlib import Path

from uavseg.cli.command import job_command
from uavseg.cli.terminal.say import Reporter
from uavseg.cli.write import creation_of, keep_inputs, transaction
from uavseg.options.maps import BuildMapOptions


@job_command("build-map", BuildMapOptions)
def command(options: BuildMapOptions) -> None:
    """Merge the scans of a recorded BAG into a map, each beam at the pose of the sensor at its time.

    BAG is a .bag of ROS 1, or a folder, a .mcap or a .db3 of ROS 2; ROS itself is not needed
    (pip install "uavseg[ros]"). Poses are interpolated between messages of odometry, or over the tree of /tf;
    where /tf_static places the sensor on the robot, that counts. Scans without a pose are left out, and
    counted. The beams of a scan that says no time_increment are all at the time of its header.

    PATH.yaml is a ROS map with its PATH.pgm, which Nav2's map server and uavseg classify read: free up to a
    probability of 0.25, occupied from 0.65 on, unless --mode keeps all levels. PATH.tif holds the
    probabilities.
    """
    from uavseg.jobs.maps.build_map import build_map, merge_params, topics_of
    from uavseg.occupancy.map_file import check_map_path, shares_of

    reporter = Reporter(options.messages)
    target, overwrite, mode = options.output, options.files.overwrite, options.mode.mode
    files = check_map_path(target, overwrite, mode)
    folder = Path(options.bag)
    keep_inputs(files, options.bag, *(sorted(folder.iterdir()) if folder.is_dir() else []))
    creation_of(options.creation, {target: "float32"})
    topics = topics_of(options.scan, options.odom, options.tf)
    found = build_map(options.bag, topics, merge_params(options))
    reporter.finish(found.warnings)
    with transaction():
        found.write(target, overwrite, options.creation.creation_options, mode)
    geobox = found.grid.geobox
    rows, cols = geobox.shape
    reporter.table(
        map=f"{rows:,} x {cols:,} cells of {geobox.transform.a:g} m in the frame {found.frame}",
        scans=f"{found.scans.merged:,} of {found.scans.total:,} merged",
        cells=shares_of(found.grid.probabilities),
        written=", ".join(files),
    )
