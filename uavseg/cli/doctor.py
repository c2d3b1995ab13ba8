"""`uavseg doctor` and `uavseg warm-up`: the state of this installation, and all of it loaded once."""

import json

import click

from uavseg.cli.command import job_command
from uavseg.cli.terminal.say import Reporter, show
from uavseg.options.pages import DoctorOptions, WarmUpOptions


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
def warm_up(options: WarmUpOptions) -> None:
    """Load everything once, and compile what has to be compiled, so that later commands start at once.

    Run it after an installation or an upgrade, before going to the field. On Linux with an x86-64 processor
    nothing is compiled: kernels come with the package. Elsewhere it takes some minutes, once; UAVSEG_CACHE
    names the folder of what is compiled.
    """
    from uavseg.jobs.install.doctor import warm_up

    reporter = Reporter(options.messages, options.progress)
    done = warm_up(options.processes, reporter.progress)
    reporter.finish()
    reporter.say(str(done))
