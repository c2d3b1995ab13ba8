"""What is searched for by a sample, and what counts as like it."""

import math
from collections.abc import Callable
from typing import Literal

from uavseg.dataclass import dataclass
from uavseg.errors import ParameterError
from uavseg.jobs.result.result import RegionRequest
from uavseg.regions.confidence import check_minimum
from uavseg.regions.edit.small import Area
from uavseg.regions.sample.place import Disc

WINDOWS = (16, 24, 32, 48, 64, 96, 128)
Ask = Callable[[Disc], bool | Literal["skip"] | None]
"""A disc -> whether it is wanted, "skip" for another place, None for no more questions."""
ANSWERS = {1: "the whole kind", 2: "what touches the sample", 3: "finer kinds"}


@dataclass(frozen=True, slots=True)
class MatchRequest(RegionRequest):
    """Which sample, and what is like it.

    A window is like the sample by its `similarity`, above 0 and at most 1, see `Sample.similarity`, and by
    how much the background may explain it better, see `Evidence.least`; a smaller one finds more. By default
    color is compared, with texture where that clearly parts what has the color; or texture, where color
    hardly parts the sample from the rest of the raster, or one of window, similarity and intensity is chosen.
    Sizes are as of `ExtractRequest`. A ParameterError says that a parameter is not allowed.
    """

    like: Disc | str | tuple[Disc | str, ...]  # str: a file of polygons; several are compared by color
    window: int | None = None  # side in pixels; by default 32, or less where the sample is too small
    similarity: float = 0.9
    intensity: float = 1.0  # standard deviations by which means may differ; infinite: texture alone
    refine: str = "pixel"  # or "none": regions end at cells of 8 pixels
    fill_holes: Area | None = None
    bands: tuple[int | str, ...] = ()  # by number or name, each compared by itself; beside texture too
    by: str = "auto"  # "auto", "color", or "texture" with intensity
    unlike: tuple[Disc | str, ...] = ()  # what is not wanted; compared by color
    answer: int = 1  # the whole kind; 2 what touches the samples, of finer kinds; 3 finer kinds; by color

    def __post_init__(self) -> None:
        check_minimum(self.min_confidence, self.refine)
        if len(self.samples) == 0:
            raise ParameterError("a sample is needed, of what is wanted")
        if not self.is_one and self.texture_alone:
            raise ParameterError(
                "texture is compared with one sample; several, and those of what is unlike, are compared by "
                "color: leave out the words of texture, or all samples but one"
            )
        if self.window is not None and self.window not in WINDOWS:
            known = ", ".join(map(str, WINDOWS))
            raise ParameterError(f"the side of a window is one of {known} pixels, not {self.window}")
        if not 0 < self.similarity <= 1:
            raise ParameterError(f"a similarity is above 0 and at most 1, not {self.similarity:g}")
        if not self.intensity >= 0:
            why = "an intensity is a number of deviations that is not negative"
            raise ParameterError(f"{why}, not {self.intensity:g}")
        if self.bands and math.isinf(self.intensity):
            raise ParameterError("an infinite intensity compares texture alone; leave the bands out, or it")
        if self.refine not in ("pixel", "none"):
            raise ParameterError(f"a refinement of matches is pixel or none, not {self.refine!r}")
        if self.by not in ("auto", "color", "texture"):
            raise ParameterError(f"regions are compared by auto, color or texture, not {self.by!r}")
        if self.answer not in ANSWERS:
            raise ParameterError(f"an answer is 1, 2 or 3, not {self.answer}")
        if self.answer != 1 and self.texture_alone:
            raise ParameterError("texture has one answer; leave out the answer, or the words of texture")
        if self.by == "color" and self.chooses_texture:
            why = "window, similarity and intensity are of texture, and not of color"
            raise ParameterError(f"{why}; leave them out")

    @property
    def chooses_texture(self) -> bool:
        """Whether something is chosen that only the comparison of texture has."""
        return (self.window, self.similarity, self.intensity) != (None, 0.9, 1.0)

    @property
    def samples(self) -> tuple[Disc | str, ...]:
        """The samples of what is wanted."""
        return self.like if isinstance(self.like, tuple) else (self.like,)

    @property
    def is_one(self) -> bool:
        """Whether there is one sample, of what is wanted."""
        return len(self.samples) == 1 and not self.unlike

    @property
    def texture_alone(self) -> bool:
        """Whether color is not looked at."""
        return self.by == "texture" or (self.by == "auto" and self.chooses_texture)
