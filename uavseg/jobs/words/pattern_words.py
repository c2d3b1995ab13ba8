"""What users say about a pattern, as its parameters: words that do not go with it are refused."""

from dataclasses import dataclass, fields

from uavseg.errors import ParameterError
from uavseg.flight.params.pattern import PARAMS_OF, PatternParams


@dataclass(frozen=True, slots=True)
class PatternWords:
    """What is said about a pattern besides its name; None, or False, where nothing is said.

    Parameters
    ----------
    hold : float, optional
        Seconds over each region, for a visit.
    offset, min_leg : float, optional
        Metres outward from the outline, and the length of the shortest leg, for a perimeter.
    holes : {"skip", "fly"}, optional
        Whether the outlines of holes are flown, for a perimeter.
    margin : float, optional
        Metres around regions, for a survey, corridor or orbit.
    crosshatch : bool
        Whether lines at a right angle are flown too, for a survey.
    turnaround : float, optional
        Metres straight on before and after each line, for a survey.
    """

    hold: float | None = None
    offset: float | None = None
    min_leg: float | None = None
    holes: str | None = None
    margin: float | None = None
    crosshatch: bool = False
    turnaround: float | None = None


_FOR = {
    "hold": ("hold_s", ("visit",)),
    "offset": ("offset_m", ("perimeter",)),
    "min_leg": ("min_leg_m", ("perimeter",)),
    "holes": ("holes", ("perimeter",)),
    "margin": ("margin_m", ("survey", "corridor", "orbit")),
    "crosshatch": ("crosshatch", ("survey",)),
    "turnaround": ("turnaround_m", ("survey",)),
}


def pattern_params(pattern: str, words: PatternWords) -> PatternParams | None:
    """The parameters of a pattern; None for an unknown one, which is refused elsewhere.

    Raises
    ------
    ParameterError
        If a value is out of bounds, or a word is for other patterns.
    """
    if pattern not in PARAMS_OF:
        return None
    given = {one.name: getattr(words, one.name) for one in fields(words)}
    named = {}
    for word, value in given.items():
        if value is None or value is False:
            continue
        name, patterns = _FOR[word]
        if pattern not in patterns:
            option = word.replace("_", "-")
            raise ParameterError(
                f"--{option} is for the pattern {' or '.join(patterns)}, not for {pattern}; leave it out"
            )
        named[name] = value
    params: PatternParams = PARAMS_OF[pattern](**named)
    return params
