"""Parameters that say how a raster is read, shared by the algorithms that read one."""

from __future__ import annotations

from .options import band, choice, number, switch, text

INDICES = (
    "ndvi",
    "gndvi",
    "bndvi",
    "ndre",
    "ndwi",
    "mndwi",
    "ndmi",
    "ndbi",
    "ndsi",
    "nbr",
    "nbr2",
    "bi",
    "ndti",
    "ndci",
    "ndyi",
    "ngrdi",
    "gli",
    "mgrvi",
    "rgbvi",
    "gcc",
    "exg",
    "exr",
    "exgr",
    "vari",
    "tgi",
    "cig",
    "cire",
    "savi",
    "osavi",
    "msavi",
    "evi",
    "evi2",
)

BAND_NAMES = text(
    "BAND_NAMES",
    "Names of the bands",
    "--band-names",
    "For an index or a formula: red,green,blue,nir, or some, such as nir=4.",
)

BAND_CHOICE = (
    band(),
    choice("INDEX", "Spectral index", "--index", "In place of a band: a spectral index.", INDICES),
    text(
        "EXPRESSION",
        "Band arithmetic",
        "--expr",
        "In place of a band: a formula, such as (nir - red) / (nir + red), or (b4 - b3) / (b4 + b3).",
    ),
    BAND_NAMES,
)

NODATA = text(
    "NODATA",
    "Nodata value",
    "--nodata",
    "This value (nan too) is nodata, beside the file's own; only:V: it alone; none: no value is.",
)
STRETCH = text(
    "STRETCH",
    "Stretch",
    "--stretch",
    "How values become v: auto, dtype, minmax, percentile:2,98, none, or LOW,HIGH. Empty: as the program "
    "does "
    "by itself, and says.",
)

RASTER = (
    *BAND_CHOICE,
    text(
        "RGB",
        "Bands of red, green and blue",
        "--rgb",
        "In place of a band: the luminance of R,G,B, such as 4,3,2.",
    ),
    NODATA,
    STRETCH,
    choice(
        "COLLAR",
        "Collar",
        "--collar",
        "Count an untagged black or white collar as nodata, or keep it.",
        ("auto", "keep"),
    ),
)

DIVISION = (
    choice(
        "METHOD",
        "Method",
        "--method",
        "Divide blocks by texture and intensity (adaptive), or by texture alone (paper). Empty: adaptive.",
        ("adaptive", "paper"),
    ),
    number(
        "THRESHOLD", "Threshold of G_max / G_min", "--threshold", "Divide where it is larger. Empty: 1.2.", 1
    ),
    number(
        "INTENSITY_STEP",
        "Intensity step",
        "--intensity-step",
        "Divide where the means of the children differ by more. Empty: 0.05.",
        0,
    ),
)

THREADS = number(
    "THREADS", "Threads", "--threads", "Empty: all processors. Changes no result.", 1, integer=True
)

MIN_AREA = text(
    "MIN_AREA",
    "Smallest area (m², or pixels as 50px)",
    "--min-area",
    "Smaller ones are left out.",
    advanced=False,
)
FILL_HOLES = text(
    "FILL_HOLES", "Fill holes up to (m², or pixels as 50px)", "--fill-holes", "Smaller holes are filled."
)
DETAIL = text(
    "DETAIL",
    "Wanted detail (m, or pixels as 9px)",
    "--detail",
    "What is narrower than a disc of this diameter is left out, necks are cut and gaps closed.",
)
FLATTEN = text(
    "FLATTEN",
    "Take slow light away over (m, or pixels as 200px)",
    "--flatten",
    "Several times the width of what is looked for: light that changes slowly over it is taken away from v.",
)
MIN_CONFIDENCE = number(
    "MIN_CONFIDENCE",
    "Least confidence",
    "--min-confidence",
    "From 0 to 1: regions that are less probably right are left out. Empty: all stay.",
    0,
)
THIN_LINES = switch(
    "THIN_LINES",
    "Add thin lines",
    "--thin-lines",
    "Lines of 1 to 3 pixels, such as cracks, are found by their contrast along 15 pixels.",
)
