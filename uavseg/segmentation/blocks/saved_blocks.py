"""A block map with what it was made from."""

import os
from dataclasses import dataclass
from pathlib import Path

from uavseg.access import current_policy, is_address
from uavseg.raster.access.opening import file_exists
from uavseg.raster.grid.geobox import GeoBox
from uavseg.raster.intensity.stretch import Stretch
from uavseg.raster.spectral.formula import BandWords
from uavseg.raster.spectral.value_scale import ValueAxis
from uavseg.segmentation.blocks.block_map import BlockMap
from uavseg.segmentation.params.illumination import Illumination


@dataclass(frozen=True)
class Origin:
    """The rasters that a block map was made from, and how they were read.

    Parameters
    ----------
    rasters : tuple of str
        Paths as given by the user.
    folder : str
        Base folder of relative paths.
    band, rgb, nodata
        Options of the user, or None; bands by their numbers.
    words : BandWords
        An index or an expression, and names of bands.
    collar : {"auto", "keep"}
        "auto" if a collar was found, which counts as nodata.
    flatten : str, optional
        The width over which slow light was taken away, such as "12.5" (metres) or "200px".
    """

    rasters: tuple[str, ...]
    folder: str
    band: int | None = None
    rgb: tuple[int, int, int] | None = None
    nodata: float | str | None = None
    words: BandWords = BandWords()
    collar: str = "keep"
    flatten: str | None = None

    def find_rasters(self, beside: str | os.PathLike[str]) -> list[str] | None:
        """Paths of the rasters, at their old place or beside the block map; None if one does not exist."""
        for folder in (Path(self.folder), Path(beside).resolve().parent):
            paths = [raster if is_address(raster) else str(folder / raster) for raster in self.rasters]
            if all(is_address(path) or file_exists(path) for path in paths):
                return paths
        return None

    def allowed_rasters(self, beside: str | os.PathLike[str]) -> list[str] | None:
        """As `find_rasters`, to be opened.

        Raises
        ------
        AccessError
            If the access policy does not allow to open one of them.
        """
        found = self.find_rasters(beside)
        for path in found or ():
            current_policy().check_name(beside, path, Path())
        return found


@dataclass(frozen=True)
class SavedBlocks:
    """A block map with its georeference, the stretch that made its grey, its origin and its values.

    Where slow light was taken away from its grey, `illumination` is that light.
    """

    blocks: BlockMap
    geobox: GeoBox
    stretch: Stretch
    band_names: str
    origin: Origin
    axis: ValueAxis | None = None
    illumination: Illumination | None = None
