"""`uavseg warm-up`: everything is loaded or compiled once."""

from uavseg.cli.command import job_command
from uavseg.cli.terminal.say import Reporter
from uavseg.options.pages import WarmUpOptions


@job_command("warm-up", WarmUpOptions)
def command(options: WarmUpOptions) -> None:
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
