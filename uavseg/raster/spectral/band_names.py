"""Bands by name: names that a file or the user gives, and the band that a name stands for."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

from uavseg.errors import BandError, ParameterError
from uavseg.plain_text import shown
from uavseg.raster.spectral.bands import BandLayout
from uavseg.raster.spectral.common_names import (
    FAMILIES,
    FROM_ROLES,
    SYNONYMS,
    code_of,
    common_names,
    from_words,
)

_LISTED = 16  # bands in a message
_MAX_NAME = 40  # characters of a name in a message
_GIVEN = re.compile(r"[^\W\d]\w{0,39}")


@dataclass(frozen=True, slots=True)
class BandName:
    """The names of one band.

    Parameters
    ----------
    number : int
        Counted from 1.
    description : str
        From the file or the user; may be empty.
    common : str
        Such as "nir", see `common_names`; may be empty.
    """

    number: int
    description: str
    common: str

    @property
    def keys(self) -> frozenset[str]:
        """What the band may be called, in lower case."""
        text = self.description.strip().casefold()
        names = {text, re.sub(r"\W+", "_", text).strip("_"), code_of(text) or "", self.common}
        return frozenset(names - {""})

    @property
    def label(self) -> str:
        """The description and the common name, "" where the band has neither."""
        text = shown(self.description.strip(), quoted=False)[:_MAX_NAME]
        common = "" if self.common == text.casefold() else self.common
        return ", ".join(part for part in (text, common) if part)

    def __str__(self) -> str:
        return f"{self.number}: {self.label}" if self.label else str(self.number)


def names_of(layout: BandLayout) -> tuple[BandName, ...]:
    """The names of all bands."""
    count = len(layout.dtypes)
    descriptions = layout.descriptions or ("",) * count
    micrometres = layout.micrometres or (None,) * count
    found = common_names(layout.roles, descriptions, micrometres)
    return tuple(map(BandName, range(1, count + 1), descriptions, found))


def listed(layout: BandLayout) -> str:
    """The bands for a message: "1: B2, blue; 2: B3, green"; only a range where none has a name."""
    names = names_of(layout)
    if not any(name.label for name in names):
        return "one without a name" if len(names) == 1 else f"1 to {len(names)}, without names"
    texts = [str(name) for name in names[:_LISTED]]
    return "; ".join(texts) + (f"; ... {len(names)} in all" if len(names) > _LISTED else "")


def find_band(layout: BandLayout, name: str) -> int:
    """The number of the band of a name: description, code or common name, in any case, or a number.

    Raises
    ------
    BandError
        If no band has that name, or several have.

    Examples
    --------
    >>> layout = BandLayout(("uint8",) * 2, ("red", "nir"), (8, 8), ("Band 4", "Band 8 - NIR"))
    >>> find_band(layout, "NIR"), find_band(layout, "b4"), find_band(layout, "2")
    (2, 1, 2)
    """
    text = name.strip().casefold()
    if text.isascii() and text.isdigit() and len(text) < 10:
        return int(text)
    text = SYNONYMS.get(text, text)
    names = names_of(layout)
    found = [band for band in names if text in band.keys]
    if not found:
        found = [band for band in names if band.common in FAMILIES.get(text, ())]
    if len(found) == 1:
        return found[0].number
    if not found:
        raise BandError(f"no band is named {shown(name)}; the bands are {listed(layout)}{_hint(layout)}")
    several = " and ".join(str(band.number) for band in found[:4])
    raise BandError(f"{shown(name)} may be bands {several}; the bands are {listed(layout)}")


def _hint(layout: BandLayout) -> str:
    count = len(layout.dtypes)
    example = ("red,green,blue,nir", "red,green,blue")[count == 3] if count in (3, 4) else "nir=4,red=3"
    return f"; to name them give --band-names, such as {example}"


def renamed(layout: BandLayout, given: str | None) -> BandLayout:
    """A layout with names that the user gives to its bands, which take the place of those of the file.

    Parameters
    ----------
    layout : BandLayout
    given : str, optional
        A name for each band, with nothing for a band that keeps its own ("red,green,blue,nir", ",,,nir"), or
        names with numbers ("nir=4,red=1").

    Raises
    ------
    ParameterError
        If it is neither, has not an entry for each band, names a band twice, or holds what is not a name.
    """
    if given is None:
        return layout
    numbered = _parse(layout, given)
    descriptions = list(layout.descriptions or ("",) * len(layout.dtypes))
    roles, micrometres = list(layout.roles), list(layout.micrometres or (None,) * len(layout.dtypes))
    own = names_of(layout)
    keys = set(numbered.values()) | {SYNONYMS.get(name, from_words(name)) for name in numbered.values()}
    for band in own:
        n = band.number - 1
        if band.number in numbered:
            name = numbered[band.number]
            common = SYNONYMS.get(name, name)
            descriptions[n], micrometres[n] = name, None
            roles[n] = common if common in FROM_ROLES or common == "alpha" else "undefined"
        elif band.keys & keys:
            descriptions[n], micrometres[n], roles[n] = "", None, "undefined"
    return replace(
        layout, descriptions=tuple(descriptions), roles=tuple(roles), micrometres=tuple(micrometres)
    )


def _parse(layout: BandLayout, given: str) -> dict[int, str]:
    """Names by number of their band, in lower case."""
    count, parts = len(layout.dtypes), [part.strip().casefold() for part in given.split(",")]
    if "=" in given:
        pairs = [_pair(part) for part in parts]
    elif len(parts) != count:
        bands = "one band" if count == 1 else f"{count} bands"
        raise ParameterError(
            f"the raster has {bands}, and {len(parts)} names are given; name each, or some as in nir=4"
        )
    else:
        pairs = [(number, part) for number, part in enumerate(parts, start=1) if part]
    for number, name in pairs:
        if not 1 <= number <= count:
            raise ParameterError(
                f"there is no band {number} to be named {shown(name)}: the bands are {listed(layout)}"
            )
        if not _GIVEN.fullmatch(name):
            raise ParameterError(
                f"a name of a band is a word of letters, digits and _, such as nir, not {shown(name)}"
            )
    numbers, names = [number for number, _ in pairs], [SYNONYMS.get(name, name) for _, name in pairs]
    if not pairs or len(set(numbers)) < len(pairs) or len(set(names)) < len(pairs):
        raise ParameterError(f"each band is named once, each with a name of its own, not {shown(given)}")
    return dict(pairs)


def _pair(part: str) -> tuple[int, str]:
    name, equals, number = (text.strip() for text in part.partition("="))
    if not equals or not (number.isascii() and number.isdigit() and len(number) < 10):
        raise ParameterError(f"names with numbers are given as nir=4,red=1, not {shown(part)}")
    return int(number), name


def check_same_names(first: BandLayout, other: BandLayout, bands: Sequence[int]) -> str | None:
    """How the names of bands differ in two files, None if they do not, or one of them has none."""
    pairs = zip(names_of(first), names_of(other), strict=True)
    for ours, theirs in pairs:
        if ours.number in bands and ours.keys and theirs.keys and ours.keys != theirs.keys:
            return f"{theirs.label} for band {theirs.number}, not {ours.label}"
    return None
