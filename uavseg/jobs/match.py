"""Search for the regions of a raster that are like a sample of it: by texture and intensity, see
`like.by_texture`, or by color, see `like.by_color`.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from uavseg.jobs.detail import detail_of
from uavseg.jobs.like.by_color import learn, regions_by_color
from uavseg.jobs.like.by_texture import TextureSample, regions_by_texture
from uavseg.jobs.like.request import MatchRequest
from uavseg.jobs.metadata import drawing_facts, with_metadata
from uavseg.jobs.open_source import raster_of
from uavseg.jobs.result import Extraction
from uavseg.jobs.source import AUTO, Raster, Source
from uavseg.jobs.work import SERIAL, Work
from uavseg.raster.intensity.stretch import fit_stretch
from uavseg.raster.tiling import TilePass
from uavseg.regions.sample.place import Disc, sample_mask
from uavseg.segmentation.sample.likeness_table import LikenessTable
from uavseg.segmentation.source import GreySource

_PARTS = 0.15  # by how much the likeness of the sample exceeds that of the raster where color parts them
_HARDLY = "color hardly parts the sample from the rest of the raster; texture may (--by texture)"


@dataclass(frozen=True)
class Match:
    """Regions like a sample, and what "like" meant.

    Parameters
    ----------
    found : Extraction
        Its regions have the column `similarity`, 1 where they are as like the sample as it is itself.
    how : LikenessTable or TextureSample
        What was compared: colour or texture.
    """

    found: Extraction
    how: LikenessTable | TextureSample

    @property
    def warnings(self) -> tuple[str, ...]:
        """What the user should know."""
        return self.found.warnings


def match(source: Source, request: MatchRequest, work: Work = SERIAL) -> Match:
    """Regions of a raster that are like a sample of it.

    Parameters
    ----------
    source : Raster
    request : MatchRequest
    work : Work

    Raises
    ------
    SampleError
        If the sample is not on the raster, too small, or on nodata.
    UavsegError
        If the raster cannot be read or a parameter does not fit it.
    """
    work = work.begun()
    raster = raster_of(source, "a block map holds no texture to be compared; name the raster itself")
    detail_of(request.detail, raster.geobox, request.refine)  # refused before any work
    place = sample_mask(request.like, raster.geobox)
    passes = work.over(raster).stages(5)
    grey = raster.grey(passes[0])
    how: LikenessTable | TextureSample
    hints = []
    if request.by == "color":
        likeness = learn(_colors(raster, grey, request.bands, passes[0].silent), place, passes[0])
        found, how = regions_by_color(grey, likeness, request, passes[1:3]), likeness.table
        if how.own - how.share < _PARTS:
            hints.append(_HARDLY)
    else:
        bands = _bands(raster, request.bands, passes[0].silent)
        found, how = regions_by_texture(grey, bands, place, request, passes[1:])
        if len(found.regions) == 0:
            hints.append("nothing is like the sample; a smaller similarity or a larger intensity finds more")
    found = with_metadata(found, raster, "match", _facts(request, how))
    return Match(work.finished(found, *hints), how)


def _colors(
    raster: Raster, grey: GreySource, bands: Sequence[int | str], tile_pass: TilePass
) -> list[GreySource]:
    """The bands that are chosen, or those whose luminance is the intensity, or the intensity itself."""
    if bands or (raster.dataset.choice.formula is None and len(raster.dataset.bands) > 1):
        return _bands(raster, bands or raster.dataset.bands, tile_pass)
    return [grey]


def _bands(raster: Raster, bands: Sequence[int | str], tile_pass: TilePass) -> list[GreySource]:
    """Each band as grey, by the stretch of the raster, fitted to it."""
    dataset = raster.cleaned(tile_pass)
    datasets = [dataset.of_band(band, raster.options.nodata) for band in bands]
    return [GreySource(one, fit_stretch(one, raster.options.spec or AUTO, tile_pass)) for one in datasets]


def _facts(request: MatchRequest, how: LikenessTable | TextureSample) -> dict[str, Any]:
    """The parameters, for the metadata of the regions."""
    like = request.like
    disc = [like.x, like.y, like.radius] if isinstance(like, Disc) else None
    facts: dict[str, Any] = {"like": like if isinstance(like, str) else disc}
    if isinstance(how, TextureSample):
        intensity = request.intensity if np.isfinite(request.intensity) else "any"
        facts |= {"by": "texture", "window": request.window, "similarity": request.similarity}
        facts |= {"intensity": intensity}
    else:
        facts |= {"by": "color"}
    facts |= {"refine": request.refine, "bands": request.bands or None}
    return facts | drawing_facts(request.drawing, request.fill_holes, request.min_area, request.detail)
