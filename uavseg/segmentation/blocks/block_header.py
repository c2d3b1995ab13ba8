"""The description in the file of a block map: JSON of one schema, checked before anything uses it."""

import json
import math
from collections.abc import Callable
from dataclasses import asdict, fields
from typing import Any

from uavseg.plain_text import shown
from uavseg.raster.intensity.stretch import Stretch
from uavseg.raster.spectral.bands import as_nodata
from uavseg.raster.spectral.formula import BandWords
from uavseg.raster.spectral.value_scale import BandScale, ValueAxis
from uavseg.segmentation.blocks.saved_blocks import Origin, SavedBlocks
from uavseg.units import CELL, GREY_MAX


def _is_list(value: Any, fits: Callable[[Any], bool]) -> bool:
    return isinstance(value, list) and len(value) > 0 and all(map(fits, value))


def _is_name(value: Any) -> bool:
    return isinstance(value, str) and value != "" and value.isprintable()


def _is_whole(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and 0 < value < 2**31


def _is_number(value: Any) -> bool:
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        return False
    try:
        float(value)
    except (ValueError, OverflowError):
        return False
    return True


def _is_nodata(value: Any) -> bool:
    """Whether a value is a number, as in earlier versions, or the text of a nodata value."""
    return _is_number(value) or (
        isinstance(value, str)
        and (value == "none" or _is_number(value.removeprefix("only:").removeprefix(_ALSO)))
    )


def _is_finite(value: Any) -> bool:
    return not isinstance(value, str) and _is_number(value) and math.isfinite(value)


def _is_values(value: Any) -> bool:
    """Whether a description of values is one, or missing."""
    if value is None:
        return True
    if not isinstance(value, dict) or not {"scale", "offset", "unit", "limits"} <= value.keys():
        return False
    limits = value["limits"]
    ends = isinstance(limits, list) and len(limits) == 2 and all(x is None or _is_finite(x) for x in limits)
    return (
        ends and _is_finite(value["scale"]) and _is_finite(value["offset"]) and isinstance(value["unit"], str)
    )


_ALSO = "also:"  # before a number that counts beside the nodata of the files
_MAX_STEP = 1 << 16  # pixels; far more than squares of light have

_SCHEMA: dict[str, Callable[[Any], bool]] = {
    "rows": _is_whole,
    "cols": _is_whole,
    "low": _is_finite,
    "high": _is_finite,
    "stretch": lambda value: isinstance(value, str),
    "bands": lambda value: isinstance(value, str),
    "rasters": lambda value: _is_list(value, _is_name),
    "folder": _is_name,
    "band": lambda value: value is None or _is_whole(value),
    "rgb": lambda value: value is None or (_is_list(value, _is_whole) and len(value) == 3),
    "nodata": lambda value: value is None or _is_nodata(value),
    "collar": lambda value: value in ("auto", "keep"),
}


def checked_header(header: Any) -> dict[str, Any]:
    """The description in a block map, each value of its kind.

    Raises
    ------
    ValueError
        If one is missing or of another kind.
    """
    if not isinstance(header, dict):
        raise ValueError("its description is not an object")
    header.setdefault("collar", "keep")  # of an earlier version
    if not _is_values(header.get("values")):
        raise ValueError(f"its values are {shown(header['values'])}")
    for name, fits in _SCHEMA.items():
        if name not in header or not fits(header[name]):
            raise ValueError(f"its {name} are {shown(header.get(name))}")
    if not _is_flat_field(header.get("flatten")):
        raise ValueError(f"its flat field is {shown(header['flatten'])}")
    if not _is_formula(header.get("formula", {})):
        raise ValueError(f"its formula is {shown(header['formula'])}")
    return header


def _is_flat_field(value: Any) -> bool:
    """Whether a value says how slow light was taken away, or that it was not."""
    if value is None:
        return True
    if not isinstance(value, dict) or value.keys() != {"width", "step", "target"}:
        return False
    step, target = value["step"], value["target"]
    whole = all(isinstance(number, int) and not isinstance(number, bool) for number in (step, target))
    return (
        whole
        and _is_name(value["width"])
        and CELL <= step <= _MAX_STEP
        and step & (step - 1) == 0
        and 0 <= target <= GREY_MAX
    )


def _is_formula(value: Any) -> bool:
    """Whether a value holds texts by the names of `BandWords`, of which one is a formula at most."""
    known = {field.name for field in fields(BandWords)}
    texts = isinstance(value, dict) and all(isinstance(text, str) for text in value.values())
    return texts and set(value) <= known and not {"index", "expr"} <= set(value)


def origin_of_header(header: dict[str, Any]) -> Origin:
    """The rasters that a block map was made from."""
    rgb = None if header["rgb"] is None else tuple(header["rgb"])
    words = BandWords(**header.get("formula", {}))
    return Origin(
        tuple(header["rasters"]),
        header["folder"],
        header["band"],
        rgb,
        _nodata_of_header(header["nodata"]),
        words,
        header["collar"],
        flatten["width"] if (flatten := header.get("flatten")) else None,
    )


def _nodata_of_header(value: float | str | None) -> float | str | None:
    """What the user named; a number of an earlier version took the place of the nodata of the files."""
    text = str(value)
    if value is None or text == "none" or text.startswith("only:"):
        return value
    return as_nodata(text.removeprefix(_ALSO) if text.startswith(_ALSO) else f"only:{text}")


def axis_of_header(header: dict[str, Any], stretch: Stretch) -> ValueAxis | None:
    """How v maps to values; unknown in block maps of earlier versions."""
    found = header.get("values")
    if found is None:
        return None
    scale = BandScale.of_tags(found["scale"], found["offset"], found["unit"])
    low, high = (None if end is None else float(end) for end in found["limits"])
    limits = -math.inf if low is None else low, math.inf if high is None else high
    return None if scale is None else ValueAxis(stretch.low, stretch.high, scale, limits)


def header_text(saved: SavedBlocks) -> str:
    """The description of a block map, as `checked_header` takes it."""
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
