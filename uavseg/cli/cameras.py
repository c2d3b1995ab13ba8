"""`uavseg cameras`: the cameras that a survey can be planned for."""

import json

from uavseg.cli.command import job_command
from uavseg.cli.terminal.say import show
from uavseg.errors import ParameterError
from uavseg.options.pages import CamerasOptions


@job_command("cameras", CamerasOptions)
def command(options: CamerasOptions) -> None:
    """List the cameras that are known; those whose names have all WORDS, if some are given.

    A camera of one's own is a JSON file with sensor_width_mm, sensor_height_mm, image_width_px,
    image_height_px, focal_mm and, if they are known, name and min_interval_s.
    """
    from uavseg.flight.camera.camera import find_cameras

    found = find_cameras(" ".join(options.words))
    if not found:
        raise ParameterError(f"no camera has {' '.join(options.words)} in its name; uavseg cameras lists all")
    if options.as_json:
        show(json.dumps([camera.as_dict() for camera in found], indent=2))
        return
    lines = [f"{'camera':<34}{'sensor mm':>14}{'image px':>15}{'focal mm':>10}{'cm at 100 m':>13}"]
    for camera in found:
        sensor = "{:g} x {:g}".format(*camera.sensor_mm)
        image = "{} x {}".format(*camera.image_px)
        gsd = f"{100 * camera.gsd_m(100):.2f}"
        lines.append(f"{camera.name:<34}{sensor:>14}{image:>15}{camera.focal_mm:>10g}{gsd:>13}")
    show("\n".join(lines))
