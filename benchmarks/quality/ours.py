"""uavseg as a method: the regions of ``uavseg extract`` as a mask, for an array in memory."""

from collections.abc import Sequence

import numpy as np
from affine import Affine

from benchmarks.quality.camera import Mask
from benchmarks.quality.scenes import RANGE, Scene
from uavseg.jobs.extract import ExtractRequest, extract
from uavseg.jobs.source.source import Raster
from uavseg.raster.grid.geobox import GeoBox
from uavseg.raster.grid.tiling import Window
from uavseg.raster.intensity.stretch import StretchSpec
from uavseg.raster.read.dataset import Dataset
from uavseg.regions.outline.rings import Rasteriser
from uavseg.segmentation.params.segment import IntensityRange, SegmentParams

DEFAULT = "default"
SETTINGS = {
    DEFAULT: SegmentParams(),
    "paper, none": SegmentParams("paper", refine="none"),
    "paper, scan": SegmentParams("paper", refine="scan"),
    "adaptive, scan": SegmentParams("adaptive", refine="scan"),
    "adaptive, smooth": SegmentParams("adaptive", refine="smooth"),
}


def settings(refinements: Sequence[str] = ()) -> dict[str, SegmentParams]:
    """Settings of uavseg by name, and the adaptive method with each of these refinements.

    Raises
    ------
    uavseg.errors.ParameterError
        If a refinement is unknown.
    """
    return SETTINGS | {f"adaptive, {refine}": SegmentParams(refine=refine) for refine in refinements}  # type: ignore[arg-type]


def extracted(scene: Scene, params: SegmentParams) -> Mask:
    """Mask of the extracted regions of a scene."""
    dataset = Dataset.of_values(scene.v, GeoBox(scene.v.shape, Affine.identity(), None), "scene")
    found = extract(Raster(dataset, StretchSpec("none")), ExtractRequest(IntensityRange(*RANGE), params))
    if len(found.rings.starts) == 0:
        return np.zeros(scene.v.shape, bool)
    return Rasteriser(found.rings)(Window(0, 0, *scene.v.shape)) > 0
