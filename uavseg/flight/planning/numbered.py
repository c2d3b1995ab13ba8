"""Mission files of several flights: survey-1.plan, survey-2.plan, and so on."""

import warnings
from collections.abc import Sequence
from pathlib import Path

from uavseg.flight.formats.files import MissionPath, write_mission
from uavseg.flight.formats.options import FileOptions
from uavseg.flight.mission.mission import Mission
from uavseg.flight.safety.paper_check import PaperCheck
from uavseg.output.transaction import transaction


def flight_paths(path: MissionPath, count: int) -> list[Path]:
    """The file of each flight: the path itself for one.

    Examples
    --------
    >>> [path.name for path in flight_paths("survey.plan", 2)]
    ['survey-1.plan', 'survey-2.plan']
    """
    base = Path(path)
    if count == 1:
        return [base]
    return [base.with_name(f"{base.stem}-{number}{base.suffix}") for number in range(1, count + 1)]


def write_flights(
    missions: Sequence[Mission],
    path: MissionPath,
    check: PaperCheck,
    overwrite: bool = False,
    options: FileOptions | None = None,
) -> list[Path]:
    """Write missions, read each back and fly it on paper; all files appear together, or none.

    Parameters
    ----------
    missions : sequence of Mission
    path : path
        Of the file of a single mission; see `flight_paths`.
    check : PaperCheck
    overwrite : bool
    options : FileOptions, optional

    Returns
    -------
    paths : list of Path

    Raises
    ------
    MissionError
        If the extension is none of a mission, or what was written is not safe.
    OutputError
        If a file exists, or cannot be written.
    """
    paths = flight_paths(path, len(missions))
    how = options or FileOptions()
    other = left_over(path, len(missions))
    with transaction():
        for mission, one in zip(missions, paths, strict=True):
            write_mission(
                mission, one, overwrite, check.check, editable=how.editable, dji_model=how.dji_model
            )
    if other is not None:
        warnings.warn(other, stacklevel=2)
    return paths


def left_over(path: MissionPath, count: int) -> str | None:
    """A note on a file of another plan that looks like one more flight of this one."""
    base = Path(path)
    beyond = base.with_name(f"{base.stem}-{count + 1 if count > 1 else 1}{base.suffix}")
    other = base if count > 1 else beyond
    for file in (beyond, other):
        if file.exists():
            return f"{file} is of another plan; do not fly it with this one"
    return None
