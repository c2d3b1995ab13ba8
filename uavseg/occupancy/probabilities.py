"""Maps of probabilities: never stretched by what they contain."""

from collections.abc import Sequence
from functools import partial

import numpy as np

from uavseg.errors import RasterError
from uavseg.parallel import Map, serial
from uavseg.raster.dataset import Dataset
from uavseg.raster.tiling import Window


def probability_stretch(dataset: Dataset, windows: Sequence[Window], map: Map = serial) -> str:
    """The stretch that turns a map's values into probabilities: integers by their type, floats as they are.

    Parameters
    ----------
    dataset : Dataset
    windows : sequence of Window
        Cover the dataset.
    map : Map
        Who looks at all values of a map of floats.

    Raises
    ------
    RasterError
        If a valid float lies outside of [0, 1].
    """
    if dataset.dtype.kind != "f":
        return "dtype"
    for strange in map(partial(_outside, dataset), windows):
        if strange is not None:
            raise RasterError(
                f"{dataset.source} holds {strange:g}, and a probability lies in 0..1; "
                "give --stretch if its values are something else"
            )
    return "none"


def _outside(dataset: Dataset, window: Window) -> float | None:
    """A valid value of a window that is no probability."""
    if dataset.is_empty(window):
        return None
    values, valid = dataset.read(window)
    strange = ~((values >= 0) & (values <= 1))
    if valid is not None:
        strange &= valid
    return float(values[strange][0]) if np.any(strange) else None
