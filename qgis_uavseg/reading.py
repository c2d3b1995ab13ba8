"""Parameters that say how a raster is read, shared by the algorithms that read one."""

from __future__ import annotations

from .options import TABLE, band, listed

INDICES = TABLE["extract"]["INDEX"]["choices"]
BAND_CHOICE = (band(), *listed("extract", "INDEX", "EXPRESSION", "BAND_NAMES"))
RASTER = (*BAND_CHOICE, *listed("extract", "RGB", "NODATA", "STRETCH", "COLLAR"))
MAP = (*BAND_CHOICE, *listed("classify", "NODATA", "STRETCH"))
DIVISION = listed("extract", "METHOD", "THRESHOLD", "INTENSITY_STEP")
