"""Bands by name: names that a file or the user gives, and the band that a name stands for.

The names are those of the STAC extension for Earth observation, with 1, 2, 3 for the bands of red edge and of
short-wave infrared (STAC: rededge071, 075, 078; swir16, swir22). Bands of satellites and wavelengths follow
the list of bands of Awesome Spectral Indices (Montero et al. 2023, Scientific Data 10:197, MIT licence).

`bands.csv` has a row for each name: the words that stand for it (a regular expression; of those that fit, the
first row counts), wavelengths, codes by satellite, whether it is a colour interpretation, synonyms.
"""

import csv
import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from uavseg.dataclass import dataclass
from uavseg.errors import BandError, ParameterError
from uavseg.plain_text import shown
from uavseg.raster.spectral.bands import BandLayout

_TABLE = list(csv.DictReader(Path(__file__).with_name("bands.csv").read_text(encoding="utf-8").splitlines()))
FROM_ROLES = {row["name"] for row in _TABLE if row["role"]}
"""Colour interpretations of GDAL that are common names."""

SYNONYMS = {word: row["name"] for row in _TABLE for word in row["synonyms"].split()}

FAMILIES = {
    "rededge": ("rededge1", "rededge2", "rededge3"),
    "swir": ("swir1", "swir2"),
    "nir": ("nir08",),
    "rededge1": ("rededge",),
    "lwir": ("lwir11", "lwir12"),
}  # names that stand for others where no band has the name itself

_WORDS = [(row["name"], row["words"]) for row in _TABLE if row["words"]]
_MICROMETRES = [(float(row["from_um"]), float(row["to_um"]), row["name"]) for row in _TABLE if row["from_um"]]
_SENTINEL_2, _LANDSAT_8, _LANDSAT_4 = (
    {row[codes]: row["name"] for row in _TABLE if row[codes]}
    for codes in ("sentinel_2", "landsat_8", "landsat_4")
)

_CODE = re.compile(r"(?:sr_|st_)?b(?:and)?[ _]?0*(\d{1,2}a?)(?![0-9a-z])")
_WAVELENGTH = re.compile(r"(\d{3,5}(?:\.\d+)?) ?nm\b")
_LISTED = 16  # bands in a message
_MAX_NAME = 40  # characters of a name in a message
_GIVEN = re.compile(r"[^\W\d]\w{0,39}")


def common_names(
    roles: Sequence[str], descriptions: Sequence[str], micrometres: Sequence[float | None]
) -> tuple[str, ...]:
    """Return the common name of each band, "" where none is known.

    What decides, in this order: the words of the description, the colour interpretation, the wavelength, and
    the code of a band ("B8") where the codes of all bands can only be those of one satellite. `roles` are
    colour interpretations, `micrometres` central wavelengths from the metadata.

    Examples
    --------
    >>> common_names(["gray", "undefined"], ["Band 4 - Red", "Band 8 - NIR"], [None, None])
    ('red', 'nir')
    >>> common_names(["undefined"] * 3, ["B4", "B8", "B8A"], [None] * 3)
    ('red', 'nir', 'nir08')
    >>> common_names(["undefined"] * 2, ["B4", "B5"], [None] * 2)  # of Sentinel-2, or of Landsat
    ('', '')
    """
    codes = _satellite([description.casefold() for description in descriptions])
    found = []
    for role, description, wavelength in zip(roles, descriptions, micrometres, strict=True):
        text = description.casefold()
        name = from_words(text) or (role if role in FROM_ROLES else "") or _from_wavelength(text, wavelength)
        found.append(name or codes.get(code_of(text) or "", ""))
    return tuple(found)


def code_of(description: str) -> str | None:
    """Return the code that begins a description, such as "b8a" for "B08A, 865 nm"; None if none does."""
    code = _CODE.match(description.casefold())
    return None if code is None else f"b{code[1]}"


def from_words(description: str) -> str:
    """Return the common name that a description holds in words; "" if it holds none, or several."""
    text = re.sub(r"[\W_]+", " ", description.casefold())
    found = []
    for name, pattern in _WORDS:
        text, count = re.subn(rf"\b(?:{pattern})\b", " ", text)
        found += [name] * bool(count)
    return found[0] if len(found) == 1 else ""


def _from_wavelength(description: str, micrometres: float | None) -> str:
    written = _WAVELENGTH.search(description)
    if micrometres is None and written is not None:
        micrometres = float(written[1]) / 1000
    if micrometres is None:
        return ""
    return next((name for low, high, name in _MICROMETRES if low <= micrometres < high), "")


def _satellite(descriptions: Sequence[str]) -> dict[str, str]:
    """Return common names by code, where the codes of all bands can be only those of one satellite."""
    codes = {code_of(text) for text in descriptions}
    if "st_b6" in descriptions:
        return _LANDSAT_4
    if any(text.startswith(("sr_b", "st_b")) for text in descriptions):  # surface reflectance
        return _LANDSAT_8 if {"b6", "b10"} & codes else {}
    return _SENTINEL_2 if {"b8a", "b12"} & codes else {}


@dataclass(frozen=True, slots=True)
class BandName:
    """The names of one band."""

    number: int  # counted from 1
    description: str  # from the file or the user; may be empty
    common: str  # such as "nir", see `common_names`; may be empty

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
    """Return the names of all bands."""
    count = len(layout.dtypes)
    descriptions = layout.descriptions or ("",) * count
    micrometres = layout.micrometres or (None,) * count
    found = common_names(layout.roles, descriptions, micrometres)
    return tuple(map(BandName, range(1, count + 1), descriptions, found))


def listed(layout: BandLayout) -> str:
    """Return the bands for a message: "1: B2, blue; 2: B3, green"; only a range where none has a name."""
    names = names_of(layout)
    if not any(name.label for name in names):
        return "one without a name" if len(names) == 1 else f"1 to {len(names)}, without names"
    texts = [str(name) for name in names[:_LISTED]]
    return "; ".join(texts) + (f"; ... {len(names)} in all" if len(names) > _LISTED else "")


def find_band(layout: BandLayout, name: str) -> int:
    """Return the number of the band of a name: description, code or common name, in any case, or a number.

    A BandError says that no band has that name, or that several have.

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
        count = len(names)
        example = ("red,green,blue,nir", "red,green,blue")[count == 3] if count in (3, 4) else "nir=4,red=3"
        hint = f"to name them give --band-names, such as {example}"
        raise BandError(f"no band is named {shown(name)}; the bands are {listed(layout)}; {hint}")
    several = " and ".join(str(band.number) for band in found[:4])
    raise BandError(f"{shown(name)} may be bands {several}; the bands are {listed(layout)}")


def renamed(layout: BandLayout, given: str | None) -> BandLayout:
    """Return a layout with names that the user gives to its bands, which take the place of those of the file.

    `given` is a name for each band, with nothing for a band that keeps its own ("red,green,blue,nir",
    ",,,nir"), or names with numbers ("nir=4,red=1"). A ParameterError says that it is neither, has not an
    entry for each band, names a band twice, or holds what is not a name.
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
    """Return names by number of their band, in lower case."""
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
