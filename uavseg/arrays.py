"""Types of arrays, paths and tables that modules share."""

import os
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

Bools = NDArray[np.bool_]
Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Objects = NDArray[np.object_]
Float32s = NDArray[np.float32]
Uint8s = NDArray[np.uint8]
Uint16s = NDArray[np.uint16]
Uint32s = NDArray[np.uint32]
Path_ = str | os.PathLike[str]
if TYPE_CHECKING:
    from geopandas import GeoDataFrame as GeoDataFrame
else:
    GeoDataFrame = Any  # the name is for type checkers: geopandas takes long to load
