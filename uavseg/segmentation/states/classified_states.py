"""Result of the classification of pixels into states, with counts by state and by own value."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uavseg.segmentation.states.state_image import StateImage
from uavseg.segmentation.states.thin_structures import ThinObstacles
from uavseg.units import FREE, OCCUPIED, UNKNOWN


@dataclass(frozen=True)
class ClassifiedStates:
    """The states of a raster's pixels.

    Parameters
    ----------
    image : StateImage
    codes : (16,) int64 array
        Number of pixels by code, see `state_scans`.
    thin : ThinObstacles
        Thin obstacles that were restored, or lost.
    noise : float
        Standard deviation of the noise of v.
    trinary : bool
        Whether free, unknown and occupied pixels have one value each.
    """

    image: StateImage
    codes: NDArray[np.int64]
    thin: ThinObstacles
    noise: float
    trinary: bool

    @property
    def pixels(self) -> dict[int, int]:
        """Number of pixels by state: 1 free, 2 unknown, 3 occupied, 0 for all others."""
        counts = {state: int(self.codes[state::4].sum()) for state in (FREE, UNKNOWN, OCCUPIED)}
        rows, cols = self.image.shape
        return {0: rows * cols - sum(counts.values())} | counts

    @property
    def occupied_in_free(self) -> int:
        """Number of pixels in state free whose own v is occupied: possibly thin walls."""
        return int(self.codes[FREE | OCCUPIED << 2])

    @property
    def unknown_in_free(self) -> int:
        """Number of pixels in state free whose own v is unknown."""
        return int(self.codes[FREE | UNKNOWN << 2])

    @property
    def occupied_by_value(self) -> int:
        """Number of pixels whose own v is occupied, in any state."""
        return int(self.codes[OCCUPIED << 2 :].sum())
