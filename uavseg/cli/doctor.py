"""`uavseg doctor`, `warm-up` and `cameras`: what this installation is, loads at once, and knows."""

import json

import click

from uavseg.cli.command import job_command
from uavseg.cli.terminal.say import Reporter, show
from uavseg.errors import ParameterError
from uavseg.options.pages import CamerasOptions, DoctorOptions, WarmUpOptions


@job_command("doctor", DoctorOptions)
def command(options: DoctorOptions) -> None:
    """Check this installation: versions of GDAL, PROJ and numba, kernels, threads, QGIS, serial ports.

    The output fits an issue report: it has no names of folders. The exit code is 1 if something is wrong;
    each problem is a line that says what to do. Nothing is compiled, and nothing is sent to a vehicle.
    """
    from uavseg.jobs.install.doctor import doctor

    found = doctor()
    show(json.dumps(found.as_dict(), indent=2) if options.as_json else str(found))
    if found.problems:
        click.get_current_context().exit(1)


@job_command("warm-up", WarmUpOptions)
def warm_up(options: WarmUpOptions, reporter: Reporter) -> None:
    """Load everything once, and compile what has to be compiled, so that later commands start at once.

    Run it after an installation or an upgrade, before going to the field. On Linux with an x86-64 processor
    nothing is compiled: kernels come with the package. Elsewhere it takes some minutes, once; UAVSEG_CACHE
    names the folder of what is compiled.
    """
    from uavseg.jobs.install.doctor import warm_up

    done = warm_up(options.processes, reporter.progress)
    reporter.finish()
    reporter.say(str(done))


@job_command("cameras", CamerasOptions)
def cameras(options: CamerasOptions) -> None:
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
