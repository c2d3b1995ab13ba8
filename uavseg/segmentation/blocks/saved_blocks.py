"""A block map with its provenance, and the JSON header of its file: one schema, checked before use."""

import json
import math
import os
from collections.abc import Callable
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

from uavseg.access import current_policy, is_address
from uavseg.dataclass import dataclass
from uavseg.plain_text import shown
from uavseg.raster.access.opening import file_exists
from uavseg.raster.grid.geobox import GeoBox
from uavseg.raster.intensity.stretch import Stretch
from uavseg.raster.spectral.bands import BandScale, ValueAxis, as_nodata
from uavseg.raster.spectral.formula import BandWords
from uavseg.segmentation.blocks.block_map import BlockMap
from uavseg.segmentation.params.illumination import Illumination
from uavseg.units import CELL, GREY_MAX

_ALSO = "also:"  # before a number that counts beside the nodata of the files
_MAX_STEP = 1 << 16  # pixels; far more than squares of illumination have


@dataclass(frozen=True)
class Origin:
    """Rasters that a block map was made from, and how they were read."""

    rasters: tuple[str, ...]  # paths as given by the user
    folder: str  # base of relative paths
    band: int | None = None  # an option of the user; bands by their numbers
    rgb: tuple[int, int, int] | None = None
    nodata: float | str | None = None
    words: BandWords = BandWords()
    collar: str = "keep"  # "auto" if one was detected, which counts as nodata
    flatten: str | None = None  # width over which illumination was estimated: "12.5" (metres) or "200px"

    def find_rasters(self, beside: str | os.PathLike[str]) -> list[str] | None:
        """Return the paths of the rasters, in their folder or beside the block map; None if any is gone."""
        for folder in (Path(self.folder), Path(beside).resolve().parent):
            paths = [raster if is_address(raster) else str(folder / raster) for raster in self.rasters]
            if all(is_address(path) or file_exists(path) for path in paths):
                return paths
        return None

    def allowed_rasters(self, beside: str | os.PathLike[str]) -> list[str] | None:
        """Return the paths of `find_rasters`; raise AccessError if the access policy forbids one of them."""
        paths = self.find_rasters(beside)
        for path in paths or ():
            current_policy().check_name(beside, path, Path())
        return paths


@dataclass(frozen=True)
class SavedBlocks:
    """Block map with its georeference, the stretch of its grey, its origin and the axis of its values.

    `illumination` is what was subtracted from its grey.
    """

    blocks: BlockMap
    geobox: GeoBox
    stretch: Stretch
    band_names: str
    origin: Origin
    axis: ValueAxis | None = None
    illumination: Illumination | None = None


def _is_list(value: Any, fits: Callable[[Any], bool]) -> bool:
    return isinstance(value, list) and len(value) > 0 and all(map(fits, value))


def _is_name(value: Any) -> bool:
    return isinstance(value, str) and value != "" and value.isprintable()


def _is_text(value: Any) -> bool:
    return isinstance(value, str)


def _is_whole(value: Any, low: int = 1, high: int = 2**31 - 1) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and low <= value <= high


def _is_number(value: Any) -> bool:
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        return False
    try:
        float(value)
    except (ValueError, OverflowError):
        return False
    return True


def _is_finite(value: Any) -> bool:
    return not isinstance(value, str) and _is_number(value) and math.isfinite(value)


def _is_nodata(value: Any) -> bool:
    """Accept a number, as in earlier versions, or the text of a nodata value."""
    return _is_number(value) or (
        isinstance(value, str)
        and (value == "none" or _is_number(value.removeprefix("only:").removeprefix(_ALSO)))
    )


def _is_values(value: Any) -> bool:
    if not isinstance(value, dict) or not {"scale", "offset", "unit", "limits"} <= value.keys():
        return False
    limits = value["limits"]
    return (
        _is_list(limits, lambda end: end is None or _is_finite(end))
        and len(limits) == 2
        and _is_finite(value["scale"])
        and _is_finite(value["offset"])
        and isinstance(value["unit"], str)
    )


def _is_illumination(value: Any) -> bool:
    return (
        isinstance(value, dict)
        and value.keys() == {"width", "step", "target"}
        and _is_name(value["width"])
        and _is_whole(value["step"], CELL, _MAX_STEP)
        and value["step"] & (value["step"] - 1) == 0
        and _is_whole(value["target"], 0, GREY_MAX)
    )


def _is_formula(value: Any) -> bool:
    """Accept texts by the names of `BandWords`, of which at most one is a formula."""
    known = {field.name for field in fields(BandWords)}
    texts = isinstance(value, dict) and all(map(_is_text, value.values()))
    return texts and set(value) <= known and not {"index", "expr"} <= set(value)


_SCHEMA: dict[str, Callable[[Any], bool]] = {
    "rows": _is_whole,
    "cols": _is_whole,
    "low": _is_finite,
    "high": _is_finite,
    "stretch": _is_text,
    "bands": _is_text,
    "rasters": lambda value: _is_list(value, _is_name),
    "folder": _is_name,
    "band": lambda value: value is None or _is_whole(value),
    "rgb": lambda value: value is None or (_is_list(value, _is_whole) and len(value) == 3),
    "nodata": lambda value: value is None or _is_nodata(value),
    "collar": lambda value: value in ("auto", "keep"),
}
_OPTIONAL: dict[str, tuple[str, Callable[[Any], bool]]] = {
    "values": ("values are", lambda value: value is None or _is_values(value)),
    "flatten": ("flat field is", lambda value: value is None or _is_illumination(value)),
    "formula": ("formula is", _is_formula),
}


def checked_header(header: Any) -> dict[str, Any]:
    """Return the header of a block map; raise ValueError if a value is missing or of another type."""
    if not isinstance(header, dict):
        raise ValueError("its description is not an object")
    header.setdefault("collar", "keep")  # of an earlier version
    for name, fits in _SCHEMA.items():
        if name not in header or not fits(header[name]):
            raise ValueError(f"its {name} are {shown(header.get(name))}")
    for name, (subject, fits) in _OPTIONAL.items():
        if name in header and not fits(header[name]):
            raise ValueError(f"its {subject} {shown(header[name])}")
    return header


def origin_of_header(header: dict[str, Any]) -> Origin:
    """Return the rasters that a block map was made from, and how they were read."""
    return Origin(
        rasters=tuple(header["rasters"]),
        folder=header["folder"],
        band=header["band"],
        rgb=None if header["rgb"] is None else tuple(header["rgb"]),
        nodata=_nodata_of_header(header["nodata"]),
        words=BandWords(**header.get("formula", {})),
        collar=header["collar"],
        flatten=flatten["width"] if (flatten := header.get("flatten")) else None,
    )


def _nodata_of_header(value: float | str | None) -> float | str | None:
    """Return the nodata option; a number of an earlier version replaced the nodata of the files."""
    text = str(value)
    if value is None or text == "none" or text.startswith("only:"):
        return value
    return as_nodata(text.removeprefix(_ALSO) if text.startswith(_ALSO) else f"only:{text}")


def axis_of_header(header: dict[str, Any], stretch: Stretch) -> ValueAxis | None:
    """Return the map from v to values of a `checked_header`; None in block maps of earlier versions."""
    values = header.get("values")
    if values is None:
        return None
    scale = BandScale.of_tags(values["scale"], values["offset"], values["unit"])
    low, high = (None if end is None else float(end) for end in values["limits"])
    limits = -math.inf if low is None else low, math.inf if high is None else high
    return None if scale is None else ValueAxis(stretch.low, stretch.high, scale, limits)


def header_text(saved: SavedBlocks) -> str:
    """Write the header of a block map as JSON, which `checked_header` accepts."""
    origin = saved.origin
    header = {
        "rows": saved.geobox.shape[0],
        "cols": saved.geobox.shape[1],
        "low": saved.stretch.low,
        "high": saved.stretch.high,
        "stretch": saved.stretch.name,
        "bands": saved.band_names,
        "rasters": list(origin.rasters),
        "folder": origin.folder,
        "band": origin.band,
        "rgb": origin.rgb,
        "nodata": f"{_ALSO}{origin.nodata!r}" if isinstance(origin.nodata, float) else origin.nodata,
    }
    if origin.collar != "keep":
        header["collar"] = origin.collar
    if saved.illumination is not None:
        flat = saved.illumination
        header["flatten"] = {"width": origin.flatten, "step": flat.step, "target": flat.target}
    if saved.axis is not None:
        scale = saved.axis.scale
        limits = [end if math.isfinite(end) else None for end in saved.axis.limits]
        numbers = {"scale": scale.scale, "offset": scale.offset}
        header["values"] = {**numbers, "unit": scale.unit, "limits": limits}
    formula = {name: text for name, text in asdict(origin.words).items() if text is not None}
    return json.dumps(header | ({"formula": formula} if formula else {}))
