"""`uavseg warm-up`: everything is loaded or compiled once."""

from __future__ import annotations

import click

from uavseg.cli.options.running import Reporter


@click.command("warm-up")
@click.option("--processes", type=int, metavar="N", help="How many compile at once.  [default: all cores]")
@click.option("-q", "--quiet", is_flag=True, help="Say nothing but errors.")
@click.option(
    "--progress",
    type=click.Choice(["auto", "plain", "none"]),
    default="auto",
    show_default=True,
    help="A bar on a terminal; plain: lines 'progress NN' on stderr, for programs.",
)
def command(processes: int | None, quiet: bool, progress: str) -> None:
    """Load everything once, and compile what has to be compiled, so that later commands start at once.

    Run it after an installation or an upgrade, before going to the field. On Linux with an x86-64 processor
    nothing is compiled: kernels come with the package. Elsewhere it takes some minutes, once; UAVSEG_CACHE
    names the folder of what is compiled.
    """
    from uavseg.jobs.install.warm_up import warm_up

    reporter = Reporter(quiet, False, progress)
    done = warm_up(processes, reporter.progress)
    reporter.finish()
    reporter.say(str(done))
