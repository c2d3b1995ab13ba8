"""Commands that are built from the options of a job: parameters, grouped help, and the call."""

import os
import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import Any

import click
from click.shell_completion import CompletionItem

from uavseg.cli.terminal.say import Reporter
from uavseg.options.option import Option, arguments_of, build, options_of
from uavseg.options.reading import AccessOptions
from uavseg.options.texts import OptionTextError

_HELP_ALL = "--help-all"
ARGUMENTS = "uavseg.arguments"  # of a command, as they were given, in the meta of its context
_FILES = {"RASTER", "PATH", "FILE", "DEM", "SAMPLE", "MAP", "REGIONS", "BAG", "LABELS", "SCENE"}
_FILES |= {"MISSION", "LOG"}


def job_command(name: str, job: type) -> Callable[[Callable[..., None]], click.Command]:
    """Make a command of a function that takes the options of a job, a dataclass; see `uavseg.options`.

    Where they choose what is printed, it takes a reporter too.
    """

    def wrap(function: Callable[..., None]) -> click.Command:
        def run(**values: Any) -> None:
            options: Any = build(job, values)
            access, messages = getattr(options, "access", None), getattr(options, "messages", None)
            with nullcontext() if access is None else _allowed(access):
                if messages is None:
                    function(options)
                else:
                    function(options, Reporter(messages, getattr(options, "progress", None)))

        params = [*_arguments(job), *_options(job), _help_all()]
        made = JobCommand(name, callback=run, params=params, help=function.__doc__)
        made.job = job
        return made

    return wrap


class JobCommand(click.Command):
    """A command whose help lists what everyone needs, and with --help-all every option in groups."""

    job: type

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Parse as click does, with the numbers after --home joined."""
        ctx.meta[ARGUMENTS] = list(args)
        return super().parse_args(ctx, joined_home(args) if "home" in options_of(self.job) else args)

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """List the basic options, or all of them under the headings of their groups."""
        everything = bool(ctx.meta.get(_HELP_ALL))
        described = options_of(self.job)
        known = {str(one.name): one for one in self.params}
        listed = [name for name in described if everything or described[name].basic]
        records = {name: record for name in listed if (record := known[name].get_help_record(ctx))}
        if everything:
            for heading in dict.fromkeys(one.group for one in described.values()):
                with formatter.section(heading):
                    formatter.write_dl([records[n] for n in records if described[n].group == heading])
            return
        if records:
            with formatter.section("Options"):
                formatter.write_dl([(left, _first_sentence(right)) for left, right in records.values()])
        if more := len(described) - len(listed):
            formatter.write_paragraph()
            formatter.write_text(f"{more} more options, and these in full: uavseg {self.name} {_HELP_ALL}")


def _first_sentence(text: str) -> str:
    """Return the first sentence of a help, and its default."""
    default = re.search(r"\s*\[(default: |required)[^]]*\]$", text)
    sentence = re.split(r"(?<=[a-z)])[.:;] |\.$", text[: default.start()] if default else text)[0]
    return sentence + (f"  {default.group().strip()}" if default else "")


def _help_all() -> click.Option:
    def show(ctx: click.Context, param: click.Parameter, value: bool) -> None:
        if value and not ctx.resilient_parsing:
            ctx.meta[_HELP_ALL] = True
            click.echo(ctx.get_help(), color=ctx.color)
            ctx.exit()

    how: dict[str, Any] = {"is_flag": True, "is_eager": True, "expose_value": False, "callback": show}
    return click.Option([_HELP_ALL], help="Show every option in full, in groups, and exit.", **how)


def _arguments(job: type) -> Iterator[click.Argument]:
    for name, one in arguments_of(job).items():
        count, parse = -1 if one.multiple else 1, _parsed(one)
        yield click.Argument([name], metavar=one.metavar, nargs=count, required=one.required, callback=parse)


def _options(job: type) -> Iterator[click.Option]:
    for name, one in options_of(job).items():
        flags = one.flags or (f"--{name.replace('_', '-')}",)
        how: dict[str, Any] = {"help": one.help, "required": one.required}
        if one.type is bool:
            if "/" in flags[-1]:
                how["default"] = one.default
            yield click.Option([*flags, name], is_flag=True, **how)
            continue
        how["type"] = click.Choice(list(one.choices)) if one.choices else one.type
        if one.minimum is not None:
            how["type"] = click.IntRange(min=one.minimum)
        if not one.required:
            how |= _default(one)
        how |= {"metavar": one.metavar or None, "multiple": one.multiple, "callback": _parsed(one)}
        yield click.Option([*flags, name], **how)


def _default(one: Option) -> dict[str, Any]:
    """Return the default of an option, and how its help shows it."""
    if one.default in (None, ()):
        return {"default": None, "show_default": one.shown or False}
    if one.parse is not None:  # which reads the text that the help shows
        return {"default": one.shown or str(one.default), "show_default": True}
    return {"default": one.default, "show_default": one.shown != "-"}


def _parsed(one: Option) -> Callable[[click.Context, click.Parameter, Any], Any] | None:
    """Return a callback that turns text into the value that Python takes."""
    if one.parse is None and not one.multiple:
        return None

    def parse(ctx: click.Context, param: click.Parameter, value: Any) -> Any:
        if value in (None, ()) or ctx.resilient_parsing:  # a shell that completes a line parses nothing
            return () if one.multiple and one.default is None and one.parse is None else one.default
        try:
            return value if one.parse is None else one.parse(value)
        except OptionTextError as error:
            raise click.BadParameter(str(error), ctx, param) from error

    return parse


@contextmanager
def _allowed(access: AccessOptions) -> Iterator[None]:
    """Enter a context under the access policy of a command."""
    from uavseg.access import allowing

    with allowing(access.allow_path, access.allow_network), _proj_requests(access.allow_network):
        yield


@contextmanager
def _proj_requests(allowed: bool) -> Iterator[None]:
    """Enter a context in which PROJ fetches no grids, unless it is allowed and asked for."""
    before = os.environ.get("PROJ_NETWORK")
    if not allowed:
        os.environ["PROJ_NETWORK"] = "OFF"
    try:
        yield
    finally:
        if before is None:
            os.environ.pop("PROJ_NETWORK", None)
        else:
            os.environ["PROJ_NETWORK"] = before


_NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+),?")


def joined_home(arguments: Sequence[str]) -> list[str]:
    """Join two or three numbers after --home to one word: `--home LAT LON`, a negative longitude too.

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
