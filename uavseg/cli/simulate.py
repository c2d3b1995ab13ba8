"""`uavseg simulate`: a scene becomes the map that a laser range finder makes of it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from uavseg.cli._write import check_distinct, keep_inputs, transaction
from uavseg.cli.options.creation import creation_of, creation_option
from uavseg.cli.options.verbosity import heed_verbose, verbosity_options
from uavseg.cli.terminal.say import say
from uavseg.errors import OutputError

if TYPE_CHECKING:
    from uavseg.occupancy.mapping.grid import OccupancyGrid
    from uavseg.occupancy.simulation.simulate import Simulation
    from uavseg.raster.formats.creation import CreationOptions

_SENSOR = {"sigma": "sigma_m", "max_range": "max_range_m", "fov": "fov_deg", "step": "step_deg"}


@click.command("simulate", short_help="Simulate a laser range finder and write the map that it makes.")
@click.argument("scene", metavar="lens|circles|SCENE.json")
@click.option(
    "-o", "--output", required=True, metavar="MAP", help="The map: .tif (probabilities), or .yaml (ROS map)."
)
@click.option(
    "--png", metavar="PATH.png", help="The map as a picture: free black, unknown grey, occupied white."
)
@click.option("--truth", metavar="PATH.tif", help="What the scene really is: states, solid, visible.")
@creation_option
@click.option(
    "--seed",
    type=click.IntRange(min=0),
    default=0,
    show_default=True,
    help="Of the noise; same seed, same map.",
)
@click.option(
    "--sigma", type=float, metavar="M", help="Standard deviation of ranges.  [default: the scene's]"
)
@click.option("--max-range", type=float, metavar="M", help="How far the sensor sees.  [default: the scene's]")
@click.option("--fov", type=float, metavar="DEG", help="Its field of view.  [default: the scene's]")
@click.option("--step", type=float, metavar="DEG", help="Between beams.  [default: the scene's]")
@click.option("--poses", type=click.IntRange(min=1), metavar="N", help="Scan from the first N poses only.")
@click.option("--overwrite", is_flag=True, help="Replace files that are there.")
@verbosity_options
def command(**options: Any) -> None:
    """Scan a scene with a laser range finder, merge the scans in log-odds and write the map.

    lens and circles are the two maps of the paper, 320 x 320 cells: five views with σ = 5 cm of an object
    like a divergent lens, and eight with σ = 3 cm of two circles. SCENE.json holds polygons and circles, a
    sensor, its poses and the cells of the map.

    The truth has three bands: states (1 free, 2 unseen, 3 occupied), solid (the cell lies inside something)
    and visible (the sensor could see it, into what is solid as deep as 3 σ).
    """
    from uavseg.jobs.maps.simulate import SimulateRequest, simulate
    from uavseg.occupancy.map_file import write_map
    from uavseg.occupancy.mapping.grid import grey_picture
    from uavseg.raster.formats.png import write_png

    heed_verbose(options["quiet"], options["verbose"])
    scene, overwrite = options["scene"], options["overwrite"]
    keep_inputs([options[name] for name in ("output", "png", "truth") if options[name]], scene)
    outputs = _check_targets(options["output"], options["png"], options["truth"], overwrite)
    creation = creation_of(options, {options["output"]: "float32", options["truth"]: "uint8"})
    sensor = {name: options[option] for option, name in _SENSOR.items()}
    found = simulate(scene, SimulateRequest(options["seed"], options["poses"], **sensor))
    grid = found.grid
    tags = {"scene": scene, "seed": str(options["seed"])}
    with transaction():
        write_map(options["output"], grid.probabilities, grid.geobox, overwrite, tags=tags, creation=creation)
        if options["png"]:
            write_png(options["png"], grey_picture(grid.probabilities), overwrite)
        if options["truth"]:
            _write_truth(options["truth"], found.simulation, overwrite, creation)
    if not options["quiet"]:
        _report(found.simulation, grid, outputs)


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


def _write_truth(path: str, simulation: Simulation, overwrite: bool, creation: CreationOptions) -> None:
    from uavseg.raster.formats.geotiff import write_geotiff

    truth = simulation.truth()
    bands = [truth.states, truth.solid.view("uint8"), truth.visible.view("uint8")]
    names = ["state: 1 free, 2 unseen, 3 occupied", "solid", "visible"]
    write_geotiff(path, bands, simulation.geobox, names, overwrite=overwrite, creation=creation)


def _report(simulation: Simulation, grid: OccupancyGrid, outputs: list[str]) -> None:
    sensor, (rows, cols) = simulation.sensor, grid.geobox.shape
    values = grid.probabilities
    shares = [(values < 0.5).mean(), (values == 0.5).mean(), (values > 0.5).mean()]
    say(f"  map         {rows} x {cols} cells of {grid.geobox.transform.a:g} m")
    say(
        f"  scans       {len(simulation.poses)} of {len(sensor.angles)} beams, "
        f"{sensor.step_deg:g} degrees apart, sigma {sensor.sigma_m:g} m, up to {sensor.max_range_m:g} m"
    )
    text = ", ".join(
        f"{name} {100 * share:.1f} %"
        for name, share in zip(("below 0.5", "never seen", "above 0.5"), shares, strict=True)
    )
    say(f"  cells       {text}")
    say(f"  written     {', '.join(outputs)}")
