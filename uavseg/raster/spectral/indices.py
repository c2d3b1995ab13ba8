"""Spectral indices: a table of formulas in common names of bands.

Formulas, names and references are those of Awesome Spectral Indices (https://github.com/awesome-spectral-indices,
Montero et al. 2023, Scientific Data 10:197, MIT licence), with its constants put in: g = 2.5, C1 = 6,
C2 = 7.5 and L = 1 for EVI, and L = 0.5 for SAVI (Huete 1988).
"""

from uavseg.dataclass import dataclass
from uavseg.errors import ParameterError
from uavseg.plain_text import shown


@dataclass(frozen=True, slots=True)
class SpectralIndex:
    """A spectral index."""

    name: str  # in full
    formula: str
    reference: str
    limits: tuple[float, float] | None = (-1.0, 1.0)  # between which all values of positive bands lie
    of_reflectance: bool = False  # for reflectance (0 to 1) alone: constants are added to bands


_DOI = "https://doi.org/"

INDICES: dict[str, SpectralIndex] = {
    "ndvi": SpectralIndex(
        "Normalized Difference Vegetation Index",
        "(nir - red) / (nir + red)",
        "https://ntrs.nasa.gov/citations/19740022614",
    ),
    "gndvi": SpectralIndex(
        "Green Normalized Difference Vegetation Index",
        "(nir - green) / (nir + green)",
        f"{_DOI}10.1016/S0034-4257(96)00072-7",
    ),
    "bndvi": SpectralIndex(
        "Blue Normalized Difference Vegetation Index",
        "(nir - blue) / (nir + blue)",
        f"{_DOI}10.1016/S1672-6308(07)60027-4",
    ),
    "ndre": SpectralIndex(
        "Normalized Difference Red Edge Index",
        "(nir - rededge1) / (nir + rededge1)",
        f"{_DOI}10.1016/1011-1344(93)06963-4",
    ),
    "ndwi": SpectralIndex(
        "Normalized Difference Water Index (McFeeters)",
        "(green - nir) / (green + nir)",
        f"{_DOI}10.1080/01431169608948714",
    ),
    "mndwi": SpectralIndex(
        "Modified Normalized Difference Water Index",
        "(green - swir1) / (green + swir1)",
        f"{_DOI}10.1080/01431160600589179",
    ),
    "ndmi": SpectralIndex(
        "Normalized Difference Moisture Index",
        "(nir - swir1) / (nir + swir1)",
        f"{_DOI}10.1016/S0034-4257(01)00318-2",
    ),
    "ndbi": SpectralIndex(
        "Normalized Difference Built-Up Index",
        "(swir1 - nir) / (swir1 + nir)",
        f"{_DOI}10.1080/01431160304987",
    ),
    "ndsi": SpectralIndex(
        "Normalized Difference Snow Index",
        "(green - swir1) / (green + swir1)",
        f"{_DOI}10.1109/IGARSS.1994.399618",
    ),
    "nbr": SpectralIndex("Normalized Burn Ratio", "(nir - swir2) / (nir + swir2)", f"{_DOI}10.3133/ofr0211"),
    "nbr2": SpectralIndex(
        "Normalized Burn Ratio 2",
        "(swir1 - swir2) / (swir1 + swir2)",
        "https://www.usgs.gov/core-science-systems/nli/landsat/landsat-normalized-burn-ratio-2",
    ),
    "bi": SpectralIndex(
        "Bare Soil Index",
        "((swir1 + red) - (nir + blue)) / ((swir1 + red) + (nir + blue))",
        "http://citeseerx.ist.psu.edu/viewdoc/download?doi=10.1.1.465.8749&rep=rep1&type=pdf",
    ),
    "ndti": SpectralIndex(
        "Normalized Difference Turbidity Index",
        "(red - green) / (red + green)",
        f"{_DOI}10.1016/j.rse.2006.07.012",
    ),
    "ndci": SpectralIndex(
        "Normalized Difference Chlorophyll Index",
        "(rededge1 - red) / (rededge1 + red)",
        f"{_DOI}10.1016/j.rse.2011.10.016",
    ),
    "ndyi": SpectralIndex(
        "Normalized Difference Yellowness Index",
        "(green - blue) / (green + blue)",
        f"{_DOI}10.1016/j.rse.2016.06.016",
    ),
    "ngrdi": SpectralIndex(
        "Normalized Green Red Difference Index",
        "(green - red) / (green + red)",
        f"{_DOI}10.1016/0034-4257(79)90013-0",
    ),
    "gli": SpectralIndex(
        "Green Leaf Index",
        "(2.0 * green - red - blue) / (2.0 * green + red + blue)",
        f"{_DOI}10.1080/10106040108542184",
    ),
    "mgrvi": SpectralIndex(
        "Modified Green Red Vegetation Index",
        "(green ** 2.0 - red ** 2.0) / (green ** 2.0 + red ** 2.0)",
        f"{_DOI}10.1016/j.jag.2015.02.012",
    ),
    "rgbvi": SpectralIndex(
        "Red Green Blue Vegetation Index",
        "(green ** 2.0 - blue * red) / (green ** 2.0 + blue * red)",
        f"{_DOI}10.1016/j.jag.2015.02.012",
    ),
    "gcc": SpectralIndex(
        "Green Chromatic Coordinate",
        "green / (red + green + blue)",
        f"{_DOI}10.1016/0034-4257(87)90088-5",
        (0.0, 1.0),
    ),
    "exg": SpectralIndex("Excess Green Index", "2 * green - red - blue", f"{_DOI}10.13031/2013.27838", None),
    "exr": SpectralIndex("Excess Red Index", "1.3 * red - green", f"{_DOI}10.1117/12.336896", None),
    "exgr": SpectralIndex(
        "ExG - ExR Vegetation Index",
        "(2.0 * green - red - blue) - (1.3 * red - green)",
        f"{_DOI}10.1016/j.compag.2008.03.009",
        None,
    ),
    "vari": SpectralIndex(
        "Visible Atmospherically Resistant Index",
        "(green - red) / (green + red - blue)",
        f"{_DOI}10.1016/S0034-4257(01)00289-9",
        None,
    ),
    "tgi": SpectralIndex(
        "Triangular Greenness Index",
        "-0.5 * (190 * (red - green) - 120 * (red - blue))",
        f"{_DOI}10.1016/j.jag.2012.07.020",
        None,
    ),
    "cig": SpectralIndex(
        "Chlorophyll Index Green", "(nir / green) - 1.0", f"{_DOI}10.1078/0176-1617-00887", None
    ),
    "cire": SpectralIndex(
        "Chlorophyll Index Red Edge", "(nir / rededge1) - 1", f"{_DOI}10.1078/0176-1617-00887", None
    ),
    "savi": SpectralIndex(
        "Soil-Adjusted Vegetation Index",
        "1.5 * (nir - red) / (nir + red + 0.5)",
        f"{_DOI}10.1016/0034-4257(88)90106-X",
        None,
        True,
    ),
    "osavi": SpectralIndex(
        "Optimized Soil-Adjusted Vegetation Index",
        "(nir - red) / (nir + red + 0.16)",
        f"{_DOI}10.1016/0034-4257(95)00186-7",
        None,
        True,
    ),
    "msavi": SpectralIndex(
        "Modified Soil-Adjusted Vegetation Index",
        "0.5 * (2.0 * nir + 1 - (((2 * nir + 1) ** 2) - 8 * (nir - red)) ** 0.5)",
        f"{_DOI}10.1016/0034-4257(94)90134-1",
        None,
        True,
    ),
    "evi": SpectralIndex(
        "Enhanced Vegetation Index",
        "2.5 * (nir - red) / (nir + 6.0 * red - 7.5 * blue + 1.0)",
        f"{_DOI}10.1016/S0034-4257(96)00112-5",
        None,
        True,
    ),
    "evi2": SpectralIndex(
        "Two-Band Enhanced Vegetation Index",
        "2.5 * (nir - red) / (nir + 2.4 * red + 1.0)",
        f"{_DOI}10.1016/j.rse.2008.06.006",
        None,
        True,
    ),
}


def find_index(name: str) -> tuple[str, SpectralIndex]:
    """Return the index of a name, in any case, with its name in lower case; else a ParameterError."""
    key = name.strip().casefold()
    if key not in INDICES:
        raise ParameterError(
            f"{shown(name)} is not a known index; give another as --expr; known are {', '.join(INDICES)}"
        )
    return key, INDICES[key]
