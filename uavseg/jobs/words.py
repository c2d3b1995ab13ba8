"""Words and numbers of both faces, Python and the command line, as values."""

from uavseg.regions.edit.small import Area, parse_area
from uavseg.segmentation.params import SegmentParams


def segment_params(
    method: str, threshold: float, intensity_step: float, refine: str | None = None
) -> SegmentParams:
    """How to segment, from words.

    Raises
    ------
    ParameterError
        If one of them is not allowed.
    """
    return SegmentParams(method, threshold, intensity_step, refine)  # type: ignore[arg-type]


def area(given: float | str | None) -> Area | None:
    """Square metres, or an area as text such as "64px".

    Raises
    ------
    ParameterError
        If it is not an area.
    """
    if given is None:
        return None
    return parse_area(given) if isinstance(given, str) else Area(float(given))
