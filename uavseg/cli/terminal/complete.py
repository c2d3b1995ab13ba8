"""Completion in shells: which parameters of a command name files."""

from __future__ import annotations

import re

import click
from click.shell_completion import CompletionItem

_FILES = {"RASTER", "PATH", "FILE", "DEM", "SAMPLE", "MAP", "REGIONS", "BAG", "LABELS", "SCENE"}


def completing_files(command: click.Command) -> click.Command:
    """Let a shell complete parameters that name files, by the words of their metavars."""
    for parameter in command.params:
        words = set(re.split(r"[^A-Z]+", parameter.metavar or ""))
        if parameter.type is click.STRING and words & _FILES:
            parameter._custom_shell_complete = _files  # what the argument `shell_complete` sets
    return command


def _files(ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
    """Return a request to the shell to complete the name of a file."""
    return [CompletionItem(incomplete, type="file")]
