"""The bands of a raster whose colors are compared."""

from collections.abc import Sequence

from uavseg.jobs.source.source import AUTO, Raster
from uavseg.raster.grid.tiling import TilePass
from uavseg.raster.intensity.stretch import fit_stretch
from uavseg.segmentation.source import GreySource


def color_sources(
    raster: Raster, grey: GreySource, bands: Sequence[int | str], tile_pass: TilePass
) -> list[GreySource]:
    """Return the chosen bands, or those whose luminance is the intensity, or the intensity itself."""
    if bands or (raster.dataset.choice.formula is None and len(raster.dataset.bands) > 1):
        return band_sources(raster, bands or raster.dataset.bands, tile_pass)
    return [grey]


def band_sources(raster: Raster, bands: Sequence[int | str], tile_pass: TilePass) -> list[GreySource]:
    """Return each band as grey, by the stretch of the raster, fitted to it."""
    dataset = raster.cleaned(tile_pass)
    datasets = [dataset.of_band(band, raster.options.nodata) for band in bands]
    return [GreySource(one, fit_stretch(one, raster.options.spec or AUTO, tile_pass)) for one in datasets]
