"""The command line: `uavseg`, and the same group as a plugin of `rio`.

Importing it brings in click and nothing heavy; a command's own module is imported when it is called.
"""

import importlib
import sys
import traceback
from typing import Any

import click

from uavseg.cli._stop import exit_code, last_line, stopping_cleanly
from uavseg.errors import UavsegError

_COMMANDS = {
    "extract": "Extract regions within a range of intensity.",
    "suggest": "Propose ranges of intensity, with what each would give.",
    "levels": "Divide a raster into levels of equal width, and each into segments.",
    "match": "Find regions whose texture and intensity are like a sample's.",
    "classify": "Find what is free, unknown and occupied in a map of probabilities.",
    "divide": "Save a raster's block map, from which any range is answered.",
    "plan": "Plan a mission over regions.",
    "upload": "Send a mission to a vehicle, and verify it.",
    "download": "Read the mission of a vehicle.",
    "path": "Find the shortest path between two places of one region.",
    "original": "Segment by texture as LBP/C did, for comparison.",
    "info": "Tell what a raster is and what its intensity looks like.",
    "simulate": "Simulate a laser range finder and write the map that it makes.",
    "preview": "Draw a raster and what was found in it as a picture.",
}


class _Group(click.Group):
    """A group whose commands are imported when they are needed."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(_COMMANDS)

    def get_command(self, ctx: click.Context, name: str) -> click.Command | None:
        if name not in _COMMANDS:
            return None
        command: click.Command = importlib.import_module(f"uavseg.cli.{name}").command
        return command

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        with formatter.section("Commands"):
            formatter.write_dl(list(_COMMANDS.items()))

    def invoke(self, ctx: click.Context) -> Any:
        """Run the command; what the user can mend is one line on stderr and exit code 1."""
        from uavseg.output.written import recording_written

        with stopping_cleanly(), recording_written() as written:
            try:
                _report_kernels()
                return super().invoke(ctx)
            except UavsegError as error:
                click.echo(f"uavseg: error: {error}", err=True)
                ctx.exit(error.exit_code)
            except MemoryError:
                click.echo(
                    "uavseg: error: out of memory; smaller tiles (--tile 1024) or fewer --threads need less",
                    err=True,
                )
                ctx.exit(1)
            except KeyboardInterrupt as error:
                traceback.clear_frames(error.__traceback__)  # so that work that waits in a pool is dropped
                click.echo(last_line(error, written), err=True)
                ctx.exit(exit_code(error))


def _report_kernels() -> None:
    """Print once that kernels are being compiled, which takes a while, or run through the fallback."""
    from uavseg._jit import messages

    told: list[str] = []

    def tell(name: str) -> None:
        if not told:
            told.append(name)
            click.echo("uavseg: compiling for this machine, once (about half a minute)", err=True)

    messages.on_compile = tell
    messages.on_note = lambda note: click.echo(f"uavseg: note: {note}", err=True)


def _version(ctx: click.Context, param: click.Parameter, value: bool) -> None:
    if value and not ctx.resilient_parsing:
        from uavseg import __version__

        click.echo(f"uavseg {__version__}")
        ctx.exit()


@click.group(
    cls=_Group,
    name="uavseg",
    short_help="From a raster to regions to a mission.",
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110},
)
@click.option(
    "--version", is_flag=True, is_eager=True, expose_value=False, callback=_version, help="Show the version."
)
def main() -> None:
    """From an aerial or satellite raster to regions that a drone should fly over, to a mission that flies.

    The line to begin with:  uavseg extract tile.tif --range 0.55,1
    """


if __name__ == "__main__":
    sys.exit(main())
