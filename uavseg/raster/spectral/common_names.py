"""Common names of spectral bands, from colour interpretations, descriptions and wavelengths.

The names are those of the STAC extension for Earth observation, with 1, 2, 3 for the bands of red edge and of
short-wave infrared (STAC: rededge071, 075, 078; swir16, swir22). Bands of satellites and wavelengths follow
the list of bands of Awesome Spectral Indices (Montero et al. 2023, Scientific Data 10:197, MIT licence).
"""

import re
from collections.abc import Sequence

FROM_ROLES = {
    *("red", "green", "blue", "yellow", "pan", "coastal", "rededge", "nir", "swir", "mwir", "lwir", "tir"),
}
"""Colour interpretations of GDAL that are common names."""

SYNONYMS = {
    "swir16": "swir1",
    "swir22": "swir2",
    "rededge071": "rededge1",
    "rededge075": "rededge2",
    "rededge078": "rededge3",
    "re1": "rededge1",
    "re2": "rededge2",
    "re3": "rededge3",
    "red_edge": "rededge",
    "near_infrared": "nir",
    "panchromatic": "pan",
}

FAMILIES = {
    "rededge": ("rededge1", "rededge2", "rededge3"),
    "swir": ("swir1", "swir2"),
    "nir": ("nir08",),
    "rededge1": ("rededge",),
    "lwir": ("lwir11", "lwir12"),
}
"""Names that stand for others where no band has the name itself."""

_WORDS = (
    ("rededge1", r"red ?edge ?1"),
    ("rededge2", r"red ?edge ?2"),
    ("rededge3", r"red ?edge ?3"),
    ("rededge", r"red ?edge"),
    ("swir1", r"swir ?(?:1|16)|(?:shortwave|short wave) infra ?red ?1"),
    ("swir2", r"swir ?(?:2|22)|(?:shortwave|short wave) infra ?red ?2"),
    ("nir08", r"nir ?08|narrow nir|nir narrow"),
    ("nir", r"nir|near infra ?red|near ir"),
    ("coastal", r"coastal(?: aerosol| blue)?|aerosols?"),
    ("cirrus", r"cirrus"),
    ("pan", r"pan|panchromatic"),
    ("lwir", r"lwir|thermal(?: infra ?red)?"),
    ("yellow", r"yellow"),
    ("red", r"red"),
    ("green", r"green"),
    ("blue", r"blue"),
)

_MICROMETRES = (
    (0.400, 0.455, "coastal"),
    (0.455, 0.510, "blue"),
    (0.510, 0.600, "green"),
    (0.600, 0.620, "yellow"),
    (0.620, 0.690, "red"),
    (0.695, 0.715, "rededge1"),
    (0.730, 0.750, "rededge2"),
    (0.765, 0.795, "rededge3"),
    (0.795, 0.855, "nir"),
    (0.855, 0.880, "nir08"),
    (1.360, 1.390, "cirrus"),
    (1.550, 1.750, "swir1"),
    (2.080, 2.350, "swir2"),
    (10.40, 11.30, "lwir11"),
    (11.50, 12.51, "lwir12"),
)

_SENTINEL_2 = {
    "b1": "coastal",
    "b2": "blue",
    "b3": "green",
    "b4": "red",
    "b5": "rededge1",
    "b6": "rededge2",
    "b7": "rededge3",
    "b8": "nir",
    "b8a": "nir08",
    "b9": "nir09",
    "b10": "cirrus",
    "b11": "swir1",
    "b12": "swir2",
}
_LANDSAT_8 = {
    "b1": "coastal",
    "b2": "blue",
    "b3": "green",
    "b4": "red",
    "b5": "nir",
    "b6": "swir1",
    "b7": "swir2",
    "b10": "lwir11",
}
_LANDSAT_4 = {
    "b1": "blue",
    "b2": "green",
    "b3": "red",
    "b4": "nir",
    "b5": "swir1",
    "b7": "swir2",
    "b6": "lwir",
}

_CODE = re.compile(r"(?:sr_|st_)?b(?:and)?[ _]?0*(\d{1,2}a?)(?![0-9a-z])")
_WAVELENGTH = re.compile(r"(\d{3,5}(?:\.\d+)?) ?nm\b")


def common_names(
    roles: Sequence[str], descriptions: Sequence[str], micrometres: Sequence[float | None]
) -> tuple[str, ...]:
    """The common name of each band, "" where none is known.

    What decides, in this order: the words of the description, the colour interpretation, the wavelength, and
    the code of a band ("B8") where the codes of all bands can only be those of one satellite.

    Parameters
    ----------
    roles : sequence of str
        Colour interpretations.
    descriptions : sequence of str
    micrometres : sequence of float or None
        Central wavelengths from the metadata.

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
        role_name = role if role in FROM_ROLES else ""
        found.append(
            from_words(text)
            or role_name
            or _from_wavelength(text, wavelength)
            or codes.get(code_of(text) or "", "")
        )
    return tuple(found)


def code_of(description: str) -> str | None:
    """The code with which a description begins, such as "b8a" for "B08A, 865 nm"; None if there is none."""
    code = _CODE.match(description.casefold())
    return None if code is None else f"b{code[1]}"


def from_words(description: str) -> str:
    """The common name that a description holds in words; "" if it holds none, or several."""
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
    """Common names by code, where the codes of all bands can be only those of one satellite."""
    codes = {code_of(text) for text in descriptions}
    surface = any(text.startswith(("sr_b", "st_b")) for text in descriptions)
    if surface:
        if "st_b6" in descriptions:
            return _LANDSAT_4
        return _LANDSAT_8 if {"b6", "b10"} & codes else {}
    return _SENTINEL_2 if {"b8a", "b12"} & codes else {}
