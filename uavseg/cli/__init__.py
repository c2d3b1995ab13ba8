"""The command line: `uavseg`, and the same group as a plugin of `rio`.

Importing it brings in click and nothing heavy; a command's own module is imported when it is called.
"""

import importlib
import os
import sys
import traceback
from collections.abc import Sequence
from difflib import get_close_matches
from typing import Any, NoReturn

import click

from uavseg.cli.terminal.stop import end_soon, exit_code, last_line, stopping_cleanly
from uavseg.errors import OUT_OF_MEMORY, UavsegError
from uavseg.plain_text import cause_of, one_line

_COMMANDS = {
    "extract": "Extract regions within a range of intensity.",
    "suggest": "Propose ranges of intensity, with what each would give.",
    "levels": "Divide a raster into levels of equal width, and each into segments.",
    "match": "Find regions whose texture and intensity are like a sample's.",
    "classify": "Find what is free, unknown and occupied in a map of probabilities.",
    "describe": "Measure shape, texture and bands of regions or of a map's objects.",
    "recognise": "Name regions or a map's objects by examples.",
    "compare": "Find what changed between two rasters or two maps of one place.",
    "divide": "Save a raster's block map, from which any range is answered.",
    "plan": "Plan a mission over regions.",
    "check": "Tell what a mission file holds, and who would refuse it.",
    "footprints": "Draw the ground that photographs from the air show.",
    "resume": "Plan the rest of a mission whose flight was cut.",
    "georeference": "Make a map of photographs from the air, by their pose.",
    "cameras": "List the cameras that a survey can be planned for.",
    "upload": "Send a mission to a vehicle, and verify it.",
    "download": "Read the mission of a vehicle.",
    "path": "Find the shortest path between two places of one region.",
    "next-view": "Find where a robot sees most of what is unknown.",
    "explore": "Explore a simulated scene until nothing reachable is unknown.",
    "original": "Segment by texture as LBP/C did, for comparison.",
    "info": "Tell what a raster is and what its intensity looks like, or how regions were made.",
    "build-map": "Merge the scans of a recorded bag into a map.",
    "merge-maps": "Merge, crop and turn maps of robots.",
    "mask": "Make a mask for Nav2 of regions to keep out of, or to be slow in.",
    "simulate": "Simulate a laser range finder and write the map that it makes.",
    "preview": "Draw a raster and what was found in it as a picture.",
    "map": "Make a web page of a raster, regions and missions for the field.",
    "serve": "Serve that page to a browser here, with exact regions and missions.",
    "doctor": "Check this installation: versions, kernels, QGIS, serial ports.",
    "warm-up": "Load or compile everything once, before going to the field.",
}

# Modules of commands that share one, in which they are functions of their own name.
_BESIDE = dict.fromkeys(("mask", "merge-maps", "simulate"), "build_map")
_BESIDE |= dict.fromkeys(("cameras", "warm-up"), "doctor")
_BESIDE |= dict.fromkeys(("compare", "describe", "recognise"), "classify")
_BESIDE |= dict.fromkeys(("levels", "original"), "divide")
_BESIDE |= dict.fromkeys(("next-view", "path"), "explore")
_BESIDE |= dict.fromkeys(("upload", "download", "footprints", "georeference"), "check")
_BESIDE |= dict.fromkeys(("info", "map", "serve"), "preview") | {"resume": "plan"}


class CommandGroup(click.Group):
    """A group whose commands are imported when they are needed."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(_COMMANDS)

    def get_command(self, ctx: click.Context, name: str) -> click.Command | None:
        if name not in _COMMANDS:
            return None
        own = name.replace("-", "_")
        module = importlib.import_module(f"uavseg.cli.{_BESIDE.get(name, own)}")
        command: click.Command = getattr(module, own if name in _BESIDE else "command")
        if ctx.resilient_parsing:  # of a shell that completes the line
            from uavseg.cli.command import completing_files

            return completing_files(command)
        return command

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """As click's; a name that is no command is answered by the nearest that is one."""
        if self.get_command(ctx, args[0]) is None and not ctx.resilient_parsing:
            near = get_close_matches(args[0], _COMMANDS, 1)
            ctx.fail(f"No such command {args[0]!r}.{f' Did you mean {near[0]!r}?' if near else ''}")
        return super().resolve_command(ctx, args)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        with formatter.section("Commands"):
            formatter.write_dl(list(_COMMANDS.items()))

    def main(self, args: Sequence[str] | None = None, *rest: Any, **options: Any) -> Any:
        """As click's; errors of the standard output too, such as of --help, are one line."""
        try:
            return super().main(args, *rest, **options)
        except SystemExit as end:
            if args is None and isinstance(end.code, int) and end.code > 128:  # a program that a signal ended
                end_soon(end.code)
            raise
        except OSError as error:
            sys.stdout = open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115, PTH123 - open until the end
            click.echo(f"uavseg: error: {_system_error(error)}", err=True)
            sys.exit(1)

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Return options of the group itself."""
        try:
            return super().parse_args(ctx, args)
        except click.UsageError as error:
            raise _clean(error) from None

    def invoke(self, ctx: click.Context) -> Any:
        """Run the command; what the user can mend is one line on stderr and exit code 1."""
        from uavseg.cli.terminal.say import library_messages, say
        from uavseg.output.disk import recording_written

        with recording_written() as written, stopping_cleanly(written) as unwound:
            try:
                _report_kernels()
                with library_messages():
                    return super().invoke(ctx)
            except click.UsageError as error:
                raise _clean(error) from None
            except UavsegError as error:
                _fail(ctx, str(error), error.exit_code)
            except OSError as error:
                _fail(ctx, _system_error(error))
            except ImportError as error:
                why = "too little memory, or it is not installed whole"
                _fail(ctx, f"a library cannot be loaded ({cause_of(error)}): {why}")
            except MemoryError:
                _fail(ctx, OUT_OF_MEMORY)
            except KeyboardInterrupt as error:
                traceback.clear_frames(error.__traceback__)  # so that work that waits in a pool is dropped
                unwound.set()
                code = exit_code(error)
                say(last_line(code - 128, written))
                ctx.exit(code)
            except Exception as error:
                if "bad_alloc" not in str(error):  # as GEOS reports it
                    raise
                _fail(ctx, OUT_OF_MEMORY)


def _fail(ctx: click.Context, text: str, code: int = 1) -> NoReturn:
    click.echo(f"uavseg: error: {text}", err=True)
    ctx.exit(code)


def _clean(error: click.UsageError) -> click.UsageError:
    """Return the error with its message as one printable line."""
    return click.UsageError(one_line(error.format_message()), error.ctx)


def _system_error(error: OSError) -> str:
    """Return what the system refused, and for which file."""
    named = "" if error.filename is None else f"{os.fsdecode(error.filename)}: "
    return one_line(f"{named}{cause_of(error)}")


def _report_kernels() -> None:
    """Print once that kernels are being compiled, which takes a while, or run through the fallback."""
    from uavseg._jit import messages
    from uavseg.cli.terminal.say import say

    def tell(name: str) -> None:
        messages.on_compile = None
        once = "compiling for this machine, once (uavseg warm-up does it for everything)"
        click.echo(f"uavseg: {once}", err=True)

    messages.on_compile = tell
    messages.on_note = lambda note: say(f"uavseg: note: {note}")


def _version(ctx: click.Context, param: click.Parameter, value: bool) -> None:
    if value and not ctx.resilient_parsing:
        from uavseg import __version__

        click.echo(f"uavseg {__version__}")
        ctx.exit()


@click.group(
    cls=CommandGroup,
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
