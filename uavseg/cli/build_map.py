"""`uavseg build-map`, `merge-maps`, `mask` and `simulate`: a bag, maps, regions or a scene become a map."""

from pathlib import Path

from uavseg.cli.command import job_command
from uavseg.cli.terminal.say import Reporter, showing_phases
from uavseg.cli.write import check_distinct, check_output, creation_of, keep_inputs, transaction
from uavseg.errors import OutputError
from uavseg.options.maps import BuildMapOptions, MaskOptions, MergeMapsOptions, SimulateOptions


@job_command("build-map", BuildMapOptions)
def command(options: BuildMapOptions, reporter: Reporter) -> None:
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


@job_command("merge-maps", MergeMapsOptions)
def merge_maps(options: MergeMapsOptions, reporter: Reporter) -> None:
    """Merge MAPs that lie in one frame into one; a single MAP may be cropped and turned.

    A MAP is the YAML file of a ROS map, or a raster of probabilities in metres. The cells are those of the
    first MAP, as far as all of them reach. Where maps differ, the value farthest from 0.5 counts; what is
    occupied in one of them is occupied. Turning and other resolutions lose no obstacle.
    """
    from uavseg.jobs.maps.merge_maps import merge_maps
    from uavseg.occupancy.map_file import check_map_path, shares_of
    from uavseg.occupancy.ros.ros_map import placement

    target, overwrite, mode = options.output, options.files.overwrite, options.mode.mode
    files = check_map_path(target, overwrite, mode)
    keep_inputs(files, *options.maps)
    creation_of(options.creation, {target: "float32"})
    with showing_phases(reporter.quiet):
        found = merge_maps(options.maps, options.crop, options.unrotate, options.resolution)
    reporter.finish(found.warnings)
    with transaction():
        found.write(target, overwrite, options.creation.creation_options, mode)
    rows, cols = found.geobox.shape
    side, (x, y, yaw), _ = placement(found.geobox)
    reporter.table(
        maps=f"{len(options.maps):,}",
        map=f"{rows:,} x {cols:,} cells of {side:g} m from {x:g}, {y:g}, yaw {yaw:g}",
        cells=shares_of(found.probabilities),
        written=", ".join(files),
    )


@job_command("mask", MaskOptions)
def mask(options: MaskOptions, reporter: Reporter) -> None:
    """Make a mask of REGIONS for a costmap filter of Nav2: a robot keeps out of them, or is slower in them.

    REGIONS are polygons in the coordinates of the map, such as uavseg describe or a GIS writes. Every cell
    that a region touches is in the mask. PATH.yaml and PATH.pgm are for Nav2's map server, PATH.params.yaml
    has the parameters of the servers and of the filter.
    """
    from uavseg.jobs.maps import mask as job

    found = job.mask(options.regions, options.map, options.speed, options.layer)
    files = job.check_mask_path(options.output, found.geobox, options.files.overwrite)
    keep_inputs(files, options.regions, options.map)
    reporter.finish(found.warnings)
    with transaction():
        found.write(options.output, options.files.overwrite)
    what = "kept out of" if found.speed is None else f"at {found.speed} % of the largest speed"
    reporter.table(
        regions=f"{found.regions:,}, {what}",
        cells=f"{(found.values > 0).sum():,} of {found.values.size:,}",
        written=", ".join(files),
    )


@job_command("simulate", SimulateOptions)
def simulate(options: SimulateOptions, reporter: Reporter) -> None:
    """Scan a scene with a laser range finder, merge the scans in log-odds and write the map.

    lens and circles are the two maps of the paper, 320 x 320 cells: five views with σ = 5 cm of an object
    like a divergent lens, and eight with σ = 3 cm of two circles. SCENE.json holds polygons and circles, a
    sensor, its poses and the cells of the map.

    The truth has three bands: states (1 free, 2 unseen, 3 occupied), solid (the cell lies inside something)
    and visible (the sensor could see it, into what is solid as deep as 3 σ).
    """
    from uavseg.jobs.maps.build_map import simulate
    from uavseg.occupancy.map_file import write_map
    from uavseg.occupancy.mapping.grid import grey_picture
    from uavseg.raster.formats.geotiff import write_geotiff
    from uavseg.raster.formats.png import write_png

    output, png, truth = options.output, options.png, options.truth
    scene, overwrite = options.scene, options.files.overwrite
    keep_inputs([path for path in (output, png, truth) if path], scene)
    outputs = _check_targets(output, png, truth, overwrite)
    creation = creation_of(options.creation, {output: "float32", truth: "uint8"})
    found = simulate(options)
    grid, simulation, sensor = found.grid, found.simulation, found.simulation.sensor
    tags = {"scene": scene, "seed": str(options.seed)}
    with transaction():
        write_map(output, grid.probabilities, grid.geobox, overwrite, tags=tags, creation=creation)
        if png:
            write_png(png, grey_picture(grid.probabilities), overwrite)
        if truth:
            real = simulation.truth()
            bands = [real.states, real.solid.view("uint8"), real.visible.view("uint8")]
            names = ["state: 1 free, 2 unseen, 3 occupied", "solid", "visible"]
            write_geotiff(truth, bands, simulation.geobox, names, overwrite=overwrite, creation=creation)
    (rows, cols), values = grid.geobox.shape, grid.probabilities
    cells = {"below 0.5": values < 0.5, "never seen": values == 0.5, "above 0.5": values > 0.5}
    beams = f"{len(sensor.angles)} beams, {sensor.step_deg:g} degrees apart"
    reach = f"sigma {sensor.sigma_m:g} m, up to {sensor.max_range_m:g} m"
    reporter.table(
        map=f"{rows} x {cols} cells of {grid.geobox.transform.a:g} m",
        scans=f"{len(simulation.poses)} of {beams}, {reach}",
        cells=", ".join(f"{name} {100 * inside.mean():.1f} %" for name, inside in cells.items()),
        written=", ".join(outputs),
    )


def _check_targets(output: str, png: str | None, truth: str | None, overwrite: bool) -> list[str]:
    """Check that all can be written, before the work; returns the files that will be."""
    from uavseg.occupancy.map_file import check_map_path
    from uavseg.raster.formats.geotiff import check_geotiff_name

    others = [path for path in (png, truth) if path]
    if png and Path(png).suffix.lower() != ".png":
        raise OutputError(f"{png}: the picture of a map is a PNG; name a .png")
    if truth:
        check_geotiff_name(truth, "the truth of a scene")
    for path in others:
        check_output(path, overwrite)
    paths = [*check_map_path(output, overwrite), *others]
    check_distinct(*paths)
    return paths
