"""What is searched for by a sample, and what counts as like it."""

import math
from dataclasses import dataclass

from uavseg.errors import ParameterError
from uavseg.jobs.detail import Length
from uavseg.jobs.result import Drawing
from uavseg.regions.edit.small import Area
from uavseg.regions.sample.place import Disc
from uavseg.units import CELL

WINDOWS = (16, 24, 32, 48, 64, 96, 128)


@dataclass(frozen=True, slots=True)
class MatchRequest:
    """Which sample, and what is like it.

    Parameters
    ----------
    like : Disc or str
        The sample: a disc on the map, or a file of polygons.
    window : int
        Side in pixels of the window whose texture is compared.
    similarity : float
        How like the sample a window must be, above 0 and at most 1, see `Sample.similarity`, and by how much
        the background may explain it better, see `Evidence.least`. A smaller one finds more.
    intensity : float
        By how many of the sample's standard deviations the mean of a window may differ from the sample's;
        infinite for texture alone.
    refine : {"pixel", "none"}
        Whether pixels near boundaries are decided one by one, or regions end at cells of 8 pixels.
    drawing : Drawing
    fill_holes, min_area : Area, optional
        As of `ExtractRequest`.
    bands : tuple of int or str
        Bands whose intensity is compared, each by itself, by number or name; beside texture, they are
        compared as well.
    by : {"texture", "color"}
        What is compared: texture with intensity, or color.
    detail : Length, optional
        As of `ExtractRequest`.

    Raises
    ------
    ParameterError
        If one of them is not allowed.
    """

    like: Disc | str
    window: int = 32
    similarity: float = 0.9
    intensity: float = 1.0
    refine: str = "pixel"
    drawing: Drawing = Drawing()
    fill_holes: Area | None = None
    min_area: Area | None = None
    bands: tuple[int | str, ...] = ()
    by: str = "texture"
    detail: Length | None = None

    def __post_init__(self) -> None:
        if self.window not in WINDOWS:
            known = ", ".join(map(str, WINDOWS))
            raise ParameterError(f"the side of a window is one of {known} pixels, not {self.window}")
        if not 0 < self.similarity <= 1:
            raise ParameterError(f"a similarity is above 0 and at most 1, not {self.similarity:g}")
        if not self.intensity >= 0:
            raise ParameterError(
                f"an intensity is a number of deviations that is not negative, not {self.intensity:g}"
            )
        if self.bands and math.isinf(self.intensity):
            raise ParameterError("an infinite intensity compares texture alone; leave the bands out, or it")
        if self.refine not in ("pixel", "none"):
            raise ParameterError(f"a refinement of matches is pixel or none, not {self.refine!r}")
        if self.by not in ("texture", "color"):
            raise ParameterError(f"regions are compared by texture or color, not {self.by!r}")
        if self.by == "color" and self.chooses_texture:
            raise ParameterError(
                "window, similarity and intensity are of texture, and not of color; leave them out"
            )

    @property
    def chooses_texture(self) -> bool:
        """Whether something is chosen that only the comparison of texture has."""
        return (self.window, self.similarity, self.intensity) != (32, 0.9, 1.0)

    @property
    def side(self) -> int:
        """Of a window, in cells."""
        return self.window // CELL
