"""Options that say how a job is run, how much it reports, and what it may open."""

from __future__ import annotations

import os

from uavseg.options.option import Options, group, option
from uavseg.options.reading import AccessOptions


class RunOptions(Options):
    """Running; changes no result."""

    tile: int | None = option("Side of a tile, a multiple of 64.", type=int, metavar="PIXELS")
    threads: int | None = option("Threads to work with.  [default: all cores]", type=int, metavar="N")
    scheduler: str | None = option(
        "Let the workers of a dask.distributed scheduler do the work.",
        metavar="tcp://HOST:PORT",
        python=False,
    )
    resume: str | os.PathLike[str] | None = option(
        "Keep finished tiles in this folder, and take up those that are there, so that a run that was "
        "stopped goes on where it stopped. Remove the folder when you are done.",
        metavar="DIR",
    )


class VerbosityOptions(Options):
    """Messages."""

    quiet: bool = option("Say nothing but errors.", "-q", "--quiet", default=False, python=False)
    verbose: bool = option(
        "Say what was decided, and how long it took.", "-v", "--verbose", default=False, python=False
    )


class ProgressOptions(Options):
    """Progress."""

    progress: str = option(
        "A bar on a terminal; plain: lines 'progress NN' on stderr, for programs.",
        default="auto",
        choices=("auto", "plain", "none"),
        python=False,
    )


class OverwriteOptions(Options):
    """Files."""

    overwrite: bool = option("Replace files that are there.", default=False, python=False, basic=True)


class TiledJobOptions(Options):
    """What jobs that work tile by tile have in common, listed after their own options."""

    run: RunOptions = group(RunOptions)
    files: OverwriteOptions = group(OverwriteOptions)
    messages: VerbosityOptions = group(VerbosityOptions)
    progress: ProgressOptions = group(ProgressOptions)
    access: AccessOptions = group(AccessOptions)
