"""`uavseg doctor`: versions and state of this installation, for an issue report."""

import json

import click

from uavseg.cli.command import job_command
from uavseg.cli.terminal.say import show
from uavseg.options.pages import DoctorOptions


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
