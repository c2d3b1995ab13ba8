"""`uavseg recognise`: names of regions, by the examples of a library."""

import click

from uavseg.cli.command import job_command
from uavseg.cli.describe import run_described
from uavseg.options.maps import RecogniseOptions


@job_command("recognise", RecogniseOptions)
def command(options: RecogniseOptions) -> None:
    """Name REGIONS, or the occupied objects of MAP, by the nearest described examples of a library.

    The outline of each example is fitted to what was seen of an object, by position, rotation and size.
    Outline that borders on unknown space is not held against it. Where no name is probable enough, or nothing
    fits, the name is 'cannot tell'. With --learn NAME --ids N,..., regions become examples of the library
    instead; the file is written anew with what it held.
    """
    from uavseg.jobs.maps.recognition import recognised

    if (options.learn is None) != (options.ids is None):
        raise click.UsageError("--learn NAME and --ids N,... belong together")
    if (options.output is None) == (options.learn is None):
        raise click.UsageError("give either -o PATH, to name regions, or --learn NAME, to add examples")
    run_described(options, recognised, options.library)
