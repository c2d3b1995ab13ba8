"""Block maps as GeoTIFF: leaves as bands to display, the block map in further pages, a JSON header."""

import json
import math
from collections.abc import Callable, Mapping
from dataclasses import asdict, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from uavseg.access import current_policy, is_address
from uavseg.arrays import Path_
from uavseg.dataclass import dataclass
from uavseg.errors import RasterError, RasterReadError, UavsegError
from uavseg.output.targets import check_not_inputs
from uavseg.plain_text import cause_of, shown
from uavseg.raster.access.opening import file_exists
from uavseg.raster.formats.creation import DEFAULT, CreationOptions
from uavseg.raster.formats.geotiff import Page, check_geotiff_name, read_geotiff, write_geotiff_pages
from uavseg.raster.grid.geobox import GeoBox, scaled
from uavseg.raster.intensity.stretch import Stretch
from uavseg.raster.spectral.bands import BandScale, ValueAxis, as_nodata
from uavseg.raster.spectral.formula import BandWords
from uavseg.segmentation.blocks.block_map import BlockMap, find_leaves
from uavseg.segmentation.params.illumination import Illumination
from uavseg.segmentation.params.segment import DivisionParams
from uavseg.units import BLOCK, CELL, CELLS, GREY_MAX

if TYPE_CHECKING:
    from rasterio.io import DatasetReader

_TAG = "UAVSEG_BLOCK_MAP"
_BAND_NAMES = ("mean v", "side of the leaf in pixels")
_RATIO_NAMES = ("R of 64", *(f"R of 32, {k}" for k in range(4)), *(f"R of 16, {k}" for k in range(16)))
_SUMS, _COUNTS, _RATIOS, _ILLUMINATION = 2, 3, 4, 5  # pages of the file
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
    bounds: tuple[float, float, float, float] | None = None  # west, south, east and north of what was read
    aoi: str | None = None  # file of the polygons in which pixels were read
    warp: bool = False  # whether files of other grids were read on that of the first

    def find_rasters(self, beside: Path_) -> list[str] | None:
        """Return the paths of the rasters, in their folder or beside the block map; None if any is gone.

        The last is that of the area of interest, if there is one.
        """
        named = self.rasters if self.aoi is None else (*self.rasters, self.aoi)
        for folder in (Path(self.folder), Path(beside).resolve().parent):
            paths = [name if is_address(name) else str(folder / name) for name in named]
            if all(is_address(path) or file_exists(path) for path in paths):
                return paths
        return None

    def allowed_rasters(self, beside: Path_) -> list[str] | None:
        """Return the paths of `find_rasters`; raise AccessError if the access policy forbids one of them."""
        paths = self.find_rasters(beside)
        for path in paths or ():
            current_policy().check_name(beside, path, Path())
        return paths


@dataclass(frozen=True)
class SavedBlocks:
    """Block map with its georeference, the stretch of its grey, its origin and the axis of its values."""

    blocks: BlockMap
    geobox: GeoBox
    stretch: Stretch
    band_names: str
    origin: Origin
    axis: ValueAxis | None = None
    illumination: Illumination | None = None  # what was subtracted from its grey


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
    text = value.removeprefix("only:").removeprefix(_ALSO) if isinstance(value, str) else value
    return value == "none" or _is_number(value) or _is_number(text)


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
    "bounds": ("bounds are", lambda value: _is_list(value, _is_finite) and len(value) == 4),
    "aoi": ("area of interest is", _is_name),
    "warp": ("warping is", lambda value: value is True),
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
        bounds=tuple(header["bounds"]) if "bounds" in header else None,
        aoi=header.get("aoi"),
        warp="warp" in header,
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
    (rows, cols), stretch, origin = saved.geobox.shape, saved.stretch, saved.origin
    nodata = f"{_ALSO}{origin.nodata!r}" if isinstance(origin.nodata, float) else origin.nodata
    header: dict[str, Any] = {"rows": rows, "cols": cols, "low": stretch.low, "high": stretch.high}
    header |= {"stretch": stretch.name, "bands": saved.band_names, "rasters": list(origin.rasters)}
    header |= {"folder": origin.folder, "band": origin.band, "rgb": origin.rgb, "nodata": nodata}
    if origin.collar != "keep":
        header["collar"] = origin.collar
    part = {"bounds": origin.bounds, "aoi": origin.aoi, "warp": origin.warp or None}
    header |= {name: value for name, value in part.items() if value is not None}
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


def is_block_map(file: "DatasetReader") -> bool:
    """Test whether an open raster is a block map, and not any other raster."""
    return _TAG in file.tags()


def rasters_of(path: Path_, tags: Mapping[str, str]) -> list[str]:
    """Return the paths of the rasters that a block map of these tags was made from; none for other files."""
    if _TAG not in tags:
        return []
    try:
        header = json.loads(tags[_TAG])
        origin = Origin(tuple(header["rasters"]), header["folder"], aoi=header.get("aoi"))
        return origin.find_rasters(path) or []
    except (UavsegError, KeyError, ValueError, TypeError):
        return []  # the error is reported when the file is opened


def check_block_map_name(path: Path_) -> None:
    """Refuse a file name that a block map cannot have, with OutputError, before the work starts."""
    check_geotiff_name(path, "a block map")


def write_block_map(
    path: Path_,
    saved: SavedBlocks,
    division: DivisionParams,
    overwrite: bool = False,
    creation: CreationOptions = DEFAULT,
) -> None:
    """Write a block map; a pixel of the file is a cell of 8 x 8 pixels.

    The bands that a viewer displays are the mean v and the side of each leaf, for the X and tau of
    `division`. Further pages hold the block map itself: sums and counts of the cells, and R of all blocks
    with a pixel for each block of 64. `creation` is how integers, which most of the file holds, are stored.
    An OutputExistsError or OutputError says that the file exists, is not named .tif, cannot be written, or is
    one of the rasters that the block map was made from.
    """
    check_block_map_name(path)
    check_not_inputs([path], saved.origin.find_rasters(path) or [])
    blocks, cells = saved.blocks, saved.geobox.coarsen(CELL)
    side, mean = find_leaves(blocks, division)
    bands = [np.where(mean < 0, np.nan, mean).astype(np.float32), side.astype(np.float32)]
    pages = [
        Page([_crop(band, cells) for band in bands], cells, _BAND_NAMES, nodata=float("nan")),
        Page([_crop(blocks.sums, cells)], cells, ["sum of grey"]),
        Page([_crop(blocks.counts, cells)], cells, ["valid pixels"]),
        Page(list(blocks.ratios.transpose(2, 0, 1)), saved.geobox.coarsen(CELL * CELLS), _RATIO_NAMES),
    ]
    if (flat := saved.illumination) is not None:
        light = ["light that was taken away, in grey"]
        pages.append(Page([flat.nodes], saved.geobox.coarsen(flat.step), light))
    write_geotiff_pages(path, pages, {_TAG: header_text(saved)}, overwrite, creation)


def _crop(band: NDArray[Any], cells: GeoBox) -> NDArray[Any]:
    return band[: cells.shape[0], : cells.shape[1]]


def read_block_map(path: Path_) -> SavedBlocks:
    """Read a block map from its GeoTIFF; raise RasterReadError or RasterError if it is not one."""
    _, cells, _, tags = read_geotiff(path)
    try:
        header = checked_header(json.loads(tags[_TAG]))
        shape = (header["rows"], header["cols"])
        geobox = GeoBox(shape, scaled(cells.transform, 1 / CELL, 1 / CELL), cells.crs)
        if min(shape) < 1 or cells.shape != tuple(-(-length // CELL) for length in shape):
            raise ValueError(f"{cells.shape} cells do not cover {shape} pixels")
        in_blocks = (-(-shape[0] // BLOCK), -(-shape[1] // BLOCK))
        sums = _read_page(path, _SUMS, cells.shape, 1, np.uint32)[0]
        counts = _read_page(path, _COUNTS, cells.shape, 1, np.uint8)[0]
        ratios = _read_page(path, _RATIOS, in_blocks, len(_RATIO_NAMES), np.float64)
        if (counts > CELL * CELL).any() or (sums > counts.astype(np.uint32) * GREY_MAX).any():
            raise ValueError("its cells hold more than pixels can")
        blocks = BlockMap.empty(shape)
        blocks.sums[: cells.shape[0], : cells.shape[1]] = sums
        blocks.counts[: cells.shape[0], : cells.shape[1]] = counts
        blocks.ratios[:] = ratios.transpose(1, 2, 0)
        illumination, flat = None, header.get("flatten")
        if flat is not None:
            squares = (-(-shape[0] // flat["step"]), -(-shape[1] // flat["step"]))
            nodes = _read_page(path, _ILLUMINATION, squares, 1, np.uint16)[0]
            illumination = Illumination(nodes, flat["step"], flat["target"])
    except (KeyError, ValueError, RecursionError, RasterReadError) as error:
        raise RasterError(
            f"{path} is not a block map that this version reads ({cause_of(error)}); make it again with "
            "uavseg divide"
        ) from error
    stretch = Stretch(header["low"], header["high"], header["stretch"])
    origin, axis = origin_of_header(header), axis_of_header(header, stretch)
    return SavedBlocks(blocks, geobox, stretch, header["bands"], origin, axis, illumination)


def _read_page(path: Path_, page: int, shape: tuple[int, int], bands: int, dtype: Any) -> NDArray[Any]:
    content = read_geotiff(path, page, shape, bands)[0]
    if content.dtype != dtype:
        raise ValueError(f"page {page} is of {content.dtype}, not of {np.dtype(dtype)}")
    return content
