"""Types of arrays, and of paths, that modules share."""

import os

import numpy as np
from numpy.typing import NDArray

Bools = NDArray[np.bool_]
Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Path_ = str | os.PathLike[str]
