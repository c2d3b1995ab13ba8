"""`uavseg simulate`: a scene becomes the map that a laser range finder makes of it."""

from pathlib import Path

from uavseg.cli.command import job_command
from uavseg.cli.terminal.say import Reporter
from uavseg.cli.write import check_distinct, creation_of, keep_inputs, transaction
from uavseg.errors import OutputError
from uavseg.options.maps import SimulateOptions


@job_command("simulate", SimulateOptions)
def command(options: SimulateOptions) -> None:
    """Scan a scene with a laser range finder, merge the scans in log-odds and write the map.

    lens and circles are the two maps of the paper, 320 x 320 cells: five views with σ = 5 cm of an object
    like a divergent lens, and eight with σ = 3 cm of two circles. SCENE.json holds polygons and circles, a
    sensor, its poses and the cells of the map.

    The truth has three bands: states (1 free, 2 unseen, 3 occupied), solid (the cell lies inside something)
    and visible (the sensor could see it, into what is solid as deep as 3 σ).
    """
    from uavseg.jobs.maps.build_map import SimulateRequest, simulate
    from uavseg.occupancy.map_file import write_map
    from uavseg.occupancy.mapping.grid import grey_picture
    from uavseg.raster.formats.geotiff import write_geotiff
    from uavseg.raster.formats.png import write_png

    reporter = Reporter(options.messages)
    output, png, truth = options.output, options.png, options.truth
    scene, overwrite = options.scene, options.files.overwrite
    keep_inputs([path for path in (output, png, truth) if path], scene)
    outputs = _check_targets(output, png, truth, overwrite)
    creation = creation_of(options.creation, {output: "float32", truth: "uint8"})
    request = SimulateRequest(
        options.seed,
        options.poses,
        sigma_m=options.sigma,
        max_range_m=options.max_range,
        fov_deg=options.fov,
        step_deg=options.step,
    )
    found = simulate(scene, request)
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
    from uavseg.output.atomic import check_target
    from uavseg.raster.formats.geotiff import check_geotiff_name

    others = [path for path in (png, truth) if path]
    if png and Path(png).suffix.lower() != ".png":
        raise OutputError(f"{png}: the picture of a map is a PNG; name a .png")
    if truth:
        check_geotiff_name(truth, "the truth of a scene")
    for path in others:
        check_target(path, overwrite)
    paths = [*check_map_path(output, overwrite), *others]
    check_distinct(*paths)
    return paths
