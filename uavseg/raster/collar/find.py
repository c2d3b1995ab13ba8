"""Search for the collar of a raster: constant black or white pixels around the picture, not tagged as nodata.

The rule, for bands of 8 or 16 bits without sign and palette; `uavseg.raster.collar.evidence` has the numbers.
A collar

- is exactly 0, or exactly the largest value, in all bands that are used, over gaps of at most two pixels;
- is connected to the edge of the raster, directly or over nodata, and some of it holds a corner: a straight
  side that cuts a rectangle cuts off at least one;
- is more than a sliver: a thousandth of the raster;
- ends in a step to a picture, where ground that is clipped at 0 fades into it and is speckled with it;
- has a border of few long straight lines, or surrounds the picture, which is in one piece; where its border
  is smeared, as by JPEG, it surrounds the picture, because a pale sky has a smeared border too.

Along a collar, and along nodata that holds a corner, pixels that are nearly constant and concentrated there
are what lossy compression and resampling leave: they go with it, within 16 pixels.
"""

import math
from dataclasses import replace
from functools import partial
from typing import TypeVar

from uavseg.errors import ParameterError
from uavseg.raster.grid.tiling import PixelMask, TilePass, Window
from uavseg.raster.read.dataset import Dataset

WORDS = ("auto", "keep")
MIN_SIDE = 64  # pixels; a smaller raster shows too little of a rim
CORNER = 4  # pixels
SLIVER = 1e-3  # share of the raster

AnyDataset = TypeVar("AnyDataset", bound=Dataset)
Corner = tuple[bool, int | None]
"""Whether the pixels at a corner are nodata, and else their constant value, if they have one."""
Found = tuple[PixelMask | None, str]
"""The pixels of a collar, or of the rim of nodata (None: they are kept), and what to say."""


def check_collar(word: str) -> str:
    """Return the word; ParameterError if it is neither "auto" nor "keep"."""
    if word not in WORDS:
        raise ParameterError(f"a collar is treated as auto or keep, not {word!r}")
    return word


def without_collar(dataset: AnyDataset, tile_pass: TilePass) -> AnyDataset:
    """Return the dataset with its collar as nodata, and a warning that says so; unchanged if it has none.

    Where no corner of the raster is constant or nodata, only the corners are read. Of a formula, it is that
    of the bands that it uses. The result depends neither on `tile_pass`, whose executor is used, nor on its
    tiles.
    """
    found = _find_collar(dataset.without_formula(), tile_pass)
    if found is None:
        return dataset
    return replace(dataset, collar=found[0], warnings=(*dataset.warnings, found[1]))


def _find_collar(dataset: Dataset, tile_pass: TilePass) -> Found | None:
    choice = dataset.choice
    in_memory = any(file.driver == "array" for file in dataset.mosaic.files)
    plain = choice.dtype.kind == "u" and choice.dtype.itemsize <= 2 and choice.bits >= 8
    if not plain or choice.expanded or in_memory or min(dataset.geobox.shape) < MIN_SIDE:
        return None
    [corners] = tile_pass.silent.run(partial(_corners, dataset), [_corner_windows(dataset)])
    values = sorted({value for _, value in corners if value is not None})
    for found in (_collar(dataset, value, tile_pass, corners) for value in values):
        if found is not None:
            return found
    return _rim_of_nodata(dataset, tile_pass) if any(is_nodata for is_nodata, _ in corners) else None


def _corner_windows(dataset: Dataset) -> list[Window]:
    rows, cols = dataset.geobox.shape
    return [Window(row, col, CORNER, CORNER) for row in (0, rows - CORNER) for col in (0, cols - CORNER)]


def _corners(dataset: Dataset, windows: list[Window]) -> list[Corner]:
    found: list[Corner] = [(True, None)] * len(windows)
    for k, window in enumerate(windows):
        if not dataset.is_empty(window):
            values, valid = dataset.read(window)
            first = int(values[0, 0, 0])
            constant = bool((values == first).all()) and first in (0, (1 << dataset.bits) - 1)
            found[k] = (False, first if constant else None) if valid is None else (not valid.any(), None)
    return found


def _collar(dataset: Dataset, value: int, tile_pass: TilePass, corners: list[Corner]) -> Found | None:
    """Return the collar of a value; None if what has that value may be ground."""
    from uavseg.raster.collar import evidence, flood

    flooded = flood.flood_from_edges(dataset, value, tile_pass)
    counts = evidence.count_rim(dataset, flooded, value, tile_pass)
    shape, total = dataset.geobox.shape, math.prod(dataset.geobox.shape)
    if counts.inside < SLIVER * total or not counts.shows_picture:
        return None
    mask, added = evidence.grow_over_smear(dataset, flooded, value, counts.smear_limit, tile_pass)
    held = sum(is_nodata or found == value for is_nodata, found in corners)
    core = mask
    if counts.smear_limit >= 0:
        core, _ = evidence.grow_over_smear(dataset, flooded, value, -1, tile_pass)
    rim = evidence.Evidence.of(counts, mask, shape, held, evidence.is_one_piece(core, shape))
    color, share = "black" if value == 0 else "white", (counts.inside + added) / total
    percent = f"{100 * share:.2g} %" if share < 0.1 else f"{100 * share:.0f} %"
    if rim.is_collar:
        note = (
            f"a {color} collar of {percent} of the raster was treated as nodata; "
            '--collar keep (collar="keep") keeps it'
        )
        return mask, note
    if rim.may_be_collar:
        note = (
            f"{color} pixels along the edge, {percent} of the raster, may be a collar or ground; they were "
            f"kept: --nodata {value} (nodata={value}) leaves them out"
        )
        return None, note
    return None


def _rim_of_nodata(dataset: Dataset, tile_pass: TilePass) -> Found | None:
    """Return nodata with the nearly constant pixels along it; None if there are none."""
    from uavseg.raster.collar import evidence, flood

    corners = tile_pass.silent.run(partial(_is_filled_white, dataset), _corner_windows(dataset))
    known = [is_white for is_white in corners if is_white is not None]
    value = (1 << dataset.bits) - 1 if known and all(known) else 0  # what nodata was filled with
    flooded = flood.flood_from_edges(dataset, None, tile_pass)
    counts = evidence.count_rim(dataset, flooded, value, tile_pass)
    if not (counts.shows_picture and counts.is_textured and counts.is_smeared) or counts.is_speckled:
        return None
    mask, pixels = evidence.grow_over_smear(dataset, flooded, value, counts.smear_limit, tile_pass)
    color = "black" if value == 0 else "white"
    note = (
        f"{pixels:,} nearly {color} pixels along nodata were treated as nodata; "
        '--collar keep (collar="keep") keeps them'
    )
    return mask, note


def _is_filled_white(dataset: Dataset, window: Window) -> bool | None:
    """Return whether nodata was filled with the largest value; None if not stored, or not all is nodata."""
    if dataset.is_empty(window):
        return None
    values, valid = dataset.read(window)
    if valid is None or valid.any():
        return None
    return bool((values == (1 << dataset.bits) - 1).all())
