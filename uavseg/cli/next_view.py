"""`uavseg next-view`: where a robot sees most of what is unknown, and the safe ways there."""

from uavseg.cli.command import job_command
from uavseg.cli.terminal.say import Reporter, work_of
from uavseg.cli.write import keep_inputs, write_text
from uavseg.options.maps import NextViewOptions


@job_command("next-view", NextViewOptions)
def command(options: NextViewOptions) -> None:
    """Find the poses from which a robot at --pose would see what is unknown in MAP, the best first.

    MAP is a raster of probabilities, or the YAML file of a ROS map. Views stand on free cells and see borders
    of free and unknown ones; the best begins a short tour through all of them, which ends where unknown space
    goes on farthest.
    """
    from uavseg.jobs.maps.next_view import next_views, view_request
    from uavseg.jobs.source.open_source import open_probability_map
    from uavseg.occupancy.paths.path_geojson import check_path_crs
    from uavseg.output.atomic import check_target

    reporter = Reporter(options.messages, options.progress)
    request = view_request(options)
    if options.output != "-":
        check_target(options.output, options.files.overwrite)
    keep_inputs([options.output], options.map_)
    source = open_probability_map(options.map_, options.read)
    check_path_crs(source.geobox)
    found = next_views(source, request, work_of(options.run, reporter))
    reporter.finish(found.warnings)
    write_text(options.output, found.to_geojson(), options.files.overwrite)
    for rank, view in enumerate(found.views, start=1):
        about = view.properties
        place = f"{view.pose.x:.2f},{view.pose.y:.2f} heading {about['heading_deg']:.0f}"
        way = f"{about['distance_m']:.1f} m away, {about['frontier_m']:.1f} m of frontiers"
        worth = f"{about['gain_bits']:.0f} bits, score {about['score']:.2f}"
        reporter.say(f"  {rank:2d}  {place}: {way}, {worth}")
    reporter.say(f"  {len(found.views)} views -> {options.output}")
