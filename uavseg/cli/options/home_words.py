"""`--home LAT LON` with a space: the numbers are taken for one word, also a negative longitude."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import click

_NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+),?")


class HomeCommand(click.Command):
    """A command whose --home may be followed by several words."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """As click's, with the numbers after --home joined."""
        return super().parse_args(ctx, joined_home(args))


def joined_home(arguments: Sequence[str]) -> list[str]:
    """Words of a command line, with two or three numbers after --home as one word.

    A single number is no home, so what follows it cannot be meant for something else; a third number may be
    the name of a file.

    Examples
    --------
    >>> joined_home(["--home", "49.4583", "-122.8272", "-q"])
    ['--home', '49.4583,-122.8272', '-q']
    """
    words = list(arguments)
    for k, word in enumerate(words):
        if word == "--":
            break
        first = k + 1 if word == "--home" else k
        text = words[first] if first > k and first < len(words) else word.removeprefix("--home=")
        if not word.startswith("--home") or not _NUMBER.fullmatch(text):
            continue
        numbers = [text]
        for more in words[first + 1 : first + 3]:
            if not _NUMBER.fullmatch(more) or (len(numbers) == 2 and Path(more).exists()):
                break
            numbers.append(more)
        home = ",".join(number.rstrip(",") for number in numbers)
        return [*words[:k], "--home", home, *words[first + len(numbers) :]]
    return words
