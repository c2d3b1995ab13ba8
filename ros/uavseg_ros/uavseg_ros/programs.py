"""Programs of the package beside its node: commands of uavseg's kind, for `ros2 run` and `python -m`."""

import sys
from collections.abc import Sequence

import click

from uavseg.cli import CommandGroup

RUN = "ros2 run uavseg_ros"
_CONTEXT = {"help_option_names": ["-h", "--help"], "max_content_width": 110}


class Program(CommandGroup):
    """A group of one command: errors are one line on stderr and exit code 1, those of usage 2."""

    def __init__(self, command: click.Command) -> None:
        super().__init__(name="uavseg_ros", context_settings=_CONTEXT)
        self._command = command

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Return the name of the command."""
        return [str(self._command.name)]

    def get_command(self, ctx: click.Context, name: str) -> click.Command | None:
        """Return the command; None for any other name."""
        return self._command if name == self._command.name else None


def run(command: click.Command, arguments: Sequence[str] | None = None) -> None:
    """Run a command with arguments, by default those of the process, and end the process.

    Raises
    ------
    SystemExit
        Always, with the exit code: 0, 1 for an error that the user can correct, 2 for one of usage.
    """
    given = sys.argv[1:] if arguments is None else arguments
    Program(command).main([str(command.name), *given], prog_name=RUN)
