"""uavseg: from an aerial or satellite raster to regions, to a mission that flies over them.

>>> import uavseg
>>> regions = uavseg.extract("tile.tif", range=(0.55, 1))  # doctest: +SKIP
"""

import importlib
from typing import TYPE_CHECKING, Any

from uavseg._version import __version__

if TYPE_CHECKING:
    from uavseg.api.each import each as each, extract_to as extract_to
    from uavseg.api.exploration import explore as explore, next_views as next_views
    from uavseg.api.maps import (
        build_map as build_map,
        classify as classify,
        compare as compare,
        mask as mask,
        merge_maps as merge_maps,
        path as path,
    )
    from uavseg.api.missions import (
        check as check,
        download as download,
        plan as plan,
        resume as resume,
        upload as upload,
    )
    from uavseg.api.pages import map_page as map_page, serve as serve
    from uavseg.api.photographs import footprints as footprints, georeference as georeference
    from uavseg.api.preview import preview as preview
    from uavseg.api.questions import info as info, match as match, suggest as suggest
    from uavseg.api.rasters import divide as divide, extract as extract, levels as levels
    from uavseg.api.recognition import describe as describe, recognise as recognise
    from uavseg.api.widget import RangeWidget as RangeWidget
    from uavseg.errors import UavsegError as UavsegError
    from uavseg.flight.params.plan import PlanParams as PlanParams
    from uavseg.jobs.install.doctor import doctor as doctor, warm_up as warm_up
    from uavseg.occupancy.mapping.grid import OccupancyGrid as OccupancyGrid
    from uavseg.occupancy.mapping.scan import Pose as Pose, Scan as Scan
    from uavseg.raster.grid.geobox import GeoBox as GeoBox
    from uavseg.raster.read.dataset import Dataset as Dataset
    from uavseg.regions.outline.trace import trace as trace
    from uavseg.segmentation.params.segment import (
        IntensityRange as IntensityRange,
        StateLimits as StateLimits,
    )

_NAMES = {
    "api.rasters": "extract divide levels",
    "api.maps": "build_map compare mask merge_maps classify path",
    "api.exploration": "next_views explore",
    "api.each": "each extract_to",
    "api.widget": "RangeWidget",
    "api.questions": "info match suggest",
    "api.recognition": "describe recognise",
    "api.missions": "plan check resume upload download",
    "api.photographs": "footprints georeference",
    "api.preview": "preview",
    "api.pages": "map_page serve",
    "jobs.install.doctor": "warm_up doctor",
    "flight.params.plan": "PlanParams",
    "raster.read.dataset": "Dataset",
    "raster.grid.geobox": "GeoBox",
    "segmentation.params.segment": "IntensityRange StateLimits",
    "occupancy.mapping.grid": "OccupancyGrid",
    "occupancy.mapping.scan": "Pose Scan",
    "regions.outline.trace": "trace",
    "errors": "UavsegError",
}
_HOMES = {name: f"uavseg.{home}" for home, names in _NAMES.items() for name in names.split()}
__all__ = ["__version__", *_HOMES]


def __getattr__(name: str) -> Any:
    """Load a public word when it is first used (PEP 562): importing uavseg costs nothing."""
    if name not in _HOMES:
        raise AttributeError(f"module 'uavseg' has no attribute {name!r}")
    value = getattr(importlib.import_module(_HOMES[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *_HOMES})
