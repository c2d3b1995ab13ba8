"""Options that choose bands: by number or name, or as a spectral index or an expression."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, TypeVar

import click

if TYPE_CHECKING:
    from uavseg.raster.spectral.formula import BandWords

Command = TypeVar("Command", bound=Callable[..., Any])


def one_band(ctx: click.Context, param: click.Parameter, value: str | None) -> int | str | None:
    """The number of a band, or its name."""
    return None if value is None else _number_or_name(value.strip(), ctx, param)


def three_bands(
    ctx: click.Context, param: click.Parameter, value: str | None
) -> tuple[int | str, int | str, int | str] | None:
    """Numbers or names of three bands."""
    if value is None:
        return None
    parts = [_number_or_name(part.strip(), ctx, param) for part in value.split(",")]
    if len(parts) != 3:
        raise click.BadParameter(f"{value!r} is not three bands, such as 4,3,2 or nir,red,green", ctx, param)
    return parts[0], parts[1], parts[2]


def many_bands(ctx: click.Context, param: click.Parameter, value: str | None) -> tuple[int | str, ...]:
    """Numbers or names of bands; none where the option is not given."""
    if value is None:
        return ()
    return tuple(_number_or_name(part.strip(), ctx, param) for part in value.split(","))


def _number_or_name(text: str, ctx: click.Context, param: click.Parameter) -> int | str:
    try:
        number = int(text)
    except ValueError:
        if text:
            return text
        raise click.BadParameter("a band is a number or a name, not an empty text", ctx, param) from None
    if not 0 < number < 2**31:
        raise click.BadParameter(f"bands are counted from 1, there is no band {text}", ctx, param)
    return number


band_option = click.option(
    "-b",
    "--band",
    "--bidx",
    "band",
    metavar="N|NAME",
    callback=one_band,
    help="Use this band, counted from 1, or by its name (B8, nir, red); --bidx as in rio.",
)


def _nodata(ctx: click.Context, param: click.Parameter, value: str | None) -> float | str | None:
    """The number, or the text of `as_nodata`."""
    if value is None:
        return None
    from uavseg.errors import ParameterError
    from uavseg.raster.spectral.bands import as_nodata

    try:
        return as_nodata(value)
    except ParameterError as error:
        raise click.BadParameter(str(error), ctx, param) from error


nodata_option = click.option(
    "--nodata",
    metavar="V|only:V|none",
    callback=_nodata,
    help="This value (nan too) is nodata, beside the file's own; only:V: it alone; none: no value is.",
)


def formula_options(command: Command) -> Command:
    """Give a command --index, --expr and --band-names; see `band_words`."""
    for option in reversed(
        (
            click.option(
                "--index", metavar="NAME", help="Use a spectral index: ndvi, ndwi, ndbi, exg, vari, ..."
            ),
            click.option(
                "--expr", metavar="TEXT", help="Use band arithmetic, such as '(nir - red) / (nir + red)'."
            ),
            click.option(
                "--band-names",
                metavar="NAMES",
                help="Names for the bands: one for each (red,green,blue,nir) or some (nir=4).",
            ),
        )
    ):
        command = option(command)
    return command


def band_words(options: dict[str, Any]) -> BandWords:
    """What the options say of bands beside --band and --rgb."""
    from uavseg.raster.spectral.formula import BandWords

    return BandWords(options.get("index"), options.get("expr"), options.get("band_names"))
